"""The configuration held against its own bounds and against radar physics, before anything runs.

All faults come in one message: each with the key's path, its value, and what is allowed.
"""

from __future__ import annotations

import difflib
import inspect
import itertools
import re
import typing
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError

from vinsar.foundations import strict_yaml
from vinsar.foundations.configuration import Study, models_in
from vinsar.foundations.errors import ConfigurationError, Fault
from vinsar.foundations.text import NAMED_BY
from vinsar.radar import trajectory
from vinsar.simulation.scene import ELEVATION, SceneObject
from vinsar.study import checks, composition, work
from vinsar.study.composition import StudyModel
from vinsar.study.options import SIMULATION

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    Rule = Callable[..., Iterator[Fault]]


_SHAPES = frozenset(
    name
    for model in models_in(SceneObject)
    for name in typing.get_args(model.model_fields["shape"].annotation)
)


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
        If a file cannot be read (`strict_yaml.load`), or none names the study.
    """
    merged: dict[str, Any] = {}
    first, *others = map(Path, paths)
    for content in (strict_yaml.load(first), *strict_yaml.overrides(*others)):
        merged = merge(merged, content)
    return merged


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration with some keys changed, section by section; lists are replaced."""
    result = dict(base)
    for key, value in changes.items():
        old = result.get(key)
        deeper = isinstance(value, dict) and isinstance(old, dict)
        result[key] = merge(old or {}, value) if deeper else value
    return result


def check(raw: Mapping[str, Any]) -> Study:
    """Check a configuration and return it as a study.

    Parameters
    ----------
    raw
        Every key with its value, as read from YAML.

    Returns
    -------
    Study
        The checked configuration.

    Raises
    ------
    ConfigurationError
        If anything is wrong with it.
    """
    faults: list[Fault] = []
    valid: dict[str, Any] = {}
    try:
        study = StudyModel.model_validate(raw)
        valid = {name: getattr(study, name) for name in StudyModel.model_fields}
    except ValidationError as error:
        faults = [_fault(item) for item in error.errors()]
        wrong = {fault.key.split(".")[0].split("[")[0] for fault in faults}
        valid = {
            name: field.annotation.model_validate(raw[name])
            for name, field in StudyModel.model_fields.items()
            if name not in wrong
            and isinstance(field.annotation, type)
            and issubclass(field.annotation, BaseModel)
        }
    valid = _meaningful(valid)
    # A section that is wrong by itself would only confuse the rules that come after.
    for rules in (work.CHECKS, composition.CHECKS, *checks.CHECKS):
        found = list(_apply(rules, valid))
        faults += found
        for fault in found:
            valid.pop(fault.key.split(".")[0], None)
    if faults:
        raise ConfigurationError(faults)
    return study


def variants(study: Study) -> dict[str, Study]:
    """Return a study's variants, all checked.

    They are checked when they are asked for: a small study inherits the paper's variants, not all
    of which suit it.

    Parameters
    ----------
    study
        The study.

    Returns
    -------
    dict of Study
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


def sweep_studies(study: Study, name: str) -> list[tuple[dict[str, Any], Study]]:
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
    found: list[tuple[dict[str, Any], Study]] = []
    faults: dict[tuple[str, str, str], Fault] = {}
    for values in itertools.product(*sweep.over.values()):
        changes = dict(zip(sweep.over, values, strict=True))
        raw: dict[str, Any] = base
        for key, value in changes.items():
            raw = merge(raw, _nested(key, value))
        # Antennas below the upper one stay when its baseline is swept alone.
        length, several = changes.get("radar.baseline_m"), raw["radar"]["baselines_m"]
        if isinstance(length, int | float) and several and "radar.baselines_m" not in changes:
            raw = merge(raw, {"radar": trajectory.longest(length, several)})
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


def _refuse_other_files(case: Study, study: Study) -> None:
    """Refuse a case that needs another file, or another part of it, than its study reads."""
    faults = [
        Fault(
            f"scene.{key}",
            getattr(case.scene, key),
            "must be the study's own, because the file is read once for all; make it a study",
        )
        for key in ELEVATION
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


def advice(study: Study) -> list[str]:
    """Return what is allowed but unwise in a checked configuration, a sentence each."""
    sections = _meaningful({name: getattr(study, name) for name in StudyModel.model_fields})
    return [str(fault) for fault in _apply((*composition.ADVICE, *checks.ADVICE), sections)]


def _meaningful(sections: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what measured echoes do without."""
    measurement = sections.get("measurement")
    measured = measurement is not None and measurement.file is not None
    return {
        name: section for name, section in sections.items() if not (measured and name in SIMULATION)
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
        if (path.endswith("]") and part in _SHAPES) or part == "[key]":
            continue  # pydantic's word for which of the shapes, or for a key itself
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else str(part)
    value = error["input"]
    if error["type"] == "missing":
        return Fault(path, None, "missing; config/paper.yaml shows it with its value")
    if error["type"] == "extra_forbidden":
        return Fault(path, value, "unknown key" + _nearest(path))
    if error["type"].startswith("string_"):
        return Fault(path, value, f"must be {NAMED_BY}")
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
    known = list(_keys(StudyModel))
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
    return frozenset(_keys(StudyModel))


def _keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    for name, field in model.model_fields.items():
        yield prefix + name
        # A key's own model, or those of the items of a list.
        for kind in models_in(field.annotation):
            yield from _keys(kind, f"{prefix}{name}.")
