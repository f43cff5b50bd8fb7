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

from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

TILE = 128
"""Columns handled at a time, a multiple of LANES: their buffers stay in the first-level cache."""

LANES = 16
"""Pixels whose samples are looked up at once."""

PADDING = 32
"""Samples that profiles must hold beyond the last one used, so that a window never ends early."""

_BEFORE = 15
"""Where the window begins, in samples before the one of the group's middle pixel."""

_REACH = 14
"""How far from the middle pixel's sample the others' may lie, for linear and cubic alike."""

_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
_FLOATS, _INTS = ir.VectorType(_FLOAT, LANES), ir.VectorType(_INT, LANES)


def _permutes(context: Any) -> bool:
    return "+avx512f" in context.codegen().magic_tuple()[2]


@intrinsic
def _has_permute(typingctx):  # type: ignore[no-untyped-def]
    """Tell whether the machine that is compiled for looks samples up in vector registers."""
    del typingctx

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        del builder, signature, arguments
        return ir.Constant(ir.IntType(1), _permutes(context))

    return types.boolean(), generate


@intrinsic
def _copy_window(typingctx, index, begin, base, profile, out):  # type: ignore[no-untyped-def]
    """Copy ``profile[base + index[begin:begin + LANES] + tap]`` to ``out[tap, begin:...]``.

    All of them must lie within the window of 32 samples that the middle one sets. The profile is
    read from it whatever the indices are, so no wrong index leaves the profile.
    """
    del typingctx
    taps = out.count
    if not (index.layout == profile.layout == out.dtype.layout == "C"):
        return None  # No such overload: the pointers below know no strides.

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        if not _permutes(context):
            return context.get_dummy_value()  # Never reached: the caller asks `_has_permute`.

        def data(number, position):  # type: ignore[no-untyped-def]
            array = context.make_array(signature.args[number])(context, builder, arguments[number])
            return builder.gep(array.data, [position])

        def constant(value):  # type: ignore[no-untyped-def]
            return ir.Constant(_INT, value)

        def load(pointer, kind):  # type: ignore[no-untyped-def]
            value = builder.load(builder.bitcast(pointer, kind.as_pointer()))
            value.align = 4
            return value

        def splat(value):  # type: ignore[no-untyped-def]
            nothing = ir.Constant(_INTS, ir.Undefined)
            first = builder.insert_element(nothing, value, constant(0))
            return builder.shuffle_vector(first, nothing, ir.Constant(_INTS, [0] * LANES))

        indices = load(data(0, arguments[1]), _INTS)
        origin = builder.trunc(arguments[2], _INT)
        middle = builder.extract_element(indices, constant(LANES // 2))
        window = builder.sub(builder.add(middle, origin), constant(_BEFORE))
        profile_type = context.make_array(signature.args[3])(context, builder, arguments[3])
        samples = builder.trunc(cgutils.unpack_tuple(builder, profile_type.shape)[0], _INT)
        most = builder.sub(samples, constant(2 * LANES))
        below = builder.icmp_signed("<", window, constant(0))
        window = builder.select(below, constant(0), window)
        above = builder.icmp_signed(">", window, most)
        window = builder.select(above, most, window)
        place = builder.add(indices, splat(builder.sub(origin, window)))
        start = builder.sext(window, ir.IntType(64))
        low = load(data(3, start), _FLOATS)
        high = load(data(3, builder.add(start, ir.Constant(start.type, LANES))), _FLOATS)
        permute = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(_FLOATS, [_FLOATS, _INTS, _FLOATS]),
            "llvm.x86.avx512.vpermi2var.ps.512",
        )
        rows = cgutils.unpack_tuple(builder, arguments[4])
        for tap in range(taps):
            at = builder.add(place, ir.Constant(_INTS, [tap] * LANES))
            found = builder.call(permute, [low, at, high])
            array = context.make_array(signature.args[4].dtype)(context, builder, rows[tap])
            pointer = builder.gep(array.data, [arguments[1]])
            stored = builder.store(found, builder.bitcast(pointer, _FLOATS.as_pointer()))
            stored.align = 4
        return context.get_dummy_value()

    return types.void(index, begin, base, profile, out), generate


if config.DISABLE_JIT:  # Then the kernels are plain Python, which has no vector registers.

    def _has_permute() -> bool:
        return False


# Fits of sin(pi t) / t and cos(pi t) in powers of t^2 on |t| <= 1/2, errors below 1.2e-6 and 5e-8.
# PyPI's llvmlite has no vector math library: math.sin would keep the loop scalar.
_S0 = np.float32(3.1415902702069918)
_S1 = np.float32(-5.16740673327233)
_S2 = np.float32(2.544010518503205)
_S3 = np.float32(-0.5594624554675647)
_C0 = np.float32(0.9999999532476083)
_C1 = np.float32(-4.934792830619607)
_C2 = np.float32(4.058411352861885)
_C3 = np.float32(-1.3318765680766596)
_C4 = np.float32(0.21968961108988486)
# sqrt(1 + e) - 1 in powers of e; the next term is -21/1024 e^6.
_E1, _E2, _E3 = np.float32(1 / 2), np.float32(-1 / 8), np.float32(1 / 16)
_E4, _E5 = np.float32(-5 / 128), np.float32(7 / 256)
_NEXT_TERM = 21 / 1024
_ONE, _HALF, _SIXTH = np.float32(1), np.float32(0.5), np.float32(1 / 6)
_TWO_THIRDS = np.float32(2 / 3)

_LARGEST_TURN = 2e-6
"""Largest error of the series in cycles of the carrier's phase: -98 dB, at a tile's corner."""

# Letting products and sums fuse halves the arithmetic; nothing here depends on their rounding.
_FAST = {"contract", "nsz"}


@njit(nogil=True, inline="always", error_model="numpy", fastmath=_FAST)
def _offsets(out, square, dx, dz, by_square, by_x, by_z, anchor, series):  # type: ignore[no-untyped-def]
    # R = R0 sqrt(1 + e) with e = (|d|^2 + 2 d . (p0 - a)) / R0^2: no two ranges are subtracted.
    for i in range(out.size):
        e = square[i] * by_square + dx[i] * by_x + dz[i] * by_z
        if series:
            relative = e * (_E1 + e * (_E2 + e * (_E3 + e * (_E4 + e * _E5))))
        else:
            relative = e / (np.sqrt(_ONE + e) + _ONE)
        out[i] += relative * anchor


@njit(nogil=True, inline="always", error_model="numpy", fastmath=_FAST)
def _turn(offset, place0, per_step, turn0, per_cycle, index, fraction, cosine, sine):  # type: ignore[no-untyped-def]
    for i in range(offset.size):
        place = offset[i] * per_step + place0
        floor = np.floor(place)
        fraction[i] = place - floor
        index[i] = np.int32(floor)
        cycles = offset[i] * per_cycle + turn0
        t = cycles - np.floor(cycles + _HALF)
        q = t * t
        s = t * (_S0 + q * (_S1 + q * (_S2 + q * _S3)))
        c = _C0 + q * (_C1 + q * (_C2 + q * (_C3 + q * _C4)))
        twice = s + s
        cosine[i] = _ONE - twice * s
        sine[i] = twice * c


@njit(nogil=True, inline="always", error_model="numpy")
def _copy(windowed, index, base, profile, out):  # type: ignore[no-untyped-def]
    if windowed:
        for begin in range(0, index.size, LANES):
            _copy_window(index, np.int64(begin), base, profile, out)
    else:
        last = profile.size - PADDING
        for i in range(index.size):
            # Unsigned, so that no negative index needs a look.
            k = np.uint64(min(max(base + index[i], 0), last))
            for tap in range(len(out)):
                out[tap][i] = profile[k + np.uint64(tap)]


@njit(nogil=True, error_model="numpy")
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


@njit(nogil=True, error_model="numpy")
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


@njit(nogil=True, error_model="numpy")
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


@njit(nogil=True, cache=True, error_model="numpy", fastmath=_FAST)
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
    samples = np.empty((2, 4, TILE), np.float32)
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
        real0, real1 = samples[0, 0, :width], samples[0, 1, :width]
        real2, real3 = samples[0, 2, :width], samples[0, 3, :width]
        imag0, imag1 = samples[1, 0, :width], samples[1, 1, :width]
        imag2, imag3 = samples[1, 2, :width], samples[1, 3, :width]
        for row in range(rows):
            half_x, half_z = 0.0, 0.0
            for i in range(width):
                pixel = min(begin + i, columns - 1)
                right, up = x[pixel] - x[middle], z[row, pixel] - z[row, middle]
                dx[i], dz[i], square[i] = right, up, right * right + up * up
                half_x, half_z = max(half_x, abs(right)), max(half_z, abs(up))
            sum_real[:] = 0
            sum_imag[:] = 0
            windowed = _has_permute() and _reach(
                dx, dz, half_x, half_z, x[middle], y[row], z[row, middle], antennas,
            ) < _REACH * range_step  # fmt: skip
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
                if cubic:
                    first = base[position] - 1
                    reals, imags = (real0, real1, real2, real3), (imag0, imag1, imag2, imag3)
                    _copy(windowed, index, first, profile_real[position], reals)
                    _copy(windowed, index, first, profile_imag[position], imags)
                    for i in range(width):
                        # The weights of the four B-splines that reach this place.
                        t = fraction[i]
                        rest, tt = _ONE - t, t * t
                        w0 = _SIXTH * rest * (rest * rest)
                        w1 = _TWO_THIRDS + tt * (_HALF * t - _ONE)
                        w3 = _SIXTH * t * tt
                        w2 = _ONE - w0 - w1 - w3
                        a = w0 * real0[i] + w1 * real1[i] + w2 * real2[i] + w3 * real3[i]
                        b = w0 * imag0[i] + w1 * imag1[i] + w2 * imag2[i] + w3 * imag3[i]
                        sum_real[i] += a * cosine[i] - b * sine[i]
                        sum_imag[i] += a * sine[i] + b * cosine[i]
                else:
                    first = base[position]
                    _copy(windowed, index, first, profile_real[position], (real0, real1))
                    _copy(windowed, index, first, profile_imag[position], (imag0, imag1))
                    for i in range(width):
                        a = real0[i] + fraction[i] * (real1[i] - real0[i])
                        b = imag0[i] + fraction[i] * (imag1[i] - imag0[i])
                        sum_real[i] += a * cosine[i] - b * sine[i]
                        sum_imag[i] += a * sine[i] + b * cosine[i]
            for i in range(used):
                image[row, begin + i] += np.complex64(complex(sum_real[i], sum_imag[i]))
