"""A second pass on the surface just found, with the band that both channels have in common.

Focused on the ground plane, what rises above it is defocused and lies elsewhere in either image,
and ground that slopes is seen by the two channels in wavenumbers that are not the same. Both
decorrelate. Here each pixel is focused on the place that the first pass found for it, and with the
part of the band and of the aperture that both channels share there (Gatelli et al. 1994 for the
band along range; a synthetic aperture has the like along x).

With the tangents u and v of the surface and path_i the path out and back of channel i, frequency f
and position s of a channel see the surface at the wavenumbers

    2 pi / c f a,    2 pi / c f (b + g s),    a = d path / dv, b = d path / du, g = d b / ds.

So frequency f of channel 1 pairs with q f of channel 2, q = a1 / a2, and position s1 with
s2 = (b1 + g1 s1) / (q g2) - b2 / g2; what has no partner is left out.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import blocks, variables
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing import filtering, height, interferogram, leakage
from vinsar.radar import aperture, grid, trajectory, waveform

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

logger = logging.getLogger(__name__)

# Sub-bands differ by a hundredth of the band: what that leaves unshared decorrelates by 0.25 %.
_SUB_BAND = 0.01

# Ground on which the channels share less than half of the band is seen at grazing incidence.
_MOST_LOST = 0.5

# Range samples a resolution cell: cubic interpolation's spectral images are below -69 dB.
_OVERSAMPLING = 3

# Power that counts no more in the surface, in medians: single bright pixels do not make it.
_MOST_POWER = 3.0

# Weight, in pixels of median power, below which no surface is known.
_LEAST_WEIGHT = 1e-6

_MOST_STEPS = 20
_CONVERGED_M = 1e-7

_ROWS_PER_BLOCK, _POSITIONS_PER_BLOCK = 16, 48

variables.declare(
    "refined",
    {
        "phase": Variable(
            GRID,
            "real",
            "radian",
            "interferometric phase by the second pass, without the flat-earth phase",
            "lower minus upper; unwrapped, known up to one constant",
        ),
        "image": Variable(
            ("channel", "y", "x"),
            "complex",
            "1",
            "complex image focused on the surface",
            "the upper one turned by the surface's phase, as if it were focused on the plane",
        ),
        "interferogram": Variable(GRID, "complex", "1", "interferogram of these"),
        "filtered": Variable(GRID, "complex", "1", "filtered interferogram of these"),
        "coherence": Variable(
            GRID,
            "real",
            "1",
            "multilooked coherence magnitude of these",
            bounds=(0, 1),
        ),
        "surface": Variable(
            GRID, "real", "m", "height of the surface that the image's pixel is focused on"
        ),
        "surface_phase": Variable(
            GRID,
            "real",
            "radian",
            "phase of the surface, removed before the filter",
            "without the flat-earth phase",
        ),
        "shared": Variable(
            GRID,
            "real",
            "1",
            "share of band times aperture that both channels have in common",
            bounds=(0, 1),
        ),
    },
)


@dataclass(frozen=True)
class Support:
    """The part of band and aperture that both channels have in common on a surface.

    Attributes
    ----------
    bands
        Edges of each sub-band by channel (channel, sub-band, edge), Hz.
    kind
        The pixel's sub-band (y, x).
    first, last
        Where the pixel's aperture begins and ends (channel, y, x), in positions; position l
        reaches from l - 1/2 to l + 1/2.
    """

    bands: Floats
    kind: NDArray[np.int32]
    first: Floats
    last: Floats

    @property
    def centers(self) -> Floats:
        """Middle of the pixels' bands (channel, y, x), Hz."""
        return np.asarray(self.bands.mean(axis=-1)[:, self.kind])

    def share(self, frequency: Floats, positions: int) -> Floats:
        """Return the part of band times aperture that is left of channel 1 (y, x)."""
        step = float(frequency[-1] - frequency[0]) / (frequency.size - 1)
        width = np.diff(self.bands[0], axis=-1)[:, 0] / (step * frequency.size)
        return np.asarray(width[self.kind] * np.maximum(self.last - self.first, 0)[0] / positions)


def surface(height: Floats, power: Floats, *, std_px: float | Sequence[float]) -> Floats:
    """Return heights smoothed by a Gaussian, weighted with the image's power.

    Parameters
    ----------
    height
        Heights of the pixels (y, x), m; NaN where unknown.
    power
        The pixels' power (y, x); what exceeds three medians counts as that.
    std_px
        Standard deviation of the Gaussian, pixels; of two, in y and x.

    Returns
    -------
    ndarray, shape (y, x)
        Heights, m; far from any known height that of the nearest one. The ground plane, with a
        warning in the log, if no pixel has both a height and power.
    """
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    known = np.isfinite(height) & np.isfinite(power) & (power > 0)
    if not known.any():
        logger.warning("the first pass found no height to focus on: the ground plane instead")
        return np.zeros(height.shape)
    weight = np.zeros(height.shape)
    weight[known] = np.minimum(power[known] / np.median(power[known]), _MOST_POWER)
    total = gaussian_filter(weight, std_px, mode="constant")
    value = gaussian_filter(weight * np.where(known, height, 0.0), std_px, mode="constant")
    found = total > _LEAST_WEIGHT
    result = np.divide(value, total, out=np.zeros_like(value), where=found)
    if not found.all():
        nearest = distance_transform_edt(~found, return_distances=False, return_indices=True)
        result = result[tuple(nearest)]
    return np.asarray(result)


def place(lower: aperture.Aperture, x: Floats, y: Floats, height: Floats) -> Floats:
    """Return the places of given heights that are imaged at the pixels of the ground plane.

    Parameters
    ----------
    lower
        Aperture of the image.
    x, y
        Axes of the image, m.
    height
        Heights (y, x), m.

    Returns
    -------
    ndarray, shape (3, y, x)
        Places, m: on a rail, on circles around it. Where there is no place of this height, the
        pixel's own on the ground plane.
    """
    pixel = np.stack(
        [np.broadcast_to(x, height.shape), np.broadcast_to(y[:, None], height.shape)]
    ).astype(float)
    found = pixel.copy()
    for _ in range(_MOST_STEPS):
        # A place is imaged nearly as far from the pixel as it is from where it should be.
        missed = pixel - np.stack(aperture.image_position(lower, found[0], found[1], height))
        found += missed
        if not np.any(np.abs(missed) > _CONVERGED_M):
            break
    known = (np.abs(missed) <= _CONVERGED_M).all(axis=0)
    return np.where(known, np.stack([*found, height]), np.stack([*pixel, np.zeros(height.shape)]))


def _rates(channel: aperture.Aperture, point: Floats, positions: int) -> tuple[Floats, ...]:
    """Return how path and slope change along the surface: a, b and g of the module's docstring."""
    along_v, along_u = np.gradient(point, axis=(1, 2))
    path, slope = aperture.gradients(channel, *point)
    turn = (slope * along_u).sum(axis=0) / max(positions - 1, 1)
    return (path * along_v).sum(axis=0), (path * along_u).sum(axis=0), turn


def support(
    channels: tuple[aperture.Aperture, aperture.Aperture],
    point: Floats,
    frequency: Floats,
    positions: int,
) -> Support:
    """Return what of band and aperture two channels have in common on a surface.

    Parameters
    ----------
    channels
        Apertures of the two channels.
    point
        Places of the pixels on the surface (axis, y, x), m.
    frequency
        Frequencies, Hz.
    positions
        Number of antenna positions.

    Returns
    -------
    Support
        Bands and positions by pixel.
    """
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1)
    low, high = frequency[0] - step / 2, frequency[-1] + step / 2
    relative = (high - low) / waveform.carrier(frequency)
    (a1, b1, g1), (a2, b2, g2) = (_rates(channel, point, positions) for channel in channels)
    with np.errstate(all="ignore"):
        wanted = np.nan_to_num(a1 / a2, nan=1.0, posinf=1.0, neginf=1.0)
        most = round(_MOST_LOST / _SUB_BAND)
        number = np.clip(np.rint((wanted - 1) / (relative * _SUB_BAND)), -most, most)
        least = number.min()
        ratios = 1 + relative * _SUB_BAND * np.arange(least, number.max() + 1)
        kind = (number - least).astype(np.int32)
        ratio = ratios[kind]
        # Position s1 of channel 1 pairs with scale s1 + shift of channel 2, from their middles.
        scale, shift = g1 / (ratio * g2), (b1 / ratio - b2) / g2
        half = positions / 2
        ends = np.sort(np.stack([(-half - shift) / scale, (half - shift) / scale]), axis=0)
    first = np.stack([np.maximum(-half, ends[0]), np.empty_like(ratio)])
    last = np.stack([np.minimum(half, ends[1]), np.empty_like(ratio)])
    first[1], last[1] = scale * first[0] + shift, scale * last[0] + shift
    lower = np.stack([np.maximum(low, low / ratios), np.minimum(high, high / ratios)], axis=-1)
    middle = (positions - 1) / 2
    return Support(np.stack([lower, lower * ratios[:, None]]), kind, first + middle, last + middle)


def focus(
    echo: xr.Dataset,
    antenna_paths: xr.Dataset,
    point: Floats,
    common: Support,
    *,
    range_window: waveform.WindowName = "rectangular",
    aperture_window: waveform.WindowName = "rectangular",
) -> Complexes:
    """Focus two channels on a surface, each pixel with its own band and aperture.

    Parameters
    ----------
    echo
        Product ``received``, of two channels.
    antenna_paths
        Product ``trajectory``: their positions as the radar knows them.
    point
        Places of the pixels on the surface (axis, y, x), m.
    common
        Bands and positions of the pixels.
    range_window, aperture_window
        Weightings of the frequencies and of the positions; what is left out of either is not
        made up for.

    Returns
    -------
    ndarray, shape (2, y, x), complex64
        Images; their phase is that of the carrier, zero for a point target on the surface.
    """
    from vinsar.kernels import subbands

    frequency = echo["frequency"].values
    samples = echo["echo"].values
    weights = waveform.window(aperture_window, samples.shape[1])
    ends = np.stack([antenna_paths["transmitter"].values, antenna_paths["receiver"].values], axis=1)
    corners = point.reshape(3, -1)
    near, far = trajectory.range_extent(
        antenna_paths, *(np.array([axis.min(), axis.max()]) for axis in corners)
    )
    transform, first_range, spacing, attenuation = _transform(frequency, near, far)
    windowed = waveform.window(range_window, frequency.size) / attenuation
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1)
    kinds = common.bands.shape[1]
    profile = np.empty((2, 2, kinds, samples.shape[1], transform.shape[-1]), np.float32)
    image = np.empty((2, *point.shape[1:]), np.complex64)
    low = np.maximum(frequency - step / 2, common.bands[..., :1])
    high = np.minimum(frequency + step / 2, common.bands[..., 1:])
    kept = (windowed * np.clip((high - low) / step, 0, 1)).astype(np.float32)
    data = (samples * weights[:, None]).astype(np.complex64)
    antennas = np.ascontiguousarray(ends.transpose(0, 1, 3, 2))
    if np.array_equal(antennas[:, 0], antennas[:, 1]):
        antennas = antennas[:, :1]

    def compress(channel: int, begin: int) -> None:
        part = slice(begin, begin + _POSITIONS_PER_BLOCK)
        subbands.compress(
            data[channel, part], kept[channel], transform, profile[channel, :, :, part]
        )

    def accumulate(channel: int, begin: int) -> None:
        rows = slice(begin, begin + _ROWS_PER_BLOCK)
        subbands.accumulate(
            image[channel, rows], np.ascontiguousarray(point[:, rows]), common.kind[rows],
            common.first[channel, rows], common.last[channel, rows], antennas[channel],
            profile[channel], first_range, spacing,
            2 * waveform.carrier(frequency) / SPEED_OF_LIGHT,
        )  # fmt: skip

    # Both channels at once: each start of Dask takes as long as some blocks.
    for work, size, each in (
        (compress, data.shape[1], _POSITIONS_PER_BLOCK),
        (accumulate, point.shape[1], _ROWS_PER_BLOCK),
    ):
        blocks.run(work, [(channel, n) for channel in range(2) for n in range(0, size, each)])
    return image


def _transform(frequency: Floats, near: float, far: float) -> tuple[Floats, float, float, Floats]:
    """Return the transform to slant ranges, their first and their spacing, and the attenuation."""
    from scipy import fft

    from vinsar.kernels import subbands

    count = frequency.size
    step = float(frequency[-1] - frequency[0]) / (count - 1)
    length = fft.next_fast_len(count * _OVERSAMPLING)
    spacing = waveform.unambiguous_range(step) / length
    # Samples to spare on either side for the interpolation, and to fill up the last lanes.
    first = int(np.floor(near / spacing)) - 2
    needed = int(np.ceil(far / spacing)) + 4 - first
    cells = first + np.arange(-(-needed // subbands.LANES) * subbands.LANES)
    turns = np.outer(2 * np.arange(count) - (count - 1), cells) % (2 * length)
    angle = np.pi * np.arange(2 * length) / length
    offset = np.arange(count) - (count - 1) / 2
    circle = np.stack([np.cos(angle), np.sin(angle)]).astype(np.float32)
    transform = np.stack([part[turns] for part in circle])
    return transform, spacing * first, spacing, np.sinc(offset / length) ** 4


def _refined(products: Products, study: Study) -> xr.Dataset:
    images, unwrapped = products["images"], products["unwrapped"]
    x, y = images["x"].values, images["y"].values
    ends = [0, -1]
    echo = leakage.clean(products["received"], study).isel(channel=ends)
    frequency = echo["frequency"].values
    channels = trajectory.apertures(images)
    wavelength = float(images["wavelength"])
    points = height.reference(x, y, study.height)
    offset = height.phase_offset(unwrapped, images, points, trend=study.height.trend)
    first = height.invert(unwrapped, images, offset)
    found = surface(
        first.image_height,
        np.abs(images["image"].values[0]) ** 2,
        std_px=[study.imaging.surface_std_m / grid.step(axis) for axis in (y, x)],
    )
    point = place(channels[0], x, y, found)
    positions = echo.sizes["position"]
    common = support((channels[0], channels[1]), point, frequency, positions)
    lower, upper = focus(
        echo,
        images.isel(channel=ends),
        point,
        common,
        range_window=study.imaging.range_window,
        aperture_window=study.imaging.aperture_window,
    )
    # What is left after the surface's phase and the channels' own constant does not wrap.
    constant = np.exp(1j * offset).astype(np.complex64)
    filtered = filtering.smooth(lower * np.conj(upper) * constant, **study.filtering.model_dump())
    rest = np.angle(filtered) * waveform.carrier(frequency) / common.centers[1]
    flat = aperture.flat_earth_phase(channels[0], channels[1], x[None, :], y[:, None], wavelength)
    known = (
        aperture.interferometric_phase(
            channels[0], channels[1], point[0], point[1], point[2], wavelength
        )
        - flat
    )
    turn = np.exp(1j * known).astype(np.complex64)
    return variables.dataset(
        "refined",
        {
            # What the first pass has no phase of, it has no surface of.
            "phase": np.where(np.isfinite(unwrapped["phase"]), known + rest - offset, np.nan),
            "image": np.stack([lower, upper / turn]),
            "interferogram": lower * np.conj(upper) * turn,
            "filtered": filtered / constant * turn,
            "coherence": interferogram.coherence(
                lower, upper, study.interferogram.coherence_window_px
            ),
            "surface": found,
            "surface_phase": known,
            "shared": common.share(frequency, positions),
        },
        {"x": x, "y": y},
    )


STAGES = {
    "refined": Stage(
        _refined,
        inputs=("received", "images", "unwrapped"),
        sections=(
            "suppression",
            "imaging.range_window",
            "imaging.aperture_window",
            "imaging.surface_std_m",
            "interferogram",
            "filtering",
            "height",
        ),
        parallel=True,
        when=lambda study: study.imaging.surface == "estimated",
    ),
}
