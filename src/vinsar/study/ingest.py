"""The user's files, surveyed heights and measured echoes, checked and made products.

docs/own-data.md describes their form. Whatever is wrong with a file is one sentence that names it
and says what to change.
"""

from __future__ import annotations

import logging
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.constants import AXES, channel_names
from vinsar.foundations.errors import ConfigurationError, Fault
from vinsar.radar import geometry, grid, trajectory, waveform
from vinsar.readers import elevation as surveyed
from vinsar.readers import files
from vinsar.simulation import scene
from vinsar.study import validation

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.processing.focusing import Imaging
    from vinsar.simulation.scene import Scene

    Floats = NDArray[np.floating]
    Antennas = tuple[Floats, Floats]

logger = logging.getLogger(__name__)

_HERTZ = ("Hz", "hertz", "Hertz", "s-1", "1/s")

# Positions whose number is correlated with their x by less than this are not in order; of a cart
# that is pushed in jerks it is 0.95 and more.
_ORDERED = 0.9

# The rules of the configuration see the antennas above the origin.
_OFF_ORIGIN_M = 1.0


def check(raw: Mapping[str, Any]) -> Study:
    """Check a configuration; a measurement's file takes the place of the section ``radar``.

    Parameters
    ----------
    raw
        Every key with its value, as read from YAML.

    Returns
    -------
    Study
        The checked configuration, whose radar is that of the measurement, if it has one.

    Raises
    ------
    validation.ConfigurationError
        If anything is wrong with it or with the measurement's antennas and frequencies.
    """
    section = raw.get("measurement")
    path = section.get("file") if isinstance(section, dict) else None
    if not isinstance(path, str):
        return validation.check(raw)
    with _blaming("measurement.file", path), _netcdf(path) as stored:
        frequency, antennas = _waveform(stored)
        near = (raw.get("imaging") or {}).get("y_min_m")
        if isinstance(near, float):
            _refuse_misplaced(antennas, near)
    found = {"radar": _radar(frequency, antennas), "measurement": {"channels": len(antennas[0])}}
    study = validation.check(validation.merge(raw, found))
    _refuse_ambiguous(frequency, antennas, study.imaging)
    return study


def read(study: Study) -> dict[str, xr.Dataset]:
    """Read the products that a study takes from files (`pipeline.from_files`).

    Parameters
    ----------
    study
        The configuration.

    Returns
    -------
    dict of xarray.Dataset
        Products by name; none for a study that is simulated as a whole.

    Raises
    ------
    validation.ConfigurationError
        If anything is wrong with the file; the message names it and says what to change.
    """
    if study.measurement.file is not None:
        return measurement(study.measurement.file)
    if study.scene.terrain == "file":
        return {"elevation": elevation(study.scene, antenna_height_m=study.radar.rail_height_m)}
    return {}


def elevation(options: Scene, *, antenna_height_m: float) -> xr.Dataset:
    """Read a file of heights and bring them onto the scene's raster.

    Parameters
    ----------
    options
        The scene.
    antenna_height_m
        Height of the lower antenna, m, which the terrain must not reach.

    Returns
    -------
    xarray.Dataset
        Product ``elevation``.

    Raises
    ------
    validation.ConfigurationError
        If anything is wrong with the file, with the file's name and what to change.
    """
    path = Path(str(options.file))
    with _blaming("scene.file", str(path)):
        x = geometry.grid_axis(options.x_min_m, options.x_max_m, options.terrain_spacing_m)
        y = geometry.grid_axis(options.y_min_m, options.y_max_m, options.terrain_spacing_m)
        found = surveyed.read(
            path,
            x,
            y,
            origin_m=(options.origin_easting_m, options.origin_northing_m),
            longitude_latitude_deg=_place(options),
            heading_deg=options.heading_deg,
            ground_height_m=options.ground_height_m,
        )
        product = scene.from_heights(
            x,
            y,
            found.height,
            _reflectivity(found, options),
            reflectivity_offset=options.reflectivity_offset,
        )
        top = float(product["height"].max())
        if top >= antenna_height_m:
            raise ValueError(
                f"variable 'height' rises to {top:.2f} m above the ground plane, and the lower "
                f"antenna stands at {antenna_height_m:.2f} m; set scene.ground_height_m to the "
                "height of the ground under the vehicle (null takes it from the file), or raise "
                "radar.rail_height_m"
            )
    for sentence in found.notes:
        logger.info("%s: %s", path, sentence)
    for sentence in found.warnings:
        logger.warning("%s: %s", path, sentence)
    return product


def _place(options: Scene) -> tuple[float, float] | None:
    longitude, latitude = options.origin_longitude_deg, options.origin_latitude_deg
    return None if longitude is None or latitude is None else (longitude, latitude)


def _reflectivity(found: surveyed.Elevation, options: Scene) -> Floats | None:
    if found.reflectivity is None and options.file_reflectivity == "constant":
        return np.full(found.height.shape, options.reflectivity_offset)
    return found.reflectivity


def measurement(path: str) -> dict[str, xr.Dataset]:
    """Read a file of measured echoes.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    dict of xarray.Dataset
        Products ``received``, ``trajectory`` and ``recorded_trajectory``, the last two alike.

    Raises
    ------
    validation.ConfigurationError
        If anything is wrong with the file, with the file's name and what to change.
    """
    with _blaming("measurement.file", path), _netcdf(path) as stored:
        frequency, antennas = _waveform(stored)
        parts = [_samples(_arranged(stored), f"echo_{part}") for part in ("real", "imag")]
    echo = np.empty(parts[0].shape, np.result_type(*parts, np.complex64))
    echo.real, echo.imag = parts
    echo, *ends = _in_order(echo, *antennas)
    phase_centers = dict(zip(("transmitter", "receiver"), ends, strict=True))
    recorded_antennas = variables.dataset("trajectory", phase_centers)
    return {
        "received": variables.dataset("received", {"echo": echo}, {"frequency": frequency}),
        "trajectory": recorded_antennas,
        "recorded_trajectory": recorded_antennas,
    }


@contextmanager
def _blaming(key: str, path: str) -> Iterator[None]:
    """Name the key and the file in the message of any error."""
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:
        sentence = str(error)
        if not isinstance(error, ValueError):
            why = sentence.partition("\n")[0]
            sentence = f"is truncated or of another format ({why}); write or copy it again"
        raise ConfigurationError([Fault(key, path, sentence)]) from error


@contextmanager
def _netcdf(path: str | Path) -> Iterator[xr.Dataset]:
    """Open a netCDF file, whose values are read when they are asked for."""
    import xarray as xr

    _refuse_missing(path)
    try:
        opened = xr.open_dataset(path, engine="netcdf4", decode_times=False)
    except Exception as error:  # whatever foreign bytes bring about
        raise OSError(str(error)) from error
    with opened:
        yield opened


def _refuse_missing(path: str | Path) -> None:
    if not Path(path).is_file():
        raise ValueError("there is no such file; paths begin in the repository's folder")


def _by_name(stored: xr.Dataset) -> xr.Dataset:
    """Return a file whose labels lie along the dimensions of their names, not of an index."""
    for name in ("channel", "axis"):
        index = f"{name}_index"
        if index in stored.dims and name not in stored.dims:
            labelled = name in stored.variables
            stored = (stored.swap_dims if labelled else stored.rename_dims)({index: name})
    return stored


def _arranged(stored: xr.Dataset) -> xr.Dataset:
    """Return a file with all that its short forms leave out.

    One channel needs no dimension of it, channels that share their positions neither, and an
    antenna that does both is told once.
    """
    stored = _by_name(stored)
    if "transmitter" in stored.variables and "receiver" not in stored.variables:
        stored = stored.assign(receiver=stored["transmitter"])
    count = stored.sizes.get("channel", 1)
    for name in ("echo_real", "echo_imag", "transmitter", "receiver"):
        # Labels would be expected of what is spread over them.
        if name in stored.variables and "channel" not in stored[name].dims:
            spread = stored[name].expand_dims({"channel": count})
            if "channel" in stored.coords and "channel" in stored.dims:
                spread = spread.assign_coords(channel=stored["channel"])
            stored = stored.assign({name: spread})
    return stored


def _waveform(stored: xr.Dataset) -> tuple[Floats, Antennas]:
    """Return frequencies and antenna positions, checked by themselves."""
    stored = _arranged(stored)
    for part in ("real", "imag"):
        _declared(stored, f"echo_{part}", ("channel", "position", "frequency"), ())
    for name, labels in (("channel", channel_names(stored.sizes["channel"])), ("axis", AXES)):
        found = [str(label) for label in _labels(stored, name)]
        if stored.sizes[name] != len(labels) or (found and found != list(labels)):
            shown = ", ".join(found) or f"{stored.sizes[name]} entries"
            raise ValueError(
                f"dimension '{name}' has {shown}; it must have {', '.join(labels)}, in this order"
            )
    if stored.sizes["position"] < 2:
        raise ValueError("dimension 'position' has 1 entry; an aperture needs two or more")
    frequency = _even(stored, "frequency", _HERTZ)
    if frequency[0] > frequency[-1]:
        raise ValueError("variable 'frequency' falls; sort it and the echo by rising frequency")
    if frequency[0] <= 0:
        raise ValueError(f"variable 'frequency' begins at {frequency[0]:g} Hz; it must be positive")
    transmitter, receiver = (
        _values(stored, name, ("channel", "position", "axis"), surveyed.METRES)
        for name in ("transmitter", "receiver")
    )
    for name, places in (("transmitter", transmitter), ("receiver", receiver)):
        _refuse_unknown(name, places)
        if places[..., 2].min() <= 0:
            raise ValueError(
                f"variable '{name}' has an antenna at z = {places[..., 2].min():g} m, below the "
                "ground plane z = 0; give heights above ground, z up"
            )
    _refuse_misaligned((transmitter + receiver) / 2)
    return frequency, (transmitter, receiver)


def _refuse_misaligned(center: Floats) -> None:
    """Refuse antennas (channel, position, axis) that are no aperture along x above the origin."""
    middle = center.mean(axis=1)
    if np.hypot(*middle[0, :2]) > _OFF_ORIGIN_M:
        raise ValueError(
            f"the lower channel's antennas are centred on x = {middle[0, 0]:.3f} m, "
            f"y = {middle[0, 1]:.3f} m; shift the coordinates so that the origin lies below their "
            "centre, with x along the aperture and y ahead (./run import --look-at)"
        )
    for places in center:
        away = places - places.mean(axis=0)
        if not away.any():
            raise ValueError("the antennas do not move along x, so there is no aperture to focus")
        # Of the middle half of them, so that one that is astray says nothing.
        x, y, z = np.subtract(*np.percentile(away, [75, 25], axis=0))
        if x < max(y, z):
            raise ValueError(
                f"the antennas are spread over {np.ptp(away[:, 0]):.3g} m along x and over "
                f"{np.ptp(away[:, 1]):.3g} m along y, so they do not move along x; turn the "
                "coordinates so that x is along the aperture (./run import --look-at)"
            )
    if len(middle) > 1:
        if np.hypot(*(middle[-1] - middle[0])[1:]) == 0:
            raise ValueError("both channels stand at the same place; without a baseline no height")
        if (np.diff(middle[:, 2]) < 0).any():
            raise ValueError(
                "channel 'lower' is above channel 'upper'; exchange them, echoes as well"
            )


def _in_order(
    echo: NDArray[np.complexfloating], transmitter: Floats, receiver: Floats
) -> tuple[NDArray[np.complexfloating], Floats, Floats]:
    """Return positions in the order in which they lie along x, if they are interleaved.

    The weighting of positions, and the line that is fitted to them, go by their number.
    """
    number = np.arange(echo.shape[1])
    parts = []
    for one, out, back in zip(echo, transmitter, receiver, strict=True):
        x = out[:, 0] + back[:, 0]
        interleaved = abs(np.corrcoef(number, x)[0, 1]) < _ORDERED
        order = np.argsort(x, kind="stable") if interleaved else number
        parts.append((one[order], out[order], back[order]))
    samples, outs, backs = (np.stack(part) for part in zip(*parts, strict=True))
    return samples, outs, backs


def _radar(frequency: Floats, antennas: Antennas) -> dict[str, Any]:
    """Return the section ``radar`` that describes a measurement."""
    center = (antennas[0] + antennas[1]) / 2
    middle = center.mean(axis=1)
    # To the nanometre: the mean of many equal heights is not to the last bit that height.
    aperture = round(float(np.ptp(center[0, :, 0])), 9)
    found = {
        "start_frequency_hz": float(frequency[0]),
        "stop_frequency_hz": float(frequency[-1]),
        "frequency_count": frequency.size,
        "aperture_length_m": aperture,
        "position_spacing_m": aperture / (center.shape[1] - 1),
        "rail_height_m": round(float(middle[0, 2]), 9),
    }
    if len(middle) == 1:
        return found | {"baselines_m": None}
    away = middle[1:] - middle[0]
    lengths = [round(float(length), 9) for length in np.hypot(away[:, 1], away[:, 2])]
    across, up = away[-1, 1:]
    return found | {
        "baseline_m": lengths[-1],
        "baselines_m": lengths if len(lengths) > 1 else None,
        "baseline_angle_deg": round(float(np.rad2deg(np.arctan2(up, across))), 9),
    }


def _refuse_misplaced(antennas: Antennas, near_edge_m: float) -> None:
    for name, places in zip(("transmitter", "receiver"), antennas, strict=True):
        foremost = places[..., 1].max()
        if foremost >= near_edge_m:
            raise ValueError(
                f"variable '{name}' has an antenna at y = {foremost:g} m, not before the image, "
                f"which begins at imaging.y_min_m = {near_edge_m:g} m; y points ahead"
            )


def _refuse_ambiguous(frequency: Floats, antennas: Antennas, imaging: Imaging) -> None:
    recorded_antennas = variables.dataset(
        "trajectory", dict(zip(("transmitter", "receiver"), antennas, strict=True))
    )
    near, far = trajectory.range_extent(recorded_antennas, *grid.image_axes(imaging))
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1)
    unambiguous = waveform.unambiguous_range(step)
    if far - near > unambiguous:
        fault = Fault(
            "imaging.y_max_m",
            imaging.y_max_m,
            f"its slant ranges, {near:.2f} to {far:.2f} m, must span no more than the unambiguous "
            f"range of the measurement, {unambiguous:.2f} m",
        )
        raise ConfigurationError([fault])
    if far > unambiguous:
        logger.warning(
            "ranges repeat every %.2f m: what is that much nearer or farther than the image, at "
            "%.2f to %.2f m, lies in it as well, if it is there",
            unambiguous, near, far,
        )  # fmt: skip


def _declared(
    stored: xr.Dataset, name: str, dims: tuple[str, ...], units: tuple[str, ...]
) -> xr.DataArray:
    """Return a variable that has these dimensions, in whatever order, and one of these units."""
    if name not in stored.variables:
        has = ", ".join(sorted(map(str, stored.variables))) or "none"
        raise ValueError(f"it lacks the variable '{name}' of dimensions {dims}; it has {has}")
    array = stored[name]
    if set(array.dims) != set(dims):
        raise ValueError(f"variable '{name}' has the dimensions {array.dims}; {dims} are needed")
    if array.dtype.kind not in "fiu":
        raise ValueError(
            f"variable '{name}' is {array.dtype}; real numbers are needed (complex samples as two "
            "variables, echo_real and echo_imag)"
        )
    found = array.attrs.get("units")
    if units and found not in units:
        given = "no units" if found is None else f"the units '{found}'"
        raise ValueError(f"variable '{name}' has {given}; convert it and write units '{units[0]}'")
    return array.transpose(*dims)


def _values(stored: xr.Dataset, name: str, dims: tuple[str, ...], units: tuple[str, ...]) -> Floats:
    return np.ascontiguousarray(_declared(stored, name, dims, units).values, dtype=float)


def _samples(stored: xr.Dataset, name: str) -> Floats:
    dims = ("channel", "position", "frequency")
    values = np.asarray(_declared(stored, name, dims, ()).values)
    _refuse_unknown(name, values)
    return values


def _refuse_unknown(name: str, values: Floats) -> None:
    unknown = ~np.isfinite(values)
    if unknown.any():
        place = tuple(int(index) for index in np.argwhere(unknown)[0])
        raise ValueError(
            f"variable '{name}' has {unknown.sum()} values that are missing or not finite, the "
            f"first at {place}; fill them or leave their positions out"
        )


def _even(stored: xr.Dataset, name: str, units: tuple[str, ...]) -> Floats:
    """Return an axis that rises or falls in even steps."""
    values = _values(stored, name, (name,), units)
    return files.even(name, values)


def _labels(stored: xr.Dataset, name: str) -> list[Any]:
    if name not in stored.variables:
        return []
    return [value.decode() if isinstance(value, bytes) else value for value in stored[name].values]
