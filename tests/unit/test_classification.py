"""Classes of heights, against scenes whose shadow and cycles are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import gamma

from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.processing import classification, uncertainty
from vinsar.processing.classification import Cycles, Fan
from vinsar.radar import aperture

X = np.arange(-2, 2.01, 0.1)
Y = np.arange(10, 16.01, 0.1)
ANTENNA = np.array([0.0, 0.0, 2.0])


def grid(value=0.0):
    return np.full((Y.size, X.size), value)


def box(height, first, last, half_width=0.5):
    inside = (Y[:, None] >= first - 1e-9) & (Y[:, None] <= last + 1e-9)
    return np.where(inside & (np.abs(X) <= half_width), height, 0.0)


def test_a_shadow_is_found_and_lit_speckle_is_not():
    rng = np.random.default_rng(7)
    shape = (120, 120)
    image = rng.normal(size=(*shape, 2)).view(complex)[..., 0]
    level = np.ones(shape)
    level[40:60, 30:45] = 0.1
    product = np.abs(level * image) ** 2 + 0j
    found = classification.shadow(
        product, cells=uncertainty.Cells(np.full((2, *shape), 1.0), (1.0, 1.0))
    )
    assert found[41:59, 31:44].mean() > 0.97
    far = np.ones(shape, bool)
    far[34:66, 24:51] = False
    # Fifteen looks are 6 dB below their mean once in 1e5; their windows count fifteenfold.
    assert found[far].mean() < 0.005
    assert found[~far].mean() < 0.6


@pytest.mark.parametrize("window", classification._SHADOW)
def test_speckle_is_as_dark_as_a_shadow_once_in_20_000_windows(window):
    looks, _, level = window
    # The mean power of L looks of speckle is gamma-distributed (Goodman 1976).
    assert gamma.cdf(looks * 10 ** (level / 10), looks) < 5e-5


def test_a_line_of_sight_passes_over_what_is_known():
    fan = Fan.over(ANTENNA, X, Y)
    height = box(0.4, 12.0, 12.0)
    line = fan.line_of_sight(height, np.ones(height.shape, bool))
    middle = X.size // 2
    # From 2 m over 0.4 m at 12 m: straight on, until level ground hides more.
    behind = (Y > 12.05) & (Y < 14.95)
    np.testing.assert_allclose(line[behind, middle], 2 - 1.6 * Y[behind] / 12, atol=1e-9)
    assert (line[Y < 12, middle] < 1e-9).all()
    hidden = line > height + 1e-9
    assert Y[hidden[:, middle]].max() == pytest.approx(12 * 2 / 1.6, abs=0.101)
    unseen = fan.line_of_sight(height, height == 0)
    assert (unseen[behind, middle] < 1e-9).all()


def test_an_antenna_behind_the_image_is_refused():
    with pytest.raises(ValueError, match=r"y = 10\.50 m is not before the image"):
        Fan.over(np.array([0.0, 10.5, 2.0]), X, Y)


@pytest.mark.parametrize(("told", "flagged"), [(-0.05, True), (0.4, False)])
def test_what_casts_too_long_a_shadow_is_too_low(told, flagged):
    fan = Fan.over(ANTENNA, X, Y)
    # 0.4 m at 12 m hide 3 m.
    dark = box(1.0, 12.3, 15.0) > 0
    height = box(told, 11.5, 12.2)
    found = fan.too_low(dark, height, grid(0.446), reach_m=0.3)
    middle = X.size // 2
    assert found[np.abs(Y - 12.15) < 0.1, middle].all() == flagged
    assert not found[:, np.abs(X) > 0.9].any()
    # A short shadow asks for less than half a cycle.
    short = fan.too_low(box(1.0, 12.3, 12.9) > 0, height, grid(0.446), reach_m=0.3)
    assert not short.any()


def raised(height, rng, lines=12, scatterers=300, frequencies=61):
    """Images of level ground at some height, each column by itself, focused on the ground plane."""
    y = np.arange(11, 15.001, 0.05)
    frequency = np.linspace(13e9, 15e9, frequencies)
    antennas = [aperture.fit(*2 * [np.array([[0.0, 0.0, z]])]) for z in (2.0, 2.3)]
    images = []
    place = rng.uniform(10.5, 15.5, (scatterers, lines))
    weight = rng.normal(size=(scatterers, lines, 2)).view(complex)[..., 0]
    for part in antennas:
        out = aperture.path(part, 0.0, y)
        back = aperture.path(part, 0.0, place, height)
        wave = 2 * np.pi * frequency / SPEED_OF_LIGHT
        echo = np.einsum("ql,kql->kl", weight, np.exp(-1j * wave[:, None, None] * back))
        images.append(np.exp(1j * np.outer(out, wave)) @ echo / frequencies)
    wavelength = 2 * SPEED_OF_LIGHT / (13e9 + 15e9)
    across = np.sqrt(y**2 + 2.0**2 - (2.0 - height) ** 2)
    phase = aperture.interferometric_phase(*antennas, 0.0, across, height, wavelength)
    phase -= aperture.flat_earth_phase(*antennas, 0.0, y, wavelength)
    return np.stack(images), np.tile(phase[:, None], lines), antennas, y, wavelength


@pytest.mark.parametrize("lost", [0, 1])
def test_the_outer_thirds_of_the_band_tell_a_lost_cycle(lost):
    images, phase, antennas, y, wavelength = raised(0.2, np.random.default_rng(8))
    resolution = np.stack([np.full(phase.shape, 0.05), np.full(phase.shape, 0.0757)])
    cycles = classification.split_band(
        images,
        # A cycle too low: the phase falls with the height.
        phase + 2 * np.pi * lost,
        antennas,
        x=0.05 * np.arange(phase.shape[1]),
        y=y,
        wavelength_m=wavelength,
        cells=uncertainty.Cells(resolution, (0.05, y[1] - y[0])),
        relative_bandwidth=2 / 14,
        rising=False,
    )
    inner = np.s_[10:-10, 3:-3]
    for part in cycles:
        # The columns' mean, to its own standard deviation.
        assert part.missing[inner].mean() == pytest.approx(lost, abs=0.15)
        # What is told of the noise is more than what it is: the baseline's has no low frequencies.
        assert np.std(part.missing[inner] - lost) < 1.5 * part.std[inner].mean()


def test_pixels_too_coarse_for_the_band_say_nothing():
    images, phase, antennas, y, wavelength = raised(0.2, np.random.default_rng(8), lines=4)
    found = classification.split_band(
        images, phase, antennas, x=0.05 * np.arange(4), y=y, wavelength_m=wavelength,
        cells=uncertainty.Cells(np.full((2, *phase.shape), 0.04), (0.05, y[1] - y[0])),
        relative_bandwidth=2 / 14, rising=False,
    )  # fmt: skip
    assert all(np.isinf(part.std).all() for part in found)


def test_a_contradiction_of_the_band_spreads_over_what_is_probable():
    missing = box(1.0, 12.0, 12.4) + box(0.3, 12.5, 12.6) * 1.5
    cycles = [Cycles(missing, grid(0.15)), Cycles(missing * 0.9, grid(0.08))]
    none = np.zeros(missing.shape, bool)
    found = classification.uncertain_cycles(cycles, none, none, window_px=(5, 5))
    assert found[missing > 0.4].all()
    assert not found[Y < 11.7].any()
    doubtful = [Cycles(missing, grid(0.5)), Cycles(missing, grid(0.5))]
    assert not classification.uncertain_cycles(doubtful, none, none, window_px=(5, 5)).any()
    # Before too long a shadow a likely contradiction is enough.
    before = box(1.0, 12.3, 12.4) > 0
    assert classification.uncertain_cycles(doubtful, none, before, window_px=(5, 5))[before].all()


def test_an_island_stays_only_if_the_band_confirms_its_cycle():
    valid = np.ones((Y.size, X.size), bool)
    valid[20:40, 10:30] = False
    valid[25:35, 15:25] = True
    reference = np.zeros(valid.shape, bool)
    reference[:3, :3] = True
    sure = Cycles(grid(0.05), grid(0.2))
    unsure = Cycles(grid(0.05), grid(3.0))
    assert not classification.islands(valid, reference, sure, window_px=(5, 5)).any()
    found = classification.islands(valid, reference, unsure, window_px=(5, 5))
    assert found[25:35, 15:25].all()
    assert found.sum() == 100
    # Without a reference nothing is held.
    nowhere = np.zeros(valid.shape, bool)
    assert classification.islands(valid, nowhere, unsure, window_px=(5, 5))[0, 0]


def test_pixels_out_of_order_are_laid_over():
    true_y = np.tile(np.array([10.0, 10.1, 10.05, 10.3]), (2, 1)).T
    found = classification.layover(true_y, np.full(true_y.shape, 0.01))
    np.testing.assert_array_equal(found[:, 0], [False, True, True, False])
    assert not classification.layover(true_y, np.full(true_y.shape, 0.1)).any()


def test_each_cell_has_the_class_of_its_fault():
    height, std = box(0.3, 12.0, 12.3), grid(0.01)
    height[-1] = np.nan
    dark = box(1.0, 12.4, 13.0) > 0
    variance = grid(0.01)
    variance[5, 5] = 2.0
    folded = np.zeros(dark.shape, bool)
    folded[20, 10] = True
    reference = np.zeros(dark.shape, bool)
    reference[:2] = True
    loose = np.zeros(dark.shape, bool)
    loose[4, -3:] = True
    found = classification.classify(
        height, std, dark=dark, folded=folded, variance=variance,
        cycles=[Cycles(grid(), grid(0.1)), Cycles(grid(), grid(0.1))], ambiguity=grid(0.9),
        reference=reference, loose=loose, antennas=[ANTENNA], x=X, y=Y, window_px=(5, 5),
    )  # fmt: skip
    assert found.dtype == np.int8
    assert (found[-1] == classification.OUTSIDE).all()
    assert (found[dark] == classification.SHADOW).all()
    # What the box hides beyond the dark cells: 12.3 m * 2 / 1.7 = 14.5 m.
    assert found[np.abs(Y - 14) < 0.01, X.size // 2] == classification.SHADOW
    assert found[5, 5] == classification.INCOHERENT
    assert found[20, 10] == classification.LAYOVER
    assert (found[4, -3:] == classification.UNCERTAIN_CYCLE).all()
    assert (found[:5][~loose[:5]] == classification.VALID).all()
