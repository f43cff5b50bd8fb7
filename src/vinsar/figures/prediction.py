"""The design sheet as curves, and its predictions against what sweeps measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures import style, sweeps
from vinsar.foundations import variables
from vinsar.foundations.constants import AXES
from vinsar.prediction import design
from vinsar.study import config

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.study.pipeline import Products

    Floats = NDArray[np.floating]

_ROWS = 61
_LEVELS = np.geomspace(4e-3, 1.0, 61)
_DASHED, _DOTTED, _BROKEN = (0, (4, 1.5)), (0, (1, 1.2)), (0, (4, 1.2, 1, 1.2))
_SNR_DB = ((20.0, _DASHED), (10.0, _BROKEN), (0.0, _DOTTED))
_OF_AXES = (
    ("along x (the rail)", style.BLUE, "-"),
    ("along y (ahead)", style.ORANGE, _DASHED),
    ("along z (up)", style.INK, _BROKEN),
)
_LEFTS, _BOTTOMS, _WIDTH, _TALL = (13.0, 105.0), (75.0, 12.0), 71.0, 46.0


@style.styled
def draw_sheet(products: Products, study: config.Study) -> Figure:
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
    axes.plot(y, ahead, color=style.ORANGE, linestyle=_DASHED, label="along y (ahead)")
    axes.axhline(
        100 * sheet.study.imaging.grid_spacing_m, color=style.GREY, linestyle=":", label="pixel"
    )
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
        axes.plot(y, shadow, color=style.ORANGE, linestyle=_DASHED, label="shadow it casts")
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
    for level, line in _SNR_DB:
        if level != own:
            parts = {name: getattr(study, name) for name in design.SECTIONS}
            other = _changed(parts, echo={"snr_db": level})
            curves.append(100 * other.height_std(y))
            axes.plot(y, curves[-1], color=style.BLUE, linestyle=line, label=f"SNR {level:g} dB")
    limit = _limit(axes, sheet)
    _log(axes, (0.7 * min(limit, *(c.min() for c in curves)), 3 * max(c.max() for c in curves)))
    axes.set_ylabel("height std (cm)")
    axes.set_title("(c) height noise on visible ground")
    axes.legend(loc="upper left", ncols=2)


def _scatter(axes: Axes, sheet: design.Sheet) -> None:
    highest = 0.0
    for axis, (label, colour, line) in enumerate(_OF_AXES):
        std = [
            100 * sheet.scene_height_std(axis, level * sheet.instrument.wavelength)
            for level in _LEVELS
        ]
        axes.plot(_LEVELS, std, color=colour, linestyle=line, label=label)
        highest = max(highest, *std)
    limit = _limit(axes, sheet)
    least = 100 * sheet.scene_height_std()
    limits = float(_LEVELS[0]), float(_LEVELS[-1])
    axes.set_xscale("log")
    axes.set_xlim(*limits)
    sweeps.log_axis(axes.xaxis, limits)
    _log(axes, (0.7 * min(limit, least), 3 * max(limit, highest)))
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


def _log(axes: Axes, limits: tuple[float, float]) -> None:
    axes.set_yscale("log")
    axes.set_ylim(*limits)
    sweeps.log_axis(axes.yaxis, limits)


@style.styled
def draw_check(products: Products, study: config.Study) -> Figure:
    """Draw the height noise that sweeps measured against what was predicted.

    Parameters
    ----------
    products
        ``sweeps/snr``, ``sweeps/baseline_length`` and ``sweeps/vibration``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure = style.new_figure(style.ONE_COLUMN_MM, 103.0)
    axes = style.place(figure, 13.0, 28.0, 69.0, 69.0)
    handles: list[Any] = []
    everything: list[Floats] = []
    for label, (predicted, measured), colour, marker in (
        ("signal-to-noise ratio", _by_noise(products, study), style.BLUE, "o"),
        ("length of the baseline", _by_baseline(products, study), style.ORANGE, "s"),
        *(
            (f"position errors along {name}", found, colour, "^v>"[AXES.index(name)])
            for name, found, colour in _by_errors(products, study)
        ),
    ):
        handles += axes.plot(
            100 * predicted,
            100 * measured,
            color=colour,
            linestyle="none",
            marker=marker,
            markersize=3.5,
            markerfacecolor="white",
            markeredgewidth=0.8,
            label=label,
        )
        everything += [100 * predicted, 100 * measured]
    limits = sweeps.around(*everything)
    line = np.array(limits)
    handles += axes.plot(line, line, color=style.GREY, linewidth=0.8, label="equal")
    for factor, name in ((2.5, "factor of 2.5"), (0.4, "")):
        drawn = axes.plot(
            line, factor * line, color=style.GREY, linestyle=":", linewidth=0.8, label=name
        )
        handles += drawn if name else []
    axes.set_xscale("log")
    axes.set_xlim(*limits)
    sweeps.log_axis(axes.xaxis, limits)
    _log(axes, limits)
    axes.set_xlabel("predicted height std (cm)")
    axes.set_ylabel("measured, 1.48 MAD on visible ground (cm)")
    axes.set_title("Predicted and measured height noise")
    sweeps.legend(figure, handles, 8.0, 2.0, 2)
    return figure


def _sheet(study: config.Study, sweep: str, **changes: dict[str, Any]) -> design.Sheet:
    parts = {name: config.swept_section(study, sweep, name) for name in design.SECTIONS}
    return _changed(parts, **changes)


def _changed(parts: dict[str, Any], **changes: dict[str, Any]) -> design.Sheet:
    changed = {name: parts[name].model_copy(update=values) for name, values in changes.items()}
    return design.Sheet(config.Study.model_construct(**(parts | changed)))


def _spread(sweep: Any) -> Floats:
    measured = sweep["mad"].sel(region="visible_ground").mean("realization")
    return np.asarray(sweeps.NORMAL * measured.values)


def _by_noise(products: Products, study: config.Study) -> tuple[Floats, Floats]:
    sweep = variables.swept(products["sweeps/snr"], "echo_snr_db")
    levels = [None if np.isnan(v) else float(v) for v in sweep["echo_snr_db"].values]
    predicted = [_sheet(study, "snr", echo={"snr_db": v}).scene_height_std() for v in levels]
    return np.array(predicted), _spread(sweep)


def _by_baseline(products: Products, study: config.Study) -> tuple[Floats, Floats]:
    sweep = variables.swept(products["sweeps/baseline_length"], "radar_baseline_m")
    predicted = [
        _sheet(study, "baseline_length", radar={"baseline_m": float(length)}).scene_height_std()
        for length in sweep["radar_baseline_m"].values
    ]
    return np.array(predicted), _spread(sweep)


def _by_errors(
    products: Products, study: config.Study
) -> list[tuple[str, tuple[Floats, Floats], str]]:
    keys = ("motion_channels", "motion_axis", "motion_level_wavelengths")
    sweep = variables.swept(products["sweeps/vibration"], *keys)
    sheet = _sheet(study, "vibration")
    found = []
    for axis, (name, (_, colour, _)) in enumerate(zip(AXES, _OF_AXES, strict=True)):
        if (
            not {"independent"} <= set(sweep["motion_channels"].values)
            or name not in sweep["motion_axis"]
        ):
            continue
        part = sweep.sel(motion_channels="independent", motion_axis=name)
        predicted = [
            sheet.scene_height_std(axis, float(level) * sheet.instrument.wavelength)
            for level in part["motion_level_wavelengths"].values
        ]
        found.append((name, (np.array(predicted), _spread(part)), colour))
    return found
