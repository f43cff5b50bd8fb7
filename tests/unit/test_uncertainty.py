"""The variance of a phase, against drawn pairs of images whose phase is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vinsar.processing import filtering, response, uncertainty

SPACING = 1.0, 1.0
NONE = {"method": "none", "goldstein_alpha": 0.8, "goldstein_patch_px": 16, "boxcar_window_px": 5}


def pair(rng, shape, coherence, gain=1.0, phase=0.0):
    """Images of white speckle: a pixel is a resolution cell."""
    first, other = rng.normal(size=(2, *shape, 2)).view(complex)[..., 0] / np.sqrt(2)
    second = coherence * first + np.sqrt(1 - coherence**2) * other
    return np.stack([first, gain * second * np.exp(-1j * phase)])


def unit_cells(shape):
    return uncertainty.Cells(np.ones((2, *shape)), SPACING)


def estimate(images, phase=0.0):
    shape = images.shape[1:]
    return uncertainty.estimate(
        images,
        np.broadcast_to(np.asarray(phase, float), shape),
        np.zeros(shape),
        cells=unit_cells(shape),
        relative_bandwidth=0.1,
    )


@pytest.mark.parametrize("coherence", [0.3, 0.41, 0.5, 0.7, 0.9, 0.98])
def test_coherence_is_not_biased(coherence):
    images = pair(np.random.default_rng(4), (200, 200), coherence, gain=3.0, phase=1.0)
    found = estimate(images).decorrelation.coherence
    # 40 000 pixels in some 800 windows: a standard error of (1 - gamma^2) / sqrt(2 * 40 000).
    assert np.median(found) == pytest.approx(coherence, abs=0.02)


@pytest.mark.parametrize("coherence", [0.8, 0.95])
def test_intervals_of_a_single_look_hold_what_they_say(coherence):
    images = pair(np.random.default_rng(5), (150, 150), coherence)
    product = images[0] * np.conj(images[1])
    variance = uncertainty.noise_variance(
        estimate(images),
        filtering.response_to(product, **NONE),
        product,
        product,
        cells=unit_cells(product.shape),
    )
    error = np.abs(np.angle(product)) / np.sqrt(variance)
    # Binomial: 3 sqrt(0.683 * 0.317 / 22 500) = 0.9 %; the von Mises distribution of a dark pixel
    # is not normal, and the noise is estimated: two per cent more.
    assert np.mean(error < 1) == pytest.approx(0.683, abs=0.03)
    assert np.mean(error < 2) == pytest.approx(0.954, abs=0.02)


def test_a_pixel_without_signal_has_no_phase():
    images = np.zeros((2, 12, 12), complex)
    product = images[0]
    variance = uncertainty.noise_variance(
        estimate(images),
        filtering.response_to(product, **NONE),
        product,
        product,
        cells=unit_cells(product.shape),
    )
    np.testing.assert_allclose(variance, np.pi**2 / 3)


def test_smoothing_of_a_ramp_is_nothing_and_of_a_parabola_its_curvature():
    line = np.arange(80.0)
    filter_ = response.Average(np.full(5, 0.2))
    resolution = np.full((2, 80, 80), 1e-3)
    inner = np.s_[25:-25, 25:-25]

    def smoothed(phase):
        product = np.exp(1j * np.broadcast_to(phase, (80, 80)))
        found = uncertainty.smoothing(
            filter_, product, cells=uncertainty.Cells(resolution, SPACING)
        )
        return found[inner]

    np.testing.assert_allclose(smoothed(0.02 * line), 0, atol=1e-6)
    curvature = 1e-3
    # Five pixels have a second moment of (25 - 1) / 12, half of it times the curvature; chords of
    # the circle, whose means are not those of the angle, are of second order in 0.06 rad.
    expected = curvature * (25 - 1) / 12 / 2
    np.testing.assert_allclose(smoothed(curvature / 2 * (line - 40) ** 2), expected, rtol=0.02)


def test_the_reference_errs_as_its_looks_do_and_as_its_ground_does():
    rng = np.random.default_rng(6)
    shape, coherence = (40, 40), 0.8
    where = np.s_[5:11, 5:17]
    level = np.full(shape, 0.3)

    def told(images):
        product = images[0] * np.conj(images[1])
        return product, uncertainty.reference_variance(
            estimate(images), product, level, where, cells=unit_cells(product.shape)
        )

    variances, found = [], []
    for _ in range(150):
        product, variance = told(pair(rng, shape, coherence, phase=0.3))
        variances.append(variance)
        found.append(np.angle(product[where].mean()))
    # 72 looks; 150 draws have their standard deviation to 3 / sqrt(300) = 17 %. What chance makes
    # of uneven ground is told on top of it.
    assert np.std(found) == pytest.approx(np.sqrt(0.36 / 2 / 0.64 / 72), rel=0.17)
    assert 0.83 * np.std(found) < np.sqrt(np.mean(variances)) < 1.7 * np.std(found)
    # A step of a radian through it is no better known than half of it.
    step = np.where(np.arange(40)[:, None] >= 8, 1.0, 0.0) + np.zeros(shape)
    _, rough = told(pair(rng, shape, coherence, phase=step))
    assert rough > 0.1


def test_windows_hold_the_looks_that_they_are_asked_for():
    resolution = np.stack([np.full((3, 3), 0.18), np.full((3, 3), 0.075)])
    for looks in (9, 42, 85):
        rows, columns = uncertainty.Cells(resolution, (0.02, 0.01)).window(looks)
        assert rows % 2 == columns % 2 == 1
        # An odd number of pixels is within one of what is asked for.
        assert rows * 0.01 == pytest.approx(np.sqrt(looks * 0.18 * 0.075), abs=0.01)
        assert columns * 0.02 == pytest.approx(np.sqrt(looks * 0.18 * 0.075), abs=0.02)
    assert uncertainty.Cells(resolution, (5.0, 5.0)).window(1) == (1, 1)
    rows, columns = uncertainty.Cells(resolution, (0.01, 0.01)).window(36, elongation=4)
    assert rows == pytest.approx(4 * columns, abs=4)


def test_roughness_is_what_the_filter_takes_and_level_ground_has_none():
    rng = np.random.default_rng(8)
    count, coherence = 160, 0.97
    filter_ = response.Average(np.full(5, 0.2))
    resolution = np.ones((2, count, count))
    ground = response.Rough(1.2, (1.0, 1.0), SPACING, (5, 5))
    power, cell = ground.spectra(count)
    white = np.fft.fft2(rng.standard_normal((count, count)))
    rms = 0.3
    true, seen = (
        rms * count * np.fft.ifft2(white * np.sqrt(power) * part).real for part in (1, cell)
    )

    def told(phase):
        images = pair(rng, (count, count), coherence, phase=phase)
        product = images[0] * np.conj(images[1])
        return uncertainty.roughness(filter_, product, cells=uncertainty.Cells(resolution, SPACING))

    passed = np.angle(filter_.apply(np.exp(1j * seen)))
    taken = np.mean((true - passed) ** 2)
    # Some 25 600 pairs at eight distances, weighted with the brightness of their speckle, of a
    # correlation of a third at most and as much noise: 3 sqrt(2 / 5000) of it and more.
    assert told(seen).mean() == pytest.approx(taken, rel=0.15)
    # Of a normal error the shrunk positive part is an eighth of the standard deviation on average:
    # 0.03 rad^2 of noise over as small a covariance of cells, and 500 looks, is 0.03; twice of it.
    assert told(0.0).mean() < 0.1 * taken
    # A plane is not rough.
    ramp = 0.2 * np.arange(count) + np.zeros((count, count))
    assert told(ramp).mean() < 0.1 * taken


@settings(max_examples=30)
@given(
    shape=st.tuples(st.integers(1, 19), st.integers(1, 17)),
    sides=st.tuples(st.sampled_from([1, 3, 5, 21]), st.sampled_from([1, 3, 7, 25])),
    outside=st.sampled_from(["mirror", "zero"]),
    parts=st.sampled_from([1, 2]),
)
def test_means_are_those_of_the_windows(shape, sides, outside, parts):
    values = np.random.default_rng(sum(shape)).normal(size=(*shape, parts))
    values = values.view(complex)[..., 0] if parts == 2 else values[..., 0]
    around = [(side // 2, side // 2) for side in sides]
    padded = np.pad(values, around, mode="symmetric" if outside == "mirror" else "constant")
    expected = [
        [
            padded[row : row + sides[0], column : column + sides[1]].mean()
            for column in range(shape[1])
        ]
        for row in range(shape[0])
    ]
    found = uncertainty.mean(values, sides, outside=outside)
    # Running sums of up to 19 x 21 numbers of size 1 keep 1e-16 of each.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
