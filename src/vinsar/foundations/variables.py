"""Variables of the products: dimensions, type, unit, name, meaning, each declared once.

A module declares the products that it makes. `dataset` is the one way to make one; `check` refuses
what departs from the declaration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from vinsar.foundations.constants import AXES, channel_names

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

Kind = Literal["real", "complex", "integer", "flag", "label"]

# Longer axes, such as that of the facets, are not remembered.
_LONG_AXIS = 4096

DTYPES: dict[Kind, tuple[str, ...]] = {
    "real": ("float32", "float64"),
    "complex": ("complex64", "complex128"),
    "integer": ("int8", "int16", "int32", "int64", "uint32"),
    "flag": ("bool",),
    "label": ("str",),
}


@dataclass(frozen=True)
class Variable:
    """What a variable is.

    Attributes
    ----------
    dims
        Names of its dimensions, in order.
    kind
        What its values are; `DTYPES` has the types allowed.
    units
        UDUNITS string; "1" where there is none, "" for labels.
    long_name
        What a plot writes on the axis.
    comment
        Sign convention and meaning, where they matter.
    flag_meanings
        For flags: the words for false and true. For integers that are classes: the words for 0, 1
        and so on.
    bounds
        The least and the largest value that there can be.
    gaps
        Whether values may be missing (NaN) though nothing misses in what it is made from.
    """

    dims: tuple[str, ...]
    kind: Kind
    units: str
    long_name: str
    comment: str = ""
    flag_meanings: str = ""
    bounds: tuple[float, float] = (-np.inf, np.inf)
    gaps: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """The bounds of its values; of classes, those that have a word."""
        if self.kind == "integer" and self.flag_meanings:
            return 0, len(self.flag_meanings.split()) - 1
        return self.bounds

    @property
    def attrs(self) -> dict[str, Any]:
        """The attributes that the variable carries."""
        attrs: dict[str, Any] = {"long_name": self.long_name}
        if self.units:
            attrs["units"] = self.units
        if self.comment:
            attrs["comment"] = self.comment
        if self.flag_meanings:
            attrs["flag_meanings"] = self.flag_meanings
        return attrs


GRID: tuple[str, ...] = ("y", "x")
"""Dimensions of what lies on image or ground."""

COORDINATES: dict[str, Variable] = {
    "channel": Variable(
        ("channel",), "label", "", "interferometric channel", "lower is S1, upper is S2"
    ),
    "axis": Variable(("axis",), "label", "", "axis of a position"),
    "ground_axis": Variable(("ground_axis",), "label", "", "axis on the ground plane"),
    "position": Variable(("position",), "integer", "1", "number of the antenna position"),
    "frequency": Variable(("frequency",), "real", "Hz", "frequency"),
    "slant_range": Variable(
        ("slant_range",), "real", "m", "slant range", "half of the path out and back"
    ),
    # Without CF's axis attribute: it would ask for the latitude and longitude of a vehicle's frame.
    "x": Variable(("x",), "real", "m", "x (along the rail)", "positive to the right"),
    "y": Variable(("y",), "real", "m", "y (ahead of the vehicle)"),
    "region": Variable(("region",), "label", "", "part of the scene"),
    "realization": Variable(("realization",), "integer", "1", "number of the realization"),
}
"""The dimensions' coordinates; a product declares those that it alone has."""

PRODUCTS: dict[str, dict[str, Variable]] = {}
"""The variables of each product, as the modules declare them."""

_CHECKS: dict[str, Callable[[xr.Dataset], None]] = {}
_STATISTICS: set[str] = set()


def declare(
    product: str,
    variables: Mapping[str, Variable],
    *,
    coordinates: Mapping[str, Variable] | None = None,
    check: Callable[[xr.Dataset], None] | None = None,
    statistics: bool = False,
) -> None:
    """Declare a product; the module that makes it does so once.

    Parameters
    ----------
    product
        Its name.
    variables
        Its variables by name.
    coordinates
        The coordinates of dimensions that no other product has.
    check
        What refuses a dataset that departs from the declaration, if not `check`.
    statistics
        Whether its values are of parts of the scene that may be empty, and are missing then.

    Raises
    ------
    ValueError
        If the product or a coordinate is declared already, and otherwise.
    """
    if PRODUCTS.setdefault(product, dict(variables)) != dict(variables):
        raise ValueError(f"product '{product}' is declared already, and otherwise")
    for name, variable in (coordinates or {}).items():
        if COORDINATES.setdefault(name, variable) != variable:
            raise ValueError(f"coordinate '{name}' is declared already, and otherwise")
    if check is not None:
        _CHECKS[product] = check
    if statistics:
        _STATISTICS.add(product)


LABELS: dict[str, tuple[str, ...]] = {"axis": AXES, "ground_axis": AXES[:2]}


def dataset(
    product: str, data: Mapping[str, Any], coords: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Make a product from plain arrays, with the declared dimensions and attributes.

    Parameters
    ----------
    product
        A key of `PRODUCTS`.
    data
        An array or scalar for each declared variable.
    coords
        The coordinates' values; `channel`, `axis` and plain counts are filled in.

    Returns
    -------
    xarray.Dataset
        The labelled product.

    Raises
    ------
    ValueError
        If a variable is missing, undeclared, or of other shape or type than declared.
    """
    declared = PRODUCTS[product]
    arrays: dict[str, xr.Variable] = {}
    sizes: dict[str, int] = {}
    for name, values in data.items():
        if name not in declared:
            raise ValueError(f"product '{product}' has no variable '{name}'")
        array = np.asarray(values)
        dims = declared[name].dims
        if array.ndim != len(dims):
            raise ValueError(
                f"'{name}' of product '{product}' has {array.ndim} dimensions, "
                f"but {dims} are declared"
            )
        arrays[name] = _variable(dims, array, declared[name].attrs)
        sizes |= dict(zip(dims, array.shape, strict=True))
    # In one order, so that a dataset written twice is the same bytes.
    labels = {
        name: np.asarray(coords[name])
        if coords is not None and name in coords
        else _labels(name, sizes[name])
        for name in sorted(sizes)
    }
    if product in _CHECKS or any(values.size > _LONG_AXIS for values in labels.values()):
        return _assemble(product, arrays, labels)
    kinds = tuple((name, array.dtype.str, array.shape) for name, array in arrays.items())
    axes = tuple((name, values.dtype.str, values.tobytes()) for name, values in labels.items())
    return _template(product, kinds, axes).copy(data=arrays)


# Labelling costs several times as much as a copy with other values, and stages make the same
# products again and again.
@lru_cache(maxsize=128)
def _template(
    product: str,
    kinds: tuple[tuple[str, str, tuple[int, ...]], ...],
    axes: tuple[tuple[str, str, bytes], ...],
) -> xr.Dataset:
    """Return a product of some types and shapes on some axes; its values take no memory."""
    arrays = {
        name: _variable(
            PRODUCTS[product][name].dims,
            np.broadcast_to(np.zeros((), dtype), shape),
            PRODUCTS[product][name].attrs,
        )
        for name, dtype, shape in kinds
    }
    labels = {name: np.frombuffer(data, dtype).copy() for name, dtype, data in axes}
    return _assemble(product, arrays, labels)


def _assemble(
    product: str, arrays: Mapping[str, xr.Variable], labels: Mapping[str, NDArray[Any]]
) -> xr.Dataset:
    """Return a product from its variables and the values of its axes, all as declared."""
    axes = {
        name: _variable((name,), values, COORDINATES[name].attrs) for name, values in labels.items()
    }
    result = xr.Dataset(arrays, xr.Coordinates(axes))
    check(result, product)
    return result


def _variable(
    dims: tuple[str, ...], array: NDArray[Any], attributes: Mapping[str, Any]
) -> xr.Variable:
    # Known to be an array: otherwise xarray loads all of Dask to ask whether it is one of Dask's,
    # which is half a second of each start of the workflow.
    return xr.Variable(dims, array, attributes, fastpath=True)


def _labels(name: str, size: int) -> NDArray[Any]:
    if name == "channel":
        return np.asarray(channel_names(size))
    return np.asarray(LABELS[name]) if name in LABELS else np.arange(size)


def swept(data: xr.Dataset, *dims: str) -> xr.Dataset:
    """Return a sweep over some of its keys, each of its other keys at its first value.

    Parameters
    ----------
    data
        Product ``sweep``.
    *dims
        Dimensions to keep; the realization and the variables' own stay as they are.

    Returns
    -------
    xarray.Dataset
        Product ``sweep`` with no other swept key.

    Raises
    ------
    ValueError
        If the sweep does not go over one of them.
    """
    keys = [str(dim) for dim in data.dims if dim not in COORDINATES]
    missing = [dim for dim in dims if dim not in keys]
    if missing:
        raise ValueError(
            f"the sweep goes over {', '.join(keys)}; {', '.join(missing)} is needed as well"
        )
    return data.isel({dim: 0 for dim in keys if dim not in dims}, drop=True)


def check(data: xr.Dataset, product: str) -> None:
    """Refuse a dataset that departs from the product's declaration.

    Parameters
    ----------
    data
        The dataset.
    product
        A key of `PRODUCTS`.

    Raises
    ------
    ValueError
        Names the first variable that is missing, undeclared, or departs in dimensions, type or
        attributes, with what is declared.
    """
    if product in _CHECKS:
        _CHECKS[product](data)
        return
    declared = PRODUCTS[product]
    dims = {dim for variable in declared.values() for dim in variable.dims}
    expected = declared | {dim: COORDINATES[dim] for dim in dims}
    found = {str(name) for name in data.variables}
    for name in sorted(set(expected) - found):
        raise ValueError(f"product '{product}' lacks the variable '{name}'")
    for name in sorted(found - set(expected)):
        raise ValueError(f"product '{product}' has no variable '{name}'")
    for name, variable in expected.items():
        array = data.variables[name]
        if array.dims != variable.dims:
            raise ValueError(
                f"'{name}' of product '{product}' has the dimensions {array.dims}, "
                f"but {variable.dims} are declared"
            )
        kind = "str" if array.dtype.kind in "UOT" else array.dtype.name
        if kind not in DTYPES[variable.kind]:
            raise ValueError(
                f"'{name}' of product '{product}' is {array.dtype}, "
                f"but {' or '.join(DTYPES[variable.kind])} is declared"
            )
        for attribute, value in variable.attrs.items():
            if array.attrs.get(attribute) != value:
                raise ValueError(
                    f"'{name}' of product '{product}' has {attribute}="
                    f"{array.attrs.get(attribute)!r}, but {value!r} is declared"
                )


# A coherence of 1 may be computed as a rounding more.
_ROUNDING = 1e-6


def refuse_values(
    data: xr.Dataset, product: str, made_from: Mapping[str, xr.Dataset] | None = None
) -> None:
    """Refuse values that cannot be: infinite, out of bounds, missing without a reason.

    Parameters
    ----------
    data
        A product as declared (`check`).
    product
        A key of `PRODUCTS`.
    made_from
        What it was made from. Where values of these are missing, its own may be.

    Raises
    ------
    ValueError
        Names the first such variable, how many of its values there are, and where the first is.
    """

    def may_miss(variable: Variable) -> bool:
        return (
            variable.gaps or product in _STATISTICS or any(map(_gaps, (made_from or {}).values()))
        )

    for name, variable in PRODUCTS[product].items():
        if variable.kind in ("flag", "label") or name not in data.variables:
            continue
        array = data.variables[name]
        both = variable.kind == "complex"
        for values in (array.values.real, array.values.imag) if both else (array.values,):
            fault = _fault(values, variable, may_miss)
            if fault is not None:
                what, wrong = fault
                first = zip(array.dims, np.argwhere(wrong)[0], strict=True)
                where = ", ".join(f"{dim} number {number}" for dim, number in first)
                raise ValueError(
                    f"{wrong.sum()} of the {wrong.size} values of '{name}' in product '{product}' "
                    f"{what}" + (f"; the first at {where}" if where else "")
                )


def _fault(
    values: NDArray[Any], variable: Variable, may_miss: Callable[[Variable], bool]
) -> tuple[str, NDArray[np.bool_]] | None:
    """Return what is wrong with some of the values, and with which."""
    if values.size == 0:
        return None
    least, largest = variable.limits
    # The extremes tell at the cost of reading the values twice whether anything is wrong at all.
    low, high = values.min(), values.max()
    if np.isnan(low):
        if not may_miss(variable):
            return "are missing", np.isnan(values)
        values = np.where(np.isnan(values), least if np.isfinite(least) else 0, values)
        low, high = values.min(), values.max()
    if not np.isfinite([low, high]).all():
        return "are infinite", np.isinf(values)
    if low < least - _ROUNDING or high > largest + _ROUNDING:
        wrong = (values < least - _ROUNDING) | (values > largest + _ROUNDING)
        return f"are outside {least:g} to {largest:g}", wrong
    return None


def _gaps(product: xr.Dataset) -> bool:
    return any(
        np.isnan(variable.values).any()
        for variable in product.variables.values()
        if variable.dtype.kind in "fc"
    )
