"""The finished tiny study as an RO-Crate, held against the profiles without any network."""

import io
import json
import shutil
import warnings
import zipfile
from pathlib import Path

import pytest
import requests
import requests_cache
import rocrate
from urllib3 import HTTPResponse

import vinsar
from vinsar.results import lineage, provenance

ROOT = Path(__file__).parents[2]
CONFIG = ("--configfile", "tiny.yaml")
CONTEXT_1_1 = "https://w3id.org/ro/crate/1.1/context"
# What RO-Crate 1.3, whose context the library brings along, names otherwise than 1.1 does.
NAMED_OTHERWISE = {
    "ComputationalWorkflow": "https://bioschemas.org/ComputationalWorkflow",
    "FormalParameter": "https://bioschemas.org/FormalParameter",
    "input": "https://bioschemas.org/ComputationalWorkflow#input",
    "output": "https://bioschemas.org/ComputationalWorkflow#output",
}


@pytest.fixture(scope="module")
def context():
    path = Path(rocrate.__file__).parent / "data/ro-crate.jsonld"
    document = json.loads(path.read_text(encoding="utf-8"))
    document["@context"] |= NAMED_OTHERWISE
    return document


class Shelf(requests.adapters.BaseAdapter):
    """Answers with one document instead of asking the network."""

    def __init__(self, document):
        super().__init__()
        self.content = json.dumps(document).encode()

    def send(self, request, **_):
        answer = requests.Response()
        answer.status_code, answer.url, answer.request = 200, request.url, request
        answer.headers["Content-Type"] = "application/ld+json"
        answer.raw = HTTPResponse(
            io.BytesIO(self.content), headers=answer.headers, status=200, preload_content=False
        )
        return answer

    def close(self):
        pass


@pytest.fixture(scope="module")
def issues(context, tmp_path_factory):
    """Return what the validator finds, and for which profiles; it has the context in its cache."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from rocrate_validator import models, services
    cache = tmp_path_factory.mktemp("cache") / "http"
    with requests_cache.CachedSession(str(cache), expire_after=-1) as session:
        session.mount(CONTEXT_1_1, Shelf(context))
        session.get(CONTEXT_1_1)

    def validate(folder):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = services.validate(
                services.ValidationSettings(
                    rocrate_uri=folder,
                    profile_identifier="provenance-run-crate-0.5",
                    requirement_severity=models.Severity.REQUIRED,
                    offline=True,
                    cache_path=cache,
                )
            )
        assert result.passed() == (not result.get_issues())
        checked = {check.requirement.profile.identifier for check in result.executed_checks}
        return [issue.message for issue in result.get_issues()], checked

    return validate


@pytest.fixture(scope="module")
def crate(lasting_copy):
    """The study's folder once it is a crate."""
    done = lasting_copy.ask("crate", "results/tiny", *CONFIG, "--agent", "Jane Doe")
    assert done.returncode == 0, done.stderr
    assert "results/tiny.crate.zip" in done.stdout
    return lasting_copy.results


@pytest.fixture(scope="module")
def entities(crate):
    graph = json.loads((crate / "ro-crate-metadata.json").read_text(encoding="utf-8"))["@graph"]
    return {entity["@id"]: entity for entity in graph}


def references(value):
    """What a property refers to, be it one or many."""
    return [one["@id"] for one in (value if isinstance(value, list) else [value]) if one]


def test_the_archive_keeps_to_the_profiles(crate, issues):
    found, checked = issues(crate.with_name("tiny.crate.zip"))
    assert found == []
    # The profile stands on the others, and their checks are made with its own.
    assert checked >= {"ro-crate-1.1", "process-run-crate-0.5", "workflow-run-crate-0.5",
                       "provenance-run-crate-0.5"}  # fmt: skip


def test_a_broken_crate_is_found_out(crate, issues, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(crate, broken)
    (broken / "dem.nc").unlink()
    path = broken / "ro-crate-metadata.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    for entity in document["@graph"]:
        if entity["@id"] in ("#job/images", "#organization"):
            del entity["instrument"]
        if entity["@id"] == "#parameter/dem.nc":
            del entity["additionalType"]
    path.write_text(json.dumps(document), encoding="utf-8")
    found = " | ".join(issues(broken)[0])
    for words in (
        "does not include the Data Entity 'dem.nc'",
        "The Action MUST have an instrument property",
        "An OrganizeAction must reference an entity representing the workflow engine",
        "FormalParameter MUST have an additionalType",
    ):
        assert words in found


def test_every_term_is_one_of_the_context(entities, context):
    kinds = {kind for entity in entities.values() for kind in _as_list(entity["@type"])}
    keys = {key for entity in entities.values() for key in entity if key[0] != "@"}
    assert kinds | keys <= set(context["@context"])


def _as_list(value):
    return value if isinstance(value, list) else [value]


def test_every_job_tells_inputs_outputs_times_and_software(crate, entities):
    records = lineage.read_records(crate)
    for name, record in records.items():
        job = entities[f"#job/{record['job'].replace(' ', '/')}"]
        assert name in references(job["result"])
        assert set(record["inputs"].values()) <= set(references(job["object"]))
        assert (job["startTime"], job["endTime"]) <= (record["started"], record["ended"])
        assert references(job["agent"]) == ["#agent"]
        tool = entities[references(job["instrument"])[0]]
        code = {f"source/{path}" for path in json.loads(record["provenance"]["vinsar_code"])}
        assert code <= set(references(tool["hasPart"]))
        assert entities[name]["sha256"] == record["sha256"]
        assert entities[name]["contentSize"] == str((crate / name).stat().st_size)
    assert entities["#job/sweep/snr"]["result"] == {"@id": "sweeps/snr.nc"}
    assert entities["#value/radar.baseline_m"]["value"] == 0.3
    assert "#value/radar.baseline_m" in references(entities["#job/trajectory"]["object"])
    assert "#value/radar.baseline_m" not in references(entities["#job/terrain"]["object"])
    assert set(references(entities["#run"]["result"])) == set(records)
    numpy = json.loads(records["dem.nc"]["provenance"]["vinsar_libraries"])["numpy"]
    assert entities["#software/numpy"]["softwareVersion"] == numpy


def test_the_sources_are_those_that_ran(crate, entities):
    for record in lineage.read_records(crate).values():
        for path, digest in json.loads(record["provenance"]["vinsar_code"]).items():
            assert provenance.sha256(crate / "source" / path) == digest
            assert entities[f"source/{path}"]["sha256"] == digest


def test_the_crate_s_configuration_is_the_study_s(crate):
    defaults = crate / "source/config/paper.yaml"
    study = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    assert vinsar.load(defaults, crate / "configuration.yaml") == study


def test_the_archive_is_the_folder_and_the_same_bytes_again(crate, lasting_copy):
    archive = crate.with_name("tiny.crate.zip")
    first = archive.read_bytes()
    with zipfile.ZipFile(archive) as file:
        packed = {name: file.read(name) for name in file.namelist() if name[-1] != "/"}
    there = {path for path in crate.rglob("*") if path.is_file()}
    assert set(packed) == {path.relative_to(crate).as_posix() for path in there}
    assert all((crate / name).read_bytes() == content for name, content in packed.items())
    done = lasting_copy.ask("crate", "results/tiny", *CONFIG, "--agent", "Jane Doe")
    assert done.returncode == 0, done.stderr
    assert archive.read_bytes() == first


def test_a_study_that_is_not_whole_is_refused_in_a_sentence(copy):
    dem = copy.results / "dem.nc"
    content = dem.read_bytes()
    dem.write_bytes(content[:-1] + b"!")
    done = copy.ask("crate", "results/tiny", *CONFIG)
    assert done.returncode == 2
    assert "results/tiny is not as its study left it (dem.nc: modified by hand" in done.stderr
    dem.write_bytes(content)
    for folder in (copy.results, copy.results / "records"):
        for path in folder.glob("figures/fig4.*"):
            path.unlink()
    done = copy.ask("crate", "results/tiny", *CONFIG)
    assert done.returncode == 2
    assert (
        "results/tiny lacks figures/fig4.pdf, figures/fig4.png, figures/fig4.svg: the study"
        in done.stderr
    )
    done = copy.ask("crate", "results/none", *CONFIG)
    assert done.returncode == 2
    assert "results/none holds no records of a study; run it first" in done.stderr
    assert not (copy.results / "ro-crate-metadata.json").exists()
    assert not list((copy.folder / "results").glob("*.zip"))
