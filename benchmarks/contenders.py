"""Contenders: plain numpy, Numba as one would write it first, and published peers."""

from __future__ import annotations

import importlib
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from numba import njit

ROOT = Path(__file__).parents[1]
PEERS = ROOT / ".venv" / "peers"
LIGHT = 299_792_458.0


def peer(name):
    """Return a module that the benchmark is measured against, or None with a word why.

    All peers are installed on first use, and again when the list of them has changed.
    """
    os.environ.setdefault("FASTSAR_CACHE_DIR", str(PEERS / "cache"))
    if str(PEERS) not in sys.path:
        sys.path.append(str(PEERS))
    wanted, stamp = ROOT / "benchmarks" / "requirements.txt", PEERS / "requirements.txt"
    try:
        if not stamp.is_file() or stamp.read_bytes() != wanted.read_bytes():
            pip = [sys.executable, "-I", "-m", "pip", "--disable-pip-version-check", "--quiet"]
            what = ["--no-deps", "--require-hashes", "-r", wanted]
            subprocess.run([*pip, "install", "--upgrade", "--target", PEERS, *what], check=True)
            stamp.write_bytes(wanted.read_bytes())
        return importlib.import_module(name)
    except (ImportError, OSError, RuntimeError, subprocess.CalledProcessError) as error:
        print(f"without {name}: {error}", file=sys.stderr)
        return None


def matched_filter(signal, frequency, antennas, x, y, z):
    """Return the direct float64 sum over positions and frequencies at each pixel."""
    grid_x, grid_y = np.meshgrid(x, y)
    result = np.zeros(grid_x.shape, complex)
    step = frequency[1] - frequency[0]
    for samples, antenna in zip(signal, antennas, strict=True):
        path = 2 * np.sqrt(
            (grid_x - antenna[0]) ** 2 + (grid_y - antenna[1]) ** 2 + (z - antenna[2]) ** 2
        )
        # Horner's scheme in exp(2 pi i step R / c): one exponential for all frequencies.
        turn = np.exp(2j * np.pi * step / LIGHT * path)
        total = np.zeros_like(turn)
        for sample in samples[::-1]:
            total = total * turn + sample
        result += total * np.exp(2j * np.pi * frequency[0] / LIGHT * path)
    return result / signal.size


def numpy_backprojection(profiles, first, step, cycles, antennas, x, y):
    """Back-project by numpy, one position after the other, in single precision where it does."""
    grid_x, grid_y = np.meshgrid(x, y)
    image = np.zeros(grid_x.shape, np.complex64)
    for profile, antenna in zip(profiles, antennas, strict=True):
        distance = np.sqrt(
            (grid_x - antenna[0]) ** 2 + (grid_y - antenna[1]) ** 2 + antenna[2] ** 2
        )
        place = (distance - first) / step
        index = place.astype(np.int64)
        share = (place - index).astype(np.float32)
        value = profile[index] * (1 - share) + profile[index + 1] * share
        turns = distance * cycles
        angle = (2 * np.pi * (turns - np.floor(turns))).astype(np.float32)
        image += value * np.exp(1j * angle)
    return image


@njit(nogil=True)
def numba_backprojection(profiles, first, step, cycles, antennas, x, y, image):
    """Back-project as one would write it first in Numba: a pixel, all positions, sin and cos."""
    for row in range(y.size):
        for column in range(x.size):
            total = 0j
            for position in range(antennas.shape[0]):
                dx = x[column] - antennas[position, 0]
                dy = y[row] - antennas[position, 1]
                dz = antennas[position, 2]
                distance = math.sqrt(dx * dx + dy * dy + dz * dz)
                place = (distance - first) / step
                k = int(place)
                share = place - k
                value = (1 - share) * profiles[position, k] + share * profiles[position, k + 1]
                angle = 2 * math.pi * cycles * distance
                total += value * complex(math.cos(angle), math.sin(angle))
            image[row, column] = total


# Taylor series in t^2 of sin(pi t) / t and cos(pi t): on |t| <= 1/2 they leave out less than 1e-17.
# PyPI's llvmlite has no vector math library: math.sin would keep the loop scalar.
_SIN = tuple((-1) ** n * math.pi ** (2 * n + 1) / math.factorial(2 * n + 1) for n in range(11))
_COS = tuple((-1) ** n * math.pi ** (2 * n) / math.factorial(2 * n) for n in range(11))


@njit(nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def strengths(path, weight, turns_per_metre, steps_per_metre, angle, strength):
    """Turn paths into the points and strengths of a non-uniform Fourier transform.

    Angle is the phase of a frequency step, strength the weight times the phasor of the middle
    frequency.
    """
    parts = strength.view(np.float64)
    for i in range(path.size):
        steps = path[i] * steps_per_metre
        angle[i] = 2 * np.pi * (steps - np.floor(steps + 0.5))
        turns = path[i] * turns_per_metre
        t = np.floor(turns + 0.5) - turns
        q = t * t
        s = _SIN[10]
        c = _COS[10]
        for n in range(9, -1, -1):
            s = s * q + _SIN[n]
            c = c * q + _COS[n]
        s *= t
        parts[2 * i] = weight[i] * (1 - 2 * s * s)
        parts[2 * i + 1] = weight[i] * (2 * s * c)


@njit(nogil=True)
def ray_march(height, x_first, x_step, y_first, y_step, antenna, points, visible):
    """Follow the line of sight to each point from raster row to raster row."""
    rows, columns = height.shape
    for i in range(points.shape[0]):
        distance = points[i, 1] - antenna[1]
        slope = (points[i, 2] - antenna[2]) / distance
        aside = (points[i, 0] - antenna[0]) / distance
        seen = True
        for row in range(rows):
            ahead = y_first + y_step * row - antenna[1]
            if ahead >= distance - y_step:
                break
            column = (antenna[0] + aside * ahead - x_first) / x_step
            if column < 0 or column > columns - 1:
                continue
            k = min(int(column), columns - 2)
            share = column - k
            z = (1 - share) * height[row, k] + share * height[row, k + 1]
            if z - antenna[2] > slope * ahead:
                seen = False
                break
        visible[i] = seen
