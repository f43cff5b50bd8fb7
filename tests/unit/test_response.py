"""What filters leave of noise and signal, against drawn noise and the filters themselves."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.processing import filtering, response
from vinsar.radar.decorrelation import Decorrelation


def white(shape, coherence=0.6, resolution=1e-6, fringes=0.0):
    """Noise without correlation from pixel to pixel."""
    return Decorrelation(
        coherence=np.full(shape, coherence),
        shift=np.zeros((2, *shape)),
        displacement=np.zeros(shape),
        resolution=np.full((2, *shape), resolution),
        fringes=np.full((2, *shape), fringes),
    )


def speckle(rng, shape):
    return rng.normal(size=(*shape, 2)).view(complex)[..., 0] / np.sqrt(2)


def of(values, method, **options):
    return filtering.response_to(
        values,
        method=method,
        **{
            "goldstein_alpha": 0.8,
            "goldstein_patch_px": 16,
            "boxcar_window_px": 5,
            "gaussian_std_px": 1.5,
        }
        | options,
    )


def test_an_average_of_independent_pixels_leaves_one_over_their_number():
    shape = (20, 23)
    found = of(np.ones(shape, complex), "boxcar").gain(white(shape), shape, (1.0, 1.0))
    # sinc of a million cells is 3e-7 at most.
    np.testing.assert_allclose(found[2:-2, 2:-2], 1 / 25, rtol=1e-5)
    # At a corner three by three are left.
    assert found[0, 0] == pytest.approx(1 / 9, rel=1e-5)
    none = of(np.ones(shape, complex), "none").gain(white(shape), shape, (1.0, 1.0))
    np.testing.assert_array_equal(none, 1)


def test_an_average_of_fine_pixels_is_the_double_sum_over_their_correlation():
    shape, spacing = (9, 9), 0.4
    noise = white(shape, coherence=0.8, resolution=1.0, fringes=0.1)
    found = of(np.ones(shape, complex), "boxcar").gain(noise, shape, (spacing, spacing))[4, 4]
    place = (np.arange(5) - 2) * spacing
    at = np.stack(np.meshgrid(place, place), axis=-1).reshape(-1, 2)
    total = 0.0
    for here in at:
        for there in at:
            alike = np.prod(np.sinc(here - there) ** 2)
            turn = 2 * np.pi * 0.1
            total += alike * np.cos(turn * (here - there)).prod()
            total -= 0.64 * alike * np.cos(turn * (here + there)).prod()
    # Sines cancel over both axes only as far as the window is symmetric, which it is.
    assert found == pytest.approx(total / 25**2 / 0.36, rel=1e-9)


def test_an_average_applied_again_is_the_filter():
    values = speckle(np.random.default_rng(0), (13, 17))
    np.testing.assert_allclose(
        of(values, "boxcar").apply(values), filtering.boxcar(values, window_px=5), atol=1e-6
    )
    np.testing.assert_allclose(
        response.Average(response.gaussian_weights(1.5)).apply(values),
        filtering.gaussian(values, std_px=1.5),
        # Weights below 1 % at three standard deviations are cut here, at four there.
        atol=0.02,
    )


def test_goldstein_applied_again_is_the_filter():
    values = speckle(np.random.default_rng(1), (30, 26)) + 2
    # Four steps a patch are what the response takes.
    expected = filtering.goldstein(values, alpha=0.8, patch_px=16, step_px=4)
    np.testing.assert_allclose(of(values, "goldstein").apply(values), expected, atol=1e-5)


def test_goldstein_leaves_of_noise_what_its_weights_leave():
    rng = np.random.default_rng(2)
    shape = (40, 40)
    filter_ = of(2 + speckle(rng, shape), "goldstein")
    gain = filter_.gain(white(shape), shape, (1.0, 1.0))
    draws = np.array([filter_.apply(speckle(rng, shape)) for _ in range(300)])
    inner = np.s_[8:-8, 8:-8]
    # 300 draws of 24 x 24 pixels, some 40 of them independent: 3 standard errors are 3 %. Patches
    # around a pixel have weights nearly but not quite alike, which takes a little more.
    measured = np.mean(np.abs(draws) ** 2, axis=0)[inner].mean()
    assert measured == pytest.approx(gain[inner].mean(), rel=0.08)


def test_the_mean_of_a_rectangle_has_its_cells_as_looks():
    noise = white((1, 1), resolution=0.1).at(np.ix_([0], [0]))
    assert response.rectangle_gain(noise, (4, 6), (1.0, 1.0)) == pytest.approx(1 / 24, rel=1e-6)


def test_an_unknown_filter_is_refused():
    with pytest.raises(ValueError, match="no filter 'wavelet'"):
        of(np.ones((4, 4)), "wavelet")
