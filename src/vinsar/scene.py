"""The true scene: terrain on a raster, its reflectivity, and the facets that scatter.

Only the simulated echo and the metrics may know it; the processing never does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar import geometry, variables

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]

TerrainName = Literal["peaks", "flat"]


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
    # The visibility kernel sweeps away from the antenna and wants the facets in that order.
    order = np.argsort(facet_y, axis=None, kind="stable")
    facet_x, facet_y = facet_x.ravel()[order], facet_y.ravel()[order]
    facet_z = sample(terrain["height"], facet_x, facet_y)
    return variables.dataset(
        "facets",
        {
            "facet_position": np.stack([facet_x, facet_y, facet_z], axis=1),
            "reflectivity": sample(terrain["reflectivity"], facet_x, facet_y),
        },
    )
