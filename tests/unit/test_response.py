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
    # Two steps a patch are what the response takes.
    expected = filtering.goldstein(values, alpha=0.8, patch_px=16, step_px=8)
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


GROUND = response.Rough(0.25, (0.18, 0.08), (0.05, 0.05), (11, 11))


def drawn(rng, ground, count):
    """Rough ground about its mean over the window, drawn from its spectrum, and its image's."""
    power, cell = ground.spectra(count)
    white = np.fft.fft2(rng.standard_normal((count, count)))
    seen = [np.fft.ifft2(white * np.sqrt(power) * part).real * count for part in (1, cell)]
    return seen[0], seen[1]


def test_rough_ground_is_a_gaussian_less_its_mean_and_a_cell_averages_as_its_point_response():
    count = 128
    power, cell = GROUND.spectra(count)
    assert power.sum() == pytest.approx(1)
    # sinc^2(d / rho) summed over so far that its tail, 1 / pi^2 d, is half a per cent.
    place = np.arange(-800, 801) * 0.05
    for axis, rho in ((0, 0.08), (1, 0.18)):
        response_ = np.sinc(place / rho) ** 2
        k = np.fft.fftfreq(count, 0.05)[:20]
        expected = np.cos(2 * np.pi * np.outer(k, place)) @ response_ / response_.sum()
        np.testing.assert_allclose(np.take(cell, 0, axis=1 - axis)[:20], expected, atol=0.02)
    # Of a plane nothing is left, of waves far shorter than the window everything.
    shape = np.exp(-((np.pi * 0.25 * np.fft.fftfreq(count, 0.05)) ** 2))
    kept = power / np.outer(shape, shape)
    assert kept[0, 0] == 0
    assert kept[1, 1] < 0.01 * kept.max()


@pytest.mark.parametrize("method", filtering.FILTERS)
def test_what_is_taken_of_rough_ground_is_what_the_filter_takes_of_a_drawn_one(method):
    rng = np.random.default_rng(9)
    count = 192
    noise = 0.25 * speckle(rng, (count, count))
    filter_ = of(1 + noise, method, goldstein_patch_px=32)
    true, image = drawn(rng, GROUND, count)
    small = 0.02
    passed = np.angle(filter_.apply((np.exp(1j * small * image)).astype(np.complex64))) / small
    inner = np.s_[16:-16, 16:-16]
    found = filter_.taken(GROUND, true.shape)[inner]
    # 8 m hold a thousand squares of a correlation length: 3 sqrt(2 / 1000) = 13 %.
    assert found.mean() == pytest.approx(np.mean((true - passed)[inner] ** 2), rel=0.15)
