"""Switched arrays through the workflow: the table beside the rail."""

from pathlib import Path

import pytest
import yaml

import vinsar
from vinsar.study import pipeline, validation

ROOT = Path(__file__).parents[2]
ARRAY = """
radar: {system: transmit_pair, aperture_length_m: 1.2}
outputs: {figures: [systems], claims: false}
dask: {scheduler: threads}
sweeps:
  systems:
    over:
      radar:
        - {system: rail, aperture_length_m: 0.6}
        - {system: transmit_pair}
        - {system: receive_pair}
    realizations: 1
    base: {filtering: {goldstein_patch_px: 16}}
"""


def test_arrays_come_to_heights_and_stand_beside_the_rail(new_checkout):
    made = new_checkout()
    done = made.snakemake("systems", extra=ARRAY)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split(" | ") for line in (made.results / "systems.md").read_text().splitlines()]
    assert [row[0] for row in rows[2:]] == [
        "| rail, 0.6 m", "| transmit pair, 1.2 m", "| receive pair, 1.2 m",
    ]  # fmt: skip
    # One end stands still: at twice the length the cell is the rail's, and the height of ambiguity
    # twice the rail's, at heights up to 10 cm apart seen from 11 m.
    assert {row[2].split()[0] for row in rows[2:]} == {"20.0"}
    cycles = [float(row[3].split()[0]) for row in rows[2:]]
    assert cycles[1:] == pytest.approx([2 * cycles[0]] * 2, rel=0.01)
    # The transmit pair is the study itself.
    base = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    study = validation.check(validation.merge(base.model_dump(mode="json"), yaml.safe_load(ARRAY)))
    accuracy = pipeline.run(study, only="accuracy")["accuracy"].sel(region="visible_ground")
    assert rows[3][-1] == f"{100 * float(accuracy['std']):.2f} cm |"
    # Without noise a thirtieth of the height of ambiguity, 0.79 m, is a fifth of a radian.
    assert float(accuracy["std"]) < 0.79 / 30
