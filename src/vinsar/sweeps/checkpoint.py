"""Finished cases of a sweep on disk, so that an interrupted one goes on from them."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

logger = logging.getLogger(__name__)


class Checkpoint:
    """Rows appended to a file, a line a block, each with a digest of its own.

    A line that was cut short, or whose bytes are not those that were written, is not read.

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
        with self.path.open("rb") as file:
            for number, line in enumerate(file, 1):
                if not line.strip():
                    continue
                digest, _, text = line.rstrip(b"\n").partition(b" ")
                if digest != _digest(text):
                    logger.warning(
                        "line %d of %s is not as it was written; its cases are computed again",
                        number,
                        self.path,
                    )
                    continue
                block = json.loads(text)
                if block["code"] == self.code:
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
        text = json.dumps({"code": self.code, "rows": rows}).encode()
        line = b"\n" + _digest(text) + b" " + text + b"\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            # Unbuffered and at once: what others append comes before or after, not between.
            with self.path.open("ab", buffering=0) as file:
                data = memoryview(line)
                while data:
                    data = data[file.write(data) :]
                os.fsync(file.fileno())
        except OSError as error:
            raise OSError(f"cannot write {self.path}: {error.strerror or error}") from error

    def remove(self) -> None:
        """Forget the rows: the sweep is whole."""
        self.path.unlink(missing_ok=True)


def _digest(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest().encode()
