"""What errors of the baseline do to the height, by its attitude (section 1.2, Eqs. 5 and 12)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import randomness, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.randomness import Draw
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.radar import baseline, formulas, geometry

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
    """Errors of the baseline that the inversion is told (section 1.2, Eqs. 5 and 12)."""

    length_std_m: float = key("standard deviation of its length", "not given", gt=0, le=0.01)
    angle_std_deg: float = key("standard deviation of its attitude", "not given", gt=0, le=1)
    draws: int = key("random draws at each attitude", "ours", ge=2, le=100_000)


def angle_errors(
    seen: baseline.View,
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
    exact = baseline.height_per_length(seen, baseline_m, angles[:, 0])
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
    options = study.baseline_errors
    return angle_errors(
        baseline.view(study.radar, study.scene),
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
