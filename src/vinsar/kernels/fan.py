"""Visibility by a fan of rays: a running maximum of slopes, swept away from the antenna.

A point is held against the two rays beside it. Where one of them passes a cliff and the other does
not, at the side of a box, the point's own line of sight is marched instead. Rays are float32: a
slope is good to 1e-8, which is a tenth of a micrometre at ten metres.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from vinsar.kernels import scratch
from vinsar.kernels.compiling import helper, kernel
from vinsar.kernels.lookup import PADDING, Emitter, contiguous, lanes, windows_for

__all__ = ["PADDING", "sweep"]

_ZERO = np.float32(0)
# The slope of a ray without terrain so far: below every other, and finite, so that sums are.
_OPEN = np.float32(-1e30)
# Between rays whose horizons rise more steeply than this across there is no interpolating.
_CLIFF = 1.0


@intrinsic
def _raise_group(  # type: ignore[no-untyped-def]
    typingctx, horizon, begin, heights, number, first, step, last, up, inverse
):
    """Do what the last loop over rays in `sweep` does for a group of them, from a window."""
    del typingctx
    if not contiguous(horizon, heights):
        return None

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        emit = Emitter(context, builder, signature, arguments)
        if not emit.has(1):
            return context.get_dummy_value()
        rays, at, table = emit.array(0), arguments[1], emit.array(2)
        number, first, step, last, up, inverse = (emit.repeated([value]) for value in arguments[3:])
        zero = ir.Constant(emit.floats, [0.0] * emit.lanes)
        lane = ir.Constant(emit.floats, [float(n) for n in range(emit.lanes)])
        column = emit.fused(step, builder.fadd(number, lane), first)
        column = builder.select(builder.fcmp_ordered(">", column, zero), column, zero)
        column = builder.select(builder.fcmp_ordered("<", column, last), column, last)
        index = builder.fptosi(column, emit.ints)
        share = emit.minus(column, builder.sitofp(index, emit.floats))
        # Columns rise along a group: the window begins at the first one, or right of it.
        places = builder.sub(index, emit.shuffled(index, index, [0] * emit.lanes))
        start = builder.extract_element(index, ir.Constant(ir.IntType(32), 0))
        start = builder.sext(start, at.type)
        right = builder.add(start, ir.Constant(at.type, 1))
        (here,), (there,) = (emit.look_up(table, k, places, 1, 1) for k in (start, right))
        z = emit.fused(share, emit.minus(there, here), here)
        slope = emit.times(emit.minus(z, up), inverse)
        # Not a choice between the two, of which LLVM makes a masked store: that is slow on AMD's.
        larger = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(emit.floats, [emit.floats, emit.floats]),
            f"llvm.maxnum.v{emit.lanes}f32",
        )
        highest = builder.call(larger, [slope, emit.load(rays, at)], fastmath=("nnan",))
        emit.store(highest, rays, at)
        return context.get_dummy_value()

    return types.void(horizon, begin, heights, number, first, step, last, up, inverse), generate


@helper
def _march(  # type: ignore[no-untyped-def]
    height, last_row, highest, x_first, x_step, near, y_step, antenna, x, y, z
):
    aside = (x - antenna[0]) / (y - antenna[1])
    slope = (z - antenna[2]) / (y - antenna[1])
    columns = height.shape[1] - PADDING
    # From row to row the line of sight advances evenly in column and height.
    first, step = (antenna[0] + aside * near - x_first) / x_step, aside * y_step / x_step
    z_first, z_step = antenna[2] + slope * near, slope * y_step
    begin, end = 0, last_row + 1
    if z_step < 0:
        # Before this row it is above everything.
        begin = min(max(begin, int((highest - z_first) / z_step)), end)
    # What hides a point is mostly close before it.
    for row in range(end - 1, begin - 1, -1):
        column = first + step * row
        if 0 <= column <= columns - 1:
            k = np.uint64(column)
            share = column - np.floor(column)
            here, there = height[np.uint64(row), k], height[np.uint64(row), k + np.uint64(1)]
            if here + share * (there - here) > z_first + z_step * row:
                return False
    return True


@kernel
def sweep(
    height: np.ndarray,
    highest: float,
    x_first: float,
    x_step: float,
    y_first: float,
    y_step: float,
    antenna: np.ndarray,
    points: np.ndarray,
    ready: np.ndarray,
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
    highest
        The largest height of all.
    x_first, x_step, y_first, y_step
        The raster's origin and spacing.
    antenna
        Its position (3,), with a y before the raster's first row.
    points
        Points (3, count), float64, sorted by y.
    ready
        Number of points with a y below that of each raster row but the first, of one row more, and
        of all (row + 1,).
    rays
        Number of rays, at least 2.
    visible
        Output flags (count,).
    """
    rows, columns = height.shape[0], height.shape[1] - PADDING
    x_last = x_first + x_step * (columns - 1)
    y_last = y_first + y_step * (rows - 1)
    near, far = y_first - antenna[1], y_last - antenna[1]
    left = min((x_first - antenna[0]) / near, (x_first - antenna[0]) / far)
    right = max((x_last - antenna[0]) / near, (x_last - antenna[0]) / far)
    ray_step = (right - left) / (rays - 1)
    horizon = np.full(rays, _OPEN, np.float32)
    place, share, slope = scratch.integers(), scratch.floats(), scratch.floats()
    before, after, unclear = scratch.floats(), scratch.floats(), scratch.integers()
    rays_per_slope, up = 1 / ray_step, np.float32(antenna[2])
    cliff = np.float32(_CLIFF * ray_step)
    last = np.float32(columns - 1)
    permuted = windows_for(0, 2) == 1
    done = 0
    for row in range(-1, rows):
        if row >= 0:
            distance = y_first + y_step * row - antenna[1]
            first = (antenna[0] + left * distance - x_first) / x_step
            step = ray_step * distance / x_step
            # Only rays that cross this row of the raster.
            begin = max(0, int(np.ceil(-first / step)))
            end = min(rays, int(np.floor((columns - 1 - first) / step)) + 1)
            origin, stride = np.float32(first + step * begin), np.float32(step)
            heights, inverse = height[row], np.float32(1 / distance)
            ray = begin
            # As many columns as there are rays in a group lie in a window; a rounding less do.
            if permuted and step * (lanes() - 1) < lanes() - 1.01:
                while ray + lanes() <= end:
                    _raise_group(
                        horizon, np.int64(ray), heights, np.float32(ray - begin), origin, stride,
                        last, up, inverse,
                    )  # fmt: skip
                    ray += lanes()
            for i in range(ray, end):
                column = min(max(origin + stride * np.float32(i - begin), _ZERO), last)
                k = np.uint64(column)
                fraction = column - np.floor(column)
                z = heights[k] + fraction * (heights[k + np.uint64(1)] - heights[k])
                horizon[i] = max(horizon[i], (z - up) * inverse)
        # Points up to here lie less than a row behind the last row in the horizon.
        while done < ready[row + 1]:
            size = min(scratch.SIZE, ready[row + 1] - done)
            for i in range(size):
                per_metre = 1 / (points[1, done + i] - antenna[1])
                ray_place = ((points[0, done + i] - antenna[0]) * per_metre - left) * rays_per_slope
                # Whole numbers are within bounds whatever the point is.
                place[i] = min(max(np.int32(np.floor(ray_place)), np.int32(0)), np.int32(rays - 2))
                share[i] = np.float32(min(max(ray_place - place[i], 0.0), 1.0))
                slope[i] = np.float32((points[2, done + i] - antenna[2]) * per_metre)
            for i in range(size):
                k = np.uint64(place[i])
                before[i] = horizon[k]
                after[i] = horizon[k + np.uint64(1)]
            some = np.int32(0)
            for i in range(size):
                a, b = before[i], after[i]
                visible[done + i] = slope[i] >= a + share[i] * (b - a)
                unclear[i] = (min(a, b) <= slope[i]) & (slope[i] < max(a, b)) & (abs(b - a) > cliff)
                some |= unclear[i]
            if some:
                for i in range(size):
                    if unclear[i]:
                        visible[done + i] = _march(
                            height, row, highest, x_first, x_step, near, y_step, antenna,
                            points[0, done + i], points[1, done + i], points[2, done + i],
                        )  # fmt: skip
            done += size
