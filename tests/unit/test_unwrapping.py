"""Unwrapping: each solver gives a smooth surface back, whole cycles apart from what went in."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vinsar.foundations import variables
from vinsar.processing import unwrapping

METHODS = ("whirlwind", "skimage", "kamui")


def unwrap(phase, method, looks=4.0):
    rows, columns = phase.shape
    coords = {"x": 0.1 * np.arange(columns), "y": 0.1 * np.arange(rows)}
    filtered = variables.dataset(
        "filtered", {"interferogram": np.exp(1j * phase).astype(np.complex64)}, coords
    )
    coherence = xr.DataArray(np.full(phase.shape, 0.9), dims=("y", "x"))
    return unwrapping.unwrap(filtered, coherence, method=method, looks=looks)


def assert_equal_up_to_whole_cycles(found, phase):
    cycles = (found - phase) / (2 * np.pi)
    # The interferogram is in single precision: its phase errs by 1e-7.
    np.testing.assert_allclose(cycles, np.rint(cycles[0, 0]), atol=1e-6)


@pytest.fixture(scope="module")
def hills():
    """A smooth surface over several cycles, with noise too small for any residue."""
    y, x = np.mgrid[-1:1:50j, -1:1:60j]
    surface = 14 * np.exp(-3 * ((x - 0.2) ** 2 + (y + 0.1) ** 2)) - 4 * x + 2 * x * y
    phase = surface + np.random.default_rng(0).normal(scale=0.2, size=surface.shape)
    steps = np.concatenate([np.diff(phase, axis=0).ravel(), np.diff(phase, axis=1).ravel()])
    assert np.abs(steps).max() < np.pi, "then the wrapped differences are the true ones"
    assert np.ptp(phase) > 4 * np.pi
    return phase


@pytest.mark.parametrize("method", METHODS)
def test_a_smooth_noisy_surface_comes_back_up_to_a_constant(hills, method):
    found = unwrap(hills, method)
    assert_equal_up_to_whole_cycles(found["phase"].values, hills)
    assert not found["residue"].values.any()


@pytest.mark.parametrize("method", METHODS)
def test_the_result_is_congruent_with_the_wrapped_phase(method):
    # Pure noise: no solution is right, but each must differ by whole cycles from what went in.
    phase = np.random.default_rng(1).uniform(-np.pi, np.pi, (30, 30))
    found = unwrap(phase, method)
    wrapped = np.angle(np.exp(1j * phase).astype(np.complex64).astype(complex))
    cycles = (found["phase"].values - wrapped) / (2 * np.pi)
    np.testing.assert_allclose(cycles, np.rint(cycles), atol=1e-12)
    assert np.abs(found["residue"].values).sum() > 50


@settings(max_examples=40)
@given(
    method=st.sampled_from(["whirlwind", "skimage"]),
    rows=st.integers(4, 16), columns=st.integers(4, 16),
    slopes=st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5)), start=st.floats(-3, 3),
)  # fmt: skip
def test_a_ramp_is_exact_up_to_a_constant(method, rows, columns, slopes, start):
    y, x = np.mgrid[:rows, :columns]
    phase = start + slopes[0] * x + slopes[1] * y
    assert_equal_up_to_whole_cycles(unwrap(phase, method)["phase"].values, phase)


@pytest.mark.parametrize("method", METHODS)
def test_a_scene_half_in_one_cycle_and_half_in_the_next_keeps_both(method):
    phase = np.tile(np.linspace(-np.pi + 0.01, 3 * np.pi - 0.01, 40), (20, 1))
    assert_equal_up_to_whole_cycles(unwrap(phase, method)["phase"].values, phase)


@pytest.mark.parametrize("method", METHODS)
def test_isolated_residues_do_not_spoil_the_surface(hills, method):
    phase = hills + np.random.default_rng(2).normal(scale=0.55, size=hills.shape)
    found = unwrap(phase, method)
    assert found["residue"].values.any()
    cycles = np.rint((found["phase"].values - phase) / (2 * np.pi))
    values, counts = np.unique(cycles, return_counts=True)
    del values
    # A cut between the two residues of a pair leaves a few pixels a cycle off, no more.
    assert counts.max() >= 0.98 * phase.size


def wrap(value):
    return (value + np.pi) % (2 * np.pi) - np.pi


def naive_residue(phase, row, column):
    ring = [(row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column)]
    total = 0.0
    for here, there in zip(ring, ring[1:] + ring[:1], strict=True):
        total += wrap(phase[there] - phase[here])
    return round(total / (2 * np.pi))


phases = arrays.arrays(float, (6, 7), elements=st.floats(-3.1, 3.1))


@given(phase=phases)
def test_residues_are_the_sums_of_wrapped_steps_around_each_cell(phase):
    steps = np.concatenate([np.diff(phase, axis=0).ravel(), np.diff(phase, axis=1).ravel()])
    # Steps of half a cycle may be wrapped either way.
    phase = phase + (1e-3 if np.any(np.isclose(np.abs(steps), np.pi)) else 0) * np.mgrid[:6, :7][0]
    found = unwrapping.residues(phase)
    expected = [[naive_residue(phase, row, column) for column in range(6)] for row in range(5)]
    np.testing.assert_array_equal(found[:-1, :-1], expected)
    assert not found[-1].any()
    assert not found[:, -1].any()
    assert np.abs(found).max() <= 1


@given(phase=phases)
def test_residues_add_up_to_the_turns_around_the_edge(phase):
    edge = np.concatenate([phase[0], phase[1:, -1], phase[-1, -2::-1], phase[-2:0:-1, 0]])
    turns = wrap(np.diff(np.append(edge, edge[0]))).sum() / (2 * np.pi)
    assert unwrapping.residues(phase).sum() == round(turns)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_vortex_has_one_residue_of_its_sense(sign):
    y, x = np.mgrid[-3:5, -4:4] + 0.5
    found = unwrapping.residues(sign * np.arctan2(y, x))
    assert np.argwhere(found).tolist() == [[2, 3]]
    assert found[2, 3] == sign


def test_a_smooth_surface_has_no_residues(hills):
    assert not unwrapping.residues(wrap(hills)).any()


def test_without_snaphu_the_error_says_what_to_do(hills):
    if importlib.util.find_spec("snaphu"):
        pytest.skip("snaphu is installed here")
    with pytest.raises(ValueError, match=r"snaphu is not installed.*pip.*unwrapping.method"):
        unwrap(hills, "snaphu")


def test_an_unknown_unwrapper_is_refused_with_those_there_are(hills):
    with pytest.raises(ValueError, match="no unwrapper 'magic'; there are whirlwind, skimage"):
        unwrap(hills, "magic")
