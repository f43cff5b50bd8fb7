"""The user's files through the workflow: exported from the tiny study, read as foreign."""

import shutil

import netCDF4
import pytest
import xarray as xr

from vinsar.results import storage
from vinsar.study import pipeline

ECHOES = """
measurement: {file: echo.nc}
outputs: {figures: [measured], claims: false}
"""
TERRAIN = """
scene: {terrain: file, file: heights.nc}
outputs: {figures: [fig4], claims: false}
"""


@pytest.fixture(scope="module")
def made(checkout, new_checkout):
    """A checkout with the tiny study's echo and terrain as the user's files."""
    fresh = new_checkout()
    done = checkout.ask("export", "results/tiny", str(fresh.folder / "echo.nc"))
    assert done.returncode == 0, done.stderr
    shutil.copy(checkout.results / "terrain.nc", fresh.folder / "heights.nc")
    return fresh


def same(checkout, made, name):
    one, two = (storage.read(place.results / f"{name}.nc", name) for place in (checkout, made))
    one.attrs, two.attrs = {}, {}
    xr.testing.assert_identical(one, two)


def test_exported_echoes_give_the_same_heights_and_nothing_that_needs_truth(checkout, made):
    done = made.snakemake(extra=ECHOES)
    assert done.returncode == 0, done.stdout + done.stderr
    # Nothing tells of rules for what the files give.
    assert "Exception" not in done.stdout + done.stderr
    same(checkout, made, "dem")
    found = {path.stem for path in made.results.glob("*.nc")}
    chain = {"autofocus", "profiles", "images", "interferogram", "filtered", "unwrapped", "dem"}
    assert found == {*pipeline.MEASURED, *chain}
    assert not (made.results / "accuracy.json").exists()
    verified = made.ask("verify", "results/tiny", "--configfile", "tiny.yaml", "extra.yaml")
    assert verified.returncode == 0, verified.stdout + verified.stderr
    packed = made.ask("crate", "results/tiny", "--configfile", "tiny.yaml", "extra.yaml")
    assert packed.returncode == 0, packed.stdout + packed.stderr
    copied = made.results / "source/echo.nc"
    assert copied.read_bytes() == (made.folder / "echo.nc").read_bytes()
    refused = made.snakemake("-n", "results/tiny/accuracy.json", extra=ECHOES)
    assert refused.returncode != 0
    assert "There is no 'accuracy' in the study 'tiny'" in refused.stdout + refused.stderr


def test_a_terrain_of_one_s_own_is_the_same_and_is_made_anew_when_its_file_changes(checkout, made):
    def run(*arguments):
        done = made.snakemake("results/tiny/terrain.nc", *arguments, extra=TERRAIN)
        return done.returncode, done.stdout + done.stderr

    code, output = run()
    assert code == 0, output
    same(checkout, made, "terrain")
    path = made.folder / "heights.nc"
    path.touch()
    assert "Nothing to be done" in run("-n")[1]
    with netCDF4.Dataset(path, "a") as file:
        file["height"][3, 4] += 0.01
    assert "elevation" in run("-n")[1]
    with netCDF4.Dataset(path, "a") as file:
        file["height"].units = "K"
    code, output = run()
    assert code == 1
    assert "scene.file = 'heights.nc': variable 'height' has the units 'K'" in output
    assert "Traceback" not in output
