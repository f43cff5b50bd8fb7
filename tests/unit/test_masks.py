"""Pixels without a value stay so, and no other pixel becomes one; islands have their own level."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import vinsar
from vinsar.foundations import variables
from vinsar.processing import (
    classification,
    cycles,
    filtering,
    height,
    interferogram,
    masks,
    unwrapping,
)

ROOT = Path(__file__).parents[2]
OPTIONS = {
    "goldstein_alpha": 0.8,
    "goldstein_patch_px": 16,
    "goldstein_step_px": 4,
    "boxcar_window_px": 5,
    "gaussian_std_px": 1.5,
}
SOLVERS = ("whirlwind", "skimage", "kamui")
NOTHING = (np.nan, np.inf, complex(1, np.nan))


def speckle(seed, shape):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).view(complex)[..., 0]


def unwrap(values, method, coherence=0.9):
    rows, columns = values.shape
    filtered = variables.dataset(
        "filtered",
        {"interferogram": np.asarray(values, np.complex64)},
        {"x": 0.1 * np.arange(columns), "y": 0.1 * np.arange(rows)},
    )
    weights = xr.DataArray(np.full(values.shape, coherence), dims=("y", "x"))
    return unwrapping.unwrap(filtered, weights, method=method, looks=4.0)


def spread(found, phase, where):
    """Return by how many cycles the level changes within a part of the image."""
    return np.ptp((found - phase)[where]) / (2 * np.pi)


shapes = st.tuples(st.integers(1, 24), st.integers(1, 24))


@given(
    method=st.sampled_from(list(filtering.FILTERS)),
    shape=shapes, seed=st.integers(0, 99), share=st.floats(0, 1), nothing=st.sampled_from(NOTHING),
)  # fmt: skip
def test_every_filter_leaves_nothing_where_there_was_nothing_and_nowhere_else(
    method, shape, seed, share, nothing
):
    values = speckle(seed, shape).astype(np.complex64)
    missing = np.random.default_rng(seed).random(shape) < share
    values[missing] = nothing
    found = filtering.smooth(values, method=method, **OPTIONS)
    assert found.shape == shape
    np.testing.assert_array_equal(np.isfinite(found), ~missing)


@given(
    method=st.sampled_from(list(filtering.FILTERS)), shape=shapes, phase=st.floats(-3, 3),
    seed=st.integers(0, 99), share=st.floats(0, 0.9),
)  # fmt: skip
def test_every_filter_keeps_a_constant_phase_around_what_is_missing(
    method, shape, phase, seed, share
):
    values = np.full(shape, np.exp(1j * phase), np.complex64)
    values[np.random.default_rng(seed).random(shape) < share] = np.nan
    known = np.isfinite(values)
    found = filtering.smooth(values, method=method, **OPTIONS)
    # Ten roundings of single precision; Goldstein's amplitude falls where little is known.
    np.testing.assert_allclose(np.angle(found[known] * np.exp(-1j * phase)), 0, atol=1e-4)


@pytest.mark.parametrize("method", ["boxcar", "gaussian"])
def test_an_average_is_over_the_pixels_that_are_known(method):
    values = speckle(1, (19, 23))
    values[np.random.default_rng(1).random(values.shape) < 0.3] = np.nan
    found = filtering.smooth(values, method=method, **OPTIONS)
    row, column = np.indices(values.shape)
    for at in np.argwhere(np.isfinite(values))[::17]:
        away = row - at[0], column - at[1]
        reach = 2 if method == "boxcar" else 6
        weight = (np.abs(away).max(axis=0) <= reach).astype(float)
        if method == "gaussian":
            weight *= np.exp(-(away[0] ** 2 + away[1] ** 2) / (2 * 1.5**2))
        weight[~np.isfinite(values)] = 0
        expected = np.nansum(weight * values) / weight.sum()
        assert found[tuple(at)] == pytest.approx(expected, abs=5e-6)


def test_goldstein_sees_what_is_missing_as_what_is_outside():
    values = speckle(2, (40, 44)).astype(np.complex64) + 2
    hole = np.s_[10:15, 20:29]
    missing, dark = values.copy(), values.copy()
    missing[hole], dark[hole] = np.nan, 0
    found, expected = (
        filtering.smooth(part, method="goldstein", **OPTIONS) for part in (missing, dark)
    )
    expected[hole] = np.nan
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("window", [1, 5])
def test_a_coherence_counts_the_pixels_that_both_images_have(window):
    lower, upper = speckle(3, (2, 14, 17))
    lower[4, 5], upper[9, 0] = np.nan, np.inf
    found = interferogram.coherence(lower, upper, window)
    missing = np.zeros(lower.shape, bool)
    missing[4, 5] = missing[9, 0] = True
    np.testing.assert_array_equal(np.isnan(found), missing)
    half = window // 2
    for row, column in np.argwhere(~missing):
        part = np.s_[max(0, row - half) : row + half + 1, max(0, column - half) : column + half + 1]
        a, b = (image[part][~missing[part]] for image in (lower, upper))
        exact = np.abs(np.vdot(b, a)) / np.sqrt((abs(a) ** 2).sum() * (abs(b) ** 2).sum())
        assert found[row, column] == pytest.approx(exact, abs=1e-12)


@settings(max_examples=120)
@given(
    method=st.sampled_from(SOLVERS), shape=shapes,
    slopes=st.tuples(st.floats(-3, 3), st.floats(-3, 3)), start=st.floats(-3, 3),
)  # fmt: skip
def test_a_ramp_of_any_size_and_slope_comes_back(method, shape, slopes, start):
    y, x = np.indices(shape)
    phase = start + slopes[0] * x + slopes[1] * y
    found = unwrap(np.exp(1j * phase), method)["phase"].values
    # Steps below half a cycle leave one solution.
    assert spread(found, phase, ...) < 1e-5


@settings(max_examples=120)
@given(
    method=st.sampled_from([name for name in unwrapping.UNWRAPPERS if name != "snaphu"]),
    shape=shapes, seed=st.integers(0, 99), share=st.floats(0, 1),
    nothing=st.sampled_from([0, *NOTHING]),
    slope=st.sampled_from([0.0, np.pi, 3.5, 40.0]) | st.none(),
)  # fmt: skip
def test_whatever_goes_in_comes_out_congruent_where_there_is_a_phase_and_nowhere_else(
    method, shape, seed, share, nothing, slope
):
    rng = np.random.default_rng(seed)
    phase = rng.uniform(-3, 3, shape) if slope is None else slope * np.indices(shape).sum(axis=0)
    values = np.exp(1j * phase).astype(np.complex64)
    missing = rng.random(shape) < share
    values[missing] = nothing
    found = unwrap(values, method)
    np.testing.assert_array_equal(np.isnan(found["phase"].values), missing)
    wrapped = np.angle(values.astype(complex))
    turns = (found["phase"].values - wrapped)[~missing] / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
    corners = missing[:-1, :-1] | missing[1:, :-1] | missing[:-1, 1:] | missing[1:, 1:]
    assert not found["residue"].values[:-1, :-1][corners].any()


BAD = {
    "one pixel": lambda y, x: (y == 7) & (x == 9),
    "a border": lambda y, x: (y < 6) | (y >= 34) | (x < 6) | (x >= 44),
    "a column": lambda y, x: (x == 25) & (y >= 0),
    "a cross": lambda y, x: (x == 25) | (y == 20),
    "a diagonal": lambda y, x: x == y,
    "a frame within": lambda y, x: np.maximum(abs(y - 20), abs(x - 25)) == 8,
}


@pytest.mark.parametrize("method", SOLVERS)
@pytest.mark.parametrize("nothing", [0, np.nan])
@pytest.mark.parametrize("bad", BAD)
def test_each_island_keeps_its_shape_beside_what_is_missing(method, nothing, bad):
    y, x = np.mgrid[:40, :50]
    phase = 0.3 * x + 0.4 * y + 0.02 * x * y
    missing = BAD[bad](y, x)
    values = np.exp(1j * phase)
    values[missing] = nothing
    found = unwrap(values, method)["phase"].values
    numbers, count = masks.islands(~missing)
    assert count == {"a column": 2, "a cross": 4, "a diagonal": 2, "a frame within": 2}.get(bad, 1)
    for number in range(1, count + 1):
        assert spread(found, phase, numbers == number) < 1e-5


def test_shorter_baselines_settle_the_cycles_around_what_is_missing():
    y, x = np.mgrid[:20, :30]
    told = 0.2 * x + 0.1 * y
    wrapped = np.angle(np.exp(1j * (told + 0.4)))
    wrapped[6:9, 12], wrapped[:, 20] = np.nan, np.nan
    for unwrapped in (False, True):
        found = cycles.settle(wrapped, told, window_px=(3, 3), unwrapped=unwrapped)
        np.testing.assert_array_equal(np.isnan(found), np.isnan(wrapped))
    found = cycles.settle(wrapped, told, window_px=(3, 3))
    known = np.isfinite(found)
    assert spread(found, told, known) < 1e-9
    nothing = cycles.settle(np.full((4, 5), np.nan), np.zeros((4, 5)), window_px=(3, 3))
    assert np.isnan(nothing).all()


X, Y = np.linspace(-1.0, 1.0, 41), np.linspace(9.0, 11.0, 51)


def test_each_island_takes_its_own_cycles_from_the_reference_on_it(ideal_phase):
    unwrapped, images = ideal_phase(lambda x, y: 0.02 * x + 0 * y, X, Y, constant=0.7)
    phase = unwrapped["phase"].values
    exact = height.phase_offset(unwrapped, images, height.level_ground(X, Y, [(-1, 1, 9, 9.2)], 0))
    moved = phase.copy()
    moved[:, 12], moved[:, 30], moved[25, :12] = np.nan, np.nan, np.nan
    moved[:25, :12] += 4 * np.pi
    moved[:, 31:] -= 6 * np.pi
    islands = unwrapped.assign(phase=(("y", "x"), moved, unwrapped["phase"].attrs))
    near = [(-1, 1, 9, 9.2)]
    for trend in ("constant", "plane"):
        offset = height.phase_offset(
            islands, images, height.level_ground(X, Y, near, 0), trend=trend
        )
        held = np.isfinite(moved)
        held[26:, :12] = False  # no reference on it
        found = (moved + offset - phase)[held]
        straight = height.phase_offset(
            unwrapped, images, height.level_ground(X, Y, near, 0), trend=trend
        )[held]
        # The fits differ by the points that are missing, which is far less than a cycle.
        np.testing.assert_allclose(found, straight, atol=0.3)
    assert np.ptp(exact) == 0


def test_a_reference_without_a_phase_is_refused(ideal_phase):
    unwrapped, images = ideal_phase(lambda x, y: 0 * x * y, X, Y)
    unwrapped["phase"].values[:12] = np.nan
    with pytest.raises(ValueError, match="none of the reference points lies where there is a"):
        height.phase_offset(unwrapped, images, height.level_ground(X, Y, [(-1, 1, 9, 9.2)], 0))


@settings(max_examples=20)
@given(
    seed=st.integers(0, 999), share=st.floats(0, 0.5), level=st.floats(-0.4, 0.4),
    turn=st.sampled_from([0.0, 0.2]),
)  # fmt: skip
def test_dem_coding_loses_the_pixels_that_are_missing_and_no_more(seed, share, level, turn):
    x, y = np.linspace(-1, 1, 9), np.linspace(8, 10, 33)
    missing = np.random.default_rng(seed).random((33, 9)) < share
    image = np.where(missing, np.nan, level)
    # All of it is shifted by the same part of a pixel.
    true_x = np.where(missing, np.nan, x + 0 * image)
    true_y = np.where(missing, np.nan, y[:, None] + turn * level)
    found = height.DemCoding(x, y, true_x=true_x, true_y=true_y)(image)
    inside = slice(2, -2)
    counted = np.isnan(found[inside]).sum(axis=0), missing[inside].sum(axis=0)
    # Both ends of the column are beyond its outermost pixel by up to two pixels of shift.
    assert np.abs(counted[0] - counted[1]).max() <= 4
    if turn == 0:
        edges = np.isnan(found) != missing
        first, last = (np.argmax(~side, axis=0) for side in (missing, missing[::-1]))
        for column in range(9):
            inner = slice(first[column], 33 - last[column])
            assert not edges[inner, column].any()


@pytest.fixture(scope="module")
def study():
    return vinsar.load(ROOT / "tests/workflow/tiny.yaml")


@pytest.fixture(scope="module")
def products(study):
    return vinsar.run(study, "detections")


def without(study, products, missing):
    """Return the products from images of which some pixels are missing."""
    image = products["images"]["image"]
    images = products["images"].assign(image=image.where(~missing, np.nan).astype(image.dtype))
    images["image"].attrs = image.attrs
    given = {n: products[n] for n in ("trajectory", "recorded_trajectory", "received", "profiles")}
    return vinsar.run(study, "detections", given={**given, "images": images})


def mask(products, rows, columns):
    missing = np.zeros(products["dem"]["height"].shape, bool)
    missing[rows, columns] = True
    return xr.DataArray(missing, dims=("y", "x"))


@pytest.mark.parametrize("method", list(filtering.FILTERS))
def test_pixels_that_are_missing_are_outside_and_cost_their_neighbours_nothing(
    study, products, method
):
    changed = study.model_copy(
        update={"filtering": study.filtering.model_copy(update={"method": method})}
    )
    missing = mask(products, 20, 9) | mask(products, slice(25, 28), slice(14, 16))
    found = without(changed, products, missing)
    for name, variable in (("interferogram", "coherence"), ("unwrapped", "phase")):
        np.testing.assert_array_equal(np.isnan(found[name][variable]), missing)
    dem = found["dem"]
    outside = dem["height_class"].values == classification.OUTSIDE
    np.testing.assert_array_equal(np.isnan(dem["height"]), outside)
    np.testing.assert_array_equal(np.isnan(dem["height_std"]), outside)
    # Each pixel that is missing is a cell, which slopes along y stretch or press together, within
    # the few pixels that heights move it.
    assert int(missing.sum()) / 2 <= outside.sum() <= 2 * int(missing.sum())
    rows, columns = np.nonzero(outside)
    assert set(columns) <= {9, 14, 15}
    assert (abs(rows - np.where(columns == 9, 20, 26)) <= 8).all()
    assert np.isfinite(found["detections"]["contrast"]).values[~missing.values].all()


def test_only_islands_that_hold_a_reference_are_valid(study, products):
    # A column cuts the scene in two, and a frame on its far side an island out of it.
    frame = mask(products, slice(25, 36), slice(20, 29)) & ~mask(
        products, slice(26, 35), slice(21, 28)
    )
    missing = mask(products, slice(None), 16) | frame
    found = without(study, products, missing)
    dem, whole = found["dem"], products["dem"]
    kind = dem["height_class"].values
    inner = mask(products, slice(28, 34), slice(21, 28)).values
    valid = whole["height_class"].values == classification.VALID
    assert (inner & valid).any()
    assert not (kind[inner] == classification.VALID).any()
    held = ~mask(products, slice(20, 40), slice(19, 30)).values & (kind == classification.VALID)
    assert held[:, :16].any()
    assert held[:, 17:].any()
    # Both sides hold a rectangle of level ground, so both have the heights of the whole image,
    # but for a fraction of a cycle where the filter sees the cut: 0.4 m is a cycle.
    off = np.abs((dem["height"] - whole["height"]).values[held & valid])
    assert np.quantile(off, 0.99) < 0.05
