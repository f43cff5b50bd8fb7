"""The noise of the interferometric phase, against closed forms and drawn speckle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import spence

from vinsar.radar import speckle


def drawn_phase(coherence, looks, draws=20_000, seed=0):
    """Return phases of averaged pairs of circular Gaussian numbers."""
    rng = np.random.default_rng(seed)
    common, first, second = rng.standard_normal((3, looks, draws, 2)) @ np.array([1, 1j])
    pair = [np.sqrt(coherence) * common + np.sqrt(1 - coherence) * part for part in (first, second)]
    return np.angle((pair[0] * pair[1].conj()).sum(axis=0))


@pytest.mark.parametrize("coherence", [0.0, 0.3, 0.8, 0.975, 0.999])
def test_of_a_single_look_the_std_is_the_closed_form(coherence):
    # Bamler and Hartl 1998, Eq. 48.
    angle = np.arcsin(coherence)
    variance = np.pi**2 / 3 - np.pi * angle + angle**2 - spence(1 - coherence**2) / 2
    assert speckle.phase_std(coherence, 1) == pytest.approx(np.sqrt(variance), rel=1e-6)


@pytest.mark.parametrize(("coherence", "looks"), [(0.98, 2), (0.6, 3), (0.9, 16), (0.4, 40)])
def test_of_more_looks_the_std_is_that_of_drawn_speckle(coherence, looks):
    phase = drawn_phase(coherence, looks)
    # The std of an estimated std is sqrt((kurtosis - 1) / 4 n) of it: four of them.
    kurtosis = (phase**4).mean() / (phase**2).mean() ** 2
    chance = 4 * np.sqrt((kurtosis - 1) / (4 * phase.size))
    assert speckle.phase_std(coherence, looks) == pytest.approx(phase.std(), rel=chance)


def test_many_looks_reach_the_bound_and_few_do_not():
    for looks in (1e3, 1e5):
        np.testing.assert_allclose(
            speckle.phase_std([0.5, 0.9], looks), speckle.phase_bound([0.5, 0.9], looks), rtol=3e-3
        )
    assert speckle.phase_std(0.975, 1) > 2.4 * speckle.phase_bound(0.975, 1)
    assert float(speckle.phase_bound(1.0, 1)) == 0
    assert float(speckle.phase_bound(0.0, 1)) == np.inf
    # Shapes broadcast.
    assert speckle.phase_std([[0.3], [0.6]], [1.0, 2.0, 4.0]).shape == (2, 3)


def test_a_pixel_has_the_noise_of_a_range_cell_over_the_width_that_the_scene_fills():
    # The whole unambiguous width filled: the range cell's ratio is the pixel's.
    np.testing.assert_allclose(speckle.pixel_coherence(1.0, [0.0, 10.0], 1.0), [0.5, 10 / 11])
    assert speckle.pixel_coherence(0.9, 0.0, 0.25) == pytest.approx(0.9 / 1.25)
    assert speckle.pixel_coherence(0.9, np.inf, 0.25) == pytest.approx(0.9)
    # A defocused target loses power to its neighbours.
    assert speckle.pixel_coherence(1.0, np.inf, 0.5, 0.4) == pytest.approx(0.4 / (0.4 + 0.6 * 0.5))
