"""Boxes as two and as three antennas report them, beside the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.chain import withheld
from vinsar.figures.drawing import declaration, maps, style, sweeps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

_MAP_MM, _TALL_MM = 40.0, 52.0
_LEAST_RANGE_M = 0.05
_COLOURS, _MARKERS = (style.ORANGE, style.BLUE), ("s", "o")


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the true heights, those by two and by more antennas, and the boxes' tops.

    Parameters
    ----------
    products
        ``dem``, ``truth``, ``two_antennas``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    truth, found = products["truth"]["height"], products["two_antennas"]
    top = max(_LEAST_RANGE_M, float(np.nanmax(truth)))
    limits = (-100 * top, 100 * top)
    colours = style.colormap(study.figures.height_colormap, "figures.height_colormap")
    _, tall = maps.fit(truth, _MAP_MM, _TALL_MM)
    below = 52.0
    figure = style.new_figure(style.TWO_COLUMNS_MM, below + 12 + tall + 7)
    shown = [(truth, "(a) true height")] + [
        (found["height"][place], f"({letter}) height by {_count(count)} antennas")
        for place, (letter, count) in enumerate(
            zip("bc", found["antenna_count"].values, strict=True)
        )
    ]
    for place, (data, title) in enumerate(shown):
        box = (13.0 + 54 * place, below + 12, _MAP_MM, tall)
        axes = maps.place(figure, data, box, title)
        image = maps.draw(axes, 100 * data, colormap=colours, limits=limits, label_y=place == 0)
        if place == 0:
            _number(axes, study)
        if place == len(shown) - 1:
            maps.hatch(axes, withheld(products["dem"]))
            ends = maps.beyond(np.stack([part.values for part, _ in shown]), (-top, top))
            maps.colorbar(axes, image, "height (cm)", extend=ends)
    style.write_title(figure, 13.0, below - 7, "(d) height of the objects, true and reported")
    _tops(style.place(figure, 13.0, 11.0, 108.0, below - 18), products)
    handles, _ = figure.axes[-1].get_legend_handles_labels()
    sweeps.legend(figure, handles, 127.0, 24.0, 1)
    return figure


def _number(axes: Axes, study: Study) -> None:
    """Write the number of each object beside it."""
    for number, part in enumerate(study.scene.objects, 1):
        axes.annotate(
            str(number),
            (part.x_m, part.y_m),
            ha="center",
            va="center",
            fontsize=style.points(style.STYLE["axes.labelsize"]),
        )


def _tops(axes: Axes, products: Products) -> None:
    """Draw each object's true height as a bar and the reported ones as marks."""
    found = products["two_antennas"]
    places = np.arange(found.sizes["object"])
    true = 100 * found["true_top_height"].values
    axes.bar(places, true, width=0.7, color="#d9dcdf", label="true")
    for number, count in enumerate(found["antenna_count"].values):
        axes.plot(
            places,
            100 * found["top_height"].values[number],
            linestyle="none",
            marker=_MARKERS[number],
            color=_COLOURS[number],
            label=f"by {_count(count)} antennas",
        )
    axes.axhline(0, color=style.GREY, linewidth=0.5)
    axes.set_xticks(places, [str(number + 1) for number in places])
    axes.set_xlabel("object of the scene")
    axes.set_ylabel("height (cm)")


def _count(number: int) -> str:
    names = {2: "two", 3: "three", 4: "four", 5: "five"}
    return names.get(int(number), str(number))


def numbers(products: Products, study: Study) -> str:
    """Return the figure's own numbers for its caption."""
    del study
    found = products["two_antennas"]
    wrong = (found["top_wrong"] > 0.5).sum("object").values
    known = int(found["top_wrong"].notnull().all("antenna_count").sum())
    ground = 100 * found["ground_wrong"].values
    fewer, more = (_count(count) for count in found["antenna_count"].values)
    return (
        f"Most of the top has a wrong cycle on {wrong[0]} of {known} objects by {fewer} antennas "
        f"and on {wrong[1]} by {more}; of the visible ground beside them {ground[0]:.1f} % and "
        f"{ground[1]:.1f} % have."
    )


FIGURES = {
    "three_antennas": declaration.Figure(
        draw=draw,
        title="Heights by further antennas",
        caption=(
            "Objects taller than half the longest baseline's height of ambiguity: true height, "
            "height by the lower and the upper antenna alone, unwrapped, and by all antennas, "
            "whose shorter baselines settle the cycle. Below, the median height of each object's "
            "visible ground, in the order of the scene. What is not delivered by all antennas is "
            "hatched; heights by two have no class of their own."
        ),
        sections=("figures", "scene"),
        inputs=("dem", "truth", "two_antennas"),
        numbers=numbers,
    ),
}
