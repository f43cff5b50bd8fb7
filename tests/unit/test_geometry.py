"""Ranges, angles and the exact inversion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vinsar.radar import formulas, geometry

WAVELENGTH = 0.0214
heights = st.floats(-0.5, 1.0)
antenna_heights = st.floats(1.5, 3.0)


def antennas(baseline, angle, height):
    lower = np.array([0.0, 0.0, height])
    return lower, lower + baseline * np.array([0.0, np.cos(angle), np.sin(angle)])


@given(first=st.floats(-20, 20), count=st.integers(1, 500), spacing=st.floats(1e-3, 1.0))
def test_grid_axis_holds_both_ends(first, count, spacing):
    axis = geometry.grid_axis(first, first + count * spacing, spacing)
    assert axis.size == count + 1
    np.testing.assert_allclose(axis[[0, -1]], [first, first + count * spacing], atol=1e-9)
    np.testing.assert_allclose(np.diff(axis), spacing, rtol=1e-6)


@pytest.mark.parametrize("ends", [(0.0, 1.05), (1.0, 0.0), (1.0, 1.0)])
def test_grid_axis_refuses_an_extent_that_is_no_multiple(ends):
    with pytest.raises(ValueError, match="not a multiple of the spacing"):
        geometry.grid_axis(*ends, 0.1)


def test_slant_range_is_the_distance_and_broadcasts():
    assert geometry.slant_range((1.0, 2.0, 15.0), 4.0, 6.0, 3.0) == pytest.approx(13)
    assert geometry.slant_range((0, 0, 2.0), np.zeros((1, 5)), np.zeros((4, 1))).shape == (4, 5)


@given(x=st.floats(-5, 5), y=st.floats(1, 30), z=st.floats(-1, 5))
def test_look_angle_turns_from_nadir_and_passes_the_level(x, y, z):
    position = (0.3, 0.0, 2.0)
    angle = geometry.look_angle(position, x, y, z)
    distance = geometry.slant_range(position, x, y, z)
    assert np.cos(angle) * distance == pytest.approx(2.0 - z, abs=1e-9)
    # Eq. 9 itself, whose asin cannot tell a target above the antenna from one below.
    assert np.sin(angle) == pytest.approx(np.hypot(x - 0.3, y) / distance)


def test_look_angle_straight_down_is_zero():
    assert geometry.look_angle((1.0, 2.0, 3.0), 1.0, 2.0) == 0


def test_phase_rises_by_a_cycle_for_each_half_wavelength_nearer_to_the_lower_antenna():
    phase = geometry.interferometric_phase([10.0, 10.0 - WAVELENGTH / 2], [10.0, 10.0], WAVELENGTH)
    np.testing.assert_allclose(phase, [0, 2 * np.pi], atol=1e-9)


@given(
    angle=st.floats(0, np.pi), height=heights, antenna=antenna_heights,
    x=st.floats(-5, 5), y=st.floats(3, 30), baseline=st.floats(0.05, 0.5),
)  # fmt: skip
def test_inversion_returns_the_height_for_any_baseline_angle(
    angle, height, antenna, x, y, baseline
):
    lower, upper = antennas(baseline, angle, antenna)
    across = np.hypot(y, antenna - height)
    # A baseline that points at the target tells it from its mirror image by nothing; on which
    # side of it the target lies is judged by level ground at the same range.
    assume(across > antenna)
    ground_angle = angle - np.arccos(antenna / across)
    target_angle = angle - np.arctan2(y, antenna - height)
    assume(np.cos(ground_angle) * np.cos(target_angle) > 1e-4)
    range_lower = geometry.slant_range(lower, x, y, height)
    phase = geometry.interferometric_phase(
        range_lower, geometry.slant_range(upper, x, y, height), WAVELENGTH
    )
    found = geometry.invert_height(
        range_lower, phase, baseline_m=baseline, baseline_angle=angle, antenna_height=antenna,
        along_track=x, wavelength_m=WAVELENGTH,
    )  # fmt: skip
    # Rounding of ranges of 30 m (4e-15 m) over a perpendicular baseline of 0.05 m x 0.01.
    assert found == pytest.approx(height, abs=1e-7)


@given(height=heights, antenna=antenna_heights, y=st.floats(3, 30))
def test_inversion_of_a_vertical_baseline_is_the_difference_of_squared_ranges(height, antenna, y):
    lower, upper = antennas(0.3, np.pi / 2, antenna)
    r1 = geometry.slant_range(lower, 0, y, height)
    r2 = geometry.slant_range(upper, 0, y, height)
    found = geometry.invert_height(
        r1, geometry.interferometric_phase(r1, r2, WAVELENGTH), baseline_m=0.3,
        baseline_angle=np.pi / 2, antenna_height=antenna, along_track=0.0,
        wavelength_m=WAVELENGTH,
    )  # fmt: skip
    assert found == pytest.approx(antenna - (r2**2 - r1**2 - 0.09) / 0.6, abs=1e-9)


def test_a_phase_that_fits_no_look_angle_gives_no_height():
    # The ranges cannot differ by more than the baseline.
    phase = geometry.interferometric_phase(13.0, 13.31, WAVELENGTH)
    found = geometry.invert_height(
        13.0, [phase, 0.0], baseline_m=0.3, baseline_angle=np.pi / 2, antenna_height=2.0,
        along_track=0.0, wavelength_m=WAVELENGTH,
    )  # fmt: skip
    assert np.isnan(found).tolist() == [True, False]


@pytest.mark.parametrize("y", [8.0, 13.0, 16.0])
def test_eq_3_as_printed_errs_by_its_wrong_numerator(y):
    lower, upper = antennas(0.3, np.pi / 2, 2.0)
    r1, r2 = geometry.slant_range(lower, 0, y), geometry.slant_range(upper, 0, y)
    look = geometry.look_angle(lower, 0, y)
    printed = formulas.printed_height(
        geometry.interferometric_phase(r1, r2, WAVELENGTH), look, baseline_m=0.3,
        baseline_angle=np.pi / 2, antenna_height=2.0, wavelength_m=WAVELENGTH,
    )  # fmt: skip
    # (lambda phi / 2 pi)^2 is 4 dr^2 where dr^2 should stand, so r1 is short by the factor
    # 3 dr^2 / (B^2 - dr^2) and level ground, at height 0, comes out that share of H0 high.
    square = (r1 - r2) ** 2
    shortfall = 3 * square / (0.09 - square)
    assert printed == pytest.approx(2.0 * shortfall, rel=1e-6)
    if y == 13.0:
        assert shortfall == pytest.approx(0.08, abs=0.01)
        assert printed == pytest.approx(0.17, abs=0.01)


@given(x=st.floats(-5, 5), y=st.floats(3, 30), height=heights, antenna=antenna_heights)
def test_the_image_of_a_raised_target_keeps_its_range_to_every_position(x, y, height, antenna):
    image_y = geometry.circle_image_y(y, height, antenna)
    for place in (-0.4, 0.0, 0.25):
        position = (place, 0.0, antenna)
        true_range = geometry.slant_range(position, x, y, height)
        assert geometry.slant_range(position, x, image_y) == pytest.approx(true_range, abs=1e-12)


@given(y=st.floats(3, 30), height=heights, antenna=antenna_heights)
def test_circle_image_y_and_circle_true_y_are_inverse(y, height, antenna):
    image_y = geometry.circle_image_y(y, height, antenna)
    assert geometry.circle_true_y(image_y, height, antenna) == pytest.approx(y, abs=1e-12)
    true_y = geometry.circle_true_y(y, height, antenna)
    assert geometry.circle_image_y(true_y, height, antenna) == pytest.approx(y, abs=1e-12)


def test_a_circle_that_misses_the_ground_gives_nan():
    # From 2 m up, a target 1 m high at 1 m ahead is 1.41 m away: nearer than any ground.
    image_y = geometry.circle_image_y([1.0, 5.0], 1.0, 2.0)
    assert np.isnan(image_y).tolist() == [True, False]
    assert np.isnan(geometry.circle_true_y(0.5, -1.0, 2.0))


def test_radial_shift_of_the_papers_target():
    for antenna, expected in ((2.0, (-0.0494, -0.0823)), (2.3, (-0.0575, -0.0958))):
        assert formulas.radial_shift(3.0, 5.0, 0.3, antenna) == pytest.approx(expected, abs=5e-5)


@given(x=st.floats(-5, 5), y=st.floats(3, 30), height=heights, antenna=antenna_heights)
def test_radial_shift_keeps_the_range_from_the_centre_and_the_bearing(x, y, height, antenna):
    shift_x, shift_y = formulas.radial_shift(x, y, height, antenna)
    moved = geometry.slant_range((0, 0, antenna), x + shift_x, y + shift_y)
    assert moved == pytest.approx(geometry.slant_range((0, 0, antenna), x, y, height), abs=1e-12)
    assert (x + shift_x) * y == pytest.approx((y + shift_y) * x, abs=1e-9)


@given(y=st.floats(3, 30), height=heights, antenna=antenna_heights)
def test_straight_ahead_the_radial_shift_is_the_circles(y, height, antenna):
    x_shift, y_shift = formulas.radial_shift(0.0, y, height, antenna)
    assert x_shift == 0
    assert y_shift == pytest.approx(geometry.circle_image_y(y, height, antenna) - y, abs=1e-12)
