"""What a second pass takes away before the filter does not count in the heights' deviations."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vinsar.foundations import variables
from vinsar.processing import assessment, filtering
from vinsar.radar import aperture, trajectory, waveform

X, Y = np.arange(-1.5, 1.5, 0.05), np.arange(10.0, 12.5, 0.05)
FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
OPTIONS = {
    "goldstein_alpha": 0.8,
    "goldstein_patch_px": 16,
    "goldstein_step_px": 4,
    "gaussian_std_px": 2.0,
    "boxcar_window_px": 5,
}


@pytest.fixture
def std_with(rail):
    """Standard deviations of level ground, with a phase that was removed before the filter."""
    shape = (Y.size, X.size)
    flat = aperture.flat_earth_phase(
        *trajectory.apertures(rail), X[None, :], Y[:, None], waveform.wavelength(14e9)
    )

    def assess(method, removed):
        rng = np.random.default_rng(4)
        signal, *noise = rng.standard_normal((3, *shape, 2)) @ np.array([1, 1j])
        pair = np.stack([signal + 0.3 * part for part in noise]).astype(np.complex64)
        left = pair[0] * np.conj(pair[1])
        smooth = filtering.smooth(left, method=method, **OPTIONS)
        turn = np.exp(1j * removed)
        pair[1] /= turn
        axes = {"x": X, "y": Y}
        images = rail.assign_coords(axes).assign(
            image=(("channel", "y", "x"), pair), wavelength=waveform.wavelength(14e9)
        )
        products = [
            variables.dataset("filtered", {"interferogram": part * turn}, axes)
            for part in (left, smooth)
        ]
        corner = (slice(0, 8), slice(0, 8))
        unmoved = xr.zeros_like(rail["transmitter"])
        still = xr.Dataset({"displacement": unmoved, "displacement_std": unmoved})
        std, _ = assessment.assess(
            images,
            *products,
            phase=flat + removed + np.angle(smooth),
            height=np.zeros(shape),
            true_y=np.broadcast_to(Y[:, None], shape),
            code=lambda values: values,
            reference=assessment.Reference((corner,), (0.0,), plane=False, level=True),
            filtering={"method": method, **OPTIONS},
            frequency=FREQUENCY,
            windows=("rectangular", "rectangular"),
            motion=still,
            removed=removed,
        )
        return std

    return assess


@pytest.mark.parametrize("method", filtering.FILTERS)
def test_the_deviation_is_that_of_what_the_filter_was_given(std_with, method):
    # Slopes of up to a cycle in 20 cm, but not at the height reference.
    steep = 9.0 * np.maximum(Y - 10.8, 0)[:, None] * np.sin(2 * X)[None, :]
    level = std_with(method, np.zeros((Y.size, X.size)))
    np.testing.assert_allclose(std_with(method, steep), level, rtol=2e-3)
