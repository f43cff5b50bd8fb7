"""Prediction and measurement: every case of the sweeps is a point."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures.drawing import sweeps


def test_it_is_as_wide_as_a_column(usual):
    assert usual("design_check").get_figwidth() * 25.4 == pytest.approx(88)


def test_it_shows_the_measured_spread_of_every_noise_level(usual, lines_of, products):
    axes = usual("design_check").axes[0]
    measured = products["sweeps/snr"]["mad"].sel(region="visible_ground").mean("realization")
    shown = lines_of(axes)["signal-to-noise ratio"].get_ydata()
    np.testing.assert_allclose(shown, 100 * sweeps.NORMAL * measured)
