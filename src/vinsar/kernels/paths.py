"""Paths from transmitter to facet to receiver, and what each visible facet returns.

Facets go in chunks through loops that vectorise; only the last one, which leaves the hidden ones
out, does not.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vinsar.kernels.compiling import kernel, part

_CHUNK = 512

# Taylor series in t^2 of sin(pi t) / t and cos(pi t): on |t| <= 1/2 they leave out less than 1e-17.
# PyPI's llvmlite has no vector math library: math.sin would keep the loop scalar.
_SIN = tuple((-1) ** n * math.pi ** (2 * n + 1) / math.factorial(2 * n + 1) for n in range(11))
_COS = tuple((-1) ** n * math.pi ** (2 * n) / math.factorial(2 * n) for n in range(11))


@part
def distances(out: Any, facets: Any, begin: int, antenna: Any) -> None:
    """Compute the distances of an antenna from as many facets as there is room for."""
    ax, ay, az = antenna[0], antenna[1], antenna[2]
    for i in range(out.size):
        dx = facets[0, begin + i] - ax
        dy = facets[1, begin + i] - ay
        dz = facets[2, begin + i] - az
        out[i] = np.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def gather(
    facets: np.ndarray,
    amplitude: np.ndarray,
    visible: np.ndarray,
    transmitter: np.ndarray,
    receiver: np.ndarray,
    spreading_reference: float,
    path: np.ndarray,
    weight: np.ndarray,
) -> int:
    """Collect path length and amplitude of the visible facets at one antenna position.

    Parameters
    ----------
    facets
        Positions (3, facet), float64.
    amplitude
        Amplitudes (facet,), float64.
    visible
        Flags (facet,).
    transmitter, receiver
        Antenna positions (3,).
    spreading_reference
        Range at which the spreading is 1, m; 0 for none.
    path
        Output: path out and back, m (facet,); filled from the start.
    weight
        Output: amplitude with spreading (facet,); filled from the start.

    Returns
    -------
    int
        Number of visible facets.
    """
    out_buffer, back_buffer = np.empty(_CHUNK), np.empty(_CHUNK)
    count = 0
    for begin in range(0, amplitude.size, _CHUNK):
        size = min(_CHUNK, amplitude.size - begin)
        out, back = out_buffer[:size], back_buffer[:size]
        distances(out, facets, begin, transmitter)
        distances(back, facets, begin, receiver)
        for i in range(size):
            if visible[begin + i]:
                path[count] = out[i] + back[i]
                weight[count] = amplitude[begin + i]
                if spreading_reference > 0:
                    weight[count] *= spreading_reference**2 / (out[i] * back[i])
                count += 1
    return count


@kernel
def strengths(
    path: np.ndarray,
    weight: np.ndarray,
    turns_per_metre: float,
    steps_per_metre: float,
    angle: np.ndarray,
    strength: np.ndarray,
) -> None:
    """Turn paths into the points and strengths of a non-uniform Fourier transform.

    Parameters
    ----------
    path, weight
        From `gather` (facet,).
    turns_per_metre
        Cycles of the middle frequency per metre of path.
    steps_per_metre
        Cycles of the frequency step per metre of path.
    angle
        Output: phase of a frequency step, -pi to pi (facet,).
    strength
        Output: weight times the phasor of the middle frequency, complex128 (facet,).
    """
    parts = strength.view(np.float64)
    for i in range(path.size):
        steps = path[i] * steps_per_metre
        angle[i] = 2 * np.pi * (steps - np.floor(steps + 0.5))
        turns = path[i] * turns_per_metre
        t = np.floor(turns + 0.5) - turns
        q = t * t
        s = _SIN[10]
        c = _COS[10]
        for n in range(9, -1, -1):
            s = s * q + _SIN[n]
            c = c * q + _COS[n]
        s *= t
        parts[2 * i] = weight[i] * (1 - 2 * s * s)
        parts[2 * i + 1] = weight[i] * (2 * s * c)
