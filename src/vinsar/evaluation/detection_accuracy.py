"""How well obstacles and holes are found: the detectors held against the objects of the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import tables, variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.processing.detection import FREE, UNKNOWN, pixel_area, regions, spacings
from vinsar.simulation import scene

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.processing.detection import Detection
    from vinsar.simulation.scene import SceneObject

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

HEIGHT_THRESHOLDS = np.round(np.arange(0.01, 0.401, 0.01), 2)
"""Thresholds of the height detector's ROC, m."""

AMPLITUDE_THRESHOLDS = 10 ** (np.arange(0.5, 15.01, 0.5) / 10)
"""Thresholds of the 2-D detector's ROC: power ratios of 0.5 to 15 dB."""

WANTED = 0.9
"""Probability of detection at which false alarms are compared."""

SWEEP = "roughness"
"""The sweep over the roughness of the ground in which the tables and the figure look."""

# Heights closer than this are the same.
_SLACK_M = 1e-9


_OBJECT = ("object",)

VARIABLES = {
    "object_x": Variable(_OBJECT, "real", "m", "centre of the object along x"),
    "object_y": Variable(_OBJECT, "real", "m", "centre of the object along y"),
    "object_height": Variable(
        _OBJECT, "real", "m", "height of the object", "negative for a ditch or pit"
    ),
    "height_found": Variable(
        ("height_threshold", "object"),
        "flag",
        "1",
        "object found by the height detector",
        flag_meanings="missed found",
    ),
    "height_false_alarms": Variable(
        ("height_threshold",), "integer", "1", "false alarms of the height detector"
    ),
    "amplitude_found": Variable(
        ("amplitude_threshold", "object"),
        "flag",
        "1",
        "object found by the 2-D detector",
        flag_meanings="missed found",
    ),
    "amplitude_false_alarms": Variable(
        ("amplitude_threshold",), "integer", "1", "false alarms of the 2-D detector"
    ),
    "object_unknown": Variable(
        _OBJECT, "real", "1", "share of the object's ground that the map has as unknown"
    ),
    "object_free": Variable(
        _OBJECT, "real", "1", "share of the object's ground that the map has as free"
    ),
    "shadow_unknown": Variable(
        (), "real", "1", "share of the true shadow that the map has as unknown"
    ),
    "visible_unknown": Variable(
        (), "real", "1", "share of visible ground beside objects that the map has as unknown"
    ),
    "scene_area": Variable((), "real", "m2", "area of the map"),
}
"""Variables of the product ``detection_accuracy``."""

variables.declare(
    "detection_accuracy",
    VARIABLES,
    coordinates={
        "object": Variable(("object",), "integer", "1", "number of the object of the scene"),
        "height_threshold": Variable(
            ("height_threshold",), "real", "m", "threshold of the height detector"
        ),
        "amplitude_threshold": Variable(
            ("amplitude_threshold",), "real", "1", "threshold of the 2-D detector, a power ratio"
        ),
    },
    statistics=True,
)


def evaluate(
    detections: xr.Dataset,
    truth: xr.Dataset,
    objects: Sequence[SceneObject],
    *,
    options: Detection,
) -> xr.Dataset:
    """Count found objects and false alarms over the thresholds of both detectors.

    An object is found if an alarm of its sign lies on it or within a multilook window of it; to the
    2-D detector, which knows no heights, any alarm will do. A false alarm is a connected area that
    touches no object so grown. Relief of the terrain itself is no object.

    Parameters
    ----------
    detections, truth
        Products of these names, on one grid.
    objects
        The objects of the scene.
    options
        Section ``detection`` of the configuration.

    Returns
    -------
    xarray.Dataset
        Product ``detection_accuracy``.
    """
    x, y = detections["x"].values, detections["y"].values
    footprints = [_footprint(part, x, y) for part in objects]
    reach = [
        int(np.ceil(options.multilook_window_m / spacing - 1e-6))
        for spacing in spacings(x, y)[::-1]
    ]
    grown = [_grow(mask, reach) for mask in footprints]
    anywhere = np.any([np.zeros((y.size, x.size), bool), *grown], axis=0)
    least = options.minimum_area_m2 / pixel_area(x, y)
    signs = [1 if part.shape in {"box", "stump", "mound"} else -1 for part in objects]

    def count(masks: dict[int, Flags]) -> tuple[list[bool], int]:
        areas = {sign: regions(mask, least) for sign, mask in masks.items()}
        found = [
            bool(areas[sign if sign in areas else 0][0][mask].any())
            for sign, mask in zip(signs, grown, strict=True)
        ]
        false = sum(
            number - np.unique(labelled[anywhere & (labelled > 0)]).size
            for labelled, number in areas.values()
        )
        return found, false

    height, contrast = detections["significant_height"].values, detections["contrast"].values
    by_height = [count({1: height > level, -1: height < -level}) for level in HEIGHT_THRESHOLDS]
    by_amplitude = [count({0: contrast > level}) for level in AMPLITUDE_THRESHOLDS]
    kind = detections["map_class"].values
    shadow, exists = truth["shadow"].values, np.isfinite(truth["height"].values)
    return variables.dataset(
        "detection_accuracy",
        {
            "object_x": np.array([part.x_m for part in objects], float),
            "object_y": np.array([part.y_m for part in objects], float),
            "object_height": np.array([_height(part) for part in objects], float),
            "height_found": _flags([found for found, _ in by_height], len(objects)),
            "height_false_alarms": np.array([false for _, false in by_height]),
            "amplitude_found": _flags([found for found, _ in by_amplitude], len(objects)),
            "amplitude_false_alarms": np.array([false for _, false in by_amplitude]),
            "object_unknown": np.array([_share(kind == UNKNOWN, mask) for mask in footprints]),
            "object_free": np.array([_share(kind == FREE, mask) for mask in footprints]),
            "shadow_unknown": _share(kind == UNKNOWN, shadow),
            "visible_unknown": _share(kind == UNKNOWN, exists & ~shadow & ~anywhere),
            "scene_area": exists.sum() * pixel_area(x, y),
        },
        {"height_threshold": HEIGHT_THRESHOLDS, "amplitude_threshold": AMPLITUDE_THRESHOLDS},
    )


def _footprint(part: SceneObject, x: Floats, y: Floats) -> Flags:
    mask = scene.relief(part, x[None, :], y[:, None]) != 0
    # The cell of its centre, at least.
    mask[np.abs(y - part.y_m).argmin(), np.abs(x - part.x_m).argmin()] = True
    return mask


def _grow(mask: Flags, cells: list[int]) -> Flags:
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(mask, np.ones([2 * count + 1 for count in cells], bool)))


def _height(part: SceneObject) -> float:
    return -part.depth_m if part.shape == "ditch" or part.shape == "pit" else part.height_m


def _flags(rows: list[list[bool]], objects: int) -> Flags:
    return np.array(rows, bool).reshape(len(rows), objects)


def _share(mask: Flags, where: Flags) -> float:
    return float(mask[where].mean()) if where.any() else np.nan


@dataclass(frozen=True)
class Curve:
    """A detector's ROC over the realizations of a case.

    Attributes
    ----------
    threshold
        Thresholds, m or power ratios, rising.
    probability
        Share of the objects that are found, by threshold.
    false_alarms
        Mean number of false alarms on 100 m2, by threshold.
    """

    threshold: Floats
    probability: Floats
    false_alarms: Floats

    def at(self, probability: float) -> tuple[float, float] | None:
        """Return the highest threshold that finds so many, and its false alarms on 100 m2."""
        enough = np.nonzero(self.probability >= probability)[0]
        if not enough.size:
            return None
        return float(self.threshold[enough[-1]]), float(self.false_alarms[enough[-1]])


def curves(case: xr.Dataset, least_height_m: float) -> dict[str, Curve]:
    """Return the ROC of both detectors for obstacles above ground.

    Parameters
    ----------
    case
        One case of a sweep over a scene with objects: product ``sweep`` without swept keys.
    least_height_m
        Height from which an obstacle counts, m.

    Returns
    -------
    dict of Curve
        For ``height`` and ``amplitude``.
    """
    counts = case["object_height"].isel(realization=0).values >= least_height_m - _SLACK_M
    result = {}
    for name in ("height", "amplitude"):
        found = case[f"{name}_found"].mean("realization").transpose(..., "object").values
        false = case[f"{name}_false_alarms"] / case["scene_area"]
        probability = found[:, counts].mean(axis=1) if counts.any() else np.full(len(found), np.nan)
        result[name] = Curve(
            case[f"{name}_threshold"].values, probability, 100 * false.mean("realization").values
        )
    return result


def as_markdown(sweep: xr.Dataset, objects: Sequence[SceneObject], options: Detection) -> str:
    """Return what a sweep over a scene with objects found, as tables in Markdown.

    Parameters
    ----------
    sweep
        Product ``sweep`` over one key.
    objects
        The objects of its scene.
    options
        Section ``detection`` of the configuration; its threshold is the operating point.

    Returns
    -------
    str
        False alarms where 90 % are found, detection by object, and what the map says of each.
    """
    key = str(sweep["height_found"].dims[0])
    cases = [sweep.isel({key: number}) for number in range(sweep.sizes[key])]
    label = sweep[key].attrs["long_name"]
    least = 100 * options.threshold_m
    rows: list[tuple[str, ...]] = []
    for case in cases:
        both = curves(case, options.threshold_m)
        at = int(np.abs(both["height"].threshold - options.threshold_m).argmin())
        rows.append(
            (
                f"{float(case[key]):g}",
                _reached(both["height"], _metres),
                _reached(both["amplitude"], _decibels),
                f"{both['height'].false_alarms[at]:.2g}",
                f"{100 * both['height'].probability[at]:.1f} %",
            )
        )
    lines = [
        f"False alarms on 100 m2 where {100 * WANTED:g} % of the obstacles of {least:g} cm and "
        f"more are found, with the threshold, and on the heights at {least:g} cm:",
        "",
        tables.write(
            (label, "heights", "image alone", f"heights at {least:g} cm", "found there"), rows
        ),
        "",
        f"Probability of detection on the heights at {least:g} cm by {label}, and shares of the "
        f"object's ground on the map at {label} = {float(cases[len(cases) // 2][key]):g}:",
        "",
    ]
    rows = []
    mean = cases[len(cases) // 2].mean("realization")
    for number, part in enumerate(objects):
        found = [
            float(
                case["height_found"]
                .sel(height_threshold=options.threshold_m, method="nearest")
                .isel(object=number)
                .mean()
            )
            for case in cases
        ]
        unknown, free = (float(mean[f"object_{name}"][number]) for name in ("unknown", "free"))
        shares = (*found, abs(1 - unknown - free), unknown, free)
        named = (part.shape, f"{_height(part):g}", f"{part.y_m:g}")
        rows.append((*named, *(f"{share:.2f}" for share in shares)))
    heads = [f"{float(case[key]):g}" for case in cases]
    lines += [
        tables.write(
            ("object", "height (m)", "at y (m)", *heads, "alarm", "unknown", "free"), rows
        ),
        "",
        f"Of the true shadow the map has {100 * float(mean['shadow_unknown']):.0f} % as unknown, "
        f"of visible ground beside objects {100 * float(mean['visible_unknown']):.1f} %. "
        f"{sweep.sizes['realization']} realizations of {float(mean['scene_area']):.0f} m2.",
    ]
    return "\n".join(lines) + "\n"


def _metres(threshold: float) -> str:
    return f"{100 * threshold:.0f} cm"


def _decibels(threshold: float) -> str:
    return f"{10 * np.log10(threshold):.1f} dB"


def _reached(curve: Curve, write: Callable[[float], str]) -> str:
    point = curve.at(WANTED)
    return "not reached" if point is None else f"{point[1]:.2g} at {write(point[0])}"


def _detection_accuracy(products: Products, study: Study) -> xr.Dataset:
    return evaluate(
        products["detections"],
        products["truth"],
        study.scene.objects,
        options=study.detection,
    )


STAGES = {
    "detection_accuracy": Stage(
        _detection_accuracy, inputs=("detections", "truth"), sections=("scene.objects", "detection")
    ),
}
