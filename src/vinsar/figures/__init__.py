"""The figures, drawn from the products of the chain and from sweeps.

Each module of this folder declares its figures: what they read, how they are drawn, title, caption
and numbers. It may also declare small pictures of products. Both are found here, by what lies in
the folder. `drawing` holds what the modules share. Figures may read the truth, which the processing
never does.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import TYPE_CHECKING, Any

from vinsar.figures.drawing.declaration import Figure
from vinsar.figures.drawing.files import save, shown_inline
from vinsar.figures.drawing.style import colormap
from vinsar.figures.drawing.thumbnails import Thumbnail
from vinsar.foundations.errors import ConfigurationError, Fault

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator
    from types import ModuleType

    from vinsar.foundations.configuration import Study


__all__ = [
    "FIGURES",
    "MODULES",
    "THUMBNAILS",
    "Figure",
    "Thumbnail",
    "check",
    "colormap",
    "save",
    "shown_inline",
]


def _modules() -> Iterator[ModuleType]:
    for found in pkgutil.iter_modules(__path__):
        if not found.ispkg:
            yield importlib.import_module(f"{__name__}.{found.name}")


def _declared(modules: Iterable[ModuleType], attribute: str) -> dict[str, tuple[ModuleType, Any]]:
    """Return what modules declare under an attribute: by name, the module and the declaration."""
    found: dict[str, tuple[ModuleType, Any]] = {}
    for module in modules:
        for name, value in getattr(module, attribute, {}).items():
            if name in found:
                both = f"{found[name][0].__name__} and {module.__name__}"
                raise ValueError(f"'{name}' is declared twice in {attribute}: {both}")
            found[name] = module, value
    return found


FIGURES: dict[str, Figure] = {}
"""The figures by name."""

MODULES: dict[str, str] = {}
"""The module that declares each figure, as ``figures.chain``."""

for _name, (_module, _figure) in _declared(_modules(), "FIGURES").items():
    FIGURES[_name] = _figure
    MODULES[_name] = _module.__name__.removeprefix("vinsar.")

THUMBNAILS: dict[str, Thumbnail] = {
    name: thumbnail for name, (_, thumbnail) in _declared(_modules(), "THUMBNAILS").items()
}
"""The small pictures by product."""


def _lacking(study: Study, name: str) -> str:
    """Return what a figure needs and a study has not."""
    figure = FIGURES[name]
    if "reflectors" in figure.inputs:
        return "measurement.reflectors"
    simulated = figure.sweeps or any(part.split(".")[0] == "scene" for part in figure.sections)
    if study.measurement.channels == 1 and not simulated:
        return "a second channel"
    return "the true scene"


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
            allowed = (
                f"needs {_lacking(study, name)}, without which there are {', '.join(possible)}"
            )
            faults.append(Fault(where, name, allowed))
            continue
        faults += [
            Fault(where, name, f"shows the sweep '{sweep}', which `sweeps` lacks")
            for sweep in FIGURES[name].sweeps
            if sweep not in study.sweeps
        ]
    if faults:
        raise ConfigurationError(faults)
