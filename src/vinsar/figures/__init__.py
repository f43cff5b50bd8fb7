"""The figures, drawn from the products of the chain and from sweeps.

Each module of this folder declares its figures: what they read, how they are drawn, title, caption
and numbers. It may also declare small pictures of products. Both are found here, by what lies in
the folder. `drawing` holds what the modules share. Figures may read the truth, which the processing
never does.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import TYPE_CHECKING

from vinsar.figures.drawing.declaration import Figure
from vinsar.figures.drawing.files import save
from vinsar.figures.drawing.style import colormap
from vinsar.figures.drawing.thumbnails import Thumbnail
from vinsar.foundations.errors import ConfigurationError, Fault

if TYPE_CHECKING:
    from collections.abc import Collection

    from vinsar.foundations.configuration import Study


__all__ = ["FIGURES", "MODULES", "THUMBNAILS", "Figure", "Thumbnail", "check", "colormap", "save"]

FIGURES: dict[str, Figure] = {}
"""The figures by name."""

MODULES: dict[str, str] = {}
"""The module that declares each figure, as ``figures.chain``."""

THUMBNAILS: dict[str, Thumbnail] = {}
"""The small pictures by product."""


def _discover() -> None:
    """Gather what the modules of the folder declare."""
    for found in pkgutil.iter_modules(__path__):
        if found.ispkg:
            continue
        module = importlib.import_module(f"{__name__}.{found.name}")
        declared = getattr(module, "FIGURES", {})
        pictures = getattr(module, "THUMBNAILS", {})
        twice = [*(declared.keys() & FIGURES.keys()), *(pictures.keys() & THUMBNAILS.keys())]
        if not declared or twice:
            what = f"declares {', '.join(sorted(twice))} once more" if twice else "has no FIGURES"
            raise ValueError(f"{module.__name__} {what}; shared code lies in figures.drawing")
        FIGURES.update(declared)
        THUMBNAILS.update(pictures)
        MODULES.update(dict.fromkeys(declared, f"figures.{found.name}"))


_discover()


def check(study: Study, products: Collection[str]) -> None:
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
        If a figure is unknown, is listed twice, shows a sweep that the study lacks, or needs the
        true scene, which measured echoes come without.
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
            faults.append(Fault(where, name, f"no such figure; {', '.join(FIGURES)}"))
            continue
        if name in asked[:number]:
            faults.append(Fault(where, name, "is listed twice"))
        if name not in possible:
            allowed = f"needs the true scene, without which there are {', '.join(possible)}"
            faults.append(Fault(where, name, allowed))
            continue
        faults += [
            Fault(where, name, f"shows the sweep '{sweep}', which `sweeps` lacks")
            for sweep in FIGURES[name].sweeps
            if sweep not in study.sweeps
        ]
    if faults:
        raise ConfigurationError(faults)
