"""A copy of the repository with a tiny study, run once for all tests of the workflow."""

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import NamedTemporaryFile

import pytest

ROOT = Path(__file__).parents[2]
FILES = ("Snakefile", "run", "requirements.lock", "CITATION.cff", "LICENSE")


@pytest.fixture(scope="session", autouse=True)
def _forks():
    """Start the process that checkouts' commands fork from."""
    command = [sys.executable, "-P", Path(__file__).with_name("forks.py")]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **pipes) as Checkout.forks:
        yield


class Checkout:
    """A copy of the repository in which Snakemake runs."""

    forks: subprocess.Popen[str]

    def __init__(self, folder: Path) -> None:
        self.folder, self.results = folder, folder / "results/tiny"

    @classmethod
    def new(cls, folder: Path) -> "Checkout":
        """Return one in which nothing has run."""
        # With __pycache__: kernels that the tests before have compiled serve here as well.
        for name in ("src", "workflow", "config", "profiles", "docs"):
            shutil.copytree(ROOT / name, folder / name)
        for name in (*FILES, "tests/workflow/tiny.yaml"):
            shutil.copy(ROOT / name, folder)
        return cls(folder)

    def copy(self, folder: Path) -> "Checkout":
        """Return a copy with its results, to be asked and to be spoilt."""
        # With what Snakemake knows of the results, or it would make them again.
        ignored = shutil.ignore_patterns("log", "locks", "running", "scripts")
        shutil.copytree(self.folder, folder, ignore=lambda place, names: (
            ignored(place, names) if place.endswith(".snakemake") else ()
        ))  # fmt: skip
        return Checkout(folder)

    def snakemake(self, *arguments: str, extra: str = "") -> subprocess.CompletedProcess[str]:
        files = ["tiny.yaml"]
        if extra:
            (self.folder / "extra.yaml").write_text(extra)
            files.append("extra.yaml")
        return self._run("workflow/start.py", "--configfile", *files, "--nocolor", *arguments)

    def ask(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command of ours on results, such as ``verify``."""
        return self._run("vinsar", *arguments)

    def _run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a script or a module as Python would with PYTHONPATH set to this checkout's src."""
        source = str(self.folder / "src")
        told = {
            "command": command,
            "folder": str(self.folder),
            "source": source,
            "environment": os.environ | {"PYTHONPATH": source},
        }
        with NamedTemporaryFile("w+") as output, NamedTemporaryFile("w+") as errors:
            told["files"] = [output.name, errors.name]
            self.forks.stdin.write(json.dumps(told) + "\n")
            self.forks.stdin.flush()
            code = int(self.forks.stdout.readline())
            return subprocess.CompletedProcess(command, code, output.read(), errors.read())

    def would_run(self, extra: str = "") -> set[str]:
        """Return the rules that a dry run names."""
        done = self.snakemake("-n", extra=extra)
        assert done.returncode == 0, done.stderr
        if "Nothing to be done" in done.stdout + done.stderr:
            return set()
        table = re.search(r"^job +count\n-.*?\n(.*?)^total", done.stdout, re.MULTILINE | re.DOTALL)
        assert table, done.stdout
        return {line.split()[0] for line in table[1].splitlines()} - {"all"}


@pytest.fixture(scope="session")
def checkout(tmp_path_factory):
    """A checkout whose study has been run once; tests leave it as they found it."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        # The folder that all workers share: whichever comes first runs the study.
        folder = folder.parent
    finished = Checkout(folder / "finished")
    with (folder / "finished.lock").open("w") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        if not finished.folder.exists():
            made = Checkout.new(tmp_path_factory.mktemp("checkout"))
            done = made.snakemake()
            assert done.returncode == 0, done.stdout + done.stderr
            made.folder.rename(finished.folder)
    return finished.copy(tmp_path_factory.mktemp("copies") / "checkout")


@pytest.fixture(scope="session")
def new_checkout(tmp_path_factory):
    """Make a checkout in which nothing has run."""
    return lambda: Checkout.new(tmp_path_factory.mktemp("checkout"))


@pytest.fixture
def copy(checkout, tmp_path):
    """A copy of the finished study for one test."""
    return checkout.copy(tmp_path / "copy")


@pytest.fixture(scope="module")
def lasting_copy(checkout, tmp_path_factory):
    """A copy of the finished study for a module's tests, which leave it as they found it."""
    return checkout.copy(tmp_path_factory.mktemp("copies") / "copy")
