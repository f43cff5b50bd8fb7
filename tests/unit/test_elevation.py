"""Elevation models: what a file declares is applied, what looks wrong is said or refused.

A plane is interpolated bilinearly without error, so that it comes back to rounding (1e-6 of a
pixel) whatever unit, scale, projection or heading the file has.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
import rasterio
import xarray as xr
from rasterio.crs import CRS
from rasterio.warp import transform

from vinsar.readers import elevation

X, Y = np.linspace(-3, 3, 13), np.linspace(10, 16, 13)
PLACE = {"origin_m": (500_030.0, 5_500_020.0), "ground_height_m": 100.0}
NORTH_UP = rasterio.Affine(1, 0, 500_000, 0, -1, 5_500_060)


def geotiff(
    path, values=None, *, crs="EPSG:32632", place=NORTH_UP, dtype="float64", units=(),
    scale=1.0, offset=0.0, names=(), nodata=None, driver="GTiff", **profile
):  # fmt: skip
    """Write bands, or a plane of 60 m x 60 m: 100 + 0.01 E' + 0.02 N', seen from its corner."""
    pixel = np.arange(60) + 0.5
    plane = 100 + 0.01 * pixel + 0.02 * (60 - pixel[:, None])
    bands = np.asarray(plane if values is None else values)
    bands = bands[None] if bands.ndim == 2 else bands
    with rasterio.open(
        path, "w", driver=driver, width=bands.shape[2], height=bands.shape[1], count=len(bands),
        dtype=dtype, crs=crs, transform=place, nodata=nodata, **profile
    ) as tiff:  # fmt: skip
        tiff.write(bands.astype(dtype))
        if units:
            tiff.units = units
        if (scale, offset) != (1.0, 0.0):
            tiff.scales, tiff.offsets = (scale,) * len(bands), (offset,) * len(bands)
        for band, name in enumerate(names, 1):
            tiff.set_band_description(band, name)
    return path


def plane(x=X, y=Y):
    """Return the plane at the places of the scene, with heights from 100 m on."""
    return 0.01 * (30 + x) + 0.02 * (20 + y[:, None])


def said(found, word):
    return [sentence for sentence in (*found.notes, *found.warnings) if word in sentence]


def refused(path, word, **place):
    with pytest.raises(ValueError, match=word) as caught:
        elevation.read(path, X, Y, **(PLACE | place))
    assert "\n" not in str(caught.value)


# What a file declares


def test_a_plane_comes_back(tmp_path):
    found = elevation.read(geotiff(tmp_path / "plane.tif", units=["m"]), X, Y, **PLACE)
    np.testing.assert_allclose(found.height, plane(), atol=1e-7)
    assert found.notes == ()
    assert found.warnings == ()


def test_scale_and_offset_are_applied(tmp_path):
    pixel = np.arange(60)
    stored = 1000 + 2 * pixel + 0 * pixel[:, None]
    path = geotiff(tmp_path / "packed.tif", stored, dtype="uint16", scale=0.1, offset=-20.0)
    found = elevation.read(path, X, Y, **PLACE)
    # Column E' - 0.5 holds 1000 + 2 (E' - 0.5), times 0.1 less 20 m.
    expected = np.broadcast_to(80 + 0.2 * (30 + X - 0.5) - 100, found.height.shape)
    np.testing.assert_allclose(found.height, expected, atol=1e-6)
    assert said(found, "scale 0.1 and offset -20")


@pytest.mark.parametrize(
    ("unit", "metres"), [("ft", 0.3048), ("US survey foot", 1200 / 3937), ("cm", 0.01)]
)
def test_heights_in_other_units_are_converted(tmp_path, unit, metres):
    path = geotiff(tmp_path / "plane.tif", units=[unit])
    found = elevation.read(path, X, Y, **(PLACE | {"ground_height_m": 100 * metres}))
    np.testing.assert_allclose(found.height, metres * plane(), atol=1e-7)
    assert said(found, f"heights are in {unit}")


def test_a_projection_in_feet_is_converted_and_keeps_its_size(tmp_path):
    foot = 1200 / 3937
    place = rasterio.Affine(1 / foot, 0, 6_500_000, 0, -1 / foot, 2_000_060)
    path = geotiff(tmp_path / "feet.tif", crs="EPSG:2225", place=place, units=["m"])
    origin = 6_500_000 * foot + 30, 2_000_060 * foot - 40
    found = elevation.read(path, X, Y, origin_m=origin, ground_height_m=100.0)
    np.testing.assert_allclose(found.height, plane(), atol=1e-6)
    assert said(found, "in US survey foot, 0.30480061 m each")


def test_heights_without_unit_in_a_projection_in_feet_are_refused(tmp_path):
    place = rasterio.Affine(1, 0, 6_500_000, 0, -1, 2_000_060)
    refused(geotiff(tmp_path / "feet.tif", crs="EPSG:2225", place=place), "declares none")


def test_feet_are_not_metres_when_the_projections_cannot_be_looked_up(tmp_path):
    place = rasterio.Affine(1, 0, 6_500_000, 0, -1, 2_000_060)
    path = geotiff(tmp_path / "feet.tif", crs="EPSG:2225", place=place, units=["m"])
    code = (
        "import sys, numpy as np\n"
        "from vinsar.readers import elevation\n"
        "try: elevation.read(sys.argv[1], np.arange(3.0), np.arange(3.0))\n"
        "except ValueError as error: print(error)"
    )
    nowhere = {"PROJ_DATA": str(tmp_path), "PROJ_LIB": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code, path],
        env=os.environ | nowhere,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "PROJ's database" in done.stdout


def slope(crs, place, shape, longitude, latitude, by_east, by_north):
    """Return a plane over true metres about a place, at the nodes of a raster in another system."""
    local = CRS.from_string(f"+proj=aeqd +lat_0={latitude} +lon_0={longitude} +datum=WGS84")
    rows, columns = np.mgrid[: shape[0], : shape[1]] + 0.5
    first, second = place @ (columns.ravel(), rows.ravel())
    east, north = transform(CRS.from_user_input(crs), local, first, second)
    return (by_east * np.asarray(east) + by_north * np.asarray(north)).reshape(shape)


@pytest.mark.parametrize("heading", [0.0, 40.0])
@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3857", "EPSG:3995"])
def test_degrees_and_stretched_projections_become_metres_on_the_ground(tmp_path, crs, heading):
    longitude, latitude = 10.0, 52.0
    (first,), (second,) = transform("EPSG:4326", crs, [longitude], [latitude])
    step = 1e-5 if crs == "EPSG:4326" else 1.0
    place = rasterio.Affine(step, 0, first - 40 * step, 0, -step, second + 40 * step)
    values = slope(crs, place, (80, 80), longitude, latitude, 0.03, 0.05)
    path = geotiff(tmp_path / "other.tif", values, crs=crs, place=place, units=["m"])
    found = elevation.read(
        path, X, Y, longitude_latitude_deg=(longitude, latitude), heading_deg=heading
    )
    # Grid north is true north, but on the polar map at 10 degrees east the pole lies 10 degrees to
    # the left of it.
    turn = np.deg2rad(heading + 10 if crs == "EPSG:3995" else heading)
    east = X * np.cos(turn) + Y[:, None] * np.sin(turn)
    north = -X * np.sin(turn) + Y[:, None] * np.cos(turn)
    # A millionth of a pixel, and the raster's own curvature over 16 m: 16^2 / 2R = 20 um.
    np.testing.assert_allclose(found.height, 0.03 * east + 0.05 * north, atol=5e-6)
    assert said(found, "metres about" if crs == "EPSG:4326" else "on the ground")


def test_longitude_and_latitude_find_the_place_in_utm(tmp_path):
    path = geotiff(tmp_path / "plane.tif", units=["m"])
    (longitude,), (latitude,) = transform("EPSG:32632", "EPSG:4326", [500_030], [5_500_020])
    found = elevation.read(
        path, X, Y, longitude_latitude_deg=(longitude, latitude), ground_height_m=100.0
    )
    np.testing.assert_allclose(found.height, plane(), atol=1e-6)


def test_degrees_need_longitude_and_latitude(tmp_path):
    path = geotiff(tmp_path / "plane.tif", crs="EPSG:4326")
    refused(path, "scene.origin_longitude_deg")


def test_a_rotated_raster_is_the_same_ground(tmp_path):
    to_middle, back = rasterio.Affine.translation(30, 30), rasterio.Affine.translation(-40, -40)
    place = NORTH_UP @ to_middle @ rasterio.Affine.rotation(30) @ back
    rows, columns = np.mgrid[:80, :80] + 0.5
    east, north = place @ (columns, rows)
    values = 100 + 0.01 * (east - 500_000) + 0.02 * (north - 5_500_000)
    path = geotiff(tmp_path / "turned.tif", values, place=place, units=["m"])
    found = elevation.read(path, X, Y, **PLACE)
    np.testing.assert_allclose(found.height, plane(), atol=1e-6)


@pytest.mark.parametrize(
    ("driver", "name"), [("HFA", "plane.img"), ("GTiff", "plane.cog"), ("AAIGrid", "plane.asc")]
)
def test_other_rasters_are_told_by_their_content(tmp_path, driver, name):
    source = geotiff(tmp_path / "plane.tif")
    if driver == "AAIGrid":
        from rasterio.shutil import copy

        copy(source, tmp_path / name, driver=driver, DECIMAL_PRECISION=9)
    else:
        geotiff(tmp_path / name, driver=driver)
    found = elevation.read(tmp_path / name, X, Y, **PLACE)
    # AAIGrid writes single precision, 4e-6 m of 100 m.
    np.testing.assert_allclose(found.height, plane(), atol=2e-5)


def test_a_virtual_raster_says_that_it_leads_on(tmp_path):
    from rasterio.shutil import copy

    copy(geotiff(tmp_path / "plane.tif"), tmp_path / "plane.vrt", driver="VRT")
    found = elevation.read(tmp_path / "plane.vrt", X, Y, **PLACE)
    np.testing.assert_allclose(found.height, plane(), atol=1e-7)
    assert said(found, "VRT")


# Bands


def test_a_band_of_reflectivity_is_never_the_heights(tmp_path):
    heights = np.full((60, 60), 101.0)
    bands = [np.full((60, 60), 0.25), heights]
    path = geotiff(tmp_path / "two.tif", bands, names=["Reflectivity", ""])
    found = elevation.read(path, X, Y, **PLACE)
    np.testing.assert_allclose(found.height, 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.reflectivity, 0.25, rtol=1e-12)


def test_reflectivity_alone_is_refused(tmp_path):
    path = geotiff(tmp_path / "one.tif", names=["reflectivity"])
    refused(path, "only band is called 'reflectivity'")


@pytest.mark.parametrize(("unit", "word"), [("dB", "in 'dB'"), ("", "may be in dB")])
def test_decibels_are_not_taken_as_linear(tmp_path, unit, word):
    bands = [np.full((60, 60), 101.0), np.full((60, 60), -12.0)]
    path = geotiff(tmp_path / "two.tif", bands, names=["", "reflectivity"], units=["m", unit])
    refused(path, word)


def test_complex_rasters_are_refused(tmp_path):
    path = geotiff(tmp_path / "slc.tif", np.full((60, 60), 101.0), dtype="complex64")
    refused(path, "band 1 is complex")


def test_several_bands_without_names_are_warned_of(tmp_path):
    found = elevation.read(
        geotiff(tmp_path / "rgb.tif", np.full((3, 60, 60), 101.0)), X, Y, **PLACE
    )
    assert said(found, "none called 'height'")


# What cannot be right


@pytest.mark.parametrize("sentinel", [-9999.0, -32768.0, -999.0, 3.4e38, -3.4e38])
def test_missing_values_that_are_not_declared_are_named(tmp_path, sentinel):
    values = np.full((60, 60), 101.0)
    values[28, 31] = sentinel
    path = geotiff(tmp_path / "gap.tif", values)
    word = f"{sentinel:g}"
    refused(path, word.replace("+", r"\+"))
    # Elsewhere it does no harm.
    far = elevation.read(path, X, np.linspace(0, 5, 6), **PLACE)
    np.testing.assert_allclose(far.height, 1.0)


def test_missing_values_that_are_declared_are_a_gap(tmp_path):
    values = np.full((60, 60), 101.0)
    values[28, 31] = -9999
    refused(geotiff(tmp_path / "gap.tif", values, nodata=-9999), "has no value at x = 50003")


def test_a_vehicle_outside_the_file_is_the_cause(tmp_path):
    path = geotiff(tmp_path / "plane.tif")
    refused(path, "the vehicle.*lies outside", origin_m=(0.0, 0.0), ground_height_m=None)
    refused(path, "move or shrink the scene", origin_m=(500_030.0, 5_500_050.0))


# What looks wrong


def test_a_raster_wider_than_the_scene_is_a_plane_in_words(tmp_path):
    place = rasterio.Affine(500, 0, 490_000, 0, -500, 5_510_000)
    path = geotiff(tmp_path / "coarse.tif", place=place, units=["m"])
    found = elevation.read(path, X, Y, **PLACE)
    assert said(found, "nodes are 500 m apart and the scene is 6 m x 6 m")


def test_a_range_beyond_reason_is_warned_of(tmp_path):
    values = 100.0 + 30 * (np.indices((60, 60)).sum(axis=0) % 2)
    found = elevation.read(geotiff(tmp_path / "rough.tif", values), X, Y, **PLACE)
    assert said(found, "range over 30 m within a scene of 6 m x 6 m")


def test_depths_below_all_land_are_warned_of(tmp_path):
    path = geotiff(tmp_path / "deep.tif", np.full((60, 60), -2000.0))
    found = elevation.read(path, X, Y, **PLACE)
    assert said(found, "below all dry land")
    assert said(found, "are the same")


def test_no_coordinate_system_is_said(tmp_path):
    found = elevation.read(geotiff(tmp_path / "plane.tif", crs=None), X, Y, **PLACE)
    assert said(found, "no coordinate system")
    small = rasterio.Affine(1e-4, 0, 10, 0, -1e-4, 52)
    path = geotiff(tmp_path / "degrees.tif", crs=None, place=small)
    found = elevation.read(path, X * 1e-4, X * 1e-4, origin_m=(10.003, 51.997))
    assert said(found, "look like degrees")


def test_only_the_window_is_read(tmp_path):
    side = 3000
    path = geotiff(
        tmp_path / "large.tif", np.full((side, side), 101.0), dtype="float32", tiled=True,
        place=rasterio.Affine(1, 0, 499_000, 0, -1, 5_501_000),
    )  # fmt: skip
    tracemalloc.start()
    elevation.read(path, X, Y, **PLACE)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # The whole has 72 MB in double precision; most of the megabytes are modules first imported.
    assert peak < 36e6


# netCDF


def heights(name="height", **attrs):
    x, y = 500_000 + np.arange(61.0), 5_500_000 + np.arange(61.0)
    values = 100 + 0.01 * (x - x[0]) + 0.02 * (y - y[0])[:, None]
    return xr.Dataset(
        {name: (("y", "x"), values, {"units": "m"} | attrs)},
        {"x": ("x", x, {"units": "m"}), "y": ("y", y, {"units": "m"})},
    )


@pytest.mark.parametrize("name", ["height", "elevation", "z", "Band1", "ground"])
def test_heights_go_by_several_names(tmp_path, name):
    heights(name, standard_name="surface_altitude").to_netcdf(tmp_path / "hill.nc")
    found = elevation.read(tmp_path / "hill.nc", X, Y, **PLACE)
    np.testing.assert_allclose(found.height, plane(), atol=1e-6)
    assert bool(said(found, "taken as the heights")) == (name != "height")


def test_two_variables_of_heights_are_ambiguous(tmp_path):
    data = heights("top", standard_name="altitude").merge(
        heights("base", standard_name="bedrock_altitude")
    )
    data.to_netcdf(tmp_path / "two.nc")
    refused(tmp_path / "two.nc", "2 variables of heights")


@pytest.mark.parametrize("packed", [False, True])
def test_values_outside_the_valid_range_are_missing(tmp_path, packed):
    data = heights()
    data["height"][32, 31] = 6000.0
    encoding = {}
    if packed:
        # Of the packed type, the range is packed: 0 to 20,000 is 0 to 2,000 m.
        encoding = {"height": {"dtype": "int32", "scale_factor": 0.1, "_FillValue": -1}}
        data["height"].attrs |= {"valid_min": np.int32(0), "valid_max": np.int32(20_000)}
    else:
        data["height"].attrs["valid_range"] = np.array([0.0, 2000.0])
    data.to_netcdf(tmp_path / "valid.nc", encoding=encoding)
    refused(tmp_path / "valid.nc", "has no value at x = 500030.5 m, y = 5500031.5 m")
    found = elevation.read(tmp_path / "valid.nc", X, np.linspace(0, 5, 6), **PLACE)
    assert said(found, "declares 0 to 2000 as valid")


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("km", 1000.0)])
def test_axes_and_heights_of_netcdf_are_converted(tmp_path, unit, metres):
    data = heights()
    data = data.assign_coords(
        {axis: (axis, data[axis].values / metres, {"units": unit}) for axis in ("x", "y")}
    )
    data["height"] = (data["height"] / metres).assign_attrs(units=unit)
    data.to_netcdf(tmp_path / "units.nc")
    found = elevation.read(tmp_path / "units.nc", X, Y, **PLACE)
    np.testing.assert_allclose(found.height, plane(), atol=1e-6)
    assert said(found, f"is in {unit}")


def test_longitudes_and_latitudes_of_netcdf_are_degrees(tmp_path):
    longitude, latitude = 10 + 1e-5 * np.arange(-40, 41), 52 + 1e-5 * np.arange(-40, 41)
    place = rasterio.Affine(1e-5, 0, longitude[0] - 5e-6, 0, 1e-5, latitude[0] - 5e-6)
    values = slope("EPSG:4326", place, (81, 81), 10.0, 52.0, 0.03, 0.05)
    xr.Dataset(
        {"elevation": (("lat", "lon"), values, {"units": "m"})},
        {
            "lat": ("lat", latitude, {"units": "degrees_north"}),
            "lon": ("lon", longitude, {"units": "degrees_east"}),
        },
    ).to_netcdf(tmp_path / "degrees.nc")
    found = elevation.read(tmp_path / "degrees.nc", X, Y, longitude_latitude_deg=(10.0, 52.0))
    np.testing.assert_allclose(found.height, 0.03 * X + 0.05 * Y[:, None], atol=5e-6)
    assert said(found, "WGS 84")


def test_a_stretched_projection_of_netcdf_is_seen(tmp_path):
    (first,), (second,) = transform("EPSG:4326", "EPSG:3857", [10.0], [52.0])
    data = heights().assign_coords(
        {
            name: (name, middle + np.arange(-30.0, 31.0), {"units": "m"})
            for name, middle in (("x", first), ("y", second))
        }
    )
    data["height"].attrs["grid_mapping"] = "crs"
    data["crs"] = ((), 0, {"crs_wkt": CRS.from_epsg(3857).to_wkt()})
    data.to_netcdf(tmp_path / "mercator.nc")
    found = elevation.read(tmp_path / "mercator.nc", X, Y, longitude_latitude_deg=(10.0, 52.0))
    assert said(found, "is 0.6")
    # 10 m on the ground are 16.2 m of Mercator's at 52 degrees north.
    ahead = (found.height[-1] - found.height[0]) / 6
    np.testing.assert_allclose(ahead, 0.02 / np.cos(np.deg2rad(52)), rtol=4e-3)
