"""The driving vehicle: sweeps over its speed, and the sensor that suffices."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vinsar.figures import moving
from vinsar.radar import motion


def test_moving_shows_the_sweeps_and_the_sensor_that_suffices(draw, lines_of, products, study):
    figure = draw("moving", products, study)
    _, slow_focus, slow, _, fast, sensor = figure.axes
    speed = products["sweeps/speed"]
    std = 100 * speed["std"].sel(region="visible_ground").mean("realization")
    for axes, duration in ((slow, 0.5), (fast, 0.03)):
        for label, correction in (("not corrected", "none"), ("true speed", "exact")):
            line = lines_of(axes)[label]
            at = {"vehicle_scan_duration_s": duration, "vehicle_speed_correction": correction}
            np.testing.assert_allclose(line.get_ydata(), std.sel(at))
    gain = speed["point_gain"].sel(vehicle_scan_duration_s=0.5, vehicle_speed_correction="sensor")
    np.testing.assert_allclose(
        lines_of(slow_focus)["speed sensor"].get_ydata(), gain.mean(("realization", "channel"))
    )
    error = products["sweeps/speed_error"]
    spread = error["std"].sel(region="visible_ground").mean("realization")
    levels = error["vehicle_speed_error_m_per_s"].values
    marks = [line.get_xdata()[0] for line in sensor.lines if line.get_linestyle() == ":"]
    for duration, mark in zip((0.5, 0.03), marks, strict=True):
        means = spread.sel(vehicle_scan_duration_s=duration).values
        assert mark == motion.sufficient_error(levels, means, factor=1.1)
        shown = f"{1000 * mark:.2g} mm/s" if mark < 0.1 else f"{mark:.2g} m/s"
        assert any(shown in text.get_text() for text in figure.legends[1].get_texts())


def test_a_wrong_speed_shows_the_heights_of_other_places(products):
    # On a slope across the way the turned image errs by slope x angle x distance ahead.
    terrain, truth = products["terrain"].copy(deep=True), products["truth"].copy(deep=True)
    for part in (terrain, truth):
        part["height"] = 0.1 * part["x"] + 0 * part["y"]
        part["height"] = part["height"].transpose("y", "x")
    truth["shadow"] = xr.zeros_like(truth["shadow"])
    inner = truth.isel(x=slice(3, -3))
    found = moving.predicted_std(terrain, inner, true_slope=0.2, told_slope=0.201, floor_m=0.0)
    # 0.1 x 1 mrad x std of y; the place along x adds k x to y, 1 % in the square root.
    assert found == pytest.approx(1e-4 * float(inner["y"].std()), rel=0.03)
    both = moving.predicted_std(terrain, inner, true_slope=0.2, told_slope=0.201, floor_m=1e-4)
    assert both == pytest.approx(np.hypot(found, 1e-4))
