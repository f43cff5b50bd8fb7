"""The images alone, with surveyed reflectors and cuts through them: all that one channel gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.chain import amplitude
from vinsar.figures.drawing import declaration, maps, style, thumbnails

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.study.options import Figures

_LOWEST_DB = -40.0

# Of more reflectors than these the numbers tell.
_SHOWN = 3

_LEFT_MM, _PITCH_MM, _TITLE_MM = 12.5, 84.0, 7.0


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the images of the first two channels, with surveyed reflectors.

    Parameters
    ----------
    products
        ``images``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    images = products["images"]["image"]
    names = [str(name) for name in images["channel"].values][:2]
    width = 56.0 if len(names) == 1 else 62.0
    _, height = maps.fit(images[0], width, 90.0)
    page = style.ONE_COLUMN_MM if len(names) == 1 else style.TWO_COLUMNS_MM
    figure = style.new_figure(page, 10.0 + height + _TITLE_MM)
    for number, name in enumerate(names):
        title = f"({'ab'[number]}) image of the {name} antenna"
        if len(names) == 1:
            title = "image; of one channel there is no height"
        axes = maps.draw_layer(
            figure,
            (_LEFT_MM + _PITCH_MM * number, 10.0, width, height),
            amplitude(name, products, study),
            title,
            label_y=number == 0,
        )
        for place in study.measurement.reflectors:
            axes.plot(
                place.x_m, place.y_m, marker="o", markersize=style.points(7),
                markerfacecolor="none", markeredgecolor=style.ORANGE,
                markeredgewidth=style.points(0.9),
            )  # fmt: skip
    return figure


@style.styled
def draw_reflectors(products: Products, study: Study) -> Figure:
    """Draw cuts through surveyed reflectors, along x and y.

    Parameters
    ----------
    products
        ``reflectors``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del study
    figure = style.new_figure(style.TWO_COLUMNS_MM, 60.0)
    for number, axis in enumerate("xy"):
        left = _LEFT_MM + _PITCH_MM * number
        axes = style.place(figure, left, 10.0, 76.0, 43.0)
        _cuts(axes, products["reflectors"], number)
        style.write_title(figure, left, 53.0, f"({'ab'[number]}) cuts along {axis}")
    return figure


def _cuts(axes: Axes, reflectors: xr.Dataset, axis: int) -> None:
    offset = reflectors["cell_offset"].values
    for number in range(min(_SHOWN, reflectors.sizes["reflector"])):
        cut = reflectors["cut"].values[0, number, axis]
        axes.plot(
            offset,
            20 * np.log10(np.maximum(cut, 1e-6)),
            color=(style.BLUE, style.ORANGE, style.GREY)[number],
            label=f"reflector {number + 1}",
        )
    axes.axvline(0, color=style.GREY, linestyle=":", linewidth=style.points(0.8))
    axes.set_xlim(offset[0], offset[-1])
    axes.set_ylim(_LOWEST_DB, 2)
    axes.set_xlabel("offset from the survey (resolution cells)")
    if axis == 0:
        axes.set_ylabel("amplitude (dB)")
        axes.legend(loc="upper left")


def _numbers(products: Products, study: Study) -> str:
    del study
    reflectors = products["reflectors"]
    parts = []
    for number, place in enumerate(reflectors["surveyed"].values):
        shift = 100 * (reflectors["imaged"].values[0, number] - place[:2])
        width = 100 * reflectors["width"].values[0, number]
        expected = 100 * reflectors["expected_width"].values[number]
        parts.append(
            f"Reflector {number + 1} lies {shift[0]:+.1f} cm in x and {shift[1]:+.1f} cm in y from "
            f"its survey, {width[0]:.1f} x {width[1]:.1f} cm wide at -3 dB (a point target: "
            f"{expected[0]:.1f} x {expected[1]:.1f} cm)."
        )
    return " ".join(parts)


def _points(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    offset = product["cell_offset"].values
    for axis, color in ((0, style.BLUE), (1, style.ORANGE)):
        cut = product["cut"].values[0, 0, axis]
        axes.plot(offset, 20 * np.log10(np.maximum(cut, 1e-6)), color=color)
    axes.set_ylim(_LOWEST_DB, 2)


FIGURES = {
    "images": declaration.Figure(
        draw=draw,
        title="Images",
        caption=(
            "The images, relative to their brightest pixel, with surveyed reflectors (circles). "
            "One channel has no interferogram and gives no height."
        ),
        sections=("figures", "measurement"),
        inputs=("images",),
    ),
    "reflectors": declaration.Figure(
        draw=draw_reflectors,
        title="Surveyed reflectors",
        caption=(
            "Cuts through the brightest pixel near each surveyed reflector, in the plane of its "
            "height, of the first channel; the dotted line is the survey."
        ),
        sections=("figures",),
        inputs=("reflectors",),
        numbers=_numbers,
    ),
}

THUMBNAILS = {
    "reflectors": thumbnails.Thumbnail("cuts through a surveyed reflector, in x and y", _points),
}
