"""What each antenna position adds to the image of a few points, and how it agrees with the rest."""

from __future__ import annotations

from typing import Any

import numpy as np

from vinsar.kernels import scratch
from vinsar.kernels.compiling import kernel, part
from vinsar.kernels.functions import phasor

_ZERO, _ONE, _HALF = np.float32(0), np.float32(1), np.float32(0.5)


@part
def _longer(
    size: int, end: Any, middle: Any, share: Any,
    rx: Any, ry: Any, rz: Any, inverse: Any, path: Any, offset: Any,
) -> None:  # fmt: skip
    """Add a share of how much longer the way is from one end than from the middle."""
    dx, dy, dz = end[0] - middle[0], end[1] - middle[1], end[2] - middle[2]
    square = np.float32(dx * dx + dy * dy + dz * dz)
    x, y, z = np.float32(dx), np.float32(dy), np.float32(dz)
    for i in range(size):
        q = square * inverse[i] + x * rx[i] + y * ry[i] + z * rz[i]
        offset[i] += share * path[i] * (q / (np.sqrt(_ONE + q) + _ONE))


@kernel
def fill(
    profile: np.ndarray,
    first_range: float,
    spacing: float,
    cycles_per_metre: float,
    transmitter: np.ndarray,
    receiver: np.ndarray,
    points: np.ndarray,
    out: np.ndarray,
    image: np.ndarray,
    power: np.ndarray,
) -> None:
    """Interpolate the profiles linearly at each point and turn them back by the path's phase.

    Parameters
    ----------
    profile
        Range profiles (antenna, range), complex64, weighted for linear interpolation.
    first_range, spacing
        Slant range of the first sample and between samples, m.
    cycles_per_metre
        Cycles of the carrier for each metre of slant range, 1/m.
    transmitter, receiver
        Positions (antenna, 3), m.
    points
        Points (3, point), m.
    out
        Output (antenna, point), complex64; 0 where a point is out of the profile. It may have no
        rows, if the sums alone are wanted.
    image, power
        Outputs (point,), complex64 and float32: the sum over the antennas, and that of their
        powers.
    """
    per_step, per_metre = np.float32(1 / spacing), np.float32(cycles_per_metre)
    antennas, count = profile.shape[0], points.shape[1]
    last = np.int32(profile.shape[1] - 2)
    middle = np.zeros(3)
    for antenna in range(antennas):
        for axis in range(3):
            middle[axis] += (transmitter[antenna, axis] + receiver[antenna, axis]) / (2 * antennas)
    rx, ry, rz = scratch.floats(), scratch.floats(), scratch.floats()
    inverse, path = scratch.floats(), scratch.floats()
    place, turn, base = scratch.floats(), scratch.floats(), scratch.integers()
    offset, index, rest = scratch.floats(), scratch.integers(), scratch.floats()
    cosine, sine = scratch.floats(), scratch.floats()
    real, imag = scratch.floats(), scratch.floats()
    total_real, total_imag, total = scratch.floats(), scratch.floats(), scratch.floats()
    for begin in range(0, count, scratch.SIZE):
        size = min(scratch.SIZE, count - begin)
        block = slice(begin, begin + size)
        for i in range(size):
            x = points[0, begin + i] - middle[0]
            y = points[1, begin + i] - middle[1]
            z = points[2, begin + i] - middle[2]
            square = x * x + y * y + z * z
            way = np.sqrt(square)
            rx[i], ry[i], rz[i] = -2 * x / square, -2 * y / square, -2 * z / square
            inverse[i], path[i] = 1 / square, way
            at = (way - first_range) / spacing
            base[i] = np.int32(np.floor(at))
            place[i] = at - np.floor(at)
            cycles = way * cycles_per_metre
            turn[i] = cycles - np.floor(cycles)
            total_real[i], total_imag[i], total[i] = 0, 0, 0
        for antenna in range(antennas):
            start, stop = transmitter[antenna], receiver[antenna]
            same = start[0] == stop[0] and start[1] == stop[1] and start[2] == stop[2]
            for i in range(size):
                offset[i] = 0
            share = _ONE if same else _HALF
            _longer(size, start, middle, share, rx, ry, rz, inverse, path, offset)
            if not same:
                _longer(size, stop, middle, share, rx, ry, rz, inverse, path, offset)
            for i in range(size):
                at = place[i] + offset[i] * per_step
                whole = np.floor(at)
                rest[i] = at - whole
                index[i] = base[i] + np.int32(whole)
            for i in range(size):
                cycles = turn[i] + offset[i] * per_metre
                c, s = phasor(cycles - np.floor(cycles + _HALF))
                inside = _ONE if 0 <= index[i] <= last else _ZERO
                cosine[i], sine[i] = inside * c, inside * s
            line = profile[antenna]
            for i in range(size):
                # Unsigned, so that no negative index needs a look.
                k = np.uint64(min(max(index[i], np.int32(0)), last))
                near, far = line[k], line[k + np.uint64(1)]
                a = near.real + rest[i] * (far.real - near.real)
                b = near.imag + rest[i] * (far.imag - near.imag)
                real[i], imag[i] = a, b
            for i in range(size):
                a, b = real[i], imag[i]
                real[i] = a * cosine[i] - b * sine[i]
                imag[i] = a * sine[i] + b * cosine[i]
                total_real[i] += real[i]
                total_imag[i] += imag[i]
                total[i] += real[i] * real[i] + imag[i] * imag[i]
            if out.shape[0]:
                row = out[antenna, block]
                for i in range(size):
                    row[i] = complex(real[i], imag[i])
        for i in range(size):
            image[begin + i] = complex(total_real[i], total_imag[i])
            power[begin + i] = total[i]


@kernel
def agree(parts: np.ndarray, reference: np.ndarray, begins: np.ndarray, out: np.ndarray) -> None:
    """Sum each position's parts times the conjugate of what all others make, by sector.

    Parameters
    ----------
    parts
        What the positions contribute (position, point), complex64.
    reference
        The image of all positions (point,), complex64.
    begins
        First point of each sector, and the number of points (sector + 1,).
    out
        Output (position, sector), complex128.
    """
    for position in range(parts.shape[0]):
        row = parts[position]
        for sector in range(out.shape[1]):
            begin, end = begins[sector], begins[sector + 1]
            # Sums side by side, so that none waits for another.
            real, imag, more, other = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
            for i in range(begin, end - 1, 2):
                a, b, c, d = row[i].real, row[i].imag, reference[i].real, reference[i].imag
                real += a * (c - a) + b * (d - b)
                imag += b * c - a * d
                a, b = row[i + 1].real, row[i + 1].imag
                c, d = reference[i + 1].real, reference[i + 1].imag
                more += a * (c - a) + b * (d - b)
                other += b * c - a * d
            if (end - begin) % 2:
                a, b = row[end - 1].real, row[end - 1].imag
                c, d = reference[end - 1].real, reference[end - 1].imag
                real += a * (c - a) + b * (d - b)
                imag += b * c - a * d
            out[position, sector] = complex(real + more, imag + other)
