"""The design of the baseline: its own errors, decorrelation, and the noise of the height.

Eq. 5 is a plane wave's: with ranges as they are, a length error ``dB`` moves the height by

    dh = dB (rho sin(theta) sin(beta - theta) / B + sin(theta)) / cos(beta - theta),

whose second term Eq. 5 lacks. It is one metre a metre for a vertical baseline, and it moves the
attitude at which a length error does no harm from ``beta = theta`` to
``beta = theta - asin(B / rho)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.radar import formulas, geometry, waveform

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.study import config

    Floats = NDArray[np.floating]

ANGLES_DEG = np.arange(0.0, 91.0)
"""Attitudes that `angle_errors` goes through, deg."""


@dataclass(frozen=True)
class View:
    """The radar over a point of the ground plane.

    With a switched array the baseline separates one end of the path alone: the phase is that of
    Eq. 1 with twice the wavelength, and the antennas here are the two that the baseline separates.

    Attributes
    ----------
    lower
        Position (3,) of the lower antenna, m.
    x_m, y_m
        The point, m.
    wavelength_m
        Wavelength of the carrier; twice that of a switched array, m.
    range_resolution_m
        Slant-range resolution, m.
    baseline_angle
        Attitude beta of the baseline, rad.
    """

    lower: Floats
    x_m: float
    y_m: float
    wavelength_m: float
    range_resolution_m: float
    baseline_angle: float

    @property
    def slant_range(self) -> float:
        """Slant range r1 of the lower antenna, m."""
        return float(geometry.slant_range(self.lower, self.x_m, self.y_m))

    @property
    def look(self) -> float:
        """Look angle theta of the lower antenna, rad."""
        return float(geometry.look_angle(self.lower, self.x_m, self.y_m))

    @property
    def critical_baseline(self) -> float:
        """Baseline across the line of sight that decorrelates level ground, m."""
        return float(
            formulas.critical_baseline(
                self.slant_range, self.wavelength_m, self.look, self.range_resolution_m
            )
        )

    def across(self, baseline_m: ArrayLike) -> Floats:
        """Return the length of the baseline across the line of sight, m."""
        return np.asarray(baseline_m) * abs(np.cos(self.baseline_angle - self.look))


def view(radar_: config.Radar, scene: config.Scene) -> View:
    """Return a radar over the middle of its scene.

    On a rail and in a receive pair the antennas stand on x = y = 0.

    Parameters
    ----------
    radar_
        Section ``radar`` of the configuration.
    scene
        Section ``scene``, for its extent alone.

    Returns
    -------
    View
        The geometry.
    """
    band = np.array([radar_.start_frequency_hz, radar_.stop_frequency_hz])
    place = np.array([0.0, 0.0, radar_.rail_height_m])
    if radar_.system == "transmit_pair":
        place = np.array(
            [radar_.transmitter_x_m, radar_.transmitter_y_m, radar_.transmitter_height_m]
        )
    return View(
        lower=place,
        x_m=(scene.x_min_m + scene.x_max_m) / 2,
        y_m=(scene.y_min_m + scene.y_max_m) / 2,
        wavelength_m=waveform.wavelength(waveform.carrier(band))
        * (1 if radar_.system == "rail" else 2),
        range_resolution_m=waveform.range_resolution(float(band[1] - band[0])),
        baseline_angle=float(np.deg2rad(radar_.baseline_angle_deg)),
    )


def height_per_length(seen: View, baseline_m: float, baseline_angle: ArrayLike) -> Floats:
    """Return the exact derivative of the height by the baseline's length, m/m.

    Eq. 5 and the term that it lacks, in the plane across the aperture.

    Parameters
    ----------
    seen
        The geometry; its own attitude is not read.
    baseline_m
        Length of the baseline, m.
    baseline_angle
        Attitudes, rad.

    Returns
    -------
    ndarray
        Derivative at the true baseline, for a target on the ground plane.
    """
    ground, height = seen.y_m - seen.lower[1], seen.lower[2]
    across_range = np.hypot(ground, height)
    look = np.arctan2(ground, height)
    angle = np.asarray(baseline_angle) - look
    return ground * np.tan(angle) / baseline_m + ground / across_range / np.cos(angle)


def angle_errors(
    seen: View,
    *,
    baseline_m: float,
    length_std_m: float,
    angle_std_deg: float,
    draws: int,
    rng: np.random.Generator,
) -> xr.Dataset:
    """Return what errors of the baseline do to the height, by the baseline's attitude.

    The true baseline gives the phase of the middle of the scene; a length, or an attitude, drawn
    from a normal distribution around the true one then inverts it exactly
    (`geometry.invert_height`). No height reference takes any of the error away again.

    Parameters
    ----------
    seen
        The geometry; its own attitude is not read.
    baseline_m
        Length of the baseline, m.
    length_std_m
        Standard deviation of the length that the inversion is told, m.
    angle_std_deg
        Standard deviation of the attitude that the inversion is told, deg.
    draws
        Draws at each attitude, of each of the two errors.
    rng
        Source of randomness.

    Returns
    -------
    xarray.Dataset
        Product ``baseline_angle``, for attitudes from 0 to 90 deg.
    """
    angles = np.deg2rad(ANGLES_DEG)[:, None]
    angle_std = float(np.deg2rad(angle_std_deg))
    upper = [
        seen.lower + baseline_m * np.array([0.0, np.cos(beta), np.sin(beta)])
        for beta in angles[:, 0]
    ]
    r2 = np.array([geometry.slant_range(antenna, seen.x_m, seen.y_m) for antenna in upper])
    phase = geometry.interferometric_phase(seen.slant_range, r2, seen.wavelength_m)[:, None]

    def std(length: ArrayLike, angle: Floats) -> Floats:
        height = geometry.invert_height(
            seen.slant_range,
            phase,
            baseline_m=length,
            baseline_angle=angle,
            antenna_height=float(seen.lower[2]),
            along_track=seen.x_m - seen.lower[0],
            wavelength_m=seen.wavelength_m,
        )
        return np.nanstd(height, axis=1)

    # Each attitude has draws of its own: its neighbours show how far chance carries it.
    unit = rng.standard_normal((2, angles.size, draws))
    eq5 = formulas.height_per_baseline_length(seen.slant_range, baseline_m, angles[:, 0], seen.look)
    eq12 = formulas.height_per_baseline_angle(seen.slant_range, seen.look)
    exact = height_per_length(seen, baseline_m, angles[:, 0])
    return variables.dataset(
        "baseline_angle",
        {
            "length_drawn": std(baseline_m + length_std_m * unit[0], angles),
            "length_eq5": length_std_m * np.abs(eq5),
            "length_exact": length_std_m * np.abs(exact),
            "angle_drawn": std(baseline_m, angles + angle_std * unit[1]),
            "angle_eq12": np.full(angles.size, angle_std * float(eq12)),
            "length_error": length_std_m,
            "angle_error": angle_std,
        },
        {"baseline_angle": angles[:, 0]},
    )
