"""What the suppression of the coupling leaves of it, and what it costs a wanted target."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.special import fresnel

import vinsar
from vinsar.foundations import variables
from vinsar.processing import focusing, leakage
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo
from vinsar.study import pipeline, validation

CONFIG = Path(__file__).parents[2] / "config"

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 401)
WAVELENGTH = LIGHT / 14e9
PLACES = [(0.0, 13.0), (0.2, 13.0), (0.4, 10.0), (0.6, 16.0), (2.0, 13.0)]


def fresnel_share(x, y, height, length):
    """|m|^2 of an aperture of this length, with ranges to the second order of x."""
    slant = np.hypot(y, height)
    ends = 2 * (x + np.array([-length / 2, length / 2])) / np.sqrt(WAVELENGTH * slant)
    sine, cosine = fresnel(ends)
    return (np.diff(cosine) ** 2 + np.diff(sine) ** 2)[0] / np.diff(ends)[0] ** 2


@pytest.mark.parametrize(("x", "y"), PLACES)
def test_the_common_share_is_a_fresnel_integral(rail, x, y):
    found = leakage.common_share(rail, x, y, WAVELENGTH)
    # 81 samples 1 cm apart fill 0.81 m. The trapezoid's ends err by half a sample of 81 in m, the
    # next order of the range by 2 pi / lambda x^4 / 4 r^3: 0.06 rad at x + L / 2 = 1 m.
    for height, share in zip((2.0, 2.3), found, strict=True):
        assert share == pytest.approx(fresnel_share(x, y, height, 0.81), abs=0.02)


def image_of(facets, antennas, x, y, method):
    near, far = trajectory.range_extent(antennas, np.array([x]), np.array([y]))
    profiles = focusing.compress(
        leakage.suppress(
            echo.simulate(facets, antennas, frequency=FREQUENCY, accuracy_db=None),
            method=method,
            gate_range_m=1.0,
        ),
        near_range_m=near,
        far_range_m=far,
    )
    images = focusing.backproject(profiles, antennas, x=np.array([x]), y=np.array([y]))
    return images["image"].values[:, 0, 0]


@pytest.mark.parametrize(("x", "y"), PLACES)
def test_removing_what_is_common_costs_a_target_that_share_and_no_phase(rail, scatterers, x, y):
    found = image_of(scatterers([x, y, 0.0]), rail, x, y, "common")
    share = leakage.common_share(rail, x, y, WAVELENGTH)
    # Over the band of +-7 % the share changes, to second order: (0.07)^2; interpolation: 1e-3.
    np.testing.assert_allclose(np.abs(found), 1 - share, atol=0.01)
    assert np.abs(np.angle(found)).max() < 0.01


def test_straight_ahead_a_quarter_of_the_amplitude_goes(rail):
    ahead, aside = leakage.common_share(rail, [0.0, 1.5], 13.0, WAVELENGTH)[0]
    # C(1.526) = 0.422 and S(1.526) = 0.686: (C^2 + S^2) / 1.526^2.
    assert ahead == pytest.approx(0.28, abs=0.01)
    # Beyond the aperture's end, its two end points: at most (lambda r / 2 pi L (x - L/2))^2 twice.
    assert aside < 2 * (WAVELENGTH * 13.15 / (2 * np.pi * 0.8 * 1.1)) ** 2


@pytest.mark.parametrize(("x", "y"), PLACES)
def test_the_gate_costs_a_target_of_the_scene_next_to_nothing(rail, scatterers, x, y):
    found = image_of(scatterers([x, y, 0.0]), rail, x, y, "gate")
    # What the gate's edge leaks at 120 cells and more, as in test_leakage: below 1 %.
    assert np.abs(found - 1).max() < 0.01


def received_coupling(antennas, variation_db, level_db=60.0):
    speckle = np.random.default_rng(3).normal(size=(2, 81, 401, 2)).view(complex)[..., 0]
    clean = variables.dataset("echo", {"echo": speckle}, {"frequency": FREQUENCY})
    with_coupling = echo.add_coupling(
        clean, clean, antennas, coupling_db=level_db, path_m=0.4, variation_db=variation_db,
        swath_m=6.0, rngs=[np.random.default_rng(seed) for seed in (1, 2)],
    )  # fmt: skip
    return with_coupling["echo"].values - clean["echo"].values


def left_db(samples, method):
    data = variables.dataset("received", {"echo": samples}, {"frequency": FREQUENCY})
    left = leakage.suppress(data, method=method, gate_range_m=1.0)["echo"].values
    return 10 * np.log10(np.mean(np.abs(left) ** 2) / np.mean(np.abs(samples) ** 2) + 1e-30)


def test_what_varies_of_the_coupling_is_not_common(rail):
    samples = received_coupling(rail, -40.0)
    # The mean of 81 draws goes too: 0.05 dB; 162 draws scatter by 0.34 dB.
    assert left_db(samples, "common") == pytest.approx(-40.0, abs=4 * 0.34)
    assert left_db(received_coupling(rail, None), "common") < -200


def test_the_gate_takes_all_of_a_varying_coupling(rail, bistatic):
    for antennas in (rail, bistatic):
        assert left_db(received_coupling(antennas, -20.0), "gate") < -100


def test_a_switched_array_s_coupling_is_not_common_to_its_positions(rail):
    # One transmitter, receivers along x: the direct path runs over several wavelengths.
    array = rail.assign(transmitter=rail["transmitter"] * 0 + [0.0, 0.0, 2.5])
    samples = received_coupling(array, None)
    assert left_db(samples, "common") > -3
    assert left_db(samples, "gate") < -100


@pytest.fixture(scope="module")
def shown():
    """What the coupling's study shows, on a small scene."""
    raw = validation.merge(
        vinsar.load(CONFIG / "smoke.yaml").model_dump(mode="json"),
        {"echo": {"coupling_db": 60.0, "accuracy_db": -85.0}, "variants": {}, "sweeps": {}},
    )
    return pipeline.run(validation.check(raw), only="coupling")["coupling"]


def test_the_coupling_stands_at_half_its_path_as_high_as_asked(shown):
    power = shown["power"].sel(weighting="rectangular", suppression="none")
    peak = power.isel(slant_range=int(np.argmax(power.values)))
    assert float(peak["slant_range"]) == pytest.approx(0.2, abs=0.01)
    # The scene's swath, of the coupling's level, is somewhat longer than the image's.
    assert 10 * np.log10(float(peak)) == pytest.approx(60.0, abs=1.0)


def test_sidelobes_bury_the_scene_until_they_are_suppressed(shown):
    scene = shown["scene_power"]
    within = (scene["slant_range"] > 10.5) & (scene["slant_range"] < 13.0)
    power = shown["power"].where(within, drop=True).mean("slant_range")
    clean = float(scene.where(within, drop=True).mean())
    buried = float(power.sel(weighting="rectangular", suppression="none"))
    # Lobes 1 / (N sin(pi r / R)) in amplitude, of half their envelope's power in the mean.
    ranges = scene["slant_range"].where(within, drop=True).values
    lobes = 1 / (201 * np.sin(np.pi * (ranges - 0.2) / waveform.unambiguous_range(1e7)))
    expected = 60 + 10 * np.log10(np.mean(lobes**2) / 2)
    assert 10 * np.log10(buried - clean) == pytest.approx(expected, abs=1.0)
    assert float(power.sel(weighting="hann", suppression="none")) < 2 * clean
    for method in ("gate", "common", "both"):
        left = float(power.sel(weighting="rectangular", suppression=method))
        assert left == pytest.approx(clean, rel=0.1), method


def test_imaged_targets_lose_the_share_that_is_common(shown):
    image = shown["point_image"]
    assert np.abs(image.sel(suppression="none") - 1).max() < 1.2e-2
    left = np.abs(image.sel(suppression="common"))
    assert np.abs(left - (1 - shown["common_share"])).max() < 0.02
