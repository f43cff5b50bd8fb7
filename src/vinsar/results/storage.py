"""Products in netCDF files (CF-1.11): whole or not at all, and refused if they are not ours.

Complex variables are stored as ``<name>_real`` and ``<name>_imag``, flags as int8 with
``flag_values``: the only forms that every CF tool reads. CF's coordinate variables are numbers in
order; other labels of a dimension are an auxiliary coordinate over ``<name>_index``.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations import variables

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import xarray as xr

CONVENTIONS = "CF-1.11"
_PARTS = ("real", "imag")


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Give a temporary file beside ``path`` to write, which takes its name only if all went well.

    Parameters
    ----------
    path
        The final name.

    Yields
    ------
    Path
        The temporary name, with the same suffix.

    Raises
    ------
    OSError
        If the file cannot be written, as on a full disk; the message tells the final name.
    """
    path = Path(path)
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent
        )
        temporary = Path(name)
        os.close(handle)
        yield temporary
        # mkstemp makes files private; results are as readable as any other file.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        # Else a power cut may leave the final name with nothing behind it.
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        # What went wrong with another file tells its name itself.
        ours = error.filename is None or Path(error.filename).parent in (path.parent, Path())
        if not ours or str(error).startswith("cannot write"):
            raise
        raise OSError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def write(
    data: xr.Dataset, path: str | Path, product: str, attributes: Mapping[str, str] | None = None
) -> None:
    """Write a product.

    Parameters
    ----------
    data
        The product.
    path
        The file; it appears whole or not at all.
    product
        A key of `variables.PRODUCTS`.
    attributes
        Global attributes, such as the provenance.

    Raises
    ------
    ValueError
        If the dataset departs from the product's declaration.
    OSError
        If the file cannot be written.
    """
    variables.check(data, product)
    stored = data.copy()
    encoding: dict[str, dict[str, Any]] = {}
    for name in map(str, data.variables):
        values = data[name]
        if values.dtype.kind == "c":
            for part in _PARTS:
                attrs = values.attrs | {"long_name": f"{values.attrs['long_name']}, {part} part"}
                stored[f"{name}_{part}"] = (values.dims, getattr(values.values, part), attrs)
                encoding[f"{name}_{part}"] = {"_FillValue": None}
            stored = stored.drop_vars(name)
        elif values.dtype.kind == "b":
            stored[name] = (values.dims, values.values.astype(np.int8), values.attrs)
            stored[name].attrs["flag_values"] = np.array([0, 1], np.int8)
            # Flags are long runs of one value: they shrink a hundredfold for little time.
            encoding[name] = {"zlib": True, "complevel": 1, "shuffle": False, "_FillValue": None}
        elif values.dtype.kind == "i" and "flag_meanings" in values.attrs:
            stored[name] = (values.dims, values.values, values.attrs)
            count = len(values.attrs["flag_meanings"].split())
            stored[name].attrs["flag_values"] = np.arange(count, dtype=values.dtype)
            encoding[name] = {"zlib": True, "complevel": 1, "shuffle": False, "_FillValue": None}
        else:
            missing = name not in data.coords and bool(
                values.dtype.kind == "f" and np.isnan(values.values).any()
            )
            encoding[name] = {"_FillValue": np.nan if missing else None}
    labelled = {dim: f"{dim}_index" for dim in data.coords if _is_label(data[dim])}
    stored = stored.rename_dims(labelled)[sorted(map(str, stored.variables))]
    stored.attrs = {"Conventions": CONVENTIONS, "vinsar_product": product} | dict(attributes or {})
    with atomic(path) as temporary:
        try:
            stored.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        except RuntimeError as error:  # what netCDF4 makes of a full disk
            raise OSError(f"cannot write {path}: {error}") from error


def _is_label(values: xr.DataArray) -> bool:
    index = values.to_index()
    ordered = index.is_monotonic_increasing or index.is_monotonic_decreasing
    return values.dtype.kind in "UOT" or not (ordered and index.is_unique)


def read(path: str | Path, product: str | None = None) -> xr.Dataset:
    """Read a product into memory.

    Parameters
    ----------
    path
        The file.
    product
        A key of `variables.PRODUCTS`; by default whatever the file says that it holds.

    Returns
    -------
    xarray.Dataset
        The product as it was written; the provenance is in its attributes.

    Raises
    ------
    ValueError
        If the file is missing, truncated, not netCDF, or holds something else; the message says
        what to do.
    """
    import xarray as xr

    remedy = "delete it and run again, and it will be made again"
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist; run the study that makes it")
    try:
        with xr.open_dataset(path, engine="netcdf4", mask_and_scale=False) as opened:
            stored = opened.load()
    except (OSError, RuntimeError, ValueError) as error:
        raise ValueError(f"{path} is truncated or not netCDF ({error}); {remedy}") from error
    found = stored.attrs.get("vinsar_product", "no vinsar product")
    if product is None and found in variables.PRODUCTS:
        product = found
    if product is None or found != product:
        wanted = f"'{product}'" if product else "a product of this version"
        raise ValueError(f"{path} holds {found}, not {wanted}; {remedy}")
    if product not in variables.PRODUCTS:
        raise ValueError(f"no module that is imported declares a product '{product}'")
    try:
        data = _restore(stored, product)
        variables.check(data, product)
    except (KeyError, ValueError) as error:
        message = error.args[0]
        raise ValueError(f"{path} is not a whole '{product}': {message}; {remedy}") from error
    return data


def _restore(stored: xr.Dataset, product: str) -> xr.Dataset:
    labelled = {f"{name}_index": name for name in stored.coords}
    stored = stored.swap_dims({dim: labelled[dim] for dim in stored.dims if dim in labelled})
    data = stored.copy()
    for name, variable in variables.PRODUCTS.get(product, {}).items():
        if variable.kind == "complex":
            real, imag = (stored[f"{name}_{part}"] for part in _PARTS)
            values = np.empty(real.shape, np.result_type(real.dtype, np.complex64))
            values.real, values.imag = real.values, imag.values
            data = data.drop_vars([f"{name}_{part}" for part in _PARTS])
            data[name] = (real.dims, values, real.attrs | {"long_name": variable.long_name})
        elif variable.kind == "flag":
            data[name] = (stored[name].dims, stored[name].values.astype(bool), variable.attrs)
        elif variable.flag_meanings:
            data[name] = (stored[name].dims, stored[name].values, variable.attrs)
    for key in data.variables:
        data[key].attrs.pop("_FillValue", None)
        data[key].encoding = {}
    data.encoding = {}
    return data
