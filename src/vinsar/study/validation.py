"""The configuration held against its own bounds and against radar physics, before anything runs.

All faults come in one message: each with the key's path, its value, and what is allowed.
"""

from __future__ import annotations

import difflib
import inspect
import itertools
import re
import typing
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ValidationError

from vinsar.foundations import colormaps
from vinsar.radar import aperture, baseline, geometry, motion, trajectory, waveform
from vinsar.study import config

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    Rule = Callable[..., Iterator["Fault"]]


_SHAPES = frozenset(
    name
    for model in config.models_in(config.SceneObject)
    for name in typing.get_args(model.model_fields["shape"].annotation)
)


@dataclass(frozen=True)
class Fault:
    """A key that is wrong.

    Attributes
    ----------
    key
        Path of the key, such as ``radar.baseline_m``.
    value
        What it holds, if it exists.
    allowed
        What would be right.
    """

    key: str
    value: Any
    allowed: str

    def __str__(self) -> str:
        value = "" if self.value is None else f" = {self.value!r}"
        return f"{self.key}{value}: {self.allowed}"


class ConfigurationError(ValueError):
    """A configuration with faults.

    Attributes
    ----------
    faults
        All that were found.
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        count = len(self.faults)
        lines = "".join(f"\n  {fault}" for fault in self.faults)
        super().__init__(f"The configuration has {count} fault{'s' * (count > 1)}:{lines}")


def read(*paths: str | Path) -> dict[str, Any]:
    """Read configuration files, each overriding the ones before it, and check nothing.

    Parameters
    ----------
    paths
        YAML files; the first is usually ``config/paper.yaml``, which has every key.

    Returns
    -------
    dict
        Keys with their values.

    Raises
    ------
    ValueError
        If a file cannot be read as YAML.
    """
    import yaml

    merged: dict[str, Any] = {}
    for path in map(Path, paths):
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
        except (OSError, yaml.YAMLError) as error:
            raise ValueError(f"cannot read the configuration {path}: {error}") from error
        if not isinstance(content, dict):
            raise ValueError(f"{path} holds {type(content).__name__}; keys with values are needed")
        merged = merge(merged, content)
    return merged


def load(*paths: str | Path) -> config.Study:
    """Read configuration files, each overriding the ones before it, and check the result.

    Parameters
    ----------
    paths
        YAML files, as in `read`.

    Returns
    -------
    config.Study
        The checked configuration.

    Raises
    ------
    ConfigurationError
        If anything is wrong with it.
    ValueError
        If a file cannot be read as YAML.
    """
    return check(read(*paths))


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with some keys changed, section by section; lists are replaced."""
    result = dict(base)
    for key, value in changes.items():
        old = result.get(key)
        deeper = isinstance(value, dict) and isinstance(old, dict)
        result[key] = merge(old or {}, value) if deeper else value
    return result


def check(raw: Mapping[str, Any]) -> config.Study:
    """Check a configuration and return it as a study.

    Parameters
    ----------
    raw
        Every key with its value, as read from YAML.

    Returns
    -------
    config.Study
        The checked configuration.

    Raises
    ------
    ConfigurationError
        If anything is wrong with it.
    """
    faults: list[Fault] = []
    valid: dict[str, Any] = {}
    try:
        study = config.Study.model_validate(raw)
        valid = {name: getattr(study, name) for name in config.Study.model_fields}
    except ValidationError as error:
        faults = [_fault(item) for item in error.errors()]
        wrong = {fault.key.split(".")[0].split("[")[0] for fault in faults}
        valid = {
            name: field.annotation.model_validate(raw[name])
            for name, field in config.Study.model_fields.items()
            if name not in wrong
            and isinstance(field.annotation, type)
            and issubclass(field.annotation, BaseModel)
        }
    valid = _meaningful(valid)
    # A section that is wrong by itself would only confuse the rules that come after.
    for rules in (_WITHIN_SECTIONS, (_ahead,), _ACROSS_SECTIONS):
        found = list(_apply(rules, valid))
        faults += found
        for fault in found:
            valid.pop(fault.key.split(".")[0], None)
    if faults:
        raise ConfigurationError(faults)
    return study


def variants(study: config.Study) -> dict[str, config.Study]:
    """Return a study's variants, all checked.

    They are checked when they are asked for: a small study inherits the paper's variants, not all
    of which suit it.

    Parameters
    ----------
    study
        The study.

    Returns
    -------
    dict of config.Study
        Each variant by its name, without variants of its own.

    Raises
    ------
    ConfigurationError
        If anything is wrong with one of them; the faults' keys begin with its name.
    """
    base = study.model_dump(mode="json")
    found, faults = {}, []
    for name, changes in study.variants.items():
        try:
            found[name] = check(merge(base, changes) | {"variants": {}})
            _refuse_other_files(found[name], study)
        except ConfigurationError as error:
            faults += [
                Fault(f"variants.{name}: {fault.key}", fault.value, fault.allowed)
                for fault in error.faults
            ]
    if faults:
        raise ConfigurationError(faults)
    return found


def sweep_studies(study: config.Study, name: str) -> list[tuple[dict[str, Any], config.Study]]:
    """Return the studies of a sweep, all checked: the product of its lists, the last fastest.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.

    Returns
    -------
    list of tuple
        Swept keys with their values, and the study that they make.

    Raises
    ------
    ConfigurationError
        If anything is wrong with one of them.
    """
    sweep = study.sweeps[name]
    base = merge(study.model_dump(mode="json"), sweep.base) | {"variants": {}, "sweeps": {}}
    found: list[tuple[dict[str, Any], config.Study]] = []
    faults: dict[tuple[str, str, str], Fault] = {}
    for values in itertools.product(*sweep.over.values()):
        changes = dict(zip(sweep.over, values, strict=True))
        raw: dict[str, Any] = base
        for key, value in changes.items():
            raw = merge(raw, _nested(key, value))
        try:
            case = check(raw)
            _refuse_other_files(case, study)
            found.append((changes, case))
        except ConfigurationError as error:
            for fault in error.faults:
                # A fault that many cases share is told once, with the first of them.
                where = f"sweeps.{name} at {changes}: {fault.key}"
                first = Fault(where, fault.value, fault.allowed)
                faults.setdefault((fault.key, str(fault.value), fault.allowed), first)
    if faults:
        raise ConfigurationError(faults.values())
    return found


def _refuse_other_files(case: config.Study, study: config.Study) -> None:
    """Refuse a case that needs another file, or another part of it, than its study reads."""
    faults = [
        Fault(
            f"scene.{key}",
            getattr(case.scene, key),
            "must be the study's own, because the file is read once for all; make it a study",
        )
        for key in config.ELEVATION
        if case.scene.terrain == "file" and getattr(case.scene, key) != getattr(study.scene, key)
    ]
    if study.measurement.file is not None or case.measurement.file is not None:
        faults.append(
            Fault(
                "measurement.file",
                case.measurement.file,
                "must be null: without the true scene there is no accuracy to compare",
            )
        )
    if faults:
        raise ConfigurationError(faults)


def _nested(key: str, value: Any) -> dict[str, Any]:
    section, _, rest = key.partition(".")
    return {section: _nested(rest, value) if rest else value}


def advice(study: config.Study) -> list[str]:
    """Return what is allowed but unwise in a checked configuration, a sentence each."""
    sections = _meaningful({name: getattr(study, name) for name in config.Study.model_fields})
    return [str(fault) for fault in _apply(_UNWISE, sections)]


def _meaningful(sections: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what measured echoes do without."""
    measurement = sections.get("measurement")
    measured = measurement is not None and measurement.file is not None
    return {
        name: section
        for name, section in sections.items()
        if not (measured and name in config.SIMULATION)
    }


def _apply(rules: Iterable[Rule], sections: Mapping[str, Any]) -> Iterator[Fault]:
    """Apply the rules whose sections, named by their parameters, are all there."""
    for rule in rules:
        names = list(inspect.signature(rule).parameters)
        if all(name in sections for name in names):
            yield from rule(*(sections[name] for name in names))


def _fault(error: Any) -> Fault:
    path = ""
    for part in error["loc"]:
        if path.endswith("]") and part in _SHAPES:
            continue  # pydantic's word for which of the shapes it is, not a key
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else str(part)
    value = error["input"]
    if error["type"] == "missing":
        return Fault(path, None, "missing; config/paper.yaml shows it with its value")
    if error["type"] == "extra_forbidden":
        return Fault(path, value, "unknown key" + _nearest(path))
    allowed = error["msg"].replace("Input should", "must").replace("String should", "must")
    if isinstance(value, str) and error["type"] in {"float_type", "int_type"}:
        try:
            number = float(value)
        except ValueError:
            pass
        else:
            # YAML 1.1 reads 13e9 as text.
            allowed += f" (YAML reads this as text; write {number:.15g})"
    return Fault(path, value, allowed)


def _nearest(path: str) -> str:
    known = list(_keys(config.Study))
    parent, _, name = re.sub(r"\[\d+\]", "", path).rpartition(".")
    siblings = [key for key in known if key.rpartition(".")[0] == parent]
    names = {key.rpartition(".")[2]: key for key in known}
    # The nearest name in the same section first, then anywhere.
    for candidates in ({key.rpartition(".")[2]: key for key in siblings}, names):
        close = difflib.get_close_matches(name, candidates, n=1, cutoff=0.6)
        if close:
            return f"; did you mean {candidates[close[0]]}?"
    listed = ", ".join(key.rpartition(".")[2] for key in siblings)
    return f"; there are {listed}" if listed else ""


@cache
def every_key() -> frozenset[str]:
    """Return every key of the configuration, dotted, sections among them."""
    return frozenset(_keys(config.Study))


def _keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    for name, field in model.model_fields.items():
        yield prefix + name
        # A key's own model, or those of the items of a list.
        for kind in config.models_in(field.annotation):
            yield from _keys(kind, f"{prefix}{name}.")


def _extent(section: str, part: Any) -> Iterator[Fault]:
    for axis in "xy":
        low, high = getattr(part, f"{axis}_min_m"), getattr(part, f"{axis}_max_m")
        if low >= high:
            yield Fault(f"{section}.{axis}_max_m", high, f"must exceed {axis}_min_m, {low}")


def _multiple(key: str, value: float, low: float, high: float, spacing: float) -> Iterator[Fault]:
    try:
        geometry.grid_axis(low, high, spacing)
    except ValueError:
        count = max(1, round((high - low) / spacing))
        yield Fault(
            key,
            value,
            f"must divide the extent from {low:g} to {high:g} m; {(high - low) / count:.6g} would",
        )


def _waveform(radar: config.Radar) -> Iterator[Fault]:
    if radar.start_frequency_hz >= radar.stop_frequency_hz:
        yield Fault(
            "radar.stop_frequency_hz",
            radar.stop_frequency_hz,
            f"must exceed radar.start_frequency_hz, {radar.start_frequency_hz:g}",
        )
    half = radar.aperture_length_m / 2
    yield from _multiple(
        "radar.position_spacing_m", radar.position_spacing_m, -half, half, radar.position_spacing_m
    )


def _scene_raster(scene: config.Scene) -> Iterator[Fault]:
    faults = list(_extent("scene", scene))
    yield from faults
    if faults:
        return
    for axis in "xy":
        low, high = getattr(scene, f"{axis}_min_m"), getattr(scene, f"{axis}_max_m")
        yield from _multiple(
            "scene.terrain_spacing_m",
            scene.terrain_spacing_m,
            low,
            high,
            scene.terrain_spacing_m,
        )
        if scene.facet_size_m > high - low:
            yield Fault(
                "scene.facet_size_m", scene.facet_size_m, f"must be at most {high - low:g} m"
            )
    if scene.terrain_spacing_m > scene.facet_size_m:
        yield Fault(
            "scene.terrain_spacing_m",
            scene.terrain_spacing_m,
            f"must be at most the facet size, {scene.facet_size_m} m",
        )
    # The deepest hollow of `peaks` is 0.81 times as deep as its highest top is high.
    least = 0.8083 * scene.peak_height_m if scene.terrain == "peaks" else 0.0
    if scene.reflectivity_offset < least:
        yield Fault(
            "scene.reflectivity_offset",
            scene.reflectivity_offset,
            f"must be at least {least:.3f}, or the deepest hollow has a negative reflectivity",
        )


def _furniture(scene: config.Scene) -> Iterator[Fault]:
    """Check what stands on the terrain, in a scene whose raster may be wrong itself."""
    least = 2 * scene.terrain_spacing_m
    if scene.roughness_std_m > 0 and scene.roughness_correlation_m < least:
        yield Fault(
            "scene.roughness_correlation_m",
            scene.roughness_correlation_m,
            f"must be at least twice scene.terrain_spacing_m, {least:g} m, or the raster loses it",
        )
    parts: dict[str, config.SceneObject | config.Patch] = {}
    parts |= {f"scene.objects[{number}]": part for number, part in enumerate(scene.objects)}
    parts |= {f"scene.patches[{number}]": part for number, part in enumerate(scene.patches)}
    for where, part in parts.items():
        keys = [key for key in ("diameter_m", "size_x_m", "size_y_m") if hasattr(part, key)]
        for key in keys:
            if getattr(part, key) < least:
                yield Fault(
                    f"{where}.{key}",
                    getattr(part, key),
                    f"must be at least twice scene.terrain_spacing_m, {least:g} m, or the raster "
                    "loses it",
                )
        for axis, reach in zip("xy", part.reach(), strict=True):
            near, far = (getattr(part, f"{axis}_m") + sign * reach for sign in (-1, 1))
            first, last = getattr(scene, f"{axis}_min_m"), getattr(scene, f"{axis}_max_m")
            if near < first or far > last:
                yield Fault(
                    f"{where}.{axis}_m",
                    getattr(part, f"{axis}_m"),
                    f"it reaches from {near:.3g} to {far:.3g} m, but must lie in the scene, "
                    f"{axis} {first:g} to {last:g} m",
                )
        if isinstance(part, config.Mound) and part.height_m > part.diameter_m / 2:
            yield Fault(
                f"{where}.height_m",
                part.height_m,
                f"must be at most half the diameter, {part.diameter_m / 2:g} m: a mound is the cap "
                "of a sphere",
            )


def _object_heights(radar: config.Radar, scene: config.Scene) -> Iterator[Fault]:
    for number, part in enumerate(scene.objects):
        for key in ("height_m", "depth_m"):
            value = getattr(part, key, 0.0)
            if value >= radar.rail_height_m:
                yield Fault(
                    f"scene.objects[{number}].{key}",
                    value,
                    f"must be below radar.rail_height_m, {radar.rail_height_m:g} m: what "
                    "is as high hides all behind it",
                )


def _own_terrain(scene: config.Scene) -> Iterator[Fault]:
    if scene.terrain == "file" and scene.file is None:
        yield Fault("scene.file", None, "must name the file of scene.terrain 'file'")
    if scene.terrain != "file" and scene.file is not None:
        yield Fault(
            "scene.file",
            scene.file,
            f"is not read for scene.terrain '{scene.terrain}'; take scene.terrain file, or null",
        )


def _image_grid(imaging: config.Imaging) -> Iterator[Fault]:
    faults = list(_extent("imaging", imaging))
    yield from faults
    if faults:
        return
    for axis in "xy":
        low, high = getattr(imaging, f"{axis}_min_m"), getattr(imaging, f"{axis}_max_m")
        yield from _multiple(
            "imaging.grid_spacing_m", imaging.grid_spacing_m, low, high, imaging.grid_spacing_m
        )


def _odd_windows(
    interferogram: config.Interferogram, filtering: config.Filtering
) -> Iterator[Fault]:
    for key, value in (
        ("interferogram.coherence_window_px", interferogram.coherence_window_px),
        ("filtering.boxcar_window_px", filtering.boxcar_window_px),
    ):
        if value % 2 == 0:
            yield Fault(key, value, "must be odd")


def _goldstein_step(filtering: config.Filtering) -> Iterator[Fault]:
    patch, step = filtering.goldstein_patch_px, filtering.goldstein_step_px
    if patch % step or patch < 2 * step:
        steps = [n for n in range(1, patch // 2 + 1) if patch % n == 0]
        yield Fault(
            "filtering.goldstein_step_px",
            step,
            f"must divide filtering.goldstein_patch_px, {patch}, at least twice: "
            + ", ".join(map(str, steps)),
        )


def _heights_rise(registration: config.Registration) -> Iterator[Fault]:
    if registration.height_min_m >= registration.height_max_m:
        yield Fault(
            "registration.height_max_m",
            registration.height_max_m,
            f"must exceed registration.height_min_m, {registration.height_min_m}",
        )


def _reference_exists(height: config.Height) -> Iterator[Fault]:
    for number, rectangle in enumerate(height.level_ground):
        yield from _extent(f"height.level_ground[{number}]", rectangle)
    if height.reference == "level_ground" and not height.level_ground:
        yield Fault("height.level_ground", (), "must hold one rectangle or more")
    if height.reference == "control_points":
        least = 3 if height.trend == "plane" else 1
        if len(height.control_points) < least:
            yield Fault(
                "height.control_points",
                f"{len(height.control_points)} points",
                f"must hold {least} or more for height.trend '{height.trend}'",
            )


def _reference_in_image(height: config.Height, imaging: config.Imaging) -> Iterator[Fault]:
    where = (
        f"x {imaging.x_min_m:g} to {imaging.x_max_m:g} m, "
        f"y {imaging.y_min_m:g} to {imaging.y_max_m:g} m"
    )

    def inside(x: float, y: float) -> bool:
        return imaging.x_min_m <= x <= imaging.x_max_m and imaging.y_min_m <= y <= imaging.y_max_m

    if height.reference == "level_ground":
        for number, part in enumerate(height.level_ground):
            corners = ((part.x_min_m, part.y_min_m), (part.x_max_m, part.y_max_m))
            if not all(inside(*corner) for corner in corners):
                yield Fault(
                    f"height.level_ground[{number}]", corners, f"must lie in the image: {where}"
                )
    else:
        for number, point in enumerate(height.control_points):
            if not inside(point.x_m, point.y_m):
                yield Fault(
                    f"height.control_points[{number}]",
                    (point.x_m, point.y_m),
                    f"must lie in the image: {where}",
                )


@dataclass(frozen=True)
class _Derived:
    """What the rules need of the radar; `foremost` is how far ahead of y = 0 an antenna stands."""

    frequency: Any
    wavelength: float
    shortest_wavelength: float
    range_cell: float
    unambiguous_range: float
    antennas: Any
    apertures: Any
    foremost: float

    # A dozen rules ask, and the cases of a sweep have few radars between them.
    @classmethod
    @lru_cache(maxsize=32)
    def of(cls, section: config.Radar) -> _Derived:
        frequency = waveform.frequencies(
            section.start_frequency_hz, section.stop_frequency_hz, section.frequency_count
        )
        antennas = trajectory.planned(section)
        return cls(
            frequency=frequency,
            wavelength=waveform.wavelength(waveform.carrier(frequency)),
            shortest_wavelength=waveform.wavelength(section.stop_frequency_hz),
            range_cell=waveform.range_resolution(float(frequency[-1] - frequency[0])),
            unambiguous_range=waveform.unambiguous_range(float(frequency[1] - frequency[0])),
            antennas=antennas,
            apertures=trajectory.apertures(antennas),
            foremost=max(
                0.0, *(antennas[name].values[..., 1].max() for name in ("transmitter", "receiver"))
            ),
        )

    def reach(
        self, part: config.Scene | config.Imaging, behind_m: float = 0.0
    ) -> tuple[float, float]:
        """Return the nearest and the farthest slant range of a part of the ground, m."""
        x, y = (
            np.array([getattr(part, f"{axis}_{end}_m") for end in ("min", "max")]) for axis in "xy"
        )
        return trajectory.range_extent(self.antennas, x, y + np.array([0.0, behind_m]))


def _ahead(radar: config.Radar, scene: config.Scene, imaging: config.Imaging) -> Iterator[Fault]:
    # Half a wavelength would do for the mathematics; a facet does for the visibility.
    foremost = _Derived.of(radar).foremost + scene.facet_size_m
    for name, part in (("scene", scene), ("imaging", imaging)):
        if part.y_min_m < foremost:
            yield Fault(
                f"{name}.y_min_m",
                part.y_min_m,
                f"must be {foremost:.3g} m or more: the antennas look ahead and stand at y = 0",
            )


def _measured_in_motion(
    measurement: config.Measurement, vehicle: config.Vehicle
) -> Iterator[Fault]:
    if measurement.file is not None and vehicle.forward_speed_m_per_s != 0:
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            vehicle.forward_speed_m_per_s,
            "must be 0 with measurement.file: its antenna positions have the motion in them",
        )


def _claims_judged(measurement: config.Measurement, outputs: config.Outputs) -> Iterator[Fault]:
    if measurement.file is not None and outputs.claims:
        yield Fault(
            "outputs.claims", True, "must be false with measurement.file: no truth decides them"
        )


def _drives_short(
    radar: config.Radar, scene: config.Scene, imaging: config.Imaging, vehicle: config.Vehicle
) -> Iterator[Fault]:
    speed, duration = vehicle.forward_speed_m_per_s, vehicle.scan_duration_s
    foremost = _Derived.of(radar).foremost + scene.facet_size_m
    room = min(scene.y_min_m, imaging.y_min_m) - foremost
    if 0 < room < speed * duration / 2:
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            speed,
            f"must be at most {2 * room / duration:.3g} m/s, or vehicle.scan_duration_s at most "
            f"{2 * room / speed:.3g} s: the vehicle drives {speed * duration / 2:.3g} m from the "
            "middle of the scan to its end, into scene or image",
        )


def _unambiguous(
    radar: config.Radar, scene: config.Scene, imaging: config.Imaging, vehicle: config.Vehicle
) -> Iterator[Fault]:
    derived = _Derived.of(radar)
    behind = vehicle.forward_speed_m_per_s * vehicle.scan_duration_s / 2
    for name, part in (("scene", scene), ("imaging", imaging)):
        _, far = derived.reach(part, behind)
        if far > derived.unambiguous_range:
            count = int(np.ceil((radar.frequency_count - 1) * far / derived.unambiguous_range)) + 1
            yield Fault(
                f"{name}.y_max_m",
                part.y_max_m,
                f"its farthest slant range of {far:.2f} m must be within the unambiguous range, "
                f"{derived.unambiguous_range:.2f} m; take radar.frequency_count {count} or more",
            )


def _facets_fine(radar: config.Radar, scene: config.Scene) -> Iterator[Fault]:
    half = _cell(radar, scene) / 2
    if scene.facet_size_m > half:
        yield Fault(
            "scene.facet_size_m",
            scene.facet_size_m,
            f"must be at most half a resolution cell, {half:.4f} m",
        )


def _grid_fine(radar: config.Radar, imaging: config.Imaging) -> Iterator[Fault]:
    cell = _cell(radar, imaging)
    if imaging.grid_spacing_m > cell:
        yield Fault(
            "imaging.grid_spacing_m",
            imaging.grid_spacing_m,
            f"must be at most the resolution, {cell:.4f} m",
        )


def _cell(radar_: config.Radar, part: config.Scene | config.Imaging) -> float:
    """Return the finest resolution in a part of the ground, m."""
    derived = _Derived.of(radar_)
    x = np.clip(0.0, part.x_min_m, part.x_max_m)
    cells = [
        waveform.ground_resolution(derived.apertures[0], x, y, frequency=derived.frequency)
        for y in (part.y_min_m, part.y_max_m)
    ]  # fmt: skip
    return float(np.min(cells))


def _widest_spacing(radar: config.Radar, scene: config.Scene) -> float:
    """Return the widest spacing of positions that images the scene's width without ambiguity, m."""
    derived = _Derived.of(radar)
    half = radar.aperture_length_m / 2
    # Echoes from the sines s1 and s2 of the squint are told apart while the phase between
    # neighbouring positions, 4 pi d (s1 - s2) / lambda, stays within a turn; where one end of the
    # path stands still, half of it.
    edge = np.array([scene.x_min_m - half, scene.x_max_m + half])
    sine = edge / np.hypot(np.hypot(edge, scene.y_min_m), radar.rail_height_m)
    moving_ends = 2 if radar.system == "rail" else 1
    return derived.shortest_wavelength / (moving_ends * float(sine[1] - sine[0]))


def _positions_dense(radar: config.Radar, scene: config.Scene) -> Iterator[Fault]:
    most = _widest_spacing(radar, scene)
    if radar.system == "rail" and radar.position_spacing_m > most:
        yield Fault(
            "radar.position_spacing_m",
            radar.position_spacing_m,
            f"must be at most {most:.4f} m, or the scene's width is imaged ambiguously",
        )


def _driven_densely(
    radar: config.Radar, scene: config.Scene, vehicle: config.Vehicle
) -> Iterator[Fault]:
    speed = vehicle.forward_speed_m_per_s
    if speed == 0:
        return
    moving = motion.advance(
        trajectory.planned(radar), speed_m_per_s=speed, duration_s=vehicle.scan_duration_s
    )
    edges = (scene.x_min_m, 0.0, scene.x_max_m), (scene.y_min_m, scene.y_max_m)
    points = np.stack([*np.meshgrid(*edges), np.zeros((2, 3))], axis=-1).reshape(-1, 3)
    change = np.zeros(len(points))
    for end in ("transmitter", "receiver"):
        places = moving[end].values[0]
        ray = points - places.mean(axis=0)
        step = (places[-1] - places[0]) / (len(places) - 1)
        change += ray @ step / np.linalg.norm(ray, axis=-1)
    # Echoes are told apart while their phases' steps differ by less than a turn.
    if np.ptp(change) > _Derived.of(radar).shortest_wavelength:
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            speed,
            f"the vehicle drives {step[1]:.3g} m from one antenna position to the next, and the "
            "scene is imaged ambiguously; take a shorter vehicle.scan_duration_s or "
            "radar.position_spacing_m",
        )


def _gate_before_image(
    radar: config.Radar, suppression: config.Suppression, imaging: config.Imaging
) -> Iterator[Fault]:
    if suppression.method not in ("gate", "both"):
        return
    derived = _Derived.of(radar)
    near, far = derived.reach(imaging)
    # Ranges repeat: the gate lies beyond the image as well.
    most = min(near / 2, derived.unambiguous_range - far)
    if suppression.gate_range_m > most:
        yield Fault(
            "suppression.gate_range_m",
            suppression.gate_range_m,
            f"must be at most {most:.2f} m: half the slant range of the image's near edge, and "
            "what the unambiguous range leaves beyond its far edge",
        )


def _targets_imaged(radar: config.Radar, registration: config.Registration) -> Iterator[Fault]:
    derived = _Derived.of(radar)
    heights = np.array([registration.height_min_m, registration.height_max_m])
    for name, target in (("near", registration.near), ("far", registration.far)):
        images = [
            aperture.image_position(part, target.x_m, target.y_m, heights)
            for part in derived.apertures
        ]
        if target.y_m <= derived.foremost or np.isnan(images).any():
            yield Fault(
                f"registration.{name}.y_m",
                target.y_m,
                "must be farther ahead: a target of these heights has no image on the ground",
            )


def _claims_of_a_rail(radar: config.Radar, outputs: config.Outputs) -> Iterator[Fault]:
    if outputs.claims and radar.system != "rail":
        yield Fault("outputs.claims", True, "must be false: the paper's claims are those of a rail")


def _colormaps(figures: config.Figures) -> Iterator[Fault]:
    for key in ("height_colormap", "phase_colormap"):
        name = getattr(figures, key)
        try:
            colormaps.find(name)
        except ValueError as error:
            yield Fault(f"figures.{key}", name, str(error))


def _text_fits(figures: config.Figures) -> Iterator[Fault]:
    # The figures are laid out for text of 7.5 pt on 88 and 180 mm, with some room to spare.
    widths = {"one_column_mm": 88.0, "two_columns_mm": 180.0}
    most = min(8.0 * getattr(figures, key) / laid_out for key, laid_out in widths.items())
    if figures.font_size_pt > most * (1 + 1e-9):
        yield Fault(
            "figures.font_size_pt",
            figures.font_size_pt,
            f"must be at most {most:.2f} for figures {figures.one_column_mm:g} and "
            f"{figures.two_columns_mm:g} mm wide, or their text would overlap",
        )


def _figure_files(figures: config.Figures) -> Iterator[Fault]:
    if "png" not in figures.formats:
        yield Fault("figures.formats", figures.formats, "must hold png, which the reports show")
    if len(set(figures.formats)) < len(figures.formats):
        yield Fault("figures.formats", figures.formats, "must hold each format once")


def _baseline_short(radar: config.Radar, scene: config.Scene) -> Iterator[Fault]:
    x = float(np.clip(0.0, scene.x_min_m, scene.x_max_m))
    seen = replace(baseline.view(radar, scene), x_m=x, y_m=scene.y_min_m)
    limit, across = seen.critical_baseline / 4, float(seen.across(radar.baseline_m))
    if across > limit:
        yield Fault(
            "radar.baseline_m",
            radar.baseline_m,
            f"its part across the line of sight, {across:.3f} m, exceeds a quarter of "
            f"the critical baseline, {limit:.3f} m, at the scene's near edge: coherence "
            "will suffer",
        )


def _elements_dense(radar: config.Radar, scene: config.Scene) -> Iterator[Fault]:
    most = _widest_spacing(radar, scene)
    if radar.system != "rail" and radar.position_spacing_m > most:
        yield Fault(
            "radar.position_spacing_m",
            radar.position_spacing_m,
            f"is wider than {most:.4f} m: grating lobes of the array fold the scene's edges over "
            "each other",
        )


def _sides_apart(
    radar: config.Radar, scene: config.Scene, imaging: config.Imaging, vehicle: config.Vehicle
) -> Iterator[Fault]:
    # The corner that the axis meets first as it turns.
    most = min(
        part.y_min_m / part.x_max_m if part.x_max_m > 0 else np.inf for part in (scene, imaging)
    )
    speed = vehicle.forward_speed_m_per_s
    lower = trajectory.apertures(
        motion.advance(
            trajectory.planned(radar), speed_m_per_s=speed, duration_s=vehicle.scan_duration_s
        )
    )[0]
    # A transmitter that stands on the vehicle halves the way along x, and not that ahead.
    along, ahead, _ = lower.transmitter_travel + lower.receiver_travel
    if ahead > most * along:
        limit = speed * most * along / ahead
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            speed,
            "turns the aperture until its axis meets the scene, and ground on one side of the axis "
            f"is imaged upon that on the other; this scan keeps them apart up to {limit:.3g} m/s",
        )


def _facets_coarse(radar: config.Radar, scene: config.Scene) -> Iterator[Fault]:
    derived = _Derived.of(radar)
    if scene.facet_size_m < derived.wavelength:
        yield Fault(
            "scene.facet_size_m",
            scene.facet_size_m,
            f"is below the wavelength, {derived.wavelength:.4f} m: many facets for little",
        )


def _coupling_in_gate(echo: config.Echo, suppression: config.Suppression) -> Iterator[Fault]:
    gated = suppression.method in ("gate", "both")
    if (
        echo.coupling_db is not None
        and gated
        and echo.coupling_path_m > 2 * suppression.gate_range_m
    ):
        yield Fault(
            "suppression.gate_range_m",
            suppression.gate_range_m,
            f"the coupling comes from beyond it, {echo.coupling_path_m / 2:g} m, and stays",
        )


def _image_in_scene(scene: config.Scene, imaging: config.Imaging) -> Iterator[Fault]:
    outside = (
        imaging.x_min_m < scene.x_min_m
        or imaging.x_max_m > scene.x_max_m
        or imaging.y_min_m < scene.y_min_m
        or imaging.y_max_m > scene.y_max_m
    )
    if outside:
        yield Fault(
            "imaging", None, "the image reaches beyond the scene: nothing scatters there but noise"
        )


_WITHIN_SECTIONS: tuple[Rule, ...] = (
    _waveform,
    _scene_raster,
    _furniture,
    _own_terrain,
    _image_grid,
    _goldstein_step,
    _heights_rise,
    _reference_exists,
    _colormaps,
    _text_fits,
    _figure_files,
)
_ACROSS_SECTIONS: tuple[Rule, ...] = (
    _odd_windows,
    _reference_in_image,
    _object_heights,
    _measured_in_motion,
    _claims_judged,
    _drives_short,
    _unambiguous,
    _facets_fine,
    _grid_fine,
    _positions_dense,
    _driven_densely,
    _gate_before_image,
    _targets_imaged,
    _claims_of_a_rail,
)
_UNWISE: tuple[Rule, ...] = (
    _baseline_short,
    _elements_dense,
    _facets_coarse,
    _coupling_in_gate,
    _image_in_scene,
    _sides_apart,
)
