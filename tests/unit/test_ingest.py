"""The user's files: what is right comes back, what is wrong is one sentence."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np
import pytest
import rasterio
import xarray as xr

import vinsar
from vinsar import figures
from vinsar.foundations.configuration import Study
from vinsar.foundations.errors import ConfigurationError
from vinsar.results import export, storage
from vinsar.study import ingest, pipeline, validation

ROOT = Path(__file__).parents[2]
FILES = (ROOT / "config/paper.yaml", ROOT / "tests/workflow/tiny.yaml")


def tiny(**sections):
    return validation.merge(validation.read(*FILES), sections)


@pytest.fixture(scope="module")
def study():
    return validation.check(tiny())


@pytest.fixture(scope="module")
def products(study):
    return pipeline.run(study, only="dem")


def stored(products, name, folder):
    path = folder / f"{name}.nc"
    attributes = {"vinsar_study": "tiny", "source": "vinsar"}
    storage.write(products[name], path, name, attributes)
    return path


@pytest.fixture(scope="module")
def terrain_file(products, tmp_path_factory):
    return stored(products, "terrain", tmp_path_factory.mktemp("terrain"))


@pytest.fixture(scope="module")
def echo_file(products, tmp_path_factory):
    folder = tmp_path_factory.mktemp("echo")
    for name in ("received", "recorded_trajectory"):
        stored(products, name, folder)
    path = folder / "echo.nc"
    export.measurement(folder, path)
    return path


@pytest.fixture(scope="module")
def echoes(echo_file):
    """What the file holds, with dimensions of the names that docs/own-data.md gives."""
    with xr.open_dataset(echo_file) as data:
        return data.load().swap_dims(channel_index="channel", axis_index="axis")


def own_terrain(path, **scene):
    return ingest.check(tiny(scene={"terrain": "file", "file": str(path)} | scene))


def own_echoes(path, **sections):
    own = {"measurement": {"file": str(path)}, "outputs": {"claims": False}}
    return ingest.check(tiny(**(own | sections)))


def said(file, ask):
    """Return the one sentence about a file that is refused."""
    with pytest.raises(ConfigurationError) as caught:
        ask()
    (fault,) = caught.value.faults
    assert fault.key in {"scene.file", "measurement.file"}
    assert fault.value == str(file)
    assert "\n" not in fault.allowed
    return fault.allowed


# Terrain


def heights(**changes):
    """Return a file's content: a plane, without reflectivity, beyond the tiny scene."""
    x, y = np.arange(-1.0, 1.01, 0.1), np.arange(9.5, 12.51, 0.1)
    data = xr.Dataset(
        {"height": (("y", "x"), 0.1 * x + 0.02 * y[:, None], {"units": "m"})},
        {"x": ("x", x, {"units": "m"}), "y": ("y", y, {"units": "m"})},
    )
    for name, change in changes.items():
        data = change(data) if callable(change) else data.assign({name: change})
    return data


def test_a_simulated_terrain_read_back_is_the_same_to_the_last_bit(terrain_file, products):
    own = own_terrain(terrain_file)
    given = ingest.read(own)
    made = pipeline.run(own, only="facets", given=given)
    xr.testing.assert_identical(made["terrain"], products["terrain"])
    xr.testing.assert_identical(made["facets"], products["facets"])


def test_a_plane_comes_back_between_its_nodes(tmp_path):
    path = tmp_path / "plane.nc"
    heights().to_netcdf(path)
    found = ingest.read(own_terrain(path))["elevation"]
    expected = 0.1 * found["x"] + 0.02 * found["y"]
    np.testing.assert_allclose(found["height"], expected.transpose("y", "x"), atol=1e-12)
    np.testing.assert_allclose(found["reflectivity"], found["height"] + 0.5, atol=1e-12)


@pytest.mark.parametrize("flipped", [{"y": slice(None, None, -1)}, {"x": slice(None, None, -1)}])
def test_falling_axes_and_exchanged_dimensions_are_the_same_heights(tmp_path, flipped):
    heights().to_netcdf(tmp_path / "a.nc")
    heights().isel(flipped).transpose("x", "y").to_netcdf(tmp_path / "b.nc")
    one, two = (ingest.read(own_terrain(tmp_path / name)) for name in ("a.nc", "b.nc"))
    xr.testing.assert_identical(one["elevation"], two["elevation"])


def test_packed_heights_are_unpacked(tmp_path):
    packed = {"dtype": "int16", "scale_factor": 1e-4, "_FillValue": -32768}
    heights().to_netcdf(tmp_path / "packed.nc", encoding={"height": packed})
    found = ingest.read(own_terrain(tmp_path / "packed.nc"))["elevation"]
    expected = 0.1 * found["x"] + 0.02 * found["y"]
    np.testing.assert_allclose(found["height"], expected.transpose("y", "x"), atol=0.6e-4)


def geotiff(path, *, values=None, transform=None, epsg=32632, bands=1, unit="", nodata=None):
    """Write a plane over 60 m x 60 m in UTM, at 1 m: height = 100 + 0.01 E' + 0.02 N'."""
    pixel = np.arange(60) + 0.5
    plane = 100 + 0.01 * pixel + 0.02 * (60 - pixel[:, None])
    values = plane if values is None else values(plane)
    north_up = rasterio.Affine(1, 0, 500_000, 0, -1, 5_500_060)
    with rasterio.open(
        path, "w", driver="GTiff", width=60, height=60, count=bands, dtype="float64",
        crs=None if epsg is None else f"EPSG:{epsg}", nodata=nodata,
        transform=north_up if transform is None else transform,
    ) as tiff:  # fmt: skip
        for band in range(1, bands + 1):
            tiff.write(values if band == 1 else np.full(values.shape, 0.25), band)
        if bands == 2:
            tiff.set_band_description(2, "reflectivity")
        tiff.units = (unit,) * bands
    return path


UTM = {"origin_easting_m": 500_030.0, "origin_northing_m": 5_500_030.0, "ground_height_m": None}


@pytest.mark.parametrize("heading", [0.0, 30.0, 90.0, 180.0, -135.0])
def test_a_plane_in_a_geotiff_turns_with_the_heading(tmp_path, heading):
    own = own_terrain(geotiff(tmp_path / "plane.tif"), heading_deg=heading, **UTM)
    found = ingest.read(own)["elevation"]
    # Ahead, y, points to sin(heading) east and cos(heading) north; x is a quarter to the right.
    sine, cosine = np.sin(np.deg2rad(heading)), np.cos(np.deg2rad(heading))
    slope_x, slope_y = 0.01 * cosine - 0.02 * sine, 0.01 * sine + 0.02 * cosine
    expected = slope_x * found["x"] + slope_y * found["y"]
    # Places are known to a millionth of a pixel, heights to 1e-6 m x 0.02.
    np.testing.assert_allclose(found["height"], expected.transpose("y", "x"), atol=1e-7)


def test_a_ground_height_of_one_s_own_is_subtracted(tmp_path):
    path = geotiff(tmp_path / "plane.tif")
    null, own = (
        ingest.read(own_terrain(path, **(UTM | {"ground_height_m": height})))["elevation"]
        for height in (None, 101.0)
    )
    # The plane is 100 + 0.3 + 0.6 m high at the vehicle.
    np.testing.assert_allclose(own["height"], null["height"] - 0.1, atol=1e-7)


def test_a_second_band_called_reflectivity_is_taken_as_such(tmp_path):
    own = own_terrain(geotiff(tmp_path / "two.tif", bands=2), **UTM)
    np.testing.assert_allclose(ingest.read(own)["elevation"]["reflectivity"], 0.25, rtol=1e-12)


def test_degrees_are_read_at_longitude_and_latitude(tmp_path):
    step = rasterio.Affine(1e-5, 0, 9.9997, 0, -1e-5, 52.0003)
    path = geotiff(tmp_path / "degrees.tif", epsg=4326, transform=step)
    own = own_terrain(
        path, origin_longitude_deg=10.0, origin_latitude_deg=52.0, ground_height_m=None
    )
    found = ingest.read(own)["elevation"]
    # A pixel of 1e-5 degrees of latitude is 1.11 m, over which the plane rises by 0.02 m.
    slope = float(found["height"][-1, 0] - found["height"][0, 0]) / 2.0
    assert slope == pytest.approx(0.02 / 1.1127, rel=1e-3)


def test_a_place_has_longitude_and_latitude(tmp_path):
    with pytest.raises(validation.ConfigurationError, match=r"scene\.origin_latitude_deg"):
        own_terrain(geotiff(tmp_path / "plane.tif"), origin_longitude_deg=10.0)


def test_the_reflectivity_of_one_s_own_terrain_may_be_constant(tmp_path):
    own = own_terrain(geotiff(tmp_path / "plane.tif"), file_reflectivity="constant", **UTM)
    assert (ingest.read(own)["elevation"]["reflectivity"] == 0.5).all()


@pytest.mark.parametrize(
    ("options", "scene", "sentence"),
    [
        ({"epsg": 4326}, {}, "degrees"),
        ({"epsg": 2225}, {}, "band 1, the height, declares none"),
        ({"unit": "furlong"}, {}, "in 'furlong'; metres"),
        ({"transform": rasterio.Affine.identity()}, {}, "not georeferenced"),
        ({"nodata": -9.0, "values": lambda z: np.where(z > 100.9, -9.0, z)}, {}, "no value at"),
        ({}, {"origin_easting_m": 0.0}, "its x goes from 500000.5 to 500059.5 m"),
        ({}, {"ground_height_m": 0.0}, "scene.ground_height_m"),
    ],
)
def test_a_geotiff_that_will_not_do_is_refused(tmp_path, options, scene, sentence):
    path = tmp_path / "bad.tif"
    if options.get("transform") == rasterio.Affine.identity():
        with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
            geotiff(path, **options)
    else:
        geotiff(path, **options)
    own = own_terrain(path, **(UTM | scene))
    assert sentence in said(path, lambda: ingest.read(own))


def without(name):
    return lambda data: data.drop_vars(name)


def unit(name, units):
    return lambda data: data.assign({name: data[name].assign_attrs(units=units)})


def scaled(name, factor):
    def change(data):
        return data.assign({name: (data[name] * factor).assign_attrs(data[name].attrs)})

    return change


def put(name, index, value):
    def change(data):
        values = data[name].values.copy()
        values[index] = value
        changed = (data[name].dims, values, data[name].attrs)
        return (
            data.assign_coords({name: changed})
            if name in data.coords
            else (data.assign({name: changed}))
        )

    return change


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (without("height"), "lacks the variable 'height'"),
        (without("x"), "lacks the variable 'x'"),
        (lambda data: data.expand_dims(time=1), "'height' has the dimensions ('time', 'y', 'x')"),
        (put("height", (15, 10), np.nan), "variable 'height' has no value at x = "),
        (unit("height", "Pa"), "variable 'height' has the units 'Pa'; convert it"),
        (unit("x", "degrees_east"), "variable 'x' has the units 'degrees_east'"),
        (lambda data: data.assign(height=data["height"].drop_attrs()), "has no units"),
        (lambda data: data.isel(y=slice(8, None)), "its y goes from 10.3 to 12.5 m, but 10 to 12"),
        (put("x", 3, -0.72), "variable 'x' is uneven"),
        (put("x", 3, 0.72), "variable 'x' is not sorted"),
        (put("x", 3, np.nan), "variable 'x' has 1 values that are missing"),
        (lambda data: data.isel(x=slice(1)), "variable 'x' has 1 value"),
        (scaled("height", 10), "rises to 3.20 m above the ground plane"),
        (scaled("height", -10), "reflectivity falls to"),
        (lambda data: data.assign(reflectivity=0 * data["height"]), "0 all over the scene"),
        (lambda data: data.assign(height=data["height"].astype(str)), "real numbers are needed"),
    ],
)
def test_heights_that_will_not_do_are_refused(tmp_path, change, sentence):
    path = tmp_path / "bad.nc"
    change(heights()).to_netcdf(path)
    own = own_terrain(path)
    assert sentence in said(path, lambda: ingest.read(own))


@pytest.mark.parametrize("name", ["heights.nc", "heights.tif", "echo.nc"])
@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "no such file"),
        (b"", "truncated or of another"),
        (b"x, y, z\n1, 2, 3\n", "truncated or of another"),
    ],
)
def test_a_file_that_cannot_be_opened_is_refused(tmp_path, name, content, sentence):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    ask = own_echoes if name == "echo.nc" else lambda path: ingest.read(own_terrain(path))
    assert sentence in said(path, lambda: ask(path))


def test_a_truncated_file_is_refused(tmp_path, terrain_file, echo_file):
    for whole, ask in (
        (terrain_file, lambda p: ingest.read(own_terrain(p))),
        (echo_file, own_echoes),
    ):
        path = tmp_path / whole.name
        path.write_bytes(whole.read_bytes()[:-2000])
        assert "truncated" in said(path, lambda ask=ask, path=path: ask(path))


def test_a_truncated_geotiff_is_refused(tmp_path):
    path = geotiff(tmp_path / "short.tif")
    path.write_bytes(path.read_bytes()[:9000])
    assert "write or copy it again" in said(path, lambda: ingest.read(own_terrain(path, **UTM)))


# Echoes


def test_a_simulated_echo_read_back_as_foreign_gives_the_same_dem(echo_file, study, products):
    own = own_echoes(echo_file)
    assert own.radar == study.radar
    made = pipeline.run(own, only="dem", given=ingest.read(own))
    xr.testing.assert_identical(made["dem"], products["dem"])
    assert not {"terrain", "facets", "truth", "accuracy"} & set(made)


@pytest.mark.parametrize(
    "sections",
    [
        {"radar": {"system": "transmit_pair", "aperture_length_m": 1.2}},
        {"vehicle": {"forward_speed_m_per_s": 2.0, "scan_duration_s": 0.5}},
        {"motion": {"level_wavelengths": 0.05}},
    ],
)
def test_other_apertures_come_back_as_well(tmp_path, sections):
    study = validation.check(tiny(outputs={"claims": False}, **sections))
    products = pipeline.run(study, only="dem")
    for name in ("received", "recorded_trajectory"):
        stored(products, name, tmp_path)
    export.measurement(tmp_path, tmp_path / "echo.nc")
    own = own_echoes(tmp_path / "echo.nc")
    made = pipeline.run(own, only="dem", given=ingest.read(own))
    xr.testing.assert_identical(made["dem"], products["dem"])


def test_labels_by_name_by_index_and_none_are_the_same(echo_file, echoes, tmp_path):
    files = [echo_file, tmp_path / "named.nc", tmp_path / "turned.nc"]
    echoes.to_netcdf(files[1])
    bare = echoes.drop_vars(["channel", "axis"])
    turned = bare.transpose("axis", "frequency", "position", "channel")
    turned.to_netcdf(files[2])
    one, *others = (ingest.measurement(str(path)) for path in files)
    for other in others:
        for name in pipeline.MEASURED:
            xr.testing.assert_identical(one[name], other[name])


def test_a_measurement_of_another_radar_brings_its_own(echoes, tmp_path):
    path = tmp_path / "other.nc"
    other = echoes.isel(frequency=slice(20, 180), position=slice(2, 19)).copy(deep=True)
    other["transmitter"][..., 2] += 0.4
    other["receiver"][1, :, 1] += 0.1
    other.to_netcdf(path)
    radar = own_echoes(path).radar
    assert radar.frequency_count == 160
    assert radar.start_frequency_hz == pytest.approx(13e9 + 20 * 10e6)
    assert radar.stop_frequency_hz == pytest.approx(13e9 + 179 * 10e6)
    assert (radar.aperture_length_m, radar.position_spacing_m) == pytest.approx((0.48, 0.03))
    # The middle between transmitter and receiver counts.
    assert radar.rail_height_m == pytest.approx(2.2)
    assert radar.baseline_m == pytest.approx(np.hypot(0.05, 0.3))
    assert radar.baseline_angle_deg == pytest.approx(np.rad2deg(np.arctan2(0.3, 0.05)))


def one_part(data):
    """Store the complex samples in a way of numpy's: parts along a dimension of their own."""
    parts = xr.concat([data["echo_real"], data["echo_imag"]], "part")
    return data.drop_vars(["echo_real", "echo_imag"]).assign(echo=parts)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (without("echo_imag"), "lacks the variable 'echo_imag'"),
        (without("transmitter"), "lacks the variable 'transmitter'"),
        (without("frequency"), "lacks the variable 'frequency'"),
        (one_part, "lacks the variable 'echo_real'"),
        (lambda data: data.rename(position="pulse"), "('channel', 'pulse', 'frequency')"),
        (lambda data: data.isel(channel=[1]), "dimension 'channel' has upper; it must have lower,"),
        (lambda data: data.isel(channel=[1, 0]), "dimension 'channel' has upper, lower"),
        (
            lambda data: data.isel(channel=[1, 0]).drop_vars("channel"),
            "'lower' is above channel 'upper'",
        ),
        (lambda data: data.isel(axis=[0, 1]), "dimension 'axis' has x, y"),
        (lambda data: data.isel(position=[4]), "'position' has 1 entry"),
        (lambda data: data.isel(frequency=[4]), "'frequency' has 1 value"),
        (lambda data: data.isel(frequency=slice(None, None, -1)), "'frequency' falls"),
        (put("frequency", 5, 13.0e9), "'frequency' is not sorted"),
        (put("frequency", 5, 13.0502e9), "'frequency' is uneven"),
        (put("frequency", 5, np.nan), "'frequency' has 1 values that are missing"),
        (unit("frequency", "GHz"), "'frequency' has the units 'GHz'"),
        (unit("receiver", "mm"), "'receiver' has the units 'mm'"),
        (put("transmitter", (0, 3, 1), np.inf), "'transmitter' has 1 values that are missing"),
        (put("transmitter", (0, 3, 1), 10.5), "'transmitter' has an antenna at y = 10.5 m, not"),
        (put("receiver", (1, 3, 1), 200.0), "'receiver' has an antenna at y = 200 m, not before"),
        (put("receiver", (1, 3, 2), -2.0), "'receiver' has an antenna at z = -2 m, below"),
        (put("transmitter", (0, slice(None), 0), 80.0), "shift the coordinates"),
        (
            lambda data: put("transmitter", (..., 0), 0.0)(put("receiver", (..., 0), 0.0)(data)),
            "do not move along x",
        ),
        (
            lambda data: data.assign(
                {n: data[n].isel(channel=[0, 0]).assign_coords(channel=data["channel"])
                 for n in ("transmitter", "receiver")}
            ),
            "without a baseline",
        ),
    ],
)  # fmt: skip
def test_echoes_that_will_not_do_are_refused_before_anything_runs(
    echoes, tmp_path, change, sentence
):
    path = tmp_path / "bad.nc"
    change(echoes).to_netcdf(path)
    assert sentence in said(path, lambda: own_echoes(path))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_samples_that_are_not_finite_are_refused(echoes, tmp_path, value):
    path = tmp_path / "bad.nc"
    put("echo_imag", (1, 2, 3), value)(echoes).to_netcdf(path)
    own = own_echoes(path)
    sentence = said(path, lambda: ingest.read(own))
    assert "'echo_imag' has 1 values" in sentence
    assert "the first at (1, 2, 3)" in sentence


def test_complex_numbers_of_netcdf_s_own_kind_are_refused(tmp_path):
    path = tmp_path / "compound.nc"
    with netCDF4.Dataset(path, "w", auto_complex=True) as file:
        for name, size in (("channel", 2), ("position", 3), ("frequency", 4)):
            file.createDimension(name, size)
        file.createVariable("echo", "c16", ("channel", "position", "frequency"))
    assert "echo_real" in said(path, lambda: own_echoes(path))


def test_the_image_must_suit_the_measured_radar(echo_file):
    with pytest.raises(ConfigurationError) as caught:
        own_echoes(echo_file, imaging={"y_max_m": 40.0})
    assert [fault.key for fault in caught.value.faults] == ["imaging.y_max_m"]


def test_one_antenna_is_told_once(echoes, tmp_path):
    echoes.to_netcdf(tmp_path / "long.nc")
    echoes.drop_vars("receiver").to_netcdf(tmp_path / "short.nc")
    one, two = (ingest.measurement(str(tmp_path / f"{name}.nc")) for name in ("long", "short"))
    for name in pipeline.MEASURED:
        xr.testing.assert_identical(one[name], two[name])


def test_one_channel_has_images_and_no_more(echoes, tmp_path, products):
    one = echoes.isel(channel=0, drop=True).drop_vars("receiver")
    one.to_netcdf(tmp_path / "one.nc")
    own = own_echoes(tmp_path / "one.nc", outputs={"claims": False, "figures": ["images"]})
    assert own.measurement.channels == 1
    made = pipeline.run(own, given=ingest.read(own))
    assert {"profiles", "images"} <= set(made)
    assert not {"interferogram", "unwrapped", "dem", "registration"} & set(made)
    np.testing.assert_array_equal(made["images"]["image"][0], products["images"]["image"][0])
    figures.check(own, made)
    with pytest.raises(validation.ConfigurationError, match="needs a second channel"):
        figures.check(
            own_echoes(tmp_path / "one.nc", outputs={"claims": False, "figures": ["measured"]}),
            made,
        )


def test_an_image_of_one_channel_says_so(echoes, tmp_path):
    echoes.isel(channel=[0]).to_netcdf(tmp_path / "one.nc")
    own = own_echoes(tmp_path / "one.nc")
    made = pipeline.run(own, only="images", given=ingest.read(own))
    figure = figures.FIGURES["images"].draw(made, own)
    assert any("of one channel there is no height" in text.get_text() for text in figure.texts)


def test_a_radar_high_up_is_refused_for_no_figure_that_nobody_asked_for(echoes, tmp_path):
    high = echoes.copy(deep=True)
    for name in ("transmitter", "receiver"):
        high[name][..., 2] += 60.0
    high.to_netcdf(tmp_path / "high.nc")
    imaging = {"y_min_m": 10.0, "y_max_m": 12.0}
    # Without a figure of misregistration its targets do not matter.
    ahead = {"claims": False, "figures": ["measured"]}
    own = own_echoes(tmp_path / "high.nc", imaging=imaging, outputs=ahead)
    assert "images" in pipeline.run(own, only="images", given=ingest.read(own))
    ahead["figures"] = ["fig2"]
    with pytest.raises(validation.ConfigurationError, match="registration"):
        own_echoes(tmp_path / "high.nc", imaging=imaging, outputs=ahead)


def test_interleaved_positions_are_put_in_order(echoes, tmp_path):
    count = echoes.sizes["position"]
    order = np.concatenate([np.arange(0, count, 2), np.arange(1, count, 2)])
    echoes.to_netcdf(tmp_path / "straight.nc")
    echoes.isel(position=order).drop_vars("position", errors="ignore").to_netcdf(
        tmp_path / "interleaved.nc"
    )
    studies = [own_echoes(tmp_path / f"{name}.nc") for name in ("straight", "interleaved")]
    # The whole chain, with a weighting that goes by the positions' number.
    one, two = (
        pipeline.run(
            own.model_copy(
                update={"imaging": own.imaging.model_copy(update={"aperture_window": "hann"})}
            ),
            only="dem",
            given=ingest.read(own),
        )["dem"]
        for own in studies
    )
    xr.testing.assert_identical(one, two)


def turned(data):
    """Turn the antennas by a right angle: the rail lies along y, but for three centimetres."""
    swapped = data.copy(deep=True)
    for name in ("transmitter", "receiver"):
        places = data[name].values
        jitter = 0.03 * np.cos(np.arange(places.shape[1]))
        swapped[name][..., 0], swapped[name][..., 1] = jitter, places[..., 0]
    return swapped


def test_a_rail_along_y_is_refused_whatever_its_jitter(echoes, tmp_path):
    turned(echoes).to_netcdf(tmp_path / "turned.nc")
    sentence = said(tmp_path / "turned.nc", lambda: own_echoes(tmp_path / "turned.nc"))
    assert "m along y, so they do not move along x" in sentence


def point_echoes(path, target, *, center, extent, positions, frequency):
    """Write the echo of a point target as two channels of one radar see it."""
    x = np.linspace(-extent / 2, extent / 2, positions)
    places = np.stack(
        [np.stack([x, 0 * x, 0 * x + center + up], axis=-1) for up in (0.0, center / 20)]
    )
    paths = np.linalg.norm(places - target, axis=-1)[..., None]
    echo = np.exp(-4j * np.pi * (frequency * paths / 299_792_458.0 % 1))
    samples, dims = ("channel", "position", "frequency"), ("channel", "position", "axis")
    xr.Dataset(
        {
            "echo_real": (samples, echo.real),
            "echo_imag": (samples, echo.imag),
            "transmitter": (dims, places, {"units": "m"}),
        },
        {"frequency": ("frequency", frequency, {"units": "Hz"})},
    ).to_netcdf(path)
    return places, echo


@pytest.mark.parametrize(
    ("radar", "imaging"),
    [
        # Nearer than the margin that profiles have elsewhere, 0.5 m, in 1.5 m of range.
        (
            {"center": 0.2, "extent": 0.3, "positions": 61,
             "frequency": np.linspace(22e9, 26e9, 41)},
            {"x": 0.4, "y_min_m": 0.4, "y_max_m": 1.2, "grid_spacing_m": 0.02},
        ),
        # A hundred times the unambiguous range away.
        (
            {"center": 40.0, "extent": 60.0, "positions": 121,
             "frequency": np.linspace(9.3e9, 9.9e9, 401)},
            {"x": 20.0, "y_min_m": 9980.0, "y_max_m": 10020.0, "grid_spacing_m": 2.0,
             "grid_spacing_y_m": 0.25},
        ),
    ],
)  # fmt: skip
def test_near_and_far_scenes_are_the_direct_sum(tmp_path, radar, imaging):
    half = imaging.pop("x")
    middle = (imaging["y_min_m"] + imaging["y_max_m"]) / 2
    places, echo = point_echoes(tmp_path / "point.nc", np.array([0.0, middle, 0.0]), **radar)
    own = own_echoes(
        tmp_path / "point.nc",
        imaging={"x_min_m": -half, "x_max_m": half, "interpolation": "cubic"} | imaging,
        height={"level_ground": [{"x_min_m": -half, "x_max_m": 0.0, "y_min_m": imaging["y_min_m"],
                                  "y_max_m": middle}]},
        outputs={"claims": False, "figures": ["measured"]},
    )  # fmt: skip
    image = pipeline.run(own, only="images", given=ingest.read(own))["images"]
    frequency = radar["frequency"]
    x, y = (image[axis].values[::5] for axis in "xy")
    pixels = np.stack([*np.meshgrid(x, y), np.zeros((y.size, x.size))], axis=-1)
    expected = np.zeros((y.size, x.size), complex)
    for place, one in zip(places[0], echo[0], strict=True):
        ranges = np.linalg.norm(pixels - place, axis=-1)[..., None]
        turn = np.exp(4j * np.pi * (frequency * ranges / 299_792_458.0 % 1))
        expected += (one * turn).mean(axis=-1) / len(places[0])
    found = image["image"].values[0, ::5, ::5]
    assert np.abs(expected).max() == pytest.approx(1, abs=1e-6)
    # Single precision of the profiles and their cubic interpolation: below -80 dB.
    assert np.abs(found - expected).max() < 1e-4


def test_what_a_file_gives_must_be_given(terrain_file, echo_file):
    for own, name in (
        (own_terrain(terrain_file), "elevation"),
        (own_echoes(echo_file), "received"),
    ):
        with pytest.raises(ValueError, match=f"{name}.* must be given"):
            pipeline.run(own)


def test_nothing_is_read_for_a_simulated_study(study):
    assert ingest.read(study) == {}
    assert isinstance(vinsar.load(*FILES), Study)
