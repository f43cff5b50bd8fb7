"""What ./run does before and after Snakemake: refusals, and the check of what is left."""

import importlib.util
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import netCDF4
import pytest
import yte
from snakemake.utils import format as formatted

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def start():
    """The script, which is not in the package."""
    spec = importlib.util.spec_from_file_location("start", ROOT / "workflow/start.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def place(new_checkout):
    """A checkout in which nothing ever runs."""
    return new_checkout()


@pytest.fixture
def refusal(start, place, monkeypatch):
    """Return why arguments are refused before Snakemake begins."""
    monkeypatch.chdir(place.folder)
    monkeypatch.setattr(yte, "process_yaml", yte.process_yaml)
    monkeypatch.setattr(start.cli, "args_to_api", lambda *_: pytest.fail("Snakemake begins"))

    def refuse(*arguments):
        with pytest.raises(SystemExit) as end:
            start.main(["--nocolor", *arguments])
        sentence = str(end.value)
        assert sentence.startswith("vinsar: ")
        assert "\n" not in sentence
        return sentence

    return refuse


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("--configfile a.yaml results/a/dem.nc", "--configfile a.yaml -- results/a/dem.nc"),
        ("--configfile a.yaml b.yaml report -n", "--configfile a.yaml b.yaml -n -- report"),
        ("--configfiles a.yaml results/a/x.json", "--configfiles a.yaml -- results/a/x.json"),
        ("--configfile ../a.json report", "--configfile ../a.json -- report"),
        ("--configfile a report", "--configfile a -- report"),
        ("report --configfile a.yaml", "report --configfile a.yaml"),
        ("--configfile=a.yaml report", "--configfile=a.yaml report"),
        ("--config a=1 b=2 report", "--config a=1 b=2 -- report"),
        ("-C a=1 report -- dem", "-C a=1 -- report dem"),
        ("--configfile a.yaml -- report", "--configfile a.yaml -- report"),
        ("-n", "-n"),
        ("", ""),
    ],
)
def test_targets_may_stand_behind_a_configuration(start, given, expected):
    assert start.targets_last(given.split()) == expected.split()


CODE = """__use_yte__: true
__definitions__:
  - open("ran", "w").close()
study: ran
"""


def in_a_profile(place):
    (place.folder / "mine").mkdir(exist_ok=True)
    (place.folder / "mine/config.yaml").write_text(CODE.replace("study: ran", "cores: 1"))


WAYS = {
    "an option": ("--configfile", "code.yaml"),
    "an option with its value": ("--configfile=code.yaml",),
    "behind another": ("--configfile", "tiny.yaml", "code.yaml"),
    "a value": ("--config", "__use_yte__=true", "study=a"),
    "a profile": ("--profile", "mine"),
    "a profile of the workflow": ("--workflow-profile", "mine"),
    "a file that a profile names": ("--profile", "naming"),
    "a file without an end": ("--configfile", "code"),
}


@pytest.mark.parametrize("way", WAYS)
def test_no_way_of_giving_a_configuration_runs_code(place, refusal, way):
    for name in ("code.yaml", "code"):
        (place.folder / name).write_text(CODE)
    in_a_profile(place)
    (place.folder / "naming").mkdir(exist_ok=True)
    (place.folder / "naming/config.yaml").write_text("configfile: code.yaml\ncores: 1\n")
    assert "__use_yte__ would run" in refusal("-n", *WAYS[way])
    assert not (place.folder / "ran").exists()


def test_the_study_s_own_defaults_run_no_code_either(place, tmp_path):
    shutil.copytree(place.folder, tmp_path / "copy")
    paper = tmp_path / "copy/config/paper.yaml"
    paper.write_text(CODE.replace("study: ran\n", "") + paper.read_text())
    command = [sys.executable, "-P", "workflow/start.py", "-n"]
    done = subprocess.run(
        command, cwd=tmp_path / "copy", capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(tmp_path / "copy/src")},
    )  # fmt: skip
    assert done.returncode == 1
    assert "__use_yte__ would run" in done.stderr
    assert not (tmp_path / "copy/ran").exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("radar: {baseline_m: 0.2}\n", "mine.yaml: it does not name its study (study: ...)"),
        ("study: mine\nseed: 1\nseed: 2\n", "mine.yaml, line 3, column 1: the key 'seed'"),
        ("study: mine\nseed: 0401\n", "mine.yaml, line 2, column 7: '0401' is"),
        ("study: mine\n\tseed: 1\n", "mine.yaml, line 2, column 1: "),
    ],
)
def test_a_wrong_file_is_one_sentence(place, refusal, content, words):
    (place.folder / "mine.yaml").write_text(content)
    assert words in refusal("-n", "--configfile", "mine.yaml")


def test_a_file_that_is_not_there_is_one_sentence(refusal):
    assert "configuration typo.yaml: there is no such file" in refusal("--configfile", "typo.yaml")


def test_a_value_alone_does_not_change_the_paper_s_study(refusal):
    assert "--config does not name its study" in refusal("-n", "--config", "seed=3")


def test_what_does_not_hold_is_made_again_and_named(copy):
    results = copy.results
    names = ("dem.nc", "accuracy.nc", "accuracy.json", "focus.nc")
    before = {name: (results / name).read_bytes() for name in names}
    with netCDF4.Dataset(results / "dem.nc", "a") as file:
        file["height"][:] = file["height"][:] + 1
    # Other bytes of the same time, which Snakemake does not see.
    spoilt = results / "focus.nc"
    told = spoilt.stat()
    spoilt.write_bytes(before["focus.nc"][:-1] + b"!")
    os.utime(spoilt, ns=(told.st_atime_ns, told.st_mtime_ns))
    for arguments in (("-n",), ()):
        done = copy.snakemake(*arguments, "accuracy_summary", "focus")
        assert done.returncode == 0, done.stderr
        for name in ("dem.nc", "focus.nc"):
            told = f"vinsar: results/tiny/{name} does not hold: modified by hand"
            assert told in done.stderr, done.stderr
    assert {name: (results / name).read_bytes() for name in names} == before


def test_an_intermediate_that_nothing_asks_for_is_missed(copy):
    lost = copy.results / "sweeps/snr.nc"
    before = lost.read_bytes()
    lost.unlink()
    assert "sweep" in copy.would_run()
    # Not even where the target is a figure that is there.
    done = copy.snakemake("figure_snr")
    assert done.returncode == 0, done.stderr
    assert "vinsar: results/tiny/sweeps/snr.nc does not hold: missing" in done.stderr
    assert lost.read_bytes() == before


def test_an_edit_of_the_code_during_a_job_leaves_no_result_of_it(copy):
    script = copy.folder / "workflow/scripts/stage.py"
    text = script.read_text()
    edit = "    open(__file__, 'a').write('# edited')\n"
    script.write_text(text.replace("    product = ", f"{edit}    product = "))
    done = copy.snakemake("trajectory")
    assert done.returncode == 1
    assert "workflow/scripts/stage.py changed while this ran; start ./run again" in done.stderr
    assert not (copy.results / "trajectory.nc").exists()


TELL = """
import psutil
with open("started.txt", "a") as told:
    told.write(f"{snakemake.rule} {' '.join(psutil.Process().parent().cmdline())}\\n")
with open("src/vinsar/report/content.py", "a") as library:
    library.write("# edited\\n")
"""


def test_jobs_fork_until_the_library_is_edited(copy):
    script = copy.folder / "workflow/scripts/stage.py"
    script.write_text(script.read_text() + TELL)
    # The second is made from the first.
    done = copy.snakemake("true_trajectory")
    assert done.returncode == 0, done.stderr
    first, second = (copy.folder / "started.txt").read_text().splitlines()
    assert first.startswith("trajectory ")
    assert second.startswith("true_trajectory ")
    assert "multiprocessing.forkserver" in first
    assert "multiprocessing.forkserver" not in second


def test_the_path_of_python_is_quoted(start, monkeypatch):
    told = []
    monkeypatch.setattr(
        start.PythonScript,
        "_execute_cmd",
        lambda _, *command, **given: told.append((command, given)),
    )
    start.quote_interpreter()
    python, script = """/Jane's "study"/$HOME/python""", "a b.py"
    start.PythonScript._execute_cmd(None, "{py_exec} {fname:q}", py_exec=python, fname=script)
    ((command,), given) = told[0]
    assert shlex.split(formatted(command, **given)) == [python, script]


def test_it_runs_in_a_folder_of_any_name(new_checkout, tmp_path):
    place = new_checkout()
    home = tmp_path / "my study/it's/a{b}c"
    home.mkdir(parents=True)
    moved = place.folder.rename(home / 'OneDrive - "X" $HOME')
    # Snakemake starts each job by the path of its Python.
    venv = moved / "venv"
    venv.symlink_to(sys.prefix)
    far = tmp_path / ("long" * 25)
    far.mkdir()
    # Each way of starting a job: sockets cannot have the longer path, and then none forks.
    for rule, temporary in (("trajectory", far), ("terrain", tmp_path)):
        done = subprocess.run(
            [venv / "bin/python", "-P", "workflow/start.py", "--nocolor", "--configfile",
             "tiny.yaml", f"results/tiny/{rule}.nc"],
            cwd=moved, capture_output=True, text=True, check=False,
            env=os.environ | {"PYTHONPATH": str(moved / "src"), "TMPDIR": str(temporary)},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        record = json.loads((moved / f"results/tiny/records/{rule}.nc.json").read_text())
        assert record["rule"] == rule
