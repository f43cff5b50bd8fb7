"""Elevation models: rasters that GDAL reads, and netCDF files of heights.

What a file declares is applied: units, scale and offset, missing values, valid range, projection.
What looks wrong is a warning, what cannot be right a `ValueError` that names the cause. Only the
window that the scene needs is read.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.readers import files

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

METRES = ("m", "metre", "metres", "meter", "meters")
_FOOT, _SURVEY_FOOT = 0.3048, 1200 / 3937
LENGTHS: dict[str, float] = {
    **dict.fromkeys(METRES, 1.0),
    **dict.fromkeys(("km", "kilometre", "kilometer"), 1e3),
    **dict.fromkeys(("dm", "decimetre", "decimeter"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimeter"), 1e-2),
    **dict.fromkeys(("mm", "millimetre", "millimeter"), 1e-3),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "international_foot"), _FOOT),
    **dict.fromkeys(
        ("us-ft", "ftus", "us survey foot", "us survey feet", "us_survey_foot", "survey foot"),
        _SURVEY_FOOT,
    ),
}
"""Units of length, in lower case, in metres."""

_EAST = ("degrees_east", "degree_east", "degree_e", "degrees_e")
_NORTH = ("degrees_north", "degree_north", "degree_n", "degrees_n")
_DEGREES = ("degree", "degrees", "deg", *_EAST, *_NORTH)

# In order: the name that vinsar writes comes first, GDAL's own name for a first band last.
_HEIGHT_NAMES = ("height", "elevation", "z", "dem", "dtm", "dsm", "band1")
_HEIGHT_STANDARD_NAMES = (
    "surface_altitude",
    "altitude",
    "height",
    "height_above_geopotential_datum",
    "height_above_mean_sea_level",
    "height_above_reference_ellipsoid",
    "geometric_height",
    "bedrock_altitude",
    "ground_level_altitude",
)
_X_NAMES = ("x", "easting", "lon", "longitude")
_Y_NAMES = ("y", "northing", "lat", "latitude")

# Everest is 8,849 m high, the deepest trench 10,994 m deep, the lowest dry land 430 m.
_HIGHEST_M, _DEEPEST_M, _LOWEST_LAND_M = 9_000.0, -11_500.0, -500.0
_SENTINELS = (-9999.0, -999.0, -99999.0, -32768.0, -32767.0, 32767.0, 9999.0, 99999.0, 65535.0)

# A projection whose scale at the place is this near to 1 is taken as metres on the ground; that of
# UTM goes from 0.9996 to 1.0010.
_SCALE_TOLERANCE = 2e-3

# Fewer nodes than this along the scene are hardly its relief.
_FEWEST_STEPS = 2.0


@dataclass(frozen=True)
class Elevation:
    """Heights on the raster of a scene.

    Attributes
    ----------
    height
        Height above the ground plane (y, x), m.
    reflectivity
        Reflectivity (y, x), linear, if the file has one.
    notes
        What was applied or assumed, a sentence each.
    warnings
        What looks wrong, a sentence each.
    """

    height: Floats
    reflectivity: Floats | None
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass
class _Band:
    """A variable of a file: how to read a window of it, and its factor to SI units."""

    name: str
    read: Callable[[slice, slice], Floats]
    factor: float = 1.0


@dataclass
class _Raster:
    """An opened file.

    `to_pixel` is the affine map (a, b, c, d, e, f) from the file's coordinates to column and row,
    both counted from the middle of the first pixel; `unit` is the metres in a unit of the
    coordinates, None for degrees.
    """

    shape: tuple[int, int]
    to_pixel: tuple[float, ...]
    crs: Any
    unit: float | None
    height: _Band
    reflectivity: _Band | None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def read(
    path: str | Path,
    x: Floats,
    y: Floats,
    *,
    origin_m: tuple[float, float] = (0.0, 0.0),
    longitude_latitude_deg: tuple[float, float] | None = None,
    heading_deg: float = 0.0,
    ground_height_m: float | None = 0.0,
) -> Elevation:
    """Read heights at the nodes of a raster in the vehicle's coordinates, bilinearly.

    Parameters
    ----------
    path
        A raster that GDAL reads or a netCDF file, told by its content.
    x, y
        Axes of the raster, m: x to the right of the vehicle, y ahead of it.
    origin_m
        Easting and northing of the vehicle in the file's projection, m.
    longitude_latitude_deg
        Longitude and latitude of the vehicle on WGS 84 instead, degrees; files in degrees need it.
    heading_deg
        Direction ahead, clockwise from the file's grid north, or from true north if the file is in
        degrees.
    ground_height_m
        Height of the file that becomes 0; None for that at the vehicle's place.

    Returns
    -------
    Elevation
        Heights, reflectivity, notes and warnings.

    Raises
    ------
    ValueError
        If the file cannot be right or does not cover the raster.
    OSError
        If the file cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError("there is no such file; paths begin in the repository's folder")
    with _open(path) as raster:
        origin = _origin(raster, origin_m, longitude_latitude_deg)
        turn = np.deg2rad(heading_deg)
        east = x * np.cos(turn) + y[:, None] * np.sin(turn)
        north = -x * np.sin(turn) + y[:, None] * np.cos(turn)
        nodes = _pixels(raster, *_to_file(raster, origin, east, north))
        if ground_height_m is None:
            ground_height_m = _ground(raster, origin)
        _refuse_outside(raster, nodes, "the scene")
        raw = _sampled(raster.height, nodes, raster, sentinels=True)
        height = raw - ground_height_m
        reflectivity = None
        if raster.reflectivity is not None:
            reflectivity = _sampled(raster.reflectivity, nodes, raster)
            _refuse_negative(reflectivity)
        _warn_of_heights(raster, raw, nodes, x, y)
        return Elevation(height, reflectivity, tuple(raster.notes), tuple(raster.warnings))


def _open(path: Path) -> Any:
    with path.open("rb") as file:
        start = file.read(8)
    return _netcdf(path) if start.startswith((b"CDF", b"\x89HDF")) else _gdal(path)


# Rasters that GDAL reads


@contextmanager
def _gdal(path: Path) -> Iterator[_Raster]:
    import warnings

    import rasterio

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        opened = rasterio.open(path)
    with opened as tiff:
        if tiff.transform.is_identity:
            raise ValueError("it is not georeferenced; give it a transform (gdal_edit.py -a_ullr)")
        if min(tiff.shape) < 2:
            raise ValueError(f"it has {tiff.height} x {tiff.width} pixels; 2 x 2 are needed")
        notes: list[str] = []
        warned: list[str] = []
        unit = _crs_unit(tiff.crs, notes, warned)
        height, reflectivity = _gdal_bands(tiff, unit, notes, warned)
        inverse = ~tiff.transform
        # Values belong to the middles of the pixels.
        to_pixel = (
            inverse.a, inverse.b, inverse.c - 0.5, inverse.d, inverse.e, inverse.f - 0.5,
        )  # fmt: skip
        if tiff.crs is None:
            _warn_without_crs(tiff.bounds, abs(tiff.transform.a), warned)
        if tiff.driver == "VRT":
            notes.append(
                "it is a VRT: heights come from the files that it names, whose changes are not "
                "followed"
            )
        yield _Raster(tiff.shape, to_pixel, tiff.crs, unit, height, reflectivity, notes, warned)


def _crs_unit(crs: Any, notes: list[str], warned: list[str]) -> float | None:
    """Return the metres in a unit of a projection's coordinates, None for degrees."""
    if crs is None:
        return 1.0
    if crs.is_geographic:
        return None
    name = _crs_name(crs)
    if not crs.is_projected:
        if not _projections_known():
            raise ValueError(
                f"its coordinate system '{name}' cannot be read, because PROJ's database is "
                "missing or of another version; unset PROJ_DATA and PROJ_LIB, or reinstall rasterio"
            )
        if "ft" in name.lower() or "foot" in name.lower() or "feet" in name.lower():
            raise ValueError(
                f"its coordinate system '{name}' is a local one that speaks of feet, and of "
                "metres as its unit; give it the right one (gdal_edit.py -a_srs)"
            )
    unit_name, unit = crs.units_factor
    if not crs.is_projected:
        warned.append(
            f"its coordinate system '{name}' is a local one, of no known place; its coordinates "
            f"are taken in its unit, {unit_name}, without a check of their scale"
        )
    if unit != 1:
        notes.append(
            f"its coordinates are in {unit_name}, {unit:.9g} m each, and were converted; the "
            "vehicle's origin is given in metres"
        )
    return float(unit)


def _crs_name(crs: Any) -> str:
    wkt = str(crs.to_wkt())
    return wkt.partition('"')[2].partition('"')[0] or "unnamed"


def _projections_known() -> bool:
    from rasterio.crs import CRS
    from rasterio.errors import CRSError

    try:
        CRS.from_epsg(32632)
    except CRSError:
        return False
    return True


def _gdal_bands(
    tiff: Any, unit: float | None, notes: list[str], warned: list[str]
) -> tuple[_Band, _Band | None]:
    names = [(description or "").strip().lower() for description in tiff.descriptions]
    found = [index for index, name in enumerate(names) if name == "reflectivity"]
    others = [index for index in range(tiff.count) if index not in found]
    if not others:
        raise ValueError("its only band is called 'reflectivity'; a band of heights is needed")
    # The first of the best name; bands without one keep their order.
    rank = {name: place for place, name in enumerate(_HEIGHT_NAMES)}
    chosen = min(others, key=lambda index: rank.get(names[index], len(rank)))
    if len(others) > 1 and names[chosen] not in _HEIGHT_NAMES:
        warned.append(
            f"it has {tiff.count} bands, none called 'height' or 'elevation'; band {chosen + 1} is "
            "taken as the heights"
        )
    height = _gdal_band(tiff, chosen, notes)
    height.factor = _height_factor(tiff, chosen, unit, notes)
    reflectivity = None
    if found:
        reflectivity = _gdal_band(tiff, found[0], notes)
        reflectivity.name = "reflectivity"
        _refuse_decibels(tiff.units[found[0]])
    return height, reflectivity


def _gdal_band(tiff: Any, index: int, notes: list[str]) -> _Band:
    band, scale, offset = index + 1, tiff.scales[index], tiff.offsets[index]
    if np.issubdtype(np.dtype(_numpy_type(tiff.dtypes[index])), np.complexfloating):
        raise ValueError(
            f"band {band} is complex ({tiff.dtypes[index]}), as radar images are; heights are "
            "real numbers"
        )
    if (scale, offset) != (1.0, 0.0):
        notes.append(f"band {band} is stored with scale {scale:g} and offset {offset:g}; applied")

    def values(rows: slice, columns: slice) -> Floats:
        from rasterio.windows import Window

        window = Window.from_slices((rows.start, rows.stop), (columns.start, columns.stop))
        stored = tiff.read(band, window=window, masked=True).astype(float)
        return np.asarray((stored * scale + offset).filled(np.nan))

    return _Band("height", values)


def _numpy_type(name: str) -> str:
    # GDAL's complex integers have no type of NumPy's.
    return "complex64" if name.startswith("complex_int") else name


def _height_factor(tiff: Any, index: int, unit: float | None, notes: list[str]) -> float:
    declared = (tiff.units[index] or "").strip() or _vertical_unit(tiff.crs)
    if declared:
        if declared.lower() not in LENGTHS:
            raise ValueError(
                f"band {index + 1}, the height, is in '{declared}'; metres or another known unit "
                "of length are needed (gdal_edit.py -units)"
            )
        factor = LENGTHS[declared.lower()]
        if factor != 1:
            notes.append(f"heights are in {declared}, {factor:.9g} m each, and were converted")
        return factor
    if unit not in (None, 1.0):
        raise ValueError(
            f"its coordinates are in units of {unit:.9g} m and band {index + 1}, the height, "
            "declares none; write it into the file (gdal_edit.py -units m, or -units ft)"
        )
    notes.append("heights declare no unit and are taken as metres")
    return 1.0


def _vertical_unit(crs: Any) -> str:
    """Return the unit of a compound system's heights, or nothing."""
    import re

    wkt = "" if crs is None else str(crs.to_wkt())
    at = wkt.find("VERT_CS")
    found = re.search(r'UNIT\["([^"]+)"', wkt[at:]) if at >= 0 else None
    return "" if found is None else found.group(1)


def _warn_without_crs(bounds: Any, step: float, warned: list[str]) -> None:
    like_degrees = (
        max(abs(bounds.left), abs(bounds.right)) <= 360
        and max(abs(bounds.bottom), abs(bounds.top)) <= 90
        and step < 0.01
    )
    warned.append(
        "it declares no coordinate system; its coordinates are taken as metres"
        + (", though they look like degrees (gdal_edit.py -a_srs EPSG:4326)" * like_degrees)
    )


# netCDF


@contextmanager
def _netcdf(path: Path) -> Iterator[_Raster]:
    import xarray as xr

    try:
        opened = xr.open_dataset(path, engine="netcdf4", decode_times=False)
    except Exception as error:  # whatever foreign bytes bring about
        raise OSError(str(error)) from error
    with opened:
        notes: list[str] = []
        warned: list[str] = []
        name = _height_name(opened)
        falling = [axis for axis, values in _axes(opened, name) if values[0] > values[-1]]
        stored = opened.isel({axis: slice(None, None, -1) for axis in falling})
        axes = _axes(stored, name)
        crs, unit = _netcdf_crs(stored, name, axes, notes, warned)
        height = _netcdf_band(stored, name, axes, notes)
        height.factor = _netcdf_height_factor(stored, name, notes, warned)
        reflectivity = None
        for other in map(str, stored.data_vars):
            if other.lower() == "reflectivity" and other != name:
                _refuse_decibels(stored[other].attrs.get("units"))
                reflectivity = _netcdf_band(stored, other, axes, notes)
                reflectivity.name = "reflectivity"
        if name != "height":
            notes.append(f"variable '{name}' is taken as the heights")
        yield _Raster(
            (axes[0][1].size, axes[1][1].size), _affine(axes), crs, unit, height, reflectivity,
            notes, warned,
        )  # fmt: skip


_Axes = tuple[tuple[str, "Floats"], tuple[str, "Floats"]]


def _height_name(stored: xr.Dataset) -> str:
    names = {str(name).lower(): str(name) for name in stored.data_vars}
    for name in _HEIGHT_NAMES:
        if name in names:
            return names[name]
    found = [
        str(name)
        for name in stored.data_vars
        if stored[name].attrs.get("standard_name") in _HEIGHT_STANDARD_NAMES
    ]
    if len(found) > 1:
        raise ValueError(
            f"it has {len(found)} variables of heights, {', '.join(found)}; call one 'height'"
        )
    if not found:
        has = ", ".join(sorted(map(str, stored.variables))) or "none"
        raise ValueError(
            f"it lacks the variable 'height' of dimensions ('y', 'x'), or 'elevation', 'z', "
            f"'Band1', or one with a standard name such as surface_altitude; it has {has}"
        )
    return found[0]


def _axes(stored: xr.Dataset, name: str) -> _Axes:
    """Return name and values of the axis y (north) and of the axis x (east)."""
    dims = [str(dim) for dim in stored[name].dims]
    found: dict[str, str] = {}
    for dim in dims:
        for axis in "xy":
            if _lies_along(stored, dim, axis):
                found[axis] = dim
    if len(dims) != 2 or set(found) != {"x", "y"}:
        if len(dims) == 2:
            for axis in "yx":
                if axis in dims and axis not in stored.variables:
                    raise ValueError(f"it lacks the variable '{axis}' of dimensions ('{axis}',)")
        raise ValueError(
            f"variable '{name}' has the dimensions {tuple(dims)}; two are needed, y and x or "
            "latitude and longitude"
        )
    for axis in "yx":
        if found[axis] not in stored.variables:
            raise ValueError(
                f"it lacks the variable '{found[axis]}' of dimensions ('{found[axis]}',)"
            )
    return (found["y"], _even(stored, found["y"])), (found["x"], _even(stored, found["x"]))


def _lies_along(stored: xr.Dataset, dim: str, axis: str) -> bool:
    names = _X_NAMES if axis == "x" else _Y_NAMES
    if dim.lower() in names:
        return True
    attrs = stored[dim].attrs if dim in stored.variables else {}
    standard = (f"projection_{axis}_coordinate", "longitude" if axis == "x" else "latitude")
    units = _EAST if axis == "x" else _NORTH
    return (
        attrs.get("standard_name") in standard
        or str(attrs.get("axis", "")).lower() == axis
        or str(attrs.get("units", "")).lower() in units
    )


def _even(stored: xr.Dataset, name: str) -> Floats:
    """Return an axis in its own unit, which rises or falls in even steps."""
    if stored[name].dims != (name,) or stored[name].dtype.kind not in "fiu":
        raise ValueError(f"variable '{name}' is not an axis of numbers")
    values = np.asarray(stored[name].values, dtype=float)
    return files.even(name, values)


def _affine(axes: _Axes) -> tuple[float, ...]:
    (_, y), (_, x) = axes
    by_x, by_y = (x.size - 1) / (x[-1] - x[0]), (y.size - 1) / (y[-1] - y[0])
    return by_x, 0.0, -x[0] * by_x, 0.0, by_y, -y[0] * by_y


def _netcdf_crs(
    stored: xr.Dataset, name: str, axes: _Axes, notes: list[str], warned: list[str]
) -> tuple[Any, float | None]:
    from rasterio.crs import CRS
    from rasterio.errors import CRSError

    units = {}
    for axis, _ in axes:
        unit = stored[axis].attrs.get("units")
        if unit is None or str(unit).lower() not in (*LENGTHS, *_DEGREES):
            given = "no units" if unit is None else f"the units '{unit}'"
            raise ValueError(f"variable '{axis}' has {given}; convert it and write units 'm'")
        units[axis] = str(unit).lower()
    kinds = {unit in _DEGREES for unit in units.values()}
    if len(kinds) > 1 or len({LENGTHS.get(unit) for unit in units.values()}) > 1:
        shown = " and ".join(f"variable '{axis}' has the units '{units[axis]}'" for axis in units)
        raise ValueError(f"{shown}; both need the same, metres or degrees")
    mapping = stored[name].attrs.get("grid_mapping", stored[name].encoding.get("grid_mapping"))
    wkt = None
    if mapping in stored.variables:
        attrs = stored[mapping].attrs
        wkt = attrs.get("crs_wkt") or attrs.get("spatial_ref")
        if wkt is None:
            warned.append(f"the projection in '{mapping}' has no crs_wkt and is not checked")
    try:
        crs = None if wkt is None else CRS.from_wkt(wkt)
    except CRSError as error:
        raise ValueError(f"its coordinate system cannot be read ({error})") from error
    if kinds == {True}:
        if crs is not None and not crs.is_geographic:
            raise ValueError("its axes are in degrees, but its projection is not geographic")
        if crs is None:
            notes.append("its degrees are taken as longitude and latitude on WGS 84")
        return CRS.from_epsg(4326) if crs is None else crs, None
    if crs is not None and crs.is_geographic:
        raise ValueError("its axes are in metres, but its coordinate system is geographic")
    factor = LENGTHS[next(iter(units.values()))]
    if factor != 1:
        unit = next(iter(units.values()))
        notes.append(
            f"its coordinates are in {unit}, {factor:.9g} m each, and were converted; the "
            "vehicle's origin is given in metres"
        )
    return crs, factor


def _netcdf_height_factor(
    stored: xr.Dataset, name: str, notes: list[str], warned: list[str]
) -> float:
    unit = stored[name].attrs.get("units")
    if unit is None and name == "Band1":  # as GDAL writes bands without a unit
        warned.append("variable 'Band1' has no units and is taken as metres")
        return 1.0
    if unit is None or str(unit).lower() not in LENGTHS:
        given = "no units" if unit is None else f"the units '{unit}'"
        raise ValueError(f"variable '{name}' has {given}; convert it and write units 'm'")
    factor = LENGTHS[str(unit).lower()]
    if factor != 1:
        notes.append(f"variable '{name}' is in {unit}, {factor:.9g} m each, and was converted")
    return factor


def _netcdf_band(stored: xr.Dataset, name: str, axes: _Axes, notes: list[str]) -> _Band:
    array = stored[name]
    dims = (axes[0][0], axes[1][0])
    if set(array.dims) != set(dims):
        raise ValueError(f"variable '{name}' has the dimensions {array.dims}; {dims} are needed")
    if array.dtype.kind not in "fiu":
        raise ValueError(f"variable '{name}' is {array.dtype}; real numbers are needed")
    least, most = _valid_range(array, notes)

    def values(rows: slice, columns: slice) -> Floats:
        part = array.isel({dims[0]: rows, dims[1]: columns}).transpose(*dims)
        found = np.array(part.values, dtype=float)
        found[(found < least) | (found > most)] = np.nan
        return found

    return _Band("height", values)


def _valid_range(array: xr.DataArray, notes: list[str]) -> tuple[float, float]:
    """Return the least and the largest valid value, unpacked, as CF section 2.5.1 has them."""
    attrs, encoding = array.attrs, array.encoding
    least, most = attrs.get("valid_range", (attrs.get("valid_min"), attrs.get("valid_max")))
    if least is None and most is None:
        return -np.inf, np.inf
    scale = float(encoding.get("scale_factor", 1.0))
    offset = float(encoding.get("add_offset", 0.0))
    stored_type = np.dtype(encoding.get("dtype", array.dtype))
    given = np.asarray(most if least is None else least)
    # Of the packed values' type the range is packed, too; of a wider one it is not.
    packed = (scale, offset) != (1.0, 0.0) and given.dtype.kind in "iu" and stored_type.kind in "iu"
    ends = [
        fallback if end is None else float(end) * scale + offset if packed else float(end)
        for end, fallback in ((least, -np.inf), (most, np.inf))
    ]
    low, high = min(ends), max(ends)
    notes.append(
        f"variable '{array.name}' declares {low:g} to {high:g} as valid; other values count as "
        "missing"
    )
    return low, high


# Places


def _origin(
    raster: _Raster,
    origin_m: tuple[float, float],
    longitude_latitude_deg: tuple[float, float] | None,
) -> tuple[float, float]:
    """Return the vehicle's place in the file's own coordinates."""
    from rasterio.crs import CRS
    from rasterio.warp import transform

    if longitude_latitude_deg is not None:
        if raster.crs is None:
            raise ValueError(
                "it declares no coordinate system, so longitude and latitude have no place in it; "
                "give the vehicle's easting and northing"
            )
        given = [[value] for value in longitude_latitude_deg]
        (east,), (north,) = transform(CRS.from_epsg(4326), raster.crs, *given)
        return float(east), float(north)
    if raster.unit is None:
        raise ValueError(
            "its coordinates are degrees; give the vehicle's place as "
            "scene.origin_longitude_deg and scene.origin_latitude_deg"
        )
    return origin_m[0] / raster.unit, origin_m[1] / raster.unit


def _to_file(
    raster: _Raster, origin: tuple[float, float], east: Floats, north: Floats
) -> tuple[Floats, Floats]:
    """Return offsets from the vehicle, m, to grid east and north, as coordinates of the file."""
    frame = _local_frame(raster, origin)
    if frame is None:
        unit = raster.unit or 1.0
        return origin[0] + east / unit, origin[1] + north / unit
    from rasterio.warp import transform

    local, convergence = frame
    true_east = east * np.cos(convergence) + north * np.sin(convergence)
    true_north = -east * np.sin(convergence) + north * np.cos(convergence)
    places = transform(local, raster.crs, true_east.ravel(), true_north.ravel())
    first, second = (np.asarray(place).reshape(east.shape) for place in places)
    return first, second


def _local_frame(raster: _Raster, origin: tuple[float, float]) -> tuple[Any, float] | None:
    """Return a local metric system about the vehicle and grid north's direction in it, clockwise.

    None where the file's own coordinates are metres on the ground.
    """
    from rasterio.crs import CRS
    from rasterio.errors import CRSError
    from rasterio.warp import transform

    if raster.crs is None or not (raster.crs.is_geographic or raster.crs.is_projected):
        return None
    try:
        (longitude,), (latitude,) = transform(
            raster.crs, CRS.from_epsg(4326), [origin[0]], [origin[1]]
        )
        if not np.isfinite([longitude, latitude]).all():
            raise ValueError("the vehicle's place lies outside its projection")
        # Equidistant from the vehicle: distances and directions from it are true.
        local = CRS.from_string(
            f"+proj=aeqd +lat_0={latitude:.12f} +lon_0={longitude:.12f} +datum=WGS84 +units=m"
        )
        if raster.unit is None:
            raster.notes.append(
                "its degrees were brought into metres about the vehicle; the heading counts from "
                "true north"
            )
            return local, 0.0
        step = 10.0 / raster.unit
        fan = np.array([[step, 0], [-step, 0], [0, step], [0, -step]]) + origin
        found = np.array(transform(raster.crs, local, fan[:, 0], fan[:, 1]))
    except CRSError as error:
        raise ValueError(f"its coordinate system cannot be related to WGS 84 ({error})") from error
    # Metres on the ground for each metre along the file's axes.
    by_x, by_y = (found[:, 0] - found[:, 1]) / 20, (found[:, 2] - found[:, 3]) / 20
    scale_x, scale_y = float(np.hypot(*by_x)), float(np.hypot(*by_y))
    skew = float(by_x @ by_y) / (scale_x * scale_y)
    if max(abs(scale_x - 1), abs(scale_y - 1), abs(skew)) <= _SCALE_TOLERANCE:
        return None
    raster.notes.append(
        f"a metre of its projection '{_crs_name(raster.crs)}' is {scale_x:.4f} m east and "
        f"{scale_y:.4f} m north on the ground at the vehicle; heights were brought into metres on "
        "the ground"
    )
    return local, float(np.arctan2(by_y[0], by_y[1]))


def _pixels(raster: _Raster, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Return rows and columns; rounded, so that a place on a node is not beside it."""
    a, b, c, d, e, f = raster.to_pixel
    return np.round(d * first + e * second + f, 6), np.round(a * first + b * second + c, 6)


def _inside(raster: _Raster, nodes: tuple[Floats, Floats]) -> bool:
    return all(
        node.min() >= 0 and node.max() <= size - 1
        for node, size in zip(nodes, raster.shape, strict=True)
    )


def _refuse_outside(raster: _Raster, nodes: tuple[Floats, Floats], what: str) -> None:
    if _inside(raster, nodes):
        return
    mark = "degrees" if raster.unit is None else "m"
    corners = _coordinates(raster, np.array([0, 0, *raster.shape]) - [0, 0, 1, 1])
    needed = _coordinates(raster, np.array(
        [nodes[0].min(), nodes[1].min(), nodes[0].max(), nodes[1].max()]
    ))  # fmt: skip
    if what != "the scene":
        raise ValueError(
            f"{what}: its x goes from {corners[0][0]:.12g} to {corners[0][1]:.12g} {mark}, its y "
            f"from {corners[1][0]:.12g} to {corners[1][1]:.12g} {mark}; mend the vehicle's origin, "
            "or give scene.ground_height_m, the file's height under the vehicle"
        )
    for name, has, wants in zip("yx", corners[::-1], needed[::-1], strict=True):
        if wants[0] < has[0] or wants[1] > has[1]:
            raise ValueError(
                f"its {name} goes from {has[0]:.12g} to {has[1]:.12g} {mark}, but "
                f"{wants[0]:.12g} to {wants[1]:.12g} {mark} are needed; move or shrink the scene, "
                "or mend origin and heading"
            )
    raise ValueError("the scene reaches beyond its rotated raster; move or shrink the scene")


def _coordinates(raster: _Raster, box: Floats) -> list[tuple[float, float]]:
    """Return the least and largest x and y, in metres or degrees, of a box of rows and columns."""
    a, b, c, d, e, f = raster.to_pixel
    inverse = np.linalg.inv(np.array([[a, b], [d, e]]))
    rows, columns = box[[0, 2]], box[[1, 3]]
    corners = np.array([(column - c, row - f) for row in rows for column in columns])
    places = corners @ inverse.T * (raster.unit or 1.0)
    return [
        (float(low), float(high)) for low, high in zip(places.min(0), places.max(0), strict=True)
    ]


def _ground(raster: _Raster, origin: tuple[float, float]) -> float:
    place = _pixels(raster, np.array([origin[0]]), np.array([origin[1]]))
    unit = raster.unit or 1.0
    _refuse_outside(
        raster,
        place,
        f"the vehicle, at x = {origin[0] * unit:.12g}, y = {origin[1] * unit:.12g}, lies outside "
        "the file",
    )
    return float(_sampled(raster.height, place, raster, sentinels=True)[0])


# Values


def _sampled(
    band: _Band, nodes: tuple[Floats, Floats], raster: _Raster, *, sentinels: bool = False
) -> Floats:
    from scipy.ndimage import map_coordinates

    low = [int(np.floor(node.min())) for node in nodes]
    high = [int(np.ceil(node.max())) + 1 for node in nodes]
    known = band.read(slice(low[0], high[0]), slice(low[1], high[1])) * band.factor
    if sentinels:
        _refuse_impossible(known, band.factor)
    shifted = [node - first for node, first in zip(nodes, low, strict=True)]
    # A neighbour without a value counts if it has a weight.
    missing = ~np.isfinite(known)
    known[missing] = 0
    found = np.asarray(map_coordinates(known, shifted, order=1, mode="nearest"))
    weight = map_coordinates(missing.astype(float), shifted, order=1, mode="nearest")
    unknown = weight > 0
    if unknown.any():
        first = np.unravel_index(np.argmax(unknown), found.shape)
        row, column = float(nodes[0][first]), float(nodes[1][first])
        ((x, _), (y, _)) = _coordinates(raster, np.array([row, column, row, column]))
        mark = "degrees" if raster.unit is None else "m"
        raise ValueError(
            f"variable '{band.name}' has no value at x = {x:.12g} {mark}, y = {y:.12g} {mark}, one "
            f"of {unknown.sum()} places without; fill the gaps, or move or shrink the scene"
        )
    return found


def _refuse_impossible(height: Floats, factor: float) -> None:
    for sentinel in _SENTINELS:
        count = int((height == sentinel * factor).sum())
        # 9999 and -999 may be a height; -9999 and the ends of integers on land may not.
        if count and not _LOWEST_LAND_M < sentinel * factor < _HIGHEST_M:
            raise ValueError(
                f"{count} of its heights are {sentinel:g}, which marks missing values and is not "
                f"declared as such; declare it (gdal_edit.py -a_nodata {sentinel:g}; _FillValue in "
                "netCDF)"
            )
    with np.errstate(invalid="ignore"):
        wrong = (height < _DEEPEST_M) | (height > _HIGHEST_M)
    if wrong.any():
        worst = height[wrong][0]
        raise ValueError(
            f"{wrong.sum()} of its heights are beyond any on Earth, such as {worst:g} m; declare "
            "missing values (nodata, _FillValue), scale, offset and unit"
        )


def _refuse_decibels(unit: str | None) -> None:
    if unit is not None and "db" in str(unit).lower():
        raise ValueError(
            f"its reflectivity is in '{unit}'; convert it: 10^(dB/20) for echo.reflectivity "
            "'amplitude', 10^(dB/10) for 'power'"
        )


def _refuse_negative(reflectivity: Floats) -> None:
    if reflectivity.min() < 0:
        raise ValueError(
            f"variable 'reflectivity' falls to {reflectivity.min():.3f}; it must not be negative, "
            "so it may be in dB: convert it to linear values"
        )


def _warn_of_heights(
    raster: _Raster, raw: Floats, nodes: tuple[Floats, Floats], x: Floats, y: Floats
) -> None:
    size = float(x[-1] - x[0]), float(y[-1] - y[0])
    # Corners in pixels along x and along y, whatever the heading.
    across = [np.hypot(node_r, node_c) for node_r, node_c in (
        (nodes[0][0, -1] - nodes[0][0, 0], nodes[1][0, -1] - nodes[1][0, 0]),
        (nodes[0][-1, 0] - nodes[0][0, 0], nodes[1][-1, 0] - nodes[1][0, 0]),
    )]  # fmt: skip
    if min(across) < _FEWEST_STEPS:
        step = max(length / steps for length, steps in zip(size, across, strict=True))
        raster.warnings.append(
            f"its nodes are {step:.3g} m apart and the scene is {size[0]:.3g} m x {size[1]:.3g} m: "
            "within it the terrain is little more than a plane between them"
        )
    relief = float(np.ptp(raw))
    if relief > np.hypot(*size):
        raster.warnings.append(
            f"its heights range over {relief:.4g} m within a scene of {size[0]:.3g} m x "
            f"{size[1]:.3g} m; check unit, scale and missing values"
        )
    if raw.min() < _LOWEST_LAND_M:
        raster.warnings.append(
            f"its heights go down to {raw.min():.4g} m, below all dry land; check unit, scale and "
            "missing values"
        )
    if relief == 0 and raw.size > 1:
        raster.warnings.append("all of its heights in the scene are the same")
