"""The numbers of the figures, as sentences that the report adds to their captions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures import acquisition, baselines, sweeps
from vinsar.foundations import variables
from vinsar.radar import geometry, instrument

if TYPE_CHECKING:
    from vinsar.study import config
    from vinsar.study.pipeline import Products


def acquisition_geometry(products: Products, study: config.Study) -> str:
    """Say the ranges and angles that Fig. 1 draws."""
    del products
    scheme = acquisition.layout(study)
    r1, r2 = scheme.ranges
    return (
        f"Drawn for a target {scheme.target[0]:g} m ahead and {scheme.target[1]:g} m high: "
        f"r1 = {r1:.3f} m, r2 = {r2:.3f} m, θ = {np.degrees(scheme.look):.2f}°."
    )


def registration_error(products: Products, study: config.Study) -> str:
    """Say the largest errors that imaged point targets measure."""
    del study
    product = products["registration"]
    parts = []
    for target in product["target"].values:
        at = product["target_position"].sel(target=target).values
        part = product.sel(target=target)
        largest = abs(part["measured"]).max("target_height")
        x, y = (1000 * float(largest.sel(ground_axis=axis)) for axis in ("x", "y"))
        tenth = 100 * float(part["resolution"].sel(ground_axis="y"))
        parts.append(
            f"at ({at[0]:g}, {at[1]:g}) m {y:.1f} mm in y, against a tenth of a cell of "
            f"{tenth:.1f} mm, and {x:.2f} mm in x"
        )
    return f"Largest errors measured: {'; '.join(parts)}."


def chain(products: Products, study: config.Study) -> str:
    """Say how much of the scene is in shadow, and how many residues the phase has."""
    del study
    shadow = 100 * float(products["truth"]["shadow"].mean())
    residues = int(np.count_nonzero(products["unwrapped"]["residue"].values))
    return f"{shadow:.1f} % of the cells are in shadow; the filtered phase has {residues} residues."


def height_error(products: Products, study: config.Study) -> str:
    """Say the statistics of the height error."""
    del study
    accuracy = products["accuracy"]
    whole = accuracy.sel(region="whole_scene")
    visible = accuracy.sel(region="visible_ground")
    tolerance = 100 * float(accuracy["tolerance"])
    return (
        f"{100 * float(whole['fraction_within_tolerance']):.1f} % of {int(whole['cell_count'])} "
        f"cells are within {tolerance:g} cm; standard deviation {100 * float(whole['std']):.2f} "
        f"cm over the whole scene and {100 * float(visible['std']):.2f} cm on visible ground; "
        f"largest error {100 * float(whole['maximum_absolute']):.1f} cm."
    )


def vibration(products: Products, study: config.Study) -> str:
    """Say the spread at the lowest level and at one wavelength or the highest, by axis."""
    del study
    sweep = variables.swept(
        products["sweeps/vibration"], "motion_channels", "motion_axis", "motion_level_wavelengths"
    )
    levels = np.sort(sweep["motion_level_wavelengths"].values)
    shown = sorted({float(levels[np.searchsorted(levels, 0.1).clip(max=levels.size - 1)]),
                    float(levels[-1])})  # fmt: skip
    parts = []
    for channels in sweep["motion_channels"].values:
        for level in shown:
            part = sweep["std"].sel(
                region="whole_scene", motion_channels=channels, motion_level_wavelengths=level
            )
            values = ", ".join(
                f"{100 * float(sweeps.spread(part.sel(motion_axis=axis))[0]):.1f} cm along {axis}"
                for axis in sorted(sweep["motion_axis"].values)
            )
            parts.append(f"{channels} errors of {level:g} wavelengths: {values}")
    return f"Mean spread under {'; '.join(parts)}."


def baseline_length(products: Products, study: config.Study) -> str:
    """Say the best length of the baseline."""
    del study
    sweep = variables.swept(products["sweeps/baseline_length"], "radar_baseline_m")
    sweep = sweep.sortby("radar_baseline_m")
    best, shortest, longest = baselines.best_lengths(sweep)
    part = sweep["std"].sel(region="whole_scene", radar_baseline_m=best)
    least = 100 * float(sweeps.spread(part)[0])
    text = f"The least spread over the whole scene, {least:.2f} cm, is that of {best:g} m"
    if longest > shortest:
        text += f"; from {shortest:g} to {longest:g} m it is at most a tenth larger"
    return f"{text}."


def baseline_angle(products: Products, study: config.Study) -> str:
    """Say the height errors at the study's own attitude, and where a length error is harmless."""
    product = products["baseline_angle"]
    beta = np.rad2deg(product["baseline_angle"].values)
    own = float(np.clip(study.radar.baseline_angle_deg, beta[0], beta[-1]))
    length, angle = (
        1000 * float(np.interp(own, beta, product[name].values))
        for name in ("length_drawn", "angle_drawn")
    )
    least = float(beta[int(np.argmin(product["length_exact"].values))])
    antenna, _ = instrument.Instrument.planned(study.radar).separated
    look = np.degrees(geometry.look_angle(antenna, *instrument.middle(study.scene)))
    return (
        f"At {own:g}° the errors of length and attitude give {length:.2f} and {angle:.2f} mm. A "
        f"length error does least harm at {least:g}°; θ is {look:.2f}°."
    )


def baseline_vibration(products: Products, study: config.Study) -> str:
    """Say the best case of each kind of error at the highest level."""
    del study
    sweep = variables.swept(
        products["sweeps/baseline_vibration"],
        "motion_channels",
        "radar_baseline_m",
        "motion_level_wavelengths",
    )
    level = float(sweep["motion_level_wavelengths"].max())
    parts = []
    for channels in sweep["motion_channels"].values:
        part = sweep["std"].sel(
            region="whole_scene", motion_channels=channels, motion_level_wavelengths=level
        )
        mean = sweeps.spread(part.transpose("radar_baseline_m", "realization"))[0]
        at = float(sweep["radar_baseline_m"].values[int(np.nanargmin(mean))])
        parts.append(f"{100 * float(np.nanmin(mean)):.1f} cm at {at:g} m under {channels} errors")
    return f"At {level:g} wavelengths the least spread is {' and '.join(parts)}."


def snr(products: Products, study: config.Study) -> str:
    """Say the spread at the lowest and the highest ratio."""
    del study
    sweep = variables.swept(products["sweeps/snr"], "echo_snr_db").sortby("echo_snr_db")
    mean = (
        100
        * sweeps.spread(
            sweep["std"].sel(region="whole_scene").transpose("echo_snr_db", "realization")
        )[0]
    )
    ratio = sweep["echo_snr_db"].values
    return (
        f"Mean spread over the whole scene: {mean[0]:.1f} cm at {ratio[0]:g} dB, {mean[-1]:.1f} cm "
        f"at {ratio[-1]:g} dB."
    )
