"""How far the two images shift against each other when nothing is registered (Fig. 2).

Three answers for each target: Eqs. 6-7 as the paper has them (a radial shift), the point of equal
path and slope (a circle around a rail, an ellipse otherwise), and what imaged targets measure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import Variable
from vinsar.processing import focusing, interferogram
from vinsar.radar import aperture, formulas, grid, trajectory, waveform
from vinsar.radar.instrument import Instrument
from vinsar.simulation import echo

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]
    Focus = Callable[[Floats, Floats], NDArray[np.complexfloating]]
    PointImager = Callable[[Floats], Focus]

_REFINEMENTS = 3


# Slant range around a point target that its image may need.
_POINT_MARGIN_M = 1.5

_SHIFT = ("ground_axis", "target", "target_height")

variables.declare(
    "registration",
    {
        "radial": Variable(
            _SHIFT, "real", "m", "registration error, radial shift (Eqs. 6-7)", "lower minus upper"
        ),
        "equal_path": Variable(
            _SHIFT,
            "real",
            "m",
            "registration error, points of equal path and slope",
            "lower minus upper; a circle around a rail, an ellipse otherwise",
        ),
        "measured": Variable(
            _SHIFT,
            "real",
            "m",
            "registration error measured on imaged point targets",
            "lower minus upper",
        ),
        "image_shift": Variable(
            ("channel", "ground_axis", "target", "target_height"),
            "real",
            "m",
            "measured displacement of the imaged point target from its position",
        ),
        "target_position": Variable(
            ("target", "ground_axis"), "real", "m", "position of the target on the ground"
        ),
        "resolution": Variable(
            ("ground_axis", "target"), "real", "m", "resolution on the ground at the target"
        ),
        "map_radial": Variable(
            ("ground_axis", "y", "x"),
            "real",
            "m",
            "registration error over the scene, radial shift (Eqs. 6-7)",
            "lower minus upper",
        ),
        "map_equal_path": Variable(
            ("ground_axis", "y", "x"),
            "real",
            "m",
            "registration error over the scene, points of equal path and slope",
            "lower minus upper",
        ),
        "map_resolution": Variable(
            ("ground_axis", "y", "x"), "real", "m", "resolution on the ground over the scene"
        ),
        "map_height": Variable((), "real", "m", "target height of the maps"),
    },
    coordinates={
        "target": Variable(("target",), "label", "", "point target"),
        "target_height": Variable(("target_height",), "real", "m", "height of the point target"),
    },
)


class Target(Section):
    """A point target of the registration analysis."""

    x_m: float = key("position along the rail", "section 1.3")
    y_m: float = key("position ahead", "section 1.3", gt=0)


class Registration(Section, name="registration"):
    """The analysis of image shifts without registration (Fig. 2)."""

    near: Target = key("the near target", "section 1.3")
    far: Target = key("the far target", "section 1.3")
    height_min_m: float = key("lowest target height", "Fig. 2, without a figure")
    height_max_m: float = key("highest target height", "Fig. 2, without a figure")
    height_count: int = key("number of target heights", "Fig. 2, without a figure", ge=3)
    map_height_m: float = key("target height of the map over the scene", "not given")


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
    given: Instrument,
    imager: PointImager,
    *,
    targets: Mapping[str, tuple[float, float]],
    heights: Floats,
    x: Floats,
    y: Floats,
    map_height_m: float,
) -> xr.Dataset:
    """Compare the three answers for point targets of rising height, and map two over the scene.

    Parameters
    ----------
    given
        The instrument.
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

    Returns
    -------
    xarray.Dataset
        Product ``registration``; registration errors are lower minus upper.
    """
    ground = np.array(list(targets.values()))
    apertures = given.lower, given.upper
    resolution = given.resolution(ground[:, 0], ground[:, 1])
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
            "map_resolution": given.resolution(grid_x, grid_y),
            "map_height": map_height_m,
        }
        | answers
        | maps,
        {"x": x, "y": y, "target": np.array(list(targets)), "target_height": heights},
    )


def _radial_shift(
    synthetic: aperture.Aperture, x: Floats, y: Floats, height: Floats
) -> tuple[Floats, Floats]:
    center = synthetic.center
    return formulas.radial_shift(x - center[0], y - center[1], height, float(center[2]))


def _equal_path_shift(
    synthetic: aperture.Aperture, x: Floats, y: Floats, height: Floats
) -> tuple[Floats, Floats]:
    image_x, image_y = aperture.image_position(synthetic, x, y, height)
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


def _registration(products: Products, study: Study) -> xr.Dataset:
    antennas = products["trajectory"].isel(channel=[0, -1])
    frequency = waveform.sampled(study.radar)
    options = study.registration

    def image_point(target: Floats) -> Focus:
        point = variables.dataset(
            "facets", {"facet_position": target[None, :], "reflectivity": np.ones(1)}
        )
        near, far = trajectory.range_extent(antennas, target[:1], target[1:2], target[2])
        profiles = focusing.compress(
            echo.simulate(point, antennas, frequency=frequency, accuracy_db=None),
            near_range_m=max(0.0, near - _POINT_MARGIN_M),
            far_range_m=far + _POINT_MARGIN_M,
            window=study.imaging.range_window,
            oversampling=study.imaging.oversampling,
            interpolation=study.imaging.interpolation,
        )

        def focus(x: Floats, y: Floats) -> NDArray[np.complexfloating]:
            images = focusing.backproject(
                profiles, antennas, x=x, y=y, window=study.imaging.aperture_window
            )
            return np.asarray(images["image"].values)

        return focus

    x, y = grid.image_axes(study.imaging)
    return analyze(
        Instrument.of(antennas, frequency),
        image_point,
        targets={
            "near": (options.near.x_m, options.near.y_m),
            "far": (options.far.x_m, options.far.y_m),
        },
        heights=np.linspace(options.height_min_m, options.height_max_m, options.height_count),
        x=x,
        y=y,
        map_height_m=options.map_height_m,
    )


def _heights_rise(registration: Registration) -> Iterator[Fault]:
    if registration.height_min_m >= registration.height_max_m:
        yield Fault(
            "registration.height_max_m",
            registration.height_max_m,
            f"must exceed registration.height_min_m, {registration.height_min_m}",
        )


STAGES = {
    "registration": Stage(
        _registration,
        inputs=("trajectory",),
        sections=(*waveform.KEYS, "imaging", "registration"),
        parallel=True,
        when=interferogram.of_two,
    ),
}


CHECKS = (_heights_rise,)
