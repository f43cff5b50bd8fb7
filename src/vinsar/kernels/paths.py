"""Paths from transmitter to facet to receiver, and what each visible facet returns.

Facets go in chunks through loops that vectorise; only the last one, which leaves the hidden ones
out, does not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vinsar.kernels.compiling import kernel, part

_CHUNK = 512


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
