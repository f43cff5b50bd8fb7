"""Registration of the two images: none, by the circle, by coherence; and focusing instead.

All four from the same echoes, through the same filter and inversion. On the ground plane a target
of some height lies elsewhere in either image (Fig. 2); the paper leaves its registration to later
work. The shift is taken from the heights that the first pass found (on a rail, along the circle
around it) or from where the coherence of a window is largest. The second pass
(`vinsar.processing.common_band`) focuses both images on the surface instead. The true terrain
serves to say how far off the shifts are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import tables, variables
from vinsar.foundations.constants import NORMAL_PER_MAD
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.processing import common_band, filtering, height, interferogram
from vinsar.radar import aperture, grid, trajectory, waveform
from vinsar.radar.instrument import Instrument

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Complexes = NDArray[np.complexfloating]
    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]
    Pair = tuple[aperture.Aperture, aperture.Aperture]

PROCESSING = ("plane", "circle", "coherence", "refocused")
"""How the two images are brought together."""

_NAMES = {
    "plane": "ground plane, not registered",
    "circle": "registered by the circle",
    "coherence": "registered by coherence",
    "refocused": "focused on the surface, common band",
}

# Length of the near and of the far band along y, m.
_BAND_M = 3.0

# Search for the largest coherence: window, farthest shift and step, m. The window holds about 40
# resolution cells, so that the shift of the largest coherence scatters by 0.02 of one.
_WINDOW_M, _FARTHEST_M, _STEP_M = 0.7, 0.06, 0.005

_ITERATIONS = 12

_BY = ("processing", "band")

variables.declare(
    "registered",
    {
        "coherence": Variable(_BY, "real", "1", "mean coherence magnitude of visible ground"),
        "misregistration": Variable(
            _BY, "real", "m", "shift that is left along y, root mean square over visible ground"
        ),
        "height_std": Variable(
            _BY, "real", "m", "standard deviation of the height error on visible ground"
        ),
        "height_mad": Variable(
            _BY, "real", "m", "median absolute deviation of the height error on visible ground"
        ),
        "resolution": Variable(("band",), "real", "m", "resolution along y in the band's middle"),
        "band_edge": Variable(("band", "end"), "real", "m", "where the band begins and ends, y"),
    },
    coordinates={
        "processing": Variable(
            ("processing",), "label", "", "how the two images are brought together"
        ),
        "band": Variable(("band",), "label", "", "part of the scene by distance"),
        "end": Variable(("end",), "integer", "1", "near or far edge"),
    },
    statistics=True,
)


def seen_by_upper(channels: Pair, place: Floats) -> Floats:
    """Return where on the ground plane the upper channel images places, x and y in m (2, y, x)."""
    return np.stack(aperture.image_position(channels[1], *place))


def true_place(lower: aperture.Aperture, x: Floats, y: Floats, truth: Floats) -> Floats:
    """Return the places of the terrain that the lower channel images at the pixels, m (3, y, x).

    Parameters
    ----------
    lower
        Its aperture.
    x, y
        Axes of image and terrain, m.
    truth
        Heights of the terrain (y, x), m.
    """
    from scipy.ndimage import map_coordinates

    terrain = np.nan_to_num(truth)
    found = np.zeros(truth.shape)
    for _ in range(_ITERATIONS):
        place = common_band.place(lower, x, y, found)
        row, column = grid.place(place[1], y), grid.place(place[0], x)
        found = map_coordinates(terrain, [row, column], order=1, mode="nearest")
    return common_band.place(lower, x, y, found)


def resample(image: Complexes, x: Floats, y: Floats, at: Floats) -> Complexes:
    """Return a complex image without carrier at other places, by cubic splines.

    Parameters
    ----------
    image
        Image (y, x), demodulated: its spectrum lies around zero.
    x, y
        Axes, m.
    at
        Places x and y (2, y, x), m; beyond the image it is zero.
    """
    from scipy.ndimage import map_coordinates

    places = [grid.place(at[1], y), grid.place(at[0], x)]
    real, imaginary = (map_coordinates(part, places, order=3) for part in (image.real, image.imag))
    return np.asarray(real + 1j * imaginary)


def by_coherence(lower: Complexes, upper: Complexes, x: Floats, y: Floats, phase: Floats) -> Floats:
    """Return the shift along y with which two demodulated images are most coherent (y, x), m.

    Parameters
    ----------
    lower, upper
        Demodulated images (y, x).
    x, y
        Axes, m.
    phase
        Absolute interferometric phase (y, x), rad, so that relief turns none within a window.
    """
    from scipy.ndimage import gaussian_filter, uniform_filter

    sides = [max(1, round(_WINDOW_M / grid.step(axis))) for axis in (y, x)]

    def mean(values: Floats) -> Floats:
        return np.asarray(uniform_filter(values, sides, mode="nearest"))

    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    shifts = np.arange(-_FARTHEST_M, _FARTHEST_M + _STEP_M / 2, _STEP_M)
    turned = lower * np.exp(-1j * phase)
    found = []
    for shift in shifts:
        moved = resample(upper, x, y, np.stack([grid_x, grid_y + shift]))
        # Beyond the image there is nothing to compare with.
        there = (grid_y + shift >= y[0]) & (grid_y + shift <= y[-1])
        product = turned * np.conj(moved) * there
        power = mean(np.abs(turned * there) ** 2) * mean(np.abs(moved * there) ** 2)
        cross = np.hypot(mean(product.real), mean(product.imag))
        found.append(cross / np.sqrt(power + np.finfo(float).tiny))
    gamma = np.stack(found)
    best = np.clip(gamma.argmax(axis=0), 1, len(shifts) - 2)[None]
    before, at, after = (np.take_along_axis(gamma, best + step, 0)[0] for step in (-1, 0, 1))
    curve = np.minimum(before - 2 * at + after, -np.finfo(float).tiny)
    step = np.clip((before - after) / (2 * curve), -1, 1)
    # The parabola through three coherences, smoothed as far as the window reaches.
    return np.asarray(gaussian_filter(shifts[best[0]] + step * _STEP_M, [n / 4 for n in sides]))


def _registered(products: Products, study: Study) -> xr.Dataset:
    images, unwrapped = products["images"].isel(channel=[0, -1]), products["unwrapped"]
    truth, refined = products["truth"], products["refined"]
    x, y = images["x"].values, images["y"].values
    channels = trajectory.apertures(images)
    pair = channels[0], channels[1]
    wavelength = float(images["wavelength"])
    flat = aperture.flat_earth_phase(*pair, x[None, :], y[:, None], wavelength)
    # Without the carrier, which turns faster from pixel to pixel than they sample.
    lower, upper = (
        image * np.exp(-2j * np.pi / wavelength * aperture.path(part, x[None, :], y[:, None]))
        for image, part in zip(images["image"].values, pair, strict=True)
    )
    points = height.reference(x, y, study.height)
    estimated = common_band.place(pair[0], x, y, refined["surface"].values)
    real = true_place(pair[0], x, y, truth["height"].values)
    pixel = np.stack([np.broadcast_to(x, flat.shape), np.broadcast_to(y[:, None], flat.shape)])
    needed = seen_by_upper(pair, real)
    along_circle = seen_by_upper(pair, estimated)
    shift = by_coherence(lower, upper, x, y, flat + unwrapped["phase"].values)
    at = {
        "plane": pixel,
        "circle": along_circle,
        "coherence": pixel + np.stack([np.zeros(shift.shape), shift]),
        "refocused": along_circle,
    }
    bands = {"near": (y[0], y[0] + _BAND_M), "far": (y[-1] - _BAND_M, y[-1])}
    visible = ~truth["shadow"].values & np.isfinite(truth["height"].values)
    rows = {name: ((y >= low) & (y <= high))[:, None] for name, (low, high) in bands.items()}
    window = study.interferogram.coherence_window_px
    result: dict[str, list[list[float]]] = {
        name: [] for name in ("coherence", "misregistration", "height_std", "height_mad")
    }
    for name in PROCESSING:
        if name == "refocused":
            gamma, heights = refined["coherence"].values, products["dem"]["height"].values
        else:
            moved = resample(upper, x, y, at[name])
            gamma, heights = _heights(
                lower, moved, flat, unwrapped, images, points, window=window, study=study
            )
        error, left = heights - truth["height"].values, (at[name] - needed)[1]
        own: dict[str, list[float]] = {key: [] for key in result}
        for band in rows.values():
            seen = visible & band & np.isfinite(error)
            own["coherence"].append(float(gamma[seen].mean()))
            own["misregistration"].append(float(np.sqrt((left[seen] ** 2).mean())))
            own["height_std"].append(float(error[seen].std()))
            middle = np.median(error[seen])
            own["height_mad"].append(float(np.median(np.abs(error[seen] - middle))))
        for key, values in own.items():
            result[key].append(values)
    instrument = Instrument.of(images, waveform.sampled(study.radar))
    middles = np.array([np.mean(ends) for ends in bands.values()])
    return variables.dataset(
        "registered",
        {key: np.array(values) for key, values in result.items()}
        | {
            "resolution": instrument.resolution(float(x.mean()), middles)[1],
            "band_edge": np.array(list(bands.values())),
        },
        {
            "processing": np.array(PROCESSING),
            "band": np.array(list(bands)),
            "end": np.arange(2),
        },
    )


def _heights(
    lower: Complexes,
    upper: Complexes,
    flat: Floats,
    unwrapped: xr.Dataset,
    images: xr.Dataset,
    points: tuple[Floats, Floats, Floats],
    *,
    window: int,
    study: Study,
) -> tuple[Floats, Floats]:
    """Return coherence and heights (y, x) of two demodulated images as they lie on each other."""
    turned = (lower * np.exp(-1j * flat)).astype(np.complex64)
    moved = upper.astype(np.complex64)
    smooth = filtering.smooth(turned * np.conj(moved), **study.filtering.model_dump())
    # The cycles are those that the first pass found.
    before = unwrapped["phase"].values
    phase = unwrapped.assign(phase=(("y", "x"), before + np.angle(smooth * np.exp(-1j * before))))
    offset = height.phase_offset(phase, images, points, trend=study.height.trend)
    gamma = interferogram.coherence(turned, moved, window)
    return gamma, height.invert(phase, images, offset).height


def as_markdown(registered: xr.Dataset) -> str:
    """Return the comparison as a Markdown table.

    Parameters
    ----------
    registered
        Product ``registered``.
    """
    rows = []
    for band in registered["band"].values:
        low, high = registered["band_edge"].sel(band=band).values
        cell = float(registered["resolution"].sel(band=band))
        for name in PROCESSING:
            part = registered.sel(band=band, processing=name)
            left = float(part["misregistration"])
            rows.append(
                (
                    f"{band}, {low:g} to {high:g} m",
                    _NAMES[name],
                    f"{float(part['coherence']):.3f}",
                    f"{1e3 * left:.1f}",
                    f"{left / cell:.3f}",
                    f"{100 * float(part['height_std']):.2f}",
                    f"{100 * NORMAL_PER_MAD * float(part['height_mad']):.2f}",
                )
            )
    heads = (
        "ground", "images", "coherence", "misregistration left (mm)", "in resolution cells",
        "height std (cm)", "1.48 MAD (cm)",
    )  # fmt: skip
    return tables.write(heads, rows, "llrrrrr") + "\n"


STAGES = {
    "registered": Stage(
        _registered,
        inputs=("images", "unwrapped", "refined", "dem", "truth"),
        sections=(*waveform.KEYS, "interferogram", "filtering", "height"),
        when=lambda study: study.imaging.surface == "estimated",
    ),
}
