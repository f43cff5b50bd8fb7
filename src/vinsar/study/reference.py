"""The configuration's reference page and its JSON schema, generated from the models.

``python -m vinsar.study.reference config`` writes ``README.md`` there.
"""

from __future__ import annotations

import json
import sys
import typing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from vinsar.foundations import tables
from vinsar.foundations.configuration import models_in
from vinsar.study.composition import StudyModel

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pydantic.fields import FieldInfo

_BOUNDS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}

_HEAD = """\
# Configuration

Generated from the sections that the modules in `src/vinsar` declare; do not edit.
`.venv/bin/python -m vinsar.study.reference config` writes it again.

`paper.yaml` holds every key with the paper's value. Another study holds only what differs, its
name `study` among it, and runs with `./run --configfile config/<name>.yaml`. Units stand in the
names. What is wrong, unknown or physically impossible is refused before anything runs, all of it
in one message. An editor that knows JSON schemas completes and checks the keys: `./run schema >
config/schema.json`.
"""


def markdown(defaults: Mapping[str, Any]) -> str:
    """Return the reference page.

    Parameters
    ----------
    defaults
        The paper's configuration.

    Returns
    -------
    str
        A table a section, in Markdown.
    """
    # In the order of paper.yaml, not in that of the folders.
    fields = {name: StudyModel.model_fields[name] for name in defaults}
    plain = [(name, field) for name, field in fields.items() if not _is_model(field.annotation)]
    parts = [_HEAD, "## Study\n", _section(plain, defaults)]
    for name, field in fields.items():
        if _is_model(field.annotation):
            model = typing.cast("type[BaseModel]", field.annotation)
            rows = list(model.model_fields.items())
            parts += [f"## `{name}`\n", f"{model.__doc__}\n", _section(rows, defaults[name])]
    return "\n".join(parts)


def _section(fields: list[tuple[str, FieldInfo]], defaults: Mapping[str, Any]) -> str:
    text = _table(fields, defaults)
    inner = {model for _, field in fields for model in _inner_models(field.annotation)}
    for model in sorted(inner, key=lambda model: model.__name__):
        rows = list(model.model_fields.items())
        text += f"\n{model.__name__}: {model.__doc__}\n\n" + _table(rows, None)
    return text


def _table(fields: list[tuple[str, FieldInfo]], defaults: Mapping[str, Any] | None) -> str:
    rows = []
    for name, field in fields:
        extra = typing.cast("dict[str, Any]", field.json_schema_extra)
        value = [] if defaults is None else [_value(defaults[name])]
        rows.append([f"`{name}`", *value, _allowed(field), field.description or "", extra["paper"]])
    value = [] if defaults is None else ["paper.yaml"]
    headings = ["key", *value, "allowed", "meaning", "in the paper"]
    return tables.write(headings, rows) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"{len(value)} entries"
    if isinstance(value, dict):
        return "see file"
    return f"`{value:g}`" if isinstance(value, float) else f"`{json.dumps(value)}`".replace('"', "")


def _allowed(field: FieldInfo) -> str:
    annotation = field.annotation
    options = typing.get_args(annotation)
    inner = _inner_models(annotation)
    if inner or _is_model(annotation):
        name = ", ".join(model.__name__ for model in inner) or getattr(annotation, "__name__", "")
        many: dict[Any, str] = {tuple: "list of ", dict: "by name: "}
        return many.get(typing.get_origin(annotation), "") + name
    if typing.get_origin(annotation) is dict:
        return "keys of a study" if options[1] is Any else "by name"
    if typing.get_origin(annotation) is typing.Literal:
        return ", ".join(f"`{option}`" for option in options)
    kind = {float: "number", int: "whole number", bool: "`true`, `false`", str: "text"}
    words = [kind[t] for t in (options or (annotation,)) if t in kind]
    bounds = [
        f"{sign} {getattr(item, name):g}"
        for item in field.metadata
        for name, sign in _BOUNDS.items()
        if hasattr(item, name)
    ]
    if type(None) in options:
        bounds.append("or null")
    return " ".join([*words, *bounds])


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _inner_models(annotation: Any) -> list[type[BaseModel]]:
    """Return the models that a list or mapping holds."""
    return [] if _is_model(annotation) else models_in(annotation)


def schema() -> str:
    """Return the JSON schema of a study's overrides: every key known, none required."""
    document = StudyModel.model_json_schema()

    def relax(node: Any) -> None:
        if isinstance(node, dict):
            # Items of lists are given whole; sections may be given in part.
            node.pop("required", None)
            for value in node.values():
                relax(value)
        elif isinstance(node, list):
            for value in node:
                relax(value)

    relax(document)
    document["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return json.dumps(document, indent=2) + "\n"


def write(folder: Path) -> None:
    """Write ``README.md`` beside ``paper.yaml``."""
    import yaml

    defaults = yaml.safe_load((folder / "paper.yaml").read_text(encoding="utf-8"))
    (folder / "README.md").write_text(markdown(defaults), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
