"""The design sheet: formulas of the rail where there are some, finite differences elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import spence

import vinsar
from vinsar.evaluation import baseline_errors
from vinsar.foundations.configuration import Study
from vinsar.foundations.errors import ConfigurationError
from vinsar.prediction import design
from vinsar.radar import aperture, formulas, geometry, trajectory
from vinsar.study import validation

CONFIG = Path(__file__).parents[2] / "config"
WAVELENGTH = 299_792_458.0 / 14e9
ENDS = ("transmitter", "receiver")
BOX = {"shape": "box", "x_m": 0.0, "y_m": 13.0, "size_x_m": 0.4, "size_y_m": 0.4}
PIT = {"shape": "pit", "x_m": 1.0, "y_m": 13.0, "diameter_m": 0.6, "depth_m": 0.4}
PAPER = vinsar.load()


def study_with(**sections: dict[str, Any]) -> Study:
    raw = PAPER.model_dump(mode="json") | {"sweeps": {}, "variants": {}}
    raw["outputs"] = {"figures": [], "claims": False}
    return validation.check(validation.merge(raw, sections))


def sheet_of(**sections: dict[str, Any]) -> design.Sheet:
    return design.Sheet(study_with(**sections))


def exact_height_error(true, told, x, y):
    """Invert the true phase of a target on the ground with the told upper antenna."""
    lower, upper = trajectory.apertures(true)
    phase = aperture.interferometric_phase(lower, upper, x, y, 0.0, WAVELENGTH)
    *_, height = aperture.locate(lower, trajectory.apertures(told)[1], x, y, phase, WAVELENGTH)
    return float(height)


@pytest.mark.parametrize("angle", [30.0, 60.0, 90.0, 120.0])
def test_of_a_rail_the_height_of_ambiguity_is_the_paper_s(angle):
    sheet = sheet_of(radar={"baseline_angle_deg": angle})
    lower, upper = sheet.instrument.separated
    r1, r2 = (geometry.slant_range(end, 0.0, sheet.places) for end in (lower, upper))
    look = geometry.look_angle(lower, 0.0, sheet.places)
    formula = formulas.height_of_ambiguity(r1, WAVELENGTH, 0.3, np.deg2rad(angle), look)
    # The exact slope has r2 where the formula has r1.
    np.testing.assert_allclose(
        sheet.instrument.height_of_ambiguity(0.0, sheet.places), formula * r2 / r1, rtol=1e-9
    )


@pytest.mark.parametrize("angle", [30.0, 60.0, 90.0, 120.0])
def test_of_a_rail_length_and_attitude_of_the_baseline_are_eqs_5_and_12_with_their_exact_terms(
    angle,
):
    sheet = sheet_of(radar={"baseline_angle_deg": angle})
    length, attitude, *_ = sheet.offsets()
    for number, y in enumerate(sheet.places):
        antenna = np.array([0.0, 0.0, 2.0])
        expected = baseline_errors.height_per_length(antenna, float(y), 0.3, np.deg2rad(angle))
        assert length.per_unit[number] / 1e-3 == pytest.approx(float(expected), rel=1e-6)
        r1, look = (f(antenna, 0.0, y) for f in (geometry.slant_range, geometry.look_angle))
        eq12 = formulas.height_per_baseline_angle(r1, look)
        assert attitude.per_unit[number] == pytest.approx(np.deg2rad(float(eq12)), rel=1e-6)


@pytest.mark.parametrize("system", ["rail", "transmit_pair", "receive_pair"])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("x", "y"), [(0.0, 13.0), (1.5, 10.0)])
def test_an_offset_moves_the_height_as_the_exact_inversion_does(system, axis, x, y):
    sheet = sheet_of(radar={"system": system})
    true = sheet.antennas
    ends = {"rail": ENDS, "transmit_pair": ENDS[:1], "receive_pair": ENDS[1:]}[system]
    step = np.array([0, 1])[:, None, None] * 1e-4 * np.eye(3)[axis]
    moved = {end: true[end].copy(data=true[end].values + step) for end in ends}
    found = float(sheet.height_per_offset(x, y, np.eye(3)[axis]))
    # Second order of a tenth of a millimetre: 1e-4 / B of the height error itself.
    expected = exact_height_error(true, true.assign(moved), x, y) / 1e-4
    assert found == pytest.approx(expected, rel=2e-3, abs=1e-3)


@pytest.mark.parametrize("system", ["transmit_pair", "receive_pair"])
def test_a_switched_array_has_twice_the_rail_s_height_of_ambiguity_and_cell(system):
    rail, array = sheet_of(), sheet_of(radar={"system": system})
    y = rail.places
    # The ends of an array's paths stand at other heights than the rail's: a few per cent.
    rail, array = rail.instrument, array.instrument
    np.testing.assert_allclose(
        array.height_of_ambiguity(0.0, y), 2 * rail.height_of_ambiguity(0.0, y), rtol=0.06
    )
    np.testing.assert_allclose(
        array.resolution(0.0, y)[0], 2 * rail.resolution(0.0, y)[0], rtol=0.02
    )
    assert array.unambiguous_width(0.0, 13.0) > 1.9 * rail.unambiguous_width(0.0, 13.0)


def test_an_array_dwells_on_each_sample():
    sheet = sheet_of(radar={"system": "receive_pair", "dwell_s": 1e-6})
    assert sheet.scan_duration == pytest.approx(2 * 81 * 401 * 1e-6)
    assert sheet_of().scan_duration == PAPER.vehicle.scan_duration_s


def test_a_driving_vehicle_s_sheet_says_what_echoes_tell_of_its_speed():
    def told(**vehicle):
        return sheet_of(vehicle={"speed_correction": "exact"} | vehicle).speed_bound()

    # A smaller yaw angle, or noise, leaves less to see.
    assert told(forward_speed_m_per_s=5.0) < told(forward_speed_m_per_s=2.0)
    noisy = sheet_of(
        vehicle={"speed_correction": "exact", "forward_speed_m_per_s": 5.0}, echo={"snr_db": 0.0}
    )
    assert noisy.speed_bound() > 1.5 * told(forward_speed_m_per_s=5.0)
    driving = vinsar.load(vehicle={"forward_speed_m_per_s": 5.0, "speed_correction": "exact"})
    line = f"speed to {design.Sheet(driving).speed_bound():.2g} m/s at best"
    assert line in design.as_markdown(design.Sheet(driving))
    assert "at best" not in design.as_markdown(design.Sheet(PAPER))


def test_an_obstacle_hides_what_a_ray_over_its_top_misses():
    assert sheet_of().shadow_length(10.0) == pytest.approx(10.0 * 0.3 / 1.7)
    # An antenna just above the top sees 300 times as little of what lies behind.
    low = sheet_of(radar={"rail_height_m": 0.301})
    assert low.shadow_length(10.0) == pytest.approx(10.0 * 0.3 / 0.001)
    with pytest.raises(ConfigurationError, match="what is as high hides all behind it"):
        sheet_of(radar={"rail_height_m": 0.25})


def test_the_reference_takes_what_is_constant_over_the_image():
    for error in sheet_of().offsets():
        assert error.tolerated_referenced >= error.tolerated * 0.999, error.name
    # One millimetre ahead is 4 cm at once, by a phase that is nearly the same everywhere.
    ahead = next(error for error in sheet_of().offsets() if error.name.endswith("along y"))
    assert ahead.per_unit[1] == pytest.approx(-0.0433, abs=1e-3)
    assert ahead.tolerated_referenced > 20 * ahead.tolerated


def test_noise_grows_with_what_makes_noise():
    y = np.array([10.0, 16.0])
    quiet = sheet_of().height_std(y)
    assert (sheet_of(echo={"snr_db": 0.0}).height_std(y) > 1.5 * quiet).all()
    assert (sheet_of(filtering={"goldstein_alpha": 0.4}).height_std(y) > 1.2 * quiet).all()
    assert (sheet_of().height_std(y, 0.5) > 1.2 * quiet).all()
    # A random phase is the worst.
    most = sheet_of().instrument.height_of_ambiguity(0.0, y) / np.sqrt(12)
    np.testing.assert_allclose(sheet_of().height_std(y, 5.0), most, rtol=1e-3)


def test_without_a_filter_the_noise_is_that_of_a_single_look():
    sheet = sheet_of(echo={"snr_db": 10.0}, filtering={"method": "none"})
    # The scene's 5 m fill a third of the unambiguous width, which the noise fills whole.
    filled = float(sheet.instrument.filled(-2.5, 2.5, 13.0))
    assert 0.3 < filled < 0.35
    coherence = float(sheet.instrument.geometric_coherence(0.0, 13.0)) / (1 + filled / 10)
    angle = np.arcsin(coherence)
    phase = np.pi**2 / 3 - np.pi * angle + angle**2 - spence(1 - coherence**2) / 2
    cycle = float(sheet.instrument.height_of_ambiguity(0.0, 13.0))
    assert sheet.height_std(13.0) == pytest.approx(cycle / (2 * np.pi) * np.sqrt(phase), rel=1e-6)


def test_spreading_makes_the_far_edge_noisier():
    sheet = sheet_of(echo={"snr_db": 20.0, "spreading": True})
    near, middle, far = sheet.snr_db(sheet.places)
    assert middle == pytest.approx(20.0)
    assert near - far == pytest.approx(40 * np.log10(np.hypot(16, 2) / np.hypot(10, 2)), abs=1e-9)


def test_tolerated_scatter_leaves_95_percent_within_the_tolerance():
    sheet = sheet_of(radar={"baseline_angle_deg": 60.0})
    for common in (False, True):
        std = sheet.tolerated_scatter(2, common=common)
        assert sheet.share_within(2, std, common=common) == pytest.approx(0.95, abs=1e-4)
    # Ahead, the path changes by all of the error, up by its share H / r only.
    assert sheet.tolerated_scatter(2) > 4 * sheet.tolerated_scatter(1)
    assert sheet_of(accuracy={"tolerance_m": 0.005}).tolerated_scatter(1) == 0


def test_of_a_vertical_baseline_alone_errors_of_both_channels_do_level_ground_no_harm():
    sheets = {beta: sheet_of(radar={"baseline_angle_deg": beta}) for beta in (90.0, 60.0)}
    shares = {
        (beta, common): sheet.share_within(2, 8.51e-3, common=common)
        for beta, sheet in sheets.items()
        for common in (False, True)
    }
    assert shares[90.0, True] > 0.999
    assert 0.85 < shares[60.0, False] < 0.95
    assert shares[60.0, True] < 0.98
    assert sheets[90.0].tolerated_scatter(2, common=True) == np.inf


@pytest.mark.parametrize("system", ["rail", "transmit_pair"])
@pytest.mark.parametrize("referenced", [False, True])
def test_a_tolerated_attitude_moves_a_height_by_just_the_tolerance(system, referenced):
    sheet = sheet_of(radar={"system": system})
    attitude = sheet.offsets()[1]
    angle = attitude.tolerated_referenced if referenced else attitude.tolerated
    lower, upper = sheet.instrument.separated
    line = upper - lower
    worst = 0.0
    for sign in (-1, 1):
        turn = np.deg2rad(sign * angle)
        told = np.array([0.0, -np.sin(turn) * line[2], np.cos(turn) * line[2]])
        step = told - line
        worst = max(worst, sheet.height_error(step, referenced=referenced))
        # The length stays.
        assert np.linalg.norm(line + step) == pytest.approx(0.3)
    assert worst == pytest.approx(0.05, rel=1e-3)


def test_with_the_reference_the_exact_tolerance_of_the_attitude_is_less_than_the_linear_one():
    sheet = sheet_of()
    x, y = np.meshgrid(np.linspace(-2.5, 2.5, 5), np.linspace(10, 16, 7))
    attitude = sheet.offsets()[1]
    direction = np.array([0.0, -0.3, 0.0]) * np.pi / 180
    per_degree = sheet.height_per_offset(x, y, direction)
    # Unreferenced, degrees are small and the derivative (Eq. 12) will do.
    assert attitude.tolerated == pytest.approx(0.05 / np.abs(per_degree).max(), rel=0.02)
    assert attitude.tolerated_referenced < 0.95 * 5.4


def test_the_height_error_of_a_step_is_that_of_the_exact_inversion():
    sheet = sheet_of()
    step = np.array([0.0, 2e-3, 1e-3])
    moved = {
        end: sheet.antennas[end].copy(
            data=sheet.antennas[end].values + np.array([0, 1])[:, None, None] * step
        )
        for end in ENDS
    }
    told = sheet.antennas.assign(moved)
    corners = [
        abs(exact_height_error(sheet.antennas, told, x, y))
        for x in (-2.5, -1.25, 0.0, 1.25, 2.5)
        for y in np.linspace(10, 16, 7)
    ]
    assert sheet.height_error(step, referenced=False) == pytest.approx(max(corners), rel=1e-9)


@pytest.mark.parametrize("shape", ["box", "pit", "mound"])
@pytest.mark.parametrize("height", [0.2, 0.3])
def test_upright_objects_of_more_than_half_a_cycle_are_warned_of(shape, height):
    item = {"shape": shape, "x_m": 0.0, "y_m": 13.0}
    item |= {"depth_m" if shape == "pit" else "height_m": height}
    item |= {"size_x_m": 0.4, "size_y_m": 0.4} if shape == "box" else {"diameter_m": 0.6}
    sheet = sheet_of(scene={"terrain": "flat", "objects": [item]})
    # Half of 0.471 m at 13 m.
    told = any("half the height of ambiguity, 0.24 m" in line for line in sheet.warnings())
    assert told == (height == 0.3 and shape != "mound")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"radar": {"frequency_count": 225}}, "unambiguous range"),
        ({"radar": {"position_spacing_m": 0.8 / 44}}, "imaged once"),
        ({"imaging": {"grid_spacing_m": 0.05}}, "undersampled"),
        ({"echo": {"coupling_db": 60.0}}, "sidelobes are +9 dB"),
        ({"echo": {"snr_db": -10.0}}, "fewer than 95 %"),
        ({"radar": {"baseline_m": 1.0}}, "less than half the relief"),
        ({"radar": {"baseline_m": 2.5}}, "a quarter of the critical baseline"),
        ({"radar": {"baselines_m": [0.2, 0.3]}}, "wrap the phase of the shortest one"),
        (
            {"radar": {"baselines_m": [0.01, 0.3]}, "echo": {"snr_db": 5.0}},
            "the noise of 0.01 m leaves cycles of 0.3 m open",
        ),
    ],
)
def test_what_is_unwise_is_said(changes, words):
    assert any(words in sentence for sentence in sheet_of(**changes).warnings())
    assert not any(words in sentence for sentence in sheet_of().warnings())


def test_suppression_ends_the_warning_of_the_coupling():
    for cure in ({"suppression": {"method": "gate"}}, {"imaging": {"range_window": "hann"}}):
        sheet = sheet_of(echo={"coupling_db": 60.0}, **cure)
        assert sheet.coupling_db() is None
        assert not any("sidelobes" in sentence for sentence in sheet.warnings())


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_study_has_a_sheet(path):
    # The echoes that some name are not in the repository.
    study = validation.check(validation.read(CONFIG / "paper.yaml", path))
    text = design.as_markdown(design.Sheet(study))
    assert text.startswith(f"# Design of the study {study.study}\n")
    assert "nan" not in text
    assert "-0.000" not in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) > 20


def test_a_short_baseline_ends_the_warning_of_upright_objects():
    scene = {"terrain": "flat", "objects": [BOX | {"height_m": 0.5}]}
    words = "half the height of ambiguity"
    assert any(words in line for line in sheet_of(scene=scene).warnings())
    recommended = sheet_of(scene=scene).settling_baselines(0.5)
    assert len(recommended) == 2
    helped = sheet_of(scene=scene, radar={"baselines_m": list(recommended)})
    told = [line for line in helped.warnings() if words in line or "baselines_m" in line]
    assert told == []


def test_the_sheet_gives_each_baseline_its_ambiguity_and_recommends_some():
    text = design.as_markdown(sheet_of(radar={"baselines_m": [0.06, 0.3]}))
    # lambda r2 / 2B at 10 m: 0.02141 x hypot(10, 2.06) / 0.12.
    assert "| the same of 0.06 m (m) | 1.822 |" in text
    assert "| 0.5 | 0.101, 0.3 |" in text


def test_the_sheet_of_the_paper_names_its_figures():
    text = design.as_markdown(design.Sheet(PAPER))
    for words in (
        "wavelength 21.41 mm, slant-range resolution 7.49 cm",
        "unambiguous range 29.98 m",
        "| height of ambiguity (m) | 0.366 | 0.471 | 0.577 |",
    ):
        assert words in text


@pytest.mark.parametrize(
    ("scene", "relief"),
    [
        ({}, 0.3),
        ({"terrain": "flat"}, 0.3),
        ({"terrain": "flat", "objects": [BOX | {"height_m": 0.12}, PIT]}, 0.12),
        ({"terrain": "peaks", "objects": [BOX | {"height_m": 0.12}]}, 0.3),
        ({"terrain": "peaks", "objects": [BOX | {"height_m": 0.5}]}, 0.5),
    ],
)
def test_the_relief_is_the_highest_thing_declared(scene, relief):
    assert sheet_of(scene=scene).relief == relief


def test_where_echoes_are_measured_the_image_stands_for_the_scene():
    measured = sheet_of(measurement={"file": "echo.nc"}, scene={"x_max_m": 4.0, "y_max_m": 20.0})
    assert measured.scene is measured.study.imaging
    assert measured.farthest_range == sheet_of().farthest_range
