"""Grids on the ground: image and DEM, the keys that give them, and what is checked of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations.errors import Fault
from vinsar.radar import geometry

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

KEYS = (
    "imaging.x_min_m",
    "imaging.x_max_m",
    "imaging.y_min_m",
    "imaging.y_max_m",
    "imaging.grid_spacing_m",
    "imaging.grid_spacing_x_m",
    "imaging.grid_spacing_y_m",
)
"""Keys of the configuration that give the grid of image and DEM."""


def pixel(imaging: Any) -> tuple[float, float]:
    """Return the spacing of pixels in x and y, m.

    Parameters
    ----------
    imaging
        Section ``imaging``.
    """
    x, y = imaging.grid_spacing_x_m, imaging.grid_spacing_y_m
    return (
        imaging.grid_spacing_m if x is None else x,
        imaging.grid_spacing_m if y is None else y,
    )


def pixel_side(imaging: Any) -> float:
    """Return the side of the square that is as large as a pixel, m.

    Parameters
    ----------
    imaging
        Section ``imaging``.
    """
    x, y = pixel(imaging)
    return x if x == y else float(np.sqrt(x * y))


def step(axis: Floats) -> float:
    """Return the step of an even axis, m; of a single pixel, as if it were a metre wide."""
    return float(axis[1] - axis[0]) if axis.size > 1 else 1.0


def place(values: Floats, axis: Floats) -> Floats:
    """Return where values lie on an even axis, in steps from its first pixel."""
    return np.asarray((values - axis[0]) / step(axis))


def image_axes(imaging: Any) -> tuple[Floats, Floats]:
    """Return the axes x and y of image and DEM, m.

    Parameters
    ----------
    imaging
        Section ``imaging``.
    """
    x, y = pixel(imaging)
    return (
        geometry.grid_axis(imaging.x_min_m, imaging.x_max_m, x),
        geometry.grid_axis(imaging.y_min_m, imaging.y_max_m, y),
    )


def check_extent(section: str, part: Any) -> Iterator[Fault]:
    """Check that a part of the ground ends beyond where it begins."""
    for axis in "xy":
        low, high = getattr(part, f"{axis}_min_m"), getattr(part, f"{axis}_max_m")
        if low >= high:
            yield Fault(f"{section}.{axis}_max_m", high, f"must exceed {axis}_min_m, {low}")


def check_multiple(
    key: str, value: float, low: float, high: float, spacing: float
) -> Iterator[Fault]:
    """Check that a spacing divides an extent, m."""
    try:
        geometry.grid_axis(low, high, spacing)
    except ValueError:
        count = max(1, round((high - low) / spacing))
        yield Fault(
            key,
            value,
            f"must divide the extent from {low:g} to {high:g} m; {(high - low) / count:.6g} would",
        )
