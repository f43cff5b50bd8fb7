"""A small picture of each stage's product, without axes, for an overview of the chain."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures import style

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from vinsar.study import config

_WIDTH_MM, _HEIGHT_MM = 42.0, 34.0
_DPI = 170
_RANGE_DB = 40.0


@dataclass(frozen=True)
class Thumbnail:
    """What a stage makes, in a line, and how its small picture is drawn.

    Attributes
    ----------
    shows
        What the picture shows; without a picture, what the stage makes.
    draw
        From axes, product and the figures' options to a picture; None where there is none.
    """

    shows: str
    draw: Callable[[Axes, xr.Dataset, config.Figures], object] | None = None


def _map(axes: Axes, data: xr.DataArray, colormap: Any, low: float, high: float) -> None:
    axes.imshow(data.values, cmap=colormap, aspect="equal", vmin=low, vmax=high)


def _heights(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    low, high = _ends(product["height"].values)
    _map(axes, product["height"], style.colormap(options.height_colormap), low, high)


def _ends(values: NDArray[np.floating]) -> tuple[float, float]:
    """Return the range of all but a few values, which may have failed."""
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, [0.1, 99.9]) if known.size else (0.0, 1.0)
    return float(low), float(high)


def _decibels(values: NDArray[np.complexfloating]) -> NDArray[np.floating]:
    amplitude = np.abs(values)
    top = max(float(amplitude.max()), np.finfo(np.float32).tiny)
    return np.asarray(20 * np.log10(np.maximum(amplitude / top, 1e-20)))


def _image(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    low = -options.amplitude_range_db
    axes.imshow(_decibels(product["image"].values[0]), cmap="gray", vmin=low, vmax=0)


def _matrix(name: str) -> Callable[[Axes, xr.Dataset, config.Figures], None]:
    """Return what draws the lower channel's positions against frequency or range."""

    def draw(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
        del options
        values = _decibels(product[name].values[0])
        axes.imshow(values, cmap="gray", aspect="auto", vmin=-_RANGE_DB, vmax=0)

    return draw


def _phase(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    angle = product["interferogram"].copy(data=np.angle(product["interferogram"].values))
    _map(axes, angle, style.colormap(options.phase_colormap), -np.pi, np.pi)


def _unwrapped(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    low, high = _ends(product["phase"].values)
    _map(axes, product["phase"], style.colormap("viridis_r"), low, high)


def _shadow(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    _map(axes, product["visible_fraction"].mean("channel"), "gray", 0, 1)


def _facets(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    x, y, _ = product["facet_position"].values.T
    colours = product["reflectivity"].values
    axes.scatter(x, y, c=colours, cmap="gray", s=0.15, linewidths=0)
    axes.set_facecolor("black")
    axes.set_aspect("equal")
    axes.set_xlim(x.min(), x.max())
    axes.set_ylim(y.min(), y.max())


def _positions(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    for channel, colour in enumerate((style.BLUE, style.ORANGE)):
        for name, marker in (("receiver", "."), ("transmitter", "+")):
            x, _, z = product[name].values[channel].T
            axes.plot(x, z, marker, color=colour, markersize=2.5, markeredgewidth=0.4)
    axes.margins(0.1, 0.6)


def _visible(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    axes.imshow(
        product["visible"].values[0], cmap="gray", aspect="auto", interpolation="antialiased"
    )


def _above_ground(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    height = product["height_above_ground"]
    low, high = _ends(height.values)
    _map(axes, height, style.colormap(options.height_colormap), low, high)


def _coupling(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    power = product["power"].values.reshape(-1, product.sizes["slant_range"])
    axes.semilogy(product["slant_range"].values, power.T, color=style.INK, linewidth=0.6)


def _error(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    limit = 3 * float(product["tolerance"])
    _map(axes, product["height_error"], style.colormap("cmc.vik"), -limit, limit)


def _shifts(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    for target, colour in zip(product["target"].values, (style.INK, style.BLUE), strict=False):
        part = product["measured"].sel(ground_axis="y", target=target)
        axes.plot(product["target_height"].values, part.values, color=colour)


def _sensitivity(axes: Axes, product: xr.Dataset, options: config.Figures) -> None:
    del options
    axes.semilogy(product["baseline_angle"].values, product["length_drawn"].values, color=style.INK)


THUMBNAILS: dict[str, Thumbnail] = {
    "elevation": Thumbnail("terrain from a file", _heights),
    "roughness": Thumbnail("small relief of the ground", _heights),
    "terrain": Thumbnail("true height, as a raster", _heights),
    "facets": Thumbnail("point scatterers and their reflectivity", _facets),
    "trajectory": Thumbnail("antenna positions, x and z", _positions),
    "true_trajectory": Thumbnail("where the antennas really were", _positions),
    "recorded_trajectory": Thumbnail("where imaging is told they were", _positions),
    "visibility": Thumbnail("facets seen from each position, lower antenna", _visible),
    "truth": Thumbnail("share of positions that see the ground", _shadow),
    "echo": Thumbnail("clean echo: position against frequency", _matrix("echo")),
    "received": Thumbnail("echo as received", _matrix("echo")),
    "profiles": Thumbnail("range profiles: position against range", _matrix("profile")),
    "images": Thumbnail("image of the lower antenna", _image),
    "interferogram": Thumbnail("phase between the images", _phase),
    "filtered": Thumbnail("filtered phase", _phase),
    "unwrapped": Thumbnail("unwrapped phase", _unwrapped),
    "dem": Thumbnail("reconstructed height", _heights),
    "accuracy": Thumbnail("height error", _error),
    "focus": Thumbnail("what position errors leave of a point target"),
    "registration": Thumbnail("shift between the images by target height", _shifts),
    "coupling": Thumbnail("power over range, as received", _coupling),
    "detections": Thumbnail("height above the ground found", _above_ground),
    "detection_accuracy": Thumbnail("what is found, missed and falsely alarmed"),
    "baseline_angle": Thumbnail("height error by the baseline's attitude", _sensitivity),
}
"""Small pictures by stage."""


def shows(stage: str) -> str:
    """Return what a stage makes, in a line."""
    known = THUMBNAILS.get(stage)
    return known.shows if known else stage.replace("_", " ")


def png(stage: str, product: xr.Dataset, options: config.Figures) -> bytes | None:
    """Draw the small picture of a stage's product.

    Parameters
    ----------
    stage
        Name of the stage.
    product
        Its product.
    options
        Section ``figures`` of the configuration.

    Returns
    -------
    bytes or None
        A PNG file, the same for the same product; None for a stage that has no picture.
    """
    thumbnail = THUMBNAILS.get(stage)
    if thumbnail is None or thumbnail.draw is None:
        return None
    with style.applied():
        figure = style.new_figure(_WIDTH_MM, _HEIGHT_MM)
        axes = style.place(figure, 0.3, 0.3, _WIDTH_MM - 0.6, _HEIGHT_MM - 0.6)
        thumbnail.draw(axes, product, options)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.minorticks_off()
        buffer = io.BytesIO()
        figure.savefig(
            buffer, format="png", dpi=_DPI, facecolor="white", metadata={"Software": None}
        )
    return buffer.getvalue()
