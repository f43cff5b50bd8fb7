"""Coherence of two images over a sliding window."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel


@kernel
def coherence(lower: np.ndarray, upper: np.ndarray, half: int, out: np.ndarray) -> None:
    """Compute the magnitude of the complex coherence.

    Sums of double precision over the window itself: a running sum would leave its rounding where
    there is nothing.

    Parameters
    ----------
    lower, upper
        Images (row, column), complex.
    half
        The window reaches so many pixels to each side; at the edges it covers what there is.
    out
        Output (row, column), float64; 0 where an image is zero all over the window.
    """
    rows, columns = lower.shape
    # Four quantities: real and imaginary part of the product, and both powers.
    values = np.zeros((2 * half + 1, 4, columns))
    tall = np.zeros((4, columns + 2 * half))
    wide = np.zeros((4, columns))
    span = 2 * half + 1
    for row in range(rows + half):
        # The newest row replaces the oldest one.
        newest = values[row % span]
        if row < rows:
            for column in range(columns):
                a, b = lower[row, column], upper[row, column]
                ar, ai = np.float64(a.real), np.float64(a.imag)
                br, bi = np.float64(b.real), np.float64(b.imag)
                newest[0, column] = ar * br + ai * bi
                newest[1, column] = ai * br - ar * bi
                newest[2, column] = ar * ar + ai * ai
                newest[3, column] = br * br + bi * bi
        else:
            newest[:] = 0
        if row < half:
            continue
        for quantity in range(4):
            line = tall[quantity, half : half + columns]
            line[:] = 0
            for other in range(span):
                added = values[other, quantity]
                for column in range(columns):
                    line[column] += added[column]
            total = wide[quantity]
            total[:] = 0
            for shift in range(span):
                added = tall[quantity, shift:]
                for column in range(columns):
                    total[column] += added[column]
        for column in range(columns):
            cross = wide[0, column] * wide[0, column] + wide[1, column] * wide[1, column]
            power = wide[2, column] * wide[3, column]
            ratio = np.sqrt(cross / power) if power > 0 else 0.0
            out[row - half, column] = min(ratio, 1.0)
