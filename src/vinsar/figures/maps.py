"""Maps of the scene: x across, y up the page, metres, equal aspect."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.figures import style

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Extend = Literal["neither", "both", "min", "max"]

SHADOW_LABEL = "outline of the shadow"
COLORBAR_GAP_MM, COLORBAR_MM = 1.5, 2.5

_SHADOW_SMOOTHING_M = 0.15


def edges(data: xr.DataArray) -> tuple[float, float, float, float]:
    """Return the outer edges of a raster's cells: left, right, near, far, m."""
    x, y = data["x"].values, data["y"].values
    half_x, half_y = (x[1] - x[0]) / 2, (y[1] - y[0]) / 2
    return (
        float(x[0] - half_x),
        float(x[-1] + half_x),
        float(y[0] - half_y),
        float(y[-1] + half_y),
    )


def fit(data: xr.DataArray, width_mm: float, height_mm: float) -> tuple[float, float]:
    """Return the largest size of a map in true proportion within a box, mm."""
    left, right, near, far = edges(data)
    scale = min(width_mm / (right - left), height_mm / (far - near))
    return (right - left) * scale, (far - near) * scale


def draw(
    axes: Axes,
    data: xr.DataArray,
    *,
    colormap: Colormap,
    limits: tuple[float, float],
    label_x: bool = True,
    label_y: bool = True,
) -> AxesImage:
    """Draw a raster as a map.

    Parameters
    ----------
    axes
        Where.
    data
        Values (y, x); NaN is shown as no data.
    colormap
        Colours.
    limits
        Values at the two ends of the colours.
    label_x, label_y
        Whether to write the axis label and the numbers.

    Returns
    -------
    matplotlib.image.AxesImage
        The picture, for its colour bar.
    """
    from matplotlib.ticker import MaxNLocator

    image = axes.imshow(
        data.values,
        extent=edges(data),
        cmap=colormap,
        vmin=limits[0],
        vmax=limits[1],
        aspect="equal",
    )
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
    axes.tick_params(labelbottom=label_x, labelleft=label_y)
    if label_x:
        axes.set_xlabel("x (m)")
    if label_y:
        axes.set_ylabel("y, ahead (m)")
    return image


def colorbar(
    axes: Axes,
    mappable: ScalarMappable,
    label: str,
    *,
    extend: Extend = "neither",
    ticks: Sequence[float] | None = None,
    tick_labels: Sequence[str] | None = None,
) -> Any:
    """Draw a colour bar of the axes' height at their right.

    Parameters
    ----------
    axes
        The map.
    mappable
        What the bar explains.
    label
        Quantity and unit.
    extend
        Ends at which values lie beyond the colours.
    ticks, tick_labels
        Where to mark the bar, and with what.

    Returns
    -------
    matplotlib.colorbar.Colorbar
        The bar.
    """
    figure: Figure = axes.get_figure(root=True)  # type: ignore[assignment]
    width, height = (float(size) * style.MM_PER_INCH for size in figure.get_size_inches())
    box = axes.get_position()
    bar = style.place(
        figure,
        box.x1 * width + COLORBAR_GAP_MM,
        box.y0 * height,
        COLORBAR_MM,
        box.height * height,
    )
    result = figure.colorbar(mappable, cax=bar, extend=extend, extendfrac=0.04, label=label)
    result.outline.set_linewidth(0.5)  # type: ignore[operator]
    if ticks is not None:
        result.set_ticks(list(ticks), labels=tick_labels)
    return result


def beyond(values: Floats, limits: tuple[float, float]) -> Extend:
    """Return at which ends values lie beyond the limits."""
    low, high = bool(np.nanmin(values) < limits[0]), bool(np.nanmax(values) > limits[1])
    names: dict[tuple[bool, bool], Extend] = {
        (False, False): "neither",
        (True, False): "min",
        (False, True): "max",
        (True, True): "both",
    }
    return names[low, high]


def outline_shadow(axes: Axes, shadow: xr.DataArray) -> bool:
    """Draw the outline of the shadow.

    Where the terrain just grazes the line of sight, shadow and light alternate from cell to cell.
    The outline is that of the mask after a majority vote over about a resolution cell; statistics
    take the mask as it is.

    Parameters
    ----------
    axes
        A map.
    shadow
        Mask (y, x), true in shadow.

    Returns
    -------
    bool
        Whether there is any shadow to outline.
    """
    from matplotlib import patheffects
    from scipy import ndimage

    x, y = shadow["x"].values, shadow["y"].values
    size = 2 * max(1, round(_SHADOW_SMOOTHING_M / float(x[1] - x[0]) / 2)) + 1
    share = ndimage.uniform_filter(shadow.values.astype(float), size, mode="nearest")
    if not share.min() < 0.5 < share.max():
        return False
    lines = axes.contour(x, y, share, levels=[0.5], colors="white", linewidths=0.5)
    # A dark casing keeps the line visible on every colour.
    lines.set_path_effects([patheffects.withStroke(linewidth=1.2, foreground="black")])
    return True


def explain_shadow(figure: Figure, left_mm: float, bottom_mm: float, text: str) -> None:
    """Write what the outline on the maps means, beside a piece of it.

    Parameters
    ----------
    figure
        The figure.
    left_mm, bottom_mm
        Lower left corner of the line, mm.
    text
        The meaning.
    """
    from matplotlib import patheffects
    from matplotlib.lines import Line2D

    width, height = (float(size) * style.MM_PER_INCH for size in figure.get_size_inches())
    piece = Line2D([], [], color="white", linewidth=0.5, label=text)
    piece.set_path_effects([patheffects.withStroke(linewidth=1.2, foreground="black")])
    figure.legend(
        handles=[piece],
        loc="lower left",
        bbox_to_anchor=(left_mm / width, bottom_mm / height),
        borderpad=0,
        borderaxespad=0,
    )
