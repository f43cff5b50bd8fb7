"""The figure of the standard deviations says what the products hold."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import calibration
from vinsar.processing.classification import CLASSES, SHADOW, VALID


def test_bins_and_coverage_are_the_product_s(draw, products, study):
    figure = draw("calibration", products, study)
    accuracy = products["accuracy"]
    spread, coverage = figure.axes[:2]
    np.testing.assert_allclose(
        spread.lines[1].get_xydata().T,
        [100 * accuracy["binned_std"].values, 100 * accuracy["binned_error"].values],
    )
    shown = [line.get_ydata() for line in coverage.lines if len(line.get_xdata()) == 5]
    np.testing.assert_allclose(shown, 100 * accuracy["binned_coverage"].values.T)


def test_classes_are_shares_of_visible_and_of_hidden_ground(products):
    found = calibration.confusion(products["dem"], products["truth"])
    assert found.shape == (len(CLASSES), 2)
    np.testing.assert_allclose(np.nansum(found, axis=0)[0], 1)
    seen = ~products["truth"]["shadow"].values
    valid = products["dem"]["height_class"].values == VALID
    assert found[VALID, 0] == pytest.approx(valid[seen].mean())
    if np.isfinite(found[SHADOW, 1]):
        assert found[SHADOW, 1] > found[SHADOW, 0]
