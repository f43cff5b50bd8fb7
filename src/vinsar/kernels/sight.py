"""Lines of sight over a grid, seen from above: along rays, from row to row in the nearest cells."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel


@kernel
def horizon(height: np.ndarray, columns: np.ndarray, rays: np.ndarray, ahead: np.ndarray) -> None:
    """Replace heights by the lines of sight that pass over those before them.

    Parameters
    ----------
    height
        Heights above the antenna (row, column), m, -inf where there is none; and the output, -inf
        where nothing lies before.
    columns
        Column of each ray in each row (row, ray); -1 beside the grid.
    rays
        Ray through each cell (row, column).
    ahead
        Distance of the rows from the antenna, m.
    """
    rows, count = columns.shape
    steepest, next_ = np.full(count, -np.inf), np.empty(count)
    for row in range(rows):
        for ray in range(count):
            column = columns[row, ray]
            slope = height[row, column] / ahead[row] if column >= 0 else -np.inf
            next_[ray] = max(steepest[ray], slope)
        for column in range(height.shape[1]):
            height[row, column] = steepest[rays[row, column]] * ahead[row]
        steepest[:] = next_


@kernel
def too_low(
    dark: np.ndarray,
    height: np.ndarray,
    cycle: np.ndarray,
    columns: np.ndarray,
    ahead: np.ndarray,
    top: float,
    ground: float,
    reach: int,
    found: np.ndarray,
) -> None:
    """Find what stands before a shadow and is half a cycle too low for its length.

    Parameters
    ----------
    dark, height, cycle
        Shadow, heights, NaN where there is none, and height of ambiguity (row, column), m.
    columns
        Column of each ray in each row (row, ray); -1 beside the grid.
    ahead
        Distance of the rows from the antenna, evenly spaced, m.
    top
        Height of the antenna, m.
    ground
        Height of what is behind a shadow where it is not known, m.
    reach
        How many rows something stands before its shadow, and a shadow has at least.
    found
        Output (row, ray): true where it stands, if it stood false.
    """
    rows, count = columns.shape
    spacing = (ahead[-1] - ahead[0]) / max(rows - 1, 1)
    behind = np.empty(reach)
    for ray in range(count):
        row = 0
        while row < rows:
            begin = row
            while row < rows and columns[row, ray] >= 0 and dark[row, columns[row, ray]]:
                row += 1
            end = row
            row += 1
            if begin == 0 or end - begin < reach:
                continue
            known, level = min(reach, rows - end), ground
            for n in range(known):
                column = columns[end + n, ray]
                behind[n] = height[end + n, column] if column >= 0 else np.nan
            if known > 0 and np.isfinite(behind[:known]).all():
                level = np.median(behind[:known])
            length = (end - begin) * spacing
            needed = level + (top - level) * length / (ahead[begin] + length)
            highest = -np.inf
            first = max(0, begin - reach)
            for before in range(first, begin):
                column = columns[before, ray]
                if column >= 0 and height[before, column] > highest:
                    highest = height[before, column]
            column = columns[begin - 1, ray]
            half = cycle[begin - 1, column] / 2 if column >= 0 else np.inf
            if np.isfinite(highest) and needed - highest > half:
                found[first:begin, ray] = True
