"""The design of the baseline: its own errors, decorrelation, and the noise of the height.

Eq. 5 is a plane wave's: with ranges as they are, a length error ``dB`` moves the height by

    dh = dB (rho sin(theta) sin(beta - theta) / B + sin(theta)) / cos(beta - theta),

whose second term Eq. 5 lacks. It is one metre a metre for a vertical baseline, and it moves the
attitude at which a length error does no harm from ``beta = theta`` to
``beta = theta - asin(B / rho)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.radar import formulas, geometry, waveform

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]


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


def view(radar_: Any, scene: Any) -> View:
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
