"""Counting wrong cycles on objects and on the ground, with heights that are made up."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.evaluation import two_antennas
from vinsar.foundations import variables
from vinsar.simulation.scene import Box

X, Y = np.linspace(-1, 1, 41), np.linspace(10, 12, 41)
BOX = Box(shape="box", x_m=0.0, y_m=11.0, size_x_m=0.52, size_y_m=0.52, height_m=0.4)
HIDDEN = Box(shape="box", x_m=0.8, y_m=11.8, size_x_m=0.12, size_y_m=0.12, height_m=0.4)


def test_a_cycle_is_wrong_where_a_visible_height_errs_by_more_than_half_the_ambiguity():
    on_box = (np.abs(X) < 0.26)[None] & (np.abs(Y - 11) < 0.26)[:, None]
    dark = np.zeros(on_box.shape, bool)
    dark[28:, 25:] = True
    true = np.where(on_box, 0.4, 0.0)
    truth = variables.dataset(
        "truth",
        {"height": true, "shadow": dark, "reflectivity": np.ones(true.shape)}
        | {"visible_fraction": np.stack([1.0 - dark] * 2)},
        {"x": X, "y": Y},
    )
    fewer = true.copy()
    fewer[on_box] = -0.05  # a cycle of 0.45 m off
    fewer[:2] = 0.3  # two of the 41 rows of ground
    fewer[dark] = 9.0  # hidden: does not count
    more = true + 0.2
    found = two_antennas.compare(
        {2: fewer, 3: more}, truth, (BOX, HIDDEN), ambiguity=np.full(true.shape, 0.45)
    )
    np.testing.assert_array_equal(found["top_wrong"][:, 0], [1, 0])
    np.testing.assert_allclose(found["top_height"][:, 0], [-0.05, 0.6])
    assert found["true_top_height"][0] == pytest.approx(0.4)
    # Within 0.3 m of the box, six cells to each side, no ground counts.
    near = (np.abs(X) < 0.56)[None] & (np.abs(Y - 11) < 0.56)[:, None]
    ground = (~near & ~dark).sum()
    np.testing.assert_allclose(found["ground_wrong"], [2 * X.size / ground, 0])
    assert np.isnan(found["top_wrong"][:, 1]).all()


def test_two_antennas_are_compared_where_there_are_more_and_they_are_unwrapped(make):
    stage = two_antennas.STAGES["two_antennas"]
    assert not stage.when(make())
    assert stage.when(make(baselines_m=[0.06, 0.3]))
    assert not stage.when(make(baselines_m=[0.06, 0.3], method="baselines"))


@pytest.fixture
def make():
    import vinsar

    def study(baselines_m=None, method="whirlwind"):
        return vinsar.load(radar={"baselines_m": baselines_m}, unwrapping={"method": method})

    return study
