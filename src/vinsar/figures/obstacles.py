"""Obstacles and holes on a map: where they are, and what is found of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures import chain
from vinsar.figures.drawing import declaration, maps, style, sweeps, thumbnails
from vinsar.processing import detection

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.study.options import Figures

CLASSES = {
    detection.FREE: ("free", "#f2f2ee"),
    detection.OBSTACLE: ("obstacle", style.ORANGE),
    detection.HOLE: ("hole", style.BLUE),
    detection.UNKNOWN: ("unknown", "#9a9fa4"),
}
"""How the classes of the map are called and coloured."""

_PATCH = "#35a7e8"
_LEAST_RANGE_M = 0.05


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the scene, an image, the reconstructed heights, and the map of what is found.

    Parameters
    ----------
    products
        ``truth``, ``images``, ``dem``, ``detections``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    truth, found = products["truth"]["height"], products["detections"]
    top = max(_LEAST_RANGE_M, float(np.nanmax(truth)))
    colours = style.colormap(study.figures.height_colormap, "figures.height_colormap")
    width = 57.0
    _, tall = maps.fit(truth, width, 88)
    rows = (22.0 + tall + 17.0, 22.0)
    figure = style.new_figure(style.TWO_COLUMNS_MM, rows[0] + tall + 7)
    boxes = [(left, bottom, width, tall) for bottom in rows for left in (13.0, 104.0)]

    for box, data, title in (
        (boxes[0], truth, "(a) true height"),
        (boxes[2], products["dem"]["height"], "(c) reconstructed height"),
    ):
        axes = maps.place(figure, data, box, title)
        image = maps.draw(axes, 100 * data, colormap=colours, limits=(-100 * top, 100 * top))
        ends = maps.beyond(data.values, (-top, top))
        maps.colorbar(axes, image, "height (cm)", extend=ends)
        if data is not truth:
            maps.hatch(axes, chain.withheld(products["dem"]))
        _outline(axes, study.scene.objects)

    contrast = found["contrast"]
    power = contrast.copy(data=10 * np.log10(np.maximum(contrast.values, 1e-4)))
    axes = maps.place(figure, power, boxes[1], "(b) power of the images over its surroundings")
    limits = (-10.0, 10.0)
    image = maps.draw(axes, power, colormap=style.colormap("gray"), limits=limits)
    maps.colorbar(axes, image, "power ratio (dB)", extend=maps.beyond(power.values, limits))
    _outline(axes, study.scene.objects)
    _outline(axes, study.scene.patches, _PATCH, linestyle=(0, (3, 1.5)))
    if found["bright"].values.any():
        axes.contour(
            found["x"], found["y"], found["bright"], levels=[0.5], colors=style.ORANGE, linewidths=1
        )

    from matplotlib.colors import ListedColormap

    axes = maps.place(figure, found["map_class"], boxes[3], "(d) map of what is found")
    palette = ListedColormap([colour for _, colour in CLASSES.values()])
    maps.draw(axes, found["map_class"], colormap=palette, limits=(-0.5, 3.5))
    _outline(axes, study.scene.objects)
    _explain(figure)
    return figure


def _outline(axes: Axes, parts: Any, colour: str = "black", linestyle: Any = "-") -> None:
    from matplotlib import patheffects
    from matplotlib.patches import Circle, Rectangle

    look: dict[str, Any] = {"fill": False, "edgecolor": colour, "linestyle": linestyle}
    # A light casing keeps the line visible on dark ground.
    casing = [patheffects.withStroke(linewidth=1.6, foreground="white")]
    look |= {"linewidth": 0.8, "path_effects": casing if colour == "black" else None}
    for part in parts:
        if hasattr(part, "diameter_m"):
            axes.add_patch(Circle((part.x_m, part.y_m), part.diameter_m / 2, **look))
        else:
            corner = (part.x_m - part.size_x_m / 2, part.y_m - part.size_y_m / 2)
            axes.add_patch(
                Rectangle(
                    corner,
                    part.size_x_m,
                    part.size_y_m,
                    angle=part.rotation_deg,
                    rotation_point="center",
                    **look,
                )
            )


def _explain(figure: Figure) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color="black", linewidth=0.8, label="true obstacle or hole"),
        Line2D([], [], color=_PATCH, linewidth=0.8, linestyle=(0, (3, 1.5)), label="bright patch"),
        Line2D([], [], color=style.ORANGE, linewidth=1, label="alarm of the image alone"),
    ]
    handles += [
        Patch(facecolor=colour, edgecolor=style.GREY, linewidth=0.5, label=label)
        for label, colour in CLASSES.values()
    ]
    sweeps.legend(figure, handles, 13.0, 2.0, 4)


def _above_ground(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    thumbnails.heights(axes, product["height_above_ground"], options)


FIGURES = {
    "obstacles": declaration.Figure(
        draw=draw,
        title="Obstacles and holes",
        caption=(
            "Rough ground with obstacles and holes, among bright patches: true height, power of "
            "the images over its surroundings with the alarms of a detector on it alone, "
            "reconstructed height, and the map that follows from the heights, with unknown "
            "ground."
        ),
        sections=("figures", "scene"),
        inputs=("truth", "dem", "detections"),
    ),
}

THUMBNAILS = {
    "detections": thumbnails.Thumbnail("height above the ground found", _above_ground),
}
