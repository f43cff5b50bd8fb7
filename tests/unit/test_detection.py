"""Obstacles and holes on heights and images that are made, not reconstructed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from vinsar.foundations import variables
from vinsar.processing import detection
from vinsar.processing.classification import SHADOW, UNCERTAIN_CYCLE, VALID
from vinsar.processing.detection import Detection

OPTIONS = {
    "threshold_m": 0.1,
    "noise_factor": 3.0,
    "minimum_area_m2": 0.02,
    "ground_window_m": None,
    "multilook_window_m": 0.25,
    "background_window_m": 3.0,
    "amplitude_threshold_db": 6.0,
}
X, Y = np.arange(-50, 51) * 0.04, 10 + np.arange(126) * 0.04
AHEAD, ACROSS = np.meshgrid(Y, X, indexing="ij")


@pytest.fixture(scope="module")
def detect(ideal_phase):
    """Detect on given heights, their standard deviation and class, and the image's power."""
    _, images = ideal_phase(lambda x, y: 0 * x + 0 * y, X, Y)
    rng = np.random.default_rng(5)
    speckle = rng.normal(size=(2, *ACROSS.shape)) @ np.eye(X.size) + 1j * rng.normal(
        size=(2, *ACROSS.shape)
    )

    def make(height, power=1.0, std=0.001, kind=VALID, **changes):
        zeros = np.zeros(height.shape)
        dem = variables.dataset(
            "dem",
            {
                "height": height,
                "height_std": zeros + std,
                "height_class": (zeros + kind).astype(np.int8),
                "image_height": zeros,
                "absolute_phase": zeros,
                "phase_offset": zeros,
            },
            {"x": X, "y": Y},
        )
        image = images.copy(deep=True)
        image["image"] = (image["image"].dims, speckle * np.sqrt(power), image["image"].attrs)
        return detection.detect(dem, image, options=Detection.model_validate(OPTIONS | changes))

    return make


def inside(x, y, size_x, size_y):
    return (np.abs(ACROSS - x) <= size_x / 2 + 1e-9) & (np.abs(AHEAD - y) <= size_y / 2 + 1e-9)


@pytest.mark.parametrize("rise", [0.2, -0.15])
def test_a_box_or_a_hole_is_found_with_its_place_extent_and_height(detect, rise):
    noise = np.random.default_rng(1).normal(scale=0.005, size=ACROSS.shape)
    # On ground that slopes by 3 % ahead and 2 % across, and lies deeper.
    slope = 0.03 * (AHEAD - 12) + 0.02 * ACROSS - 0.3
    box = inside(0.8, 12.4, 0.4, 0.6)
    found = detect(noise + slope + rise * box)
    assert found.sizes["detection"] == 1
    one = found.isel(detection=0)
    assert one["detected_x"] == pytest.approx(0.8, abs=0.04)
    assert one["detected_y"] == pytest.approx(12.4, abs=0.04)
    # Nodes on both edges belong to it: a cell more than the box.
    assert one["extent_x"] == pytest.approx(0.4, abs=0.041)
    assert one["extent_y"] == pytest.approx(0.6, abs=0.041)
    assert one["detected_area"] == pytest.approx(box.sum() * 0.04**2)
    # What a tenth of the cells exceeds lies 1.28 standard deviations above the mean.
    assert abs(one["detected_height"]) == pytest.approx(abs(rise) + 1.28 * 0.005, abs=0.002)
    assert np.sign(one["detected_height"]) == np.sign(rise)
    expected = np.where(box, detection.OBSTACLE if rise > 0 else detection.HOLE, detection.FREE)
    if rise > 0:
        # Half of a window of 0.25 m: a cell on each side.
        beside = inside(0.8, 12.4, 0.4 + 0.08, 0.6 + 0.08) & ~box
        expected = np.where(beside, detection.UNKNOWN, expected)
    np.testing.assert_array_equal(found["map_class"], expected)
    np.testing.assert_allclose(found["ground"], slope, atol=1e-3)


@pytest.mark.parametrize("factor", [1.5, 2.5])
def test_noise_alone_gives_the_expected_rate_of_alarms(detect, factor):
    sigma = 0.01
    noise = np.random.default_rng(2).normal(size=ACROSS.shape) * sigma
    found = detect(noise, std=sigma, noise_factor=factor)
    rate = float((found["significant_height"] != 0).mean())
    expected = 2 * norm.sf(factor)
    # Binomial scatter, four of it, and 1 % of the noise in the exponent.
    count = ACROSS.size
    slack = 2 * 0.01 * factor * norm.pdf(factor)
    assert rate == pytest.approx(expected, abs=4 * np.sqrt(expected / count) + slack)


def test_what_is_not_valid_is_unknown_whatever_its_height(detect):
    lost = inside(0, 12, 1.2, 1.6)
    height = np.where(inside(0, 12, 0.6, 0.6), 0.4, 0.0)
    found = detect(height, kind=np.where(lost, SHADOW, VALID))
    kind = found["map_class"].values
    assert found.sizes["detection"] == 0
    # With the rim of a hole, a window of 0.25 m around it.
    unknown = inside(0, 12, 1.2 + 0.24, 1.6 + 0.24)
    np.testing.assert_array_equal(kind == detection.UNKNOWN, unknown)
    assert (kind[~unknown] == detection.FREE).all()


def test_the_rim_of_a_hole_is_unknown_and_that_of_a_cast_shadow_is_not(detect):
    hole, cast = inside(-1, 12, 0.6, 0.6), inside(1, 12.4, 0.4, 0.8)
    box, folded = inside(1, 11.88, 0.4, 0.2), inside(0, 14, 0.4, 0.4)
    behind = inside(0, 14.4, 0.4, 0.36)
    classes = np.select([hole | cast | behind, folded], [SHADOW, UNCERTAIN_CYCLE], VALID)
    kind = detect(np.where(box, 0.3, 0.0), kind=classes)["map_class"].values
    assert (kind[inside(-1, 12, 0.6 + 0.24, 0.6 + 0.24)] == detection.UNKNOWN).all()
    # What an obstacle casts, and what a lost cycle does, have sharp edges.
    assert (kind[box] == detection.OBSTACLE).all()
    far = inside(1, 12.6, 0.5, 0.5) & ~cast
    assert (kind[far] == detection.FREE).all()
    # One and a half windows around a lost cycle: four cells on each side.
    assert (kind[inside(0, 14, 0.4 + 0.32, 0.4 + 0.32)] == detection.UNKNOWN).all()
    assert (kind[inside(0, 14.5, 0.6, 0.16) & ~behind] == detection.FREE).all()


def test_without_valid_heights_everything_is_unknown(detect, caplog):
    found = detect(np.zeros(ACROSS.shape), kind=UNCERTAIN_CYCLE)
    assert (found["map_class"] == detection.UNKNOWN).all()
    assert found.sizes["detection"] == 0
    assert "fewer than three heights are valid" in caplog.text


def test_ground_too_noisy_to_tell_is_unknown_and_a_tall_obstacle_on_it_is_one(detect):
    noisy = inside(-1, 12, 1.0, 1.0)
    tall = inside(-1, 12, 0.4, 0.4)
    # Three standard deviations are 0.15 m: above 0.1, below 0.5 m.
    found = detect(np.where(tall, 0.5, 0.0), std=np.where(noisy, 0.05, 0.001))
    kind = found["map_class"].values
    assert (kind[tall] == detection.OBSTACLE).all()
    assert (kind[noisy & ~tall] == detection.UNKNOWN).all()
    assert (kind[~noisy] == detection.FREE).all()


def test_a_bright_patch_alarms_the_image_and_not_the_heights(detect):
    patch = inside(1, 13, 0.6, 0.6)
    found = detect(np.zeros(ACROSS.shape), power=np.where(patch, 16.0, 1.0))
    bright = found["bright"].values
    assert bright[patch].mean() > 0.8
    assert not bright[~inside(1, 13, 0.9, 0.9)].any()
    assert found["contrast"].values[patch].mean() == pytest.approx(16, rel=0.3)
    assert not np.isin(found["map_class"], [detection.OBSTACLE, detection.HOLE]).any()


def test_the_plane_does_not_bend_under_objects_and_the_median_follows_rolling_ground():
    plane = 0.1 + 0.02 * ACROSS - 0.01 * (AHEAD - 10)
    # Objects on an eighth of the ground, on one side of it, and a gap in what is known.
    height = np.where((ACROSS > 0) & (AHEAD % 1 < 0.25), plane + 0.3, plane)
    height[:3, :40] = np.nan
    np.testing.assert_allclose(detection.ground(height, X, Y, None), plane, atol=1e-3)
    rolling = 0.3 * np.sin(2 * np.pi * AHEAD / 5)
    box = inside(0, 12.5, 0.4, 0.4)
    found = detection.ground(rolling + 0.2 * box, X, Y, 1.0)
    # The median of a window of 1 m errs by the curvature, 0.3 (2 pi / 5)^2 / 24 x 1 m^2 = 2 cm, and
    # by the box, a sixth of the window: a twelfth of what the slope of 0.38 rises in it, 3 cm.
    assert np.abs(found - rolling)[15:-15].max() < 0.05
    assert np.abs(detection.ground(rolling, X, Y, None) - rolling).max() > 0.2
    assert np.isnan(detection.ground(np.full((4, 4), np.nan), X[:4], Y[:4], None)).all()


def test_the_running_median_is_the_median_of_its_window():
    values = np.random.default_rng(3).normal(size=(40, 30))
    values[values > 1.5] = np.nan
    found = detection.running_median(values, (7, 7))
    for row, column in ((0, 0), (20, 11), (39, 29), (5, 28)):
        part = values[max(0, row - 3) : row + 4, max(0, column - 3) : column + 4]
        assert found[row, column] == np.nanmedian(part)
    empty = values.copy()
    empty[:20, :15] = np.nan
    assert detection.running_median(empty, (7, 7))[3, 3] == np.nanmedian(empty)


def test_regions_are_connected_over_corners_and_large_enough():
    mask = np.zeros((6, 8), bool)
    mask[0, 0] = mask[1, 1] = mask[2, 2] = True
    mask[0, 6:] = True
    areas, count = detection.regions(mask, 3)
    assert count == 1
    assert (areas == np.diag([1, 1, 1, 0, 0, 0, 0, 0])[:6]).all()
    areas, count = detection.regions(mask, 2)
    assert count == 2
    assert set(areas[0, 6:]) == {2}
    assert detection.regions(~mask & mask, 1)[1] == 0
