"""From a radar's files to a measurement: which array is what, where the antennas were.

Whatever is not given is looked for by usual names, and everything that is found or assumed is a
note of the measurement.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.foundations.constants import AXES
from vinsar.readers import files, forms
from vinsar.readers.elevation import LENGTHS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

Form = Literal["stepped", "dechirped", "pulses", "compressed"]
FORMS: tuple[Form, ...] = ("stepped", "dechirped", "pulses", "compressed")

_HERTZ = {"hz": 1.0, "hertz": 1.0, "1/s": 1.0, "s-1": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}
_SECONDS = {"s": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}

# Names that are looked for, without case, if none is given.
_USUAL: dict[str, tuple[str, ...]] = {
    "samples": ("echo", "pulse", "pulses", "beat", "samples", "data", "signal", "fp", "s21", "s11"),
    "frequency": ("frequency", "frequencies", "freq", "f"),
    "range": ("range", "ranges", "slant_range", "r"),
    "positions": (
        "transmitter", "antenna", "antennas", "position", "positions", "x,y,z", "pos", "platform",
    ),
    "receivers": ("receiver",),
    "reference_range": ("reference_range", "r0"),
    "time": ("time", "t"),
}  # fmt: skip


@dataclass(frozen=True)
class Options:
    """What the files do not tell of themselves; None is looked for by usual names.

    Attributes
    ----------
    samples
        Array of the samples, one for each channel or one with a dimension of channels.
    order
        Dimensions of the samples, such as ``channel,position,frequency``; the last kind is always
        called ``frequency``.
    frequency, range
        Array of the axis, or ``first:last`` in Hz or m.
    positions, receivers
        Arrays of the transmitting and of the receiving antennas (position, axis), one for each
        channel, or three names or numbers for x, y and z; without receivers one antenna does both.
    reference_range
        Array of the range that is taken out at each position, m.
    time, positions_time
        Times of the echoes; times of the positions if they differ, which are then interpolated.
    start_frequency_hz, sweep_rate_hz_per_s, sample_rate_hz, alternating
        Of dechirped samples (`forms.dechirped`).
    carrier_frequency_hz, band_hz, carrier_kept
        Of pulses (`forms.pulses`).
    sign
        Sign of the phase that grows with range; None for the form's own.
    look_at
        A place of the scene in the files' coordinates, m: they are turned so that x is along the
        aperture, y ahead, and the origin below the aperture's middle.
    ground_m
        Height of the ground in the files' coordinates, m.
    """

    samples: tuple[str, ...] | None = None
    order: str | None = None
    frequency: str | None = None
    range: str | None = None
    positions: tuple[str, ...] | None = None
    receivers: tuple[str, ...] | None = None
    reference_range: str | None = None
    time: str | None = None
    positions_time: str | None = None
    start_frequency_hz: float | None = None
    sweep_rate_hz_per_s: float | None = None
    sample_rate_hz: float | None = None
    alternating: bool = False
    carrier_frequency_hz: float = 0.0
    band_hz: tuple[float, float] | None = None
    carrier_kept: bool = False
    sign: forms.Sign | None = None
    look_at: tuple[float, float] | None = None
    ground_m: float = 0.0


@dataclass
class Measurement:
    """Echoes of a stepped frequency, and where the antennas were.

    Attributes
    ----------
    echo
        Complex samples (channel, position, frequency).
    frequency
        Frequencies, Hz.
    transmitter, receiver
        Antenna positions (channel, position, axis), m.
    time
        Time of each position (position,), s, if it is known.
    scene_m
        Middle of the scene, m, if it is known.
    notes
        What was assumed or done, a sentence each.
    """

    echo: Complexes
    frequency: Floats
    transmitter: Floats
    receiver: Floats
    time: Floats | None = None
    scene_m: tuple[float, float] | None = None
    notes: list[str] = field(default_factory=list)

    def dataset(self) -> xr.Dataset:
        """Return the measurement in the form of docs/own-data.md, ready to be stored."""
        import xarray as xr

        from vinsar.foundations.constants import CHANNELS

        samples = ("channel", "position", "frequency")
        places = ("channel", "position", "axis")
        metres = {"units": "m"}
        data: dict[str, Any] = {
            "echo_real": (samples, self.echo.real.astype(np.float32), {"units": "1"}),
            "echo_imag": (samples, self.echo.imag.astype(np.float32), {"units": "1"}),
            "transmitter": (places, self.transmitter, metres),
            "receiver": (places, self.receiver, metres),
        }
        if self.time is not None:
            data["time"] = ("position", self.time, {"units": "s", "long_name": "time of the echo"})
        labels = list(CHANNELS[: len(self.echo)])
        return xr.Dataset(
            data,
            {
                "frequency": ("frequency", self.frequency, {"units": "Hz"}),
                "channel": labels,
                "axis": list(AXES),
            },
            {"title": "measured echoes", "comment": "\n".join(self.notes)},
        )


def read(form: Form, paths: Sequence[str | Path], options: Options) -> Measurement:
    """Read a radar's files.

    Parameters
    ----------
    form
        What the samples are.
    paths
        Files with the samples, axes and positions; of an array that several of them have, the parts
        follow each other as positions.
    options
        What the files do not tell.

    Returns
    -------
    Measurement
        Echoes and antennas.

    Raises
    ------
    ValueError
        If something is missing, of another shape, or cannot be told.
    """
    if form not in FORMS:
        raise ValueError(f"there is no form '{form}'; the forms are {', '.join(FORMS)}")
    source = _Source(paths)
    time = source.vector(
        "time", options.time, _SECONDS, required=options.positions_time is not None
    )
    transmitter = _antennas(source, "positions", options.positions)
    receiver = _antennas(source, "receivers", options.receivers) if _has_receivers(
        source, options
    ) else transmitter  # fmt: skip
    if options.positions_time is not None:
        own = source.vector("positions_time", options.positions_time, _SECONDS, required=True)
        transmitter, receiver = (_at(time, own, places) for places in (transmitter, receiver))
        source.notes.append("positions interpolated to the times of the echoes (cubic spline)")
    axis = None
    if form == "stepped":
        axis = source.axis("frequency", options.frequency, _HERTZ)
    elif form != "dechirped":
        axis = source.axis("range", options.range, LENGTHS)
    parts = [
        _oriented(source, name, options.order, axis, transmitter.shape[1])
        for name in source.names("samples", options.samples)
    ]
    samples = np.concatenate(parts)
    if isinstance(axis, tuple):
        axis = np.linspace(*axis, samples.shape[-1])
    reference = source.vector(
        "reference_range", options.reference_range, LENGTHS, required=form == "compressed"
    )
    echo = _converted(form, samples, axis, reference, options)
    notes = [*source.notes, *echo.notes]
    channels, positions = echo.samples.shape[:2]
    transmitter, receiver = (
        _fitting(places, channels, positions, notes) for places in (transmitter, receiver)
    )
    if time is not None and time.size != positions:
        raise ValueError(f"{time.size} times do not fit {positions} positions")
    result = Measurement(echo.samples, echo.frequency, transmitter, receiver, time, None, notes)
    if options.look_at is not None:
        _turn(result, options.look_at)
    if options.ground_m:
        result.transmitter = result.transmitter - [0, 0, options.ground_m]
        result.receiver = result.receiver - [0, 0, options.ground_m]
        notes.append(f"heights count from the ground at {options.ground_m:g} m")
    _describe(result)
    return result


def _converted(
    form: Form, samples: NDArray[Any], axis: Any, reference: Floats | None, options: Options
) -> forms.Echo:
    sign: dict[str, Any] = {} if options.sign is None else {"sign": options.sign}
    if form == "stepped":
        return forms.stepped(samples, axis, reference_range_m=reference, **sign)
    if form == "dechirped":
        needed = {
            "start_frequency_hz": options.start_frequency_hz,
            "sweep_rate_hz_per_s": options.sweep_rate_hz_per_s,
            "sample_rate_hz": options.sample_rate_hz,
        }
        missing = [name for name, value in needed.items() if value is None]
        if missing:
            raise ValueError(f"dechirped samples need {', '.join(missing)}")
        return forms.dechirped(
            samples,
            alternating=options.alternating,
            reference_range_m=reference,
            **sign,
            **needed,  # type: ignore[arg-type]
        )
    return forms.pulses(
        samples,
        axis,
        carrier_frequency_hz=options.carrier_frequency_hz,
        band_hz=options.band_hz,
        reference_range_m=reference,
        carrier_kept=options.carrier_kept,
        **sign,
    )


class _Source:
    """The arrays of several files by name."""

    def __init__(self, paths: Sequence[str | Path]) -> None:
        self.parts: dict[str, list[NDArray[Any]]] = {}
        self.units: dict[str, str] = {}
        self.notes: list[str] = []
        for path in paths:
            arrays, units = files.load(path)
            for name, values in arrays.items():
                self.parts.setdefault(name, []).append(values)
            self.units |= units
        self.notes.append(f"read {', '.join(Path(path).name for path in paths)}")

    def find(self, role: str, given: str | None) -> str | None:
        """Return the name of an array, given or usual."""
        if given is not None:
            name = given.partition("[")[0]
            if name not in self.parts:
                raise ValueError(f"there is no array '{name}' for the {role}; there are {self}")
            return given
        lower = {name.lower(): name for name in self.parts}
        # The last part of a name in a structure counts as well.
        lower = {name.rpartition("/")[2]: whole for name, whole in lower.items()} | lower
        for usual in _USUAL.get(role, ()):
            wanted = usual.split(",")
            if all(part in lower for part in wanted):
                found = ",".join(lower[part] for part in wanted)
                self.notes.append(f"{role}: '{found}', by its name")
                return found
        return None

    def names(self, role: str, given: tuple[str, ...] | None) -> tuple[str, ...]:
        """Return the names of arrays, one for each channel."""
        if given is not None:
            return given
        found = self.find(role, None)
        if found is None:
            raise ValueError(f"no array has a usual name for the {role}; name one of {self}")
        return (found,)

    def get(self, name: str) -> list[NDArray[Any]]:
        """Return the parts of an array, each indexed as the name asks, such as ``data[:,0]``."""
        plain, index = _indexed(name)
        if plain not in self.parts:
            raise ValueError(f"there is no array '{plain}'; there are {self}")
        try:
            return [values[index] for values in self.parts[plain]]
        except IndexError as error:
            raise ValueError(f"'{name}' does not fit its array ({error})") from error

    def factor(self, name: str, units: dict[str, float]) -> float:
        """Return the factor to SI units of an array."""
        declared = self.units.get(name.partition("[")[0])
        if declared is None:
            si = next(iter(units))
            self.notes.append(f"'{name}' declares no units and is taken in {si}")
            return 1.0
        if declared.lower() not in units:
            raise ValueError(f"'{name}' is in '{declared}'; one of {', '.join(units)} is needed")
        return units[declared.lower()]

    def vector(
        self, role: str, given: str | None, units: dict[str, float], *, required: bool = False
    ) -> Floats | None:
        """Return an array of one value for each position."""
        name = self.find(role, given)
        if name is None:
            if required:
                raise ValueError(f"the {role} must be given; name one of {self}")
            return None
        parts = [np.atleast_1d(np.squeeze(values)) for values in self.get(name)]
        if any(part.ndim != 1 for part in parts):
            raise ValueError(f"'{name}' has the shape {parts[0].shape}; one dimension is needed")
        return np.concatenate(parts).astype(float) * self.factor(name, units)

    def axis(
        self, role: str, given: str | None, units: dict[str, float]
    ) -> Floats | tuple[float, float]:
        """Return an axis of the samples, or its ends."""
        if given is not None and ":" in given and "[" not in given:
            first, _, last = given.partition(":")
            return float(first), float(last)
        name = self.find(role, given)
        if name is None:
            raise ValueError(f"the {role} must be given, as one of {self} or as first:last")
        parts = [np.atleast_1d(np.squeeze(values)).astype(float) for values in self.get(name)]
        if any(not np.array_equal(part, parts[0]) for part in parts):
            raise ValueError(f"the files differ in their {role}; resample them to one")
        return parts[0] * self.factor(name, units)

    def __str__(self) -> str:
        return ", ".join(
            f"{name} {'x'.join(map(str, parts[0].shape))}" for name, parts in self.parts.items()
        )


def _indexed(name: str) -> tuple[str, tuple[slice | int, ...]]:
    plain, bracket, rest = name.partition("[")
    if not bracket:
        return name, ()
    index: list[slice | int] = []
    for word in rest.rstrip("]").split(","):
        if not re.fullmatch(r"-?\d+|(-?\d*)(:-?\d*){1,2}", word.strip()):
            raise ValueError(f"'[{rest}' is not an index, such as [:,0]")
        bounds = [int(bound) if bound else None for bound in word.strip().split(":")]
        index.append(slice(*bounds) if len(bounds) > 1 else int(word))
    return plain, tuple(index)


def _has_receivers(source: _Source, options: Options) -> bool:
    if options.receivers is not None:
        return True
    return options.positions is None and "receiver" in {name.lower() for name in source.parts}


def _antennas(source: _Source, role: str, given: tuple[str, ...] | None) -> Floats:
    """Return antenna positions (channel, position, axis)."""
    channels: list[Floats] = []
    for name in source.names(role, given):
        words = name.split(",") if "[" not in name else [name]
        places = _places(source, name) if len(words) == 1 else _columns(source, words)
        channels.extend(places if places.ndim == 3 else [places])
    counts = {len(places) for places in channels}
    if len(counts) > 1:
        raise ValueError(f"the channels have {', '.join(map(str, counts))} positions; take as many")
    return np.stack(channels)


def _places(source: _Source, name: str) -> Floats:
    parts = []
    for values in source.get(name):
        found = values.astype(float)
        if found.shape[-1] != 3 and found.shape[0] == 3:
            found = found.T
        if found.ndim not in (2, 3) or found.shape[-1] != 3:
            raise ValueError(
                f"'{name}' has the shape {values.shape}; positions have x, y and z along the last "
                "dimension, or are three arrays: x,y,z"
            )
        parts.append(found)
    return np.concatenate(parts, axis=-2) * source.factor(name, LENGTHS)


def _columns(source: _Source, words: list[str]) -> Floats:
    if len(words) != 3:
        raise ValueError(f"'{','.join(words)}' must be three names or numbers, for x, y and z")
    columns = [
        np.array([float(word)]) if files.is_number(word) else source.vector(word, word, LENGTHS)
        for word in words
    ]
    found = [column for column in columns if column is not None]
    size = max(column.size for column in found)
    if any(column.size not in (1, size) for column in found):
        raise ValueError(f"'{','.join(words)}' differ in length")
    return np.stack([np.broadcast_to(column, size) for column in found], axis=-1)


def _at(time: Floats | None, own: Floats | None, places: Floats) -> Floats:
    from scipy.interpolate import CubicSpline

    if time is None or own is None:
        raise ValueError("positions of their own times need the times of the echoes as well")
    if own.size != places.shape[1] or np.any(np.diff(own) <= 0):
        raise ValueError(f"{own.size} times of the positions must rise, one for each of them")
    if time.min() < own[0] or time.max() > own[-1]:
        raise ValueError(
            f"the echoes last from {time.min():.6g} to {time.max():.6g} s, the positions from "
            f"{own[0]:.6g} to {own[-1]:.6g} s; leave out what has no position"
        )
    return np.asarray(CubicSpline(own, places, axis=1)(time))


def _oriented(
    source: _Source,
    name: str,
    order: str | None,
    axis: Floats | tuple[float, float] | None,
    positions: int,
) -> NDArray[Any]:
    """Return samples as (channel, position, sample)."""
    count = axis.size if isinstance(axis, np.ndarray) else None
    parts = []
    for values in source.get(name):
        array = np.squeeze(values) if values.ndim > 3 else values
        dims = order.split(",") if order else _guessed(name, array.shape, count, positions)
        if len(dims) != array.ndim or not {"position", "frequency"} <= set(dims):
            raise ValueError(
                f"'{name}' has the shape {array.shape}, which the order {','.join(dims)} does not "
                "fit; give position, frequency and perhaps channel"
            )
        if "channel" not in dims:
            array, dims = array[None], ["channel", *dims]
        parts.append(
            array.transpose([dims.index(dim) for dim in ("channel", "position", "frequency")])
        )
    joined = np.concatenate(parts, axis=1)
    source.notes.append(
        f"samples '{name}': {'x'.join(map(str, joined.shape))} (channel, position, sample), "
        f"{joined.dtype}"
    )
    return joined


def _guessed(name: str, shape: tuple[int, ...], count: int | None, positions: int) -> list[str]:
    """Tell the dimensions by their lengths; what fits twice is refused."""
    orders: Iterable[tuple[str, ...]] = {
        2: (("position", "frequency"), ("frequency", "position")),
        3: (
            ("channel", "position", "frequency"), ("channel", "frequency", "position"),
            ("position", "channel", "frequency"), ("position", "frequency", "channel"),
            ("frequency", "channel", "position"), ("frequency", "position", "channel"),
        ),
    }.get(len(shape), ())  # fmt: skip

    def fits(dims: tuple[str, ...], whole: bool) -> bool:
        sizes = dict(zip(dims, shape, strict=True))
        if count is not None and sizes["frequency"] != count:
            return False
        # Positions may be spread over several files.
        return sizes["position"] == positions or (not whole and count is not None)

    for whole in (True, False):
        found = [dims for dims in orders if fits(dims, whole)]
        if len(found) == 1:
            return list(found[0])
        if found:
            break
    raise ValueError(
        f"'{name}' has the shape {shape}, for {positions} positions"
        + (f" and {count} samples" if count is not None else "")
        + "; say what its dimensions are (--order position,frequency)"
    )


def _fitting(places: Floats, channels: int, positions: int, notes: list[str]) -> Floats:
    if places.shape[0] == 1 and channels > 1:
        notes.append("all channels have the same positions")
        places = np.repeat(places, channels, axis=0)
    if places.shape[:2] != (channels, positions):
        raise ValueError(
            f"antennas of {places.shape[0]} channels and {places.shape[1]} positions do not fit "
            f"samples of {channels} and {positions}"
        )
    return np.ascontiguousarray(places)


def _turn(measurement: Measurement, look_at: tuple[float, float]) -> None:
    """Turn the coordinates: x along the aperture, y ahead, the origin below the first channel."""
    center = (measurement.transmitter + measurement.receiver)[0, :, :2] / 2
    middle = center.mean(axis=0)
    _, _, axes = np.linalg.svd(center - middle, full_matrices=False)
    along = axes[0]
    ahead = np.array([-along[1], along[0]])
    toward = np.asarray(look_at) - middle
    if toward @ ahead < 0:
        along, ahead = -along, -ahead
    turned = np.stack([along, ahead])
    for name in ("transmitter", "receiver"):
        places = getattr(measurement, name).copy()
        places[..., :2] = (places[..., :2] - middle) @ turned.T
        setattr(measurement, name, places)
    x, y = turned @ toward
    measurement.scene_m = float(x), float(y)
    angle = float(np.rad2deg(np.arctan2(along[1], along[0])))
    measurement.notes.append(
        f"coordinates turned by {angle:.6g} degrees (x along the aperture) about the new origin at "
        f"x = {middle[0]:.6g} m, y = {middle[1]:.6g} m; the place looked at is at x = {x:.6g} m, "
        f"y = {y:.6g} m now"
    )


def _describe(measurement: Measurement) -> None:
    center = (measurement.transmitter + measurement.receiver) / 2
    low, high = center.reshape(-1, 3).min(0), center.reshape(-1, 3).max(0)
    measurement.notes.append(
        f"{len(center)} channel{'s' * (len(center) > 1)} of {center.shape[1]} positions; antennas "
        + ", ".join(f"{a} {p:.4g} to {q:.4g} m" for a, p, q in zip("xyz", low, high, strict=True))
    )
    if not np.isfinite(measurement.echo).all():
        count = int((~np.isfinite(measurement.echo)).sum())
        raise ValueError(f"{count} samples are missing or not finite; leave their positions out")
    if not (np.isfinite(measurement.transmitter).all() and np.isfinite(measurement.receiver).all()):
        raise ValueError("positions are missing or not finite; leave them out")
