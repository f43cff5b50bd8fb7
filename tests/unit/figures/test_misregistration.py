"""Fig. 2 shows the product, in millimetres and with the allowed shift."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import FIGURES


def test_the_curve_of_an_array_is_an_ellipse(make_study, draw, written, products):
    study = make_study(radar={"system": "transmit_pair"})
    texts = written(draw("fig2", products, study))
    assert "ellipse" in texts
    assert not any("circle" in text for text in texts)


def test_registration_curves_are_the_product_s_in_millimetres(draw, products, study):
    figure = draw("fig2", products, study)
    product = products["registration"]
    panels = [(axis, target) for axis in ("x", "y") for target in ("near", "far")]
    for axes, (ground_axis, target) in zip(figure.axes[:4], panels, strict=True):
        part = product.sel(ground_axis=ground_axis, target=target)
        lines = {line.get_label(): line for line in axes.lines}
        for label, name in (
            ("radial (Eq. 7)", "radial"),
            ("circle", "equal_path"),
            ("measured on images", "measured"),
        ):
            np.testing.assert_allclose(lines[label].get_ydata(), 1000 * part[name].values)
        allowed = 100 * float(part["resolution"])
        limit = axes.get_ylim()[1]
        values = np.concatenate([line.get_ydata() for line in axes.lines[1:]])
        assert np.abs(values).max() < limit
        note = next(text.get_text() for text in axes.texts)
        assert note.startswith(f"± {allowed:.1f} mm")
        assert ("beyond" in note) == (allowed > limit)
    # One scale for near and far, so that the eye compares them.
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()
    assert figure.axes[2].get_ylim() == figure.axes[3].get_ylim()
    share = np.abs(product["map_equal_path"].sel(ground_axis="y")) / (
        0.1 * product["map_resolution"].sel(ground_axis="y")
    )
    image = figure.axes[4].images[0]
    np.testing.assert_allclose(image.get_array(), share.values)
    assert sum(image.get_clim()) == pytest.approx(2)  # white is exactly a tenth of a cell


def test_the_caption_gives_the_largest_error(products, study):
    near = products["registration"]["measured"].sel(ground_axis="y", target="near")
    said = FIGURES["fig2"].numbers(products, study)
    assert f"{1000 * float(abs(near).max()):.1f} mm in y" in said
