"""The length of the baseline: the sweep, the prediction and the optimum."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import FIGURES, baseline_length
from vinsar.processing import filtering
from vinsar.radar.speckle import phase_std


def test_baseline_length_shows_the_sweep_the_prediction_and_the_optimum(
    make_sweep, draw, written, lines_of, products, study
):
    length = [0.1, 0.2, 0.3, 0.5, 1.0]
    std = np.array([0.09, 0.05, 0.02, 0.0205, 0.06])
    sweep = make_sweep({"radar.baseline_m": length}, std, realizations=3)
    sweep["std"].values[:] = std[:, None, None] * np.array([1, 0.5, 2, 0.3])
    figure = draw("baseline_length", products | {"sweeps/baseline_length": sweep}, study)
    spreads, ambiguity, coherence = figure.axes
    lines = lines_of(spreads)
    np.testing.assert_allclose(lines["std, whole scene"].get_ydata(), 100 * std)
    np.testing.assert_allclose(lines["std, visible ground"].get_ydata(), 50 * std)
    robust = 148.26 * sweep["mad"].sel(region="visible_ground").mean("realization")
    np.testing.assert_allclose(lines["1.48 MAD, visible ground"].get_ydata(), robust)
    # Written out: the coherence of level ground, the looks of the filter, the phase, the height.
    r1, wavelength, cell = np.hypot(11.0, 2.0), 299_792_458.0 / 14e9, 299_792_458.0 / 4e9
    r2 = np.hypot(11.0, 2.0 + np.array(length))
    # The channels share the wavenumbers from 13 GHz at y / r1 to 15 GHz at y / r2.
    gamma = (15 / r2 - 13 / r1) / (2 / np.sqrt(r1 * r2))
    cells = cell * r1 / 11 / 0.05, wavelength * r1 / 1.6 / 0.05
    filters = study.filtering.model_dump() | study.sweeps["baseline_length"].base["filtering"]
    looks = filtering.effective_looks(gamma, cells, shifted=1.0, **filters)
    height = wavelength * r2 / (2 * np.array(length))
    expected = height / (2 * np.pi) * phase_std(gamma, looks)
    # Rodriguez and Martin (1992), written out.
    bound = height / (2 * np.pi) * np.sqrt((1 - gamma**2) / (2 * looks)) / gamma
    np.testing.assert_allclose(lines["Cramér-Rao bound"].get_ydata(), 100 * bound)
    critical = np.sqrt((15 / 13 * r1) ** 2 - 11**2) - 2
    np.testing.assert_allclose(lines["predicted, level ground"].get_ydata(), 100 * expected)
    np.testing.assert_allclose(ambiguity.lines[0].get_ydata(), height)
    np.testing.assert_allclose(coherence.lines[1].get_ydata(), gamma)
    for axes in figure.axes:
        marks = [line.get_xdata()[0] for line in axes.lines if len(set(line.get_xdata())) == 1]
        assert any(mark == pytest.approx(critical / 4) for mark in marks)
    texts = written(figure)
    assert "least: 2.00 cm at 0.3 m" in texts
    assert "within 10 % of it: 0.3 … 0.5 m" in texts
    assert baseline_length.best_lengths(sweep) == (0.3, 0.3, 0.5)


def test_the_caption_gives_the_best_length(products, study):
    best, _, _ = baseline_length.best_lengths(products["sweeps/baseline_length"])
    said = FIGURES["baseline_length"].numbers(products, study)
    assert f"is that of {best:g} m" in said
