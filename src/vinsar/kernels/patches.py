"""Spectra of overlapping patches: weighting them, and adding the patches up.

Arrays are (patch along x, column, patch along y, row): what is contiguous lies along y.
"""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import power


@kernel
def weigh(spectra: np.ndarray, alpha: float, weights: np.ndarray) -> None:
    """Raise magnitude spectra, smoothed by 3 x 3 and scaled to a maximum of 1, to a power.

    Parameters
    ----------
    spectra
        Spectra (patch along x, column, patch along y, row), complex64, periodic in column and row.
    alpha
        The power.
    weights
        Output of the same shape, float32; 0 where a patch is.
    """
    across, columns, down, rows = spectra.shape
    parts = spectra.view(np.float32)
    exponent = np.float32(alpha)
    # Columns of sums over three rows, each side of the patch repeated by one.
    sums = np.empty((columns + 2, rows), np.float32)
    line = np.empty(rows + 2, np.float32)
    for j in range(across):
        for i in range(down):
            for column in range(columns):
                values = parts[j, column, i]
                for row in range(rows):
                    a, b = values[2 * row], values[2 * row + 1]
                    line[row + 1] = np.sqrt(a * a + b * b)
                line[0], line[rows + 1] = line[rows], line[1]
                for row in range(rows):
                    sums[column + 1, row] = line[row] + line[row + 1] + line[row + 2]
            for row in range(rows):
                sums[0, row], sums[columns + 1, row] = sums[columns, row], sums[1, row]
            peak = np.float32(0)
            for column in range(columns):
                out = weights[j, column, i]
                for row in range(rows):
                    out[row] = sums[column, row] + sums[column + 1, row] + sums[column + 2, row]
                for row in range(rows):
                    peak = max(peak, out[row])
            scale = np.float32(1) / peak if peak > 0 else np.float32(0)
            for column in range(columns):
                out = weights[j, column, i]
                for row in range(rows):
                    out[row] = power(out[row] * scale, exponent)


@kernel
def add_along_y(patches: np.ndarray, taper: np.ndarray, step: int, lines: np.ndarray) -> None:
    """Add tapered patches up along y.

    Parameters
    ----------
    patches
        Patches (patch along x, column, patch along y, row), complex64.
    taper
        Taper of a column (side,), float32.
    step
        Step between patches, pixels.
    lines
        Output (patch along x, column, y), complex64, which begins with the first patch.
    """
    across, columns, down, rows = patches.shape
    parts, sums = patches.view(np.float32), lines.view(np.float32)
    weight = np.empty(2 * rows, np.float32)
    for row in range(rows):
        weight[2 * row] = weight[2 * row + 1] = taper[row]
    for j in range(across):
        for column in range(columns):
            for i in range(down):
                values, out = parts[j, column, i], sums[j, column, 2 * i * step :]
                for k in range(2 * rows):
                    out[k] += weight[k] * values[k]


@kernel
def add_along_x(lines: np.ndarray, taper: np.ndarray, step: int, total: np.ndarray) -> None:
    """Add tapered lines of patches up along x.

    Parameters
    ----------
    lines
        Lines (patch along x, column, y), complex64, as `add_along_y` makes them.
    taper
        Taper of a row (side,), float32.
    step
        Step between patches, pixels.
    total
        Output (x, y), complex64, which begins with the first patch.
    """
    across, columns, count = lines.shape
    parts, sums = lines.view(np.float32), total.view(np.float32)
    for j in range(across):
        for column in range(columns):
            weight, values, out = taper[column], parts[j, column], sums[j * step + column]
            for k in range(2 * count):
                out[k] += weight * values[k]
