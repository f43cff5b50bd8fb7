"""The workflow as a user runs it: on a copy of the repository, with a tiny study."""

import html
import json
import os
import re
from pathlib import Path

import pytest
import xarray as xr

import vinsar
from vinsar import figures
from vinsar.evaluation import accuracy
from vinsar.paper import claims
from vinsar.results import storage
from vinsar.study import pipeline

ROOT = Path(__file__).parents[2]
OF_SWEEPS = {"figure_fig5", "figure_snr"}
FIGURE_RULES = {
    "figure_summary", "figure_fig1", "figure_fig2", "figure_fig3", "figure_fig3_panels",
    "figure_fig4", *OF_SWEEPS,
}  # fmt: skip
AFTER_FILTERING = {
    "filtered", "unwrapped", "dem", "detections", "accuracy", "accuracy_summary", "claims",
    "figure_summary", "figure_fig3", "figure_fig3_panels", "figure_fig4", "sweep", *OF_SWEEPS,
}  # fmt: skip


@pytest.fixture(scope="module")
def study():
    return vinsar.load(ROOT / "tests/workflow/tiny.yaml")


@pytest.fixture(scope="module")
def products(study):
    return pipeline.run(study)


@pytest.fixture(scope="module")
def sweeps(checkout, study):
    return {
        f"sweeps/{name}": vinsar.read(checkout.results / f"sweeps/{name}.nc")
        for figure in study.outputs.figures
        for name in figures.FIGURES[figure].sweeps
    }


@pytest.fixture(scope="module")
def computed(study):
    """The stages that the study's outputs need; the others serve figures of other studies."""
    read = {name for figure in study.outputs.figures for name in figures.FIGURES[figure].inputs}
    wanted = {*read, *claims.INPUTS, "accuracy", "focus"}
    return pipeline.needed(wanted, pipeline.stages(study))


def test_the_workflow_gives_the_same_numbers_as_the_library(checkout, products, computed):
    for name in computed:
        stored = storage.read(checkout.results / f"{name}.nc", name)
        stored.attrs = {}
        xr.testing.assert_identical(stored, products[name])


def test_the_summary_and_the_claims_are_those_of_the_library(checkout, products, sweeps, study):
    summary = json.loads((checkout.results / "accuracy.json").read_text())
    assert summary == accuracy.summary(products["accuracy"])
    found = claims.evaluate(products | sweeps, study)
    assert json.loads((checkout.results / "claims.json").read_text()) == claims.as_json(found)
    assert (checkout.results / "claims.md").read_text() == claims.as_markdown(found)


def test_every_figure_is_there_in_every_format(checkout, study):
    made = {path.name for path in (checkout.results / "figures").iterdir()}
    assert made == {
        f"{name}.{end}" for name in study.outputs.figures for end in ("pdf", "svg", "png")
    }


def test_each_product_tells_the_inputs_and_sections_that_its_stage_declares(checkout, computed):
    for name, stage in computed.items():
        attributes = storage.read(checkout.results / f"{name}.nc", name).attrs
        assert set(json.loads(attributes["vinsar_inputs"])) == set(stage.inputs), name
        assert set(json.loads(attributes["vinsar_configuration"])) == set(stage.sections), name


def test_each_figure_tells_the_products_sweeps_and_sections_that_it_declares(checkout, study):
    for name in study.outputs.figures:
        figure = figures.FIGURES[name]
        text = (checkout.results / f"figures/{name}.svg").read_text(encoding="utf-8")
        found = re.search(r"<dc:description>(.*?)</dc:description>", text, re.DOTALL)
        attributes = json.loads(html.unescape(found[1]))
        read = set(figure.reads)
        # The single panels of the third figure are drawn together.
        single = bool(figure.sheet)
        assert set(json.loads(attributes["vinsar_inputs"])) >= read, name
        assert single or set(json.loads(attributes["vinsar_inputs"])) == read, name
        assert set(json.loads(attributes["vinsar_configuration"])) == set(figure.sections), name


def test_a_sweep_s_values_rerun_what_reads_it(checkout):
    rules = checkout.would_run("sweeps: {snr: {realizations: 2}}\n")
    assert {"sweep", "figure_snr"} <= rules
    assert rules <= {"sweep", "claims", *OF_SWEEPS}


def test_a_second_run_has_nothing_to_do_even_after_a_touch(checkout):
    touched = [
        path
        for folder in ("src", "workflow", "config")
        for path in (checkout.folder / folder).rglob("*")
    ]
    touched += checkout.results.glob("*.nc")
    times = {path: path.stat().st_mtime_ns for path in touched}
    for path in touched:
        path.touch()
    rules = checkout.would_run()
    # What is compiled goes by the sources' times.
    for path, nanoseconds in times.items():
        os.utime(path, ns=(nanoseconds, nanoseconds))
    assert rules == set()


def test_the_look_of_figures_reruns_only_figures(checkout):
    look = "height_colormap: viridis, two_columns_mm: 170.0, font: serif, formats: [svg, png]"
    assert checkout.would_run(f"figures: {{{look}}}\n") == FIGURE_RULES


def test_a_filter_setting_reruns_the_filter_and_what_follows(checkout):
    assert checkout.would_run("filtering: {goldstein_alpha: 0.5}\n") == AFTER_FILTERING


def test_an_edit_of_filtering_reruns_the_filter_and_what_follows(checkout):
    path = checkout.folder / "src/vinsar/processing/filtering.py"
    before = path.read_text()
    path.write_text(before + "\n_EDITED = True\n")
    try:
        assert checkout.would_run() == AFTER_FILTERING
    finally:
        path.write_text(before)


def test_an_edit_of_a_figure_reruns_that_figure_alone(checkout):
    path = checkout.folder / "src/vinsar/figures/acquisition.py"
    before = path.read_text()
    path.write_text(before + "\n_EDITED = True\n")
    try:
        assert checkout.would_run() == {"figure_fig1"}
    finally:
        path.write_text(before)


def test_a_kernel_edit_reruns_what_runs_it(checkout):
    path = checkout.folder / "src/vinsar/kernels/backprojection.py"
    before = path.read_text()
    path.write_text(before + "\n_EDITED = True\n")
    try:
        rules = checkout.would_run()
    finally:
        path.write_text(before)
    assert {"images", "registration", "dem"} <= rules
    assert not {"trajectory", "terrain", "facets", "visibility", "truth", "echo"} & rules


def test_a_rail_height_reruns_no_facet(checkout):
    rules = checkout.would_run("radar: {rail_height_m: 2.2}\n")
    assert {"trajectory", "echo", "figure_fig1", "claims"} <= rules
    assert not {"terrain", "facets"} & rules


def test_a_speed_of_the_vehicle_reruns_no_facet(checkout):
    rules = checkout.would_run("vehicle: {forward_speed_m_per_s: 1.0}\n")
    assert {"true_trajectory", "truth", "echo", "profiles", "focus"} <= rules
    assert not {"terrain", "facets", "trajectory", "registration"} & rules


def test_a_truncated_product_is_named_with_what_to_do(checkout):
    path = checkout.results / "interferogram.nc"
    whole = path.read_bytes()
    path.write_bytes(whole[:9000])
    done = checkout.snakemake()
    said = done.stdout + done.stderr
    assert done.returncode != 0
    assert "results/tiny/interferogram.nc is truncated or not netCDF" in said
    assert "delete it and run again" in said
    assert "Traceback" not in said
    path.unlink()
    done = checkout.snakemake("results/tiny/interferogram.nc", "results/tiny/filtered.nc")
    assert done.returncode == 0, done.stdout + done.stderr
    assert path.read_bytes() == whole


def test_a_wrong_configuration_starts_no_job(new_checkout):
    made = new_checkout()
    done = made.snakemake(
        extra="radar: {baselin_m: 0.3}\nscene: {x_max_m: -9.0}\nfiltering: {method: lee}\n"
    )
    said = done.stdout + done.stderr
    assert done.returncode == 1
    assert "The configuration has 3 faults" in said
    for key in ("radar.baselin_m", "scene.x_max_m", "filtering.method"):
        assert key in said
    assert "Traceback" not in said
    assert not made.results.exists()


def test_what_is_unwise_is_said_before_the_jobs(checkout):
    done = checkout.snakemake("-n", extra="radar: {baseline_m: 2.5}\n")
    assert done.returncode == 0
    assert "a quarter of the critical baseline" in done.stdout + done.stderr
