"""Surveyed reflectors in the images of measured echoes: where they are, how wide, how clean."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.processing import focusing
from vinsar.radar import aperture, grid, trajectory, waveform

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

# A patch about a reflector: so many resolution cells either way, and pixels to a cell.
_CELLS, _PIXELS = 4.0, 8
_SIDE = 2 * int(_CELLS * _PIXELS) + 1

_OFFSETS = np.linspace(-_CELLS, _CELLS, _SIDE)

variables.declare(
    "reflectors",
    {
        "surveyed": Variable(("reflector", "axis"), "real", "m", "surveyed place"),
        "imaged": Variable(
            ("channel", "reflector", "ground_axis"),
            "real",
            "m",
            "place of the brightest pixel near the survey, in the plane of its height",
        ),
        "width": Variable(
            ("channel", "reflector", "ground_axis"), "real", "m", "-3 dB width through that pixel"
        ),
        "expected_width": Variable(
            ("reflector", "ground_axis"), "real", "m", "-3 dB width of a point target there"
        ),
        "sidelobe": Variable(
            ("channel", "reflector", "ground_axis"),
            "real",
            "1",
            "power of the highest sidelobe or neighbour over the peak, along the axis",
        ),
        "cut": Variable(
            ("channel", "reflector", "ground_axis", "cell_offset"),
            "real",
            "1",
            "amplitude over the peak's, along the axis through it",
        ),
    },
    coordinates={
        "reflector": Variable(("reflector",), "integer", "1", "number of the reflector"),
        "cell_offset": Variable(
            ("cell_offset",), "real", "1", "offset from the survey, in resolution cells"
        ),
    },
    statistics=True,
)


def measure(
    profiles: xr.Dataset,
    antennas: xr.Dataset,
    surveyed: Floats,
    *,
    frequency: Floats,
    range_window: waveform.WindowName = "rectangular",
    aperture_window: waveform.WindowName = "rectangular",
) -> xr.Dataset:
    """Measure surveyed reflectors in images of their own height.

    Parameters
    ----------
    profiles
        Product ``profiles``.
    antennas
        Product ``recorded_trajectory``.
    surveyed
        Surveyed places (reflector, 3), m, within the image.
    frequency
        Frequencies, Hz.
    range_window, aperture_window
        Weightings, of which the second is applied here.

    Returns
    -------
    xarray.Dataset
        Product ``reflectors``. A width that the patch does not hold is NaN.
    """
    line = trajectory.apertures(antennas)[0]
    factors = np.array(
        [waveform.window_width(aperture_window), waveform.window_width(range_window)]
    )
    found = []
    cells = np.array([_cell(line, place, frequency) for place in surveyed])
    for place, cell in zip(surveyed, cells, strict=True):
        axes = [at + size * _OFFSETS for at, size in zip(place[:2], cell, strict=True)]
        image = focusing.backproject(
            profiles, antennas, x=axes[0], y=axes[1], z=place[2], window=aperture_window
        )["image"].values
        found.append([_described(np.abs(one), axes) for one in image])
    # From reflectors of channels to channels of reflectors.
    imaged, width, sidelobe, cut = (
        np.array([[one[index] for one in row] for row in found]).swapaxes(0, 1)
        for index in range(4)
    )
    return variables.dataset(
        "reflectors",
        {
            "surveyed": surveyed,
            "imaged": imaged,
            "width": width,
            "expected_width": cells * factors,
            "sidelobe": sidelobe,
            "cut": cut,
        },
        {"channel": antennas["channel"].values, "cell_offset": _OFFSETS},
    )


def _cell(line: aperture.Aperture, place: Floats, frequency: Floats) -> Floats:
    """Return the resolution in x and y in the plane of a place's height, m."""
    # That plane is the ground of a radar which is as much lower.
    down = np.array([0.0, 0.0, place[2]])
    lowered = replace(line, transmitter=line.transmitter - down, receiver=line.receiver - down)
    path, slope = aperture.gradients(lowered, place[0], place[1])
    cell = 2 * waveform.range_resolution(float(frequency[-1] - frequency[0]))
    carrier = waveform.wavelength(waveform.carrier(frequency))
    return np.abs(np.array([carrier / slope[0], cell / path[1]]))


def _described(
    amplitude: Floats, axes: list[Floats]
) -> tuple[list[float], list[float], list[float], list[Floats]]:
    """Return place, widths, sidelobes and cuts of the brightest pixel, in x and y."""
    row, column = np.unravel_index(amplitude.argmax(), amplitude.shape)
    peak = float(amplitude[row, column])
    cuts = [amplitude[row] / peak, amplitude[:, column] / peak]
    ends = [_main_lobe(cut, int(at)) for cut, at in zip(cuts, (column, row), strict=True)]
    return (
        [float(axes[0][column]), float(axes[1][row])],
        [
            _width(cut, axis, int(at))
            for cut, axis, at in zip(cuts, axes, (column, row), strict=True)
        ],
        [
            float(np.concatenate([cut[: low + 1], cut[high:]]).max() ** 2)
            for cut, (low, high) in zip(cuts, ends, strict=True)
        ],
        cuts,
    )


def _main_lobe(cut: Floats, peak: int) -> tuple[int, int]:
    """Return the places of the minima on either side of a peak."""
    low, high = peak, peak
    while low > 0 and cut[low - 1] < cut[low]:
        low -= 1
    while high < cut.size - 1 and cut[high + 1] < cut[high]:
        high += 1
    return low, high


def _width(cut: Floats, axis: Floats, peak: int) -> float:
    """Return the -3 dB width of a peak, interpolated linearly in power; NaN if it is cut off."""
    power = cut**2 - 0.5
    ends = []
    for step in (-1, 1):
        at = peak
        while 0 < at < cut.size - 1 and power[at] > 0:
            at += step
        if power[at] > 0:
            return float("nan")
        inner = at - step
        share = power[inner] / (power[inner] - power[at])
        ends.append(axis[inner] + share * (axis[at] - axis[inner]))
    return float(ends[1] - ends[0])


def _reflectors(products: Products, study: Study) -> xr.Dataset:
    return measure(
        products["profiles"],
        products["recorded_trajectory"],
        np.array([(one.x_m, one.y_m, one.height_m) for one in study.measurement.reflectors]),
        frequency=waveform.sampled(study.radar),
        range_window=study.imaging.range_window,
        aperture_window=study.imaging.aperture_window,
    )


def _surveyed(study: Study) -> bool:
    return bool(study.measurement.reflectors)


STAGES = {
    "reflectors": Stage(
        _reflectors,
        inputs=("profiles", "recorded_trajectory"),
        sections=(
            *waveform.KEYS,
            *grid.KEYS,
            "measurement.reflectors",
            "imaging.range_window",
            "imaging.aperture_window",
        ),
        when=_surveyed,
    ),
}
