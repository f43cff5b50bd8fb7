"""The true scene: terrain on a raster, its reflectivity, and the facets that scatter.

Only the simulated echo and the metrics may know it; the processing never does.
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from vinsar.foundations import randomness, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault
from vinsar.foundations.randomness import Draw
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.radar import geometry, grid

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

# Tangent of 60 degrees: from here on a face is a wall, its surface more than twice its ground.
_WALL_SLOPE = 3**0.5


TERRAIN = {
    "height": Variable(GRID, "real", "m", "true height above the ground plane"),
    "reflectivity": Variable(GRID, "real", "1", "reflectivity of the scene"),
}

variables.declare(
    "roughness",
    {
        "height": Variable(GRID, "real", "m", "random roughness of the ground"),
    },
)
variables.declare("elevation", TERRAIN)
variables.declare("terrain", TERRAIN)
variables.declare(
    "facets",
    {
        "facet_position": Variable(("facet", "axis"), "real", "m", "position of the facet"),
        "reflectivity": Variable(("facet",), "real", "1", "reflectivity of the facet"),
    },
    coordinates={"facet": Variable(("facet",), "integer", "1", "number of the facet")},
)


def peaks(u: ArrayLike, v: ArrayLike) -> Floats:
    """Return the `peaks` function that numerical software ships: three tops, two hollows.

    Parameters
    ----------
    u, v
        Coordinates, each usually from -3 to 3.

    Returns
    -------
    ndarray
        Values from about -6.55 to 8.11.
    """
    u, v = np.asarray(u, dtype=float), np.asarray(v, dtype=float)
    return np.asarray(
        3 * (1 - u) ** 2 * np.exp(-(u**2) - (v + 1) ** 2)
        - 10 * (u / 5 - u**3 - v**5) * np.exp(-(u**2) - v**2)
        - np.exp(-((u + 1) ** 2) - v**2) / 3
    )


def _highest_peak() -> float:
    from scipy.optimize import minimize

    def depth(point: Floats) -> float:
        return -float(peaks(point[0], point[1]))

    return -float(minimize(depth, x0=(0.0, 1.6), tol=1e-12).fun)


def _peaks(x: Floats, y: Floats, *, peak_height_m: float, **_: Any) -> Floats:
    """Span the extent with the domain -3..3; scale it to the height of its highest top."""
    u = 6 * (x - x[0]) / (x[-1] - x[0]) - 3
    v = 6 * (y - y[0]) / (y[-1] - y[0]) - 3
    return peak_height_m / _highest_peak() * peaks(u[None, :], v[:, None])


def _flat(x: Floats, y: Floats, **_: Any) -> Floats:
    return np.zeros((y.size, x.size))


TERRAINS: dict[str, Callable[..., Floats]] = {"peaks": _peaks, "flat": _flat}
"""The shapes of terrain by name: from x and y of the raster, m, and the keys of `Scene`, by
keyword, to heights (y, x), m."""


def terrain(
    name: str,
    *,
    x_min_m: float,
    x_max_m: float,
    y_min_m: float,
    y_max_m: float,
    spacing_m: float,
    reflectivity_offset: float,
    **shape: Any,
) -> xr.Dataset:
    """Return terrain and reflectivity on a raster; between its nodes the terrain is bilinear.

    Parameters
    ----------
    name
        A key of `TERRAINS`. ``peaks`` is scaled so that its highest top has the peak height (its
        deepest hollow is then -0.81 times that); ``flat`` is zero.
    x_min_m, x_max_m, y_min_m, y_max_m
        Extent, m.
    spacing_m
        Spacing of the raster, m.
    reflectivity_offset
        Reflectivity is the height in metres plus this.
    shape
        The keys of `Scene` that the shape reads, such as ``peak_height_m``.

    Returns
    -------
    xarray.Dataset
        Product ``terrain``: ``height`` and ``reflectivity`` (y, x).

    Raises
    ------
    ValueError
        If there is no such terrain, the spacing does not divide the extent, or a reflectivity is
        negative.
    """
    if name not in TERRAINS:
        raise ValueError(f"no terrain '{name}'; there are {', '.join(TERRAINS)}")
    x = geometry.grid_axis(x_min_m, x_max_m, spacing_m)
    y = geometry.grid_axis(y_min_m, y_max_m, spacing_m)
    height = TERRAINS[name](x, y, **shape)
    reflectivity = height + reflectivity_offset
    if reflectivity.min() < 0:
        raise ValueError(
            f"the reflectivity offset {reflectivity_offset} leaves a negative reflectivity of "
            f"{reflectivity.min():.3f} at the deepest point; take {-height.min():.3f} or more"
        )
    return variables.dataset(
        "terrain", {"height": height, "reflectivity": reflectivity}, {"x": x, "y": y}
    )


def from_heights(
    x: Floats,
    y: Floats,
    height: Floats,
    reflectivity: Floats | None = None,
    *,
    reflectivity_offset: float,
) -> xr.Dataset:
    """Return surveyed heights as a terrain.

    Parameters
    ----------
    x, y
        Axes of the raster, m.
    height
        Heights above the ground plane (y, x), m.
    reflectivity
        Reflectivity (y, x), if it is known.
    reflectivity_offset
        Otherwise it is the height in metres plus this, as in `terrain`.

    Returns
    -------
    xarray.Dataset
        Product ``elevation``.

    Raises
    ------
    ValueError
        If a reflectivity would be negative, or all of it is zero.
    """
    if reflectivity is None:
        reflectivity = height + reflectivity_offset
        if reflectivity.min() < 0:
            raise ValueError(
                f"its heights fall to {height.min():.3f} m above the ground plane, so that the "
                f"reflectivity falls to {reflectivity.min():.3f}, being the height plus "
                f"scene.reflectivity_offset; take an offset of {-height.min():.3f} or more, give "
                "the file a 'reflectivity' of its own, or correct scene.ground_height_m"
            )
    if not reflectivity.max() > 0:
        raise ValueError(
            "its reflectivity is 0 all over the scene, so that nothing returns an echo; give the "
            "file another, or take scene.file_reflectivity 'constant'"
        )
    return variables.dataset(
        "elevation", {"height": height, "reflectivity": reflectivity}, {"x": x, "y": y}
    )


def roughness(
    *,
    x_min_m: float,
    x_max_m: float,
    y_min_m: float,
    y_max_m: float,
    spacing_m: float,
    std_m: float,
    correlation_m: float,
    rng: np.random.Generator,
) -> xr.Dataset:
    """Return a random field with a Gaussian autocorrelation.

    White noise under a Gaussian of the standard deviation ``s`` is correlated as
    ``exp(-d^2 / 4 s^2)``: ``s`` is half the correlation length. The field is periodic.

    Parameters
    ----------
    x_min_m, x_max_m, y_min_m, y_max_m
        Extent, m.
    spacing_m
        Spacing of the raster, m.
    std_m
        Standard deviation of the field, not of its sample on this raster, m.
    correlation_m
        Distance at which the correlation has fallen to 1/e, m.
    rng
        Source of randomness.

    Returns
    -------
    xarray.Dataset
        Product ``roughness``: ``height`` (y, x), of the four corners alone if it is 0 everywhere.
    """
    from scipy.ndimage import gaussian_filter

    if std_m == 0:
        corners = {"x": np.array([x_min_m, x_max_m]), "y": np.array([y_min_m, y_max_m])}
        return variables.dataset("roughness", {"height": np.zeros((2, 2))}, corners)
    x = geometry.grid_axis(x_min_m, x_max_m, spacing_m)
    y = geometry.grid_axis(y_min_m, y_max_m, spacing_m)
    sigma = correlation_m / 2 / spacing_m
    impulse = np.zeros((y.size, x.size))
    impulse[y.size // 2, x.size // 2] = 1
    gain = np.sqrt((gaussian_filter(impulse, sigma, mode="wrap") ** 2).sum())
    white = rng.normal(size=impulse.shape)
    height = std_m / gain * gaussian_filter(white, sigma, mode="wrap")
    return variables.dataset("roughness", {"height": height}, {"x": x, "y": y})


def _inside(part: Any, x: Floats, y: Floats) -> Flags:
    """Return which points lie on a disc or on a turned rectangle, its edge included."""
    slack = 1e-9
    x, y = x - part.x_m, y - part.y_m
    if hasattr(part, "diameter_m"):
        return np.asarray(np.hypot(x, y) <= part.diameter_m / 2 + slack)
    turn = np.deg2rad(part.rotation_deg)
    across = np.abs(np.cos(turn) * x + np.sin(turn) * y)
    along = np.abs(np.cos(turn) * y - np.sin(turn) * x)
    return np.asarray((across <= part.size_x_m / 2 + slack) & (along <= part.size_y_m / 2 + slack))


def relief(part: SceneObject, x: Floats, y: Floats) -> Floats:
    """Return how far an object rises above the ground, or falls below it.

    Parameters
    ----------
    part
        The object.
    x, y
        Points, m, of shapes that broadcast.

    Returns
    -------
    ndarray
        Heights, m: positive for a box, stump or mound, negative for a ditch or pit, 0 beside it.
    """
    inside = _inside(part, x, y)
    if part.shape == "mound":
        edge, top = part.diameter_m / 2, part.height_m
        radius = (edge**2 + top**2) / (2 * top)
        away = np.hypot(x - part.x_m, y - part.y_m)
        cap = np.sqrt(np.maximum(radius**2 - away**2, 0)) - (radius - top)
        return np.where(inside, np.maximum(cap, 0), 0.0)
    if part.shape == "ditch" or part.shape == "pit":
        return np.where(inside, -part.depth_m, 0.0)
    return np.where(inside, part.height_m, 0.0)


def furnish(
    terrain: xr.Dataset,
    roughness: xr.Dataset,
    *,
    objects: Sequence[SceneObject],
    patches: Sequence[Patch],
) -> xr.Dataset:
    """Put roughness, patches and objects on a terrain.

    Parameters
    ----------
    terrain, roughness
        Products of these names.
    objects
        Obstacles and holes; where they overlap, their heights add up.
    patches
        Ground of other reflectivity; a later one covers an earlier one, objects cover them all.

    Returns
    -------
    xarray.Dataset
        Product ``terrain``. Upright walls are one cell of the raster thick.
    """
    x, y = terrain["x"].values, terrain["y"].values
    height, reflectivity = terrain["height"].values.copy(), terrain["reflectivity"].values.copy()
    if roughness["height"].values.any():
        grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
        height += sample(roughness["height"], grid_x, grid_y)
    # ASSUME: the reflectivity follows the height of the terrain alone, not that of its roughness
    # and of the objects.
    across, ahead = x[None, :], y[:, None]
    for patch in patches:
        reflectivity[_inside(patch, across, ahead)] = patch.reflectivity
    for part in objects:
        height += relief(part, across, ahead)
        if part.reflectivity is not None:
            reflectivity[_inside(part, across, ahead)] = part.reflectivity
    return variables.dataset(
        "terrain", {"height": height, "reflectivity": reflectivity}, {"x": x, "y": y}
    )


def sample(raster: xr.DataArray, x: ArrayLike, y: ArrayLike) -> Floats:
    """Return a raster's values at points, bilinearly interpolated.

    Parameters
    ----------
    raster
        Values on evenly spaced (y, x).
    x, y
        Points, m, of one shape; those outside get the value of the nearest edge.

    Returns
    -------
    ndarray
        Values in the shape of the points.
    """
    from scipy.ndimage import map_coordinates

    columns, rows = raster["x"].values, raster["y"].values
    column = (np.asarray(x) - columns[0]) / (columns[1] - columns[0])
    row = (np.asarray(y) - rows[0]) / (rows[1] - rows[0])
    return np.asarray(map_coordinates(raster.values, [row, column], order=1, mode="nearest"))


def facets(
    terrain: xr.Dataset, *, facet_size_m: float, facet_jitter: float, rng: np.random.Generator
) -> xr.Dataset:
    """Cut the terrain into facets, each a point scatterer at a random place in its cell.

    Facets on an even grid scatter like a crystal (Bragg resonance): where twice the ground
    component of the wave number is a multiple of ``2 pi / size`` all echoes add up. A jitter of one
    full cell makes that coherent sum zero on average.

    Cells of the ground hold hardly a facet of an upright wall. On walls, faces steeper than 60
    degrees, a facet therefore stands for surface, not for ground: further facets lie on them at
    random, as many as their surface exceeds their ground by.

    Parameters
    ----------
    terrain
        Product ``terrain``.
    facet_size_m
        Side of a facet, m.
    facet_jitter
        Full width of the uniform displacement, as a fraction of the size.
    rng
        Source of randomness.

    Returns
    -------
    xarray.Dataset
        Product ``facets``, in the order of increasing y.
    """
    x, y = terrain["x"].values, terrain["y"].values
    columns = max(1, round((x[-1] - x[0]) / facet_size_m))
    rows = max(1, round((y[-1] - y[0]) / facet_size_m))
    width, depth = (x[-1] - x[0]) / columns, (y[-1] - y[0]) / rows
    shift = facet_jitter * (rng.random((2, rows, columns)) - 0.5)
    facet_x = x[0] + width * (np.arange(columns)[None, :] + 0.5 + shift[0])
    facet_y = y[0] + depth * (np.arange(rows)[:, None] + 0.5 + shift[1])
    wall_x, wall_y = _wall_facets(terrain, width * depth, rng)
    facet_x = np.concatenate([facet_x.ravel(), wall_x])
    facet_y = np.concatenate([facet_y.ravel(), wall_y])
    # The visibility kernel sweeps away from the antenna and wants the facets in that order.
    order = np.argsort(facet_y, kind="stable")
    facet_x, facet_y = facet_x[order], facet_y[order]
    facet_z = sample(terrain["height"], facet_x, facet_y)
    return variables.dataset(
        "facets",
        {
            "facet_position": np.stack([facet_x, facet_y, facet_z], axis=1),
            "reflectivity": sample(terrain["reflectivity"], facet_x, facet_y),
        },
    )


def _wall_facets(
    terrain: xr.Dataset, area: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return places of the facets that walls have beyond those of their ground."""
    # ASSUME: a wall scatters as the ground does, by its surface and whatever the angle; the paper's
    # terrain has no face as steep as that.
    x, y, height = terrain["x"].values, terrain["y"].values, terrain["height"].values
    step_x, step_y = x[1] - x[0], y[1] - y[0]
    along_x, along_y = np.diff(height, axis=1) / step_x, np.diff(height, axis=0) / step_y
    slope = np.hypot((along_x[1:] + along_x[:-1]) / 2, (along_y[:, 1:] + along_y[:, :-1]) / 2)
    row, column = np.nonzero(slope > _WALL_SLOPE)
    surplus = (np.sqrt(1 + slope[row, column] ** 2) - 1) * step_x * step_y / area
    count = np.floor(surplus + rng.random(surplus.size)).astype(int)
    row, column = np.repeat(row, count), np.repeat(column, count)
    place = rng.random((2, row.size))
    return x[0] + step_x * (column + place[0]), y[0] + step_y * (row + place[1])


class _Placed(Section):
    """Something at a place of the scene."""

    x_m: float = key("position of its centre along the rail", "ours")
    y_m: float = key("position of its centre ahead", "ours")


class _Rectangle(_Placed):
    """A rectangle at a place of the scene."""

    size_x_m: float = key("extent along x, before its rotation", "ours", gt=0)
    size_y_m: float = key("extent along y, before its rotation", "ours", gt=0)
    rotation_deg: float = key(
        "rotation from x towards y; 0 if left out", "ours", default=0.0, ge=-180, le=180
    )

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches from its centre along x and y, m."""
        cosine, sine = (abs(part(radians(self.rotation_deg))) for part in (cos, sin))
        half_x, half_y = self.size_x_m / 2, self.size_y_m / 2
        return half_x * cosine + half_y * sine, half_x * sine + half_y * cosine


class _Disc(_Placed):
    """A disc at a place of the scene."""

    diameter_m: float = key("diameter on the ground", "ours", gt=0)

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches from its centre along x and y, m."""
        return self.diameter_m / 2, self.diameter_m / 2


class _Object(_Placed):
    """Something that rises above the ground or falls below it."""

    reflectivity: float | None = key(
        "its reflectivity; that of the ground beneath if left out", "ours", default=None, ge=0
    )


class Box(_Object, _Rectangle):
    """A box: upright walls, a top that follows the ground beneath."""

    shape: Literal["box"] = key("a box", "ours")
    height_m: float = key("height above the ground beneath", "ours", gt=0)


class Stump(_Object, _Disc):
    """An upright cylinder."""

    shape: Literal["stump"] = key("a stump", "ours")
    height_m: float = key("height above the ground beneath", "ours", gt=0)


class Mound(_Object, _Disc):
    """A mound: the cap of a sphere."""

    shape: Literal["mound"] = key("a mound", "ours")
    height_m: float = key("height of its top above the ground beneath", "ours", gt=0)


class Ditch(_Object, _Rectangle):
    """A trench with upright walls."""

    shape: Literal["ditch"] = key("a ditch", "ours")
    depth_m: float = key("depth below the ground around", "ours", gt=0)


class Pit(_Object, _Disc):
    """A round hole with an upright wall."""

    shape: Literal["pit"] = key("a pit", "ours")
    depth_m: float = key("depth below the ground around", "ours", gt=0)


class Patch(_Rectangle):
    """Ground of another reflectivity, without height."""

    reflectivity: float = key("its reflectivity", "section 1, without a figure", ge=0)


SceneObject = Annotated[Box | Stump | Mound | Ditch | Pit, Field(discriminator="shape")]


class Scene(Section, name="scene"):
    """The true terrain: for the simulated echo and the metrics, never for the processing."""

    terrain: Literal[*TERRAINS, "file"] = key(  # type: ignore[valid-type]
        "shape of the terrain; `file` is your own (docs/own-data.md)", "section 2"
    )
    file: str | None = key(
        "netCDF file or raster with the heights of the terrain `file`; paths begin in the "
        "repository's folder",
        "ours",
    )
    origin_easting_m: float = key("easting (x) of the vehicle in the file", "ours")
    origin_northing_m: float = key("northing (y) of the vehicle in the file", "ours")
    origin_longitude_deg: float | None = key(
        "longitude of the vehicle on WGS 84, which files in degrees need; with its latitude it "
        "takes the place of easting and northing",
        "ours",
        ge=-180,
        le=360,
    )
    origin_latitude_deg: float | None = key(
        "latitude of the vehicle on WGS 84", "ours", ge=-90, le=90
    )
    heading_deg: float = key(
        "direction ahead, clockwise from the file's y axis (grid north; true north if the file is "
        "in degrees)",
        "ours",
        ge=-360,
        le=360,
    )
    ground_height_m: float | None = key(
        "height in the file that becomes 0, the ground plane; null for the file's own height at "
        "the vehicle",
        "ours",
    )
    peak_height_m: float = key("height of the highest top of `peaks`", "section 2", gt=0)
    x_min_m: float = key("left edge", "section 2")
    x_max_m: float = key("right edge", "section 2")
    y_min_m: float = key("near edge", "section 2")
    y_max_m: float = key("far edge", "section 2")
    terrain_spacing_m: float = key(
        "spacing of the raster that represents the terrain", "not given", gt=0
    )
    facet_size_m: float = key("side of a facet", "section 2.1, without a figure", gt=0)
    facet_jitter: float = key(
        "random displacement of the facets, as a fraction of the facet size (full width)",
        "section 2.1, without a figure",
        ge=0,
        le=1,
    )
    reflectivity_offset: float = key(
        "reflectivity is the height in metres plus this", "section 2", gt=0
    )
    file_reflectivity: Literal["height", "constant"] = key(
        "of a file without reflectivity: the height plus reflectivity_offset, as in the paper, or "
        "reflectivity_offset everywhere",
        "ours",
    )
    roughness_std_m: float = key(
        "standard deviation of the random roughness of the ground; 0 for none", "ours", ge=0
    )
    roughness_correlation_m: float = key(
        "distance at which the roughness is correlated by 1/e", "ours", gt=0
    )
    objects: Annotated[tuple[SceneObject, ...], Field(strict=False)] = key(
        "obstacles and holes, added to the terrain", "sections 1 and 3, without a figure"
    )
    patches: Annotated[tuple[Patch, ...], Field(strict=False)] = key(
        "ground of another reflectivity, without height", "section 1, without a figure"
    )


ELEVATION = (
    "terrain",
    "file",
    "origin_easting_m",
    "origin_northing_m",
    "origin_longitude_deg",
    "origin_latitude_deg",
    "heading_deg",
    "ground_height_m",
    "x_min_m",
    "x_max_m",
    "y_min_m",
    "y_max_m",
    "terrain_spacing_m",
    "reflectivity_offset",
    "file_reflectivity",
)
"""Keys of `Scene` that decide what is read from the file of a terrain."""


def _roughness(products: Products, study: Study) -> xr.Dataset:
    del products
    return roughness(
        x_min_m=study.scene.x_min_m,
        x_max_m=study.scene.x_max_m,
        y_min_m=study.scene.y_min_m,
        y_max_m=study.scene.y_max_m,
        spacing_m=study.scene.terrain_spacing_m,
        std_m=study.scene.roughness_std_m,
        correlation_m=study.scene.roughness_correlation_m,
        rng=randomness.generator(study, Draw.ROUGHNESS),
    )


def _terrain(products: Products, study: Study) -> xr.Dataset:
    options = study.scene
    if options.terrain == "file":
        ground = products["elevation"]
    else:
        keys = options.model_dump(exclude={"terrain", "terrain_spacing_m"})
        ground = terrain(options.terrain, spacing_m=options.terrain_spacing_m, **keys)
    return furnish(ground, products["roughness"], objects=options.objects, patches=options.patches)


def _facets(products: Products, study: Study) -> xr.Dataset:
    return facets(
        products["terrain"],
        facet_size_m=study.scene.facet_size_m,
        facet_jitter=study.scene.facet_jitter,
        rng=randomness.generator(study, Draw.JITTER),
    )


def _scene_raster(scene: Scene) -> Iterator[Fault]:
    faults = list(grid.check_extent("scene", scene))
    yield from faults
    if faults:
        return
    for axis in "xy":
        low, high = getattr(scene, f"{axis}_min_m"), getattr(scene, f"{axis}_max_m")
        yield from grid.check_multiple(
            "scene.terrain_spacing_m",
            scene.terrain_spacing_m,
            low,
            high,
            scene.terrain_spacing_m,
        )
        if scene.facet_size_m > high - low:
            yield Fault(
                "scene.facet_size_m", scene.facet_size_m, f"must be at most {high - low:g} m"
            )
    if scene.terrain_spacing_m > scene.facet_size_m:
        yield Fault(
            "scene.terrain_spacing_m",
            scene.terrain_spacing_m,
            f"must be at most the facet size, {scene.facet_size_m} m",
        )
    # The deepest hollow of `peaks` is 0.81 times as deep as its highest top is high.
    least = 0.8083 * scene.peak_height_m if scene.terrain == "peaks" else 0.0
    if scene.reflectivity_offset < least:
        yield Fault(
            "scene.reflectivity_offset",
            scene.reflectivity_offset,
            f"must be at least {least:.3f}, or the deepest hollow has a negative reflectivity",
        )


def _furniture(scene: Scene) -> Iterator[Fault]:
    """Check what stands on the terrain, in a scene whose raster may be wrong itself."""
    least = 2 * scene.terrain_spacing_m
    if scene.roughness_std_m > 0 and scene.roughness_correlation_m < least:
        yield Fault(
            "scene.roughness_correlation_m",
            scene.roughness_correlation_m,
            f"must be at least twice scene.terrain_spacing_m, {least:g} m, or the raster loses it",
        )
    parts: dict[str, SceneObject | Patch] = {}
    parts |= {f"scene.objects[{number}]": part for number, part in enumerate(scene.objects)}
    parts |= {f"scene.patches[{number}]": part for number, part in enumerate(scene.patches)}
    for where, part in parts.items():
        sizes = [name for name in ("diameter_m", "size_x_m", "size_y_m") if hasattr(part, name)]
        for size in sizes:
            if getattr(part, size) < least:
                yield Fault(
                    f"{where}.{size}",
                    getattr(part, size),
                    f"must be at least twice scene.terrain_spacing_m, {least:g} m, or the raster "
                    "loses it",
                )
        for axis, reach in zip("xy", part.reach(), strict=True):
            near, far = (getattr(part, f"{axis}_m") + sign * reach for sign in (-1, 1))
            first, last = getattr(scene, f"{axis}_min_m"), getattr(scene, f"{axis}_max_m")
            if near < first or far > last:
                yield Fault(
                    f"{where}.{axis}_m",
                    getattr(part, f"{axis}_m"),
                    f"it reaches from {near:.3g} to {far:.3g} m, but must lie in the scene, "
                    f"{axis} {first:g} to {last:g} m",
                )
        if isinstance(part, Mound) and part.height_m > part.diameter_m / 2:
            yield Fault(
                f"{where}.height_m",
                part.height_m,
                f"must be at most half the diameter, {part.diameter_m / 2:g} m: a mound is the cap "
                "of a sphere",
            )


def _own_terrain(scene: Scene) -> Iterator[Fault]:
    if scene.terrain == "file" and scene.file is None:
        yield Fault("scene.file", None, "must name the file of scene.terrain 'file'")
    if scene.terrain != "file" and scene.file is not None:
        yield Fault(
            "scene.file",
            scene.file,
            f"is not read for scene.terrain '{scene.terrain}'; take scene.terrain file, or null",
        )
    place = scene.origin_longitude_deg, scene.origin_latitude_deg
    if (place[0] is None) != (place[1] is None):
        missing = "longitude" if place[0] is None else "latitude"
        yield Fault(f"scene.origin_{missing}_deg", None, "must be given as well: a place has both")


STAGES = {
    "roughness": Stage(
        _roughness,
        sections=(
            *randomness.KEYS,
            "scene.x_min_m",
            "scene.x_max_m",
            "scene.y_min_m",
            "scene.y_max_m",
            "scene.terrain_spacing_m",
            "scene.roughness_std_m",
            "scene.roughness_correlation_m",
        ),
    ),
    "terrain": Stage(_terrain, inputs=("roughness",), sections=("scene",), optional=("elevation",)),
    "facets": Stage(
        _facets,
        inputs=("terrain",),
        sections=(*randomness.KEYS, "scene.facet_size_m", "scene.facet_jitter"),
    ),
}


CHECKS = (_scene_raster, _furniture, _own_terrain)
