"""A copy of the repository with a tiny study, run once for all tests of the workflow."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = ("Snakefile", "run", "requirements.lock", "CITATION.cff", "LICENSE")


class Checkout:
    """A copy of the repository in which Snakemake runs."""

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
        return subprocess.run(
            [sys.executable, "-P", "workflow/start.py", "--configfile", *files, "--nocolor",
             *arguments],
            cwd=self.folder,
            env=os.environ | {"PYTHONPATH": str(self.folder / "src")},
            capture_output=True,
            text=True,
            check=False,
        )  # fmt: skip

    def ask(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command of ours on results, such as ``verify``."""
        return subprocess.run(
            [sys.executable, "-m", "vinsar", *arguments],
            cwd=self.folder,
            env=os.environ | {"PYTHONPATH": str(self.folder / "src")},
            capture_output=True,
            text=True,
            check=False,
        )

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
