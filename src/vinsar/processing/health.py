"""Health of the echo: channels and positions that say nothing, or nothing true, named and left out.

A receiver that is dead, stuck or overdriven still fills its file, and images of what it writes look
like level ground. Every stage that processes the echo takes it from `sound`.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations import variables

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from numpy.typing import NDArray

    Complexes = NDArray[np.complexfloating]
    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

logger = logging.getLogger(__name__)

# netCDF fills with 9.97e36 what nobody has written; no receiver counts so far.
_FILL = 9e36

# Amplitude of a sample against its position's median. Speckle exceeds 6 once in 1e11 samples.
_SPIKE = 30.0
# Amplitude of a position against the channel's median.
_LOUD, _SILENT = 30.0, 1e-3
# Successive samples alike: a converter that hangs for so much of a sweep.
_HANGING_SHARE, _HANGING_SAMPLES = 0.1, 16
# Samples at the very end of the range, as a share of all and against those at the next value. Of a
# sine in whole numbers the last value has 2.4 times as many as the last but one.
_CLIPPED_SHARE, _CLIPPED_RATIO = 1e-3, 5.0
# Rounding of a magnitude, and how far below the largest magnitudes are compared with.
_SAME, _NEAR = 1e-6, 1e-2

# Two antennas apart see different echoes; what two channels differ by at least, as power.
_LEAST_DIFFERENCE = 1e-9

# Sound positions that an aperture needs, as a share of all.
_LEAST_SOUND = 0.5

# Exponents of two of the typical amplitude within which single precision holds its fourth power.
_EXPONENTS = 15


@dataclass(frozen=True)
class Finding:
    """What is wrong with a channel.

    Attributes
    ----------
    channel
        Name of the channel.
    what
        What its positions are, such as ``zero``.
    positions
        Their numbers.
    share
        Share of their samples, where it is not all.
    """

    channel: str
    what: str
    positions: NDArray[np.integer]
    share: float | None = None

    def __str__(self) -> str:
        numbers = self.positions
        where = f"position{'s' * (numbers.size > 1)} {_listed(numbers)}"
        are = "is" if numbers.size == 1 else "are"
        part = "" if self.share is None else f" in {100 * self.share:.2g} % of the samples"
        return f"channel '{self.channel}': {where} {are} {self.what}{part}"


def sound(echo: xr.Dataset) -> xr.Dataset:
    """Return an echo without what is wrong with it, at a scale that single precision holds.

    A position that is not finite, filled, zero, constant, stuck, silent or far too loud in one
    channel is set to zero in all of them, so that their apertures stay alike; so are single spikes.
    Clipped samples stay. All of it is named in the log, with channel and position. A channel whose
    typical amplitude is far from 1 is multiplied by a power of two, which changes no digit.

    Parameters
    ----------
    echo
        Product ``received``.

    Returns
    -------
    xarray.Dataset
        Product ``received``; the same object if nothing is wrong.

    Raises
    ------
    ValueError
        If fewer than half of the positions are sound in all channels, or two channels hold the
        same echo.
    """
    samples = echo["echo"].values
    names = [str(name) for name in echo["channel"].values]
    lost, spiked = np.zeros(samples.shape[:2], bool), np.zeros(samples.shape, bool)
    found: list[Finding] = []
    for number, name in enumerate(names):
        kinds, spikes = _examine(samples[number])
        for what, positions in kinds.items():
            if positions.any():
                found.append(Finding(name, what, np.nonzero(positions)[0]))
                lost[number] |= positions
        spiked[number] = spikes & ~lost[number][:, None]
        found += _softer(name, samples[number], lost[number], spiked[number])
    _refuse_lost(lost, names, found)
    left_out = np.asarray(lost.any(axis=0))
    for finding in found:
        logger.warning("%s", finding)
    if left_out.any():
        logger.warning(
            "left out in all channels: %d of %d positions (%s)",
            left_out.sum(), left_out.size, _listed(np.nonzero(left_out)[0]),
        )  # fmt: skip
    wrong = np.asarray(spiked | left_out[:, None])
    healthy = np.where(wrong, 0, samples) if wrong.any() else samples
    exponents = [_exponent(part) for part in healthy]
    if any(exponents):
        # In double precision, whose range no echo leaves.
        healthy = np.asarray(healthy, np.complex128)
        healthy = np.stack([part * 2.0**-n for part, n in zip(healthy, exponents, strict=True)])
        for name, exponent in zip(names, exponents, strict=True):
            logger.info("channel '%s' is divided by 2^%d", name, exponent)
    _refuse_equal(healthy, names)
    if healthy is samples:
        return echo
    coords = {"channel": echo["channel"].values, "frequency": echo["frequency"].values}
    return variables.dataset("received", {"echo": healthy}, coords)


def _examine(samples: Complexes) -> tuple[dict[str, Flags], Flags]:
    """Return positions by what they are, none under two names, and samples that are spikes."""
    kinds: dict[str, Flags] = {}
    rest = np.ones(samples.shape[0], bool)

    def name(what: str, positions: Any) -> None:
        kinds[what] = np.asarray(positions & rest)
        rest[kinds[what]] = False

    # Extremes of real and imaginary parts tell at the cost of reading them twice.
    parts = np.ascontiguousarray(samples).view(samples.real.dtype)
    largest, least = parts.max(axis=1), parts.min(axis=1)
    name("not finite", ~(np.isfinite(largest) & np.isfinite(least)))
    name("filled as if never written", np.maximum(largest, -least) >= _FILL)
    name("zero", (largest == 0) & (least == 0))
    known = samples if rest.all() else np.where(rest[:, None], samples, 0)
    steady = [(part == part[:, :1]).all(axis=1) for part in (known.real, known.imag)]
    name("constant over all frequencies", steady[0] & steady[1])
    name("constant in one of real and imaginary part", steady[0] | steady[1])
    repeated = np.zeros(rest.size, bool)
    repeated[1:] = (known[1:] == known[:-1]).all(axis=1)
    name("the same as the one before", repeated)
    name("stuck for a part of the frequencies", _hanging(known))
    magnitude = np.abs(known)
    # The median: rows are sorted faster than it is selected.
    ordered, count = np.sort(magnitude, axis=1), magnitude.shape[1]
    typical = (ordered[:, (count - 1) // 2] + ordered[:, count // 2]) / 2
    spikes = magnitude > _SPIKE * typical[:, None]
    # What is so in most of its samples is no spike.
    spikes = np.asarray(spikes & (typical > 0)[:, None] & rest[:, None])
    power = np.sqrt(np.mean(np.where(spikes, 0.0, magnitude.astype(float)) ** 2, axis=1))
    usual = np.median(power[rest]) if rest.any() else 0.0
    name("silent, 60 dB and more below the others", np.asarray(power < _SILENT * usual))
    name("30 dB and more above the others", np.asarray(power > _LOUD * usual))
    return kinds, spikes


def _hanging(samples: Complexes) -> Flags:
    """Return positions with a long run of one value."""
    count = max(_HANGING_SAMPLES, int(np.ceil(_HANGING_SHARE * samples.shape[1])))
    if samples.shape[1] <= count:
        return np.zeros(len(samples), bool)
    alike = (samples[:, 1:] == samples[:, :-1]) & (samples[:, 1:] != 0)
    if (alike.sum(axis=1) < count - 1).all():
        return np.zeros(len(samples), bool)
    total = np.cumsum(np.pad(alike, ((0, 0), (1, 0))), axis=1, dtype=np.int32)
    return np.asarray((total[:, count - 1 :] - total[:, : 1 - count] == count - 1).any(axis=1))


def _softer(name: str, samples: Complexes, lost: Flags, spiked: Flags) -> Iterator[Finding]:
    """Yield what is wrong with samples of positions that are not left out."""
    if spiked.any():
        positions = np.nonzero(spiked.any(axis=1))[0]
        share = float(spiked[positions].mean())
        yield Finding(name, f"spiked, {_SPIKE:.0f} times their median and more,", positions, share)
    counted = np.where(spiked | lost[:, None], 0, samples)
    clipped = _clipped(counted)
    if clipped.any():
        positions = np.nonzero(clipped.any(axis=1))[0]
        yield Finding(name, "clipped", positions, float(clipped[positions].mean()))


def _clipped(samples: Complexes) -> Flags:
    """Return samples at an end of the converter's range that holds far too many."""
    parts = np.stack([samples.real, samples.imag])
    result = np.zeros(samples.shape, bool)
    least = max(4.0, _CLIPPED_SHARE * samples.size)
    for sign in (1, -1):
        values = sign * parts
        top = values.max()
        at_top = values == top
        if top <= 0 or at_top.sum() < least or at_top.all():
            continue
        below = values[~at_top]
        if at_top.sum() > _CLIPPED_RATIO * (below == below.max()).sum():
            result |= at_top.any(axis=0)
    magnitude = np.abs(samples)
    top = magnitude.max()
    at_top = magnitude >= top * (1 - _SAME)
    # Of a single scatterer all samples are as large.
    if least <= at_top.sum() < samples.size / 2:
        near = (magnitude >= top * (1 - _NEAR)) & ~at_top
        if at_top.sum() > _CLIPPED_RATIO * near.sum():
            result |= at_top
    return result


def _exponent(samples: Complexes) -> int:
    """Return the exponent of two of the typical amplitude, 0 if single precision holds it well."""
    magnitude = np.abs(samples)
    there = np.count_nonzero(magnitude)
    if not there:
        return 0
    exponent = int(np.frexp(magnitude.sum(dtype=float) / there)[1])
    return exponent if abs(exponent) > _EXPONENTS else 0


def _refuse_lost(lost: Flags, names: list[str], found: list[Finding]) -> None:
    left = ~lost.any(axis=0)
    if left.sum() >= max(2, _LEAST_SOUND * left.size):
        return
    worst = "; ".join(str(finding) for finding in found if finding.share is None)
    raise ValueError(
        f"{left.sum()} of {left.size} positions have a usable echo in all of {', '.join(names)}, "
        f"and half of them at least are needed: {worst}; mend the receiver or leave the channel out"
    )


def _refuse_equal(samples: Complexes, names: list[str]) -> None:
    used = np.nonzero(samples.any(axis=(0, 2)))[0]
    for one, other in combinations(range(len(names)), 2):
        # Nearly always the first position tells.
        if used.size and all(_alike(samples[one, n], samples[other, n]) for n in used):
            raise ValueError(
                f"channels '{names[one]}' and '{names[other]}' hold the same echo, up to a factor; "
                "without a second antenna's echo there is no height"
            )


def _alike(one: Complexes, other: Complexes) -> bool:
    a, b = (np.asarray(part, np.complex128) for part in (one, other))
    power = float((np.abs(a) ** 2).sum() * (np.abs(b) ** 2).sum())
    return bool(np.abs(np.vdot(a, b)) ** 2 > (1 - _LEAST_DIFFERENCE) * power)


def _listed(numbers: NDArray[Any], most: int = 6) -> str:
    """Return numbers as text, runs of them by their ends."""
    runs = np.split(numbers, np.nonzero(np.diff(numbers) > 1)[0] + 1)
    parts = [f"{run[0]}" if run.size == 1 else f"{run[0]} to {run[-1]}" for run in runs]
    if len(parts) > most:
        parts = [*parts[:most], f"{sum(run.size for run in runs[most:])} more"]
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
