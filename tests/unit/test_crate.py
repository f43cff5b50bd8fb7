import json
import zipfile
from pathlib import Path

import pytest

from vinsar.results import crate, lineage, provenance
from vinsar.study import validation

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A finished study of next to nothing, made from heights of the user's own."""
    # In a repository of its own, so that what lies inside it and outside can be told apart.
    for path in ROOT.iterdir():
        if path.name not in {"results", ".snakemake"}:
            (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "survey").mkdir()
    heights = tmp_path / "survey/heights.tif"
    heights.write_bytes(b"heights")
    made = tmp_path / "results/small"
    made.mkdir(parents=True)
    for name, source in (("elevation.nc", heights), ("accuracy.json", made / "elevation.nc")):
        (made / name).write_bytes(name.encode())
        lineage.write_record(
            made / name,
            folder=made,
            attributes={
                "source": "vinsar",
                "vinsar_stage": name,
                "vinsar_commit": "unknown",
                "vinsar_configuration": "{}",
                "vinsar_code": "{}",
                "vinsar_inputs": json.dumps({source.stem: provenance.sha256(source)}),
                "vinsar_libraries": "{}",
            },
            started=0.0,
            seconds=1.0,
            rule=name.partition(".")[0],
            job=name.partition(".")[0],
            threads=1,
            inputs={source.stem: source},
        )
    return made


@pytest.fixture(scope="module")
def study():
    whole = validation.load(ROOT / "config/paper.yaml")
    outputs = whole.outputs.model_copy(update={"figures": (), "claims": False})
    return whole.model_copy(update={"study": "small", "outputs": outputs})


def described(folder):
    graph = json.loads((folder / crate.METADATA).read_text(encoding="utf-8"))["@graph"]
    return {entity["@id"]: entity for entity in graph}


def test_a_file_of_the_user_s_own_goes_where_the_sources_look_for_it(folder, study):
    archive = crate.write(folder, study)
    place = "source/survey/heights.tif"
    assert (folder / place).read_bytes() == b"heights"
    with zipfile.ZipFile(archive) as file:
        assert place in file.namelist()
    entities = described(folder)
    assert entities["#job/elevation"]["object"] == {"@id": place}
    assert entities["#job/accuracy"]["object"] == {"@id": "elevation.nc"}
    assert entities[place]["sha256"] == provenance.sha256(folder / place)
    assert entities["#step/elevation"]["position"] < entities["#step/accuracy"]["position"]
    # What was copied is no result without a record.
    assert not lineage.troubled(lineage.verify(folder, study))


def test_nobody_is_named_unasked(folder, study):
    crate.write(folder, study)
    assert "agent" not in described(folder)["#run"]
    assert "#agent" not in described(folder)


def test_a_file_of_the_user_s_own_that_has_changed_is_refused(folder, study):
    Path("survey/heights.tif").write_bytes(b"others")
    with pytest.raises(ValueError, match=r"elevation.nc: stale: made from another .*heights\.tif"):
        crate.write(folder, study)
    assert not (folder / crate.METADATA).exists()
