"""Back-projection against the matched filter, summed directly in double precision."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations import variables
from vinsar.processing import focusing
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
X, Y = np.linspace(-0.6, 0.6, 25), np.linspace(5.4, 6.6, 21)
# Wide, so that the kernel takes more than one tile of columns and one block of rows.
WIDE_X, WIDE_Y = np.linspace(-2.5, 2.5, 300), np.linspace(10.0, 16.0, 35)


def half_paths(antennas, x, y, z):
    """Half the path out and back (channel, position, y, x)."""
    grid_z = np.broadcast_to(z, (y.size, x.size))
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    points = np.stack([grid_x, grid_y, grid_z], axis=-1)
    return sum(
        np.linalg.norm(points - antennas[name].values[:, :, None, None], axis=-1)
        for name in ("transmitter", "receiver")
    ) / 2  # fmt: skip


def matched_filter(signal, antennas, x, y, z, window):
    """``sum_l v_l sum_k w_k s_lk exp(4 pi i f_k rho_l / c)`` at each pixel."""
    samples, frequency = signal["echo"].values, signal["frequency"].values
    weights = waveform.window(window, frequency.size)
    positions = waveform.window(window, samples.shape[1])
    paths = half_paths(antennas, x, y, z)
    result = np.zeros((2, y.size, x.size), complex)
    for k, value in enumerate(frequency):
        turned = np.exp(4j * np.pi * value / LIGHT * paths)
        result += weights[k] * np.einsum("l,cl,clyx->cyx", positions, samples[:, :, k], turned)
    return result


@pytest.fixture(scope="module")
def speckle(scatterers):
    """A field of 1500 random scatterers, which fills the band evenly."""
    rng = np.random.default_rng(11)
    return scatterers(rng.uniform([-0.8, 5.2, -0.2], [0.8, 6.8, 0.2], (1500, 3)), rng.random(1500))


def profiles_of(signal, antennas, x, y, z, window, oversampling):
    near, far = trajectory.range_extent(antennas, x, y, z)
    return focusing.compress(
        signal, near_range_m=near, far_range_m=far, window=window, oversampling=oversampling
    )


def interpolation_error_db(profiles, frequency, window):
    """Expected error of linear interpolation after the sinc^2 pre-emphasis, for white speckle.

    A line at f (in units of the sampling rate) leaves images (f / (f + n))^2, n != 0; of the sum of
    their powers, 2 zeta(4) f^4 is the leading part: -64 dB over a full band at 16 times.
    """
    slant = profiles["slant_range"].values
    spacing = (slant[-1] - slant[0]) / (slant.size - 1)
    f = 2 * (frequency - waveform.carrier(frequency)) * spacing / LIGHT
    images = sum((f / (f + n)) ** 4 for n in range(-50, 51) if n)
    power = waveform.window(window, frequency.size) ** 2
    return 10 * np.log10((power @ images) / power.sum())


@pytest.mark.parametrize("window", ["rectangular", "hann"])
def test_a_speckled_image_errs_as_linear_interpolation_should(speckle, rail, window):
    signal = echo.simulate(speckle, rail, frequency=FREQUENCY, accuracy_db=None)
    exact = matched_filter(signal, rail, X, Y, 0.0, window)
    for oversampling in (4, 16, 32):
        profiles = profiles_of(signal, rail, X, Y, 0.0, window, oversampling)
        found = focusing.backproject(profiles, rail, x=X, y=Y, window=window)["image"].values
        error_db = 20 * np.log10(np.linalg.norm(found - exact) / np.linalg.norm(exact))
        expected = interpolation_error_db(profiles, FREQUENCY, window)
        # The error is speckle like the image: over the grid's ~100 resolution cells of two channels
        # the power of each scatters by 1 / sqrt(200), three of which are 0.9 dB.
        assert error_db <= expected + 2
        # An error far below theory would mean a theory of no use.
        assert error_db >= expected - 6


def test_linear_interpolation_at_16_times_is_minus_64_db_for_a_full_band():
    # The figure of the documentation: f^4 averages to (1/32)^4 / 5 over the band.
    slant = np.arange(3) * LIGHT / (2 * 101 * 2e7) / 16
    profiles = {"slant_range": variables.xr.DataArray(slant)}
    assert interpolation_error_db(profiles, FREQUENCY, "rectangular") == pytest.approx(-64, abs=0.5)


@pytest.mark.parametrize("window", ["rectangular", "hamming"])
def test_a_point_target_errs_nowhere_by_more_than_its_bound(scatterers, rail, window):
    signal = echo.simulate(scatterers([0.1, 6.0, 0.0]), rail, frequency=FREQUENCY, accuracy_db=None)
    profiles = profiles_of(signal, rail, X, Y, 0.0, window, 16)
    found = focusing.backproject(profiles, rail, x=X, y=Y, window=window)["image"].values
    exact = matched_filter(signal, rail, X, Y, 0.0, window)
    slant = profiles["slant_range"].values
    spacing = (slant[-1] - slant[0]) / (slant.size - 1)
    # All images of a line at f together are at most 1 / sinc(f)^2 - 1, whatever their phases.
    images = 1 / np.sinc(2 * (FREQUENCY - 14e9) * spacing / LIGHT) ** 2 - 1
    bound = waveform.window(window, FREQUENCY.size) @ images
    assert np.abs(found - exact).max() <= bound + 1e-6


@pytest.mark.parametrize("system", ["rail", "bistatic"])
def test_other_surfaces_and_antennas_are_focused_by_the_same_sum(speckle, system, request):
    antennas = request.getfixturevalue(system)
    surface = 0.2 * np.sin(4 * X[None, :]) * np.cos(3 * Y[:, None])
    signal = echo.simulate(speckle, antennas, frequency=FREQUENCY, accuracy_db=None)
    profiles = profiles_of(signal, antennas, X, Y, surface, "rectangular", 16)
    found = focusing.backproject(profiles, antennas, x=X, y=Y, z=surface)["image"].values
    exact = matched_filter(signal, antennas, X, Y, surface, "rectangular")
    error_db = 20 * np.log10(np.linalg.norm(found - exact) / np.linalg.norm(exact))
    assert error_db <= interpolation_error_db(profiles, FREQUENCY, "rectangular") + 2


def straight_profiles(antennas, x, y, z):
    """Profiles that are straight lines over range: linear interpolation makes no error in them."""
    rng = np.random.default_rng(2)
    near, far = trajectory.range_extent(antennas, x, y, z)
    slant = np.arange(near - 0.01, far + 0.01, 0.004)
    start = rng.normal(size=(2, 81, 1, 2)).view(complex)[..., 0]
    slope = rng.normal(size=(2, 81, 1, 2)).view(complex)[..., 0]
    values = start + slope * (slant - near) / (far - near)
    return variables.dataset(
        "profiles",
        {"profile": values.astype(np.complex64), "carrier_frequency": 14e9},
        {"slant_range": slant},
    ), lambda paths: start[..., None] + slope[..., None] * (paths - near) / (far - near)


def floor_db(antennas, x, y, z):
    profiles, value_at = straight_profiles(antennas, x, y, z)
    found = focusing.backproject(profiles, antennas, x=x, y=y, z=z)["image"].values
    paths = half_paths(antennas, x, y, z)
    turned = np.exp(4j * np.pi * 14e9 / LIGHT * paths)
    exact = np.mean(value_at(paths) * turned, axis=1)
    return 20 * np.log10(np.linalg.norm(found - exact) / np.linalg.norm(exact))


@pytest.mark.parametrize("system", ["rail", "bistatic"])
@pytest.mark.parametrize("relief", [0.0, 0.3])
def test_single_precision_adds_less_than_minus_100_db_over_the_papers_scene(
    system, relief, request
):
    antennas = request.getfixturevalue(system)
    surface = relief * np.sin(2 * WIDE_X[None, :]) * np.cos(3 * WIDE_Y[:, None])
    assert floor_db(antennas, WIDE_X, WIDE_Y, surface) < -100


def test_single_precision_adds_less_than_minus_100_db_over_a_wide_near_scene(rail):
    # 20 m across from 2 m ahead, at the 5 cm of the sweeps.
    assert floor_db(rail, np.linspace(-10, 10, 401), np.linspace(2.0, 4.0, 10), 0.0) < -100
