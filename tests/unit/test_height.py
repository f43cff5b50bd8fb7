"""Phase constant, inversion and DEM coding, on phases known exactly."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.processing import height
from vinsar.radar import geometry

X, Y = np.linspace(-1, 1, 21), np.linspace(8, 11, 61)
GRID_Y, GRID_X = np.meshgrid(Y, X, indexing="ij")


def flat(x, y):
    del y
    return np.zeros_like(x)


def hill(x, y):
    return 0.2 * np.exp(-((x - 0.1) ** 2 + (y - 9.6) ** 2) / 0.18)


def points(function, count=40, seed=0):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.9, 0.9, count), rng.uniform(8.4, 10.8, count)
    return x, y, function(x, y)


def test_level_ground_takes_the_grid_points_in_its_rectangles():
    x, y, z = height.level_ground(
        np.array([0.0, 1.0, 2.0]), np.array([5.0, 6.0]), [(0, 0.5, 5, 6), (1.5, 2, 6, 7)], 0.1
    )
    assert sorted(zip(x, y, z, strict=True)) == [(0, 5, 0.1), (0, 6, 0.1), (2, 6, 0.1)]


def test_rectangles_that_overlap_count_a_point_once():
    x, _, _ = height.level_ground(X, Y, [(-1, 0, 8, 9), (-1, 0, 8, 9)], 0.0)
    assert len(x) == 11 * 21


def test_level_ground_beside_the_grid_is_refused():
    with pytest.raises(ValueError, match="no pixel of the grid"):
        height.level_ground(X, Y, [(3, 4, 8, 9)], 0.0)


@given(constant=st.floats(-50, 50), level=st.floats(-0.2, 0.2), seed=st.integers(0, 100))
def test_the_constant_is_recovered_from_ground_at_any_level(ideal_phase, constant, level, seed):
    unwrapped, images = ideal_phase(lambda x, _: np.full_like(x, level), X, Y, constant=constant)
    reference = points(lambda x, _: np.full_like(x, level), seed=seed)
    offset = height.phase_offset(unwrapped, images, reference)
    # A level's phase goes as h / r: its curvature 2 phi / r^2 = 0.1 rad / m^2 leaves bilinear
    # interpolation over 5 cm an error below 1e-4 rad.
    np.testing.assert_allclose(offset, -constant, atol=1e-4)
    assert offset.shape == GRID_X.shape


def test_bad_pixels_do_not_move_the_constant(ideal_phase):
    unwrapped, images = ideal_phase(flat, X, Y, constant=1.2)
    rng = np.random.default_rng(3)
    wrong = rng.random(GRID_X.shape) < 0.3
    unwrapped["phase"].values[wrong] += 2 * np.pi * rng.choice([-1, 1, 2], wrong.sum())
    reference = GRID_X.ravel(), GRID_Y.ravel(), np.zeros(GRID_X.size)
    # The median over 70 % good points, which agree exactly.
    np.testing.assert_allclose(height.phase_offset(unwrapped, images, reference), -1.2, atol=1e-9)


@given(
    constant=st.floats(-20, 20), slope_x=st.floats(-3, 3), slope_y=st.floats(-3, 3),
    seed=st.integers(0, 20),
)  # fmt: skip
def test_a_plane_of_phase_is_recovered_among_bad_pixels(
    ideal_phase, constant, slope_x, slope_y, seed
):
    unwrapped, images = ideal_phase(flat, X, Y)
    plane = constant + slope_x * GRID_X + slope_y * (GRID_Y - 9)
    rng = np.random.default_rng(seed)
    wrong = rng.random(GRID_X.shape) < 0.2
    cycles = 2 * np.pi * rng.choice([-1, 1], GRID_X.shape) * wrong
    shifted = unwrapped.assign(phase=unwrapped["phase"] - plane + cycles)
    reference = GRID_X.ravel(), GRID_Y.ravel(), np.zeros(GRID_X.size)
    offset = height.phase_offset(shifted, images, reference, trend="plane")
    # Least absolute deviations fit the exact majority; weights are bounded at a milliradian.
    np.testing.assert_allclose(offset, plane, atol=2e-3)


def test_too_few_points_for_a_plane_are_refused(ideal_phase):
    unwrapped, images = ideal_phase(flat, X, Y)
    with pytest.raises(ValueError, match="three or more reference points, not 2"):
        height.phase_offset(unwrapped, images, points(flat, 2), trend="plane")


@pytest.mark.parametrize("trend", ["constant", "plane"])
def test_control_points_on_a_hill_fix_the_constant(ideal_phase, trend):
    unwrapped, images = ideal_phase(hill, X, Y, constant=-7.0)
    offset = height.phase_offset(unwrapped, images, points(hill), trend=trend)
    # Bilinear interpolation of the hill's phase (18 rad per metre of height) over 10 x 5 cm:
    # curvature 2.2 per metre x (0.1^2 + 0.05^2) / 8 x 18 = 0.06 rad at the top, less elsewhere.
    np.testing.assert_allclose(offset, 7.0, atol=0.05)


@pytest.mark.parametrize(("x", "y", "z"), [(2.0, 9.0, 0.0), (0.0, 12.0, 0.0), (0.0, 8.05, 0.5)])
def test_a_point_imaged_outside_the_grid_is_refused(ideal_phase, x, y, z):
    # The last one lies inside, but its height brings it nearer by 11 cm.
    unwrapped, images = ideal_phase(flat, X, Y)
    reference = np.array([0.0, x]), np.array([9.0, y]), np.array([0.0, z])
    with pytest.raises(ValueError, match=f"x = {x:.2f} m, y = {y:.2f} m is imaged outside"):
        height.phase_offset(unwrapped, images, reference)


def code(image_height, y, antenna_height=2.0, antenna_y=0.0):
    x = np.arange(float(image_height.shape[1]))
    true_y = geometry.circle_true_y(y[:, None] - antenna_y, image_height, antenna_height)
    true_x = np.broadcast_to(x, image_height.shape)
    return height.DemCoding(x, y, true_x=true_x, true_y=antenna_y + true_y)(image_height)


@pytest.mark.parametrize("antenna_y", [0.0, 3.0])
def test_dem_coding_puts_a_raised_block_back_to_its_place(antenna_y):
    y = np.linspace(8, 12, 401)
    front, back, top = 9.5, 10.5, 0.3

    def imaged(place):
        # The circle around the aperture axis, in the plane across it.
        return antenna_y + np.sqrt((place - antenna_y) ** 2 + 1.7**2 - 2.0**2)

    assert front - imaged(front) > 0.05
    image = np.zeros((y.size, 1))
    image[(y >= imaged(front)) & (y <= imaged(back))] = top
    image[(y > imaged(back)) & (y < back)] = np.nan
    found = code(image, y, antenna_y=antenna_y)[:, 0]
    # Pixels of 1 cm: the edges come back to within one.
    np.testing.assert_allclose(found[(y > front + 0.011) & (y < back - 0.011)], top)
    np.testing.assert_allclose(found[(y < imaged(front) - 0.011) | (y > back + 0.011)], 0)


def test_dem_coding_leaves_level_ground_alone():
    np.testing.assert_array_equal(code(np.zeros((30, 4)), np.linspace(8, 9, 30)), 0)


@given(seed=st.integers(0, 10**6), roughness=st.floats(0, 1.5), holes=st.floats(0, 1))
def test_dem_coding_of_layover_and_holes_stays_within_the_heights(seed, roughness, holes):
    rng = np.random.default_rng(seed)
    image = rng.uniform(-roughness, roughness, (25, 6))
    image[rng.random(image.shape) < holes] = np.nan
    image[:, 0] = np.nan
    found = code(image, np.linspace(5, 6, 25))
    assert np.isnan(found[:, 0]).all()
    known = found[np.isfinite(found)]
    if known.size:
        assert np.nanmin(image) <= known.min()
        assert known.max() <= np.nanmax(image)


def test_dem_coding_does_not_extrapolate_beyond_a_pixel():
    y = np.linspace(8, 9, 11)
    image = np.full((11, 1), 0.02)
    image[:3], image[7:] = np.nan, np.nan
    found = code(image, y)[:, 0]
    # 2 cm of height move the pixels at 8.3 to 8.6 m by 5 mm: 8.7 m is within 0.1 m, 8.2 m is not.
    assert np.isfinite(found).tolist() == [False] * 3 + [True] * 5 + [False] * 3


@pytest.mark.parametrize("turn", [-0.6, 0.2])
def test_dem_coding_moves_heights_in_x_and_y(turn):
    # Each pixel belongs a share of its height away, in a direction between the axes.
    x, y = np.linspace(-1, 1, 81), np.linspace(8, 10, 81)
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    image_x, image_y = grid_x, grid_y
    for _ in range(60):
        true_x, true_y = grid_x + turn * hill(image_x, image_y), grid_y + hill(image_x, image_y) / 3
        image_x, image_y = true_x, true_y
    found = height.DemCoding(x, y, true_x=true_x, true_y=true_y)(hill(true_x, true_y))
    # Linear interpolation over places up to 2.5 cm, stretched by the slope of 0.4 to 3.4 cm,
    # apart: 0.2 / 0.09 x 0.034^2 / 8 along each axis.
    inside = (abs(grid_x) < 0.8) & (grid_y > 8.2) & (grid_y < 9.8)
    np.testing.assert_allclose(found[inside], hill(grid_x, grid_y)[inside], atol=7e-4)


@pytest.mark.parametrize("upper", [(0.0, 0.0, 2.3), (0.0, 0.15, 2.26), (0.0, -0.1, 2.28)])
def test_inversion_gives_the_height_at_the_pixel_for_any_baseline(ideal_phase, upper):
    unwrapped, images = ideal_phase(hill, X, Y, upper=upper, constant=5.0)
    dem = height.invert(unwrapped, images, np.full(GRID_X.shape, -5.0))
    image_height = dem.image_height
    true_y = geometry.circle_true_y(GRID_Y, image_height, 2.0)
    np.testing.assert_allclose(image_height, hill(GRID_X, true_y), atol=1e-9)
    ranges = [geometry.slant_range(place, GRID_X, GRID_Y) for place in ((0, 0, 2.0), upper)]
    flat_earth = -4 * np.pi * (ranges[0] - ranges[1]) / 0.0214
    np.testing.assert_allclose(dem.phase, unwrapped["phase"].values - 5.0 + flat_earth, atol=1e-9)


def test_a_rail_beside_and_before_the_origin_is_inverted_from_its_own_place(ideal_phase):
    lower, upper = (0.7, -0.5, 1.9), (0.7, -0.4, 2.2)
    unwrapped, images = ideal_phase(hill, X, Y, lower=lower, upper=upper)
    dem = height.invert(unwrapped, images, np.zeros(GRID_X.shape))
    # Linear interpolation along y over 5 cm: 0.2 / 0.09 x 0.05^2 / 8 < 1 mm.
    inside = GRID_Y < 10.8
    error = np.abs(dem.height - hill(GRID_X, GRID_Y))[inside]
    assert error.max() < 1e-3


def test_cells_without_a_height_are_logged(ideal_phase, caplog):
    unwrapped, images = ideal_phase(flat, X, Y)
    unwrapped["phase"].values[:, 4] = 1e6
    with caplog.at_level(logging.INFO):
        dem = height.invert(unwrapped, images, np.zeros(GRID_X.shape))
    assert np.isnan(dem.height[:, 4]).all()
    assert "61 of 1281 cells of the DEM have no height" in caplog.text
