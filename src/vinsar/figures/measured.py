"""The chain from the images to the height, without any truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vinsar.figures.chain import PANELS, Panel, withheld
from vinsar.figures.drawing import declaration, maps, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

_TITLE_MM = 7.0


def _coherence(products: Products, study: Study) -> maps.Layer:
    del study
    return maps.Layer(
        products["interferogram"]["coherence"], style.colormap("gray"), (0.0, 1.0), "coherence"
    )


_SHOWN: tuple[Panel, ...] = (
    PANELS["c"],
    PANELS["d"],
    Panel("coherence", "interferogram", _coherence),
    PANELS["e"],
    PANELS["g"],
    PANELS["h"],
)
INPUTS: tuple[str, ...] = tuple(dict.fromkeys(panel.product for panel in _SHOWN))


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the chain from the images to the height, without any truth.

    Parameters
    ----------
    products
        Those of `INPUTS`.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    left, bottom, pitch, width = 12.5, 10.0, 56.0, 38.0
    _, height = maps.fit(products["dem"]["height"], width, 60)
    figure = style.new_figure(style.TWO_COLUMNS_MM, bottom + 2 * (height + _TITLE_MM))
    for place, panel in enumerate(_SHOWN):
        row, column = divmod(place, 3)
        box = left + column * pitch, bottom + (1 - row) * (height + _TITLE_MM), width, height
        axes = maps.draw_layer(
            figure,
            box,
            panel.layer(products, study),
            f"({'abcdef'[place]}) {panel.title}",
            label_x=row == 1,
            label_y=column == 0,
        )
        if panel is PANELS["h"]:
            maps.hatch(axes, withheld(products["dem"]))
    return figure


FIGURES = {
    "measured": declaration.Figure(
        draw=draw,
        title="From images to height",
        caption=(
            "The chain without truth: the two images, their coherence, raw and unwrapped "
            "phase, and the reconstructed height."
        ),
        sections=("figures",),
        inputs=INPUTS,
    ),
}
