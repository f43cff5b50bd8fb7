"""Spectra of overlapping patches: smoothing them, and adding the patches up."""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel


@kernel
def smooth(spectra: np.ndarray, weights: np.ndarray) -> None:
    """Sum magnitude spectra over 3 x 3 and scale each to a maximum of 1.

    Parameters
    ----------
    spectra
        Spectra (patch row, patch, row, column), complex64, periodic in row and column.
    weights
        Output of the same shape, float32; 0 where a patch is.
    """
    down, across, rows, columns = spectra.shape
    parts = spectra.view(np.float32)
    # Rows of sums over three columns, each side of the patch repeated by one.
    sums = np.empty((rows + 2, columns), np.float32)
    line = np.empty(columns + 2, np.float32)
    for i in range(down):
        for j in range(across):
            for row in range(rows):
                values = parts[i, j, row]
                for column in range(columns):
                    a, b = values[2 * column], values[2 * column + 1]
                    line[column + 1] = np.sqrt(a * a + b * b)
                line[0], line[columns + 1] = line[columns], line[1]
                for column in range(columns):
                    sums[row + 1, column] = line[column] + line[column + 1] + line[column + 2]
            for column in range(columns):
                sums[0, column], sums[rows + 1, column] = sums[rows, column], sums[1, column]
            peak = np.float32(0)
            for row in range(rows):
                out = weights[i, j, row]
                for column in range(columns):
                    out[column] = sums[row, column] + sums[row + 1, column] + sums[row + 2, column]
                for column in range(columns):
                    peak = max(peak, out[column])
            scale = np.float32(1) / peak if peak > 0 else np.float32(0)
            for row in range(rows):
                out = weights[i, j, row]
                for column in range(columns):
                    out[column] *= scale


@kernel
def overlap_add(patches: np.ndarray, taper: np.ndarray, step: int, total: np.ndarray) -> None:
    """Add up tapered patches at their places.

    Parameters
    ----------
    patches
        Patches (patch row, patch, row, column), complex64.
    taper
        Taper of a row and of a column (side,), float32.
    step
        Step between patches, in rows and columns.
    total
        Output (row, column), complex64, which begins with the first patch.
    """
    down, across, rows, columns = patches.shape
    parts, sums = patches.view(np.float32), total.view(np.float32)
    weight = np.empty(2 * columns, np.float32)
    for row in range(rows):
        for column in range(columns):
            weight[2 * column] = taper[row] * taper[column]
            weight[2 * column + 1] = weight[2 * column]
        for i in range(down):
            for j in range(across):
                values = parts[i, j, row]
                out = sums[i * step + row, 2 * j * step :]
                for k in range(2 * columns):
                    out[k] += weight[k] * values[k]
