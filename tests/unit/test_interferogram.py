"""The interferogram's sign (Eq. 10) and the coherence."""

from __future__ import annotations

from math import gamma, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vinsar.foundations import variables
from vinsar.processing import interferogram


def images(lower, upper):
    rows, columns = lower.shape
    return variables.dataset(
        "images",
        {
            "image": np.stack([lower, upper]).astype(np.complex64),
            "wavelength": 0.0214,
            "transmitter": np.zeros((2, 1, 3)),
            "receiver": np.zeros((2, 1, 3)),
        },
        {"x": 0.1 * np.arange(columns), "y": 5 + 0.1 * np.arange(rows)},
    )


def speckle(seed, shape=(200, 200)):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).view(complex)[..., 0] / sqrt(2)


def test_eq_10_is_lower_times_conjugate_upper():
    lower, upper = np.full((3, 4), 2 * np.exp(0.9j)), np.full((3, 4), 3 * np.exp(0.2j))
    found = interferogram.form(images(lower, upper), coherence_window_px=3)
    np.testing.assert_allclose(found["interferogram"].values, 6 * np.exp(0.7j), rtol=1e-6)
    np.testing.assert_allclose(found["x"], [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(found["y"], [5.0, 5.1, 5.2])


def test_the_channels_are_found_by_name():
    lower, upper = speckle(1, (4, 4)), speckle(2, (4, 4))
    data = images(lower, upper)
    swapped = data.isel(channel=[1, 0])
    np.testing.assert_array_equal(
        interferogram.form(data, coherence_window_px=1)["interferogram"],
        interferogram.form(swapped, coherence_window_px=1)["interferogram"],
    )


@pytest.mark.parametrize("window", [1, 3, 7])
def test_images_equal_up_to_a_factor_are_fully_coherent(window):
    image = speckle(0, (30, 20))
    found = interferogram.coherence(image, 0.3 * np.exp(2j) * image, window)
    np.testing.assert_allclose(found, 1, atol=1e-12)


def test_a_phase_ramp_within_the_window_loses_the_coherence_of_its_sum():
    # Unit phasors that turn by d from column to column add up to a Dirichlet kernel.
    turn, window = 0.4, 5
    image = np.exp(1j * turn * np.arange(40)) * np.ones((20, 1))
    found = interferogram.coherence(image, np.ones_like(image), window)
    expected = np.sin(window * turn / 2) / (window * np.sin(turn / 2))
    np.testing.assert_allclose(found[2:-2, 2:-2], expected, rtol=1e-12)


def naive_coherence(lower, upper, window):
    half = window // 2
    result = np.zeros(lower.shape)
    for row in range(lower.shape[0]):
        for column in range(lower.shape[1]):
            part = np.s_[
                max(0, row - half) : row + half + 1, max(0, column - half) : column + half + 1
            ]
            a, b = lower[part], upper[part]
            power = np.sum(np.abs(a) ** 2) * np.sum(np.abs(b) ** 2)
            result[row, column] = np.abs(np.vdot(b, a)) / sqrt(power)
    return result


@pytest.mark.parametrize("window", [1, 3, 5, 9])
def test_coherence_is_that_of_the_samples_in_the_window(window):
    lower = speckle(3, (12, 17))
    upper = lower + speckle(4, (12, 17))
    found = interferogram.coherence(lower, upper, window)
    np.testing.assert_allclose(found, naive_coherence(lower, upper, window), atol=1e-12)


@pytest.mark.parametrize("window", [3, 5])
def test_independent_speckle_has_the_bias_of_a_sample_coherence(window):
    looks = window**2
    found = interferogram.coherence(speckle(5), speckle(6), window)[window:-window, window:-window]
    # Touzi et al. 1999 at zero coherence: Gamma(L) Gamma(3/2) / Gamma(L + 1/2).
    expected = gamma(looks) * gamma(1.5) / gamma(looks + 0.5)
    # At zero coherence E[g^2] = 1 / L; windows that do not overlap are independent.
    deviation = sqrt(1 / looks - expected**2)
    assert found.mean() == pytest.approx(expected, abs=4 * deviation / sqrt(found.size / looks))


moderate = st.complex_numbers(max_magnitude=1e3, allow_nan=False, allow_infinity=False)


@given(
    data=arrays.arrays(complex, (2, 6, 5), elements=moderate),
    window=st.sampled_from([1, 3, 5, 7]),
)
def test_coherence_stays_between_0_and_1(data, window):
    found = interferogram.coherence(data[0], data[1], window)
    assert found.shape == (6, 5)
    assert np.all((found >= 0) & (found <= 1))


def test_where_an_image_is_dark_there_is_no_coherence():
    image = np.ones((9, 9), complex)
    dark = image.copy()
    dark[:, :5] = 0
    found = interferogram.coherence(image, dark, 3)
    assert not found[:, :4].any()
    np.testing.assert_allclose(found[:, 6:], 1)


@pytest.mark.parametrize("window", [0, -3, 4])
def test_an_even_window_is_refused(window):
    with pytest.raises(ValueError, match="must be odd and positive"):
        interferogram.coherence(np.ones((5, 5)), np.ones((5, 5)), window)
