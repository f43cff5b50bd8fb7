"""Statistics of height errors, on numbers worked out by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vinsar.evaluation import accuracy
from vinsar.foundations import variables

COORDS = {"x": np.arange(4.0), "y": np.arange(2.0)}


def dem(height, std=0.02, kind=0):
    zeros = np.zeros_like(height)
    return variables.dataset(
        "dem",
        {
            "height": height,
            "height_std": zeros + std,
            "height_class": (zeros + kind).astype(np.int8),
            "image_height": zeros,
            "absolute_phase": zeros,
            "phase_offset": zeros,
        },
        COORDS,
    )


def truth(height, shadow):
    return variables.dataset(
        "truth",
        {
            "height": height,
            "reflectivity": np.ones_like(height),
            "visible_fraction": np.ones((2, *height.shape)),
            "shadow": shadow,
        },
        COORDS,
    )


def test_statistics_of_five_errors():
    found = accuracy.statistics(np.array([-0.04, 0.01, 0.02, 0.03, 0.08]), 0.04)
    assert found == pytest.approx(
        {
            "mean": 0.02,
            "std": np.sqrt((36 + 1 + 0 + 1 + 36) / 5) / 100,
            "median": 0.02,
            "mad": 0.01,
            # 90 and 95 % of the way from the first to the last of 0.01 0.02 0.03 0.04 0.08.
            "percentile_90_absolute": 0.04 + 0.6 * 0.04,
            "percentile_95_absolute": 0.04 + 0.8 * 0.04,
            "maximum_absolute": 0.08,
            "fraction_within_tolerance": 0.8,
            "fraction_reconstructed": 1.0,
            "cell_count": 5,
        }
    )


def test_cells_without_a_height_count_as_not_within():
    found = accuracy.statistics(np.array([0.0, 0.02, np.nan, np.nan]), 0.05)
    assert found["mean"] == pytest.approx(0.01)
    assert found["maximum_absolute"] == pytest.approx(0.02)
    assert found["fraction_within_tolerance"] == 0.5
    assert found["fraction_reconstructed"] == 0.5
    assert found["cell_count"] == 4


@pytest.mark.parametrize("error", [np.array([]), np.array([np.nan, np.nan])])
def test_where_there_is_nothing_to_count_statistics_are_nan(error):
    found = accuracy.statistics(error, 0.05)
    assert np.isnan([found["mean"], found["std"], found["maximum_absolute"]]).all()
    assert found["cell_count"] == error.size
    np.testing.assert_equal(found["fraction_reconstructed"], 0.0 if error.size else np.nan)


@pytest.fixture
def scored():
    height = np.array([[0.0, 0.0, 0.5, np.nan], [1.0, 1.0, 1.0, np.nan]])
    shadow = np.array([[False, True, True, False], [False, False, False, False]])
    error = np.array([[0.01, 0.30, np.nan, 9.0], [-0.01, np.nan, 0.06, 9.0]])
    return accuracy.evaluate(
        dem(np.where(np.isnan(height), 9.0, height + error), kind=[[0, 0, 1, 0], [0, 2, 4, 5]]),
        truth(height, shadow),
        tolerance_m=0.05,
    )


def test_errors_are_reconstructed_minus_true(scored):
    expected = [[0.01, 0.30, np.nan, np.nan], [-0.01, np.nan, 0.06, np.nan]]
    np.testing.assert_allclose(scored["height_error"].values, expected, atol=1e-12)


def test_regions_split_the_scene_by_shadow_and_leave_out_what_is_beyond(scored):
    expected = ["whole_scene", "visible_ground", "shadow", "delivered"]
    assert scored["region"].values.tolist() == expected
    assert scored["cell_count"].values.tolist() == [6, 4, 2, 3]
    np.testing.assert_allclose(scored["fraction_reconstructed"], [4 / 6, 3 / 4, 1 / 2, 1])
    np.testing.assert_allclose(scored["fraction_within_tolerance"], [2 / 6, 2 / 4, 0, 2 / 3])
    np.testing.assert_allclose(scored["mean"], [0.09, 0.02, 0.30, 0.10])
    np.testing.assert_allclose(scored["maximum_absolute"], [0.30, 0.06, 0.30, 0.30])
    np.testing.assert_allclose(scored["share_of_scene"], [1, 4 / 6, 2 / 6, 3 / 6])
    assert float(scored["tolerance"]) == 0.05


def test_what_is_promised_is_held_against_the_errors(scored):
    # Errors of 0.01, 0.30, -0.01 and 0.06 at a standard deviation of 0.02.
    np.testing.assert_allclose(scored["coverage_1_sigma"], [2 / 4, 2 / 3, 0, 2 / 3])
    found = accuracy.coverage(np.array([0.02, -0.03, 0.05, np.nan]), np.full(4, 0.02))
    assert found == {"coverage_1_sigma": pytest.approx(1 / 3), "coverage_2_sigma": 2 / 3}
    assert np.isnan(list(accuracy.coverage(np.array([np.nan]), np.ones(1)).values())).all()


def test_fifths_by_standard_deviation_hold_as_many_cells_each():
    std = np.arange(1.0, 11.0)
    found = accuracy.calibration(np.append(std[::-1], np.nan)[::-1], np.append(np.nan, std))
    np.testing.assert_allclose(
        found["binned_std"], np.sqrt(np.arange(1, 10, 2) ** 2 / 2 + np.arange(2, 11, 2) ** 2 / 2)
    )
    np.testing.assert_allclose(found["binned_error"], found["binned_std"])
    np.testing.assert_array_equal(found["binned_coverage"], 1)
    few = accuracy.calibration(np.zeros(3), np.ones(3))
    assert np.isnan(few["binned_coverage"]).all()


def test_hidden_ground_that_is_delivered_and_visible_ground_that_is_not():
    shadow = np.zeros((5, 6), bool)
    shadow[1:4, 1:] = True
    kind = np.zeros(shadow.shape)
    # A cell or more inside: the middle row, from its second cell to the edge of the scene.
    kind[2, 2:4] = 1
    kind[0, :3] = 4
    coords = {"x": np.arange(6.0), "y": np.arange(5.0)}
    made = dem(np.zeros((2, 4)))
    made = variables.dataset(
        "dem",
        {name: np.zeros(shadow.shape) for name in made if name != "height_class"}
        | {"height_class": kind.astype(np.int8)},
        coords,
    )
    true = variables.dataset(
        "truth",
        {
            "height": np.zeros(shadow.shape),
            "reflectivity": np.ones(shadow.shape),
            "visible_fraction": np.ones((2, *shadow.shape)),
            "shadow": shadow,
        },
        coords,
    )
    found = accuracy.evaluate(made, true, tolerance_m=0.05)
    assert float(found["hidden_delivered"]) == pytest.approx(2 / 4)
    assert float(found["visible_withheld"]) == pytest.approx(3 / 15)


def test_grids_that_differ_are_refused():
    small = truth(np.zeros((2, 4)), np.zeros((2, 4), bool)).isel(x=slice(3))
    with pytest.raises(ValueError, match=r"x runs from 0 to 3 m in 4 cells, .* in 3"):
        accuracy.evaluate(dem(np.zeros((2, 4))), small, tolerance_m=0.05)


def test_grids_of_one_shape_at_other_places_are_refused():
    moved = truth(np.zeros((2, 4)), np.zeros((2, 4), bool)).assign_coords(x=np.arange(4.0) + 1)
    with pytest.raises(ValueError, match=r"DEM|grid"):
        accuracy.evaluate(dem(np.zeros((2, 4))), moved, tolerance_m=0.05)


def test_summary_is_json_with_units_and_null_where_undefined():
    height, nothing = np.zeros((2, 4)), np.zeros((2, 4), bool)
    scored = accuracy.evaluate(dem(height + 0.02), truth(height, nothing), tolerance_m=0.05)
    found = json.loads(json.dumps(accuracy.summary(scored), allow_nan=False))
    assert found["tolerance_m"] == 0.05
    assert found["whole_scene"]["mean_error_m"] == pytest.approx(0.02)
    assert found["whole_scene"]["cell_count"] == 8
    assert found["shadow"]["cell_count"] == 0
    assert found["shadow"]["std_error_m"] is None
    assert found["shadow"]["fraction_within_tolerance"] is None
    assert found["delivered"]["share_of_scene"] == 1
    assert found["hidden_delivered"] is None
    assert set(found) == {
        "tolerance_m", "hidden_delivered", "visible_withheld", *accuracy.REGIONS
    }  # fmt: skip
