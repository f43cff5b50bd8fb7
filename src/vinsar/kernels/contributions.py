"""What each antenna position adds to the image of a few points, before the sum over positions."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import phasor


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
        Points (point, 3), m.
    out
        Output (antenna, point), complex64; 0 where a point is out of the profile.
    """
    samples = profile.shape[1]
    for antenna in range(profile.shape[0]):
        line = profile[antenna]
        tx, ty, tz = transmitter[antenna]
        rx, ry, rz = receiver[antenna]
        same = tx == rx and ty == ry and tz == rz
        for i in range(points.shape[0]):
            x, y, z = points[i]
            a, b, c = x - tx, y - ty, z - tz
            path = np.sqrt(a * a + b * b + c * c)
            if not same:
                a, b, c = x - rx, y - ry, z - rz
                path = 0.5 * (path + np.sqrt(a * a + b * b + c * c))
            place = (path - first_range) / spacing
            index = int(np.floor(place))
            if index < 0 or index > samples - 2:
                out[antenna, i] = 0
                continue
            cycles = path * cycles_per_metre
            cosine, sine = phasor(np.float32(cycles - np.floor(cycles + 0.5)))
            rest = np.float32(place - index)
            near, far = line[index], line[index + 1]
            real = near.real + rest * (far.real - near.real)
            imag = near.imag + rest * (far.imag - near.imag)
            out[antenna, i] = complex(real * cosine - imag * sine, real * sine + imag * cosine)
