"""Means over windows of an image."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel


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
    parts = width // (count - sides[1] + 1)
    scale = 1.0 / (sides[0] * sides[1])
    # Sums down the columns, and of those up to each place along a row.
    sums, total = np.zeros(width), np.zeros((count + 1) * parts)
    ends = total[sides[1] * parts :]
    for place in range(sides[0] - 1):
        if rows[place] >= 0:
            line = values[rows[place]]
            for n in range(width):
                sums[n] += line[n]
    for row in range(down):
        if rows[row + sides[0] - 1] >= 0:
            line = values[rows[row + sides[0] - 1]]
            for n in range(width):
                sums[n] += line[n]
        for part in range(parts):
            so_far = 0.0
            for place in range(count):
                if columns[place] >= 0:
                    so_far += sums[columns[place] * parts + part]
                total[(place + 1) * parts + part] = so_far
        found = out[row]
        for n in range(width):
            found[n] = (ends[n] - total[n]) * scale
        if rows[row] >= 0:
            line = values[rows[row]]
            for n in range(width):
                sums[n] -= line[n]
