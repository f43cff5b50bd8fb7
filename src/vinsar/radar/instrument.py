"""The performance of a radar from its antennas and waveform alone: each quantity derived once.

Wavelength, resolution, ambiguities in range, width and height, and the critical baseline, for any
arrangement of antennas. All of it follows from the two apertures (`vinsar.radar.aperture`): path
and slope of the lower one and the difference of the paths locate a target, and the rest follows
from the gradients of these three on the ground. On the paper's rail the results are its formulas
without the plane-wave approximation (`vinsar.radar.formulas`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.radar import aperture, geometry, trajectory, waveform

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.radar.trajectory import Radar

    Floats = NDArray[np.floating]

# Lengths tried for the critical baseline, in units of the baseline.
_FACTORS = np.geomspace(1e-3, 1e5, 161)
_BISECTIONS = 50

# Phases err by no more than so many standard deviations: 0.3 % of them do, and the median over a
# window of pixels takes the rest.
_SIGMAS = 3.0

# More antennas than this say that noise is the trouble.
_MOST_STEPS = 8

# Steps to the baseline of a height of ambiguity, which is nearly inverse to it.
_STEPS = 8


@dataclass(frozen=True)
class Ground:
    """Points of the ground plane as an instrument sees them.

    Attributes
    ----------
    instrument
        The instrument.
    x, y
        Points, m, of shapes that broadcast.
    """

    instrument: Instrument
    x: ArrayLike
    y: ArrayLike

    @cached_property
    def gradients(self) -> tuple[Floats, Floats]:
        """Gradients of the lower aperture's path and slope, each (3, ...), m/m."""
        return aperture.gradients(self.instrument.lower, self.x, self.y)

    @property
    def resolution(self) -> Floats:
        """Resolution in x and y (2, ...), m.

        In y the path's cell ``c / W`` over the path's derivative by y; in x the wavelength over
        the derivative by x of the path's change along the aperture. On a rail that is
        ``lambda r / 2L`` over the squared cosine of the squint, by which the aperture shortens and
        the angle turns; with one end that stands still, twice as much.
        """
        path, slope = self.gradients
        across = self.instrument.wavelength / slope[0]
        return np.abs(np.stack([across, 2 * self.instrument.range_resolution / path[1]]))

    @cached_property
    def _rising(self) -> Floats:
        """Direction in which a target rises and keeps its pixel, ``grad path_1 x grad slope_1``."""
        return aperture.cross(*self.gradients)

    @property
    def drift(self) -> Floats:
        """How a pixel's target moves in x and in y as its height rises (2, ...), m/m."""
        return np.asarray(self._rising[:2] / self._rising[2])

    @property
    def height_per_difference(self) -> Floats:
        """Derivative of the height by the difference of the paths, lower less upper, m/m.

        A target moves with its height along ``t = grad path_1 x grad slope_1``, which keeps it in
        its pixel; the difference changes by ``-(t . grad path_2) / t_z`` for each metre.
        """
        other, _ = aperture.gradients(self.instrument.upper, self.x, self.y)
        return np.asarray(-self._rising[2] / (self._rising * other).sum(axis=0))


@dataclass(frozen=True)
class Instrument:
    """Two apertures and a stepped waveform.

    Attributes
    ----------
    lower, upper
        The apertures of the channels.
    positions
        Number of antenna positions of a channel.
    frequency
        Evenly spaced frequencies (frequency,), Hz.
    """

    lower: aperture.Aperture
    upper: aperture.Aperture
    positions: int
    frequency: Floats

    @classmethod
    def of(cls, antennas: xr.Dataset, frequency: Floats) -> Instrument:
        """Return the instrument of some antenna positions.

        Parameters
        ----------
        antennas
            Product ``trajectory``, or ``images``.
        frequency
            Frequencies, Hz.
        """
        lower, upper = trajectory.apertures(antennas)
        return cls(lower, upper, antennas["receiver"].sizes["position"], frequency)

    @classmethod
    def planned(cls, radar: Radar) -> Instrument:
        """Return the instrument of a configuration's section ``radar``, without any errors."""
        return cls.of(trajectory.planned(radar), waveform.sampled(radar))

    @property
    def wavelength(self) -> float:
        """Wavelength of the carrier, m."""
        return waveform.wavelength(waveform.carrier(self.frequency))

    @property
    def shortest_wavelength(self) -> float:
        """Wavelength at the upper end of the band, m."""
        return waveform.wavelength(float(self.frequency[-1]))

    @property
    def frequency_step(self) -> float:
        """Step of the frequencies, Hz."""
        return float(self.frequency[1] - self.frequency[0])

    @property
    def range_resolution(self) -> float:
        """Slant-range resolution ``c / 2W``, m."""
        return waveform.range_resolution(float(self.frequency[-1] - self.frequency[0]))

    @property
    def unambiguous_range(self) -> float:
        """Slant range after which the waveform repeats, m."""
        return waveform.unambiguous_range(self.frequency_step)

    @property
    def separated(self) -> tuple[Floats, Floats]:
        """Places (3,) of the lower and the upper of the antennas that the baseline separates, m."""
        ends = (
            (self.lower.receiver, self.upper.receiver),
            (self.lower.transmitter, self.upper.transmitter),
        )
        return max(ends, key=lambda pair: float(np.linalg.norm(pair[1] - pair[0])))

    @property
    def baseline(self) -> float:
        """Distance of the antennas that the baseline separates, m."""
        lower, upper = self.separated
        return float(np.linalg.norm(upper - lower))

    @property
    def foremost(self) -> float:
        """How far ahead an antenna stands at most, y in m."""
        return max(
            float(end[1] + abs(travel[1]) / 2)
            for part in (self.lower, self.upper)
            for end, travel in (
                (part.transmitter, part.transmitter_travel),
                (part.receiver, part.receiver_travel),
            )
        )

    @property
    def lowest(self) -> float:
        """Height of the lowest antenna, m."""
        return min(
            float(end[2])
            for part in (self.lower, self.upper)
            for end in (part.transmitter, part.receiver)
        )

    def slant_range(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return half the lower aperture's path to points of the ground plane, m."""
        return aperture.path(self.lower, x, y) / 2

    def look_angle(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the look angle from nadir at the lower aperture's centre, rad."""
        return geometry.look_angle(self.lower.center, x, y)

    def over(self, x: ArrayLike, y: ArrayLike) -> Ground:
        """Return points of the ground plane, m, of shapes that broadcast, as it sees them."""
        return Ground(self, x, y)

    def resolution(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the resolution at points of the ground plane in x and y (2, ...), m."""
        return self.over(x, y).resolution

    def looks(self, side_m: float, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the independent looks of a square window: its area in resolution cells.

        Parameters
        ----------
        side_m
            Side of the window, m.
        x, y
            Points, m, of shapes that broadcast.

        Returns
        -------
        ndarray
            Looks, at least 1: pixels finer than the resolution are not independent.
        """
        across, ahead = self.resolution(x, y)
        return np.maximum(1.0, side_m**2 / (across * ahead))

    def height_of_ambiguity(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the height that turns the phase of a pixel by a cycle, m, without its sign.

        On a rail with a vertical baseline that is ``lambda r2 / 2B``; with one end of the path
        common to both channels, twice as much.
        """
        return np.abs(self.wavelength * self.over(x, y).height_per_difference)

    def scaled(self, factor: float) -> Instrument:
        """Return the instrument with so many times the baseline, in the same attitude."""
        ends = {
            name: mine + factor * (getattr(self.upper, name) - mine)
            for name in ("transmitter", "receiver")
            for mine in (getattr(self.lower, name),)
        }
        return replace(self, upper=replace(self.upper, **ends))

    def unwrapped_baseline(
        self, height_m: float, x: ArrayLike, y: ArrayLike, *, phase_std: float = 0.0
    ) -> float:
        """Return the longest baseline of this attitude that tells objects without unwrapping, m.

        Heights up to `height_m` above or below the reference stay within half a cycle of it: the
        height of ambiguity is twice `height_m`, and more by what noise takes of the half cycle.

        Parameters
        ----------
        height_m
            Height of the objects, or depth, m.
        x, y
            Points, m, of shapes that broadcast; the worst of them counts.
        phase_std
            Standard deviation of the filtered phase, rad.

        Returns
        -------
        float
            Length, m; 0 if noise alone takes the half cycle.

        Raises
        ------
        ValueError
            If the height is not positive.
        """
        if height_m <= 0:
            raise ValueError(f"objects of {height_m:g} m have no height to tell: take one above 0")
        left = 1 - _SIGMAS * phase_std / np.pi
        if left <= 0:
            return 0.0
        factor = 1.0
        for _ in range(_STEPS):
            cycle = float(self.scaled(factor).height_of_ambiguity(x, y).min())
            factor *= cycle * left / (2 * height_m)
        return factor * self.baseline

    def settling_baselines(
        self, height_m: float, x: ArrayLike, y: ArrayLike, *, phase_std: float = 0.0
    ) -> tuple[float, ...]:
        """Return the baselines, up to this one, that tell upright objects their whole cycles.

        The shortest needs no unwrapping (`unwrapped_baseline`), and each settles the next one's
        cycles (`settles`).

        Parameters
        ----------
        height_m, x, y, phase_std
            As in `unwrapped_baseline`.

        Returns
        -------
        tuple of float
            Lengths, rising, m; this baseline alone if it is short enough, nothing if the phase is
            too noisy for any.

        Raises
        ------
        ValueError
            If the height is not positive.
        """
        first = self.unwrapped_baseline(height_m, x, y, phase_std=phase_std)
        if first >= self.baseline:
            return (self.baseline,)
        if first == 0 or not settles(1.0, phase_std):
            return ()
        ratio, steps = self.baseline / first, 1
        while not settles(ratio ** (1 / steps), phase_std):
            steps += 1
            if steps > _MOST_STEPS:
                return ()
        return tuple(self.baseline * ratio ** (step / steps - 1) for step in range(steps + 1))

    def random_phase_std(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the standard deviation of the height under a phase that is noise, m.

        A phase uniform over a cycle makes heights uniform over the height of ambiguity.
        """
        return self.height_of_ambiguity(x, y) / np.sqrt(12)

    def geometric_coherence(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the coherence that the baseline leaves level ground.

        Each channel sees the ground's wavenumbers along y in a band of its own, the frequencies
        times ``|dpath / dy| / c``. What the bands share is common to the images. For a plane wave
        that is ``1 - B_perp / B_crit``.
        """
        return self._shared_band(np.asarray(1.0), x, y)

    def critical_baseline(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the baseline of the same attitude that decorrelates level ground, m.

        The shortest with which the channels see no wavenumber of the ground in common
        (`geometric_coherence`); infinite if there is none. The formula for a plane wave
        (`formulas.critical_baseline`) is the limit of a waveform of narrow band, whose critical
        baseline is short against the range and the antennas' height.

        Parameters
        ----------
        x, y
            Points, m, of shapes that broadcast.

        Returns
        -------
        ndarray
            Length, m.
        """
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        factors = _FACTORS.reshape(-1, *(1,) * x.ndim)
        gone = self._shared_band(factors, x, y) == 0
        first = np.argmax(gone, axis=0)
        low, high = _FACTORS[np.maximum(first - 1, 0)], _FACTORS[first]
        _, high = _bisected(lambda factor: self._shared_band(factor, x, y) == 0, low, high)
        return np.where(gone.any(axis=0), self.baseline * high, np.inf)

    def _shared_band(self, factor: Floats, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the coherence of level ground with so many times the baseline."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        slopes: list[Floats] = []
        for times in (np.zeros_like(factor), factor):
            slope: Floats = np.zeros(())
            for mine, other in (
                (self.lower.transmitter, self.upper.transmitter),
                (self.lower.receiver, self.upper.receiver),
            ):
                # Nothing to move where a channel shares its antenna: shapes broadcast.
                end = [a + times * (b - a) for a, b in zip(mine, other, strict=True)]
                ahead = y - end[1]
                slope = slope + ahead / np.sqrt((x - end[0]) ** 2 + ahead**2 + end[2] ** 2)
            slopes.append(np.abs(slope))
        low, high = self.frequency[0], self.frequency[-1]
        least, most = np.minimum(*slopes), np.maximum(*slopes)
        shared = high * least - low * most
        return np.clip(shared / ((high - low) * np.sqrt(least * most)), 0, 1)

    def growth(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return by how much the lower path grows from one position to the next, in the mean, m.

        Targets are ambiguous if the growth of their paths differs by a wavelength (grating lobes).
        """
        part = self.lower
        first, last = (
            geometry.slant_range(part.transmitter + end * part.transmitter_travel, x, y)
            + geometry.slant_range(part.receiver + end * part.receiver_travel, x, y)
            for end in (-0.5, 0.5)
        )
        return np.asarray(last - first) / max(self.positions - 1, 1)

    def filled(self, x_min_m: float, x_max_m: float, y: ArrayLike) -> Floats:
        """Return the share of the unambiguous width that ground from x_min to x_max fills.

        At the carrier; above 1 it folds over itself.
        """
        return np.abs(self.growth(x_max_m, y) - self.growth(x_min_m, y)) / self.wavelength

    def widest_spacing(self, x: ArrayLike, y: ArrayLike) -> float:
        """Return the widest mean spacing of the positions that images all of some points once, m.

        Parameters
        ----------
        x, y
            Points, m, of shapes that broadcast.

        Returns
        -------
        float
            Spacing along the aperture at which the growth of the paths to two of them differs by
            the shortest wavelength; infinite for points without a difference.
        """
        travel = max(
            float(np.linalg.norm(part))
            for part in (self.lower.transmitter_travel, self.lower.receiver_travel)
        )
        spacing = travel / max(self.positions - 1, 1)
        spread = float(np.ptp(self.growth(x, y)))
        return spacing * self.shortest_wavelength / spread if spread > 0 else math.inf

    def unambiguous_width(self, x: float, y: float) -> float:
        """Return the width around x that the spacing of the positions images once, m.

        By the shortest wavelength; infinite if no two targets are ambiguous.
        """

        def ambiguous(width: Floats) -> Floats:
            left, right = self.growth(x + width * np.array([-0.5, 0.5]), y)
            return np.abs(right - left) > self.shortest_wavelength

        widest = np.array(1e4)
        if not ambiguous(widest):
            return math.inf
        return float(_bisected(ambiguous, np.zeros(()), widest)[0])


def _bisected(
    beyond: Callable[[Floats], Floats], low: Floats, high: Floats
) -> tuple[Floats, Floats]:
    """Return bounds, of one shape, drawn together around where a condition begins to hold.

    SciPy's search does as much, but every start of the workflow would wait to load it.
    """
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        there = beyond(middle)
        low, high = np.where(there, low, middle), np.where(there, middle, high)
    return low, high


def settles(ratio: float, phase_std: float) -> bool:
    """Tell whether a baseline's phase settles the whole cycles of one so many times as long.

    It predicts the longer one's phase with its own error times the ratio, which with the longer
    one's own must stay within half a cycle: ``3 std sqrt(1 + ratio^2) < pi``.

    Parameters
    ----------
    ratio
        Longer baseline over shorter one.
    phase_std
        Standard deviation of the filtered phase of either, rad.
    """
    return _SIGMAS * phase_std * math.sqrt(1 + ratio**2) < math.pi


def middle(area: Any) -> tuple[float, float]:
    """Return the middle of a part of the ground, x and y in m.

    Parameters
    ----------
    area
        Section ``scene`` or ``imaging`` of the configuration.
    """
    return (area.x_min_m + area.x_max_m) / 2, (area.y_min_m + area.y_max_m) / 2
