"""The true scene: terrain, reflectivity, facets."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from vinsar.simulation import scene
from vinsar.simulation.scene import Patch, SceneObject


def make(name="peaks", **changes):
    options = {
        "x_min_m": -2.5,
        "x_max_m": 2.5,
        "y_min_m": 10.0,
        "y_max_m": 16.0,
        "spacing_m": 0.02,
        "peak_height_m": 0.30,
        "reflectivity_offset": 0.5,
    }
    return scene.terrain(name, **(options | changes))


@pytest.fixture(scope="module")
def peaks():
    return make()


def local_maxima(values):
    inner = values[1:-1, 1:-1]
    around = [
        values[1 + down : values.shape[0] - 1 + down, 1 + across : values.shape[1] - 1 + across]
        for down in (-1, 0, 1)
        for across in (-1, 0, 1)
        if (down, across) != (0, 0)
    ]
    return inner[np.all([inner > neighbour for neighbour in around], axis=0)]


def test_peaks_agrees_with_its_published_values():
    # The highest top and the deepest hollow of the function, as its manual plots them.
    assert scene.peaks(-0.00932, 1.58137) == pytest.approx(8.10621, abs=1e-4)
    assert scene.peaks(0.22828, -1.62553) == pytest.approx(-6.55113, abs=1e-4)
    assert scene.peaks(0, 0) == pytest.approx(3 / np.e - 1 / (3 * np.e))


def test_terrain_peaks_at_30_cm_and_its_hollow_follows(peaks):
    height = peaks["height"].values
    # Between nodes 2 cm apart the raster misses at most curvature x spacing^2 / 4 < 1 mm.
    assert height.max() == pytest.approx(0.30, abs=1e-3)
    assert height.max() <= 0.30
    assert height.min() == pytest.approx(-0.30 * 6.55113 / 8.10621, abs=1e-3)


def test_terrain_has_three_tops_and_two_hollows(peaks):
    height = peaks["height"].values
    assert local_maxima(height).size == 3
    # A third minimum, between the tops, is a dent of 2 mm.
    hollows = np.sort(local_maxima(-height))[::-1]
    assert (hollows > 0.01).sum() == 2
    assert np.all(hollows[2:] < 0.003)


def test_the_highest_top_is_ahead_of_the_deepest_hollow(peaks):
    # The function's v grows away from the vehicle: top at v = 1.58, hollow at v = -1.63.
    height = peaks["height"]
    top, hollow = height.argmax(("y", "x")), height.argmin(("y", "x"))
    assert peaks["y"][top["y"]] == pytest.approx(13 + 1.58137, abs=0.02)
    assert peaks["y"][hollow["y"]] == pytest.approx(13 - 1.62553, abs=0.02)
    assert peaks["x"][hollow["x"]] == pytest.approx(0.22828 * 5 / 6, abs=0.02)


def test_reflectivity_is_height_plus_a_half(peaks):
    np.testing.assert_allclose(
        peaks["reflectivity"].values - peaks["height"].values, 0.5, rtol=1e-12
    )


def test_flat_terrain_is_flat_everywhere():
    terrain = make("flat", spacing_m=0.5)
    assert terrain["height"].shape == (13, 11)
    assert not terrain["height"].values.any()
    assert np.all(terrain["reflectivity"].values == 0.5)


def test_a_negative_reflectivity_is_refused_with_the_least_offset():
    with pytest.raises(ValueError, match=r"take 0\.24\d or more"):
        make(reflectivity_offset=0.1)


def test_a_spacing_that_does_not_divide_the_extent_is_refused():
    with pytest.raises(ValueError, match="not a multiple of the spacing"):
        make(spacing_m=0.07)


coefficients = st.floats(-3, 3)


@given(
    terms=st.tuples(coefficients, coefficients, coefficients, coefficients),
    points=st.lists(st.tuples(st.floats(-1, 1), st.floats(4, 7)), min_size=1, max_size=20),
)
def test_sample_reproduces_bilinear_functions(terms, points):
    a, b, c, d = terms
    x, y = np.linspace(-1, 1, 5), np.linspace(4, 7, 7)

    def surface(u, v):
        return a + b * u + c * v + d * u * v

    raster = xr.DataArray(surface(x[None, :], y[:, None]), dims=("y", "x"), coords={"x": x, "y": y})
    at = np.array(points)
    found = scene.sample(raster, at[:, 0], at[:, 1])
    np.testing.assert_allclose(found, surface(at[:, 0], at[:, 1]), atol=1e-11)


def test_sample_gives_the_edge_outside(peaks):
    height = peaks["height"]
    found = scene.sample(height, [-9.0, 0.0, 9.0], [10.0, 99.0, 16.0])
    expected = [height.values[0, 0], height.values[-1, 125], height.values[-1, -1]]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def cut(terrain, jitter, seed=1, size=0.03):
    return scene.facets(
        terrain, facet_size_m=size, facet_jitter=jitter, rng=np.random.default_rng(seed)
    )


def test_facets_tile_the_terrain_and_lie_on_it(peaks):
    facets = cut(peaks, 1.0)
    position = facets["facet_position"].values
    assert len(position) == round(5 / 0.03) * 200
    # A jitter of one full cell leaves each facet in its own cell.
    column = np.floor((position[:, 0] + 2.5) / 5 * 167).astype(int)
    row = np.floor((position[:, 1] - 10) / 6 * 200).astype(int)
    assert len(set(zip(row, column, strict=True))) == len(position)
    np.testing.assert_allclose(
        position[:, 2], scene.sample(peaks["height"], position[:, 0], position[:, 1])
    )
    # Both are bilinear on the same raster, so their sum rule survives the interpolation.
    np.testing.assert_allclose(facets["reflectivity"].values, position[:, 2] + 0.5, rtol=1e-9)


def test_facets_come_in_the_order_of_distance(peaks):
    assert np.all(np.diff(cut(peaks, 1.0)["facet_position"].values[:, 1]) >= 0)


def test_facets_are_the_same_for_the_same_seed_alone(peaks):
    first, again, other = cut(peaks, 1.0), cut(peaks, 1.0), cut(peaks, 1.0, seed=2)
    assert first.identical(again)
    assert not np.allclose(first["facet_position"], other["facet_position"])


@pytest.mark.parametrize("jitter", [0.0, 0.5, 1.0])
def test_jitter_is_the_full_width_of_a_uniform_displacement(jitter):
    terrain = make("flat", spacing_m=0.5)
    x = cut(terrain, jitter, size=0.05)["facet_position"].values[:, 0]
    offset = (x + 2.5) / 0.05 % 1 - 0.5
    # 12,000 draws come within 1e-3 of the ends of a uniform distribution, and not beyond it.
    assert np.abs(offset).max() == pytest.approx(jitter / 2, abs=1e-3)
    # Its standard deviation is width / sqrt(12), known here to 1 / sqrt(12000) of itself.
    assert offset.std() == pytest.approx(jitter / np.sqrt(12), rel=0.03, abs=1e-9)


def test_jitter_in_x_and_y_is_independent():
    position = cut(make("flat", spacing_m=0.5), 1.0, size=0.05)["facet_position"].values
    offset_x, offset_y = (position[:, 0] + 2.5) / 0.05 % 1, (position[:, 1] - 10) / 0.05 % 1
    # The correlation of n independent pairs scatters by 1 / sqrt(n); four of that.
    correlation = np.corrcoef(offset_x, offset_y)[0, 1]
    assert abs(correlation) < 4 / np.sqrt(len(position))


def test_facets_larger_than_the_terrain_are_one_facet():
    facets = cut(make("flat", spacing_m=0.5), 0.0, size=50.0)
    np.testing.assert_allclose(facets["facet_position"].values, [[0, 13, 0]], atol=1e-12)


OBJECT = TypeAdapter(SceneObject)


def rough(std_m=0.0, correlation_m=0.2, seed=3):
    return scene.roughness(
        x_min_m=-2.5,
        x_max_m=2.5,
        y_min_m=10.0,
        y_max_m=16.0,
        spacing_m=0.02,
        std_m=std_m,
        correlation_m=correlation_m,
        rng=np.random.default_rng(seed),
    )


def furnish(terrain, objects=(), patches=()):
    return scene.furnish(terrain, rough(), objects=objects, patches=patches)


def test_nothing_added_leaves_the_terrain_as_it_is(peaks):
    assert furnish(peaks).identical(peaks)


@pytest.mark.parametrize(
    ("shape", "inside", "outside", "volume"),
    [
        # Volumes by the textbook: a b h, pi r^2 h, and pi h (3 r^2 + h^2) / 6 for the cap.
        (
            {"shape": "box", "size_x_m": 0.6, "size_y_m": 0.2, "rotation_deg": 30, "height_m": 0.3},
            # Along the long side, 30 deg from x towards y.
            (0.28 * np.cos(np.pi / 6), 0.28 * np.sin(np.pi / 6), 0.3),
            (0.28 * np.cos(np.pi / 6), -0.28 * np.sin(np.pi / 6)),
            0.6 * 0.2 * 0.3,
        ),
        (
            {"shape": "stump", "diameter_m": 0.5, "height_m": 0.2},
            (0.17, 0.17, 0.2),
            (0.19, 0.19),
            np.pi * 0.25**2 * 0.2,
        ),
        (
            {"shape": "mound", "diameter_m": 0.8, "height_m": 0.2},
            # The sphere through edge and top has the radius (0.4^2 + 0.2^2) / 0.4 = 0.5 m.
            (0.3, 0.0, 0.4 - 0.3),
            (0.3, 0.3),
            np.pi * 0.2 * (3 * 0.4**2 + 0.2**2) / 6,
        ),
        (
            {"shape": "ditch", "size_x_m": 0.8, "size_y_m": 0.3, "depth_m": 0.4},
            (0.39, -0.14, -0.4),
            (0.39, -0.17),
            -0.8 * 0.3 * 0.4,
        ),
        (
            {"shape": "pit", "diameter_m": 0.5, "depth_m": 0.6},
            (-0.17, 0.17, -0.6),
            (-0.19, 0.19),
            -np.pi * 0.25**2 * 0.6,
        ),
    ],
)
def test_shapes_have_their_heights_and_volumes(shape, inside, outside, volume):
    made = OBJECT.validate_python({"x_m": 1.0, "y_m": 12.0} | shape)
    x, y, height = inside
    assert scene.relief(made, np.array(1.0 + x), np.array(12.0 + y)) == pytest.approx(height)
    assert scene.relief(made, np.array(1.0 + outside[0]), np.array(12.0 + outside[1])) == 0
    axis = (np.arange(-500, 500) + 0.5) * 1e-3
    raster = scene.relief(made, 1.0 + axis[None, :], 12.0 + axis[:, None])
    # Midpoints 1 mm apart: the rim's cells err at random, by 1e-3 of the volume at most.
    assert raster.sum() * 1e-6 == pytest.approx(volume, rel=2e-3)


def test_objects_stand_on_the_terrain_and_add_up(peaks):
    box = {"shape": "box", "x_m": 0, "y_m": 12, "size_x_m": 1, "size_y_m": 1, "height_m": 0.3}
    pit = {"shape": "pit", "x_m": 0, "y_m": 12, "diameter_m": 0.2, "depth_m": 0.1}
    objects = [OBJECT.validate_python(one) for one in (box, pit)]
    added = (furnish(peaks, objects=objects) - peaks)["height"]
    assert added.sel(x=0, y=12, method="nearest") == pytest.approx(0.2)
    assert added.sel(x=0.4, y=12.4, method="nearest") == pytest.approx(0.3)
    assert added.sel(x=0.6, y=12, method="nearest") == 0


def test_reflectivity_is_that_of_patches_and_objects_and_has_no_height():
    terrain = make("flat")
    place = {"x_m": 0, "y_m": 12, "size_x_m": 1, "size_y_m": 1}
    patch = Patch.model_validate(place | {"reflectivity": 2.0})
    pit = {"shape": "pit", "x_m": 0, "y_m": 12, "diameter_m": 0.4, "depth_m": 0.6}
    plain, bright = (OBJECT.validate_python(pit | extra) for extra in ({}, {"reflectivity": 3.0}))
    found = furnish(terrain, patches=[patch])
    assert found["height"].identical(terrain["height"])
    assert found["reflectivity"].sel(x=0.4, y=12.4, method="nearest") == 2
    assert found["reflectivity"].sel(x=0.6, y=12, method="nearest") == 0.5
    # An object without a reflectivity has that of the ground, whatever its depth.
    for one, expected in ((plain, 2.0), (bright, 3.0)):
        found = furnish(terrain, patches=[patch], objects=[one])["reflectivity"]
        assert found.sel(x=0, y=12, method="nearest") == expected


def test_roughness_has_its_spread_and_its_correlation():
    std, length = 0.02, 0.1
    height = rough(std, length)["height"].values
    # The field has some 5 * 6 / (2 pi (l / 2)^2) = 1900 independent cells, so that its standard
    # deviation is known to 1 / sqrt(2 * 1900) = 1.6 %; three times that.
    assert height.std() == pytest.approx(std, rel=0.05)
    for lag in (2, 5, 8):
        expected = np.exp(-((lag * 0.02 / length) ** 2))
        for pair in ((height[lag:], height[:-lag]), (height[:, lag:], height[:, :-lag])):
            assert (pair[0] * pair[1]).mean() / std**2 == pytest.approx(expected, abs=0.07)
    assert np.array_equal(height, rough(std, length)["height"])
    assert not np.allclose(height, rough(std, length, seed=4)["height"])


def test_roughness_is_added_to_the_terrain_and_leaves_its_reflectivity(peaks):
    field = rough(0.02, 0.3)
    found = scene.furnish(peaks, field, objects=(), patches=())
    np.testing.assert_allclose(found["height"] - peaks["height"], field["height"], atol=1e-12)
    assert found["reflectivity"].identical(peaks["reflectivity"])
    # A raster twice as fine has it in between.
    fine = scene.furnish(make("flat", spacing_m=0.01), field, objects=(), patches=())["height"]
    between = (field["height"].values[:, 1:] + field["height"].values[:, :-1]) / 2
    np.testing.assert_allclose(fine.values[::2, 1::2], between, atol=1e-12)


def test_walls_have_facets_by_their_surface_and_gentle_ground_by_its_area(peaks):
    box = {"shape": "box", "x_m": 0, "y_m": 12, "size_x_m": 1, "size_y_m": 0.6, "height_m": 0.3}
    terrain = furnish(make("flat", spacing_m=0.01), objects=[OBJECT.validate_python(box)])
    position = cut(terrain, 1.0)["facet_position"].values
    x, y, z = position.T
    wall = (z > 0.02) & (z < 0.28)
    # Four walls, one raster cell thick: perimeter times height over the area of a facet, known to
    # the root of the count.
    expected = 2 * (1 + 0.6) * 0.26 / 0.03**2
    assert wall.sum() == pytest.approx(expected, abs=4 * np.sqrt(expected))
    # The wall that faces the radar has its share, evenly from bottom to top.
    facing = z[wall & (np.abs(y - 11.7) < 0.011) & (np.abs(x) < 0.5)]
    expected = 0.26 / 0.03**2
    assert facing.size == pytest.approx(expected, abs=4 * np.sqrt(expected))
    assert facing.mean() == pytest.approx(0.15, abs=4 * 0.26 / np.sqrt(12 * facing.size))
    # Nothing of the peaks is a wall: one facet a cell.
    assert cut(peaks, 1.0).sizes["facet"] == 167 * 200


@pytest.mark.parametrize(
    ("height", "reflectivity"), [(np.full((2, 3), -0.4), None), (np.ones((2, 3)), np.zeros((2, 3)))]
)
def test_terrain_that_returns_no_echo_is_refused(height, reflectivity):
    x, y = np.arange(3.0), np.arange(2.0)
    with pytest.raises(ValueError, match="0 all over the scene"):
        scene.from_heights(x, y, height, reflectivity, reflectivity_offset=0.4)
