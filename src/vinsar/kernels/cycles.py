"""Whole cycles along a path, by dynamic programming."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel


@kernel
def likeliest(gain: np.ndarray, cost: np.ndarray, path: np.ndarray) -> None:
    """Find the likeliest path over states by dynamic programming.

    Parameters
    ----------
    gain
        What each jump from a position to the next speaks for (position - 1, jump); the middle one
        stays in the state.
    cost
        What speaks against a state (position, state).
    path
        Output (position,): the state taken at each position, int64.
    """
    positions, states = cost.shape
    most = gain.shape[1] // 2
    come = np.empty((positions, states), np.int64)
    best, next_ = -cost[0], np.empty(states)
    for position in range(1, positions):
        for state in range(states):
            found, jumped = -np.inf, 0
            for jump in range(-most, most + 1):
                if 0 <= state - jump < states:
                    value = best[state - jump] + gain[position - 1, jump + most]
                    if value > found:
                        found, jumped = value, jump
            next_[state] = found - cost[position, state]
            come[position, state] = state - jumped
        best[:] = next_
    path[positions - 1] = best.argmax()
    for position in range(positions - 1, 0, -1):
        path[position - 1] = come[position, path[position]]
