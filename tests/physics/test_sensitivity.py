"""The paper's first-order formulas (Eqs. 2, 4, 5, 12) against the exact geometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vinsar.radar import formulas, geometry

WAVELENGTH = 299_792_458.0 / 14e9
ANGLES = [np.deg2rad(value) for value in (30.0, 60.0, 90.0, 120.0)]


def geometry_at(y, baseline, angle, height=0.0):
    """Ranges of both antennas, and the lower one's look angle."""
    lower = np.array([0.0, 0.0, 2.0])
    upper = lower + baseline * np.array([0.0, np.cos(angle), np.sin(angle)])
    return (
        float(geometry.slant_range(lower, 0, y, height)),
        float(geometry.slant_range(upper, 0, y, height)),
        float(geometry.look_angle(lower, 0, y, height)),
    )


def inverted(range_lower, phase, baseline, angle):
    return float(
        geometry.invert_height(
            range_lower, phase, baseline_m=baseline, baseline_angle=angle, antenna_height=2.0,
            along_track=0.0, wavelength_m=WAVELENGTH,
        )
    )  # fmt: skip


def slope(function, at, step):
    return (function(at + step) - function(at - step)) / (2 * step)


@given(y=st.floats(5, 1e4), baseline=st.floats(0.05, 1), angle=st.floats(0, np.pi))
def test_eq_2_errs_by_no_more_than_the_curvature_of_the_wave(y, baseline, angle):
    r1, r2, look = geometry_at(y, baseline, angle)
    plane = formulas.plane_wave_range_difference(baseline, angle, look)
    # r2 = r1 + B sin + B^2 cos^2 / 2 r1 + ...: the next term of the series is smaller by B / r1.
    curvature = baseline**2 * np.cos(angle - look) ** 2 / (2 * r1)
    series = 2 * baseline**3 / r1**2
    assert (r1 - r2) - plane == pytest.approx(-curvature, abs=series + 1e-10)


@given(baseline=st.floats(0.01, 2), angle=st.floats(0, np.pi), look=st.floats(0, np.pi))
def test_eq_4_splits_the_baseline_by_pythagoras(baseline, angle, look):
    along, across = formulas.baseline_components(baseline, angle, look)
    assert np.hypot(along, across) == pytest.approx(baseline)


def test_eq_4_along_the_line_of_sight_is_eq_2():
    along, _ = formulas.baseline_components(0.3, np.pi / 2, 1.4)
    assert along == formulas.plane_wave_range_difference(0.3, np.pi / 2, 1.4)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("y", [10.0, 16.0])
def test_eq_5_is_the_slope_of_height_over_baseline_length_for_a_plane_wave(angle, y):
    r1, r2, look = geometry_at(y, 0.3, angle)
    phase = float(geometry.interferometric_phase(r1, r2, WAVELENGTH))
    exact = slope(lambda length: inverted(r1, phase, length, angle), 0.3, 1e-4)
    # Eq. 5 takes the plane wave of Eq. 2. The exact law of cosines adds sin(theta) /
    # cos(beta - theta), metre for metre: 13 % at H0 = 2 m for the vertical baseline.
    curvature = np.sin(look) / np.cos(angle - look)
    found = formulas.height_per_baseline_length(r1, 0.3, angle, look)
    assert found == pytest.approx(exact - curvature, rel=1e-5)


def test_eq_5_vanishes_where_the_baseline_is_across_the_line_of_sight():
    assert formulas.height_per_baseline_length(13.0, 0.3, 1.42, 1.42) == 0


def test_ahead_of_a_vehicle_a_vertical_baseline_suffers_least_from_its_length():
    r1, _, look = geometry_at(13.0, 0.3, np.pi / 2)
    vertical, horizontal = (
        abs(formulas.height_per_baseline_length(r1, 0.3, angle, look)) for angle in (np.pi / 2, 0.0)
    )
    # tan(beta - theta) is cot(theta) for the one and -tan(theta) for the other.
    assert horizontal / vertical == pytest.approx(np.tan(look) ** 2)
    assert np.tan(look) ** 2 > 40


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("y", [10.0, 16.0])
def test_eq_12_is_the_slope_of_height_over_baseline_attitude(angle, y):
    r1, r2, look = geometry_at(y, 0.3, angle)
    phase = float(geometry.interferometric_phase(r1, r2, WAVELENGTH))
    exact = slope(lambda attitude: inverted(r1, phase, 0.3, attitude), angle, 1e-5)
    assert formulas.height_per_baseline_angle(r1, look) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("angle", ANGLES)
def test_height_of_ambiguity_turns_the_phase_by_one_cycle(angle):
    r1, r2, look = geometry_at(13.0, 0.3, angle)
    phase = float(geometry.interferometric_phase(r1, r2, WAVELENGTH))
    per_radian = slope(lambda value: inverted(r1, value, 0.3, angle), phase, 1e-3)
    found = formulas.height_of_ambiguity(r1, WAVELENGTH, 0.3, angle, look)
    # The exact slope has r2 where the formula has r1. The phase falls with height.
    assert found == pytest.approx(-2 * np.pi * per_radian * r1 / r2, rel=1e-6)


def test_height_of_ambiguity_of_the_paper():
    r1, _, look = geometry_at(13.0, 0.3, np.pi / 2)
    found = formulas.height_of_ambiguity(r1, WAVELENGTH, 0.3, np.pi / 2, look)
    assert found == pytest.approx(0.469, abs=1e-3)


@pytest.mark.parametrize("y", [5.0, 13.0])
def test_at_the_critical_baseline_the_phase_turns_once_in_a_resolution_cell(y):
    cell, short = 0.075, 1e-3

    def phase_at(range_lower):
        r1, r2, _ = geometry_at(np.sqrt(range_lower**2 - 4), short, np.pi / 2)
        return float(geometry.interferometric_phase(r1, r2, WAVELENGTH))

    r1, _, look = geometry_at(y, short, np.pi / 2)
    per_cell = slope(phase_at, r1, 1e-2) * cell
    _, across = formulas.baseline_components(short, np.pi / 2, look)
    # Phase is proportional to a short baseline; the next order is B / H0 = 5e-4 of it.
    found = formulas.critical_baseline(r1, WAVELENGTH, look, cell)
    assert found == pytest.approx(2 * np.pi / abs(per_cell) * across, rel=1e-3)


@given(
    height=st.floats(-0.3, 0.3), y=st.floats(8, 16), angle=st.floats(0.5, 2.6),
    error=st.floats(-0.01, 0.01),
)  # fmt: skip
def test_an_error_of_attitude_turns_the_look_angle_by_as_much(height, y, angle, error):
    r1, r2, look = geometry_at(y, 0.3, angle, height)
    assume(np.cos(angle - look) > 0.1)
    phase = float(geometry.interferometric_phase(r1, r2, WAVELENGTH))
    found = inverted(r1, phase, 0.3, angle + error)
    assert found == pytest.approx(2.0 - r1 * np.cos(look + error), abs=1e-9)
