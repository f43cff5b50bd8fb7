"""Which facets an antenna sees: occlusion by terrain (Eqs. 8-9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import blocks, variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.radar import grid
from vinsar.simulation import scene

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

# Where the raster is coarse, the edges of shadows still are to be sharp.
_FEWEST_RAYS = 800


SHADOW = Variable(
    GRID,
    "flag",
    "1",
    "cell hidden from either antenna at more than half of the positions",
    flag_meanings="visible shadow",
)
"""Variable of what is hidden."""

variables.declare(
    "visibility",
    {
        "visible": Variable(
            ("channel", "position", "facet"),
            "flag",
            "1",
            "facet seen from the transmitter and the receiver (Eq. 8)",
            flag_meanings="hidden visible",
        ),
    },
)
variables.declare(
    "truth",
    {
        "height": Variable(GRID, "real", "m", "true height on the DEM's grid"),
        "reflectivity": Variable(GRID, "real", "1", "reflectivity on the DEM's grid"),
        "visible_fraction": Variable(
            ("channel", "y", "x"), "real", "1", "share of the antenna positions that see the cell"
        ),
        "shadow": SHADOW,
    },
)


def visible_points(terrain: xr.Dataset, antennas: Floats, points: Floats) -> Flags:
    """Return which points the terrain leaves in sight of each antenna.

    Parameters
    ----------
    terrain
        Product ``terrain``; all of it ahead of the antennas.
    antennas
        Positions (antenna, 3), m.
    points
        Points (point, 3), m, sorted by y.

    Returns
    -------
    ndarray of bool, shape (antenna, point)
        True where visible.

    Raises
    ------
    ValueError
        If an antenna is not before the terrain, a position is not finite, or the points are not
        sorted by y.
    """
    from vinsar.kernels import fan

    x, y = terrain["x"].values, terrain["y"].values
    height = np.pad(
        terrain["height"].values.astype(np.float32), ((0, 0), (0, fan.PADDING)), mode="edge"
    )
    if antennas[:, 1].max() >= y[0]:
        raise ValueError(
            f"an antenna at y = {antennas[:, 1].max():.3f} m is not before the terrain, which "
            f"begins at y = {y[0]:.3f} m"
        )
    if not (np.isfinite(antennas).all() and np.isfinite(points).all()):
        raise ValueError("an antenna or a point is at a position that is not a number")
    if np.any(np.diff(points[:, 1]) < 0):
        raise ValueError("the points are not sorted by y")
    columns = np.ascontiguousarray(points.T, dtype=float)
    visible = np.empty((len(antennas), len(points)), dtype=bool)
    # Rays a raster cell apart at the far edge, where they are widest apart.
    spread = (x[-1] - x[0]) / (y[0] - antennas[:, 1].max())
    spacing = (x[1] - x[0]) / (y[-1] - antennas[:, 1].min())
    rays = max(_FEWEST_RAYS, int(np.ceil(spread / spacing)) + 1)

    def work(index: int) -> None:
        fan.sweep(
            height, x[0], x[1] - x[0], y[0], y[1] - y[0], antennas[index], columns, rays,
            visible[index],
        )  # fmt: skip

    blocks.run(work, ((index,) for index in range(len(antennas))))
    return visible


def channel_visibility(terrain: xr.Dataset, trajectory: xr.Dataset, points: Floats) -> Flags:
    """Return which points both ends of each channel see at each position.

    Parameters
    ----------
    terrain
        Product ``terrain``.
    trajectory
        Product ``trajectory``.
    points
        Points (point, 3), m, sorted by y.

    Returns
    -------
    ndarray of bool, shape (channel, position, point)
        True where transmitter and receiver both see the point.
    """
    transmitter, receiver = trajectory["transmitter"].values, trajectory["receiver"].values
    antennas, where = np.unique(
        np.concatenate([transmitter, receiver]).reshape(-1, 3), axis=0, return_inverse=True
    )
    seen = visible_points(terrain, antennas, points)
    channels, positions = transmitter.shape[:2]
    out, back = where.reshape(2, channels, positions)
    return np.asarray(seen[out] & seen[back])


def facet_visibility(terrain: xr.Dataset, facets: xr.Dataset, trajectory: xr.Dataset) -> xr.Dataset:
    """Return the visibility of every facet from every antenna position (Eq. 8).

    Parameters
    ----------
    terrain, facets, trajectory
        Products of these names.

    Returns
    -------
    xarray.Dataset
        Product ``visibility``.
    """
    points = facets["facet_position"].values
    return variables.dataset(
        "visibility",
        {"visible": channel_visibility(terrain, trajectory, points)},
        {"channel": trajectory["channel"].values},
    )


def truth_on_grid(terrain: xr.Dataset, trajectory: xr.Dataset, x: Floats, y: Floats) -> xr.Dataset:
    """Return true heights and shadow on a grid, for the metrics and the figures.

    Parameters
    ----------
    terrain, trajectory
        Products of these names.
    x, y
        Axes of the grid, m.

    Returns
    -------
    xarray.Dataset
        Product ``truth``; NaN heights outside the terrain.
    """
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    height = scene.sample(terrain["height"], grid_x, grid_y)
    points = np.stack([grid_x, grid_y, height], axis=-1).reshape(-1, 3)
    seen = channel_visibility(terrain, trajectory, points)
    fraction = seen.mean(axis=1).reshape(seen.shape[0], y.size, x.size)
    edge = terrain["x"].values, terrain["y"].values
    outside = (
        (grid_x < edge[0][0] - 1e-9) | (grid_x > edge[0][-1] + 1e-9)
        | (grid_y < edge[1][0] - 1e-9) | (grid_y > edge[1][-1] + 1e-9)
    )  # fmt: skip
    return variables.dataset(
        "truth",
        {
            "height": np.where(outside, np.nan, height),
            "reflectivity": np.where(
                outside, np.nan, scene.sample(terrain["reflectivity"], grid_x, grid_y)
            ),
            "visible_fraction": fraction,
            "shadow": (fraction < 0.5).any(axis=0) & ~outside,
        },
        {"x": x, "y": y},
    )


def _visibility(products: Products, study: Study) -> xr.Dataset:
    del study
    return facet_visibility(products["terrain"], products["facets"], products["true_trajectory"])


def _truth(products: Products, study: Study) -> xr.Dataset:
    x, y = grid.image_axes(study.imaging)
    return truth_on_grid(products["terrain"], products["true_trajectory"], x, y)


STAGES = {
    "visibility": Stage(
        _visibility, inputs=("terrain", "facets", "true_trajectory"), by_channel=True, parallel=True
    ),
    "truth": Stage(
        _truth, inputs=("terrain", "true_trajectory"), sections=grid.KEYS, parallel=True
    ),
}
