"""The stepped-frequency echo and its noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.foundations import variables
from vinsar.radar import waveform
from vinsar.simulation import echo

LIGHT = 299_792_458.0


@pytest.fixture(scope="module")
def frequency():
    return waveform.frequencies(13e9, 15e9, 101)


@pytest.fixture(scope="module")
def few(bistatic):
    return bistatic.isel(position=[0, 40, 80])


@pytest.fixture(scope="module")
def cloud(scatterers):
    rng = np.random.default_rng(5)
    position = rng.uniform([-2.5, 10.0, -0.3], [2.5, 16.0, 0.3], (2000, 3))
    return scatterers(position, rng.random(2000))


@given(x=st.floats(-5, 5), y=st.floats(3, 30), z=st.floats(-1, 1))
def test_a_single_point_has_the_phase_of_its_path(few, scatterers, x, y, z):
    frequency = np.array([13e9, 13.7e9, 14.4e9])
    found = echo.simulate(scatterers([x, y, z], 0.7), few, frequency=frequency, accuracy_db=None)
    point = np.array([x, y, z])
    path = np.linalg.norm(few["transmitter"].values - point, axis=-1) + np.linalg.norm(
        few["receiver"].values - point, axis=-1
    )
    expected = 0.7 * np.exp(-2j * np.pi * frequency * path[..., None] / LIGHT)
    # Some 6000 cycles in double precision: 6000 x 2 pi x 2e-16 x a few roundings.
    np.testing.assert_allclose(found["echo"].values, expected, atol=1e-10)


@pytest.mark.parametrize("count", [401, 200])
@pytest.mark.parametrize("accuracy_db", [-60.0, -90.0, -110.0, -160.0])
def test_the_fast_sum_errs_less_than_asked(cloud, few, accuracy_db, count):
    frequency = waveform.frequencies(13e9, 15e9, count)
    direct = echo.simulate(cloud, few, frequency=frequency, accuracy_db=None)["echo"].values
    fast = echo.simulate(cloud, few, frequency=frequency, accuracy_db=accuracy_db)["echo"].values
    error = np.linalg.norm(fast - direct, axis=-1) / np.linalg.norm(direct, axis=-1)
    assert error.max() <= 10 ** (accuracy_db / 20)


def test_echoes_of_facets_add_up(cloud, few, frequency):
    def simulate(facets):
        facets = facets.assign_coords(facet=np.arange(facets.sizes["facet"]))
        return echo.simulate(facets, few, frequency=frequency, accuracy_db=None)["echo"].values

    parts = [cloud.isel(facet=slice(0, 700)), cloud.isel(facet=slice(700, None))]
    np.testing.assert_allclose(sum(simulate(part) for part in parts), simulate(cloud), atol=1e-9)


def test_reflectivity_is_the_amplitude_or_its_square(scatterers, few, frequency):
    facets = scatterers([[0, 10, 0]], 0.25)
    for reflectivity, amplitude in (("amplitude", 0.25), ("power", 0.5)):
        found = echo.simulate(
            facets, few, frequency=frequency, reflectivity=reflectivity, accuracy_db=None
        )
        np.testing.assert_allclose(np.abs(found["echo"].values), amplitude, rtol=1e-12)


def test_a_negative_reflectivity_is_refused(scatterers, few, frequency):
    with pytest.raises(ValueError, match=r"negative reflectivity -0\.5"):
        echo.simulate(scatterers([0, 10, 0], -0.5), few, frequency=frequency)


def only(facet, facets, antennas):
    shape = (2, antennas.sizes["position"], facets.sizes["facet"])
    visible = np.zeros(shape, bool)
    visible[..., facet] = True
    return variables.dataset("visibility", {"visible": visible})


def test_amplitude_spreads_with_the_ranges_out_and_back(scatterers, few, frequency):
    points = np.array([[0.0, 6.0, 0.0], [1.0, 15.0, 0.2]])
    facets = scatterers(points)
    near, far = (
        np.abs(
            echo.simulate(
                facets, few, only(index, facets, few), frequency=frequency, spreading=True,
                accuracy_db=None,
            )["echo"].values
        )
        for index in (0, 1)
    )  # fmt: skip
    out, back = (
        np.linalg.norm(few[name].values[:, :, None] - points, axis=-1)
        for name in ("transmitter", "receiver")
    )
    expected = (out * back)[..., 0] / (out * back)[..., 1]
    np.testing.assert_allclose(far / near, np.broadcast_to(expected[..., None], far.shape))
    # Monostatic at the scene's own mean range, the amplitude is the facet's.
    assert near.max() > 1 > far.max()


def test_hidden_facets_are_silent_on_both_ways_of_summing(cloud, few, frequency):
    rng = np.random.default_rng(0)
    visible = rng.random((2, 3, 2000)) < 0.5
    visible[0, 0] = False
    mask = variables.dataset("visibility", {"visible": visible})
    direct = echo.simulate(cloud, few, mask, frequency=frequency, accuracy_db=None)["echo"].values
    fast = echo.simulate(cloud, few, mask, frequency=frequency)["echo"].values
    assert not direct[0, 0].any()
    assert not fast[0, 0].any()
    for channel, position in ((0, 1), (1, 2)):
        seen = cloud.isel(facet=visible[channel, position])
        seen = seen.assign_coords(facet=np.arange(seen.sizes["facet"]))
        alone = echo.simulate(seen, few, frequency=frequency, accuracy_db=None)["echo"].values
        np.testing.assert_allclose(direct[channel, position], alone[channel, position], rtol=1e-12)


def test_positions_beyond_one_block_are_all_simulated(scatterers, rail, frequency):
    facets = scatterers([[0.3, 12.0, 0.1], [-0.3, 13.0, 0.0]])
    whole = echo.simulate(facets, rail, frequency=frequency)["echo"].values
    for index in (0, 26, 27, 53, 54, 80):
        alone = echo.simulate(facets, rail.isel(position=[index]), frequency=frequency)
        np.testing.assert_array_equal(whole[:, index], alone["echo"].values[:, 0])


def test_one_channel_alone_keeps_its_name_and_its_echo(scatterers, few, frequency):
    facets = scatterers([[0.3, 12.0, 0.1], [-0.3, 13.0, 0.0]])
    upper = echo.simulate(facets, few.sel(channel=["upper"]), frequency=frequency)
    both = echo.simulate(facets, few, frequency=frequency)
    assert upper["channel"].values.tolist() == ["upper"]
    np.testing.assert_array_equal(upper["echo"][0], both["echo"].sel(channel="upper"))


def test_uneven_frequencies_are_refused(cloud, few):
    with pytest.raises(ValueError, match="evenly spaced"):
        echo.simulate(cloud, few, frequency=np.array([13e9, 13.1e9, 13.3e9]))
    with pytest.raises(ValueError, match="two or more"):
        echo.simulate(cloud, few, frequency=np.array([13e9]))


def test_visibility_of_another_scene_is_refused(cloud, few, frequency):
    mask = variables.dataset("visibility", {"visible": np.ones((2, 3, 5), bool)})
    with pytest.raises(ValueError, match="2 channels, 3 positions and 2000 facets"):
        echo.simulate(cloud, few, mask, frequency=frequency)


SWATH = 6.0


@pytest.fixture(scope="module")
def speckle(scatterers, rail):
    """Echo of a strip ahead that fills the swath evenly; the lower channel is twice as loud."""
    rng = np.random.default_rng(8)
    slant = rng.uniform(10.0, 10.0 + SWATH, 4000)
    facets = scatterers(np.stack([np.zeros(4000), np.sqrt(slant**2 - 4), np.zeros(4000)], axis=1))
    data = echo.simulate(facets, rail, frequency=waveform.frequencies(13e9, 15e9, 201))
    return data.assign(echo=data["echo"] * np.array([2.0, 1.0])[:, None, None])


def noisy(speckle, snr_db=10.0, seed=0):
    rngs = [np.random.default_rng(stream) for stream in np.random.SeedSequence(seed).spawn(2)]
    return echo.add_noise(speckle, snr_db=snr_db, swath_m=SWATH, rngs=rngs)


@pytest.mark.parametrize("snr_db", [0.0, 10.0, 30.0])
def test_noise_gives_a_range_cell_the_signal_to_noise_ratio_asked_for(speckle, snr_db):
    clean = speckle["echo"].values
    noise = noisy(speckle, snr_db)["echo"].values - clean
    count = clean.shape[-1]
    cells = np.abs(np.fft.ifft(noise, axis=-1)) ** 2
    signal = np.abs(np.fft.ifft(clean, axis=-1)) ** 2
    slant = np.arange(count) * waveform.unambiguous_range(1e7) / count
    inside = (slant >= 10.0) & (slant < 10.0 + SWATH)
    ratio = signal[..., inside].mean() / cells.mean()
    # Exponential noise powers: relative error 1 / sqrt(n), four of them. And of the swath's 80
    # cells, one at the edges counts more or less.
    bound = 4 / np.sqrt(noise.size) + 1 / inside.sum()
    assert ratio / 10 ** (snr_db / 10) == pytest.approx(1, abs=bound)


def test_noise_is_white_circular_and_of_one_power_in_independent_channels(speckle):
    noise = noisy(speckle)["echo"].values - speckle["echo"].values
    lower, upper = noise.reshape(2, -1)
    count = lower.size
    power = np.mean(np.abs(noise) ** 2)
    # Each of these is a mean of n terms of unit deviation: four standard errors.
    bound = 4 / np.sqrt(count)
    assert np.mean(np.abs(lower) ** 2) / power == pytest.approx(1, abs=bound)
    assert np.abs(np.mean(lower * np.conj(upper))) / power < bound
    assert np.abs(np.mean(lower[1:] * np.conj(lower[:-1]))) / power < bound
    assert np.abs(np.mean(lower**2)) / power < np.sqrt(2) * bound
    assert np.abs(np.mean(lower)) / np.sqrt(power) < bound


def test_noise_is_the_same_for_the_same_seed_alone(speckle):
    assert noisy(speckle).identical(noisy(speckle))
    assert not np.array_equal(noisy(speckle)["echo"], noisy(speckle, seed=1)["echo"])


def test_noise_of_one_channel_does_not_depend_on_the_others_source(speckle):
    sources = [(1, 2), (1, 3)]
    lower = [
        echo.add_noise(
            speckle, snr_db=10.0, swath_m=SWATH, rngs=[np.random.default_rng(s) for s in pair]
        )["echo"].values[0]
        for pair in sources
    ]
    np.testing.assert_array_equal(*lower)


def test_a_swath_beyond_the_unambiguous_range_is_refused(speckle):
    for swath in (0.0, 15.1):
        with pytest.raises(ValueError, match=r"unambiguous range of 14\.99 m"):
            echo.add_noise(speckle, snr_db=10.0, swath_m=swath, rngs=[np.random.default_rng()] * 2)


def test_each_channel_needs_its_source_of_noise(speckle):
    with pytest.raises(ValueError, match="2 channels need as many sources, not 1"):
        echo.add_noise(speckle, snr_db=10.0, swath_m=SWATH, rngs=[np.random.default_rng(0)])


def coupled(received, antennas, seeds=(1, 2), **options):
    options = {"coupling_db": 60.0, "path_m": 0.45, "variation_db": None} | options
    return echo.add_coupling(
        received, received, antennas, swath_m=SWATH,
        rngs=[np.random.default_rng(seed) for seed in seeds], **options,
    )["echo"].values - received["echo"].values  # fmt: skip


def as_many(antennas, data):
    return antennas.isel(position=np.arange(data.sizes["position"]) % antennas.sizes["position"])


@pytest.mark.parametrize("coupling_db", [0.0, 60.0])
def test_the_coupling_peaks_as_far_above_the_scene_s_cells_as_asked(speckle, rail, coupling_db):
    found = coupled(speckle, as_many(rail, speckle), coupling_db=coupling_db, path_m=0.0)
    count = found.shape[-1]
    peak = np.abs(np.fft.ifft(found, axis=-1))[..., 0] ** 2
    clean = np.abs(np.fft.ifft(speckle["echo"].values, axis=-1)) ** 2
    slant = np.arange(count) * waveform.unambiguous_range(1e7) / count
    inside = (slant >= 10.0) & (slant < 10.0 + SWATH)
    # Sidelobes beyond the swath's edges take some hundredths of a dB of the scene.
    assert 10 * np.log10(peak.mean() / clean[..., inside].mean()) == pytest.approx(
        coupling_db, abs=0.2
    )


def test_the_coupling_is_at_half_its_path_and_the_distance_between_the_antennas(
    speckle, rail, bistatic
):
    frequency = speckle["frequency"].values
    apart = np.linalg.norm([0.3, -0.1, 0.2])
    for antennas, path in ((rail, 0.45), (bistatic, 0.45 + apart)):
        found = coupled(speckle, as_many(antennas, speckle))
        turn = found * np.exp(2j * np.pi * frequency * path / LIGHT)
        np.testing.assert_allclose(turn, np.broadcast_to(turn[:1, :1, :1], turn.shape), rtol=1e-6)
        assert turn[0, 0, 0].real > 0


def test_the_coupling_varies_between_positions_and_not_over_the_frequencies(speckle, rail):
    options = {"path_m": 0.0, "coupling_db": 20.0}
    constant = coupled(speckle, as_many(rail, speckle), **options)
    varied = coupled(speckle, as_many(rail, speckle), variation_db=-30.0, **options)
    relative = varied / constant - 1
    np.testing.assert_allclose(
        relative, relative[..., :1].repeat(relative.shape[-1], -1), rtol=1e-3
    )
    draws = relative[..., 0].ravel()
    # Mean power of n circular normal draws, to four standard deviations: 4 / sqrt(n).
    assert np.mean(np.abs(draws) ** 2) == pytest.approx(1e-3, rel=4 / np.sqrt(draws.size))


def test_each_channel_needs_its_source_of_coupling(speckle, rail):
    with pytest.raises(ValueError, match="2 channels need as many sources, not 1"):
        coupled(speckle, as_many(rail, speckle), seeds=(1,))
