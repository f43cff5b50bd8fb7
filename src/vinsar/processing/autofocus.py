"""Antenna positions from the echoes themselves: corrections of navigated positions.

Two facts carry it. Antennas closer together than the scene's speckle is wide see nearly the same
speckle, so the phase between their echoes is the difference of their range errors; and both
antennas of an interferometer see the same scene from the *same* position, so that the difference
between the channels, which heights need, is measured position by position and does not drift.

1. `_coarse` takes each position's echo along the middle line of the scene, in sub-bands. The
   phases between neighbours, and their slopes over the sub-bands, are joined to one range error a
   position by angular synchronisation. `_spaced` takes the distances between neighbours from the
   size of their coherence instead: no range error changes it, errors along the aperture do.
2. `_Image.step` holds what each position adds to the image against what all others make of it, in
   sectors of angle and range. The phases over the sectors give three components of displacement:
   along x they are antisymmetric across the scene, along z they change with range. A normal prior,
   whose variances are found from the echoes (by axis, common to the antennas and between them),
   keeps components that nothing speaks for at zero.

The second step starts from the navigated positions or from one of the first step's, whichever the
image is in better focus with.

A few strong reflectors have no speckle that joins neighbours. Where there are such, `_Sharpest`
takes the errors of the navigated positions as independent and the true path as smooth: it starts
from these positions, a line through them or a curve, and moves it by growing polynomials to the
sharpest image. It stands if it is sharper than what the other steps come to.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.processing import focusing, leakage, next_scan, speed
from vinsar.radar import grid, motion, trajectory, waveform

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

logger = logging.getLogger(__name__)

Extent = tuple[float, float, float, float]

_SUB_BANDS = 4
_OVERSAMPLING = 8
_LEAST_POSITIONS = 16

# Positions apart: phases of the carrier, and their slope over the sub-bands.
_PHASE_LAG, _SLOPE_LAG = 8, 3
_COARSE_ROUNDS, _SLIP_ROUNDS = 3, 6

# Steps to the eigenvector, and those by its phases that follow.
_EIGENVECTOR_STEPS, _PHASE_STEPS = 20, 3

# Share of the largest sum of weights that each antenna has at least.
_LEAST_DISAGREEMENT = 1e-6
_TINY = float(np.finfo(np.float32).tiny)

# Standard deviation of a distance from the coherence, in units of that where it vanishes.
_SPACING_STD = 0.05

# Whole cycles that a position may be off, and from one position to the next.
_MOST_SLIPS, _MOST_JUMP = 8, 2

# Coherence that neighbours need by their distance alone, the focus that a result needs, and that of
# recorded positions which the image's steps take on as they are.
_LEAST_COHERENCE, _LEAST_FOCUS, _IN_FOCUS = 0.3, 0.75, 0.5

# Range margin of the profiles, m: the largest errors of position.
_MARGIN_M = 0.5

# Looks times the squared coherence that noise has by chance, exp(-8) of the pairs.
_BY_CHANCE = 8

# Sectors across the scene and along range; window, in cells, that smooths the topographic phase.
_ACROSS, _ALONG = 6, 4
_WINDOW = (9, 3)

# Steps of the image at most; relative gain in energy, and fall of the focus, that end them.
_MOST_STEPS, _LEAST_GAIN, _MOST_FALL = 16, 1e-3, 0.1

# What a start must gain in focus over one that assumes less.
_PREFERENCE = 1.015

# Gain in focus below which the navigated positions stay: errors that small harm no image.
_WORTH = 1.03

# Sharpness (2 for speckle and noise) that tells of prominent points, and its gain and the focus
# that they must show; their cells.
_PROMINENT, _SHARPER, _LEAST_SHARP_FOCUS, _PROMINENT_CELLS = 4.0, 1.1, 0.4, 64

# Displacement, in wavelengths, that changes no image.
_LEAST_MOVE = 1e-4

# Share of its sharpness that a smooth path keeps once the speckle has its say.
_LEAST_KEPT = 0.5

# What a curve must gain in sharpness over a line.
_MUCH_SHARPER = 1.3

# Numbers of polynomials along the path that it moves by, and what tells an order of the navigated
# path from noise, in standard deviations.
_MOVES, _SIGNIFICANT = (4, 6, 9, 13), 5.0

# Shares of a step that are tried in turn, as it may be too long.
_SHARES = (1.0, 0.5, 0.25)

# Steps by each number at most; gains in sharpness that go on with it, and with the next.
_MOST_SHARPER, _GOES_ON, _GOES_FARTHER = 20, 2e-3, 1e-2

# Standard deviation, in wavelengths, of what the path is off in each polynomial.
_SMOOTH_STD = 0.1

# Bounds of the prior's standard deviation in wavelengths, and where it begins.
_LEAST_STD, _FIRST_STD, _MOST_STD = 0.005, 1.0, 4.0


MOST_CHANNELS = 2
"""More at one place hold together so well that errors along the aperture weigh nothing beside."""

variables.declare(
    "autofocus",
    {
        "displacement": Variable(
            ("channel", "position", "axis"),
            "real",
            "m",
            "displacement of the antennas from their recorded positions",
            "added to transmitter and receiver before imaging",
        ),
        "displacement_std": Variable(
            ("channel", "position", "axis"),
            "real",
            "m",
            "standard deviation of the displacement",
            "NaN where the echoes tell nothing; 0 where the recorded positions are taken as exact",
            bounds=(0, np.inf),
            gaps=True,
        ),
        "range_correction": Variable(
            ("channel", "position"),
            "real",
            "m",
            "range correction at the middle of the scene",
            "positive where the antenna was farther away than recorded",
        ),
        "range_std": Variable(
            ("channel", "position"),
            "real",
            "m",
            "standard deviation of the range correction",
            "NaN where the echoes tell nothing; 0 where the recorded positions are taken as exact",
            bounds=(0, np.inf),
            gaps=True,
        ),
        "focus_recorded": Variable(
            (),
            "real",
            "1",
            "share of the full coherence among the recorded positions",
            gaps=True,
        ),
        "focus_corrected": Variable(
            (),
            "real",
            "1",
            "share of the full coherence among the corrected positions",
            gaps=True,
        ),
    },
)


class Autofocus(Section, name="autofocus"):
    """Errors of the antenna positions, taken from the echoes."""

    method: Literal["none", "echoes"] = key(
        "imaging takes the recorded positions as they are, or as the echoes correct them",
        "future work",
    )


@dataclass(frozen=True)
class Motion:
    """Where the antennas were, relative to where they are recorded to have been.

    Attributes
    ----------
    displacement
        To add to the recorded positions (channel, position, axis), m; 0 if nothing is applied.
    displacement_std
        Its standard deviation (channel, position, axis), m: where nothing is applied, that of the
        errors which the echoes leave possible, NaN if they say nothing.
    range_correction, range_std
        The same along the line of sight to the middle of the scene (channel, position), m.
    focus
        Share of the full coherence among the positions before and after, 0 to 1.
    reason
        Why nothing is applied; empty if something is.
    """

    displacement: Floats
    displacement_std: Floats
    range_correction: Floats
    range_std: Floats
    focus: tuple[float, float]
    reason: str = ""


def estimate(echo: xr.Dataset, recorded: xr.Dataset, *, extent: Extent) -> Motion:
    """Estimate the errors of the recorded positions from the echoes.

    Parameters
    ----------
    echo
        Product ``received`` of one channel or two, without leakage. Positions that are zero are
        left out (`health.sound`); the errors on their two sides stand in for theirs.
    recorded
        Product ``trajectory``: the navigated positions.
    extent
        Ground that echoes come from (x_min, x_max, y_min, y_max), m, which must lie ahead.

    Returns
    -------
    Motion
        The displacements. Where the echoes cannot tell them they are 0, the reason is given, and
        a warning is logged.
    """
    channels, positions = recorded.sizes["channel"], recorded.sizes["position"]
    if channels > MOST_CHANNELS:
        many = f"it takes {MOST_CHANNELS} channels at most, and there are {channels}"
        return _told(_nothing(channels, positions, many))
    used = echo["echo"].values.any(axis=(0, 2))
    if not used.all():
        kept = np.nonzero(used)[0]
        found = estimate(echo.isel(position=kept), recorded.isel(position=kept), extent=extent)
        return _spread(found, kept, positions)
    if positions < _LEAST_POSITIONS:
        few = f"{positions} positions are too few; take {_LEAST_POSITIONS}"
        return _told(_nothing(channels, positions, few))
    image = _Image(_Samples(echo, recorded, extent))
    return _told(_Sharpest(image).instead_of(_by_speckle(image)))


def _told(found: Motion) -> Motion:
    """Log what was found, as a warning where the echoes tell nothing."""
    if not found.reason:
        logger.info(
            "autofocus: focus from %.0f to %.0f %%", *(100 * share for share in found.focus)
        )
    else:
        level = logging.WARNING if np.isnan(found.range_std).all() else logging.INFO
        logger.log(level, "autofocus: no correction, because %s", found.reason)
    return found


def _by_speckle(image: _Image) -> Motion:
    """Return the errors by what neighbouring positions see alike, and by the image's energy."""
    samples = image.samples
    channels, positions = samples.channels, samples.positions
    still: Floats = np.zeros((channels, positions, 3))
    start = still
    before = best = image.recorded.energy
    in_focus = samples.focus(before, still) >= _IN_FOCUS
    apart = _reached(np.abs(samples.level_covariance(still)), samples).min() < _LEAST_COHERENCE
    if apart or not in_focus:
        error, coherence = _coarse(samples)
        gap = _gap(samples, coherence)
        if gap is not None:
            return _nothing(channels, positions, gap)
    # Of all steps the focus after this one alone tells a wrong order of positions from a right one.
    # In focus as recorded, positions need no other start, nor the level ground that these assume.
    if not in_focus:
        for other in (samples.along_sight(error), _spaced(samples)):
            energy = image.form(other).energy
            if energy > _PREFERENCE * best:
                start, best = other, energy
    result = image.refine(start)
    if in_focus and _differ(_moved(samples, result.displacement, result.covariance, (0, 0))):
        # Energy hardly tells when errors that change slowly are found; the first step does. Errors
        # along the rail, which it takes for others, it leaves with less energy.
        other = samples.along_sight(_coarse(samples)[0])
        if image.form(other).energy > before:
            again = image.refine(other)
            if _PREFERENCE * again.formed.energy > result.formed.energy:
                result = again
    focus = samples.focus(before, still), samples.focus(result.formed.energy, result.displacement)
    if focus[1] < _LEAST_FOCUS:
        reason = f"the echoes of all positions agree to {focus[1]:.0%} only"
        return _nothing(channels, positions, reason, focus)
    found = _moved(samples, result.displacement, result.covariance, focus)
    if result.formed.energy < _WORTH * before and not _differ(found):
        reason = f"the navigated positions focus to {focus[0]:.0%} already"
        none = np.zeros_like(found.range_correction)
        return replace(found, displacement=still, range_correction=none, reason=reason)
    return found


def _differ(found: Motion) -> bool:
    """Return whether the channels' errors differ by more than chance.

    Errors that change slowly along the aperture leave each image in focus, and yet an interferogram
    holds their difference; a constant is not theirs to tell.
    """
    if len(found.range_correction) < 2:
        return False
    apart = found.range_correction[1] - found.range_correction[0]
    variance = (found.range_std**2).sum(axis=0)
    return bool(((apart - apart.mean()) ** 2 / variance).mean() > 1)


def _moved(
    samples: _Samples, displacement: Floats, covariance: Floats, focus: tuple[float, float]
) -> Motion:
    """Return displacements with their covariance (channel, position, axis, axis) as applied."""
    sight = samples.sight()
    return Motion(
        displacement=displacement,
        displacement_std=np.sqrt(np.einsum("clii->cli", covariance)),
        range_correction=np.einsum("cli,cli->cl", sight, displacement),
        range_std=np.sqrt(np.einsum("cli,clij,clj->cl", sight, covariance, sight)),
        focus=focus,
    )


def _nothing(
    channels: int, positions: int, reason: str, focus: tuple[float, float] = (np.nan, np.nan)
) -> Motion:
    shape = channels, positions
    return Motion(
        displacement=np.zeros((*shape, 3)),
        displacement_std=np.full((*shape, 3), np.nan),
        range_correction=np.zeros(shape),
        range_std=np.full(shape, np.nan),
        focus=focus,
        reason=reason,
    )


def _spread(found: Motion, kept: NDArray[np.integer], positions: int) -> Motion:
    """Return what was found at some positions for all of them, by linear interpolation."""

    def between(values: Floats) -> Floats:
        flat = np.moveaxis(values, 1, -1).reshape(-1, kept.size)
        lines = np.array([np.interp(np.arange(positions), kept, line) for line in flat])
        shape = *np.moveaxis(values, 1, -1).shape[:-1], positions
        return np.asarray(np.moveaxis(lines.reshape(shape), -1, 1))

    return replace(
        found,
        displacement=between(found.displacement),
        displacement_std=between(found.displacement_std),
        range_correction=between(found.range_correction),
        range_std=between(found.range_std),
    )


class _Samples:
    """The echoes as profiles, and the ground that they come from in polar coordinates."""

    def __init__(self, echo: xr.Dataset, recorded: xr.Dataset, extent: Extent) -> None:
        self.transmitter = recorded["transmitter"].values
        self.receiver = recorded["receiver"].values
        self.channels, self.positions, _ = self.transmitter.shape
        self.extent = extent
        self.echo = echo["echo"].values
        self.frequency = echo["frequency"].values
        self.wavelength = waveform.wavelength(waveform.carrier(self.frequency))
        x, y = np.array(extent[:2]), np.array(extent[2:])
        near, far = trajectory.range_extent(recorded, x, y)
        self.reach = max(near - _MARGIN_M, 0.0), far + _MARGIN_M
        each = self.frequency.size // _SUB_BANDS
        self.bands = [slice(k * each, (k + 1) * each) for k in range(_SUB_BANDS)]
        self.whole = self.profiles(slice(None))
        self.step_hz = float(self.frequency[each] - self.frequency[0])
        self.cell = waveform.range_resolution(float(self.frequency[-1] - self.frequency[0]))
        self.monostatic = np.array_equal(self.transmitter, self.receiver)
        self.center = (self.transmitter + self.receiver).mean(axis=(0, 1)) / 2
        self.middle = (extent[0] + extent[1]) / 2
        coarse = self.ranges(self.cell * self.frequency.size / each)
        self.line = self.on_ground(coarse, np.zeros(1))[:, 0]
        self.count = len(coarse) * _SUB_BANDS

    def profiles(self, band: slice) -> tuple[Complexes, float, float, float]:
        """Return the range profiles (antenna, range) of a band, as `kernels.contributions` does.

        With them their first range and spacing, m, and the carrier's cycles for each metre.
        """
        frequency = self.frequency[band]
        profiles, slant = focusing.compressed(
            self.echo[..., band],
            frequency,
            near_range_m=self.reach[0],
            far_range_m=self.reach[1],
            window="rectangular",
            oversampling=_OVERSAMPLING,
            interpolation="linear",
        )
        spacing = float(slant[-1] - slant[0]) / (slant.size - 1)
        cycles = 2 * waveform.carrier(frequency) / SPEED_OF_LIGHT
        return profiles.reshape(-1, slant.size), float(slant[0]), spacing, cycles

    @cached_property
    def sub_bands(self) -> list[tuple[Complexes, float, float, float]]:
        """The profiles of each sub-band."""
        return [self.profiles(band) for band in self.bands]

    @cached_property
    def recorded_covariance(self) -> Complexes:
        """The covariance along the middle line by the recorded positions (`_covariance`)."""
        return _covariance(self, np.zeros_like(self.transmitter))

    def ranges(self, spacing: float) -> Floats:
        """Return cells of slant range from the centre along the middle line, m."""
        offset = self.middle - self.center[0], self.center[2]
        low, high = (
            np.sqrt((y - self.center[1]) ** 2 + offset[0] ** 2 + offset[1] ** 2)
            for y in self.extent[2:]
        )
        count = max(1, int((high - low) / spacing))
        return np.asarray((low + high) / 2 + spacing * (np.arange(count) - (count - 1) / 2))

    def on_ground(self, ranges: Floats, across: Floats) -> Floats:
        """Return points (range, angle, 3) on the ground at sines of angle from the middle line."""
        ground = np.sqrt(ranges**2 - self.center[2] ** 2)[:, None]
        sine = (self.middle - self.center[0]) / ground + across
        x = self.center[0] + ground * sine
        y = self.center[1] + ground * np.sqrt(np.maximum(1 - sine**2, 0))
        return np.stack([x, y, np.zeros_like(x)], axis=-1)

    def width(self, range_m: float) -> float:
        """Return the sine of the angle that the scene spans at a slant range."""
        ground = np.sqrt(range_m**2 - self.center[2] ** 2)
        return float((self.extent[1] - self.extent[0]) / ground)

    def take(
        self,
        profiles: tuple[Complexes, float, float, float],
        displacement: Floats,
        points: Floats,
        *,
        apart: bool = True,
    ) -> tuple[Complexes, Complexes, float]:
        """Return what positions contribute to points (channel, position, point).

        With it go the images (channel, point) and the sum of the powers. Contributions that are not
        wanted apart have no positions.
        """
        from vinsar.kernels import contributions

        count = self.positions if apart else 0
        out = np.empty((self.channels, count, len(points)), np.complex64)
        image = np.empty((self.channels, len(points)), np.complex64)
        power = np.empty((self.channels, len(points)), np.float32)
        columns = np.ascontiguousarray(points.T)
        for channel in range(self.channels):
            own = slice(channel * self.positions, (channel + 1) * self.positions)
            contributions.fill(
                profiles[0][own],
                *profiles[1:],
                self.transmitter[channel] + displacement[channel],
                self.receiver[channel] + displacement[channel],
                columns,
                out[channel],
                image[channel],
                power[channel],
            )
        return out, image, float(power.sum(dtype=float))

    def paths(self, displacement: Floats, points: Floats) -> Floats:
        """Return the half paths (antenna, point) to points, m."""
        total = np.zeros((self.channels * self.positions, len(points)))
        for end in (self.transmitter, self.receiver):
            if end is self.receiver and self.monostatic:
                return 2 * total
            place = (end + displacement).reshape(-1, 3)
            squares = (np.subtract.outer(place[:, k], points[:, k]) ** 2 for k in range(3))
            total += np.sqrt(sum(squares)) / 2
        return total

    def gradient(self, displacement: Floats, points: Floats) -> Floats:
        """Return how the half path to points grows with a displacement (..., point, 3)."""
        total = np.zeros((*self.transmitter.shape[:2], len(points), 3))
        for end in (self.transmitter, self.receiver):
            if end is self.receiver and self.monostatic:
                return 2 * total
            ray = points - (end + displacement)[..., None, :]
            total -= ray / (2 * np.sqrt(np.einsum("...i,...i", ray, ray))[..., None])
        return total

    def sight(self) -> Floats:
        """Return the gradient (channel, position, 3) at the middle of the scene."""
        point = self.line[len(self.line) // 2]
        return self.gradient(np.zeros_like(self.transmitter), point[None])[:, :, 0]

    def along_sight(self, range_error: Floats) -> Floats:
        """Return the displacement along the line of sight that makes range errors."""
        sight = self.sight()
        size = (sight**2).sum(axis=-1, keepdims=True)
        return np.asarray(sight / size * range_error.reshape(*sight.shape[:2], 1))

    def level_steering(self, displacement: Floats) -> Complexes:
        """Return how antennas see the cells of a level scene of unit power (antenna, cell)."""
        middle = self.line[len(self.line) // 2]
        slant = float(np.linalg.norm(middle - self.center))
        width = self.width(slant)
        cells = max(2, int(np.ceil(2 * width / self.angle_cell())))
        sines = width * ((np.arange(cells) + 0.5) / cells - 0.5)
        arc = self.on_ground(np.array([slant]), sines)[0]
        path = self.paths(displacement, np.concatenate([arc, middle[None]]))
        cycles = -2 / self.wavelength * (path[:, :-1] - path[:, -1:])
        phase = (2 * np.pi * (cycles - np.round(cycles))).astype(np.float32)
        return np.asarray((np.cos(phase) + 1j * np.sin(phase)) / np.float32(np.sqrt(cells)))

    def level_covariance(self, displacement: Floats) -> Complexes:
        """Return the covariance (antenna, antenna) by a level scene, of unit power."""
        steering = self.level_steering(displacement)
        return np.asarray(steering @ steering.conj().T)

    def angle_cell(self) -> float:
        """Return the aperture's resolution in the sine of angle."""
        ends = self.transmitter[..., 0] + self.receiver[..., 0]
        return float(self.wavelength / np.ptp(ends))

    def focus(self, energy: float, displacement: Floats) -> float:
        """Return the share of the full coherence that an image energy tells."""
        steering = self.level_steering(displacement).reshape(self.channels, self.positions, -1)
        # The squared size of a matrix's product with itself is the same in either order.
        size = np.abs(steering.conj().transpose(0, 2, 1) @ steering) ** 2
        own = size.sum(dtype=float) / (self.channels * self.positions)
        return float(np.clip((energy - 1) / (own - 1), 0, 1))


def _gap(samples: _Samples, measured: Floats) -> str | None:
    """Return what keeps neighbouring positions from seeing the same speckle, if anything.

    Navigated positions with errors seem farther apart than they are, and echoes may be weak: both
    must tell of the gap.
    """
    level = np.abs(samples.level_covariance(np.zeros_like(samples.transmitter)))
    # Of some ten pairs across a gap the largest coherence of noise stays below this, by far.
    measured = np.where(measured > np.sqrt(_BY_CHANCE / samples.count), measured, 0)
    most = np.maximum(_reached(level, samples), _reached(measured, samples))
    weakest = int(most.argmin())
    if most[weakest] >= _LEAST_COHERENCE:
        return None
    ends = (samples.transmitter + samples.receiver)[0, weakest : weakest + 2] / 2
    return (
        f"positions {weakest} and {weakest + 1}, {np.linalg.norm(ends[1] - ends[0]):.3f} m apart, "
        f"share a coherence of {most[weakest]:.2f} at most: they see other speckle"
    )


def _reached(size: Floats, samples: _Samples) -> Floats:
    """Return the largest coherence (position - 1,) across each step from a position to the next."""
    reached = np.zeros(samples.positions - 1)
    pairs = size.reshape(samples.channels, samples.positions, samples.channels, -1)
    for channel in range(samples.channels):
        for lag in range(1, _SLOPE_LAG + 1):
            values = np.diagonal(pairs[channel, :, channel], lag)
            for shift in range(lag):
                across = reached[shift : shift + values.size]
                np.maximum(across, values, out=across)
    return reached


class _Pairs:
    """Pairs of antennas near each other, and the phases between them."""

    def __init__(self, samples: _Samples) -> None:
        place = np.tile(np.arange(samples.positions), samples.channels)
        self.size = place.size
        # With the channels of a position side by side, pairs lie along a matrix's diagonal.
        self.order = place * samples.channels + np.arange(self.size) // samples.positions
        lag = place - place[:, None]
        later = self.order > self.order[:, None]
        self.first, self.second = np.nonzero((lag <= _PHASE_LAG) & later)
        self.lag = lag[self.first, self.second]
        column, row = self.order[self.second], self.order[self.first]
        self.reach = int(np.max(column - row))
        self.beside = self.reach + row - column, column
        self.samples = samples
        self.carrier = np.array([2 * np.pi * band[3] for band in samples.sub_bands])

    def turned(self, covariance: Complexes, by: Floats) -> Complexes:
        """Return the covariance (sub-band, pair) once range errors (antenna,) are taken out."""
        turn = np.exp(1j * self.carrier[:, None] * by).astype(np.complex64)
        return np.asarray(covariance * (turn[:, self.first] * turn[:, self.second].conj()))

    def synchronised(self, products: Complexes, weight: Floats) -> Complexes:
        """Return the unit phasors (antenna,) whose products fit those of pairs best.

        From the eigenvector of least disagreement, degrees less weights over degrees, by Gauss and
        Newton. (That of the weights' largest eigenvalue lies about the positions of largest
        weights, and leaves the phase of others to rounding.)
        """
        from scipy.linalg import cho_solve_banded

        # In double precision: entries larger than their weights would leave it indefinite.
        value = weight * np.exp(1j * np.angle(products).astype(float))
        factor, degree = self.disagreement(weight, value)
        vector = np.ones(self.size, complex)
        for _ in range(_EIGENVECTOR_STEPS):
            vector = cho_solve_banded((factor, False), degree * vector, check_finite=False)
            vector /= np.abs(vector).max()
        phase = np.angle(vector)[self.order]
        for _ in range(_PHASE_STEPS):
            phasor = np.exp(1j * phase)
            rest = value * phasor[self.first].conj() * phasor[self.second]
            agreed = np.maximum(rest.real, 0)
            factor, _ = self.disagreement(agreed, agreed)
            slope = self.by_antenna(rest.imag, -rest.imag)
            move = cho_solve_banded((factor, False), slope, check_finite=False)[self.order]
            phase += np.clip(move, -1, 1)
        phasor = np.exp(1j * phase)
        return np.asarray(phasor * np.exp(-1j * np.angle(phasor.mean())))

    def disagreement(self, weight: Floats, value: Complexes | Floats) -> tuple[Complexes, Floats]:
        """Return the factor of the matrix of degrees less values (pair,), and the degrees.

        Both are ordered by `order`.
        """
        from scipy.linalg import cholesky_banded

        degree = self.by_antenna(weight, weight)
        # Antennas that nothing joins to others would leave it singular.
        degree += _LEAST_DISAGREEMENT * degree.max() + _TINY
        band = np.zeros((self.reach + 1, self.size), value.dtype)
        band[self.reach] = degree * (1 + _LEAST_DISAGREEMENT)
        band[self.beside] = -value
        return cholesky_banded(band, overwrite_ab=True, check_finite=False), degree

    def by_antenna(self, of_first: Floats, of_second: Floats) -> Floats:
        """Return the sums (antenna,) over the pairs that each antenna is in, ordered by `order`."""
        result = np.empty(self.size)
        result[self.order] = np.bincount(self.first, of_first, minlength=self.size)
        result[self.order] += np.bincount(self.second, of_second, minlength=self.size)
        return result


def _coarse(samples: _Samples) -> tuple[Floats, Floats]:
    """Return range errors (channel, position), m, true less navigated, but for a constant.

    With them, the coherence (antenna, antenna) of the positions that they leave.
    """
    shape = samples.channels, samples.positions
    pairs = _Pairs(samples)
    period = SPEED_OF_LIGHT / (2 * samples.step_hz)
    cells = samples.count // _SUB_BANDS
    error = np.zeros(pairs.size)
    covariance: Complexes = np.empty(0, complex)
    for number in range(_COARSE_ROUNDS):
        displacement = samples.along_sight(error)
        found = _covariance(samples, displacement) if number else samples.recorded_covariance
        level = samples.level_covariance(displacement)[pairs.first, pairs.second]
        covariance = found[:, pairs.first, pairs.second] * level.conj()
        covariance /= np.abs(level) + np.finfo(np.float32).tiny
        slope = (covariance[1:] * covariance[:-1].conj()).mean(axis=0)
        weight = np.where(pairs.lag <= _SLOPE_LAG, _weight(np.sqrt(np.abs(slope)), cells), 0)
        delay = -np.angle(pairs.synchronised(slope, weight)) * period / (2 * np.pi)
        delay -= period * np.round((error + delay) / period)
        covariance, error = pairs.turned(covariance, delay), error + delay
        whole = covariance.mean(axis=0)
        weight = _weight(np.abs(whole), samples.count)
        phase = np.angle(pairs.synchronised(whole, weight)).reshape(shape)
        phase = np.unwrap(phase, axis=1)
        turns = np.round(np.median(phase - phase[0], axis=1) / (2 * np.pi))
        phase -= 2 * np.pi * turns[:, None]
        by = -(phase - np.median(phase)).ravel() * samples.wavelength / (4 * np.pi)
        covariance, error = pairs.turned(covariance, by), error + by
        error = error - error.mean()
    for _ in range(_SLIP_ROUNDS):
        cycles = _slips(pairs, covariance, error)
        if not cycles.any():
            break
        by = cycles * samples.wavelength / 2
        covariance, error = pairs.turned(covariance, by), error + by
    coherence = np.eye(pairs.size)
    coherence[pairs.first, pairs.second] = np.abs(covariance.mean(axis=0))
    return error.reshape(shape), np.maximum(coherence, coherence.T)


def _covariance(samples: _Samples, displacement: Floats) -> Complexes:
    """Return the sample covariance (sub-band, antenna, antenna) along the middle line."""
    result = []
    for band in samples.sub_bands:
        values = samples.take(band, displacement, samples.line)[0]
        values = values.reshape(-1, len(samples.line))
        values /= np.sqrt((values.real**2 + values.imag**2).mean(axis=0))
        power = (values.real**2 + values.imag**2).sum(axis=1, keepdims=True)
        values /= np.sqrt(power)
        result.append(values @ values.conj().T)
    return np.array(result)


def _spaced(samples: _Samples) -> Floats:
    """Return the displacement (channel, position, axis) along x that neighbours' coherence tells.

    A level scene as wide as the image has the coherence ``sinc(k w d / lambda)`` at a distance d,
    with w the sine of angle that it spans and k = 2, or 1 where one end stands still. Taken to lie
    in their order, positions follow by least squares: distances that sum to the navigated length,
    and navigated positions with the prior's errors.
    """
    displacement = np.zeros_like(samples.transmitter)
    covariance = samples.recorded_covariance
    middle = samples.line[len(samples.line) // 2]
    width = samples.width(float(np.linalg.norm(middle - samples.center)))
    place = (samples.transmitter + samples.receiver)[..., 0] / 2
    cycle = samples.wavelength / (2 * width)
    distances = cycle * np.linspace(0, 1, 400)
    coherence = np.sinc(distances / cycle)
    along = np.linspace(-0.5, 0.5, samples.positions)
    apart = np.diff(np.eye(samples.positions), axis=0)
    looks = samples.count // _SUB_BANDS
    shape = -1, samples.channels, samples.positions, samples.channels, samples.positions
    size = np.abs(covariance).reshape(shape)
    for channel in range(samples.channels):
        pairs = np.diagonal(size[:, channel, :, channel], 1, axis1=1, axis2=2)
        found = np.sqrt(np.clip(((pairs**2).mean(axis=0) - 1 / looks) / (1 - 1 / looks), 0, 1))
        length = along @ place[channel] / (along @ along)

        def spacing(full: float, found: Floats = found) -> Floats:
            return np.interp(-found / full, -coherence, distances)

        # Noise lowers all coherences alike; the length tells by how much.
        low, high = 0.5, 1.5
        for _ in range(30):
            full = (low + high) / 2
            low, high = (low, full) if spacing(full).sum() > length else (full, high)
        weight = 1 / (_SPACING_STD * cycle) ** 2
        keep = 1 / (_FIRST_STD * samples.wavelength) ** 2
        system = weight * apart.T @ apart + keep * np.eye(samples.positions)
        told = weight * apart.T @ spacing(full) + keep * place[channel]
        displacement[channel, :, 0] = np.linalg.solve(system, told) - place[channel]
    return displacement


def _weight(coherence: Floats, looks: int) -> Floats:
    """Return the weight of a phase, the inverse of its variance but for a factor."""
    square = np.clip((coherence**2 - 1 / looks) / (1 - 1 / looks), 0, 0.98)
    return np.asarray(square / (1 - square))


def _slips(pairs: _Pairs, covariance: Complexes, error: Floats) -> NDArray[np.integer]:
    """Return whole cycles, common to the channels, by which range errors are more likely.

    The carrier's phase leaves half a wavelength open from one position to the next, and the slope
    over the sub-bands tells it only to a few millimetres. Dynamic programming over the cycles of
    each position weighs the phases of neighbours in the sub-bands against errors larger than the
    others are.
    """
    from vinsar.kernels.cycles import likeliest

    samples = pairs.samples
    channels, positions = samples.channels, samples.positions
    turn = pairs.carrier * samples.wavelength / 2
    jumps = np.arange(-_MOST_JUMP, _MOST_JUMP + 1)
    cycles = np.arange(-_MOST_SLIPS, _MOST_SLIPS + 1)
    next_ = np.nonzero(pairs.lag == 1)[0]
    beside = covariance[:, next_].conj()
    square = np.clip(np.abs(beside.mean(axis=0)) ** 2 - 1 / samples.count, 0, 0.98)
    fit = (beside.T @ np.exp(1j * turn[:, None] * jumps)).real
    gain = np.zeros((positions - 1, jumps.size))
    worth = np.sqrt(square) / (1 - square)
    np.add.at(gain, pairs.first[next_] % positions, worth[:, None] * fit)
    # Neighbouring pairs see the same speckle: the pairs of all channels count as half of them.
    gain *= samples.count / _SUB_BANDS / channels
    common = error.reshape(channels, positions).mean(axis=0)
    variance = (common**2).mean() + np.finfo(float).tiny
    cost = (common[:, None] + samples.wavelength / 2 * cycles) ** 2 / (2 * variance)
    path = np.empty(positions, np.int64)
    likeliest(gain, cost, path)
    return np.tile(cycles[path], channels)


@dataclass(frozen=True)
class _Formed:
    """An image (channel, point), its parts (channel, position, point) and its energy.

    The energy is relative to that of incoherent positions. Parts may be left out.
    """

    parts: Complexes
    image: Complexes
    energy: float


@dataclass(frozen=True)
class _State:
    """What the image's steps have come to."""

    displacement: Floats
    covariance: Floats
    prior: Floats
    formed: _Formed


class _Image:
    """The image in polar coordinates, and what each position adds to it."""

    def __init__(self, samples: _Samples) -> None:
        self.samples = samples
        ranges = samples.ranges(samples.cell)
        width = samples.width(float(ranges.mean()))
        angles = _ACROSS * max(1, int(np.ceil(width / samples.angle_cell() / _ACROSS)))
        sine = width * ((np.arange(angles) + 0.5) / angles - 0.5)
        points = samples.on_ground(ranges, sine)
        self.shape = points.shape[:2]
        blocks = [
            block
            for rows in np.array_split(np.arange(ranges.size), min(_ALONG, ranges.size))
            for block in (
                (rows[:, None] * angles + columns).ravel()
                for columns in np.array_split(np.arange(angles), _ACROSS)
            )
        ]
        self.order = np.concatenate(blocks)
        self.begins = np.cumsum([0, *(block.size for block in blocks)])
        flat = points.reshape(-1, 3)
        self.points = np.ascontiguousarray(flat[self.order])
        self.middles = np.array([flat[block].mean(axis=0) for block in blocks])
        along = np.linspace(-1, 1, samples.positions)
        self.trend = np.linalg.qr(np.stack([np.ones_like(along), along], axis=1))[0]

    def form(self, displacement: Floats, *, apart: bool = False) -> _Formed:
        """Return the image, with the parts that the positions contribute if wanted."""
        parts, image, power = self.samples.take(
            self.samples.whole, displacement, self.points, apart=apart
        )
        energy = float((image.real**2 + image.imag**2).sum(dtype=float))
        return _Formed(parts, image, energy / (power or 1.0))

    @cached_property
    def recorded(self) -> _Formed:
        """The image by the recorded positions, with its parts."""
        return self.form(np.zeros_like(self.samples.transmitter), apart=True)

    def correlate(self, formed: _Formed) -> Complexes:
        """Return what parts agree with the rest of the image (channel, position, sector)."""
        from vinsar.kernels import contributions

        parts = formed.parts
        reference = formed.image + self.other_channels(formed.image)
        result: Complexes = np.empty((*parts.shape[:2], len(self.middles)), complex)
        for channel in range(len(parts)):
            contributions.agree(parts[channel], reference[channel], self.begins, result[channel])
        # The scale does not count; numbers near 1 keep clear of underflow.
        result /= np.abs(result).mean() or 1.0
        return result

    def by_range_and_angle(self, image: Complexes) -> Complexes:
        """Return an image (channel, point) as (channel, range, angle)."""
        result = np.empty_like(image)
        result[:, self.order] = image
        return result.reshape(-1, *self.shape)

    def other_channels(self, image: Complexes) -> Complexes:
        """Return the others' images (channel, point) for each channel.

        Each is turned by the phase of the topography between the two.
        """
        from scipy.ndimage import uniform_filter

        grid = self.by_range_and_angle(image)

        def smooth(values: Floats) -> Floats:
            return np.asarray(uniform_filter(values, _WINDOW, mode="nearest"))

        power = [smooth(np.abs(part) ** 2) for part in grid]
        result = np.zeros_like(image)
        for first, second in combinations(range(len(grid)), 2):
            product = grid[first] * grid[second].conj()
            cross = smooth(product.real) + 1j * smooth(product.imag)
            cross /= np.sqrt(power[first] * power[second]) + np.finfo(np.float32).tiny
            turned = cross.ravel()[self.order]
            result[first] += turned * image[second]
            result[second] += turned.conj() * image[first]
        return result

    def step(self, formed: _Formed, displacement: Floats, prior: Floats) -> _State:
        """Take one step of Gauss and Newton from an image; its energy is that of the result."""
        samples = self.samples
        channels, positions = samples.channels, samples.positions
        found = self.correlate(formed)
        gradient = samples.gradient(displacement, self.middles)
        wave = 4 * np.pi / samples.wavelength
        # Amplitude and noise by sector: what is not in focus has little of the first.
        amplitude = np.maximum(found.real.mean(axis=1), 0)
        weight = amplitude / (found.imag**2).mean(axis=1)
        slope = -wave * np.einsum("cs,clsi,cls->lci", weight, gradient, found.imag)
        curvature = wave**2 * np.einsum(
            "cs,clsi,clsj->clij", weight * amplitude, gradient, gradient
        )
        system = np.zeros((positions, channels, 3, channels, 3))
        for channel in range(channels):
            system[:, channel, :, channel] = curvature[channel]
        keep = _precision(prior)
        slope -= np.einsum("cidj,dlj->lci", keep, displacement)
        size = 3 * channels
        inverse = np.linalg.inv((system + keep).reshape(positions, size, size))
        move = np.einsum("lij,lj->li", inverse, slope.reshape(positions, size))
        moved = displacement + move.reshape(positions, channels, 3).transpose(1, 0, 2)
        # Along x a constant and a stretch turn and scale the image, which no echo contradicts.
        common = moved[..., 0].mean(axis=0)
        moved[..., 0] -= self.trend @ (self.trend.T @ common)
        # A constant between the channels cannot be told from topography: it stays as recorded.
        constant = moved.mean(axis=1, keepdims=True)
        moved -= constant - constant.mean(axis=0)
        inverse = inverse.reshape(positions, channels, 3, channels, 3)
        own = np.stack([inverse[:, channel, :, channel] for channel in range(channels)])
        return _State(
            moved, own, self.variances(moved, inverse, prior), self.form(moved, apart=True)
        )

    def variances(self, moved: Floats, inverse: Floats, prior: Floats) -> Floats:
        """Return the prior's standard deviations (mode, axis) that make the estimate likeliest."""
        positions = self.samples.positions
        wavelength = self.samples.wavelength
        result = np.empty_like(prior)
        for mode, signs in enumerate(_modes(len(prior))):
            value = np.einsum("c,cli->li", signs, moved)
            spread = np.einsum("c,lcidi,d->li", signs, inverse, signs)
            known = positions - spread.sum(axis=0) / prior[mode] ** 2
            result[mode] = np.sqrt((value**2).sum(axis=0) / np.maximum(known, 1e-3))
        return np.clip(result, _LEAST_STD * wavelength, _MOST_STD * wavelength)

    def refine(self, displacement: Floats) -> _State:
        """Take steps until the energy gains no more."""
        prior = np.full((self.samples.channels, 3), _FIRST_STD * self.samples.wavelength)
        formed = self.form(displacement, apart=True) if displacement.any() else self.recorded
        kept = None
        # Positions that crowd together raise the energy as well, but not its share of the full one.
        best = self.samples.focus(formed.energy, displacement)
        for _ in range(_MOST_STEPS):
            before = formed.energy
            state = self.step(formed, displacement, prior)
            displacement, prior, formed = state.displacement, state.prior, state.formed
            focus = self.samples.focus(formed.energy, displacement)
            if kept is not None and focus < best - _MOST_FALL:
                return kept
            kept, best = state, max(best, focus)
            if formed.energy < before * (1 + _LEAST_GAIN):
                break
        return state


def _modes(channels: int) -> Floats:
    """Return what is common to the channels, and what differs between them: orthonormal rows."""
    found = np.zeros((channels, channels))
    found[0] = 1
    for mode in range(1, channels):
        found[mode, :mode], found[mode, mode] = 1, -mode
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _precision(prior: Floats) -> Floats:
    """Return the inverse covariance (channel, axis, channel, axis) of the prior (mode, axis)."""
    channels = len(prior)
    modes = _modes(channels)
    result = np.zeros((channels, 3, channels, 3))
    for axis in range(3):
        result[:, axis, :, axis] = (modes.T / prior[:, axis] ** 2) @ modes
    return result


class _Sharpest:
    """The smooth path along which prominent points make the sharpest image.

    Sharpness is the mean squared intensity over the squared mean, by channel. Its gradient is that
    of each position's part against the image times the image's power: so prominent points alone
    count, which have one phase at all positions that see them.
    """

    def __init__(self, image: _Image) -> None:
        self.image = image
        self.samples = samples = image.samples
        along = np.linspace(-1, 1, samples.positions)
        powers = np.vander(along, max(_MOVES), increasing=True)
        self.basis = np.sqrt(samples.positions) * np.linalg.qr(powers)[0]
        # A shift and a turn of all positions, which no echo contradicts, stay as recorded.
        self.free = np.ones((max(_MOVES), 3))
        self.free[0] = self.free[1, 1:] = 0

    def instead_of(self, found: Motion) -> Motion:
        """Return the displacements to it, or what was found if prominent points speak for that."""
        samples = self.samples
        still: Floats = np.zeros_like(samples.transmitter)
        starts = [still, *self.smoothed()]
        formed = [self.sharpness(self.image.recorded.image)]
        for start in starts[1:]:
            # Positions on a line are where they are recorded to be.
            moved = np.abs(start).max() > _LEAST_MOVE * samples.wavelength
            formed.append(self.sharpness_of(start) if moved else formed[0])
        sharpness = np.array(formed)
        if sharpness.max() < _PROMINENT:
            return found
        displacement, best = still.copy(), np.zeros(samples.channels)
        covariance, taken = np.zeros((*still.shape, 3)), still.copy()
        for number, (start, first) in enumerate(zip(starts, sharpness, strict=True)):
            # A start far less sharp than the other leads nowhere.
            if (first < sharpness.max(axis=0) / 2).all():
                continue
            moved, spread, reached = self.follow(start)
            # Curves that noise bends may sharpen what is no point: a line needs less.
            better = reached > (_PREFERENCE if number < 2 else _MUCH_SHARPER) * best
            best = np.where(better, reached, best)
            displacement[better], covariance[better] = moved[better], spread[better]
            taken[better] = start[better]
        before = self.sharpness_of(found.displacement)
        if best.min() < _PROMINENT or (best < before).any():
            return found
        if best.mean() < _SHARPER * before.mean():
            return found
        displacement = self.registered(displacement, (taken[..., 1:] ** 2).mean(axis=(1, 2)))
        refined = self.image.refine(displacement)
        recorded = samples.focus(self.image.recorded.energy, still)
        focus = recorded, samples.focus(refined.formed.energy, refined.displacement)
        smooth = samples.focus(self.image.form(displacement).energy, displacement)
        kept = self.sharpness_of(refined.displacement).mean() / best.mean()
        # Boxes among speckle: polynomials sharpen them more than they are. Points stay points.
        as_good = focus[1] > smooth - _MOST_FALL and kept > _LEAST_KEPT
        if focus[1] > _LEAST_FOCUS and (kept * _PREFERENCE > 1 or as_good):
            return _moved(samples, refined.displacement, refined.covariance, focus)
        focus = recorded, smooth
        # Echoes from outside the image lower the focus, but a path that shakes leaves next to none.
        if focus[1] < _LEAST_SHARP_FOCUS:
            return found
        logger.info(
            "autofocus: sharpness %.1f as recorded, %.1f along a smooth path",
            sharpness[0].mean(),
            best.mean(),
        )
        return _moved(samples, displacement, covariance, focus)

    def smoothed(self) -> list[Floats]:
        """Return the displacements to a line, a parabola and the lowest polynomial that shows."""
        place = (self.samples.transmitter + self.samples.receiver) / 2
        count, orders = self.basis.shape
        found = self.basis.T @ place / count
        rest = place - self.basis @ found
        std = np.sqrt((rest**2).sum(axis=1, keepdims=True) / (count - orders) / count)
        shown = np.nonzero((np.abs(found) > _SIGNIFICANT * std).any(axis=(0, 2)))[0]
        kept = sorted({2, 3, max(1, int(shown.max(initial=0))) + 1})
        return [self.basis[:, :some] @ found[:, :some] - place for some in kept]

    def registered(self, displacement: Floats, variance: Floats) -> Floats:
        """Return the displacement with the rails turned until both images lie on each other.

        No echo tells the turn of a rail, but both channels see one scene: of the turn between them
        each takes the share of its errors' variance (channel,), m^2.
        """
        samples = self.samples
        place = ((samples.transmitter + samples.receiver) / 2 + displacement)[..., 0]
        place = place - place.mean(axis=1, keepdims=True)
        turn = np.sqrt((variance / (place**2).sum(axis=1)).sum())
        angles = self.image.shape[1]
        spacing = samples.width(float(samples.ranges(samples.cell).mean())) / angles
        most = int(_SIGNIFICANT * turn / spacing * _OVERSAMPLING)
        if not most:
            return displacement
        grid = self.image.by_range_and_angle(self.image.form(displacement).image)
        # Zeros beside the image keep its edges apart, those beside the spectrum interpolate.
        spectra = np.fft.fft(grid, 2 * angles)
        cross = np.fft.fftshift(spectra * spectra[:1].conj(), axes=-1)
        beside = angles * (_OVERSAMPLING - 1)
        cross = np.fft.ifftshift(np.pad(cross, ((0, 0), (0, 0), (beside, beside))), axes=-1)
        match = (np.abs(np.fft.ifft(cross)) ** 2).sum(axis=1)
        steps = np.arange(-most, most + 1)
        # Sine of angle by which a channel's image is off the first one's.
        shift = spacing / _OVERSAMPLING * steps[match[:, steps].argmax(axis=1)]
        weight = 1 / np.maximum(variance, np.finfo(float).tiny)
        shift -= (weight / weight.sum()) @ shift
        result = displacement.copy()
        result[..., 1] += shift[:, None] * place
        return result

    def sharpness_of(self, displacement: Floats) -> Floats:
        """Return the sharpness (channel,) of the image."""
        return self.sharpness(self.image.form(displacement).image)

    def sharpness(self, image: Complexes) -> Floats:
        """Return the sharpness (channel,) of an image, 2 for speckle and noise."""
        power = image.real**2 + image.imag**2
        tiny = np.finfo(np.float32).tiny
        return np.asarray((power**2).mean(axis=1) / (power.mean(axis=1) ** 2 + tiny))

    def follow(self, start: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the displacement, its covariance and the sharpness that a start leads to."""
        # Independent errors leave their mean and their slope in what is fitted to them.
        left = (start**2).mean(axis=1) / self.samples.positions
        keep = 1 / ((_SMOOTH_STD * self.samples.wavelength) ** 2 + left)
        moves = np.zeros((len(start), max(_MOVES), 3))
        displacement, covariance = start, np.zeros((*start.shape, 3))
        formed = self.image.form(start, apart=True)
        reached = self.sharpness(formed.image)
        for count in _MOVES:
            before = reached
            for _ in range(_MOST_SHARPER):
                moved, spread = self.step(formed, displacement, moves[:, :count], keep)
                for share in _SHARES:
                    taken = moves[:, :count] + share * (moved - moves[:, :count])
                    candidate = start + np.einsum("lk,cki->cli", self.basis[:, :count], taken)
                    trial = self.image.form(candidate, apart=True)
                    sharpness = self.sharpness(trial.image)
                    sharper = sharpness.mean() > (1 + _GOES_ON) * reached.mean()
                    if sharper:
                        break
                if not sharper:
                    break
                moves[:, :count], covariance = taken, spread
                displacement, reached, formed = candidate, sharpness, trial
            if reached.mean() < (1 + _GOES_FARTHER) * before.mean():
                break
        return displacement, covariance, reached

    def step(
        self, formed: _Formed, displacement: Floats, moves: Floats, keep: Floats
    ) -> tuple[Floats, Floats]:
        """Take a step of Gauss and Newton: the moves (channel, polynomial, axis) after it.

        With them goes the covariance (channel, position, axis, axis) of the displacements.
        """
        samples, image = self.samples, formed.image
        count = moves.shape[1]
        basis, free = self.basis[:, :count], self.free[:count]
        wave = 4 * np.pi / samples.wavelength
        result, covariance = np.empty_like(moves), np.empty((*displacement.shape, 3))
        for channel, prior in enumerate(keep):
            power = np.abs(image[channel]) ** 2
            chosen = np.argpartition(power, -_PROMINENT_CELLS)[-_PROMINENT_CELLS:]
            reference = image[channel, chosen] * power[chosen] / (power[chosen] ** 2).sum()
            found = formed.parts[channel][:, chosen] * reference.conj()
            gradient = samples.gradient(displacement, self.image.points[chosen])[channel]
            size = np.abs(found)
            # The score's variance over the information: what a phase's weight has too much.
            scatter = (found.imag.sum(axis=1) ** 2).sum() / size.sum()
            slope = -wave * basis.T @ np.einsum("ls,lsi->li", found.imag, gradient) / scatter
            curvature = wave**2 * np.einsum("ls,lsi,lsj->lij", size, gradient, gradient) / scatter
            system = np.einsum("lk,lij,lm->kimj", basis, curvature, basis, optimize=True)
            precision = np.tile(prior, count)
            system = system.reshape(3 * count, -1) * np.outer(free, free) + np.diag(precision)
            inverse = np.linalg.inv(system)
            slope = free * slope - prior * moves[channel]
            result[channel] = moves[channel] + (inverse @ slope.ravel()).reshape(count, 3)
            inverse = inverse.reshape(count, 3, count, 3)
            covariance[channel] = np.einsum("lk,kimj,lm->lij", basis, inverse, basis, optimize=True)
        return result, covariance


def _autofocus(products: Products, study: Study) -> xr.Dataset:
    recorded = products["recorded_trajectory"]
    x, y = grid.image_axes(study.imaging)
    extent = x[0], x[-1], y[0], y[-1]
    way = np.zeros(recorded["receiver"].shape)
    if study.vehicle.speed_correction in ("echoes", "next_scan"):
        way += _way(products, study, extent)
    if study.autofocus.method == "none":
        nothing = np.zeros_like(way)
        still = nothing[..., 0].copy()
        found = Motion(nothing, nothing, still, still, (np.nan, np.nan))
    else:
        echo = leakage.clean(products["received"], study)
        found = estimate(echo, trajectory.displaced(recorded, way), extent=extent)
    return variables.dataset(
        "autofocus",
        {
            "displacement": found.displacement + way,
            "displacement_std": found.displacement_std,
            "range_correction": found.range_correction,
            "range_std": found.range_std,
            "focus_recorded": found.focus[0],
            "focus_corrected": found.focus[1],
        },
        {"channel": recorded["channel"].values},
    )


def _way(products: Products, study: Study, extent: Extent) -> Floats:
    """Return the displacement (position, axis), m, by what the echoes tell of the speed."""
    recorded = products["recorded_trajectory"]
    heard = leakage.clean(products["received"], study)
    duration = trajectory.scan_duration(study.radar, study.vehicle)
    sensor = study.vehicle.speed_error_m_per_s
    if motion.has_next_scan(study.vehicle):
        told = next_scan.estimate(
            (heard, leakage.clean(products["next_received"], study)),
            (recorded, products["next_recorded_trajectory"]),
            extent=extent,
            duration_s=duration,
            interval_s=motion.scan_interval(study.radar, study.vehicle),
            sensor_std_m_per_s=sensor,
        )
    else:
        told = speed.estimate(
            heard, recorded, extent=extent, duration_s=duration, sensor_std_m_per_s=sensor
        )
    return speed.way(told.correction, positions=recorded.sizes["position"], duration_s=duration)


STAGES = {
    "autofocus": Stage(
        _autofocus,
        inputs=("received", "recorded_trajectory"),
        optional=("next_received", "next_recorded_trajectory"),
        sections=(
            *grid.KEYS,
            "suppression",
            "autofocus",
            "vehicle.speed_correction",
            "vehicle.scan_interval_s",
            "vehicle.speed_error_m_per_s",
            "vehicle.scan_duration_s",
            *trajectory.SCAN_KEYS,
        ),
    ),
}
