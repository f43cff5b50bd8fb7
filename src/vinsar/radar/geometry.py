"""Ranges, angles and heights, and the circle around the aperture axis.

Right-handed metres: x along the rail, y forward, z up; the lower antenna stands at
``(0, 0, H1)``, the upper at ``(0, B cos(beta), H1 + B sin(beta))``. Angles are in radians.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]


def grid_axis(minimum_m: float, maximum_m: float, spacing_m: float) -> Floats:
    """Return evenly spaced coordinates with both ends included.

    Parameters
    ----------
    minimum_m, maximum_m
        First and last coordinate, m.
    spacing_m
        Spacing, m; it must divide the extent.

    Returns
    -------
    ndarray
        Coordinates, m.

    Raises
    ------
    ValueError
        If the spacing is not positive, or the extent no positive multiple of it.
    """
    if spacing_m <= 0:
        raise ValueError(f"a spacing of {spacing_m} m is not positive")
    steps = (maximum_m - minimum_m) / spacing_m
    count = round(steps)
    if count < 1 or abs(steps - count) > 1e-6:
        raise ValueError(
            f"an extent from {minimum_m} to {maximum_m} m is not a multiple of the spacing "
            f"{spacing_m} m"
        )
    return minimum_m + spacing_m * np.arange(count + 1)


def slant_range(position: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0) -> Floats:
    """Return the distance from an antenna to points.

    Parameters
    ----------
    position
        Antenna position (x, y, z), m.
    x, y, z
        Points, m, of shapes that broadcast.

    Returns
    -------
    ndarray
        Distance, m.
    """
    antenna = np.asarray(position, dtype=float)
    dx, dy, dz = np.asarray(x) - antenna[0], np.asarray(y) - antenna[1], np.asarray(z) - antenna[2]
    return np.sqrt(dx**2 + dy**2 + dz**2)


def look_angle(position: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0) -> Floats:
    """Return the look angle from nadir (Eq. 9), in radians.

    The asin of Eq. 9 confuses a target above the antenna with one below; atan2 does not.
    """
    antenna = np.asarray(position, dtype=float)
    ground = np.hypot(np.asarray(x) - antenna[0], np.asarray(y) - antenna[1])
    return np.arctan2(ground, antenna[2] - np.asarray(z))


def interferometric_phase(
    range_lower_m: ArrayLike, range_upper_m: ArrayLike, wavelength_m: float
) -> Floats:
    """Return the interferometric phase (Eq. 1), lower minus upper, in radians.

    Each antenna transmits and receives alone.

    Parameters
    ----------
    range_lower_m, range_upper_m
        Slant ranges of the target, m.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    ndarray
        Phase, rad.
    """
    difference = np.asarray(range_lower_m) - np.asarray(range_upper_m)
    return -4 * np.pi * difference / wavelength_m


def circle_image_y(y: ArrayLike, height: ArrayLike, antenna_height: float) -> Floats:
    """Return where an aperture along x images a raised target on the ground plane.

    Every range ``r^2 = (x - x_l)^2 + y^2 + (H - h)^2`` recurs on the ground at the same x and
    ``y'^2 = y^2 + (H - h)^2 - H^2``: a circle around the aperture axis.

    Parameters
    ----------
    y
        True distance ahead of the aperture, m.
    height
        Height of the target, m.
    antenna_height
        Height H of the aperture, m.

    Returns
    -------
    ndarray
        y' in metres; NaN where the circle does not reach the ground.
    """
    height = np.asarray(height, dtype=float)
    square = np.asarray(y) ** 2 + (antenna_height - height) ** 2 - antenna_height**2
    return np.sqrt(np.where(square >= 0, square, np.nan))


def circle_true_y(image_y: ArrayLike, height: ArrayLike, antenna_height: float) -> Floats:
    """Invert `circle_image_y`: the true y of a target of known height imaged at ``image_y``."""
    height = np.asarray(height, dtype=float)
    square = np.asarray(image_y) ** 2 + antenna_height**2 - (antenna_height - height) ** 2
    return np.sqrt(np.where(square >= 0, square, np.nan))


def invert_height(
    range_lower_m: ArrayLike,
    phase: ArrayLike,
    *,
    baseline_m: ArrayLike,
    baseline_angle: ArrayLike,
    antenna_height: float,
    along_track: ArrayLike,
    wavelength_m: float,
) -> Floats:
    """Return the height from slant range and absolute phase, exactly, for any baseline angle.

    With r1 from the pixel and ``dr = r1 - r2`` from the phase, the law of cosines in the plane
    across the aperture gives ``sin(beta - theta) = (r2^2 - r1^2 - B^2) / (2 rho1 B)`` and
    ``h = H1 - rho1 cos(theta)``, where ``rho1^2 = r1^2 - x^2``. This replaces the paper's Eq. 3.

    Parameters
    ----------
    range_lower_m
        Slant range r1 from the lower antenna, m.
    phase
        Absolute interferometric phase, flat-earth phase included, rad.
    baseline_m, baseline_angle
        Length, m, and attitude from horizontal, rad, of the baseline.
    antenna_height
        Height H1 of the lower antenna, m.
    along_track
        Offset x of the target from the centre of the aperture, m.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    ndarray
        Height, m; NaN where no look angle fits the phase.
    """
    r1 = np.asarray(range_lower_m, dtype=float)
    r2 = r1 + wavelength_m * np.asarray(phase) / (4 * np.pi)
    across_range = np.sqrt(r1**2 - np.asarray(along_track) ** 2)
    baseline_m, baseline_angle = np.asarray(baseline_m), np.asarray(baseline_angle)
    sine = (r2**2 - r1**2 - baseline_m**2) / (2 * across_range * baseline_m)
    cosine = np.sqrt(np.where(np.abs(sine) <= 1, 1 - sine**2, np.nan))
    # The sine knows the angle up to its mirror image; level ground at this range tells which side.
    ground_cosine = np.clip(antenna_height / across_range, -1, 1)
    ground_sine = np.sqrt(1 - ground_cosine**2)
    across, up = np.cos(baseline_angle), np.sin(baseline_angle)
    cosine = np.where(across * ground_cosine + up * ground_sine < 0, -cosine, cosine)
    # The look angle is beta less this angle.
    return antenna_height - across_range * (across * cosine + up * sine)


def fit_plane(x: Floats, y: Floats, z: Floats, *, least_residual: float) -> Floats:
    """Fit a plane by least absolute deviations: single bad points do not count.

    By least squares, reweighted with the inverse of the residuals.

    Parameters
    ----------
    x, y, z
        Points (point,).
    least_residual
        Residual below which the weight grows no more, in the unit of z.

    Returns
    -------
    ndarray, shape (3,)
        Value at the origin, slope along x, slope along y.
    """
    design = np.stack([np.ones_like(x), x, y], axis=1)
    weights: Floats = np.ones(z.size)
    solution: Floats = np.zeros(3)
    for _ in range(50):
        root = np.sqrt(weights)
        solution, *_ = np.linalg.lstsq(design * root[:, None], z * root, rcond=None)
        weights = 1 / np.maximum(np.abs(z - design @ solution), least_residual)
    return solution
