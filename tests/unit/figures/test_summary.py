"""The front sheet says what the product holds, in letters for a room."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import summary


def test_front_sheet_says_what_the_product_holds_and_large(draw, written, sizes, products, study):
    figure = draw("summary", products, study)
    texts = written(figure)
    accuracy = products["accuracy"]
    whole = accuracy.sel(region="whole_scene")
    delivered = accuracy.sel(region="delivered")
    numbers = [texts[texts.index(number)] for number, _ in summary.statistics(accuracy)]
    assert [float(number.split()[0]) for number in numbers] == pytest.approx(
        [
            round(100 * float(delivered["share_of_scene"]), 1),
            round(100 * float(delivered["fraction_within_tolerance"]), 1),
            round(100 * float(whole["fraction_within_tolerance"]), 1),
            round(100 * float(whole["std"]), 1),
        ]
    )
    images = [axes.images[0] for axes in figure.axes if axes.images]
    np.testing.assert_allclose(images[4].get_array(), 100 * accuracy["height_error"])
    # A thirtieth of the slide's height is what a room's last row reads.
    assert min(sizes(figure)) >= 0.99 * figure.get_figheight() * 72 / 35


def test_it_is_a_slide(draw, products, study):
    assert draw("summary", products, study).get_size_inches() * 25.4 == pytest.approx(
        [338.7, 190.5]
    )
