"""The vehicle's speed from the echoes of one scan: what a wrong one leaves out of focus.

A wrong speed leaves ranges as they are and turns the image about the vehicle, which no echo
contradicts. What it leaves is a phase that grows with the square of the way along the aperture
(docs/autofocus.md has it, and what can be known of it). `estimate` compensates it for one speed
after the other and takes the one whose image has the least mean logarithm of its power, averaged
over some range cells: the maximum likelihood of speckle whose mean power nobody knows.

The image is formed over the cosine of the angle to the aperture's axis, once with each of a few
orthogonal weightings. What sidelobes contribute to the power of weak pixels is least at another
speed than the true one. It follows from the image's own power, and is taken off.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.processing import focusing
from vinsar.radar import trajectory, waveform

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

logger = logging.getLogger(__name__)

_LEAST_POSITIONS = 16
_OVERSAMPLING = 8
_MARGIN_M = 0.5

# Directions in a cell of the aperture's resolution, and sines from the middle at most.
_PER_CELL, _WIDEST = 2, 0.6

# Range cells over which power is averaged, and what is added to it: a share of its mean. Without,
# sidelobes beside the scene would count as much as the scene.
_LOOKS, _FLOOR = 8, 0.03

# Sine tapers of the aperture; every so many range cells, sidelobes are computed.
_TAPERS, _APART = 3, 10

# Speeds tried: standard deviations of the sensor at most, phases of the ends, rad, from one to the
# next, at most so many. Then rounds with the positions that follow from the speed found: some
# steps to both sides of it, and a parabola through a few speeds a step around it.
_REACH, _STEP, _MOST = 4.0, 0.6, 121
_MOVES, _NEAR = 6, 4
_ROUNDS, _FIT = 2, 5

# Least standard deviation in units of that of a likelihood as curved as the cost, which counts each
# taper, and the directions between cells, as looks of their own: as scans of speckle scatter.
_LEAST_STD = 2.0

# Newton's steps to the turn of the image, and the step of its derivative.
_TURNS, _SMALL = 4, 1e-4

# Phase of the ends that one standard deviation of the sensor makes, rad, below which no echo helps;
# how far the least criterion must lie below the mean, in standard deviations; and what the echoes'
# standard deviation may be of the sensor's.
_LEAST_PHASE, _CLEAR, _BETTER = 0.1, 5.0, 0.7


@dataclass(frozen=True)
class Speed:
    """What the echoes tell of the vehicle's speed.

    Attributes
    ----------
    correction
        To add to the recorded speed, m/s; 0 if nothing is applied.
    std
        Standard deviation of the corrected speed, m/s: the sensor's if nothing is applied.
    reason
        Why nothing is applied; empty if something is.
    """

    correction: float
    std: float
    reason: str = ""


def way(speed_m_per_s: float, *, positions: int, duration_s: float) -> Floats:
    """Return the displacement (position, axis) by a speed ahead, m; none at half of the scan."""
    result = np.zeros((positions, 3))
    result[:, 1] = speed_m_per_s * duration_s * np.linspace(-0.5, 0.5, positions)
    return result


def unusable(echoes: Sequence[xr.Dataset], sensor_std_m_per_s: float) -> str:
    """Return why no scan like these can correct the sensor; empty if one may.

    Parameters
    ----------
    echoes
        Products ``received``.
    sensor_std_m_per_s
        Stated standard deviation of the sensor, m/s.
    """
    if sensor_std_m_per_s == 0:
        return "the sensor is stated to be exact (vehicle.speed_error_m_per_s is 0)"
    positions = echoes[0].sizes["position"]
    if positions < _LEAST_POSITIONS:
        return f"{positions} positions are too few; take {_LEAST_POSITIONS}"
    if not all(echo["echo"].values.any(axis=(0, 2)).all() for echo in echoes):
        return "some positions have no echo"
    return ""


def weighed(found: float, std: float, sensor_std_m_per_s: float) -> Speed:
    """Return a correction found from echoes, weighed against the sensor; none if it is too coarse.

    Parameters
    ----------
    found, std
        The correction and its standard deviation, m/s.
    sensor_std_m_per_s
        Stated standard deviation of the sensor, m/s.
    """
    if std > _BETTER * sensor_std_m_per_s:
        reason = f"they tell the speed to {std:.2g} m/s, the sensor to {sensor_std_m_per_s:.2g} m/s"
        return Speed(0.0, sensor_std_m_per_s, reason)
    share = sensor_std_m_per_s**2 / (sensor_std_m_per_s**2 + std**2)
    return Speed(share * found, float(np.sqrt(share) * std))


def estimate(
    echo: xr.Dataset,
    recorded: xr.Dataset,
    *,
    extent: tuple[float, float, float, float],
    duration_s: float,
    sensor_std_m_per_s: float,
) -> Speed:
    """Estimate the error of the recorded speed from the echoes of one scan.

    Parameters
    ----------
    echo
        Product ``received``, without leakage.
    recorded
        Product ``trajectory``: the positions by the speed sensor.
    extent
        Ground that echoes come from (x_min, x_max, y_min, y_max), m, which must lie ahead.
    duration_s
        Time from the first position to the last, s.
    sensor_std_m_per_s
        Stated standard deviation of the sensor, m/s.

    Returns
    -------
    Speed
        The correction, weighed against the sensor by both standard deviations. Where the echoes
        cannot tell it, it is 0, the reason is given, and a warning is logged.
    """

    def nothing(reason: str) -> Speed:
        logger.warning("speed: no correction, because %s", reason)
        return Speed(0.0, sensor_std_m_per_s, reason)

    positions = recorded.sizes["position"]
    if reason := unusable([echo], sensor_std_m_per_s):
        return nothing(reason)
    image = _Image(echo, recorded, extent, duration_s)
    phase = image.end_phase(sensor_std_m_per_s)
    if phase < _LEAST_PHASE:
        return nothing(
            f"the sensor's error makes a phase of {phase:.2g} rad at the aperture's ends: the "
            "vehicle is too slow, or the scan too short"
        )
    count = min(2 * int(np.ceil(_REACH * phase / _STEP)) + 1, _MOST)
    step = _STEP * sensor_std_m_per_s / phase
    tried = step * (np.arange(count) - (count - 1) / 2)
    costs = image.costs(image.phases(tried), tapers=1)
    best = int(costs.sum(axis=1).argmin())
    depth = _blocks(costs.mean(axis=0) - costs[best])
    clear = depth.sum() / (np.sqrt(depth.size) * depth.std() + np.finfo(float).tiny)
    if not clear > _CLEAR or not 0 < best < count - 1:
        return nothing("no speed of those that the sensor allows makes the image clearly sharper")
    found = float(tried[best])

    def moved() -> _Image:
        shift = way(found, positions=positions, duration_s=duration_s)
        return _Image(echo, trajectory.displaced(recorded, shift), extent, duration_s)

    # Far from the true speed the phase is not that of its square alone.
    near = step * np.arange(-_NEAR, _NEAR + 1)
    for _ in range(_MOVES):
        image = moved()
        shift = float(near[image.costs(image.phases(near), tapers=1).sum(axis=1).argmin()])
        found += shift
        if abs(shift) < 1.5 * step:
            break
    std = np.inf
    near = step * np.linspace(-1, 1, _FIT)
    for _ in range(_ROUNDS):
        shift, std = moved().least(near)
        if not np.isfinite(std):
            return nothing("no speed makes the image sharpest")
        found += float(np.clip(shift, near[0], near[-1]))
    result = weighed(found, std, sensor_std_m_per_s)
    if result.reason:
        return nothing(result.reason)
    logger.info("speed: corrected by %+.4f m/s, known to %.4f m/s", result.correction, std)
    return result


class _Image:
    """What each position adds to the image over range and direction to the aperture's axis."""

    def __init__(
        self,
        echo: xr.Dataset,
        recorded: xr.Dataset,
        extent: tuple[float, float, float, float],
        duration_s: float,
    ) -> None:
        ends = [recorded[name].values for name in ("transmitter", "receiver")]
        self.channels, self.positions, _ = ends[0].shape
        self.duration = duration_s
        center = (ends[0] + ends[1]).mean(axis=(0, 1)) / 2
        self.ends = [end - center for end in ends]
        middle = (self.ends[0] + self.ends[1]).mean(axis=0) / 2
        axis = middle[-1] - middle[0]
        axis[2] = 0
        length = float(np.linalg.norm(axis))
        self.axis = axis / length
        x = (extent[0] + extent[1]) / 2 - center[0]
        frequency = echo["frequency"].values
        cell = waveform.range_resolution(float(frequency[-1] - frequency[0]))
        low, high = (float(np.linalg.norm([x, y - center[1], center[2]])) for y in extent[2:])
        self.ranges = np.arange(low, high, cell)
        ground = np.sqrt(self.ranges**2 - center[2] ** 2 - x**2)
        self.toward = np.stack(
            [np.full_like(ground, x), ground, np.full_like(ground, -center[2])], axis=1
        )
        near, far = trajectory.range_extent(recorded, np.array(extent[:2]), np.array(extent[2:]))
        profiles = focusing.compress(
            echo,
            near_range_m=max(near - _MARGIN_M, 0.0),
            far_range_m=far + _MARGIN_M,
            oversampling=_OVERSAMPLING,
        )
        carrier = float(profiles["carrier_frequency"])
        self.wave = 4 * np.pi * carrier / SPEED_OF_LIGHT
        wavelength = waveform.wavelength(carrier)
        half = min(wavelength * (self.positions - 1) / (4 * length), _WIDEST)
        count = max(1, int(half * _PER_CELL * 2 * length / wavelength))
        self.directions = np.arange(-count, count) * half / count
        self.parts = self._parts(profiles)
        self._weight()

    def path(self, channel: int | None, directions: Floats, moved: Floats | float = 0.0) -> Floats:
        """Return half paths (position, range, direction), m, of a channel or of their mean.

        Along the axis a direction is added to that of the middle. It may lie where no ground is,
        beside what the aperture sees of it: the path is the same function of range and cosine.
        """
        total: Floats = np.zeros((self.positions, self.ranges.size, directions.size))
        for end in self.ends:
            place = (end.mean(axis=0) if channel is None else end[channel]) + moved
            cosine = place @ self.toward.T
            along = np.multiply.outer(place @ self.axis, np.multiply.outer(self.ranges, directions))
            square = (place**2).sum(axis=1)[:, None] + self.ranges**2 - 2 * cosine
            total += np.sqrt(square[:, :, None] - 2 * along) / 2
        return total

    def _parts(self, profiles: xr.Dataset) -> Complexes:
        slant, values = profiles["slant_range"].values, profiles["profile"].values
        spacing = float(slant[-1] - slant[0]) / (slant.size - 1)
        shape = self.channels, self.positions, self.ranges.size, self.directions.size
        parts: Complexes = np.empty(shape, np.complex64)
        row = np.arange(self.positions)[:, None, None]
        for channel in range(self.channels):
            path = self.path(channel, self.directions)
            place = np.clip((path - slant[0]) / spacing, 0, slant.size - 1.001)
            index = place.astype(int)
            rest = (place - index).astype(np.float32)
            line = values[channel]
            between = line[row, index] * (1 - rest) + line[row, index + 1] * rest
            parts[channel] = between * np.exp(1j * self.wave * path)
        return parts

    def _places(self, directions: Floats) -> Floats:
        """Return where positions are along the aperture as each direction sees it, -1 to 1.

        What the path loses by a step of the direction: along it a scatterer's spread by a wrong
        speed is the same to both sides.
        """
        step = 1e-3
        loss = self.path(None, directions - step) - self.path(None, directions + step)
        reach = np.minimum(np.abs(loss[0]), np.abs(loss[-1])) * (1 + 1 / self.positions)
        return np.clip(loss / reach, -1, 1)

    def _weight(self) -> None:
        places = self._places(self.directions)
        apart = np.abs(np.gradient(places, axis=0))
        orders = np.pi / 2 * np.arange(1, _TAPERS + 1)
        tapers = np.sin(orders[:, None, None, None] * (places + 1)) * apart
        tapers /= np.sqrt((tapers**2).sum(axis=1, keepdims=True))
        self.tapers = tapers.astype(np.float32)
        self.square = (places**2).astype(np.float32)
        # The same at the middle, to tell what a speed makes of it.
        self.share = self._places(np.zeros(1))[:, :, 0]

    def phases(self, speeds: Floats) -> Floats:
        """Return the phase at the aperture's ends (speed, range), rad, that speeds make.

        The path at the true speed less that at the recorded one, but for a constant and for what
        a turn of the image takes.
        """
        still = self._middle(np.zeros(self.ranges.size), 0.0)
        result = np.empty((speeds.size, self.ranges.size))
        weight = np.cos(np.pi / 2 * self.share)
        # The square of the place, less constant and trend: what a fit takes for its coefficient.
        trend = self.share - (weight * self.share).sum(axis=0) / weight.sum(axis=0)
        square = self.share**2 - (weight * self.share**2).sum(axis=0) / weight.sum(axis=0)
        norm = (weight * trend**2).sum(axis=0)
        square -= trend * (weight * trend * square).sum(axis=0) / norm
        for number, speed in enumerate(speeds):
            moved = way(float(speed), positions=self.positions, duration_s=self.duration)
            turn = np.zeros(self.ranges.size)
            for _ in range(_TURNS):
                change = self._middle(turn, moved) - still
                rise = (self._middle(turn + _SMALL, moved) - still - change) / _SMALL
                turn -= (weight * trend * change).sum(axis=0) / (
                    (weight * trend * rise).sum(axis=0)
                )
            change = self._middle(turn, moved) - still
            result[number] = (
                self.wave
                * (weight * square * change).sum(axis=0)
                / (weight * square**2).sum(axis=0)
            )
        return result

    def _middle(self, directions: Floats, moved: Floats | float) -> Floats:
        """Return half paths (position, range), m, each range in a direction of its own."""
        total: Floats = np.zeros((self.positions, self.ranges.size))
        for end in self.ends:
            place = end.mean(axis=0) + moved
            toward = place @ self.toward.T + np.outer(place @ self.axis, self.ranges * directions)
            square = (place**2).sum(axis=1)[:, None] + self.ranges**2 - 2 * toward
            total += np.sqrt(square) / 2
        return total

    def end_phase(self, speed: float) -> float:
        """Return the phase at the ends that a small error of the speed makes, rad."""
        ends = self.phases(np.array([-speed / 10, speed / 10]))
        return float(np.abs(ends[1] - ends[0]).mean() * 5)

    def power(self, phase: Floats, tapers: int) -> Floats:
        """Return the power (taper, range, direction) once a phase (range,) is compensated."""
        turn = np.exp(1j * phase.astype(np.float32)[:, None] * self.square)
        images = [
            np.einsum("clru,lru->cru", self.parts, turn * taper) for taper in self.tapers[:tapers]
        ]
        return np.array([(image.real**2 + image.imag**2).mean(axis=0) for image in images])

    def costs(self, phases: Floats, tapers: int = _TAPERS) -> Floats:
        """Return the logarithm of the power (phase, range), a sum over tapers and directions."""
        from scipy.ndimage import uniform_filter1d

        powers = np.array([self.power(phase, tapers) for phase in phases])
        floor = _FLOOR * powers.mean()
        self.seen = powers[len(powers) // 2]
        smooth = uniform_filter1d(powers, _LOOKS, axis=2)
        return np.asarray(np.log(smooth + floor).sum(axis=(1, 3)))

    def expected_costs(self, phases: Floats) -> Floats:
        """Return what `costs` of the same power would be (phase, some ranges) without speckle."""
        from scipy.ndimage import uniform_filter1d

        rows = np.arange(_APART // 2, self.ranges.size, _APART)
        power = uniform_filter1d(self.seen[0], _LOOKS, axis=0)[rows]
        paths = self.path(None, self.directions)[:, rows]
        expected = np.empty((len(phases), _TAPERS, *power.shape))
        for column, row in enumerate(rows):
            path = paths[:, column]
            steering = np.exp(1j * self.wave * (path - path.mean(axis=1, keepdims=True)))
            for number, phase in enumerate(phases):
                turned = steering * np.exp(1j * phase[row] * self.square[:, row])
                for taper in range(_TAPERS):
                    spread = (turned * self.tapers[taper][:, row]).T @ steering.conj()
                    expected[number, taper, column] = np.abs(spread) ** 2 @ power[column]
        return np.asarray(np.log(expected + _FLOOR * expected.mean()).sum(axis=(1, 3)))

    def least(self, speeds: Floats) -> tuple[float, float]:
        """Return the speed of the least cost near some, and its standard deviation, m/s."""
        phases = self.phases(speeds)
        costs = self.costs(phases)
        _, slope, curve = np.polynomial.polynomial.polyfit(speeds, costs, 2)
        _, lean, bend = np.polynomial.polynomial.polyfit(
            speeds, self.expected_costs(phases).sum(axis=1), 2
        )
        curvature = 2 * curve.sum()
        if curvature <= 0 or bend <= 0:
            return 0.0, np.inf
        least = -slope.sum() / curvature
        # The slopes of blocks of ranges, each with its own speckle, tell the standard deviation.
        left = slope + 2 * curve * least
        blocks = _blocks(left)
        square = (blocks**2).sum()
        # Power is averaged across their borders.
        square += max(0.0, float((blocks[1:] * blocks[:-1]).sum()))
        std = np.sqrt(square * blocks.size / max(blocks.size - 1, 1)) / curvature
        # Few blocks scatter little by chance.
        std = max(std, _LEAST_STD / np.sqrt(curvature))
        return float(least + lean / (2 * bend)), float(std)


def _blocks(values: Floats) -> Floats:
    """Return the sums of values (range,) over blocks of ranges with other speckle."""
    return np.asarray(np.add.reduceat(values, np.arange(0, values.size, _LOOKS)))
