import json

import numpy as np
import psutil
import pytest

from vinsar.results import lineage


@pytest.fixture
def study(tmp_path):
    """Make a study's folder with a result a stage, from what each stage was made with."""

    def make(name, stages):
        folder = tmp_path / name
        folder.mkdir()
        for stage, (configuration, code) in stages.items():
            path = folder / f"{stage}.nc"
            path.write_bytes(b"result")
            lineage.write_record(
                path,
                folder=folder,
                attributes={
                    "vinsar_stage": stage,
                    "vinsar_configuration": json.dumps(configuration),
                    "vinsar_code": json.dumps(code),
                    "vinsar_libraries": json.dumps({"numpy": "2.4.0"}),
                },
                started=1.5,
                seconds=2.25,
                rule=stage,
                job=stage,
                threads=2,
                inputs={},
            )
        return folder

    return make


def test_a_record_tells_when_a_job_began_and_ended(study):
    (record,) = lineage.read_records(study("a", {"dem": ({}, {})})).values()
    assert record["started"] == "1970-01-01T00:00:01.500+00:00"
    assert record["ended"] == "1970-01-01T00:00:03.750+00:00"
    assert (record["job"], record["threads"]) == ("dem", 2)


def test_a_record_tells_the_peak_of_memory(study):
    held = np.ones(2**24)
    (record,) = lineage.read_records(study("a", {"dem": ({}, {})})).values()
    # The peak is of the process so far, whatever has been given back since.
    assert record["peak_bytes"] >= psutil.Process().memory_info().rss - 2**20
    assert record["peak_bytes"] > held.nbytes


def test_a_stage_of_other_code_is_found_though_later_stages_agree(study):
    old, new = {"src/vinsar/geometry.py": "1"}, {"src/vinsar/geometry.py": "2"}
    seed = {"seed": 1}
    one = study("one", {"dem": (seed, old), "images": (seed, old), "truth": (seed, old)})
    two = study("two", {"dem": (seed, new), "images": (seed, new), "truth": (seed, old)})
    assert lineage.compare(one, two) == ["code src/vinsar/geometry.py (dem, images) differs"]


def test_what_all_stages_read_is_told_once(study):
    one = study("one", {"dem": ({"seed": 1}, {}), "images": ({"seed": 1}, {})})
    two = study("two", {"dem": ({"seed": 2}, {}), "images": ({"seed": 2}, {})})
    assert lineage.compare(one, two) == ["configuration seed: 1 and 2"]


def test_a_sweep_s_definition_is_told_with_its_name(study):
    one = study("one", {"sweep snr": ({"sweep": {"realizations": 1}}, {})})
    two = study("two", {"sweep snr": ({"sweep": {"realizations": 3}}, {})})
    assert lineage.compare(one, two) == ["configuration sweep.realizations (sweep snr): 1 and 3"]


def test_what_one_study_alone_has_is_told_as_absent(study):
    one = study("one", {"dem": ({"seed": 1}, {})})
    two = study("two", {"dem": ({}, {})})
    assert lineage.compare(one, two) == ["configuration seed: 1 and absent"]


def test_studies_without_a_common_stage_are_compared_by_their_values(study):
    one = study("one", {"dem": ({"seed": 1}, {})})
    assert lineage.compare(one, study("two", {"images": ({"seed": 1}, {})})) == []
    three = study("three", {"images": ({"seed": 2}, {}), "truth": ({"seed": 3}, {})})
    assert lineage.compare(one, three) == ["configuration seed: 1 and 2 or 3"]
