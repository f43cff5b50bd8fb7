"""Wrapped phases of a known terrain through unwrapping and inversion, without any radar."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations import variables
from vinsar.processing import height, unwrapping

X, Y = np.linspace(-2.5, 2.5, 126), np.linspace(10, 16, 301)
GRID_Y, GRID_X = np.meshgrid(Y, X, indexing="ij")


def hills(x, y):
    """Two hills and a hollow, smooth and without layover; level at the scene's near corners."""
    return (
        0.30 * np.exp(-((x - 0.8) ** 2 + (y - 14.0) ** 2) / 0.5)
        + 0.15 * np.exp(-((x + 0.9) ** 2 + (y - 12.4) ** 2) / 0.4)
        - 0.20 * np.exp(-((x - 0.1) ** 2 + (y - 12.6) ** 2) / 0.3)
    )


def reconstruct(unwrapped, images, method, reference):
    wrapped = np.exp(1j * unwrapped["phase"].values)
    coords = {"x": X, "y": Y}
    filtered = variables.dataset("filtered", {"interferogram": wrapped}, coords)
    coherence = unwrapped["phase"] * 0 + 0.99
    found = unwrapping.unwrap(filtered, coherence, method=method, looks=10.0)
    offset = height.phase_offset(found, images, reference)
    return height.invert(found, images, offset).height


@pytest.mark.parametrize("method", ["whirlwind", "skimage", "kamui"])
@pytest.mark.parametrize("upper", [(0.0, 0.0, 2.3), (0.0, 0.15, 2.26)])
def test_heights_of_a_smooth_terrain_come_back_to_a_millimetre(ideal_phase, method, upper):
    unwrapped, images = ideal_phase(hills, X, Y, upper=upper, constant=2.0)
    ground = height.level_ground(X, Y, [(-2.4, -1.9, 10.1, 10.7), (1.9, 2.4, 10.1, 10.7)], 0.0)
    error = reconstruct(unwrapped, images, method, ground) - hills(GRID_X, GRID_Y)
    # Left is the linear interpolation of DEM coding over 2 cm: 0.3 / 0.25 x 0.02^2 / 8 = 60 um,
    # stretched in front of the hills. Beyond the last pixel's place nothing is known.
    inside = GRID_Y <= 15.9
    assert np.abs(error[inside]).max() < 1e-3


def test_one_control_point_on_a_hill_is_enough(ideal_phase):
    unwrapped, images = ideal_phase(hills, X, Y, constant=-4.0)
    point = np.array([0.8]), np.array([14.0]), hills(np.array([0.8]), np.array([14.0]))
    error = reconstruct(unwrapped, images, "skimage", point) - hills(GRID_X, GRID_Y)
    # Interpolation of the phase at the point: curvature x (2 cm and 4 cm)^2 / 8, under 0.2 mm.
    assert np.abs(error[GRID_Y <= 15.9]).max() < 1e-3


def test_a_phase_error_of_one_cycle_is_one_height_of_ambiguity(ideal_phase):
    unwrapped, images = ideal_phase(hills, X, Y)
    dem = [
        height.invert(unwrapped, images, np.full(GRID_X.shape, turns * 2 * np.pi)).image_height
        for turns in (0, 1)
    ]
    # lambda r / (2 B) for the vertical baseline; r2 for r1 and the curvature are below 2 %.
    slant = np.hypot(np.hypot(GRID_X, GRID_Y), 2.0)
    across = np.sqrt(slant**2 - GRID_X**2)
    expected = 0.0214 * slant / (2 * 0.3)
    step = dem[0] - dem[1]
    assert across.min() > 10
    np.testing.assert_allclose(step, expected, rtol=0.02)
