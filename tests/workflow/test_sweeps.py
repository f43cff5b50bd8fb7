"""Sweeps as a user runs them, interrupted in every way."""

import importlib.util
import io
import logging
import os
import pty
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).parents[2]
TARGET = "results/tiny/sweeps/quick.nc"
CHECKPOINT = "results/tiny/sweeps/.quick.jsonl"
SWEEP = """
sweeps:
  quick:
    over:
      motion.level_wavelengths: [0.0, 0.1, 0.2, 0.5]
      filtering.goldstein_alpha: [0.2, 0.8]
    realizations: 4
    base: {}
dask: {scheduler: processes, address: null}
"""
CASES = 32
# For machines on which much else runs.
PATIENCE = 300


class Study:
    """A checkout with a sweep."""

    def __init__(self, folder):
        self.folder = folder
        for name in ("workflow", "config", "profiles"):
            shutil.copytree(ROOT / name, folder / name)
        for path in (ROOT / "Snakefile", ROOT / "tests/workflow/tiny.yaml"):
            shutil.copy(path, folder)
        # The library itself and not a copy, whose kernels would have to be compiled again.
        (folder / "src").symlink_to(ROOT / "src")
        self.output = folder / TARGET
        self.checkpoint = folder / CHECKPOINT

    def set(self, sweep):
        (self.folder / "sweep.yaml").write_text(sweep)

    def start(self, *before, **environment):
        """Start as from a terminal: with a process group of its own, and Ctrl-C not ignored."""
        with (self.folder / "out.txt").open("wb") as out:
            return subprocess.Popen(
                [*before, sys.executable, "-P", "workflow/start.py", "--configfile", "tiny.yaml",
                 "sweep.yaml", "--nocolor", "--", TARGET],
                cwd=self.folder,
                env=os.environ | {"PYTHONPATH": str(self.folder / "src")} | environment,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )  # fmt: skip

    def run(self, *before, **environment):
        code = self.start(*before, **environment).wait(timeout=PATIENCE)
        return code, self.said()

    def said(self):
        return (self.folder / "out.txt").read_text()

    def log(self):
        return (self.folder / "results/tiny/logs/sweep_quick.log").read_text()

    def processes(self):
        return [one for one in psutil.process_iter() if str(self.folder) in where(one)]

    def wait_for_blocks(self, process, count):
        until = time.monotonic() + PATIENCE
        while not self.checkpoint.exists() or self.checkpoint.read_bytes().count(b'"code"') < count:
            assert process.poll() is None, self.said()
            assert time.monotonic() < until, self.said()
            time.sleep(0.02)


def where(process):
    """Where a process works, and for whom."""
    try:
        return f"{process.cwd()} {process.cmdline()}"
    except psutil.Error:
        return ""


def gone_within(study, seconds):
    until = time.monotonic() + seconds
    while study.processes():
        if time.monotonic() > until:
            return False
        time.sleep(0.1)
    return True


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The folder with the sweep; each test begins without results."""
    return Study(tmp_path_factory.mktemp("sweeps"))


@pytest.fixture(scope="module")
def uninterrupted(study):
    """The bytes of a run by threads from beginning to end."""
    study.set(SWEEP.replace("processes", "threads"))
    code, said = study.run()
    assert code == 0, said
    assert not study.checkpoint.exists()
    return study.output.read_bytes()


@pytest.fixture
def fresh(study, uninterrupted):
    assert uninterrupted
    shutil.rmtree(study.folder / "results", ignore_errors=True)
    study.set(SWEEP)
    yield study
    for process in study.processes():
        process.kill()


def finished_before(log):
    """How many cases a run found finished."""
    return int(re.search(r"quick: (\d+) of", log)[1])


def test_a_run_after_kill_9_of_snakemake_goes_on(fresh, uninterrupted):
    process = fresh.start()
    fresh.wait_for_blocks(process, 8)
    process.kill()
    process.wait()
    # Without a word to Snakemake, and while what it had started may still be ending.
    fresh.set(SWEEP.replace("processes", "threads"))
    code, said = fresh.run()
    assert code == 0, said
    assert finished_before(fresh.log()) >= 8
    assert fresh.output.read_bytes() == uninterrupted
    assert gone_within(fresh, 60)


def test_ctrl_c_stops_in_seconds_and_the_next_run_goes_on(fresh, uninterrupted):
    process = fresh.start()
    fresh.wait_for_blocks(process, 8)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(timeout=60) != 0
    assert gone_within(fresh, 60)
    assert "the next run goes on" in fresh.log()
    assert "Traceback" not in fresh.said()
    kept = fresh.checkpoint.read_bytes().count(b"point_gain")
    assert 8 <= kept < CASES
    assert not fresh.output.exists()
    fresh.set(SWEEP.replace("processes", "threads"))
    code, said = fresh.run()
    assert code == 0, said
    assert finished_before(fresh.log()) == kept
    assert fresh.output.read_bytes() == uninterrupted


SOLVERS = SWEEP.replace("filtering.goldstein_alpha", "unwrapping.method").replace(
    "[0.2, 0.8]", "[whirlwind, snaphu]"
)


@pytest.mark.skipif(importlib.util.find_spec("snaphu") is not None, reason="snaphu is installed")
def test_failed_cases_are_named_and_only_they_are_computed_after_mending(fresh, tmp_path):
    solver = tmp_path / "snaphu.py"
    path = f"{fresh.folder / 'src'}{os.pathsep}{tmp_path}"
    fresh.set(SOLVERS.replace("processes", "threads"))
    solver.write_text("def unwrap(*_, **__):\n    raise ValueError('no licence')\n")
    code, said = fresh.run(PYTHONPATH=path)
    assert code == 1
    assert "16 of 32 cases of the sweep 'quick' failed" in said
    assert "level_wavelengths = 0.1, unwrapping.method = snaphu, realization 0: ValueError" in said
    assert "Traceback (" not in said
    assert not fresh.output.exists()
    # Mended.
    solver.write_text(
        "import numpy\ndef unwrap(values, *_, **__):\n    return numpy.angle(values), None\n"
    )
    code, said = fresh.run(PYTHONPATH=path)
    assert code == 0, said
    assert finished_before(fresh.log()) == 16


@pytest.mark.skipif(importlib.util.find_spec("snaphu") is not None, reason="snaphu is installed")
def test_a_solver_that_is_not_installed_starts_nothing(fresh):
    fresh.set(SOLVERS)
    code, said = fresh.run()
    assert code == 1
    assert "unwrapping.method = 'snaphu': snaphu is not installed" in said
    assert not (fresh.folder / "results").exists()


def test_a_wrong_sweep_starts_nothing(fresh):
    fresh.set(SWEEP.replace("0.8]", "0.8, 3.0]").replace("[0.0, 0.1", "[0.0, one"))
    code, said = fresh.run()
    assert code == 1
    assert "sweeps.quick at {" in said
    assert "filtering.goldstein_alpha = 3.0: must be less than or equal to 1" in said
    assert "motion.level_wavelengths = 'one': must be a valid number" in said
    assert not (fresh.folder / "results").exists()


def test_an_address_where_nobody_answers_ends_the_run_soon(fresh):
    address = "tcp://127.0.0.1:9"
    code, said = fresh.run(DASK_SCHEDULER_ADDRESS=address)
    assert code == 1
    assert f"no Dask scheduler answers at {address}" in said
    assert "Traceback (" not in said


# A small file system for the sweeps alone, which only this run and the shell around it see.
ON_A_SMALL_DISK = """
mkdir -p results/tiny/sweeps && mount -t tmpfs -o size=$0 none results/tiny/sweeps || exit 99
"$@"
code=$?
ls -A results/tiny/sweeps > left.txt
exit $code
"""


def can_mount():
    trial = ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"]
    return shutil.which("unshare") and not subprocess.call(trial, stderr=subprocess.DEVNULL)


# One page holds some rows and not all; six hold the rows, and not the product beside them.
@pytest.mark.skipif(not can_mount(), reason="no file system can be mounted here")
@pytest.mark.parametrize(
    ("size", "file"), [("4k", r"\.quick\.jsonl: No space left on device"), ("24k", r"quick\.nc")]
)
def test_a_full_disk_is_said_and_leaves_nothing_half_written(fresh, size, file):
    few = SWEEP.replace("realizations: 4", "realizations: 1").replace("processes", "threads")
    fresh.set(few)
    code, said = fresh.run("unshare", "-rm", "sh", "-c", ON_A_SMALL_DISK, size)
    assert code == 1, said
    assert re.search(f"cannot write results/tiny/sweeps/{file}", said), said
    assert "Traceback (" not in said
    assert (fresh.folder / "left.txt").read_text().split() == [".quick.jsonl"]


@pytest.fixture
def progress(monkeypatch):
    """The class of the script, which is not in the package."""
    place = ROOT / "workflow/scripts/progress.py"
    spec = importlib.util.spec_from_file_location("progress", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    clock = iter(range(0, 1000, 4))
    monkeypatch.setattr(module.time, "monotonic", lambda: float(next(clock)))
    return module.Progress


def test_without_a_terminal_the_log_has_lines(progress, monkeypatch, caplog):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with caplog.at_level(logging.INFO), progress("vibration") as tell:
        for done in (40, 50, 60, 70, 80, 100):
            tell(done, 100)
    assert stream.getvalue() == ""
    # Every 12 s, as the clock ticks by 4, and at the end.
    assert caplog.messages == [
        "vibration: 40 of 100 cases",
        "vibration: 70 of 100 cases, 2.5 cases/s, 12 s left",
        "vibration: 100 of 100 cases, 3.0 cases/s, 0 s left",
    ]


def test_on_a_terminal_a_bar_is_drawn(progress, monkeypatch):
    ours, theirs = pty.openpty()
    with os.fdopen(ours, "rb", buffering=0) as screen, os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        with progress("vibration") as tell:
            tell(0, 100)
            tell(50, 100)
        terminal.flush()
        monkeypatch.undo()
        shown = ""
        while not shown.endswith("\r\n"):
            shown += screen.read(4096).decode()
    half = "#" * 15 + "." * 15
    assert f"[{half}] vibration: 50 of 100 cases, 12.5 cases/s, 4 s left" in shown
    assert shown.startswith("\r[" + "." * 30 + "] vibration: 0 of 100 cases\x1b[K\r")
    assert shown.endswith("\r\n")
