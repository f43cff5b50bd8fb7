"""Where the antennas are: positions of transmitter and receiver by channel and position."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import CHANNELS
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.radar import aperture, geometry, grid

if TYPE_CHECKING:
    from collections.abc import Iterator

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
    baseline = {
        "baseline_m": radar.baseline_m,
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
    baseline_m: float,
    baseline_angle_deg: float,
) -> xr.Dataset:
    """Return the positions of two monostatic antennas on one cart that runs along a roof rail.

    The rail is centred on x = 0 at y = 0; the lower antenna runs at the rail's height, the upper
    one a baseline away from it in the plane across the rail.

    Parameters
    ----------
    aperture_length_m
        Distance between the first and the last position, m.
    position_spacing_m
        Spacing of the positions, m; it must divide the length.
    rail_height_m
        Height H0 of the lower antenna, m.
    baseline_m
        Distance B between the antennas, m.
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
    antennas = np.stack([line, line + _baseline(baseline_m, baseline_angle_deg)])
    return variables.dataset("trajectory", {"transmitter": antennas, "receiver": antennas.copy()})


def switched_array(
    *,
    baseline_between: Literal["transmitters", "receivers"],
    array_length_m: float,
    element_spacing_m: float,
    array_height_m: float,
    transmitter: tuple[float, float, float],
    baseline_m: float,
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
        Distance B between the transmitters, or between the arrays, m.
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
    step = np.stack([np.zeros(3), _baseline(baseline_m, baseline_angle_deg)])[:, None]
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
    positions = round(radar.aperture_length_m / radar.position_spacing_m) + 1
    return len(CHANNELS) * positions * radar.frequency_count


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


def _baseline(length_m: float, angle_deg: float) -> NDArray[np.floating]:
    beta = np.deg2rad(angle_deg)
    # The paper's vertical baseline has no y offset at all, not 1e-17 m.
    across = 0.0 if angle_deg == 90 else np.cos(beta)
    return length_m * np.array([0.0, across, np.sin(beta)])


def apertures(trajectory: xr.Dataset) -> list[aperture.Aperture]:
    """Return the aperture of each channel.

    Parameters
    ----------
    trajectory
        Product ``trajectory``, or ``images``, which hold the positions that they are focused with.

    Returns
    -------
    list of aperture.Aperture
        Straight lines through the positions (`aperture.fit`), by channel.
    """
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
    return trajectory.assign(
        {
            name: trajectory[name].copy(data=trajectory[name].values + displacement)
            for name in ("transmitter", "receiver")
        }
    )


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


CHECKS = (_waveform,)
