"""Faults of a configuration: what is wrong, where, and what is allowed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from vinsar.foundations.text import printable

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True)
class Fault:
    """A key that is wrong.

    Attributes
    ----------
    key
        Path of the key, such as ``radar.baseline_m``.
    value
        What it holds, if it exists.
    allowed
        What would be right.
    """

    key: str
    value: Any
    allowed: str

    def __str__(self) -> str:
        value = "" if self.value is None else f" = {self.value!r}"
        return printable(f"{self.key}{value}: {self.allowed}")


class ConfigurationError(ValueError):
    """A configuration with faults.

    Attributes
    ----------
    faults
        All that were found.
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        count = len(self.faults)
        lines = "".join(f"\n  {fault}" for fault in self.faults)
        super().__init__(f"The configuration has {count} fault{'s' * (count > 1)}:{lines}")
