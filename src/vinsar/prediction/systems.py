"""The antenna arrangements side by side: resolution, height of ambiguity, accuracy, scan time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from vinsar.foundations import tables, variables
from vinsar.foundations.configuration import swept_section
from vinsar.radar import instrument, trajectory

if TYPE_CHECKING:
    import xarray as xr

    from vinsar.foundations.configuration import Study

SWEEP = "systems"
"""The sweep that the comparison is made from; it goes over the section ``radar`` alone."""

_NAMES = {"rail": "rail", "transmit_pair": "transmit pair", "receive_pair": "receive pair"}


@dataclass(frozen=True)
class System:
    """An antenna arrangement and what it achieves.

    Attributes
    ----------
    name
        Arrangement and length.
    positions
        Antenna positions, or elements of an array.
    resolution_m
        Resolution in x and y at the scene's middle, on the ground, m.
    height_of_ambiguity_m
        Height that turns the phase by a cycle there, m.
    scan_time_s
        Time for the aperture: the cart's run along the rail, or the array's frequency sweeps, s.
    accuracy
        Product ``sweep`` of this arrangement: its statistics by region and realization.
    """

    name: str
    positions: int
    resolution_m: tuple[float, float]
    height_of_ambiguity_m: float
    scan_time_s: float
    accuracy: xr.Dataset


def compare(sweep: xr.Dataset, study: Study) -> list[System]:
    """Return the arrangements of the sweep `SWEEP`, in its order.

    Parameters
    ----------
    sweep
        The sweep's dataset.
    study
        The study, with ``radar``, ``scene``, ``vehicle`` and ``sweeps``.

    Returns
    -------
    list of System
        An arrangement each.
    """
    over = study.sweeps[SWEEP].over
    if list(over) != ["radar"]:
        raise ValueError(f"the sweep '{SWEEP}' goes over {', '.join(over)}; radar alone is needed")
    common = swept_section(study, SWEEP, "radar")
    scene = swept_section(study, SWEEP, "scene")
    statistics = variables.swept(sweep, "radar")
    found = []
    for number, changes in enumerate(over["radar"]):
        arranged = common.model_copy(update=changes)
        planned = instrument.Instrument.planned(arranged)
        place = instrument.middle(scene)
        across, ahead = planned.resolution(*place)
        found.append(
            System(
                name=f"{_NAMES[arranged.system]}, {arranged.aperture_length_m:g} m",
                positions=planned.positions,
                resolution_m=(float(across), float(ahead)),
                height_of_ambiguity_m=float(planned.height_of_ambiguity(*place)),
                scan_time_s=trajectory.scan_duration(arranged, study.vehicle),
                accuracy=statistics.isel(radar=number),
            )
        )
    return found


def as_markdown(found: list[System]) -> str:
    """Return the comparison as a Markdown table, means over the realizations."""
    headings = (
        *("system", "positions", "resolution in x, y", "height of ambiguity", "scan time"),
        *("within tolerance", "std", "visible: within tolerance", "visible: std"),
    )
    rows = []
    for system in found:
        across, ahead = system.resolution_m
        statistics = system.accuracy.mean("realization")
        row = [
            system.name,
            f"{system.positions}",
            f"{100 * across:.1f} cm, {100 * ahead:.1f} cm",
            f"{system.height_of_ambiguity_m:.3f} m",
            f"{system.scan_time_s:.3g} s",
        ]
        for region in ("whole_scene", "visible_ground"):
            part = statistics.sel(region=region)
            row.append(f"{100 * float(part['fraction_within_tolerance']):.1f} %")
            row.append(f"{100 * float(part['std']):.2f} cm")
        rows.append(row)
    return tables.write(headings, rows, "lrrrrrrrr") + "\n"
