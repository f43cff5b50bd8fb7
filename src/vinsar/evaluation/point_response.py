"""The response to a point target at the middle of the image: what position errors leave of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.radar import grid, motion, trajectory, waveform

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

VARIABLES = {
    "point_gain": Variable(
        ("channel",),
        "real",
        "1",
        "amplitude of a point target at the image's centre relative to perfect focus",
    ),
    "peak_gain": Variable(
        ("channel",),
        "real",
        "1",
        "amplitude of the point target where its image lies, relative to perfect focus",
    ),
    "peak_shift": Variable(
        ("channel", "ground_axis"),
        "real",
        "m",
        "displacement of the point target's image from its position",
        "by the least-squares match of the ranges",
    ),
}
"""Variables of the product ``focus``."""

variables.declare("focus", VARIABLES, statistics=True)


def _focus(products: Products, study: Study) -> xr.Dataset:
    truth = products["true_trajectory"]
    recorded = trajectory.displaced(
        products["recorded_trajectory"], products["autofocus"]["displacement"].values
    )
    frequency = waveform.sampled(study.radar)
    x, y = grid.image_axes(study.imaging)
    target = np.array([(x[0] + x[-1]) / 2, (y[0] + y[-1]) / 2, 0.0])
    aperture_weights = waveform.window(study.imaging.aperture_window, truth.sizes["position"])
    peak = motion.peak_place(truth, recorded, target, aperture_weights)

    def gain(place: Floats) -> Floats:
        return motion.point_gain(
            truth,
            recorded,
            target,
            place,
            frequency,
            waveform.window(study.imaging.range_window, frequency.size),
            aperture_weights,
        )

    return variables.dataset(
        "focus",
        {
            "point_gain": gain(np.tile(target, (len(peak), 1))),
            "peak_gain": gain(peak),
            "peak_shift": (peak - target)[:, :2],
        },
    )


STAGES = {
    "focus": Stage(
        _focus,
        inputs=("true_trajectory", "recorded_trajectory", "autofocus"),
        sections=(*waveform.KEYS, *grid.KEYS, "imaging.range_window", "imaging.aperture_window"),
    ),
}
