"""How far the two images shift against each other when nothing is registered (Fig. 2).

Three answers for each target: Eqs. 6-7 as the paper has them (a radial shift), the point of equal
path and slope (a circle around a rail, an ellipse otherwise), and what imaged targets measure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.radar import aperture, formulas, waveform

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Focus = Callable[[Floats, Floats], NDArray[np.complexfloating]]
    PointImager = Callable[[Floats], Focus]

_REFINEMENTS = 3


def peak(values: NDArray[np.complexfloating], x: Floats, y: Floats) -> tuple[float, float]:
    """Return where a 3 x 3 patch of an image peaks, by a parabola in x and y.

    Parameters
    ----------
    values
        Complex image (3, 3), its largest sample in the middle or near it.
    x, y
        Axes of the patch, m.

    Returns
    -------
    tuple of float
        x and y of the peak, m.
    """
    power = np.abs(values) ** 2
    u, v = np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0])
    design = np.stack([u**0, u, v, u * v, u**2, v**2], axis=-1).reshape(9, 6)
    _, bx, by, bxy, bxx, byy = np.linalg.lstsq(design, power.ravel(), rcond=None)[0]
    step = np.linalg.solve([[2 * bxx, bxy], [bxy, 2 * byy]], [-bx, -by])
    step = np.clip(step, -1, 1)
    return float(x[1] + step[0] * (x[1] - x[0])), float(y[1] + step[1] * (y[1] - y[0]))


def measure_shift(imager: PointImager, target: Floats, resolution: Floats) -> Floats:
    """Return how far the image of a point target lies from its position, in each channel.

    Parameters
    ----------
    imager
        Takes the position (3,) of a unit point target, m, and returns a function that images it:
        from the axes x and y of a grid, m, to complex images (channel, y, x).
    target
        Position of the target, m.
    resolution
        Resolution in x and y, m, which sets the search grid.

    Returns
    -------
    ndarray, shape (channel, 2)
        Displacement in x and y on the ground plane, m.
    """
    # A resolution cell sampled ten times: the parabola then errs by less than a thousandth of it.
    coarse = np.arange(-20, 21) / 10
    x, y = target[0] + coarse * resolution[0], target[1] + coarse * resolution[1]
    focus = imager(target)
    images = focus(x, y)
    result = np.empty((len(images), 2))
    for channel, image in enumerate(np.abs(images)):
        row, column = np.unravel_index(np.argmax(image), image.shape)
        found = np.array([x[column], y[row]])
        for _ in range(_REFINEMENTS):
            axis_x = found[0] + np.array([-0.1, 0, 0.1]) * resolution[0]
            axis_y = found[1] + np.array([-0.1, 0, 0.1]) * resolution[1]
            found = np.array(peak(focus(axis_x, axis_y)[channel], axis_x, axis_y))
        result[channel] = found - target[:2]
    return result


def analyze(
    apertures: Sequence[aperture.Aperture],
    imager: PointImager,
    *,
    targets: Mapping[str, tuple[float, float]],
    heights: Floats,
    x: Floats,
    y: Floats,
    map_height_m: float,
    frequency: Floats,
) -> xr.Dataset:
    """Compare the three answers for point targets of rising height, and map two over the scene.

    Parameters
    ----------
    apertures
        The aperture of each channel.
    imager
        As in `measure_shift`.
    targets
        Position (x, y) on the ground of each named target, m.
    heights
        Target heights, m.
    x, y
        Axes of the maps, m.
    map_height_m
        Target height of the maps, m.
    frequency
        Frequencies, Hz.

    Returns
    -------
    xarray.Dataset
        Product ``registration``; registration errors are lower minus upper.
    """
    ground = np.array(list(targets.values()))
    resolution = waveform.ground_resolution(
        apertures[0], ground[:, 0], ground[:, 1], frequency=frequency
    )
    answers = {
        name: _difference(formula, apertures, ground[:, :1], ground[:, 1:], heights)
        for name, formula in _FORMULAS.items()
    }
    shift = np.empty((len(apertures), 2, len(ground), heights.size))
    for i, (at_x, at_y) in enumerate(ground):
        for j, height in enumerate(heights):
            target = np.array([at_x, at_y, height])
            shift[:, :, i, j] = measure_shift(imager, target, resolution[:, i])
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    maps = {
        f"map_{name}": _difference(formula, apertures, grid_x, grid_y, np.asarray(map_height_m))
        for name, formula in _FORMULAS.items()
    }
    return variables.dataset(
        "registration",
        {
            "measured": shift[0] - shift[1],
            "image_shift": shift,
            "target_position": ground,
            "resolution": resolution,
            "map_resolution": waveform.ground_resolution(
                apertures[0], grid_x, grid_y, frequency=frequency
            ),
            "map_height": map_height_m,
        }
        | answers
        | maps,
        {"x": x, "y": y, "target": np.array(list(targets)), "target_height": heights},
    )


def _radial_shift(
    aperture_: aperture.Aperture, x: Floats, y: Floats, height: Floats
) -> tuple[Floats, Floats]:
    center = aperture_.center
    return formulas.radial_shift(x - center[0], y - center[1], height, float(center[2]))


def _equal_path_shift(
    aperture_: aperture.Aperture, x: Floats, y: Floats, height: Floats
) -> tuple[Floats, Floats]:
    image_x, image_y = aperture.image_position(aperture_, x, y, height)
    return image_x - x, image_y - y


_FORMULAS = {"radial": _radial_shift, "equal_path": _equal_path_shift}


def _difference(
    formula: Callable[..., tuple[Floats, Floats]],
    apertures: Sequence[aperture.Aperture],
    x: Floats,
    y: Floats,
    height: Floats,
) -> Floats:
    shifts = [np.stack(np.broadcast_arrays(*formula(part, x, y, height))) for part in apertures]
    return np.asarray(shifts[0] - shifts[1])
