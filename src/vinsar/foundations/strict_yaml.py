"""Configuration files, read so that nothing is lost and nothing is guessed.

PyYAML, which Snakemake reads with as well, keeps to YAML 1.1: of a key that is given twice it
drops the first, `0401` is 257 to it, `1:30` is 90 and `1e9` is text. What YAML 1.1 and 1.2 read
differently is refused here, so that a file means the same to its author and to every reader.
"""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

# The scalars of YAML 1.2's core schema (section 10.3.2).
_CORE = (
    ("null", re.compile(r"null|Null|NULL|~|")),
    ("bool", re.compile(r"true|True|TRUE|false|False|FALSE")),
    ("int", re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")),
    (
        "float",
        re.compile(
            r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
            r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
        ),
    ),
)
_CALLED = {
    "null": "nothing", "bool": "true or false", "int": "a whole number", "float": "a number",
    "str": "text", "timestamp": "a date", "value": "a default", "merge": "keys merged in",
}  # fmt: skip

# Far more than a study holds: aliases of aliases may stand for more than any memory.
_MOST_VALUES = 2_000_000
_DEEPEST = 50

CODE = "__use_yte__"
"""A key by which Snakemake would run what a file holds as Python."""


class FileError(ValueError):
    """A file that cannot be read, or that different readers would read differently."""

    def __init__(self, path: Path, what: str, line: int = 0, column: int = 0) -> None:
        place = f", line {line}, column {column}" if line else ""
        super().__init__(f"cannot read the configuration {path}{place}: {what}")


def load(path: str | Path) -> dict[str, Any]:
    """Read a configuration file of JSON or YAML.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    dict
        Keys with their values; none for an empty file.

    Raises
    ------
    FileError
        If it is no such file, not UTF-8, not YAML, holds a key twice, a value that YAML 1.1 and
        1.2 read differently, a tag, or code; the message tells the line and the column.
    """
    path = Path(path)
    text = _text(path)
    try:
        content = _json(path, text)
    except json.JSONDecodeError:
        content = _yaml(path, text)
    if content is None:
        content = {}
    if not isinstance(content, dict):
        kind = type(content).__name__
        raise FileError(path, f"it holds {kind}; keys with values are needed")
    if CODE in content:
        raise FileError(path, f"{CODE} would run it as a program; a configuration holds values")
    return content


def overrides(*paths: str | Path) -> list[dict[str, Any]]:
    """Read the files that make a study of the paper's.

    Parameters
    ----------
    paths
        The files, in the order in which they override each other.

    Returns
    -------
    list of dict
        Keys with their values, of each file.

    Raises
    ------
    FileError
        As of `load`, or if none of them names the study.
    """
    read = [load(path) for path in paths]
    if read and not any("study" in content for content in read):
        raise FileError(
            Path(paths[-1]),
            "it does not name its study (study: ...), so that its results would take the place of "
            "the paper's",
        )
    return read


def _text(path: Path) -> str:
    if not path.exists():
        raise FileError(path, "there is no such file")
    if not path.is_file():
        raise FileError(path, "it is no file")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileError(path, f"{error.strerror or error}") from error
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        before = content[: error.start].decode("utf-8-sig")
        what = "it is UTF-16" if wide else f"byte 0x{content[error.start]:02x} is not UTF-8"
        raise FileError(path, f"{what}; save it as UTF-8", *_place(before)) from error


def _place(before: str) -> tuple[int, int]:
    """Return line and column, from 1, of what comes after a text."""
    return before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1


def _json(path: Path, text: str) -> Any:
    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in pairs:
            if key in found:
                raise FileError(path, f"the key '{key}' is given twice in one place")
            found[key] = value
        return found

    def refuse(word: str) -> Any:
        raise FileError(path, f"{word} is no number")

    try:
        content = json.loads(text, object_pairs_hook=unique, parse_constant=refuse)
        level = [content]
        for _ in range(_DEEPEST):
            level = [part for whole in level for part in _parts(whole)]
        if level:
            raise RecursionError
        return content
    except RecursionError as error:
        raise FileError(path, f"it is nested deeper than {_DEEPEST} levels") from error
    except json.JSONDecodeError:
        raise
    except ValueError as error:
        # A whole number of thousands of digits.
        raise error if isinstance(error, FileError) else FileError(path, str(error)) from error


def _parts(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return list(value.values())
    return value if isinstance(value, list) else []


def _yaml(path: Path, text: str) -> Any:
    import yaml

    try:
        loader = yaml.SafeLoader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        for problem, mark in _problems(node):
            raise FileError(path, problem, mark.line + 1, mark.column + 1)
        return loader.construct_document(node)
    except yaml.reader.ReaderError as error:
        character = f"the character U+{error.character:04X}"
        place = _place(text[: error.position])
        raise FileError(path, f"{character} is not allowed in YAML", *place) from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        raise FileError(path, _sentence(error), *place) from error
    except RecursionError as error:
        raise FileError(path, f"it is nested deeper than {_DEEPEST} levels") from error
    except ValueError as error:
        raise error if isinstance(error, FileError) else FileError(path, str(error)) from error


def _sentence(error: Any) -> str:
    problem = str(error.problem or error.context or error)
    if "'\\t'" in problem or "tab" in problem:
        return f"{problem}; indent with spaces"
    if "expected a single document" in str(error.context or ""):
        return "it holds several documents (---); one is needed"
    return problem


def _problems(root: Any) -> Iterator[tuple[str, Any]]:
    """Yield what is wrong with a document's nodes, each with its mark."""
    import yaml

    sizes: dict[int, int] = {}
    entered: set[int] = set()

    def visit(node: Any, depth: int) -> Iterator[tuple[str, Any]]:
        if id(node) in sizes:
            return
        if id(node) in entered:
            yield "an alias (*) stands within what it repeats", node.start_mark
            return
        if depth > _DEEPEST:
            yield f"it is nested deeper than {_DEEPEST} levels", node.start_mark
            return
        entered.add(id(node))
        size = 1
        children: list[Any] = []
        if isinstance(node, yaml.ScalarNode):
            yield from _of_scalar(node)
        elif isinstance(node, yaml.MappingNode):
            yield from _of_mapping(node)
            children = [part for pair in node.value for part in pair]
        else:
            yield from _of_tag(node, "seq")
            children = node.value
        for child in children:
            yield from visit(child, depth + 1)
            size += sizes.get(id(child), 1)
        if size > _MOST_VALUES:
            yield f"its aliases stand for more than {_MOST_VALUES} values", node.start_mark
        entered.discard(id(node))
        sizes[id(node)] = size

    return visit(root, 0)


def _of_tag(node: Any, expected: str) -> Iterator[tuple[str, Any]]:
    if node.tag != f"tag:yaml.org,2002:{expected}":
        # YAML writes the tags of its own schema so.
        shown = node.tag.replace("tag:yaml.org,2002:", "!!")
        yield f"the tag {shown} is not allowed; a configuration holds plain values", node.start_mark


def _of_mapping(node: Any) -> Iterator[tuple[str, Any]]:
    yield from _of_tag(node, "map")
    seen: dict[str, int] = {}
    for key, _ in node.value:
        kind = key.tag.rpartition(":")[2]
        if kind == "merge":
            continue  # told as a scalar that readers take differently
        if kind != "str":
            shown = getattr(key, "value", None)
            told = f"the key {shown} is {_CALLED.get(kind, kind)}" if isinstance(shown, str) else (
                "a key is itself a list or keys with values"
            )  # fmt: skip
            yield f"{told}; a key is text (put it in quotes, if it is meant so)", key.start_mark
        elif key.value in seen:
            first = seen[key.value]
            yield f"the key '{key.value}' is given twice, first in line {first}", key.start_mark
        else:
            seen[key.value] = key.start_mark.line + 1


def _of_scalar(node: Any) -> Iterator[tuple[str, Any]]:
    kind = node.tag.rpartition(":")[2]
    text = node.value
    if node.style is not None:
        yield from _of_tag(node, "str")
        return
    resolved = _resolver().resolve(type(node), text, (True, False))
    if node.tag != resolved:
        yield from _of_tag(node, "?")
        return
    core = next((name for name, form in _CORE if form.fullmatch(text)), "str")
    if kind == core and not (kind == "int" and re.match(r"[-+]?0[0-9]", text)):
        return
    told = [_CALLED.get(name, name) for name in (kind, core)]
    if told[0] == told[1]:
        told = ["a number in base 8", "a number in base 10"]
    yield (
        f"'{text}' is {told[0]} to some readers of YAML, {told[1]} to others; {_instead(text)}",
        (node.start_mark),
    )


def _instead(text: str) -> str:
    """Return how to write a scalar that no two readers take differently."""
    if text.lower() in ("yes", "on"):
        return "write true, or put it in quotes for text"
    if text.lower() in ("no", "off"):
        return "write false, or put it in quotes for text"
    number = text.replace("_", "")
    try:
        if re.fullmatch(r"[-+]?0*[0-9]+", number):
            return f"write {int(number)}, or put it in quotes for text"
        if re.fullmatch(r"[-+]?[0-9.]+([eE][-+]?[0-9]+)?", number):
            mantissa, _, exponent = number.lower().partition("e")
            mantissa = repr(float(mantissa))
            shown = f"{mantissa}e{int(exponent):+d}" if exponent else mantissa
            return f"write {shown}, or put it in quotes for text"
    except ValueError:
        pass
    if text == "<<":
        return "write the keys out, or repeat the whole value by its alias"
    return "put it in quotes for text, or write the number in full"


@cache
def _resolver() -> Any:
    import yaml

    return yaml.SafeLoader("")
