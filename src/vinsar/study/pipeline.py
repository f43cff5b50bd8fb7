"""The stages in order: what each reads, which configuration it depends on, what it computes.

`STAGES` is the one description of the chain. `run` takes a study through it in memory; the
workflow takes each stage through a rule of its own, with the same functions.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from vinsar.evaluation import accuracy, detection_accuracy, misregistration
from vinsar.foundations import variables
from vinsar.foundations.constants import CHANNELS
from vinsar.processing import (
    detection,
    filtering,
    focusing,
    height,
    interferogram,
    leakage,
    unwrapping,
)
from vinsar.radar import baseline, geometry, motion, trajectory, waveform
from vinsar.simulation import echo, scene, visibility
from vinsar.study import config

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

logger = logging.getLogger(__name__)

Products = dict[str, "xr.Dataset"]

# What a random draw is for; the number is part of its seed and never changes.
_JITTER, _NOISE, _MOTION, _BASELINE, _ROUGHNESS, _COUPLING, _SPEED = 0, 1, 2, 3, 4, 5, 6

# Slant range by which the profiles exceed the image: position errors shall not need new ones.
_PROFILE_MARGIN_M = 0.5

# Slant range around a point target that its image may need.
_POINT_MARGIN_M = 1.5


# Range samples a resolution cell of the profiles that show the coupling, and targets along x.
_PROFILE_SAMPLES, _TARGETS = 8, 17


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
        Parts of the configuration that it reads, and no others: sections, or single keys such as
        ``radar.frequency_count``.
    modules
        Modules whose code it runs, without those that they import.
    by_channel
        Whether each channel is computed from its own part of the inputs alone.
    optional
        Products that it reads if the study has them.
    """

    compute: Callable[[Products, config.Study], xr.Dataset]
    inputs: tuple[str, ...]
    sections: tuple[str, ...]
    modules: tuple[str, ...]
    by_channel: bool = False
    optional: tuple[str, ...] = ()


def _rng(study: config.Study, *purpose: int) -> np.random.Generator:
    key = (study.realization, *purpose)
    return np.random.default_rng(np.random.SeedSequence(study.seed, spawn_key=key))


def _frequency(study: config.Study) -> Floats:
    return waveform.frequencies(
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
    return trajectory.planned(study.radar)


def _displaced(products: Products, study: config.Study, affected: str) -> xr.Dataset:
    options = study.motion
    if options.affects != affected or options.level_wavelengths == 0:
        return products["trajectory"]

    def draw(channel: int, positions: int) -> Floats:
        return motion.errors(
            positions,
            std_m=options.level_wavelengths
            * waveform.wavelength(waveform.carrier(_frequency(study))),
            distribution=options.distribution,
            spectrum=options.spectrum,
            cycles_per_aperture=options.cycles_per_aperture,
            rng=_rng(study, _MOTION, channel if options.channels == "independent" else 0),
        )

    return motion.displace(products["trajectory"], axis=options.axis, draw=draw)


def _true_trajectory(products: Products, study: config.Study) -> xr.Dataset:
    return motion.advance(
        _displaced(products, study, "true"),
        speed_m_per_s=study.vehicle.forward_speed_m_per_s,
        duration_s=study.vehicle.scan_duration_s,
    )


def _told_speed(study: config.Study) -> float:
    """Return the speed that imaging is told, m/s."""
    options = study.vehicle
    if options.speed_correction == "none":
        return 0.0
    if options.speed_correction == "exact":
        return options.forward_speed_m_per_s
    # ASSUME: The sensor's error is normal and constant during a scan. One draw a realization,
    # whatever the speed and the error's size.
    error = options.speed_error_m_per_s * _rng(study, _SPEED).standard_normal()
    return options.forward_speed_m_per_s + float(error)


def _recorded_trajectory(products: Products, study: config.Study) -> xr.Dataset:
    return motion.advance(
        _displaced(products, study, "recorded"),
        speed_m_per_s=_told_speed(study),
        duration_s=study.vehicle.scan_duration_s,
    )


def _roughness(products: Products, study: config.Study) -> xr.Dataset:
    del products
    return scene.roughness(
        x_min_m=study.scene.x_min_m,
        x_max_m=study.scene.x_max_m,
        y_min_m=study.scene.y_min_m,
        y_max_m=study.scene.y_max_m,
        spacing_m=study.scene.terrain_spacing_m,
        std_m=study.scene.roughness_std_m,
        correlation_m=study.scene.roughness_correlation_m,
        rng=_rng(study, _ROUGHNESS),
    )


def _terrain(products: Products, study: config.Study) -> xr.Dataset:
    options = study.scene
    if options.terrain == "file":
        ground = products["elevation"]
    else:
        ground = scene.terrain(
            options.terrain,
            x_min_m=options.x_min_m,
            x_max_m=options.x_max_m,
            y_min_m=options.y_min_m,
            y_max_m=options.y_max_m,
            spacing_m=options.terrain_spacing_m,
            peak_height_m=options.peak_height_m,
            reflectivity_offset=options.reflectivity_offset,
        )
    return scene.furnish(
        ground, products["roughness"], objects=options.objects, patches=options.patches
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
        products["terrain"], products["facets"], products["true_trajectory"]
    )


def _truth(products: Products, study: config.Study) -> xr.Dataset:
    x, y = image_axes(study.imaging)
    return visibility.truth_on_grid(products["terrain"], products["true_trajectory"], x, y)


def _echo(products: Products, study: config.Study) -> xr.Dataset:
    return echo.simulate(
        products["facets"],
        products["true_trajectory"],
        products["visibility"] if study.echo.occlusion else None,
        frequency=_frequency(study),
        reflectivity=study.echo.reflectivity,
        spreading=study.echo.spreading,
        accuracy_db=study.echo.accuracy_db,
    )


def _received(products: Products, study: config.Study) -> xr.Dataset:
    clean, options = products["echo"], study.echo
    if options.snr_db is None and options.coupling_db is None:
        return clean
    # The antennas at rest: over a whole scan a vehicle in motion sees a wider swath than from any
    # one place, and motion leaves a transmitter's distance from its receiver as it is.
    facets, antennas = products["facets"], products["trajectory"]
    near, far = trajectory.range_extent(
        antennas, *_facet_extent(facets), facets["facet_position"].values[:, 2]
    )

    def rngs(purpose: int) -> list[np.random.Generator]:
        return [_rng(study, purpose, channel) for channel in range(clean.sizes["channel"])]

    result = clean
    if options.snr_db is not None:
        result = echo.add_noise(clean, snr_db=options.snr_db, swath_m=far - near, rngs=rngs(_NOISE))
    if options.coupling_db is not None:
        result = echo.add_coupling(
            result,
            clean,
            antennas,
            coupling_db=options.coupling_db,
            path_m=options.coupling_path_m,
            variation_db=options.coupling_variation_db,
            swath_m=far - near,
            rngs=rngs(_COUPLING),
        )
    return result


def _facet_extent(facets: xr.Dataset) -> tuple[Floats, Floats]:
    position = facets["facet_position"].values
    least, most = position.min(axis=0), position.max(axis=0)
    return np.array([least[0], most[0]]), np.array([least[1], most[1]])


def _profiles(products: Products, study: config.Study) -> xr.Dataset:
    antennas = motion.advance(
        products["trajectory"],
        speed_m_per_s=_told_speed(study),
        duration_s=study.vehicle.scan_duration_s,
    )
    near, far = trajectory.range_extent(antennas, *image_axes(study.imaging))
    return focusing.compress(
        leakage.suppress(products["received"], **study.suppression.model_dump()),
        near_range_m=max(0.0, near - _PROFILE_MARGIN_M),
        far_range_m=far + _PROFILE_MARGIN_M,
        window=study.imaging.range_window,
        oversampling=study.imaging.oversampling,
        interpolation=study.imaging.interpolation,
    )


def _images(products: Products, study: config.Study) -> xr.Dataset:
    x, y = image_axes(study.imaging)
    return focusing.backproject(
        products["profiles"],
        products["recorded_trajectory"],
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


def looks(antennas: xr.Dataset, study: config.Study) -> float:
    """Return the effective number of looks of the coherence.

    The multilook window's area over that of a resolution cell at the middle of the image, at
    least 1: pixels finer than the resolution are not independent.

    Parameters
    ----------
    antennas
        Product ``trajectory``.
    study
        The configuration.
    """
    x, y = image_axes(study.imaging)
    cell = waveform.ground_resolution(
        trajectory.apertures(antennas)[0],
        (x[0] + x[-1]) / 2,
        (y[0] + y[-1]) / 2,
        frequency=_frequency(study),
    )
    side = study.interferogram.coherence_window_px * study.imaging.grid_spacing_m
    return max(1.0, float(side**2 / (cell[0] * cell[1])))


def _unwrapped(products: Products, study: config.Study) -> xr.Dataset:
    return unwrapping.unwrap(
        products["filtered"],
        products["interferogram"]["coherence"],
        method=study.unwrapping.method,
        looks=looks(products["trajectory"], study),
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


def _detections(products: Products, study: config.Study) -> xr.Dataset:
    return detection.detect(
        products["dem"],
        products["images"],
        products["interferogram"],
        options=study.detection,
        looks=looks(products["trajectory"], study),
    )


def _detection_accuracy(products: Products, study: config.Study) -> xr.Dataset:
    return detection_accuracy.evaluate(
        products["detections"],
        products["truth"],
        study.scene.objects,
        options=study.detection,
    )


def _accuracy(products: Products, study: config.Study) -> xr.Dataset:
    return accuracy.evaluate(
        products["dem"], products["truth"], tolerance_m=study.accuracy.tolerance_m
    )


def _focus(products: Products, study: config.Study) -> xr.Dataset:
    truth, recorded = products["true_trajectory"], products["recorded_trajectory"]
    frequency = _frequency(study)
    x, y = image_axes(study.imaging)
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


def _coupling(products: Products, study: config.Study) -> xr.Dataset:
    antennas, clean, received = (products[name] for name in ("trajectory", "echo", "received"))
    frequency, options = _frequency(study), study.suppression
    swath = trajectory.range_extent(antennas, *image_axes(study.imaging))

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


def _baseline_angle(products: Products, study: config.Study) -> xr.Dataset:
    del products
    options = study.baseline_errors
    return baseline.angle_errors(
        baseline.view(study.radar, study.scene),
        baseline_m=study.radar.baseline_m,
        length_std_m=options.length_std_m,
        angle_std_deg=options.angle_std_deg,
        draws=options.draws,
        rng=_rng(study, _BASELINE),
    )


def _registration(products: Products, study: config.Study) -> xr.Dataset:
    antennas = products["trajectory"]
    frequency = _frequency(study)
    options = study.registration

    def image_point(target: Floats) -> misregistration.Focus:
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

    x, y = image_axes(study.imaging)
    return misregistration.analyze(
        trajectory.apertures(antennas),
        image_point,
        targets={
            "near": (options.near.x_m, options.near.y_m),
            "far": (options.far.x_m, options.far.y_m),
        },
        heights=np.linspace(options.height_min_m, options.height_max_m, options.height_count),
        x=x,
        y=y,
        map_height_m=options.map_height_m,
        frequency=frequency,
    )


_WAVEFORM = ("radar.start_frequency_hz", "radar.stop_frequency_hz", "radar.frequency_count")
_ANTENNAS = (
    "radar.system",
    "radar.aperture_length_m",
    "radar.position_spacing_m",
    "radar.rail_height_m",
    "radar.baseline_m",
    "radar.baseline_angle_deg",
    "radar.transmitter_x_m",
    "radar.transmitter_y_m",
    "radar.transmitter_height_m",
)
_DRAWS = ("seed", "realization")
_GRID = (
    "imaging.x_min_m",
    "imaging.x_max_m",
    "imaging.y_min_m",
    "imaging.y_max_m",
    "imaging.grid_spacing_m",
)
_LOOKS = (*_WAVEFORM, *_GRID, "interferogram")

STAGES: dict[str, Stage] = {
    # By itself, so that without roughness the terrain does not depend on what is drawn.
    "roughness": Stage(
        _roughness,
        (),
        (
            *_DRAWS,
            "scene.x_min_m",
            "scene.x_max_m",
            "scene.y_min_m",
            "scene.y_max_m",
            "scene.terrain_spacing_m",
            "scene.roughness_std_m",
            "scene.roughness_correlation_m",
        ),
        ("simulation.scene",),
    ),
    "terrain": Stage(
        _terrain, ("roughness",), ("scene",), ("simulation.scene",), optional=("elevation",)
    ),
    "facets": Stage(
        _facets,
        ("terrain",),
        (*_DRAWS, "scene.facet_size_m", "scene.facet_jitter"),
        ("simulation.scene",),
    ),
    "trajectory": Stage(_trajectory, (), _ANTENNAS, ("radar.trajectory",)),
    "true_trajectory": Stage(
        _true_trajectory,
        ("trajectory",),
        (
            *_DRAWS,
            *_WAVEFORM,
            "motion",
            "vehicle.forward_speed_m_per_s",
            "vehicle.scan_duration_s",
        ),
        ("radar.motion", "radar.waveform"),
    ),
    "visibility": Stage(
        _visibility,
        ("terrain", "facets", "true_trajectory"),
        (),
        ("simulation.visibility",),
        by_channel=True,
    ),
    "truth": Stage(_truth, ("terrain", "true_trajectory"), _GRID, ("simulation.visibility",)),
    "echo": Stage(
        _echo,
        ("facets", "true_trajectory", "visibility"),
        (
            *_WAVEFORM,
            "echo.reflectivity",
            "echo.occlusion",
            "echo.spreading",
            "echo.accuracy_db",
        ),
        ("simulation.echo",),
        by_channel=True,
    ),
    "received": Stage(
        _received,
        ("echo", "facets", "trajectory"),
        (
            *_DRAWS,
            "echo.snr_db",
            "echo.coupling_db",
            "echo.coupling_path_m",
            "echo.coupling_variation_db",
        ),
        ("simulation.echo", "radar.trajectory"),
    ),
    "profiles": Stage(
        _profiles,
        ("received", "trajectory"),
        (
            *_DRAWS,
            *_GRID,
            "vehicle",
            "suppression",
            "imaging.range_window",
            "imaging.oversampling",
            "imaging.interpolation",
        ),
        ("processing.leakage", "processing.focusing", "radar.trajectory", "radar.motion"),
    ),
    "recorded_trajectory": Stage(
        _recorded_trajectory,
        ("trajectory",),
        (*_DRAWS, *_WAVEFORM, "motion", "vehicle"),
        ("radar.motion", "radar.waveform"),
    ),
    "images": Stage(
        _images,
        ("profiles", "recorded_trajectory"),
        (*_GRID, "imaging.aperture_window"),
        ("processing.focusing",),
        by_channel=True,
    ),
    "interferogram": Stage(
        _interferogram, ("images",), ("interferogram",), ("processing.interferogram",)
    ),
    "filtered": Stage(_filtered, ("interferogram",), ("filtering",), ("processing.filtering",)),
    "unwrapped": Stage(
        _unwrapped,
        ("filtered", "interferogram", "trajectory"),
        (*_LOOKS, "unwrapping"),
        ("processing.unwrapping", "radar.waveform", "radar.trajectory"),
    ),
    "dem": Stage(_dem, ("unwrapped", "images"), ("height",), ("processing.height",)),
    "detections": Stage(
        _detections,
        ("dem", "images", "interferogram", "trajectory"),
        (*_LOOKS, "detection"),
        ("processing.detection", "radar.waveform", "radar.trajectory"),
    ),
    "detection_accuracy": Stage(
        _detection_accuracy,
        ("detections", "truth"),
        ("scene.objects", "detection"),
        ("evaluation.detection_accuracy",),
    ),
    "accuracy": Stage(_accuracy, ("dem", "truth"), ("accuracy",), ("evaluation.accuracy",)),
    "focus": Stage(
        _focus,
        ("true_trajectory", "recorded_trajectory"),
        (*_WAVEFORM, *_GRID, "imaging.range_window", "imaging.aperture_window"),
        ("radar.motion", "radar.waveform"),
    ),
    "registration": Stage(
        _registration,
        ("trajectory",),
        (*_WAVEFORM, "imaging", "registration"),
        ("evaluation.misregistration", "simulation.echo", "processing.focusing"),
    ),
    "coupling": Stage(
        _coupling,
        ("trajectory", "echo", "received"),
        (*_WAVEFORM, *_GRID, "suppression.gate_range_m"),
        ("processing.leakage", "simulation.echo", "processing.focusing", "radar.trajectory"),
    ),
    "baseline_angle": Stage(
        _baseline_angle, (), (*_DRAWS, "radar", "scene", "baseline_errors"), ("radar.baseline",)
    ),
}
"""The chain; a stage makes the product of its name. What sweeps change least comes first."""

MEASURED = ("received", "trajectory", "recorded_trajectory")
"""Products that come from a file of measured echoes."""


def from_files(study: config.Study) -> tuple[str, ...]:
    """Return the products that a study takes from files of the user's own."""
    if study.measurement.file is not None:
        return MEASURED
    return ("elevation",) if study.scene.terrain == "file" else ()


def stages(study: config.Study) -> dict[str, Stage]:
    """Return the stages that a study has, in order.

    Measured echoes come without the true scene: what is computed from it, or would compare with
    it, is left out.
    """
    if study.measurement.file is None:
        return STAGES
    found: dict[str, Stage] = {}
    for name, stage in STAGES.items():
        simulated = any(key.split(".")[0] in config.SIMULATION for key in stage.sections)
        known = set(stage.inputs) <= {*MEASURED, *found}
        if name not in MEASURED and known and not simulated:
            found[name] = stage
    return found


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
    part = study.part(study.values(stage.sections))
    inputs = {key: products[key] for key in stage.inputs}
    inputs |= {key: products[key] for key in stage.optional if key in products}
    if not stage.by_channel:
        return stage.compute(inputs, part)
    return join_channels(
        [stage.compute(split_channel(inputs, channel), part) for channel in CHANNELS]
    )


def split_channel(products: Mapping[str, xr.Dataset], channel: str) -> Products:
    """Return one channel's part of each product."""
    index = [CHANNELS.index(channel)]
    return {
        name: product.isel(channel=index) if "channel" in product.dims else product
        for name, product in products.items()
    }


def join_channels(parts: list[xr.Dataset]) -> xr.Dataset:
    """Return one product from its channels' parts; what has no channel is the first part's."""
    first = parts[0]
    joined = {}
    for name, values in first.variables.items():
        if "channel" in values.dims:
            pieces = [part.variables[name].values for part in parts]
            axis = values.dims.index("channel")
            joined[name] = (values.dims, np.concatenate(pieces, axis=axis), values.attrs)
        else:
            joined[name] = (values.dims, values.values, values.attrs)
    coords = {name: joined.pop(name) for name in first.coords}
    return xr.Dataset(joined, coords)


def run(
    study: config.Study, only: str | None = None, given: Mapping[str, xr.Dataset] | None = None
) -> Products:
    """Take a study through all stages in memory.

    Parameters
    ----------
    study
        The configuration.
    only
        A product: compute no more than it needs.
    given
        Products that are there already, such as those from files of the user's own
        (`ingest.read`); they are not computed.

    Returns
    -------
    dict of xarray.Dataset
        Every product given and computed, by name.

    Raises
    ------
    KeyError
        If there is no such product.
    ValueError
        If a product from a file is not given.
    """
    products: Products = dict(given or {})
    missing = [name for name in from_files(study) if name not in products]
    if missing:
        raise ValueError(f"{', '.join(missing)} must be given: the study takes them from a file")
    waiting = {name: stage for name, stage in stages(study).items() if name not in products}
    for name in waiting if only is None else needed([only], waiting):
        products[name] = run_stage(name, products, study)
    return products


def needed(
    products: Iterable[str], available: Mapping[str, Stage] | None = None
) -> dict[str, Stage]:
    """Return the stages that some products need, their own included, in order.

    Parameters
    ----------
    products
        Names of products.
    available
        The stages there are, all of the chain by default; what none of them makes is there
        already.

    Returns
    -------
    dict of Stage
        The stages by name.

    Raises
    ------
    KeyError
        If none of them makes one of the products.
    """
    available = STAGES if available is None else available
    wanted: set[str] = set()

    def want(name: str) -> None:
        wanted.add(name)
        for source in available[name].inputs:
            if source in available:
                want(source)

    for product in products:
        want(product)
    return {name: stage for name, stage in available.items() if name in wanted}
