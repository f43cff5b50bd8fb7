"""The covariance of an interferogram's noise, against simulated bands."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.radar.decorrelation import Decorrelation

CELLS, FINE = 12, 4
"""Resolution cells and pixels a cell of the simulated lines."""


def decorrelation(coherence, shift, displacement=0.0, resolution=1.0, fringes=0.0):
    return Decorrelation(
        coherence=np.array([coherence]),
        shift=np.array([[0.0], [shift]]),
        displacement=np.array([displacement]),
        resolution=np.full((2, 1), resolution),
        fringes=np.array([[0.0], [fringes]]),
    )


def lines(rng, count, shift, displacement, thermal):
    """Pairs of lines that see the same reflectivity in bands a share of the band apart."""
    samples = 20 * CELLS
    spectrum = rng.normal(size=(count, 2 * samples, 2)).view(complex)[..., 0]
    place = np.arange(CELLS * FINE) / FINE
    wave = np.arange(samples) / samples
    found = []
    for begin, moved in ((0, 0.0), (round(shift * samples), displacement)):
        # Back at zero frequency after the flat-earth phase: what is left is the shift.
        turn = np.exp(2j * np.pi * np.outer(wave + begin / samples, place + moved))
        part = spectrum[:, begin : begin + samples] @ turn
        found.append(part / np.sqrt(2 * samples))
    noise = rng.normal(size=(2, count, samples, 2)).view(complex)[..., 0]
    turn = np.exp(2j * np.pi * np.outer(wave, place)) / np.sqrt(2 * samples)
    level = np.sqrt(1 / thermal - 1)
    return [part + level * (extra @ turn) for part, extra in zip(found, noise, strict=True)]


@pytest.mark.parametrize(
    ("shift", "displacement", "thermal"),
    [(0.0, 0.0, 0.8), (0.1, 0.0, 1.0), (0.0, 0.2, 1.0), (0.1, 0.15, 0.9)],
)
@pytest.mark.parametrize("window", [1, 8])
def test_the_noise_that_an_average_leaves_is_that_of_simulated_bands(
    shift, displacement, thermal, window
):
    rng = np.random.default_rng(3)
    count = 2500
    lower, upper = lines(rng, count, shift, displacement, thermal)
    middle = slice(CELLS * FINE // 2, CELLS * FINE // 2 + window)
    mean = (lower * np.conj(upper))[:, middle].mean(axis=1)
    phase = np.angle(mean.mean())
    found = np.var((mean * np.exp(-1j * phase)).imag)
    power = np.mean(np.abs(lower) ** 2) * np.mean(np.abs(upper) ** 2)
    pixel = decorrelation(1.0, shift, displacement)
    pixel = decorrelation(float(pixel.geometric[0]) * thermal, shift, displacement)
    lag = np.arange(1 - window, window)
    weight = (window - np.abs(lag)) / window**2
    own, cross = (float((part @ weight)[0]) for part in pixel.correlations(1, lag / FINE))
    expected = power / 2 * (own - thermal**2 * cross)
    # The variance of n values of a heavier than normal tail: four standard errors of 1 / sqrt(n),
    # and the finite sample of the power, which the thermal part does not share.
    assert found == pytest.approx(expected, rel=4 * 1.5 / np.sqrt(count))


def test_the_baselines_noise_has_nothing_at_frequency_zero():
    pixel = decorrelation(0.9, 0.1)
    lag = np.linspace(-400, 400, 160_001)
    own, cross = pixel.correlations(1, lag)
    step = lag[1] - lag[0]
    # Both integrals are the shared band, 0.9; truncated at 400 cells they are so to 1 / (pi^2 400).
    assert own.sum() * step == pytest.approx(0.9, abs=1e-3)
    assert cross.sum() * step == pytest.approx(0.9, abs=1e-3)


def test_coherence_factors_into_shift_displacement_and_the_rest():
    pixel = decorrelation(0.72 * np.sinc(0.9 * 0.2), 0.1, 0.2)
    assert pixel.geometric[0] == pytest.approx(0.9 * np.sinc(0.9 * 0.2))
    assert pixel.thermal[0] == pytest.approx(0.8)
    own, cross = pixel.correlations(1, np.zeros(1))
    assert own[0, 0] == 1
    assert cross[0, 0] == pytest.approx(pixel.geometric[0] ** 2)
    assert pixel.combine(np.ones(1), np.array([pixel.geometric[0] ** 2]))[0] == pytest.approx(1)


def test_pixels_are_taken_by_their_indices():
    field = np.arange(12.0).reshape(3, 4) / 12
    whole = Decorrelation(field, np.stack([field, field + 1]), field, field[None] + [[[1]], [[2]]],
                          np.stack([field, field]))  # fmt: skip
    part = whole.at(np.ix_([0, 2], [1, 3]))
    np.testing.assert_array_equal(part.coherence * 12, [1, 3, 9, 11])
    np.testing.assert_array_equal(part.resolution[1], part.coherence + 2)
