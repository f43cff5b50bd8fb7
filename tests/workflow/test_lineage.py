"""Asking results where they come from, on the finished tiny study."""

import json
import shutil

import netCDF4
import pytest

from vinsar.results import lineage

CONFIG = ("--configfile", "tiny.yaml")
SPOILT = ("fig1.pdf", "fig2.png", "fig4.pdf")


def test_an_unchanged_study_is_verified(copy):
    done = copy.ask("verify", "results/tiny", *CONFIG)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "results unchanged" in done.stdout


def test_every_kind_of_damage_is_found_and_named(copy):
    results = copy.results
    flipped = bytearray((results / "dem.nc").read_bytes())
    flipped[len(flipped) // 2] ^= 1
    (results / "dem.nc").write_bytes(flipped)
    image = results / "figures/fig2.png"
    image.write_bytes(image.read_bytes()[:-100])
    with netCDF4.Dataset(results / "terrain.nc", "a") as file:
        file["height"].long_name = "edited"
    fig1, fig4 = results / "figures/fig1.pdf", results / "figures/fig4.pdf"
    one, four = fig1.read_bytes(), fig4.read_bytes()
    fig1.write_bytes(four)
    fig4.write_bytes(one)
    (results / "claims.md").unlink()
    (results / "foreign.nc").write_bytes(b"not ours")
    done = copy.ask("verify", "results/tiny", *CONFIG)
    assert done.returncode == 1
    for name in ("dem.nc", "terrain.nc", *(f"figures/{figure}" for figure in SPOILT)):
        assert f"{name}: modified by hand" in done.stdout
    assert "claims.md: missing" in done.stdout
    assert "foreign.nc: there is no record of its making" in done.stdout
    assert "accuracy.nc: stale: made from another dem.nc" in done.stdout
    assert "figures/fig3.png: modified" not in done.stdout


def edit(path, change):
    record = json.loads(path.read_text())
    change(record)
    path.write_text(json.dumps(record, indent=2, sort_keys=True) + "\n")


EDITS = {
    "dem.nc": lambda record: record.update(rule="another"),
    "truth.nc": lambda record: record.update(started="2014-01-01T00:00:00.000+00:00"),
    "facets.nc": lambda record: record["provenance"].update(vinsar_commit="0123456789ab"),
    "terrain.nc": lambda record: record["provenance"].update(vinsar_configuration="{}"),
    "images.nc": lambda record: record.pop("provenance"),
    "claims.md": lambda record: record.pop("digest"),
    "figures/fig1.png": lambda record: record.update(threads=99),
    "accuracy.json": lambda record: record.clear(),
}


def test_every_edit_of_a_record_is_found(copy):
    for name, change in EDITS.items():
        edit(copy.results / f"records/{name}.json", change)
    # One that its editor has signed anew, against the provenance in the file itself.
    signed = copy.results / "records/figures/fig2.pdf.json"
    record = json.loads(signed.read_text())
    record["provenance"]["vinsar_commit"] = "0123456789ab"
    signed.write_text(json.dumps(lineage.signed(record)))
    (copy.results / "records/focus.nc.json").write_bytes(b"\xff{")
    done = copy.ask("verify", "results/tiny", *CONFIG)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    for name in EDITS:
        assert f"{name}: its record " in done.stdout, name
    assert "figures/fig2.pdf: its record tells another vinsar_commit than" in done.stdout
    assert "focus.nc: its record cannot be read" in done.stdout
    for command in (("diff", "results/tiny", "results/tiny"), ("crate", "results/tiny", *CONFIG)):
        done = copy.ask(*command)
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
        assert "record" in done.stderr


def test_other_code_and_configuration_make_results_stale(copy):
    code = copy.folder / "src/vinsar/processing/filtering.py"
    code.write_text(code.read_text() + "\n_EDITED = True\n")
    tiny = copy.folder / "tiny.yaml"
    tiny.write_text(tiny.read_text() + "seed: 1\n")
    done = copy.ask("verify", "results/tiny", *CONFIG)
    assert done.returncode == 1
    assert "filtered.nc: stale: code src/vinsar/processing/filtering.py has changed" in done.stdout
    assert "facets.nc: stale: configuration seed was 2014, is 1" in done.stdout
    assert "images.nc:" not in done.stdout


@pytest.mark.parametrize("name", ["fig4.pdf", "fig4.png", "fig4.svg"])
def test_a_figure_is_traced_to_configuration_and_seeds(copy, name):
    done = copy.ask("trace", f"results/tiny/figures/{name}", *CONFIG)
    assert done.returncode == 0, done.stderr
    for line in (
        f"results/tiny/figures/{name} (fig4)",
        "results/tiny/facets.nc (facets)",
        "seed = 2014",
        "radar.baseline_m = 0.3",
        "imaging.grid_spacing_m = 0.05",
    ):
        assert line in done.stdout
    assert "CHANGED" not in done.stdout


def test_a_trace_marks_what_has_changed(copy):
    path = copy.results / "echo.nc"
    content = bytearray(path.read_bytes())
    content[-50] ^= 1
    path.write_bytes(content)
    done = copy.ask("trace", "results/tiny/dem.nc", *CONFIG)
    assert "results/tiny/echo.nc (echo) [CHANGED]" in done.stdout
    assert "results/tiny/facets.nc (facets)\n" in done.stdout


def test_two_studies_are_told_apart(copy):
    shutil.copytree(copy.results, copy.folder / "results/other")
    same = copy.ask("diff", "results/tiny", "results/other")
    assert (same.returncode, same.stdout) == (0, "no difference\n")
    # The filter's own record, and those of the sweeps, which filter too.
    for record in (copy.folder / "results/other/records").rglob("*.json"):
        content = json.loads(record.read_text())
        changed = json.loads(content["provenance"]["vinsar_configuration"])
        if "filtering" in changed:
            changed["filtering"]["goldstein_alpha"] = 0.5
            content["provenance"]["vinsar_configuration"] = json.dumps(changed)
            record.write_text(json.dumps(lineage.signed(content)))
    summary = copy.folder / "results/other/accuracy.json"
    numbers = json.loads(summary.read_text())
    numbers["whole_scene"]["std_error_m"] += 0.01
    summary.write_text(json.dumps(numbers))
    done = copy.ask("diff", "results/tiny", "results/other")
    assert done.returncode == 1
    assert "configuration filtering.goldstein_alpha: 0.8 and 0.5, -0.3" in done.stdout
    assert "accuracy whole_scene.std_error_m:" in done.stdout
    assert "+0.01" in done.stdout


def test_a_folder_without_a_study_is_named(copy):
    (copy.folder / "empty").mkdir()
    done = copy.ask("verify", "empty")
    assert done.returncode == 2
    assert "empty holds no records of a study" in done.stderr
    assert "Traceback" not in done.stderr
