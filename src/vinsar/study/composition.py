"""The whole of a study, composed of what the modules of the wings declare.

A module may hold sections (`vinsar.foundations.configuration.Section` with a name), ``STAGES``,
``CHECKS`` of its own sections and ``ADVICE``; it is found by its folder, and listed nowhere.
"""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType
from typing import TYPE_CHECKING, Any

from pydantic import create_model

from vinsar.foundations import configuration
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.text import Name
from vinsar.study import options

if TYPE_CHECKING:
    from vinsar.foundations.stage import Stage

_WINGS = ("radar", "simulation", "processing", "evaluation")


def _modules() -> list[ModuleType]:
    found: list[ModuleType] = []
    for wing in _WINGS:
        package = importlib.import_module(f"vinsar.{wing}")
        found += [
            importlib.import_module(f"{package.__name__}.{module.name}")
            for module in pkgutil.iter_modules(package.__path__)
        ]
    return [*found, options]


def _sections(modules: list[ModuleType]) -> dict[str, type[Section]]:
    found: dict[str, type[Section]] = {}
    for module in modules:
        for value in vars(module).values():
            if not (isinstance(value, type) and issubclass(value, Section)):
                continue
            if value.__module__ == module.__name__ and value.section_name:
                if value.section_name in found:
                    raise ValueError(f"two sections are called '{value.section_name}'")
                found[value.section_name] = value
    return found


def _ordered(declared: dict[str, Stage]) -> dict[str, Stage]:
    """Return the stages so that each comes after its inputs, and not before it is needed."""
    found: dict[str, Stage] = {}

    def visit(name: str) -> None:
        if name in declared and name not in found:
            for source in (*declared[name].inputs, *declared[name].optional):
                visit(source)
            found[name] = declared[name]

    read = {source for stage in declared.values() for source in (*stage.inputs, *stage.optional)}
    for name in declared:
        if name not in read:
            visit(name)
    return found


def _collected(name: str) -> tuple[Any, ...]:
    return tuple(rule for module in _MODULES for rule in getattr(module, name, ()))


_MODULES = _modules()

STAGES: dict[str, Stage] = _ordered(
    {name: stage for module in _MODULES for name, stage in getattr(module, "STAGES", {}).items()}
)
"""The chain; a stage makes the product of its name, after those that it reads."""

CHECKS = _collected("CHECKS")
"""Checks of single sections."""

ADVICE = _collected("ADVICE")
"""What is allowed but unwise in single sections."""

StudyModel: type[configuration.Study] = create_model(  # type: ignore[call-overload]
    "StudyModel",
    __base__=configuration.Study,
    __module__=__name__,
    __doc__="A whole study.",
    **{name: (section, ...) for name, section in _sections(_MODULES).items()},
    variants=(
        dict[Name, options.Override],
        key("overrides by name; `./run variants` tabulates the accuracy of each", "ours"),
    ),
    sweeps=(
        dict[Name, options.Sweep],
        key("sweeps by name; `./run results/<study>/sweeps/<name>.nc` computes one", "ours"),
    ),
)
"""The model of a whole study."""
