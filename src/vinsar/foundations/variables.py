"""Every variable of every product, declared once: dimensions, type, unit, name, meaning.

`dataset` is the one way to make a product; `check` refuses what departs from the declaration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from vinsar.foundations.constants import AXES, CHANNELS, REGIONS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray
    from xarray.core.indexes import Index

    _Coordinate = tuple[xr.Variable, Index]

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
        For flags: the words for false and true.
    """

    dims: tuple[str, ...]
    kind: Kind
    units: str
    long_name: str
    comment: str = ""
    flag_meanings: str = ""

    @property
    def attrs(self) -> dict[str, str]:
        """The attributes that the variable carries."""
        attrs = {"long_name": self.long_name}
        if self.units:
            attrs["units"] = self.units
        if self.comment:
            attrs["comment"] = self.comment
        if self.flag_meanings:
            attrs["flag_meanings"] = self.flag_meanings
        return attrs


_GRID = ("y", "x")

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
    "facet": Variable(("facet",), "integer", "1", "number of the facet"),
    "target": Variable(("target",), "label", "", "point target"),
    "target_height": Variable(("target_height",), "real", "m", "height of the point target"),
    "region": Variable(("region",), "label", "", "part of the scene"),
    "baseline_angle": Variable(
        ("baseline_angle",), "real", "radian", "attitude of the baseline from horizontal"
    ),
    "detection": Variable(("detection",), "integer", "1", "number of the detected area"),
    "object": Variable(("object",), "integer", "1", "number of the object of the scene"),
    "height_threshold": Variable(
        ("height_threshold",), "real", "m", "threshold of the height detector"
    ),
    "amplitude_threshold": Variable(
        ("amplitude_threshold",), "real", "1", "threshold of the 2-D detector, a power ratio"
    ),
    "suppression": Variable(("suppression",), "label", "", "suppression of the coupling"),
    "weighting": Variable(("weighting",), "label", "", "weighting of the frequencies"),
    "realization": Variable(("realization",), "integer", "1", "number of the realization"),
}

_ANTENNA = ("channel", "position", "axis")
_SHIFT = ("ground_axis", "target", "target_height")

_ANTENNAS = {
    "transmitter": Variable(_ANTENNA, "real", "m", "position of the transmitting antenna"),
    "receiver": Variable(_ANTENNA, "real", "m", "position of the receiving antenna"),
}
_SHADOW = Variable(
    _GRID,
    "flag",
    "1",
    "cell hidden from either antenna at more than half of the positions",
    flag_meanings="visible shadow",
)
_TERRAIN = {
    "height": Variable(_GRID, "real", "m", "true height above the ground plane"),
    "reflectivity": Variable(_GRID, "real", "1", "reflectivity of the scene"),
}
_DETECTED, _OBJECT = ("detection",), ("object",)
_ECHO = {
    "echo": Variable(
        ("channel", "position", "frequency"),
        "complex",
        "1",
        "stepped-frequency echo",
        "a path R out and back gives the phase -2 pi f R / c",
    ),
}

PRODUCTS: dict[str, dict[str, Variable]] = {
    "trajectory": _ANTENNAS,
    "true_trajectory": _ANTENNAS,
    "recorded_trajectory": _ANTENNAS,
    "roughness": {
        "height": Variable(_GRID, "real", "m", "random roughness of the ground"),
    },
    "elevation": _TERRAIN,
    "terrain": _TERRAIN,
    "facets": {
        "facet_position": Variable(("facet", "axis"), "real", "m", "position of the facet"),
        "reflectivity": Variable(("facet",), "real", "1", "reflectivity of the facet"),
    },
    "visibility": {
        "visible": Variable(
            ("channel", "position", "facet"),
            "flag",
            "1",
            "facet seen from the transmitter and the receiver (Eq. 8)",
            flag_meanings="hidden visible",
        ),
    },
    "truth": {
        "height": Variable(_GRID, "real", "m", "true height on the DEM's grid"),
        "reflectivity": Variable(_GRID, "real", "1", "reflectivity on the DEM's grid"),
        "visible_fraction": Variable(
            ("channel", "y", "x"), "real", "1", "share of the antenna positions that see the cell"
        ),
        "shadow": _SHADOW,
    },
    "echo": _ECHO,
    "received": _ECHO,
    "measurement": _ECHO | _ANTENNAS,
    "profiles": {
        "profile": Variable(
            ("channel", "position", "slant_range"),
            "complex",
            "1",
            "range-compressed profile",
            "at baseband: the carrier's phase over the slant-range axis is removed; "
            "a unit point target peaks at 1",
        ),
        "carrier_frequency": Variable((), "real", "Hz", "carrier frequency of the profiles"),
    },
    "images": {
        "image": Variable(
            ("channel", "y", "x"),
            "complex",
            "1",
            "complex image focused on the ground plane",
            "a unit point target on the ground plane gives amplitude 1 and phase 0",
        ),
        "wavelength": Variable((), "real", "m", "wavelength of the carrier"),
        **_ANTENNAS,
    },
    "interferogram": {
        "interferogram": Variable(
            _GRID, "complex", "1", "interferogram, lower times conjugate upper (Eq. 10)"
        ),
        "coherence": Variable(_GRID, "real", "1", "multilooked coherence magnitude"),
    },
    "filtered": {
        "interferogram": Variable(_GRID, "complex", "1", "filtered interferogram"),
    },
    "unwrapped": {
        "phase": Variable(
            _GRID,
            "real",
            "radian",
            "unwrapped interferometric phase without the flat-earth phase",
            "lower minus upper; known up to one constant",
        ),
        "residue": Variable(
            _GRID,
            "integer",
            "1",
            "residue of the filtered phase",
            "winding number of the four cells whose least x and y are this one's: -1, 0 or 1",
        ),
    },
    "dem": {
        "height": Variable(_GRID, "real", "m", "reconstructed height above the ground plane"),
        "image_height": Variable(
            _GRID, "real", "m", "height at the image's pixel, before DEM coding"
        ),
        "absolute_phase": Variable(
            _GRID,
            "real",
            "radian",
            "absolute interferometric phase at the image's pixel",
            "lower minus upper, flat-earth phase included (Eq. 11)",
        ),
        "phase_offset": Variable(
            _GRID, "real", "radian", "phase added to fit the reference heights"
        ),
    },
    "detections": {
        "ground": Variable(_GRID, "real", "m", "height of the ground beneath obstacles"),
        "height_above_ground": Variable(
            _GRID, "real", "m", "reconstructed height above the ground beneath", "negative in holes"
        ),
        "height_noise": Variable(
            _GRID, "real", "m", "standard deviation of the height expected from the coherence"
        ),
        "significant_height": Variable(
            _GRID,
            "real",
            "m",
            "height above the ground beneath where it exceeds its noise",
            "0 where it does not, not a number where the image is dark",
        ),
        "map_class": Variable(
            _GRID,
            "integer",
            "1",
            "what the ground is taken for",
            "0 free, 1 obstacle, 2 hole, 3 unknown: dark, or too noisy to tell",
        ),
        "contrast": Variable(
            _GRID,
            "real",
            "1",
            "multilooked power of the images over that of their surroundings",
            "at the image's pixel, before DEM coding",
        ),
        "bright": Variable(
            _GRID,
            "flag",
            "1",
            "alarm of the 2-D detector, which sees the images' power alone",
            flag_meanings="quiet alarm",
        ),
        "detected_x": Variable(_DETECTED, "real", "m", "centre of the detected area along x"),
        "detected_y": Variable(_DETECTED, "real", "m", "centre of the detected area along y"),
        "extent_x": Variable(_DETECTED, "real", "m", "extent of the detected area along x"),
        "extent_y": Variable(_DETECTED, "real", "m", "extent of the detected area along y"),
        "detected_area": Variable(_DETECTED, "real", "m2", "detected area"),
        "detected_height": Variable(
            _DETECTED,
            "real",
            "m",
            "height of the detected area",
            "what a tenth of it exceeds; negative for a hole",
        ),
    },
    "detection_accuracy": {
        "object_x": Variable(_OBJECT, "real", "m", "centre of the object along x"),
        "object_y": Variable(_OBJECT, "real", "m", "centre of the object along y"),
        "object_height": Variable(
            _OBJECT, "real", "m", "height of the object", "negative for a ditch or pit"
        ),
        "height_found": Variable(
            ("height_threshold", "object"),
            "flag",
            "1",
            "object found by the height detector",
            flag_meanings="missed found",
        ),
        "height_false_alarms": Variable(
            ("height_threshold",), "integer", "1", "false alarms of the height detector"
        ),
        "amplitude_found": Variable(
            ("amplitude_threshold", "object"),
            "flag",
            "1",
            "object found by the 2-D detector",
            flag_meanings="missed found",
        ),
        "amplitude_false_alarms": Variable(
            ("amplitude_threshold",), "integer", "1", "false alarms of the 2-D detector"
        ),
        "object_unknown": Variable(
            _OBJECT, "real", "1", "share of the object's ground that the map has as unknown"
        ),
        "object_free": Variable(
            _OBJECT, "real", "1", "share of the object's ground that the map has as free"
        ),
        "shadow_unknown": Variable(
            (), "real", "1", "share of the true shadow that the map has as unknown"
        ),
        "visible_unknown": Variable(
            (), "real", "1", "share of visible ground beside objects that the map has as unknown"
        ),
        "scene_area": Variable((), "real", "m2", "area of the map"),
    },
    "focus": {
        "point_gain": Variable(
            ("channel",),
            "real",
            "1",
            "amplitude of a point target at the image's centre relative to perfect focus",
        ),
        "peak_gain": Variable(
            ("channel",),
            "real",
            "1",
            "amplitude of the point target where its image lies, relative to perfect focus",
        ),
        "peak_shift": Variable(
            ("channel", "ground_axis"),
            "real",
            "m",
            "displacement of the point target's image from its position",
            "by the least-squares match of the ranges",
        ),
    },
    "accuracy": {
        "height_error": Variable(_GRID, "real", "m", "height error, reconstructed minus true"),
        "shadow": _SHADOW,
        "mean": Variable(("region",), "real", "m", "mean height error"),
        "std": Variable(("region",), "real", "m", "standard deviation of the height error"),
        "median": Variable(("region",), "real", "m", "median height error"),
        "mad": Variable(("region",), "real", "m", "median absolute deviation of the height error"),
        "percentile_95_absolute": Variable(
            ("region",), "real", "m", "95th percentile of the absolute height error"
        ),
        "maximum_absolute": Variable(("region",), "real", "m", "largest absolute height error"),
        "fraction_within_tolerance": Variable(
            ("region",),
            "real",
            "1",
            "share of the region's cells with an error within the tolerance",
        ),
        "fraction_reconstructed": Variable(
            ("region",), "real", "1", "share of the region's cells that have a height"
        ),
        "cell_count": Variable(("region",), "integer", "1", "number of cells in the region"),
        "tolerance": Variable((), "real", "m", "height error that counts as within"),
    },
    "registration": {
        "radial": Variable(
            _SHIFT, "real", "m", "registration error, radial shift (Eqs. 6-7)", "lower minus upper"
        ),
        "equal_path": Variable(
            _SHIFT,
            "real",
            "m",
            "registration error, points of equal path and slope",
            "lower minus upper; a circle around a rail, an ellipse otherwise",
        ),
        "measured": Variable(
            _SHIFT,
            "real",
            "m",
            "registration error measured on imaged point targets",
            "lower minus upper",
        ),
        "image_shift": Variable(
            ("channel", "ground_axis", "target", "target_height"),
            "real",
            "m",
            "measured displacement of the imaged point target from its position",
        ),
        "target_position": Variable(
            ("target", "ground_axis"), "real", "m", "position of the target on the ground"
        ),
        "resolution": Variable(
            ("ground_axis", "target"), "real", "m", "resolution on the ground at the target"
        ),
        "map_radial": Variable(
            ("ground_axis", "y", "x"),
            "real",
            "m",
            "registration error over the scene, radial shift (Eqs. 6-7)",
            "lower minus upper",
        ),
        "map_equal_path": Variable(
            ("ground_axis", "y", "x"),
            "real",
            "m",
            "registration error over the scene, points of equal path and slope",
            "lower minus upper",
        ),
        "map_resolution": Variable(
            ("ground_axis", "y", "x"), "real", "m", "resolution on the ground over the scene"
        ),
        "map_height": Variable((), "real", "m", "target height of the maps"),
    },
    "coupling": {
        "scene_power": Variable(
            ("slant_range",),
            "real",
            "1",
            "mean power of the range profiles without coupling",
            "over the mean of the image's slant ranges, of all positions and channels",
        ),
        "power": Variable(
            ("weighting", "suppression", "slant_range"),
            "real",
            "1",
            "mean power of the range profiles as received",
            "over the mean of the image's slant ranges without coupling",
        ),
        "point_image": Variable(
            ("suppression", "channel", "y", "x"),
            "complex",
            "1",
            "image of a unit point target at its place after suppression",
            "amplitude 1 and phase 0 without any",
        ),
        "common_share": Variable(
            ("channel", "y", "x"),
            "real",
            "1",
            "share of a target's amplitude that is common to all positions",
        ),
    },
    "baseline_angle": {
        "length_drawn": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height under drawn errors of the baseline's length",
            "by the exact inversion",
        ),
        "length_eq5": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height from the baseline's length by Eq. 5",
        ),
        "length_exact": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height from the baseline's length by the exact derivative",
        ),
        "angle_drawn": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height under drawn errors of the baseline's attitude",
            "by the exact inversion",
        ),
        "angle_eq12": Variable(
            ("baseline_angle",),
            "real",
            "m",
            "standard deviation of the height from the baseline's attitude by Eq. 12",
        ),
        "length_error": Variable(
            (), "real", "m", "standard deviation of the error of the baseline's length"
        ),
        "angle_error": Variable(
            (), "real", "radian", "standard deviation of the error of the baseline's attitude"
        ),
    },
}

SWEEP: dict[str, Variable] = {
    name: variable
    for name, variable in PRODUCTS["accuracy"].items()
    if variable.dims == ("region",) and name != "cell_count"
} | {
    "coherence": Variable((), "real", "1", "median coherence on visible ground"),
    "residues": Variable((), "integer", "1", "residues of the filtered phase"),
    **PRODUCTS["focus"],
}
"""Variables of a sweep; the dimensions of the swept keys and of the realization come first."""

SWEEP_OF_OBJECTS: dict[str, Variable] = SWEEP | PRODUCTS["detection_accuracy"]
"""Variables of a sweep over a scene with objects."""

LABELS: dict[str, tuple[str, ...]] = {"channel": CHANNELS, "axis": AXES, "ground_axis": AXES[:2]}


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
    contents: dict[str, Any] = {}
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
        contents[name] = (dims, array, declared[name].attrs)
        sizes |= dict(zip(dims, array.shape, strict=True))
    labels: dict[str, Any] = {}
    # In one order, so that a dataset written twice is the same bytes.
    for name in sorted(sizes):
        if coords is not None and name in coords:
            values = np.asarray(coords[name])
        else:
            values = np.asarray(LABELS[name] if name in LABELS else np.arange(sizes[name]))
        labels[name] = _coordinate(name, values)
    result = xr.Dataset(
        contents,
        xr.Coordinates(
            # Copies, because a dataset's owner may change its attributes.
            {name: variable.copy(deep=False) for name, (variable, _) in labels.items()},
            {name: index for name, (_, index) in labels.items()},
        ),
    )
    check(result, product)
    return result


def _coordinate(name: str, values: NDArray[Any]) -> _Coordinate:
    # Making an index costs more than all else here, and the same few axes come again and again.
    if values.size > _LONG_AXIS:
        return _make_coordinate(name, values)
    return _remembered_coordinate(name, values.dtype.str, values.tobytes())


@lru_cache(maxsize=128)
def _remembered_coordinate(name: str, dtype: str, data: bytes) -> _Coordinate:
    return _make_coordinate(name, np.frombuffer(data, dtype).copy())


def _make_coordinate(name: str, values: NDArray[Any]) -> _Coordinate:
    made = xr.Coordinates({name: (name, values, COORDINATES[name].attrs)})
    return made.variables[name], made.xindexes[name]


def sweep_dataset(
    data: Mapping[str, Any],
    swept: Mapping[str, tuple[Any, dict[str, str]]],
    coords: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Make a sweep's product.

    Parameters
    ----------
    data
        An array for each variable of `SWEEP`, or of `SWEEP_OF_OBJECTS`: swept keys, realization,
        then its own dimensions.
    swept
        Values and attributes of each swept key's dimension, in order.
    coords
        The coordinates' values of dimensions that are neither region nor channel.

    Returns
    -------
    xarray.Dataset
        Product ``sweep``.
    """
    result = xr.Dataset()
    leading = (*swept, "realization")
    for name, values in data.items():
        variable = SWEEP_OF_OBJECTS[name]
        result[name] = ((*leading, *variable.dims), values, variable.attrs)
    for name, (labels, attrs) in swept.items():
        result = result.assign_coords({name: (name, labels, attrs)})
    own = {
        "realization": np.arange(result.sizes["realization"]),
        "region": np.array(REGIONS),
        "channel": np.array(CHANNELS),
        "ground_axis": np.array(LABELS["ground_axis"]),
    }
    for name, labels in (own | dict(coords or {})).items():
        result = result.assign_coords({name: (name, labels, COORDINATES[name].attrs)})
    return result


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
    declared = SWEEP_OF_OBJECTS.values()
    own = {"realization", *(dim for variable in declared for dim in variable.dims)}
    keys = [str(dim) for dim in data.dims if dim not in own]
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
    if product == "sweep":
        _check_sweep(data)
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


def _check_sweep(data: xr.Dataset) -> None:
    found = {str(name) for name in data.data_vars}
    declared = SWEEP_OF_OBJECTS if found - set(SWEEP) else SWEEP
    if found != set(declared):
        raise ValueError(
            f"product 'sweep' holds {sorted(found)}, but {sorted(declared)} are declared"
        )
    for name, variable in declared.items():
        dims = data[name].dims
        own = len(variable.dims)
        if dims[len(dims) - own :] != variable.dims or "realization" not in dims:
            raise ValueError(
                f"'{name}' of product 'sweep' has the dimensions {dims}, but the swept keys, "
                f"realization and {variable.dims} are declared"
            )
        for attribute, value in variable.attrs.items():
            if data[name].attrs.get(attribute) != value:
                raise ValueError(
                    f"'{name}' of product 'sweep' has {attribute}="
                    f"{data[name].attrs.get(attribute)!r}, but {value!r} is declared"
                )
