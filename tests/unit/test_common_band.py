"""The second pass: its surface and places, and what of band and aperture two channels share."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.processing import common_band
from vinsar.radar import aperture, trajectory, waveform
from vinsar.simulation import echo

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
X, Y = np.linspace(-0.5, 0.5, 21), np.linspace(6.0, 7.0, 26)
GRID_Y, GRID_X = np.meshgrid(Y, X, indexing="ij")
HILL = 0.15 * np.exp(-((GRID_X - 0.1) ** 2 + (GRID_Y - 6.5) ** 2) / 0.3**2)


@pytest.fixture(params=["rail", "bistatic"])
def antennas(request):
    return request.getfixturevalue(request.param)


@pytest.fixture
def point(antennas):
    return common_band.place(trajectory.apertures(antennas)[0], X, Y, HILL)


def test_level_heights_are_their_own_surface():
    power = np.random.default_rng(1).exponential(size=HILL.shape)
    found = common_band.surface(np.full(HILL.shape, 0.07), power, std_px=3.0)
    np.testing.assert_allclose(found, 0.07, rtol=1e-12)


def test_the_surface_is_the_gaussian_mean_weighted_by_power_up_to_three_medians():
    rng = np.random.default_rng(2)
    height, power = rng.normal(size=(15, 15)), rng.exponential(size=(15, 15))
    height[4, 4], power[7, 9] = np.nan, 1e6
    found = common_band.surface(height, power, std_px=1.0)
    row, column = np.indices(height.shape)
    weight = np.minimum(power, 3 * np.median(power[np.isfinite(height)]))
    weight *= np.exp(-((row - 7) ** 2 + (column - 7) ** 2) / 2)
    # Four standard deviations: the Gaussian is cut off there, where it is below 4e-4.
    weight[(abs(row - 7) > 4) | (abs(column - 7) > 4) | np.isnan(height)] = 0
    expected = (weight * np.nan_to_num(height)).sum() / weight.sum()
    assert found[7, 7] == pytest.approx(expected, rel=1e-6)


def test_what_is_far_from_any_known_height_takes_the_nearest_one():
    height = np.full((60, 60), np.nan)
    height[:5], height[-5:] = 0.1, -0.2
    found = common_band.surface(height, np.ones(height.shape), std_px=1.0)
    assert found[20, 30] == pytest.approx(0.1)
    assert found[45, 30] == pytest.approx(-0.2)


@pytest.mark.parametrize("power", [0.0, np.nan])
def test_without_any_height_it_is_the_plane_and_a_warning(power, caplog):
    found = common_band.surface(np.zeros((8, 8)), np.full((8, 8), power), std_px=1.0)
    assert not found.any()
    assert "ground plane" in caplog.text


def test_a_place_is_imaged_at_its_pixel(antennas, point):
    lower = trajectory.apertures(antennas)[0]
    image_x, image_y = aperture.image_position(lower, *point)
    np.testing.assert_allclose(image_x, GRID_X, atol=2e-7)
    np.testing.assert_allclose(image_y, GRID_Y, atol=2e-7)
    np.testing.assert_array_equal(point[2], HILL)


def test_where_no_place_has_a_height_the_pixel_is_focused_on_the_plane(rail):
    # From 2 m up, a pixel 0.5 m ahead is 2.06 m away: a target 5 m below the rail is not.
    lower = trajectory.apertures(rail)[0]
    found = common_band.place(lower, X, np.array([0.5, 0.6]), np.full((2, X.size), -3.0))
    np.testing.assert_array_equal(found[1], np.repeat([[0.5], [0.6]], X.size, axis=1))
    assert not found[2].any()


def test_two_channels_that_are_one_share_everything(antennas, point):
    lower = trajectory.apertures(antennas)[0]
    found = common_band.support((lower, lower), point, FREQUENCY, 81)
    step = FREQUENCY[1] - FREQUENCY[0]
    np.testing.assert_allclose(found.bands, [[[13e9 - step / 2, 15e9 + step / 2]]] * 2, rtol=1e-12)
    np.testing.assert_allclose(found.first, -0.5, atol=1e-9)
    np.testing.assert_allclose(found.last, 80.5, atol=1e-9)
    np.testing.assert_allclose(found.share(FREQUENCY, 81), 1.0)


def wavenumbers(antennas, channel, frequency, position, point):
    """Wavenumber of the surface (v, u), rad a pixel, at positions between those there are."""
    index = np.arange(antennas.sizes["position"])
    steps = []
    for name in ("transmitter", "receiver"):
        places = antennas[name].values[channel]
        at = np.stack([np.interp(position, index, places[:, axis]) for axis in range(3)])
        step = point - at
        steps.append(step / np.linalg.norm(step, axis=0))
    along = np.gradient(point, axis=(1, 2))
    path = [sum((step * tangent).sum(axis=0) for step in steps) for tangent in along]
    return [2 * np.pi / LIGHT * frequency * rate for rate in path]


@pytest.mark.parametrize("end", ["first", "last"])
def test_the_shared_edges_are_seen_at_one_wavenumber(antennas, point, end):
    channels = tuple(trajectory.apertures(antennas))
    found = common_band.support(channels, point, FREQUENCY, 81)
    edge = {"first": 0, "last": 1}[end]
    seen = [
        wavenumbers(
            antennas, channel, found.bands[channel, found.kind, edge],
            getattr(found, end)[channel], point,
        )
        for channel in range(2)
    ]  # fmt: skip
    whole = [
        np.ptp(
            [
                wavenumbers(antennas, 0, frequency, np.full(HILL.shape, position), point)
                for frequency in (13e9, 15e9)
                for position in (0.0, 80.0)
            ],
            axis=0,
        )
    ][0]
    # Sub-bands differ by 1 % of the band, so half of that; the pairing of positions is linear,
    # and what of it is not is less than 2 % of the aperture's wavenumbers this near.
    np.testing.assert_array_less(np.abs(seen[0][0] - seen[1][0]) / whole[0], 0.02)
    np.testing.assert_array_less(np.abs(seen[0][1] - seen[1][1]) / whole[1], 0.02)


def test_an_image_is_the_sum_over_the_bands_and_positions_of_each_pixel(
    antennas, point, scatterers
):
    rng = np.random.default_rng(3)
    field = scatterers(rng.uniform([-0.7, 5.8, -0.1], [0.7, 7.2, 0.2], (400, 3)), rng.random(400))
    signal = echo.simulate(field, antennas, frequency=FREQUENCY, accuracy_db=None)
    channels = tuple(trajectory.apertures(antennas))
    common = common_band.support(channels, point, FREQUENCY, 81)
    found = common_band.focus(
        signal, antennas, point, common, range_window="hamming", aperture_window="hann"
    )
    step, positions = FREQUENCY[1] - FREQUENCY[0], np.arange(81)
    weights = np.outer(waveform.window("hann", 81), waveform.window("hamming", FREQUENCY.size))
    exact = np.zeros_like(found, dtype=complex)
    for channel in range(2):
        for row, column in np.ndindex(HILL.shape):
            low, high = common.bands[channel, common.kind[row, column]]
            band = np.clip(
                np.minimum(FREQUENCY + step / 2, high) - np.maximum(FREQUENCY - step / 2, low),
                0, step,
            ) / step  # fmt: skip
            first = common.first[channel, row, column]
            last = common.last[channel, row, column]
            used = np.clip(
                np.minimum(positions + 0.5, last) - np.maximum(positions - 0.5, first), 0, 1
            )
            path = sum(
                np.linalg.norm(point[:, row, column] - antennas[name].values[channel], axis=-1)
                for name in ("transmitter", "receiver")
            )
            turned = np.exp(2j * np.pi / LIGHT * np.outer(path, FREQUENCY))
            kept = weights * np.outer(used, band)
            samples = signal["echo"].values[channel]
            exact[channel, row, column] = (kept * samples * turned).sum()
    error = np.linalg.norm(found - exact) / np.linalg.norm(exact)
    # Cubic interpolation at three samples a cell: -69 dB for a band of even weights.
    assert 20 * np.log10(error) < -66


def test_a_pixel_without_a_shared_aperture_is_dark(rail, point, scatterers):
    signal = echo.simulate(scatterers([[0.0, 6.5, 0.0]]), rail, frequency=FREQUENCY)
    common = common_band.support(tuple(trajectory.apertures(rail)), point, FREQUENCY, 81)
    common.last[:, 3, 4] = common.first[:, 3, 4] - 1
    common.last[:, 5, 6] = np.nan
    found = common_band.focus(signal, rail, point, common)
    dark = np.argwhere(found[0] == 0)
    assert dark.tolist() == [[3, 4], [5, 6]]
