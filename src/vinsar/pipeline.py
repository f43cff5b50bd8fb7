"""The stages in order: what each reads, which configuration it depends on, what it computes.

`STAGES` is the one description of the chain. `run` takes a study through it in memory; the
workflow takes each stage through a rule of its own, with the same functions.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vinsar import (
    accuracy,
    config,
    echo,
    filtering,
    geometry,
    height,
    imaging,
    interferogram,
    radar,
    registration,
    scene,
    trajectory,
    unwrapping,
    variables,
    visibility,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

logger = logging.getLogger(__name__)

Products = dict[str, "xr.Dataset"]

# What a random draw is for; the number is part of its seed and never changes.
_JITTER, _NOISE = 0, 1

# Slant range around a point target that its image may need.
_POINT_MARGIN_M = 1.5


@dataclass(frozen=True)
class Stage:
    """A step of the chain.

    Attributes
    ----------
    compute
        From the input products and the study to the stage's product.
    inputs
        Products that it reads.
    sections
        Parts of the configuration that it reads, and no others.
    modules
        Modules whose code it runs, without those that they import.
    """

    compute: Callable[[Products, config.Study], xr.Dataset]
    inputs: tuple[str, ...]
    sections: tuple[str, ...]
    modules: tuple[str, ...]


def _rng(study: config.Study, *purpose: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(study.seed, spawn_key=purpose))


def _frequency(study: config.Study) -> Floats:
    return radar.frequencies(
        study.radar.start_frequency_hz,
        study.radar.stop_frequency_hz,
        study.radar.frequency_count,
    )


def image_axes(imaging_: config.Imaging) -> tuple[Floats, Floats]:
    """Return the axes x and y of image and DEM, m."""
    return (
        geometry.grid_axis(imaging_.x_min_m, imaging_.x_max_m, imaging_.grid_spacing_m),
        geometry.grid_axis(imaging_.y_min_m, imaging_.y_max_m, imaging_.grid_spacing_m),
    )


def _trajectory(products: Products, study: config.Study) -> xr.Dataset:
    del products
    return trajectory.rail(
        aperture_length_m=study.radar.aperture_length_m,
        position_spacing_m=study.radar.position_spacing_m,
        rail_height_m=study.radar.rail_height_m,
        baseline_m=study.radar.baseline_m,
        baseline_angle_deg=study.radar.baseline_angle_deg,
    )


def _terrain(products: Products, study: config.Study) -> xr.Dataset:
    del products
    return scene.terrain(
        study.scene.terrain,
        x_min_m=study.scene.x_min_m,
        x_max_m=study.scene.x_max_m,
        y_min_m=study.scene.y_min_m,
        y_max_m=study.scene.y_max_m,
        spacing_m=study.scene.terrain_spacing_m,
        peak_height_m=study.scene.peak_height_m,
        reflectivity_offset=study.scene.reflectivity_offset,
    )


def _facets(products: Products, study: config.Study) -> xr.Dataset:
    return scene.facets(
        products["terrain"],
        facet_size_m=study.scene.facet_size_m,
        facet_jitter=study.scene.facet_jitter,
        rng=_rng(study, _JITTER),
    )


def _visibility(products: Products, study: config.Study) -> xr.Dataset:
    del study
    return visibility.facet_visibility(
        products["terrain"], products["facets"], products["trajectory"]
    )


def _truth(products: Products, study: config.Study) -> xr.Dataset:
    x, y = image_axes(study.imaging)
    return visibility.truth_on_grid(products["terrain"], products["trajectory"], x, y)


def _echo(products: Products, study: config.Study) -> xr.Dataset:
    options = study.echo
    facets, antennas = products["facets"], products["trajectory"]
    result = echo.simulate(
        facets,
        antennas,
        products["visibility"] if options.occlusion else None,
        frequency=_frequency(study),
        reflectivity=options.reflectivity,
        spreading=options.spreading,
        accuracy_db=options.accuracy_db,
    )
    if options.snr_db is None:
        return result
    near, far = trajectory.range_extent(
        antennas, *_facet_extent(facets), facets["facet_position"].values[:, 2]
    )
    return echo.add_noise(
        result,
        snr_db=options.snr_db,
        swath_m=far - near,
        rngs=[_rng(study, _NOISE, channel) for channel in range(result.sizes["channel"])],
    )


def _facet_extent(facets: xr.Dataset) -> tuple[Floats, Floats]:
    position = facets["facet_position"].values
    least, most = position.min(axis=0), position.max(axis=0)
    return np.array([least[0], most[0]]), np.array([least[1], most[1]])


def _profiles(products: Products, study: config.Study) -> xr.Dataset:
    near, far = trajectory.range_extent(products["trajectory"], *image_axes(study.imaging))
    return imaging.compress(
        products["echo"],
        near_range_m=near,
        far_range_m=far,
        window=study.imaging.range_window,
        oversampling=study.imaging.oversampling,
    )


def _images(products: Products, study: config.Study) -> xr.Dataset:
    x, y = image_axes(study.imaging)
    return imaging.backproject(
        products["profiles"],
        products["trajectory"],
        x=x,
        y=y,
        window=study.imaging.aperture_window,
    )


def _interferogram(products: Products, study: config.Study) -> xr.Dataset:
    return interferogram.form(
        products["images"], coherence_window_px=study.interferogram.coherence_window_px
    )


def _filtered(products: Products, study: config.Study) -> xr.Dataset:
    return filtering.apply(products["interferogram"], **study.filtering.model_dump())


def looks(study: config.Study) -> float:
    """Return the effective number of looks of the coherence.

    The multilook window's area over that of a resolution cell at the middle of the image, at
    least 1: pixels finer than the resolution are not independent.
    """
    x, y = image_axes(study.imaging)
    frequency = _frequency(study)
    cell = radar.ground_resolution(
        np.array([0.0, 0.0, study.radar.rail_height_m]),
        np.array((x[0] + x[-1]) / 2),
        np.array((y[0] + y[-1]) / 2),
        aperture_length_m=study.radar.aperture_length_m,
        frequency=frequency,
    )
    side = study.interferogram.coherence_window_px * study.imaging.grid_spacing_m
    return max(1.0, float(side**2 / (cell[0] * cell[1])))


def _unwrapped(products: Products, study: config.Study) -> xr.Dataset:
    return unwrapping.unwrap(
        products["filtered"],
        products["interferogram"]["coherence"],
        method=study.unwrapping.method,
        looks=looks(study),
    )


def _dem(products: Products, study: config.Study) -> xr.Dataset:
    options = study.height
    if options.reference == "level_ground":
        points = height.level_ground(
            products["unwrapped"]["x"].values,
            products["unwrapped"]["y"].values,
            [(r.x_min_m, r.x_max_m, r.y_min_m, r.y_max_m) for r in options.level_ground],
            options.level_ground_height_m,
        )
    else:
        rows = np.array([(p.x_m, p.y_m, p.height_m) for p in options.control_points])
        points = rows[:, 0], rows[:, 1], rows[:, 2]
    offset = height.phase_offset(
        products["unwrapped"], products["images"], points, trend=options.trend
    )
    return height.invert(products["unwrapped"], products["images"], offset)


def _accuracy(products: Products, study: config.Study) -> xr.Dataset:
    return accuracy.evaluate(
        products["dem"], products["truth"], tolerance_m=study.accuracy.tolerance_m
    )


def _registration(products: Products, study: config.Study) -> xr.Dataset:
    antennas = products["trajectory"]
    frequency = _frequency(study)
    options = study.registration

    def image_point(target: Floats) -> registration.Focus:
        point = variables.dataset(
            "facets", {"facet_position": target[None, :], "reflectivity": np.ones(1)}
        )
        near, far = trajectory.range_extent(antennas, target[:1], target[1:2], target[2])
        profiles = imaging.compress(
            echo.simulate(point, antennas, frequency=frequency, accuracy_db=None),
            near_range_m=max(0.0, near - _POINT_MARGIN_M),
            far_range_m=far + _POINT_MARGIN_M,
            window=study.imaging.range_window,
            oversampling=study.imaging.oversampling,
        )

        def focus(x: Floats, y: Floats) -> NDArray[np.complexfloating]:
            images = imaging.backproject(
                profiles, antennas, x=x, y=y, window=study.imaging.aperture_window
            )
            return np.asarray(images["image"].values)

        return focus

    x, y = image_axes(study.imaging)
    return registration.analyze(
        trajectory.phase_centers(antennas),
        image_point,
        targets={
            "near": (options.near.x_m, options.near.y_m),
            "far": (options.far.x_m, options.far.y_m),
        },
        heights=np.linspace(options.height_min_m, options.height_max_m, options.height_count),
        x=x,
        y=y,
        map_height_m=options.map_height_m,
        aperture_length_m=study.radar.aperture_length_m,
        frequency=frequency,
    )


STAGES: dict[str, Stage] = {
    "trajectory": Stage(_trajectory, (), ("radar",), ("trajectory",)),
    "terrain": Stage(_terrain, (), ("scene",), ("scene",)),
    "facets": Stage(_facets, ("terrain",), ("seed", "scene"), ("scene",)),
    "visibility": Stage(_visibility, ("terrain", "facets", "trajectory"), (), ("visibility",)),
    "truth": Stage(_truth, ("terrain", "trajectory"), ("imaging",), ("visibility",)),
    "echo": Stage(
        _echo,
        ("facets", "trajectory", "visibility"),
        ("seed", "radar", "echo"),
        ("echo", "trajectory"),
    ),
    "profiles": Stage(_profiles, ("echo", "trajectory"), ("imaging",), ("imaging",)),
    "images": Stage(_images, ("profiles", "trajectory"), ("imaging",), ("imaging",)),
    "interferogram": Stage(_interferogram, ("images",), ("interferogram",), ("interferogram",)),
    "filtered": Stage(_filtered, ("interferogram",), ("filtering",), ("filtering",)),
    "unwrapped": Stage(
        _unwrapped,
        ("filtered", "interferogram"),
        ("radar", "imaging", "interferogram", "unwrapping"),
        ("unwrapping", "radar"),
    ),
    "dem": Stage(_dem, ("unwrapped", "images"), ("height",), ("height",)),
    "accuracy": Stage(_accuracy, ("dem", "truth"), ("accuracy",), ("accuracy",)),
    "registration": Stage(
        _registration,
        ("trajectory",),
        ("radar", "imaging", "registration"),
        ("registration", "echo", "imaging"),
    ),
}
"""The chain in order; a stage makes the product of its name."""


def run_stage(name: str, products: Mapping[str, xr.Dataset], study: config.Study) -> xr.Dataset:
    """Compute one stage.

    Parameters
    ----------
    name
        A key of `STAGES`.
    products
        The products that it reads, by name; others are not passed on.
    study
        The configuration.

    Returns
    -------
    xarray.Dataset
        The product of the stage's name.
    """
    stage = STAGES[name]
    logger.info("stage %s", name)
    part = study.part({section: getattr(study, section) for section in stage.sections})
    return stage.compute({key: products[key] for key in stage.inputs}, part)


def run(study: config.Study, only: str | None = None) -> Products:
    """Take a study through all stages in memory.

    Parameters
    ----------
    study
        The configuration.
    only
        A product: compute no more than it needs.

    Returns
    -------
    dict of xarray.Dataset
        Every product computed, by name.

    Raises
    ------
    KeyError
        If there is no such product.
    """
    wanted = set(STAGES) if only is None else _needed(only)
    products: Products = {}
    for name in STAGES:
        if name in wanted:
            products[name] = run_stage(name, products, study)
    return products


def _needed(product: str) -> set[str]:
    return {product}.union(*(_needed(name) for name in STAGES[product].inputs))
