"""Imports go one way; Numba stays in the kernels; the true scene stays out of the processing."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "vinsar"
PROCESSING = "vinsar.processing"
TRUTH = ("vinsar.simulation.", "vinsar.evaluation.")


def module_name(path):
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def imports_of(path):
    """Every module that a file names in an import, wherever the import stands."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path} has a relative import"
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return found


def reached_from(name):
    """The package's modules that a module imports, directly or through others."""
    reached, waiting = set(), [name]
    while waiting:
        for other in imports_of(MODULES[waiting.pop()]) & set(MODULES):
            # The package's own __init__ imports nothing.
            if other not in reached and other != "vinsar":
                reached.add(other)
                waiting.append(other)
    return reached


def test_import_contracts_are_kept():
    command = Path(sys.executable).parent / "lint-imports"
    result = subprocess.run(
        [command, "--no-cache"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(PACKAGE.parent)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("name", MODULES)
def test_only_kernels_import_numba(name):
    uses = any(other.split(".")[0] == "numba" for other in imports_of(MODULES[name]))
    assert not uses or name.startswith("vinsar.kernels.")


def test_kernels_are_looked_at():
    kernels = [name for name in MODULES if name.startswith("vinsar.kernels.")]
    assert len(kernels) >= 3
    numba = {"numba", "vinsar.kernels.compiling"}
    assert all(imports_of(MODULES[name]) & numba for name in kernels)


@pytest.mark.parametrize("name", [name for name in MODULES if name.startswith(f"{PROCESSING}.")])
def test_the_processing_never_reaches_the_true_scene(name):
    assert not [other for other in reached_from(name) if other.startswith(TRUTH)]


def test_imports_are_followed():
    assert "vinsar.foundations.variables" in reached_from(f"{PROCESSING}.height")


def test_the_library_knows_nothing_of_the_workflow():
    for path in MODULES.values():
        assert not any(other.split(".")[0] == "snakemake" for other in imports_of(path))
