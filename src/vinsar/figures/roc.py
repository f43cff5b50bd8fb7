"""How often obstacles and holes are found, against false alarms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.evaluation import detection_accuracy
from vinsar.figures import obstacles
from vinsar.figures.drawing import declaration, style, sweeps, thumbnails
from vinsar.foundations import variables
from vinsar.foundations.configuration import swept_section
from vinsar.processing import detection

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.processing.detection import Detection
    from vinsar.simulation.scene import SceneObject

_HEIGHT = [
    sweeps.Look("", style.BLUE, "-", "o"),
    sweeps.Look("", style.BLUE, style.DASHED, "s"),
    sweeps.Look("", style.BLUE, style.DOTTED, "^"),
]
_AMPLITUDE = sweeps.Look("image alone", style.ORANGE, style.DASH_DOTTED, "D")
_DISTANCES = [
    sweeps.Look("", style.INK, "-", "o"),
    sweeps.Look("", style.BLUE, style.DASHED, "s"),
    sweeps.Look("", style.ORANGE, style.DASH_DOTTED, "^"),
]


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw detection against false alarms, detection against height, and what holes become.

    Parameters
    ----------
    products
        ``sweeps/roughness``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    key = "scene_roughness_std_m"
    sweep = variables.swept(products[f"sweeps/{detection_accuracy.SWEEP}"], key).sortby(key)
    options = swept_section(study, detection_accuracy.SWEEP, "detection")
    middle = sweep.isel({key: sweep.sizes[key] // 2})
    sunk = int((middle["object_height"].isel(realization=0) < 0).sum())
    bottom = 30.0 + 5.0 * sunk
    figure = style.new_figure(style.TWO_COLUMNS_MM, bottom + 70.0)
    _draw_curves(style.place(figure, 13.0, bottom, 72.0, 63.0), sweep, options)
    _draw_by_height(style.place(figure, 104.0, bottom, 72.0, 63.0), middle, options)
    if sunk:
        objects = swept_section(study, detection_accuracy.SWEEP, "scene").objects
        _draw_holes(style.place(figure, 58.0, 13.0, 118.0, 5.0 * sunk), middle, objects)
    return figure


def _draw_curves(axes: Axes, sweep: xr.Dataset, options: Detection) -> None:
    key = "scene_roughness_std_m"
    most = 1.0
    for number, look in enumerate(_HEIGHT[: sweep.sizes[key]]):
        case = sweep.isel({key: number})
        curve = detection_accuracy.curves(case, options.threshold_m)["height"]
        label = f"heights, {100 * float(case[key]):g} cm"
        _curve(axes, curve, look, label)
        at = int(np.abs(curve.threshold - options.threshold_m).argmin())
        axes.plot(
            curve.false_alarms[at], curve.probability[at], marker="*", markersize=8,
            color=look.colour, markeredgecolor="white", markeredgewidth=0.5, zorder=5,
        )  # fmt: skip
        most = max(most, float(curve.false_alarms.max()))
    middle = sweep.isel({key: sweep.sizes[key] // 2})
    curve = detection_accuracy.curves(middle, options.threshold_m)["amplitude"]
    _curve(axes, curve, _AMPLITUDE, f"image alone, {100 * float(middle[key]):g} cm")
    most = max(most, float(curve.false_alarms.max()))
    axes.axhline(detection_accuracy.WANTED, color=style.GREY, linestyle=":", linewidth=0.8)
    axes.set_xscale("symlog", linthresh=0.1, linscale=0.4)
    axes.set_xlim(-0.015, 1.6 * most)
    axes.set_ylim(0, 1.03)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("false alarms on 100 m²")
    axes.set_ylabel("probability of detection")
    axes.set_title(f"(a) obstacles of {100 * options.threshold_m:g} cm and more")
    mark = f"threshold of {100 * options.threshold_m:g} cm"
    axes.plot([], [], linestyle="", marker="*", markersize=7, color=_HEIGHT[0].colour, label=mark)
    axes.legend(
        title="detector, roughness", loc="center left", bbox_to_anchor=(0.05, 0.42),
        alignment="left",
    )  # fmt: skip


def _curve(axes: Axes, curve: detection_accuracy.Curve, look: sweeps.Look, label: str) -> None:
    axes.plot(
        curve.false_alarms, curve.probability, color=look.colour, linestyle=look.line,
        marker=look.marker, markersize=2.5, markerfacecolor="white", markeredgewidth=0.6,
        label=label,
    )  # fmt: skip


def _draw_by_height(axes: Axes, case: xr.Dataset, options: Detection) -> None:
    first = case.isel(realization=0)
    height, distance = first["object_height"].values, first["object_y"].values
    at = case["height_found"].sel(height_threshold=options.threshold_m, method="nearest")
    found = at.mean("realization").values
    raised = {y: np.nonzero((distance == y) & (height > 0))[0] for y in np.unique(distance)}
    rows = [(y, chosen) for y, chosen in raised.items() if np.unique(height[chosen]).size > 1]
    for (y, chosen), look in zip(rows, _DISTANCES, strict=False):
        order = chosen[np.argsort(height[chosen])]
        axes.plot(
            100 * height[order], found[order], color=look.colour, linestyle=look.line,
            marker=look.marker, markerfacecolor="white", label=f"{y:g} m ahead",
        )  # fmt: skip
    axes.axvline(100 * options.threshold_m, color=style.GREY, linestyle=":", linewidth=0.8)
    axes.set_xlim(0, None)
    axes.set_ylim(0, 1.03)
    axes.set_xlabel("height of the obstacle (cm)")
    axes.set_ylabel("probability of detection")
    axes.set_title(f"(b) detection at a threshold of {100 * options.threshold_m:g} cm")
    if rows:
        axes.legend(loc="lower right")


def _draw_holes(axes: Axes, case: xr.Dataset, objects: tuple[SceneObject, ...]) -> None:
    mean = case.mean("realization")
    holes = np.array([n for n, part in enumerate(objects) if hasattr(part, "depth_m")])[::-1]
    unknown, free = (mean[name].values[holes] for name in ("object_unknown", "object_free"))
    shares = {
        detection.HOLE: 1 - unknown - free,
        detection.UNKNOWN: unknown,
        detection.FREE: free,
    }
    left = np.zeros(holes.size)
    for kind, share in shares.items():
        label, colour = obstacles.CLASSES[kind]
        label = "hole or obstacle" if kind == detection.HOLE else label
        axes.barh(
            np.arange(holes.size), 100 * share, left=100 * left, height=0.7, color=colour,
            edgecolor=style.GREY, linewidth=0.5, label=label,
        )  # fmt: skip
        left += share
    axes.set_yticks(np.arange(holes.size), [_describe(objects[n]) for n in holes])
    axes.set_xlim(0, 100)
    axes.set_xlabel("share of the hole's ground on the map (%)")
    axes.set_title("(c) what the map says of holes")
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, borderaxespad=0.2)


def _describe(part: Any) -> str:
    length = part.diameter_m if hasattr(part, "diameter_m") else part.size_y_m
    return f"{part.shape}, {length:g} m long, {100 * part.depth_m:g} cm deep, at {part.y_m:g} m"


FIGURES = {
    "roc": declaration.Figure(
        draw=draw,
        title="Detection and false alarms",
        caption=(
            "Probability of detection against false alarms for the heights and for the image "
            "alone, over realizations of speckle, noise and ground; detection against the "
            "obstacle's height at three distances; and the classes that the map gives to holes."
        ),
        sections=("figures", "scene", "detection", "sweeps"),
        sweeps=(detection_accuracy.SWEEP,),
    ),
}

THUMBNAILS = {
    "detection_accuracy": thumbnails.Thumbnail("what is found, missed and falsely alarmed"),
}
