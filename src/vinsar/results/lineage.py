"""Ask results where they come from: trace a file, verify a study, tell two studies apart.

Each result carries its provenance; beside them, ``records`` holds what cannot be in a file itself:
its digest, when it was made, where, and how long it took.
"""

from __future__ import annotations

import json
import os
import platform
import re
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vinsar.results import provenance, storage

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from vinsar.foundations.configuration import Study


RECORDS = "records"
# What `crate` copies into a study's folder, to be handed on with it.
SOURCE = "source"

Records = dict[str, dict[str, Any]]


def write_record(
    path: str | Path,
    *,
    folder: str | Path,
    attributes: Mapping[str, str],
    started: float,
    seconds: float,
    rule: str,
    job: str,
    threads: int,
    inputs: Mapping[str, str | Path],
) -> None:
    """Write the record of a finished result.

    Parameters
    ----------
    path
        The result.
    folder
        The study's folder.
    attributes
        Its provenance, as `provenance.describe` gives it.
    started, seconds
        When its job began (seconds since 1970) and how long it took.
    rule
        The rule that made it.
    job
        The rule's job: all results that were made together have it, and no others.
    threads
        On how many cores.
    inputs
        The results that it was made from, by name.
    """
    path, folder = Path(path), Path(folder)
    relative = path.relative_to(folder)
    record = {
        "file": relative.as_posix(),
        "sha256": provenance.sha256(path),
        "bytes": path.stat().st_size,
        "rule": rule,
        "job": job,
        "threads": threads,
        "inputs": {
            # A file of the user's own lies elsewhere.
            name: Path(os.path.relpath(source, folder)).as_posix()
            for name, source in inputs.items()
        },
        "started": _instant(started),
        "ended": _instant(started + seconds),
        "seconds": round(seconds, 3),
        "host": platform.node(),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "provenance": dict(attributes),
    }
    target = folder / RECORDS / relative.with_name(relative.name + ".json")
    with storage.atomic(target) as temporary:
        temporary.write_text(json.dumps(record, indent=2, sort_keys=True) + "\n")


def _instant(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")


def read_records(folder: str | Path) -> Records:
    """Return a study's records by the results' paths within its folder.

    Raises
    ------
    ValueError
        If there are none, or one cannot be read.
    """
    folder = Path(folder)
    if not (folder / RECORDS).is_dir():
        raise ValueError(f"{folder} holds no records of a study; run it first")
    found = {}
    for path in sorted((folder / RECORDS).rglob("*.json")):
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            found[record["file"]] = record
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path} is no record of a result ({error}); delete it") from error
    return found


def own_files(folder: str | Path, records: Records) -> dict[str, Path]:
    """Return the files of the user's own that a study was made from.

    Parameters
    ----------
    folder
        The study's folder.
    records
        Its records, as `read_records` gives them.

    Returns
    -------
    dict of Path
        By the names that they have in the records: paths from the working folder, or absolute ones
        if they lie outside of it.
    """
    found = {}
    for record in records.values():
        for name in record["inputs"].values():
            if name.startswith("../"):
                path = (Path(folder) / name).resolve()
                inside = path.is_relative_to(Path.cwd())
                found[name] = path.relative_to(Path.cwd()) if inside else path
    return found


def read_provenance(path: str | Path) -> dict[str, str]:
    """Return the provenance that a result carries in its own metadata.

    Parameters
    ----------
    path
        A netCDF, PNG, PDF or SVG file.

    Returns
    -------
    dict of str
        Attributes as `provenance.describe` gives them.

    Raises
    ------
    ValueError
        If the file carries none.
    """
    path = Path(path)
    readers = {
        ".nc": _from_netcdf,
        ".png": _from_png,
        ".pdf": _from_pdf,
        ".svg": _from_svg,
        ".html": _from_html,
    }
    try:
        attributes = readers[path.suffix](path)
    except KeyError:
        known = ", ".join(readers)
        raise ValueError(f"{path} is none of {known}, which carry their provenance") from None
    except (OSError, ValueError, SyntaxError) as error:
        raise ValueError(f"{path} cannot be read ({error})") from error
    if "vinsar_stage" not in attributes:
        raise ValueError(f"{path} carries no provenance of vinsar")
    return attributes


def _from_netcdf(path: Path) -> dict[str, str]:
    import netCDF4

    with netCDF4.Dataset(path) as file:
        return {name: str(file.getncattr(name)) for name in file.ncattrs()}


def _from_png(path: Path) -> dict[str, str]:
    from PIL import Image

    with Image.open(path) as image:
        image.load()
        return {str(key): str(value) for key, value in image.info.items()}


def _from_pdf(path: Path) -> dict[str, str]:
    # Matplotlib and Typst write the information dictionary plainly, with the brackets escaped.
    found = re.search(rb"/Keywords ?\((.*?)(?<!\\)\)[\s/>]", path.read_bytes(), re.DOTALL)
    if found is None:
        return {}
    text = re.sub(rb"\\(.)", rb"\1", found[1], flags=re.DOTALL)
    encoding = "utf-16" if text.startswith(b"\xfe\xff") else "latin-1"
    return dict(json.loads(text.decode(encoding)))


def _from_html(path: Path) -> dict[str, str]:
    text = path.read_text(encoding="utf-8")
    found = re.search(r'<script[^>]* id="vinsar-provenance">(.*?)</script>', text, re.DOTALL)
    return dict(json.loads(found[1])) if found else {}


def _from_svg(path: Path) -> dict[str, str]:
    import xml.etree.ElementTree as ET

    tree = ET.parse(path)  # noqa: S314 (our own file; nothing is fetched)
    node = tree.find(".//{http://purl.org/dc/elements/1.1/}description")
    return dict(json.loads(node.text)) if node is not None and node.text else {}


@dataclass
class Origin:
    """A result with all that it comes from.

    Attributes
    ----------
    file
        Its path.
    attributes
        Its provenance.
    changes
        What differs now from when it was made, a sentence each; empty if nothing does.
    inputs
        The results that it was made from.
    """

    file: Path
    attributes: dict[str, str]
    changes: list[str] = field(default_factory=list)
    inputs: list[Origin] = field(default_factory=list)


def trace(path: str | Path, study: Study | None = None) -> Origin:
    """Return what a result comes from, down to configuration and code.

    Parameters
    ----------
    path
        A result in its study's folder.
    study
        The configuration as it is now; without it, it is not compared.

    Returns
    -------
    Origin
        The result and, below it, those that it was made from.

    Raises
    ------
    ValueError
        If the file is missing or carries no provenance.
    """
    return _trace(Path(path), _study_folder(Path(path)), study, None, {})


def _study_folder(path: Path) -> Path:
    for parent in path.absolute().parents:
        if (parent / RECORDS).is_dir():
            return parent
    raise ValueError(f"{path} is in no study's folder: there are no {RECORDS} above it")


def _trace(
    path: Path,
    folder: Path,
    study: Study | None,
    expected: str | None,
    known: dict[tuple[Path, str | None], Origin],
) -> Origin:
    """Trace a result once, however many others were made from it."""
    if (path, expected) not in known:
        known[path, expected] = _traced(path, folder, study, expected, known)
    return known[path, expected]


def _traced(
    path: Path,
    folder: Path,
    study: Study | None,
    expected: str | None,
    known: dict[tuple[Path, str | None], Origin],
) -> Origin:
    if not path.is_file():
        return Origin(path, {}, ["missing"])
    record = _record(path, folder)
    try:
        attributes = read_provenance(path)
    except ValueError as error:
        if record is None:
            raise
        attributes = record["provenance"]
        if path.suffix not in {".json", ".md"}:
            return Origin(path, attributes, [str(error)])
    origin = Origin(path, attributes)
    digest = provenance.sha256(path)
    if record is None:
        origin.changes.append("there is no record of its making")
    elif record["sha256"] != digest:
        origin.changes.append("modified by hand: its bytes are not those that were written")
    if expected is not None and digest != expected:
        origin.changes.append("not the bytes that the result above was made from")
    origin.changes += _differences(attributes, study)
    sources = json.loads(attributes.get("vinsar_inputs", "{}"))
    for name, sha in sources.items():
        source = (record or {}).get("inputs", {}).get(name, f"{name}.nc")
        if source.startswith("../"):
            origin.inputs.append(_own_file(folder / source, sha))
        else:
            origin.inputs.append(_trace(folder / source, folder, study, sha, known))
    return origin


def _own_file(path: Path, expected: str) -> Origin:
    """Return a file of the user's own, whose origin nobody knows here."""
    if not path.is_file():
        return Origin(path, {}, ["missing"])
    same = provenance.sha256(path) == expected
    changes = [] if same else ["not the bytes that the result above was made from"]
    return Origin(path.resolve(), {"vinsar_stage": "own file"}, changes)


def _record(path: Path, folder: Path) -> dict[str, Any] | None:
    relative = path.absolute().relative_to(folder)
    record = folder / RECORDS / relative.with_name(relative.name + ".json")
    if not record.is_file():
        return None
    try:
        return dict(json.loads(record.read_text(encoding="utf-8")))
    except ValueError:
        return None


def _differences(attributes: Mapping[str, str], study: Study | None) -> Iterator[str]:
    for name, sha in json.loads(attributes["vinsar_code"]).items():
        if not Path(name).is_file():
            yield f"code {name} is gone"
        elif provenance.sha256(name) != sha:
            yield f"code {name} has changed"
    now = provenance.library_versions()
    for name, version in json.loads(attributes["vinsar_libraries"]).items():
        if now.get(name) != version:
            yield f"library {name} was {version}, is {now.get(name, 'not installed')}"
    if study is None:
        return
    for key, value in leaves(json.loads(attributes["vinsar_configuration"])):
        current = _current(study, attributes["vinsar_stage"], key)
        if current != value:
            yield f"configuration {key} was {value}, is {current}"


def leaves(value: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys of a nested configuration, joined by dots, with their values."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from leaves(inner, f"{prefix}.{key}" if prefix else key)
    elif prefix:
        yield prefix, value


def _current(study: Study, stage: str, key: str) -> Any:
    whole = study.model_dump(mode="json")
    # A sweep's own definition stands under its name.
    whole["sweep"] = whole["sweeps"].get(stage.removeprefix("sweep "), {})
    return dict(leaves(whole)).get(key)


def as_text(origin: Origin) -> str:
    """Return a tree: each result with configuration and seeds, marked where something changed."""
    return "\n".join(_lines(origin, "", "", set())) + "\n"


def _lines(origin: Origin, first: str, rest: str, seen: set[Path]) -> Iterator[str]:
    stage = origin.attributes.get("vinsar_stage", "unknown")
    mark = " [CHANGED]" if origin.changes else ""
    again = origin.file in seen and bool(origin.inputs)
    seen.add(origin.file)
    shown = _short(origin.file)
    yield f"{first}{shown} ({stage}){mark}" + (" (as above)" if again else "")
    details = [f"! {change}" for change in origin.changes]
    if not again:
        values = leaves(json.loads(origin.attributes.get("vinsar_configuration", "{}")))
        details += [f"{key} = {json.dumps(value)}" for key, value in values]
        code = json.loads(origin.attributes.get("vinsar_code", "{}"))
        commit = origin.attributes.get("vinsar_commit", "")
        details += [f"code: {len(code)} files, {commit}".rstrip(", ")] if code else []
    children = [] if again else origin.inputs
    bar = "│  " if children else "   "
    for detail in details:
        yield f"{rest}{bar}{detail}"
    for number, child in enumerate(children):
        last = number == len(children) - 1
        yield from _lines(
            child, rest + ("└─ " if last else "├─ "), rest + ("   " if last else "│  "), seen
        )


def _short(path: Path) -> str:
    try:
        return path.absolute().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return path.as_posix()


def verify(folder: str | Path, study: Study | None = None) -> dict[str, list[str]]:
    """Check every result of a study.

    Parameters
    ----------
    folder
        The study's folder.
    study
        The configuration as it is now; without it, it is not compared.

    Returns
    -------
    dict of list of str
        For each result what does not hold, a sentence each; an empty list if it is unchanged.

    Raises
    ------
    ValueError
        If the folder holds no records.
    """
    folder = Path(folder)
    records = read_records(folder)
    shas = {
        name: provenance.sha256(folder / name) if (folder / name).is_file() else None
        for name in records
    }
    found: dict[str, list[str]] = {}
    for name, record in records.items():
        if shas[name] is None:
            found[name] = ["missing"]
            continue
        problems = []
        if shas[name] != record["sha256"]:
            problems.append("modified by hand: its bytes are not those that were written")
        made_from = json.loads(record["provenance"].get("vinsar_inputs", "{}"))
        for key, sha in made_from.items():
            source = record["inputs"].get(key, f"{key}.nc")
            if source not in shas and (folder / source).is_file():
                shas[source] = provenance.sha256(folder / source)
            if shas.get(source) != sha:
                problems.append(f"stale: made from another {source}")
        problems += [f"stale: {text}" for text in _differences(record["provenance"], study)]
        found[name] = problems
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if name.startswith(f"{SOURCE}/"):
            continue
        ours = path.suffix in {".nc", ".png", ".pdf", ".svg"} and not path.name.startswith(".")
        if ours and path.is_file() and name not in records:
            found[name] = ["there is no record of its making"]
    return found


def compare(first: str | Path, second: str | Path) -> list[str]:
    """Tell what differs between two studies.

    Parameters
    ----------
    first, second
        Their folders.

    Returns
    -------
    list of str
        Keys of the configuration, files of the code and libraries that differ, and the statistics
        of the height error with their change; empty if nothing differs.

    Raises
    ------
    ValueError
        If a folder holds no records.
    """
    sides = [_summary(folder) for folder in (first, second)]
    lines = []
    for title in ("configuration", "code", "library", "accuracy"):
        one, two = (side[title] for side in sides)
        for key in sorted(set(one) | set(two)):
            for stages, a, b in _pairs(one.get(key, {}), two.get(key, {})):
                # Each sweep has its own definition under the same key.
                every = len(stages) == len(set(one.get(key, {})) & set(two.get(key, {})))
                named = not stages or (every and not key.startswith("sweep."))
                label = f"{title} {key}" if named else f"{title} {key} ({', '.join(stages)})"
                if title == "code":
                    lines.append(f"{label} differs")
                elif isinstance(a, float) and isinstance(b, float):
                    lines.append(f"{label}: {a:.6g} and {b:.6g}, {b - a:+.3g}")
                else:
                    lines.append(f"{label}: {a} and {b}")
    return lines


def _pairs(one: Mapping[str, Any], two: Mapping[str, Any]) -> list[tuple[list[str], Any, Any]]:
    """Return what differs between a key's values by stage: the stages, and both values."""
    common = sorted(set(one) & set(two))
    if not common:
        a, b = (_all_of(values) for values in (one, two))
        return [([], a, b)] if a != b else []
    found: list[tuple[list[str], Any, Any]] = []
    for stage in common:
        a, b = one[stage], two[stage]
        if a == b:
            continue
        for stages, *values in found:
            if values == [a, b]:
                stages.append(stage)
                break
        else:
            found.append(([stage], a, b))
    return found


def _all_of(values: Mapping[str, Any]) -> Any:
    distinct: list[Any] = []
    for value in values.values():
        if value not in distinct:
            distinct.append(value)
    return distinct[0] if len(distinct) == 1 else " or ".join(map(str, distinct)) or "absent"


def _summary(folder: str | Path) -> dict[str, dict[str, dict[str, Any]]]:
    """Return, by kind and key, what each stage was made with: stages may disagree if one is old."""
    folder = Path(folder)
    result: dict[str, dict[str, dict[str, Any]]] = {
        "configuration": {}, "code": {}, "library": {}, "accuracy": {},
    }  # fmt: skip
    for record in read_records(folder).values():
        attributes = record["provenance"]
        for title, values in (
            ("configuration", dict(leaves(json.loads(attributes["vinsar_configuration"])))),
            ("code", json.loads(attributes["vinsar_code"])),
            ("library", json.loads(attributes["vinsar_libraries"])),
        ):
            for key, value in values.items():
                result[title].setdefault(key, {})[attributes["vinsar_stage"]] = value
    summary = folder / "accuracy.json"
    if summary.is_file():
        for key, value in leaves(json.loads(summary.read_text(encoding="utf-8"))):
            result["accuracy"][key] = {"accuracy_summary": value}
    return result


def troubled(found: Mapping[str, Iterable[str]]) -> bool:
    """Tell whether anything does not hold."""
    return any(list(problems) for problems in found.values())
