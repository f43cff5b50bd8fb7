"""A box and a bright patch, from their echo to the map of what is found."""

from pathlib import Path

import numpy as np
import pytest

import vinsar
from vinsar.processing import detection
from vinsar.radar import formulas, geometry
from vinsar.study import pipeline, validation

ROOT = Path(__file__).parents[2]
HEIGHT = 0.2
AT = (0.4, 11.2)


@pytest.fixture(scope="module")
def study():
    raw = vinsar.load().model_dump(mode="json")
    box = {"shape": "box", "x_m": AT[0], "y_m": AT[1], "size_x_m": 0.5, "size_y_m": 0.5}
    patch = {"x_m": -0.6, "y_m": 11.4, "size_x_m": 0.5, "size_y_m": 0.5, "reflectivity": 2.0}
    extent = {"x_min_m": -1.2, "x_max_m": 1.2, "y_min_m": 10.0, "y_max_m": 13.0}
    changes = {
        "radar": {"baseline_m": 0.15, "position_spacing_m": 0.02},
        "scene": extent
        | {"terrain": "flat", "objects": [box | {"height_m": HEIGHT}], "patches": [patch]},
        "echo": {"accuracy_db": -85.0, "snr_db": 25.0},
        "imaging": extent | {"grid_spacing_m": 0.05},
        "filtering": {"goldstein_patch_px": 16, "goldstein_step_px": 4},
        "height": {
            "level_ground": [{"x_min_m": -1.1, "x_max_m": -0.7, "y_min_m": 10.1, "y_max_m": 10.6}]
        },
    }
    return validation.check(validation.merge(raw, changes))


@pytest.fixture(scope="module")
def products(study):
    return pipeline.run(study, only="detection_accuracy")


def test_a_box_is_the_one_obstacle_within_a_resolution_cell_of_its_place(products):
    found = products["detections"]
    obstacles = found["detected_height"].values > 0
    assert obstacles.sum() == 1
    # 15 cm across at 11 m, 0.0214 m x 11.4 m / (2 x 0.8 m), and 7.6 cm along. Part of its ground is
    # too noisy to tell: two cells along.
    assert abs(found["detected_x"].values[obstacles][0] - AT[0]) < 0.15
    assert abs(found["detected_y"].values[obstacles][0] - AT[1]) < 0.15
    # Its wall, in the same cells as its edges, lies half as high.
    height = found["detected_height"].values[obstacles][0]
    assert HEIGHT / 2 < height < HEIGHT + 3 * float(products["dem"]["height_std"].median())


def test_what_the_box_hides_is_unknown_and_the_patch_is_free(products):
    found = products["detections"]
    kind = found["map_class"]
    # Its shadow ends where the ray over its far edge meets the ground: y H / (H - h).
    far = (AT[1] + 0.25) * 2.0 / (2.0 - HEIGHT)
    hidden = kind.sel(x=slice(0.35, 0.5), y=slice(AT[1] + 0.4, far - 0.2)).values
    assert (hidden == detection.UNKNOWN).mean() > 0.9
    patch = {"x": slice(-0.8, -0.4), "y": slice(11.2, 11.6)}
    assert (kind.sel(patch).values == detection.FREE).all()
    # Twice the amplitude of 0.5 and twice that: 12 dB.
    contrast = 10 * np.log10(found["contrast"].sel(patch).values.mean())
    assert contrast == pytest.approx(12, abs=3)
    assert found["bright"].sel(patch).values.any()


def test_the_counts_say_so(products, study):
    counts = products["detection_accuracy"]
    at = counts.sel(height_threshold=0.1, method="nearest")
    assert at["height_found"].values.tolist() == [True]
    assert at["height_false_alarms"] == 0
    bright = counts.sel(amplitude_threshold=10**0.6, method="nearest")
    assert bright["amplitude_false_alarms"] >= 1
    # The box stays below half the height of ambiguity, or unwrapping could not tell its height.
    lower = np.array([0.0, 0.0, 2.0])
    look = geometry.look_angle(lower, *AT)
    range_ = geometry.slant_range(lower, *AT)
    ambiguity = formulas.height_of_ambiguity(
        range_, 0.0214, study.radar.baseline_m, np.pi / 2, look
    )
    assert ambiguity / 2 > HEIGHT
