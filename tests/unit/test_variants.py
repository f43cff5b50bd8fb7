from pathlib import Path

import pytest
import xarray as xr

import vinsar
from vinsar.study import pipeline
from vinsar.sweeps import variants

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def study():
    tiny = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    return tiny.model_copy(update={"variants": {"other seed": {"seed": 1}}})


@pytest.fixture(scope="module")
def results(study):
    return variants.evaluate(study)


def test_a_study_and_its_variants_are_run(study, results):
    assert list(results) == ["as configured", "other seed"]
    own = pipeline.run(study, only="accuracy")["accuracy"]
    xr.testing.assert_identical(results["as configured"], own)
    other = pipeline.run(study.model_copy(update={"seed": 1}), only="accuracy")["accuracy"]
    xr.testing.assert_identical(results["other seed"], other)
    assert not own["height_error"].equals(other["height_error"])


def test_the_table_has_a_row_a_variant_with_its_numbers(results):
    first, second = variants.as_markdown(results).split("\n\n")
    rows = first.splitlines()[2:]
    delivered = second.splitlines()[2:]
    for row, (name, accuracy) in zip(delivered, results.items(), strict=True):
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        part = accuracy.sel(region="delivered")
        assert cells[0] == name
        assert cells[1] == f"{100 * float(part['share_of_scene']):.1f} %"
        assert cells[5].startswith(f"{100 * float(part['coverage_1_sigma']):.1f} % (")
    for row, (name, accuracy) in zip(rows, results.items(), strict=True):
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        scene = accuracy.sel(region="whole_scene")
        assert cells[0] == name
        assert cells[2] == f"{100 * float(scene['std']):.2f} cm"
