"""The stepped waveform: its frequencies, range resolution, ambiguity and weightings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.foundations.constants import SPEED_OF_LIGHT

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

WindowName = Literal["rectangular", "hann", "hamming", "blackman"]

KEYS = ("radar.start_frequency_hz", "radar.stop_frequency_hz", "radar.frequency_count")
"""Keys of the configuration that give the waveform."""


def frequencies(
    start_frequency_hz: float, stop_frequency_hz: float, frequency_count: int
) -> NDArray[np.floating]:
    """Return the evenly spaced frequencies of the stepped waveform, both ends included.

    Parameters
    ----------
    start_frequency_hz, stop_frequency_hz
        Lowest and highest frequency, Hz.
    frequency_count
        How many, at least 2.

    Returns
    -------
    ndarray, shape (frequency,)
        Frequencies, Hz.

    Raises
    ------
    ValueError
        If the frequencies do not rise or are fewer than 2.
    """
    if not 0 < start_frequency_hz < stop_frequency_hz:
        raise ValueError(
            f"the start frequency {start_frequency_hz} Hz must be positive and below "
            f"the stop frequency {stop_frequency_hz} Hz"
        )
    if frequency_count < 2:
        raise ValueError(f"{frequency_count} frequencies make no range profile; take 2 or more")
    return np.linspace(start_frequency_hz, stop_frequency_hz, frequency_count)


def sampled(radar: Any) -> NDArray[np.floating]:
    """Return the frequencies of a configuration's waveform, Hz.

    Parameters
    ----------
    radar
        Section ``radar``.
    """
    return frequencies(radar.start_frequency_hz, radar.stop_frequency_hz, radar.frequency_count)


def carrier(frequency: ArrayLike) -> float:
    """Return the carrier: the middle of the band, Hz."""
    values = np.asarray(frequency, dtype=float)
    return float(values[0] + values[-1]) / 2


def wavelength(frequency_hz: float) -> float:
    """Return the wavelength in metres."""
    return SPEED_OF_LIGHT / frequency_hz


def range_resolution(bandwidth_hz: float) -> float:
    """Return the slant-range resolution ``c / 2W`` in metres, with W the bandwidth."""
    return SPEED_OF_LIGHT / (2 * bandwidth_hz)


def unambiguous_range(frequency_step_hz: float) -> float:
    """Return the range in metres after which a stepped waveform repeats."""
    return SPEED_OF_LIGHT / (2 * frequency_step_hz)


def window(name: WindowName, count: int) -> NDArray[np.floating]:
    """Return a symmetric weighting, scaled to a sum of 1.

    Parameters
    ----------
    name
        Name of the weighting.
    count
        Number of samples.

    Returns
    -------
    ndarray, shape (count,)
        Weights.
    """
    if name == "rectangular":
        return np.full(count, 1 / count)
    # It takes 0.3 s to load, which most jobs need not wait for.
    from scipy.signal import windows

    if name == "hamming":
        weights = windows.hamming(count, sym=True)
    else:
        # One sample more on each side, so that hann and blackman keep their end samples.
        weights = windows.get_window(name, count + 2, fftbins=False)[1:-1]
    return np.asarray(weights / weights.sum())


def window_width(name: WindowName) -> float:
    """Return a weighting's -3 dB width in units of the resolution ``c / 2W``.

    Twice the root of the transform of the continuous weighting, ``|F(u)|^2 = 1/2``. A solver would
    take a quarter of a second to load at each start.
    """
    return {
        "rectangular": 0.8858929413789046,
        "hann": 1.4405825801202676,
        "hamming": 1.3029820808162895,
        "blackman": 1.643681675384673,
    }[name]
