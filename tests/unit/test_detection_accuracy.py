"""Found objects and false alarms, counted on maps that are made."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import TypeAdapter

from vinsar.evaluation import detection_accuracy
from vinsar.foundations import variables
from vinsar.processing import detection
from vinsar.processing.detection import Detection
from vinsar.simulation.scene import SceneObject
from vinsar.sweeps.sweep import SWEEP, sweep_dataset

OPTIONS = Detection(
    threshold_m=0.1,
    noise_factor=3.0,
    minimum_area_m2=0.02,
    ground_window_m=None,
    multilook_window_m=0.2,
    background_window_m=3.0,
    amplitude_threshold_db=6.0,
)
X, Y = np.arange(-20, 21) * 0.1, 10 + np.arange(31) * 0.1
OBJECTS = TypeAdapter(tuple[SceneObject, ...]).validate_python(
    [
        {"shape": "box", "x_m": -1, "y_m": 11, "size_x_m": 0.4, "size_y_m": 0.4, "height_m": 0.2},
        {"shape": "pit", "x_m": 1, "y_m": 12, "diameter_m": 0.4, "depth_m": 0.3},
    ]
)


def cells(x, y):
    """Two cells beside each other, 0.02 m2."""
    mask = np.zeros((Y.size, X.size), bool)
    row, column = round((y - 10) / 0.1), round((x + 2) / 0.1)
    mask[row, column : column + 2] = True
    return mask


def evaluate(height=(), contrast=(), kind=None, objects=OBJECTS):
    shape = (Y.size, X.size)
    fields = [np.zeros(shape), np.zeros(shape)]
    for field, parts in zip(fields, (height, contrast), strict=True):
        for value, x, y in parts:
            field[cells(x, y)] = value
    shadow = np.zeros(shape, bool)
    shadow[-5:] = True
    empty = np.zeros(0)
    detections = variables.dataset(
        "detections",
        {name: np.zeros(shape) for name in ("ground", "height_above_ground")}
        | {
            "significant_height": fields[0],
            "contrast": fields[1],
            "map_class": np.zeros(shape, np.int8) if kind is None else kind,
            "bright": np.zeros(shape, bool),
        }
        | {
            name: empty
            for name, variable in variables.PRODUCTS["detections"].items()
            if variable.dims == ("detection",)
        },
        {"x": X, "y": Y},
    )
    truth = variables.dataset(
        "truth",
        {
            "height": np.zeros(shape),
            "reflectivity": np.ones(shape),
            "visible_fraction": np.ones((2, *shape)),
            "shadow": shadow,
        },
        {"x": X, "y": Y},
    )
    return detection_accuracy.evaluate(detections, truth, objects, options=OPTIONS)


def at(found, name, threshold):
    key = "height_threshold" if name.startswith("height") else "amplitude_threshold"
    return found[name].sel({key: threshold}, method="nearest").values


def ratio(decibel):
    return 10 ** (decibel / 10)


def test_an_object_is_found_by_an_alarm_of_its_sign_up_to_the_threshold():
    found = evaluate(height=[(0.205, -1, 11), (-0.105, 1, 12)])
    assert at(found, "height_found", 0.1).tolist() == [True, True]
    assert at(found, "height_found", 0.2).tolist() == [True, False]
    assert at(found, "height_found", 0.21).tolist() == [False, False]
    assert not found["height_false_alarms"].any()
    wrong = evaluate(height=[(-0.205, -1, 11), (0.105, 1, 12)])
    assert not wrong["height_found"].any()
    assert found["object_height"].values.tolist() == [0.2, -0.3]


def test_an_alarm_within_a_multilook_window_is_the_object_s_and_one_beyond_is_false():
    # The box ends at x = -0.8 m.
    assert at(evaluate(height=[(0.3, -0.6, 11)]), "height_found", 0.1)[0]
    beyond = evaluate(height=[(0.3, -0.5, 11), (-0.155, 0, 12.5)])
    assert not at(beyond, "height_found", 0.1)[0]
    assert at(beyond, "height_false_alarms", 0.1) == 2
    assert at(beyond, "height_false_alarms", 0.2) == 1


def test_any_bright_alarm_finds_an_object_and_the_others_are_false():
    bright = [(ratio(8.2), -1, 11), (ratio(5.2), 1, 12), (ratio(6.2), 0, 10.5)]
    found = evaluate(contrast=bright)
    assert at(found, "amplitude_found", ratio(5)).tolist() == [True, True]
    assert at(found, "amplitude_found", ratio(8)).tolist() == [True, False]
    false = [int(at(found, "amplitude_false_alarms", ratio(level))) for level in (5, 6, 6.5)]
    assert false == [1, 1, 0]


def test_the_map_s_unknown_is_counted_on_objects_in_shadow_and_on_visible_ground():
    kind = np.zeros((Y.size, X.size), np.int8)
    kind[-2:] = detection.UNKNOWN
    kind[:, X > 0.95] = detection.UNKNOWN
    found = evaluate(kind=kind)
    # The box is free; half of the pit, and its middle, lie at x > 0.95 m.
    assert found["object_free"].values[0] == 1
    assert found["object_unknown"].values[1] == pytest.approx(8 / 13, abs=0.15)
    wide = (X > 0.95).mean()
    assert found["shadow_unknown"] == pytest.approx(0.4 + 0.6 * wide)
    assert found["scene_area"] == pytest.approx(X.size * Y.size * 0.01)


def test_a_scene_without_objects_has_nothing_but_false_alarms():
    found = evaluate(height=[(0.3, 0, 11)], objects=())
    assert found.sizes["object"] == 0
    assert at(found, "height_false_alarms", 0.1) == 1


def swept(*cases):
    """Make a sweep over the roughness, a realization a case, from what they found."""
    data = {
        name: np.stack([case[name].values.astype(float) for case in cases])[:, None]
        for name in cases[0].data_vars
    }
    for name, variable in SWEEP.items():
        sizes = {"region": 4, "channel": 2, "ground_axis": 2}
        data[name] = np.ones((len(cases), 1, *(sizes[dim] for dim in variable.dims)))
    axis = (0.01 * np.arange(len(cases)), {"long_name": "scene.roughness_std_m"})
    coords = {name: cases[0][name].values for name in cases[0].coords if name not in "xy"}
    return sweep_dataset(data, {"scene_roughness_std_m": axis}, coords)


def test_the_roc_is_of_obstacles_above_ground_and_of_alarms_by_area():
    bright = [(ratio(3.2), -1, 11), (ratio(5.2), 0, 12.5), (ratio(2.2), -1.5, 12.5)]
    sweep = swept(
        evaluate(height=[(0.205, -1, 11), (0.055, 0, 12.5)], contrast=bright),
        evaluate(height=[(0.155, -1, 11)], contrast=bright[:1]),
    )
    case = sweep.isel(scene_roughness_std_m=0)
    both = detection_accuracy.curves(case, 0.2)
    area = 41 * 31 * 0.01
    # The box alone counts: it is found up to 20 cm, beside no false alarm from 6 cm on.
    assert both["height"].at(0.9) == (pytest.approx(0.2), 0.0)
    assert both["height"].false_alarms[2] == pytest.approx(100 / area)
    assert both["amplitude"].at(0.9) == (pytest.approx(ratio(3)), pytest.approx(100 / area))
    # Nothing is that high, and then nothing is found or missed.
    assert np.isnan(detection_accuracy.curves(case, 0.3)["height"].probability).all()
    assert detection_accuracy.curves(case, 0.3)["height"].at(0.9) is None
    text = detection_accuracy.as_markdown(sweep, OBJECTS, OPTIONS)
    assert f"| 0 | 0 at 20 cm | {100 / area:.2g} at 3.0 dB | 0 | 100.0 % |" in text
    assert "| 0.01 | 0 at 15 cm | 0 at 3.0 dB | 0 | 100.0 % |" in text
    assert "| box | 0.2 | 11 | 1.00 | 1.00 |" in text
    assert "| pit | -0.3 | 12 | 0.00 | 0.00 |" in text
