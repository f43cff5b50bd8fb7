"""Suppression of the coupling: what is removed, and what is not."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations import variables
from vinsar.processing import leakage
from vinsar.radar import waveform

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 401)
CELL = LIGHT / 2 / (401 * 5e6)


def returns(*slant_range_m):
    """One channel's spectra, a position each, of one unit return."""
    samples = np.exp(-4j * np.pi * np.outer(slant_range_m, FREQUENCY) / LIGHT)
    coords = {"channel": ["lower"], "frequency": FREQUENCY}
    return variables.dataset("received", {"echo": samples[None]}, coords)


def power(data):
    return np.mean(np.abs(data["echo"].values[0]) ** 2, axis=-1)


def test_without_a_method_the_echo_passes_as_it_is():
    echo = returns(0.2, 5.0)
    assert leakage.suppress(echo, method="none", gate_range_m=1.0) is echo


def test_the_gate_removes_near_returns_wherever_they_lie_between_the_cells():
    left = power(leakage.gate(returns(*np.linspace(0, 1, 41)), range_m=1.0))
    assert 10 * np.log10(left.max()) < -110


def test_the_gate_leaves_far_returns():
    left = power(leakage.gate(returns(*np.linspace(10, 16, 61)), range_m=1.0))
    # The gate's 14 cells and the dozen of its edge span 26 of 401 dimensions. The edge's leak as
    # 1 / d^2 with the distance in cells: 12 / (2 pi^2 120^2), and the range ends at 30 m again.
    assert 1 - left.min() < 4 * 12 / (np.pi**2 * 120**2) * 20
    assert 1 - left.min() > 0


def test_what_is_common_to_all_positions_goes_and_the_rest_stays():
    echo = returns(5.0, 5.0 + LIGHT / 14e9 / 4)
    echo["echo"].values[...] += 7.0
    left = leakage.remove_common(echo)["echo"].values
    assert np.abs(left.mean(axis=1)).max() < 1e-12
    difference = left[0, 0] - left[0, 1]
    assert difference == pytest.approx(echo["echo"].values[0, 0] - echo["echo"].values[0, 1])


def test_a_constant_return_at_any_range_is_common():
    assert power(leakage.remove_common(returns(7.3, 7.3, 7.3))).max() < 1e-24


def test_both_methods_do_the_same_in_either_order():
    echo = returns(0.2, 0.21, 5.0, 5.003)
    one = leakage.suppress(echo, method="both", gate_range_m=1.0)
    other = leakage.gate(leakage.remove_common(echo), range_m=1.0)
    np.testing.assert_allclose(one["echo"], other["echo"], atol=1e-12)


@pytest.mark.parametrize("range_m", [0.0, -1.0, 31.0])
def test_a_gate_beyond_the_unambiguous_range_is_refused(range_m):
    with pytest.raises(ValueError, match=r"unambiguous range of 29\.98 m"):
        leakage.gate(returns(1.0), range_m=range_m)
