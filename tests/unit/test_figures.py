"""The figures: what they show is what the products hold, readable, and the same bytes each time."""

from __future__ import annotations

import hashlib
import json
import re
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
import xarray as xr
import yaml
from matplotlib.figure import Figure
from matplotlib.text import Text

from vinsar import figures
from vinsar.evaluation import detection_accuracy
from vinsar.figures import (
    acquisition,
    baselines,
    chain,
    files,
    height_error,
    maps,
    moving,
    style,
    summary,
    sweeps,
    thumbnails,
)
from vinsar.foundations import variables
from vinsar.prediction import systems
from vinsar.radar import baseline, geometry, motion
from vinsar.radar.instrument import Instrument
from vinsar.study import config, pipeline, validation

PAPER = Path(__file__).parents[2] / "config" / "paper.yaml"
OF_SWEEPS = ["fig5", "baseline_length", "baseline_vibration", "snr", "moving", "systems"]
NAMES = [
    "summary",
    "measured",
    *("fig1", "fig2", "fig3", *(f"fig3{letter}" for letter in "abcdefgh"), "fig4", "fig5"),
    *("baseline_length", "baseline_angle", "baseline_vibration", "snr", "moving"),
    *("obstacles", "roc"),
    *("coupling", "design", "design_check", "systems"),
]
NARROW = {*(f"fig3{letter}" for letter in "abcdefgh"), "snr", "design_check"}
# The front sheet is a slide, whatever the journal's columns and text are.
SLIDES = {"summary": 338.7}
FORMATS = ["pdf", "svg", "png"]
SMALL: dict[str, dict[str, Any]] = {
    "radar": {"frequency_count": 201, "position_spacing_m": 0.02},
    "scene": {
        "x_min_m": -0.8,
        "x_max_m": 0.8,
        "y_min_m": 10.0,
        "y_max_m": 12.0,
        "terrain_spacing_m": 0.05,
        "facet_size_m": 0.04,
        "peak_height_m": 0.2,
        "objects": [
            {"shape": "box", "x_m": 0.4, "y_m": 11.4, "size_x_m": 0.3, "size_y_m": 0.2}
            | {"height_m": 0.1, "rotation_deg": 20.0},
            {"shape": "pit", "x_m": -0.3, "y_m": 11.4, "diameter_m": 0.3, "depth_m": 0.1},
        ],
        "patches": [
            {"x_m": 0.0, "y_m": 10.6, "size_x_m": 0.3, "size_y_m": 0.3, "reflectivity": 3.0}
        ],
    },
    "imaging": {
        "x_min_m": -0.8,
        "x_max_m": 0.8,
        "y_min_m": 10.0,
        "y_max_m": 12.0,
        "grid_spacing_m": 0.05,
    },
    "filtering": {"goldstein_patch_px": 16, "goldstein_step_px": 4},
    "height": {
        "level_ground": [{"x_min_m": -0.8, "x_max_m": -0.6, "y_min_m": 10.0, "y_max_m": 10.2}]
    },
    "registration": {"height_count": 3},
}


def make_study(**sections: dict[str, Any]) -> config.Study:
    values = yaml.safe_load(PAPER.read_text(encoding="utf-8"))
    for other in ("array", "moving", "obstacles", "coupling"):
        text = PAPER.with_name(f"{other}.yaml").read_text(encoding="utf-8")
        values["sweeps"] |= yaml.safe_load(text)["sweeps"]
    for name, section in sections.items():
        values[name] |= section
    return config.Study.model_validate(values)


@pytest.fixture(scope="module")
def study() -> config.Study:
    return make_study(**SMALL)


@pytest.fixture(scope="module")
def products(study: config.Study) -> pipeline.Products:
    return pipeline.run(study) | all_sweeps(study)


def make_sweep(
    over: dict[str, list[Any]], std_m: Any, realizations: int = 4, seed: int = 0
) -> pipeline.Products:
    """Make a sweep with some std by case; other realizations scatter by a tenth around it."""
    rng = np.random.default_rng(seed)
    shape = (*(len(values) for values in over.values()), realizations)
    std = np.broadcast_to(np.asarray(std_m, float)[..., None], shape)
    std = std * rng.uniform(0.9, 1.1, shape)
    data: dict[str, Any] = {}
    for name, variable in variables.SWEEP.items():
        one = std if name not in {"coherence", "point_gain", "peak_gain"} else 1 / (1 + 20 * std)
        trailing = {"region": (1.0, 0.4, 2.0), "channel": (1.0, 0.9), "ground_axis": (1.0, 0.1)}
        for dim in variable.dims:
            one = one[..., None] * np.asarray(trailing[dim])
        data[name] = one.astype(int) if name == "residues" else one
    swept = {
        key.replace(".", "_"): (
            np.asarray([json.dumps(v) if isinstance(v, dict) else v for v in values]),
            {"long_name": key},
        )
        for key, values in over.items()
    }
    return variables.sweep_dataset(data, swept)


def make_found(roughness: list[float], realizations: int = 4) -> xr.Dataset:
    """Make a sweep over the scene of `SMALL`: a box that is found up to 5 cm, a pit that is not."""
    heights = detection_accuracy.HEIGHT_THRESHOLDS
    ratios = detection_accuracy.AMPLITUDE_THRESHOLDS
    found = np.stack([heights < 0.055, heights < 0], axis=-1)
    seen = np.stack([ratios < 2, ratios < 1.5], axis=-1)
    data = {
        "object_x": np.array([0.4, -0.3]),
        "object_y": np.array([11.4, 11.4]),
        "object_height": np.array([0.1, -0.1]),
        "height_found": found,
        "height_false_alarms": np.round(2 * np.exp(-heights / 0.02)),
        "amplitude_found": seen,
        "amplitude_false_alarms": np.round(8 * np.exp(-ratios / 2)),
        "object_unknown": np.array([0.1, 0.6]),
        "object_free": np.array([0.2, 0.4]),
        "shadow_unknown": np.array(0.7),
        "visible_unknown": np.array(0.02),
        "scene_area": np.array(4.0),
    }
    shape = (len(roughness), realizations)
    data = {name: np.broadcast_to(value, (*shape, *value.shape)) for name, value in data.items()}
    plain = make_sweep({"scene.roughness_std_m": roughness}, np.full(shape[0], 0.02), realizations)
    swept = {"scene_roughness_std_m": (np.array(roughness), {"long_name": "roughness"})}
    coords = {
        "height_threshold": heights, "amplitude_threshold": ratios, "object": np.arange(2)
    }  # fmt: skip
    data |= {str(name): values.values for name, values in plain.data_vars.items()}
    return variables.sweep_dataset(data, swept, coords)


def all_sweeps(study: config.Study) -> pipeline.Products:
    """Make the sweeps that the configuration describes, with made up heights."""
    made = {}
    for name, sweep in study.sweeps.items():
        over = {key: list(values) for key, values in sweep.over.items()}
        shape = tuple(len(values) for values in over.values())
        # From 1 cm to half a metre along the last key, another size along the others.
        steps = np.geomspace(0.01, 0.5, shape[-1])
        others = 1 + 0.3 * np.arange(int(np.prod(shape[:-1]))).reshape(shape[:-1])
        if name == "roughness":
            made[f"sweeps/{name}"] = make_found(over["scene.roughness_std_m"])
            continue
        made[f"sweeps/{name}"] = make_sweep(over, others[..., None] * steps)
    return made


class OnlySections:
    """A study that hands out the declared sections and refuses all others."""

    def __init__(self, study: config.Study, sections: tuple[str, ...]) -> None:
        self._study, self._sections = study, sections

    def __getattr__(self, name: str) -> Any:
        assert name in self._sections, f"section '{name}' is read but not declared"
        return getattr(self._study, name)


def draw(name: str, products: pipeline.Products, study: config.Study) -> Figure:
    figure = figures.FIGURES[name]
    read = [*figure.inputs, *(f"sweeps/{key}" for key in figure.sweeps)]
    allowed = {key: products[key] for key in read}
    return figure.draw(allowed, OnlySections(study, figure.sections))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def sheet(products: pipeline.Products, study: config.Study) -> Figure:
    return draw("fig3", products, study)


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def drawn_texts(figure: Figure, monkeypatch: pytest.MonkeyPatch) -> dict[Text, Any]:
    """Return every text that reaches the paper, with its box in pixels."""
    texts: list[Text] = []
    original = Text.draw

    def recording(self: Text, renderer: Any) -> None:
        if self.get_visible() and self.get_text().strip() and self not in texts:
            texts.append(self)
        original(self, renderer)

    with monkeypatch.context() as patch, style.applied(style.options_of(figure)):
        patch.setattr(Text, "draw", recording)
        figure.draw_without_rendering()
        return {text: text.get_window_extent() for text in texts}


def written(figure: Figure, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    return [text.get_text() for text in drawn_texts(figure, monkeypatch)]


def check_readable(figure: Figure, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is cut at the edge of the paper, and no text lies on another or on other axes."""
    boxes = drawn_texts(figure, monkeypatch)
    assert boxes
    width, height = figure.bbox.width, figure.bbox.height
    for text, box in boxes.items():
        inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height
        assert inside, f"{text} is cut: {box}"
    # The box of a slanting text is larger than the text.
    straight = [(text, box) for text, box in boxes.items() if text.get_rotation() % 90 == 0]
    for index, (text, box) in enumerate(straight):
        for other, other_box in straight[index + 1 :]:
            x = min(box.x1, other_box.x1) - max(box.x0, other_box.x0)
            y = min(box.y1, other_box.y1) - max(box.y0, other_box.y0)
            assert x < 1 or y < 1, f"{text} lies on {other}"
    with style.applied(style.options_of(figure)):
        renderer = figure._get_renderer()  # type: ignore[attr-defined]
        areas = [axes.get_tightbbox(renderer) for axes in figure.axes]
    for index, area in enumerate(areas):
        for other_area in areas[index + 1 :]:
            x = min(area.x1, other_area.x1) - max(area.x0, other_area.x0)
            y = min(area.y1, other_area.y1) - max(area.y0, other_area.y0)
            assert x < 1 or y < 1, f"axes overlap: {area} and {other_area}"


def test_registry_is_complete_and_declares_known_inputs(study: config.Study) -> None:
    assert list(figures.FIGURES) == NAMES
    for figure in figures.FIGURES.values():
        assert set(figure.inputs) <= set(pipeline.STAGES)
        assert set(figure.sweeps) <= set(study.sweeps)
        assert set(figure.sections) <= set(config.Study.model_fields)
        assert "figures" in figure.sections


@pytest.mark.parametrize("name", NAMES)
def test_figure_is_readable_and_takes_what_it_declares(
    name: str,
    products: pipeline.Products,
    study: config.Study,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    figure = draw(name, products, study)
    width, height = figure.get_size_inches() * style.MM_PER_INCH
    assert width == pytest.approx(SLIDES.get(name, 88 if name in NARROW else 180))
    assert height < 247  # fits on a page of A4 with its caption
    check_readable(figure, monkeypatch)


def sizes(figure: Figure, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    return sorted({round(text.get_fontsize(), 3) for text in drawn_texts(figure, monkeypatch)})


@pytest.mark.parametrize(
    "look",
    [
        {"font_size_pt": 8.0},
        {"one_column_mm": 83.0, "two_columns_mm": 170.0, "font_size_pt": 7.0, "font": "serif"},
    ],
    ids=["large", "narrow"],
)
@pytest.mark.parametrize("name", NAMES)
def test_figure_has_the_width_and_the_text_asked_for_and_stays_readable(
    name: str,
    look: dict[str, Any],
    products: pipeline.Products,
    study: config.Study,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = study.model_copy(update={"figures": study.figures.model_copy(update=look)})
    validation.check(make_study(figures=look).model_dump(mode="json"))
    usual, figure = draw(name, products, study), draw(name, products, asked)
    width = asked.figures.one_column_mm if name in NARROW else asked.figures.two_columns_mm
    shape = usual.get_figheight() / usual.get_figwidth()
    scale = asked.figures.font_size_pt / study.figures.font_size_pt
    if name in SLIDES:
        width, scale = SLIDES[name], 1.0
    assert figure.get_size_inches() * 25.4 == pytest.approx([width, shape * width])
    check_readable(figure, monkeypatch)
    expected = [round(size * scale, 3) for size in sizes(usual, monkeypatch)]
    assert sizes(figure, monkeypatch) == pytest.approx(expected, abs=0.002)
    fonts = {text.get_fontname() for text in drawn_texts(figure, monkeypatch)}
    assert fonts == {"STIXGeneral" if asked.figures.font == "serif" else "DejaVu Sans"}


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
def test_geometry_is_readable_for_other_radars(
    radar: dict[str, float], far: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = make_study(radar=radar, scene={"y_max_m": far}, imaging={"y_max_m": far})
    figure = draw("fig1", {}, study)
    check_readable(figure, monkeypatch)


def test_geometry_is_to_scale_with_the_study_s_values(monkeypatch: pytest.MonkeyPatch) -> None:
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
    texts = written(figure, monkeypatch)
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
    system: str, names: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study = make_study(radar={"system": system, "transmitter_x_m": 0.6, "transmitter_y_m": 0.1})
    figure = draw("fig1", {}, study)
    assert names <= set(written(figure, monkeypatch))
    transmitter = (0.6, 0.1, 2.1)
    lower = np.array(transmitter if system == "transmit_pair" else (0.0, 0.0, 2.0))
    listed = dict(acquisition.values(study))
    r1 = float(geometry.slant_range(lower, 0.0, 13.0, 0.3))
    assert f"$r_1$ = {r1:.3f} m" in written(figure, monkeypatch)
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


def test_systems_show_what_each_arrangement_achieves(
    products: pipeline.Products, study: config.Study
) -> None:
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


def test_the_curve_of_an_array_is_an_ellipse(
    products: pipeline.Products, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = make_study(radar={"system": "transmit_pair"})
    texts = written(draw("fig2", products, study), monkeypatch)
    assert "ellipse" in texts
    assert not any("circle" in text for text in texts)


def test_geometry_shows_the_image_where_it_is_not_the_scene(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = make_study(imaging={"x_min_m": -1.0})
    assert "scene, image outlined" in written(draw("fig1", {}, study), monkeypatch)
    assert "scene and image" in written(draw("fig1", {}, make_study()), monkeypatch)


def test_registration_curves_are_the_product_s_in_millimetres(
    products: pipeline.Products, study: config.Study
) -> None:
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


def test_truth_and_reconstruction_share_colours_and_limits(
    sheet: Figure, products: pipeline.Products, study: config.Study
) -> None:
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


def test_maps_have_true_proportions_and_rise_ahead(sheet: Figure) -> None:
    for axes in sheet.axes:
        if axes.images:
            assert axes.get_aspect() == 1
            assert axes.images[0].origin == "lower"
            assert axes.get_xlim() == pytest.approx((-0.825, 0.825))
            assert axes.get_ylim() == pytest.approx((9.975, 12.025))


@pytest.mark.parametrize("letter", ["e", "f", "g"])
def test_phase_is_marked_at_multiples_of_pi(
    letter: str, products: pipeline.Products, study: config.Study
) -> None:
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


@pytest.mark.parametrize(
    ("limits", "most", "halves"),
    [
        ((-np.pi, np.pi), 7, [-2, 0, 2]),
        ((-1.5 * np.pi, 1.5 * np.pi), 7, [-2, 0, 2]),
        ((-0.5 * np.pi, 0.5 * np.pi), 7, [-1, 0, 1]),
        ((0, 20 * np.pi), 7, [0, 8, 16, 24, 32, 40]),
    ],
)
def test_pi_ticks_are_round_and_few(
    limits: tuple[float, float], most: int, halves: list[int]
) -> None:
    assert maps.pi_ticks(limits, most) == halves


def test_pi_labels() -> None:
    labels = [maps.pi_label(n) for n in (-4, -3, -2, -1, 0, 1, 2, 3, 8)]
    assert labels == ["−2π", "−3π/2", "−π", "−π/2", "0", "π/2", "π", "3π/2", "4π"]


def test_statistics_are_the_product_s(
    products: pipeline.Products, study: config.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = draw("fig4", products, study)
    texts = written(figure, monkeypatch)
    rows = height_error.table_rows(products["accuracy"])
    assert [row[0] for row in rows[2:]] == ["whole scene", "visible ground", "shadow"]
    for row in rows:
        for cell in row:
            assert cell == "" or cell in texts
    keys = ["median", "std", "percentile_95_absolute", "maximum_absolute"]
    shares = ["fraction_within_tolerance", "fraction_reconstructed"]
    for row, region in zip(rows[2:], products["accuracy"]["region"].values, strict=True):
        part = products["accuracy"].sel(region=region)
        assert int(row[1]) == int(part["cell_count"])
        numbers = [float(cell.replace("−", "-")) for cell in row[2:]]
        for number, key in zip(numbers[:4], keys, strict=True):
            assert number == pytest.approx(100 * float(part[key]), abs=0.0051), key
        for number, key in zip(numbers[4:], shares, strict=True):
            assert number == pytest.approx(100 * float(part[key]), abs=0.051), key
    assert "≤ 5 cm" in rows[0]


def test_front_sheet_says_what_the_product_holds_and_large(
    products: pipeline.Products, study: config.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = draw("summary", products, study)
    texts = written(figure, monkeypatch)
    accuracy = products["accuracy"]
    whole = accuracy.sel(region="whole_scene")
    visible = accuracy.sel(region="visible_ground")
    numbers = [texts[texts.index(number)] for number, _ in summary.statistics(accuracy)]
    assert [float(number.split()[0]) for number in numbers] == pytest.approx(
        [
            round(100 * float(whole["fraction_within_tolerance"]), 1),
            round(100 * float(whole["std"]), 1),
            round(100 * float(visible["std"]), 1),
            round(100 * float(whole["maximum_absolute"])),
        ]
    )
    images = [axes.images[0] for axes in figure.axes if axes.images]
    np.testing.assert_allclose(images[4].get_array(), 100 * accuracy["height_error"])
    # A thirtieth of the slide's height is what a room's last row reads.
    assert min(sizes(figure, monkeypatch)) >= 0.99 * figure.get_figheight() * 72 / 35


def test_stages_have_small_pictures_or_say_what_they_make(
    products: pipeline.Products, study: config.Study
) -> None:
    for name in set(thumbnails.THUMBNAILS) & set(products):
        made = thumbnails.png(name, products[name], study.figures)
        if name in {"focus", "detection_accuracy"}:
            assert made is None
        else:
            assert made is not None
            width, height = struct.unpack(">II", made[16:24])
            assert width > 250
            assert height > 200
            assert made == thumbnails.png(name, products[name], study.figures)
    assert thumbnails.png("another_stage", products["dem"], study.figures) is None
    assert thumbnails.shows("another_stage") == "another stage"


def test_captions_give_the_products_numbers(
    products: pipeline.Products, study: config.Study
) -> None:
    said = {
        name: figure.numbers(products, study)
        for name, figure in figures.FIGURES.items()
        if figure.numbers is not None
    }
    for name, text in said.items():
        assert text.endswith("."), name
        assert "nan" not in text, name
    whole = products["accuracy"].sel(region="whole_scene")
    assert f"{100 * float(whole['fraction_within_tolerance']):.1f} % of" in said["fig4"]
    assert f"{100 * float(whole['maximum_absolute']):.1f} cm" in said["fig4"]
    near = products["registration"]["measured"].sel(ground_axis="y", target="near")
    assert f"{1000 * float(abs(near).max()):.1f} mm in y" in said["fig2"]
    r1 = float(geometry.slant_range((0.0, 0.0, 2.0), 0.0, 11.0, 0.2))
    assert f"r1 = {r1:.3f} m" in said["fig1"]
    shadow = 100 * float(products["truth"]["shadow"].mean())
    assert f"{shadow:.1f} % of the cells are in shadow" in said["fig3"]
    best, _, _ = baselines.best_lengths(products["sweeps/baseline_length"])
    assert f"is that of {best:g} m" in said["baseline_length"]
    worst = products["sweeps/vibration"]["std"].sel(
        region="whole_scene",
        motion_channels="independent",
        motion_axis="z",
        motion_level_wavelengths=4.0,
    )
    assert f"{100 * float(worst.mean()):.1f} cm along z." in said["fig5"]


def test_histogram_counts_every_cell_once(products: pipeline.Products, study: config.Study) -> None:
    figure = draw("fig4", products, study)
    histogram = next(axes for axes in figure.axes if axes.get_yscale() == "log")
    counts = {
        patch.get_label(): patch.get_data().values.sum()
        for patch in histogram.patches
        if patch.get_label()
    }
    cells = dict(
        zip(
            ("whole scene", "visible ground", "shadow"),
            products["accuracy"]["cell_count"].values,
            strict=True,
        )
    )
    assert counts == cells
    marks = sorted(line.get_xdata()[0] for line in histogram.lines)
    assert marks == [-5, 5]


def test_bins_end_at_the_tolerance_and_stay_few() -> None:
    edges = height_error.bin_edges(np.array([0.01, -0.17, np.nan]), 0.05)
    assert edges[0] == pytest.approx(-0.20)
    assert edges[-1] == pytest.approx(0.20)
    assert np.isclose(edges, 0.05).any()
    assert len(height_error.bin_edges(np.array([50.0]), 0.05)) == 401
    assert height_error.bin_edges(np.array([np.nan]), 0.05)[-1] == pytest.approx(0.10)


def test_failed_cells_are_grey_counted_and_no_exception(
    products: pipeline.Products, study: config.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    assert "1 cells beyond\n± 100 cm" in written(errors, monkeypatch)


def test_flat_ground_still_has_a_height_scale(products: pipeline.Products) -> None:
    flat = products["truth"].copy(deep=True)
    flat["height"][:] = 0.0
    assert chain.height_limits(flat) == pytest.approx((-0.05, 0.05))
    flat["height"][3, 3] = 0.31
    assert chain.height_limits(flat) == pytest.approx((0.0, 0.35))


def test_shadow_s_outline_follows_patches_and_drops_single_cells() -> None:
    import xarray as xr

    axis = np.arange(40) * 0.05
    mask = np.zeros((40, 40), dtype=bool)
    mask[5, 5] = True
    single = xr.DataArray(mask.copy(), {"y": axis, "x": axis}, ("y", "x"))
    axes = style.place(style.new_figure(50, 50), 5, 5, 40, 40)
    assert not maps.outline_shadow(axes, single)
    assert not axes.collections
    mask[20:30, 10:30] = True
    patch = single.copy(data=mask)
    assert maps.outline_shadow(axes, patch)
    (path,) = axes.collections[0].get_paths()
    x, y = path.vertices.T
    assert (x.min(), x.max()) == pytest.approx((axis[10] - 0.025, axis[29] + 0.025), abs=0.005)
    assert (y.min(), y.max()) == pytest.approx((axis[20] - 0.025, axis[29] + 0.025), abs=0.005)


@pytest.mark.parametrize("key", ["height_colormap", "phase_colormap"])
def test_unknown_colormap_is_refused_with_its_key_and_a_hint(
    key: str, products: pipeline.Products, study: config.Study
) -> None:
    options = study.figures.model_copy(update={key: "cmc.batlov"})
    wrong = study.model_copy(update={"figures": options})
    with pytest.raises(ValueError, match=rf"figures\.{key}.*cmc\.batlov.*cmc\.batlow"):
        draw("fig3", products, wrong)


def test_colormaps_are_found_by_either_collection() -> None:
    assert figures.colormap("cmc.romaO").name == "romaO"
    assert figures.colormap("viridis").name == "viridis"
    with pytest.raises(ValueError, match="no colour map 'batlow nonsense'"):
        figures.colormap("batlow nonsense")


def lines_of(axes: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in axes.lines}


def band_of(axes: Any, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper edge of one of the bands."""
    band = axes.collections[number].get_paths()[0].vertices
    count = (len(band) - 3) // 2
    return band[1 : 1 + count, 1], band[2 + count : 2 + 2 * count, 1][::-1]


def test_fig5_shows_mean_and_band_by_axis_and_mode(
    products: pipeline.Products, study: config.Study
) -> None:
    figure = draw("fig5", products, study)
    std = 100 * products["sweeps/vibration"]["std"].sel(region="whole_scene")
    for axes, mode in zip(figure.axes, ("common", "independent"), strict=False):
        lines = lines_of(axes)
        for number, (label, axis) in enumerate(
            [("error along x (the rail)", "x"), ("along y (ahead)", "y"), ("along z (up)", "z")]
        ):
            part = std.sel(motion_channels=mode, motion_axis=axis)
            np.testing.assert_allclose(lines[label].get_ydata(), part.mean("realization"))
            np.testing.assert_array_equal(
                lines[label].get_xdata(), part["motion_level_wavelengths"]
            )
            low, high = band_of(axes, number)
            np.testing.assert_allclose(low, np.percentile(part, 10, axis=-1))
            np.testing.assert_allclose(high, np.percentile(part, 90, axis=-1))
    first, second, focus = figure.axes
    assert first.get_ylim() == second.get_ylim()
    assert first.get_xscale() == "symlog"
    assert first.get_xlim()[0] < 0
    assert 0 in first.get_xticks()
    gain = products["sweeps/vibration"]["point_gain"].sel(motion_channels="common")
    np.testing.assert_allclose(
        lines_of(focus)["along y (ahead)"].get_ydata(),
        gain.sel(motion_axis="y").mean(("realization", "channel")),
    )


def test_fig5_has_the_error_free_the_level_and_the_random_height_as_references(
    products: pipeline.Products, study: config.Study
) -> None:
    axes = draw("fig5", products, study).axes[0]
    levels = {line.get_ydata()[0] for line in axes.lines if len(set(line.get_ydata())) == 1}
    std = products["sweeps/vibration"]["std"].sel(region="whole_scene", motion_channels="common")
    r2 = np.hypot(11.0, 2.3)
    wavelength = 299_792_458.0 / 14e9
    # Vertical: the height of ambiguity is lambda r2 / 2B.
    expected = {
        100 * float(std.sel(motion_level_wavelengths=0).mean()),
        100 * float(products["truth"]["height"].std()),
        100 * wavelength * r2 / (2 * 0.3) / np.sqrt(12),
    }
    assert sorted(levels) == pytest.approx(sorted(expected))


def test_curves_differ_without_their_colours(
    products: pipeline.Products, study: config.Study
) -> None:
    for name in ("fig5", "baseline_length", "snr"):
        axes = draw(name, products, study).axes[0]
        marked = [line for line in axes.lines if line.get_marker() not in {"None", "*"}]
        assert len(marked) == 3
        assert len({line.get_marker() for line in marked}) == 3
        assert len({line.get_linestyle() + str(line._dash_pattern) for line in marked}) == 3  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "over",
    [
        {"motion.channels": ["common"], "motion.axis": ["y"], "motion.level_wavelengths": [0.1]},
        {
            "motion.channels": ["independent", "common"],
            "motion.axis": ["z", "x"],
            "motion.level_wavelengths": [2.0, 0.0],
            "motion.spectrum": ["white", "sinusoidal"],
        },
    ],
)
def test_fig5_takes_what_the_sweep_has(
    over: dict[str, list[Any]],
    products: pipeline.Products,
    study: config.Study,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shape = tuple(len(values) for values in over.values())
    made = {"sweeps/vibration": make_sweep(over, np.full(shape, 0.03), realizations=1)}
    figure = draw("fig5", products | made, study)
    check_readable(figure, monkeypatch)
    marked = [line for line in figure.axes[0].lines if line.get_marker() != "None"]
    assert len(marked) == len(over["motion.axis"])
    for line in marked:
        assert list(line.get_xdata()) == sorted(over["motion.level_wavelengths"])


def test_sweep_without_a_key_that_a_figure_needs_is_refused(
    products: pipeline.Products, study: config.Study
) -> None:
    made = {"sweeps/vibration": make_sweep({"motion.axis": ["x", "y"]}, np.ones(2))}
    with pytest.raises(ValueError, match=r"goes over motion_axis; motion_channels, motion_level"):
        draw("fig5", products | made, study)


def test_failed_cases_leave_gaps_and_no_exception(
    products: pipeline.Products, study: config.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in OF_SWEEPS:
        key = f"sweeps/{figures.FIGURES[name].sweeps[0]}"
        broken = products[key].copy(deep=True)
        broken["std"][..., 0, :] = np.nan
        last = next(dim for dim in reversed(broken["std"].dims[:-2]) if dim != "realization")
        broken["std"].loc[{last: broken[last][-1]}] = np.nan
        check_readable(draw(name, products | {key: broken}, study), monkeypatch)


def test_baseline_length_shows_the_sweep_the_bound_and_the_optimum(
    products: pipeline.Products, study: config.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    length = [0.1, 0.2, 0.3, 0.5, 1.0]
    std = np.array([0.09, 0.05, 0.02, 0.0205, 0.06])
    sweep = make_sweep({"radar.baseline_m": length}, std, realizations=3)
    sweep["std"].values[:] = std[:, None, None] * np.array([1, 0.5, 2])
    figure = draw("baseline_length", products | {"sweeps/baseline_length": sweep}, study)
    spreads, ambiguity, coherence = figure.axes
    lines = lines_of(spreads)
    np.testing.assert_allclose(lines["std, whole scene"].get_ydata(), 100 * std)
    np.testing.assert_allclose(lines["std, visible ground"].get_ydata(), 50 * std)
    robust = 148.26 * sweep["mad"].sel(region="visible_ground").mean("realization")
    np.testing.assert_allclose(lines["1.48 MAD, visible ground"].get_ydata(), robust)
    # Written out: the coherence of level ground, the looks of the window, the phase, the height.
    r1, wavelength, cell = np.hypot(11.0, 2.0), 299_792_458.0 / 14e9, 299_792_458.0 / 4e9
    r2 = np.hypot(11.0, 2.0 + np.array(length))
    # The channels share the wavenumbers from 13 GHz at y / r1 to 15 GHz at y / r2.
    gamma = (15 / r2 - 13 / r1) / (2 / np.sqrt(r1 * r2))
    looks = 0.25**2 / (wavelength * r1 / 1.6 * cell * r1 / 11)
    phase = np.sqrt((1 - gamma**2) / (2 * looks * gamma**2))
    height = wavelength * r2 / (2 * np.array(length))
    bound = height / (2 * np.pi) * phase
    critical = np.sqrt((15 / 13 * r1) ** 2 - 11**2) - 2
    assert sweeps.looks(study, "baseline_length") == pytest.approx(looks)
    np.testing.assert_allclose(
        lines[f"bound, level ground, {looks:.1f} looks"].get_ydata(), 100 * bound
    )
    np.testing.assert_allclose(ambiguity.lines[0].get_ydata(), height)
    np.testing.assert_allclose(coherence.lines[1].get_ydata(), gamma)
    for axes in figure.axes:
        marks = [line.get_xdata()[0] for line in axes.lines if len(set(line.get_xdata())) == 1]
        assert any(mark == pytest.approx(critical / 4) for mark in marks)
    texts = written(figure, monkeypatch)
    assert "least: 2.00 cm at 0.3 m" in texts
    assert "within 10 % of it: 0.3 … 0.5 m" in texts
    assert baselines.best_lengths(sweep) == (0.3, 0.3, 0.5)


def test_baseline_angle_shows_draws_and_formulas(
    products: pipeline.Products, study: config.Study
) -> None:
    figure = draw("baseline_angle", products, study)
    product = products["baseline_angle"]
    first, second = (lines_of(axes) for axes in figure.axes)
    shown = {
        "length_drawn": first["drawn, exact inversion"],
        "length_eq5": first["Eq. 5"],
        "length_exact": first["exact derivative"],
        "angle_drawn": second["drawn, exact inversion"],
        "angle_eq12": second["Eq. 12"],
    }
    for name, line in shown.items():
        np.testing.assert_allclose(line.get_ydata(), 1000 * product[name], err_msg=name)
        np.testing.assert_allclose(line.get_xdata(), baseline.ANGLES_DEG)


def test_heat_maps_hold_the_sweep_on_one_scale(
    products: pipeline.Products, study: config.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = draw("baseline_vibration", products, study)
    std = 100 * products["sweeps/baseline_vibration"]["std"].sel(region="whole_scene")
    meshes = [axes.collections[0] for axes in figure.axes[:2]]
    for mesh, mode in zip(meshes, ("common", "independent"), strict=True):
        part = std.sel(motion_channels=mode).mean("realization")
        np.testing.assert_allclose(mesh.get_array(), part)
    assert meshes[0].get_clim() == meshes[1].get_clim()
    assert meshes[0].get_clim()[0] == pytest.approx(float(std.mean("realization").min()))
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == ["0.1", "0.2", "0.3", "0.5", "0.7", "1"]
    texts = written(figure, monkeypatch)
    for level in (3, 5, 10, 20):
        assert f"{level} cm" in texts


def test_snr_shows_the_sweep_and_the_bound(
    products: pipeline.Products, study: config.Study
) -> None:
    lines = lines_of(draw("snr", products, study).axes[0])
    sweep = products["sweeps/snr"]
    ratio = sweep["echo_snr_db"].values
    std = sweep["std"].mean("realization")
    np.testing.assert_allclose(
        lines["std, whole scene"].get_ydata(), 100 * std.sel(region="whole_scene")
    )
    np.testing.assert_array_equal(lines["std, whole scene"].get_xdata(), ratio)
    planned, place = Instrument.planned(study.radar), (0.0, 11.0)
    gamma = planned.geometric_coherence(*place) / (1 + 10 ** (-ratio / 10))
    looks = sweeps.looks(study, "snr")
    phase = np.sqrt((1 - gamma**2) / (2 * looks * gamma**2))
    expected = 100 * planned.height_of_ambiguity(*place) / (2 * np.pi) * phase
    np.testing.assert_allclose(
        lines[f"bound, level ground, {looks:.1f} looks"].get_ydata(), expected
    )


def test_moving_shows_the_sweeps_and_the_sensor_that_suffices(
    products: pipeline.Products, study: config.Study
) -> None:
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


def test_a_wrong_speed_shows_the_heights_of_other_places(products: pipeline.Products) -> None:
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


def test_roc_shows_the_counts_of_the_sweep(
    products: pipeline.Products, study: config.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = draw("roc", products, study)
    curves, by_height, holes = figure.axes
    lines = lines_of(curves)
    # The box is found up to a threshold of 5 cm; on 4 m2, n false alarms are 25 n on 100 m2.
    heights = detection_accuracy.HEIGHT_THRESHOLDS
    line = lines["heights, 1 cm"]
    np.testing.assert_array_equal(line.get_ydata(), heights < 0.055)
    np.testing.assert_allclose(line.get_xdata(), 25 * np.round(2 * np.exp(-heights / 0.02)))
    ratios = detection_accuracy.AMPLITUDE_THRESHOLDS
    line = lines["image alone, 1 cm"]
    np.testing.assert_array_equal(line.get_ydata(), ratios < 2)
    np.testing.assert_allclose(line.get_xdata(), 25 * np.round(8 * np.exp(-ratios / 2)))
    # One height at a distance is no curve.
    assert len(by_height.lines) == 1
    shares = [bar.get_width() for bar in holes.patches]
    assert shares == pytest.approx([0, 60, 40])
    assert "pit, 0.3 m long, 10 cm deep, at 11.4 m" in written(figure, monkeypatch)


def test_obstacles_are_outlined_where_they_are(
    products: pipeline.Products, study: config.Study
) -> None:
    for axes in draw("obstacles", products, study).axes:
        if axes.images and axes.get_xlabel() == "x (m)":
            box, pit = axes.patches[:2]
            x, y = 0.15 * np.array([-1, 1]), 0.1 * np.array([-1, 1])
            turn = np.deg2rad(20)
            corner = [
                (
                    0.4 + a * np.cos(turn) - b * np.sin(turn),
                    11.4 + a * np.sin(turn) + b * np.cos(turn),
                )
                for a in x
                for b in y
            ]
            found = box.get_patch_transform().transform([(0, 0), (0, 1), (1, 0), (1, 1)])
            np.testing.assert_allclose(found, corner, atol=1e-9)
            assert pit.center == (-0.3, 11.4)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", [*OF_SWEEPS, "baseline_angle"])
def test_figures_of_sweeps_give_the_same_bytes(
    name: str, products: pipeline.Products, study: config.Study, tmp_path: Path
) -> None:
    made = []
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        made.append(save_all(draw(name, products, study), folder))
    assert made[0] == made[1]


DRAW_FIG1 = """
import hashlib, sys
from pathlib import Path
import yaml
import vinsar.figures
assert "matplotlib" not in sys.modules, "importing the figures is not light"
from vinsar.study import config
study = config.Study.model_validate(yaml.safe_load(Path(sys.argv[1]).read_text(encoding="utf-8")))
paths = [Path(sys.argv[2]) / f"fig1.{suffix}" for suffix in ("pdf", "svg", "png")]
figure = vinsar.figures.FIGURES["fig1"].draw({}, study)
vinsar.figures.save(figure, paths, png_dpi=100)
print(*(hashlib.sha256(path.read_bytes()).hexdigest() for path in paths))
"""


def test_two_processes_give_the_same_bytes_whatever_the_user_s_settings(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", DRAW_FIG1, str(PAPER), str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
    )
    paths = [tmp_path / f"here.{suffix}" for suffix in FORMATS]
    with matplotlib.rc_context({"lines.linewidth": 7, "font.size": 20, "pdf.fonttype": 3}):
        before = dict(matplotlib.rcParams)
        figures.save(draw("fig1", {}, make_study()), paths, png_dpi=100)
        assert dict(matplotlib.rcParams) == before
    assert result.stdout.split() == [digest(path) for path in paths]


def save_all(figure: Figure, folder: Path) -> dict[str, bytes]:
    paths = [folder / f"figure.{suffix}" for suffix in FORMATS]
    figures.save(figure, paths, png_dpi=60)
    assert sorted(folder.iterdir()) == sorted(paths)
    return {path.suffix[1:]: path.read_bytes() for path in paths}


@pytest.fixture(scope="module")
def saved(sheet: Figure, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return save_all(sheet, tmp_path_factory.mktemp("saved"))


def test_same_figure_gives_same_bytes(
    saved: dict[str, bytes],
    sheet: Figure,
    products: pipeline.Products,
    study: config.Study,
    tmp_path: Path,
) -> None:
    # Saved before, saved once more, and drawn anew from the same products.
    assert save_all(sheet, tmp_path) == saved
    assert save_all(draw("fig3", products, study), tmp_path) == saved


def pdf_content(data: bytes) -> bytes:
    """Return a PDF with its streams inflated."""
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL)
    inflated = []
    for stream in streams:
        try:
            inflated.append(zlib.decompress(stream))
        except zlib.error:
            inflated.append(stream)
    return data + b"\n".join(inflated)


def png_chunks(data: bytes) -> list[tuple[str, bytes]]:
    chunks, at = [], 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        chunks.append((data[at + 4 : at + 8].decode("ascii"), data[at + 8 : at + 8 + length]))
        at += 12 + length
    return chunks


def test_pdf_embeds_its_fonts_as_truetype(saved: dict[str, bytes]) -> None:
    content = pdf_content(saved["pdf"])
    assert re.search(rb"/BaseFont /[A-Z]{6}\+DejaVuSans", content)
    assert b"/CIDFontType2" in content
    assert b"/FontFile2" in content
    assert b"/Type3" not in content


def test_svg_keeps_text_as_text(saved: dict[str, bytes]) -> None:
    svg = saved["svg"].decode("utf-8")
    texts = re.findall(r"<text[^>]*>([^<]+)</text>", svg)
    assert "(h) reconstructed height" in texts
    assert "−π" in texts
    assert "DejaVu Sans" in svg


def test_png_has_the_resolution_asked_for(saved: dict[str, bytes]) -> None:
    chunks = dict(png_chunks(saved["png"]))
    width, _ = struct.unpack(">II", chunks["IHDR"][:8])
    assert width == pytest.approx(180 / 25.4 * 60, abs=1)
    per_metre, _, unit = struct.unpack(">IIB", chunks["pHYs"])
    assert unit == 1
    assert per_metre * 0.0254 == pytest.approx(60, abs=0.1)


def test_no_file_holds_a_date_or_a_version(saved: dict[str, bytes]) -> None:
    assert {name for name, _ in png_chunks(saved["png"])} <= {"IHDR", "pHYs", "IDAT", "IEND"}
    pdf = pdf_content(saved["pdf"])
    assert b"/CreationDate" not in pdf
    assert b"/ModDate" not in pdf
    for data in (pdf, saved["svg"]):
        assert not re.search(rb"D:20\d\d|20\d\d-[01]\d-[0-3]\d", data)
        assert b"dc:date" not in data
        assert matplotlib.__version__.encode() not in data


def test_vector_files_stay_small(saved: dict[str, bytes]) -> None:
    # The surface and the maps are pixels in them: thousands of facets would be megabytes.
    assert len(saved["pdf"]) < 200_000
    assert len(saved["svg"]) < 300_000


def test_metadata_comes_back_from_every_format(tmp_path: Path) -> None:
    metadata = {"study": "paper", "inputs": "a & b <ü>", "code": "0123"}
    paths = [tmp_path / f"fig1.{suffix}" for suffix in FORMATS]
    figures.save(style.new_figure(50, 50), paths, png_dpi=50, metadata=metadata)
    pdf, svg, png = (path.read_bytes() for path in paths)
    keywords = re.search(rb"/Keywords \((.*?[^\\])\)", pdf, re.DOTALL)
    assert keywords
    assert json.loads(keywords[1].replace(rb"\\", b"\\")) == metadata
    description = re.search(r"<dc:description>(.*?)</dc:description>", svg.decode("utf-8"))
    assert description
    plain = description[1]
    for entity, character in (("&quot;", '"'), ("&lt;", "<"), ("&gt;", ">"), ("&amp;", "&")):
        plain = plain.replace(entity, character)
    assert json.loads(plain) == metadata
    texts = [data.split(b"\0", 1) for name, data in png_chunks(png) if name == "tEXt"]
    assert {key.decode(): value.decode("latin-1") for key, value in texts} == metadata


def test_other_suffixes_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    figure = style.new_figure(50, 50)
    with pytest.raises(ValueError, match=r"'\.jpg'.*\.pdf, \.svg, \.png"):
        figures.save(figure, [tmp_path / "a.png", tmp_path / "a.jpg"], png_dpi=50)
    assert not list(tmp_path.iterdir())


def test_failed_write_leaves_the_old_file_and_no_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "fig.png"
    path.write_bytes(b"old")

    def fail(self: Figure, target: Path, **_: Any) -> None:
        del self
        Path(target).write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        files.save(style.new_figure(50, 50), [path], png_dpi=50)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["fig.png"]


def test_figures_that_cannot_be_drawn_are_refused_before_anything_runs():
    asked = ["fig1", "fig9", "fig5", "fig1"]
    study = make_study(outputs={"figures": asked, "claims": False})
    study = study.model_copy(update={"sweeps": {}})
    with pytest.raises(validation.ConfigurationError) as caught:
        figures.check(study, pipeline.STAGES)
    keys = [fault.key for fault in caught.value.faults]
    assert keys == [f"outputs.figures[{number}]" for number in (1, 2, 3)]
    assert "'vibration'" in caught.value.faults[1].allowed


def test_measured_echoes_have_the_figures_that_need_no_truth():
    study = make_study(
        measurement={"file": "echo.nc"},
        outputs={"figures": ["measured", "fig1", "fig4", "snr"], "claims": False},
    )
    known = {*pipeline.stages(study), *pipeline.from_files(study)}
    with pytest.raises(validation.ConfigurationError) as caught:
        figures.check(study, known)
    assert [fault.value for fault in caught.value.faults] == ["fig1", "fig4", "snr"]
    assert all("there are measured, fig2" in fault.allowed for fault in caught.value.faults)


def test_the_measured_figure_colours_heights_by_the_reconstruction(
    products: pipeline.Products, study: config.Study
) -> None:
    rebuilt = {name: products[name].copy(deep=True) for name in chain.MEASURED_INPUTS}
    height = rebuilt["dem"]["height"].values
    height[...] = np.linspace(-0.12, 0.31, height.size).reshape(height.shape)
    # One failed cell in more than a thousand does not stretch the colours; NaN has none.
    height[3, 3], height[5, 5] = 7.0, np.nan
    shown = draw("measured", rebuilt, study).axes[-2].images[0]
    assert shown.get_clim() == pytest.approx((-0.15, 0.35))
