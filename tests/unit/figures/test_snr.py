"""Thermal noise: the sweep and the prediction."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures.drawing import sweeps
from vinsar.radar.instrument import Instrument


def test_snr_shows_the_sweep_and_the_prediction(draw, lines_of, products, study):
    lines = lines_of(draw("snr", products, study).axes[0])
    sweep = products["sweeps/snr"]
    ratio = sweep["echo_snr_db"].values
    std = sweep["std"].mean("realization")
    np.testing.assert_allclose(
        lines["std, whole scene"].get_ydata(), 100 * std.sel(region="whole_scene")
    )
    np.testing.assert_array_equal(lines["std, whole scene"].get_xdata(), ratio)
    planned, place = Instrument.planned(study.radar), (0.0, 11.0)
    filled = planned.filled(study.scene.x_min_m, study.scene.x_max_m, 11.0)
    gamma = planned.geometric_coherence(*place) / (1 + filled * 10 ** (-ratio / 10))
    phase, bound = sweeps.phase_std(study, "snr", planned, gamma)
    per_radian = 100 * planned.height_of_ambiguity(*place) / (2 * np.pi)
    np.testing.assert_allclose(lines["predicted, level ground"].get_ydata(), per_radian * phase)
    np.testing.assert_allclose(lines["Cramér-Rao bound"].get_ydata(), per_radian * bound)
    # No unbiased estimate of a phase that does not wrap is below it; noise alone wraps.
    assert (bound <= phase)[gamma > 0.5].all()


def test_it_is_as_wide_as_a_column(usual):
    assert usual("snr").get_figwidth() * 25.4 == pytest.approx(88)
