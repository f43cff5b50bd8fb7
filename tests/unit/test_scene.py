"""The true scene: terrain, reflectivity, facets."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from vinsar import scene


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
