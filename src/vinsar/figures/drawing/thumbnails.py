"""The small picture of a product, without axes, by which the report shows a stage."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import style

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from vinsar.study.options import Figures


_WIDTH_MM, _HEIGHT_MM = 42.0, 34.0
_DPI = 170


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
    draw: Callable[[Axes, xr.Dataset, Figures], object] | None = None


def png(thumbnail: Thumbnail, product: xr.Dataset, options: Figures) -> bytes | None:
    """Draw the small picture of a product.

    Parameters
    ----------
    thumbnail
        Its declaration.
    product
        The product.
    options
        Section ``figures`` of the configuration.

    Returns
    -------
    bytes or None
        A PNG file, the same for the same product; None where no picture is declared.
    """
    if thumbnail.draw is None:
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


def raster(axes: Axes, data: xr.DataArray, colormap: Any, low: float, high: float) -> None:
    """Draw values (y, x) between two limits, in true proportion."""
    axes.imshow(data.values, cmap=colormap, aspect="equal", vmin=low, vmax=high)


def heights(axes: Axes, data: xr.DataArray, options: Figures) -> None:
    """Draw heights in the colours of heights."""
    raster(axes, data, style.colormap(options.height_colormap), *ends(data.values))


def ends(values: NDArray[np.floating]) -> tuple[float, float]:
    """Return the range of all but a few values, which may have failed."""
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, [0.1, 99.9]) if known.size else (0.0, 1.0)
    return float(low), float(high)


def decibels(values: NDArray[np.complexfloating]) -> NDArray[np.floating]:
    """Return amplitudes in dB below the largest."""
    amplitude = np.abs(values)
    top = max(float(amplitude.max()), np.finfo(np.float32).tiny)
    return np.asarray(20 * np.log10(np.maximum(amplitude / top, 1e-20)))
