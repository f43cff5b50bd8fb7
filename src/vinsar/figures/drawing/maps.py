"""Maps of the scene: x across, y up the page, metres, equal aspect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.figures.drawing import style

if TYPE_CHECKING:
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
_TICK_MM = 6.0


@dataclass(frozen=True)
class Layer:
    """What a map shows: values, colours, and the colour bar that explains them."""

    data: xr.DataArray
    colormap: Colormap
    limits: tuple[float, float]
    label: str
    extend: Extend = "neither"
    phase: bool = False


HATCH = "#6b6b6b"
"""Colour of the hatching over heights that are not delivered."""


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


def place(
    figure: Figure, data: xr.DataArray, box: tuple[float, float, float, float], title: str
) -> Axes:
    """Add axes for a map as large as fits in a box, at its top and in the middle of its width.

    Parameters
    ----------
    figure
        The figure.
    data
        The raster.
    box
        Left, bottom, width and height, mm.
    title
        Written above the left end of the box.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.
    """
    left, bottom, box_width, box_height = box
    width, height = fit(data, box_width, box_height)
    style.write_title(figure, left, bottom + box_height, title)
    return style.place(
        figure, left + (box_width - width) / 2, bottom + box_height - height, width, height
    )


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
    image = axes.imshow(
        data.values,
        extent=edges(data),
        cmap=colormap,
        vmin=limits[0],
        vmax=limits[1],
        aspect="equal",
    )
    width, height = style.size_mm(axes)
    axes.xaxis.set_major_locator(style.round_ticks(min(6, int(width / 6))))
    axes.yaxis.set_major_locator(style.round_ticks(min(7, int(height / 5))))
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
    phase: bool = False,
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
    phase
        Whether to mark multiples of pi rather than round numbers.

    Returns
    -------
    matplotlib.colorbar.Colorbar
        The bar.
    """
    figure: Any = axes.get_figure(root=True)
    page_width, page_height = style.page_mm(figure)
    box = axes.get_position()
    bar = style.place(
        figure,
        box.x1 * page_width + COLORBAR_GAP_MM,
        box.y0 * page_height,
        COLORBAR_MM,
        box.height * page_height,
    )
    result = figure.colorbar(mappable, cax=bar, extend=extend, extendfrac=0.04, label=label)
    result.outline.set_linewidth(0.5)
    most = max(2, int(box.height * page_height / _TICK_MM))
    if phase:
        halves = pi_ticks(mappable.get_clim(), max(3, most))
        result.set_ticks([n * np.pi / 2 for n in halves], labels=[pi_label(n) for n in halves])
        result.minorticks_off()
    else:
        result.locator = style.round_ticks(min(7, most))
    return result


def draw_layer(
    figure: Figure,
    box: tuple[float, float, float, float],
    layer: Layer,
    title: str,
    *,
    label_x: bool = True,
    label_y: bool = True,
) -> Axes:
    """Draw a layer with its title and colour bar.

    Parameters
    ----------
    figure
        The figure.
    box
        Left, bottom, width and height, mm.
    layer
        What is drawn.
    title
        Written above the left end of the box.
    label_x, label_y
        Whether to write the axis label and the numbers.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the map.
    """
    axes = place(figure, layer.data, box, title)
    image = draw(
        axes,
        layer.data,
        colormap=layer.colormap,
        limits=layer.limits,
        label_x=label_x,
        label_y=label_y,
    )
    colorbar(axes, image, layer.label, extend=layer.extend, phase=layer.phase)
    return axes


def pi_ticks(limits: tuple[float | None, float | None], most: int) -> list[int]:
    """Return where to mark a phase axis, in halves of pi.

    Parameters
    ----------
    limits
        Lowest and highest phase, rad.
    most
        How many marks there is room for.

    Returns
    -------
    list of int
        Multiples of 2 (of pi, that is), or of a coarser step, or of 1 where the axis is so short
        that it holds no two multiples of pi.
    """
    low, high = (0.0 if limit is None else limit / (np.pi / 2) for limit in limits)
    halves = range(int(np.ceil(low - 1e-9)), int(np.floor(high + 1e-9)) + 1)
    step = 2
    while sum(n % step == 0 for n in halves) > most:
        step *= 2
    marks = [n for n in halves if n % step == 0]
    return marks if len(marks) > 1 else list(halves)


def pi_label(halves: int) -> str:
    """Return how a phase of so many halves of pi is written."""
    sign = "−" if halves < 0 else ""
    whole, odd = divmod(abs(halves), 2)
    if odd:
        return f"{sign}{'' if abs(halves) == 1 else abs(halves)}π/2"
    return "0" if whole == 0 else f"{sign}{'' if whole == 1 else whole}π"


def beyond(values: Floats, limits: tuple[float, float]) -> Extend:
    """Return at which ends values lie beyond the limits."""
    low, high = bool((values < limits[0]).any()), bool((values > limits[1]).any())
    names: dict[tuple[bool, bool], Extend] = {
        (False, False): "neither",
        (True, False): "min",
        (False, True): "max",
        (True, True): "both",
    }
    return names[low, high]


def hatch(axes: Axes, withheld: xr.DataArray) -> None:
    """Hatch the cells whose value is not known.

    Parameters
    ----------
    axes
        A map.
    withheld
        Mask (y, x), true where the value is not delivered.
    """
    if not withheld.values.any():
        return
    hatched = axes.contourf(
        withheld["x"].values,
        withheld["y"].values,
        withheld.values.astype(float),
        levels=[0.5, 1.5],
        colors="none",
        hatches=["/////"],
    )
    hatched.set_edgecolor(HATCH)
    hatched.set_linewidth(0)


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
    lines = axes.contour(x, y, share, levels=[0.5], colors="white", linewidths=style.points(0.5))
    # A dark casing keeps the line visible on every colour.
    casing = patheffects.withStroke(linewidth=style.points(1.2), foreground="black")
    lines.set_path_effects([casing])
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

    width, height = style.page_mm(figure)
    piece = Line2D([], [], color="white", linewidth=style.points(0.5), label=text)
    casing = patheffects.withStroke(linewidth=style.points(1.2), foreground="black")
    piece.set_path_effects([casing])
    figure.legend(
        handles=[piece],
        loc="lower left",
        bbox_to_anchor=(left_mm / width, bottom_mm / height),
        borderpad=0,
        borderaxespad=0,
    )
