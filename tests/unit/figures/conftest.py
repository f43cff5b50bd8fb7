"""What the tests of figures share: a small study with its products, and looks at what is drawn."""

from __future__ import annotations

import json
import re
import struct
import zlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.text import Text

from vinsar import figures
from vinsar.evaluation import detection_accuracy
from vinsar.figures.drawing import style
from vinsar.study import pipeline
from vinsar.study.composition import StudyModel
from vinsar.sweeps.sweep import SWEEP, sweep_dataset

CONFIG = Path(__file__).parents[3] / "config"
EXTENT = {"x_min_m": -0.8, "x_max_m": 0.8, "y_min_m": 10.0, "y_max_m": 12.0}
SMALL = {
    "radar": {"frequency_count": 201, "position_spacing_m": 0.02},
    "scene": EXTENT
    | {
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
    "imaging": EXTENT | {"grid_spacing_m": 0.05},
    "filtering": {"goldstein_patch_px": 16, "goldstein_step_px": 4},
    "height": {
        "level_ground": [{"x_min_m": -0.8, "x_max_m": -0.6, "y_min_m": 10.0, "y_max_m": 10.2}]
    },
    "registration": {"height_count": 3},
    "measurement": {"reflectors": [{"x_m": 0.4, "y_m": 11.4, "height_m": 0.1}]},
}


@pytest.fixture(scope="session")
def make_study():
    """Make the paper's study with other values in some sections, and with every study's sweeps."""

    paper = yaml.safe_load((CONFIG / "paper.yaml").read_text(encoding="utf-8"))
    for path in sorted(CONFIG.glob("*.yaml")):
        others = yaml.safe_load(path.read_text(encoding="utf-8")).get("sweeps", {})
        paper["sweeps"] = others | paper["sweeps"]

    def make(**sections):
        return StudyModel.model_validate(
            paper | {name: paper[name] | section for name, section in sections.items()}
        )

    return make


@pytest.fixture(scope="session")
def study(make_study):
    return make_study(**SMALL)


@pytest.fixture(scope="session")
def products(study, make_study, make_sweep):
    """Return the products of the small study, and sweeps with made-up heights."""
    made = pipeline.run(study)
    three = make_study(**SMALL | {"radar": SMALL["radar"] | {"baselines_m": [0.06, 0.3]}})
    made["two_antennas"] = pipeline.run(three, "two_antennas")["two_antennas"]
    for name, sweep in study.sweeps.items():
        over = {key: list(values) for key, values in sweep.over.items()}
        shape = tuple(len(values) for values in over.values())
        # From 1 cm to half a metre along the last key, another size along the others.
        steps = np.geomspace(0.01, 0.5, shape[-1])
        others = 1 + 0.3 * np.arange(int(np.prod(shape[:-1]))).reshape(shape[:-1])
        made[f"sweeps/{name}"] = make_sweep(over, others[..., None] * steps)
    name = f"sweeps/{detection_accuracy.SWEEP}"
    return made | {name: with_detections(made[name])}


@pytest.fixture(scope="session")
def make_sweep():
    """Make a sweep with some std by case; other realizations scatter by a tenth around it."""

    def make(over, std_m, realizations=4, seed=0):
        rng = np.random.default_rng(seed)
        shape = (*(len(values) for values in over.values()), realizations)
        std = np.broadcast_to(np.asarray(std_m, float)[..., None], shape)
        std = std * rng.uniform(0.9, 1.1, shape)
        shares = {"coherence", "point_gain", "peak_gain"}
        trailing = {
            "region": (1.0, 0.4, 2.0, 0.3),
            "channel": (1.0, 0.9),
            "ground_axis": (1.0, 0.1),
        }
        data = {}
        for name, variable in SWEEP.items():
            one = 1 / (1 + 20 * std) if name in shares else std
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
        return sweep_dataset(data, swept)

    return make


def with_detections(sweep):
    """Add detections in the scene of `SMALL`: a box that is found up to 5 cm, a pit that is not."""
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
    (key,) = (dim for dim in sweep["mad"].dims if dim not in {"realization", "region"})
    shape = (sweep.sizes[key], sweep.sizes["realization"])
    data = {name: np.broadcast_to(value, (*shape, *value.shape)) for name, value in data.items()}
    data |= {str(name): values.values for name, values in sweep.data_vars.items()}
    coords = {"height_threshold": heights, "amplitude_threshold": ratios, "object": np.arange(2)}
    swept = {key: (sweep[key].values, {"long_name": "roughness"})}
    return sweep_dataset(data, swept, coords)


class OnlySections:
    """A study that hands out the declared sections and refuses all others."""

    def __init__(self, study, sections):
        self._study, self._sections = study, sections

    def __getattr__(self, name):
        assert name in self._sections, f"section '{name}' is read but not declared"
        return getattr(self._study, name)


@pytest.fixture(scope="session")
def draw():
    """Draw a figure from what it declares, and nothing else."""

    def drawn(name, products, study):
        figure = figures.FIGURES[name]
        allowed = {key: products[key] for key in figure.reads}
        return figure.draw(allowed, OnlySections(study, figure.sections))

    return drawn


@pytest.fixture(scope="session")
def usual(draw, products, study):
    """Return a figure as the small study has it, drawn once: look at it, and leave it as it is."""
    return cache(lambda name: draw(name, products, study))


@pytest.fixture(scope="session")
def sheet(usual):
    return usual("fig3")


@pytest.fixture(scope="session")
def drawn_texts():
    """Return every text that reaches the paper, with its box in pixels.

    A figure is laid out once, which takes most of the time: nobody changes it afterwards.
    """

    def drawn(figure):
        if not hasattr(figure, "texts_on_paper"):
            figure.texts_on_paper = laid_out(figure)
        return figure.texts_on_paper

    def laid_out(figure):
        texts = []
        original = Text.draw

        def recording(self, renderer):
            if self.get_visible() and self.get_text().strip() and self not in texts:
                texts.append(self)
            original(self, renderer)

        with pytest.MonkeyPatch.context() as patch, style.applied(style.options_of(figure)):
            patch.setattr(Text, "draw", recording)
            figure.draw_without_rendering()
            return {text: text.get_window_extent() for text in texts}

    return drawn


@pytest.fixture(scope="session")
def written(drawn_texts):
    """Return what is written on a figure."""
    return lambda figure: [text.get_text() for text in drawn_texts(figure)]


@pytest.fixture(scope="session")
def sizes(drawn_texts):
    """Return the sizes of the text on a figure, each once, in points."""
    return lambda figure: sorted({round(text.get_fontsize(), 3) for text in drawn_texts(figure)})


@pytest.fixture(scope="session")
def check_readable(drawn_texts):
    """Nothing is cut at the edge of the paper, and no text lies on another or on other axes."""

    def check(figure):
        boxes = drawn_texts(figure)
        assert boxes
        width, height = figure.bbox.width, figure.bbox.height
        for text, box in boxes.items():
            inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height
            assert inside, f"{text} is cut: {box}"
        # The box of a slanting text is larger than the text.
        straight = [(text, box) for text, box in boxes.items() if text.get_rotation() % 90 == 0]
        for index, (text, box) in enumerate(straight):
            for other, other_box in straight[index + 1 :]:
                assert not _overlap(box, other_box), f"{text} lies on {other}"
        with style.applied(style.options_of(figure)):
            renderer = figure._get_renderer()
            areas = [axes.get_tightbbox(renderer) for axes in figure.axes]
        for index, area in enumerate(areas):
            for other_area in areas[index + 1 :]:
                assert not _overlap(area, other_area), f"axes overlap: {area} and {other_area}"

    return check


def _overlap(one, other):
    """Tell whether two boxes overlap by a pixel or more both ways."""
    x = min(one.x1, other.x1) - max(one.x0, other.x0)
    y = min(one.y1, other.y1) - max(one.y0, other.y0)
    return x >= 1 and y >= 1


@pytest.fixture(scope="session")
def lines_of():
    """Return the lines of axes by their label."""
    return lambda axes: {line.get_label(): line for line in axes.lines}


@pytest.fixture(scope="session")
def save_all():
    """Save a figure in all formats and return their bytes."""

    def save(figure, folder):
        paths = [folder / f"figure.{suffix}" for suffix in ("pdf", "svg", "png")]
        figures.save(figure, paths, png_dpi=60)
        assert sorted(folder.iterdir()) == sorted(paths)
        return {path.suffix[1:]: path.read_bytes() for path in paths}

    return save


@pytest.fixture(scope="session")
def pdf_content():
    """Return a PDF with its streams inflated."""

    def content(data):
        streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL)
        inflated = []
        for stream in streams:
            try:
                inflated.append(zlib.decompress(stream))
            except zlib.error:
                inflated.append(stream)
        return data + b"\n".join(inflated)

    return content


@pytest.fixture(scope="session")
def png_chunks():
    """Return the chunks of a PNG, each as name and bytes."""

    def split(data):
        chunks, at = [], 8
        while at < len(data):
            (length,) = struct.unpack(">I", data[at : at + 4])
            name = data[at + 4 : at + 8].decode("ascii")
            chunks.append((name, data[at + 8 : at + 8 + length]))
            at += 12 + length
        return chunks

    return split
