"""Paths from transmitter to facet to receiver, and what each facet returns."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(nogil=True, cache=True, error_model="numpy")
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
        Positions (facet, 3), float64.
    amplitude
        Amplitudes (facet,).
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
    count = 0
    for i in range(facets.shape[0]):
        if not visible[i]:
            continue
        out = np.sqrt(
            (facets[i, 0] - transmitter[0]) ** 2
            + (facets[i, 1] - transmitter[1]) ** 2
            + (facets[i, 2] - transmitter[2]) ** 2
        )
        back = np.sqrt(
            (facets[i, 0] - receiver[0]) ** 2
            + (facets[i, 1] - receiver[1]) ** 2
            + (facets[i, 2] - receiver[2]) ** 2
        )
        path[count] = out + back
        weight[count] = amplitude[i]
        if spreading_reference > 0:
            weight[count] *= spreading_reference**2 / (out * back)
        count += 1
    return count
