"""Fig. 4 gives the statistics of the product and counts every cell."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import FIGURES, height_error


def test_statistics_are_the_product_s(draw, written, products, study):
    figure = draw("fig4", products, study)
    texts = written(figure)
    rows = height_error.table_rows(products["accuracy"])
    regions = ["delivered", "whole_scene", "visible_ground", "shadow"]
    assert [row[0] for row in rows[2:]] == [region.replace("_", " ") for region in regions]
    for row in rows:
        for cell in row:
            assert cell == "" or cell in texts
    keys = ["median", "std", "percentile_95_absolute", "maximum_absolute"]
    shares = ["fraction_within_tolerance", "fraction_reconstructed"]
    for row, region in zip(rows[2:], regions, strict=True):
        part = products["accuracy"].sel(region=region)
        assert int(row[1]) == int(part["cell_count"])
        numbers = [float(cell.replace("−", "-")) for cell in row[2:]]
        for number, key in zip(numbers[:4], keys, strict=True):
            assert number == pytest.approx(100 * float(part[key]), abs=0.0051), key
        for number, key in zip(numbers[4:], shares, strict=True):
            assert number == pytest.approx(100 * float(part[key]), abs=0.051), key
    assert "≤ 5 cm" in rows[0]


def test_histogram_counts_every_cell_once(draw, products, study):
    figure = draw("fig4", products, study)
    histogram = next(axes for axes in figure.axes if axes.get_yscale() == "log")
    counts = {
        patch.get_label(): patch.get_data().values.sum()
        for patch in histogram.patches
        if patch.get_label()
    }
    cells = dict(
        zip(
            ("whole scene", "visible ground", "shadow", "delivered"),
            products["accuracy"]["cell_count"].values,
            strict=True,
        )
    )
    assert counts == cells
    marks = sorted(line.get_xdata()[0] for line in histogram.lines)
    assert marks == [-5, 5]


def test_bins_end_at_the_tolerance_and_stay_few():
    edges = height_error.bin_edges(np.array([0.01, -0.17, np.nan]), 0.05)
    assert edges[0] == pytest.approx(-0.20)
    assert edges[-1] == pytest.approx(0.20)
    assert np.isclose(edges, 0.05).any()
    assert len(height_error.bin_edges(np.array([50.0]), 0.05)) == 401
    assert height_error.bin_edges(np.array([np.nan]), 0.05)[-1] == pytest.approx(0.10)


def test_the_caption_gives_the_statistics(products, study):
    said = FIGURES["fig4"].numbers(products, study)
    whole = products["accuracy"].sel(region="whole_scene")
    assert f"{100 * float(whole['fraction_within_tolerance']):.1f} % of" in said
    assert f"{100 * float(whole['maximum_absolute']):.1f} cm" in said
