"""Range profiles of nested sub-bands, and back-projection with a band and an aperture a pixel.

A pixel reads the profiles of its sub-band, one of a few, and the positions between its own limits.
So the loop over positions is the inner one, in two parts: range, phase and weights of all
positions, which vectorises; then the look-up and the multiply-add of those within the limits.
"""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import phasor, spline

LANES = 32
"""Cells of a profile come in multiples of it, so that no vectorised loop has a remainder."""

# Positions whose sums stay in the first-level cache.
_GROUP = 6

_ONE, _HALF = np.float32(1), np.float32(0.5)


@kernel
def compress(
    samples: np.ndarray, weights: np.ndarray, transform: np.ndarray, profile: np.ndarray
) -> None:
    """Compress echoes in range with each of several weightings of the frequencies.

    A profile is the one of the weighting before it and what the two differ in: weightings of
    neighbouring sub-bands differ in few frequencies.

    Parameters
    ----------
    samples
        Echo (position, frequency), complex64.
    weights
        Weightings (weighting, frequency), float32.
    transform
        Real and imaginary part of ``exp(4 pi i (f - f_c) rho / c)`` (part, frequency, slant
        range), float32; slant ranges in multiples of `LANES`.
    profile
        Output (part, weighting, position, slant range), float32.
    """
    kinds, count = weights.shape
    cells = transform.shape[2]
    real, imag = np.empty((_GROUP, cells), np.float32), np.empty((_GROUP, cells), np.float32)
    chosen, amount = np.empty(count + 1, np.int64), np.empty(count + 1, np.float32)
    for start in range(0, samples.shape[0], _GROUP):
        group = min(_GROUP, samples.shape[0] - start)
        real[:], imag[:] = 0, 0
        for kind in range(kinds):
            changes = 0
            for k in range(count):
                change = weights[kind, k]
                if kind > 0:
                    change -= weights[kind - 1, k]
                if change != 0:
                    chosen[changes], amount[changes] = k, change
                    changes += 1
            if changes % 2:
                chosen[changes], amount[changes] = chosen[changes - 1], 0
            for change in range(0, changes, 2):
                k0, k1 = chosen[change], chosen[change + 1]
                w0, w1 = amount[change], amount[change + 1]
                c0, s0, c1, s1 = transform[0, k0], transform[1, k0], transform[0, k1], transform[1, k1]  # fmt: skip # noqa: E501
                for member in range(group):
                    first, second = samples[start + member, k0], samples[start + member, k1]
                    a0, b0 = w0 * first.real, w0 * first.imag
                    a1, b1 = w1 * second.real, w1 * second.imag
                    sums_real, sums_imag = real[member], imag[member]
                    for i in range(cells):
                        sums_real[i] += a0 * c0[i] - b0 * s0[i] + (a1 * c1[i] - b1 * s1[i])
                    for i in range(cells):
                        sums_imag[i] += a0 * s0[i] + b0 * c0[i] + (a1 * s1[i] + b1 * c1[i])
            for member in range(group):
                profile[0, kind, start + member] = real[member]
                profile[1, kind, start + member] = imag[member]


@kernel
def accumulate(
    image: np.ndarray,
    point: np.ndarray,
    kind: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    antennas: np.ndarray,
    profile: np.ndarray,
    first_range: float,
    range_step: float,
    cycles_per_metre: float,
) -> None:
    """Fill an image with the matched-filter sum of each pixel over its own band and positions.

    Parameters
    ----------
    image
        Output (row, column), complex64.
    point
        The place that each pixel is focused on (axis, row, column), m, float64.
    kind
        The pixel's sub-band (row, column), an index of `profile`, int32.
    first, last
        Where the pixel's aperture begins and ends (row, column), in positions, float64: position l
        reaches from l - 1/2 to l + 1/2 and counts with what of that lies within.
    antennas
        Antenna positions (end, axis, position), float64; of one end where both are the same.
    profile
        Range profiles (part, sub-band, position, slant range), float32, real and imaginary part,
        weighted for cubic B-splines. A pixel beyond reads some other sample of them.
    first_range, range_step
        Slant range of the first sample and the spacing, m.
    cycles_per_metre
        Carrier phase per slant range, in cycles: 2 / wavelength.
    """
    rows, columns = image.shape
    ends, _, positions = antennas.shape
    middle = positions // 2
    size = (positions + LANES - 1) // LANES * LANES
    most = profile.shape[3] - 4
    # |p - a|^2 = |p - m|^2 (1 + q) with the middle antenna m: no two ranges are subtracted.
    along = np.zeros((ends, 4, size), np.float32)
    for end in range(ends):
        for j in range(positions):
            for axis in range(3):
                step = antennas[end, axis, j] - antennas[end, axis, middle]
                along[end, axis, j] = -2 * step
                along[end, 3, j] += step * step
    offset, fraction = np.empty(size, np.float32), np.empty(size, np.float32)
    cosine, sine = np.empty(size, np.float32), np.empty(size, np.float32)
    w0, w1 = np.empty(size, np.float32), np.empty(size, np.float32)
    w2, w3 = np.empty(size, np.float32), np.empty(size, np.float32)
    index = np.empty(size, np.int32)
    per_step, per_cycle = np.float32(1 / range_step), np.float32(cycles_per_metre)
    for row in range(rows):
        for column in range(columns):
            low, high = first[row, column], last[row, column]
            if not high > low:
                image[row, column] = 0
                continue
            anchor = 0.0
            offset[:] = 0
            for end in range(ends):
                px = point[0, row, column] - antennas[end, 0, middle]
                py = point[1, row, column] - antennas[end, 1, middle]
                pz = point[2, row, column] - antennas[end, 2, middle]
                square = px * px + py * py + pz * pz
                range_ = np.sqrt(square) / ends
                anchor += range_
                scale, inverse = np.float32(range_), np.float32(1 / square)
                dx, dy, dz = np.float32(px / square), np.float32(py / square), np.float32(pz / square)  # fmt: skip # noqa: E501
                ax, ay, az, shift = along[end, 0], along[end, 1], along[end, 2], along[end, 3]
                for j in range(size):
                    q = shift[j] * inverse + dx * ax[j] + dy * ay[j] + dz * az[j]
                    offset[j] += scale * (q / (np.sqrt(_ONE + q) + _ONE))
            place = (anchor - first_range) / range_step
            base = int(np.floor(place))
            place0, cycles = np.float32(place - base), anchor * cycles_per_metre
            turn0 = np.float32(cycles - np.floor(cycles))
            for j in range(size):
                place_ = offset[j] * per_step + place0
                floor = np.floor(place_)
                index[j] = np.int32(floor)
                fraction[j] = place_ - floor
            for j in range(size):
                turn = offset[j] * per_cycle + turn0
                cosine[j], sine[j] = phasor(turn - np.floor(turn + _HALF))
            # Two at a time: a loop that writes more arrays does not vectorise.
            for j in range(size):
                w0[j], w1[j], _, _ = spline(fraction[j])
            for j in range(size):
                _, _, w2[j], w3[j] = spline(fraction[j])
            begin = max(0, int(np.floor(low + 0.5)))
            end_ = min(positions, int(np.ceil(high + 0.5)))
            for j, share in ((begin, begin + 0.5 - low), (end_ - 1, high - end_ + 1.5)):
                cosine[j] *= np.float32(min(share, 1.0))
                sine[j] *= np.float32(min(share, 1.0))
            # Four sums, so that none waits for another.
            ac, bs, as_, bc = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
            band = kind[row, column]
            for j in range(begin, end_):
                # Unsigned, so that no negative index needs a look.
                k = np.uint64(min(max(base + index[j] - 1, 0), most))
                k1, k2, k3 = k + np.uint64(1), k + np.uint64(2), k + np.uint64(3)
                re, im = profile[0, band, j], profile[1, band, j]
                a = w0[j] * re[k] + w1[j] * re[k1] + (w2[j] * re[k2] + w3[j] * re[k3])
                b = w0[j] * im[k] + w1[j] * im[k1] + (w2[j] * im[k2] + w3[j] * im[k3])
                ac += a * cosine[j]
                bs += b * sine[j]
                as_ += a * sine[j]
                bc += b * cosine[j]
            image[row, column] = np.complex64(complex(ac - bs, as_ + bc))
