"""Resampling the columns of an image from the places where their pixels belong."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel


@kernel
def weigh(
    place: np.ndarray, axis: np.ndarray, first: np.ndarray, second: np.ndarray, share: np.ndarray
) -> None:
    """Find between which rows of each column the places of an axis lie.

    Parameters
    ----------
    place
        Where the rows of each column belong (row, column), float64. A NaN place is missing: between
        the rows on its two sides nothing is interpolated.
    axis
        Where to interpolate (row,), evenly spaced and rising.
    first, second
        Outputs, the two rows (row, column), int32; -1 more than a step of the axis beyond the
        outermost place, and more than half a step from the places on either side of a missing one.
    share
        Output, the weight of the second row (row, column), float64.
    """
    rows, columns = place.shape
    spacing = axis[1] - axis[0]
    x, source = np.empty(rows), np.empty(rows, np.int32)
    # How many are missing before each place.
    before = np.empty(rows, np.int64)
    for column in range(columns):
        count = missing = 0
        for row in range(rows):
            if np.isfinite(place[row, column]):
                # Places mostly rise. Those that coincide stay in the order of the image.
                at = count
                while at > 0 and x[at - 1] > place[row, column]:
                    x[at], source[at], before[at] = x[at - 1], source[at - 1], before[at - 1]
                    at -= 1
                x[at], source[at], before[at] = place[row, column], row, missing
                count += 1
            else:
                missing += 1
        left = 0
        for row in range(axis.size):
            target = axis[row]
            share[row, column] = 0
            if count == 0 or target < x[0] - spacing or target > x[count - 1] + spacing:
                first[row, column] = second[row, column] = -1
                continue
            while left < count - 1 and x[left + 1] <= target:
                left += 1
            one = other = source[left]
            if target > x[0] and left < count - 1:
                if before[left] == before[left + 1]:
                    other = source[left + 1]
                    share[row, column] = (target - x[left]) / (x[left + 1] - x[left])
                elif target - x[left] > spacing / 2:
                    one = source[left + 1] if x[left + 1] - target < spacing / 2 else np.int32(-1)
                    other = one
            first[row, column], second[row, column] = one, other


@kernel
def resample(
    values: np.ndarray, first: np.ndarray, second: np.ndarray, share: np.ndarray, out: np.ndarray
) -> None:
    """Interpolate each column between the rows that `weigh` has found.

    Parameters
    ----------
    values
        Values (row, column), float64.
    first, second, share
        The two rows and the weight of the second (row, column).
    out
        Output (row, column), float64; NaN where there are no such rows.
    """
    rows, columns = first.shape
    for row in range(rows):
        for column in range(columns):
            one, other = first[row, column], second[row, column]
            if one < 0:
                out[row, column] = np.nan
            elif one == other:
                out[row, column] = values[one, column]
            else:
                before = values[one, column]
                out[row, column] = before + share[row, column] * (values[other, column] - before)
