"""Likeness to the published figures, on statistics with a known distance from them."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations.constants import REGIONS
from vinsar.paper import likeness
from vinsar.sweeps.sweep import SWEEP, sweep_dataset

SCATTER = (0.05, 0.08, 0.2)


def made(keys, logs, realizations=10, seed=0):
    """A sweep whose whole-scene statistics scatter about given logarithms."""
    rng = np.random.default_rng(seed)
    shape = [len(values) for values, _ in keys.values()]
    cells = np.broadcast_to(np.asarray(logs, float), (*shape, 3))
    drawn = cells[..., None, :] + np.array(SCATTER) * rng.standard_normal((*shape, realizations, 3))
    beyond, std, worst = np.exp(np.moveaxis(drawn, -1, 0))
    data = {}
    for name, variable in SWEEP.items():
        sizes = {"region": len(REGIONS), "channel": 2, "ground_axis": 2}
        own = tuple(sizes[dim] for dim in variable.dims)
        data[name] = np.ones((*shape, realizations, *own), int if name == "residues" else float)
    for name, values in zip(likeness.STATISTICS, (1 - beyond, std, worst), strict=True):
        data[name] = np.repeat(values[..., None], len(REGIONS), axis=-1)
    return sweep_dataset(data, keys)


def key(name, *values):
    return {name.replace(".", "_"): (np.array(values), {"long_name": name})}


@pytest.fixture(scope="module")
def sweeps():
    target = likeness.transformed(np.array(likeness.PUBLISHED))
    away = target - 5 * np.array(SCATTER)
    found = {
        name: made(key(f"radar.{name}", 1.0, 2.0), [away, away], seed=number)
        for number, name in enumerate(likeness.SWEEPS)
    }
    # The second rail height has the published figures as its mean.
    found["rail_height"] = made(key("radar.rail_height_m", 2.0, 1.8), [away, target], seed=99)
    return found


def test_a_choice_with_the_published_figures_is_found(sweeps):
    choices = likeness.compare(sweeps)
    assert len(choices) == 2 * len(likeness.SWEEPS)
    best = likeness.nearest(choices)
    assert best.label == "rail 1.8 m"
    assert [choice for choice in choices if choice.consistent] == [best]
    # The mean of ten has a tenth of the variance in each of three dimensions: chi with 3 degrees
    # of freedom over sqrt(10), 99.9 % of it below 4.03 / sqrt(10).
    assert best.distance < 4.03 / np.sqrt(10)


def test_distances_are_those_that_the_statistics_were_made_with(sweeps):
    # Five standard deviations in each of three independent statistics; the mean of ten errs by
    # 1 / sqrt(10), the pooled covariance of 34 x 9 degrees of freedom by a twelfth.
    others = [c.distance for c in likeness.compare(sweeps) if c.label != "rail 1.8 m"]
    expected = 5 * np.sqrt(3)
    assert np.mean(others) == pytest.approx(expected, rel=0.1)
    spread = [c.distance_std for c in likeness.compare(sweeps)]
    assert np.median(spread) == pytest.approx(1 / np.sqrt(10), rel=0.4)


def test_the_conclusion_names_what_is_consistent(sweeps):
    text = likeness.conclusion(likeness.compare(sweeps))
    assert "two standard deviations of all three published figures: rail 1.8 m." in text
    far = sweeps | {"rail_height": sweeps["noise"]}
    assert likeness.conclusion(likeness.compare(far)).startswith("No choice tried")


def test_too_few_realizations_are_refused(sweeps):
    few = sweeps | {"noise": sweeps["noise"].isel(realization=slice(2))}
    with pytest.raises(ValueError, match="'noise' has fewer than three"):
        likeness.compare(few)


def test_the_table_has_a_row_for_each_choice_and_the_published_figures(sweeps):
    errors = made(
        key("unwrapping.method", "skimage")
        | key("motion.channels", "common")
        | key("motion.axis", "x", "y", "z")
        | key("motion.level_wavelengths", 0.0, 1.0, 2.0),
        np.log([0.05, likeness.PLATEAU_M, 0.9]),
        realizations=3,
    )
    text = likeness.as_markdown(sweeps | {likeness.POSITION_ERRORS: errors})
    assert "| published | 95 % | 4.5 cm | 0.88 m |" in text
    assert text.count("| rail ") == 2
    row = next(line for line in text.splitlines() if line.startswith("| skimage, common"))
    # Nine draws about the plateau: their mean is within 3 / sqrt(9) of a standard deviation.
    assert abs(float(row.split("|")[-2])) < 1
