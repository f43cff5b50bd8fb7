import hashlib
import json
import subprocess

import pytest

from vinsar.results import provenance
from vinsar.study import pipeline


def names(*modules):
    return {path.stem for path in provenance.sources_of(*modules)}


def test_sources_follow_imports_inside_functions():
    assert {"visibility", "scene", "fan", "blocks"} <= names("simulation.visibility")


def test_sources_leave_out_what_is_not_imported():
    assert not {"echo", "scene", "visibility", "focusing", "height"} & names("processing.filtering")


def test_imports_for_type_checkers_do_not_count():
    # Figures know the pipeline's types, but run none of its code.
    assert not {"pipeline", "echo", "unwrapping"} & names("figures")


def test_the_processing_runs_no_code_that_knows_the_scene():
    for stage in ("profiles", "images", "interferogram", "filtered", "unwrapped", "dem"):
        assert not {"scene", "visibility", "echo", "accuracy"} & names(
            pipeline.STAGES[stage].module
        )


def test_an_unknown_module_is_named():
    with pytest.raises(ValueError, match="no module 'filterign'"):
        provenance.sources_of("filterign")


def test_sha256_is_that_of_the_bytes(tmp_path):
    (tmp_path / "a").write_bytes(b"radar")
    assert provenance.sha256(tmp_path / "a") == hashlib.sha256(b"radar").hexdigest()


def test_the_code_digest_tells_content_and_name_but_not_folder(tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.py").write_text("x = 1\n")
    one, two = ([tmp_path / folder / "a.py"] for folder in ("one", "two"))
    assert provenance.code_digest(one) == provenance.code_digest(two)
    two[0].write_text("x = 2\n")
    assert provenance.code_digest(one) != provenance.code_digest(two)


def test_a_description_tells_inputs_configuration_and_versions(tmp_path):
    source = tmp_path / "in.nc"
    source.write_bytes(b"1")
    found = provenance.describe(
        study="s", stage="dem", configuration={"b": 1, "a": 2}, inputs={"images": source}, code=[]
    )
    assert json.loads(found["vinsar_inputs"]) == {"images": provenance.sha256(source)}
    assert found["vinsar_configuration"] == '{"a": 2, "b": 1}'
    assert set(json.loads(found["vinsar_libraries"])) >= {"numpy", "scipy", "numba", "xarray"}
    assert str(tmp_path) not in json.dumps(found)


@pytest.fixture
def commit(tmp_path, monkeypatch):
    """Return a function that tells the commit of a package, and the package's repository."""
    for who in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{who}_NAME", "test")
        monkeypatch.setenv(f"GIT_{who}_EMAIL", "test@localhost")

    def repository(folder):
        package = folder / "src" / "vinsar"
        package.mkdir(parents=True)
        (package / "__init__.py").touch()
        for arguments in (("init", "--quiet"), ("add", "--all"), ("commit", "--quiet", "-m", "x")):
            subprocess.run(["git", *arguments], cwd=folder, check=True)
        return package

    def tell(package):
        monkeypatch.setattr(provenance, "_PACKAGE", package)
        monkeypatch.setattr(provenance.git, "__kwdefaults__", {"cwd": package})
        return provenance.commit.__wrapped__()

    return tell, repository(tmp_path / "ours")


def head(package):
    command = ["git", "rev-parse", "--short=12", "HEAD"]
    return subprocess.run(command, cwd=package, check=True, capture_output=True, text=True).stdout[
        :-1
    ]


def test_the_commit_is_that_of_the_source(commit):
    tell, package = commit
    assert tell(package) == head(package)
    (package / "__init__.py").write_text("changed = 1")
    assert tell(package) == f"{head(package)}-dirty"


@pytest.mark.parametrize("place", ["inside", ".", "src"])
def test_an_archive_inside_another_repository_has_no_commit(commit, tmp_path, place):
    tell, other = commit
    package = other.parents[1] / place / "src" / "vinsar2"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    assert tell(package) == "unknown"
    assert tell(tmp_path) == "unknown"


@pytest.mark.parametrize(
    "name", ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_CEILING_DIRECTORIES"]
)
def test_a_repository_that_the_environment_names_is_not_ours(commit, tmp_path, monkeypatch, name):
    tell, package = commit
    expected = head(package)
    monkeypatch.setenv(name, str(tmp_path / "elsewhere"))
    assert tell(package) == expected
