"""The antenna arrangements side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps
from vinsar.prediction import systems

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

_REGIONS = (
    ("visible_ground", sweeps.Look("visible ground", style.BLUE, "none", "o")),
    ("whole_scene", sweeps.Look("whole scene", style.ORANGE, "none", "s")),
)
_ROW_MM = 6.5


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw resolution, height of ambiguity, accuracy and scan time of each arrangement.

    Parameters
    ----------
    products
        ``sweeps/systems``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    found = systems.compare(products[f"sweeps/{systems.SWEEP}"], study)
    height = _ROW_MM * len(found)
    figure = style.new_figure(style.TWO_COLUMNS_MM, height + 27)
    titles = (
        "(a) resolution in x",
        "(b) height of ambiguity",
        "(c) height error",
        "(d) scan time",
    )
    panels: list[Axes] = []
    for left, title in zip((30.0, 69.0, 108.0, 147.0), titles, strict=True):
        axes = style.place(figure, left, 17, 30, height)
        axes.set_title(title)
        axes.set_ylim(len(found) - 0.5, -0.5)
        axes.set_yticks(range(len(found)), [system.name for system in found])
        axes.tick_params(left=False, labelleft=not panels)
        axes.set_axisbelow(True)
        axes.grid(axis="y")
        panels.append(axes)
    across = [100 * system.resolution_m[0] for system in found]
    _bars(panels[0], across, "{:.1f}", "at the scene's middle (cm)")
    ambiguity = [system.height_of_ambiguity_m for system in found]
    _bars(panels[1], ambiguity, "{:.2f}", "at the scene's middle (m)")
    for region, look in _REGIONS:
        for row, system in enumerate(found):
            values = 100 * system.accuracy["std"].sel(region=region).values
            mean = float(values.mean())
            low, high = np.percentile(values, (10, 90))
            panels[2].plot([low, high], [row, row], color=look.colour, alpha=0.4, linewidth=2.5)
            panels[2].plot(
                mean,
                row,
                color=look.colour,
                linestyle="none",
                marker=look.marker,
                markerfacecolor="white",
                label=None if row else look.label,
            )
    panels[2].set_xlim(left=0)
    panels[2].xaxis.set_major_locator(style.round_ticks(5))
    panels[2].set_xlabel("standard deviation (cm)")
    _bars(panels[3], [1000 * s.scan_time_s for s in found], "{:.0f}", "ms (logarithmic)", log=True)
    handles, _ = panels[2].get_legend_handles_labels()
    sweeps.legend(figure, [*handles, sweeps.band_patch()], 69.0, 1.5, 3)
    return figure


def _bars(axes: Axes, values: list[float], form: str, label: str, *, log: bool = False) -> None:
    from matplotlib.ticker import LogLocator

    rows = np.arange(len(values))
    largest = max(values)
    if log:
        low = 10.0 ** np.floor(np.log10(min(values)))
        axes.set_xscale("log")
        axes.set_xlim(low, largest * (largest / low) ** 0.4)
        axes.xaxis.set_major_locator(LogLocator(numticks=9))
    else:
        low = 0.0
        axes.set_xlim(0, 1.45 * largest)
        axes.xaxis.set_major_locator(style.round_ticks(4))
    axes.barh(rows, np.array(values) - low, left=low, height=0.5, color=style.BLUE, alpha=0.8)
    for row, value in zip(rows, values, strict=True):
        axes.annotate(
            form.format(value), (value, row), (3, 0), textcoords="offset points", va="center"
        )
    axes.set_xlabel(label)


FIGURES = {
    "systems": declaration.Figure(
        draw=draw,
        title="The rail beside switched arrays",
        caption=(
            "Each arrangement of antennas: resolution along x and height of ambiguity at the "
            "scene's middle on the ground, standard deviation of the height error, and time for "
            "a scan."
        ),
        sections=("figures", "radar", "scene", "vehicle", "sweeps"),
        sweeps=(systems.SWEEP,),
    ),
}
