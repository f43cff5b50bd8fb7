"""Back-projection of range profiles: the matched filter up to the profiles' interpolation.

A tile is up to 128 pixels of an image row. For each antenna position short loops run over it: place
in the profile, weights and phase; a look-up of the profile's samples there; interpolation and the
multiply-add. Along a level row, range is a polynomial of fifth degree in x around the tile's
middle, exact in double precision there; on a surface, it is a series in the relative change of the
squared range. Either errs by less than single precision does, which adds an error below -100 dB.
Loops are short on purpose: a processor then works on several groups of pixels at once.
"""

from __future__ import annotations

import numpy as np

from vinsar.kernels import scratch
from vinsar.kernels.compiling import helper, kernel, part
from vinsar.kernels.functions import phasor, spline
from vinsar.kernels.lookup import LANES, PADDING, lanes, windows_for
from vinsar.kernels.matched import add

__all__ = ["PADDING", "accumulate"]

# sqrt(1 + e) - 1 in powers of e; the next term is -21/1024 e^6.
_E1, _E2, _E3 = np.float32(1 / 2), np.float32(-1 / 8), np.float32(1 / 16)
_E4, _E5 = np.float32(-5 / 128), np.float32(7 / 256)
_NEXT_TERM = 21 / 1024
_ONE, _HALF = np.float32(1), np.float32(0.5)

_LARGEST_TURN = 2e-6
"""Largest error of range in cycles of the carrier's phase: -98 dB, at a tile's edge."""


@part
def _polynomial(dx, by, place):  # type: ignore[no-untyped-def]
    b0, b1, b2, b3, b4, b5 = by[0], by[1], by[2], by[3], by[4], by[5]
    for i in range(place.size):
        d = dx[i]
        place[i] = b0 + d * (b1 + d * (b2 + d * (b3 + d * (b4 + d * b5))))


@part
def _expansion(dx, dz, square, by, series, change, place):  # type: ignore[no-untyped-def]
    # R = R0 sqrt(1 + e) with e = (|d|^2 + 2 d . (p0 - a)) / R0^2: no two ranges are subtracted.
    scale, inverse, by_x, by_z = by[0], by[1], by[2], by[3]
    for i in range(place.size):
        change[i] = square[i] * inverse + dx[i] * by_x + dz[i] * by_z
    if series:
        for i in range(place.size):
            e = change[i]
            place[i] += scale * (e * (_E1 + e * (_E2 + e * (_E3 + e * (_E4 + e * _E5)))))
    else:
        for i in range(place.size):
            e = change[i]
            place[i] += scale * (e / (np.sqrt(_ONE + e) + _ONE))


@part
def _split(place, least, most, turn0, per_step, index, fraction, turn):  # type: ignore[no-untyped-def]
    for i in range(place.size):
        cycles = turn0 + place[i] * per_step
        turn[i] = cycles - np.floor(cycles + _HALF)
        floor = np.floor(place[i])
        fraction[i] = place[i] - floor
        # Whatever the positions are, no sample is read outside the profile.
        index[i] = np.int32(min(max(least, floor), most))


@helper
def _aside(y, z, antennas):  # type: ignore[no-untyped-def]
    # How near the antennas' tracks along x are to the block at least, how far above it at most.
    low, high = z[0, 0], z[0, 0]
    for row in range(z.shape[0]):
        for column in range(z.shape[1]):
            low, high = min(low, z[row, column]), max(high, z[row, column])
    nearest, above = np.inf, 0.0
    for end in range(antennas.shape[0]):
        for position in range(antennas.shape[2]):
            up = antennas[end, 2, position]
            gap = max(0.0, up - high, low - up)
            above = max(above, abs(up - high), abs(low - up))
            for row in range(y.size):
                nearest = min(nearest, np.hypot(y[row] - antennas[end, 1, position], gap))
    return nearest, above


@helper
def _left_out(half, nearest, cycles_per_metre):  # type: ignore[no-untyped-def]
    # What the polynomial leaves out, in cycles. The terms of sixth and seventh degree in dx / R are
    # R / 16 and R / 15 at most; the first is economised, to a thirty-second of itself.
    ratio = half / nearest if nearest > 0 else np.inf
    square = ratio * ratio
    return square * square * square * (1 / 512 + ratio / 15) * nearest * cycles_per_metre


@helper
def _farthest(offset):  # type: ignore[no-untyped-def]
    # How far a pixel of a group is from the group's middle one.
    most = np.float32(0)
    for begin in range(0, offset.size, lanes()):
        for i in range(begin, begin + lanes()):
            most = max(most, abs(offset[i] - offset[begin + lanes() // 2]))
    return most


@helper
def _fit(antennas, x, y, z, half, fit):  # type: ignore[no-untyped-def]
    # sqrt(1 + 2 m t + t^2) in powers of t = dx / R, where m = px / R: its coefficients are
    # differences of Legendre polynomials of m. The sixth power is economised into lower ones.
    fit[:] = 0
    share, square = 1 / antennas.shape[0], half * half
    for end in range(antennas.shape[0]):
        for position in range(antennas.shape[2]):
            px = x - antennas[end, 0, position]
            py = y - antennas[end, 1, position]
            pz = z - antennas[end, 2, position]
            across = py * py + pz * pz
            inverse = 1 / np.sqrt(px * px + across)
            m = px * inverse
            m2 = m * m
            second = 0.5 * share * across * inverse * inverse * inverse
            third, fourth = second * inverse, second * inverse * inverse
            fifth = fourth * inverse
            sixth = fifth * inverse * square * (0.125 + m2 * (2.625 * m2 - 1.75))
            fit[0, position] += share / inverse + 0.03125 * sixth * square * square
            fit[1, position] += share * m
            fit[2, position] += second - 0.5625 * sixth * square
            fit[3, position] -= third * m
            fit[4, position] += fourth * (1.25 * m2 - 0.25) + 1.5 * sixth
            fit[5, position] -= fifth * m * (1.75 * m2 - 0.75)


@helper
def _expand(  # type: ignore[no-untyped-def]
    share, antenna, x, y, z, half_x, half_z, steps_per_metre, by, anchor, worst
):
    for position in range(anchor.size):
        px, py, pz = x - antenna[0, position], y - antenna[1, position], z - antenna[2, position]
        square = px * px + py * py + pz * pz
        range_ = np.sqrt(square)
        inverse = 1 / square
        by[1, position] = share * range_ * steps_per_metre
        by[2, position] = inverse
        by[3, position] = 2 * px * inverse
        by[4, position] = 2 * pz * inverse
        anchor[position] += share * range_
        e = 2 * (abs(px) * half_x + abs(pz) * half_z) + half_x * half_x + half_z * half_z
        e *= inverse
        worst[position] = max(worst[position], range_ * (e * e * e) * (e * e * e))


@kernel
def accumulate(
    image: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    transmitter: np.ndarray,
    receiver: np.ndarray,
    extra_range: np.ndarray,
    profile_real: np.ndarray,
    profile_imag: np.ndarray,
    first_range: float,
    range_step: float,
    cycles_per_metre: float,
    cubic: bool,
) -> None:
    """Add the matched-filter sum over all positions to a block of image rows.

    Parameters
    ----------
    image
        Output (row, column), complex64.
    x, y
        Axes of the block, float64.
    z
        Surface to focus on (row, column), float64. Level rows are faster than others.
    transmitter, receiver
        Antenna positions (position, 3), float64.
    extra_range
        What to add to the slant ranges at each position (position,), m.
    profile_real, profile_imag
        Range profiles at baseband (position, slant range), float32, with `PADDING` samples to spare
        at the end. They must cover all ranges; a pixel beyond reads some other sample of them.
    first_range, range_step
        Slant range of the first sample and the spacing, m.
    cycles_per_metre
        Carrier phase per slant range, in cycles: 2 / wavelength.
    cubic
        Interpolate by cubic B-splines, for which the profiles must be weighted, or else linearly.
    """
    rows, columns = image.shape
    positions = transmitter.shape[0]
    dx_buffer, dz_buffer, place_buffer = scratch.floats(), scratch.floats(), scratch.floats()
    fraction_buffer, turn_buffer, index_buffer = (
        scratch.floats(),
        scratch.floats(),
        scratch.integers(),
    )
    square_buffer, change_buffer = scratch.floats(), scratch.floats()
    cosine_buffer, sine_buffer = scratch.floats(), scratch.floats()
    weight0_buffer, weight1_buffer = scratch.floats(), scratch.floats()
    weight2_buffer, weight3_buffer = scratch.floats(), scratch.floats()
    real_buffer, imag_buffer = scratch.floats(), scratch.floats()
    fit = np.empty((6, positions))
    anchor, worst = np.empty(positions), np.empty(positions)
    # What turns a pixel's offset from the middle of its tile into its place in the profile.
    by = np.empty((2, 6, positions), np.float32)
    turn0 = np.empty(positions, np.float32)
    base = np.empty(positions, np.int64)
    steps_per_metre = 1 / range_step
    cycles_per_step = np.float32(range_step * cycles_per_metre)
    taps, before = (4, 1) if cubic else (2, 0)
    last = profile_real.shape[1] - PADDING
    ends = 1  # Both ends of a monostatic position are the same.
    antennas = np.empty((2, 3, positions))
    for position in range(positions):
        for axis in range(3):
            antennas[0, axis, position] = transmitter[position, axis]
            antennas[1, axis, position] = receiver[position, axis]
            if transmitter[position, axis] != receiver[position, axis]:
                ends = 2
    antennas = antennas[:ends]
    nearest, above = _aside(y, z, antennas)
    spacing = (x[-1] - x[0]) / max(1, columns - 1)
    tile = scratch.SIZE
    # Wide tiles save set-up, narrow ones are what the polynomial suffices for.
    while tile > LANES and _left_out(tile * spacing / 2, nearest, cycles_per_metre) > _LARGEST_TURN:
        tile //= 2
    for begin in range(0, columns, tile):
        used = min(tile, columns - begin)
        # Whole groups: copies of the last pixel fill them up.
        width = (used + LANES - 1) // LANES * LANES
        middle = begin + used // 2
        dx, dz, place = dx_buffer[:width], dz_buffer[:width], place_buffer[:width]
        index, fraction, turn = index_buffer[:width], fraction_buffer[:width], turn_buffer[:width]
        square, change = square_buffer[:width], change_buffer[:width]
        cosine, sine = cosine_buffer[:width], sine_buffer[:width]
        weight0, weight1 = weight0_buffer[:width], weight1_buffer[:width]
        weight2, weight3 = weight2_buffer[:width], weight3_buffer[:width]
        sum_real, sum_imag = real_buffer[:width], imag_buffer[:width]
        half_x, aside = 0.0, 0.0
        for i in range(width):
            right = x[min(begin + i, columns - 1)] - x[middle]
            dx[i], half_x = right, max(half_x, abs(right))
        for position in range(positions):
            for end in range(ends):
                aside = max(aside, abs(x[middle] - antennas[end, 0, position]))
        steepest = (aside + half_x) / np.hypot(max(0.0, aside - half_x), nearest)
        fits = _left_out(half_x, nearest, cycles_per_metre) <= 1.01 * _LARGEST_TURN
        for row in range(rows):
            half_z = 0.0
            for i in range(width):
                up = z[row, min(begin + i, columns - 1)] - z[row, middle]
                dz[i], half_z = up, max(half_z, abs(up))
                square[i] = dx[i] * dx[i] + up * up
            reach = _farthest(dx) * steepest
            if half_z > 0:
                reach += _farthest(dz) * above / nearest
            windows = windows_for(np.ceil(reach * steps_per_metre), taps)
            polynomial = fits and half_z == 0
            if polynomial:
                _fit(antennas, x[middle], y[row], z[row, middle], half_x, fit)
                for position in range(positions):
                    anchor[position] = fit[0, position]
                for power in range(1, 6):
                    for position in range(positions):
                        by[0, power, position] = fit[power, position] * steps_per_metre
            else:
                anchor[:] = 0
                worst[:] = 0
                for end in range(ends):
                    _expand(
                        1 / ends, antennas[end], x[middle], y[row], z[row, middle], half_x, half_z,
                        steps_per_metre, by[end], anchor, worst,
                    )  # fmt: skip
            for position in range(positions):
                distance = anchor[position] + extra_range[position]
                at = (distance - first_range) * steps_per_metre
                floor = min(max(0.0, np.floor(at)), float(last))
                base[position] = np.int64(floor) - before
                by[0, 0, position] = at - floor
                cycles = (first_range + floor * range_step) * cycles_per_metre
                turn0[position] = cycles - np.floor(cycles)
            sum_real[:] = 0
            sum_imag[:] = 0
            for position in range(positions):
                at_least, at_most = -base[position], last - base[position]
                if polynomial:
                    _polynomial(dx, by[0, :, position], place)
                else:
                    place[:] = by[0, 0, position]
                    series = worst[position] * _NEXT_TERM * cycles_per_metre < _LARGEST_TURN
                    for end in range(ends):
                        _expansion(
                            dx, dz, square, by[end, 1:, position], series, change, place
                        )  # fmt: skip
                _split(
                    place, np.float32(at_least), np.float32(at_most), turn0[position],
                    cycles_per_step, index, fraction, turn,
                )  # fmt: skip
                for i in range(width):
                    cosine[i], sine[i] = phasor(turn[i])
                real, imag = profile_real[position], profile_imag[position]
                if cubic:
                    for i in range(width):
                        weight0[i], weight1[i], weight2[i], weight3[i] = spline(fraction[i])
                    add(
                        windows, index, base[position], (weight0, weight1, weight2, weight3),
                        cosine, sine, real, imag, sum_real, sum_imag,
                    )  # fmt: skip
                else:
                    add(
                        windows, index, base[position], (fraction,), cosine, sine, real, imag,
                        sum_real, sum_imag,
                    )  # fmt: skip
            for i in range(used):
                image[row, begin + i] += np.complex64(complex(sum_real[i], sum_imag[i]))
