"""Registration of two images by the circle and by coherence, on images that are made up."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.evaluation import registered
from vinsar.foundations import variables
from vinsar.paper import claims
from vinsar.processing import common_band
from vinsar.radar import aperture, trajectory
from vinsar.study import pipeline

X, Y = np.arange(-1.0, 1.0, 0.03), np.arange(6.0, 8.0, 0.02)
GRID_Y, GRID_X = np.meshgrid(Y, X, indexing="ij")
# Cells of 15 by 8 cm, as the paper's: the images have nothing beyond.
CELL_X, CELL_Y = 0.15, 0.08


def speckle(seed, at_y, at_x=GRID_X):
    """Speckle without carrier, limited to the band of its cell, at any places."""
    rng = np.random.default_rng(seed)
    count = 600
    across, ahead = (rng.uniform(-np.pi, np.pi, count) / cell for cell in (CELL_X, CELL_Y))
    weight = rng.standard_normal((count, 2)) @ np.array([1, 1j])
    phase = across * at_x[..., None] + ahead * at_y[..., None]
    return np.exp(1j * phase) @ weight


def test_resampling_moves_an_image_of_limited_band():
    moved = registered.resample(speckle(1, GRID_Y), X, Y, np.stack([GRID_X, GRID_Y + 0.013]))
    exact = speckle(1, GRID_Y + 0.013)
    inside = np.s_[5:-5, 5:-5]
    error = np.abs(moved - exact)[inside] ** 2
    # Cubic splines at 4 samples a cell in y and 5 in x: their images are below -40 dB at the edge
    # of the band, and less within.
    assert error.mean() < 1e-4 * (np.abs(exact) ** 2).mean()


@pytest.mark.parametrize("shift", [0.0, 0.011, -0.02])
def test_the_largest_coherence_is_at_the_shift(shift):
    upper = speckle(2, GRID_Y - shift) + 0.3 * speckle(3, GRID_Y)
    found = registered.by_coherence(speckle(2, GRID_Y), upper, X, Y, np.zeros(GRID_Y.shape))
    # Bamler and Just (1993): sqrt(3 / 2N) sqrt(1 - g^2) / (pi g) cells, 0.3 mm of N = 40 cells of
    # coherence 0.96 here; five of these, as the windows at the edges are halves.
    gamma, cells = 1 / np.hypot(1, 0.3), 0.49 / (CELL_X * CELL_Y)
    scatter = CELL_Y * np.sqrt(3 / (2 * cells)) * np.sqrt(1 - gamma**2) / (np.pi * gamma)
    assert np.abs(found - shift).max() < 5 * scatter + registered._STEP_M / 10


def test_the_true_place_is_on_the_terrain_and_imaged_at_the_pixel(rail):
    lower, upper = trajectory.apertures(rail)
    terrain = 0.2 * np.exp(-((GRID_X - 0.2) ** 2 + (GRID_Y - 7.0) ** 2) / 0.4**2)
    place = registered.true_place(lower, X, Y, terrain)
    inside = np.s_[15:-15, 5:-5]
    seen = 0.2 * np.exp(-((place[0] - 0.2) ** 2 + (place[1] - 7.0) ** 2) / 0.4**2)
    # Bilinear between cells of 2 and 3 cm: half a millimetre at this curvature.
    np.testing.assert_allclose(place[2][inside], seen[inside], atol=1e-3)
    np.testing.assert_allclose(aperture.image_position(lower, *place)[1], GRID_Y, atol=1e-6)
    # On a rail the upper channel sees it on the circle around it, and x stays.
    at = registered.seen_by_upper((lower, upper), place)
    height = 2.3
    circle = np.sqrt(place[1] ** 2 + (height - place[2]) ** 2 - height**2)
    np.testing.assert_allclose(at[1], circle, atol=1e-6)
    np.testing.assert_allclose(at[0], place[0], atol=1e-6)


def made(near, far):
    """Product ``registered`` with these deviations: plane, circle, coherence, refocused."""
    std = np.array([near, far]).T
    return variables.dataset(
        "registered",
        {
            "coherence": np.full((4, 2), 0.9),
            "misregistration": np.full((4, 2), 0.004),
            "height_std": std,
            "height_mad": std / 2,
            "resolution": np.full(2, 0.08),
            "band_edge": np.array([[5.0, 8.0], [13.0, 16.0]]),
        },
        {
            "processing": np.array(registered.PROCESSING),
            "band": np.array(["near", "far"]),
            "end": np.arange(2),
        },
    )


@pytest.mark.parametrize(
    ("near", "far", "verdict"),
    [(0.008, 0.0098, "reproduced"), (0.008, 0.008, "partly"), (0.0095, 0.0098, "contradicted")],
)
def test_heights_decide_whether_images_must_be_registered(near, far, verdict):
    found = made([0.01, near, near, 0.005], [0.01, far, far, 0.007])
    claim = claims.registration_needed(found)
    assert claim.verdict == verdict
    assert claim.figures["near_registered_std_m"] == near
    table = registered.as_markdown(found)
    assert "| near, 5 to 8 m | registered by the circle | 0.900 | 4.0 | 0.050 |" in table


def test_only_studies_with_a_second_pass_have_it(make):
    assert "registered" not in pipeline.stages(make("plane"))
    assert claims.REGISTERED not in claims.inputs_of(pipeline.stages(make("plane")))
    assert claims.REGISTERED in claims.inputs_of(pipeline.stages(make("estimated")))


@pytest.fixture
def make():
    import vinsar

    return lambda surface: vinsar.load(imaging={"surface": surface})


def test_the_surface_is_that_of_the_second_pass(rail):
    # What the circle takes for the shift vanishes on the ground plane.
    lower, upper = trajectory.apertures(rail)
    place = common_band.place(lower, X, Y, np.zeros(GRID_Y.shape))
    at = registered.seen_by_upper((lower, upper), place)
    np.testing.assert_allclose(at[1], GRID_Y, atol=1e-9)
