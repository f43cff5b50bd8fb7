"""Errors of positions, taken from the echoes of speckle that nobody told the method."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.processing import autofocus
from vinsar.radar import motion, trajectory, waveform
from vinsar.simulation import echo

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 401)
WAVELENGTH = LIGHT / 14e9
EXTENT = (-2.5, 2.5, 10.0, 14.0)


@pytest.fixture(scope="module")
def received(rail, scatterers):
    rng = np.random.default_rng(3)
    count = 20_000
    places = np.zeros((count, 3))
    places[:, 0] = rng.uniform(*EXTENT[:2], count)
    places[:, 1] = rng.uniform(*EXTENT[2:], count)
    # A hill, so that the two antennas see other phases, as they do of any relief.
    places[:, 2] = 0.2 * np.exp(-((places[:, 0] - 0.5) ** 2) - (places[:, 1] - 12) ** 2)
    return echo.simulate(scatterers(places), rail, frequency=FREQUENCY, accuracy_db=-60.0)


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
