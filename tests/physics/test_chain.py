"""The whole chain on ground whose answer is known: level, and a plane of constant slope."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import spence

from vinsar.foundations import variables
from vinsar.processing import filtering, focusing, height, interferogram, unwrapping
from vinsar.radar import aperture, formulas, geometry, trajectory, waveform
from vinsar.radar.instrument import Instrument
from vinsar.simulation import echo, scene, visibility

FREQUENCY = waveform.frequencies(13e9, 15e9, 201)
WAVELENGTH = 299_792_458.0 / 14e9
X, Y = np.linspace(-0.9, 0.9, 46), np.linspace(9.1, 11.3, 56)
GRID_Y, GRID_X = np.meshgrid(Y, X, indexing="ij")
SLOPES = (0.04, -0.03)


def ground(slope_x, slope_y):
    x, y = np.linspace(-1.2, 1.2, 61), np.linspace(8.8, 11.6, 71)
    return variables.dataset(
        "terrain",
        {
            "height": slope_x * x[None, :] + slope_y * (y[:, None] - 10.2),
            "reflectivity": np.full((y.size, x.size), 0.5),
        },
        {"x": x, "y": y},
    )


def focus(terrain, antennas):
    facets = scene.facets(
        terrain, facet_size_m=0.03, facet_jitter=1.0, rng=np.random.default_rng(4)
    )
    seen = visibility.facet_visibility(terrain, facets, antennas)
    signal = echo.simulate(facets, antennas, seen, frequency=FREQUENCY)
    near, far = trajectory.range_extent(antennas, X, Y)
    profiles = focusing.compress(signal, near_range_m=near, far_range_m=far)
    return focusing.backproject(profiles, antennas, x=X, y=Y)


def reconstruct(images, reference):
    formed = interferogram.form(images, coherence_window_px=5)
    smooth = filtering.apply(
        formed, method="goldstein", goldstein_alpha=0.8, goldstein_patch_px=16,
        goldstein_step_px=4, boxcar_window_px=1,
    )  # fmt: skip
    unwrapped = unwrapping.unwrap(smooth, formed["coherence"], method="whirlwind", looks=1.0)
    offset = height.phase_offset(unwrapped, images, reference)
    return height.invert(unwrapped, images, offset).height


@pytest.fixture(scope="module")
def level(rail):
    return focus(ground(0.0, 0.0), rail)


@pytest.fixture(scope="module")
def theory():
    """Coherence, single-look phase noise and height of ambiguity at the middle of the scene."""
    lower = (0.0, 0.0, 2.0)
    slant = float(geometry.slant_range(lower, 0.0, 10.2))
    look = float(geometry.look_angle(lower, 0.0, 10.2))
    _, across = formulas.baseline_components(0.3, np.pi / 2, look)
    # Level ground seen from two angles shifts its spectrum: of the band W = 201 x 10 MHz the
    # share B_perp / B_crit is not common to both images.
    cell = 299_792_458.0 / (2 * 201 * 10e6)
    coherence = 1 - across / formulas.critical_baseline(slant, WAVELENGTH, look, cell)
    # Single-look phase variance of circular Gaussian speckle (Bamler and Hartl 1998, Eq. 48).
    angle = np.arcsin(coherence)
    variance = np.pi**2 / 3 - np.pi * angle + angle**2 - spence(1 - coherence**2) / 2
    ambiguity = formulas.height_of_ambiguity(slant, WAVELENGTH, 0.3, np.pi / 2, look)
    return SimpleNamespace(
        coherence=float(coherence), phase=float(np.sqrt(variance)), ambiguity=float(ambiguity)
    )


def resolution_cells():
    # 81 positions fill 81 steps.
    place, travel = np.array([0.0, 0.0, 2.0]), np.array([0.81, 0.0, 0.0])
    antenna = aperture.Aperture(place, place, travel, travel)
    along, ahead = Instrument(antenna, antenna, 81, FREQUENCY).resolution(0.0, 10.2)
    return np.ptp(X) * np.ptp(Y) / (along * ahead)


def test_level_ground_is_as_coherent_as_its_spectral_shift_leaves_it(level, theory):
    lower, upper = level["image"].values.astype(complex)
    power = np.sum(np.abs(lower) ** 2) * np.sum(np.abs(upper) ** 2)
    found = np.abs(np.vdot(upper, lower)) / np.sqrt(power)
    # Sample coherence scatters by (1 - g^2) / sqrt(2 N) over N cells; B_perp / B_crit itself
    # falls by a fifth from near to far.
    scatter = 4 * (1 - theory.coherence**2) / np.sqrt(2 * resolution_cells())
    assert 0.9 < theory.coherence < 0.99
    assert found == pytest.approx(theory.coherence, abs=scatter)


def test_level_ground_has_the_phase_noise_of_its_coherence_around_zero(level, theory):
    lower, upper = level["image"].values
    phase = np.angle(lower * np.conj(upper))
    cells = resolution_cells()
    assert abs(phase.mean()) < 4 * theory.phase / np.sqrt(cells)
    # The fourth moment of single-look phases is 14 times the squared variance:
    # relative scatter of the variance sqrt(14 / N), of the deviation half of it; three of them.
    assert phase.std() == pytest.approx(theory.phase, rel=1.5 * np.sqrt(14 / cells))


def test_level_ground_comes_out_level_within_its_phase_noise(level, theory):
    reference = height.level_ground(X, Y, [(-0.9, -0.3, 9.2, 11.2)], 0.0)
    found = reconstruct(level, reference)
    bound = theory.phase * theory.ambiguity / (2 * np.pi)
    inside = np.isfinite(found)
    assert inside.mean() > 0.99
    # Unfiltered single-look noise is the upper bound of what the filter leaves.
    assert found[inside].std() < bound
    assert abs(found[inside].mean()) < 0.5 * bound


def test_a_plane_keeps_its_slopes(rail, theory):
    terrain = ground(*SLOPES)
    rng = np.random.default_rng(9)
    x, y = rng.uniform(-0.8, 0.8, 60), rng.uniform(9.4, 11.0, 60)
    reference = x, y, scene.sample(terrain["height"], x, y)
    found = reconstruct(focus(terrain, rail), reference)
    inside = np.isfinite(found)
    assert inside.mean() > 0.9
    design = np.stack([np.ones(inside.sum()), GRID_X[inside], GRID_Y[inside] - 10.2], axis=1)
    (constant, slope_x, slope_y), *_ = np.linalg.lstsq(design, found[inside], rcond=None)
    # A plane fitted to N cells with single-look noise: deviation over sqrt(N) and the extent's own
    # deviation, four times. The terrain spans 15 cm, a third of the ambiguity.
    noise = theory.phase * theory.ambiguity / (2 * np.pi) / np.sqrt(resolution_cells())
    assert slope_x == pytest.approx(SLOPES[0], abs=4 * noise / GRID_X.std())
    assert slope_y == pytest.approx(SLOPES[1], abs=4 * noise / GRID_Y.std())
    assert constant == pytest.approx(0.0, abs=4 * noise)
    assert 4 * noise / GRID_X.std() < abs(SLOPES[1]), "or zero slope would pass"
