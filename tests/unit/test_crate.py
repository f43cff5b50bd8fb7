import json
import zipfile
from pathlib import Path

import netCDF4
import pytest

import vinsar
from vinsar.results import crate, lineage, provenance

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A finished study of next to nothing, made from the user's heights."""
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
        attributes = {
            "source": "vinsar",
            "vinsar_stage": name,
            "vinsar_commit": "unknown",
            "vinsar_configuration": "{}",
            "vinsar_code": "{}",
            "vinsar_inputs": json.dumps({source.stem: provenance.sha256(source)}),
            "vinsar_libraries": "{}",
        }
        if name.endswith(".nc"):
            with netCDF4.Dataset(made / name, "w") as file:
                file.setncatts(attributes)
        else:
            (made / name).write_bytes(name.encode())
        lineage.write_record(
            made / name,
            folder=made,
            attributes=attributes,
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
    whole = vinsar.load()
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


def edit(folder, name, **changes):
    """Edit a record so that nobody sees it."""
    path = folder / lineage.RECORDS / f"{name}.json"
    record = json.loads(path.read_text())
    path.write_text(json.dumps(lineage.signed(record | changes)))


@pytest.mark.parametrize("key", ["heights", "another"])
@pytest.mark.parametrize("depth", range(2, 9, 3))
def test_what_a_record_names_and_no_result_declares_is_not_packed(folder, study, key, depth):
    own = lineage.read_records(folder)["elevation.nc"]["inputs"]
    edit(folder, "elevation.nc", inputs=own | {key: "../" * depth + "etc/hostname"})
    with pytest.raises(ValueError, match="etc/hostname"):
        crate.write(folder, study)
    assert not (folder / "source").exists()


def test_an_absolute_path_in_a_record_is_not_packed(folder, study):
    edit(folder, "accuracy.json", inputs={"elevation": "/etc/hostname"})
    with pytest.raises(ValueError, match="/etc/hostname"):
        crate.write(folder, study)


@pytest.mark.parametrize("name", ["figures", "logs/old.log", "note.md", "source"])
def test_a_link_that_leads_out_of_the_study_is_refused(folder, study, tmp_path, name):
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret/key").write_text("secret")
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).symlink_to(tmp_path / "secret")
    with pytest.raises(ValueError, match=f"{name} is a link that leads out of the study"):
        crate.write(folder, study)
    assert sorted(path.name for path in (tmp_path / "secret").iterdir()) == ["key"]


def test_sources_are_not_written_through_a_link_within_the_study(folder, study):
    (folder / "kept").mkdir()
    (folder / "source").symlink_to("kept")
    with pytest.raises(ValueError, match="source is a link"):
        crate.write(folder, study)
    assert not list((folder / "kept").iterdir())


def test_a_link_that_stays_in_the_study_is_packed(folder, study):
    (folder / "note.md").write_text("note")
    (folder / "same.md").symlink_to("note.md")
    with zipfile.ZipFile(crate.write(folder, study)) as file:
        assert file.read("same.md") == b"note"
