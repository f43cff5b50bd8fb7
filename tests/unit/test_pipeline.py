from dataclasses import replace
from pathlib import Path

import dask
import numpy as np
import pytest
import xarray as xr

import vinsar
from vinsar.foundations import variables
from vinsar.foundations.configuration import Study
from vinsar.processing import interferogram
from vinsar.processing.height import ControlPoint
from vinsar.study import pipeline

ROOT = Path(__file__).parents[2]
PROCESSING = ("autofocus", "profiles", "images", "interferogram", "filtered", "unwrapped", "dem")


@pytest.fixture(scope="module")
def study():
    return vinsar.load(ROOT / "tests/workflow/tiny.yaml")


@pytest.fixture(scope="module")
def products(study):
    return pipeline.run(study)


def changed(study: Study, section: str, **values) -> Study:
    part = getattr(study, section).model_copy(update=values)
    return study.model_copy(update={section: part})


def test_every_stage_makes_the_product_of_its_name(study, products):
    assert list(products) == list(pipeline.stages(study))
    for name, product in products.items():
        variables.check(product, name)


def test_stages_come_after_what_they_read():
    seen = set()
    for name, stage in pipeline.STAGES.items():
        assert set(stage.inputs) <= seen, name
        seen.add(name)


def test_the_true_scene_reaches_the_processing_only_as_an_echo():
    scene = {"terrain", "facets", "visibility", "truth", "echo", "true_trajectory"}
    for name in PROCESSING:
        assert not scene & set(pipeline.STAGES[name].inputs), name
        assert "scene" not in pipeline.STAGES[name].sections, name


def test_processing_is_blind_to_the_terrain_but_for_the_echo(study, products):
    # The same echo with the truth taken away gives the same heights.
    blind = {name: products[name] for name in ("received", "trajectory", "recorded_trajectory")}
    for name in PROCESSING:
        blind[name] = pipeline.run_stage(name, blind, study)
    xr.testing.assert_identical(blind["dem"], products["dem"])


def test_a_stage_cannot_read_a_section_that_it_does_not_declare(study, products, monkeypatch):
    stage = pipeline.STAGES["filtered"]
    blind = replace(stage, sections=())
    monkeypatch.setitem(pipeline.STAGES, "filtered", blind)
    with pytest.raises(AttributeError, match="filtering"):
        pipeline.run_stage("filtered", products, study)


def test_no_stage_delivers_values_that_cannot_be(study, products, monkeypatch):
    def broken(inputs, part):
        made = stage.compute(inputs, part)
        made["coherence"][3, 4] = np.nan
        return made

    stage = pipeline.STAGES["interferogram"]
    monkeypatch.setitem(pipeline.STAGES, "interferogram", replace(stage, compute=broken))
    with pytest.raises(ValueError, match="'coherence' in product 'interferogram' are missing"):
        pipeline.run_stage("interferogram", products, study)


def test_a_run_is_the_same_bits_however_many_threads(study, products):
    with dask.config.set(scheduler="synchronous"):
        again = pipeline.run(study, only="dem")
    xr.testing.assert_identical(again["dem"], products["dem"])


def test_only_what_a_product_needs_is_computed(study):
    found = pipeline.run(study, only="facets")
    assert list(found) == ["roughness", "terrain", "facets"]


def test_the_seed_moves_the_facets_and_nothing_else_of_the_scene(study, products):
    other = pipeline.run(study.model_copy(update={"seed": study.seed + 1}), only="facets")
    xr.testing.assert_identical(other["terrain"], products["terrain"])
    moved = other["facets"]["facet_position"].values - products["facets"]["facet_position"].values
    assert np.abs(moved).max() > 0.01


def test_noise_does_not_move_the_facets(study, products):
    noisy = pipeline.run(changed(study, "echo", snr_db=10.0), only="received")
    xr.testing.assert_identical(noisy["facets"], products["facets"])
    difference = noisy["received"]["echo"].values - products["received"]["echo"].values
    assert np.abs(difference).min() > 0


def test_hidden_facets_echo_only_without_occlusion(study, products):
    dark = products | {"visibility": products["visibility"].copy(deep=True)}
    dark["visibility"]["visible"].values[...] = False
    hidden = pipeline.run_stage("echo", dark, study)
    open_ = pipeline.run_stage("echo", dark, changed(study, "echo", occlusion=False))
    assert np.abs(hidden["echo"]).max() == 0
    assert np.abs(open_["echo"]).min() > 0


def test_control_points_and_level_ground_agree(study, products):
    points = tuple(
        ControlPoint(x_m=x, y_m=10.1, height_m=float(height))
        for x, height in zip(
            (-0.7, 0.7),
            products["truth"]["height"].sel(y=10.1, x=[-0.7, 0.7], method="nearest").values,
            strict=True,
        )
    )
    other = changed(study, "height", reference="control_points", control_points=points)
    dem = pipeline.run_stage("dem", products, other)
    # Two single pixels of speckle against many: within a tenth of a cycle of phase.
    offsets = [float(d["phase_offset"].mean()) for d in (dem, products["dem"])]
    assert abs(offsets[0] - offsets[1]) < 2 * np.pi / 10


def test_the_looks_count_resolution_cells(study, products):
    fine = changed(study, "interferogram", coherence_window_px=1)
    wide = changed(study, "interferogram", coherence_window_px=31)
    assert interferogram.looks(products["trajectory"], fine) == 1
    # 31 pixels of 5 cm against cells of about 0.074 m x 0.20 m (0.6 m aperture, 11.2 m range).
    found = interferogram.looks(products["trajectory"], wide)
    assert found == pytest.approx(1.55**2 / (0.0763 * 0.2), rel=0.03)


def test_measured_echoes_leave_out_what_needs_the_truth(study):
    measured = changed(study, "measurement", file="echo.nc")
    assert pipeline.from_files(measured) == pipeline.MEASURED
    assert set(pipeline.stages(measured)) >= {*PROCESSING, "registration"}
    truth = {"terrain", "facets", "true_trajectory", "visibility", "truth", "echo", "accuracy"}
    assert not {*truth, "focus", "baseline_angle"} & set(pipeline.stages(measured))
    assert pipeline.from_files(study) == ()
    optional = {name for name, stage in pipeline.STAGES.items() if stage.when}
    assert set(pipeline.STAGES) - optional <= set(pipeline.stages(study))
    assert "reflectors" not in pipeline.stages(study)


def test_a_second_pass_and_further_antennas_are_there_when_they_are_asked_for(study):
    assert not {"refined", "short_baselines"} & set(pipeline.stages(study))
    asked = changed(study, "imaging", surface="estimated")
    asked = changed(asked, "radar", baselines_m=(0.06, 0.3))
    # To the end: what evaluates two channels takes those of the longest baseline.
    products = pipeline.run(asked)
    assert set(products) == set(pipeline.stages(asked))
    for name in ("refined", "short_baselines", "images", "registration"):
        variables.check(products[name], name)
    assert products["images"].sizes["channel"] == 3
    # The second pass moves heights by less than a cycle, and by more than nothing.
    plane = pipeline.run(study, "dem")["dem"]["image_height"]
    moved = np.abs(products["dem"]["image_height"] - plane)
    assert 1e-4 < float(moved.median()) < 0.02


def test_a_third_antenna_leaves_the_other_two_as_they_are(study, products):
    three = pipeline.run(changed(study, "radar", baselines_m=(0.06, 0.3)), "filtered")
    for name in ("received", "images"):
        xr.testing.assert_identical(three[name].sel(channel=["lower", "upper"]), products[name])
    xr.testing.assert_identical(three["filtered"], products["filtered"])
