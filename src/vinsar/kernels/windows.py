"""Means over windows of an image."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel

# Rows that are averaged along x at once.
_ROWS = 8


@kernel
def mean(
    values: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
    sides: tuple[int, int],
    out: np.ndarray,
) -> None:
    """Average over a window around each pixel, by running sums.

    Parameters
    ----------
    values
        Values (y, x part), float64: of each pixel so many parts, averaged by themselves.
    rows, columns
        Which row, and which column, each place along the windows holds (y + side - 1,) and
        (x + side - 1,); -1 for zeros.
    sides
        Sides of the window in rows and columns.
    out
        Output of the shape of the values, float64.
    """
    down, width = values.shape
    count = columns.size
    across = count - sides[1] + 1
    parts = width // across
    scale = 1.0 / (sides[0] * sides[1])
    sums, total = np.zeros(width), np.empty(_ROWS * parts)
    # Sums down the columns of some rows, side by side: the loops along x work on all at once.
    strip, means = np.zeros((count, _ROWS * parts)), np.empty((across, _ROWS * parts))
    for place in range(sides[0] - 1):
        if rows[place] >= 0:
            line = values[rows[place]]
            for n in range(width):
                sums[n] += line[n]
    for begin in range(0, down, _ROWS):
        some = min(_ROWS, down - begin)
        for row in range(begin, begin + some):
            if rows[row + sides[0] - 1] >= 0:
                line = values[rows[row + sides[0] - 1]]
                for n in range(width):
                    sums[n] += line[n]
            first = (row - begin) * parts
            for place in range(count):
                if columns[place] >= 0:
                    for part in range(parts):
                        strip[place, first + part] = sums[columns[place] * parts + part]
            if rows[row] >= 0:
                line = values[rows[row]]
                for n in range(width):
                    sums[n] -= line[n]
        total[:] = 0
        for place in range(sides[1] - 1):
            for n in range(total.size):
                total[n] += strip[place, n]
        for column in range(across):
            enters, leaves, found = strip[column + sides[1] - 1], strip[column], means[column]
            for n in range(total.size):
                now = total[n] + enters[n]
                found[n] = now * scale
                total[n] = now - leaves[n]
        for row in range(some):
            for column in range(across):
                for part in range(parts):
                    out[begin + row, column * parts + part] = means[column, row * parts + part]
