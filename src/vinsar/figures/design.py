"""The design sheet as curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps
from vinsar.foundations.configuration import Study
from vinsar.prediction import design
from vinsar.radar import grid
from vinsar.study.composition import StudyModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

_ROWS = 61
_LEVELS = np.geomspace(4e-3, 1.0, 61)
_SNR_DB = ((20.0, style.DASHED), (10.0, style.DASH_DOTTED), (0.0, style.DOTTED))
OF_AXES = (
    ("along x (the rail)", style.BLUE, "-"),
    ("along y (ahead)", style.ORANGE, style.DASHED),
    ("along z (up)", style.INK, style.DASH_DOTTED),
)
"""How curves for the three axes are called and drawn."""

_LEFTS, _BOTTOMS, _WIDTH, _TALL = (13.0, 105.0), (75.0, 12.0), 71.0, 46.0


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw what a configuration will do, without having run it.

    Parameters
    ----------
    products
        Nothing.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del products
    sheet = design.Sheet(study)
    y = np.linspace(study.imaging.y_min_m, study.imaging.y_max_m, _ROWS)
    figure = style.new_figure(style.TWO_COLUMNS_MM, 127.0)
    panels = [
        style.place(figure, left, bottom, _WIDTH, _TALL) for bottom in _BOTTOMS for left in _LEFTS
    ]
    _resolutions(panels[0], sheet, y)
    _heights(panels[1], sheet, y)
    _noise(panels[2], sheet, y)
    _scatter(panels[3], sheet)
    for axes in panels[:3]:
        axes.set_xlim(y[0], y[-1])
        axes.set_xlabel("distance ahead y (m)")
        axes.xaxis.set_major_locator(style.round_ticks(7))
    return figure


def _resolutions(axes: Axes, sheet: design.Sheet, y: Floats) -> None:
    across, ahead = 100 * sheet.instrument.resolution(sheet.x, y)
    axes.plot(y, across, color=style.BLUE, label="along x (the rail)")
    axes.plot(y, ahead, color=style.ORANGE, linestyle=style.DASHED, label="along y (ahead)")
    side = grid.pixel_side(sheet.study.imaging)
    axes.axhline(100 * side, color=style.GREY, linestyle=":", label="pixel")
    axes.set_ylim(0, 1.45 * max(across.max(), ahead.max()))
    axes.yaxis.set_major_locator(style.round_ticks(6))
    axes.set_ylabel("resolution (cm)")
    axes.set_title("(a) resolution on the ground")
    axes.legend(loc="upper left", ncols=2)


def _heights(axes: Axes, sheet: design.Sheet, y: Floats) -> None:
    cycle = sheet.instrument.height_of_ambiguity(sheet.x, y)
    shadow = sheet.shadow_length(y)
    relief = sheet.relief
    axes.plot(y, cycle, color=style.BLUE, label="height of ambiguity")
    values = [cycle.max(), relief]
    if np.isfinite(shadow).all():
        axes.plot(y, shadow, color=style.ORANGE, linestyle=style.DASHED, label="shadow it casts")
        values.append(shadow.max())
    axes.axhline(relief, color=style.GREY, linestyle=":", label=f"relief, {relief:g} m")
    axes.set_ylim(0, 1.45 * max(values))
    axes.yaxis.set_major_locator(style.round_ticks(6))
    axes.set_ylabel("height, length (m)")
    axes.set_title("(b) height of ambiguity, and shadow")
    axes.legend(loc="upper left", ncols=2)


def _noise(axes: Axes, sheet: design.Sheet, y: Floats) -> None:
    study = sheet.study
    own = study.echo.snr_db
    label = "without noise" if own is None else f"as configured, {own:g} dB"
    curves = [100 * sheet.height_std(y)]
    axes.plot(y, curves[0], color=style.INK, label=label)
    curves.append(100 * sheet.height_bound(y))
    sweeps.draw_bound(axes, y, curves[-1])
    for level, line in _SNR_DB:
        if level != own:
            parts = {name: getattr(study, name) for name in design.SECTIONS}
            other = changed(parts, echo={"snr_db": level})
            curves.append(100 * other.height_std(y))
            axes.plot(y, curves[-1], color=style.BLUE, linestyle=line, label=f"SNR {level:g} dB")
    limit = _limit(axes, sheet)
    sweeps.log_y(
        axes, (0.7 * min(limit, *(c.min() for c in curves)), 3 * max(c.max() for c in curves))
    )
    axes.set_ylabel("height std (cm)")
    axes.set_title("(c) height noise on visible ground")
    axes.legend(loc="upper left", ncols=2)


def _scatter(axes: Axes, sheet: design.Sheet) -> None:
    highest = 0.0
    for axis, (label, colour, line) in enumerate(OF_AXES):
        std = [
            100 * sheet.scene_height_std(axis, level * sheet.instrument.wavelength)
            for level in _LEVELS
        ]
        axes.plot(_LEVELS, std, color=colour, linestyle=line, label=label)
        highest = max(highest, *std)
    limit = _limit(axes, sheet)
    least = 100 * sheet.scene_height_std()
    limits = float(_LEVELS[0]), float(_LEVELS[-1])
    sweeps.log_x(axes, limits)
    sweeps.log_y(axes, (0.7 * min(limit, least), 3 * max(limit, highest)))
    axes.set_xlabel("std of the position error (wavelengths)")
    axes.set_ylabel("height std (cm)")
    axes.set_title("(d) position errors of each antenna")
    axes.legend(loc="upper left", ncols=2)


def _limit(axes: Axes, sheet: design.Sheet) -> float:
    tolerance = 100 * sheet.study.accuracy.tolerance_m
    limit = tolerance / design.OF_95_PERCENT
    axes.axhline(
        limit,
        color=style.GREY,
        linestyle="--",
        linewidth=0.8,
        label=f"95 % within {tolerance:g} cm",
    )
    return limit


def changed(parts: dict[str, Any], **changes: dict[str, Any]) -> design.Sheet:
    """Return the design sheet of some sections of a study, with other values in some of them."""
    changed = {name: parts[name].model_copy(update=values) for name, values in changes.items()}
    return design.Sheet(StudyModel.model_construct(**(parts | changed)))


FIGURES = {
    "design": declaration.Figure(
        draw=draw,
        title="Design sheet",
        caption=(
            "Predicted from the configuration alone: resolution on the ground, height of "
            "ambiguity and shadow, height noise of level ground for the looks of the phase "
            "filter, and the noise under white position errors of each antenna."
        ),
        sections=("figures", *design.SECTIONS),
    ),
}
