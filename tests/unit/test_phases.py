"""Phases of complex images, against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.processing import phases

# Every octant, the axes with either sign of zero, magnitudes far apart, and nothing at all.
TURNS = np.exp(
    1j * np.concatenate([np.linspace(-np.pi, np.pi, 10_001), np.arange(-8, 9) * np.pi / 8])
)
VALUES = np.concatenate([1e-30 * TURNS, TURNS, 1e30 * TURNS, [1, -1, 1j, -1j, -1 - 0j]])


def test_phases_are_numpy_s():
    # A polynomial of 2e-15, and a few roundings of half a turn.
    np.testing.assert_allclose(phases.angle(VALUES), np.angle(VALUES), atol=4e-15)
    assert phases.angle(np.zeros((2, 3), complex)).tolist() == [[0, 0, 0], [0, 0, 0]]


def test_what_is_not_a_number_has_no_phase():
    values = np.array([complex(np.nan, 1), complex(1, np.nan), complex(np.nan, np.nan)])
    assert np.isnan(phases.angle(values)).all()


@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
def test_units_have_the_phase_and_magnitude_1(kind):
    values = np.append(TURNS * 0.3, [0, 0]).astype(kind).reshape(2, -1)
    found = phases.unit(values)
    assert found.shape == values.shape
    magnitude = np.abs(values)
    expected = np.divide(
        values, magnitude, out=np.zeros(values.shape, complex), where=magnitude > 0
    )
    np.testing.assert_allclose(found, expected, atol=1e-7 if kind == np.complex64 else 1e-15)


def test_phases_of_many_cycles_are_rotated_in_single_precision():
    phase = np.random.default_rng(3).uniform(-1e5, 1e5, 10_000)
    phase[0] = np.nan
    found = phases.rotation(phase)
    assert np.isnan(found[0])
    # Errors below -124 dB, and the rounding of what is left of a cycle to single precision.
    assert np.abs(found - np.exp(-1j * phase))[1:].max() < 10 ** (-124 / 20) + np.pi * 2**-24
