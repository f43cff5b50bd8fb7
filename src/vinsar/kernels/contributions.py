"""What each antenna position adds to the image of a few points, and how it agrees with the rest."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import phasor

_HALF = 0.5


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
        Output (antenna, point), complex64; 0 where a point is out of the profile.
    """
    samples, count = profile.shape[1], points.shape[1]
    x, y, z = points
    path, place = np.empty(count), np.empty(count)
    cosine, sine = np.empty(count, np.float32), np.empty(count, np.float32)
    # Short loops, each of one kind: all but the last vectorise.
    for antenna in range(profile.shape[0]):
        tx, ty, tz = transmitter[antenna]
        rx, ry, rz = receiver[antenna]
        for i in range(count):
            a, b, c = x[i] - tx, y[i] - ty, z[i] - tz
            path[i] = np.sqrt(a * a + b * b + c * c)
        if tx != rx or ty != ry or tz != rz:
            for i in range(count):
                a, b, c = x[i] - rx, y[i] - ry, z[i] - rz
                path[i] = _HALF * (path[i] + np.sqrt(a * a + b * b + c * c))
        for i in range(count):
            place[i] = (path[i] - first_range) / spacing
            cycles = path[i] * cycles_per_metre
            cosine[i], sine[i] = phasor(np.float32(cycles - np.floor(cycles + _HALF)))
        line, row = profile[antenna], out[antenna]
        for i in range(count):
            index = int(np.floor(place[i]))
            if index < 0 or index > samples - 2:
                row[i] = 0
                continue
            rest = np.float32(place[i] - index)
            near, far = line[index], line[index + 1]
            real = near.real + rest * (far.real - near.real)
            imag = near.imag + rest * (far.imag - near.imag)
            row[i] = complex(real * cosine[i] - imag * sine[i], real * sine[i] + imag * cosine[i])


@kernel
def add(parts: np.ndarray, image: np.ndarray) -> float:
    """Add the parts up over the positions, and return the sum of their powers.

    Parameters
    ----------
    parts
        What the positions contribute (position, point), complex64.
    image
        Their sum (point,), complex64, which begins at 0.
    """
    power = 0.0
    for position in range(parts.shape[0]):
        row = parts[position]
        for i in range(image.size):
            image[i] += row[i]
            power += row[i].real * row[i].real + row[i].imag * row[i].imag
    return power


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
            real, imag = np.float32(0), np.float32(0)
            for i in range(begins[sector], begins[sector + 1]):
                a, b = row[i].real, row[i].imag
                c, d = reference[i].real, reference[i].imag
                real += a * (c - a) + b * (d - b)
                imag += b * c - a * d
            out[position, sector] = complex(real, imag)
