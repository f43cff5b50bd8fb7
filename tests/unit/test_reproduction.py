import json
from pathlib import Path

import pytest

from vinsar.results import lineage, reproduction

ROOT = Path(__file__).parents[2]


@pytest.fixture
def study(tmp_path, monkeypatch):
    """Make a study's folder of two results, and stand in for the run that makes them afresh."""

    def make(*, commits=("unknown", "unknown"), fresh=(b"dem", b"images"), threads=2):
        folder = tmp_path / "results/small"
        folder.mkdir(parents=True)
        for name, commit in zip(("dem", "images"), commits, strict=True):
            (folder / f"{name}.nc").write_bytes(name.encode())
            write_record(folder, name, commit, threads)

        def run(place, targets, _, cores):
            assert targets == ["results/small/dem.nc", "results/small/images.nc"]
            again = place / "results/small"
            again.mkdir(parents=True)
            for name, content in zip(("dem", "images"), fresh, strict=True):
                (again / f"{name}.nc").write_bytes(content)
                write_record(again, name, "unknown", cores)

        monkeypatch.chdir(ROOT)
        monkeypatch.setattr(reproduction, "_run", run)
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
        (tmp_path / "temporary").mkdir()
        return folder

    return make


def write_record(folder, name, commit, threads, suffix="nc"):
    lineage.write_record(
        folder / f"{name}.{suffix}",
        folder=folder,
        attributes={
            "vinsar_stage": name,
            "vinsar_commit": commit,
            "vinsar_configuration": "{}",
            "vinsar_code": "{}",
            "vinsar_libraries": json.dumps({"threads": threads}),
        },
        started=0.0,
        seconds=1.0,
        rule=name,
        job=name,
        threads=threads,
        inputs={},
    )


def test_the_same_bytes_are_told_and_the_fresh_run_goes(study, tmp_path):
    verdict = reproduction.reproduce(study(), configuration=[])
    assert verdict.compared == ["dem.nc", "images.nc"]
    assert verdict.differing == []
    assert verdict.cores == (2, 1)
    assert list((tmp_path / "temporary").iterdir()) == []


def test_what_differs_is_named_with_reasons_and_the_fresh_run_kept(study):
    verdict = reproduction.reproduce(study(fresh=(b"dem", b"imagES")), configuration=[], cores=3)
    assert verdict.differing == ["images.nc"]
    assert verdict.reasons == ["library threads: 2 and 3"]
    assert (verdict.kept / "images.nc").read_bytes() == b"imagES"


def test_the_report_is_left_out(study):
    folder = study()
    (folder / "report.html").write_text("it took 3 s")
    write_record(folder, "report", "unknown", 2, suffix="html")
    assert reproduction.reproduce(folder, configuration=[]).compared == ["dem.nc", "images.nc"]


def test_a_study_on_one_core_is_run_on_two(study):
    assert reproduction.reproduce(study(threads=1), configuration=[]).cores == (1, 2)


@pytest.mark.parametrize(
    ("commits", "message"),
    [
        (("0123456789ab", "unknown"), r"several commits \(0123456789ab, unknown\)"),
        (("0123-dirty", "0123-dirty"), r"sources that no commit holds \(0123-dirty\)"),
        (("0123456789ab", "0123456789ab"), "commit 0123456789ab cannot be had from here"),
    ],
)
def test_what_cannot_be_reproduced_is_refused(study, monkeypatch, tmp_path, commits, message):
    folder = study(commits=commits)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=message):
        reproduction.reproduce(folder, configuration=[])
    assert list((tmp_path / "temporary").iterdir()) == []


def test_a_changed_study_is_refused(study):
    folder = study()
    (folder / "dem.nc").write_bytes(b"other")
    with pytest.raises(ValueError, match=r"not as its study left it \(dem.nc missing or modified"):
        reproduction.reproduce(folder, configuration=[])


def test_no_cores_are_refused(study):
    with pytest.raises(ValueError, match="on 1 core at least, not on 0"):
        reproduction.reproduce(study(), configuration=[], cores=0)
