"""Boxes as two and as three antennas report them: marks at the medians, hatching by the class."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.contour import ContourSet


@pytest.fixture
def found(products):
    """Three objects, of which two antennas lose the second."""
    one = products["two_antennas"].drop_dims("object")
    by_count = ("antenna_count", "object")
    return one.assign(
        top_height=(by_count, np.array([[0.3, -0.1, 0.4], [0.31, 0.38, 0.4]])),
        top_wrong=(by_count, np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])),
        true_top_height=("object", np.array([0.3, 0.4, 0.4])),
    ).assign_coords(object=np.arange(3))


def test_marks_are_the_medians_beside_the_true_heights(draw, products, study, found):
    figure = draw("three_antennas", products | {"two_antennas": found}, study)
    axes = figure.axes[-1]
    shown = {line.get_label(): line.get_ydata() for line in axes.lines}
    for count, name in ((2, "by two antennas"), (3, "by three antennas")):
        expected = 100 * found["top_height"].sel(antenna_count=count)
        np.testing.assert_allclose(shown[name], expected)
    assert [bar.get_height() for bar in axes.patches] == pytest.approx([30, 40, 40])


def test_what_is_not_delivered_is_hatched_on_the_map_of_all_antennas(draw, products, study, found):
    given = products | {"two_antennas": found}

    def hatched(dem):
        figure = draw("three_antennas", given | {"dem": dem}, study)
        return [
            axes.get_title(loc="left") or number
            for number, axes in enumerate(figure.axes)
            if any(isinstance(part, ContourSet) and part.hatches for part in axes.collections)
        ]

    dem = products["dem"]
    assert len(hatched(dem.assign(height_class=xr.ones_like(dem["height_class"])))) == 1
    assert not hatched(dem.assign(height_class=xr.zeros_like(dem["height_class"])))
