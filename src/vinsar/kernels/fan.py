"""Visibility by a fan of rays: a running maximum of slopes, swept away from the antenna.

A point is held against the two rays beside it. Where one of them passes a cliff and the other does
not, at the side of a box, the point's own line of sight is marched instead. Rays are float32: a
slope is good to 1e-8, which is a tenth of a micrometre at ten metres.
"""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import helper, kernel
from vinsar.kernels.lookup import LANES, PADDING, copy, lanes, windows_for

__all__ = ["PADDING", "sweep"]

_CHUNK = 256
_ZERO = np.float32(0)
# The slope of a ray without terrain so far: below every other, and finite, so that sums are.
_OPEN = np.float32(-1e30)
# Between rays whose horizons rise more steeply than this across there is no interpolating.
_CLIFF = 1.0


@helper
def _march(  # type: ignore[no-untyped-def]
    height, last_row, x_first, x_step, near, y_step, antenna, x, y, z
):
    aside = (x - antenna[0]) / (y - antenna[1])
    slope = (z - antenna[2]) / (y - antenna[1])
    columns = height.shape[1] - PADDING
    # What hides a point is mostly close before it.
    for row in range(last_row, -1, -1):
        distance = near + y_step * row
        column = (antenna[0] + aside * distance - x_first) / x_step
        if 0 <= column <= columns - 1:
            k = np.uint64(column)
            share = column - np.floor(column)
            here, there = height[np.uint64(row), k], height[np.uint64(row), k + np.uint64(1)]
            if here + share * (there - here) - antenna[2] > slope * distance:
                return False
    return True


@kernel
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
        Terrain (row, column), float32, its last column repeated `PADDING` times.
    x_first, x_step, y_first, y_step
        The raster's origin and spacing.
    antenna
        Its position (3,), with a y before the raster's first row.
    points
        Points (3, count), float64, sorted by y.
    rays
        Number of rays, at least 2.
    visible
        Output flags (count,).
    """
    rows, columns = height.shape[0], height.shape[1] - PADDING
    along = points[1]
    x_last = x_first + x_step * (columns - 1)
    y_last = y_first + y_step * (rows - 1)
    near, far = y_first - antenna[1], y_last - antenna[1]
    left = min((x_first - antenna[0]) / near, (x_first - antenna[0]) / far)
    right = max((x_last - antenna[0]) / near, (x_last - antenna[0]) / far)
    ray_step = (right - left) / (rays - 1)
    rays_per_slope = 1 / ray_step
    # Whole groups of lanes; whatever is computed for the lanes beyond the last ray is not used.
    room = (rays + LANES - 1) // LANES * LANES
    horizon = np.full(room + PADDING, _OPEN, np.float32)
    index_buffer = np.empty(room, np.int32)
    fraction_buffer = np.empty(room, np.float32)
    here_buffer = np.empty(room, np.float32)
    there_buffer = np.empty(room, np.float32)
    place = np.empty(_CHUNK, np.int32)
    slope = np.empty(_CHUNK, np.float32)
    share = np.empty(_CHUNK, np.float32)
    cliff = np.float32(_CLIFF * ray_step)
    before = np.empty(_CHUNK, np.float32)
    after = np.empty(_CHUNK, np.float32)
    unclear = np.empty(_CHUNK, np.bool_)
    most = np.float32(columns - 1)
    done = 0
    for row in range(-1, rows):
        if row >= 0:
            distance = y_first + y_step * row - antenna[1]
            first = (antenna[0] + left * distance - x_first) / x_step
            step = ray_step * distance / x_step
            # Only rays that cross this row of the raster.
            begin = max(0, int(np.ceil(-first / step)))
            end = min(rays, int(np.floor((columns - 1 - first) / step)) + 1)
            width = max(0, end - begin + LANES - 1) // LANES * LANES
            index, fraction = index_buffer[:width], fraction_buffer[:width]
            here, there = here_buffer[:width], there_buffer[:width]
            origin, stride = np.float32(first + step * begin), np.float32(step)
            for i in range(width):
                column = min(max(origin + stride * np.float32(i), _ZERO), most)
                floor = np.floor(column)
                fraction[i] = column - floor
                index[i] = np.int32(floor)
            windows = windows_for(np.ceil(step * (lanes() // 2)), 2)
            copy(windows, index, np.int64(0), height[row], (here, there))
            inverse, up = np.float32(1 / distance), np.float32(antenna[2])
            line = horizon[begin:]
            for i in range(end - begin):
                z = here[i] + fraction[i] * (there[i] - here[i])
                line[i] = max(line[i], (z - up) * inverse)
        # Points up to here lie less than a row behind the last row in the horizon.
        limit = y_first + y_step * (row + 2)
        ready = done + int(np.searchsorted(along[done:], limit)) if row < rows - 1 else along.size
        while done < ready:
            size = min(_CHUNK, ready - done)
            for i in range(size):
                inverse = 1 / (along[done + i] - antenna[1])
                ray = ((points[0, done + i] - antenna[0]) * inverse - left) * rays_per_slope
                floor = min(max(np.floor(ray), 0.0), rays - 2.0)
                place[i] = np.int32(floor)
                share[i] = np.float32(min(max(ray - floor, 0.0), 1.0))
                slope[i] = np.float32((points[2, done + i] - antenna[2]) * inverse)
            for i in range(size):
                k = np.uint64(place[i])
                before[i] = horizon[k]
                after[i] = horizon[k + np.uint64(1)]
            some = False
            for i in range(size):
                a, b = before[i], after[i]
                visible[done + i] = slope[i] >= a + share[i] * (b - a)
                unclear[i] = (min(a, b) <= slope[i]) & (slope[i] < max(a, b)) & (abs(b - a) > cliff)
                some |= unclear[i]
            if some:
                for i in range(size):
                    if unclear[i]:
                        visible[done + i] = _march(
                            height, row, x_first, x_step, near, y_step, antenna,
                            points[0, done + i], along[done + i], points[2, done + i],
                        )  # fmt: skip
            done += size
