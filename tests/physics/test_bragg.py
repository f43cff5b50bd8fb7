"""Facets on an even grid scatter like a crystal; a jitter of one cell ends that."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations import variables
from vinsar.radar import geometry
from vinsar.simulation import echo, scene

SIZE, COUNT = 0.0321, 100
FAR, HEIGHT = 200.0, 2.0
LIGHT = 299_792_458.0


@pytest.fixture(scope="module")
def strip():
    """A strip of level ground, one facet wide and 100 deep, so far away that waves are plane."""
    return scene.terrain(
        "flat", x_min_m=-SIZE / 2, x_max_m=SIZE / 2, y_min_m=FAR, y_max_m=FAR + COUNT * SIZE,
        spacing_m=SIZE, peak_height_m=1.0, reflectivity_offset=1.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def antenna():
    position = np.tile([0.0, 0.0, HEIGHT], (2, 1, 1))
    return variables.dataset("trajectory", {"transmitter": position, "receiver": position})


@pytest.fixture(scope="module")
def resonance():
    """The frequency in 13..15 GHz where 2 d sin(theta) / lambda is a whole number, 3."""
    look = geometry.look_angle((0, 0, HEIGHT), 0, FAR + COUNT * SIZE / 2)
    frequency = float(3 * LIGHT / (2 * SIZE * np.sin(look)))
    assert 13e9 < frequency < 15e9
    return frequency


def returns(strip, antenna, frequency, jitter, seed=0):
    facets = scene.facets(
        strip, facet_size_m=SIZE, facet_jitter=jitter, rng=np.random.default_rng(seed)
    )
    signal = echo.simulate(facets, antenna, frequency=frequency, accuracy_db=None)
    return signal["echo"].values[0, 0]


def test_without_jitter_the_echoes_of_all_facets_add_up_at_resonance(strip, antenna, resonance):
    # The next resonances are LIGHT / 2 d = 4.7 GHz away. Between them a grid of N facets adds up
    # like sin(N a) / sin(a); one step of LIGHT / 2 d N is to its first zero.
    step = LIGHT / (2 * SIZE * COUNT)
    power = np.abs(returns(strip, antenna, resonance + step * np.arange(-8, 9), 0.0)) ** 2
    # The sphericity of the wave over the strip, (4 pi / lambda) L^2 cos^2 / 8 r < 1e-3 rad, and
    # its changing look angle leave N^2 all but whole.
    assert power[8] == pytest.approx(COUNT**2, rel=1e-3)
    assert np.delete(power, 8).max() < 1e-3 * COUNT**2


def test_with_full_jitter_the_resonance_is_gone_and_speckle_is_left(strip, antenna, resonance):
    seeds = 200
    frequency = resonance + np.array([0.0, 1e6])
    signal = np.array([returns(strip, antenna, frequency, 1.0, seed)[0] for seed in range(seeds)])
    # The jitter's characteristic function is sinc(3) = 0, so the expected sum is zero: the mean of
    # K sums has the mean power N / K, exponentially distributed (exp(-12) = 6e-6).
    assert np.abs(signal.mean()) ** 2 < 12 * COUNT / seeds
    # Random phases: mean power N and a variance of N^2 (1 - 1/N), four standard errors.
    power = np.abs(signal) ** 2
    assert power.mean() == pytest.approx(COUNT, rel=4 / np.sqrt(seeds))
    # Speckle's contrast is 1. Its estimate errs by about sqrt(2 / K), as powers of 4 count.
    assert power.std() / power.mean() == pytest.approx(1, abs=4 * np.sqrt(2 / seeds))


def test_half_a_jitter_leaves_the_resonance_its_characteristic_function(strip, antenna, resonance):
    seeds = 100
    frequency = resonance + np.array([0.0, 1e6])
    mean = np.mean([returns(strip, antenna, frequency, 0.5, seed)[0] for seed in range(seeds)])
    # sinc(3 / 2) = -0.212 of each facet's echo stays coherent; the rest averages out.
    expected = COUNT * np.sinc(1.5)
    assert np.abs(mean) == pytest.approx(np.abs(expected), abs=3.5 * np.sqrt(COUNT / seeds))
