"""Resampling the columns of an image from the places where their pixels belong."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel


@kernel
def resample(values: np.ndarray, place: np.ndarray, axis: np.ndarray, out: np.ndarray) -> None:
    """Interpolate each column linearly at the axis, from values at places of their own.

    Parameters
    ----------
    values, place
        Values and where they belong (row, column), float64. A NaN place is missing: between the
        rows on its two sides nothing is interpolated.
    axis
        Where to interpolate (row,), evenly spaced and rising.
    out
        Output (row, column), float64; NaN more than a step of the axis beyond the outermost place,
        and more than half a step from the places on either side of a missing one.
    """
    rows, columns = values.shape
    spacing = axis[1] - axis[0]
    x, y = np.empty(rows), np.empty(rows)
    # How many are missing before each place.
    before = np.empty(rows, np.int64)
    for column in range(columns):
        count = missing = 0
        for row in range(rows):
            if np.isfinite(place[row, column]):
                # Places mostly rise. Those that coincide stay in the order of the image.
                at = count
                while at > 0 and x[at - 1] > place[row, column]:
                    x[at], y[at], before[at] = x[at - 1], y[at - 1], before[at - 1]
                    at -= 1
                x[at], y[at], before[at] = place[row, column], values[row, column], missing
                count += 1
            else:
                missing += 1
        if count == 0:
            out[:, column] = np.nan
            continue
        left = 0
        for row in range(axis.size):
            target = axis[row]
            if target < x[0] - spacing or target > x[count - 1] + spacing:
                out[row, column] = np.nan
                continue
            while left < count - 1 and x[left + 1] <= target:
                left += 1
            if target <= x[0]:
                out[row, column] = y[0]
            elif left == count - 1:
                out[row, column] = y[count - 1]
            elif before[left] != before[left + 1]:
                if target - x[left] <= spacing / 2:
                    out[row, column] = y[left]
                elif x[left + 1] - target < spacing / 2:
                    out[row, column] = y[left + 1]
                else:
                    out[row, column] = np.nan
            else:
                share = (target - x[left]) / (x[left + 1] - x[left])
                out[row, column] = y[left] + share * (y[left + 1] - y[left])
