"""Back-projection from a rail along x onto level rows: geometry once a row, not once a position.

Range depends on a pixel and a position only through ``x - x_l``. Where pixels and positions are
evenly spaced and one spacing divides the other, a row meets few values of it: ranges, phases and
places in the profile are computed once for each, in double precision, and a position takes a piece
of that table. What is left for each pixel and position is the look-up and a multiply-add.
"""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import phasor, spline
from vinsar.kernels.lookup import LANES, PADDING, lanes, windows_for
from vinsar.kernels.matched import add

_TILE = 256


@kernel
def accumulate(
    image: np.ndarray,
    x_first: float,
    x_step: float,
    y: np.ndarray,
    z: np.ndarray,
    transmitter: np.ndarray,
    receiver: np.ndarray,
    pitch: float,
    classes: int,
    stride: int,
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
    x_first, x_step
        The first pixel's x and the pixels' spacing, m.
    y, z
        Place and height of each row (row,), float64.
    transmitter, receiver
        Antennas at the first position (3,), float64.
    pitch
        Spacing of the positions along x, m.
    classes, stride
        ``classes`` positions later the antennas are ``stride`` pixels further. One of them is 1.
    profile_real, profile_imag, first_range, range_step, cycles_per_metre, cubic
        As in `backprojection.accumulate`.
    """
    rows, columns = image.shape
    positions = profile_real.shape[0]
    # How many pixels the last position's piece lies before the first one's.
    lead = stride * ((positions - 1) // classes)
    length = lead + (columns + LANES - 1) // LANES * LANES
    # No sample is read outside the profile.
    taps, before = (4, 1) if cubic else (2, 0)
    last = float(profile_real.shape[1] - PADDING)
    index = np.empty((classes, length), np.int32)
    weights = np.empty((4, classes, length), np.float32)
    fraction = np.empty((classes, length), np.float32)
    turn = np.empty(length, np.float32)
    cosine = np.empty((classes, length), np.float32)
    sine = np.empty((classes, length), np.float32)
    sums = np.empty((2, _TILE), np.float32)
    for row in range(rows):
        out = (y[row] - transmitter[1]) ** 2 + (z[row] - transmitter[2]) ** 2
        back = (y[row] - receiver[1]) ** 2 + (z[row] - receiver[2]) ** 2
        reach = 0
        for kind in range(classes):
            to_out = x_first - transmitter[0] - kind * pitch
            to_back = x_first - receiver[0] - kind * pitch
            for i in range(length):
                # The last group of pixels is filled up with the last pixel.
                along = min(i - lead, columns - 1) * x_step
                distance = 0.5 * (
                    np.sqrt((to_out + along) ** 2 + out) + np.sqrt((to_back + along) ** 2 + back)
                )
                place = (distance - first_range) / range_step
                floor = np.floor(place)
                index[kind, i] = np.int32(min(max(float(before), floor), last))
                fraction[kind, i] = np.float32(place - floor)
                cycles = distance * cycles_per_metre
                turn[i] = np.float32(cycles - np.floor(cycles + 0.5))
            for i in range(length):
                cosine[kind, i], sine[kind, i] = phasor(turn[i])
            if cubic:
                for i in range(length):
                    w0, w1, w2, w3 = spline(fraction[kind, i])
                    weights[0, kind, i], weights[1, kind, i] = w0, w1
                    weights[2, kind, i], weights[3, kind, i] = w2, w3
            for i in range(length - lanes() // 2):
                # Range is convex in x: in between, indices are no further apart.
                reach = max(reach, abs(index[kind, i + lanes() // 2] - index[kind, i]))
        windows = windows_for(reach, taps)
        for begin in range(0, columns, _TILE):
            used = min(_TILE, columns - begin)
            width = (used + LANES - 1) // LANES * LANES
            sums[:] = 0
            for position in range(positions):
                kind = position % classes
                start = begin + lead - stride * (position // classes)
                piece = slice(start, start + width)
                real, imag = profile_real[position], profile_imag[position]
                places = index[kind, piece]
                turns = cosine[kind, piece], sine[kind, piece]
                if cubic:
                    four = (
                        weights[0, kind, piece], weights[1, kind, piece],
                        weights[2, kind, piece], weights[3, kind, piece],
                    )  # fmt: skip
                    add(
                        windows, places, np.int64(-1), four, turns[0], turns[1], real, imag,
                        sums[0, :width], sums[1, :width],
                    )  # fmt: skip
                else:
                    add(
                        windows, places, np.int64(0), (fraction[kind, piece],), turns[0], turns[1],
                        real, imag, sums[0, :width], sums[1, :width],
                    )  # fmt: skip
            for i in range(used):
                image[row, begin + i] += np.complex64(complex(sums[0, i], sums[1, i]))
