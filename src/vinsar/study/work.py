"""How much a study computes and holds, told from its configuration alone before any of it is done.

Peaks of memory are those of the chain's own arrays, by the quantity that each grows with; the
figures were taken with `tracemalloc` and are good to a factor of two.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from math import inf, isfinite, prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vinsar.foundations.errors import Fault
from vinsar.radar import grid

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from vinsar.evaluation.misregistration import Registration
    from vinsar.foundations.configuration import Study
    from vinsar.processing.filtering import Filtering
    from vinsar.processing.focusing import Imaging
    from vinsar.radar.trajectory import Radar
    from vinsar.simulation.scene import Scene
    from vinsar.study.options import Sweep

_CHANNELS = 2

# What the interpreter and its libraries take before anything is computed.
_START_BYTES = 0.4e9

# A case of a sweep, and its row as it waits for the others.
_ROW_BYTES = 8000

_TOLD = ("antenna positions", "frequencies", "cells of the terrain", "facets", "pixels")


@dataclass(frozen=True)
class Amount:
    """A number that memory or time grow with.

    Attributes
    ----------
    name
        What is counted.
    count
        How many; infinite if there is no number.
    key
        The key that changes it.
    stage
        The stage whose memory it bounds.
    bytes_each
        Bytes at that stage's peak for each.
    """

    name: str
    count: float
    key: str
    stage: str
    bytes_each: float

    @property
    def bytes(self) -> float:
        """Bytes at the stage's peak."""
        return self.count * self.bytes_each


def _ratio(extent: float, spacing: float) -> float:
    try:
        return extent / spacing
    except (OverflowError, ZeroDivisionError):
        return inf


def _cells(part: Scene | Imaging, spacing_x: float, spacing_y: float) -> float:
    along = _ratio(part.x_max_m - part.x_min_m, spacing_x)
    return along * _ratio(part.y_max_m - part.y_min_m, spacing_y)


def of_radar(radar: Radar) -> list[Amount]:
    """Return the amounts that the radar alone decides."""
    positions = _ratio(radar.aperture_length_m, radar.position_spacing_m) + 1
    samples = _CHANNELS * positions * radar.frequency_count
    return [
        Amount("antenna positions", positions, "radar.position_spacing_m", "trajectory", 1000),
        Amount("frequencies", radar.frequency_count, "radar.frequency_count", "echo", 1000),
        Amount("samples of the echo", samples, "radar.frequency_count", "profiles", 500),
    ]


def of_scene(scene: Scene) -> list[Amount]:
    """Return the amounts that the scene alone decides."""
    cells = _cells(scene, scene.terrain_spacing_m, scene.terrain_spacing_m)
    facets = _cells(scene, scene.facet_size_m, scene.facet_size_m)
    return [
        Amount("cells of the terrain", cells, "scene.terrain_spacing_m", "terrain", 80),
        Amount("facets", facets, "scene.facet_size_m", "facets", 400),
    ]


def of_imaging(imaging: Imaging) -> list[Amount]:
    """Return the amounts that the image alone decides."""
    pixels = _cells(imaging, *grid.pixel(imaging))
    return [Amount("pixels", pixels, "imaging.grid_spacing_m", "images", 350)]


def of_filtering(filtering: Filtering) -> list[Amount]:
    """Return the amounts that the filter alone decides."""
    patch = float(filtering.goldstein_patch_px) ** 2
    key = "filtering.goldstein_patch_px"
    return [Amount("cells of a patch", patch, key, "filtered", 200)]


def of_registration(registration: Registration) -> list[Amount]:
    """Return the amounts that the registration's figure alone decides."""
    count = registration.height_count
    return [Amount("heights of targets", count, "registration.height_count", "registration", 2e4)]


def of_radar_and_scene(radar: Radar, scene: Scene) -> list[Amount]:
    """Return the amounts that radar and scene decide together."""
    flags = _CHANNELS * of_radar(radar)[0].count * of_scene(scene)[1].count
    name = "facets seen from positions"
    return [Amount(name, flags, "scene.facet_size_m", "visibility", 4)]


def of_sweeps(sweeps: Mapping[str, Sweep]) -> list[Amount]:
    """Return the cases of each sweep."""
    return [
        Amount(
            f"cases of the sweep '{name}'",
            prod(map(len, sweep.over.values())) * float(sweep.realizations),
            f"sweeps.{name}.realizations",
            f"sweep {name}",
            _ROW_BYTES,
        )
        for name, sweep in sweeps.items()
    ]


def memory() -> float:
    """Return how many bytes of memory this machine, or what it grants this process, has."""
    found = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    limit = Path("/sys/fs/cgroup/memory.max")
    if limit.is_file() and (text := limit.read_text(encoding="ascii").strip()).isdigit():
        found = min(found, float(text))
    return found


def _too_much(amounts: list[Amount], **sections: Any) -> Iterator[Fault]:
    most = memory()
    told = set()
    for amount in sorted(amounts, key=lambda one: -one.bytes):
        if amount.bytes + _START_BYTES > most and amount.key not in told:
            told.add(amount.key)
            section, _, key = amount.key.partition(".")
            count = f"{amount.count:.3g}" if isfinite(amount.count) else "far too many"
            yield Fault(
                amount.key,
                getattr(sections.get(section), key, None),
                f"makes {count} {amount.name}, about {amount.bytes / 1e9:.3g} GB in "
                f"'{amount.stage}', and this machine has {most / 1e9:.3g} GB",
            )


def _radar_fits(radar: Radar) -> Iterator[Fault]:
    yield from _too_much(of_radar(radar), radar=radar)


def _scene_fits(scene: Scene) -> Iterator[Fault]:
    yield from _too_much(of_scene(scene), scene=scene)


def _image_fits(imaging: Imaging) -> Iterator[Fault]:
    yield from _too_much(of_imaging(imaging), imaging=imaging)


def _patches_fit(filtering: Filtering) -> Iterator[Fault]:
    yield from _too_much(of_filtering(filtering), filtering=filtering)


def _targets_fit(registration: Registration) -> Iterator[Fault]:
    yield from _too_much(of_registration(registration), registration=registration)


def _visibility_fits(radar: Radar, scene: Scene) -> Iterator[Fault]:
    if not list(_too_much([*of_radar(radar), *of_scene(scene)])):
        yield from _too_much(of_radar_and_scene(radar, scene), scene=scene)


def _sweeps_fit(sweeps: Mapping[str, Sweep]) -> Iterator[Fault]:
    yield from _too_much(of_sweeps(sweeps))


CHECKS = (
    _radar_fits,
    _scene_fits,
    _image_fits,
    _patches_fit,
    _targets_fit,
    _visibility_fits,
    _sweeps_fit,
)
"""First of all: the other checks compute with what these find to fit."""


def amounts(study: Study) -> list[Amount]:
    """Return all amounts of a study.

    Parameters
    ----------
    study
        The checked configuration.
    """
    found = [*of_radar(study.radar), *of_imaging(study.imaging)]
    if study.filtering.method == "goldstein":
        found += of_filtering(study.filtering)
    if study.measurement.file is None:
        found += [*of_scene(study.scene), *of_radar_and_scene(study.radar, study.scene)]
        found += of_sweeps(study.sweeps)
    return found


def sentence(study: Study) -> str:
    """Return what a study computes, and what it takes, in one sentence.

    Parameters
    ----------
    study
        The checked configuration.
    """
    found = amounts(study)
    largest = max(found, key=lambda one: one.bytes)
    told = [one for one in found if one.name in _TOLD]
    counts = [f"{one.count:,.0f} {one.name}" for one in told]
    cases = sum(one.count for one in found if one.name.startswith("cases"))
    counts += [f"{cases:,.0f} cases of sweeps"] if cases else []
    peak = (largest.bytes + _START_BYTES) / 1e9
    return f"{', '.join(counts)}; about {peak:.1f} GB of memory at most, in '{largest.stage}'"
