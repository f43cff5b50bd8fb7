"""Calibration from what is known of the scene: a surveyed reflector, or level ground.

The reflector gives each channel's range bias and the offset between the clocks of echoes and
positions: those with which the echo of a point there adds up best over positions and frequencies,
which is the maximum-likelihood estimate of a point in white noise. Between channels, reflector and
ground give the delay and the phase at the carrier. Standard deviations are jackknifed over blocks
of positions or of ground, so that they hold what clutter does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray as xr

from vinsar.foundations import variables
from vinsar.foundations.constants import CHANNELS, SPEED_OF_LIGHT
from vinsar.processing import focusing
from vinsar.radar import trajectory, waveform

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]
    Flags = NDArray[np.bool_]

Kind = Literal["range", "time", "channels"]
KINDS: tuple[Kind, ...] = ("range", "time", "channels")

_BLOCKS = 10

# Ground is taken in tiles, a side of the region each so many.
_TILES = 4


@dataclass(frozen=True)
class Echoes:
    """What is calibrated.

    Attributes
    ----------
    samples
        Complex echo (channel, position, frequency).
    frequency
        Frequencies, Hz.
    transmitter, receiver
        Antenna positions (channel, position, axis), m.
    time
        Time of each position (position,), s, if it is known.
    """

    samples: Complexes
    frequency: Floats
    transmitter: Floats
    receiver: Floats
    time: Floats | None = None


@dataclass(frozen=True)
class Estimate:
    """A value and its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True)
class Calibration:
    """What was estimated; what is not known is None.

    Attributes
    ----------
    range_bias_m
        What the first channel's ranges are too long by, m.
    time_offset_s
        By channel, the time to add to an echo's time to find its position, s.
    channel_delay_s
        By channel, what it lags behind the first, s, about the carrier.
    channel_phase_rad
        By channel, the phase at the carrier by which it is ahead of the first, rad.
    """

    range_bias_m: Estimate | None = None
    time_offset_s: tuple[Estimate, ...] | None = None
    channel_delay_s: tuple[Estimate, ...] | None = None
    channel_phase_rad: tuple[Estimate, ...] | None = None


def from_reflector(
    echoes: Echoes,
    reflector_m: ArrayLike,
    *,
    largest_bias_m: float = 1.0,
    largest_offset_s: float = 0.25,
    use: Flags | None = None,
) -> Calibration:
    """Estimate range bias, time offset and channel differences from a surveyed reflector.

    Parameters
    ----------
    echoes
        Echoes, the coupling still in them: what is common to all positions is left out.
    reflector_m
        Place of the reflector's phase centre, m.
    largest_bias_m, largest_offset_s
        Where the estimates are looked for, either way.
    use
        Positions to use; all by default.

    Returns
    -------
    Calibration
        The time offset is None without times.

    Raises
    ------
    ValueError
        If an estimate lies at the end of where it is looked for: the reflector was not found.
    """
    reflector = np.asarray(reflector_m, dtype=float)
    positions = np.arange(echoes.samples.shape[1])[slice(None) if use is None else use]
    blocks = np.array_split(positions, min(_BLOCKS, positions.size))
    fits = [
        _Fit(echoes, channel, reflector, blocks, largest_bias_m, largest_offset_s)
        for channel in range(len(echoes.samples))
    ]

    def estimates(kept: Flags) -> Floats:
        """Return bias, offset, delay and phase of each channel."""
        best = [fit.best(kept) for fit in fits]
        common = best[0][0]
        delays = [2 * (bias - common) / SPEED_OF_LIGHT for bias, _ in best]
        phases = np.array(
            [
                fit.phase_at_carrier(kept, common, delay)
                for fit, delay in zip(fits, delays, strict=True)
            ]
        )
        return np.column_stack([best, delays, _wrapped(phases - phases[0])])

    found, std = _jackknifed(estimates, len(blocks), turning=3)
    timed = echoes.time is not None
    several = len(fits) > 1

    def column(index: int) -> tuple[Estimate, ...]:
        return tuple(map(Estimate, found[:, index].tolist(), std[:, index].tolist()))

    return Calibration(
        column(0)[0],
        column(1) if timed else None,
        column(2) if several else None,
        column(3) if several else None,
    )


def from_ground(
    echoes: Echoes, regions_m: Sequence[tuple[float, float, float, float]], height_m: float = 0.0
) -> Calibration:
    """Estimate delay and phase between channels from ground of a known height.

    Imaged on that height, all channels have the same phase there. Their difference is the
    channel's phase; how it changes from the lower half of the band to the upper is its delay.

    Parameters
    ----------
    echoes
        Echoes of two or more channels.
    regions_m
        Rectangles on the ground: least x, largest x, least y, largest y, m.
    height_m
        Height of the ground there, m.

    Returns
    -------
    Calibration
        Delay and phase of the channels.

    Raises
    ------
    ValueError
        If there is one channel.
    """
    if len(echoes.samples) < 2:
        raise ValueError("there is one channel; level ground calibrates the second to the first")
    count = echoes.frequency.size
    halves = slice(0, count // 2), slice(count - count // 2, count)
    carriers = [waveform.carrier(echoes.frequency[half]) for half in halves]
    # (half, channel, tile): products with the first channel.
    products = np.concatenate(
        [
            np.stack([_tiles(echoes, half, region, height_m) for half in halves])
            for region in regions_m
        ],
        axis=-1,
    )

    def estimates(kept: Flags) -> Floats:
        low, high = (product[:, kept].sum(axis=-1) for product in products)
        # Between the halves the phase of the carrier; the delay turns them against each other.
        phase = np.angle(low * np.exp(0.5j * np.angle(high * low.conj())))
        delay = -np.angle(high * low.conj()) / (2 * np.pi * (carriers[1] - carriers[0]))
        return np.stack([delay, phase], axis=-1)

    found, std = _jackknifed(estimates, products.shape[-1], turning=1)
    columns = [
        tuple(map(Estimate, found[:, index].tolist(), std[:, index].tolist())) for index in (0, 1)
    ]
    return Calibration(None, None, *columns)


def apply(echoes: Echoes, calibration: Calibration, kinds: Collection[Kind] = KINDS) -> Echoes:
    """Take a calibration out of the echoes.

    Parameters
    ----------
    echoes
        Echoes.
    calibration
        What was estimated.
    kinds
        What is taken out: the range bias, the time offset, the channels' delays and phases.

    Returns
    -------
    Echoes
        Positions at the corrected times; those outside the times that there are, left out.

    Raises
    ------
    ValueError
        If a kind is unknown.
    """
    unknown = sorted(set(kinds) - set(KINDS))
    if unknown:
        raise ValueError(f"there is nothing called {', '.join(unknown)} to apply; see {KINDS}")
    samples, frequency = echoes.samples.copy(), echoes.frequency
    if "range" in kinds and calibration.range_bias_m is not None:
        samples *= _turned(frequency, 2 * calibration.range_bias_m.value / SPEED_OF_LIGHT)
    if "channels" in kinds:
        offset = frequency - waveform.carrier(frequency)
        for channel, delay in enumerate(calibration.channel_delay_s or ()):
            samples[channel] *= _turned(offset, delay.value)
        for channel, phase in enumerate(calibration.channel_phase_rad or ()):
            samples[channel] *= np.exp(-1j * phase.value)
    result = replace(echoes, samples=samples)
    if "time" in kinds and calibration.time_offset_s is not None:
        result = _shifted(result, [offset.value for offset in calibration.time_offset_s])
    return result


def _shifted(echoes: Echoes, offsets: list[float]) -> Echoes:
    from scipy.interpolate import CubicSpline

    if echoes.time is None:
        raise ValueError("the echoes have no times, so that no offset can be applied")
    time = echoes.time
    wanted = time + np.array(offsets)[:, None]
    inside = ((wanted >= time[0]) & (wanted <= time[-1])).all(axis=0)
    ends = {
        name: np.stack(
            [
                CubicSpline(time, places)(at[inside])
                for places, at in zip(getattr(echoes, name), wanted, strict=True)
            ]
        )
        for name in ("transmitter", "receiver")
    }
    return replace(echoes, samples=echoes.samples[:, inside], time=time[inside], **ends)


class _Fit:
    """How well the echo of a point adds up, over positions and frequencies.

    Sums over blocks of positions are kept, so that leaving one out costs nothing.
    """

    def __init__(
        self,
        echoes: Echoes,
        channel: int,
        reflector: Floats,
        blocks: Sequence[NDArray[np.integer]],
        largest_bias_m: float,
        largest_offset_s: float,
    ) -> None:
        self.frequency, self.time, self.blocks = echoes.frequency, echoes.time, blocks
        # The window keeps what lies beside the reflector out of its sum.
        weights = waveform.window("hann", self.frequency.size)
        self.samples = (echoes.samples[channel] - echoes.samples[channel].mean(axis=0)) * weights
        ends = echoes.transmitter[channel], echoes.receiver[channel]
        self.ranges = np.asarray(sum(np.linalg.norm(end - reflector, axis=-1) for end in ends)) / 2
        self._search(largest_bias_m, largest_offset_s)

    def _search(self, largest_bias_m: float, largest_offset_s: float) -> None:
        """Find the largest sum on a coarse grid, and lay a fine one about it."""
        bandwidth = float(self.frequency[-1] - self.frequency[0])
        step = waveform.range_resolution(bandwidth) / 4
        half = int(np.ceil(largest_bias_m / step))
        biases: Floats = step * np.arange(-half, half + 1)
        pace = 0.0
        offsets: Floats = np.zeros(1)
        if self.time is not None:
            # Within a step a range changes by an eighth of a wavelength, at most.
            speed = float(np.abs(np.gradient(self.ranges, self.time)).max())
            carrier = waveform.carrier(self.frequency)
            pace = waveform.wavelength(carrier) / 8 / max(speed, 1e-9)
            half = int(np.clip(np.ceil(largest_offset_s / pace), 1, 200))
            pace = largest_offset_s / half
            offsets = pace * np.arange(-half, half + 1)
        whole = np.abs(self.sums(offsets).sum(axis=1) @ self._turns(biases))
        row, column = np.unravel_index(whole.argmax(), whole.shape)
        if column in (0, biases.size - 1) or (offsets.size > 1 and row in (0, offsets.size - 1)):
            raise ValueError(
                f"the reflector was not found within {largest_bias_m:g} m and "
                f"{largest_offset_s:g} s of its survey; mend its place or search farther"
            )
        self.biases = biases[column] + step * np.linspace(-2, 2, 65)
        self.offsets = offsets[row] + pace * np.linspace(-2, 2, 33 if pace else 1)
        turns = self._turns(self.biases)
        # Sums of each block (block, offset, bias).
        self.fine = np.stack([block @ turns for block in self.sums(self.offsets).swapaxes(0, 1)])
        everything = np.ones(len(self.blocks), bool)
        self.at_best = self.sums(np.array([self.best(everything)[1]]))[0]

    def sums(self, offsets: Floats) -> Complexes:
        """Return sums of each block (offset, block, frequency), the reflector's path taken out."""
        result = np.empty((offsets.size, len(self.blocks), self.frequency.size), complex)
        for row, offset in enumerate(offsets):
            ranges = self.ranges
            if self.time is not None and offset:
                from scipy.interpolate import CubicSpline

                at = np.clip(self.time + offset, self.time[0], self.time[-1])
                ranges = CubicSpline(self.time, self.ranges)(at)
            for column, block in enumerate(self.blocks):
                turn = _turned(self.frequency, 2 * ranges[block, None] / SPEED_OF_LIGHT)
                result[row, column] = (self.samples[block] * turn).sum(axis=0)
        return result

    def _turns(self, biases: Floats) -> Complexes:
        return _turned(self.frequency[:, None], 2 * biases / SPEED_OF_LIGHT)

    def best(self, kept: Flags) -> tuple[float, float]:
        """Return bias and offset of the largest sum over some blocks."""
        power = np.abs(self.fine[kept].sum(axis=0)) ** 2
        row, column = _top(power)
        return (
            float(np.interp(column, np.arange(self.biases.size), self.biases)),
            float(np.interp(row, np.arange(self.offsets.size), self.offsets)),
        )

    def phase_at_carrier(self, kept: Flags, bias: float, delay: float) -> float:
        """Return the phase that is left at the carrier, bias and delay taken out."""
        turn = _turned(self.frequency, 2 * bias / SPEED_OF_LIGHT)
        turn = turn * _turned(self.frequency - waveform.carrier(self.frequency), delay)
        return float(np.angle((self.at_best[kept].sum(axis=0) * turn).sum()))


def _top(values: Floats) -> tuple[float, float]:
    """Return row and column of the top of the paraboloid through a maximum and its neighbours.

    Both at once: bias and offset go together along a ridge.
    """
    row, column = (int(index) for index in np.unravel_index(values.argmax(), values.shape))
    rows, columns = (
        np.arange(max(at - 2, 0), min(at + 3, size))
        for at, size in zip((row, column), values.shape, strict=True)
    )
    v, u = (part.ravel() for part in np.meshgrid(rows - row, columns - column, indexing="ij"))
    near = values[np.ix_(rows, columns)].ravel() / values[row, column]
    if values.shape[0] == 1:
        _, slope, bend = np.linalg.lstsq(np.stack([u**0, u, u**2], axis=1), near)[0]
        return 0.0, float(column - slope / (2 * bend))
    terms = np.stack([u**0, u, v, u * u, u * v, v * v], axis=1)
    _, by_u, by_v, uu, uv, vv = np.linalg.lstsq(terms, near)[0]
    shift = np.linalg.solve([[2 * uu, uv], [uv, 2 * vv]], [-by_u, -by_v])
    return float(row + shift[1]), float(column + shift[0])


def _tiles(
    echoes: Echoes, half: slice, region: tuple[float, float, float, float], height_m: float
) -> Complexes:
    """Return products of the channels with the first, summed over tiles (channel, tile)."""
    frequency = echoes.frequency[half]
    ends = {"transmitter": echoes.transmitter, "receiver": echoes.receiver}
    channels = {"channel": list(CHANNELS[: len(echoes.samples)])}
    antennas = variables.dataset("trajectory", ends, channels)
    x, y = (
        np.linspace(low, high, max(2 * _TILES, int((high - low) / 0.05)) // _TILES * _TILES)
        for low, high in (region[:2], region[2:])
    )
    near, far = trajectory.range_extent(antennas, x, y, height_m)
    moving = echoes.samples - echoes.samples.mean(axis=1, keepdims=True)
    profiles = focusing.compress(
        xr.Dataset(
            {"echo": (("channel", "position", "frequency"), moving[..., half])},
            {"frequency": frequency, **channels},
        ),
        near_range_m=max(0.0, near - 0.1),
        far_range_m=far + 0.1,
        window="hann",
    )
    image = focusing.backproject(profiles, antennas, x=x, y=y, z=height_m)["image"].values
    products = image * image[0].conj()
    tiled = products.reshape(len(image), _TILES, y.size // _TILES, _TILES, x.size // _TILES)
    return np.asarray(tiled.sum(axis=(2, 4)).reshape(len(image), -1))


def _jackknifed(
    estimate: Callable[[Flags], Floats], blocks: int, turning: int
) -> tuple[Floats, Floats]:
    """Return estimates (channel, quantity) and their standard deviations.

    The quantity `turning` is an angle.
    """
    whole = estimate(np.ones(blocks, bool))
    changes = []
    for block in range(blocks):
        change = estimate(np.arange(blocks) != block) - whole
        change[:, turning] = _wrapped(change[:, turning])
        changes.append(change)
    apart = np.array(changes) - np.mean(changes, axis=0)
    return whole, np.sqrt((blocks - 1) / blocks * (apart**2).sum(axis=0))


def _turned(frequency: Floats, delay: ArrayLike) -> Complexes:
    return np.exp(2j * np.pi * (frequency * np.asarray(delay) % 1))


def _wrapped(phase: Floats) -> Floats:
    return np.angle(np.exp(1j * phase))


def as_text(calibration: Calibration, applied: Collection[Kind]) -> list[str]:
    """Return estimates with their standard deviations, a line each."""

    def line(name: str, kind: Kind, estimate: Estimate, scale: float, unit: str) -> str:
        state = "applied" if kind in applied else "not applied"
        return (
            f"{name}: {scale * estimate.value:.4g} +- {scale * estimate.std:.2g} {unit} ({state})"
        )

    lines = []
    if calibration.range_bias_m is not None:
        lines.append(line("range bias", "range", calibration.range_bias_m, 1.0, "m"))
    for channel, offset in enumerate(calibration.time_offset_s or ()):
        lines.append(line(f"time offset of {CHANNELS[channel]}", "time", offset, 1e3, "ms"))
    for channel, delay in list(enumerate(calibration.channel_delay_s or ()))[1:]:
        lines.append(line(f"delay of {CHANNELS[channel]}", "channels", delay, 1e12, "ps"))
    for channel, phase in list(enumerate(calibration.channel_phase_rad or ()))[1:]:
        name = f"phase of {CHANNELS[channel]}"
        lines.append(line(name, "channels", phase, 180 / np.pi, "degrees"))
    return lines
