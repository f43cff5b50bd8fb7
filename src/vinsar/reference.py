"""The configuration's reference page and its schema, generated from the models.

``python -m vinsar.reference config`` writes ``README.md`` and ``schema.json`` there.
"""

from __future__ import annotations

import json
import sys
import typing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from vinsar import config

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pydantic.fields import FieldInfo

_BOUNDS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}

_HEAD = """\
# Configuration

Generated from `src/vinsar/config.py`; do not edit.
`.venv/bin/python -m vinsar.reference config` makes it anew.

`paper.yaml` holds every key with the paper's value. Another study holds only what differs, its
name `study` among it, and runs with `./run --configfile config/<name>.yaml`. Units stand in the
names. What is wrong, unknown or physically impossible is refused before anything runs, all of it
in one message. An editor that knows JSON schemas completes and checks the keys with `schema.json`.
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
    plain = [(n, f) for n, f in config.Study.model_fields.items() if _model(f.annotation) is None]
    parts = [_HEAD, "## Study\n", _table(plain, defaults)]
    for name, field in config.Study.model_fields.items():
        model = _model(field.annotation)
        if model is not None:
            parts += [f"## `{name}`\n", f"{model.__doc__}\n", _section(model, defaults[name])]
    return "\n".join(parts)


def _section(model: type[BaseModel], defaults: Mapping[str, Any]) -> str:
    text = _table(list(model.model_fields.items()), defaults)
    nested = {_model(f.annotation) for f in model.model_fields.values()}
    for inner in sorted((m for m in nested if m is not None), key=lambda m: m.__name__):
        text += f"\n{inner.__name__}: {inner.__doc__}\n\n" + _table(
            list(inner.model_fields.items()), None
        )
    return text


def _table(fields: list[tuple[str, FieldInfo]], defaults: Mapping[str, Any] | None) -> str:
    value = " paper.yaml |" if defaults is not None else ""
    rule = "---|" if defaults is not None else ""
    lines = [f"| key |{value} allowed | meaning | in the paper |", f"|---|{rule}---|---|---|"]
    for name, field in fields:
        extra = typing.cast("dict[str, Any]", field.json_schema_extra)
        cell = f" {_value(defaults[name])} |" if defaults is not None else ""
        lines.append(
            f"| `{name}` |{cell} {_allowed(field)} | {field.description} | {extra['paper']} |"
        )
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"{len(value)} entries"
    if isinstance(value, dict):
        return "see file"
    return f"`{value:g}`" if isinstance(value, float) else f"`{json.dumps(value)}`".replace('"', "")


def _allowed(field: FieldInfo) -> str:
    model = _model(field.annotation)
    if model is not None:
        many = typing.get_origin(field.annotation) is tuple
        return f"list of {model.__name__}" if many else model.__name__
    if typing.get_origin(field.annotation) is dict:
        return "keys of a study, by name"
    options = typing.get_args(field.annotation)
    if typing.get_origin(field.annotation) is typing.Literal:
        return ", ".join(f"`{option}`" for option in options)
    kind = {float: "number", int: "whole number", bool: "`true`, `false`", str: "text"}
    words = [kind[t] for t in (options or (field.annotation,)) if t in kind]
    bounds = [
        f"{sign} {getattr(item, name):g}"
        for item in field.metadata
        for name, sign in _BOUNDS.items()
        if hasattr(item, name)
    ]
    if type(None) in options:
        bounds.append("or null")
    return " ".join([words[0], *bounds])


def _model(annotation: Any) -> type[BaseModel] | None:
    for kind in _kinds(annotation):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None


def _kinds(annotation: Any) -> Iterator[Any]:
    yield annotation
    yield from typing.get_args(annotation)


def schema() -> str:
    """Return the JSON schema of a study's overrides: every key known, none required."""
    document = config.Study.model_json_schema()

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
    """Write ``README.md`` and ``schema.json`` beside ``paper.yaml``."""
    import yaml

    defaults = yaml.safe_load((folder / "paper.yaml").read_text(encoding="utf-8"))
    (folder / "README.md").write_text(markdown(defaults), encoding="utf-8")
    (folder / "schema.json").write_text(schema(), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
