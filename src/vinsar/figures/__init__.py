"""The figures of the paper, drawn from the products of the chain and from sweeps.

`FIGURES` is the one description of them; `save` writes one to files. Figures may read the truth,
which the processing never does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from vinsar.figures import (
    acquisition,
    baselines,
    captions,
    chain,
    coupling,
    height_error,
    moving,
    noise,
    obstacles,
    prediction,
    registration_error,
    summary,
    systems,
    vibration,
)
from vinsar.figures.files import save
from vinsar.figures.style import colormap
from vinsar.prediction import design
from vinsar.study import validation

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    import matplotlib.figure

    from vinsar.study import config
    from vinsar.study.pipeline import Products

__all__ = ["FIGURES", "Figure", "check", "colormap", "save"]


@dataclass(frozen=True)
class Figure:
    """A figure of the paper.

    Attributes
    ----------
    draw
        From the products and the study to the figure.
    inputs
        Products that it reads, keys of `vinsar.study.pipeline.STAGES`.
    sections
        Parts of the configuration that it reads, and no others.
    sweeps
        Sweeps that it reads; `draw` finds each among the products as ``sweeps/<name>``.
    title
        What the report calls it; its name if empty.
    numbers
        From the same products and study to a sentence with the figure's own numbers, which the
        report adds to its caption.
    """

    draw: Callable[[Products, config.Study], matplotlib.figure.Figure]
    inputs: tuple[str, ...]
    sections: tuple[str, ...]
    sweeps: tuple[str, ...] = ()
    title: str = ""
    numbers: Callable[[Products, config.Study], str] | None = None


FIGURES: dict[str, Figure] = {
    "summary": Figure(
        summary.draw,
        summary.INPUTS,
        ("figures", "radar"),
        title="Front sheet",
        numbers=captions.height_error,
    ),
    "measured": Figure(chain.draw_measured, chain.MEASURED_INPUTS, ("figures",)),
    "fig1": Figure(
        acquisition.draw,
        (),
        ("figures", "radar", "scene", "imaging"),
        title="Geometry",
        numbers=captions.acquisition_geometry,
    ),
    "fig2": Figure(
        registration_error.draw,
        ("registration",),
        ("figures", "radar"),
        title="Registration error",
        numbers=captions.registration_error,
    ),
    "fig3": Figure(
        chain.draw_sheet,
        chain.SHEET_INPUTS,
        ("figures",),
        title="From terrain to height",
        numbers=captions.chain,
    ),
    **{
        f"fig3{letter}": Figure(
            partial(chain.draw_single, letter), chain.panel_inputs(letter), ("figures",)
        )
        for letter in chain.PANELS
    },
    "fig4": Figure(
        height_error.draw,
        ("accuracy",),
        ("figures",),
        title="Height error",
        numbers=captions.height_error,
    ),
    "fig5": Figure(
        vibration.draw,
        ("truth",),
        ("figures", "radar", "scene", "sweeps"),
        ("vibration",),
        title="Position errors",
        numbers=captions.vibration,
    ),
    "baseline_length": Figure(
        baselines.draw_length,
        (),
        ("figures", "radar", "scene", "imaging", "interferogram", "sweeps"),
        ("baseline_length",),
        title="Length of the baseline",
        numbers=captions.baseline_length,
    ),
    "baseline_angle": Figure(
        baselines.draw_angle,
        ("baseline_angle",),
        ("figures", "radar", "scene"),
        title="Attitude of the baseline",
        numbers=captions.baseline_angle,
    ),
    "baseline_vibration": Figure(
        baselines.draw_vibration,
        (),
        ("figures", "motion", "sweeps"),
        ("baseline_vibration",),
        title="Length of the baseline under position errors",
        numbers=captions.baseline_vibration,
    ),
    "snr": Figure(
        noise.draw,
        (),
        ("figures", "radar", "scene", "imaging", "interferogram", "sweeps"),
        ("snr",),
        title="Thermal noise",
        numbers=captions.snr,
    ),
    "moving": Figure(
        moving.draw,
        ("terrain", "truth"),
        ("figures", "radar", "imaging", "vehicle"),
        ("speed", "speed_error"),
        title="A vehicle that drives during the scan",
    ),
    "obstacles": Figure(
        obstacles.draw_map,
        ("truth", "dem", "detections"),
        ("figures", "scene"),
        title="Obstacles and holes",
    ),
    "roc": Figure(
        obstacles.draw_roc,
        (),
        ("figures", "scene", "detection", "sweeps"),
        (obstacles.SWEEP,),
        title="Detection and false alarms",
    ),
    "coupling": Figure(
        coupling.draw,
        ("coupling",),
        ("figures",),
        ("coupling",),
        title="Coupling of transmitter and receiver",
    ),
    "design": Figure(
        prediction.draw_sheet, (), ("figures", *design.SECTIONS), title="Design sheet"
    ),
    "design_check": Figure(
        prediction.draw_check,
        (),
        ("figures", "sweeps", *design.SECTIONS),
        ("snr", "baseline_length", "vibration"),
        title="Prediction and measurement",
    ),
    "systems": Figure(
        systems.draw,
        (),
        ("figures", "radar", "scene", "vehicle", "sweeps"),
        ("systems",),
        title="The rail beside switched arrays",
    ),
}
"""The figures by name: the paper's in its order, then those of its section 1.2, of noise, and of
obstacles."""


def check(study: config.Study, products: Collection[str]) -> None:
    """Refuse a study that asks for figures that do not exist or cannot be drawn.

    Parameters
    ----------
    study
        The configuration.
    products
        Names of the products that the study has.

    Raises
    ------
    validation.ConfigurationError
        If a figure is unknown, stands there twice, shows a sweep that the study lacks, or needs
        the true scene, which measured echoes come without.
    """
    faults = []
    measured = study.measurement.file is not None
    possible = [
        name
        for name, figure in FIGURES.items()
        if not (measured and (figure.sweeps or "scene" in figure.sections))
        and set(figure.inputs) <= set(products)
    ]
    asked = study.outputs.figures
    for number, name in enumerate(asked):
        where = f"outputs.figures[{number}]"
        if name not in FIGURES:
            faults.append(validation.Fault(where, name, f"no such figure; {', '.join(FIGURES)}"))
            continue
        if name in asked[:number]:
            faults.append(validation.Fault(where, name, "stands there twice"))
        if name not in possible:
            allowed = f"needs the true scene, without which there are {', '.join(possible)}"
            faults.append(validation.Fault(where, name, allowed))
            continue
        faults += [
            validation.Fault(where, name, f"shows the sweep '{sweep}', which `sweeps` lacks")
            for sweep in FIGURES[name].sweeps
            if sweep not in study.sweeps
        ]
    if faults:
        raise validation.ConfigurationError(faults)
