"""A third antenna tells boxes taller than half the height of ambiguity, which two take for flat."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

import vinsar

HEIGHTS = (0.6, 0.28, 0.5, 0.34, 0.42, 0.55)
# Behind a box the ground is hidden as far as the next row: y h / (H - h) is 4.5 m at most.
BOXES = [
    {"shape": "box", "x_m": x, "y_m": y, "size_x_m": size, "size_y_m": size, "height_m": height}
    for (x, y, size), height in zip(
        ((-1.9, 10.9, 1.0), (-0.6, 11.4, 0.6), (0.7, 11.0, 1.0), (1.9, 11.8, 0.6),
         (-1.2, 14.6, 1.0), (1.4, 14.8, 0.6)),
        HEIGHTS, strict=True,
    )
]  # fmt: skip
SEEDS = range(3)
SCENE = {"x_min_m": -2.5, "x_max_m": 2.5, "y_min_m": 10.0, "y_max_m": 16.0}


@pytest.fixture(scope="module")
def found():
    """What two and three antennas make of the boxes, at 10 dB."""
    # Before the boxes, where none hides the ground.
    level = [{"x_min_m": -2.4, "x_max_m": 2.4, "y_min_m": 10.05, "y_max_m": 10.3}]
    studies = [
        vinsar.load(
            seed=seed,
            radar={"baselines_m": [0.06, 0.3], "position_spacing_m": 0.02},
            scene=SCENE
            | {"terrain": "flat", "facet_size_m": 0.037, "roughness_std_m": 0.01, "objects": BOXES},
            echo={"snr_db": 10.0, "accuracy_db": -60.0},
            imaging={"grid_spacing_m": 0.05},
            filtering={"method": "gaussian", "gaussian_std_px": 2.0},
            height={"level_ground": level},
        )
        for seed in SEEDS
    ]
    return [vinsar.run(study, "two_antennas")["two_antennas"] for study in studies]


def test_boxes_beyond_half_the_ambiguity_keep_their_height_by_three_antennas_only(found):
    wrong = np.array([(part["top_wrong"] > 0.5).sum("object").values for part in found]).sum(axis=0)
    count = len(BOXES) * len(SEEDS)
    # Wrong in four of five by the long baseline alone, and in no more than one of twenty by all:
    # bounds that a thousandth of the draws would miss.
    assert wrong[0] >= binom.ppf(0.001, count, 0.8)
    assert wrong[1] <= binom.ppf(0.999, count, 0.05)
    errors = np.array([part["top_height"] - part["true_top_height"] for part in found])
    assert (np.abs(errors[:, 1]) > 0.05).sum() <= binom.ppf(0.999, count, 0.05)


def test_the_ground_beside_boxes_keeps_its_cycle(found):
    assert all(part["ground_wrong"][1] < 0.001 for part in found)


def test_a_long_baseline_whose_cycles_are_settled_makes_better_heights():
    """The paper's relief is four heights of ambiguity of 1 m high, and unwraps wrongly alone."""

    def visible(*baselines):
        study = vinsar.load(
            seed=1,
            radar={"baseline_m": baselines[-1], "baselines_m": list(baselines)},
            echo={"accuracy_db": -60.0},
            imaging={"grid_spacing_m": 0.05, "surface": "estimated"},
            filtering={"method": "gaussian", "gaussian_std_px": 2.0},
        )
        found = vinsar.run(study, "accuracy")["accuracy"]
        return float(found["std"].sel(region="visible_ground"))

    settled = visible(0.15, 1.0)
    # A tenth at least, where phase noise alone would make it a third of that of 0.3 m.
    assert settled < 0.9 * visible(0.15, 0.3)
    assert settled < 0.5 * visible(1.0)
