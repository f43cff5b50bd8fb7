"""Phases of complex images, and images of some phase."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import angle, fine_phasor


@kernel
def of(values: np.ndarray, out: np.ndarray) -> None:
    """Return the phases of complex numbers.

    Parameters
    ----------
    values
        Real and imaginary parts in turn (2 n,), float64.
    out
        Output (n,), rad, float64; 0 for a zero.
    """
    for n in range(out.size):
        out[n] = angle(values[2 * n], values[2 * n + 1])


@kernel
def unit(values: np.ndarray, out: np.ndarray) -> None:
    """Return complex numbers of the same phases and of magnitude 1.

    Parameters
    ----------
    values
        Real and imaginary parts in turn (2 n,), float64.
    out
        Output of the same kind; 0 for a zero.
    """
    for n in range(out.size // 2):
        real, imag = values[2 * n], values[2 * n + 1]
        magnitude = np.sqrt(real * real + imag * imag)
        scale = 1 / magnitude if magnitude > 0 else 0.0
        out[2 * n], out[2 * n + 1] = real * scale, imag * scale


@kernel
def rotation(phase: np.ndarray, out: np.ndarray) -> None:
    """Return exp(-i phase).

    Parameters
    ----------
    phase
        Phases of whatever size (n,), rad, float64.
    out
        Output (n,), complex64; NaN where the phase is not finite.
    """
    parts = out.view(np.float32)
    for n in range(phase.size):
        turn = phase[n] / (2 * np.pi)
        cosine, sine = fine_phasor(np.float32(turn - np.rint(turn)))
        parts[2 * n], parts[2 * n + 1] = cosine, -sine
