"""The true scene: terrain on a raster, its reflectivity, and the facets that scatter.

Only the simulated echo and the metrics may know it; the processing never does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.foundations import variables
from vinsar.radar import geometry

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.study import config

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

TerrainName = Literal["peaks", "flat"]

# Tangent of 60 degrees: from here on a face is a wall, its surface more than twice its ground.
_WALL_SLOPE = 3**0.5


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


def terrain(
    name: TerrainName,
    *,
    x_min_m: float,
    x_max_m: float,
    y_min_m: float,
    y_max_m: float,
    spacing_m: float,
    peak_height_m: float,
    reflectivity_offset: float,
) -> xr.Dataset:
    """Return terrain and reflectivity on a raster; between its nodes the terrain is bilinear.

    Parameters
    ----------
    name
        ``peaks`` spans the extent with its domain -3..3 and is scaled so that its highest top has
        the peak height (its deepest hollow is then -0.81 times that); ``flat`` is zero.
    x_min_m, x_max_m, y_min_m, y_max_m
        Extent, m.
    spacing_m
        Spacing of the raster, m.
    peak_height_m
        Height of the highest top, m.
    reflectivity_offset
        Reflectivity is the height in metres plus this.

    Returns
    -------
    xarray.Dataset
        Product ``terrain``: ``height`` and ``reflectivity`` (y, x).

    Raises
    ------
    ValueError
        If the spacing does not divide the extent, or a reflectivity is negative.
    """
    x = geometry.grid_axis(x_min_m, x_max_m, spacing_m)
    y = geometry.grid_axis(y_min_m, y_max_m, spacing_m)
    height: Floats
    if name == "flat":
        height = np.zeros((y.size, x.size))
    else:
        u = 6 * (x - x_min_m) / (x_max_m - x_min_m) - 3
        v = 6 * (y - y_min_m) / (y_max_m - y_min_m) - 3
        height = peak_height_m / _highest_peak() * peaks(u[None, :], v[:, None])
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
        If a reflectivity would be negative.
    """
    if reflectivity is None:
        reflectivity = height + reflectivity_offset
        if reflectivity.min() < 0:
            raise ValueError(
                f"its heights fall to {height.min():.3f} m above the ground plane, so that the "
                f"reflectivity falls to {reflectivity.min():.3f}, being the height plus "
                f"scene.reflectivity_offset; take an offset of {-height.min():.3f} or more, give "
                "the file a 'reflectivity' of its own, or mend scene.ground_height_m"
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


def relief(part: config.SceneObject, x: Floats, y: Floats) -> Floats:
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
    objects: Sequence[config.SceneObject],
    patches: Sequence[config.Patch],
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
