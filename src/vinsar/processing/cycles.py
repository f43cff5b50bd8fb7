"""The whole cycles of a long baseline's phase, from shorter baselines of the same antennas.

A short baseline measures coarse heights, but over a height of ambiguity that nothing in the scene
exceeds: it needs no unwrapping. Its heights tell the phase that a longer baseline must have to
within a fraction of a cycle, so upright objects, on which no path of small phase steps leads, come
out at their own height. From the shortest baseline to the longest, each tells the next.

The cycle is the median's over a window, rounded. Maximum likelihood over all baselines is the same
decision pixel by pixel, as the long one's phase is the finer by far; added up over a window it
mixes an object's top with the ground more than the median does (docs/antennas.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing import filtering, height, masks
from vinsar.radar import aperture, grid, trajectory

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]
    Points = tuple[Floats, Floats, Floats]

_CYCLE = 2 * np.pi

variables.declare(
    "short_baselines",
    {
        "told_phase": Variable(
            GRID,
            "real",
            "radian",
            "phase of the longest baseline by the shorter ones, without the flat-earth phase",
            "lower minus upper; not a number where they locate nothing",
            gaps=True,
        ),
    },
)


def constant(
    phase: Floats,
    pair: tuple[aperture.Aperture, aperture.Aperture],
    x: Floats,
    y: Floats,
    points: Points,
    wavelength_m: float,
) -> float:
    """Return the constant that takes a wrapped phase to that of points of known height, rad.

    Parameters
    ----------
    phase
        Phase without that of the ground plane (y, x), rad; whole cycles do not count.
    pair
        Apertures of the two channels.
    x, y
        Axes, m.
    points
        x, y and height of the points, m.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    float
        The mean over the points on the circle, -pi to pi.

    Raises
    ------
    ValueError
        If no point has a phase.
    """
    image_x, image_y = aperture.image_position(pair[0], *points)
    expected = aperture.interferometric_phase(*pair, *points, wavelength_m)
    expected = expected - aperture.flat_earth_phase(*pair, image_x, image_y, wavelength_m)
    row, column = (np.rint(grid.place(*ends)).astype(int) for ends in ((image_y, y), (image_x, x)))
    row, column = np.clip(row, 0, y.size - 1), np.clip(column, 0, x.size - 1)
    missing = (expected - phase[row, column])[np.isfinite(phase[row, column])]
    if not missing.size:
        raise ValueError("none of the points of known height lies where there is a phase")
    return float(np.angle(np.mean(np.exp(1j * missing))))


def predict(
    phase: Floats,
    pair: tuple[aperture.Aperture, aperture.Aperture],
    other: tuple[aperture.Aperture, aperture.Aperture],
    x: Floats,
    y: Floats,
    wavelength_m: float,
) -> Floats:
    """Return the phase that a pair of channels sees of what another pair has located.

    Parameters
    ----------
    phase
        Absolute phase without that of the ground plane (y, x), rad.
    pair, other
        Apertures of the pair that measured it, and of the other one; the first channel is common.
    x, y
        Axes, m.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    ndarray, shape (y, x)
        Phase without that of the ground plane, rad; NaN where the pair locates nothing.
    """
    grid_x, grid_y = x[None, :], y[:, None]
    flat = aperture.flat_earth_phase(*pair, grid_x, grid_y, wavelength_m)
    place = aperture.locate(*pair, grid_x, grid_y, phase + flat, wavelength_m)
    seen = aperture.interferometric_phase(*other, *place, wavelength_m)
    return np.asarray(seen - aperture.flat_earth_phase(*other, grid_x, grid_y, wavelength_m))


def told(
    wrapped: Sequence[Floats],
    channels: Sequence[aperture.Aperture],
    x: Floats,
    y: Floats,
    points: Points,
    wavelength_m: float,
    *,
    window_px: tuple[int, int],
) -> Floats:
    """Return the phase that the longest baseline must have, by the shorter ones.

    Parameters
    ----------
    wrapped
        Phase of each pair but the last (y, x), the first channel with each other one, without that
        of the ground plane, rad; the shortest baseline first. It must not wrap over the scene.
    channels
        Apertures, the first channel and then the others in the same order, the last one included.
    x, y
        Axes, m.
    points
        x, y and height of points of known height, m.
    wavelength_m
        Wavelength, m.
    window_px
        Sides of the median's window in y and x, odd.

    Returns
    -------
    ndarray, shape (y, x)
        Phase without that of the ground plane, rad; NaN where a shorter baseline locates nothing.

    Raises
    ------
    ValueError
        If pairs and channels do not fit.
    """
    if len(channels) != len(wrapped) + 2:
        raise ValueError(f"{len(wrapped)} shorter pairs do not fit {len(channels)} channels")
    first = channels[0], channels[1]
    phase = wrapped[0] + constant(wrapped[0], first, x, y, points, wavelength_m)
    phase = phase - _CYCLE * np.rint(phase / _CYCLE)
    for number, longer in enumerate(channels[2:], 1):
        pairs = (channels[0], channels[number]), (channels[0], longer)
        phase = predict(phase, *pairs, x, y, wavelength_m)
        if number < len(wrapped):
            offset = constant(wrapped[number], pairs[1], x, y, points, wavelength_m)
            phase = settle(wrapped[number] + offset, phase, window_px=window_px)
    return phase


def settle(
    phase: Floats, told: Floats, *, window_px: tuple[int, int], unwrapped: bool = False
) -> NDArray[np.float64]:
    """Return a phase with the whole cycles that shorter baselines tell.

    Parameters
    ----------
    phase
        Measured phase (y, x), rad; NaN where there is none.
    told
        What it must be (y, x), from `told`, rad, up to a constant; NaN where that is not known.
    window_px
        Sides of the median's window in y and x, odd.
    unwrapped
        Whether neighbours in `phase` belong to one cycle already. If not, each pixel goes to the
        cycle that is nearest to what the shorter baselines tell.

    Returns
    -------
    ndarray, shape (y, x)
        As measured, plus whole cycles, rad; NaN where there is no phase.

    Raises
    ------
    ValueError
        If the window is not odd and positive.
    """
    from scipy.ndimage import median_filter

    if any(side < 1 or side % 2 == 0 for side in window_px):
        raise ValueError(f"the sides of the window, {window_px} pixels, must be odd and positive")
    missing = ~np.isfinite(phase)
    if missing.all():
        return np.array(phase, float)
    phase = masks.fill(phase)
    # The channels' constant: what most of the scene says.
    known = np.isfinite(told) & ~missing
    level = np.angle(np.exp(1j * (told - phase)[known]).sum()) if known.any() else 0.0
    expected = np.where(known, told - level, phase)
    found = np.array(phase, float)
    if not unwrapped:
        found += _CYCLE * np.rint((median_filter(expected, window_px) - found) / _CYCLE)
    found += _CYCLE * np.rint(median_filter(expected - found, window_px) / _CYCLE)
    found[missing] = np.nan
    return found


def window(side_m: float, x: Floats, y: Floats) -> tuple[int, int]:
    """Return the sides of a window in y and x, odd numbers of pixels of at most that length."""
    down, across = (2 * int(side_m / grid.step(axis) / 2) + 1 for axis in (y, x))
    return down, across


def _short_baselines(products: Products, study: Study) -> xr.Dataset:
    images = products["images"]
    x, y = images["x"].values, images["y"].values
    lower, *others = images["image"].values
    wrapped = [
        np.angle(filtering.smooth(lower * np.conj(other), **study.filtering.model_dump()))
        for other in others[:-1]
    ]
    phase = told(
        wrapped,
        trajectory.all_apertures(images),
        x,
        y,
        height.reference(x, y, study.height),
        float(images["wavelength"]),
        window_px=window(study.unwrapping.cycle_window_m, x, y),
    )
    return variables.dataset("short_baselines", {"told_phase": phase}, {"x": x, "y": y})


STAGES = {
    "short_baselines": Stage(
        _short_baselines,
        inputs=("images",),
        sections=("filtering", "height", "unwrapping.cycle_window_m"),
        parallel=True,
        when=lambda study: len(study.radar.baselines) > 1,
    ),
}
