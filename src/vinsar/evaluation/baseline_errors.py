"""What errors of the baseline do to the height, by its attitude (section 1.2, Eqs. 5 and 12).

Eq. 5 is a plane wave's: with ranges as they are, a length error ``dB`` moves the height by

    dh = dB (rho sin(theta) sin(beta - theta) / B + sin(theta)) / cos(beta - theta),

whose second term Eq. 5 lacks. It is one metre a metre for a vertical baseline, and it moves the
attitude at which a length error does no harm from ``beta = theta`` to
``beta = theta - asin(B / rho)``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import randomness, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.randomness import Draw
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.radar import formulas, geometry, instrument
from vinsar.radar.instrument import Instrument

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

ANGLES_DEG = np.arange(0.0, 91.0)
"""Attitudes that `angle_errors` goes through, deg."""

variables.declare(
    "baseline_angle",
    {
        "length_drawn": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height under drawn errors of the baseline's length",
            "by the exact inversion",
        ),
        "length_eq5": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height from the baseline's length by Eq. 5",
        ),
        "length_exact": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height from the baseline's length by the exact derivative",
        ),
        "angle_drawn": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height under drawn errors of the baseline's attitude",
            "by the exact inversion",
        ),
        "angle_eq12": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height from the baseline's attitude by Eq. 12",
        ),
        "length_error": Variable(
            (), "real", "m", "standard deviation of the error of the baseline's length"
        ),
        "angle_error": Variable(
            (), "real", "radian", "standard deviation of the error of the baseline's attitude"
        ),
    },
    coordinates={
        "baseline_angle": Variable(
            ("baseline_angle",), "real", "radian", "attitude of the baseline from horizontal"
        )
    },
)


class BaselineErrors(Section, name="baseline_errors"):
    """Errors of the baseline that the inversion assumes (section 1.2, Eqs. 5 and 12)."""

    length_std_m: float = key("standard deviation of its length", "not given", gt=0, le=0.01)
    angle_std_deg: float = key("standard deviation of its attitude", "not given", gt=0, le=1)
    draws: int = key("random draws at each attitude", "ours", ge=2, le=100_000)


def height_per_length(
    antenna: Floats, y_m: float, baseline_m: float, baseline_angle: ArrayLike
) -> Floats:
    """Return the exact derivative of the height by the baseline's length, m/m.

    Eq. 5 and the term that it lacks, in the plane across the aperture.

    Parameters
    ----------
    antenna
        Position (3,) of the lower antenna, m.
    y_m
        Distance ahead of a target on the ground plane, m.
    baseline_m
        Length of the baseline, m.
    baseline_angle
        Attitudes, rad.

    Returns
    -------
    ndarray
        Derivative at the true baseline.
    """
    ground, height = y_m - antenna[1], antenna[2]
    across_range = np.hypot(ground, height)
    look = np.arctan2(ground, height)
    angle = np.asarray(baseline_angle) - look
    return ground * np.tan(angle) / baseline_m + ground / across_range / np.cos(angle)


def angle_errors(
    antenna: Floats,
    place: tuple[float, float],
    *,
    wavelength_m: float,
    baseline_m: float,
    length_std_m: float,
    angle_std_deg: float,
    draws: int,
    rng: np.random.Generator,
) -> xr.Dataset:
    """Return what errors of the baseline do to the height, by the baseline's attitude.

    The true baseline gives the phase of a place on the ground; a length, or an attitude, drawn
    from a normal distribution around the true one then inverts it exactly
    (`geometry.invert_height`). No height reference takes any of the error away again.

    Parameters
    ----------
    antenna
        Position (3,) of the lower antenna, m.
    place
        The place, x and y in m.
    wavelength_m
        Wavelength, m; twice the carrier's where the baseline separates one end of the path alone.
    baseline_m
        Length of the baseline, m.
    length_std_m
        Standard deviation of the length that the inversion assumes, m.
    angle_std_deg
        Standard deviation of the attitude that the inversion assumes, deg.
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
    r1, look = float(geometry.slant_range(antenna, *place)), geometry.look_angle(antenna, *place)
    upper = [
        antenna + baseline_m * np.array([0.0, np.cos(beta), np.sin(beta)]) for beta in angles[:, 0]
    ]
    r2 = np.array([geometry.slant_range(end, *place) for end in upper])
    phase = geometry.interferometric_phase(r1, r2, wavelength_m)[:, None]

    def std(length: ArrayLike, angle: Floats) -> Floats:
        height = geometry.invert_height(
            r1,
            phase,
            baseline_m=length,
            baseline_angle=angle,
            antenna_height=float(antenna[2]),
            along_track=place[0] - antenna[0],
            wavelength_m=wavelength_m,
        )
        return np.nanstd(height, axis=1)

    # Independent draws for each attitude: the scatter between neighbours shows the sampling error.
    unit = rng.standard_normal((2, angles.size, draws))
    eq5 = formulas.height_per_baseline_length(r1, baseline_m, angles[:, 0], look)
    eq12 = formulas.height_per_baseline_angle(r1, look)
    exact = height_per_length(antenna, place[1], baseline_m, angles[:, 0])
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


def _baseline_angle(products: Products, study: Study) -> xr.Dataset:
    del products
    options, planned = study.baseline_errors, Instrument.planned(study.radar)
    antenna, _ = planned.separated
    return angle_errors(
        antenna,
        instrument.middle(study.scene),
        # With common receivers, or a common transmitter, half the phase.
        wavelength_m=planned.wavelength * (1 if study.radar.system == "rail" else 2),
        baseline_m=study.radar.baseline_m,
        length_std_m=options.length_std_m,
        angle_std_deg=options.angle_std_deg,
        draws=options.draws,
        rng=randomness.generator(study, Draw.BASELINE),
    )


STAGES = {
    "baseline_angle": Stage(
        _baseline_angle, sections=(*randomness.KEYS, "radar", "scene", "baseline_errors")
    ),
}
