"""The public face of visibility: channels, truth on a grid, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations import variables
from vinsar.simulation import echo, scene, visibility


@pytest.fixture(scope="module")
def terrain():
    """Level ground with a wall across it at y = 11 m, 0.25 m high."""
    y = 10 + 0.05 * np.arange(81)
    x = -1 + 0.05 * np.arange(41)
    height = np.zeros((y.size, x.size))
    height[20:22] = 0.25
    return variables.dataset(
        "terrain", {"height": height, "reflectivity": height + 0.5}, {"x": x, "y": y}
    )


@pytest.fixture(scope="module")
def facets(terrain):
    return scene.facets(terrain, facet_size_m=0.1, facet_jitter=1.0, rng=np.random.default_rng(3))


@pytest.fixture(scope="module")
def seen(terrain, facets, rail):
    return visibility.facet_visibility(terrain, facets, rail)


def test_the_higher_antenna_sees_further_over_the_wall(seen):
    share = seen["visible"].mean(("position", "facet"))
    assert share.sel(channel="lower") < share.sel(channel="upper")
    # The shadows are 1.58 and 1.35 of the scene's 4 m long, a facet's row more or less.
    assert share.sel(channel="lower") == pytest.approx(1 - 1.58 / 4, abs=0.03)
    assert share.sel(channel="upper") == pytest.approx(1 - 1.35 / 4, abs=0.03)


def test_facets_in_the_dark_add_nothing_to_the_echo(seen, facets, rail):
    frequency = np.linspace(13e9, 15e9, 5)
    options = {"frequency": frequency, "accuracy_db": None}
    antennas = rail.isel(position=slice(0, 3))
    # Ground behind the wall, out of sight for the lower antenna at every position.
    dark = ~seen["visible"].values[0].any(axis=0)
    assert dark.sum() > 50
    masked = echo.simulate(facets, antennas, seen.isel(position=slice(0, 3)), **options)
    zeroed = facets.assign(reflectivity=facets["reflectivity"].where(~dark, 0.0))
    unmasked = echo.simulate(zeroed, antennas, seen.isel(position=slice(0, 3)), **options)
    lower, same = masked["echo"].values[0], unmasked["echo"].values[0]
    np.testing.assert_allclose(same, lower, rtol=1e-12)
    # And without visibility they do add.
    assert not np.allclose(echo.simulate(facets, antennas, **options)["echo"].values[0], lower)


def test_a_bistatic_channel_sees_what_both_its_ends_see(terrain, facets, rail):
    points = facets["facet_position"].values
    lower = rail["transmitter"].sel(channel="lower").values
    upper = rail["transmitter"].sel(channel="upper").values
    crossed = variables.dataset(
        "trajectory",
        {"transmitter": np.stack([lower, upper]), "receiver": np.stack([upper, lower])},
    )
    found = visibility.channel_visibility(terrain, crossed, points)
    by_lower = visibility.visible_points(terrain, lower, points)
    by_upper = visibility.visible_points(terrain, upper, points)
    np.testing.assert_array_equal(found, [by_lower & by_upper, by_lower & by_upper])


@pytest.mark.parametrize("y", [10.0, 12.0])
def test_an_antenna_inside_the_terrain_is_refused(terrain, facets, y):
    antennas = np.array([[0.0, 0.0, 2.0], [0.0, y, 2.0]])
    with pytest.raises(ValueError, match=f"y = {y:.3f} m is not before the terrain"):
        visibility.visible_points(terrain, antennas, facets["facet_position"].values)


def test_points_out_of_order_are_refused(terrain):
    points = np.array([[0.0, 12.0, 0.0], [0.0, 11.0, 0.0]])
    with pytest.raises(ValueError, match="not sorted by y"):
        visibility.visible_points(terrain, np.array([[0.0, 0.0, 2.0]]), points)


def test_truth_holds_heights_on_the_grid_and_nan_beyond_the_terrain(terrain, rail):
    x, y = np.array([-1.5, -1.0, 0.0, 1.0]), np.array([9.95, 10.0, 11.025, 14.0, 14.05])
    truth = visibility.truth_on_grid(terrain, rail, x, y)
    inside = np.isfinite(truth["height"].values)
    np.testing.assert_array_equal(inside[:, 0], False)
    np.testing.assert_array_equal(inside[:, 2], [False, True, True, True, False])
    np.testing.assert_allclose(truth["height"].values[1:4, 2], [0, 0.25, 0])
    np.testing.assert_allclose(truth["reflectivity"].values[1:4, 2], [0.5, 0.75, 0.5])
    np.testing.assert_array_equal(np.isfinite(truth["reflectivity"].values), inside)
    assert not truth["shadow"].values[~inside].any()


def test_truth_marks_as_shadow_what_either_antenna_mostly_misses(terrain, rail):
    # The wall's back at 11.05 m throws a shadow to 12.63 m from 2.0 m and to 12.40 m from 2.3 m.
    y = np.array([10.5, 11.8, 12.35, 12.5, 12.7])
    truth = visibility.truth_on_grid(terrain, rail, np.array([0.0, 0.1]), y)
    seen = truth["visible_fraction"].values[:, :, 0]
    np.testing.assert_array_equal(seen, [[1, 0, 0, 0, 1], [1, 0, 0, 1, 1]])
    assert truth["shadow"].values[:, 0].tolist() == [False, True, True, True, False]


def march(terrain, antenna, points):
    """Follow each line of sight over the raster's rows, but not the one just before the point."""
    x, y = terrain["x"].values, terrain["y"].values
    height = terrain["height"].values
    ahead = y[None, :] - antenna[1]
    distance = points[:, 1:2] - antenna[1]
    column = antenna[0] + (points[:, :1] - antenna[0]) * ahead / distance
    line = antenna[2] + (points[:, 2:] - antenna[2]) * ahead / distance
    ground = np.stack([np.interp(column[:, row], x, height[row]) for row in range(y.size)], axis=1)
    row = np.floor((points[:, 1:2] - y[0]) / (y[1] - y[0]))
    before = np.arange(y.size) < row
    return ~np.any(before & (ground > line), axis=1)


@pytest.mark.parametrize("kind", ["peaks", "boxes"])
def test_coarse_rasters_of_peaks_and_boxes_cast_the_shadows_of_a_march(kind):
    x, y = np.linspace(-2.5, 2.5, 200), np.linspace(10.0, 16.0, 240)
    rng = np.random.default_rng(2)
    if kind == "peaks":
        fine = scene.terrain(
            "peaks", x_min_m=-2.5, x_max_m=2.5, y_min_m=10.0, y_max_m=16.0, spacing_m=0.01,
            peak_height_m=0.3, reflectivity_offset=0.5,
        )  # fmt: skip
        height = scene.sample(fine["height"], *np.meshgrid(x, y))
    else:
        height = np.zeros((240, 200))
        for _ in range(25):
            row, column = rng.integers(0, 220), rng.integers(0, 180)
            tall, wide = rng.integers(8, 25, 2)
            height[row : row + tall, column : column + wide] = rng.uniform(0.1, 0.5)
    terrain = variables.dataset(
        "terrain", {"height": height, "reflectivity": height + 1}, {"x": x, "y": y}
    )
    place = rng.uniform([-2.5, 10.0], [2.5, 16.0], (20_000, 2))
    place = place[np.argsort(place[:, 1])]
    points = np.column_stack([place, scene.sample(terrain["height"], place[:, 0], place[:, 1])])
    antennas = np.array([[-0.4, 0.0, 2.0], [0.4, 0.0, 1.5]])
    found = visibility.visible_points(terrain, antennas, points)
    marched = np.array([march(terrain, antenna, points) for antenna in antennas])
    assert 0.5 < marched.mean() < 0.98
    assert (found == marched).mean() > 0.9995


def test_points_at_the_antenna_and_behind_it_do_no_harm(terrain):
    points = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 2.0], [0.0, 10.5, 0.0]])
    seen = visibility.visible_points(terrain, np.array([[0.0, 0.0, 2.0]]), points)
    assert seen[0, 2]
