"""Fig. 2: the misregistration of the two images by the height of the target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.drawing import declaration, maps, style, thumbnails

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.study.options import Figures

# A tenth of a resolution cell is what the paper allows without registration (section 1.3).
_ALLOWED_SHARE = 0.1
_HEIGHT_MM = 88.0


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw Fig. 2.

    Parameters
    ----------
    products
        ``registration``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    curve = "circle" if study.radar.system == "rail" else "ellipse"
    registration = products["registration"]
    figure = style.new_figure(style.TWO_COLUMNS_MM, _HEIGHT_MM)
    lefts, bottoms, width, height = (13.0, 56.5), (53.0, 16.0), 41.0, 29.5
    letters = iter("abcd")
    for ground_axis, bottom in zip(("x", "y"), bottoms, strict=True):
        limit = _limit(registration, ground_axis)
        for target, left in zip(registration["target"].values, lefts, strict=True):
            axes = style.place(figure, left, bottom, width, height)
            _curves(axes, registration, ground_axis, str(target), limit, curve)
            axes.set_title(_title(registration, ground_axis, str(target), next(letters)))
            axes.tick_params(labelbottom=ground_axis == "y", labelleft=target == "near")
            if ground_axis == "y":
                axes.set_xlabel("target height (m)")
            if target == "near":
                axes.set_ylabel(f"error in {ground_axis} (mm)")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="lower left",
        ncols=4,
        bbox_to_anchor=(lefts[0] / style.TWO_COLUMNS_MM, 1.5 / _HEIGHT_MM),
        borderpad=0,
        borderaxespad=0,
        columnspacing=1.4,
    )
    _map(figure, registration, curve)
    return figure


def _limit(registration: xr.Dataset, ground_axis: str) -> float:
    """Return the limit of the error axis of a row of panels, mm: as far as its curves need."""
    part = registration.sel(ground_axis=ground_axis)
    largest = max(float(np.abs(part[name]).max()) for name in ("radial", "equal_path", "measured"))
    bands = _ALLOWED_SHARE * part["resolution"].values
    # The edge of a band a little beyond the curves is worth the room; one far beyond is not.
    near = bands[bands < 1.6 * largest]
    return 1000 * 1.15 * max([largest, 1e-6, *near])


def _curves(
    axes: Axes, registration: xr.Dataset, ground_axis: str, target: str, limit: float, curve: str
) -> None:
    part = registration.sel(ground_axis=ground_axis, target=target)
    height = part["target_height"].values
    allowed = 1000 * _ALLOWED_SHARE * float(part["resolution"])
    axes.axhspan(
        -allowed, allowed, color="#e3ebf2", linewidth=0, zorder=0, label="a tenth of a cell"
    )
    axes.axhline(0, color=style.GREY, linewidth=0.5, zorder=1)
    axes.plot(
        height,
        1000 * part["radial"].values,
        color=style.ORANGE,
        linestyle="--",
        label="radial (Eq. 7)",
    )
    axes.plot(height, 1000 * part["equal_path"].values, color=style.BLUE, label=curve)
    axes.plot(
        height,
        1000 * part["measured"].values,
        color=style.INK,
        linestyle="none",
        marker="o",
        markerfacecolor="none",
        markeredgewidth=0.7,
        label="measured on images",
    )
    axes.set_ylim(-limit, limit)
    margin = 0.04 * (height[-1] - height[0])
    axes.set_xlim(height[0] - margin, height[-1] + margin)
    rises = part["equal_path"].values[-1] >= part["equal_path"].values[0]
    axes.text(
        0.97,
        0.05 if rises else 0.95,
        f"± {allowed:.1f} mm" + ("" if allowed < limit else ",\nbeyond the axis"),
        transform=axes.transAxes,
        ha="right",
        va="bottom" if rises else "top",
    )


def _title(registration: xr.Dataset, ground_axis: str, target: str, letter: str) -> str:
    x, y = registration["target_position"].sel(target=target).values
    return f"({letter}) in {ground_axis}, {target} ({x:g}, {y:g}) m"


def _map(figure: Figure, registration: xr.Dataset, curve: str) -> None:
    """Draw the error by the circle or ellipse over the scene, in tenths of a resolution cell."""
    part = registration.sel(ground_axis="y")
    share = abs(part["map_equal_path"]) / (_ALLOWED_SHARE * part["map_resolution"])
    title = f"(e) in y by the {curve}, height {float(registration['map_height']):g} m"
    axes = maps.place(figure, share, (110, 16, 53, 66.5), title)
    # White is exactly a tenth of a cell: blue needs no registration, red does.
    reach = min(1.0, max(0.1, float(np.ceil(10 * np.nanmax(np.abs(share.values - 1))) / 10)))
    limits = (1 - reach, 1 + reach)
    image = maps.draw(axes, share, colormap=style.colormap("cmc.vik"), limits=limits)
    drawn = maps.beyond(share.values, (1.0, 1.0)) == "both"
    if drawn:
        axes.contour(
            share["x"].values,
            share["y"].values,
            share.values,
            levels=[1.0],
            colors="black",
            linewidths=0.8,
        )
    bar = maps.colorbar(axes, image, "tenths of a cell", extend=maps.beyond(share.values, limits))
    if drawn:
        bar.ax.axhline(1, color="black", linewidth=0.8)


def numbers(products: Products, study: Study) -> str:
    """Return the largest errors that imaged point targets measure, as a sentence."""
    del study
    product = products["registration"]
    parts = []
    for target in product["target"].values:
        at = product["target_position"].sel(target=target).values
        part = product.sel(target=target)
        largest = abs(part["measured"]).max("target_height")
        x, y = (1000 * float(largest.sel(ground_axis=axis)) for axis in ("x", "y"))
        tenth = 100 * float(part["resolution"].sel(ground_axis="y"))
        parts.append(
            f"at ({at[0]:g}, {at[1]:g}) m {y:.1f} mm in y, against a tenth of a cell of "
            f"{tenth:.1f} mm, and {x:.2f} mm in x"
        )
    return f"Largest errors measured: {'; '.join(parts)}."


def _shifts(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    for target, colour in zip(product["target"].values, (style.INK, style.BLUE), strict=False):
        part = product["measured"].sel(ground_axis="y", target=target)
        axes.plot(product["target_height"].values, part.values, color=colour)


FIGURES = {
    "fig2": declaration.Figure(
        draw=draw,
        title="Misregistration",
        caption=(
            "Shift between the images of a raised target against its height, near and far: Eqs. "
            "6-7 as printed, the points of equal path and slope (a circle around a rail's axis, "
            "an ellipse for an array), and measured on images of point targets. The band is a "
            "tenth of a resolution cell."
        ),
        sections=("figures", "radar"),
        inputs=("registration",),
        numbers=numbers,
    ),
}

THUMBNAILS = {
    "registration": thumbnails.Thumbnail("shift between the images by target height", _shifts),
}
