"""Detection against false alarms: the counts of the sweep."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.evaluation import detection_accuracy
from vinsar.figures import THUMBNAILS


def test_roc_shows_the_counts_of_the_sweep(draw, written, lines_of, products, study):
    figure = draw("roc", products, study)
    curves, by_height, holes = figure.axes
    lines = lines_of(curves)
    # The box is found up to a threshold of 5 cm; on 4 m2, n false alarms are 25 n on 100 m2.
    heights = detection_accuracy.HEIGHT_THRESHOLDS
    line = lines["heights, 1 cm"]
    np.testing.assert_array_equal(line.get_ydata(), heights < 0.055)
    np.testing.assert_allclose(line.get_xdata(), 25 * np.round(2 * np.exp(-heights / 0.02)))
    ratios = detection_accuracy.AMPLITUDE_THRESHOLDS
    line = lines["image alone, 1 cm"]
    np.testing.assert_array_equal(line.get_ydata(), ratios < 2)
    np.testing.assert_allclose(line.get_xdata(), 25 * np.round(8 * np.exp(-ratios / 2)))
    # One height at a distance is no curve.
    assert len(by_height.lines) == 1
    shares = [bar.get_width() for bar in holes.patches]
    assert shares == pytest.approx([0, 60, 40])
    assert "pit, 0.3 m long, 10 cm deep, at 11.4 m" in written(figure)


def test_the_detection_accuracy_has_a_line_and_no_picture():
    assert THUMBNAILS["detection_accuracy"].draw is None
