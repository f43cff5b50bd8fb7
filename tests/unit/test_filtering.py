"""Filters of the interferometric phase."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations import variables
from vinsar.processing import filtering
from vinsar.radar.speckle import phase_std


def speckle(seed, shape):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).view(complex)[..., 0]


def naive_goldstein(values, alpha, patch, step):
    """One patch after the other, in double precision, weights summed up beside the values."""
    rows, columns = values.shape
    padded = np.pad(values.astype(complex), patch)
    total, weights = np.zeros_like(padded), np.zeros(padded.shape)
    profile = np.sin(np.pi * (np.arange(patch) + 0.5) / patch) ** 2
    taper = np.outer(profile, profile)
    for top in range(step, patch + rows, step):
        for left in range(step, patch + columns, step):
            part = np.s_[top : top + patch, left : left + patch]
            if padded[part].shape != taper.shape:
                continue
            spectrum = np.fft.fft2(padded[part])
            smooth = np.zeros((patch, patch))
            for row in range(patch):
                for column in range(patch):
                    for down in (-1, 0, 1):
                        for across in (-1, 0, 1):
                            smooth[row, column] += np.abs(
                                spectrum[(row + down) % patch, (column + across) % patch]
                            )
            if smooth.max() > 0:
                spectrum *= (smooth / smooth.max()) ** alpha
            total[part] += np.fft.ifft2(spectrum) * taper
            weights[part] += taper
    inside = np.s_[patch : patch + rows, patch : patch + columns]
    return total[inside] / weights[inside]


@pytest.mark.parametrize(("patch", "step"), [(8, 2), (8, 4), (9, 3)])
@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_goldstein_agrees_with_a_loop_over_patches(alpha, patch, step):
    values = speckle(0, (21, 18)) + 3
    found = filtering.goldstein(values, alpha=alpha, patch_px=patch, step_px=step)
    expected = naive_goldstein(values, alpha, patch, step)
    # Single precision through two transforms of 81 points: some ten roundings of 6e-8.
    np.testing.assert_allclose(found, expected, atol=2e-6 * np.abs(values).max())


@pytest.mark.parametrize(
    ("patch", "step"),
    [(patch, step) for patch in (4, 9, 16, 30) for step in range(1, patch // 2 + 1)
     if patch % step == 0],
)  # fmt: skip
def test_goldstein_at_alpha_0_changes_nothing_up_to_the_edges(patch, step):
    values = speckle(1, (37, 26))
    found = filtering.goldstein(values, alpha=0.0, patch_px=patch, step_px=step)
    assert found.dtype == np.complex64
    np.testing.assert_allclose(found, values, atol=2e-6 * np.abs(values).max())


@pytest.fixture(scope="module")
def noisy_ramp():
    rows, columns = np.mgrid[:96, :112]
    ramp = np.exp(1j * (0.31 * columns + 0.17 * rows))
    return ramp, ramp + 0.5 * speckle(2, ramp.shape) / np.sqrt(2)


def test_goldstein_reduces_the_noise_of_a_ramp_and_keeps_the_ramp(noisy_ramp):
    ramp, noisy = noisy_ramp
    found = filtering.goldstein(noisy, alpha=0.8, patch_px=32, step_px=8)
    inner = np.s_[32:-32, 32:-32]
    before = np.angle(noisy * np.conj(ramp))[inner]
    after = np.angle(found * np.conj(ramp))[inner]
    # The ramp's line holds 32^2, noise 0.5 x 32 a bin: smoothed, about 9 x 0.89 x 16 against
    # 4 x 1024, which to the power 0.8 leaves a twentieth to a tenth of the noise. The 3 x 3 and
    # leakage bins around the line pass another 5 x 5 / 32^2 of its power, a sixth in amplitude.
    assert after.std() < 0.25 * before.std()
    # What is left is correlated over half a patch: 48 x 32 pixels hold 6 independent values.
    assert abs(after.mean()) < 4 * after.std() / np.sqrt(6)


def test_goldstein_filters_more_the_larger_alpha_is(noisy_ramp):
    ramp, noisy = noisy_ramp
    noise = [
        np.angle(
            filtering.goldstein(noisy, alpha=alpha, patch_px=16, step_px=4) * np.conj(ramp)
        ).std()
        for alpha in (0.0, 0.4, 0.8)
    ]
    assert noise[0] > noise[1] > noise[2]


def test_goldstein_of_batches_is_goldstein_of_the_whole(noisy_ramp, monkeypatch):
    options = {"alpha": 0.6, "patch_px": 16, "step_px": 4}
    whole = filtering.goldstein(noisy_ramp[1], **options)
    monkeypatch.setattr(filtering, "_PIXELS_PER_BATCH", 1)
    np.testing.assert_allclose(filtering.goldstein(noisy_ramp[1], **options), whole, atol=1e-6)


def test_goldstein_takes_darkness_and_small_scenes():
    assert not filtering.goldstein(np.zeros((40, 40)), alpha=0.8, patch_px=16, step_px=4).any()
    small = filtering.goldstein(np.full((3, 5), 1j), alpha=0.5, patch_px=32, step_px=8)
    np.testing.assert_allclose(np.angle(small), np.pi / 2, atol=1e-5)


def test_goldstein_turns_with_the_phase(noisy_ramp):
    # A constant phase added before comes out after: no phase is special.
    options = {"alpha": 0.8, "patch_px": 16, "step_px": 8}
    turned = filtering.goldstein(noisy_ramp[1] * np.exp(2j), **options)
    plain = filtering.goldstein(noisy_ramp[1], **options)
    np.testing.assert_allclose(turned, plain * np.exp(2j), atol=1e-5)


@pytest.mark.parametrize(
    ("alpha", "patch", "step", "message"),
    [
        (-0.1, 32, 8, "alpha is -0.1; take 0 to 1"),
        (1.1, 32, 8, "alpha is 1.1; take 0 to 1"),
        (0.5, 32, 5, "must divide the patch of 32 pixels"),
        (0.5, 32, 32, "twice or more"),
        (0.5, 32, 0, "a step of 0 pixels"),
    ],
)
def test_goldstein_refuses_impossible_options(alpha, patch, step, message):
    with pytest.raises(ValueError, match=message):
        filtering.goldstein(np.ones((40, 40)), alpha=alpha, patch_px=patch, step_px=step)


def test_boxcar_averages_over_what_the_window_covers():
    values = speckle(3, (11, 9))
    found = filtering.boxcar(values, window_px=5)
    for row in range(11):
        for column in range(9):
            part = values[max(0, row - 2) : row + 3, max(0, column - 2) : column + 3]
            assert found[row, column] == pytest.approx(part.mean(), abs=1e-6)


def test_boxcar_of_one_pixel_changes_nothing():
    values = speckle(4, (6, 5)).astype(np.complex64)
    np.testing.assert_allclose(filtering.boxcar(values, window_px=1), values, rtol=1e-6)


@pytest.mark.parametrize("window", [0, -1, 4])
def test_boxcar_refuses_an_even_window(window):
    with pytest.raises(ValueError, match="must be odd and positive"):
        filtering.boxcar(np.ones((5, 5)), window_px=window)


@pytest.mark.parametrize("method", ["goldstein", "boxcar", "gaussian", "none"])
def test_apply_takes_the_filter_by_name(method):
    values = speckle(5, (20, 24)).astype(np.complex64)
    data = variables.dataset(
        "interferogram",
        {"interferogram": values, "coherence": np.ones(values.shape)},
        {"x": 0.1 * np.arange(24), "y": 0.1 * np.arange(20)},
    )
    found = filtering.apply(
        data, method=method, goldstein_alpha=0.5, goldstein_patch_px=8, goldstein_step_px=4,
        boxcar_window_px=3, gaussian_std_px=1.5,
    )  # fmt: skip
    expected = {
        "goldstein": lambda: filtering.goldstein(values, alpha=0.5, patch_px=8, step_px=4),
        "boxcar": lambda: filtering.boxcar(values, window_px=3),
        "gaussian": lambda: filtering.gaussian(values, std_px=1.5),
        "none": lambda: values,
    }[method]()
    np.testing.assert_array_equal(found["interferogram"].values, expected)
    np.testing.assert_array_equal(data["interferogram"].values, values)


@pytest.mark.parametrize("std", [0.7, 2.0])
def test_the_gaussian_is_the_mean_by_its_weights(std):
    rng = np.random.default_rng(4)
    values = rng.normal(size=(20, 31)) + 1j * rng.normal(size=(20, 31))
    found = filtering.gaussian(values, std_px=std)
    row, column = np.indices(values.shape)
    for at in ((10, 15), (0, 0), (19, 4)):
        reach = int(4 * std + 0.5)
        weight = np.exp(-((row - at[0]) ** 2 + (column - at[1]) ** 2) / (2 * std**2))
        weight[(abs(row - at[0]) > reach) | (abs(column - at[1]) > reach)] = 0
        expected = (weight * values).sum() / weight.sum()
        assert found[at] == pytest.approx(expected, abs=2e-6)


def test_the_gaussian_averages_as_many_looks_as_its_docstring_says():
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(400, 400)) + 1j * rng.normal(size=(400, 400))
    power = np.mean(abs(filtering.gaussian(noise, std_px=2.0)[20:-20, 20:-20]) ** 2)
    # 160,000 pixels in correlated groups of 50: power within 2 % by one standard deviation.
    assert 2 / power == pytest.approx(4 * np.pi * 2.0**2, rel=0.08)


def test_a_gaussian_without_width_is_refused():
    with pytest.raises(ValueError, match="wider than 0"):
        filtering.gaussian(np.ones((3, 3), complex), std_px=0.0)


def speckled_pair(cell_px, coherence, side=224, seed=0):
    """Return two images of level ground whose resolution cells are so large."""
    rng = np.random.default_rng(seed)
    axis = np.abs(np.fft.fftfreq(side))
    band = np.outer(axis <= 0.5 / cell_px[0], axis <= 0.5 / cell_px[1])
    white = rng.standard_normal((2, side, side, 2)) @ np.array([1, 1j])
    common, other = (np.fft.ifft2(np.fft.fft2(part) * band) for part in white)
    return common, coherence * common + np.sqrt(1 - coherence**2) * other


# Of the paper's cells on its grids of 2 and 5 cm. The distribution of looks takes pixels of a
# window for independent and Goldstein's gain for that of the mean spectrum: up to a quarter high.
@pytest.mark.parametrize("coherence", [0.975, 0.6])
@pytest.mark.parametrize("cell_px", [(3.8, 8.8), (1.5, 3.5)])
@pytest.mark.parametrize(
    "changes",
    [
        {"method": "none"},
        {"method": "boxcar"},
        {"method": "boxcar", "boxcar_window_px": 15},
        {"method": "gaussian"},
        {},
        {"goldstein_alpha": 0.5},
        {"goldstein_patch_px": 32},
    ],
)
def test_the_filter_s_looks_give_the_phase_noise_of_filtered_speckle(changes, cell_px, coherence):
    options = {
        "method": "goldstein",
        "goldstein_alpha": 0.8,
        "goldstein_patch_px": 64,
        "goldstein_step_px": 8,
        "boxcar_window_px": 5,
        "gaussian_std_px": 4.0,
    } | changes
    lower, upper = speckled_pair(cell_px, coherence)
    product = variables.dataset(
        "interferogram",
        {"interferogram": lower * upper.conj(), "coherence": np.ones(lower.shape)},
        {"x": np.arange(lower.shape[1]) * 0.02, "y": 1 + np.arange(lower.shape[0]) * 0.02},
    )
    phase = np.angle(filtering.apply(product, **options)["interferogram"].values)
    looks = filtering.effective_looks(coherence, cell_px, **options)
    ratio = phase.std() / float(phase_std(coherence, looks))
    assert 0.75 < ratio < 1.1
    if changes.get("method") == "none":
        assert looks == 1


def test_a_wide_boxcar_has_the_looks_of_its_area_in_cells_and_of_the_weighting():
    options = {
        "method": "boxcar",
        "goldstein_alpha": 0.8,
        "goldstein_patch_px": 32,
        "goldstein_step_px": 8,
        "boxcar_window_px": 81,
    }
    cells = 81**2 / (2 * 4)
    looks = filtering.effective_looks(0.9, (2.0, 4.0), **options)
    # The window's ends cut cells: a cell in 81 of each side.
    assert looks == pytest.approx(cells, rel=0.1)
    # A weighting w correlates the speckle over sum(w^4) / sum(w^2)^2 of a cell: 35/18 for Hann.
    # Noise of the bands' ends is half as strong in the middle of the spectrum along y.
    even = filtering.effective_looks(0.9, (2.0, 4.0), **options, shifted=1.0)
    assert even / looks == pytest.approx(2, rel=0.05)
    hann = filtering.effective_looks(0.9, (2.0, 4.0), **options, windows=("hann", "rectangular"))
    assert looks / hann == pytest.approx(35 / 18, rel=0.03)


def test_the_baseline_s_share_of_the_noise():
    assert filtering.shifted_share(0.9, 0.9) == 1
    assert filtering.shifted_share(1.0, 1.0) == 0
    assert filtering.shifted_share(0.8, 1.0) == 0
    # Little of either: noise adds up.
    assert filtering.shifted_share(0.99 * 0.98, 0.99) == pytest.approx(1 / 3, rel=0.03)


@pytest.mark.parametrize("method", filtering.FILTERS)
def test_every_filter_has_its_looks(method):
    options = {
        "goldstein_alpha": 0.8,
        "goldstein_patch_px": 32,
        "boxcar_window_px": 5,
        "gaussian_std_px": 2.0,
    }
    assert filtering.effective_looks(0.9, (2.0, 4.0), method=method, **options) >= 1


def test_an_unknown_filter_has_no_looks():
    with pytest.raises(ValueError, match="no filter 'medain'; there are goldstein"):
        filtering.effective_looks(0.9, (2.0, 4.0), method="medain")
