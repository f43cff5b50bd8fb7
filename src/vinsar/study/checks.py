"""Checks across sections: the configuration held against radar physics, before anything runs.

A rule is called with the sections that its parameters name and yields what is wrong.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations.errors import Fault
from vinsar.processing.autofocus import MOST_CHANNELS
from vinsar.radar import aperture, grid, instrument, motion, trajectory, waveform
from vinsar.radar.instrument import Instrument
from vinsar.study import work

if TYPE_CHECKING:
    from collections.abc import Iterator

    from vinsar.evaluation.misregistration import Registration
    from vinsar.processing.autofocus import Autofocus
    from vinsar.processing.filtering import Filtering
    from vinsar.processing.focusing import Imaging
    from vinsar.processing.height import Height
    from vinsar.processing.interferogram import Interferogram
    from vinsar.processing.leakage import Suppression
    from vinsar.processing.unwrapping import Unwrapping
    from vinsar.radar.motion import Vehicle
    from vinsar.radar.trajectory import Radar
    from vinsar.simulation.echo import Echo
    from vinsar.simulation.scene import Scene
    from vinsar.study.options import Measurement, Outputs


# A dozen rules ask, and the cases of a sweep have few radars between them.
@lru_cache(maxsize=32)
def _planned(radar: Radar) -> Instrument:
    return Instrument.planned(radar)


def _reach(radar: Radar, part: Scene | Imaging, behind_m: float = 0.0) -> tuple[float, float]:
    """Return the nearest and the farthest slant range of a part of the ground, m."""
    x, y = (np.array([getattr(part, f"{axis}_{end}_m") for end in ("min", "max")]) for axis in "xy")
    return trajectory.range_extent(trajectory.planned(radar), x, y + np.array([0.0, behind_m]))


def _foremost(radar: Radar) -> float:
    """Return how far ahead of y = 0 an antenna stands, m."""
    return max(0.0, _planned(radar).foremost)


def _ahead(radar: Radar, scene: Scene, imaging: Imaging) -> Iterator[Fault]:
    # Half a wavelength would do for the mathematics; a facet does for the visibility.
    foremost = _foremost(radar) + scene.facet_size_m
    for name, part in (("scene", scene), ("imaging", imaging)):
        if part.y_min_m < foremost:
            yield Fault(
                f"{name}.y_min_m",
                part.y_min_m,
                f"must be {foremost:.3g} m or more: the antennas look ahead and stand at y = 0",
            )


def _tops_below_antennas(radar: Radar, scene: Scene) -> Iterator[Fault]:
    limit = f"radar.rail_height_m, {radar.rail_height_m:g} m: what is as high hides all behind it"
    ground = scene.peak_height_m if scene.terrain == "peaks" else 0.0
    if ground >= radar.rail_height_m:
        yield Fault("scene.peak_height_m", ground, f"must be below {limit}")
        return
    for number, part in enumerate(scene.objects):
        where = f"scene.objects[{number}]"
        height, depth = (getattr(part, name, 0.0) for name in ("height_m", "depth_m"))
        if depth >= radar.rail_height_m:
            yield Fault(f"{where}.depth_m", depth, f"must be below {limit}")
        # What overlaps is added up.
        others = sum(getattr(other, "height_m", 0.0) for other in scene.objects[:number]
                     if _overlap(part, other))  # fmt: skip
        if height > 0 and ground + others + height >= radar.rail_height_m:
            upon = f" with the {ground + others:g} m beneath it" if ground + others else ""
            yield Fault(f"{where}.height_m", height, f"must{upon} be below {limit}")


def _overlap(one: Any, other: Any) -> bool:
    """Tell whether two objects may stand upon each other."""
    return all(
        abs(getattr(one, f"{axis}_m") - getattr(other, f"{axis}_m")) < sum(reaches)
        for axis, reaches in zip("xy", zip(one.reach(), other.reach(), strict=True), strict=True)
    )


def _band_resolves(radar: Radar, imaging: Imaging) -> Iterator[Fault]:
    near, far = _reach(radar, imaging)
    cell = waveform.range_resolution(radar.stop_frequency_hz - radar.start_frequency_hz)
    if cell > far - near:
        yield Fault(
            "radar.stop_frequency_hz",
            radar.stop_frequency_hz,
            f"a band of {radar.stop_frequency_hz - radar.start_frequency_hz:.3g} Hz resolves "
            f"{cell:.3g} m in range, more than the {far - near:.3g} m of the image",
        )


def _windows_in_image(
    imaging: Imaging, filtering: Filtering, interferogram: Interferogram
) -> Iterator[Fault]:
    shape = _pixels(imaging)
    for section, name, options in (
        ("interferogram", "coherence_window_px", interferogram),
        *((("filtering", "boxcar_window_px", filtering),) if filtering.method == "boxcar" else ()),
    ):
        if getattr(options, name) > min(shape):
            yield Fault(
                f"{section}.{name}",
                getattr(options, name),
                f"must be at most {min(shape)}, the pixels of the image's shorter side",
            )
    if filtering.method == "goldstein" and filtering.goldstein_patch_px > max(shape):
        yield Fault(
            "filtering.goldstein_patch_px",
            filtering.goldstein_patch_px,
            f"must be at most {max(shape)}, the pixels of the image's longer side",
        )


def _pixels(imaging: Imaging) -> tuple[int, int]:
    x, y = grid.image_axes(imaging)
    return x.size, y.size


def _reference_determines(radar: Radar, imaging: Imaging, height: Height) -> Iterator[Fault]:
    top = radar.rail_height_m
    if height.reference == "level_ground":
        axes = dict(zip("xy", grid.image_axes(imaging), strict=True))
        for number, part in enumerate(height.level_ground):
            inside = [
                int(
                    (
                        (axis >= getattr(part, f"{name}_min_m"))
                        & (axis <= getattr(part, f"{name}_max_m"))
                    ).sum()
                )
                for name, axis in axes.items()
            ]
            least = 2 if height.trend == "plane" and len(height.level_ground) == 1 else 1
            if min(inside) < least:
                yield Fault(
                    f"height.level_ground[{number}]",
                    None,
                    f"holds {inside[0]} x {inside[1]} pixels; it must hold {least} x {least} at "
                    "least, or imaging.grid_spacing_m be smaller",
                )
        near = min((part.y_min_m for part in height.level_ground), default=imaging.y_min_m)
        if not _has_image(height.level_ground_height_m, near, top):
            yield Fault(
                "height.level_ground_height_m",
                height.level_ground_height_m,
                f"must be below the antennas and leave the ground an image: from "
                f"{top - float(np.hypot(near, top)):.3g} to {top:g} m",
            )
        return
    for number, point in enumerate(height.control_points):
        if not _has_image(point.height_m, point.y_m, top):
            yield Fault(
                f"height.control_points[{number}].height_m",
                point.height_m,
                f"must be below the antennas and leave the point an image: from "
                f"{top - float(np.hypot(point.y_m, top)):.3g} to {top:g} m",
            )
    if height.trend == "plane" and len(height.control_points) >= 3:
        places = np.array([(point.x_m, point.y_m) for point in height.control_points])
        spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
        if spread[1] < grid.pixel_side(imaging):
            yield Fault(
                "height.control_points",
                None,
                "must not lie in one line for height.trend 'plane', which they leave to turn",
            )


def _has_image(height: float, ahead: float, antenna: float) -> bool:
    """Tell whether a point has the slant range of some point of the ground ahead."""
    return height < antenna and ahead**2 + antenna**2 > (antenna - height) ** 2


def _registration_matters(measurement: Measurement, outputs: Outputs) -> bool:
    """Tell whether the targets do: those of a measurement only if a figure shows them."""
    return measurement.file is None or "fig2" in outputs.figures


def _heights_below_antennas(
    radar: Radar, registration: Registration, measurement: Measurement, outputs: Outputs
) -> Iterator[Fault]:
    if not _registration_matters(measurement, outputs):
        return
    for name in ("height_max_m", "map_height_m"):
        if getattr(registration, name) >= radar.rail_height_m:
            yield Fault(
                f"registration.{name}",
                getattr(registration, name),
                f"must be below radar.rail_height_m, {radar.rail_height_m:g} m",
            )


def _told_short(radar: Radar, scene: Scene, imaging: Imaging, vehicle: Vehicle) -> Iterator[Fault]:
    if vehicle.speed_correction not in ("sensor", "echoes", "next_scan"):
        return
    # Beyond four standard deviations lies one draw in 30,000.
    told = vehicle.forward_speed_m_per_s + 4 * vehicle.speed_error_m_per_s
    room = min(scene.y_min_m, imaging.y_min_m) - _foremost(radar) - scene.facet_size_m
    last = _last(radar, vehicle)
    if told * last > room > 0:
        most = (room / last - vehicle.forward_speed_m_per_s) / 4
        yield Fault(
            "vehicle.speed_error_m_per_s",
            vehicle.speed_error_m_per_s,
            f"must be at most {max(most, 0):.3g} m/s, or imaging is told that the vehicle drives "
            "into the scene",
        )


def _something_scatters(scene: Scene) -> Iterator[Fault]:
    for number, patch in enumerate(scene.patches):
        covers = patch.rotation_deg == 0 and all(
            getattr(patch, f"{axis}_m") - reach <= getattr(scene, f"{axis}_min_m")
            and getattr(patch, f"{axis}_m") + reach >= getattr(scene, f"{axis}_max_m")
            for axis, reach in zip("xy", patch.reach(), strict=True)
        )
        if covers and patch.reflectivity == 0 and number == len(scene.patches) - 1:
            yield Fault(
                f"scene.patches[{number}].reflectivity", 0.0, "covers all of the scene: no echo"
            )


def _path_of_positions(radar: Radar, outputs: Outputs) -> Iterator[Fault]:
    positions = trajectory.planned(radar).sizes["position"]
    if positions < 3 and "fig2" in outputs.figures:
        yield Fault(
            "radar.position_spacing_m",
            radar.position_spacing_m,
            f"makes {positions} positions; the point targets of fig2 need 3 at least",
        )


def _reference_in_image(height: Height, imaging: Imaging) -> Iterator[Fault]:
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


def _measured_in_motion(measurement: Measurement, vehicle: Vehicle) -> Iterator[Fault]:
    if measurement.file is not None and vehicle.forward_speed_m_per_s != 0:
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            vehicle.forward_speed_m_per_s,
            "must be 0 with measurement.file: its antenna positions have the motion in them",
        )


def _claims_judged(measurement: Measurement, outputs: Outputs) -> Iterator[Fault]:
    if measurement.file is not None and outputs.claims:
        yield Fault(
            "outputs.claims", True, "must be false with measurement.file: no truth decides them"
        )


def _duration_key(radar: Radar) -> str:
    """Return the key that gives the duration of a scan."""
    return "vehicle.scan_duration_s" if radar.system == "rail" else "radar.dwell_s"


def _last(radar: Radar, vehicle: Vehicle) -> float:
    """Return the time from the middle of the scan to the end of all, s."""
    half = trajectory.scan_duration(radar, vehicle) / 2
    after = motion.scan_interval(radar, vehicle) if motion.has_next_scan(vehicle) else 0.0
    return half + after


def _next_scan(
    radar: Radar, scene: Scene, imaging: Imaging, vehicle: Vehicle, measurement: Measurement
) -> Iterator[Fault]:
    if not motion.has_next_scan(vehicle):
        return
    if measurement.file is not None:
        yield Fault(
            "vehicle.speed_correction",
            vehicle.speed_correction,
            "needs a simulated vehicle: a file of measured echoes holds one scan",
        )
        return
    duration = trajectory.scan_duration(radar, vehicle)
    if vehicle.scan_interval_s is not None and vehicle.scan_interval_s < duration:
        yield Fault(
            "vehicle.scan_interval_s",
            vehicle.scan_interval_s,
            f"must be at least the time of a scan, {duration:.3g} s ({_duration_key(radar)})",
        )
        return
    speed, last = vehicle.forward_speed_m_per_s, _last(radar, vehicle)
    room = min(scene.y_min_m, imaging.y_min_m) - _foremost(radar) - scene.facet_size_m
    if speed * duration / 2 <= room < speed * last:
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            speed,
            f"must be at most {room / last:.3g} m/s with vehicle.speed_correction next_scan: the "
            f"vehicle drives {speed * last:.3g} m from the middle of the scan to the end of the "
            "next one, into scene or image",
        )


def _drives_short(
    radar: Radar, scene: Scene, imaging: Imaging, vehicle: Vehicle
) -> Iterator[Fault]:
    speed, duration = vehicle.forward_speed_m_per_s, trajectory.scan_duration(radar, vehicle)
    foremost = _foremost(radar) + scene.facet_size_m
    room = min(scene.y_min_m, imaging.y_min_m) - foremost
    if 0 < room < speed * duration / 2:
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            speed,
            f"must be at most {2 * room / duration:.3g} m/s, or the scan at most "
            f"{2 * room / speed:.3g} s ({_duration_key(radar)}): the vehicle drives "
            f"{speed * duration / 2:.3g} m from the middle of the scan to its end, into scene or "
            "image",
        )


def _unambiguous(radar: Radar, scene: Scene, imaging: Imaging, vehicle: Vehicle) -> Iterator[Fault]:
    period = _planned(radar).unambiguous_range
    behind = vehicle.forward_speed_m_per_s * trajectory.scan_duration(radar, vehicle) / 2
    for name, part in (("scene", scene), ("imaging", imaging)):
        _, far = _reach(radar, part, behind)
        if far > period:
            count = int(np.ceil((radar.frequency_count - 1) * far / period)) + 1
            yield Fault(
                f"{name}.y_max_m",
                part.y_max_m,
                f"its farthest slant range of {far:.2f} m must be within the unambiguous range, "
                f"{period:.2f} m; take radar.frequency_count {count} or more",
            )


def _facets_fine(radar: Radar, scene: Scene) -> Iterator[Fault]:
    half = _cell(radar, scene) / 2
    if scene.facet_size_m > half:
        yield Fault(
            "scene.facet_size_m",
            scene.facet_size_m,
            f"must be at most half a resolution cell, {half:.4f} m",
        )


def _grid_fine(radar: Radar, imaging: Imaging) -> Iterator[Fault]:
    windows = imaging.aperture_window, imaging.range_window
    pixels = zip("xy", grid.pixel(imaging), _cells(radar, imaging), windows, strict=True)
    for axis, spacing, cell, window in pixels:
        width = waveform.window_width(window) * cell
        if spacing > width:
            own = f"grid_spacing_{axis}_m"
            key = "grid_spacing_m" if getattr(imaging, own) is None else own
            yield Fault(
                f"imaging.{key}",
                spacing,
                f"is wider than a point target's -3 dB width in {axis} where it is least, "
                f"{width:.4f} m: targets are missed between pixels, and phases undersampled",
            )


def _cell(radar: Radar, part: Scene | Imaging) -> float:
    """Return the finest resolution in a part of the ground, m."""
    return float(_cells(radar, part).min())


def _cells(radar: Radar, part: Scene | Imaging) -> Any:
    """Return the finest resolution in x and in y in a part of the ground, m."""
    x = np.clip(0.0, part.x_min_m, part.x_max_m)
    return _planned(radar).resolution(x, np.array([part.y_min_m, part.y_max_m])).min(axis=-1)


def _widest_spacing(radar: Radar, scene: Scene) -> float:
    """Return the widest spacing of positions that images the scene's width without ambiguity, m."""
    edges = np.array([scene.x_min_m, scene.x_max_m])
    return _planned(radar).widest_spacing(edges, scene.y_min_m)


def _positions_dense(radar: Radar, scene: Scene) -> Iterator[Fault]:
    most = _widest_spacing(radar, scene)
    if radar.system == "rail" and radar.position_spacing_m > most:
        yield Fault(
            "radar.position_spacing_m",
            radar.position_spacing_m,
            f"must be at most {most:.4f} m, or the scene's width is imaged ambiguously",
        )


def _driven_densely(radar: Radar, scene: Scene, vehicle: Vehicle) -> Iterator[Fault]:
    speed = vehicle.forward_speed_m_per_s
    if speed == 0:
        return
    duration = trajectory.scan_duration(radar, vehicle)
    moving = motion.advance(trajectory.planned(radar), speed_m_per_s=speed, duration_s=duration)
    found = Instrument.of(moving, waveform.sampled(radar))
    x, y = np.meshgrid((scene.x_min_m, 0.0, scene.x_max_m), (scene.y_min_m, scene.y_max_m))
    if np.ptp(found.growth(x, y)) > found.shortest_wavelength:
        step = speed * duration / (found.positions - 1)
        yield Fault(
            "vehicle.forward_speed_m_per_s",
            speed,
            f"the vehicle drives {step:.3g} m from one antenna position to the next, and the "
            f"scene is imaged ambiguously; take a shorter {_duration_key(radar)} or "
            "radar.position_spacing_m",
        )


def _gate_before_image(radar: Radar, suppression: Suppression, imaging: Imaging) -> Iterator[Fault]:
    if suppression.method not in ("gate", "both"):
        return
    near, far = _reach(radar, imaging)
    # Ranges repeat: the gate lies beyond the image as well.
    most = min(near / 2, _planned(radar).unambiguous_range - far)
    if suppression.gate_range_m > most:
        yield Fault(
            "suppression.gate_range_m",
            suppression.gate_range_m,
            f"must be at most {most:.2f} m: half the slant range of the image's near edge, and "
            "what the unambiguous range leaves beyond its far edge",
        )


def _targets_imaged(
    radar: Radar, registration: Registration, measurement: Measurement, outputs: Outputs
) -> Iterator[Fault]:
    if not _registration_matters(measurement, outputs):
        return
    planned = _planned(radar)
    heights = np.array([registration.height_min_m, registration.height_max_m])
    for name, target in (("near", registration.near), ("far", registration.far)):
        images = [
            aperture.image_position(part, target.x_m, target.y_m, heights)
            for part in (planned.lower, planned.upper)
        ]
        if target.y_m <= _foremost(radar) or np.isnan(images).any():
            yield Fault(
                f"registration.{name}.y_m",
                target.y_m,
                "must be farther ahead: a target of these heights has no image on the ground",
            )


def _claims_of_a_rail(radar: Radar, outputs: Outputs) -> Iterator[Fault]:
    if outputs.claims and radar.system != "rail":
        yield Fault("outputs.claims", True, "must be false: the paper's claims are those of a rail")


def _baselines_settle(radar: Radar, unwrapping: Unwrapping) -> Iterator[Fault]:
    if unwrapping.method == "baselines" and len(radar.baselines) < 2:
        yield Fault(
            "unwrapping.method",
            unwrapping.method,
            "needs radar.baselines_m with two baselines or more: one alone tells no cycle",
        )


def _autofocus_of_two(radar: Radar, autofocus: Autofocus) -> Iterator[Fault]:
    count = len(radar.baselines) + 1
    if autofocus.method != "none" and count > MOST_CHANNELS:
        yield Fault(
            "autofocus.method",
            autofocus.method,
            f"takes {MOST_CHANNELS} antennas at most, but radar.baselines_m makes {count}",
        )


def _antennas_fit(radar: Radar, imaging: Imaging) -> Iterator[Fault]:
    if len(radar.baselines) < 2:
        return
    pixels = np.prod([axis.size for axis in grid.image_axes(imaging)])
    samples = (radar.aperture_length_m / radar.position_spacing_m + 1) * radar.frequency_count
    # Echoes clean and received, of 16 bytes a sample, and images of 8 bytes a pixel.
    needed = (2 * 16 * samples + 8 * pixels) * (len(radar.baselines) + 1)
    there = work.memory()
    if needed > there / 2:
        yield Fault(
            "radar.baselines_m",
            f"{len(radar.baselines) + 1} antennas",
            f"their echoes and images take {needed / 1e9:.1f} GB, and half of this machine's "
            f"memory is {there / 2e9:.1f} GB: take fewer antennas, or a coarser grid",
        )


def _baseline_short(radar: Radar, scene: Scene) -> Iterator[Fault]:
    x = float(np.clip(0.0, scene.x_min_m, scene.x_max_m))
    limit = float(_planned(radar).critical_baseline(x, scene.y_min_m)) / 4
    if radar.baseline_m > limit:
        yield Fault(
            "radar.baseline_m",
            radar.baseline_m,
            f"exceeds a quarter of the critical baseline, {limit:.3f} m, at the scene's near edge: "
            "coherence will suffer",
        )


def _elements_dense(radar: Radar, scene: Scene) -> Iterator[Fault]:
    most = _widest_spacing(radar, scene)
    if radar.system != "rail" and radar.position_spacing_m > most:
        yield Fault(
            "radar.position_spacing_m",
            radar.position_spacing_m,
            f"is wider than {most:.4f} m: grating lobes of the array fold the scene's edges over "
            "each other",
        )


def _heights_tell(radar: Radar, imaging: Imaging, measurement: Measurement) -> Iterator[Fault]:
    if measurement.file is None or measurement.channels == 1:
        return
    planned, middle = _planned(radar), instrument.middle(imaging)
    cycle = float(planned.height_of_ambiguity(*middle))
    distance = float(planned.slant_range(*middle))
    if cycle > distance:
        yield Fault(
            "radar.baseline_m",
            radar.baseline_m,
            f"measured, has a height of ambiguity of {cycle:.3g} m in the middle of the image, "
            f"{distance:.3g} m away: heights mean nothing, phase and coherence do",
        )


def _sides_apart(radar: Radar, scene: Scene, imaging: Imaging, vehicle: Vehicle) -> Iterator[Fault]:
    # The corner that the axis meets first as it turns.
    most = min(
        part.y_min_m / part.x_max_m if part.x_max_m > 0 else np.inf for part in (scene, imaging)
    )
    speed = vehicle.forward_speed_m_per_s
    lower = trajectory.apertures(
        motion.advance(
            trajectory.planned(radar),
            speed_m_per_s=speed,
            duration_s=trajectory.scan_duration(radar, vehicle),
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


def _facets_coarse(radar: Radar, scene: Scene) -> Iterator[Fault]:
    wavelength = _planned(radar).wavelength
    if scene.facet_size_m < wavelength:
        yield Fault(
            "scene.facet_size_m",
            scene.facet_size_m,
            f"is below the wavelength, {wavelength:.4f} m: many facets for little",
        )


def _coupling_in_gate(echo: Echo, suppression: Suppression) -> Iterator[Fault]:
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


def _image_in_scene(scene: Scene, imaging: Imaging) -> Iterator[Fault]:
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


def _facets_like_a_crystal(scene: Scene) -> Iterator[Fault]:
    if scene.facet_jitter < 0.5:
        yield Fault(
            "scene.facet_jitter",
            scene.facet_jitter,
            "facets in rows scatter like a crystal, not like ground (Bragg resonance); take 1",
        )


def _noise_above_scene(echo: Echo) -> Iterator[Fault]:
    if echo.snr_db is not None and echo.snr_db < 0:
        coherence = 1 / (1 + 10 ** (-echo.snr_db / 10))
        yield Fault(
            "echo.snr_db",
            echo.snr_db,
            f"the noise exceeds the scene and leaves a coherence of {coherence:.2g}: heights, "
            "obstacles and holes are those of noise",
        )


def _baseline_of_nothing(radar: Radar) -> Iterator[Fault]:
    wavelength = _planned(radar).wavelength
    if radar.baseline_m < wavelength:
        yield Fault(
            "radar.baseline_m",
            radar.baseline_m,
            f"is shorter than the wavelength, {wavelength:.3g} m: the phase hardly tells heights",
        )


def _few_positions(radar: Radar) -> Iterator[Fault]:
    positions = trajectory.planned(radar).sizes["position"]
    if positions < 8:
        yield Fault(
            "radar.position_spacing_m",
            radar.position_spacing_m,
            f"makes an aperture of {positions} positions, whose image is mostly sidelobes",
        )


def _reference_near_ground(scene: Scene, height: Height) -> Iterator[Fault]:
    if scene.terrain == "file":
        return
    peak = scene.peak_height_m if scene.terrain == "peaks" else 0.0
    low, high = -peak - 3 * scene.roughness_std_m, peak + 3 * scene.roughness_std_m
    low -= sum(getattr(part, "depth_m", 0.0) for part in scene.objects)
    high += sum(getattr(part, "height_m", 0.0) for part in scene.objects)
    told = (
        {"height.level_ground_height_m": height.level_ground_height_m}
        if height.reference == "level_ground"
        else {
            f"height.control_points[{number}].height_m": point.height_m
            for number, point in enumerate(height.control_points)
        }
    )
    for key, value in told.items():
        if not low <= value <= high:
            yield Fault(
                key, value, f"is off the terrain, {low:.3g} to {high:.3g} m: all heights shift"
            )


CHECKS = (
    # Too many antennas would not get through the others, and those in the scene confuse them.
    (_antennas_fit,),
    (_ahead,),
    (
        _reference_in_image,
        _tops_below_antennas,
        _measured_in_motion,
        _claims_judged,
        _drives_short,
        _unambiguous,
        _facets_fine,
        _positions_dense,
        _driven_densely,
        _gate_before_image,
        _targets_imaged,
        _claims_of_a_rail,
        _band_resolves,
        _windows_in_image,
        _reference_determines,
        _heights_below_antennas,
        _told_short,
        _next_scan,
        _something_scatters,
        _path_of_positions,
        _baselines_settle,
        _autofocus_of_two,
    ),
)
"""In groups: what a group finds wrong is kept from the next."""

ADVICE = (
    _baseline_short,
    _elements_dense,
    _facets_coarse,
    _grid_fine,
    _heights_tell,
    _coupling_in_gate,
    _image_in_scene,
    _sides_apart,
    _facets_like_a_crystal,
    _noise_above_scene,
    _baseline_of_nothing,
    _few_positions,
    _reference_near_ground,
)
"""What is allowed but unwise."""
