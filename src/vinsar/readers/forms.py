"""Radars' own forms as echoes of a stepped frequency.

A path ``R`` from the transmitter by the target to the receiver gives the phase ``-2 pi f R / c``.
All forms end there, so that one chain images them all: a dechirped sample belongs to the frequency
that the sweep then had, and the spectrum of a pulse is an echo already.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar.foundations.constants import SPEED_OF_LIGHT

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

Sign = Literal[-1, 1]

# A band ends where the mean spectrum has fallen by this.
_BAND_DB = -10.0

# Residual video phase that is worth the removal, at the farthest range that the samples can have.
_LEAST_TURN = 1e-3

_UNEVEN = 1e-3


@dataclass(frozen=True)
class Echo:
    """Echoes of a stepped frequency.

    Attributes
    ----------
    samples
        Complex echo (..., position, frequency) with the phase ``-2 pi f R / c``.
    frequency
        Frequencies (frequency,), rising in even steps, Hz.
    notes
        What was assumed or done, a sentence each.
    """

    samples: Complexes
    frequency: Floats
    notes: tuple[str, ...]


def stepped(
    samples: ArrayLike,
    frequency_hz: ArrayLike,
    *,
    sign: Sign = -1,
    reference_range_m: ArrayLike | None = None,
) -> Echo:
    """Take samples over frequency, as a network analyser or a phase history has them.

    Parameters
    ----------
    samples
        Complex samples (..., position, frequency).
    frequency_hz
        Frequencies (frequency,), even, rising or falling, Hz.
    sign
        Sign of the phase that grows with range.
    reference_range_m
        Range (position,) whose phase the radar has taken out, m.

    Returns
    -------
    Echo
        The echo.

    Raises
    ------
    ValueError
        If the samples are real, or do not fit the frequencies.
    """
    values, frequency = np.asarray(samples), np.asarray(frequency_hz, dtype=float)
    if not np.iscomplexobj(values):
        raise ValueError("samples over frequency must be complex; these are real")
    _refuse_misfit(values, frequency, "frequencies")
    _refuse_uneven(frequency, "frequencies")
    notes = [f"{frequency.size} frequencies, {_band(frequency)}"]
    if frequency[0] > frequency[-1]:
        values, frequency = values[..., ::-1], frequency[::-1]
        notes.append("frequencies fall; turned round")
    values = _signed(values, sign, notes)
    return Echo(_restored(values, frequency, reference_range_m, notes), frequency, tuple(notes))


def dechirped(
    samples: ArrayLike,
    *,
    start_frequency_hz: float,
    sweep_rate_hz_per_s: float,
    sample_rate_hz: float,
    sign: Sign = 1,
    alternating: bool = False,
    reference_range_m: ArrayLike | None = None,
) -> Echo:
    """Take the beat of an FMCW radar: what it receives, mixed with what it transmits.

    The sample at the time ``t`` belongs to the frequency ``f0 + a t`` of the sweep. A target of the
    delay ``T`` has there the phase ``2 pi (f0 + a t) T - pi a T^2``, of which the second part, the
    residual video phase, is removed by a filter over the beat's spectrum (Carrara, Goodman &
    Majewski 1995, section 10.6). Of a real beat the analytic signal is taken: a positive beat is a
    positive range.

    Parameters
    ----------
    samples
        Beat (..., position, time), real or complex.
    start_frequency_hz
        Frequency at the first sample, Hz.
    sweep_rate_hz_per_s
        Rate of the sweep, negative for one that falls, Hz/s.
    sample_rate_hz
        Samples per second, Hz.
    sign
        Sign of a complex beat's phase as it grows with range: 1 if the transmitted signal is
        mixed with the conjugate of the received one, -1 if the received with that of the
        transmitted. A real beat has none.
    alternating
        Every second position, from the second on, is swept back along the same frequencies.
    reference_range_m
        Range (position,) of the signal that the echo is mixed with, m, if it is delayed.

    Returns
    -------
    Echo
        The echo.

    Raises
    ------
    ValueError
        If a rate is 0, or the sweep passes through 0 Hz.
    """
    from scipy import fft

    values = np.asarray(samples)
    count = values.shape[-1]
    if sample_rate_hz <= 0 or sweep_rate_hz_per_s == 0:
        raise ValueError(
            f"a sample rate of {sample_rate_hz:g} Hz and a sweep rate of {sweep_rate_hz_per_s:g} "
            "Hz/s make no sweep; the first must be positive, the second not 0"
        )
    if count < 2:
        raise ValueError(f"{count} sample makes no sweep; two or more are needed")
    notes: list[str] = []
    step = sweep_rate_hz_per_s / sample_rate_hz
    frequency = start_frequency_hz + step * np.arange(count)
    if min(frequency[0], frequency[-1]) <= 0:
        raise ValueError(f"the sweep goes from {frequency[0]:g} to {frequency[-1]:g} Hz")
    notes.append(f"a sweep of {count} samples, {_band(frequency)}")
    rates = np.full(values.shape[-2], sweep_rate_hz_per_s)
    if alternating:
        rates[1::2] *= -1
        notes.append("every second sweep runs back")
    if np.iscomplexobj(values):
        beat = values if sign > 0 else values.conj()
        notes.append(f"phase of the beat taken to {'rise' if sign > 0 else 'fall'} with range")
    else:
        # Positive frequencies alone: of a rising sweep they have the sign +1, of a falling one -1.
        beat = _analytic(values)
        beat = np.where(rates[:, None] > 0, beat, beat.conj())
        notes.append("real beat: its analytic signal (Hilbert), with positive ranges")
    # Now a beat exp(+2 pi i f T): its frequency over time is a T, of the sign of the sweep.
    farthest = sample_rate_hz / 2 / abs(sweep_rate_hz_per_s)
    turn = np.pi * abs(sweep_rate_hz_per_s) * farthest**2
    if turn > _LEAST_TURN:
        padded = fft.next_fast_len(2 * count)
        beat_hz = fft.fftfreq(padded, 1 / sample_rate_hz)
        phase = np.exp(1j * np.pi * beat_hz**2 / rates[:, None])
        beat = fft.ifft(fft.fft(beat, padded, axis=-1) * phase, axis=-1)[..., :count]
        notes.append(
            f"residual video phase removed; it reaches {np.rad2deg(turn):.3g} degrees at "
            f"{SPEED_OF_LIGHT * farthest / 2:.4g} m"
        )
    if alternating:
        # The way back begins a step after the last frequency of the way out.
        shared = np.array(beat[..., 1:])
        shared[..., 1::2, :] = beat[..., 1::2, :0:-1]
        beat, frequency = shared, frequency[1:]
    if frequency[0] > frequency[-1]:
        beat, frequency = beat[..., ::-1], frequency[::-1]
    upward = beat.conj()
    return Echo(_restored(upward, frequency, reference_range_m, notes), frequency, tuple(notes))


def pulses(
    samples: ArrayLike,
    range_m: ArrayLike,
    *,
    carrier_frequency_hz: float = 0.0,
    band_hz: tuple[float, float] | None = None,
    sign: Sign = -1,
    reference_range_m: ArrayLike | None = None,
    carrier_kept: bool = False,
) -> Echo:
    """Take pulses, or range profiles, sampled over range: their spectrum is the echo.

    Parameters
    ----------
    samples
        Samples (..., position, range), real at radio frequency (of which the analytic signal is
        taken) or complex.
    range_m
        Even, rising one-way range of the samples, or what is left of it with a reference, m.
    carrier_frequency_hz
        Frequency that is 0 in the complex samples, Hz; 0 if they are not mixed down.
    band_hz
        Frequencies to take, Hz; None for those within 10 dB of the mean spectrum's maximum.
    sign
        Sign of the phase that grows with range, of complex samples.
    reference_range_m
        Range (position,) that counts as 0 on the range axis, m.
    carrier_kept
        The reference has shifted the samples alone and left the carrier's phase as it was.

    Returns
    -------
    Echo
        The echo.

    Raises
    ------
    ValueError
        If ranges are uneven, real samples have a carrier, or the band is not theirs.
    """
    from scipy import fft

    values, ranges = np.asarray(samples), np.asarray(range_m, dtype=float)
    _refuse_misfit(values, ranges, "ranges")
    _refuse_uneven(ranges, "ranges")
    if ranges[0] > ranges[-1]:
        raise ValueError("the ranges fall; turn them and the samples round")
    real = not np.iscomplexobj(values)
    if real and carrier_frequency_hz:
        raise ValueError("real samples are at radio frequency; they have no carrier to add")
    notes: list[str] = []
    step = (ranges[-1] - ranges[0]) / (ranges.size - 1)
    rate = SPEED_OF_LIGHT / (2 * step)
    notes.append(
        f"{ranges.size} ranges from {ranges[0]:.4g} to {ranges[-1]:.4g} m, sampled at "
        f"{rate / 1e9:.4g} GHz"
    )
    if real:
        notes.append("real samples: positive frequencies are taken (the analytic signal)")
    else:
        values = _signed(values, sign, notes)
    # Padded, so that the ranges are unambiguous from 0 on where that costs little.
    count = ranges.size
    if 0 <= ranges[0] < ranges[-1] - ranges[0]:
        count = int(np.ceil(ranges[-1] / step)) + 1
    count = fft.next_fast_len(count, real=real)
    if real:
        spectrum, offset = 2 * fft.rfft(values, count, axis=-1), fft.rfftfreq(count, 1 / rate)
    else:
        spectrum = fft.fftshift(fft.fft(values, count, axis=-1), axes=-1)
        offset = fft.fftshift(fft.fftfreq(count, 1 / rate))
    frequency = carrier_frequency_hz + offset
    chosen = _chosen(spectrum, frequency, band_hz, notes)
    spectrum, offset, frequency = spectrum[..., chosen], offset[chosen], frequency[chosen]
    if frequency[0] <= 0:
        raise ValueError(f"the band begins at {frequency[0]:g} Hz; give the carrier's frequency")
    # The first sample's range turns the spectrum, and the reference the carrier as well.
    spectrum = spectrum * np.exp(-4j * np.pi * offset * ranges[0] / SPEED_OF_LIGHT)
    if reference_range_m is None or not carrier_kept:
        spectrum = _restored(spectrum, frequency, reference_range_m, notes)
    else:
        spectrum = _restored(spectrum, offset, reference_range_m, notes)
        notes.append("the carrier's phase was not referenced")
    return Echo(spectrum, frequency, tuple(notes))


def _chosen(
    spectrum: Complexes, frequency: Floats, band_hz: tuple[float, float] | None, notes: list[str]
) -> slice:
    mean = np.sqrt((np.abs(spectrum) ** 2).reshape(-1, frequency.size).mean(axis=0))
    level = 20 * np.log10(np.maximum(mean, 1e-300) / max(mean.max(), 1e-300))
    if band_hz is None:
        within = np.flatnonzero(level >= _BAND_DB)
        how = f"within {-_BAND_DB:g} dB of the mean spectrum's maximum"
    else:
        within = np.flatnonzero((frequency >= band_hz[0]) & (frequency <= band_hz[1]))
        how = "as given"
    if within.size < 2:
        raise ValueError(
            f"the band has {within.size} frequencies of those from {frequency[0] / 1e9:.4g} to "
            f"{frequency[-1] / 1e9:.4g} GHz; two or more are needed"
        )
    chosen = slice(int(within[0]), int(within[-1]) + 1)
    notes.append(
        f"band {how}: {_band(frequency[chosen])}, {frequency[chosen].size} frequencies, where the "
        f"mean spectrum falls to {level[chosen].min():.3g} dB"
    )
    return chosen


def _analytic(values: Floats) -> Complexes:
    from scipy.signal import hilbert

    return np.asarray(hilbert(values, axis=-1))


def _signed(values: Complexes, sign: Sign, notes: list[str]) -> Complexes:
    if sign not in (-1, 1):
        raise ValueError(f"the sign {sign} must be -1 or 1")
    notes.append(f"phase taken to {'rise' if sign > 0 else 'fall'} with range")
    return values.conj() if sign > 0 else values


def _restored(
    samples: Complexes, frequency: Floats, reference_range_m: ArrayLike | None, notes: list[str]
) -> Complexes:
    """Put back the phase of a reference range, over absolute frequencies or the band's alone."""
    if reference_range_m is None:
        return samples
    reference = np.broadcast_to(np.asarray(reference_range_m, dtype=float), samples.shape[-2:-1])
    if not np.isfinite(reference).all():
        raise ValueError("a reference range is missing or not finite")
    notes.append(
        f"reference range of {reference.min():.6g} to {reference.max():.6g} m put back into the "
        "phase"
    )
    turns = 2 * frequency * reference[:, None] / SPEED_OF_LIGHT
    return samples * np.exp(-2j * np.pi * (turns % 1))


def _band(frequency: Floats) -> str:
    low, high = sorted((float(frequency[0]), float(frequency[-1])))
    return f"{low / 1e9:.6g} to {high / 1e9:.6g} GHz"


def _refuse_misfit(values: NDArray[np.generic], axis: Floats, what: str) -> None:
    if axis.ndim != 1 or axis.size < 2:
        raise ValueError(
            f"{what} of the shape {axis.shape}; one dimension of two or more is needed"
        )
    if values.ndim < 2 or values.shape[-1] != axis.size:
        raise ValueError(f"samples of the shape {values.shape} do not fit {axis.size} {what}")


def _refuse_uneven(axis: Floats, what: str) -> None:
    steps = np.diff(axis)
    step = (axis[-1] - axis[0]) / steps.size
    if not np.isfinite(axis).all() or step == 0 or np.abs(steps / step - 1).max() > _UNEVEN:
        raise ValueError(f"the {what} are not in even steps (to 0.1 % of one); resample them")
