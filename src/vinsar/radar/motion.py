"""The vehicle's motion during the scan, position errors, and what both do to the focus (Fig. 5).

While the cart crosses the aperture at the speed ``u`` the vehicle drives ahead at ``v``: the
positions lie on a line turned by the yaw angle ``atan(v / u)`` (section 1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar.foundations import randomness, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import AXES, SPEED_OF_LIGHT
from vinsar.foundations.randomness import Draw
from vinsar.foundations.stage import Stage
from vinsar.radar import trajectory, waveform
from vinsar.radar.trajectory import ANTENNAS

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

AxisName = Literal["x", "y", "z"]
Distribution = Literal["uniform", "normal"]
Spectrum = Literal["white", "sinusoidal", "random_walk"]


# Points across the scene, and ranges, that the bound of the speed takes.
_BOUND_POINTS, _BOUND_RANGES = 401, 8

# Points along each side of the ground that the bound of two scans takes.
_BOUND_SIDE = 20


variables.declare("true_trajectory", ANTENNAS)
variables.declare("recorded_trajectory", ANTENNAS)
variables.declare("next_true_trajectory", ANTENNAS)
variables.declare("next_recorded_trajectory", ANTENNAS)


class Motion(Section, name="motion"):
    """Errors of the antenna positions (Fig. 5)."""

    axis: Literal["x", "y", "z"] = key("axis along which the positions err", "section 2.4")
    level_wavelengths: float = key(
        "standard deviation of the error in wavelengths; 0 for none", "Fig. 5", ge=0
    )
    distribution: Literal["uniform", "normal"] = key(
        "of the errors; a uniform one has the half-width sqrt(3) sigma", "section 2.4"
    )
    channels: Literal["common", "independent"] = key(
        "one error for both antennas (the vehicle shakes), or one for each (their positions are "
        "measured by themselves)",
        "not given",
    )
    spectrum: Literal["white", "sinusoidal", "random_walk"] = key(
        "independent errors, one vibration, or drift", "section 2.4 has white errors"
    )
    cycles_per_aperture: float = key("periods of the vibration over the scan", "ours", gt=0)
    affects: Literal["recorded", "true"] = key(
        "which positions have the errors: those that focusing uses, or the true ones while it uses "
        "the undisturbed ones",
        "section 2.4 has measurement errors",
    )


class Vehicle(Section, name="vehicle"):
    """The vehicle's motion during the scan, and the speed that focusing assumes."""

    forward_speed_m_per_s: float = key(
        "constant speed ahead during the scan", "section 1, without a figure", ge=0, le=60
    )
    scan_duration_s: float = key(
        "time of the cart along the rail, relevant to a moving vehicle; an array dwells on each "
        "sample instead",
        "section 1, without a figure",
        gt=0,
        le=60,
    )
    speed_correction: Literal["none", "exact", "sensor", "echoes", "next_scan"] = key(
        "the speed that focusing assumes: zero, the true one, that of the speed sensor, the "
        "sensor's as the echoes correct it, or as they do together with those of the next scan, "
        "on the cart's way back",
        "section 1",
    )
    scan_interval_s: float | None = key(
        "from the beginning of the scan to that of the next one, at least the time of a scan; null "
        "for just that",
        "not given",
        gt=0,
        le=60,
    )
    speed_error_m_per_s: float = key(
        "standard deviation of the sensor's error, normal and constant during a scan",
        "not given",
        ge=0,
        le=60,
    )


def errors(
    positions: int,
    *,
    std_m: float,
    distribution: Distribution,
    spectrum: Spectrum,
    cycles_per_aperture: float,
    rng: np.random.Generator,
) -> Floats:
    """Draw the position errors of one antenna along one axis.

    Parameters
    ----------
    positions
        Number of antenna positions.
    std_m
        Standard deviation of the errors, m: of each error for ``white``, over a period for
        ``sinusoidal``, over the aperture for ``random_walk``.
    distribution
        Of the errors (``white``) or of the steps (``random_walk``); a uniform error has the
        half-width ``sqrt(3) std``.
    spectrum
        ``white``: independent from position to position, as in the paper; ``sinusoidal``: one
        vibration of random phase; ``random_walk``: drift, the sum of independent steps.
    cycles_per_aperture
        Frequency of the sinusoid, in periods over the aperture.
    rng
        Source of randomness; the draw scales with the standard deviation and changes in nothing
        else with it.

    Returns
    -------
    ndarray, shape (position,)
        Errors, m.
    """
    if spectrum == "sinusoidal":
        phase = 2 * np.pi * rng.random()
        turns = cycles_per_aperture * np.linspace(0, 1, positions)
        return std_m * np.sqrt(2) * np.sin(2 * np.pi * turns + phase)
    if distribution == "uniform":
        unit = np.sqrt(3) * rng.uniform(-1, 1, positions)
    else:
        unit = rng.standard_normal(positions)
    if spectrum == "random_walk":
        # The variance grows with the steps; its mean over the aperture is (positions + 1) / 2.
        unit = np.cumsum(unit) / np.sqrt((positions + 1) / 2)
    return std_m * unit


def displace(
    trajectory: xr.Dataset, *, axis: AxisName, draw: Callable[[int, int], Floats]
) -> xr.Dataset:
    """Displace a trajectory's antennas along one axis, transmitter and receiver alike.

    Parameters
    ----------
    trajectory
        Product ``trajectory``.
    axis
        Axis of the displacement.
    draw
        From a channel's number and the number of positions to errors (position,), m.

    Returns
    -------
    xarray.Dataset
        Product ``trajectory`` with other positions.
    """
    antennas = {name: trajectory[name].values.copy() for name in ("transmitter", "receiver")}
    channels, positions, _ = antennas["transmitter"].shape
    for channel in range(channels):
        shift = draw(channel, positions)
        for values in antennas.values():
            values[channel, :, AXES.index(axis)] += shift
    return variables.dataset("trajectory", antennas, {"channel": trajectory["channel"].values})


def slope(speed_m_per_s: ArrayLike, *, aperture_length_m: float, duration_s: float) -> Floats:
    """Return how far the vehicle drives for each metre of the scan: the tangent of the yaw angle.

    Parameters
    ----------
    speed_m_per_s
        Speed ``v`` of the vehicle, m/s.
    aperture_length_m, duration_s
        Length of the aperture at rest, m, and time for it, s; ``u`` is their ratio.

    Returns
    -------
    ndarray
        ``v / u``, 1.
    """
    return np.asarray(speed_m_per_s) * duration_s / aperture_length_m


def advance(trajectory: xr.Dataset, *, speed_m_per_s: float, duration_s: float) -> xr.Dataset:
    """Let the vehicle drive ahead during the scan.

    Parameters
    ----------
    trajectory
        Product ``trajectory``; its positions are evenly spaced in time.
    speed_m_per_s
        Speed of the vehicle, constant and straight ahead, m/s.
    duration_s
        Time from the first position to the last, s. At half of it the vehicle is where it is in
        ``trajectory``: the scene stays fixed to the ground.

    Returns
    -------
    xarray.Dataset
        Product ``trajectory`` with other positions; the same where the speed is 0.
    """
    if speed_m_per_s == 0:
        return trajectory
    # ASSUME: The vehicle stands still during a frequency sweep and moves from sweep to sweep.
    # ASSUME: Cart, switches and vehicle keep their speed during the scan, and both antennas take
    # their echoes at once.
    time = duration_s * np.linspace(-0.5, 0.5, trajectory.sizes["position"])
    way = speed_m_per_s * time[None, :, None] * (np.array(AXES) == "y")
    antennas = {name: trajectory[name].values + way for name in ("transmitter", "receiver")}
    return variables.dataset("trajectory", antennas, {"channel": trajectory["channel"].values})


def return_scan(
    trajectory: xr.Dataset, *, speed_m_per_s: float, duration_s: float, interval_s: float
) -> xr.Dataset:
    """Let the vehicle drive on and the cart go back: the antenna positions of the next scan.

    Parameters
    ----------
    trajectory
        Product ``trajectory``; its positions are evenly spaced in time.
    speed_m_per_s
        Speed of the vehicle, the same in both scans and straight ahead, m/s.
    duration_s
        Time from the first position of a scan to the last, s.
    interval_s
        Time from the beginning of the scan (`advance`) to that of the next one, s.

    Returns
    -------
    xarray.Dataset
        Product ``trajectory`` with other positions, in the same order along the aperture.
    """
    # ASSUME: On its way back the cart stops at the same positions, and the vehicle keeps speed and
    # heading over both scans.
    time = return_time(trajectory.sizes["position"], duration_s=duration_s, interval_s=interval_s)
    way = speed_m_per_s * time[None, :, None] * (np.array(AXES) == "y")
    antennas = {name: trajectory[name].values + way for name in ("transmitter", "receiver")}
    return variables.dataset("trajectory", antennas, {"channel": trajectory["channel"].values})


def return_time(positions: int, *, duration_s: float, interval_s: float) -> Floats:
    """Return the time of each position of the next scan, s, from the middle of the first one."""
    return interval_s - duration_s * np.linspace(-0.5, 0.5, positions)


def imaged_place(
    x: ArrayLike, y: ArrayLike, *, true_slope: float, told_slope: float
) -> tuple[Floats, Floats]:
    """Return where ground is imaged when focusing assumes another speed.

    From the position ``(s, k s)`` on an aperture of the slope ``k`` a point has the squared range
    ``|p|^2 + (1 + k^2) s^2 - 2 s (x + k y)``. It is imaged where distance ``|p'|`` and
    ``x' + k' y'`` of the slope ``k'`` that focusing assumes are the same; what remains,
    ``(k^2 - k'^2) s^2``, defocuses. Near broadside that is a turn by the error of the yaw angle.
    The height is unaffected: it comes from the difference of the two ranges alone.

    Parameters
    ----------
    x, y
        Ground points relative to the aperture's centre, m, of shapes that broadcast.
    true_slope, told_slope
        ``v / u`` of the true speed and of the one that focusing assumes (`slope`).

    Returns
    -------
    tuple of ndarray
        x and y in the image, m, on the same side of the aperture; NaN where nothing fits.
    """
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    distance = np.hypot(x, y)
    cosine = (x + true_slope * y) / (np.sqrt(1 + told_slope**2) * distance)
    from_axis = np.arccos(np.where(np.abs(cosine) <= 1, cosine, np.nan))
    side = np.where(y >= true_slope * x, 1.0, -1.0)
    azimuth = np.arctan(told_slope) + side * from_axis
    return distance * np.cos(azimuth), distance * np.sin(azimuth)


def speed_bound(
    antennas: xr.Dataset,
    *,
    extent: tuple[float, float, float, float],
    wavelength_m: float,
    range_cell_m: float,
    incoherent: float,
    duration_s: float,
) -> float:
    """Return the Cramer-Rao bound of the speed that the echoes of one scan tell, m/s.

    Speckle of level ground that fills an extent, of one power, has at each slant range the
    covariance R of the positions; the Fisher information of two parameters of it is
    ``tr(R^-1 dR_a R^-1 dR_b)`` for each range cell and channel (docs/autofocus.md). Nobody knows
    where the scene lies: what moves a point along the axis of the aperture tells nothing.

    Parameters
    ----------
    antennas
        Product ``trajectory`` with the vehicle's motion.
    extent
        Ground that scatters (x_min, x_max, y_min, y_max), m, ahead of the antennas.
    wavelength_m, range_cell_m
        Wavelength and resolution in slant range, m.
    incoherent
        Share of the power that is noise, of each position's own.
    duration_s
        Duration of the scan, s.

    Returns
    -------
    float
        Standard deviation, m/s; infinite where the echoes tell nothing.
    """
    ends = [antennas[name].values[0] for name in ("transmitter", "receiver")]
    center = (ends[0] + ends[1]).mean(axis=0) / 2
    count = len(ends[0])
    axis = (ends[0] + ends[1])[-1] - (ends[0] + ends[1])[0]
    axis = axis / np.linalg.norm(axis)
    time = duration_s * np.linspace(-0.5, 0.5, count)[:, None]
    near, far = np.array(extent[2:]) - center[1]
    across = np.linspace(extent[0], extent[1], _BOUND_POINTS) - center[0]
    ground = np.linspace(max(near, 1.01 * np.abs(across).max()), far, _BOUND_RANGES)
    wave = 2 * np.pi / wavelength_m
    information = np.zeros((2, 2))
    for distance in ground:
        ahead = np.sqrt(distance**2 - across**2)
        points = np.stack([across, ahead, np.full_like(ahead, -center[2])], axis=1)
        path, by_speed, along = (np.zeros((count, across.size)) for _ in range(3))
        for end in ends:
            place = end - center
            ray = points - place[:, None]
            length = np.linalg.norm(ray, axis=-1)
            path += length
            by_speed -= time * ray[..., 1] / length
            along -= (place @ axis)[:, None] / length
        by_speed -= by_speed.mean(axis=0)
        along -= along.mean(axis=0)
        by_speed -= along * (along * by_speed).sum(axis=0) / (along**2).sum(axis=0)
        weight = (1 - incoherent) / across.size
        steering = np.exp(-1j * wave * (path - path[:, across.size // 2, None]))
        covariance = weight * steering @ steering.conj().T + incoherent * np.eye(count)
        slopes = []
        for by in (by_speed, along):
            slope = weight * (-1j * wave * by * steering) @ steering.conj().T
            slopes.append(np.linalg.solve(covariance, slope + slope.conj().T))
        information += np.array([[np.sum(a * b.T).real for b in slopes] for a in slopes])
    swath = np.hypot(far, center[2]) - np.hypot(near, center[2])
    information *= antennas.sizes["channel"] * swath / range_cell_m / ground.size
    (speed, both), (_, turn) = information
    left = speed - both**2 / turn
    return float(1 / np.sqrt(left)) if left > 0 else float("inf")


def next_scan_bound(
    scans: tuple[xr.Dataset, xr.Dataset],
    *,
    extent: tuple[float, float, float, float],
    wavelength_m: float,
    range_cell_m: float,
    incoherent: float,
    duration_s: float,
    interval_s: float,
) -> float:
    """Return the bound of the speed that two scans of one drive, registered, tell, m/s.

    Each cell of the directions and ranges that both see tells how far one image is off the other
    to the Cramer-Rao bound of speckle of unknown phase (docs/autofocus.md). The height of each
    cell, which displaces its images as well, is known from the phase between the antennas alone.

    Parameters
    ----------
    scans
        Product ``trajectory`` of both (`advance`, `return_scan`), with the vehicle's motion.
    extent
        Ground that scatters (x_min, x_max, y_min, y_max), m, ahead of the antennas.
    wavelength_m, range_cell_m
        Wavelength and resolution in slant range, m.
    incoherent
        Share of the power that is noise, of each scan's own.
    duration_s, interval_s
        As in `return_scan`.

    Returns
    -------
    float
        Standard deviation, m/s; infinite where the scans tell nothing.
    """
    count = scans[0].sizes["position"]
    times = (
        duration_s * np.linspace(-0.5, 0.5, count),
        return_time(count, duration_s=duration_s, interval_s=interval_s),
    )
    axes = [np.linspace(*ends, _BOUND_SIDE + 1) for ends in (extent[:2], extent[2:])]
    grid = np.stack(np.meshgrid(*[(axis[1:] + axis[:-1]) / 2 for axis in axes]), -1)
    points = np.concatenate([grid.reshape(-1, 2), np.zeros((_BOUND_SIDE**2, 1))], axis=1)
    area = (extent[1] - extent[0]) * (extent[3] - extent[2]) / len(points)
    looks = 2 * (1 - incoherent) ** 2 / (1 - (1 - incoherent) ** 2)
    sides, moves, cosines = [], [], []
    height = np.zeros(len(points))
    for scan, time in zip(scans, times, strict=True):
        # The outer antennas.
        lower, upper = (_rays(scan.isel(channel=channel), points) for channel in (0, -1))
        move = image_moves(scan, time, points)
        moves.append(move)
        direction = np.arctan2(lower[..., 0], lower[..., 1])
        sides.append((direction.min(axis=1), direction.max(axis=1)))
        cosine, other = (np.hypot(ray[..., 0], ray[..., 1]).mean(axis=1) for ray in (lower, upper))
        cosines.append(cosine)
        band = cosine / range_cell_m
        shared = (1 - incoherent) * np.maximum(
            1 - 2 * np.abs(cosine - other) / wavelength_m / band, 0
        )
        change = upper[..., 2].sum(axis=1) - np.einsum("plk,pk->p", upper[..., :2], move[..., 1])
        change *= 4 * np.pi / wavelength_m / count
        cells = band * 2 / wavelength_m * cosine * np.ptp(direction, axis=1) * area
        height += cells * 2 * shared**2 / (1 - shared**2) * change**2
    low, high = (
        pick(ends, axis=0)
        for pick, ends in zip((np.max, np.min), zip(*sides, strict=True), strict=True)
    )
    cosine = np.mean(cosines, axis=0)
    bands = np.stack(
        [
            2 / wavelength_m * cosine * np.maximum(high - low, 0),
            np.maximum(
                cosine / range_cell_m - 2 / wavelength_m * np.abs(cosines[0] - cosines[1]), 0
            ),
        ]
    )
    middle = (low + high) / 2
    turned = np.array([[np.cos(middle), -np.sin(middle)], [np.sin(middle), np.cos(middle)]])
    apart = np.einsum("akp,pkc->apc", turned, moves[0] - moves[1])
    weight = looks * (2 * np.pi * bands) ** 2 / 12 * bands.prod(axis=0) * area
    information = scans[0].sizes["channel"] * np.einsum("ap,apc,apd->cdp", weight, apart, apart)
    left = information[0, 0] - information[0, 1] ** 2 / (information[1, 1] + height)
    total = float(left.sum())
    return 1 / np.sqrt(total) if total > 0 else float("inf")


def image_moves(antennas: xr.Dataset, time: Floats, points: Floats) -> Floats:
    """Return how the images of points move on the ground with speed and height, to first order.

    To where the half paths of the first channel, from all positions, are what they were, by least
    squares.

    Parameters
    ----------
    antennas
        Product ``trajectory``: the positions that focusing assumes.
    time
        When the antennas are there (position,), s, from when the vehicle is where it is known.
    points
        Points (point, 3), m.

    Returns
    -------
    ndarray, shape (point, 2, 2)
        Change of x and y with the speed that focusing assumes, s, and with the height of the
        point above the surface that it is focused on, 1.
    """
    rays = _rays(antennas.isel(channel=0), points)
    ground = rays[..., :2]
    normal = np.linalg.inv(np.einsum("plk,plm->pkm", ground, ground))
    causes = np.stack([time * rays[..., 1], rays[..., 2]], axis=-1)
    return np.asarray(normal @ np.einsum("plk,plc->pkc", ground, causes))


def _rays(antennas: xr.Dataset, points: Floats) -> Floats:
    """Return the half paths' derivatives by the points (point, position, axis)."""
    result = np.zeros((len(points), antennas.sizes["position"], 3))
    for name in ("transmitter", "receiver"):
        ray = points[:, None] - antennas[name].values
        result += ray / np.linalg.norm(ray, axis=-1, keepdims=True) / 2
    return result


def _half_path(antennas: xr.Dataset, point: Floats) -> Floats:
    legs = [
        np.linalg.norm(antennas[name].values - point, axis=-1)
        for name in ("transmitter", "receiver")
    ]
    return np.asarray(legs[0] + legs[1]) / 2


def peak_place(
    truth: xr.Dataset, recorded: xr.Dataset, point: Floats, aperture_weights: Floats
) -> Floats:
    """Return where the image of a point target on the ground lies, by channel.

    The ground point whose half paths from the recorded positions match those of the target from
    the true ones best, by least squares over the aperture.

    Parameters
    ----------
    truth, recorded
        Product ``trajectory``: where the antennas were, and where imaging takes them to be.
    point
        Position of the target (3,), m.
    aperture_weights
        Weights of the positions, of sum 1.

    Returns
    -------
    ndarray, shape (channel, 3)
        Places, m, at the target's height.
    """
    from scipy.optimize import leastsq

    weight = np.sqrt(aperture_weights)
    found = np.tile(point, (truth.sizes["channel"], 1))
    for channel, path in enumerate(_half_path(truth, point)):
        ends = [recorded[name].values[channel] for name in ("transmitter", "receiver")]

        def miss(place: Floats, ends: list[Floats] = ends, path: Floats = path) -> Floats:
            legs = [np.linalg.norm(end - [*place, point[2]], axis=-1) for end in ends]
            return np.asarray(weight * ((legs[0] + legs[1]) / 2 - path))

        def gradient(place: Floats, ends: list[Floats] = ends) -> Floats:
            rays = [[*place, point[2]] - end for end in ends]
            units = [ray / np.linalg.norm(ray, axis=-1)[:, None] for ray in rays]
            return np.asarray(weight[:, None] * (units[0] + units[1])[:, :2] / 2)

        # MINPACK itself: what wraps it takes several times as long as the few steps. With its full
        # output it does not warn where a target is imaged nowhere, and ends at the nearest place.
        found[channel, :2] = leastsq(miss, point[:2], Dfun=gradient, full_output=True)[0]
    return found


def point_gain(
    truth: xr.Dataset,
    recorded: xr.Dataset,
    point: Floats,
    place: Floats,
    frequency: Floats,
    range_weights: Floats,
    aperture_weights: Floats,
) -> Floats:
    """Return how much of a point target's image is found at a place, by channel.

    The exact matched filter of the recorded positions applied to the echo of the true ones:
    ``|sum_l v_l sum_k w_k exp(4 pi i f_k (rho_recorded - rho_true) / c)|``, 1 at the
    target's own position without errors.

    Parameters
    ----------
    truth, recorded
        Product ``trajectory``: where the antennas were, and where imaging takes them to be.
    point
        Position of the target (3,), m.
    place
        Where the image is looked at, by channel (channel, 3), m: `peak_place`, or the target's
        own position.
    frequency
        Evenly spaced frequencies, Hz.
    range_weights, aperture_weights
        Weights of frequencies and positions, each of sum 1.

    Returns
    -------
    ndarray, shape (channel,)
        Amplitude relative to perfect focus.
    """
    delay = 2 * (_half_path(recorded, place[:, None]) - _half_path(truth, point)) / SPEED_OF_LIGHT
    # The frequencies are evenly spaced: each phasor is one of a few coarse steps times one of a few
    # fine ones.
    fine = int(np.ceil(np.sqrt(frequency.size)))
    weights = np.zeros((fine, fine))
    weights.flat[: frequency.size] = range_weights
    turn = 2j * np.pi * delay[..., None] * np.arange(fine) * (frequency[1] - frequency[0])
    profile = ((np.exp(fine * turn) @ weights) * np.exp(turn)).sum(axis=-1)
    profile *= np.exp(2j * np.pi * delay * frequency[0])
    return np.asarray(np.abs(profile @ aperture_weights))


def sufficient_error(errors: Floats, spread: Floats, *, factor: float) -> float:
    """Return the largest error that lets the heights' spread exceed the error-free one's so far.

    Parameters
    ----------
    errors
        Errors (level,), rising from 0.
    spread
        Spread of the heights at each.
    factor
        How far the spread may go, in units of that without error.

    Returns
    -------
    float
        Linear between the levels; infinite if the spread stays below at all of them.
    """
    limit = factor * spread[0]
    beyond = np.flatnonzero(spread > limit)
    if beyond.size == 0:
        return float("inf")
    last = int(beyond[0])
    return float(np.interp(limit, spread[last - 1 : last + 1], errors[last - 1 : last + 1]))


def _displaced(products: Products, study: Study, affected: str, *scan: int) -> xr.Dataset:
    options = study.motion
    if options.affects != affected or options.level_wavelengths == 0:
        return products["trajectory"]

    def draw(channel: int, positions: int) -> Floats:
        return errors(
            positions,
            std_m=options.level_wavelengths
            * waveform.wavelength(waveform.carrier(waveform.sampled(study.radar))),
            distribution=options.distribution,
            spectrum=options.spectrum,
            cycles_per_aperture=options.cycles_per_aperture,
            rng=randomness.generator(
                study, Draw.MOTION, channel if options.channels == "independent" else 0, *scan
            ),
        )

    return displace(products["trajectory"], axis=options.axis, draw=draw)


def _true_trajectory(products: Products, study: Study) -> xr.Dataset:
    return advance(
        _displaced(products, study, "true"),
        speed_m_per_s=study.vehicle.forward_speed_m_per_s,
        duration_s=trajectory.scan_duration(study.radar, study.vehicle),
    )


def told_speed(study: Study) -> float:
    """Return the speed that the recorded positions have, m/s: the sensor's if echoes correct it."""
    options = study.vehicle
    if options.speed_correction == "none":
        return 0.0
    if options.speed_correction == "exact":
        return options.forward_speed_m_per_s
    # ASSUME: The sensor's error is normal and constant during a scan. One draw a realization,
    # whatever the speed and the error's size.
    error = options.speed_error_m_per_s * randomness.generator(study, Draw.SPEED).standard_normal()
    return options.forward_speed_m_per_s + float(error)


def _recorded_trajectory(products: Products, study: Study) -> xr.Dataset:
    return advance(
        _displaced(products, study, "recorded"),
        speed_m_per_s=told_speed(study),
        duration_s=trajectory.scan_duration(study.radar, study.vehicle),
    )


def has_next_scan(vehicle: Vehicle) -> bool:
    """Return whether there is a next scan (section ``vehicle``)."""
    return vehicle.speed_correction == "next_scan"


def scan_interval(radar: trajectory.Radar, vehicle: Vehicle) -> float:
    """Return the time from the beginning of the scan to that of the next one, s."""
    if vehicle.scan_interval_s is not None:
        return vehicle.scan_interval_s
    return trajectory.scan_duration(radar, vehicle)


# Position errors of the next scan are drawn by themselves.
_NEXT = 1


def _next(products: Products, study: Study, affected: str, speed_m_per_s: float) -> xr.Dataset:
    return return_scan(
        _displaced(products, study, affected, _NEXT),
        speed_m_per_s=speed_m_per_s,
        duration_s=trajectory.scan_duration(study.radar, study.vehicle),
        interval_s=scan_interval(study.radar, study.vehicle),
    )


def _next_true_trajectory(products: Products, study: Study) -> xr.Dataset:
    return _next(products, study, "true", study.vehicle.forward_speed_m_per_s)


def _next_recorded_trajectory(products: Products, study: Study) -> xr.Dataset:
    return _next(products, study, "recorded", told_speed(study))


STAGES = {
    "true_trajectory": Stage(
        _true_trajectory,
        inputs=("trajectory",),
        sections=(
            *randomness.KEYS,
            *waveform.KEYS,
            "motion",
            "vehicle.forward_speed_m_per_s",
            "vehicle.scan_duration_s",
            *trajectory.SCAN_KEYS,
        ),
    ),
    "recorded_trajectory": Stage(
        _recorded_trajectory,
        inputs=("trajectory",),
        sections=(
            *randomness.KEYS,
            *waveform.KEYS,
            "motion",
            "vehicle",
            *trajectory.SCAN_KEYS,
        ),
    ),
    "next_true_trajectory": Stage(
        _next_true_trajectory,
        inputs=("trajectory",),
        sections=(
            *randomness.KEYS,
            *waveform.KEYS,
            "motion",
            "vehicle.forward_speed_m_per_s",
            "vehicle.scan_duration_s",
            "vehicle.scan_interval_s",
            *trajectory.SCAN_KEYS,
        ),
        when=lambda study: has_next_scan(study.vehicle),
    ),
    "next_recorded_trajectory": Stage(
        _next_recorded_trajectory,
        inputs=("trajectory",),
        sections=(
            *randomness.KEYS,
            *waveform.KEYS,
            "motion",
            "vehicle",
            *trajectory.SCAN_KEYS,
        ),
        when=lambda study: has_next_scan(study.vehicle),
    ),
}
