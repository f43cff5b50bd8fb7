"""Obstacles and holes: alarms on the reconstructed heights, and on an image alone beside it.

Heights tell what rises above the ground or falls below it, by their standard deviation and class.
Where they are not valid, too noisy to tell, or share a cell with what is an obstacle or lost, the
ground is unknown, not free. The 2-D detector is what a radar without interferometry has: what is
brighter than its surroundings.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing import masks
from vinsar.processing.classification import SHADOW, UNCERTAIN_CYCLE, VALID, grow
from vinsar.radar import geometry

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

logger = logging.getLogger(__name__)

FREE, OBSTACLE, HOLE, UNKNOWN = 0, 1, 2, 3
"""Classes of a cell of the map."""

# Running medians are taken at so many nodes along the side of their window.
_NODES = 12

# Height that is representative of an area: what a tenth of its cells exceed.
_PERCENTILE = 90

# So far, in multilook windows, ground beside an obstacle, a hole in the dark or a lost cycle is
# unknown: foot and wall share a cell, sidelobes fill the rim of a hole, and the windows that tell a
# cycle are wider than what has lost it.
_BESIDE_OBSTACLE, _BESIDE_HOLE, _BESIDE_CYCLE = 0.5, 1.0, 1.5

# Residuals below this do not gain weight in the fit of the ground, m.
_LEAST_RESIDUAL_M = 1e-3


_DETECTED = ("detection",)

variables.declare(
    "detections",
    {
        "ground": Variable(GRID, "real", "m", "height of the ground beneath obstacles"),
        "height_above_ground": Variable(
            GRID, "real", "m", "reconstructed height above the ground beneath", "negative in holes"
        ),
        "significant_height": Variable(
            GRID,
            "real",
            "m",
            "height above the ground beneath where it exceeds its noise",
            "0 where it does not, not a number where the height is not valid",
            gaps=True,
        ),
        "map_class": Variable(
            GRID,
            "integer",
            "1",
            "what the ground is taken for",
            "unknown is what is not valid, too noisy to tell, or beside an obstacle or hole",
            flag_meanings="free obstacle hole unknown",
        ),
        "contrast": Variable(
            GRID,
            "real",
            "1",
            "multilooked power of the images over that of their surroundings",
            "at the image's pixel, before DEM coding",
            bounds=(0, np.inf),
        ),
        "bright": Variable(
            GRID,
            "flag",
            "1",
            "alarm of the 2-D detector, which sees the images' power alone",
            flag_meanings="quiet alarm",
        ),
        "detected_x": Variable(_DETECTED, "real", "m", "centre of the detected area along x"),
        "detected_y": Variable(_DETECTED, "real", "m", "centre of the detected area along y"),
        "extent_x": Variable(_DETECTED, "real", "m", "extent of the detected area along x"),
        "extent_y": Variable(_DETECTED, "real", "m", "extent of the detected area along y"),
        "detected_area": Variable(
            _DETECTED,
            "real",
            "m2",
            "detected area",
            bounds=(0, np.inf),
        ),
        "detected_height": Variable(
            _DETECTED,
            "real",
            "m",
            "height of the detected area",
            "what a tenth of it exceeds; negative for a hole",
        ),
    },
    coordinates={
        "detection": Variable(("detection",), "integer", "1", "number of the detected area")
    },
)


class Detection(Section, name="detection"):
    """Detection of obstacles and holes on the heights, and on an image alone."""

    threshold_m: float = key("height or depth from the ground that is an alarm", "ours", gt=0)
    noise_factor: float = key(
        "an alarm exceeds as many standard deviations of the height; where they exceed the "
        "threshold, the ground is unknown",
        "ours",
        gt=0,
    )
    minimum_area_m2: float = key("connected area that is an alarm", "ours", gt=0)
    ground_window_m: float | None = key(
        "side of the running median that follows rolling ground; null for a plane alone",
        "ours",
        gt=0,
    )
    multilook_window_m: float = key(
        "side of the window over which the image's power is averaged", "ours", gt=0
    )
    background_window_m: float = key(
        "side of the window whose median power is that of the surroundings", "ours", gt=0
    )
    amplitude_threshold_db: float = key(
        "power relative to the surroundings that is an alarm of the image alone", "ours", gt=0
    )


def regions(alarm: Flags, least_cells: float) -> tuple[NDArray[np.integer], int]:
    """Return the connected areas of a mask that are large enough.

    Parameters
    ----------
    alarm
        Mask (y, x); cells that touch at a corner are connected.
    least_cells
        Number of cells that an area must have.

    Returns
    -------
    areas
        Number of the area from 1, or 0 (y, x).
    count
        How many areas there are.
    """
    from scipy.ndimage import label

    areas, _ = label(alarm, np.ones((3, 3)))
    size = np.bincount(areas.ravel())
    kept = size > least_cells - 1e-6
    kept[0] = False
    number = np.where(kept, np.cumsum(kept), 0)
    return number[areas], int(kept.sum())


def _window(length_m: float, x: Floats, y: Floats) -> tuple[int, int]:
    """Return odd numbers of rows and columns of about this length."""
    across, ahead = spacings(x, y)
    rows, columns = (
        2 * max(0, round(length_m / spacing / 2 - 0.5)) + 1 for spacing in (ahead, across)
    )
    return rows, columns


def spacings(x: Floats, y: Floats) -> tuple[float, float]:
    """Return the spacing of pixels in x and y, m; of square ones the same number twice."""
    across, ahead = float(x[1] - x[0]), float(y[1] - y[0])
    return across, across if abs(ahead - across) < 1e-9 else ahead


def pixel_area(x: Floats, y: Floats) -> float:
    """Return the area of a pixel, m^2."""
    across, ahead = spacings(x, y)
    return across * ahead


def running_median(values: Floats, window_px: tuple[int, int]) -> Floats:
    """Return the median around each cell, without the cells that are not a number.

    It is taken at a few nodes a window and interpolated between them.

    Parameters
    ----------
    values
        Values (y, x).
    window_px
        Rows and columns of the window; at the edges it covers what there is.

    Returns
    -------
    ndarray, shape (y, x)
        Medians; where a window has no value, the median of all.
    """
    from scipy.ndimage import map_coordinates

    steps = [max(1, side // _NODES) for side in window_px]
    up, across = (side // 2 for side in window_px)
    rows, columns = (
        np.arange(0, size - 1 + step, step) for size, step in zip(values.shape, steps, strict=True)
    )
    medians = np.empty((rows.size, columns.size))
    everywhere = values[np.isfinite(values)]
    default = np.median(everywhere) if everywhere.size else np.nan
    for i, row in enumerate(rows):
        strip = values[max(0, row - up) : row + up + 1]
        for j, column in enumerate(columns):
            part = strip[:, max(0, column - across) : column + across + 1]
            known = part[np.isfinite(part)]
            medians[i, j] = np.median(known) if known.size else default
    places = np.indices(values.shape) / np.reshape(steps, (2, 1, 1))
    return np.asarray(map_coordinates(medians, places, order=1, mode="nearest"))


def ground(heights: Floats, x: Floats, y: Floats, window_m: float | None) -> Floats:
    """Return the ground beneath obstacles, from the heights themselves.

    A plane by least absolute deviations, which objects here and there do not bend, and on request
    the running median of what is left, for ground that rolls.

    Parameters
    ----------
    heights
        Heights (y, x), m; NaN where unknown.
    x, y
        Axes, m.
    window_m
        Side of the running median's window, m; None for the plane alone.

    Returns
    -------
    ndarray, shape (y, x)
        Heights of the ground, m; not a number, with a warning in the log, if fewer than three
        heights are known.
    """
    known = np.isfinite(heights)
    if known.sum() < 3:
        logger.warning(
            "fewer than three heights are valid: there is no ground to find obstacles on"
        )
        return np.full(heights.shape, np.nan)
    row, column = np.nonzero(known)
    constant, slope_x, slope_y = geometry.fit_plane(
        x[column], y[row] - y[0], heights[known], least_residual=_LEAST_RESIDUAL_M
    )
    plane = constant + slope_x * x[None, :] + slope_y * (y[:, None] - y[0])
    if window_m is None:
        return np.asarray(plane)
    return np.asarray(plane + running_median(heights - plane, _window(window_m, x, y)))


def _ratio(decibel: float) -> float:
    return float(10 ** (decibel / 10))


def detect(dem: xr.Dataset, images: xr.Dataset, *, options: Detection) -> xr.Dataset:
    """Find obstacles and holes.

    Parameters
    ----------
    dem, images
        Products of these names.
    options
        Section ``detection`` of the configuration.

    Returns
    -------
    xarray.Dataset
        Product ``detections``.
    """
    from scipy.ndimage import uniform_filter

    x, y = dem["x"].values, dem["y"].values
    window = _window(options.multilook_window_m, x, y)
    power = (np.abs(images["image"].values) ** 2).mean(axis=0)
    intensity = masks.average(lambda part: uniform_filter(part, window, mode="nearest"), power)
    surroundings = running_median(intensity, _window(options.background_window_m, x, y))
    contrast = intensity / np.maximum(surroundings, np.finfo(float).tiny)
    least = options.minimum_area_m2 / pixel_area(x, y)
    found, valid = dem["height"].values, dem["height_class"].values == VALID
    noise = options.noise_factor * dem["height_std"].values
    surface = ground(np.where(valid, found, np.nan), x, y, options.ground_window_m)
    residual = found - surface
    certain = valid & (np.abs(residual) > noise)
    # What is not certain is no alarm at any threshold.
    significant = np.where(valid, np.where(certain, residual, 0.0), np.nan)
    above, raised = regions(significant > options.threshold_m, least)
    below, sunk = regions(significant < -options.threshold_m, least)
    kind = np.full(found.shape, FREE, np.int8)
    kind[~(valid & (noise <= options.threshold_m) & np.isfinite(residual))] = UNKNOWN
    side = options.multilook_window_m
    for mask, width in (
        (above > 0, _BESIDE_OBSTACLE),
        (_holes(dem["height_class"].values, above > 0, window), _BESIDE_HOLE),
        (dem["height_class"].values == UNCERTAIN_CYCLE, _BESIDE_CYCLE),
    ):
        kind[grow(mask, _window(width * side, x, y))] = UNKNOWN
    kind[above > 0], kind[below > 0] = OBSTACLE, HOLE
    bright, count = regions(contrast > _ratio(options.amplitude_threshold_db), least)
    logger.info("%d obstacles, %d holes; %d alarms of the image alone", raised, sunk, count)
    areas = [above == number + 1 for number in range(raised)]
    areas += [below == number + 1 for number in range(sunk)]
    table = np.array([_describe(area, residual, x, y) for area in areas]).reshape(-1, 6)
    names = ("detected_x", "detected_y", "extent_x", "extent_y", "detected_area", "detected_height")
    return variables.dataset(
        "detections",
        {
            "ground": surface,
            "height_above_ground": residual,
            "significant_height": significant,
            "map_class": kind,
            "contrast": contrast,
            "bright": bright > 0,
        }
        | dict(zip(names, table.T, strict=True)),
        {"x": x, "y": y},
    )


def _holes(classes: NDArray[np.int8], obstacles: Flags, window_px: tuple[int, int]) -> Flags:
    """Return shadows that nothing casts: no obstacle and no lost cycle stands before them.

    Each column by itself, as shadows of several things run together.
    """
    from scipy.ndimage import label

    dark = classes == SHADOW
    numbers, _ = label(dark, [[0, 1, 0]] * 3)
    rows, columns = window_px
    # A window's rows behind each, not around it.
    behind = np.zeros_like(dark)
    standing = grow(obstacles | (classes == UNCERTAIN_CYCLE), (1, columns))
    for row in range(min(rows, len(dark))):
        behind[row:] |= standing[: len(dark) - row]
    alone = dark & ~np.isin(numbers, numbers[behind & dark])
    # Less than a window of it is the edge of what something casts.
    return grow(~grow(~alone, window_px), window_px)


def _describe(area: Flags, residual: Floats, x: Floats, y: Floats) -> tuple[float, ...]:
    """Return centre, extent, area and height of an area."""
    row, column = np.nonzero(area)
    values = residual[area]
    sign = 1.0 if values[0] > 0 else -1.0
    across, ahead = spacings(x, y)
    return (
        float(x[column].mean()),
        float(y[row].mean()),
        float(np.ptp(x[column])) + across,
        float(np.ptp(y[row])) + ahead,
        row.size * pixel_area(x, y),
        sign * float(np.percentile(sign * values, _PERCENTILE)),
    )


def _detections(products: Products, study: Study) -> xr.Dataset:
    return detect(products["dem"], products["images"], options=study.detection)


STAGES = {
    "detections": Stage(_detections, inputs=("dem", "images"), sections=("detection",)),
}
