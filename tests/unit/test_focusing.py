"""Range compression and back-projection: products, threads, refusals."""

from __future__ import annotations

import dask
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.foundations import variables
from vinsar.processing import focusing
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo

LIGHT = 299_792_458.0


@pytest.fixture(scope="module")
def frequency():
    return waveform.frequencies(13e9, 15e9, 101)


@pytest.fixture(scope="module")
def point_echo(scatterers, rail, frequency):
    """Echo of one point; its slant ranges are near 6.3 m, within the 7.5 m before repetition."""
    return echo.simulate(scatterers([0.2, 6.0, 0.1]), rail, frequency=frequency, accuracy_db=None)


def compress(signal, near=4.0, far=7.4, **options):
    return focusing.compress(signal, near_range_m=near, far_range_m=far, **options)


@given(
    distance=st.floats(4.1, 7.3),
    window=st.sampled_from(["rectangular", "hann", "hamming", "blackman"]),
    oversampling=st.sampled_from([2, 4, 16, 64]),
)
def test_profiles_interpolate_linearly_to_the_sum_over_frequencies(
    point_echo, distance, window, oversampling
):
    frequency = point_echo["frequency"].values
    profiles = compress(point_echo, window=window, oversampling=oversampling)
    slant = profiles["slant_range"].values
    profile = profiles["profile"].values[1, 17]
    found = np.interp(distance, slant, profile.real) + 1j * np.interp(distance, slant, profile.imag)
    weights = waveform.window(window, frequency.size)
    turns = 2 * (frequency - 14e9) * distance / LIGHT
    expected = (weights * point_echo["echo"].values[1, 17]) @ np.exp(2j * np.pi * turns)
    # Linear interpolation of a line at f (in units of the sampling rate) leaves images at f + n of
    # sinc(f + n)^2. After division by sinc(f)^2 the images' sum is at most 1 / sinc(f)^2 - 1.
    spacing = (slant[-1] - slant[0]) / (slant.size - 1)
    images = 1 / np.sinc(2 * (frequency - 14e9) * spacing / LIGHT) ** 2 - 1
    assert np.abs(found - expected) <= weights @ images + 1e-6


@pytest.mark.parametrize("oversampling", [2, 7, 16])
def test_profiles_sample_a_resolution_cell_as_often_as_asked(point_echo, oversampling):
    slant = compress(point_echo, oversampling=oversampling)["slant_range"].values
    cell = waveform.range_resolution(101 * 2e7)
    assert np.diff(slant).max() <= cell / oversampling * (1 + 1e-9)
    np.testing.assert_allclose(np.diff(slant), slant[1] - slant[0], rtol=1e-9)
    assert slant[0] <= 4.0
    assert slant[-1] >= 7.4


def test_profiles_of_a_crop_are_those_of_the_whole(point_echo):
    whole, crop = compress(point_echo), compress(point_echo, near=5.0, far=6.0)
    part = whole.sel(slant_range=crop["slant_range"], method="nearest", tolerance=1e-9)
    np.testing.assert_array_equal(part["profile"].values, crop["profile"].values)


def test_ranges_beyond_the_first_ambiguity_are_taken_modulo(scatterers, rail, frequency):
    # A point farther than 7.5 m is imaged all the same: its echo repeats with the range.
    far = echo.simulate(scatterers([0.0, 13.0, 0.0]), rail, frequency=frequency, accuracy_db=None)
    profiles = compress(far, near=12.0, far=15.0)
    magnitude = np.abs(profiles["profile"].values[0, 40])
    peak = profiles["slant_range"].values[magnitude.argmax()]
    assert peak == pytest.approx(np.hypot(13, 2), abs=0.005)


@pytest.mark.parametrize(
    ("near", "far", "message"),
    [
        (5.0, 5.0, "do not rise from 0"),
        (-1.0, 5.0, "do not rise from 0"),
        (2.0, 10.0, r"8\.00 m of slant range exceed .* 7\.49 m; take a finer frequency step"),
    ],
)
def test_impossible_ranges_are_refused(point_echo, near, far, message):
    with pytest.raises(ValueError, match=message):
        compress(point_echo, near, far)


X, Y = np.linspace(-0.5, 0.7, 25), np.linspace(5.5, 6.5, 70)


def image(profiles, antennas, **options):
    return focusing.backproject(profiles, antennas, x=X, y=Y, **options)


def test_images_carry_the_wavelength_and_the_positions(point_echo, rail):
    images = image(compress(point_echo), rail)
    assert float(images["wavelength"]) == pytest.approx(LIGHT / 14e9)
    for name in ("transmitter", "receiver"):
        np.testing.assert_array_equal(images[name], rail[name])
    np.testing.assert_array_equal(images["x"], X)
    np.testing.assert_array_equal(images["y"], Y)
    assert images["image"].dtype == np.complex64


@pytest.mark.parametrize("workers", [2, 5])
def test_one_thread_and_many_give_the_same_bits(point_echo, rail, workers):
    profiles = compress(point_echo)
    with dask.config.set(scheduler="synchronous"):
        alone = image(profiles, rail)
    with dask.config.set(scheduler="threads", num_workers=workers):
        together = image(profiles, rail)
    np.testing.assert_array_equal(
        alone["image"].values.view(np.uint64), together["image"].values.view(np.uint64)
    )


def test_a_pixel_does_not_depend_on_the_grid_around_it(point_echo, rail):
    # Tiles of columns and blocks of rows anchor their ranges differently, to float32 rounding.
    profiles = compress(point_echo)
    whole = image(profiles, rail)["image"].values
    for row, column in ((0, 0), (31, 3), (32, 24), (69, 12)):
        single = focusing.backproject(profiles, rail, x=X[column : column + 1], y=Y[row : row + 1])[
            "image"
        ].values[:, 0, 0]
        np.testing.assert_allclose(single, whole[:, row, column], atol=1e-5)


def test_images_are_linear_in_the_echo(point_echo, rail):
    twice = point_echo.assign(echo=point_echo["echo"] * 2j)
    found, single = image(compress(twice), rail), image(compress(point_echo), rail)
    np.testing.assert_allclose(found["image"], 2j * single["image"], atol=1e-6)


def test_one_channel_alone_keeps_its_name_and_its_image(point_echo, rail):
    upper = image(compress(point_echo.sel(channel=["upper"])), rail.sel(channel=["upper"]))
    both = image(compress(point_echo), rail)
    assert upper["channel"].values.tolist() == ["upper"]
    np.testing.assert_array_equal(upper["image"][0], both["image"].sel(channel="upper"))


def test_inputs_are_not_changed(point_echo, rail):
    signal, antennas = point_echo.copy(deep=True), rail.copy(deep=True)
    profiles = compress(signal)
    kept = profiles.copy(deep=True)
    image(profiles, antennas, window="hann")
    assert profiles.identical(kept)
    assert signal.identical(point_echo)
    assert antennas.identical(rail)


def test_an_extra_range_that_is_known_is_undone(point_echo, rail):
    extra = np.random.default_rng(5).uniform(-0.01, 0.01, (2, 81))
    frequency = point_echo["frequency"].values
    late = point_echo["echo"].values * np.exp(-4j * np.pi / LIGHT * extra[..., None] * frequency)
    other = variables.dataset("echo", {"echo": late}, {"frequency": frequency})
    expected = image(compress(point_echo, oversampling=64), rail)["image"].values
    found = image(compress(other, oversampling=64), rail, extra_range_m=extra)["image"].values
    # Linear interpolation at 64 errs by -88 dB of each image; the focus is kept to that.
    assert np.linalg.norm(found - expected) < 2 * 10 ** (-85 / 20) * np.linalg.norm(expected)
    blurred = image(compress(other, oversampling=64), rail)["image"].values
    assert np.abs(blurred).max() < 0.7 * np.abs(expected).max()


@pytest.mark.parametrize("extra", [np.zeros(81), np.full((2, 81), np.nan)])
def test_extra_ranges_of_other_positions_or_without_a_value_are_refused(point_echo, rail, extra):
    with pytest.raises(ValueError, match="extra ranges of"):
        image(compress(point_echo), rail, extra_range_m=extra)


def test_an_extra_range_beyond_the_profiles_is_refused(point_echo, rail):
    with pytest.raises(ValueError, match="but the grid needs"):
        image(compress(point_echo), rail, extra_range_m=np.full((2, 81), 3.0))


def test_profiles_of_other_positions_are_refused(point_echo, rail):
    with pytest.raises(ValueError, match=r"\(2, 81\) .* do not fit a trajectory of \(2, 80\)"):
        image(compress(point_echo), rail.isel(position=slice(80)))


@pytest.mark.parametrize(("near", "far"), [(6.0, 7.4), (4.0, 6.5)])
def test_profiles_that_do_not_cover_the_grid_are_refused(point_echo, rail, near, far):
    with pytest.raises(ValueError, match="but the grid needs"):
        image(compress(point_echo, near, far), rail)


def test_a_high_surface_needs_nearer_profiles(point_echo, rail):
    near, far = trajectory.range_extent(rail, X, Y)
    profiles = compress(point_echo, near, far)
    image(profiles, rail)
    with pytest.raises(ValueError, match="but the grid needs"):
        image(profiles, rail, z=1.5)


def test_a_surface_of_another_shape_is_refused(point_echo, rail):
    with pytest.raises(ValueError, match="broadcast"):
        image(compress(point_echo), rail, z=np.zeros((3, 4)))


def test_an_empty_echo_gives_a_black_image(rail, frequency):
    silence = variables.dataset(
        "echo", {"echo": np.zeros((2, 81, 101), complex)}, {"frequency": frequency}
    )
    assert not image(compress(silence), rail)["image"].values.any()
