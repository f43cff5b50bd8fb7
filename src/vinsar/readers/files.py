"""Named arrays from files: netCDF, HDF5, MATLAB, NumPy, Touchstone and CSV, told by their content.

Nothing of a file is executed: no pickles. Groups and structures are flattened with slashes, such as
``data/fp``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Arrays = dict[str, NDArray[Any]]

_HDF5 = b"\x89HDF\r\n\x1a\n"


# Steps may differ by this share of themselves: a thousandth of a frequency step turns the phase by
# 6 mrad at the far end of the unambiguous range.
_UNEVEN = 1e-3


def even(name: str, values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the values of an axis if they rise or fall in even steps.

    Parameters
    ----------
    name
        Name of the variable, for the message.
    values
        Its values (n,).

    Raises
    ------
    ValueError
        If there are fewer than two, some are not finite, or they are not sorted or not even.
    """
    if values.size < 2:
        raise ValueError(f"variable '{name}' has {values.size} value; two or more are needed")
    if not np.isfinite(values).all():
        count = int((~np.isfinite(values)).sum())
        raise ValueError(f"variable '{name}' has {count} values that are missing or not finite")
    steps = np.diff(values)
    if not (np.all(steps > 0) or np.all(steps < 0)):
        raise ValueError(f"variable '{name}' is not sorted; sort it, and the data along it")
    step = (values[-1] - values[0]) / steps.size
    off = float(np.abs(steps / step - 1).max())
    if off > _UNEVEN:
        raise ValueError(
            f"variable '{name}' is uneven: its steps differ by up to {100 * off:.3g} % from "
            f"{abs(step):g}; resample to even steps (and store it in double precision)"
        )
    return values


def load(path: str | Path) -> tuple[Arrays, dict[str, str]]:
    """Read all arrays of a file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    arrays : dict of ndarray
        Numbers, real or complex, by name. The parts of `<name>_real` and `<name>_imag` are joined
        as `<name>` besides.
    units : dict of str
        Units, of those that declare them.

    Raises
    ------
    ValueError
        If the file is missing, of another form, or holds pickled objects.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"there is no file {path}")
    with path.open("rb") as file:
        start = file.read(8)
        # MATLAB puts 512 bytes of its own before HDF5.
        file.seek(512)
        hdf5 = start == _HDF5 or file.read(8) == _HDF5
    try:
        if hdf5 and path.suffix != ".nc":
            found = _hdf5(path, transposed=start.startswith(b"MATLAB"))
        elif hdf5 or start.startswith(b"CDF"):
            found = _netcdf(path)
        elif start.startswith((b"MATLAB", b"\x00\x00\x00\x00")) or path.suffix == ".mat":
            found = _matlab(path)
        elif start.startswith((b"\x93NUMPY", b"PK\x03\x04")):
            found = _numpy(path)
        elif path.suffix.lower().startswith(".s") and path.suffix.lower().endswith("p"):
            found = _touchstone(path)
        else:
            found = _csv(path)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    except Exception as error:  # whatever foreign bytes bring about
        reason = str(error).partition("\n")[0]
        raise ValueError(f"{path} is truncated or of another format ({reason})") from error
    arrays, units = found
    return arrays | _joined(arrays), units


def _joined(arrays: Arrays) -> Arrays:
    """Return complex arrays of those whose parts are stored apart."""
    joined: Arrays = {}
    for real in arrays:
        for ends in (("_real", "_imag"), ("_re", "_im"), ("/real", "/imag")):
            name = real.removesuffix(ends[0])
            other = arrays.get(name + ends[1])
            if real != name and name and other is not None and other.shape == arrays[real].shape:
                joined[name] = arrays[real] + 1j * other
    return joined


def _netcdf(path: Path) -> tuple[Arrays, dict[str, str]]:
    import xarray as xr

    arrays: Arrays = {}
    units: dict[str, str] = {}
    with xr.open_dataset(path, engine="netcdf4", decode_times=False) as stored:
        for key, values in stored.variables.items():
            if values.dtype.kind in "fiuc":
                arrays[str(key)] = np.asarray(values.values)
                if "units" in values.attrs:
                    units[str(key)] = str(values.attrs["units"])
    return arrays, units


def _hdf5(path: Path, *, transposed: bool) -> tuple[Arrays, dict[str, str]]:
    import h5py

    arrays: Arrays = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        # Of MATLAB's own notes, in groups whose names begin with #, there is no need.
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        values = np.asarray(item)
        if values.dtype.names and {"real", "imag"} <= set(values.dtype.names):
            values = values["real"] + 1j * values["imag"]
        if values.dtype.kind in "fiuc" and "MATLAB_empty" not in item.attrs:
            # MATLAB stores by columns.
            arrays[name] = values.T if transposed else values
            unit = item.attrs.get("units")
            if unit is not None:
                units[name] = unit.decode() if isinstance(unit, bytes) else str(unit)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return arrays, units


def _matlab(path: Path) -> tuple[Arrays, dict[str, str]]:
    from scipy import io

    arrays: Arrays = {}
    _flatten(
        {
            name: value
            for name, value in io.loadmat(path, simplify_cells=True).items()
            if not name.startswith("__")
        },
        "",
        arrays,
    )
    return arrays, {}


def _flatten(values: Mapping[str, Any], prefix: str, arrays: Arrays) -> None:
    for name, value in values.items():
        if isinstance(value, dict):
            _flatten(value, f"{prefix}{name}/", arrays)
        elif (array := np.asarray(value)).dtype.kind in "fiuc":
            arrays[prefix + name] = array


def _numpy(path: Path) -> tuple[Arrays, dict[str, str]]:
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return {path.stem: loaded}, {}
    with loaded:
        return {name: loaded[name] for name in loaded.files}, {}


def _touchstone(path: Path) -> tuple[Arrays, dict[str, str]]:
    import skrf

    network = skrf.Network(str(path))
    ports = range(network.nports)
    # S12 goes from port 2 to port 1. A file is a position.
    arrays: Arrays = {
        f"S{out + 1}{into + 1}": network.s[None, :, out, into] for out in ports for into in ports
    }
    arrays["frequency"] = np.asarray(network.f)
    return arrays, {"frequency": "Hz"}


def _csv(path: Path) -> tuple[Arrays, dict[str, str]]:
    """Read a table of numbers with a line of names, separated by commas, semicolons or blanks."""
    lines = [
        line.strip().lstrip("#").strip()
        for line in path.read_text(encoding="utf-8-sig").splitlines()
        if line.strip()
    ]
    if not lines:
        raise ValueError("it is empty")
    mark = next((mark for mark in ",;\t" if mark in lines[0]), None)
    header = [word.strip().strip('"') for word in lines[0].split(mark)]
    if all(is_number(word) for word in header):
        raise ValueError("its first line must name the columns, such as: time,x,y,z")
    rows = [[word.strip() for word in line.split(mark)] for line in lines[1:]]
    uneven = [number for number, row in enumerate(rows, 2) if len(row) != len(header)]
    if uneven:
        raise ValueError(f"line {uneven[0]} has not the {len(header)} columns that line 1 names")
    arrays: Arrays = {}
    units: dict[str, str] = {}
    for index, name in enumerate(header):
        plain, _, unit = name.partition("(")
        plain = plain.strip()
        column = [row[index] for row in rows]
        if all(is_number(word) for word in column):
            arrays[plain] = np.array(column, dtype=float)
            if unit:
                units[plain] = unit.rstrip(") ")
    return arrays, units


def is_number(word: str) -> bool:
    """Tell whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True
