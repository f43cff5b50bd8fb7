"""The stepped-frequency echo: a coherent sum over visible facets with their exact ranges.

A facet whose path out and back is R adds ``a exp(-2 pi i f R / c)`` at frequency f. Nothing is
stationary or plane-wave: each antenna position has its own ranges and its own visible facets.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar import blocks, radar, variables
from vinsar.constants import SPEED_OF_LIGHT

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

logger = logging.getLogger(__name__)

Weighting = Literal["amplitude", "power"]
_POSITIONS_PER_BLOCK = 27


def amplitudes(facets: xr.Dataset, reflectivity: Weighting) -> NDArray[np.floating]:
    """Return the facets' echo amplitudes.

    Parameters
    ----------
    facets
        Product ``facets``.
    reflectivity
        What the reflectivity is: the echo's ``amplitude``, or its ``power`` (then its root is
        taken).

    Returns
    -------
    ndarray, shape (facet,)
        Amplitudes.

    Raises
    ------
    ValueError
        If a reflectivity is negative.
    """
    values = facets["reflectivity"].values.astype(float)
    if values.size and values.min() < 0:
        raise ValueError(f"a facet has the negative reflectivity {values.min()}")
    return values if reflectivity == "amplitude" else np.sqrt(values)


def simulate(
    facets: xr.Dataset,
    trajectory: xr.Dataset,
    visibility: xr.Dataset | None = None,
    *,
    frequency: NDArray[np.floating],
    reflectivity: Weighting = "amplitude",
    spreading: bool = False,
    accuracy_db: float | None = -110.0,
) -> xr.Dataset:
    """Simulate the echo at every channel, position and frequency.

    Parameters
    ----------
    facets, trajectory, visibility
        Products of these names; without visibility, every facet is seen.
    frequency
        Evenly spaced frequencies, Hz.
    reflectivity
        As in `amplitudes`.
    spreading
        Amplitude falls with 1 / (transmit range x receive range), relative to the mean range.
    accuracy_db
        Largest relative error of the fast sum (a non-uniform Fourier transform), as a norm over
        the frequencies; None for the direct float64 sum, about 100 times slower.

    Returns
    -------
    xarray.Dataset
        Product ``echo``.

    Raises
    ------
    ValueError
        If the frequencies are not evenly spaced, or visibility and the other products disagree.
    """
    steps = np.diff(frequency)
    if frequency.size < 2 or not np.allclose(steps, steps[0], rtol=1e-6, atol=0):
        raise ValueError("the echo needs two or more evenly spaced frequencies")
    position = np.ascontiguousarray(facets["facet_position"].values, dtype=float)
    amplitude = amplitudes(facets, reflectivity)
    transmitter, receiver = trajectory["transmitter"].values, trajectory["receiver"].values
    channels, positions = transmitter.shape[:2]
    if visibility is None:
        visible = np.broadcast_to(np.array(True), (channels, positions, len(position)))
    else:
        visible = visibility["visible"].values
        if visible.shape != (channels, positions, len(position)):
            raise ValueError(
                f"visibility is of shape {visible.shape}, but there are {channels} channels, "
                f"{positions} positions and {len(position)} facets"
            )
    reference = 0.0
    if spreading:
        centre = position.mean(axis=0)
        reference = float(np.linalg.norm(transmitter.mean(axis=(0, 1)) - centre))
    result = np.empty((channels, positions, frequency.size), dtype=np.complex128)

    def work(channel: int, begin: int) -> None:
        chosen = slice(begin, min(begin + _POSITIONS_PER_BLOCK, positions))
        _simulate_block(
            result[channel, chosen], position, amplitude, visible[channel, chosen],
            transmitter[channel, chosen], receiver[channel, chosen], frequency, reference,
            accuracy_db,
        )  # fmt: skip

    blocks.run(
        work,
        (
            (channel, begin)
            for channel in range(channels)
            for begin in range(0, positions, _POSITIONS_PER_BLOCK)
        ),
    )
    logger.info("echo of %d facets at %d positions", len(position), channels * positions)
    coords = {"channel": trajectory["channel"].values, "frequency": frequency}
    return variables.dataset("echo", {"echo": result}, coords)


def _simulate_block(
    out: NDArray[np.complex128],
    facets: NDArray[np.floating],
    amplitude: NDArray[np.floating],
    visible: NDArray[np.bool_],
    transmitter: NDArray[np.floating],
    receiver: NDArray[np.floating],
    frequency: NDArray[np.floating],
    reference: float,
    accuracy_db: float | None,
) -> None:
    from vinsar.kernels import paths

    path, weight = np.empty(len(facets)), np.empty(len(facets))
    plan = None if accuracy_db is None else _Transform(frequency, accuracy_db)
    for index in range(len(out)):
        count = paths.gather(
            facets, amplitude, visible[index], transmitter[index], receiver[index], reference,
            path, weight,
        )  # fmt: skip
        if plan is None:
            out[index] = _direct(path[:count], weight[:count], frequency)
        else:
            out[index] = plan(path[:count], weight[:count])


def _direct(
    path: NDArray[np.floating], weight: NDArray[np.floating], frequency: NDArray[np.floating]
) -> NDArray[np.complex128]:
    # In pieces, so that memory does not grow with the facets.
    total = np.zeros(frequency.size, dtype=np.complex128)
    for begin in range(0, path.size, 4096):
        piece = slice(begin, begin + 4096)
        turns = np.outer(frequency / SPEED_OF_LIGHT, path[piece])
        total += np.exp(-2j * np.pi * turns) @ weight[piece]
    return total


class _Transform:
    """The sum over facets as a type-1 non-uniform Fourier transform, planned once a block."""

    def __init__(self, frequency: NDArray[np.floating], accuracy_db: float) -> None:
        import finufft

        count = frequency.size
        # Mode k of the transform is frequency number k + count // 2.
        self.center = float(frequency[count // 2])
        self.step = float(frequency[-1] - frequency[0]) / (count - 1)
        self.plan = finufft.Plan(
            1, (count,), eps=max(10 ** (accuracy_db / 20), 1e-14), isign=-1, nthreads=1
        )
        self.count = count

    def __call__(
        self, path: NDArray[np.floating], weight: NDArray[np.floating]
    ) -> NDArray[np.complex128]:
        if path.size == 0:
            return np.zeros(self.count, dtype=np.complex128)
        delay = path / SPEED_OF_LIGHT
        cycles = self.center * delay
        strength = weight * np.exp(-2j * np.pi * (cycles - np.rint(cycles)))
        turns = self.step * delay
        self.plan.setpts(2 * np.pi * (turns - np.rint(turns)))
        return np.asarray(self.plan.execute(strength))


def add_noise(
    echo: xr.Dataset, *, snr_db: float, swath_m: float, rngs: list[np.random.Generator]
) -> xr.Dataset:
    """Add thermal noise: white, complex Gaussian, of one power in both channels.

    The signal-to-noise ratio is that of a range-compressed resolution cell with uniform
    weighting: mean signal power over the swath's cells against noise power in a cell. By
    Parseval the noise of a frequency sample then has the power
    ``mean |s|^2 / (SNR x swath / unambiguous range)``.

    Parameters
    ----------
    echo
        Product ``echo``.
    snr_db
        Signal-to-noise ratio, dB.
    swath_m
        Extent of the scene in slant range, m.
    rngs
        One source of randomness a channel.

    Returns
    -------
    xarray.Dataset
        Product ``echo`` with noise.

    Raises
    ------
    ValueError
        If the swath is not within the unambiguous range, or a source is missing.
    """
    samples = echo["echo"].values
    frequency = echo["frequency"].values
    unambiguous = radar.unambiguous_range(float(frequency[1] - frequency[0]))
    if not 0 < swath_m <= unambiguous:
        raise ValueError(
            f"a swath of {swath_m:.2f} m is not within the unambiguous range of {unambiguous:.2f} m"
        )
    if len(rngs) != samples.shape[0]:
        raise ValueError(f"{samples.shape[0]} channels need as many sources, not {len(rngs)}")
    power = np.mean(np.abs(samples) ** 2) * unambiguous / swath_m / 10 ** (snr_db / 10)
    noise = np.stack(
        [rng.normal(size=(*samples.shape[1:], 2)).view(np.complex128)[..., 0] for rng in rngs]
    )
    coords = {"channel": echo["channel"].values, "frequency": frequency}
    return variables.dataset("echo", {"echo": samples + np.sqrt(power / 2) * noise}, coords)
