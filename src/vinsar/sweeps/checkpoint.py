"""Finished cases of a sweep on disk, so that an interrupted one goes on from them."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


class Checkpoint:
    """Rows appended to a file, a line a block; a line that was cut short is not read.

    Parameters
    ----------
    path
        The file.
    code
        Digest of the code that computes the rows; rows of other code are not read.
    """

    def __init__(self, path: str | Path, code: str) -> None:
        self.path, self.code = Path(path), code

    def rows(self) -> dict[str, dict[str, Any]]:
        """Return the rows of finished cases by the cases' keys."""
        found: dict[str, dict[str, Any]] = {}
        if not self.path.exists():
            return found
        # A power cut may leave any bytes.
        with self.path.open(encoding="utf-8", errors="replace") as file:
            for line in file:
                try:
                    block = json.loads(line)
                except json.JSONDecodeError:
                    continue
                if isinstance(block, dict) and block.get("code") == self.code:
                    found |= block["rows"]
        return found

    def keep(self, rows: Mapping[str, Any]) -> None:
        """Append a block's rows; they are on disk when this returns.

        Parameters
        ----------
        rows
            Rows by the cases' keys, in plain values.

        Raises
        ------
        OSError
            If they cannot be written, as on a full disk; none of them is kept then.
        """
        if not rows:
            return
        # Begins a line of its own, whatever an interrupted write has left before.
        text = "\n" + json.dumps({"code": self.code, "rows": rows}) + "\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            # Unbuffered and at once: what others append comes before or after, not between.
            with self.path.open("ab", buffering=0) as file:
                data = memoryview(text.encode())
                while data:
                    data = data[file.write(data) :]
                os.fsync(file.fileno())
        except OSError as error:
            raise OSError(f"cannot write {self.path}: {error.strerror or error}") from error

    def remove(self) -> None:
        """Forget the rows: the sweep is whole."""
        self.path.unlink(missing_ok=True)
