"""Position errors of a shaking vehicle, and what they do to the focus (Fig. 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.polynomial import polynomial

from vinsar import variables
from vinsar.constants import AXES, SPEED_OF_LIGHT

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

AxisName = Literal["x", "y", "z"]
Distribution = Literal["uniform", "normal"]
Spectrum = Literal["white", "sinusoidal", "random_walk"]


def errors(
    positions: int,
    *,
    std_m: float,
    distribution: Distribution,
    spectrum: Spectrum,
    cycles_per_aperture: float,
    rng: np.random.Generator,
) -> Floats:
    """Draw the position errors of one antenna along one axis.

    Parameters
    ----------
    positions
        Number of antenna positions.
    std_m
        Standard deviation of the errors, m: of each error for ``white``, over a period for
        ``sinusoidal``, over the aperture for ``random_walk``.
    distribution
        Of the errors (``white``) or of the steps (``random_walk``); a uniform error has the
        half-width ``sqrt(3) std``.
    spectrum
        ``white``: independent from position to position, as in the paper; ``sinusoidal``: one
        vibration of random phase; ``random_walk``: drift, the sum of independent steps.
    cycles_per_aperture
        Frequency of the sinusoid, in periods over the aperture.
    rng
        Source of randomness; the draw scales with the standard deviation and changes in nothing
        else with it.

    Returns
    -------
    ndarray, shape (position,)
        Errors, m.
    """
    if spectrum == "sinusoidal":
        phase = 2 * np.pi * rng.random()
        turns = cycles_per_aperture * np.linspace(0, 1, positions)
        return std_m * np.sqrt(2) * np.sin(2 * np.pi * turns + phase)
    if distribution == "uniform":
        unit = np.sqrt(3) * rng.uniform(-1, 1, positions)
    else:
        unit = rng.standard_normal(positions)
    if spectrum == "random_walk":
        # The variance grows with the steps; its mean over the aperture is (positions + 1) / 2.
        unit = np.cumsum(unit) / np.sqrt((positions + 1) / 2)
    return std_m * unit


def displace(
    trajectory: xr.Dataset, *, axis: AxisName, draw: Callable[[int, int], Floats]
) -> xr.Dataset:
    """Displace a trajectory's antennas along one axis, transmitter and receiver alike.

    Parameters
    ----------
    trajectory
        Product ``trajectory``.
    axis
        Axis of the displacement.
    draw
        From a channel's number and the number of positions to errors (position,), m.

    Returns
    -------
    xarray.Dataset
        Product ``trajectory`` with other positions.
    """
    antennas = {name: trajectory[name].values.copy() for name in ("transmitter", "receiver")}
    channels, positions, _ = antennas["transmitter"].shape
    for channel in range(channels):
        shift = draw(channel, positions)
        for values in antennas.values():
            values[channel, :, AXES.index(axis)] += shift
    return variables.dataset("trajectory", antennas, {"channel": trajectory["channel"].values})


def point_gain(
    truth: xr.Dataset,
    recorded: xr.Dataset,
    point: Floats,
    frequency: Floats,
    range_weights: Floats,
    aperture_weights: Floats,
) -> Floats:
    """Return how much of a point target's image is left at its position, by channel.

    The exact matched filter of the recorded positions applied to the echo of the true ones:
    ``|sum_l v_l sum_k w_k exp(4 pi i f_k (rho_recorded - rho_true) / c)|``, 1 without errors.

    Parameters
    ----------
    truth, recorded
        Product ``trajectory``: where the antennas were, and where imaging takes them to be.
    point
        Position of the target (3,), m.
    frequency
        Evenly spaced frequencies, Hz.
    range_weights, aperture_weights
        Weights of frequencies and positions, each of sum 1.

    Returns
    -------
    ndarray, shape (channel,)
        Amplitude relative to perfect focus.
    """

    def half_path(antennas: xr.Dataset) -> Floats:
        legs = [
            np.linalg.norm(antennas[name].values - point, axis=-1)
            for name in ("transmitter", "receiver")
        ]
        return np.asarray(legs[0] + legs[1]) / 2

    delay = 2 * (half_path(recorded) - half_path(truth)) / SPEED_OF_LIGHT
    # The frequencies are evenly spaced: the sum over them is a polynomial of the step's phase.
    step = np.exp(2j * np.pi * delay * (frequency[1] - frequency[0]))
    profile = polynomial.polyval(step, range_weights) * np.exp(2j * np.pi * delay * frequency[0])
    return np.asarray(np.abs(profile @ aperture_weights))
