"""The antenna arrangements side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vinsar
from vinsar.prediction import systems
from vinsar.study.options import Sweep
from vinsar.sweeps.sweep import SWEEP, sweep_dataset

CONFIG = Path(__file__).parents[2] / "config"


@pytest.fixture(scope="module")
def study():
    return vinsar.load(CONFIG / "array.yaml")


@pytest.fixture(scope="module")
def sweep(study):
    """The shipped study's sweep with made up statistics: the number of the arrangement."""
    count = len(study.sweeps["systems"].over["radar"])
    data = {}
    for name, variable in SWEEP.items():
        trailing = [{"region": 4, "channel": 2, "ground_axis": 2}[dim] for dim in variable.dims]
        values = np.arange(count).reshape(count, 1, *[1] * len(trailing))
        values = np.broadcast_to(values, (count, 2, *trailing))
        data[name] = values if name == "residues" else values / 100
    return sweep_dataset(data, {"radar": (np.arange(count), {"long_name": "radar"})})


def test_each_arrangement_has_its_own_numbers(sweep, study):
    found = {one.name: one for one in systems.compare(sweep, study)}
    rail, short, long = (
        found[name] for name in ("rail, 0.8 m", "transmit pair, 0.8 m", "transmit pair, 1.6 m")
    )
    assert [one.positions for one in (rail, short, long)] == [81, 41, 81]
    # One end stands still: twice the cell at the same length, the same at twice the length.
    assert short.resolution_m[0] == pytest.approx(2 * rail.resolution_m[0], rel=1e-3)
    assert long.resolution_m == pytest.approx(rail.resolution_m, rel=1e-3)
    # At heights up to 10 cm apart, seen from 13 m.
    assert short.height_of_ambiguity_m == pytest.approx(2 * rail.height_of_ambiguity_m, rel=0.01)
    # The cart's time; two channels of 81 elements and 401 frequencies of a microsecond.
    assert rail.scan_time_s == study.vehicle.scan_duration_s
    assert long.scan_time_s == pytest.approx(2 * 81 * 401e-6)
    assert float(long.accuracy["std"].sel(region="shadow").mean()) == pytest.approx(0.02)


def test_the_table_has_a_row_an_arrangement(sweep, study):
    lines = systems.as_markdown(systems.compare(sweep, study)).splitlines()
    assert len(lines) == 2 + 5
    assert lines[4].startswith("| transmit pair, 1.6 m | 81 | 17.6 cm, 7.6 cm | 0.9")
    assert lines[4].endswith("| 0.065 s | 2.0 % | 2.00 cm | 2.0 % | 2.00 cm |")
    assert len({line.count("|") for line in lines}) == 1


def test_a_sweep_over_other_keys_is_refused(sweep, study):
    other = Sweep(over={"radar.baseline_m": (0.1, 0.2)}, realizations=2, base={})
    changed = study.model_copy(update={"sweeps": {"systems": other}})
    with pytest.raises(ValueError, match=r"goes over radar\.baseline_m; radar alone"):
        systems.compare(sweep, changed)
