"""Occlusion (Eqs. 8-9) against rays marched through the terrain, and against triangles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vinsar.foundations import variables
from vinsar.simulation import scene, visibility

SPACING = 0.025
# As far apart as the rail's ends and the two antennas are.
ANTENNAS = np.array([[x, 0.0, z] for x in (-0.4, 0.0, 0.4) for z in (1.2, 2.0)])


def raster(height, spacing=SPACING, first_x=-2.5, first_y=10.0):
    rows, columns = height.shape
    return variables.dataset(
        "terrain",
        {"height": height, "reflectivity": np.ones_like(height)},
        {"x": first_x + spacing * np.arange(columns), "y": first_y + spacing * np.arange(rows)},
    )


def bilinear(terrain, x, y):
    height = terrain["height"].values
    columns, rows = terrain["x"].values, terrain["y"].values
    u = np.clip((x - columns[0]) / (columns[1] - columns[0]), 0, columns.size - 1)
    v = np.clip((y - rows[0]) / (rows[1] - rows[0]), 0, rows.size - 1)
    i, j = np.minimum(u.astype(int), columns.size - 2), np.minimum(v.astype(int), rows.size - 2)
    u, v = u - i, v - j
    near = height[j, i] * (1 - u) + height[j, i + 1] * u
    far = height[j + 1, i] * (1 - u) + height[j + 1, i + 1] * u
    return near * (1 - v) + far * v


def march(terrain, antenna, points):
    """Follow the straight line from antenna to point in steps of half a raster row.

    Terrain within a row of the point does not hide it, as `visibility` has it too.
    """
    y = terrain["y"].values
    steps = np.arange(y[0], y[-1], (y[1] - y[0]) / 2)
    part = (steps[None, :] - antenna[1]) / (points[:, 1:2] - antenna[1])
    line = antenna[None, None, :] + part[..., None] * (points[:, None, :] - antenna)
    ground = bilinear(terrain, line[..., 0], line[..., 1])
    before = steps[None, :] < points[:, 1:2] - (y[1] - y[0])
    return ~np.any(before & (ground > line[..., 2] + 1e-9), axis=1)


def random_points(terrain, count, seed=0):
    rng = np.random.default_rng(seed)
    x, y = terrain["x"].values, terrain["y"].values
    place_x = rng.uniform(x[0], x[-1], count)
    place_y = np.sort(rng.uniform(y[0], y[-1], count))
    return np.stack([place_x, place_y, bilinear(terrain, place_x, place_y)], axis=1)


@pytest.fixture(scope="module")
def peaks():
    """The paper's terrain on its raster of 1 cm."""
    return scene.terrain(
        "peaks", x_min_m=-2.5, x_max_m=2.5, y_min_m=10.0, y_max_m=16.0, spacing_m=0.01,
        peak_height_m=0.30, reflectivity_offset=0.5,
    )  # fmt: skip


@pytest.fixture(scope="module")
def boxes():
    height = np.zeros((241, 201))
    for row, column, side, top in ((40, 60, 20, 0.4), (90, 120, 30, 0.25), (150, 40, 24, 0.6)):
        height[row : row + side, column : column + side] = top
    return raster(height)


def compare(terrain, antennas, seed):
    points = random_points(terrain, 2500, seed)
    fan = visibility.visible_points(terrain, antennas, points)
    marched = np.array([march(terrain, antenna, points) for antenna in antennas])
    assert 0.03 < 1 - marched.mean() < 0.5, "the scene must have shadows to be a test"
    spacing = terrain["y"].values[1] - terrain["y"].values[0]
    offsets = 2 * spacing * np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)])
    places = []
    for index, point in zip(*np.nonzero(fan != marched), strict=True):
        around = points[point, :2] + offsets
        around = np.column_stack([around, bilinear(terrain, *around.T)])
        verdicts = march(terrain, antennas[index], around)
        places.append((np.ptp(verdicts.astype(int)) == 1, np.ptp(around[:, 2])))
    return (fan == marched).mean(), places


def test_on_smooth_terrain_the_fan_agrees_with_rays_marched_one_by_one(peaks):
    antennas = np.array([[-0.4, 0.0, 1.8], [0.0, 0.0, 2.0], [0.3, 0.0, 2.3], [0.4, 0.0, 2.0]])
    agreement, places = compare(peaks, antennas, seed=0)
    assert agreement >= 0.9995
    # Where they differ, a shadow ends within two cells.
    assert all(verdict_changes for verdict_changes, _ in places)


def test_on_boxes_they_differ_only_within_two_cells_of_an_edge(boxes):
    # The last antenna stands beside the terrain: its rays enter it from the side.
    agreement, places = compare(boxes, np.vstack([ANTENNAS, [-4.0, 0.0, 2.0]]), seed=1)
    # Boxes and shadows have some 20 m of edges on 30 m^2: a band of half a cell (12 mm) is 0.8 %.
    assert agreement >= 0.992
    assert all(verdict_changes or step > 0.1 for verdict_changes, step in places)


def test_a_level_plane_is_wholly_visible():
    terrain = raster(np.zeros((61, 51)), spacing=0.1)
    points = random_points(terrain, 2000)
    assert visibility.visible_points(terrain, ANTENNAS, points).all()


@given(along=st.floats(-0.05, 0.5), across=st.floats(-0.2, 0.2))
def test_a_plane_that_faces_the_antenna_is_wholly_visible(along, across):
    x, y = -2.5 + 0.25 * np.arange(21), 0.25 * np.arange(25)
    terrain = raster(along * y[:, None] + across * x[None, :] / 2.5, spacing=0.25)
    antenna = np.array([[0.1, 0.0, 2.0]])
    assert visibility.visible_points(terrain, antenna, random_points(terrain, 300)).all()


def test_a_plane_that_falls_away_is_hidden_behind_its_edge():
    # From 2 m up at 10 m, anything steeper than 1 in 5 falls behind the first row's ray.
    terrain = raster(np.tile(-0.5 * 0.1 * np.arange(61)[:, None], (1, 51)), spacing=0.1)
    points = random_points(terrain, 500)
    seen = visibility.visible_points(terrain, np.array([[0.0, 0.0, 2.0]]), points)[0]
    assert not seen[points[:, 1] > 10.2].any()


@pytest.mark.parametrize(("top", "level"), [(0.5, 2.0), (1.0, 2.0), (0.3, 1.2)])
def test_a_wall_hides_the_length_that_similar_triangles_predict(top, level):
    height = np.zeros((241, 201))
    height[40:44] = top
    terrain = raster(height)
    back = terrain["y"].values[43]
    end = back * level / (level - top)
    ground = np.stack([np.full(2000, 0.3), np.linspace(10, 16, 2000), np.zeros(2000)], axis=1)
    antennas = np.array([[-0.4, 0.0, level], [0.2, 0.0, level]])
    in_front = ground[:, 1] < 10 + 39 * SPACING
    # Terrain within a row or two of a point does not hide it, and the wall's back is a ramp.
    hidden = (ground[:, 1] > back + 3 * SPACING) & (ground[:, 1] < end - 1e-6)
    beyond = ground[:, 1] > end + 1e-6
    assert hidden.sum() > 100
    for seen in visibility.visible_points(terrain, antennas, ground):
        assert seen[in_front].all()
        assert not seen[hidden].any()
        assert seen[beyond].all()


def test_a_shadow_is_thrown_away_from_each_antenna():
    height = np.zeros((241, 201))
    height[40:50, 90:111] = 0.6
    terrain = raster(height)
    antennas = np.array([[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0]])
    # 1.5 m behind the box the rays of either antenna have crossed over by 0.27 m.
    points = np.array([[-0.4, 12.7, 0.0], [0.4, 12.7, 0.0]])
    seen = visibility.visible_points(terrain, antennas, points)
    assert seen.tolist() == [[True, False], [False, True]]


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), level=st.floats(0.6, 3), rise=st.floats(0.01, 2))
def test_what_an_antenna_sees_a_higher_one_sees_too(seed, level, rise):
    # The higher one's line of sight lies above the lower one's all the way to the point.
    rng = np.random.default_rng(seed)
    terrain = raster(rng.uniform(0, 0.5, (13, 11)), spacing=0.5)
    antennas = np.array([[0.2, 0.0, level], [0.2, 0.0, level + rise]])
    low, high = visibility.visible_points(terrain, antennas, random_points(terrain, 300, seed))
    assert not np.any(low & ~high)
