"""The commands for measured data: import a radar's own form, and calibrate an echo."""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.processing import calibration
from vinsar.radar import waveform
from vinsar.readers import importing, sign
from vinsar.results import storage

if TYPE_CHECKING:
    from collections.abc import Sequence

_PNG_DPI = 150


def add_commands(commands: Any) -> tuple[argparse.ArgumentParser, ...]:
    """Add `import` and `calibrate` to the commands."""
    add = commands.add_parser("import", help="a radar's own files as a measurement")
    add.add_argument("form", choices=importing.FORMS)
    add.add_argument("files", nargs="+")
    add.add_argument("-o", "--output", required=True, help="the measurement, a netCDF file")
    add.add_argument("--samples", nargs="+", help="array of the samples, or one for each channel")
    add.add_argument("--order", help="their dimensions, such as channel,position,frequency")
    add.add_argument("--frequency", help="array of the frequencies, or first:last in Hz")
    add.add_argument("--range", help="array of the ranges, or first:last in m")
    add.add_argument("--positions", nargs="+", help="array of the antennas, or x,y,z")
    add.add_argument("--receivers", nargs="+", help="of the receiving ones, if they are others")
    add.add_argument("--reference-range", help="array of the range taken out at each position")
    add.add_argument("--time", help="array of the times of the echoes")
    add.add_argument("--positions-time", help="array of the times of the positions, if others")
    add.add_argument("--start-frequency", type=float, help="at the first sample, Hz")
    add.add_argument("--sweep-rate", type=float, help="Hz/s, negative if it falls")
    add.add_argument("--sample-rate", type=float, help="Hz")
    add.add_argument("--alternating", action="store_true", help="every second sweep runs back")
    add.add_argument("--carrier", type=float, default=0.0, help="of complex pulses, Hz")
    add.add_argument("--band", nargs=2, type=float, metavar=("LOW", "HIGH"), help="Hz")
    add.add_argument("--carrier-kept", action="store_true", help="the reference left the carrier")
    add.add_argument("--sign", type=int, choices=(-1, 1), help="of the phase that grows with range")
    add.add_argument("--look-at", type=_numbers(2), help="x,y of the scene: turn coordinates to it")
    add.add_argument("--ground", type=float, default=0.0, help="height of the ground, m")
    add.set_defaults(answer=_import)
    fit = commands.add_parser("calibrate", help="a measurement by a reflector or level ground")
    fit.add_argument("file")
    fit.add_argument("-o", "--output", required=True, help="the calibrated measurement")
    fit.add_argument("--reflector", type=_numbers(3), help="x,y,z of a surveyed reflector, m")
    fit.add_argument(
        "--ground",
        type=_numbers(4),
        nargs="+",
        help="x_min,x_max,y_min,y_max of level ground at z = 0, m",
    )
    fit.add_argument(
        "--apply",
        nargs="*",
        choices=calibration.KINDS,
        default=list(calibration.KINDS),
        help="what is taken out; all by default",
    )
    fit.add_argument("--largest-bias", type=float, default=1.0, help="m")
    fit.add_argument("--largest-offset", type=float, default=0.25, help="s")
    fit.set_defaults(answer=_calibrate)
    return add, fit


def _numbers(count: int) -> Any:
    def parse(word: str) -> tuple[float, ...]:
        found = tuple(map(float, word.split(",")))
        if len(found) != count:
            raise argparse.ArgumentTypeError(f"{count} numbers are needed, joined by commas")
        return found

    return parse


def _import(arguments: argparse.Namespace) -> int:
    options = importing.Options(
        samples=None if arguments.samples is None else tuple(arguments.samples),
        order=arguments.order,
        frequency=arguments.frequency,
        range=arguments.range,
        positions=None if arguments.positions is None else tuple(arguments.positions),
        receivers=None if arguments.receivers is None else tuple(arguments.receivers),
        reference_range=arguments.reference_range,
        time=arguments.time,
        positions_time=arguments.positions_time,
        start_frequency_hz=arguments.start_frequency,
        sweep_rate_hz_per_s=arguments.sweep_rate,
        sample_rate_hz=arguments.sample_rate,
        alternating=arguments.alternating,
        carrier_frequency_hz=arguments.carrier,
        band_hz=None if arguments.band is None else tuple(arguments.band),
        carrier_kept=arguments.carrier_kept,
        sign=arguments.sign,
        look_at=arguments.look_at,
        ground_m=arguments.ground,
    )
    found = importing.read(arguments.form, arguments.files, options)
    for note in found.notes:
        sys.stdout.write(f"{note}\n")
    test = sign.compare(
        found.echo, found.frequency, found.transmitter, found.receiver, scene_m=found.scene_m
    )
    sys.stdout.write(f"{test.sentence}\n")
    found.notes.append(test.sentence)
    _write(found, arguments.output, arguments.files, {"vinsar_form": arguments.form})
    return 0


def _calibrate(arguments: argparse.Namespace) -> int:
    if arguments.reflector is None and arguments.ground is None:
        raise ValueError("nothing to calibrate by; give --reflector x,y,z or --ground")
    found = importing.read("stepped", [arguments.file], importing.Options())
    echoes = calibration.Echoes(
        found.echo, found.frequency, found.transmitter, found.receiver, found.time
    )
    estimate = calibration.Calibration()
    if arguments.reflector is not None:
        estimate = calibration.from_reflector(
            echoes,
            arguments.reflector,
            largest_bias_m=arguments.largest_bias,
            largest_offset_s=arguments.largest_offset,
        )
    if arguments.ground is not None:
        # Range and clocks have to be right before the ground is where it is.
        rough = calibration.apply(echoes, estimate, ("range", "time"))
        ground = calibration.from_ground(rough, arguments.ground)
        estimate = replace(
            estimate,
            channel_delay_s=ground.channel_delay_s,
            channel_phase_rad=ground.channel_phase_rad,
        )
    for line in calibration.as_text(estimate, arguments.apply):
        sys.stdout.write(f"{line}\n")
    applied = calibration.apply(echoes, estimate, arguments.apply)
    found.echo, found.time = applied.samples, applied.time
    found.transmitter, found.receiver = applied.transmitter, applied.receiver
    found.notes += calibration.as_text(estimate, arguments.apply)
    record = {
        "reflector_m": arguments.reflector,
        "ground_m": arguments.ground,
        "applied": arguments.apply,
        "estimates": asdict(estimate),
    }
    attributes = {"vinsar_calibration": json.dumps(record, sort_keys=True)}
    _write(found, arguments.output, [arguments.file], attributes)
    return 0


def _write(
    found: importing.Measurement, output: str, files: Sequence[str], attributes: dict[str, str]
) -> None:
    from vinsar.figures.drawing import files as figure_files
    from vinsar.figures.drawing import preview

    hashes = [f"{Path(name).name} {_sha256(name)}" for name in files]
    data = found.dataset()
    data.attrs |= {"source": "; ".join(hashes)} | attributes
    with storage.atomic(output) as temporary:
        data.to_netcdf(temporary, engine="netcdf4", format="NETCDF4")
    near = 0.0
    if found.scene_m is not None:
        center = (found.transmitter + found.receiver).reshape(-1, 3).mean(axis=0) / 2
        step = float(found.frequency[1] - found.frequency[0])
        distance = float(np.hypot(np.hypot(*(found.scene_m - center[:2])), center[2]))
        near = max(0.0, distance - waveform.unambiguous_range(step) / 2)
    figure = preview.draw(found.echo, found.frequency, near_range_m=near, title=Path(output).name)
    picture = Path(output).with_suffix(".png")
    figure_files.save(figure, [picture], png_dpi=_PNG_DPI)
    sys.stdout.write(f"wrote {output} and {picture}\n")


def _sha256(name: str) -> str:
    return hashlib.sha256(Path(name).read_bytes()).hexdigest()
