"""The vehicle moves during the scan: turned apertures, focus and height, and the speed sensor."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps
from vinsar.foundations import variables
from vinsar.radar import motion, trajectory, waveform
from vinsar.simulation import scene

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

_SPEED, _DURATION = "vehicle_forward_speed_m_per_s", "vehicle_scan_duration_s"
_CORRECTION, _ERROR = "vehicle_speed_correction", "vehicle_speed_error_m_per_s"
_REGION = "visible_ground"
_TOLERATED = 1.1
_DRAWS, _LEVELS = 11, 15

_LOOKS = {
    "none": sweeps.Look("not corrected", style.ORANGE, style.DASHED, "s"),
    "exact": sweeps.Look("true speed", style.BLUE, "-", "o"),
    "sensor": sweeps.Look("speed sensor", style.INK, style.DASH_DOTTED, "^"),
}
_TWO_SCANS = (style.DASHED, "D"), (style.DASH_DOTTED, "v")
_HEIGHT_MM = 108.0
_BOTTOM, _TALL, _LOW, _HIGH = 29.0, 72.0, 32.0, 69.0
# Heights of (d) and, below its x axis, of (e).
_SENSOR_MM, _TOLD_MM = 33.0, 25.0
# Share of the power that the bounds take as incoherent: relief and sidelobes of range.
_INCOHERENT = 1 / 20
# Speeds of which the bounds are taken.
_BOUNDS = 6
_LEFTS = (10.0, 50.0, 94.0, 141.0)
_WIDTHS = (27.0, 32.0, 32.0, 36.0)


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the turned aperture, and focus and height against speed and against its error.

    Parameters
    ----------
    products
        ``sweeps/speed``, ``sweeps/speed_error``, ``sweeps/echoes``, ``sweeps/next_scan``,
        ``terrain`` and ``truth``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    speed = variables.swept(products["sweeps/speed"], _DURATION, _CORRECTION, _SPEED)
    error = variables.swept(products["sweeps/speed_error"], _DURATION, _ERROR)
    speed, error = speed.sortby(_SPEED), error.sortby([_DURATION, _ERROR])
    durations = sorted((float(value) for value in speed[_DURATION].values), reverse=True)
    seen = ~products["truth"]["shadow"].values
    relief = float(products["truth"]["height"].values[seen].std())
    figure = style.new_figure(style.TWO_COLUMNS_MM, _HEIGHT_MM)
    _plan(
        style.place(figure, _LEFTS[0], _BOTTOM, _WIDTHS[0], _TALL), study, speed[_SPEED].values,
        durations,
    )  # fmt: skip
    std = speed["std"].sel(region=_REGION)
    limits = sweeps.around(100 * std.values, 100 * error["std"].sel(region=_REGION).values)
    limits = limits[0], max(limits[1], 130 * relief)
    handles: list[Any] = []
    for number, (duration, left, width) in enumerate(
        zip(durations[:2], _LEFTS[1:3], _WIDTHS[1:3], strict=False)
    ):
        upper = style.place(figure, left, _HIGH, width, _LOW)
        _focus(upper, speed.sel({_DURATION: duration}))
        upper.set_title(f"({'bc'[number]}) scan of {_time(duration)}")
        lower = style.place(figure, left, _BOTTOM, width, _LOW)
        for name, look in _corrections(speed):
            at = std.sel({_DURATION: duration, _CORRECTION: name})
            sweeps.curve(lower, speed[_SPEED].values, at, look, scale=100)
        handles, _ = lower.get_legend_handles_labels()
        handles.append(_level(lower, relief))
        sweeps.log_y(lower, limits)
        lower.set_xlabel("forward speed (m/s)")
        if number == 0:
            upper.set_ylabel("amplitude (1)")
            lower.set_ylabel("height error, std (cm)")
    axes = style.place(figure, _LEFTS[3], _BOTTOM + _TALL - _SENSOR_MM, _WIDTHS[3], _SENSOR_MM)
    keys, tolerated = _sensor(axes, error, products, study)
    looks = _looks(study, durations)
    echoes = variables.swept(products["sweeps/echoes"], _ERROR).sortby(_ERROR)
    both = variables.swept(products["sweeps/next_scan"], _DURATION, _ERROR).sortby(_ERROR)
    _corrected(axes, echoes, looks[0])
    for duration, look in zip(durations, looks[1:], strict=False):
        if duration in both[_DURATION].values:
            _corrected(axes, both.sel({_DURATION: duration}), look)
    _level(axes, relief)
    sweeps.log_y(axes, limits)
    lower = style.place(figure, _LEFTS[3], _BOTTOM, _WIDTHS[3], _TOLD_MM)
    _told(lower, speed[_SPEED].values, study, durations, looks, tolerated)
    handles += [*_keys(), *(_key(look) for look in looks)]
    sweeps.legend(figure, handles, _LEFTS[0], 2.0, 3)
    sweeps.legend(figure, keys, _LEFTS[3] - 13.0, 2.0, 1)
    return figure


def _looks(study: Study, durations: list[float]) -> list[sweeps.Look]:
    """Return how the echoes' corrections look: of one scan, then of two by duration."""
    own = _time(trajectory.scan_duration(study.radar, study.vehicle))
    return [
        sweeps.Look(f"(d, e) one scan, {own}", style.ORANGE, "-", "s"),
        *(
            sweeps.Look(f"(d, e) two scans, {_time(duration)}", style.ORANGE, line, marker)
            for duration, (line, marker) in zip(durations, _TWO_SCANS, strict=False)
        ),
    ]


def _key(look: sweeps.Look) -> Any:
    from matplotlib.lines import Line2D

    return Line2D(
        [], [], color=look.colour, linestyle=look.line, marker=look.marker, markersize=3,
        markerfacecolor="white", markeredgewidth=0.8, label=look.label,
    )  # fmt: skip


def _time(duration: float) -> str:
    return f"{duration:g} s" if duration >= 0.1 else f"{1000 * duration:g} ms"


def _corrections(speed: xr.Dataset) -> list[tuple[str, sweeps.Look]]:
    return [(name, look) for name, look in _LOOKS.items() if name in speed[_CORRECTION].values]


def _keys() -> list[Any]:
    from matplotlib.lines import Line2D

    return [
        sweeps.band_patch(),
        Line2D([], [], color=style.INK, linewidth=0.7, linestyle=":",
               label="(b, c) where its image lies"),
        Line2D([], [], color=style.GREY, linewidth=2.2, label="(d) predicted (in brackets)"),
    ]  # fmt: skip


def _level(axes: Axes, relief: float) -> Any:
    return axes.axhline(
        100 * relief,
        label=f"level DEM: {100 * relief:.1f} cm",
        color=style.GREY,
        linestyle="--",
        linewidth=0.9,
        zorder=0.5,
    )


def _plan(axes: Axes, study: Study, speeds: Floats, durations: list[float]) -> None:
    """Draw apertures, image, and where the image lies uncorrected, seen from above."""
    from matplotlib.patches import Polygon, Rectangle

    part, length = study.imaging, study.radar.aperture_length_m
    low, high = np.array([part.x_min_m, part.y_min_m]), np.array([part.x_max_m, part.y_max_m])
    axes.add_patch(Rectangle((low[0], low[1]), *(high - low), facecolor="#e3e6e8", linewidth=0))
    middle = (low + high) / 2
    axes.text(middle[0], middle[1], "image", ha="center", va="center", color="#55595d")
    top = float(speeds.max())
    shown = [float(speeds[np.abs(speeds - share * top).argmin()]) for share in (0.0, 0.5, 1.0)]
    for speed in shown:
        slope = float(motion.slope(speed, aperture_length_m=length, duration_s=durations[0]))
        x = np.array([-0.5, 0.5]) * length
        axes.plot(x, slope * x, color=style.BLUE, linewidth=1.4)
        axes.annotate(
            f"{speed:g} m/s", (x[1], slope * x[1]), (2, 0), textcoords="offset points",
            va="center", color=style.BLUE, fontsize=style.points(6.5),
        )  # fmt: skip
    slope = float(motion.slope(shown[1], aperture_length_m=length, duration_s=durations[-1]))
    edge, zero = np.linspace(0, 1, 21)[:-1], np.zeros(20)
    sides = (edge, zero), (1 + zero, edge), (1 - edge, 1 + zero), (zero, 1 - edge)
    outline = low + np.concatenate([np.stack(side, -1) for side in sides]) * (high - low)
    moved = np.stack(motion.imaged_place(*outline.T, true_slope=slope, told_slope=0.0), -1)
    axes.add_patch(
        Polygon(moved, fill=False, edgecolor=style.ORANGE, linewidth=0.9, linestyle=style.DASHED)
    )
    # Metres are as long along y as along x.
    x_limits = low[0] - 0.6, max(high[0], float(moved[:, 0].max())) + 0.6
    tall = (x_limits[1] - x_limits[0]) * _TALL / _WIDTHS[0]
    axes.set_xlim(*x_limits)
    axes.set_ylim(high[1] + 1.0 - tall, high[1] + 1.0)
    axes.text(
        sum(x_limits) / 2,
        low[1] - 1.0,
        f"not corrected:\n{shown[1]:g} m/s, {_time(durations[-1])}",
        ha="center",
        va="top",
        color=style.ORANGE,
        fontsize=style.points(6.5),
    )
    axes.xaxis.set_major_locator(style.round_ticks(3))
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y, ahead (m)")
    axes.set_title(f"(a) apertures, {_time(durations[0])}")


def _focus(axes: Axes, speed: xr.Dataset) -> None:
    # Both antennas stand on one cart and lose focus alike.
    at = speed[_SPEED].values
    for name, look in _corrections(speed):
        part = speed.sel({_CORRECTION: name}).mean("channel")
        sweeps.curve(axes, at, part["point_gain"], look)
        peak, _, _ = sweeps.spread(part["peak_gain"])
        axes.plot(at, peak, color=look.colour, linestyle=":", linewidth=0.9)
    axes.set_ylim(0, 1.08)
    axes.yaxis.set_major_locator(style.round_ticks(5))
    axes.tick_params(labelbottom=False)


def predicted_std(
    terrain: xr.Dataset, truth: xr.Dataset, *, true_slope: float, told_slope: float, floor_m: float
) -> float:
    """Return the spread of the height error that a wrong speed makes on visible ground, m.

    The image shows at each place the height of another (`motion.imaged_place`): to the error-free
    variance comes that of the difference.

    Parameters
    ----------
    terrain, truth
        Products of these names.
    true_slope, told_slope
        Of the true speed and of the one that focusing assumes (`motion.slope`).
    floor_m
        Error-free standard deviation, m.

    Returns
    -------
    float
        Standard deviation, m; NaN where the image shows none of the ground.
    """
    x, y = np.meshgrid(truth["x"].values, truth["y"].values)
    # Swapped: the ground that is imaged at a place of the grid.
    ground = motion.imaged_place(x, y, true_slope=told_slope, told_slope=true_slope)
    error = scene.sample(terrain["height"], *ground) - truth["height"].values
    inside = np.isfinite(ground[0]) & ~truth["shadow"].values
    return float(np.hypot(floor_m, error[inside].std())) if inside.any() else float("nan")


def _sensor(
    axes: Axes, error: xr.Dataset, products: Products, study: Study
) -> tuple[list[Any], list[float]]:
    """Draw the spread of the height against the sensor's error; return keys and what suffices."""
    from matplotlib.ticker import FixedLocator
    from scipy.stats import norm

    keys: list[Any] = axes.plot([], [], linestyle="", label="(d) a tenth more at an error of")
    tolerated = []
    levels = error[_ERROR].values
    positive = levels[levels > 0]
    draws = norm.ppf((np.arange(_DRAWS) + 0.5) / _DRAWS)
    fine = np.concatenate([[0.0], np.geomspace(positive.min(), positive.max(), _LEVELS)])
    speed = study.vehicle.forward_speed_m_per_s
    looks = (
        sweeps.Look("", style.INK, "-", "^"),
        sweeps.Look("", style.BLUE, style.DASHED, "o"),
    )
    durations = sorted((float(value) for value in error[_DURATION].values), reverse=True)
    for duration, look in zip(durations, looks, strict=False):
        part = error["std"].sel({_DURATION: duration, "region": _REGION})
        mean, _, _ = sweeps.spread(part)
        slopes = {
            told: float(
                motion.slope(told, aperture_length_m=study.radar.aperture_length_m,
                             duration_s=duration)
            )
            for told in [speed, *(speed + np.outer(fine, draws).ravel())]
        }  # fmt: skip
        predicted = np.array(
            [
                np.mean(
                    [
                        predicted_std(
                            products["terrain"], products["truth"], true_slope=slopes[speed],
                            told_slope=slopes[speed + one * realization], floor_m=mean[0],
                        )
                        for realization in draws
                    ]
                )
                for one in fine
            ]
        )  # fmt: skip
        axes.plot(fine[1:], 100 * predicted[1:], color=style.GREY, linewidth=2.2, zorder=0.8)
        sweeps.curve(axes, positive, part.sel({_ERROR: positive}), look, scale=100)
        measured = motion.sufficient_error(levels, mean, factor=_TOLERATED)
        theory = motion.sufficient_error(fine, predicted, factor=_TOLERATED)
        tolerated.append(measured)
        if np.isfinite(measured):
            axes.axvline(measured, color=look.colour, linewidth=0.7, linestyle=":")
        keys += axes.plot(
            [], [], color=look.colour, linestyle=look.line, marker=look.marker, markersize=3,
            markerfacecolor="white", markeredgewidth=0.8,
            label=f"{_time(duration)}: {_speed(measured)} ({_speed(theory)})",
        )  # fmt: skip
    limits = positive.min() * 0.8, positive.max() * 1.25
    sweeps.log_x(axes, limits)
    decades = 10.0 ** np.arange(-6, 3)
    axes.xaxis.set_major_locator(
        FixedLocator([value for value in decades if limits[0] <= value <= limits[1]])
    )
    axes.set_xlabel("sensor error, std (m/s)")
    axes.set_ylabel("height error, std (cm)")
    axes.set_title(f"(d) speed sensor, {speed:g} m/s")
    return keys, tolerated


def _corrected(axes: Axes, error: xr.Dataset, look: sweeps.Look) -> None:
    """Draw the spread once echoes have corrected the sensor's speed."""
    sweeps.curve(axes, error[_ERROR].values, error["std"].sel(region=_REGION), look, scale=100)


# A figure is drawn for the page, for a slide and in other sizes; the first bound takes long.
@lru_cache(maxsize=64)
def _bound(
    radar: trajectory.Radar, imaging: Any, scans: int, speed_m_per_s: float, duration_s: float
) -> float:
    """Return the bound of the speed that the echoes of one scan or of two tell, m/s."""
    frequency = waveform.sampled(radar)
    at_rest = trajectory.planned(radar)
    first = motion.advance(at_rest, speed_m_per_s=speed_m_per_s, duration_s=duration_s)
    options: dict[str, Any] = {
        "extent": (imaging.x_min_m, imaging.x_max_m, imaging.y_min_m, imaging.y_max_m),
        "wavelength_m": waveform.wavelength(waveform.carrier(frequency)),
        "range_cell_m": waveform.range_resolution(float(frequency[-1] - frequency[0])),
        "incoherent": _INCOHERENT,
        "duration_s": duration_s,
    }
    if scans == 1:
        return motion.speed_bound(first, **options)
    second = motion.return_scan(
        at_rest, speed_m_per_s=speed_m_per_s, duration_s=duration_s, interval_s=duration_s
    )
    return motion.next_scan_bound((first, second), interval_s=duration_s, **options)


def _told(
    axes: Axes,
    speeds: Floats,
    study: Study,
    durations: list[float],
    looks: list[sweeps.Look],
    tolerated: list[float],
) -> None:
    """Draw what echoes tell of the speed at best, and what the heights tolerate."""
    top = float(speeds.max())
    at = np.linspace(top / 10, top, _BOUNDS)
    own = trajectory.scan_duration(study.radar, study.vehicle)
    curves = [(1, own), *((2, duration) for duration in durations)]
    drawn = []
    for (scans, duration), look in zip(curves, looks, strict=False):
        values = np.array(
            [
                1000 * _bound(study.radar, study.imaging, scans, float(speed), duration)
                for speed in at
            ]
        )
        drawn.append(values)
        axes.plot(at, values, color=look.colour, linestyle=look.line)
    for value, colour in zip(tolerated, (style.INK, style.BLUE), strict=False):
        if np.isfinite(value):
            drawn.append(np.array([1000 * value]))
            axes.axhline(1000 * value, color=colour, linewidth=0.7, linestyle=":")
    everything = np.concatenate(drawn)
    sweeps.log_y(axes, sweeps.around(everything[np.isfinite(everything)]))
    axes.set_xlim(0, top)
    axes.xaxis.set_major_locator(style.round_ticks(3))
    axes.set_xlabel("forward speed (m/s)")
    axes.set_ylabel("speed, std (mm/s)")
    axes.set_title("(e) echoes at best")


def _speed(value: float) -> str:
    if not np.isfinite(value):
        return "none seen"
    return f"{1000 * value:.2g} mm/s" if value < 0.1 else f"{value:.2g} m/s"


FIGURES = {
    "moving": declaration.Figure(
        draw=draw,
        title="A vehicle that drives during the scan",
        caption=(
            "(a) Apertures of the slow scan from above, at forward speeds in m/s, and where the "
            "image lies at half the highest speed of the fast scan if focusing assumes no "
            "motion. (b, c) A point target at the image's centre and the height error on visible "
            "ground against the speed, for both scans: not corrected, corrected with the true "
            "speed, and with that of an erroneous sensor. Dotted: amplitude of the target at the "
            "place where it is imaged. (d) Height error against the sensor's error, with the "
            "prediction from the heights of the places that the image shows instead; dotted "
            "lines mark where it exceeds the error-free one by a tenth. Orange: once the echoes "
            "of the scan have corrected the sensor's speed, or those of the next one as well, on "
            "the cart's way back. (e) The bound of the speed that they tell, and, dotted, the "
            "error of the speed at which the height error is a tenth more: above its line one scan "
            "does not suffice and the next one is needed. The estimate from one scan has two to "
            "three times its bound. Of the fast scan alone, echoes tell less than the sensor. "
            "Lines are means and bands 10 to 90 % of the realizations."
        ),
        sections=("figures", "radar", "imaging", "vehicle"),
        inputs=("terrain", "truth"),
        sweeps=("speed", "speed_error", "echoes", "next_scan"),
    ),
}
