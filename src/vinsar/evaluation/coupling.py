"""Coupling of transmitter and receiver: its range profiles, and what its suppression costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.processing import focusing, leakage
from vinsar.radar import grid, trajectory, waveform
from vinsar.simulation import echo

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

# Range samples a resolution cell of the profiles that show the coupling, and targets along x.
_PROFILE_SAMPLES, _TARGETS = 8, 17

variables.declare(
    "coupling",
    {
        "scene_power": Variable(
            ("slant_range",),
            "real",
            "1",
            "mean power of the range profiles without coupling",
            "over the mean of the image's slant ranges, of all positions and channels",
        ),
        "power": Variable(
            ("weighting", "suppression", "slant_range"),
            "real",
            "1",
            "mean power of the range profiles as received",
            "over the mean of the image's slant ranges without coupling",
        ),
        "point_image": Variable(
            ("suppression", "channel", "y", "x"),
            "complex",
            "1",
            "image of a unit point target at its place after suppression",
            "amplitude 1 and phase 0 without any",
        ),
        "common_share": Variable(
            ("channel", "y", "x"),
            "real",
            "1",
            "share of a target's amplitude that is common to all positions",
        ),
    },
    coordinates={
        "suppression": Variable(("suppression",), "label", "", "suppression of the coupling"),
        "weighting": Variable(("weighting",), "label", "", "weighting of the frequencies"),
    },
)


def _coupling(products: Products, study: Study) -> xr.Dataset:
    antennas, clean, received = (products[name] for name in ("trajectory", "echo", "received"))
    frequency, options = waveform.sampled(study.radar), study.suppression
    swath = trajectory.range_extent(antennas, *grid.image_axes(study.imaging))

    def profiles(
        data: xr.Dataset,
        method: leakage.Method,
        window: waveform.WindowName,
        extent: tuple[float, float],
    ) -> xr.Dataset:
        return focusing.compress(
            leakage.suppress(data, method=method, gate_range_m=options.gate_range_m),
            near_range_m=extent[0],
            far_range_m=extent[1],
            window=window,
            oversampling=_PROFILE_SAMPLES,
        )

    def power(
        data: xr.Dataset, method: leakage.Method = "none", window: waveform.WindowName = "hann"
    ) -> Floats:
        profile = profiles(data, method, window, (0.0, swath[1]))["profile"].values
        return np.asarray((np.abs(profile) ** 2).mean(axis=(0, 1)))

    def image(method: leakage.Method, x: float, y: float) -> NDArray[np.complexfloating]:
        target = np.array([[x, y, 0.0]])
        point = variables.dataset("facets", {"facet_position": target, "reflectivity": np.ones(1)})
        seen = echo.simulate(point, antennas, frequency=frequency, accuracy_db=None)
        at = np.array([x]), np.array([y])
        # A unit point target with uniform weighting: what is lost is lost to the suppression.
        near, far = trajectory.range_extent(antennas, *at)
        focused = focusing.backproject(
            profiles(seen, method, "rectangular", (near, far)), antennas, x=at[0], y=at[1]
        )
        return np.asarray(focused["image"].values[:, 0, 0])

    length = float(np.ptp(antennas["receiver"].values[..., 0]))
    x = np.linspace(0, 1.5 * length, _TARGETS)
    y = np.array([study.imaging.y_min_m, study.imaging.y_max_m])
    slant_range = profiles(clean, "none", "hann", (0.0, swath[1]))["slant_range"].values
    within = (slant_range >= swath[0]) & (slant_range <= swath[1])
    windows: tuple[waveform.WindowName, ...] = ("rectangular", "hann")
    scene_power = power(clean, window="rectangular")
    unit = scene_power[within].mean()
    return variables.dataset(
        "coupling",
        {
            "scene_power": scene_power / unit,
            "power": [
                [power(received, method, window) / unit for method in leakage.METHODS]
                for window in windows
            ],
            "point_image": np.moveaxis(
                np.array(
                    [
                        [[image(method, float(a), float(b)) for a in x] for b in y]
                        for method in leakage.METHODS
                    ]
                ),
                -1,
                1,
            ),
            "common_share": leakage.common_share(
                antennas, x[None, :], y[:, None], waveform.wavelength(waveform.carrier(frequency))
            ),
        },
        {
            "slant_range": slant_range,
            "suppression": list(leakage.METHODS),
            "weighting": list(windows),
            "x": x,
            "y": y,
        },
    )


STAGES = {
    "coupling": Stage(
        _coupling,
        inputs=("trajectory", "echo", "received"),
        sections=(*waveform.KEYS, *grid.KEYS, "suppression.gate_range_m"),
        parallel=True,
    ),
}
