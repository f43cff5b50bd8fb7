"""What a configuration will achieve, predicted from its geometry and waveform without a run.

Resolution, ambiguities and the effect of a path error on a height are properties of the instrument
(`vinsar.radar.instrument`), for any arrangement of antennas; here they are combined with scene,
image and noise.
On the paper's rail the errors of the baseline are Eqs. 5 and 12 with their exact terms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations import tables
from vinsar.foundations.constants import AXES
from vinsar.processing import filtering
from vinsar.radar import aperture, grid, instrument, motion, speckle, trajectory
from vinsar.radar.instrument import Instrument
from vinsar.study import validation, work

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.processing.focusing import Imaging
    from vinsar.simulation.scene import Scene

    Floats = NDArray[np.floating]

SECTIONS = (
    "radar",
    "scene",
    "measurement",
    "echo",
    "suppression",
    "imaging",
    "filtering",
    "height",
    "accuracy",
)
"""Parts of the configuration that `Sheet` reads."""

PLACES = ("near", "middle", "far")

OF_95_PERCENT = 1.96
"""95 % of a normal distribution lie within this many standard deviations."""

# Up to what share of a resolution cell the images may be shifted against each other.
_REGISTRATION_SHARE = 0.1

_RANGE_SHARE, _WIDTH_SHARE = 0.9, 0.7
_SIDELOBES_DB = -10.0
_SAME_M = 1e-9

# Objects with vertical sides.
_UPRIGHT = ("box", "stump", "ditch", "pit")

# Heights of upright objects for which antennas are recommended, m.
_OBJECTS_M = (0.25, 0.5, 1.0, 2.0)

# Errors tried for a tolerance, as shares of the largest.
_SIZES = np.geomspace(1e-3, 1.0, 13)

# Parts of the image, along x and along y, over which shares of its heights are averaged.
_PARTS = 5

# Targets over the scene's width for the mean of their phases, and Newton's steps to their range.
_TARGETS, _STEPS = 41, 4
_BYTES_PER_SAMPLE = 8

# Share of the power that is not coherent even without noise, as in docs/autofocus.md.
_INCOHERENT = 0.05


def _middles(low: float, high: float) -> Floats:
    """Return the middles of some parts of an extent."""
    return low + (high - low) * (np.arange(_PARTS) + 0.5) / _PARTS


def filter_looks(
    planned: Instrument,
    x: float,
    y: ArrayLike,
    coherence: ArrayLike,
    *,
    options: filtering.Filtering,
    imaging: Imaging,
) -> Floats:
    """Return over how many independent looks the phase filter averages level ground.

    Parameters
    ----------
    planned
        The instrument.
    x, y
        Places, m.
    coherence
        Coherence there, of a shape that broadcasts with `y`.
    options, imaging
        Sections ``filtering`` and ``imaging`` of the configuration.

    Returns
    -------
    ndarray
        Looks, 1 or more (`filtering.effective_looks`).
    """
    y, coherence = np.broadcast_arrays(np.asarray(y, float), np.asarray(coherence, float))
    looks = np.empty(y.shape)
    share = filtering.shifted_share(coherence, planned.geometric_coherence(x, y))
    for row in np.unique(y):
        across, ahead = planned.resolution(x, row) / np.array(grid.pixel(imaging))
        looks[y == row] = filtering.effective_looks(
            coherence[y == row],
            (float(ahead), float(across)),
            windows=(imaging.range_window, imaging.aperture_window),
            shifted=share[y == row],
            **options.model_dump(),
        )
    return looks


@dataclass(frozen=True)
class Tolerance:
    """The effect of an error of the geometry on heights, and how large it may be.

    Attributes
    ----------
    name
        The error.
    unit
        Unit of the error.
    per_unit
        Height error per unit at `PLACES`, m.
    tolerated
        Error that moves a height of the image by the tolerance, at most.
    tolerated_referenced
        The same after the height reference has taken its phase constant.
    """

    name: str
    unit: str
    per_unit: Floats
    tolerated: float
    tolerated_referenced: float


@dataclass(frozen=True)
class Sheet:
    """The predictions for a study.

    Attributes
    ----------
    study
        The configuration, or `SECTIONS` of it.
    """

    study: Study

    @cached_property
    def antennas(self) -> xr.Dataset:
        """Product ``trajectory``."""
        return trajectory.planned(self.study.radar)

    @cached_property
    def instrument(self) -> Instrument:
        """What follows from antennas and waveform alone."""
        return Instrument.planned(self.study.radar)

    @property
    def farthest_range(self) -> float:
        """Farthest slant range of scene and image, m."""
        corners = [
            trajectory.range_extent(
                self.antennas,
                np.array([part.x_min_m, part.x_max_m]),
                np.array([part.y_min_m, part.y_max_m]),
            )[1]
            for part in (self.scene, self.study.imaging)
        ]
        return max(corners)

    @property
    def samples(self) -> int:
        """Samples of a scan."""
        return trajectory.samples(self.study.radar)

    @property
    def scan_duration(self) -> float:
        """Duration of a scan, s."""
        return trajectory.scan_duration(self.study.radar, self.study.vehicle)

    @property
    def scene(self) -> Scene | Imaging:
        """What scatters: the scene, or the image's ground where echoes are measured."""
        measured = self.study.measurement.file is not None
        return self.study.imaging if measured else self.study.scene

    @property
    def relief(self) -> float:
        """Height of the scene's highest obstacle or top, m; of `peaks` where none is declared."""
        part = self.study.scene
        heights = [float(getattr(item, "height_m", 0.0)) for item in part.objects]
        if part.terrain != "flat" or not any(heights):
            heights.append(part.peak_height_m)
        return max(heights)

    @property
    def x(self) -> float:
        """Middle of the image along x, m."""
        return (self.study.imaging.x_min_m + self.study.imaging.x_max_m) / 2

    @property
    def places(self) -> Floats:
        """The image's near edge, middle and far edge, y in m."""
        part = self.study.imaging
        return np.array([part.y_min_m, (part.y_min_m + part.y_max_m) / 2, part.y_max_m])

    def snr_db(self, y: ArrayLike) -> Floats:
        """Return the signal-to-noise ratio of a range cell, dB; infinite without noise."""
        part = self.study.echo
        y = np.asarray(y, float)
        if part.snr_db is None:
            return np.full(y.shape, np.inf)
        if not part.spreading:
            return np.full(y.shape, part.snr_db)
        middle = self.instrument.slant_range(self.x, instrument.middle(self.scene)[1])
        return part.snr_db - 40 * np.log10(self.instrument.slant_range(self.x, y) / middle)

    def complex_coherence(
        self,
        x: ArrayLike,
        y: ArrayLike,
        position_errors: ArrayLike = 0.0,
        *,
        common: bool = False,
    ) -> NDArray[np.complexfloating]:
        """Return the coherence of level ground that baseline, noise and position errors leave.

        White position errors that give the echoes phases of variance v leave ``s = exp(-v)`` of a
        target's power in focus and spread the rest evenly over all paths' growths from position to
        position, which repeats after a wavelength (`speckle.pixel_coherence`). If both channels
        share the errors, both images contain the same spread targets, each with the phase
        difference of its own place instead of the pixel's. With a vertical baseline that makes no
        difference over level ground; otherwise it adds a mean phase and decorrelates.

        Parameters
        ----------
        x, y
            Points, m, of shapes that broadcast.
        position_errors
            Standard deviation of the echoes' phase at each position and channel, rad.
        common
            Whether both channels share the errors.

        Returns
        -------
        ndarray
            Coherence; its angle is the error of the phase, rad.
        """
        x, y, errors = np.broadcast_arrays(x, y, np.asarray(position_errors, float))
        part, planned = self.scene, self.instrument
        filled = planned.filled(part.x_min_m, part.x_max_m, y)
        focused = np.exp(-(errors**2))
        return speckle.pixel_coherence(
            planned.geometric_coherence(x, y),
            self.snr_db(y),
            filled,
            focused,
            self._spread_phasor(x, y) if common else 0j,
        )

    def _spread_phasor(self, x: Floats, y: Floats) -> NDArray[np.complexfloating]:
        """Return the mean of what level ground at a pixel's range adds to its interferogram.

        The targets over the scene's width whose lower path is the pixel's, evenly by the growth of
        their paths, at the phase by which their upper path differs.
        """
        part, planned = self.scene, self.instrument
        across = np.linspace(part.x_min_m, part.x_max_m, _TARGETS).reshape(-1, *(1,) * x.ndim)
        wanted = aperture.path(planned.lower, x, y)
        ahead = np.broadcast_to(y, np.broadcast_shapes(across.shape, y.shape)).copy()
        for _ in range(_STEPS):
            slope = aperture.gradients(planned.lower, across, ahead)[0][1]
            ahead -= (aperture.path(planned.lower, across, ahead) - wanted) / slope
        longer = aperture.path(planned.upper, across, ahead) - aperture.path(planned.upper, x, y)
        weight = np.abs(np.gradient(planned.growth(across, ahead), axis=0))
        phasor = np.exp(2j * np.pi / planned.wavelength * longer)
        return np.asarray((weight * phasor).sum(axis=0) / weight.sum(axis=0))

    def coherence(self, y: ArrayLike, position_errors: ArrayLike = 0.0) -> Floats:
        """Return the coherence at the middle of the image's rows, with independent errors.

        Parameters
        ----------
        y
            Distance ahead, m.
        position_errors
            As in `complex_coherence`.

        Returns
        -------
        ndarray
            Coherence.
        """
        return np.abs(self.complex_coherence(self.x, y, position_errors))

    def looks(self, y: ArrayLike, coherence: ArrayLike) -> Floats:
        """Return over how many independent looks the phase filter averages (`filter_looks`)."""
        return filter_looks(
            self.instrument,
            self.x,
            y,
            coherence,
            options=self.study.filtering,
            imaging=self.study.imaging,
        )

    def height_std(self, y: ArrayLike, position_errors: ArrayLike = 0.0) -> Floats:
        """Return the predicted standard deviation of the height on visible ground, m.

        That of the phase of the filter's looks (`speckle.phase_std`), as long as it unwraps; of a
        phase that is noise, that of heights anywhere within the height of ambiguity.

        Parameters
        ----------
        y
            Distance ahead, m.
        position_errors
            As in `coherence`.

        Returns
        -------
        ndarray
            Standard deviation, m.
        """
        return self._height_std(self.x, y, self.coherence(y, position_errors))

    def height_bound(self, y: ArrayLike) -> Floats:
        """Return the Cramer-Rao bound of the height's standard deviation, m.

        Of the phase filter's looks at the predicted coherence (`speckle.phase_bound`).

        Parameters
        ----------
        y
            Distance ahead, m.
        """
        coherence = self.coherence(y)
        per_radian = self.instrument.height_of_ambiguity(self.x, y) / (2 * np.pi)
        return np.asarray(per_radian * speckle.phase_bound(coherence, self.looks(y, coherence)))

    def _height_std(self, x: ArrayLike, y: ArrayLike, coherence: Floats) -> Floats:
        per_radian = self.instrument.height_of_ambiguity(x, y) / (2 * np.pi)
        return np.asarray(per_radian * speckle.phase_std(coherence, self.looks(y, coherence)))

    def scene_height_std(self, axis: int = 0, position_std_m: float = 0.0) -> float:
        """Return the predicted height noise over the image: the root of its mean square, m.

        Parameters
        ----------
        axis
            Axis of white position errors, of each channel's own.
        position_std_m
            Their standard deviation, m.
        """
        part = self.study.imaging
        x, y = np.linspace(part.x_min_m, part.x_max_m, 5)[:, None], self.places
        errors = position_std_m * self.phase_per_position(x, y, axis)
        return float(np.sqrt(np.mean(self.height_std(y, errors) ** 2)))

    def share_within(self, axis: int, position_std_m: float, *, common: bool) -> float:
        """Return the share of the heights of level ground that position errors leave within.

        Within the tolerance, over the image, after the height reference has taken the mean phase of
        its points.

        Parameters
        ----------
        axis
            Axis of the white position errors.
        position_std_m
            Their standard deviation, m.
        common
            Whether both channels share the errors.

        Returns
        -------
        float
            Share, 0 to 1.
        """
        from scipy.stats import norm

        part, planned = self.study.imaging, self.instrument

        def fringe(x: Floats, y: Floats) -> tuple[NDArray[np.complexfloating], Floats]:
            errors = position_std_m * self.phase_per_position(x, y, axis)
            return self.complex_coherence(x, y, errors, common=common), errors**2

        x, y = (
            _middles(getattr(part, f"{axis}_min_m"), getattr(part, f"{axis}_max_m"))
            for axis in "xy"
        )
        x = x[:, None]
        found, variance = fringe(x, y)
        shift = np.angle(found)
        if common:
            shift -= np.median(np.angle(fringe(*self._reference())[0]))
        per_radian = planned.height_of_ambiguity(x, y) / (2 * np.pi)
        bias = per_radian * shift
        # A scan draws as many errors as it has positions: sqrt(2 / N) of their variance v, of
        # which the shift has the share of exp(v) - 1, what is spread over what is in focus.
        chance = np.abs(bias) * variance / np.maximum(-np.expm1(-variance), 1e-12)
        std = np.hypot(
            self._height_std(x, y, np.abs(found)), chance * np.sqrt(2 / planned.positions)
        )
        std = np.maximum(std, 1e-12)
        most = self.study.accuracy.tolerance_m
        within = norm.cdf((most - bias) / std) - norm.cdf((-most - bias) / std)
        return float(within.mean())

    def pairs(self) -> dict[float, Instrument]:
        """Return the lower antenna with each other one, by the length of the baseline in m."""
        part = self.study.radar
        return {
            length: Instrument.planned(part.model_copy(update=trajectory.longest(length, None)))
            for length in part.baselines
        }

    def phase_std(self) -> float:
        """Return the standard deviation of the filtered phase where it is largest, rad."""
        coherence = self.coherence(self.places)
        return float(speckle.phase_std(coherence, self.looks(self.places, coherence)).max())

    def settling_baselines(self, height_m: float) -> tuple[float, ...]:
        """Return the baselines that tell upright objects of a height, near and far, m.

        Parameters
        ----------
        height_m
            Height of the objects, or depth, m.

        Returns
        -------
        tuple of float
            Lengths, rising (`Instrument.settling_baselines`).
        """
        found = self.instrument.settling_baselines(
            height_m, self.x, self.places, phase_std=self.phase_std()
        )
        # The longest as it is configured, not as a distance of antennas.
        return (*found[:-1], self.study.radar.baseline_m) if found else ()

    def shadow_length(self, y: ArrayLike) -> Floats:
        """Return how far an obstacle as high as the scene's relief hides the ground behind it, m.

        Infinite where it is as high as the lowest antenna.
        """
        height, lowest = self.relief, self.instrument.lowest
        if height >= lowest:
            return np.full(np.shape(y), np.inf)
        return np.asarray(y, float) * height / (lowest - height)

    def registration_shift(self, y: ArrayLike) -> Floats:
        """Return by how much the images of a target as high as the relief differ in y, m."""
        height = self.relief
        lower, upper = (
            aperture.image_position(part, self.x, y, height)[1]
            for part in (self.instrument.lower, self.instrument.upper)
        )
        return np.abs(lower - upper)

    def height_per_offset(self, x: ArrayLike, y: ArrayLike, direction: Floats) -> Floats:
        """Return the height error per offset of the upper antenna against the lower, m/m.

        The inversion assumes it farther along a direction than it is. Where the
        channels share their receivers or their transmitter, the other end alone has the offset.

        Parameters
        ----------
        x, y
            Targets on the ground plane, m, of shapes that broadcast.
        direction
            Direction of the offset (axis,), per unit of it.

        Returns
        -------
        ndarray
            Height error, m per unit.
        """
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        target = np.stack([x, y, np.zeros(x.shape)], axis=-1)
        lower, upper = self.instrument.lower, self.instrument.upper
        path = np.zeros(x.shape)
        for mine, other in (
            (upper.transmitter, lower.transmitter),
            (upper.receiver, lower.receiver),
        ):
            if np.abs(mine - other).max() > _SAME_M:
                line = target - mine
                path -= line @ direction / np.linalg.norm(line, axis=-1)
        # The difference of the assumed paths, lower less upper, has to equal the measured one.
        return self.instrument.over(x, y).height_per_difference * path

    def _reference(self) -> tuple[Floats, Floats]:
        """Return points that fix the phase constant: corners of level ground, or control points."""
        part = self.study.height
        if part.reference == "level_ground":
            points = [
                (x, y)
                for r in part.level_ground
                for x in (r.x_min_m, r.x_max_m)
                for y in (r.y_min_m, r.y_max_m)
            ]
        else:
            points = [(point.x_m, point.y_m) for point in part.control_points]
        x, y = np.array(points).T
        return x, y

    def offsets(self) -> list[Tolerance]:
        """Return what constant errors of the upper antenna against the lower do to heights.

        Returns
        -------
        list of Tolerance
            Length and attitude of the baseline (Eqs. 5 and 12), and offsets along the axes.
        """
        lower, upper = self.instrument.separated
        line, length = upper - lower, self.instrument.baseline
        along = line / length
        # In the plane across the aperture, upwards from horizontal.
        up = np.array([0.0, -line[2], line[1]])

        def turn(angle: float) -> Floats:
            return np.asarray((math.cos(angle) - 1) * line + math.sin(angle) * up)

        def straight(direction: Floats) -> Callable[[float], Floats]:
            return lambda size: np.asarray(size * direction)

        millimetre, degree = ("mm", 1e-3, length), ("deg", np.pi / 180, np.pi / 2)
        return [
            self._tolerance("length of the baseline (Eq. 5)", *millimetre, along, straight(along)),
            self._tolerance("attitude of the baseline (Eq. 12)", *degree, up, turn),
            *(
                self._tolerance(f"upper antenna along {name}", *millimetre, axis, straight(axis))
                for name, axis in zip(AXES, np.eye(3), strict=True)
            ),
        ]

    def _tolerance(
        self,
        name: str,
        unit: str,
        size: float,
        largest: float,
        direction: Floats,
        step: Callable[[float], Floats],
    ) -> Tolerance:
        """Return an error's tolerance: a unit's size, the largest looked at, its step."""
        return Tolerance(
            name,
            unit,
            size * self.height_per_offset(self.x, self.places, direction),
            *(
                min(self._tolerated(step, sign * largest, referenced) for sign in (1, -1)) / size
                for referenced in (False, True)
            ),
        )

    def _tolerated(
        self, step: Callable[[float], Floats], largest: float, referenced: bool
    ) -> float:
        """Return the least error, towards the largest, that moves a height by the tolerance."""
        from scipy.optimize import brentq

        def excess(size: float) -> float:
            return self.height_error(step(size), referenced=referenced) - most

        most, below = self.study.accuracy.tolerance_m, 0.0
        for size in largest * _SIZES:
            if excess(size) > 0:
                return abs(float(brentq(excess, below, size)))
            below = size
        return math.inf

    def height_error(self, step: Floats, *, referenced: bool) -> float:
        """Return by how much a wrong position of the upper antenna moves a height, at most, m.

        The exact inversion of the phases of level ground, on a grid over the image, with the upper
        one of the antennas that the baseline separates assumed a step away from where it is.

        Parameters
        ----------
        step
            The step (axis,), m.
        referenced
            Whether the height reference has taken its phase constant.

        Returns
        -------
        float
            Largest height error, m; infinite where a phase fits no height.
        """
        part, planned = self.study.imaging, self.instrument
        lower, upper = planned.lower, planned.upper
        ends = {
            name: getattr(upper, name) + step
            for name in ("transmitter", "receiver")
            if np.abs(getattr(upper, name) - getattr(lower, name)).max() > _SAME_M
        }
        told = replace(upper, **ends)

        def phase(antenna: aperture.Aperture, x: Floats, y: Floats) -> Floats:
            return aperture.flat_earth_phase(lower, antenna, x, y, planned.wavelength)

        x, y = np.meshgrid(
            np.linspace(part.x_min_m, part.x_max_m, 5), np.linspace(part.y_min_m, part.y_max_m, 7)
        )
        measured = phase(upper, x, y)
        if referenced:
            points = self._reference()
            measured = measured + np.median(phase(told, *points) - phase(upper, *points))
        *_, height = aperture.locate(lower, told, x, y, measured, planned.wavelength)
        error = np.abs(height).max()
        return math.inf if np.isnan(error) else float(error)

    def phase_per_position(self, x: ArrayLike, y: ArrayLike, axis: int) -> Floats:
        """Return the echo's phase by an error of one antenna position along an axis, rad/m.

        Only ends that move along the aperture have a new position for each echo.
        """
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        target = np.stack([x, y, np.zeros(x.shape)], axis=-1)
        lower = self.instrument.lower
        slope = np.zeros(x.shape)
        for end, travel in (
            (lower.transmitter, lower.transmitter_travel),
            (lower.receiver, lower.receiver_travel),
        ):
            if travel.any():
                line = target - end
                slope += line[..., axis] / np.linalg.norm(line, axis=-1)
        return 2 * np.pi / self.instrument.wavelength * np.abs(slope)

    def tolerated_scatter(self, axis: int, *, common: bool = False) -> float:
        """Return which white position errors keep 95 % of the heights within the tolerance, m.

        Standard deviation along an axis, independent by position; over level ground
        (`share_within`). Relief of more than the height of ambiguity makes errors that the channels
        share as harmful as independent ones.

        Parameters
        ----------
        axis
            Axis of the errors.
        common
            Whether both channels share them, as on a shaking vehicle, or have independent ones.

        Returns
        -------
        float
            Standard deviation, m; 0 if noise alone exceeds the tolerance, infinite if no error
            matters.
        """
        from scipy.optimize import brentq

        def missing(std: float) -> float:
            return 0.95 - self.share_within(axis, std, common=common)

        if missing(0.0) > 0:
            return 0.0
        below = 0.0
        for size in self.instrument.wavelength * _SIZES:
            if missing(size) > 0:
                return float(brentq(missing, below, size, xtol=1e-7))
            below = size
        return math.inf

    def coupling_db(self) -> float | None:
        """Return the coupling's strongest sidelobes in the image over the scene, dB.

        By the envelope of a rectangular window's sidelobes, ``1 / (N sin(pi r / R))`` for N
        frequencies and the unambiguous range R; None where there is no coupling, or it is
        suppressed.
        """
        level = self.study.echo.coupling_db
        if (
            level is None
            or self.study.suppression.method != "none"
            or self.study.imaging.range_window != "rectangular"
        ):
            return None
        nearest = float(self.instrument.slant_range(self.x, self.places[0]))
        ends = np.array([nearest, self.farthest_range])
        period, count = self.instrument.unambiguous_range, self.instrument.frequency.size
        turn = np.pi * (ends - self.study.echo.coupling_path_m / 2) / period
        return level - 20 * math.log10(count * float(np.abs(np.sin(turn)).min()))

    def speed_bound(self) -> float:
        """Return the least standard deviation of the speed that one scan's echoes tell, m/s.

        `motion.speed_bound`, with the noise of the scene's middle, or a twentieth of the power if
        that is more: what relief and sidelobes of range make incoherent.
        """
        part, scene = self.study.imaging, self.scene
        noise = 10 ** (-float(self.snr_db(self.places[1])) / 10)
        antennas = motion.advance(
            self.antennas,
            speed_m_per_s=self.study.vehicle.forward_speed_m_per_s,
            duration_s=self.scan_duration,
        )
        return motion.speed_bound(
            antennas,
            extent=(scene.x_min_m, scene.x_max_m, part.y_min_m, part.y_max_m),
            wavelength_m=self.instrument.wavelength,
            range_cell_m=self.instrument.range_resolution,
            incoherent=max(_INCOHERENT, noise / (1 + noise)),
            duration_s=self.scan_duration,
        )

    def warnings(self) -> list[str]:
        """Return what is questionable, a sentence each, in the order of the chain.

        The whole configuration is read (`validation.advice`).
        """
        found = validation.advice(self.study)
        y, planned = self.places, self.instrument
        if self.farthest_range > _RANGE_SHARE * planned.unambiguous_range:
            found.append(
                f"radar.frequency_count = {planned.frequency.size}: the farthest slant range, "
                f"{self.farthest_range:.2f} m, is nearly the unambiguous range, "
                f"{planned.unambiguous_range:.2f} m: what lies behind the scene folds into it"
            )
        widths = np.array([planned.unambiguous_width(self.x, float(at)) for at in y])
        width = self.scene.x_max_m - self.scene.x_min_m
        if width > _WIDTH_SHARE * widths.min():
            found.append(
                f"radar.position_spacing_m = {self.study.radar.position_spacing_m}: the scene is "
                f"{width:g} m wide and {widths.min():.2f} m are imaged once: what lies beside it "
                "folds into it"
            )
        cells = planned.resolution(self.x, y).reshape(2, -1).min(axis=1)
        for axis, spacing, cell in zip("xy", grid.pixel(self.study.imaging), cells, strict=True):
            if spacing > cell / 2:
                found.append(
                    f"imaging.grid_spacing_m = {spacing}: above half the resolution in {axis}, "
                    f"{cell / 2:.3f} m: the interferogram is undersampled"
                )
        sidelobes = self.coupling_db()
        if sidelobes is not None and sidelobes > _SIDELOBES_DB:
            found.append(
                f"echo.coupling_db = {self.study.echo.coupling_db}: its sidelobes are "
                f"{sidelobes:+.0f} dB against the scene in the image; take a "
                "suppression.method or an imaging.range_window"
            )
        std, most = self.height_std(y), self.study.accuracy.tolerance_m / OF_95_PERCENT
        if std.max() > most:
            found.append(
                f"accuracy.tolerance_m = {self.study.accuracy.tolerance_m}: the predicted noise of "
                f"{100 * std.max():.1f} cm leaves fewer than 95 % of the heights within it"
            )
        share = float((self.registration_shift(y) / planned.resolution(self.x, y)[1]).max())
        if share > _REGISTRATION_SHARE:
            found.append(
                f"scene: the images of a target as high as the relief, {self.relief:g} m, "
                f"differ by {share:.2f} of a resolution cell, more than a tenth"
            )
        shortest, pair = next(iter(self.pairs().items()))
        cycle, relief = float(pair.height_of_ambiguity(self.x, y).min()), self.relief
        if relief > 2 * cycle:
            found.append(
                f"radar.baseline_m = {shortest}: the height of ambiguity, "
                f"{cycle:.2f} m, is less than half the relief of {relief:g} m: steps of half of it "
                "unwrap wrongly"
            )
        found += self._unsettled()
        found += self._ambiguous_objects()
        return found

    def _unsettled(self) -> list[str]:
        """Return what keeps shorter baselines from settling the cycle of the longer ones."""
        lengths = self.study.radar.baselines
        if len(lengths) < 2:
            return []
        found, noise = [], self.phase_std()
        needed = self.instrument.unwrapped_baseline(
            self.relief, self.x, self.places, phase_std=noise
        )
        where = f"radar.baselines_m = {list(lengths)}"
        if lengths[0] > needed:
            found.append(
                f"{where}: relief and obstacles of {self.relief:g} m wrap the phase of the "
                f"shortest one; {needed:.3f} m or less would hold them"
            )
        for shorter, longer in pairwise(lengths):
            if not instrument.settles(longer / shorter, noise):
                found.append(
                    f"{where}: the noise of {shorter:g} m leaves cycles of {longer:g} m open; "
                    "place an antenna between"
                )
        return found

    def _ambiguous_objects(self) -> list[str]:
        """Return the upright objects whose sides jump by more than half a cycle.

        Of the shortest baseline, which settles the cycles of the others.
        """
        found = []
        shortest = next(iter(self.pairs().values()))
        objects = () if self.study.measurement.file is not None else self.study.scene.objects
        for number, item in enumerate(objects):
            size = float(getattr(item, "height_m", getattr(item, "depth_m", 0.0)))
            half = float(shortest.height_of_ambiguity(item.x_m, item.y_m)) / 2
            if item.shape in _UPRIGHT and size > half:
                found.append(
                    f"scene.objects[{number}]: a {item.shape} of {size:g} m exceeds half the "
                    f"height of ambiguity, {half:.2f} m: it may come out a cycle off, as free "
                    "ground"
                )
        return found


def _span(values: ArrayLike, form: str) -> list[str]:
    return [
        # Without the sign of a negative number that rounds to zero.
        "unlimited" if math.isinf(value) else format(value, "z" + form)
        for value in np.ravel(np.asarray(values, float))
    ]


def as_markdown(sheet: Sheet) -> str:
    """Return a design sheet as Markdown that a terminal shows as well.

    Parameters
    ----------
    sheet
        The predictions, of a whole study.

    Returns
    -------
    str
        Tables of what is predicted, and the warnings.
    """
    study, y = sheet.study, sheet.places
    part, planned = study.radar, sheet.instrument
    place = sheet.x, y
    megabytes = sheet.samples * _BYTES_PER_SAMPLE / 1e6
    lines = [
        f"# Design of the study {study.study}",
        "",
        *(
            [
                "- measured with one channel: heights, coherence and errors of the baseline are "
                "those that a second antenna at radar.baseline_m would have"
            ]
            if study.measurement.channels == 1
            else []
        ),
        f"- {part.system}, {part.start_frequency_hz / 1e9:g} to {part.stop_frequency_hz / 1e9:g} "
        f"GHz in {planned.frequency.size} steps, {planned.positions} positions over "
        f"{part.aperture_length_m:g} m, baseline of {part.baseline_m:g} m at "
        f"{part.baseline_angle_deg:g} deg",
        f"- wavelength {1e3 * planned.wavelength:.2f} mm, slant-range resolution "
        f"{1e2 * planned.range_resolution:.2f} cm",
        f"- unambiguous range {planned.unambiguous_range:.2f} m; the farthest target is at "
        f"{sheet.farthest_range:.2f} m",
        f"- {sheet.samples} complex samples a scan of {sheet.scan_duration:.3g} s, "
        f"{megabytes:.2f} MB in single precision; the vehicle drives "
        f"{study.vehicle.forward_speed_m_per_s * sheet.scan_duration:.2f} m in it",
        *(
            [
                f"- the echoes of one scan tell the vehicle's speed to {sheet.speed_bound():.2g} "
                "m/s at best (vehicle.speed_correction: echoes)"
            ]
            if study.vehicle.forward_speed_m_per_s > 0
            else []
        ),
        f"- work: {work.sentence(study)}",
        "",
        f"At x = {sheet.x:g} m, for relief and obstacles of {sheet.relief:g} m:",
        "",
    ]
    resolution, critical = planned.resolution(*place), planned.critical_baseline(*place)
    rows: list[tuple[str, Any, str]] = [
        ("distance ahead y (m)", y, ".2f"),
        ("slant range (m)", planned.slant_range(*place), ".2f"),
        ("look angle from nadir (deg)", np.rad2deg(planned.look_angle(*place)), ".2f"),
        ("resolution in y (cm)", 100 * resolution[1], ".2f"),
        ("resolution in x (cm)", 100 * resolution[0], ".2f"),
        (
            "width imaged without grating lobes (m)",
            [planned.unambiguous_width(sheet.x, float(at)) for at in y],
            ".2f",
        ),
        ("critical baseline of this attitude (m)", critical, ".2f"),
        ("a quarter of it (m)", critical / 4, ".2f"),
        ("height of ambiguity (m)", planned.height_of_ambiguity(*place), ".3f"),
        *(
            (f"the same of {length:g} m (m)", pair.height_of_ambiguity(*place), ".3f")
            for length, pair in list(sheet.pairs().items())[:-1]
        ),
        ("coherence of level ground", sheet.coherence(y), ".3f"),
        ("looks of the phase filter", sheet.looks(y, sheet.coherence(y)), ".1f"),
        ("predicted height noise, 1 sigma (cm)", 100 * sheet.height_std(y), ".2f"),
        ("registration error, raised target (mm)", 1e3 * sheet.registration_shift(y), ".2f"),
        ("shadow behind an obstacle (m)", sheet.shadow_length(y), ".2f"),
    ]
    table = [(name, *_span(values, form)) for name, values, form in rows]
    lines.append(tables.write(("", "near", "middle", "far"), table, "lrrr"))
    most = 100 * study.accuracy.tolerance_m
    heights = sorted({sheet.relief, *_OBJECTS_M})
    lines += [
        "",
        "Upright objects of a height are told with antennas so far above the lower one "
        "(radar.baselines_m): the shortest baseline needs no unwrapping, and each settles the next "
        "one's cycles:",
        "",
        tables.write(
            ("height of the objects (m)", "baselines (m)"),
            [(f"{height:g}", _lengths(sheet.settling_baselines(height))) for height in heights],
            "rl",
        ),
        "",
        f"Constant errors, and which move no height of the image by more than {most:g} cm, before "
        "and after the height reference takes its phase constant:",
        "",
        tables.write(
            ("error", "unit", "cm a unit: near", "middle", "far", "tolerated", "with reference"),
            [
                (
                    *(error.name, error.unit, *_span(100 * error.per_unit, ".3f")),
                    *(_amount(error.tolerated), _amount(error.tolerated_referenced)),
                )
                for error in sheet.offsets()
            ],
            "llrrrrr",
        ),
        "",
        "Position errors, independent by position, 1 sigma, with which 95 % of the heights of "
        f"level ground stay within {most:g} cm: independent by channel, and common to both "
        "channels, as on a shaking vehicle. Where the relief exceeds the height of ambiguity, "
        "common errors do as much harm as independent ones:",
        "",
    ]
    scatter = [
        (
            name,
            *(
                _amount(sheet.tolerated_scatter(axis, common=common) * per)
                for common in (False, True)
                for per in (1e3, 1 / planned.wavelength)
            ),
        )
        for axis, name in enumerate(AXES)
    ]
    headings = ("along", "independent (mm)", "wavelengths", "common (mm)", "wavelengths")
    lines.append(tables.write(headings, scatter, "lrrrr"))
    found = sheet.warnings()
    lines += ["", "Warnings:", ""] if found else ["", "No warnings."]
    lines += [f"- {sentence}" for sentence in found]
    return "\n".join(lines) + "\n"


def _lengths(lengths: tuple[float, ...]) -> str:
    """Return baselines as text, the recommended ones rounded down to millimetres."""
    *shorter, longest = lengths or (math.nan,)
    if math.isnan(longest):
        return "none: the phase is too noisy"
    floor = [f"{math.floor(1e3 * length) / 1e3:g}" for length in shorter]
    return ", ".join([*floor, f"{longest:g}"])


def _amount(value: float) -> str:
    return "any" if math.isinf(value) or value > 1e6 else f"{value:.3g}"
