"""The stepped-frequency echo: a coherent sum over visible facets with their exact ranges.

A facet whose path out and back is R adds ``a exp(-2 pi i f R / c)`` at frequency f. Nothing is
stationary or plane-wave: each antenna position has its own ranges and its own visible facets.
"""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.foundations import blocks, randomness, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.foundations.randomness import Draw
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.radar import motion, trajectory, waveform
from vinsar.radar.trajectory import ANTENNAS
from vinsar.simulation import visibility as sight

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

logger = logging.getLogger(__name__)

SPLAT_TAPS = {-85.0: 4, -110.0: 6}
"""Range bins that a facet must reach for an error, dB.

Four err by -104 dB for facets at random places and by -87 dB for those on an even grid; six err by
what single precision does, some -118 dB, either way.
"""

Weighting = Literal["amplitude", "power"]
_POSITIONS_PER_BLOCK = 27

# Noise and coupling of the next scan are drawn by themselves.
_NEXT = 1


ECHO = {
    "echo": Variable(
        ("channel", "position", "frequency"),
        "complex",
        "1",
        "stepped-frequency echo",
        "a path R out and back gives the phase -2 pi f R / c",
    ),
}
"""Variables of a product with echoes."""

variables.declare("echo", ECHO)
variables.declare("received", ECHO)
variables.declare("next_received", ECHO)
variables.declare("measurement", ECHO | ANTENNAS)


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
        Largest relative error of the fast sum (`_Splat`), as a norm over the frequencies, dB. If
        it is less than what `SPLAT_TAPS` reach, or None, the sum is the direct one in float64,
        hundreds of times as slow.

    Returns
    -------
    xarray.Dataset
        Product ``echo``.

    Raises
    ------
    ValueError
        If the frequencies are not evenly spaced, a position is not finite, or visibility and the
        other products disagree.
    """
    steps = np.diff(frequency)
    if frequency.size < 2 or not np.allclose(steps, steps[0], rtol=1e-6, atol=0):
        raise ValueError("the echo needs two or more evenly spaced frequencies")
    position = facets["facet_position"].values.astype(float)
    amplitude = amplitudes(facets, reflectivity)
    transmitter, receiver = trajectory["transmitter"].values, trajectory["receiver"].values
    if not all(np.isfinite(places).all() for places in (position, transmitter, receiver)):
        raise ValueError("a facet or an antenna is at a position that is not a number")
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
    columns = np.ascontiguousarray(position.T)

    def work(channel: int, begin: int) -> None:
        chosen = slice(begin, min(begin + _POSITIONS_PER_BLOCK, positions))
        _simulate_block(
            result[channel, chosen], columns, amplitude, visible[channel, chosen],
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
    reached = [db for db in SPLAT_TAPS if accuracy_db is not None and accuracy_db >= db]
    total = _Splat(frequency, SPLAT_TAPS[max(reached)]) if reached else _Direct(frequency)
    seen = np.ascontiguousarray(visible)
    out[:] = total(
        facets, amplitude, list(zip(seen, transmitter, receiver, strict=True)), reference
    )


class _Direct:
    """The sum over facets as it stands, in double precision."""

    def __init__(self, frequency: NDArray[np.floating]) -> None:
        self.wavenumber = -2j * np.pi * frequency / SPEED_OF_LIGHT

    def __call__(
        self,
        facets: NDArray[np.floating],
        amplitude: NDArray[np.floating],
        positions: list[tuple[Any, Any, Any]],
        reference: float,
    ) -> NDArray[np.complex128]:
        """Return the echo (position, frequency) from what each position sees, sends and hears."""
        from vinsar.kernels import paths

        path, weight = np.empty(amplitude.size), np.empty(amplitude.size)
        total = np.zeros((len(positions), self.wavenumber.size), dtype=np.complex128)
        for number, antennas in enumerate(positions):
            count = int(paths.gather(facets, amplitude, *antennas, reference, path, weight))
            # In pieces, so that memory does not grow with the facets.
            for begin in range(0, count, 4096):
                piece = slice(begin, min(begin + 4096, count))
                total[number] += np.exp(np.outer(self.wavenumber, path[piece])) @ weight[piece]
        return total


class _Splat:
    """The sum over facets by B-splines on range bins, in single precision.

    The frequencies are modes of a Fourier transform of the bins, mode ``k`` of the sampled
    frequency number ``k + size // 2``. The splines' ``sinc^taps`` is divided out, so that their
    spectral images remain as its error: what the facets return at the frequencies ``f - n P``, n !=
    0, where P is the bins' sampling rate. For random facets that is as much as in the band,
    weighted ``(1 / (2 n m))^taps`` at the band's edges with m bins a resolution cell: for m = 8,
    -103 dB of four taps and -155 dB of six. But at low frequencies all facets are in phase, so P
    exceeds the highest frequency. Facets on an even grid (`facet_jitter` of 0) may echo louder at
    such a frequency than in the band: by up to 17 dB, it was seen.
    """

    def __init__(self, frequency: NDArray[np.floating], taps: int) -> None:
        from scipy import fft

        self.taps = taps
        step = float(frequency[-1] - frequency[0]) / (frequency.size - 1)
        self.turns_per_metre = float(frequency[frequency.size // 2]) / SPEED_OF_LIGHT
        self.steps_per_metre = step / SPEED_OF_LIGHT
        highest = float(frequency[-1]) / step
        self.period = fft.next_fast_len(math.ceil(max(8 * frequency.size, 1.2 * highest)))
        self.modes = np.arange(frequency.size) - frequency.size // 2

    def __call__(
        self,
        facets: NDArray[np.floating],
        amplitude: NDArray[np.floating],
        positions: list[tuple[Any, Any, Any]],
        reference: float,
    ) -> NDArray[np.complex128]:
        """Return the echo (position, frequency) from what each position sees, sends and hears."""
        from scipy import fft

        from vinsar.kernels import splat

        single = amplitude.astype(np.float32)
        bins = np.zeros((len(positions), self.period + splat.MOST_TAPS), np.complex64)
        copies = np.zeros((splat.COPIES, bins.shape[1]), np.complex64)
        for row, antennas in zip(bins, positions, strict=True):
            splat.spread(
                facets, single, *antennas, reference, self.turns_per_metre, self.steps_per_metre,
                self.taps, copies, row,
            )  # fmt: skip
        bins[:, : splat.MOST_TAPS] += bins[:, self.period :]
        spectrum = fft.fft(bins[:, : self.period])
        # A facet adds to its own bin and the next ones, not to those around it: the bins are late.
        late = np.exp(2j * np.pi * (self.taps // 2 - 1) * self.modes / self.period)
        correction = late / np.sinc(self.modes / self.period) ** self.taps
        return np.asarray(np.take(spectrum, self.modes, axis=-1, mode="wrap") * correction)


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
    if len(rngs) != samples.shape[0]:
        raise ValueError(f"{samples.shape[0]} channels need as many sources, not {len(rngs)}")
    power = _filled(samples, frequency, swath_m) / 10 ** (snr_db / 10)
    noise = np.stack(
        [rng.normal(size=(*samples.shape[1:], 2)).view(np.complex128)[..., 0] for rng in rngs]
    )
    coords = {"channel": echo["channel"].values, "frequency": frequency}
    return variables.dataset("echo", {"echo": samples + np.sqrt(power / 2) * noise}, coords)


def add_coupling(
    received: xr.Dataset,
    echo: xr.Dataset,
    trajectory: xr.Dataset,
    *,
    coupling_db: float,
    path_m: float,
    variation_db: float | None,
    swath_m: float,
    rngs: list[np.random.Generator],
) -> xr.Dataset:
    """Add the coupling between transmitter and receiver: a return at near zero range.

    Its path is that inside the radar and the distance from transmitter to receiver. At each
    position it has one complex amplitude for all frequencies, ``1 + e`` times its level, with a
    circular normal ``e`` that is independent by position.

    Parameters
    ----------
    received, echo
        Product ``echo`` with and without noise.
    trajectory
        Product ``trajectory``.
    coupling_db
        Power of the coupling over the mean power of the scene, both in a range-compressed
        resolution cell with uniform weighting, dB.
    path_m
        Path inside the radar, m.
    variation_db
        Mean power of ``e``, dB; None for a constant coupling.
    swath_m
        Extent of the scene in slant range, m.
    rngs
        One source of randomness a channel.

    Returns
    -------
    xarray.Dataset
        Product ``received`` with coupling.

    Raises
    ------
    ValueError
        If the swath is not within the unambiguous range, or a source is missing.
    """
    samples, frequency = received["echo"].values, received["frequency"].values
    channels, positions, count = samples.shape
    if len(rngs) != channels:
        raise ValueError(f"{channels} channels need as many sources, not {len(rngs)}")
    # The scene's cells are `count` to the unambiguous range; the coupling is all in one of them.
    cell = _filled(echo["echo"].values, frequency, swath_m) / count
    amplitude = np.full((channels, positions), np.sqrt(cell * 10 ** (coupling_db / 10)), complex)
    if variation_db is not None:
        draws = np.stack([rng.normal(size=(positions, 2)) @ [1, 1j] for rng in rngs])
        amplitude *= 1 + np.sqrt(10 ** (variation_db / 10) / 2) * draws
    apart = trajectory["transmitter"].values - trajectory["receiver"].values
    path = path_m + np.linalg.norm(apart, axis=-1)
    phase = np.exp(-2j * np.pi * path[..., None] * frequency / SPEED_OF_LIGHT)
    coords = {"channel": received["channel"].values, "frequency": frequency}
    return variables.dataset("echo", {"echo": samples + amplitude[..., None] * phase}, coords)


def _filled(
    samples: NDArray[np.complexfloating], frequency: NDArray[np.floating], swath_m: float
) -> float:
    """Return the mean power of a sample, were all ranges as strong as the swath."""
    unambiguous = waveform.unambiguous_range(float(frequency[1] - frequency[0]))
    if not 0 < swath_m <= unambiguous:
        raise ValueError(
            f"a swath of {swath_m:.2f} m is not within the unambiguous range of {unambiguous:.2f} m"
        )
    return float(np.mean(np.abs(samples) ** 2) * unambiguous / swath_m)


class Echo(Section, name="echo"):
    """How the echo is simulated."""

    reflectivity: Literal["amplitude", "power"] = key(
        "what the scene's reflectivity weights: the echo's amplitude or its power", "not given"
    )
    occlusion: bool = key("terrain hides what lies behind it (Eqs. 8-9)", "section 2.1")
    spreading: bool = key(
        "amplitude falls with 1 / (transmit range x receive range), relative to the scene centre",
        "not mentioned",
    )
    snr_db: float | None = key(
        "signal-to-noise ratio in a range-compressed resolution cell; null for no noise",
        "not mentioned",
        ge=-40,
        le=120,
    )
    coupling_db: float | None = key(
        "power of the coupling between transmitter and receiver over the mean power of the scene, "
        "both in a range-compressed resolution cell; null for none",
        "future work",
        ge=-40,
        le=140,
    )
    coupling_path_m: float = key(
        "path of the coupling inside the radar; the distance between the antennas comes to it",
        "not given",
        ge=0,
    )
    coupling_variation_db: float | None = key(
        "what of the coupling changes at random from position to position, over the coupling; "
        "null for none",
        "not given",
        ge=-140,
        le=0,
    )
    accuracy_db: float = key(
        "largest error of the sum over facets against the direct one; from -85 on it is fastest, "
        "below -110 it is the direct one, hundreds of times as slow",
        "not given",
        ge=-200,
        le=-40,
    )


def _echo(products: Products, study: Study) -> xr.Dataset:
    return simulate(
        products["facets"],
        products["true_trajectory"],
        products["visibility"] if study.echo.occlusion else None,
        frequency=waveform.sampled(study.radar),
        reflectivity=study.echo.reflectivity,
        spreading=study.echo.spreading,
        accuracy_db=study.echo.accuracy_db,
    )


def _received(products: Products, study: Study) -> xr.Dataset:
    return _as_received(products["echo"], products, study)


def _next_received(products: Products, study: Study) -> xr.Dataset:
    options, antennas = study.echo, products["next_true_trajectory"]
    seen = (
        sight.facet_visibility(products["terrain"], products["facets"], antennas)
        if options.occlusion
        else None
    )
    clean = simulate(
        products["facets"],
        antennas,
        seen,
        frequency=waveform.sampled(study.radar),
        reflectivity=options.reflectivity,
        spreading=options.spreading,
        accuracy_db=options.accuracy_db,
    )
    return _as_received(clean, products, study, _NEXT)


def _as_received(clean: xr.Dataset, products: Products, study: Study, *scan: int) -> xr.Dataset:
    options = study.echo
    if options.snr_db is None and options.coupling_db is None:
        return clean
    # The antennas at rest: over a whole scan a vehicle in motion sees a wider swath than from any
    # one place, and motion leaves a transmitter's distance from its receiver as it is.
    facets, antennas = products["facets"], products["trajectory"]
    near, far = trajectory.range_extent(
        antennas, *_facet_extent(facets), facets["facet_position"].values[:, 2]
    )

    def rngs(purpose: Draw) -> list[np.random.Generator]:
        return [
            randomness.generator(study, purpose, channel, *scan)
            for channel in range(clean.sizes["channel"])
        ]

    result = clean
    if options.snr_db is not None:
        result = add_noise(clean, snr_db=options.snr_db, swath_m=far - near, rngs=rngs(Draw.NOISE))
    if options.coupling_db is not None:
        result = add_coupling(
            result,
            clean,
            antennas,
            coupling_db=options.coupling_db,
            path_m=options.coupling_path_m,
            variation_db=options.coupling_variation_db,
            swath_m=far - near,
            rngs=rngs(Draw.COUPLING),
        )
    return result


def _facet_extent(facets: xr.Dataset) -> tuple[Floats, Floats]:
    position = facets["facet_position"].values
    least, most = position.min(axis=0), position.max(axis=0)
    return np.array([least[0], most[0]]), np.array([least[1], most[1]])


STAGES = {
    "echo": Stage(
        _echo,
        inputs=("facets", "true_trajectory", "visibility"),
        sections=(
            *waveform.KEYS,
            "echo.reflectivity",
            "echo.occlusion",
            "echo.spreading",
            "echo.accuracy_db",
        ),
        by_channel=True,
        parallel=True,
    ),
    "received": Stage(
        _received,
        inputs=("echo", "facets", "trajectory"),
        sections=(
            *randomness.KEYS,
            "echo.snr_db",
            "echo.coupling_db",
            "echo.coupling_path_m",
            "echo.coupling_variation_db",
        ),
    ),
    "next_received": Stage(
        _next_received,
        inputs=("terrain", "facets", "trajectory", "next_true_trajectory"),
        sections=(*randomness.KEYS, *waveform.KEYS, "echo"),
        parallel=True,
        when=lambda study: motion.has_next_scan(study.vehicle),
    ),
}
