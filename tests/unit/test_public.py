"""What a notebook needs of the library."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

import vinsar
from vinsar.results import storage
from vinsar.study import pipeline

ROOT = Path(__file__).parents[2]
TINY = ROOT / "tests/workflow/tiny.yaml"


@pytest.fixture(scope="module")
def study():
    return vinsar.load(TINY)


@pytest.fixture(scope="module")
def products(study):
    return vinsar.run(study, "accuracy")


def test_without_files_it_is_the_study_of_the_paper():
    paper = yaml.safe_load((ROOT / "config/paper.yaml").read_text(encoding="utf-8"))
    loaded = vinsar.load()
    assert loaded.study == "paper"
    assert loaded.radar.model_dump() == paper["radar"]
    assert loaded.imaging.model_dump() == paper["imaging"]


def test_keywords_override_files():
    study = vinsar.load(TINY, seed=7, radar={"rail_height_m": 1.8})
    assert (study.study, study.seed, study.radar.rail_height_m) == ("tiny", 7, 1.8)
    # What the keywords do not name stays as the file has it.
    assert study.radar.position_spacing_m == 0.03


def test_what_is_wrong_is_one_value_error():
    with pytest.raises(ValueError, match=r"radar\.baseline_m"):
        vinsar.load(radar={"baseline_m": -1.0})


def test_a_run_is_that_of_the_pipeline_and_no_more_than_asked_for(study, products):
    whole = pipeline.run(study, "accuracy")
    assert products.keys() == whole.keys()
    np.testing.assert_array_equal(products["dem"]["height"], whole["dem"]["height"])
    assert "detections" not in products


def test_a_run_goes_on_from_what_is_given(study, products):
    more = vinsar.run(study, "focus", given=products)
    assert more["dem"] is products["dem"]
    assert "focus" in more


def test_a_product_may_be_asked_for_after_one_that_needs_it(study):
    found = vinsar.run(study, "facets", "terrain")
    assert list(found) == list(vinsar.run(study, "facets"))


def test_an_unknown_product_is_named(study):
    with pytest.raises(ValueError, match="no product 'demm'"):
        vinsar.run(study, "demm")


def test_a_figure_is_shown_by_a_notebook(study, products):
    shown = vinsar.draw("fig4", products, study)._repr_png_()
    assert shown.startswith(b"\x89PNG")


def test_a_figure_says_what_it_lacks(study):
    with pytest.raises(ValueError, match="'fig4' reads accuracy"):
        vinsar.draw("fig4", {}, study)
    with pytest.raises(ValueError, match="no figure 'fig44'; there are"):
        vinsar.draw("fig44", {}, study)


def test_a_sweep_has_its_keys_as_dimensions(study):
    found = vinsar.sweep(study, "snr")
    assert found["std"].dims == ("echo_snr_db", "realization", "region")
    assert np.isfinite(found["std"].sel(region="whole_scene")).all()
    with pytest.raises(ValueError, match=r"no sweep 'snrr'; it has .*snr"):
        vinsar.sweep(study, "snrr")


def test_a_product_is_read_by_what_its_file_says(tmp_path, products):
    storage.write(products["dem"], tmp_path / "x.nc", "dem")
    found = vinsar.read(tmp_path / "x.nc")
    np.testing.assert_array_equal(found["height"], products["dem"]["height"])


def test_importing_it_is_light():
    code = (
        "import sys, vinsar; print([m for m in ('numpy', 'xarray', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_tutorial_runs_from_its_first_cell_to_its_last():
    notebook = json.loads((ROOT / "docs/tutorial.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    assert len(cells) > 4
    assert not any(cell.get("outputs") for cell in notebook["cells"])
    code = "\n".join(cells)
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
