"""What each height of a DEM is worth: its standard deviation and its class, from the data alone."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.processing import classification, masks, uncertainty
from vinsar.processing.filtering import response_to
from vinsar.radar import aperture, grid, waveform
from vinsar.radar.instrument import Ground, Instrument

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

logger = logging.getLogger(__name__)

# Samples of a weighting, enough for its noise bandwidth.
_WEIGHTS = 401

# Rounding of a noise bandwidth.
_SLACK = 1e-9

# Antennas closer than this stand in one place.
_SAME_M = 1e-6


# Share of reference ground that is to be valid, as its fit is a median, and how many standard
# deviations it may be off.
_LEAST_VALID, _MOST_AWAY = 0.5, 3.0


@dataclass(frozen=True)
class Reference:
    """What the unknown phase constant was taken from.

    Attributes
    ----------
    rectangles
        Rows and columns of the pixels of each piece of it: of level ground, or of single points.
    heights
        What they are declared to be, m.
    plane
        Whether a plane was fitted, not a constant.
    level
        Whether it is level ground, over which the phase was averaged before any filter would
        matter; single points have the noise of the filtered phase.
    """

    rectangles: tuple[tuple[slice, slice], ...]
    heights: tuple[float, ...]
    plane: bool
    level: bool


def assess(
    images: xr.Dataset,
    interferogram: xr.Dataset,
    filtered: xr.Dataset,
    *,
    phase: Floats,
    height: Floats,
    true_y: Floats,
    code: Callable[[Floats], Floats],
    reference: Reference,
    filtering: Mapping[str, Any],
    frequency: Floats,
    windows: tuple[waveform.WindowName, waveform.WindowName],
    motion: xr.Dataset,
    removed: Floats | None = None,
) -> tuple[Floats, NDArray[np.int8]]:
    """Return the standard deviation and the class of the heights of a DEM.

    What speaks against the height reference is logged as a warning (`doubts`).

    Parameters
    ----------
    images, interferogram, filtered
        Products of these names.
    phase
        Absolute phase at the image's pixels (y, x), rad; NaN where there is none.
    height
        Heights on the grid (y, x), m; NaN where there is none.
    true_y
        Where the pixels belong along y (y, x), m.
    code
        From values at the image's pixels to values on the grid (DEM coding).
    reference
        What the phase's constant was taken from.
    filtering
        Section ``filtering``: the filter and its options.
    frequency
        Frequencies, Hz.
    windows
        Weightings of the frequencies and of the aperture.
    motion
        Product ``autofocus`` of the two channels: what is left of the positions' errors.
    removed
        Phase without that of the ground plane (y, x) that a second pass took away before the
        filter, with the band that the channels do not share, rad. Filter and noise are those of
        what is left; None for images on the ground plane.

    Returns
    -------
    std
        Standard deviation of each height (y, x), m; NaN where there is no height.
    kind
        Class of each height (y, x), an index into `classification.CLASSES`.
    """
    x, y = images["x"].values, images["y"].values
    instrument = Instrument.of(images, frequency)
    across, ahead = x[None, :], y[:, None]
    antennas = instrument.lower, instrument.upper
    flat = aperture.flat_earth_phase(*antennas, across, ahead, instrument.wavelength)
    widening = np.array([_noise_width(name) for name in windows[::-1]])
    ground = instrument.over(across, ahead)
    resolution = ground.resolution * widening[:, None, None]
    cells = uncertainty.Cells(resolution, (grid.step(x), grid.step(y)))
    pictures = np.nan_to_num(images["image"].values)
    product, smooth = (
        np.nan_to_num(part["interferogram"].values) for part in (interferogram, filtered)
    )
    absolute = np.where(np.isfinite(phase), phase, flat)
    bandwidth = float(frequency[-1] - frequency[0]) / waveform.carrier(frequency)
    seen, left, passed, told, level = pictures, product, smooth, absolute, flat
    if removed is not None:
        turn = np.exp(1j * removed).astype(np.complex64)
        seen = np.stack([pictures[0], pictures[1] * turn])
        left, passed = product / turn, smooth / turn
        told, level = absolute - flat - removed, np.zeros(product.shape)
    filter_ = response_to(left, **filtering)
    noise = uncertainty.estimate(seen, told, level, cells=cells, relative_bandwidth=bandwidth)
    by_noise = uncertainty.noise_variance(noise, filter_, left, passed, cells=cells)
    taken = uncertainty.smoothing(filter_, left, cells=cells)
    terrain = uncertainty.mean(taken**2, cells.window(uncertainty.NOISE_LOOKS))
    if not (widening > 1 + _SLACK).any():
        # Both tell of the same, the one of relief, the other of rougher ground. Under a weighting
        # pixels share speckle as far as they share ground.
        rough = uncertainty.roughness(filter_, left, cells=cells)
        terrain = np.maximum(terrain, rough)
    own = np.minimum(by_noise + terrain, uncertainty.UNIFORM)
    shared = _reference_variance(reference, noise, product, own, x, y, cells)
    shared = shared + motion_variance(motion, ground, reference)
    per_difference = ground.height_per_difference
    ambiguity = np.abs(instrument.wavelength * per_difference)
    per_phase = ambiguity / (2 * np.pi)
    drift = ground.drift
    # Interpolation between two pixels along y averages their noise.
    share = np.where(np.isfinite(true_y), (true_y - ahead) / cells.spacing[1], 0.0) % 1
    alike = filter_.neighbours(noise.decorrelation, cells.spacing)
    kept = 1 - 2 * share * (1 - share) * (1 - alike)
    moved = _at_one_place(drift, height, cells)
    std = np.sqrt(code((kept * own + shared) * per_phase**2)) * moved
    cycles = classification.split_band(
        pictures, absolute - flat, antennas,
        x=x, y=y, wavelength_m=instrument.wavelength, cells=cells,
        # The phase is -2 pi / lambda times the difference.
        relative_bandwidth=bandwidth,
        rising=bool(per_difference[y.size // 2, x.size // 2] < 0),
    )  # fmt: skip
    slack = 2 * np.sqrt(own) * per_phase * np.abs(drift[1])
    held = np.zeros(product.shape, bool)
    for where in reference.rectangles:
        held[where] = True
    numbers, _ = masks.islands(np.isfinite(phase))
    kind = classification.classify(
        height,
        std,
        dark=classification.coded(code, classification.shadow(product, cells=cells)),
        folded=classification.coded(code, classification.layover(true_y, slack)),
        variance=code(by_noise),
        cycles=[classification.Cycles(code(part.missing), code(part.std)) for part in cycles],
        ambiguity=ambiguity,
        reference=held,
        loose=classification.coded(code, ~np.isin(numbers, numbers[held])),
        antennas=_before(instrument, float(y[0])),
        x=x,
        y=y,
        window_px=cells.window(classification.SPLIT_LOOKS[0]),
    )
    alone = np.sqrt(code(kept * own * per_phase**2)) * moved
    for doubt in doubts(reference, height, alone, kind, x=x, y=y):
        logger.warning("%s", doubt)
    return std, kind


def doubts(
    reference: Reference,
    height: Floats,
    std: Floats,
    kind: NDArray[np.int8],
    *,
    x: Floats,
    y: Floats,
) -> Iterator[str]:
    """Yield what speaks against the height reference: it is not seen, or not as high as declared.

    Parameters
    ----------
    reference
        What the phase's constant was taken from.
    height
        Heights (y, x), m; NaN where there is none.
    std
        Their standard deviation without the part that all heights share (y, x), m.
    kind
        Their classes (y, x).
    x, y
        Axes, m.
    """
    for where, declared in zip(reference.rectangles, reference.heights, strict=True):
        left, right = x[where[1]][[0, -1]]
        near, far = y[where[0]][[0, -1]]
        place = (
            f"level ground at x = {left:.2f} to {right:.2f} m, y = {near:.2f} to {far:.2f} m"
            if reference.level
            else f"control point at x = {left:.2f} m, y = {near:.2f} m"
        )
        classes = kind[where]
        shares = {
            label.replace("_", " "): float((classes == number).mean())
            for number, label in enumerate(classification.CLASSES)
        }
        if shares.pop("valid") < _LEAST_VALID:
            told = ", ".join(
                f"{100 * share:.0f} % {label}" for label, share in shares.items() if share
            )
            yield (
                f"the {place} is to a large part not known ({told}), and all heights hang on it: "
                "declare ground that the radar sees"
            )
        known = np.isfinite(height[where]) & (std[where] > 0)
        if not known.any():
            continue
        away = (height[where] - declared)[known]
        error = float(np.sqrt(np.mean(std[where][known] ** 2)))
        rms = float(np.sqrt(np.mean(away**2)))
        if rms > _MOST_AWAY * error:
            yield (
                f"the {place} comes out {100 * rms:.1f} cm (rms) off its declared "
                f"{declared:g} m, {rms / error:.1f} times its standard deviation of "
                f"{100 * error:.1f} cm, and {100 * away.mean():+.1f} cm on average: it is not "
                "level, not so high, or seen wrongly, and all heights hang on it"
            )


def _noise_width(name: waveform.WindowName) -> float:
    """Return by how much a weighting widens the correlation of noise, in resolution cells."""
    power = waveform.window(name, _WEIGHTS) ** 2
    return float(_WEIGHTS * (power**2).sum() / power.sum() ** 2)


def _at_one_place(drift: Floats, height: Floats, cells: uncertainty.Cells) -> Floats:
    """Return the error at a place over that of a pixel, which moves with its height (y, x)."""
    known = np.isfinite(height)
    level = float(np.median(height[known])) if known.any() else 0.0
    smooth = uncertainty.mean(np.where(known, height, level), cells.window(uncertainty.PHASE_LOOKS))
    slope = uncertainty.slopes(smooth, cells.spacing)
    return np.abs(1 - (slope * drift).sum(axis=0))


def _reference_variance(
    reference: Reference,
    noise: uncertainty.Noise,
    product: NDArray[np.complexfloating],
    own: Floats,
    x: Floats,
    y: Floats,
    cells: uncertainty.Cells,
) -> Floats:
    """Return the variance of the phase added to all pixels (y, x), rad^2."""
    pieces = [part for where in reference.rectangles for part in _pieces(where, reference)]
    # Level ground off the ground plane has a slow phase of its own, which a rectangle hardly sees.
    level = np.zeros(product.shape)
    found = np.array(
        [
            uncertainty.reference_variance(noise, product, level, part, cells=cells)
            if reference.level
            else own[part].mean()
            for part in pieces
        ]
    )
    if not reference.plane:
        return np.full(product.shape, found.sum() / len(found) ** 2)
    centers = np.array(
        [[1.0, x[columns].mean() - x[0], y[rows].mean() - y[0]] for rows, columns in pieces]
    )
    inverse = np.linalg.pinv(centers)
    covariance = (inverse * found) @ inverse.T
    places = np.stack(np.broadcast_arrays(1.0, x[None, :] - x[0], y[:, None] - y[0]), axis=-1)
    return np.asarray(np.einsum("yxi,ij,yxj->yx", places, covariance, places))


def motion_variance(motion: xr.Dataset, ground: Ground, reference: Reference) -> Floats | float:
    """Return the variance of the phase by what autofocus leaves (y, x), rad^2.

    The image's steps measure how positions depart from their mean. A constant difference between
    the channels, which is one of the baseline, they cannot tell from topography: it stays as it is
    recorded. Errors independent from position to position leave in it their own variance over the
    number of positions, and the height reference takes what of it is common to all pixels.
    """
    found, std = (motion[name].values for name in ("displacement", "displacement_std"))
    if not np.isfinite(std).all():
        return uncertainty.UNIFORM
    square = ((found[0] - found[1]) ** 2 + (std**2).sum(axis=0)).mean(axis=0)
    if not square.any():
        return 0.0
    # The path grows with a target's displacement as it falls with the antennas'.
    path = ground.gradients[0]
    pieces = [path[:, rows, columns].mean(axis=(1, 2)) for rows, columns in reference.rectangles]
    if pieces:
        path = path - np.mean(pieces, axis=0)[:, None, None]
    wave = 2 * np.pi / ground.instrument.wavelength
    return np.asarray(wave**2 * np.einsum("iyx,i->yx", path**2, square) / found.shape[1])


def _pieces(where: tuple[slice, slice], reference: Reference) -> list[tuple[slice, slice]]:
    """Return a rectangle, in quarters where a plane is fitted: it has an inclination of its own."""
    if not (reference.plane and reference.level):
        return [where]
    halves = []
    for axis in where:
        middle = max(axis.start + 1, (axis.start + axis.stop) // 2)
        halves.append([slice(axis.start, middle), slice(min(middle, axis.stop - 1), axis.stop)])
    return [(rows, columns) for rows in halves[0] for columns in halves[1]]


def _before(instrument: Instrument, near: float) -> list[Floats]:
    """Return the places (3,) of the antennas that stand before the image, m."""
    ends = [
        end
        for part in (instrument.lower, instrument.upper)
        for end in (part.transmitter, part.receiver)
        if end[1] < near
    ]
    places: list[Floats] = []
    for end in ends:
        if all(np.abs(end - place).max() > _SAME_M for place in places):
            places.append(end)
    return places
