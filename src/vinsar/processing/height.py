"""From unwrapped phase to a digital elevation model: constant, inversion, DEM coding."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing import assessment, classification, masks
from vinsar.radar import aperture, geometry, grid, trajectory, waveform

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

logger = logging.getLogger(__name__)

Trend = Literal["constant", "plane"]
Extent = tuple[float, float, float, float]

# Residual below which a reference point gains no more weight in the fit of a plane, rad.
_LEAST_RESIDUAL = 1e-3


variables.declare(
    "dem",
    {
        "height": Variable(
            GRID,
            "real",
            "m",
            "reconstructed height above the ground plane",
            "known where height_class is valid alone",
            gaps=True,
        ),
        "height_std": Variable(
            GRID,
            "real",
            "m",
            "standard deviation of the height",
            "from the data: noise, what filter and resolution cell take, height reference, what "
            "autofocus leaves",
            bounds=(0, np.inf),
            gaps=True,
        ),
        "height_class": Variable(
            GRID,
            "integer",
            "1",
            "what kind of height it is, from the data alone",
            flag_meanings=" ".join(classification.CLASSES),
        ),
        "image_height": Variable(
            GRID, "real", "m", "height at the image's pixel, before DEM coding"
        ),
        "absolute_phase": Variable(
            GRID,
            "real",
            "radian",
            "absolute interferometric phase at the image's pixel",
            "lower minus upper, flat-earth phase included (Eq. 11)",
        ),
        "phase_offset": Variable(
            GRID, "real", "radian", "phase added to fit the reference heights"
        ),
    },
)


class Rectangle(Section):
    """A rectangle on the ground."""

    x_min_m: float = key("left edge", "not given")
    x_max_m: float = key("right edge", "not given")
    y_min_m: float = key("near edge", "not given")
    y_max_m: float = key("far edge", "not given")


class ControlPoint(Section):
    """A surveyed point."""

    x_m: float = key("position along the rail", "section 2.3")
    y_m: float = key("position ahead", "section 2.3")
    height_m: float = key("surveyed height", "section 2.3")


class Height(Section, name="height"):
    """Inversion of the phase and its unknown constant."""

    reference: Literal["level_ground", "control_points"] = key(
        "what fixes the unknown phase constant", "section 2.3"
    )
    level_ground: Annotated[tuple[Rectangle, ...], Field(strict=False)] = key(
        "ground that the user declares level", "not given"
    )
    level_ground_height_m: float = key("height of the level ground", "not given")
    control_points: Annotated[tuple[ControlPoint, ...], Field(strict=False)] = key(
        "points of known height, one or more", "section 2.3"
    )
    trend: Literal["constant", "plane"] = key(
        "what is fitted to the reference's phase: a constant, or a plane in x and y", "section 2.3"
    )


def level_ground(
    x: Floats, y: Floats, rectangles: Sequence[Extent], height_m: float
) -> tuple[Floats, Floats, Floats]:
    """Return the grid's points on ground that the user declares level.

    Parameters
    ----------
    x, y
        Axes of the grid, m.
    rectangles
        Extents (x_min, x_max, y_min, y_max), m.
    height_m
        Height of the level ground, m.

    Returns
    -------
    tuple of ndarray
        x, y and height of the points, m.

    Raises
    ------
    ValueError
        If no point of the grid is on the declared ground.
    """
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    inside = np.zeros(grid_x.shape, bool)
    for x_min, x_max, y_min, y_max in rectangles:
        inside |= (grid_x >= x_min) & (grid_x <= x_max) & (grid_y >= y_min) & (grid_y <= y_max)
    if not inside.any():
        raise ValueError("no pixel of the grid lies on the ground declared level")
    return grid_x[inside], grid_y[inside], np.full(int(inside.sum()), height_m)


def phase_offset(
    unwrapped: xr.Dataset,
    images: xr.Dataset,
    points: tuple[Floats, Floats, Floats],
    *,
    trend: Trend = "constant",
) -> Floats:
    """Return the phase to add so that reference points come out at their known heights.

    Unwrapping leaves one constant unknown. Each reference point tells it: its absolute phase is
    known (Eq. 1), and so is the pixel where it is imaged. The constant is the median over points,
    the plane a fit by least absolute deviations, so that single bad pixels do not count. Islands of
    the phase have whole cycles of their own besides, which the points on each tell.

    Parameters
    ----------
    unwrapped, images
        Products of these names.
    points
        x, y and height of the reference points, m. Those without a phase do not count.
    trend
        What to fit.

    Returns
    -------
    ndarray, shape (y, x)
        Phase to add, rad; to islands without a point that of the island with most.

    Raises
    ------
    ValueError
        If a reference point is imaged outside the grid, none has a phase, or there are too few for
        the trend.
    """
    from scipy.ndimage import map_coordinates

    x, y = unwrapped["x"].values, unwrapped["y"].values
    lower, upper = trajectory.apertures(images)
    wavelength = float(images["wavelength"])
    point_x, point_y, point_height = points
    image_x, image_y = aperture.image_position(lower, point_x, point_y, point_height)
    row, column = grid.place(image_y, y), grid.place(image_x, x)
    # A pixel's width of tolerance: declared ground may end at the image's edge.
    inside = (row > -1) & (row < y.size) & (column > -1) & (column < x.size)
    if not inside.all():
        first = int(np.argmin(inside))
        raise ValueError(
            f"the reference point at x = {point_x[first]:.2f} m, y = {point_y[first]:.2f} m is "
            "imaged outside the grid"
        )
    absolute = aperture.interferometric_phase(
        lower, upper, point_x, point_y, point_height, wavelength
    )
    flat = aperture.flat_earth_phase(lower, upper, image_x, image_y, wavelength)
    phase = unwrapped["phase"].values
    pixel = tuple(
        np.clip(np.rint(at).astype(int), 0, size - 1)
        for at, size in zip((row, column), phase.shape, strict=True)
    )
    known = np.isfinite(phase)
    counted = known[pixel]
    if not counted.any():
        raise ValueError(
            "none of the reference points lies where there is a phase; declare level ground or "
            "control points that the radar sees"
        )
    found = map_coordinates(masks.fill(phase), [row, column], order=1, mode="nearest")
    missing = (absolute - flat - found)[counted]
    image_x, image_y = image_x[counted], image_y[counted]
    numbers, count = masks.islands(known)
    turns = _turns(missing, numbers[pixel][counted], count)
    missing = missing - turns[numbers[pixel][counted]]
    if trend == "constant":
        return np.median(missing) + turns[numbers]
    if len(missing) < 3:
        raise ValueError(f"a plane needs three or more reference points, not {len(missing)}")
    constant, slope_x, slope_y = geometry.fit_plane(
        image_x, image_y - y[0], missing, least_residual=_LEAST_RESIDUAL
    )
    plane = constant + slope_x * x[None, :] + slope_y * (y[:, None] - y[0])
    return np.asarray(plane + turns[numbers])


def _turns(missing: Floats, island: NDArray[np.integer], count: int) -> Floats:
    """Return the whole cycles that each island needs beside that of most points, rad.

    Parameters
    ----------
    missing
        Phase that the reference points say is missing, rad.
    island
        Number of each point's island, from 1 on.
    count
        How many islands there are.

    Returns
    -------
    ndarray, shape (count + 1,)
        By number of the island; 0 for those without a point.
    """
    points = np.bincount(island, minlength=count + 1)
    level = np.median(missing[island == points.argmax()])
    turns = np.zeros(count + 1)
    for number in np.nonzero(points)[0]:
        away = np.median(missing[island == number]) - level
        turns[number] = 2 * np.pi * np.rint(away / (2 * np.pi))
    return turns


class DemCoding:
    """Moves values of the image's pixels to their true positions, and resamples them to the grid.

    The paper's DEM coding. Values, and the true x, are interpolated linearly in y along each
    column of the image, and then the values in x along each row of the grid, where the true x are
    not those of the columns. Where parts overlap (layover) they come in the order of y.

    Parameters
    ----------
    x, y
        Axes of image and DEM, m.
    true_x, true_y
        Where the pixels belong (y, x), m; NaN where that is not known.
    """

    def __init__(self, x: Floats, y: Floats, *, true_x: Floats, true_y: Floats) -> None:
        self._along_y = _Resampling(true_y, y)
        self._along_x = None
        known = np.isfinite(true_y)
        if not np.array_equal(true_x[known], np.broadcast_to(x, known.shape)[known]):
            place = self._along_y(true_x)
            self._along_x = _Resampling(np.ascontiguousarray(place.T), x)

    def __call__(self, values: Floats) -> Floats:
        """Return values (y, x) on the grid.

        NaN more than a pixel beyond the outermost known place, and where a pixel's is not known.

        Raises
        ------
        ValueError
            If the values are not on the axes.
        """
        coded = self._along_y(values)
        if self._along_x is None:
            return coded
        return np.ascontiguousarray(self._along_x(coded.T).T)


class _Resampling:
    """Linear interpolation of columns at an axis, from places (row, column) of their own."""

    def __init__(self, place: Floats, axis: Floats) -> None:
        from vinsar.kernels import columns

        self._rows = np.empty((2, *place.shape), np.int32)
        self._share = np.empty(place.shape)
        columns.weigh(np.ascontiguousarray(place, float), axis, *self._rows, self._share)

    def __call__(self, values: Floats) -> Floats:
        from vinsar.kernels import columns

        if values.shape != self._share.shape:
            raise ValueError(
                f"values of shape {values.shape} are not on a grid of {self._share.shape}"
            )
        found = np.empty(values.shape)
        columns.resample(np.ascontiguousarray(values, float), *self._rows, self._share, found)
        return found


def invert(unwrapped: xr.Dataset, images: xr.Dataset, offset: Floats) -> Inverted:
    """Invert the unwrapped phase to heights and code the DEM.

    The flat-earth phase (Eq. 11), which focusing on the ground plane has removed, is added back;
    `aperture.locate` gives the height and the true place of each pixel, and `DemCoding` moves it
    there.

    Parameters
    ----------
    unwrapped, images
        Products of these names.
    offset
        Phase to add (y, x), from `phase_offset`, rad.

    Returns
    -------
    Inverted
        Phase, heights and places.
    """
    x, y = unwrapped["x"].values, unwrapped["y"].values
    lower, upper = trajectory.apertures(images)
    wavelength = float(images["wavelength"])
    flat = aperture.flat_earth_phase(lower, upper, x[None, :], y[:, None], wavelength)
    absolute = unwrapped["phase"].values + flat + offset
    true_x, true_y, image_height = aperture.locate(
        lower, upper, x[None, :], y[:, None], absolute, wavelength
    )
    code = DemCoding(x, y, true_x=true_x, true_y=true_y)
    height = code(image_height)
    unknown = int(np.isnan(height).sum())
    if unknown:
        logger.info("%d of %d cells of the DEM have no height", unknown, height.size)
    return Inverted(absolute, image_height, true_y, height, code)


@dataclass(frozen=True)
class Inverted:
    """Heights that are not assessed yet.

    Attributes
    ----------
    phase
        Absolute phase of the image's pixels (y, x), rad.
    image_height
        Their heights (y, x), m.
    true_y
        Where they belong along y (y, x), m.
    height
        Heights on the grid (y, x), m.
    code
        What moves values of the pixels to the grid.
    """

    phase: Floats
    image_height: Floats
    true_y: Floats
    height: Floats
    code: DemCoding


def reference(x: Floats, y: Floats, options: Height) -> tuple[Floats, Floats, Floats]:
    """Return the points of known height that a configuration declares.

    Parameters
    ----------
    x, y
        Axes of the grid, m.
    options
        Section ``height``.

    Returns
    -------
    tuple of ndarray
        x, y and height of the points, m.
    """
    if options.reference == "level_ground":
        extents = [(r.x_min_m, r.x_max_m, r.y_min_m, r.y_max_m) for r in options.level_ground]
        return level_ground(x, y, extents, options.level_ground_height_m)
    rows = np.array([(p.x_m, p.y_m, p.height_m) for p in options.control_points])
    return rows[:, 0], rows[:, 1], rows[:, 2]


def _dem(products: Products, study: Study) -> xr.Dataset:
    options, unwrapped, images = study.height, products["unwrapped"], products["images"]
    x, y = unwrapped["x"].values, unwrapped["y"].values
    if "refined" in products:
        # The second pass in place of the first: the same quantities, from images of its own.
        refined = unwrapped = products["refined"]
        images = trajectory.outer(images).assign(image=refined["image"])
        formed, smooth = refined, refined[["filtered"]].rename(filtered="interferogram")
        removed = refined["surface_phase"].values
    else:
        images = trajectory.outer(images)
        formed, smooth, removed = products["interferogram"], products["filtered"], None
    points = reference(x, y, options)
    offset = phase_offset(unwrapped, images, points, trend=options.trend)
    found = invert(unwrapped, images, offset)
    std, kind = assessment.assess(
        images,
        formed,
        smooth,
        phase=found.phase,
        height=found.height,
        true_y=found.true_y,
        code=found.code,
        reference=_reference(options, x, y),
        filtering=study.filtering.model_dump(),
        frequency=waveform.sampled(study.radar),
        windows=(study.imaging.range_window, study.imaging.aperture_window),
        motion=trajectory.outer(products["autofocus"]),
        removed=removed,
    )
    return variables.dataset(
        "dem",
        {
            "height": found.height,
            "height_std": std,
            "height_class": kind,
            "image_height": found.image_height,
            "absolute_phase": found.phase,
            "phase_offset": offset,
        },
        {"x": x, "y": y},
    )


def _reference(options: Height, x: Floats, y: Floats) -> assessment.Reference:
    """Return the pixels of the height reference."""
    level = options.reference == "level_ground"
    if level:
        height_m = options.level_ground_height_m
        extents = [
            (r.y_min_m, r.y_max_m, r.x_min_m, r.x_max_m, height_m) for r in options.level_ground
        ]
    else:
        extents = [(p.y_m, p.y_m, p.x_m, p.x_m, p.height_m) for p in options.control_points]
    rectangles, heights = [], []
    for near, far, left, right, declared in extents:
        rows, columns = (
            _indices(axis, *ends) for axis, ends in ((y, (near, far)), (x, (left, right)))
        )
        if rows is not None and columns is not None:
            rectangles.append((rows, columns))
            heights.append(declared)
    return assessment.Reference(
        tuple(rectangles), tuple(heights), plane=options.trend == "plane", level=level
    )


def _indices(axis: Floats, first: float, last: float) -> slice | None:
    """Return the indices of an axis from one value to another; the nearest if there is none."""
    if first == last:
        nearest = int(np.abs(axis - first).argmin())
        return slice(nearest, nearest + 1)
    inside = np.nonzero((axis >= first) & (axis <= last))[0]
    return slice(int(inside[0]), int(inside[-1]) + 1) if inside.size else None


def _reference_exists(height: Height) -> Iterator[Fault]:
    for number, rectangle in enumerate(height.level_ground):
        yield from grid.check_extent(f"height.level_ground[{number}]", rectangle)
    if height.reference == "level_ground" and not height.level_ground:
        yield Fault("height.level_ground", (), "must hold one rectangle or more")
    if height.reference == "control_points":
        least = 3 if height.trend == "plane" else 1
        if len(height.control_points) < least:
            yield Fault(
                "height.control_points",
                f"{len(height.control_points)} points",
                f"must hold {least} or more for height.trend '{height.trend}'",
            )


STAGES = {
    "dem": Stage(
        _dem,
        inputs=("unwrapped", "images", "interferogram", "filtered", "autofocus"),
        sections=(
            *waveform.KEYS,
            "imaging.range_window",
            "imaging.aperture_window",
            "filtering",
            "height",
        ),
        optional=("refined",),
    ),
}


CHECKS = (_reference_exists,)
