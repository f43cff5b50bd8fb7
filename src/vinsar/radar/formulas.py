"""The paper's formulas as printed (Eqs. 2-6 and 12), most of them for plane waves.

The processing does not use them. `vinsar.radar.instrument` derives the same quantities without
the plane wave, `vinsar.radar.geometry` and `vinsar.radar.aperture` what is imaged where.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]


def plane_wave_range_difference(
    baseline_m: float, baseline_angle: float, look: ArrayLike
) -> Floats:
    """Return ``r1 - r2`` for a plane wave (Eq. 2), m; angles in radians."""
    return -baseline_m * np.sin(baseline_angle - np.asarray(look))


def printed_height(
    phase: ArrayLike,
    look: ArrayLike,
    *,
    baseline_m: float,
    baseline_angle: float,
    antenna_height: float,
    wavelength_m: float,
) -> Floats:
    """Return the height by Eq. 3 as printed, which is wrong; kept to show by how much.

    The numerator's ``lambda phi / 2 pi`` should be ``lambda phi / 4 pi``; use
    `geometry.invert_height`.

    Parameters
    ----------
    phase
        Absolute interferometric phase, rad.
    look
        Look angle of the lower antenna, rad.
    baseline_m, baseline_angle
        Length, m, and attitude, rad, of the baseline.
    antenna_height
        Height of the lower antenna, m.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    ndarray
        Height, m.
    """
    path = wavelength_m * np.asarray(phase) / (2 * np.pi)
    look = np.asarray(look)
    range_ = (path**2 - baseline_m**2) / (2 * baseline_m * np.sin(baseline_angle - look) - path)
    return antenna_height - range_ * np.cos(look)


def baseline_components(
    baseline_m: float, baseline_angle: ArrayLike, look: ArrayLike
) -> tuple[Floats, Floats]:
    """Return the baseline along and across the line of sight (Eq. 4), m; angles in radians."""
    angle = np.asarray(baseline_angle) - np.asarray(look)
    return -baseline_m * np.sin(angle), baseline_m * np.cos(angle)


def height_per_baseline_length(
    range_m: ArrayLike, baseline_m: float, baseline_angle: ArrayLike, look: ArrayLike
) -> Floats:
    """Return the height error per error of the baseline's length (Eq. 5), m/m."""
    _, across = baseline_components(baseline_m, baseline_angle, look)
    look = np.asarray(look)
    return np.asarray(range_m) * np.sin(look) * np.sin(np.asarray(baseline_angle) - look) / across


def height_per_baseline_angle(range_m: ArrayLike, look: ArrayLike) -> Floats:
    """Return the height error per error of the baseline's attitude (Eq. 12), m/rad."""
    return np.asarray(range_m) * np.sin(np.asarray(look))


def height_of_ambiguity(
    range_m: ArrayLike,
    wavelength_m: float,
    baseline_m: float,
    baseline_angle: float,
    look: ArrayLike,
) -> Floats:
    """Return the height that turns the phase by a cycle: ``lambda r sin(theta) / 2 B_perp``, m."""
    _, across = baseline_components(baseline_m, baseline_angle, look)
    return wavelength_m * np.asarray(range_m) * np.sin(np.asarray(look)) / (2 * across)


def critical_baseline(
    range_m: ArrayLike, wavelength_m: float, look: ArrayLike, range_resolution_m: float
) -> Floats:
    """Return the perpendicular baseline that decorrelates level ground, m.

    ``lambda r tan(theta) / (2 rho_r)``: the phase turns by a cycle within a resolution cell.
    """
    return wavelength_m * np.asarray(range_m) * np.tan(np.asarray(look)) / (2 * range_resolution_m)


def radial_shift(
    x: ArrayLike, y: ArrayLike, height: ArrayLike, antenna_height: float
) -> tuple[Floats, Floats]:
    """Return the paper's image shift (Eq. 6 with its missing term), in x and y.

    It moves the target radially. That is what a rotating antenna would do; a synthetic aperture
    moves it as `aperture.image_position` has it.

    Parameters
    ----------
    x, y
        Target on the ground, m, of shapes that broadcast.
    height
        Height of the target, m.
    antenna_height
        Height H of the antenna, m.

    Returns
    -------
    tuple of ndarray
        Shifts in x and y, m.
    """
    x, y, height = np.broadcast_arrays(
        np.asarray(x, float), np.asarray(y, float), np.asarray(height, float)
    )
    ground = np.hypot(x, y)
    shift = np.sqrt((antenna_height - height) ** 2 - antenna_height**2 + ground**2) - ground
    return shift * x / ground, shift * y / ground
