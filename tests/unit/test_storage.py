import resource
import signal
from contextlib import contextmanager

import netCDF4
import numpy as np
import pytest
import xarray as xr

from vinsar.foundations import variables
from vinsar.results import storage


def images():
    rng = np.random.default_rng(5)
    return variables.dataset(
        "images",
        {
            "image": (rng.normal(size=(2, 3, 4)) + 1j * rng.normal(size=(2, 3, 4))).astype("c8"),
            "wavelength": 0.0214,
            "transmitter": np.zeros((2, 1, 3)),
            "receiver": np.zeros((2, 1, 3)),
        },
        {"x": np.arange(4.0), "y": np.arange(3.0)},
    )


def truth():
    height = np.array([[0.1, np.nan], [0.2, -0.3]])
    return variables.dataset(
        "truth",
        {
            "height": height,
            "reflectivity": height + 0.5,
            "visible_fraction": np.ones((2, 2, 2)),
            "shadow": np.array([[True, False], [False, True]]),
        },
        {"x": np.arange(2.0), "y": np.arange(2.0)},
    )


@pytest.mark.parametrize(("product", "make"), [("images", images), ("truth", truth)])
def test_a_product_comes_back_as_it_was(tmp_path, product, make):
    storage.write(make(), tmp_path / "a.nc", product, {"vinsar_study": "test"})
    back = storage.read(tmp_path / "a.nc", product)
    assert back.attrs["vinsar_study"] == "test"
    back.attrs = {}
    xr.testing.assert_identical(back, make())
    for name in back.variables:
        assert back[name].dtype == make()[name].dtype


def test_the_file_holds_what_every_cf_tool_reads(tmp_path):
    storage.write(images(), tmp_path / "a.nc", "images")
    storage.write(truth(), tmp_path / "b.nc", "truth")
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert file.Conventions == "CF-1.11"
        assert {"image_real", "image_imag"} < set(file.variables)
        assert file["channel"].dimensions == ("channel_index",)
        assert "channel" in file["image_real"].coordinates.split()
        assert "_FillValue" not in file["x"].ncattrs()
    with netCDF4.Dataset(tmp_path / "b.nc") as file:
        assert file["shadow"].dtype == np.int8
        assert list(file["shadow"].flag_values) == [0, 1]
        assert file["shadow"].flag_meanings == "visible shadow"
        assert np.isnan(file["height"]._FillValue)


def test_the_same_product_is_the_same_bytes(tmp_path):
    for name in "ab":
        storage.write(images(), tmp_path / f"{name}.nc", "images", {"vinsar_study": "test"})
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_what_departs_from_its_declaration_is_not_written(tmp_path):
    wrong = images().rename(image="picture")
    with pytest.raises(ValueError, match="image"):
        storage.write(wrong, tmp_path / "a.nc", "images")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def interrupted():
        with storage.atomic(path) as temporary:
            temporary.write_text("half")
            raise OSError("no space left on device")

    with pytest.raises(OSError, match="no space left"):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]
    assert path.read_text() == "old"


def test_a_new_file_is_as_readable_as_any_other(tmp_path):
    with storage.atomic(tmp_path / "a.txt") as temporary:
        temporary.write_text("new")
    plain = tmp_path / "b.txt"
    plain.write_text("new")
    assert (tmp_path / "a.txt").stat().st_mode == plain.stat().st_mode


def test_a_truncated_file_is_named_with_what_to_do(tmp_path):
    path = tmp_path / "images.nc"
    storage.write(images(), path, "images")
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(ValueError, match=r"images\.nc is truncated .*delete it and run again"):
        storage.read(path, "images")


def test_a_foreign_file_is_named_with_what_it_holds(tmp_path):
    path = tmp_path / "images.nc"
    xr.Dataset({"temperature": ("time", np.arange(3))}).to_netcdf(path)
    with pytest.raises(ValueError, match=r"images\.nc holds no vinsar product"):
        storage.read(path, "images")
    storage.write(truth(), path, "truth")
    with pytest.raises(ValueError, match=r"images\.nc holds truth, not 'images'"):
        storage.read(path, "images")


def test_an_edited_file_is_refused(tmp_path):
    path = tmp_path / "images.nc"
    storage.write(images(), path, "images")
    with netCDF4.Dataset(path, "a") as file:
        file["wavelength"].units = "km"
    with pytest.raises(ValueError, match="'wavelength' of product 'images' has units='km'"):
        storage.read(path, "images")
    with netCDF4.Dataset(path, "a") as file:
        file.renameVariable("image_imag", "image_imaginary")
    with pytest.raises(ValueError, match="not a whole 'images'"):
        storage.read(path, "images")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"absent\.nc does not exist"):
        storage.read(tmp_path / "absent.nc", "images")


def test_what_cannot_reach_the_disk_takes_no_name(tmp_path, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match=r"cannot write .*a\.nc: No space left on device"):
        storage.write(images(), tmp_path / "a.nc", "images")
    assert list(tmp_path.iterdir()) == []


def test_a_map_without_a_detection_comes_back(tmp_path):
    shape = (3, 4)
    data = {
        name: np.zeros(shape if variable.dims else (), variables.DTYPES[variable.kind][0])
        for name, variable in variables.PRODUCTS["detections"].items()
        if variable.dims == ("y", "x")
    } | {
        name: np.zeros(0)
        for name, variable in variables.PRODUCTS["detections"].items()
        if variable.dims == ("detection",)
    }
    axes = {"y": np.arange(3.0), "x": np.arange(4.0)}
    found = variables.dataset("detections", data, axes)
    storage.write(found, tmp_path / "detections.nc", "detections")
    back = storage.read(tmp_path / "detections.nc", "detections")
    xr.testing.assert_identical(back.drop_attrs(deep=False), found)


@contextmanager
def small_files():
    """Let no file grow beyond some bytes, which fails in the middle of writing."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        yield
    finally:
        # Before pytest writes its next dot, which may go to a longer file.
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def as_text(path):
    with storage.atomic(path) as temporary:
        temporary.write_text("x" * 100_000)


def as_netcdf(path):
    storage.write(images(), path, "images")


@pytest.mark.parametrize("write", [as_text, as_netcdf])
def test_what_cannot_be_written_whole_is_told_with_its_name(tmp_path, write):
    path = tmp_path / "a.nc"
    path.write_bytes(b"before")
    with small_files(), pytest.raises(OSError, match=r"^cannot write .*/a\.nc: "):
        write(path)
    assert path.read_bytes() == b"before"
    assert [one.name for one in tmp_path.iterdir()] == ["a.nc"]
