"""Back-projection of range profiles: the matched filter up to the profiles' interpolation.

A tile is up to 128 pixels of an image row. For each antenna position three short loops run over
it: range, phase and place in the profile; a look-up of the profile's samples there; interpolation
and the multiply-add. All arithmetic vectorises, in single precision relative to a float64 anchor at
the middle of the tile, which adds an error below -100 dB; only the look-up does not. Range changes
slowly along x, so the samples that 16 neighbours need mostly lie within 32 samples: two vector
registers, in which AVX-512 finds all 16 with one instruction. Where they do not, or there is no
AVX-512, they are copied one by one: the same samples, so the same image.
"""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import helper, kernel, part
from vinsar.kernels.functions import phasor, spline
from vinsar.kernels.lookup import LANES, PADDING, pairs_for
from vinsar.kernels.matched import add

__all__ = ["PADDING", "accumulate"]

TILE = 128
"""Columns handled at a time, a multiple of LANES: their buffers stay in the first-level cache."""

# sqrt(1 + e) - 1 in powers of e; the next term is -21/1024 e^6.
_E1, _E2, _E3 = np.float32(1 / 2), np.float32(-1 / 8), np.float32(1 / 16)
_E4, _E5 = np.float32(-5 / 128), np.float32(7 / 256)
_NEXT_TERM = 21 / 1024
_ONE, _HALF = np.float32(1), np.float32(0.5)

_LARGEST_TURN = 2e-6
"""Largest error of the series in cycles of the carrier's phase: -98 dB, at a tile's corner."""


@part
def _offsets(out, square, dx, dz, by_square, by_x, by_z, anchor, series):  # type: ignore[no-untyped-def]
    # R = R0 sqrt(1 + e) with e = (|d|^2 + 2 d . (p0 - a)) / R0^2: no two ranges are subtracted.
    for i in range(out.size):
        e = square[i] * by_square + dx[i] * by_x + dz[i] * by_z
        if series:
            relative = e * (_E1 + e * (_E2 + e * (_E3 + e * (_E4 + e * _E5))))
        else:
            relative = e / (np.sqrt(_ONE + e) + _ONE)
        out[i] += relative * anchor


@part
def _turn(offset, place0, per_step, turn0, per_cycle, index, fraction, cosine, sine):  # type: ignore[no-untyped-def]
    for i in range(offset.size):
        place = offset[i] * per_step + place0
        floor = np.floor(place)
        fraction[i] = place - floor
        index[i] = np.int32(floor)
        cycles = offset[i] * per_cycle + turn0
        cosine[i], sine[i] = phasor(cycles - np.floor(cycles + _HALF))


@helper
def _tile(x, y, z, antennas):  # type: ignore[no-untyped-def]
    # Wide tiles save set-up; a third of the range is where float32 and the series still suffice.
    nearest = np.inf
    for antenna in antennas:
        nearest = min(nearest, np.hypot(y[0] - antenna[1], z[0, 0] - antenna[2]))
    spacing = (x[-1] - x[0]) / max(1, x.size - 1)
    tile = TILE
    while tile > LANES and tile * spacing > nearest / 3:
        tile //= 2
    return tile


@helper
def _reach(dx, dz, half_x, half_z, x0, y0, z0, antennas):  # type: ignore[no-untyped-def]
    # How far in range a pixel of a group can be from the group's middle one, at any position.
    right, up = np.float32(0), np.float32(0)
    for begin in range(0, dx.size, LANES):
        for i in range(begin, begin + LANES):
            right = max(right, abs(dx[i] - dx[begin + LANES // 2]))
            up = max(up, abs(dz[i] - dz[begin + LANES // 2]))
    most = 0.0
    for end in range(2):
        for position in range(antennas.shape[2]):
            px, py, pz = (
                x0 - antennas[end, 0, position], y0 - antennas[end, 1, position],
                z0 - antennas[end, 2, position],
            )  # fmt: skip
            least = np.sqrt(px * px + py * py + pz * pz) - half_x - half_z
            slope = right * (abs(px) + half_x) + up * (abs(pz) + half_z)
            most = max(most, slope / least if least > 0 else np.inf)
    return most


@helper
def _prepare(  # type: ignore[no-untyped-def]
    antennas, x0, y0, z0, half_x, half_z, share, factors, anchor, worst
):
    for position in range(share.size):
        px, py, pz = (
            x0 - antennas[0, position],
            y0 - antennas[1, position],
            z0 - antennas[2, position],
        )
        square = px * px + py * py + pz * pz
        range_ = np.sqrt(square)
        inverse = 1 / square
        factors[0, position] = inverse
        factors[1, position] = 2 * px * inverse
        factors[2, position] = 2 * pz * inverse
        factors[3, position] = share[position] * range_
        # Both ends of a monostatic position are the same: half of each is the whole of one.
        anchor[position] += 0.5 * range_
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
        Surface to focus on (row, column), float64.
    transmitter, receiver
        Antenna positions (position, 3), float64.
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
    square_buffer = np.empty(TILE, np.float32)
    dx_buffer = np.empty(TILE, np.float32)
    dz_buffer = np.empty(TILE, np.float32)
    offset_buffer = np.empty(TILE, np.float32)
    fraction_buffer = np.empty(TILE, np.float32)
    index_buffer = np.empty(TILE, np.int32)
    cosine_buffer = np.empty(TILE, np.float32)
    sine_buffer = np.empty(TILE, np.float32)
    sums = np.empty((2, TILE), np.float32)
    weights = np.empty((4, TILE), np.float32)
    # For both ends of each position: what turns a pixel's place into e, and the anchor.
    factors = np.empty((2, 4, positions), np.float32)
    share = np.empty(positions)  # of each end in the half path; monostatic, the first has all
    anchor = np.empty(positions)
    worst = np.empty(positions)
    base = np.empty(positions, np.int64)
    place0 = np.empty(positions, np.float32)
    turn0 = np.empty(positions, np.float32)
    per_step, per_cycle = np.float32(1 / range_step), np.float32(cycles_per_metre)
    antennas = np.empty((2, 3, positions))
    for position in range(positions):
        share[position] = 1.0
        for axis in range(3):
            antennas[0, axis, position] = transmitter[position, axis]
            antennas[1, axis, position] = receiver[position, axis]
            if transmitter[position, axis] != receiver[position, axis]:
                share[position] = 0.5
    tile = _tile(x, y, z, transmitter)
    for begin in range(0, columns, tile):
        used = min(tile, columns - begin)
        # Whole groups: copies of the last pixel fill them up.
        width = (used + LANES - 1) // LANES * LANES
        middle = begin + used // 2
        square, dx, dz = square_buffer[:width], dx_buffer[:width], dz_buffer[:width]
        offset, fraction, index = (
            offset_buffer[:width], fraction_buffer[:width], index_buffer[:width],
        )  # fmt: skip
        cosine, sine = cosine_buffer[:width], sine_buffer[:width]
        sum_real, sum_imag = sums[0, :width], sums[1, :width]
        weight0, weight1 = weights[0, :width], weights[1, :width]
        weight2, weight3 = weights[2, :width], weights[3, :width]
        for row in range(rows):
            half_x, half_z = 0.0, 0.0
            for i in range(width):
                pixel = min(begin + i, columns - 1)
                right, up = x[pixel] - x[middle], z[row, pixel] - z[row, middle]
                dx[i], dz[i], square[i] = right, up, right * right + up * up
                half_x, half_z = max(half_x, abs(right)), max(half_z, abs(up))
            sums[:] = 0
            reach = _reach(
                dx, dz, half_x, half_z, x[middle], y[row], z[row, middle], antennas,
            )  # fmt: skip
            pairs = pairs_for(np.ceil(reach / range_step))
            anchor[:] = 0
            worst[:] = 0
            for end in range(2):
                _prepare(
                    antennas[end], x[middle], y[row], z[row, middle], half_x, half_z, share,
                    factors[end], anchor, worst,
                )  # fmt: skip
            for position in range(positions):
                place = (anchor[position] - first_range) / range_step
                base[position] = int(np.floor(place))
                place0[position] = place - np.floor(place)
                cycles = anchor[position] * cycles_per_metre
                turn0[position] = cycles - np.floor(cycles)
            for position in range(positions):
                offset[:] = 0
                for end in range(1 if share[position] == 1 else 2):
                    by = factors[end, :, position]
                    if worst[position] * _NEXT_TERM * cycles_per_metre < _LARGEST_TURN:
                        _offsets(offset, square, dx, dz, by[0], by[1], by[2], by[3], True)
                    else:
                        _offsets(offset, square, dx, dz, by[0], by[1], by[2], by[3], False)
                _turn(
                    offset, place0[position], per_step, turn0[position], per_cycle, index,
                    fraction, cosine, sine,
                )  # fmt: skip
                real, imag = profile_real[position], profile_imag[position]
                if cubic:
                    for i in range(width):
                        weight0[i], weight1[i], weight2[i], weight3[i] = spline(fraction[i])
                    add(
                        pairs, index, base[position] - 1, (weight0, weight1, weight2, weight3),
                        cosine, sine, real, imag, sum_real, sum_imag,
                    )  # fmt: skip
                else:
                    for i in range(width):
                        weight0[i] = _ONE - fraction[i]
                    add(
                        pairs, index, base[position], (weight0, fraction), cosine, sine,
                        real, imag, sum_real, sum_imag,
                    )  # fmt: skip
            for i in range(used):
                image[row, begin + i] += np.complex64(complex(sums[0, i], sums[1, i]))
