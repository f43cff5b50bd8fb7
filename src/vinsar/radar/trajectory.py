"""Where the antennas are: positions of transmitter and receiver by channel and position."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.radar import aperture, geometry, grid

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products


KEYS = (
    "radar.system",
    "radar.aperture_length_m",
    "radar.position_spacing_m",
    "radar.rail_height_m",
    "radar.baseline_m",
    "radar.baselines_m",
    "radar.baseline_angle_deg",
    "radar.transmitter_x_m",
    "radar.transmitter_y_m",
    "radar.transmitter_height_m",
)
"""Keys of the configuration that give the antenna positions."""

ANTENNAS = {
    "transmitter": variables.Variable(
        ("channel", "position", "axis"), "real", "m", "position of the transmitting antenna"
    ),
    "receiver": variables.Variable(
        ("channel", "position", "axis"), "real", "m", "position of the receiving antenna"
    ),
}
"""Variables of a product with antenna positions."""

variables.declare("trajectory", ANTENNAS)


class Radar(Section, name="radar"):
    """The radar and its antennas (Table 1)."""

    system: Literal["rail", "transmit_pair", "receive_pair"] = key(
        "antenna arrangement: a cart with both antennas on a roof rail, or switched arrays in its "
        "place: one receives and transmitters stand at two heights, or two receive at two heights "
        "and one transmitter stands",
        "section 1",
    )
    start_frequency_hz: float = key("lowest frequency", "Table 1", gt=0)
    stop_frequency_hz: float = key("highest frequency", "Table 1", gt=0)
    frequency_count: int = key("number of frequencies, evenly spaced", "not given", ge=2)
    aperture_length_m: float = key(
        "length of the aperture along x: of the rail or the array", "Table 1", gt=0
    )
    position_spacing_m: float = key(
        "spacing of the antenna positions, or of the array's elements", "Table 1", gt=0
    )
    rail_height_m: float = key(
        "height above ground of the lower antenna on the rail, or of the array (the lower of two), "
        "H0",
        "not given",
        gt=0,
    )
    baseline_m: float = key(
        "distance between the antennas, the transmitters of a transmit pair, or the arrays, B",
        "Table 1",
        gt=0,
    )
    baselines_m: Annotated[tuple[float, ...], Field(strict=False, min_length=1)] | None = key(
        "distances of all antennas above the lower one (transmitters, arrays), rising; the last is "
        "baseline_m, and shorter ones settle its phase's whole cycles; null for baseline_m alone",
        "not mentioned",
    )
    baseline_angle_deg: float = key(
        "attitude of the baseline from horizontal, beta; 90 is vertical", "Table 1", ge=0, le=180
    )
    transmitter_x_m: float = key(
        "place of an array's transmitter (the lower of two) along the array, from its middle",
        "not given",
    )
    transmitter_y_m: float = key("its place ahead of the array", "not given")
    transmitter_height_m: float = key("its height above ground", "not given", gt=0)
    dwell_s: float = key("time for each frequency of an array's sweep", "not given", gt=0, le=1)

    @property
    def baselines(self) -> tuple[float, ...]:
        """Distances of all antennas above the lower one, m; the longest is the last."""
        return self.baselines_m or (self.baseline_m,)

    def with_baseline(self, length_m: float) -> Radar:
        """Return the radar with another longest baseline (`longest`)."""
        return self.model_copy(update=longest(length_m, self.baselines_m))


def longest(length_m: float, baselines_m: Sequence[float] | None) -> dict[str, Any]:
    """Return the keys of section ``radar`` that change with the longest baseline.

    Parameters
    ----------
    length_m
        The longest baseline, m.
    baselines_m
        ``radar.baselines_m`` until now; the antennas below the upper one stay where the new one
        leaves them below.
    """
    if baselines_m is None:
        return {"baseline_m": length_m, "baselines_m": None}
    shorter = [other for other in baselines_m[:-1] if other < length_m]
    return {"baseline_m": length_m, "baselines_m": (*shorter, length_m)}


def planned(radar: Radar) -> xr.Dataset:
    """Return the antenna positions of a configuration.

    Parameters
    ----------
    radar
        Section ``radar``.

    Returns
    -------
    xarray.Dataset
        Product ``trajectory``.
    """
    baseline: dict[str, Any] = {
        "baseline_m": radar.baselines,
        "baseline_angle_deg": radar.baseline_angle_deg,
    }
    if radar.system == "rail":
        return rail(
            aperture_length_m=radar.aperture_length_m,
            position_spacing_m=radar.position_spacing_m,
            rail_height_m=radar.rail_height_m,
            **baseline,
        )
    return switched_array(
        baseline_between="transmitters" if radar.system == "transmit_pair" else "receivers",
        array_length_m=radar.aperture_length_m,
        element_spacing_m=radar.position_spacing_m,
        array_height_m=radar.rail_height_m,
        transmitter=(radar.transmitter_x_m, radar.transmitter_y_m, radar.transmitter_height_m),
        **baseline,
    )


def rail(
    *,
    aperture_length_m: float,
    position_spacing_m: float,
    rail_height_m: float,
    baseline_m: float | Sequence[float],
    baseline_angle_deg: float,
) -> xr.Dataset:
    """Return the positions of monostatic antennas on one cart that runs along a roof rail.

    The rail is centred on x = 0 at y = 0; the lower antenna runs at the rail's height, the upper
    one a baseline away from it in the plane across the rail, and others may be between them.

    Parameters
    ----------
    aperture_length_m
        Distance between the first and the last position, m.
    position_spacing_m
        Spacing of the positions, m; it must divide the length.
    rail_height_m
        Height H0 of the lower antenna, m.
    baseline_m
        Distance B between the antennas, m; for more than two, of each from the lower one, rising.
    baseline_angle_deg
        Attitude beta of the baseline from horizontal, degrees; 90 is vertical.

    Returns
    -------
    xarray.Dataset
        Product ``trajectory``: ``transmitter`` and ``receiver`` (channel, position, axis), m.

    Raises
    ------
    ValueError
        If the spacing does not divide the length.
    """
    line = _line(aperture_length_m, position_spacing_m, rail_height_m)
    antennas = line + _baselines(baseline_m, baseline_angle_deg)
    return variables.dataset("trajectory", {"transmitter": antennas, "receiver": antennas.copy()})


def switched_array(
    *,
    baseline_between: Literal["transmitters", "receivers"],
    array_length_m: float,
    element_spacing_m: float,
    array_height_m: float,
    transmitter: tuple[float, float, float],
    baseline_m: float | Sequence[float],
    baseline_angle_deg: float,
) -> xr.Dataset:
    """Return the positions of a switched array: one end of each path stands still.

    A position is an element of the receive array, which lies along x, centred on x = 0 at y = 0.

    Parameters
    ----------
    baseline_between
        Two transmitters and one receive array, or two receive arrays and one transmitter.
    array_length_m
        Distance between the first and the last element, m.
    element_spacing_m
        Spacing of the elements, m; it must divide the length.
    array_height_m
        Height H0 of the array, the lower one of two, m.
    transmitter
        Position of the transmitter, the lower one of two, m.
    baseline_m
        Distance B between the transmitters, or between the arrays, m; for more than two, of each
        from the lower one, rising.
    baseline_angle_deg
        Attitude beta of the baseline from horizontal, degrees; 90 is vertical.

    Returns
    -------
    xarray.Dataset
        Product ``trajectory``: ``transmitter`` and ``receiver`` (channel, position, axis), m.

    Raises
    ------
    ValueError
        If the spacing does not divide the length.
    """
    line = _line(array_length_m, element_spacing_m, array_height_m)
    still = np.broadcast_to(np.array(transmitter, float), line.shape)
    step = _baselines(baseline_m, baseline_angle_deg)
    between_transmitters = baseline_between == "transmitters"
    return variables.dataset(
        "trajectory",
        {
            "transmitter": still + step * between_transmitters,
            "receiver": line + step * (not between_transmitters),
        },
    )


def samples(radar: Radar) -> int:
    """Return the samples of a scan: channels x positions x frequencies."""
    channels = 2 if radar.baselines_m is None else len(radar.baselines_m) + 1
    positions = round(radar.aperture_length_m / radar.position_spacing_m) + 1
    return channels * positions * radar.frequency_count


def scan_duration(radar: Radar, vehicle: Any) -> float:
    """Return the duration of a scan, s: the cart's on a rail, the dwell on all samples of an array.

    Parameters
    ----------
    radar, vehicle
        Sections of the configuration.
    """
    # ASSUME: An array has one receiver, which is switched from element to element; a cart
    # measures both channels as it passes. A microsecond for each frequency.
    return vehicle.scan_duration_s if radar.system == "rail" else samples(radar) * radar.dwell_s


SCAN_KEYS = (
    "radar.baselines_m",
    "radar.system",
    "radar.aperture_length_m",
    "radar.position_spacing_m",
    "radar.frequency_count",
    "radar.dwell_s",
)
"""Keys that `scan_duration` depends on, beside ``vehicle.scan_duration_s``."""


def _line(length_m: float, spacing_m: float, height_m: float) -> NDArray[np.floating]:
    x = geometry.grid_axis(-length_m / 2, length_m / 2, spacing_m)
    return np.stack([x, np.zeros(x.size), np.full(x.size, height_m)], axis=-1)


def _baselines(lengths_m: float | Sequence[float], angle_deg: float) -> NDArray[np.floating]:
    """Return where the channels stand from the lower one (channel, 1, axis), m."""
    beta = np.deg2rad(angle_deg)
    # The paper's vertical baseline has no y offset at all, not 1e-17 m.
    across = 0.0 if angle_deg == 90 else np.cos(beta)
    lengths = np.concatenate([[0.0], np.atleast_1d(lengths_m)])
    return lengths[:, None, None] * np.array([0.0, across, np.sin(beta)])


def apertures(trajectory: xr.Dataset) -> list[aperture.Aperture]:
    """Return the apertures of the lower and the upper channel, whatever is between them.

    Parameters
    ----------
    trajectory
        Product ``trajectory``, or ``images``, which hold the positions that they are focused with.

    Returns
    -------
    list of aperture.Aperture
        Straight lines through the positions (`aperture.fit`), by channel.
    """
    found = all_apertures(trajectory)
    return [found[0], found[-1]] if len(found) > 1 else found


def outer(product: xr.Dataset) -> xr.Dataset:
    """Return a product of its first and its last channel alone."""
    return product if product.sizes["channel"] == 2 else product.isel(channel=[0, -1])


def all_apertures(trajectory: xr.Dataset) -> list[aperture.Aperture]:
    """Return the aperture of each channel, as `apertures` does of two."""
    ends = trajectory["transmitter"].values, trajectory["receiver"].values
    return [aperture.fit(*channel) for channel in zip(*ends, strict=True)]


def displaced(trajectory: xr.Dataset, displacement: NDArray[np.floating]) -> xr.Dataset:
    """Return a trajectory with a displacement added to transmitters and receivers alike.

    Parameters
    ----------
    trajectory
        Product ``trajectory``.
    displacement
        Displacement (channel, position, axis), m.
    """
    ends = {name: trajectory[name].values + displacement for name in ("transmitter", "receiver")}
    return trajectory.copy(data=ends)


def range_extent(
    trajectory: xr.Dataset, x: NDArray[np.floating], y: NDArray[np.floating], z: ArrayLike = 0.0
) -> tuple[float, float]:
    """Return the least and the largest slant range between any antenna and a grid, m.

    Parameters
    ----------
    trajectory
        Product ``trajectory``.
    x, y
        Axes of the grid, m.
    z
        Heights of the surface, m; its extremes count.
    """
    antennas = np.stack([trajectory["transmitter"].values, trajectory["receiver"].values])
    z = np.asarray(z, dtype=float)
    least, most = np.zeros(antennas.shape[:-1]), np.zeros(antennas.shape[:-1])
    for axis, (low, high) in enumerate(((x[0], x[-1]), (y[0], y[-1]), (z.min(), z.max()))):
        place = antennas[..., axis]
        least += np.maximum(np.maximum(low - place, place - high), 0) ** 2
        most += np.maximum(np.abs(low - place), np.abs(high - place)) ** 2
    return float(np.sqrt(least.min())), float(np.sqrt(most.max()))


def _trajectory(products: Products, study: Study) -> xr.Dataset:
    del products
    return planned(study.radar)


def _baselines_rise(radar: Radar) -> Iterator[Fault]:
    lengths = radar.baselines
    if lengths[0] <= 0 or any(a >= b for a, b in pairwise(lengths)):
        yield Fault("radar.baselines_m", lengths, "must rise from above 0, no two of them equal")
    elif lengths[-1] != radar.baseline_m:
        yield Fault(
            "radar.baselines_m",
            lengths,
            f"must end with radar.baseline_m, {radar.baseline_m:g} m: make the two the same",
        )


def _baselines_tell(radar: Radar) -> Iterator[Fault]:
    least = SPEED_OF_LIGHT / (radar.start_frequency_hz + radar.stop_frequency_hz) / 2
    if radar.baselines_m is not None and radar.baselines[0] < least:
        yield Fault(
            "radar.baselines_m",
            radar.baselines[0],
            f"is shorter than a quarter of the wavelength, {least:.4f} m: its phase hardly "
            "changes with height",
        )


def _waveform(radar: Radar) -> Iterator[Fault]:
    if radar.start_frequency_hz >= radar.stop_frequency_hz:
        yield Fault(
            "radar.stop_frequency_hz",
            radar.stop_frequency_hz,
            f"must exceed radar.start_frequency_hz, {radar.start_frequency_hz:g}",
        )
    half = radar.aperture_length_m / 2
    yield from grid.check_multiple(
        "radar.position_spacing_m", radar.position_spacing_m, -half, half, radar.position_spacing_m
    )


STAGES = {
    "trajectory": Stage(_trajectory, sections=KEYS),
}


CHECKS = (_waveform, _baselines_rise)

ADVICE = (_baselines_tell,)
