"""A wheel holds all that the library needs: it runs where there is no repository."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKED = ("src", "config/paper.yaml", "pyproject.toml", "README.md", "LICENSE")

CHAIN = """
import vinsar
small = {"x_min_m": -0.8, "x_max_m": 0.8, "y_max_m": 12.0}
ground = {"x_min_m": 0.6, "x_max_m": 0.75, "y_min_m": 10.05, "y_max_m": 10.2}
study = vinsar.load(
    radar={"frequency_count": 201, "position_spacing_m": 0.02},
    scene=small | {"terrain_spacing_m": 0.02},
    imaging=small | {"grid_spacing_m": 0.04},
    filtering={"goldstein_patch_px": 32, "goldstein_step_px": 8},
    height={"level_ground": [ground]},
)
products = vinsar.run(study, "accuracy")
vinsar.draw("fig4", products, study)
print(vinsar.__file__)
print(products["accuracy"]["std"].values.tolist())
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    command = ["git", "ls-files", "-z", *PACKED]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listed.split("\0")):
        target = source / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).is_symlink():
            target.symlink_to((ROOT / name).readlink())
        else:
            target.write_bytes((ROOT / name).read_bytes())
    build = f"from setuptools import build_meta; build_meta.build_wheel({str(folder)!r})"
    subprocess.run([sys.executable, "-c", build], cwd=source, capture_output=True, check=True)
    return next(folder.glob("*.whl"))


def chain(python, folder):
    """Run the chain; return where the package lies and what came out."""
    command = [python, "-c", CHAIN]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_wheel_runs_the_chain_in_an_environment_without_the_repository(wheel, tmp_path):
    environment = tmp_path / "env"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    places = sysconfig.get_paths(vars={"base": str(environment), "platbase": str(environment)})
    site = Path(places["purelib"])
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(site)
    # The libraries that it depends on, without what makes the repository importable here.
    (site / "libraries.pth").write_text(f"{sysconfig.get_paths()['purelib']}\n")
    place, found = chain(environment / "bin/python", tmp_path)
    assert Path(place).is_relative_to(site)
    # The same numbers as here.
    assert found == chain(sys.executable, ROOT)[1]
