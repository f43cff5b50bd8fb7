"""The design of the baseline: its length, its attitude, and its length under vibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures import maps, style, sweeps
from vinsar.foundations import variables
from vinsar.radar import geometry, instrument, speckle
from vinsar.study import config

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.study.pipeline import Products

    Floats = NDArray[np.floating]

# Lengths whose spread is within this share of the best one's are as good: chance decides there.
_AS_GOOD = 0.1
_BEST_COLOUR = "#dcebdd"


def _log_x(axes: Axes, limits: tuple[float, float]) -> None:
    axes.set_xscale("log")
    axes.set_xlim(*limits)
    sweeps.log_axis(axes.xaxis, limits)


def _log_y(axes: Axes, limits: tuple[float, float]) -> None:
    axes.set_yscale("log")
    axes.set_ylim(*limits)
    sweeps.log_axis(axes.yaxis, limits)


@style.styled
def draw_length(products: Products, study: config.Study) -> Figure:
    """Draw the spread of the height against the length of the baseline.

    Parameters
    ----------
    products
        ``sweeps/baseline_length``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    name = "baseline_length"
    sweep = variables.swept(products[f"sweeps/{name}"], "radar_baseline_m")
    sweep = sweep.sortby("radar_baseline_m")
    length = sweep["radar_baseline_m"].values
    radar = config.swept_section(study, name, "radar")
    place = instrument.middle(config.swept_section(study, name, "scene"))
    quarter = float(instrument.Instrument.planned(radar).critical_baseline(*place)) / 4
    planned = [
        instrument.Instrument.planned(radar.model_copy(update={"baseline_m": float(value)}))
        for value in length
    ]
    ambiguity = np.array([float(part.height_of_ambiguity(*place)) for part in planned])
    theory = np.array([float(part.geometric_coherence(*place)) for part in planned])
    height = 88.0
    figure = style.new_figure(style.TWO_COLUMNS_MM, height)
    left, bottom, width, tall = 13.0, 24.0, 88.0, 58.0
    limits = sweeps.around(length, [quarter], low=0.85, high=1.18)

    axes = style.place(figure, left, bottom, width, tall)
    count = sweeps.looks(study, name)
    found, _, _ = sweeps.spread(sweep["coherence"])
    bounds = {
        f"bound, {source}, {count:.1f} looks": (
            ambiguity / (2 * np.pi) * speckle.phase_std(coherence, count)
        )
        for source, coherence in (("level ground", theory), ("measured coherence", found))
    }
    spreads = _spreads(axes, sweep, length)
    curves, _ = axes.get_legend_handles_labels()
    styles: list[Any] = ["--", ":"]
    lines = [
        axes.plot(length, 100 * values, color=style.GREY, linestyle=line, label=label)[0]
        for (label, values), line in zip(bounds.items(), styles, strict=True)
    ]
    _log_x(axes, limits)
    _log_y(axes, sweeps.around(spreads, *(100 * values for values in bounds.values())))
    best = _best(axes, sweep, length)
    axes.set_xlabel("baseline B (m)")
    axes.set_ylabel("height error (cm)")
    axes.set_title("(a) spread of the height error")
    mark = _mark(axes, quarter)

    tops, small = (56.0, 24.0), 26.0
    right, narrow = 121.0, 56.0
    upper = style.place(figure, right, tops[0], narrow, small)
    upper.plot(length, ambiguity, color=style.INK)
    _log_x(upper, limits)
    _log_y(upper, sweeps.around(ambiguity, low=0.8, high=1.25))
    upper.tick_params(labelbottom=False)
    upper.set_ylabel("height (m)")
    upper.set_title("(b) height of ambiguity")
    lower = style.place(figure, right, tops[1], narrow, small)
    sweeps.curve(
        lower,
        length,
        sweep["coherence"],
        sweeps.Look("measured", style.BLUE, (0, (4, 1.5)), "s"),
    )
    level = lower.plot(length, theory, color=style.GREY, linestyle="--")
    _log_x(lower, limits)
    lower.set_ylim(0, 1.05)
    lower.yaxis.set_major_locator(style.round_ticks(5))
    lower.set_xlabel("baseline B (m)")
    lower.set_ylabel("coherence (1)")
    lower.set_title("(c) coherence, visible ground")
    lower.legend(
        handles=[lower.lines[0], *level],
        labels=["measured", "level ground"],
        loc="lower left",
    )
    for panel in (upper, lower):
        _mark(panel, quarter)
    sweeps.legend(figure, [*curves, *lines, mark, *best, sweeps.band_patch()], left, 2.0, 3)
    return figure


def _spreads(axes: Axes, sweep: xr.Dataset, at: Floats) -> Floats:
    """Draw the three spreads of the height error, cm, and return their ends."""
    parts = (
        (sweep["std"].sel(region="whole_scene"), sweeps.WHOLE, 100.0),
        (sweep["std"].sel(region="visible_ground"), sweeps.VISIBLE, 100.0),
        (sweep["mad"].sel(region="visible_ground"), sweeps.CORE, 100.0 * sweeps.NORMAL),
    )
    for data, look, scale in parts:
        sweeps.curve(axes, at, data, look, scale=scale)
    return np.concatenate([np.ravel(scale * data.values) for data, _, scale in parts])


def best_lengths(sweep: xr.Dataset) -> tuple[float, float, float]:
    """Return the baseline of the least spread, and the ends of the range that is as good.

    Parameters
    ----------
    sweep
        Product ``sweep`` over ``radar.baseline_m`` alone, rising.

    Returns
    -------
    tuple of float
        The length of the least mean std over the whole scene, m; then the shortest and the longest
        around it whose std exceeds that by a tenth at most, without a worse one between.
    """
    length = sweep["radar_baseline_m"].values
    mean, _, _ = sweeps.spread(sweep["std"].sel(region="whole_scene"))
    least = int(np.nanargmin(mean))
    good = mean <= (1 + _AS_GOOD) * mean[least]
    first = last = least
    while first > 0 and good[first - 1]:
        first -= 1
    while last < len(mean) - 1 and good[last + 1]:
        last += 1
    return float(length[least]), float(length[first]), float(length[last])


def _best(axes: Axes, sweep: xr.Dataset, length: Floats) -> list[Any]:
    at, shortest, longest = best_lengths(sweep)
    mean, _, _ = sweeps.spread(sweep["std"].sel(region="whole_scene"))
    least = 100 * float(mean[np.flatnonzero(length == at)[0]])
    star = axes.plot(
        at,
        least,
        marker="*",
        markersize=9,
        color=style.INK,
        linestyle="none",
        zorder=6,
        label=f"least: {least:.2f} cm at {at:g} m",
    )
    area = axes.axvspan(
        shortest / 1.03,
        longest * 1.03,
        color=_BEST_COLOUR,
        linewidth=0,
        zorder=0,
        label=f"within {100 * _AS_GOOD:g} % of it: {shortest:g} … {longest:g} m",
    )
    return [*star, area]


def _mark(axes: Axes, quarter: float) -> Any:
    return axes.axvline(
        quarter,
        color=style.GREY,
        linewidth=0.8,
        linestyle=(0, (1, 1)),
        zorder=1,
        label=f"$B_{{crit}}/4$ = {quarter:.2f} m",
    )


@style.styled
def draw_angle(products: Products, study: config.Study) -> Figure:
    """Draw what errors of the baseline do to the height, by its attitude.

    Parameters
    ----------
    products
        ``baseline_angle``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    product = products["baseline_angle"]
    beta = np.rad2deg(product["baseline_angle"].values)
    antenna, _ = instrument.Instrument.planned(study.radar).separated
    look = float(np.rad2deg(geometry.look_angle(antenna, *instrument.middle(study.scene))))
    figure = style.new_figure(style.TWO_COLUMNS_MM, 71.0)
    bottom, tall = 16.5, 48.0
    length, angle = float(product["length_error"]), np.rad2deg(float(product["angle_error"]))
    drawn: dict[str, Any] = {
        "color": style.INK,
        "linestyle": "none",
        "marker": "o",
        "markersize": 2.6,
    }
    drawn |= {"markerfacecolor": "none", "markeredgewidth": 0.6, "label": "drawn, exact inversion"}

    axes = style.place(figure, 13.0, bottom, 76.0, tall)
    curves = {
        "length_exact": (style.BLUE, "-", "exact derivative"),
        "length_eq5": (style.ORANGE, "--", "Eq. 5"),
    }
    for name, (colour, line, label) in curves.items():
        axes.plot(beta, 1000 * product[name].values, color=colour, linestyle=line, label=label)
    markers = axes.plot(beta, 1000 * product["length_drawn"].values, **drawn)
    limits = sweeps.around(1000 * product["length_drawn"].values, low=0.6, high=1.6)
    _log_y(axes, limits)
    axes.set_title(f"(a) error of the length, std {1000 * length:g} mm")
    axes.set_ylabel("height std (mm)")
    handles, _ = axes.get_legend_handles_labels()

    flat = style.place(figure, 101.0, bottom, 75.0, tall)
    line12 = flat.plot(
        beta,
        1000 * product["angle_eq12"].values,
        color=style.ORANGE,
        linestyle=(0, (4, 1.2, 1, 1.2)),
        label="Eq. 12",
    )
    flat.plot(beta, 1000 * product["angle_drawn"].values, **drawn)
    top = 1000 * max(float(product["angle_drawn"].max()), float(product["angle_eq12"].max()))
    flat.set_ylim(0, 1.3 * top)
    flat.yaxis.set_major_locator(style.round_ticks(6))
    flat.set_title(f"(b) error of the attitude, std {angle:.2g}°")
    for panel in (axes, flat):
        panel.set_xlim(beta[0], beta[-1])
        panel.set_xticks(np.arange(0, 91, 15))
        panel.set_xlabel(r"attitude $\beta$ of the baseline, 90 is vertical (deg)")
        mark = panel.axvline(
            look,
            color=style.GREY,
            linewidth=0.8,
            linestyle=":",
            zorder=0.5,
            label=rf"$\beta = \theta$ = {look:.2f}°",
        )
    order = [markers[0], *(handle for handle in handles if handle is not markers[0])]
    sweeps.legend(figure, [*order, line12[0], mark], 13.0, 2.5, 5)
    return figure


_CONTOURS_CM = (3, 5, 10, 20, 50)
_MODES = {"common": "errors common to both antennas", "independent": "independent errors"}


@style.styled
def draw_vibration(products: Products, study: config.Study) -> Figure:
    """Draw the spread of the height over the length of the baseline and the vibration.

    Parameters
    ----------
    products
        ``sweeps/baseline_vibration``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    sweep = variables.swept(
        products["sweeps/baseline_vibration"],
        "motion_channels",
        "radar_baseline_m",
        "motion_level_wavelengths",
    ).sortby(["radar_baseline_m", "motion_level_wavelengths"])
    axis = config.swept_section(study, "baseline_vibration", "motion").axis
    modes = [mode for mode in _MODES if mode in sweep["motion_channels"].values]
    part = (
        sweep["std"]
        .sel(region="whole_scene")
        .transpose("motion_channels", "radar_baseline_m", "motion_level_wavelengths", "realization")
    )
    fields = {m: 100 * sweeps.spread(part.sel(motion_channels=m))[0] for m in modes}
    limits = sweeps.around(*fields.values(), low=1, high=1.0001)
    figure = style.new_figure(style.TWO_COLUMNS_MM, 74.0)
    for number, (mode, left) in enumerate(zip(modes, (13.0, 90.0), strict=False)):
        axes = style.place(figure, left, 13.0, 70.0, 54.0)
        image = _heat(axes, part, fields[mode], limits)
        axes.set_title(f"({'ab'[number]}) {_MODES[mode]}, along {axis}")
        axes.set_xlabel("level: std of the error (wavelengths)")
        axes.tick_params(labelleft=number == 0)
        if number == 0:
            axes.set_ylabel("baseline B (m)")
    bar = maps.colorbar(axes, image, "height std, whole scene (cm)")
    sweeps.log_axis(bar.ax.yaxis, limits)
    return figure


def _heat(axes: Axes, part: xr.DataArray, field: Floats, limits: tuple[float, float]) -> Any:
    """Draw a field as even cells, whatever the steps between the values, with its contours."""
    from matplotlib import patheffects
    from matplotlib.colors import LogNorm

    rows, columns = field.shape
    image = axes.pcolormesh(
        np.arange(columns + 1) - 0.5,
        np.arange(rows + 1) - 0.5,
        field,
        norm=LogNorm(*limits),
        cmap=style.colormap("cmc.batlow"),
        rasterized=True,
    )
    inside = [level for level in _CONTOURS_CM if np.nanmin(field) < level < np.nanmax(field)]
    if inside and min(field.shape) > 1:
        casing: list[Any] = [patheffects.withStroke(linewidth=1.6, foreground="black")]
        lines = axes.contour(field, levels=inside, colors="white", linewidths=0.8)
        lines.set_path_effects(casing)
        texts = axes.clabel(lines, fmt="%g cm", fontsize=style.points(7), inline_spacing=3)
        for text in texts:
            text.set_path_effects(casing)
    names = ("motion_level_wavelengths", "radar_baseline_m")
    for axis, name in zip((axes.xaxis, axes.yaxis), names, strict=True):
        values = part[name].values
        axis.set_ticks(np.arange(values.size), [f"{value:g}" for value in values])
    return image
