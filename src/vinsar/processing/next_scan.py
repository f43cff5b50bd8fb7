"""The vehicle's speed from two scans of one drive, registered on each other.

The cart scans once more on its way back, and so the aperture of the next scan is turned to the
other side. A wrong speed turns the two images of the same ground apart, by twice the error of the
yaw angle, and sets them off along the drive by the error times the interval (docs/autofocus.md).
Speckle that both scans see from nearly the same directions is coherent only where it lies on
itself: `estimate` focuses both scans with one speed after the other and takes the one of the
largest coherence, window by window, whatever phase lies between them.

What is not on the ground plane is displaced by a turned aperture as well, to the other side in the
next scan. So windows are focused on the heights that the two antennas tell.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations.constants import NORMAL_PER_MAD
from vinsar.processing import focusing
from vinsar.processing.speed import Speed, unusable, weighed
from vinsar.radar import motion, trajectory, waveform

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

logger = logging.getLogger(__name__)

_OVERSAMPLING = 8
_MARGIN_M = 0.5

# Of more than two antennas, the outer ones.
_OUTER = [0, -1]

# Pixels in a resolution cell across and along the drive, pixels at most, and a window's sides.
_PER_CELL, _MOST_PIXELS, _WINDOW = (3.0, 2.0), 40_000, 10

# Speeds tried, in steps that turn the images apart by half a cell of the aperture's resolution:
# from one to the next, standard deviations of the sensor at most, to both sides at least, and at
# most so many in all.
_APART, _REACH, _FEWEST, _MOST = 1.5, 4.0, 12, 1001

# How far the best match must lie above the median of all, in their spread.
_CLEAR = 8.0

# Heights tried: so many to a cycle of the phase between the antennas, from level ground. A cycle
# away from it the match must be better by so much of the power; of the ground as a whole, the
# likelihood by such a share.
_TO_CYCLE, _LOW, _HIGH = 8, -5, 11
_NEARER, _RATHER = 0.1, 0.15

# A step of height, m, and the least that a metre of it may change the path between the antennas.
_SMALL_M = 0.01

# Rounds of heights and speed at most; speeds tried in each, in steps, from the last one; what that
# is multiplied by from round to round, and how far. The best and its neighbours make a parabola.
_ROUNDS, _SETTLED = 6, 0.01
_NEAR, _FIT = np.linspace(-1.25, 1.25, 9), 2
_CLOSER, _CLOSEST = 1 / 3, 0.1

# What the registration is trusted to, in steps: a twenty-fifth of a cell.
_LEAST_STD = 0.08

# Least of what a window lacks to full coherence.
_LEAST = 1e-6


def estimate(
    echoes: tuple[xr.Dataset, xr.Dataset],
    recorded: tuple[xr.Dataset, xr.Dataset],
    *,
    extent: tuple[float, float, float, float],
    duration_s: float,
    interval_s: float,
    sensor_std_m_per_s: float,
) -> Speed:
    """Estimate the error of the recorded speed from two scans of one drive.

    Parameters
    ----------
    echoes
        Product ``received`` of the scan and of the next one, without leakage.
    recorded
        Product ``trajectory`` of both: the positions by the speed sensor
        (`vinsar.radar.motion.return_scan`).
    extent
        Ground that echoes come from (x_min, x_max, y_min, y_max), m, which must lie ahead.
    duration_s
        Time from the first position of a scan to the last, s.
    interval_s
        Time from the beginning of the scan to that of the next one, s.
    sensor_std_m_per_s
        Stated standard deviation of the sensor, m/s.

    Returns
    -------
    Speed
        The correction, weighed against the sensor by both standard deviations. Where the scans
        cannot tell it, it is 0, the reason is given, and a warning is logged.
    """

    def nothing(reason: str) -> Speed:
        logger.warning("next scan: no correction of the speed, because %s", reason)
        return Speed(0.0, sensor_std_m_per_s, reason)

    if reason := unusable(echoes, sensor_std_m_per_s):
        return nothing(reason)
    if recorded[0].sizes["channel"] == 1:
        return nothing("one antenna tells no heights, which would be taken for speed")
    carrier = waveform.carrier(echoes[0]["frequency"].values)
    step = waveform.wavelength(carrier) / (8 * duration_s)
    most = max(_FEWEST, int(np.ceil(_REACH * sensor_std_m_per_s / (_APART * step))) + 1)
    if 2 * most + 1 > _MOST:
        return nothing(
            f"the sensor leaves {2 * most + 1} speeds to try, of {_MOST} at most: it is too coarse "
            "for so long a scan"
        )
    tried = _APART * step * np.arange(-most, most + 1)
    pair = _Pair(echoes, recorded, extent, duration_s, interval_s)
    if not pair.compress(echoes, float(tried[-1])):
        return nothing(
            "ranges repeat among those of the speeds that the sensor allows; take more frequencies"
        )
    level = pair.level()
    match = pair.matches(tried, level)
    best = int(match.argmax())
    spread = NORMAL_PER_MAD * np.median(np.abs(match - np.median(match)))
    if not match[best] - np.median(match) > _CLEAR * spread or not 0 < best < 2 * most:
        return nothing("at no speed of those that the sensor allows do both scans clearly match")
    # Ground a cycle higher would match nearly as well at another speed.
    candidates = []
    for cycles in (-1, 0, 1):
        about, ground = tried[best] + cycles * pair.alike(), level + cycles * pair.cycle
        speed, std, cost = pair.best(about + step * _NEAR, pair.surface(about, ground))
        candidates.append((cost * (1 if cycles else 1 + _RATHER), speed, std, ground))
    _, found, std, level = min(candidates)
    closer = _CLOSER
    for _ in range(_ROUNDS):
        before = found
        found, std, _ = pair.best(found + closer * step * _NEAR, pair.surface(found, level))
        if closer == _CLOSEST and abs(found - before) < _SETTLED * step:
            break
        closer = max(_CLOSER * closer, _CLOSEST)
    if not np.isfinite(std):
        return nothing("at no speed do both scans match best")
    std = float(np.hypot(std, _LEAST_STD * step))
    result = weighed(found, std, sensor_std_m_per_s)
    if result.reason:
        return nothing(result.reason)
    logger.info(
        "next scan: speed corrected by %+.4f m/s, known to %.4f m/s", result.correction, std
    )
    return result


class _Pair:
    """Two scans of the same ground, focused with a speed."""

    def __init__(
        self,
        echoes: tuple[xr.Dataset, xr.Dataset],
        recorded: tuple[xr.Dataset, xr.Dataset],
        extent: tuple[float, float, float, float],
        duration_s: float,
        interval_s: float,
    ) -> None:
        self.recorded = [scan.isel(channel=_OUTER) for scan in recorded]
        count = recorded[0].sizes["position"]
        self.time = [
            duration_s * np.linspace(-0.5, 0.5, count),
            motion.return_time(count, duration_s=duration_s, interval_s=interval_s),
        ]
        frequency = echoes[0]["frequency"].values
        self.wavelength = waveform.wavelength(waveform.carrier(frequency))
        cell = waveform.range_resolution(float(frequency[-1] - frequency[0]))
        self.x, self.y = self._axes(extent, cell)
        self.cycle = self._cycle()
        self.profiles: list[xr.Dataset] = []

    def compress(self, echoes: tuple[xr.Dataset, xr.Dataset], reach: float) -> bool:
        """Compress the echoes for speeds off by so much, m/s; return whether that can be."""
        for echo, scan, time in zip(echoes, self.recorded, self.time, strict=True):
            frequency = echo["frequency"].values
            near, far = trajectory.range_extent(scan, self.x, self.y)
            margin = reach * float(np.abs(time).max()) + _MARGIN_M
            near, far = max(near - margin, 0.0), far + margin
            if far - near > waveform.unambiguous_range(float(frequency[1] - frequency[0])):
                return False
            self.profiles.append(
                focusing.compress(
                    echo.isel(channel=_OUTER),
                    near_range_m=near,
                    far_range_m=far,
                    oversampling=_OVERSAMPLING,
                )
            )
        return True

    def _axes(
        self, extent: tuple[float, float, float, float], cell: float
    ) -> tuple[Floats, Floats]:
        ends = [self.recorded[0][name].values[0] for name in ("transmitter", "receiver")]
        middle = (ends[0] + ends[1]) / 2
        distance = np.hypot(*(extent[2] - middle[:, 1].mean(), middle[:, 2].mean()))
        across = self.wavelength * distance / (2 * np.ptp(middle[:, 0]))
        sizes = extent[1] - extent[0], extent[3] - extent[2]
        steps = np.array([across / _PER_CELL[0], cell / _PER_CELL[1]])
        pixels = sizes[0] * sizes[1] / steps.prod()
        steps *= max(1.0, np.sqrt(pixels / _MOST_PIXELS))
        x, y = (
            np.linspace(low, high, max(2 * _WINDOW, int(size / step) // _WINDOW * _WINDOW))
            for low, high, size, step in zip(extent[::2], extent[1::2], sizes, steps, strict=True)
        )
        return x, y

    def images(
        self, speed: float, surface: Floats | float = 0.0, channels: slice = slice(None)
    ) -> tuple[Complexes, Complexes]:
        """Return the images (channel, y, x) of both scans."""
        found = []
        for profiles, scan, time in zip(self.profiles, self.recorded, self.time, strict=True):
            moved = np.zeros((time.size, 3))
            moved[:, 1] = speed * time
            image = focusing.backproject(
                profiles.isel(channel=channels),
                trajectory.displaced(scan.isel(channel=channels), moved),
                x=self.x,
                y=self.y,
                z=surface,
            )
            found.append(image["image"].values)
        return found[0], found[1]

    def coherence(self, first: Complexes, second: Complexes) -> Floats:
        """Return the squared coherence (channel, window, window) of the scans."""
        power = _windows(np.abs(first) ** 2) * _windows(np.abs(second) ** 2)
        cross = np.abs(_windows(first * second.conj())) ** 2
        return np.asarray(cross / (power + np.finfo(np.float32).tiny))

    def level(self) -> float:
        """Return the height of most of the ground, m, less than half a cycle from the plane."""
        heights = self.cycle * np.arange(_TO_CYCLE) / _TO_CYCLE
        between = []
        for height in heights:
            first, second = self.images(0.0, float(height))
            between.append((first[0] * first[1].conj() + second[0] * second[1].conj()).sum().real)
        angle = np.angle(np.sum(np.array(between) * np.exp(2j * np.pi * heights / self.cycle)))
        return float(self.cycle * angle / (2 * np.pi))

    def matches(self, speeds: Floats, level: float) -> Floats:
        """Return how well the scans match at each speed, by one antenna on level ground.

        The mean fourth power of the coherence: what few windows of level ground share counts.
        """
        one = slice(1)
        found = [self.coherence(*self.images(float(speed), level, one)) for speed in speeds]
        return np.array([(square**2).mean() for square in found])

    def alike(self) -> float:
        """Return the change of the speed, m/s, that turns the images as a cycle of height does."""
        middle = np.array([[self.x.mean(), self.y.mean(), 0.0]])
        moves = [
            motion.image_moves(scan, time, middle)[0, 0]
            for scan, time in zip(self.recorded, self.time, strict=True)
        ]
        by_speed, by_height = moves[0] - moves[1]
        return float(self.cycle * by_height / by_speed)

    def surface(self, speed: float, level: float) -> Floats:
        """Return the heights (y, x) that the antennas tell, m.

        Of the heights a cycle of their phase apart, the one at which the scans match as well.
        """
        heights = level + self.cycle * np.arange(_LOW, _HIGH + 1) / _TO_CYCLE
        both, antennas = [], []
        for height in heights:
            first, second = self.images(speed, float(height))
            power = _windows((np.abs(first) ** 2 + np.abs(second) ** 2).sum(axis=0))
            between = _windows(first[0] * first[1].conj() + second[0] * second[1].conj()).real
            scans = np.abs(_windows(first * second.conj())).sum(axis=0)
            antennas.append(between / power)
            away = _NEARER * abs(height - level) / self.cycle
            both.append((between + scans) / power - away)
        at = np.clip(np.argmax(both, axis=0), 1, heights.size - 2)[None]
        before, here, after = (
            np.take_along_axis(np.array(antennas), at + step, 0)[0] for step in (-1, 0, 1)
        )
        bend = np.minimum(before - 2 * here + after, -np.finfo(float).tiny)
        part = np.clip((before - after) / (2 * bend), -1, 1)
        found = heights[at[0]] + part * (heights[1] - heights[0])
        return _spread(found, self.y.size, self.x.size)

    def _cycle(self) -> float:
        """Return the height of a cycle of the phase between the antennas, m, in the middle."""
        heights = np.array([[-_SMALL_M], [_SMALL_M]])
        points = np.concatenate([np.tile([self.x.mean(), self.y.mean()], (2, 1)), heights], axis=1)
        paths = sum(
            np.linalg.norm(points[:, None, None] - self.recorded[0][name].values, axis=-1).mean(-1)
            for name in ("transmitter", "receiver")
        )
        between = np.diff(np.asarray(paths), axis=1)
        change = float(np.abs(np.diff(between, axis=0)).item()) / (2 * _SMALL_M)
        return self.wavelength / max(change, _SMALL_M)

    def best(self, speeds: Floats, surface: Floats) -> tuple[float, float, float]:
        """Return the speed of the best match on a surface, its standard deviation, and its cost."""
        costs = []
        for speed in speeds:
            square = self.coherence(*self.images(float(speed), surface))
            # The likelihood of two images of unknown powers, coherence and phase.
            costs.append(np.log(np.maximum(1 - square, _LEAST)).sum(axis=0).ravel())
        total = np.sum(costs, axis=1)
        middle = int(np.clip(total.argmin(), _FIT, speeds.size - 1 - _FIT))
        part = slice(middle - _FIT, middle + _FIT + 1)
        about = float(speeds[middle])
        _, slope, curve = np.polynomial.polynomial.polyfit(speeds[part] - about, costs[part], 2)
        curvature = 2 * float(curve.sum())
        if curvature <= 0:
            return float(speeds[total.argmin()]), np.inf, float(total.min())
        least = float(np.clip(-slope.sum() / curvature, *(speeds[[0, -1]] - about)))
        # The slopes of windows, each with its own speckle, tell the standard deviation.
        left = slope + 2 * curve * least
        std = np.sqrt((left**2).sum() * left.size / max(left.size - 1, 1)) / curvature
        return about + least, float(std), float(total.min())


def _windows(values: Complexes | Floats) -> Complexes | Floats:
    """Return sums over windows (..., y, x) -> (..., window, window)."""
    rows, columns = (size // _WINDOW for size in values.shape[-2:])
    cut = values[..., : rows * _WINDOW, : columns * _WINDOW]
    split = cut.reshape(*cut.shape[:-2], rows, _WINDOW, columns, _WINDOW)
    return np.asarray(split.sum(axis=(-3, -1)))


def _spread(values: Floats, rows: int, columns: int) -> Floats:
    """Return values of windows between their middles, as pixels."""
    from scipy.ndimage import map_coordinates

    places = [(np.arange(size) + 0.5) / _WINDOW - 0.5 for size in (rows, columns)]
    at = np.meshgrid(*places, indexing="ij")
    return np.asarray(map_coordinates(values, at, order=1, mode="nearest"))
