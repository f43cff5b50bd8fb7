"""Fig. 4: the height error as a map and as a histogram, with its statistics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures import maps, style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar import config
    from vinsar.pipeline import Products

_REGIONS = {"whole_scene": "whole scene", "visible_ground": "visible ground", "shadow": "shadow"}
_BINS_PER_TOLERANCE = 10
# Beyond this many tolerances a height has failed, and its size says no more.
_HISTOGRAM_TOLERANCES = 20


@style.styled
def draw(products: Products, study: config.Study) -> Figure:
    """Draw Fig. 4.

    Parameters
    ----------
    products
        ``accuracy``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del study
    accuracy = products["accuracy"]
    error = accuracy["height_error"]
    tolerance = float(accuracy["tolerance"])
    limit = 3 * tolerance
    width, height = maps.fit(error, 62, 90)
    figure = style.new_figure(style.TWO_COLUMNS_MM, height + 20)

    axes = style.place(figure, 11, 13, width, height)
    image = maps.draw(
        axes,
        error * 100,
        colormap=style.colormap("cmc.vik"),
        limits=(-limit * 100, limit * 100),
    )
    axes.set_title("(a) height error, reconstructed minus true")
    maps.colorbar(
        axes,
        image,
        "height error (cm)",
        extend=maps.beyond(error.values, (-limit, limit)),
        ticks=[step * tolerance * 100 for step in range(-3, 4)],
    )
    if maps.outline_shadow(axes, accuracy["shadow"]):
        maps.explain_shadow(figure, 11, 1.5, maps.SHADOW_LABEL)

    left = 11 + width + 29
    room = style.TWO_COLUMNS_MM - left - 3
    histogram = style.place(figure, left, 13, room, height - 27)
    _histogram(histogram, accuracy, tolerance)
    table = style.place(figure, left - 8, 13 + height - 22, room + 8, 22)
    _table(table, accuracy)
    return figure


def bin_edges(error: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the edges of the histogram's bins, symmetric, with the tolerance on an edge.

    Parameters
    ----------
    error
        Height errors, m; NaN where there is none.
    tolerance
        Error that counts as within, m.

    Returns
    -------
    ndarray
        Edges, m: as far as the errors go, at least 2 and at most 20 tolerances.
    """
    worst = float(np.nanmax(np.abs(error), initial=0))
    reach = min(max(np.ceil(worst / tolerance), 2), _HISTOGRAM_TOLERANCES)
    steps = int(reach) * _BINS_PER_TOLERANCE
    return np.arange(-steps, steps + 1) * (tolerance / _BINS_PER_TOLERANCE)


def _histogram(axes: Axes, accuracy: xr.Dataset, tolerance: float) -> None:
    error, shadow = accuracy["height_error"].values, accuracy["shadow"].values
    edges = bin_edges(error, tolerance)
    known = np.isfinite(error)
    parts = {
        "whole scene": (known, style.INK),
        "visible ground": (known & ~shadow, style.BLUE),
        "shadow": (known & shadow, style.ORANGE),
    }
    most = 1
    for label, (part, colour) in parts.items():
        count, _ = np.histogram(error[part], edges)
        most = max(most, int(count.max()))
        axes.stairs(count, edges * 100, label=label, color=colour, linewidth=0.9, baseline=0.5)
        if label != "whole scene":
            axes.stairs(
                count, edges * 100, color=colour, fill=True, alpha=0.2, linewidth=0, baseline=0.5
            )
    axes.set_yscale("log")
    axes.set_ylim(0.5, most * 8)
    axes.set_xlim(edges[0] * 100, edges[-1] * 100)
    for side in (-1, 1):
        axes.axvline(side * tolerance * 100, color=style.INK, linewidth=0.7, linestyle="--")
    axes.annotate(
        f"± {tolerance * 100:g} cm",
        (tolerance * 100, most * 5),
        (3, 0),
        textcoords="offset points",
        va="center",
    )
    outside = int((np.abs(error[known]) > edges[-1]).sum())
    if outside:
        axes.text(
            0.99,
            0.7,
            f"{outside} cells beyond\n± {edges[-1] * 100:g} cm",
            transform=axes.transAxes,
            ha="right",
            va="top",
        )
    axes.set_xlabel("height error (cm)")
    axes.set_ylabel(f"cells per {tolerance / _BINS_PER_TOLERANCE * 1000:g} mm")
    axes.legend(loc="upper left", borderaxespad=0.3)


def table_rows(accuracy: xr.Dataset) -> list[list[str]]:
    """Return the statistics as Fig. 4 writes them.

    Parameters
    ----------
    accuracy
        Product ``accuracy``.

    Returns
    -------
    list of list of str
        Headings, units, then a row for each region; lengths in centimetres, shares in per cent.
    """
    tolerance = float(accuracy["tolerance"]) * 100
    rows = [
        ["", "cells", "median", "std", "95th |e|", "max |e|", f"≤ {tolerance:g} cm", "found"],
        ["", "", "cm", "cm", "cm", "cm", "%", "%"],
    ]
    for region, name in _REGIONS.items():
        part = accuracy.sel(region=region)
        lengths = [
            _written(float(part[key]) * 100, ".2f")
            for key in ("median", "std", "percentile_95_absolute", "maximum_absolute")
        ]
        shares = [
            _written(float(part[key]) * 100, ".1f")
            for key in ("fraction_within_tolerance", "fraction_reconstructed")
        ]
        rows.append([name, f"{int(part['cell_count'])}", *lengths, *shares])
    return rows


def _written(value: float, form: str) -> str:
    return f"{value:{form}}".replace("-", "−") if np.isfinite(value) else "–"


def _table(axes: Axes, accuracy: xr.Dataset) -> None:
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    axes.set_title("(b) statistics and histogram of the height error")
    right = (0.0, 0.33, 0.445, 0.535, 0.665, 0.78, 0.90, 1.0)
    for row, level in zip(table_rows(accuracy), (0.86, 0.72, 0.50, 0.30, 0.10), strict=True):
        for column, (text, at) in enumerate(zip(row, right, strict=True)):
            axes.text(at, level, text, ha="right" if column else "left", va="center", fontsize=6.8)
    for level in (0.98, 0.62, 0.0):
        axes.plot([0, 1], [level, level], color=style.INK, linewidth=0.5)
