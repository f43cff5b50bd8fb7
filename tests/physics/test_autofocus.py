"""Errors of positions, taken from the echoes of speckle that nobody told the method."""

from __future__ import annotations

import numpy as np
import pytest

import vinsar
from vinsar.foundations import variables
from vinsar.processing import assessment, autofocus, uncertainty
from vinsar.radar import motion, trajectory, waveform
from vinsar.radar.instrument import Instrument
from vinsar.simulation import echo

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 401)
WAVELENGTH = LIGHT / 14e9
EXTENT = (-2.5, 2.5, 10.0, 14.0)


def speckle_of(antennas, scatterers, seed=3):
    rng = np.random.default_rng(seed)
    count = 20_000
    places = np.zeros((count, 3))
    places[:, 0] = rng.uniform(*EXTENT[:2], count)
    places[:, 1] = rng.uniform(*EXTENT[2:], count)
    # A hill, so that the two antennas see other phases, as they do of any relief.
    places[:, 2] = 0.2 * np.exp(-((places[:, 0] - 0.5) ** 2) - (places[:, 1] - 12) ** 2)
    return echo.simulate(scatterers(places), antennas, frequency=FREQUENCY, accuracy_db=-60.0)


@pytest.fixture(scope="module")
def received(rail, scatterers):
    return speckle_of(rail, scatterers)


def recorded_with(rail, axis, std, *, common, spectrum="white", cycles=2.0, seed=4):
    """The rail as a sensor with errors records it."""

    def draw(channel, positions):
        return motion.errors(
            positions,
            std_m=std,
            distribution="uniform",
            spectrum=spectrum,
            cycles_per_aperture=cycles,
            rng=np.random.default_rng((seed, 0 if common else channel)),
        )

    return motion.displace(rail, axis=axis, draw=draw)


def left_over(rail, recorded, displacement, points):
    """Phase (channel, position, point) that is left of the errors, less each channel's line.

    A constant and a trend along the aperture move and turn the image: echoes do not tell them.
    Nor do they tell half wavelengths from one position to the next, which no phase shows.
    """
    believed = trajectory.displaced(recorded, displacement)
    ends = [
        np.linalg.norm(points - antennas["receiver"].values[:, :, None], axis=-1)
        for antennas in (rail, believed)
    ]
    phase = np.unwrap(4 * np.pi * (ends[0] - ends[1]) / WAVELENGTH, axis=1)
    along = np.linspace(-1, 1, phase.shape[1])
    line = np.linalg.qr(np.stack([np.ones_like(along), along], axis=1))[0]
    return phase - np.einsum("lk,mk,cmp->clp", line, line, phase)


MIDDLE = np.array([[0.0, 12.0, 0.0]])
PLACES = np.array([[-2.0, 11.0, 0.0], [2.0, 11.0, 0.0], [0.0, 12.0, 0.0], [0.0, 13.5, 0.0]])


@pytest.mark.parametrize("axis", ["y", "z"])
@pytest.mark.parametrize("common", [True, False], ids=["common", "independent"])
def test_errors_of_a_wavelength_are_found(rail, received, axis, common):
    recorded = recorded_with(rail, axis, WAVELENGTH, common=common)
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    assert not found.reason
    assert found.focus[1] > 0.85
    before = left_over(rail, recorded, np.zeros_like(found.displacement), MIDDLE)
    after = left_over(rail, recorded, found.displacement, MIDDLE)
    assert before.std() > 1.2
    # What is left costs a point exp(-variance / 2) of its amplitude: 5 % at a third of a radian.
    # The channels share the drift along the aperture: their difference has none.
    assert after.std() < 1 / 3
    assert (after[0] - after[1]).std() < 1 / 8


@pytest.mark.parametrize("common", [True, False], ids=["common", "independent"])
def test_errors_along_the_rail_are_found(rail, received, common):
    """They turn the phase of the two sides of the scene against each other."""
    recorded = recorded_with(rail, "x", WAVELENGTH, common=common)
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    assert not found.reason
    before, after = (
        left_over(rail, recorded, moved, PLACES[:2])
        for moved in (np.zeros_like(found.displacement), found.displacement)
    )
    # Half a radian on either side costs a point there 12 % of its amplitude, at most.
    assert (before[..., 0] - before[..., 1]).std() > 3
    assert (after[..., 0] - after[..., 1]).std() < 1


def test_a_slow_vibration_of_each_channel_is_found(rail, received):
    """It leaves each image in focus, and the interferogram wrong by whole radians."""
    recorded = recorded_with(rail, "y", 2e-3, common=False, spectrum="sinusoidal", seed=8)
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    assert not found.reason
    assert found.focus[0] > 0.75
    before, after = (
        left_over(rail, recorded, moved, MIDDLE)
        for moved in (np.zeros_like(found.displacement), found.displacement)
    )
    assert (before[0] - before[1]).std() > 1 / 2
    assert (after[0] - after[1]).std() < 1 / 8


@pytest.mark.parametrize("channel", [0, 1])
def test_errors_of_one_channel_are_found_by_itself(rail, received, channel):
    antennas = rail.isel(channel=[channel])
    recorded = recorded_with(antennas, "y", WAVELENGTH / 2, common=False)
    found = autofocus.estimate(received.isel(channel=[channel]), recorded, extent=EXTENT)
    assert not found.reason
    assert left_over(antennas, recorded, np.zeros_like(found.displacement), MIDDLE).std() > 1
    # Half a radian of drift costs a point 12 % of its amplitude.
    assert left_over(antennas, recorded, found.displacement, MIDDLE).std() < 1 / 2


def test_three_channels_are_left_alone_with_a_warning(rail, received, caplog):
    three = [0, 0, 1]
    found = autofocus.estimate(
        received.isel(channel=three), rail.isel(channel=three), extent=EXTENT
    )
    assert "2 channels at most, and there are 3" in caplog.text
    assert not found.displacement.any()
    assert np.isnan(found.range_std).all()


def test_without_errors_nothing_moves(rail, received, caplog):
    found = autofocus.estimate(received, rail, extent=EXTENT)
    assert "already" in found.reason
    assert not caplog.records
    assert not found.displacement.any()
    # What the echoes leave possible is known all the same: a small part of the wavelength.
    assert 0 < found.range_std.max() < WAVELENGTH / 50


def test_a_correction_is_the_same_wherever_the_sensor_puts_the_vehicle(rail, received):
    """An offset of all positions moves the scene with them."""
    recorded = recorded_with(rail, "y", WAVELENGTH, common=True)
    moved = recorded.assign(
        {name: recorded[name] + [0.0, 100.0, 0.0] for name in ("transmitter", "receiver")}
    )
    here = autofocus.estimate(received, recorded, extent=EXTENT)
    there = autofocus.estimate(received, moved, extent=(*EXTENT[:2], 110.0, 114.0))
    np.testing.assert_allclose(there.displacement, here.displacement, atol=1e-4)


def bound(rail, looks, *, between, incoherent):
    """Cramer-Rao bound (rms, rad) of the phases less each channel's line, and of their difference.

    J = 2 N (R o R^-T - 1) of docs/autofocus.md. R is the covariance of a level scene as wide as the
    image by a sum over its angles, with a coherence between the channels and an incoherent share.
    """
    x = rail["receiver"].values[0, :, 0]
    sines = np.linspace(-1, 1, 400) * EXTENT[1] / np.hypot(MIDDLE[0, 1], 2.0)
    steering = np.exp(4j * np.pi / WAVELENGTH * x[:, None] * sines)
    own = (steering @ steering.conj().T / sines.size).real
    covariance = np.kron([[1, between], [between, 1]], own)
    size = len(covariance)
    covariance = (1 - incoherent) * covariance + incoherent * np.eye(size)
    information = 2 * looks * (covariance * np.linalg.inv(covariance).T - np.eye(size))
    along = np.linspace(-1, 1, x.size)
    line = np.linalg.qr(np.stack([np.ones_like(along), along], axis=1))[0]
    keep = np.kron(np.eye(2), np.eye(x.size) - line @ line.T)
    least = np.linalg.pinv(keep @ information @ keep, rcond=1e-8, hermitian=True)
    apart = np.kron([1, -1], np.eye(x.size))
    return np.sqrt(np.trace(least) / size), np.sqrt(np.trace(apart @ least @ apart.T) / x.size)


def test_what_is_left_is_held_against_the_cramer_rao_bound(rail, received):
    """Between the channels within 1.5 times the bound; the drift that they share is not.

    A twentieth of the power counts as incoherent. An estimate from 80 positions cannot stay below
    the bound by more than three times the error 1 / sqrt(2 x 80) of a standard deviation.
    """
    recorded = recorded_with(rail, "y", WAVELENGTH, common=False)
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    left = left_over(rail, recorded, found.displacement, MIDDLE)[..., 0]
    looks = int((EXTENT[3] - EXTENT[2]) / waveform.range_resolution(2e9))
    each, difference = bound(rail, looks, between=0.75, incoherent=0.05)
    assert 1 - 3 / np.sqrt(160) < (left[0] - left[1]).std() / difference < 1.5
    assert 1 < left.std() / each < 5


def motion_product(displacement, std):
    zeros = np.zeros(displacement.shape[:2])
    return variables.dataset(
        "autofocus",
        {
            "displacement": displacement,
            "displacement_std": std,
            "range_correction": zeros,
            "range_std": zeros,
            "focus_recorded": np.nan,
            "focus_corrected": np.nan,
        },
        {"channel": np.array(["lower", "upper"])},
    )


REFERENCE = assessment.Reference(
    ((slice(0, 1), slice(0, 1)),), plane=False, level=True, heights=(0.0,)
)


def test_the_variance_of_the_phase_is_that_of_positions_nobody_corrects(rail):
    """Monte Carlo with exact ranges: a constant between the channels tilts the phase."""
    rng = np.random.default_rng(11)
    x, y = np.array([0.0, 1.5]), np.array([10.0, 12.0, 15.0])
    points = np.stack(np.broadcast_arrays(x[None, :], y[:, None], 0.0), axis=-1).reshape(-1, 3)
    std = np.array([0.2, 1.0, 0.6]) * WAVELENGTH
    count, draws = rail.sizes["position"], 1500
    ends = rail["receiver"].values

    def paths(antennas):
        return np.linalg.norm(points - antennas[..., None, :], axis=-1).mean(axis=1)

    true = paths(ends)
    phase = np.empty((draws, len(points)))
    for number in range(draws):
        # Both channels are off: the steps find all but the constant between them.
        wrong = std * rng.standard_normal((2, 1, 3)) / np.sqrt(count)
        moved = paths(ends + wrong - wrong.mean(axis=0)) - true
        phase[number] = 4 * np.pi / WAVELENGTH * (moved[0] - moved[1])
    phase -= phase[:, :1]
    displacement = std * rng.standard_normal((2, count, 3))
    displacement -= displacement.mean(axis=1, keepdims=True)
    displacement *= std / displacement.std(axis=1, keepdims=True)
    product = motion_product(displacement, np.zeros((2, count, 3)))
    instrument = Instrument.of(rail, FREQUENCY)
    told = assessment.motion_variance(
        product, instrument.over(x[None, :], y[:, None]), REFERENCE
    ).ravel()
    assert told[0] == 0
    # The variance of 1500 draws is known to 4 %; the two channels of 81 positions correlate to a
    # ninth by chance, which changes their difference's as much. Three times both.
    np.testing.assert_allclose(told[1:], phase.var(axis=0)[1:], rtol=0.36)


def test_positions_of_which_nothing_is_known_leave_no_phase(rail):
    unknown = np.full((2, rail.sizes["position"], 3), np.nan)
    product = motion_product(np.zeros(unknown.shape), unknown)
    instrument = Instrument.of(rail, FREQUENCY)
    axis = np.array([10.0, 11.0])
    told = assessment.motion_variance(product, instrument.over(axis - 10, axis[:, None]), REFERENCE)
    assert told == uncertainty.UNIFORM


@pytest.mark.parametrize("channels", ["common", "independent"])
def test_heights_after_autofocus_keep_within_their_standard_deviations(channels):
    """Coverage of what is delivered, of two realizations with errors of a wavelength along y."""
    shares = []
    for realization in range(2):
        study = vinsar.load(
            realization=realization,
            autofocus={"method": "echoes"},
            motion={"axis": "y", "channels": channels, "level_wavelengths": 1.0},
            imaging={"grid_spacing_m": 0.05},
            filtering={"goldstein_patch_px": 32},
            echo={"accuracy_db": -60.0},
        )
        found = vinsar.run(study, "accuracy")["accuracy"].sel(region="delivered")
        shares.append([float(found[f"coverage_{times}_sigma"]) for times in (1, 2)])
    # A tilt is common to all heights of a realization, so their number does not
    # count: a coverage scatters by 0.03 from one to the next. Three times that of the mean.
    np.testing.assert_allclose(np.mean(shares, axis=0), [0.683, 0.954], atol=3 * 0.03 / np.sqrt(2))
