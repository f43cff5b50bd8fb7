"""Fig. 1 is the geometry of the configuration, to scale."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import FIGURES, acquisition
from vinsar.radar import geometry


@pytest.mark.parametrize(
    ("radar", "far"),
    [
        ({}, 30.0),
        ({"baseline_angle_deg": 45.0, "rail_height_m": 1.6}, 12.0),
        ({"baseline_angle_deg": 0.0, "baseline_m": 1.0}, 16.0),
        ({"baseline_angle_deg": 120.0, "rail_height_m": 0.9, "baseline_m": 0.1}, 16.0),
        ({"system": "transmit_pair", "aperture_length_m": 1.6}, 16.0),
        ({"system": "receive_pair", "transmitter_x_m": 0.9, "transmitter_y_m": -0.4}, 16.0),
    ],
)
def test_geometry_is_readable_for_other_radars(make_study, draw, check_readable, radar, far):
    study = make_study(radar=radar, scene={"y_max_m": far}, imaging={"y_max_m": far})
    figure = draw("fig1", {}, study)
    check_readable(figure)


def test_geometry_is_to_scale_with_the_study_s_values(make_study, draw, written):
    study = make_study(radar={"baseline_angle_deg": 60.0})
    figure = draw("fig1", {}, study)
    views = [axes for axes in figure.axes if axes.axison]
    assert len(views) == 3
    assert all(axes.get_aspect() == 1 for axes in views)
    # Equal aspect has not shrunk the axes: their proportions are those of their limits.
    for axes in views:
        box = axes.get_position(original=True)
        axes.apply_aspect()
        assert axes.get_position().bounds == pytest.approx(box.bounds, abs=2e-3)
    lower = (0.0, 0.0, 2.0)
    upper = (0.0, 0.3 * np.cos(np.pi / 3), 2.0 + 0.3 * np.sin(np.pi / 3))
    target = (0.0, 13.0, 0.3)
    r1, r2 = (float(geometry.slant_range(antenna, *target)) for antenna in (lower, upper))
    texts = written(figure)
    assert f"$r_1$ = {r1:.3f} m" in texts
    assert f"$r_2$ = {r2:.3f} m" in texts
    assert r"$\beta$ = 60°" in texts
    listed = dict(acquisition.values(study))
    assert listed[r"wavelength $\lambda$"] == "21.4 mm"
    assert listed["positions"] == "81"
    assert listed[r"$\Delta r = r_1 - r_2$"] == f"{1000 * (r1 - r2):.1f} mm".replace("-", "−")
    # On the ground: lambda r1 sin(theta) / 2 B_perp with the upper range for the lower one.
    ends = [np.hypot(13.0 - y, z) for y, z in ((0.0, 2.0), (0.15, 2.0 + 0.3 * np.sin(np.pi / 3)))]
    look = np.arctan2(13.0, 2.0)
    ambiguity = 0.0214137 * ends[1] * np.sin(look) / (2 * 0.3 * np.cos(np.pi / 3 - look))
    assert listed["height of ambiguity"] == f"{ambiguity:.3f} m"
    assert set(listed.values()) - {""} <= set(texts)


@pytest.mark.parametrize(
    ("system", "names"),
    [("transmit_pair", {"Tx$_1$", "Tx$_2$", "Rx"}), ("receive_pair", {"Rx$_1$", "Rx$_2$", "Tx"})],
)
def test_geometry_of_an_array_shows_its_transmitters_and_receivers(
    make_study, draw, written, system, names
):
    study = make_study(radar={"system": system, "transmitter_x_m": 0.6, "transmitter_y_m": 0.1})
    figure = draw("fig1", {}, study)
    assert names <= set(written(figure))
    transmitter = (0.6, 0.1, 2.1)
    lower = np.array(transmitter if system == "transmit_pair" else (0.0, 0.0, 2.0))
    listed = dict(acquisition.values(study))
    r1 = float(geometry.slant_range(lower, 0.0, 13.0, 0.3))
    assert f"$r_1$ = {r1:.3f} m" in written(figure)
    # About twice those of a rail: lambda r2 / B and lambda r / L, on the ground. The transmitter
    # beside the array tilts the cut in which a pixel's targets lie.
    r2 = np.hypot(13.0, lower[2] + 0.3)
    assert float(listed["height of ambiguity"][:-2]) == pytest.approx(
        0.0214137 * r2 / 0.3, rel=0.06
    )
    assert float(listed["resolution in x"][:-3]) == pytest.approx(2.14137 * r1 / 0.8, rel=0.01)
    # In the plan the transmitter stands where it is.
    plan = next(axes for axes in figure.axes if axes.get_title(loc="left").startswith("(c)"))
    spots = [line.get_xydata()[0] for line in plan.lines if len(line.get_xydata()) == 1]
    assert any(np.allclose(spot, transmitter[:2]) for spot in spots)


def test_geometry_shows_the_image_where_it_is_not_the_scene(make_study, draw, written):
    study = make_study(imaging={"x_min_m": -1.0})
    assert "scene, image outlined" in written(draw("fig1", {}, study))
    assert "scene and image" in written(draw("fig1", {}, make_study()))


def test_the_caption_gives_the_range(products, study):
    r1 = float(geometry.slant_range((0.0, 0.0, 2.0), 0.0, 11.0, 0.2))
    assert f"r1 = {r1:.3f} m" in FIGURES["fig1"].numbers(products, study)
