"""The chain without truth takes its colours from the reconstruction."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import measured


def test_the_measured_figure_colours_heights_by_the_reconstruction(draw, products, study):
    rebuilt = {name: products[name].copy(deep=True) for name in measured.INPUTS}
    height = rebuilt["dem"]["height"].values
    height[...] = np.linspace(-0.12, 0.31, height.size).reshape(height.shape)
    # One failed cell in more than a thousand does not stretch the colours; NaN has none.
    height[3, 3], height[5, 5] = 7.0, np.nan
    shown = draw("measured", rebuilt, study).axes[-2].images[0]
    assert shown.get_clim() == pytest.approx((-0.15, 0.35))
