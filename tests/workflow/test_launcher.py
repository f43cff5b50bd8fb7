"""The launcher `run`, in small checkouts of its own: no network, hardly any packages.

Most tests start it with a Python whose modules `venv` and `ensurepip` are quick stand-ins. They
make a real virtual environment, but its pip only notes that it was called and installs a
`snakemake` and a `pytest` which tell how they were started.
"""

import ast
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

LAUNCHER = Path(__file__).resolve().parents[2] / "run"
REAL_PYTHON = Path(sys._base_executable)
WHOLE_SET_UP = ["venv", "ensurepip", "pip"]
OLD = {"PRETENDED_VERSION": "3.9.18"}
PATIENCE = 60.0
ABOUT_A_STEP = ("installed", "settings")

PROGRAM = """\
import json, os, sys
name = __spec__.name if __spec__ else os.path.basename(__file__)
told = {"program": name, "environment": dict(os.environ), "arguments": sys.argv[1:],
        "directory": os.getcwd(), "process": os.getpid(), "path": sys.path, "python": sys.prefix}
print(json.dumps(told))
sys.exit(int(os.environ.get("EXIT_CODE", "0")))
"""

NOTE = """\
import json, os, pathlib, sys, sysconfig, time
def note(step):
    with open(os.environ["STEPS"], "a") as steps:
        steps.write(step + "\\n")
site_packages = pathlib.Path(sysconfig.get_paths()["purelib"])
"""

PIP = f"""\
from stand_in import *
if __name__ == "__main__":
    if sys.argv[1] == "config":
        print(os.environ.get("CONFIG_OF_PIP", ""))
        sys.exit()
    note("pip " + " ".join(sys.argv[1:]))
    settings = dict(item for item in os.environ.items() if item[0].startswith("PIP_"))
    note("settings " + json.dumps(settings))
    mode = os.environ.get("MODE_OF_PIP", "")
    if mode == "fail":
        print("WARNING: the line is dead\\n", flush=True)
        raise ConnectionError("nobody answers")
    while mode not in ("", "elsewhere") and not pathlib.Path(mode).exists():
        time.sleep(0.01)
    if mode != "elsewhere":
        (site_packages / "pytest.py").write_text({PROGRAM!r})
        (site_packages / "snakemake.py").touch()
    note("installed")
"""

ENSUREPIP = f"""\
from stand_in import *
if __name__ == "__main__":
    note("ensurepip")
    (site_packages / "pip.py").write_text({PIP!r})
"""

VENV = f"""\
from stand_in import *
if __name__ == "__main__":
    import runpy, shutil
    note("venv")
    sys.path.remove(os.path.dirname(__file__))
    sys._base_executable = {str(REAL_PYTHON)!r}
    try:
        runpy.run_module("venv", run_name="__main__")
    except SystemExit as end:
        if end.code:
            raise
    for made in pathlib.Path(sys.argv[-1]).glob("lib/python*/site-packages"):
        shutil.copy(site_packages / "sitecustomize.py", made)
"""

SITE_CUSTOMIZE = """\
import os, sys
sys.path.insert(0, {stand_ins!r})
sys._base_executable = sys.executable
if "PRETENDED_VERSION" in os.environ:
    sys.version_info = (*map(int, os.environ["PRETENDED_VERSION"].split(".")), "final", 0)
if "LACKING_MODULE" in os.environ:
    sys.modules[os.environ["LACKING_MODULE"]] = None
"""


@dataclass
class Checkout:
    """A repository of nothing but the launcher and a lock file, and a Python to start it with."""

    root: Path
    python: Path

    @property
    def venv(self) -> Path:
        return self.root / ".venv"

    @property
    def stamp(self) -> Path:
        return self.venv / "vinsar-stamp"

    @property
    def lock(self) -> Path:
        return self.root / "requirements.lock"

    @property
    def steps(self) -> list[str]:
        """The steps of the set-up that have run so far, by name."""
        return [line.split()[0] for line in self.notes if not line.startswith(ABOUT_A_STEP)]

    @property
    def notes(self) -> list[str]:
        notes = self.root / "steps.txt"
        return notes.read_text().splitlines() if notes.exists() else []

    @property
    def launcher(self) -> Path:
        return self.root / "run"

    def start(
        self, *arguments: str, command: tuple = (), cwd: Path | None = None, **environment: str
    ) -> subprocess.Popen[str]:
        """Start the launcher in a process group of its own, as a terminal would."""
        inherited = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PYTHON", "PIP_", "VIRTUAL_ENV"))
        }
        path = os.pathsep.join([str(self.python.parent), os.environ["PATH"]])
        return subprocess.Popen(
            [*(command or (self.launcher,)), *arguments],
            env={**inherited, "PATH": path, "STEPS": str(self.root / "steps.txt"), **environment},
            cwd=cwd or self.root.parent,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def run(self, *arguments: str, **options) -> subprocess.CompletedProcess[str]:
        return finish(self.start(*arguments, **options))


def finish(process: subprocess.Popen) -> subprocess.CompletedProcess[str]:
    with process:
        output, errors = process.communicate(timeout=PATIENCE)
    assert "Traceback" not in errors
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def told(done: subprocess.CompletedProcess[str]) -> dict:
    """What the program which the launcher became tells of itself."""
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def new_checkout(root: Path, python: Path) -> Checkout:
    root.mkdir()
    shutil.copy(LAUNCHER, root)
    (root / "workflow").mkdir()
    (root / "workflow" / "start.py").write_text(PROGRAM)
    (root / "requirements.lock").write_text("# nothing\n")
    return Checkout(root, python)


@pytest.fixture(scope="module")
def quick_python(tmp_path_factory) -> Path:
    """A Python with the stand-ins for `venv` and `ensurepip`."""
    home = tmp_path_factory.mktemp("quick")
    for name, text in (("stand_in", NOTE), ("venv", VENV), ("ensurepip", ENSUREPIP)):
        (home / "stand_ins").mkdir(exist_ok=True)
        (home / "stand_ins" / f"{name}.py").write_text(text)
    subprocess.run([REAL_PYTHON, "-I", "-m", "venv", "--without-pip", home / "python"], check=True)
    (site_packages,) = (home / "python").glob("lib/python*/site-packages")
    text = SITE_CUSTOMIZE.format(stand_ins=str(home / "stand_ins"))
    (site_packages / "sitecustomize.py").write_text(text)
    return home / "python" / "bin" / "python3"


@pytest.fixture
def checkout(tmp_path, quick_python) -> Iterator[Checkout]:
    yield new_checkout(tmp_path / "check out", quick_python)
    # A test that fails halfway leaves a set-up behind which waits for ever.
    for process in psutil.process_iter(["cmdline"]):
        if str(tmp_path) in " ".join(process.info["cmdline"] or ()):
            process.kill()


@pytest.fixture
def ready(checkout) -> Checkout:
    """A checkout whose first start is over; its notes begin anew."""
    assert told(checkout.run())["program"] == "start.py"
    (checkout.root / "steps.txt").unlink()
    return checkout


@pytest.fixture(scope="module")
def lasting(tmp_path_factory, quick_python) -> Checkout:
    """A checkout ready to use, for tests which leave it as it is."""
    checkout = new_checkout(tmp_path_factory.mktemp("lasting") / "checkout", quick_python)
    assert checkout.run().returncode == 0
    assert checkout.steps == WHOLE_SET_UP
    return checkout


@pytest.fixture(scope="module", autouse=True)
def real_start(tmp_path_factory) -> Iterator[tuple[Checkout, subprocess.Popen[str]]]:
    """A first start with the real `venv`, `ensurepip` and pip: seconds, beside the other tests."""
    home = tmp_path_factory.mktemp("real")
    checkout = new_checkout(home / "checkout", REAL_PYTHON)
    (home / "users modules").mkdir()
    for module in ("venv", "pip", "ensurepip", "json"):
        text = "raise SystemExit('the set-up met PYTHONPATH')"
        (home / "users modules" / f"{module}.py").write_text(text)
    with checkout.start("-n", PYTHONPATH=str(home / "users modules")) as process:
        yield checkout, process
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)


def test_old_pythons_can_read_it():
    ast.parse(LAUNCHER.read_text(), feature_version=(3, 6))
    assert os.access(LAUNCHER, os.X_OK)


def test_pip_is_held_to_the_lock(lasting):
    (call,) = [line for line in lasting.notes if line.startswith("pip ")]
    for word in ("install", "--no-deps", "--require-hashes", f"-r {lasting.lock}"):
        assert f" {word}" in call


def test_later_start_sets_nothing_up(lasting):
    before = lasting.stamp.stat()
    done = lasting.run(MODE_OF_PIP="fail")
    assert told(done)["program"] == "start.py"
    assert told(done)["arguments"] == []
    assert done.stderr == ""
    assert lasting.steps == WHOLE_SET_UP
    assert lasting.stamp.stat().st_mtime_ns == before.st_mtime_ns


def test_arguments_reach_snakemake_untouched(lasting, tmp_path):
    arguments = ["--cores", "1", "two words", "*", "", "test", "--", "-h"]
    tells = told(lasting.run(*arguments, cwd=tmp_path))
    assert tells["program"] == "start.py"
    assert tells["arguments"] == arguments
    assert tells["directory"] == str(lasting.root)


def test_test_is_pytest(lasting):
    tells = told(lasting.run("test", "-k", "two words", "test"))
    assert tells["program"] == "pytest"
    assert tells["arguments"] == ["-k", "two words", "test"]
    assert tells["directory"] == str(lasting.root)


def test_what_others_set_for_other_programs_is_left_behind(lasting):
    others = {
        "PYTHONPATH": "/mine", "PYTHONWARNINGS": "error", "PYTHONDONTWRITEBYTECODE": "1",
        "MPLBACKEND": "module://mine",
    }  # fmt: skip
    tells = told(lasting.run(**others))["environment"]
    assert not set(others) & set(tells)
    assert tells["PYTHONUTF8"] == "1"


def test_of_pip_s_settings_only_those_of_where_packages_come_from_count(checkout):
    settings = {
        "global.target": "/elsewhere", "global.index-url": "file:///one", "global.prefix": "/p",
        "install.index-url": "file:///two", "install.root": "/r", ":env:.dry-run": "1",
        ":env:.proxy": "http://localhost:1", "install.find-links": "/a\n/b", "freeze.timeout": "3",
    }  # fmt: skip
    listed = "\n".join(f"{key}={value!r}" for key, value in sorted(settings.items()))
    own = {"PIP_TARGET": "/x", "PIP_PREFIX": "/x", "PIP_DRY_RUN": "1", "PIP_USER": "1"}
    assert told(checkout.run(CONFIG_OF_PIP=listed, **own))["program"] == "start.py"
    (line,) = [line for line in checkout.notes if line.startswith("settings")]
    assert json.loads(line.partition(" ")[2]) == {
        "PIP_CONFIG_FILE": os.devnull,
        "PIP_INDEX_URL": "file:///two",
        "PIP_PROXY": "http://localhost:1",
        "PIP_FIND_LINKS": "/a /b",
    }


def test_what_cannot_be_imported_is_not_said_to_be_ready(checkout):
    checkout.lock.write_text("snakemake==9.27.1\n")
    done = checkout.run(MODE_OF_PIP="elsewhere")
    assert done.returncode == 1
    _, sentence, *lines = done.stderr.splitlines()
    assert "cannot be imported; see that no setting of pip's puts packages elsewhere" in sentence
    assert lines[-1] == "  ModuleNotFoundError: No module named 'snakemake'"
    assert not checkout.stamp.exists()
    assert told(checkout.run())["program"] == "start.py"


def test_exit_code_is_snakemakes(lasting):
    assert lasting.run(EXIT_CODE="7").returncode == 7


def test_snakemake_takes_the_launchers_place(lasting):
    process = lasting.start()
    assert told(finish(process))["process"] == process.pid


def test_called_through_a_link(lasting, tmp_path):
    (tmp_path / "study").symlink_to(lasting.launcher)
    tells = told(lasting.run(command=(tmp_path / "study",)))
    assert tells["directory"] == str(lasting.root)
    assert lasting.steps == WHOLE_SET_UP


def test_old_python_needs_no_successor_once_set_up(lasting, tmp_path):
    done = lasting.run(command=(lasting.python, lasting.launcher), **OLD, PATH=str(tmp_path))
    assert told(done)["program"] == "start.py"
    assert done.stderr == ""


LOCK_WITH_UV = "six==2\nuv==1 \\\n    --hash=sha256:0\nzipp==3\n"

UV = """\
from stand_in import *
note("uv " + " ".join(sys.argv[1:]))
"""


def test_uv_installs_the_lock_that_names_it(ready):
    (site_packages,) = ready.venv.glob("lib/python*/site-packages")
    (site_packages / "uv.py").write_text(UV)
    ready.lock.write_text(LOCK_WITH_UV)
    assert ready.run().returncode == 0
    wheel, uv = (line for line in ready.notes if line.startswith(("pip ", "uv ")))
    (wanted,) = ready.venv.glob("uv-requirements.txt")
    assert wanted.read_text() == "uv==1 \\\n    --hash=sha256:0\n"
    assert wheel.endswith(f"--no-deps --require-hashes -r {wanted}")
    assert uv.startswith("uv pip install")
    assert uv.endswith(f"--no-deps --require-hashes -r {ready.lock}")


@pytest.mark.parametrize(
    ("config", "steps"), [("", 2), ("global.index-url='https://packages.example'", 1)]
)
def test_pip_installs_what_uv_cannot_or_may_not(ready, config, steps):
    ready.lock.write_text(LOCK_WITH_UV)
    assert ready.run(CONFIG_OF_PIP=config).returncode == 0
    assert ready.steps == ["pip"] * steps
    *_, last = (line for line in ready.notes if line.startswith("pip "))
    assert last.endswith(f"--no-deps --require-hashes -r {ready.lock}")


def test_changed_lock_is_installed_into_the_same_environment(ready):
    kept = ready.venv / "kept"
    kept.touch()
    ready.lock.write_text("# something\n")
    assert told(ready.run())["program"] == "start.py"
    assert ready.steps == ["pip"]
    assert kept.exists()
    assert told(ready.run())["program"] == "start.py"
    assert ready.steps == ["pip"]


def lose_stamp(checkout: Checkout) -> None:
    checkout.stamp.unlink()


def lose_interpreter(checkout: Checkout) -> None:
    """Make it as if the Python under .venv had been uninstalled since."""
    gone = checkout.root / "uninstalled"
    for link in (checkout.venv / "bin").glob("python*"):
        link.unlink()
        link.symlink_to(gone)
    stamp = checkout.stamp.read_text()
    assert str(REAL_PYTHON.resolve()) in stamp
    checkout.stamp.write_text(stamp.replace(str(REAL_PYTHON.resolve()), str(gone)))


def change_interpreter(checkout: Checkout) -> None:
    link = checkout.venv / "bin" / "python"
    link.unlink()
    link.symlink_to(shutil.copy(REAL_PYTHON, checkout.root / "other"))


def lose_pip_before_a_new_lock(checkout: Checkout) -> None:
    (pip,) = checkout.venv.glob("lib/python*/site-packages/pip.py")
    pip.unlink()
    checkout.lock.write_text("# something\n")


@pytest.mark.parametrize(
    "damage",
    [
        lose_stamp,
        lose_interpreter,
        change_interpreter,
        lose_pip_before_a_new_lock,
    ],
)
def test_damaged_environment_is_made_anew(ready, damage):
    (ready.venv / "left over").touch()
    damage(ready)
    assert told(ready.run())["python"] == str(ready.venv)
    assert ready.steps == WHOLE_SET_UP
    assert not (ready.venv / "left over").exists()


def test_moved_checkout_is_set_up_anew(ready, tmp_path):
    moved = Checkout(ready.root.rename(tmp_path / "moved"), ready.python)
    tells = told(moved.run())
    assert moved.steps == WHOLE_SET_UP
    assert tells["python"] == str(moved.venv)
    (pth,) = moved.venv.glob("lib/python*/site-packages/vinsar.pth")
    assert pth.read_text() == f"{moved.root / 'src'}\n"


def test_failing_pip_is_one_sentence_and_its_last_lines(checkout):
    done = checkout.run(MODE_OF_PIP="fail")
    assert done.returncode == 1
    assert done.stdout == ""
    _, sentence, *lines = done.stderr.splitlines()
    assert sentence.startswith("vinsar: pip could not install requirements.lock; see that the net")
    assert "start ./run again, which resumes" in sentence
    assert lines[-2:] == ["  WARNING: the line is dead", "  ConnectionError: nobody answers"]
    assert told(checkout.run())["program"] == "start.py"


def test_lock_taken_back_after_a_failed_change_is_installed_again(ready):
    before = ready.lock.read_text()
    ready.lock.write_text("# something\n")
    assert ready.run(MODE_OF_PIP="fail").returncode == 1
    ready.lock.write_text(before)
    assert told(ready.run())["program"] == "start.py"
    assert ready.steps == ["pip", *WHOLE_SET_UP]


def test_old_python_is_one_sentence(checkout, tmp_path):
    done = checkout.run(command=(checkout.python, checkout.launcher), **OLD, PATH=str(tmp_path))
    assert done.returncode == 1
    (sentence,) = done.stderr.splitlines()
    assert "Python 3.11 or newer" in sentence
    assert "3.9.18" in sentence
    assert not checkout.venv.exists()


def test_old_python_hands_over_to_a_newer_one_that_works(checkout, tmp_path):
    newer = {
        "python3.13": "echo no such version >&2; exit 127",
        "python3.12": f'unset PRETENDED_VERSION; echo used >&2; exec "{checkout.python}" "$@"',
        "python3.11": "echo the wrong one >&2; exit 1",
    }
    for name, text in newer.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    done = checkout.run(
        "-n", command=(checkout.python, checkout.launcher), **OLD, PATH=str(tmp_path)
    )
    assert told(done)["arguments"] == ["-n"]
    assert done.stderr.splitlines()[0] == "used"
    assert len(done.stderr.splitlines()) == 2


@pytest.mark.parametrize("module", ["venv", "ensurepip"])
def test_missing_module_is_one_sentence(checkout, module):
    done = checkout.run(LACKING_MODULE=module)
    assert done.returncode == 1
    (sentence,) = done.stderr.splitlines()
    assert f"module {module}" in sentence
    assert "python3-venv" in sentence
    assert not checkout.venv.exists()


def test_failed_writing_says_why(tmp_path):
    checkout = new_checkout(tmp_path / "checkout", REAL_PYTHON)
    done = checkout.run(command=("sh", "-c", 'ulimit -f 100; exec "$0"', checkout.launcher))
    assert done.returncode == 1
    _, sentence, *lines = done.stderr.splitlines()
    assert f"could not make {checkout.venv}" in sentence
    assert "disk is not full" in sentence
    assert "File too large" in lines[-1]


def test_file_in_place_of_the_environment_is_one_sentence(checkout):
    checkout.venv.touch()
    done = checkout.run()
    assert done.returncode == 1
    _, sentence = done.stderr.splitlines()
    assert "Not a directory" in sentence
    assert str(checkout.venv) in sentence


def test_lock_that_is_not_there_is_one_sentence(checkout):
    checkout.lock.unlink()
    done = checkout.run()
    assert done.returncode == 1
    (sentence,) = done.stderr.splitlines()
    assert "requirements.lock" in sentence


def test_interrupted_set_up_is_taken_up_again(checkout, tmp_path):
    process = checkout.start(MODE_OF_PIP=str(tmp_path / "never"))
    wait_until(lambda: "pip" in checkout.steps)
    os.killpg(process.pid, signal.SIGINT)
    done = finish(process)
    assert done.returncode == 130
    assert done.stderr.splitlines()[1:] == ["vinsar: interrupted; the next ./run goes on"]
    assert "installed" not in checkout.notes
    assert told(checkout.run())["program"] == "start.py"
    assert checkout.steps == WHOLE_SET_UP * 2


def test_second_start_waits_for_what_a_killed_first_one_left_running(checkout, tmp_path):
    go_on = tmp_path / "go on"
    first = checkout.start(MODE_OF_PIP=str(go_on))
    wait_until(lambda: "pip" in checkout.steps)
    first.kill()
    assert finish_killed(first) == -signal.SIGKILL
    second = checkout.start()
    assert "setting up" in second.stderr.readline()
    time.sleep(0.1)
    assert checkout.steps == WHOLE_SET_UP
    go_on.touch()
    assert told(finish(second))["program"] == "start.py"
    ends = [line.split()[0] for line in checkout.notes if not line.startswith("settings")]
    assert ends == [*WHOLE_SET_UP, "installed"] * 2


def finish_killed(process: subprocess.Popen) -> int:
    """Wait for the launcher alone: what it started still holds its output open."""
    with process:
        return process.wait(PATIENCE)


def test_two_first_starts_set_up_once(checkout, tmp_path):
    go_on = tmp_path / "go on"
    both = [checkout.start(MODE_OF_PIP=str(go_on)) for _ in range(2)]
    for process in both:
        assert "setting up" in process.stderr.readline()
    wait_until(lambda: "pip" in checkout.steps)
    go_on.touch()
    for process in both:
        assert told(finish(process))["program"] == "start.py"
    assert checkout.steps == WHOLE_SET_UP


def test_first_start_with_the_real_venv_and_pip(real_start):
    checkout, process = real_start
    done = finish(process)
    tells = told(done)
    assert tells["arguments"] == ["-n"]
    assert tells["python"] == str(checkout.venv)
    assert str(checkout.root.parent / "users modules") not in tells["path"]
    (pth,) = checkout.venv.glob("lib/python*/site-packages/vinsar.pth")
    assert pth.read_text() == f"{checkout.root / 'src'}\n"
    assert done.stderr.splitlines() == ["vinsar: setting up .venv (about a minute, once) ..."]
    assert (checkout.venv / "bin" / "pip").exists()
    assert checkout.stamp.exists()
