"""Visibility by a fan of rays: a running maximum of slopes, swept away from the antenna."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(nogil=True, cache=True, error_model="numpy")
def sweep(
    height: np.ndarray,
    x_first: float,
    x_step: float,
    y_first: float,
    y_step: float,
    antenna: np.ndarray,
    points: np.ndarray,
    rays: int,
    visible: np.ndarray,
) -> None:
    """Mark the points that terrain does not hide from one antenna.

    Along a ray ``(x - x_l) / (y - y_l) = const`` a point is hidden if some terrain before it has a
    larger slope ``(z - H) / (y - y_l)``: Eq. 8 without angles. The terrain within one raster row of
    a point does not hide it.

    Parameters
    ----------
    height
        Terrain (row, column).
    x_first, x_step, y_first, y_step
        The raster's origin and spacing.
    antenna
        Its position (3,), with a y before the raster's first row.
    points
        Points (count, 3), sorted by y.
    rays
        Number of rays, at least 2.
    visible
        Output flags (count,).
    """
    rows, columns = height.shape
    x_last = x_first + x_step * (columns - 1)
    y_last = y_first + y_step * (rows - 1)
    near, far = y_first - antenna[1], y_last - antenna[1]
    left = min((x_first - antenna[0]) / near, (x_first - antenna[0]) / far)
    right = max((x_last - antenna[0]) / near, (x_last - antenna[0]) / far)
    ray_step = (right - left) / (rays - 1)
    horizon = np.full(rays, -np.inf, dtype=np.float64)
    point = 0
    for row in range(-1, rows):
        # Points up to here lie less than a row behind the last row in the horizon.
        limit = y_first + y_step * (row + 2) if row < rows - 1 else np.inf
        if row >= 0:
            distance = y_first + y_step * row - antenna[1]
            first = (antenna[0] + left * distance - x_first) / x_step
            step = ray_step * distance / x_step
            # Only rays that cross this row of the raster.
            begin = max(0, int(np.ceil(-first / step)))
            end = min(rays, int(np.floor((columns - 1 - first) / step)) + 1)
            inverse = 1.0 / distance
            for ray in range(begin, end):
                column = first + step * ray
                k = min(max(int(column), 0), columns - 2)
                fraction = column - k
                z = height[row, k] + fraction * (height[row, k + 1] - height[row, k])
                horizon[ray] = max(horizon[ray], (z - antenna[2]) * inverse)
        while point < points.shape[0] and points[point, 1] < limit:
            distance = points[point, 1] - antenna[1]
            ray_position = ((points[point, 0] - antenna[0]) / distance - left) / ray_step
            ray = min(max(int(ray_position), 0), rays - 2)
            fraction = min(max(ray_position - ray, 0.0), 1.0)
            a, b = horizon[ray], horizon[ray + 1]
            # A ray without terrain so far has no horizon; the other one decides then.
            if a == -np.inf:
                blocking = b
            elif b == -np.inf:
                blocking = a
            else:
                blocking = a + fraction * (b - a)
            visible[point] = (points[point, 2] - antenna[2]) >= blocking * distance
            point += 1
