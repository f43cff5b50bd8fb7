"""Which facets an antenna sees: occlusion by terrain (Eqs. 8-9)."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import blocks, variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.radar import grid
from vinsar.simulation import scene

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

# Where the raster is coarse, the edges of shadows still are to be sharp.
_FEWEST_RAYS = 800

# Cells of a grid that are interpolated at a time.
_CELLS_AT_ONCE = 1 << 18


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
        "height": Variable(GRID, "real", "m", "true height on the DEM's grid", gaps=True),
        "reflectivity": Variable(GRID, "real", "1", "reflectivity on the DEM's grid", gaps=True),
        "visible_fraction": Variable(
            ("channel", "y", "x"),
            "real",
            "1",
            "share of the antenna positions that see the cell",
            bounds=(0, 1),
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
    look = _looking(terrain, antennas, points)
    visible = np.empty((len(antennas), len(points)), dtype=bool)
    blocks.run(
        lambda index: look(antennas[index], visible[index]),
        ((index,) for index in range(len(antennas))),
    )
    return visible


def _looking(
    terrain: xr.Dataset, antennas: Floats, points: Floats
) -> Callable[[Floats, Flags], None]:
    """Return a function that marks the points in sight of one of the antennas."""
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
    x_step, y_step = x[1] - x[0], y[1] - y[0]
    columns = np.ascontiguousarray(points.T, dtype=float)
    ready = np.searchsorted(points[:, 1], y[0] + y_step * np.arange(1, y.size + 2))
    ready[-1] = len(points)
    # Rays a raster cell apart at the far edge, where they are widest apart.
    spread = (x[-1] - x[0]) / (y[0] - antennas[:, 1].max())
    spacing = x_step / (y[-1] - antennas[:, 1].min())
    rays = max(_FEWEST_RAYS, int(np.ceil(spread / spacing)) + 1)
    highest = float(height.max())

    def look(antenna: Floats, visible: Flags) -> None:
        fan.sweep(
            height, highest, x[0], x_step, y[0], y_step, antenna, columns, ready, rays, visible
        )  # fmt: skip

    return look


def _each_channel(
    terrain: xr.Dataset,
    trajectory: xr.Dataset,
    points: Floats,
    take: Callable[[int, int, Flags], None],
) -> None:
    """Call ``take(channel, position, flags)`` with what both ends see: all of it is too much.

    The calls come from several threads, and the flags are theirs for the call alone.
    """
    transmitter, receiver = trajectory["transmitter"].values, trajectory["receiver"].values
    channels, positions = transmitter.shape[:2]
    antennas, where = np.unique(
        np.concatenate([transmitter, receiver]).reshape(-1, 3), axis=0, return_inverse=True
    )
    ends = where.reshape(2, channels, positions)
    look = _looking(terrain, antennas, points)

    def flags(index: int) -> Flags:
        seen = np.empty(len(points), dtype=bool)
        look(antennas[index], seen)
        return seen

    # An antenna that stands still while another moves is asked once.
    still = {int(part[0]) for part in ends.reshape(-1, positions) if (part == part[0]).all()}
    standing = {index: flags(index) for index in sorted(still)}

    def work(position: int) -> None:
        seen = dict(standing)
        for channel in range(channels):
            out, back = (int(index) for index in ends[:, channel, position])
            for index in (out, back):
                if index not in seen:
                    seen[index] = flags(index)
            take(channel, position, seen[out] if out == back else seen[out] & seen[back])

    blocks.run(work, ((position,) for position in range(positions)))


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
    visible = np.empty((*trajectory["transmitter"].shape[:2], len(points)), dtype=bool)

    def take(channel: int, position: int, flags: Flags) -> None:
        visible[channel, position] = flags

    _each_channel(terrain, trajectory, points, take)
    return visible


def visible_share(terrain: xr.Dataset, trajectory: xr.Dataset, points: Floats) -> Floats:
    """Return the share of the antenna positions at which each channel sees points.

    Parameters
    ----------
    terrain, trajectory, points
        As of `channel_visibility`, whose flags take many times the memory.

    Returns
    -------
    ndarray, shape (channel, point)
        From 0 to 1.
    """
    channels, positions = trajectory["transmitter"].shape[:2]
    # Bytes, if they hold so many, are added far faster.
    counts = np.zeros((channels, len(points)), dtype=np.min_scalar_type(positions))
    turn = threading.Lock()

    def take(channel: int, position: int, flags: Flags) -> None:
        del position
        with turn:
            counts[channel] += flags.view(np.uint8)

    _each_channel(terrain, trajectory, points, take)
    return counts / positions


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
    columns = np.empty((3, y.size, x.size))
    reflectivity = np.empty(columns.shape[1:])
    for rows in _row_blocks(y.size, x.size):
        columns[1, rows], columns[0, rows] = np.meshgrid(y[rows], x, indexing="ij")
        place = columns[0, rows], columns[1, rows]
        columns[2, rows] = scene.sample(terrain["height"], *place)
        reflectivity[rows] = scene.sample(terrain["reflectivity"], *place)
    fraction = visible_share(terrain, trajectory, columns.reshape(3, -1).T)
    fraction = fraction.reshape(-1, y.size, x.size)
    inside = [
        (axis > own[0] - 1e-9) & (axis < own[-1] + 1e-9)
        for axis, own in ((y, terrain["y"].values), (x, terrain["x"].values))
    ]
    outside = ~(inside[0][:, np.newaxis] & inside[1])
    height = columns[2]
    for values in (height, reflectivity):
        values[outside] = np.nan
    return variables.dataset(
        "truth",
        {
            "height": height,
            "reflectivity": reflectivity,
            "visible_fraction": fraction,
            "shadow": (fraction < 0.5).any(axis=0) & ~outside,
        },
        {"x": x, "y": y},
    )


def _row_blocks(rows: int, columns: int) -> list[slice]:
    """Return slices of rows with so many cells that what is computed of them takes little."""
    step = max(1, _CELLS_AT_ONCE // columns)
    return [slice(begin, begin + step) for begin in range(0, rows, step)]


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
