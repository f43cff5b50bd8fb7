"""How a module of this wing declares its figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import matplotlib.figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure: what it reads, how it is drawn, and what is written below it.

    Attributes
    ----------
    draw
        From the products and the study to the figure.
    title
        What the report calls it.
    caption
        What it shows, as reStructuredText on any number of lines.
    sections
        Parts of the configuration that it reads, and no others.
    inputs
        Products that it reads, keys of `vinsar.study.pipeline.STAGES`.
    sweeps
        Sweeps that it reads; `draw` finds each among the products as ``sweeps/<name>``.
    numbers
        From the same products and study to a sentence with the figure's own numbers, which the
        report adds to the caption.
    sheet
        The figure of which it is one panel: a report that has the sheet leaves the panel out, and
        all panels of a sheet are drawn together.
    """

    draw: Callable[[Products, Study], matplotlib.figure.Figure]
    title: str
    caption: str
    sections: tuple[str, ...]
    inputs: tuple[str, ...] = ()
    sweeps: tuple[str, ...] = ()
    numbers: Callable[[Products, Study], str] | None = None
    sheet: str = ""

    @property
    def reads(self) -> tuple[str, ...]:
        """All that it reads, under the names by which `draw` finds it among the products."""
        return (*self.inputs, *(f"sweeps/{name}" for name in self.sweeps))
