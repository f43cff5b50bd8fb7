"""Fig. 4: the height error as a map and as a histogram, with its statistics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.drawing import declaration, maps, style, thumbnails

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.study.options import Figures

_REGIONS = {
    "delivered": "delivered",
    "whole_scene": "whole scene",
    "visible_ground": "visible ground",
    "shadow": "shadow",
}
_BINS_PER_TOLERANCE = 10
# Beyond this many tolerances a height has failed, by whatever amount.
_HISTOGRAM_TOLERANCES = 20


@style.styled
def draw(products: Products, study: Study) -> Figure:
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
    left, bottom, width = 13.0, 13.0, 60.0
    _, height = maps.fit(error, width, 90)
    height = max(height, 66.0)
    figure = style.new_figure(style.TWO_COLUMNS_MM, bottom + height + 7)

    title = "(a) height error, reconstructed minus true"
    axes = maps.draw_layer(figure, (left, bottom, width, height), layer(accuracy), title)
    maps.hatch(axes, ~accuracy["delivered"] & np.isfinite(error))
    if maps.outline_shadow(axes, accuracy["shadow"]):
        below = bottom + height - style.size_mm(axes)[1] - 11.5
        maps.explain_shadow(figure, left, below, maps.SHADOW_LABEL)

    left, room = 102.0, 73.0
    _histogram(style.place(figure, left, bottom, room, height - 39), accuracy, tolerance)
    left, room = left - 11, room + 11
    style.write_title(
        figure, left, bottom + height, "(b) statistics and histogram of the height error"
    )
    _table(style.place(figure, left, bottom + height - 27, room, 27), accuracy)
    return figure


def layer(accuracy: xr.Dataset) -> maps.Layer:
    """Return the map of the height error, in centimetres up to three tolerances.

    Parameters
    ----------
    accuracy
        Product ``accuracy``.

    Returns
    -------
    maps.Layer
        Values with their colours.
    """
    error = accuracy["height_error"] * 100
    limit = 300 * float(accuracy["tolerance"])
    limits = (-limit, limit)
    return maps.Layer(
        error,
        style.colormap("cmc.vik"),
        limits,
        "height error (cm)",
        maps.beyond(error.values, limits),
    )


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
    return np.linspace(-steps, steps, 2 * steps + 1) * (tolerance / _BINS_PER_TOLERANCE)


def _histogram(axes: Axes, accuracy: xr.Dataset, tolerance: float) -> None:
    error, shadow = accuracy["height_error"].values, accuracy["shadow"].values
    edges = bin_edges(error, tolerance)
    known = np.isfinite(error)
    parts = {
        "whole scene": (known, style.INK),
        "visible ground": (known & ~shadow, style.BLUE),
        "shadow": (known & shadow, style.ORANGE),
        "delivered": (known & accuracy["delivered"].values, style.GREEN),
    }
    most = 1
    for label, (part, colour) in parts.items():
        count, _ = np.histogram(error[part], edges)
        most = max(most, int(count.max()))
        axes.stairs(count, edges * 100, label=label, color=colour, linewidth=0.9, baseline=0.5)
        if label not in {"whole scene", "delivered"}:
            axes.stairs(
                count, edges * 100, color=colour, fill=True, alpha=0.2, linewidth=0, baseline=0.5
            )
    axes.set_yscale("log")
    axes.set_ylim(0.5, most * 4)
    axes.set_xlim(edges[0] * 100, edges[-1] * 100)
    for side in (-1, 1):
        axes.axvline(side * tolerance * 100, color=style.INK, linewidth=0.7, linestyle="--")
    axes.annotate(
        f"± {tolerance * 100:g} cm",
        (tolerance * 100, most * 2.4),
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
    axes.xaxis.set_major_locator(style.round_ticks(9))
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3, borderaxespad=0.2, columnspacing=1.4
    )


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
        ["", "cells", "median", "std", "95th", "max", f"≤ {tolerance:g} cm", "found"],
        ["", "", "cm", "cm", "|e|, cm", "|e|, cm", "%", "%"],
    ]
    for region, name in _REGIONS.items():
        part = accuracy.sel(region=region)
        lengths = [
            written(float(part[key]) * 100, ".2f")
            for key in ("median", "std", "percentile_95_absolute", "maximum_absolute")
        ]
        shares = [
            written(float(part[key]) * 100, ".1f")
            for key in ("fraction_within_tolerance", "fraction_reconstructed")
        ]
        rows.append([name, f"{int(part['cell_count'])}", *lengths, *shares])
    return rows


def written(value: float, form: str) -> str:
    """Return a number as figures write it: a real minus, none before zero, a dash for NaN."""
    if not np.isfinite(value):
        return "–"
    text = f"{value:{form}}"
    return text.replace("-", "" if float(text) == 0 else "−")


def _table(axes: Axes, accuracy: xr.Dataset) -> None:
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    right = (0.0, 0.315, 0.44, 0.535, 0.655, 0.775, 0.90, 1.0)
    for row, level in zip(table_rows(accuracy), (0.88, 0.76, 0.58, 0.42, 0.26, 0.10), strict=True):
        for column, (text, at) in enumerate(zip(row, right, strict=True)):
            axes.text(
                at,
                level,
                text,
                ha="right" if column else "left",
                va="center",
                fontsize=style.points(6.8),
            )
    for level in (0.98, 0.67, 0.0):
        axes.plot([0, 1], [level, level], color=style.INK, linewidth=0.5, clip_on=False)


def numbers(products: Products, study: Study) -> str:
    """Return the statistics of the height error, as a sentence."""
    del study
    accuracy = products["accuracy"]
    whole = accuracy.sel(region="whole_scene")
    visible = accuracy.sel(region="visible_ground")
    tolerance = 100 * float(accuracy["tolerance"])
    return (
        f"{delivered(accuracy)} "
        f"{100 * float(whole['fraction_within_tolerance']):.1f} % of {int(whole['cell_count'])} "
        f"cells are within {tolerance:g} cm; standard deviation {100 * float(whole['std']):.2f} "
        f"cm over the whole scene and {100 * float(visible['std']):.2f} cm on visible ground; "
        f"largest error {100 * float(whole['maximum_absolute']):.1f} cm."
    )


def delivered(accuracy: xr.Dataset) -> str:
    """Return what the heights that are delivered are worth, as a sentence.

    Parameters
    ----------
    accuracy
        Product ``accuracy``.
    """
    part = accuracy.sel(region="delivered")
    tolerance = 100 * float(accuracy["tolerance"])
    return (
        f"{100 * float(part['share_of_scene']):.1f} % of the scene are delivered; of these "
        f"{100 * float(part['fraction_within_tolerance']):.1f} % are within {tolerance:g} cm, the "
        f"largest error is {100 * float(part['maximum_absolute']):.1f} cm (LE90 "
        f"{100 * float(part['percentile_90_absolute']):.1f} cm), and "
        f"{100 * float(part['coverage_1_sigma']):.1f} and "
        f"{100 * float(part['coverage_2_sigma']):.1f} % lie within one and two of their standard "
        "deviations."
    )


def _error(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    limit = 3 * float(product["tolerance"])
    thumbnails.raster(axes, product["height_error"], style.colormap("cmc.vik"), -limit, limit)


FIGURES = {
    "fig4": declaration.Figure(
        draw=draw,
        title="Height error",
        caption=(
            "Reconstructed minus true height as a map, hatched where it is not delivered, its "
            "statistics over what is delivered, the whole scene, visible ground and shadow, and "
            "its histogram."
        ),
        sections=("figures",),
        inputs=("accuracy",),
        numbers=numbers,
    ),
}

THUMBNAILS = {
    "accuracy": thumbnails.Thumbnail("height error", _error),
}
