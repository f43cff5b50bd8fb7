"""The contributions of positions to an image, and what autofocus refuses."""

from __future__ import annotations

import itertools
import logging

import numpy as np
import pytest

from vinsar.kernels import contributions, cycles
from vinsar.processing import autofocus, focusing
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
EXTENT = (-1.0, 1.0, 10.0, 12.0)


def seen_by(antennas, scatterers, count=400, seed=0):
    """The echo of level speckle: scatterers at random places of random amplitude."""
    rng = np.random.default_rng(seed)
    places = np.zeros((count, 3))
    places[:, 0] = rng.uniform(*EXTENT[:2], count)
    places[:, 1] = rng.uniform(*EXTENT[2:], count)
    return echo.simulate(scatterers(places), antennas, frequency=FREQUENCY, accuracy_db=None)


@pytest.mark.parametrize("system", ["rail", "bistatic"])
def test_contributions_are_the_matched_filter_of_each_position(system, request, scatterers):
    antennas = request.getfixturevalue(system)
    received = seen_by(antennas, scatterers, count=20)
    profiles = focusing.compress(
        received, near_range_m=9.0, far_range_m=14.0, oversampling=16, interpolation="linear"
    )
    points = np.array([[0.3, 10.7, 0.0], [-0.8, 11.5, 0.1], [0.0, 30.0, 0.0]])
    slant = profiles["slant_range"].values
    ends = [antennas[name].values.reshape(-1, 3) for name in ("transmitter", "receiver")]
    given = (
        profiles["profile"].values.reshape(-1, slant.size),
        slant[0],
        (slant[-1] - slant[0]) / (slant.size - 1),
        2 * waveform.carrier(FREQUENCY) / LIGHT,
        *ends,
        np.ascontiguousarray(points.T),
    )
    found = np.empty((len(ends[0]), len(points)), np.complex64)
    image, power = np.empty(len(points), np.complex64), np.empty(len(points), np.float32)
    contributions.fill(*given, found, image, power)
    path = sum(np.linalg.norm(points - end[:, None], axis=-1) for end in ends)
    filters = np.exp(2j * np.pi * FREQUENCY * path[..., None] / LIGHT)
    direct = np.einsum(
        "af,apf->ap", received["echo"].values.reshape(len(path), -1), filters / FREQUENCY.size
    )
    # Linear interpolation at 16 samples a cell errs by -64 dB of the power.
    error = np.abs(found - direct)[:, :2]
    assert np.sqrt((error**2).mean() / (np.abs(direct[:, :2]) ** 2).mean()) < 10 ** (-60 / 20)
    np.testing.assert_array_equal(found[:, 2], 0)
    # Sums in single precision round by 6e-8 of their parts each.
    size = np.abs(found).sum(axis=0)
    assert (np.abs(image - found.sum(axis=0)) <= 6e-8 * len(found) * size).all()
    np.testing.assert_allclose(power, (np.abs(found) ** 2).sum(axis=0), rtol=6e-8 * len(found))
    alone = np.empty_like(image)
    contributions.fill(*given, found[:0], alone, power)
    np.testing.assert_array_equal(alone, image)


def test_each_position_is_held_against_the_others_by_sector():
    rng = np.random.default_rng(4)
    parts = (rng.standard_normal((5, 9, 2)) @ [1, 1j]).astype(np.complex64)
    reference = parts.sum(axis=0)
    begins = np.array([0, 3, 7, 9])
    found = np.empty((5, 3), complex)
    contributions.agree(parts, reference, begins, found)
    for sector, part in enumerate([slice(0, 3), slice(3, 7), slice(7, 9)]):
        direct = (parts * (reference - parts).conj())[:, part].sum(axis=1)
        # A dozen numbers of size 10 in single precision.
        np.testing.assert_allclose(found[:, sector], direct, atol=1e-4)


def test_phases_are_joined_whatever_their_weights(rail, scatterers):
    """Weights that fall by six orders of magnitude along the rail: no antenna may be left out."""
    samples = autofocus._Samples(seen_by(rail, scatterers, count=20), rail, EXTENT)
    pairs = autofocus._Pairs(samples)
    rng = np.random.default_rng(5)
    phase = rng.uniform(-np.pi, np.pi, pairs.size)
    products = np.exp(1j * (phase[pairs.first] - phase[pairs.second]))
    place = (pairs.first + pairs.second) % samples.positions / samples.positions
    found = pairs.synchronised(products, 10 ** (-6 * place))
    turn = found * np.exp(-1j * phase)
    # All phases agree, so the solution is exact but for rounding.
    np.testing.assert_allclose(turn / turn[0], 1, atol=1e-6)


def test_the_likeliest_path_is_the_best_of_all():
    positions, states, most = 5, 4, 1
    rng = np.random.default_rng(6)
    gain = rng.standard_normal((positions - 1, 2 * most + 1))
    cost = rng.standard_normal((positions, states))

    def worth(path):
        jumps = np.diff(path)
        if np.abs(jumps).max() > most:
            return -np.inf
        return gain[np.arange(positions - 1), jumps + most].sum() - sum(
            cost[place, state] for place, state in enumerate(path)
        )

    best = max(itertools.product(range(states), repeat=positions), key=worth)
    path = np.empty(positions, np.int64)
    cycles.likeliest(gain, cost, path)
    np.testing.assert_array_equal(path, best)


def test_displacements_are_added_to_both_ends(bistatic):
    shift = np.random.default_rng(1).standard_normal(bistatic["receiver"].shape)
    moved = trajectory.displaced(bistatic, shift)
    for name in ("transmitter", "receiver"):
        np.testing.assert_allclose(moved[name] - bistatic[name], shift, atol=1e-12)
        assert moved[name].attrs == bistatic[name].attrs


def rail_of(spacing, length):
    return trajectory.rail(
        aperture_length_m=length,
        position_spacing_m=spacing,
        rail_height_m=2.0,
        baseline_m=0.3,
        baseline_angle_deg=90.0,
    )


@pytest.mark.parametrize(
    ("antennas", "reason"),
    [
        (rail_of(0.1, 0.8), "9 positions are too few"),
        (rail_of(0.1, 2.0), "see other speckle"),
        # A part of the rail was not recorded.
        (rail_of(0.01, 0.8).isel(position=[*range(30), *range(42, 81)]), "positions 29 and 30"),
    ],
    ids=["few positions", "wide spacing", "gap"],
)
def test_what_the_echoes_cannot_tell_is_left_alone_with_a_warning(
    antennas, reason, scatterers, caplog
):
    received = seen_by(antennas, scatterers)
    with caplog.at_level(logging.WARNING):
        found = autofocus.estimate(received, antennas, extent=EXTENT)
    assert reason in found.reason
    assert found.reason in caplog.text
    assert not found.displacement.any()
    assert not found.range_correction.any()
    assert np.isnan(found.displacement_std).all()
    assert np.isnan(found.range_std).all()


def test_noise_alone_moves_nothing(rail, scatterers):
    received = seen_by(rail, scatterers)
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((2, *received["echo"].shape))
    received["echo"].values[:] = noise[0] + 1j * noise[1]
    found = autofocus.estimate(received, rail, extent=EXTENT)
    assert found.reason
    assert not found.displacement.any()
