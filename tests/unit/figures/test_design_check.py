"""Prediction and measurement: every case of the sweeps is a point."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import FIGURES
from vinsar.foundations.constants import NORMAL_PER_MAD


def test_it_is_as_wide_as_a_column(usual):
    assert usual("design_check").get_figwidth() * 25.4 == pytest.approx(88)


def test_it_shows_the_measured_spread_of_every_noise_level(usual, lines_of, products):
    axes = usual("design_check").axes[0]
    measured = products["sweeps/snr"]["mad"].sel(region="visible_ground").mean("realization")
    shown = lines_of(axes)["signal-to-noise ratio"].get_ydata()
    np.testing.assert_allclose(shown, 100 * NORMAL_PER_MAD * measured)


def test_the_caption_gives_the_range_of_the_ratio(usual, lines_of, products, study):
    said = FIGURES["design_check"].numbers(products, study)
    points = [
        line.get_xydata()
        for line in lines_of(usual("design_check").axes[0]).values()
        if line.get_linestyle() == "None"
    ]
    predicted, measured = np.concatenate(points).T
    ratio = measured[predicted < 5] / predicted[predicted < 5]
    assert said.startswith(f"Of {ratio.size} cases")
    assert f"{ratio.min():.2g} to {ratio.max():.2g} times" in said
