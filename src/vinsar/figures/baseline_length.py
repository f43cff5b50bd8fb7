"""The spread of the height against the length of the baseline."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps
from vinsar.foundations import variables
from vinsar.foundations.configuration import swept_section
from vinsar.foundations.constants import NORMAL_PER_MAD
from vinsar.radar import instrument

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

# Lengths whose spread is within this share of the best one's are as good: chance decides there.
_AS_GOOD = 0.1
_BEST_COLOUR = "#dcebdd"


@style.styled
def draw(products: Products, study: Study) -> Figure:
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
    radar = swept_section(study, name, "radar")
    place = instrument.middle(swept_section(study, name, "scene"))
    quarter = float(instrument.Instrument.planned(radar).critical_baseline(*place)) / 4
    planned = [instrument.Instrument.planned(radar.with_baseline(float(value))) for value in length]
    ambiguity = np.array([float(part.height_of_ambiguity(*place)) for part in planned])
    theory = np.array([float(part.geometric_coherence(*place)) for part in planned])
    height = 92.0
    figure = style.new_figure(style.TWO_COLUMNS_MM, height)
    left, bottom, width, tall = 13.0, 28.0, 88.0, 58.0
    limits = sweeps.around(length, [quarter], low=0.85, high=1.18)

    axes = style.place(figure, left, bottom, width, tall)
    found, _, _ = sweeps.spread(sweep["coherence"])
    sources = {"level ground": theory, "measured coherence": found}
    # Standard deviation and bound (case, 2) by the coherence that they follow from.
    heights = {
        source: (ambiguity / (2 * np.pi))[:, None]
        * [
            np.ravel(sweeps.phase_std(study, name, part, value))
            for part, value in zip(planned, coherence, strict=True)
        ]
        for source, coherence in sources.items()
    }
    expected = {f"predicted, {source}": values[:, 0] for source, values in heights.items()}
    bound = heights["level ground"][:, 1]
    spreads = _spreads(axes, sweep, length)
    curves, _ = axes.get_legend_handles_labels()
    styles: list[Any] = ["--", ":"]
    lines = [
        axes.plot(length, 100 * values, color=style.GREY, linestyle=line, label=label)[0]
        for (label, values), line in zip(expected.items(), styles, strict=True)
    ]
    lines.append(sweeps.draw_bound(axes, length, 100 * bound))
    sweeps.log_x(axes, limits)
    sweeps.log_y(
        axes, sweeps.around(spreads, 100 * bound, *(100 * values for values in expected.values()))
    )
    best = _best(axes, sweep, length)
    axes.set_xlabel("baseline B (m)")
    axes.set_ylabel("height error (cm)")
    axes.set_title("(a) spread of the height error")
    mark = _mark(axes, quarter)

    tops, small = (60.0, 28.0), 26.0
    right, narrow = 121.0, 56.0
    upper = style.place(figure, right, tops[0], narrow, small)
    upper.plot(length, ambiguity, color=style.INK)
    sweeps.log_x(upper, limits)
    sweeps.log_y(upper, sweeps.around(ambiguity, low=0.8, high=1.25))
    upper.tick_params(labelbottom=False)
    upper.set_ylabel("height (m)")
    upper.set_title("(b) height of ambiguity")
    lower = style.place(figure, right, tops[1], narrow, small)
    sweeps.curve(
        lower,
        length,
        sweep["coherence"],
        sweeps.Look("measured", style.BLUE, style.DASHED, "s"),
    )
    level = lower.plot(length, theory, color=style.GREY, linestyle="--")
    sweeps.log_x(lower, limits)
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
        (sweep["mad"].sel(region="visible_ground"), sweeps.CORE, 100.0 * NORMAL_PER_MAD),
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


def numbers(products: Products, study: Study) -> str:
    """Return the best length of the baseline, as a sentence."""
    del study
    sweep = variables.swept(products["sweeps/baseline_length"], "radar_baseline_m")
    sweep = sweep.sortby("radar_baseline_m")
    best, shortest, longest = best_lengths(sweep)
    part = sweep["std"].sel(region="whole_scene", radar_baseline_m=best)
    least = 100 * float(sweeps.spread(part)[0])
    text = f"The least spread over the whole scene, {least:.2f} cm, is that of {best:g} m"
    if longest > shortest:
        text += f"; from {shortest:g} to {longest:g} m it is at most a tenth larger"
    return f"{text}."


FIGURES = {
    "baseline_length": declaration.Figure(
        draw=draw,
        title="Length of the baseline",
        caption=(
            "Height error against the length of the baseline: standard deviation over the "
            "whole scene and on visible ground, and 1.48 median absolute deviations, which "
            "leave out the cells that unwrapped to another cycle. The prediction is the noise "
            "that the looks of the phase filter leave, once with the coherence of level ground "
            "and once with the one measured."
        ),
        sections=("figures", "radar", "scene", "imaging", "filtering", "sweeps"),
        sweeps=("baseline_length",),
        numbers=numbers,
    ),
}
