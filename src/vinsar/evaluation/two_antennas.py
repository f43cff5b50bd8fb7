"""What further antennas settle: heights by the lower and upper antenna alone, beside by all.

Both have the same filtered phase; shorter baselines (`vinsar.processing.cycles`) add whole cycles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing import height, interferogram, unwrapping
from vinsar.radar import grid, waveform
from vinsar.radar.instrument import Instrument
from vinsar.simulation import scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.simulation.scene import SceneObject

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]

# Ground this close to an object has heights that filter and resolution cell mix with it.
_BESIDE_M = 0.3

_OBJECT = ("antenna_count", "object")

variables.declare(
    "two_antennas",
    {
        "height": Variable(
            ("antenna_count", *GRID), "real", "m", "height by so many antennas, whatever its class"
        ),
        "top_height": Variable(
            _OBJECT, "real", "m", "median height over the object's visible ground"
        ),
        "true_top_height": Variable(("object",), "real", "m", "the same of the true heights"),
        "top_wrong": Variable(
            _OBJECT, "real", "1", "share of the object's visible ground with a wrong cycle"
        ),
        "ground_wrong": Variable(
            ("antenna_count",),
            "real",
            "1",
            "share of the visible ground beside objects with a wrong cycle",
        ),
    },
    coordinates={
        "antenna_count": Variable(
            ("antenna_count",), "integer", "1", "antennas that the heights are taken from"
        ),
        "object": Variable(("object",), "integer", "1", "number of the object of the scene"),
    },
    statistics=True,
)


def compare(
    heights: dict[int, Floats],
    truth: xr.Dataset,
    objects: Sequence[SceneObject],
    *,
    ambiguity: Floats,
) -> xr.Dataset:
    """Hold heights by fewer and by more antennas against the objects of the scene.

    A height has a wrong cycle if it errs by more than half the height of ambiguity.

    Parameters
    ----------
    heights
        Heights (y, x) by number of antennas, m.
    truth
        Product ``truth``, on their grid.
    objects
        The objects of the scene.
    ambiguity
        Height of ambiguity (y, x), m.

    Returns
    -------
    xarray.Dataset
        Product ``two_antennas``; an object that is hidden has no numbers.
    """
    from scipy.ndimage import binary_dilation

    x, y = truth["x"].values, truth["y"].values
    true, visible = truth["height"].values, ~truth["shadow"].values
    visible &= np.isfinite(true)
    tops = [visible & (scene.relief(part, x[None, :], y[:, None]) != 0) for part in objects]
    reach = [1 + 2 * int(np.ceil(_BESIDE_M / grid.step(axis))) for axis in (y, x)]
    near = binary_dilation(np.any([np.zeros(true.shape, bool), *tops], axis=0), np.ones(reach))
    stacked = np.stack(list(heights.values()))
    wrong = np.abs(stacked - true) > ambiguity / 2

    def over(tops: list[Flags], values: Floats, mean: bool = False) -> Floats:
        found = [
            [
                (np.mean if mean else np.nanmedian)(part[top]) if top.any() else np.nan
                for top in tops
            ]
            for part in values
        ]
        return np.array(found).reshape(len(values), len(tops))

    return variables.dataset(
        "two_antennas",
        {
            "height": stacked,
            "top_height": over(tops, stacked),
            "true_top_height": over(tops, true[None])[0],
            "top_wrong": over(tops, wrong, mean=True),
            "ground_wrong": over([visible & ~near], wrong, mean=True)[:, 0],
        },
        {
            "antenna_count": np.array(list(heights)),
            "object": np.arange(len(objects)),
            "x": x,
            "y": y,
        },
    )


def _two_antennas(products: Products, study: Study) -> xr.Dataset:
    images, dem = products["images"], products["dem"]
    x, y = dem["x"].values, dem["y"].values
    unwrapped = unwrapping.unwrap(
        products["filtered"],
        products["interferogram"]["coherence"],
        method=study.unwrapping.method,
        looks=interferogram.looks(products["trajectory"], study),
    )
    ends = images.isel(channel=[0, -1])
    points = height.reference(x, y, study.height)
    offset = height.phase_offset(unwrapped, ends, points, trend=study.height.trend)
    instrument = Instrument.of(ends, waveform.sampled(study.radar))
    return compare(
        {
            2: height.invert(unwrapped, ends, offset).height,
            images.sizes["channel"]: dem["height"].values,
        },
        products["truth"],
        study.scene.objects,
        ambiguity=instrument.height_of_ambiguity(x[None, :], y[:, None]),
    )


def _compared(study: Study) -> bool:
    # Two antennas alone must be unwrapped.
    return len(study.radar.baselines) > 1 and study.unwrapping.method != "baselines"


STAGES = {
    "two_antennas": Stage(
        _two_antennas,
        inputs=("images", "interferogram", "filtered", "trajectory", "dem", "truth"),
        sections=(*interferogram.LOOKS_KEYS, "unwrapping", "height", "scene.objects"),
        when=_compared,
    ),
}
