"""Fig. 3 shows the products on common scales and in true proportion."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest

from vinsar.figures import FIGURES, chain
from vinsar.figures.drawing import style


def test_truth_and_reconstruction_share_colours_and_limits(draw, sheet, products, study):
    shown = [axes.images[0] for axes in sheet.axes if axes.images]
    assert len(shown) == 8
    truth, lower, upper, rebuilt = shown[0], shown[2], shown[3], shown[7]
    assert truth.get_clim() == rebuilt.get_clim()
    assert truth.get_cmap() == rebuilt.get_cmap()
    assert truth.get_cmap().name == "batlow"
    np.testing.assert_array_equal(truth.get_array(), products["truth"]["height"])
    np.testing.assert_array_equal(rebuilt.get_array(), products["dem"]["height"])
    low, high = truth.get_clim()
    assert low <= products["truth"]["height"].min()
    assert high >= products["truth"]["height"].max()
    # The two images: one scale, whose zero is the strongest cell of both.
    assert lower.get_clim() == upper.get_clim() == (-40.0, 0.0)
    assert max(lower.get_array().max(), upper.get_array().max()) == pytest.approx(0, abs=1e-5)
    amplitude = np.abs(products["images"]["image"].values)
    decibels = 20 * np.log10(amplitude / amplitude.max())
    np.testing.assert_allclose([lower.get_array(), upper.get_array()], decibels, atol=1e-4)
    # Single panels show the same.
    single = draw("fig3h", products, study)
    assert single.axes[0].images[0].get_clim() == truth.get_clim()


def test_maps_have_true_proportions_and_rise_ahead(sheet):
    for axes in sheet.axes:
        if axes.images:
            assert axes.get_aspect() == 1
            assert axes.images[0].origin == "lower"
            assert axes.get_xlim() == pytest.approx((-0.825, 0.825))
            assert axes.get_ylim() == pytest.approx((9.975, 12.025))


@pytest.mark.parametrize("letter", ["e", "f", "g"])
def test_phase_is_marked_at_multiples_of_pi(draw, letter, products, study):
    figure = draw(f"fig3{letter}", products, study)
    image, bar = figure.axes[0].images[0], figure.axes[1]
    ticks = bar.get_yticks() / np.pi
    labels = [label.get_text() for label in bar.get_yticklabels()]
    assert len(ticks) >= 2
    for tick, label in zip(ticks, labels, strict=True):
        number = label.replace("−", "-").replace("π", "")
        scale = 2 if number.endswith("/2") else 1
        number = number.removesuffix("/2")
        value = float({"": "1", "-": "-1"}.get(number, number)) / scale
        assert value == pytest.approx(tick, abs=1e-12)
    if letter != "g":
        assert image.get_clim() == (-np.pi, np.pi)
        assert labels == ["−π", "0", "π"]
        # Cyclic: the two ends are one phase and one colour.
        ends = image.get_cmap()([0.0, 1.0])
        np.testing.assert_allclose(ends[0], ends[1], atol=0.02)


def test_failed_cells_are_grey_counted_and_no_exception(draw, written, products, study):
    broken = {name: product.copy(deep=True) for name, product in products.items()}
    broken["dem"]["height"][:5] = np.nan
    broken["unwrapped"]["phase"][:] = np.nan
    broken["accuracy"]["height_error"][:] = np.nan
    broken["accuracy"]["height_error"][10, 10] = 3.0
    figure = draw("fig3", broken, study)
    shown = [axes.images[0] for axes in figure.axes if axes.images]
    for image in (shown[6], shown[7]):
        colour = image.to_rgba(image.get_array())[0, 0]
        np.testing.assert_allclose(colour, matplotlib.colors.to_rgba(style.NO_DATA), atol=0.01)
    errors = draw("fig4", broken, study)
    assert "1 cells beyond\n± 100 cm" in written(errors)


def test_flat_ground_still_has_a_height_scale(products):
    flat = products["truth"].copy(deep=True)
    flat["height"][:] = 0.0
    assert chain.height_limits(flat) == pytest.approx((-0.05, 0.05))
    flat["height"][3, 3] = 0.31
    assert chain.height_limits(flat) == pytest.approx((0.0, 0.35))


def test_the_caption_gives_the_share_of_shadow(products, study):
    shadow = 100 * float(products["truth"]["shadow"].mean())
    said = FIGURES["fig3"].numbers(products, study)
    assert f"{shadow:.1f} % of the cells are in shadow" in said


@pytest.mark.parametrize("key", ["height_colormap", "phase_colormap"])
def test_unknown_colormap_is_refused_with_its_key_and_a_hint(draw, products, study, key):
    options = study.figures.model_copy(update={key: "cmc.batlov"})
    wrong = study.model_copy(update={"figures": options})
    with pytest.raises(ValueError, match=rf"figures\.{key}.*cmc\.batlov.*cmc\.batlow"):
        draw("fig3", products, wrong)


@pytest.mark.parametrize("letter", chain.PANELS)
def test_a_panel_is_as_wide_as_a_column(usual, letter):
    assert usual(f"fig3{letter}").get_figwidth() * 25.4 == pytest.approx(88)
