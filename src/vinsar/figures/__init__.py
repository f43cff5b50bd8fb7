"""The figures of the paper, drawn from the products of the chain.

`FIGURES` is the one description of them; `save` writes one to files. Figures may read the truth,
which the processing never does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from vinsar.figures import acquisition, chain, height_error, registration_error
from vinsar.figures.files import save
from vinsar.figures.style import colormap

if TYPE_CHECKING:
    from collections.abc import Callable

    import matplotlib.figure

    from vinsar import config
    from vinsar.pipeline import Products

__all__ = ["FIGURES", "Figure", "colormap", "save"]


@dataclass(frozen=True)
class Figure:
    """A figure of the paper.

    Attributes
    ----------
    draw
        From the products and the study to the figure.
    inputs
        Products that it reads, keys of `vinsar.pipeline.STAGES`.
    sections
        Parts of the configuration that it reads, and no others.
    """

    draw: Callable[[Products, config.Study], matplotlib.figure.Figure]
    inputs: tuple[str, ...]
    sections: tuple[str, ...]


FIGURES: dict[str, Figure] = {
    "fig1": Figure(acquisition.draw, (), ("figures", "radar", "scene", "imaging")),
    "fig2": Figure(registration_error.draw, ("registration",), ("figures",)),
    "fig3": Figure(chain.draw_sheet, chain.SHEET_INPUTS, ("figures",)),
    **{
        f"fig3{letter}": Figure(
            partial(chain.draw_single, letter), chain.panel_inputs(letter), ("figures",)
        )
        for letter in chain.PANELS
    },
    "fig4": Figure(height_error.draw, ("accuracy",), ("figures",)),
}
"""The figures by name, in the paper's order."""
