"""The configuration: every key, its unit, its bounds and its place in the paper.

The models hold no defaults: ``config/paper.yaml`` has every value, other studies override it.
Checks that need radar physics are in `vinsar.study.validation`.
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


def _key(description: str, paper: str, **bounds: Any) -> Any:
    """Describe one key: what it means, where the paper gives it, and its bounds."""
    return Field(description=description, json_schema_extra={"paper": paper}, **bounds)


class Section(BaseModel):
    """A part of the configuration that never changes and knows all its keys."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, strict=True, validate_default=True
    )


class Radar(Section):
    """The radar and its antennas (Table 1)."""

    system: Literal["rail", "transmit_pair", "receive_pair"] = _key(
        "antenna arrangement: a cart with both antennas on a roof rail, or switched arrays in its "
        "place: one receives and transmitters stand at two heights, or two receive at two heights "
        "and one transmitter stands",
        "section 1",
    )
    start_frequency_hz: float = _key("lowest frequency", "Table 1", gt=0)
    stop_frequency_hz: float = _key("highest frequency", "Table 1", gt=0)
    frequency_count: int = _key("number of frequencies, evenly spaced", "not given", ge=2)
    aperture_length_m: float = _key(
        "length of the aperture along x: of the rail or the array", "Table 1", gt=0
    )
    position_spacing_m: float = _key(
        "spacing of the antenna positions, or of the array's elements", "Table 1", gt=0
    )
    rail_height_m: float = _key(
        "height above ground of the lower antenna on the rail, or of the array (the lower of two), "
        "H0",
        "not given",
        gt=0,
    )
    baseline_m: float = _key(
        "distance between the antennas, the transmitters of a transmit pair, or the arrays, B",
        "Table 1",
        gt=0,
    )
    baseline_angle_deg: float = _key(
        "attitude of the baseline from horizontal, beta; 90 is vertical", "Table 1", ge=0, le=180
    )
    transmitter_x_m: float = _key(
        "place of an array's transmitter (the lower of two) along the array, from its middle",
        "not given",
    )
    transmitter_y_m: float = _key("its place ahead of the array", "not given")
    transmitter_height_m: float = _key("its height above ground", "not given", gt=0)
    dwell_s: float = _key("time for each frequency of an array's sweep", "not given", gt=0, le=1)


class _Placed(Section):
    """Something at a place of the scene."""

    x_m: float = _key("position of its centre along the rail", "ours")
    y_m: float = _key("position of its centre ahead", "ours")


class _Rectangle(_Placed):
    """A rectangle at a place of the scene."""

    size_x_m: float = _key("extent along x, before its rotation", "ours", gt=0)
    size_y_m: float = _key("extent along y, before its rotation", "ours", gt=0)
    rotation_deg: float = _key(
        "rotation from x towards y; 0 if left out", "ours", default=0.0, ge=-180, le=180
    )

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches from its centre along x and y, m."""
        cosine, sine = (abs(part(radians(self.rotation_deg))) for part in (cos, sin))
        half_x, half_y = self.size_x_m / 2, self.size_y_m / 2
        return half_x * cosine + half_y * sine, half_x * sine + half_y * cosine


class _Disc(_Placed):
    """A disc at a place of the scene."""

    diameter_m: float = _key("diameter on the ground", "ours", gt=0)

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches from its centre along x and y, m."""
        return self.diameter_m / 2, self.diameter_m / 2


class _Object(_Placed):
    """Something that rises above the ground or falls below it."""

    reflectivity: float | None = _key(
        "its reflectivity; that of the ground beneath if left out", "ours", default=None, ge=0
    )


class Box(_Object, _Rectangle):
    """A box: upright walls, a top that follows the ground beneath."""

    shape: Literal["box"] = _key("a box", "ours")
    height_m: float = _key("height above the ground beneath", "ours", gt=0)


class Stump(_Object, _Disc):
    """An upright cylinder."""

    shape: Literal["stump"] = _key("a stump", "ours")
    height_m: float = _key("height above the ground beneath", "ours", gt=0)


class Mound(_Object, _Disc):
    """A mound: the cap of a sphere."""

    shape: Literal["mound"] = _key("a mound", "ours")
    height_m: float = _key("height of its top above the ground beneath", "ours", gt=0)


class Ditch(_Object, _Rectangle):
    """A trench with upright walls."""

    shape: Literal["ditch"] = _key("a ditch", "ours")
    depth_m: float = _key("depth below the ground around", "ours", gt=0)


class Pit(_Object, _Disc):
    """A round hole with an upright wall."""

    shape: Literal["pit"] = _key("a pit", "ours")
    depth_m: float = _key("depth below the ground around", "ours", gt=0)


class Patch(_Rectangle):
    """Ground of another reflectivity, without height."""

    reflectivity: float = _key("its reflectivity", "section 1, without a figure", ge=0)


SceneObject = Annotated[Box | Stump | Mound | Ditch | Pit, Field(discriminator="shape")]


class Scene(Section):
    """The true terrain: for the simulated echo and the metrics, never for the processing."""

    terrain: Literal["peaks", "flat", "file"] = _key(
        "shape of the terrain; `file` is your own (docs/own-data.md)", "section 2"
    )
    file: str | None = _key(
        "netCDF or GeoTIFF file with the heights of the terrain `file`; paths begin in the "
        "repository's folder",
        "ours",
    )
    origin_easting_m: float = _key("easting (x) of the vehicle in the file", "ours")
    origin_northing_m: float = _key("northing (y) of the vehicle in the file", "ours")
    heading_deg: float = _key(
        "direction ahead, clockwise from the file's y axis (grid north)", "ours", ge=-360, le=360
    )
    ground_height_m: float | None = _key(
        "height in the file that becomes 0, the ground plane; null for the file's own height at "
        "the vehicle",
        "ours",
    )
    peak_height_m: float = _key("height of the highest top of `peaks`", "section 2", gt=0)
    x_min_m: float = _key("left edge", "section 2")
    x_max_m: float = _key("right edge", "section 2")
    y_min_m: float = _key("near edge", "section 2")
    y_max_m: float = _key("far edge", "section 2")
    terrain_spacing_m: float = _key(
        "spacing of the raster that represents the terrain", "not given", gt=0
    )
    facet_size_m: float = _key("side of a facet", "section 2.1, without a figure", gt=0)
    facet_jitter: float = _key(
        "random displacement of the facets, as a fraction of the facet size (full width)",
        "section 2.1, without a figure",
        ge=0,
        le=1,
    )
    reflectivity_offset: float = _key(
        "reflectivity is the height in metres plus this", "section 2", gt=0
    )
    roughness_std_m: float = _key(
        "standard deviation of the random roughness of the ground; 0 for none", "ours", ge=0
    )
    roughness_correlation_m: float = _key(
        "distance at which the roughness is correlated by 1/e", "ours", gt=0
    )
    objects: Annotated[tuple[SceneObject, ...], Field(strict=False)] = _key(
        "obstacles and holes, added to the terrain", "sections 1 and 3, without a figure"
    )
    patches: Annotated[tuple[Patch, ...], Field(strict=False)] = _key(
        "ground of another reflectivity, without height", "section 1, without a figure"
    )


class Measurement(Section):
    """Echoes of your own in place of simulated ones (docs/own-data.md)."""

    file: str | None = _key(
        "netCDF file of measured echoes; paths begin in the repository's folder. The section "
        "`radar` then comes from the file; `scene`, `echo` and `motion` mean nothing",
        "ours",
    )


class Echo(Section):
    """How the echo is simulated."""

    reflectivity: Literal["amplitude", "power"] = _key(
        "what the scene's reflectivity weights: the echo's amplitude or its power", "not given"
    )
    occlusion: bool = _key("terrain hides what lies behind it (Eqs. 8-9)", "section 2.1")
    spreading: bool = _key(
        "amplitude falls with 1 / (transmit range x receive range), relative to the scene centre",
        "not mentioned",
    )
    snr_db: float | None = _key(
        "signal-to-noise ratio in a range-compressed resolution cell; null for no noise",
        "not mentioned",
        ge=-40,
        le=120,
    )
    coupling_db: float | None = _key(
        "power of the coupling between transmitter and receiver over the mean power of the scene, "
        "both in a range-compressed resolution cell; null for none",
        "future work",
        ge=-40,
        le=140,
    )
    coupling_path_m: float = _key(
        "path of the coupling inside the radar; the distance between the antennas comes to it",
        "not given",
        ge=0,
    )
    coupling_variation_db: float | None = _key(
        "what of the coupling changes at random from position to position, over the coupling; "
        "null for none",
        "not given",
        ge=-140,
        le=0,
    )
    accuracy_db: float = _key(
        "largest error of the fast sum against the direct one; from -85 on, many times as fast",
        "not given",
        ge=-200,
        le=-40,
    )


class Motion(Section):
    """Errors of the antenna positions (Fig. 5)."""

    axis: Literal["x", "y", "z"] = _key("axis along which the positions err", "section 2.4")
    level_wavelengths: float = _key(
        "standard deviation of the error in wavelengths; 0 for none", "Fig. 5", ge=0
    )
    distribution: Literal["uniform", "normal"] = _key(
        "of the errors; a uniform one has the half-width sqrt(3) sigma", "section 2.4"
    )
    channels: Literal["common", "independent"] = _key(
        "one error for both antennas (the vehicle shakes), or one for each (their positions are "
        "measured by themselves)",
        "not given",
    )
    spectrum: Literal["white", "sinusoidal", "random_walk"] = _key(
        "independent errors, one vibration, or drift", "section 2.4 has white errors"
    )
    cycles_per_aperture: float = _key("periods of the vibration over the scan", "ours", gt=0)
    affects: Literal["recorded", "true"] = _key(
        "what errs: the positions that imaging is told, or the true ones while it is told the "
        "undisturbed ones",
        "section 2.4 has measurement errors",
    )


class Suppression(Section):
    """Suppression of the coupling between transmitter and receiver."""

    method: Literal["none", "gate", "common", "both"] = _key(
        "what is removed from the echo: returns from within the gate, what is common to all "
        "antenna positions, or both",
        "future work",
    )
    gate_range_m: float = _key("slant range up to which the gate removes returns", "ours", gt=0)


class Vehicle(Section):
    """The vehicle's way during the scan, and what imaging is told of it."""

    forward_speed_m_per_s: float = _key(
        "constant speed ahead during the scan", "section 1, without a figure", ge=0, le=60
    )
    scan_duration_s: float = _key(
        "time from the first antenna position to the last; only a moving vehicle feels it",
        "section 1, without a figure",
        gt=0,
        le=60,
    )
    speed_correction: Literal["none", "exact", "sensor"] = _key(
        "the speed that imaging is told: zero, the true one, or that of the speed sensor",
        "section 1",
    )
    speed_error_m_per_s: float = _key(
        "standard deviation of the sensor's error, normal and constant during a scan",
        "not given",
        ge=0,
        le=60,
    )


class Imaging(Section):
    """Range compression and back-projection."""

    x_min_m: float = _key("left edge of the image", "section 2")
    x_max_m: float = _key("right edge of the image", "section 2")
    y_min_m: float = _key("near edge of the image", "section 2")
    y_max_m: float = _key("far edge of the image", "section 2")
    grid_spacing_m: float = _key("pixel spacing of image and DEM", "not given", gt=0)
    range_window: Literal["rectangular", "hann", "hamming", "blackman"] = _key(
        "weighting of the frequencies", "not mentioned"
    )
    aperture_window: Literal["rectangular", "hann", "hamming", "blackman"] = _key(
        "weighting of the antenna positions", "not mentioned"
    )
    oversampling: int = _key(
        "range samples per resolution cell before interpolation", "not given", ge=2, le=128
    )
    interpolation: Literal["linear", "cubic"] = _key(
        "interpolation of the range profiles: linear errs by -64 dB at an oversampling of 16; "
        "cubic by -79 dB at 4, -93 dB at 6 and -103 dB at 8",
        "not given",
    )


class Interferogram(Section):
    """Interferogram and coherence."""

    coherence_window_px: int = _key(
        "side of the multilook window of the coherence, odd", "not mentioned", ge=1
    )


class Filtering(Section):
    """The filter of the interferometric phase."""

    method: Literal["goldstein", "boxcar", "none"] = _key("the filter", "section 2.2")
    goldstein_alpha: float = _key(
        "strength: exponent of the smoothed spectrum", "reference 19", ge=0, le=1
    )
    goldstein_patch_px: int = _key("side of a patch", "reference 19", ge=4)
    goldstein_step_px: int = _key("step between patches", "reference 19", ge=1)
    boxcar_window_px: int = _key("side of the boxcar, odd", "not mentioned", ge=1)


class Unwrapping(Section):
    """Phase unwrapping."""

    method: Literal["whirlwind", "skimage", "kamui", "snaphu"] = _key(
        "the unwrapper; snaphu has to be installed by you", "section 2.3, reference 15"
    )


class Rectangle(Section):
    """A rectangle on the ground."""

    x_min_m: float = _key("left edge", "not given")
    x_max_m: float = _key("right edge", "not given")
    y_min_m: float = _key("near edge", "not given")
    y_max_m: float = _key("far edge", "not given")


class ControlPoint(Section):
    """A surveyed point."""

    x_m: float = _key("position along the rail", "section 2.3")
    y_m: float = _key("position ahead", "section 2.3")
    height_m: float = _key("surveyed height", "section 2.3")


class Height(Section):
    """Inversion of the phase and its unknown constant."""

    reference: Literal["level_ground", "control_points"] = _key(
        "what fixes the unknown phase constant", "section 2.3"
    )
    level_ground: Annotated[tuple[Rectangle, ...], Field(strict=False)] = _key(
        "ground that the user declares level", "not given"
    )
    level_ground_height_m: float = _key("height of the level ground", "not given")
    control_points: Annotated[tuple[ControlPoint, ...], Field(strict=False)] = _key(
        "points of known height, one or more", "section 2.3"
    )
    trend: Literal["constant", "plane"] = _key(
        "what is fitted to the reference's phase: a constant, or a plane in x and y", "section 2.3"
    )


class Detection(Section):
    """Detection of obstacles and holes on the heights, and on an image alone."""

    threshold_m: float = _key("height or depth from the ground that is an alarm", "ours", gt=0)
    noise_factor: float = _key(
        "an alarm exceeds as many standard deviations of the height's noise, as the coherence lets "
        "expect it; where they exceed the threshold, the ground is unknown",
        "ours",
        gt=0,
    )
    minimum_area_m2: float = _key("connected area that is an alarm", "ours", gt=0)
    ground_window_m: float | None = _key(
        "side of the running median that follows rolling ground; null for a plane alone",
        "ours",
        gt=0,
    )
    multilook_window_m: float = _key(
        "side of the window over which the image's power is averaged", "ours", gt=0
    )
    background_window_m: float = _key(
        "side of the window whose median power is that of the surroundings", "ours", gt=0
    )
    shadow_level_db: float = _key(
        "power relative to the surroundings below which the ground is unknown", "ours", lt=0
    )
    amplitude_threshold_db: float = _key(
        "power relative to the surroundings that is an alarm of the image alone", "ours", gt=0
    )


class Accuracy(Section):
    """What the height errors are held against."""

    tolerance_m: float = _key("height error that counts as within", "section 2.3", gt=0)


class Target(Section):
    """A point target of the registration analysis."""

    x_m: float = _key("position along the rail", "section 1.3")
    y_m: float = _key("position ahead", "section 1.3", gt=0)


class Registration(Section):
    """The analysis of image shifts without registration (Fig. 2)."""

    near: Target = _key("the near target", "section 1.3")
    far: Target = _key("the far target", "section 1.3")
    height_min_m: float = _key("lowest target height", "Fig. 2, without a figure")
    height_max_m: float = _key("highest target height", "Fig. 2, without a figure")
    height_count: int = _key("number of target heights", "Fig. 2, without a figure", ge=3)
    map_height_m: float = _key("target height of the map over the scene", "not given")


class BaselineErrors(Section):
    """Errors of the baseline that the inversion is told (section 1.2, Eqs. 5 and 12)."""

    length_std_m: float = _key("standard deviation of its length", "not given", gt=0, le=0.01)
    angle_std_deg: float = _key("standard deviation of its attitude", "not given", gt=0, le=1)
    draws: int = _key("random draws at each attitude", "ours", ge=2, le=100_000)


class Figures(Section):
    """How figures look; nothing here changes a number."""

    height_colormap: str = _key("colour map of heights, truth and reconstruction alike", "Fig. 3")
    phase_colormap: str = _key("cyclic colour map of wrapped phases", "Fig. 3")
    amplitude_range_db: float = _key("dynamic range of the images", "Fig. 3", gt=0)
    one_column_mm: float = _key(
        "width of the figures of one column; the height goes with it", "not given", ge=70, le=140
    )
    two_columns_mm: float = _key(
        "width of the figures of two columns; the height goes with it", "not given", ge=140, le=280
    )
    font_size_pt: float = _key("size of the figures' text at any width", "not given", ge=5, le=12)
    font: Literal["sans", "serif"] = _key(
        "DejaVu Sans or STIX, which is like Times; files embed it", "not given"
    )
    formats: Annotated[
        tuple[Literal["pdf", "svg", "png"], ...], Field(strict=False, min_length=1)
    ] = _key("files of each figure; the reports show the PNG", "not given")
    png_dpi: int = _key("resolution of the PNG files", "not given", ge=50, le=1200)


class Outputs(Section):
    """What `./run` makes besides the products of the chain."""

    figures: Annotated[tuple[str, ...], Field(strict=False)] = _key(
        "names of the figures; the sweeps that they show are run with them", "ours"
    )
    claims: bool = _key("hold the study against the paper's claims", "ours")


ELEVATION = (
    "terrain",
    "file",
    "origin_easting_m",
    "origin_northing_m",
    "heading_deg",
    "ground_height_m",
    "x_min_m",
    "x_max_m",
    "y_min_m",
    "y_max_m",
    "terrain_spacing_m",
    "reflectivity_offset",
)
"""Keys of `Scene` that decide what is read from the file of a terrain."""

SIMULATION = ("scene", "echo", "motion")
"""Sections that mean nothing to measured echoes."""


Override = dict[str, Any]


class Sweep(Section):
    """A sweep over keys of the configuration."""

    over: dict[str, Annotated[tuple[Any, ...], Field(strict=False, min_length=1)]] = _key(
        "values by dotted key, such as `radar.baseline_m`; the product of all lists is swept",
        "ours",
        min_length=1,
    )
    realizations: int = _key(
        "independent repetitions of each case: other speckle, noise and errors", "ours", ge=1
    )
    base: Override = _key("overrides that hold for all of its cases", "ours")


class Dask(Section):
    """Where sweeps run."""

    scheduler: Literal["threads", "processes"] = _key(
        "workers of this machine: threads share what they have computed, processes survive a "
        "crash of one",
        "ours",
    )
    address: str | None = _key(
        "address of a Dask scheduler that runs them instead; null for Dask's own configuration "
        "(DASK_SCHEDULER_ADDRESS) or this machine",
        "ours",
    )


class Study(Section):
    """A whole study."""

    study: str = _key(
        "name of the study; results go to results/<study>",
        "ours",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$",
    )
    seed: int = _key("seed of everything random", "ours", ge=0)
    realization: int = _key("number of the realization of everything random", "ours", ge=0)
    radar: Radar
    scene: Scene
    measurement: Measurement
    echo: Echo
    motion: Motion
    suppression: Suppression
    vehicle: Vehicle
    imaging: Imaging
    interferogram: Interferogram
    filtering: Filtering
    unwrapping: Unwrapping
    height: Height
    detection: Detection
    accuracy: Accuracy
    registration: Registration
    baseline_errors: BaselineErrors
    figures: Figures
    outputs: Outputs
    dask: Dask
    variants: dict[str, Override] = _key(
        "overrides by name; `./run variants` tabulates the accuracy of each", "ours"
    )
    sweeps: dict[str, Sweep] = _key(
        "sweeps by name; `./run results/<study>/sweeps/<name>.nc` computes one", "ours"
    )

    @classmethod
    def part(cls, values: Mapping[str, Any]) -> Study:
        """Return a study that has some of its parts and no others.

        A stage gets only the parts that it declares, so that it cannot depend on another unseen.

        Parameters
        ----------
        values
            Sections, as models or as plain values, by name; a name such as
            ``radar.frequency_count`` stands for a single key of a section.

        Returns
        -------
        Study
            Reading a part that is not there raises `AttributeError`.
        """
        parts: dict[str, Any] = {}
        single: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            section, _, key = name.partition(".")
            kind = cls.model_fields[section].annotation
            if key:
                single.setdefault(section, {})[key] = value
            elif isinstance(kind, type) and issubclass(kind, Section):
                parts[name] = kind.model_validate(value)
            elif isinstance(value, dict):
                parts[name] = TypeAdapter[Any](cast("Any", kind)).validate_python(value)
            else:
                parts[name] = value
        for section, keys in single.items():
            kind = cast("type[Section]", cls.model_fields[section].annotation)
            made = {
                # A list may hold models; plain values are what they are.
                key: TypeAdapter[Any](kind.model_fields[key].rebuild_annotation()).validate_python(
                    value
                )
                if isinstance(value, list)
                else value
                for key, value in keys.items()
            }
            parts[section] = kind.model_construct(**made)
        return cls.model_construct(**parts)

    def values(self, names: Iterable[str]) -> dict[str, Any]:
        """Return sections and single keys by name, as `part` takes them, in plain values."""
        result: dict[str, Any] = {}
        for name in names:
            section, _, key = name.partition(".")
            value = getattr(self, section)
            if key and isinstance(getattr(value, key), tuple):
                result[name] = value.model_dump(mode="json", include={key})[key]
                continue
            if key:
                value = getattr(value, key)
            if isinstance(value, dict):
                result[name] = {
                    label: item.model_dump(mode="json") if isinstance(item, Section) else item
                    for label, item in value.items()
                }
            else:
                plain = isinstance(value, Section)
                result[name] = value.model_dump(mode="json") if plain else value
        return result


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the models that an annotation names: those of a list's items, for example."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in models_in(part)]


def swept_section(study: Study, sweep: str, section: str) -> Any:
    """Return a section with the overrides that hold for all cases of a sweep.

    Parameters
    ----------
    study
        A study with this section and with ``sweeps``.
    sweep
        Name of the sweep.
    section
        Name of the section.

    Returns
    -------
    Section
        The section; what the sweep goes over is as in the study.
    """
    part = getattr(study, section)
    return part.model_copy(update=study.sweeps[sweep].base.get(section, {}))
