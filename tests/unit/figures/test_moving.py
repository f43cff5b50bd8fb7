"""The driving vehicle: sweeps over its speed, and the sensor that suffices."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vinsar.figures import moving
from vinsar.radar import motion, trajectory, waveform


def test_moving_shows_the_sweeps_and_the_sensor_that_suffices(draw, lines_of, products, study):
    figure = draw("moving", products, study)
    _, slow_focus, slow, _, fast, sensor, told = figure.axes
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
        assert 1000 * mark in [line.get_ydata()[0] for line in told.lines]
    both = 100 * products["sweeps/next_scan"]["std"].sel(region="visible_ground").mean(
        "realization"
    )
    for label, duration in (("0.5 s", 0.5), ("30 ms", 0.03)):
        line = lines_of(sensor)[f"(d, e) two scans, {label}"]
        np.testing.assert_allclose(line.get_ydata(), both.sel(vehicle_scan_duration_s=duration))


def test_moving_shows_the_bounds_of_one_scan_and_of_two(draw, products, study):
    one, two, fast = (
        line.get_ydata() for line in draw("moving", products, study).axes[-1].lines[:3]
    )
    top = products["sweeps/speed"]["vehicle_forward_speed_m_per_s"].values.max()
    at = np.array([top / 10, top])
    part = study.imaging
    antennas = trajectory.planned(study.radar)
    frequency = waveform.sampled(study.radar)
    options = {
        "extent": (part.x_min_m, part.x_max_m, part.y_min_m, part.y_max_m),
        "wavelength_m": 299_792_458.0 / frequency.mean(),
        "range_cell_m": 299_792_458.0 / 2 / np.ptp(frequency),
        "incoherent": 0.05,
    }
    for number in (0, -1):
        for duration, found in ((0.5, two), (0.03, fast)):
            times = {"duration_s": duration, "interval_s": duration}
            scans = (
                motion.advance(antennas, speed_m_per_s=at[number], duration_s=duration),
                motion.return_scan(antennas, speed_m_per_s=at[number], **times),
            )
            bound = motion.next_scan_bound(scans, **times, **options)
            assert found[number] == pytest.approx(1000 * bound)
        driven = motion.advance(antennas, speed_m_per_s=at[number], duration_s=0.5)
        bound = motion.speed_bound(driven, duration_s=0.5, **options)
        assert one[number] == pytest.approx(1000 * bound)


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
