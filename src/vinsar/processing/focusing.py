"""From echoes to complex images: range compression and back-projection."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar.foundations import blocks, randomness, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.processing import leakage
from vinsar.radar import grid, motion, trajectory, waveform
from vinsar.radar.trajectory import ANTENNAS

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.errors import Fault
    from vinsar.foundations.stage import Products

logger = logging.getLogger(__name__)

Interpolation = Literal["linear", "cubic"]

# B-splines of degree 1 and 3 attenuate a frequency by sinc to these powers.
_SINC_POWER: dict[str, int] = {"linear": 2, "cubic": 4}

_ROWS_PER_BLOCK = 32
_POSITIONS_PER_BLOCK = 128


# Slant range by which the profiles exceed the image: position errors shall not need new ones.
_PROFILE_MARGIN_M = 0.5

# They begin at a multiple of this: so positions that differ a little give images of the same bits.
_PROFILE_STEP_M = 0.5

variables.declare(
    "profiles",
    {
        "profile": Variable(
            ("channel", "position", "slant_range"),
            "complex",
            "1",
            "range-compressed profile",
            "at baseband: the carrier's phase over the slant-range axis is removed; "
            "a unit point target peaks at 1",
        ),
        "carrier_frequency": Variable((), "real", "Hz", "carrier frequency of the profiles"),
    },
)
variables.declare(
    "images",
    {
        "image": Variable(
            ("channel", "y", "x"),
            "complex",
            "1",
            "complex image focused on the ground plane",
            "a unit point target on the ground plane gives amplitude 1 and phase 0",
        ),
        "wavelength": Variable((), "real", "m", "wavelength of the carrier"),
        **ANTENNAS,
    },
)


class Imaging(Section, name="imaging"):
    """Range compression and back-projection."""

    x_min_m: float = key("left edge of the image", "section 2")
    x_max_m: float = key("right edge of the image", "section 2")
    y_min_m: float = key("near edge of the image", "section 2")
    y_max_m: float = key("far edge of the image", "section 2")
    grid_spacing_m: float = key("pixel spacing of image and DEM", "not given", gt=0)
    grid_spacing_x_m: float | None = key(
        "pixel spacing in x, if it is not that of y; null for grid_spacing_m", "not given", gt=0
    )
    grid_spacing_y_m: float | None = key(
        "pixel spacing in y, if it is not that of x; null for grid_spacing_m", "not given", gt=0
    )
    range_window: Literal["rectangular", "hann", "hamming", "blackman"] = key(
        "weighting of the frequencies", "not mentioned"
    )
    aperture_window: Literal["rectangular", "hann", "hamming", "blackman"] = key(
        "weighting of the antenna positions", "not mentioned"
    )
    oversampling: int = key(
        "range samples per resolution cell before interpolation", "not given", ge=2, le=128
    )
    interpolation: Literal["linear", "cubic"] = key(
        "interpolation of the range profiles: linear errs by -64 dB at an oversampling of 16; "
        "cubic by -79 dB at 4, -93 dB at 6 and -103 dB at 8",
        "not given",
    )
    surface: Literal["plane", "estimated"] = key(
        "what the images that make the heights are focused on: the ground plane, or, in a second "
        "pass with the band and aperture that both channels share there, the surface just found",
        "section 1.2",
    )
    surface_std_m: float = key(
        "standard deviation of the Gaussian that smooths that surface", "not mentioned", gt=0
    )


def compress(
    echo: xr.Dataset,
    *,
    near_range_m: float,
    far_range_m: float,
    window: waveform.WindowName = "rectangular",
    oversampling: int = 16,
    interpolation: Interpolation = "linear",
) -> xr.Dataset:
    """Compress the echo in range, for back-projection by interpolation.

    The profile at slant range rho is ``sum_k w_k s_k exp(4 pi i (f_k - f_c) rho / c)`` with weights
    of sum 1. Interpolation between its samples attenuates the band's edges, linear by sinc^2 and
    cubic (by B-splines) by sinc^4; the weights undo that, so only the spectral images of the
    interpolation remain as its error. At oversampling m a full band has them at
    ``2 (1 / 2m)^4 / 5`` of its power if linear, ``2 (1 / 2m)^8 / 9`` if cubic: -64 dB for linear at
    16; -79, -93 and -103 dB for cubic at 4, 6 and 8.

    Parameters
    ----------
    echo
        Product ``echo``.
    near_range_m, far_range_m
        Slant ranges to cover, m.
    window
        Weighting of the frequencies.
    oversampling
        Range samples per resolution cell ``c / 2W``, at least.
    interpolation
        What the profiles are weighted for; it goes with them as an attribute.

    Returns
    -------
    xarray.Dataset
        Product ``profiles``.

    Raises
    ------
    ValueError
        If the ranges do not rise, or span more than the unambiguous range.
    """
    profile, slant_range = compressed(
        echo["echo"].values,
        echo["frequency"].values,
        near_range_m=near_range_m,
        far_range_m=far_range_m,
        window=window,
        oversampling=oversampling,
        interpolation=interpolation,
    )
    carrier = waveform.carrier(echo["frequency"].values)
    result = variables.dataset(
        "profiles",
        {"profile": profile, "carrier_frequency": carrier},
        {"channel": echo["channel"].values, "slant_range": slant_range},
    )
    result["profile"].attrs["interpolation"] = interpolation
    return result


def compressed(
    samples: NDArray[np.complexfloating],
    frequency: NDArray[np.floating],
    *,
    near_range_m: float,
    far_range_m: float,
    window: waveform.WindowName,
    oversampling: int,
    interpolation: Interpolation,
) -> tuple[NDArray[np.complexfloating], NDArray[np.floating]]:
    """Return what `compress` does, as arrays: profiles and slant ranges.

    Parameters
    ----------
    samples, frequency
        The echo (channel, position, frequency) and its frequencies, Hz.
    near_range_m, far_range_m, window, oversampling, interpolation
        As for `compress`, which says what is refused.

    Returns
    -------
    tuple of ndarray
        Profiles (channel, position, slant range), complex64, and the slant ranges, m.
    """
    from scipy import fft

    count = frequency.size
    step = float(frequency[-1] - frequency[0]) / (count - 1)
    unambiguous = waveform.unambiguous_range(step)
    if not 0 <= near_range_m < far_range_m:
        raise ValueError(f"the ranges {near_range_m} m and {far_range_m} m do not rise from 0")
    if far_range_m - near_range_m > unambiguous:
        raise ValueError(
            f"{far_range_m - near_range_m:.2f} m of slant range exceed the unambiguous range of "
            f"{unambiguous:.2f} m; take a finer frequency step"
        )
    length = fft.next_fast_len(count * oversampling)
    spacing = unambiguous / length
    offset = np.arange(count) - (count - 1) / 2
    attenuation = np.sinc(offset / length) ** _SINC_POWER[interpolation]
    weights = (waveform.window(window, count) / attenuation).astype(np.float32)
    # Two samples to spare on either side for the interpolation.
    first = int(np.floor(near_range_m / spacing)) - 2
    cells = np.arange(first, int(np.ceil(far_range_m / spacing)) + 3)
    # The transform's phase runs from the first frequency; the carrier is the band's middle.
    turn = np.exp(-2j * np.pi * ((count - 1) / 2 * cells / length % 1)).astype(np.complex64)
    channels, positions = samples.shape[:2]
    profile = np.empty((channels, positions, cells.size), np.complex64)

    def work(channel: int, begin: int) -> None:
        part = channel, slice(begin, begin + _POSITIONS_PER_BLOCK)
        # In single precision: its rounding, below -120 dB, is less than the interpolation's error.
        spectrum = samples[part].astype(np.complex64) * weights
        whole = fft.ifft(spectrum, length, axis=-1, norm="forward", overwrite_x=True)
        np.multiply(np.take(whole, cells, axis=-1, mode="wrap"), turn, out=profile[part])

    blocks.run(
        work,
        (
            (channel, begin)
            for channel in range(channels)
            for begin in range(0, positions, _POSITIONS_PER_BLOCK)
        ),
    )
    return profile, spacing * cells


def backproject(
    profiles: xr.Dataset,
    antenna_paths: xr.Dataset,
    *,
    x: NDArray[np.floating],
    y: NDArray[np.floating],
    z: ArrayLike = 0.0,
    window: waveform.WindowName = "rectangular",
    extra_range_m: NDArray[np.floating] | None = None,
) -> xr.Dataset:
    """Back-project the profiles onto a surface, by default the ground plane.

    They are interpolated as they are weighted for (`compress`).

    ``I(p) = sum_l v_l P_l(rho_l) exp(4 pi i f_c rho_l / c)`` with the exact half path ``rho_l``
    from transmitter to pixel to receiver and weights of sum 1: a unit point target on the surface
    gives amplitude 1 and phase 0.

    Parameters
    ----------
    profiles
        Product ``profiles``.
    antenna_paths
        Product ``trajectory``: the antenna positions as the radar knows them.
    x, y
        Axes of the grid, m.
    z
        Height of the surface, a number or (y, x), m.
    window
        Weighting of the antenna positions.
    extra_range_m
        What to add to the half paths ``rho_l`` of each (channel, position), such as an estimated
        error of the positions along the line of sight, m; by default nothing.

    Returns
    -------
    xarray.Dataset
        Product ``images``.

    Raises
    ------
    ValueError
        If profiles, trajectory and extra ranges differ in their positions, or the profiles do not
        cover the grid.
    """
    from vinsar.kernels import backprojection, rail

    samples = profiles["profile"].values
    transmitter, receiver = antenna_paths["transmitter"].values, antenna_paths["receiver"].values
    if samples.shape[:2] != transmitter.shape[:2]:
        raise ValueError(
            f"profiles of {samples.shape[:2]} channels and positions do not fit a trajectory of "
            f"{transmitter.shape[:2]}"
        )
    extra = (
        np.zeros(samples.shape[:2]) if extra_range_m is None else np.asarray(extra_range_m, float)
    )
    if extra.shape != samples.shape[:2] or not np.isfinite(extra).all():
        raise ValueError(
            f"extra ranges of {extra.shape} do not give a number for each of {samples.shape[:2]} "
            "channels and positions"
        )
    slant_range = profiles["slant_range"].values
    spacing = float(slant_range[-1] - slant_range[0]) / (slant_range.size - 1)
    cubic = profiles["profile"].attrs.get("interpolation", "linear") == "cubic"
    near, far = trajectory.range_extent(antenna_paths, x, y, z)
    near, far = near + min(0.0, extra.min()), far + max(0.0, extra.max())
    # A cubic reads one sample more on either side.
    spare = spacing if cubic else 0.0
    if near < slant_range[0] + spare or far > slant_range[-1] - spare:
        raise ValueError(
            f"the profiles cover {slant_range[0]:.2f} to {slant_range[-1]:.2f} m of slant range, "
            f"but the grid needs {near:.2f} to {far:.2f} m"
        )
    weights = waveform.window(window, samples.shape[1])
    # Real and imaginary parts apart: so their samples fit into vector registers.
    parts = np.zeros((2, *samples.shape[:2], slant_range.size + backprojection.PADDING), np.float32)
    for part, values in zip(parts, (samples.real, samples.imag), strict=True):
        part[..., : slant_range.size] = values * weights[:, None].astype(np.float32)
    surface = np.ascontiguousarray(np.broadcast_to(np.asarray(z, dtype=float), (y.size, x.size)))
    rails = [
        None if some.any() else _rail(x, surface, *ends)
        for some, *ends in zip(extra, transmitter, receiver, strict=True)
    ]
    carrier = float(profiles["carrier_frequency"])
    image = np.zeros((samples.shape[0], y.size, x.size), dtype=np.complex64)
    sampling = float(slant_range[0]), spacing, 2 * carrier / SPEED_OF_LIGHT, cubic

    def work(channel: int, begin: int) -> None:
        rows = slice(begin, begin + _ROWS_PER_BLOCK)
        out, back, regular = transmitter[channel], receiver[channel], rails[channel]
        data = parts[0, channel], parts[1, channel], *sampling
        if regular is None:
            backprojection.accumulate(
                image[channel, rows], x, y[rows], surface[rows], out, back, extra[channel], *data
            )
        else:
            rail.accumulate(
                image[channel, rows], x[0], (x[-1] - x[0]) / (x.size - 1), y[rows],
                np.ascontiguousarray(surface[rows, 0]), out[0], back[0], *regular, *data,
            )  # fmt: skip

    blocks.run(
        work,
        (
            (channel, begin)
            for channel in range(samples.shape[0])
            for begin in range(0, y.size, _ROWS_PER_BLOCK)
        ),
    )
    logger.debug("back-projected %d x %d pixels from %d positions", *image.shape[1:], len(weights))
    return variables.dataset(
        "images",
        {
            "image": image,
            "wavelength": waveform.wavelength(carrier),
            "transmitter": transmitter,
            "receiver": receiver,
        },
        {"channel": profiles["channel"].values, "x": x, "y": y},
    )


def _rail(
    x: NDArray[np.floating],
    surface: NDArray[np.floating],
    transmitter: NDArray[np.floating],
    receiver: NDArray[np.floating],
) -> tuple[float, int, int] | None:
    """Return the positions' pitch, classes and stride as `kernels.rail` takes them, if it can."""
    if x.size < 2 or len(transmitter) < 2 or np.ptp(surface, axis=1).any():
        return None
    spacing = (x[-1] - x[0]) / (x.size - 1)
    pitch = (transmitter[-1, 0] - transmitter[0, 0]) / (len(transmitter) - 1)
    if pitch <= 0:
        return None
    classes, stride = max(1, round(spacing / pitch)), max(1, round(pitch / spacing))
    shift = pitch * np.arange(len(transmitter))[:, None] * np.array([1.0, 0.0, 0.0])
    places = [(transmitter, transmitter[0] + shift), (receiver, receiver[0] + shift)]
    grid = (x, x[0] + spacing * np.arange(x.size))
    # Rounding of coordinates is allowed for: a nanometre is a millionth of a cycle.
    even = all(np.abs(found - expected).max() < 1e-9 for found, expected in [*places, grid])
    last = (len(transmitter) - 1) * abs(spacing / classes - pitch / stride)
    return (pitch, classes, stride) if even and last < 1e-9 else None


def _profiles(products: Products, study: Study) -> xr.Dataset:
    antennas = motion.advance(
        products["trajectory"],
        speed_m_per_s=motion.told_speed(study),
        duration_s=trajectory.scan_duration(study.radar, study.vehicle),
    )
    near, far = trajectory.range_extent(antennas, *grid.image_axes(study.imaging))
    frequency = products["received"]["frequency"].values
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1)
    # Of ranges that repeat, none is needed twice.
    repeated = waveform.unambiguous_range(step)
    margin = min(_PROFILE_MARGIN_M, 0.49 * (repeated - far + near))
    begin = _PROFILE_STEP_M * np.floor((near - margin) / _PROFILE_STEP_M)
    return compress(
        leakage.clean(products["received"], study),
        near_range_m=max(0.0, float(begin), far + margin - repeated),
        far_range_m=far + margin,
        window=study.imaging.range_window,
        oversampling=study.imaging.oversampling,
        interpolation=study.imaging.interpolation,
    )


def _images(products: Products, study: Study) -> xr.Dataset:
    x, y = grid.image_axes(study.imaging)
    return backproject(
        products["profiles"],
        trajectory.displaced(
            products["recorded_trajectory"], products["autofocus"]["displacement"].values
        ),
        x=x,
        y=y,
        window=study.imaging.aperture_window,
    )


def _image_grid(imaging: Imaging) -> Iterator[Fault]:
    faults = list(grid.check_extent("imaging", imaging))
    yield from faults
    if faults:
        return
    for axis, spacing in zip("xy", grid.pixel(imaging), strict=True):
        low, high = getattr(imaging, f"{axis}_min_m"), getattr(imaging, f"{axis}_max_m")
        own = f"grid_spacing_{axis}_m"
        spacing_key = "grid_spacing_m" if getattr(imaging, own) is None else own
        yield from grid.check_multiple(f"imaging.{spacing_key}", spacing, low, high, spacing)


STAGES = {
    "profiles": Stage(
        _profiles,
        inputs=("received", "trajectory"),
        sections=(
            *randomness.KEYS,
            *grid.KEYS,
            "vehicle",
            *trajectory.SCAN_KEYS,
            "suppression",
            "imaging.range_window",
            "imaging.oversampling",
            "imaging.interpolation",
        ),
    ),
    "images": Stage(
        _images,
        inputs=("profiles", "recorded_trajectory", "autofocus"),
        sections=(*grid.KEYS, "imaging.aperture_window"),
        by_channel=True,
        parallel=True,
    ),
}


CHECKS = (_image_grid,)
