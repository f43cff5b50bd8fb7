"""Back-projection of range profiles: the matched filter up to the profiles' interpolation.

Ranges are taken relative to a float64 anchor at the middle of each row of a tile, so that the
float32 arithmetic of the inner loops adds an error below -100 dB.
"""

from __future__ import annotations

import numpy as np
from numba import njit

TILE = 256
"""Columns handled at a time: their buffers stay in the first-level cache."""

# Chebyshev fits of sin(pi t) / t and cos(pi t) in powers of t^2 on |t| <= 1/2, errors below 5e-8.
# PyPI's llvmlite has no vector math library: math.sin would keep the loop scalar.
_S0 = np.float32(3.1415926401307073)
_S1 = np.float32(-5.167710083507863)
_S2 = np.float32(2.550077523214028)
_S3 = np.float32(-0.5982912856170749)
_S4 = np.float32(0.07765766029935518)
_C0 = np.float32(0.9999999532476083)
_C1 = np.float32(-4.934792830619607)
_C2 = np.float32(4.058411352861885)
_C3 = np.float32(-1.3318765680766596)
_C4 = np.float32(0.21968961108988486)
_ONE, _TWO, _HALF = np.float32(1), np.float32(2), np.float32(0.5)


@njit(nogil=True, inline="always", error_model="numpy")
def _anchor(antenna, x0, y0, z0):  # type: ignore[no-untyped-def]
    return np.sqrt((x0 - antenna[0]) ** 2 + (y0 - antenna[1]) ** 2 + (z0 - antenna[2]) ** 2)


@njit(nogil=True, inline="always", error_model="numpy")
def _offsets(out, dx, dz, antenna, x0, z0, anchor):  # type: ignore[no-untyped-def]
    # R - R0 = (R^2 - R0^2) / (R + R0), without the cancellation of subtracting two ranges.
    twice_x = np.float32(2 * (x0 - antenna[0]))
    twice_z = np.float32(2 * (z0 - antenna[2]))
    r0 = np.float32(anchor)
    square = np.float32(anchor * anchor)
    for i in range(out.size):
        q = dx[i] * (dx[i] + twice_x) + dz[i] * (dz[i] + twice_z)
        out[i] += q / (np.sqrt(square + q) + r0)


@njit(nogil=True, cache=True, error_model="numpy")
def accumulate(
    image: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    transmitter: np.ndarray,
    receiver: np.ndarray,
    profiles: np.ndarray,
    first_range: float,
    range_step: float,
    cycles_per_metre: float,
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
    profiles
        Range profiles at baseband (position, slant range), complex64. Pixels beyond either end
        take the end's samples, so the profiles should cover all ranges.
    first_range, range_step
        Slant range of the first sample and the spacing, m.
    cycles_per_metre
        Carrier phase per slant range, in cycles: 2 / wavelength.
    """
    rows, columns = image.shape
    last = profiles.shape[1] - 2
    inverse_step = np.float32(1.0 / range_step)
    cycles_scale = np.float32(cycles_per_metre)
    dx_buffer = np.empty(TILE, np.float32)
    dz_buffer = np.empty(TILE, np.float32)
    offset_buffer = np.empty(TILE, np.float32)
    fraction = np.empty(TILE, np.float32)
    cosine = np.empty(TILE, np.float32)
    sine = np.empty(TILE, np.float32)
    index = np.empty(TILE, np.int32)
    real = np.empty(TILE, np.float32)
    imag = np.empty(TILE, np.float32)
    here = np.empty(TILE, np.int64)
    there = np.empty(TILE, np.int64)
    here_parts = here.view(np.float32)
    there_parts = there.view(np.float32)
    for begin in range(0, columns, TILE):
        width = min(TILE, columns - begin)
        middle = begin + width // 2
        x0 = x[middle]
        dx = dx_buffer[:width]
        dz = dz_buffer[:width]
        offset = offset_buffer[:width]
        for i in range(width):
            dx[i] = np.float32(x[begin + i] - x0)
        for row in range(rows):
            y0, z0 = y[row], z[row, middle]
            for i in range(width):
                dz[i] = np.float32(z[row, begin + i] - z0)
            real[:width] = 0
            imag[:width] = 0
            for position in range(transmitter.shape[0]):
                out, back = transmitter[position], receiver[position]
                offset[:] = 0
                anchor = _anchor(out, x0, y0, z0)
                _offsets(offset, dx, dz, out, x0, z0, anchor)
                if out[0] != back[0] or out[1] != back[1] or out[2] != back[2]:
                    other = _anchor(back, x0, y0, z0)
                    _offsets(offset, dx, dz, back, x0, z0, other)
                    anchor = 0.5 * (anchor + other)
                    for i in range(width):
                        offset[i] *= _HALF
                place0 = (anchor - first_range) / range_step
                base = int(np.floor(place0))
                part = np.float32(place0 - base)
                turns = anchor * cycles_per_metre
                turn = np.float32(turns - np.floor(turns))
                for i in range(width):
                    place = offset[i] * inverse_step + part
                    floor = np.floor(place)
                    fraction[i] = place - floor
                    index[i] = np.int32(floor)
                    cycles = offset[i] * cycles_scale + turn
                    t = cycles - np.floor(cycles + _HALF)
                    q = t * t
                    s = t * (_S0 + q * (_S1 + q * (_S2 + q * (_S3 + q * _S4))))
                    c = _C0 + q * (_C1 + q * (_C2 + q * (_C3 + q * _C4)))
                    cosine[i] = _ONE - _TWO * s * s
                    sine[i] = _TWO * s * c
                profile = profiles[position].view(np.int64)
                for i in range(width):
                    # Unsigned, so that no negative index needs a look.
                    k = np.uint64(min(max(base + index[i], 0), last))
                    here[i] = profile[k]
                    there[i] = profile[k + np.uint64(1)]
                for i in range(width):
                    a, b = here_parts[2 * i], here_parts[2 * i + 1]
                    a += fraction[i] * (there_parts[2 * i] - a)
                    b += fraction[i] * (there_parts[2 * i + 1] - b)
                    real[i] += a * cosine[i] - b * sine[i]
                    imag[i] += a * sine[i] + b * cosine[i]
            for i in range(width):
                image[row, begin + i] += np.complex64(complex(real[i], imag[i]))
