"""Suppression of the transmit-receive coupling in the received echo.

The coupling is strong, near and much the same at all antenna positions. Its near return lies
outside the image; what harms are its range sidelobes, which reach the scene. Either property
tells it from the scene: that it is near (`gate`), or that it is constant (`remove_common`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.processing import health
from vinsar.radar import waveform

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study

Method = Literal["none", "gate", "common", "both"]
METHODS: tuple[Method, ...] = ("none", "gate", "common", "both")

# Of a return inside the gate about this much is left: -120 dB. The sequences that hold more of one
# than that are as many as the range has cells, and fewer than these besides.
_LEFT = 1e-6
_EDGE = 24


class Suppression(Section, name="suppression"):
    """Suppression of the coupling between transmitter and receiver."""

    method: Literal["none", "gate", "common", "both"] = key(
        "what is removed from the echo: returns from within the gate, what is common to all "
        "antenna positions, or both",
        "future work",
    )
    gate_range_m: float = key("slant range up to which the gate removes returns", "ours", gt=0)


def clean(received: xr.Dataset, study: Study) -> xr.Dataset:
    """Return the echo as all processing takes it: of sound positions, with the coupling suppressed.

    Parameters
    ----------
    received
        Product ``received``.
    study
        The configuration, with its section ``suppression``.
    """
    return suppress(health.sound(received), **study.suppression.model_dump())


def suppress(echo: xr.Dataset, *, method: Method, gate_range_m: float) -> xr.Dataset:
    """Suppress the coupling by a method.

    Parameters
    ----------
    echo
        Product ``received``.
    method
        `gate`, what is `common` to all positions, one after the other, or none.
    gate_range_m
        Slant range up to which `gate` removes returns, m.

    Returns
    -------
    xarray.Dataset
        Product ``received``; the same object for the method ``none``.
    """
    if method in ("gate", "both"):
        echo = gate(echo, range_m=gate_range_m)
    if method in ("common", "both"):
        echo = remove_common(echo)
    return echo


def remove_common(echo: xr.Dataset) -> xr.Dataset:
    """Remove what is common to all positions: each channel's mean spectrum over them.

    Positions that are zero, as `health.sound` leaves them, stay so and do not count. A target whose
    range hardly changes along the aperture goes with the others (`common_share`).

    Parameters
    ----------
    echo
        Product ``received``.

    Returns
    -------
    xarray.Dataset
        Product ``received``.
    """
    samples = echo["echo"].values
    used = samples.any(axis=(0, 2))
    if used.all() or not used.any():
        return _with(echo, samples - samples.mean(axis=1, keepdims=True))
    result = np.zeros_like(samples)
    result[:, used] = samples[:, used] - samples[:, used].mean(axis=1, keepdims=True)
    return _with(echo, result)


def common_share(
    trajectory: xr.Dataset, x: ArrayLike, y: ArrayLike, wavelength_m: float
) -> NDArray[np.floating]:
    """Return how much of a target's image goes with what is common to all positions.

    Its spectrum has the mean ``m = mean_l exp(-2 pi i R_l / lambda)`` over the positions, and its
    image, which sums the conjugate phases, loses ``|m|^2`` of its amplitude and no phase. Along a
    rail ``m`` is a Fresnel integral: about ``sqrt(lambda r) / 2 L`` where the foot of the target is
    within the aperture, and little elsewhere.

    Parameters
    ----------
    trajectory
        Product ``trajectory``.
    x, y
        Targets on the ground plane, m, of shapes that broadcast.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    ndarray, shape (channel, ...)
        Share of the amplitude, 0 to 1.
    """
    target = np.stack(np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float), 0.0), axis=-1)
    path = sum(
        np.linalg.norm(
            target[..., None, :]
            - np.expand_dims(trajectory[name].values, (*range(1, target.ndim),)),
            axis=-1,
        )
        for name in ("transmitter", "receiver")
    )
    return np.abs(np.exp(-2j * np.pi * path / wavelength_m).mean(axis=-1)) ** 2


def gate(echo: xr.Dataset, *, range_m: float) -> xr.Dataset:
    """Remove returns from within a slant range, with their sidelobes at all ranges.

    To blank a range profile would leave the sidelobes outside the blanked part. Here each spectrum
    is projected onto the complement of all spectra that returns from within the range can have.
    Of a finite band these span few dimensions, the discrete prolate spheroidal sequences (Slepian
    1978): as many as the range has cells, and some for the edge. Targets well outside lose little.

    Parameters
    ----------
    echo
        Product ``received``.
    range_m
        Slant range up to which returns are removed, m.

    Returns
    -------
    xarray.Dataset
        Product ``received``.

    Raises
    ------
    ValueError
        If the range is not within the unambiguous range.
    """
    from scipy.signal import windows

    samples, frequency = echo["echo"].values, echo["frequency"].values
    count = frequency.size
    step = float(frequency[-1] - frequency[0]) / (count - 1)
    unambiguous = waveform.unambiguous_range(step)
    if not 0 < range_m < unambiguous:
        raise ValueError(
            f"a gate of {range_m} m is not within the unambiguous range of {unambiguous:.2f} m"
        )
    # Half the range is to the unambiguous range what the bandwidth is to the sampling rate.
    bandwidth = range_m / 2 * count / unambiguous
    most = min(count, int(np.ceil(2 * bandwidth)) + _EDGE)
    sequences, inside = windows.dpss(count, bandwidth, most, return_ratios=True)
    middle = np.exp(-2j * np.pi * frequency * range_m / SPEED_OF_LIGHT)
    basis = np.asarray((sequences[inside > _LEFT**2] * middle).T, np.complex128)
    return _with(echo, samples - (samples @ basis.conj()) @ basis.T)


def _with(echo: xr.Dataset, samples: NDArray[np.complexfloating]) -> xr.Dataset:
    coords = {"channel": echo["channel"].values, "frequency": echo["frequency"].values}
    return variables.dataset("received", {"echo": samples}, coords)
