"""Spectra of overlapping patches: weighting them, what weights leave, and adding patches up.

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
def left(weights: np.ndarray, rows: np.ndarray, columns: np.ndarray, power: np.ndarray) -> None:
    """Add up what weights leave of spectra, each the product of two along the axes.

    Parameters
    ----------
    weights
        Weights (patch along x, column, patch along y, row), float32.
    rows, columns
        Power of some spectra along y and along x (spectrum, patch along y, patch along x, row) and
        (.., column), float64.
    power
        Output (spectrum, patch along y, patch along x), float64: sums of the squared weights times
        the spectra.
    """
    across, sides, down, count = weights.shape
    sums = np.empty(count)
    for kind in range(len(power)):
        for j in range(across):
            for i in range(down):
                sums[:] = 0
                for column in range(sides):
                    values, factor = weights[j, column, i], columns[kind, i, j, column]
                    for row in range(count):
                        sums[row] += factor * np.float64(values[row] * values[row])
                total, along = 0.0, rows[kind, i, j]
                for row in range(count):
                    total += sums[row] * along[row]
                power[kind, i, j] = total


@kernel
def sidebands(
    weights: np.ndarray,
    carrier: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
    power: np.ndarray,
    cell: np.ndarray,
    lost: np.ndarray,
) -> None:
    """Add up what patches and resolution cell take from a phase's pairs of sidebands.

    Parameters
    ----------
    weights
        Weights (patch along x, column, patch along y, row), float32.
    carrier
        Column and row of the fringe (2, patch along x, patch along y).
    rows, columns
        Rows and columns from it to one sideband of each pair (pair,).
    power, cell
        Power of each, and the cell's transfer (pair,), float64.
    lost
        Output (patch along y, patch along x), float64: the sums of the power times the square of
        what is not passed.
    """
    across, side, down, _ = weights.shape
    for j in range(across):
        for i in range(down):
            column, row = carrier[0, j, i], carrier[1, j, i]
            scale = 0.5 / max(np.float64(weights[j, column, i, row]), 1e-30)
            total = 0.0
            for n in range(rows.size):
                one = weights[j, (column + columns[n]) % side, i, (row + rows[n]) % side]
                other = weights[j, (column - columns[n]) % side, i, (row - rows[n]) % side]
                passed = min(np.float64(one + other) * scale, 1.0) * cell[n]
                total += power[n] * (1 - passed) ** 2
            lost[i, j] = total


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
