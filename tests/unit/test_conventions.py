"""Every declared variable, as it is stored, held against the CF conventions by a checker."""

import warnings
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from vinsar.foundations import variables
from vinsar.foundations.constants import REGIONS
from vinsar.results import provenance, storage
from vinsar.sweeps import sweep
from vinsar.sweeps.sweep import SWEEP, sweep_dataset

HIGH = 3
LABELS = {
    dim: variables.LABELS.get(dim, ("one", "other"))
    for dim, declared in variables.COORDINATES.items()
    if declared.kind == "label"
} | {"region": REGIONS}
# What is not among them is as long as its place.
SIZES = {
    dim: len(LABELS.get(dim, range(2 + place))) for place, dim in enumerate(variables.COORDINATES)
}


@pytest.fixture(scope="module")
def errors():
    """Return what the checker of CF-1.11 calls an error, and where it failed itself."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from compliance_checker.suite import CheckSuite

        suite = CheckSuite()
        suite.load_all_available_checkers()

    def check(path):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = suite.load_dataset(str(path))
            ((groups, failures),) = suite.run_all(file, ["cf:1.11"]).values()
            file.close()
        assert len(groups) > 10
        found = [group for group in groups if group.value[0] < group.value[1]]
        return [
            *failures,
            *(text for group in found if group.weight == HIGH for text in group.msgs),
        ]

    return check


def values(variable, shape):
    """Values as a stage may give them: of every kind, and missing where a height can be."""
    made = np.arange(np.prod(shape), dtype=float).reshape(shape) / 7
    if variable.kind == "complex":
        return (made + 1j).astype(np.complex64)
    if variable.kind == "real":
        if variable.dims == ("y", "x"):
            made[0, 0] = np.nan
        return made
    return made.astype({"integer": np.int32, "flag": bool}[variable.kind])


def product(name):
    declared = variables.PRODUCTS[name]
    return variables.dataset(
        name,
        {
            key: values(variable, [SIZES[dim] for dim in variable.dims])
            for key, variable in declared.items()
        },
        {
            dim: np.array(LABELS.get(dim, 2.0 + np.arange(SIZES[dim])))
            for dim, declared in variables.COORDINATES.items()
            if declared.kind != "integer"
        },
    )


def swept():
    keys = {
        f"key_{end}": (np.arange(2.0), {"long_name": end, "units": unit})
        for end, unit in sweep.UNITS.items()
    } | {
        "falling": ([0.3, 0.1], {"long_name": "falling", "units": "1"}),
        "mixed": ([0.0, 20.0, 10.0], {"long_name": "mixed", "units": "1"}),
        "motion_channels": (["common", "independent"], {"long_name": "motion.channels"}),
    }
    leading = [*(len(labels) for labels, _ in keys.values()), 2]
    data = {
        name: values(variable, [*leading, *(SIZES[dim] for dim in variable.dims)])
        for name, variable in SWEEP.items()
    }
    return sweep_dataset(data, keys)


def write(path, name):
    data = swept() if name == "sweep" else product(name)
    attributes = provenance.describe(
        study="test", stage=name, configuration={"seed": 1}, inputs={}, code=[Path(__file__)]
    )
    storage.write(data, path, name, attributes)
    return data


@pytest.mark.parametrize("name", [*variables.PRODUCTS, "sweep"])
def test_each_product_has_no_error_and_comes_back(errors, tmp_path, name):
    data = write(tmp_path / "a.nc", name)
    assert errors(tmp_path / "a.nc") == []
    back = storage.read(tmp_path / "a.nc", name)
    back.attrs = {}
    assert back.identical(data)


def test_an_error_is_found(errors, tmp_path):
    write(tmp_path / "a.nc", "dem")
    with netCDF4.Dataset(tmp_path / "a.nc", "a") as file:
        file["height"].units = "elephants"
        file["y"][:] = 1.0
    found = " ".join(errors(tmp_path / "a.nc"))
    assert "elephants" in found
    assert "monoton" in found
