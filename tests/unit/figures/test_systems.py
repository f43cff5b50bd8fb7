"""The comparison of antenna arrangements shows what the table holds."""

from __future__ import annotations

import pytest

from vinsar.prediction import systems


def test_systems_show_what_each_arrangement_achieves(draw, products, study):
    figure = draw("systems", products, study)
    found = systems.compare(products["sweeps/systems"], study)
    across, cycle, error, time = figure.axes
    for axes, values in (
        (across, [100 * one.resolution_m[0] for one in found]),
        (cycle, [one.height_of_ambiguity_m for one in found]),
        (time, [1000 * one.scan_time_s for one in found]),
    ):
        ends = [bar.get_x() + bar.get_width() for bar in axes.patches]
        assert ends == pytest.approx(values)
    shown = [line for line in error.lines if line.get_marker() == "o"]
    means = [100 * float(one.accuracy["std"].sel(region="visible_ground").mean()) for one in found]
    assert [line.get_xdata()[0] for line in shown] == pytest.approx(means)
    names = [text.get_text() for text in across.get_yticklabels()]
    assert names[:2] == ["rail, 0.8 m", "transmit pair, 0.8 m"]
