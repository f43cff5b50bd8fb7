"""Ask results where they come from: trace a file, verify a study, tell two studies apart.

Each result carries its provenance; beside them, ``records`` holds what cannot be in a file itself:
its digest, when it was made, where, and how long it took.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import resource
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vinsar.foundations.text import printable
from vinsar.results import provenance, storage

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from vinsar.foundations.configuration import Study


RECORDS = "records"
# What `crate` copies into a study's folder, to be handed on with it.
SOURCE = "source"

Records = dict[str, dict[str, Any]]

NO_RECORD = "there is no record of its making"
MODIFIED = "modified by hand: its bytes are not those that were written"


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
            # A file supplied by the user lies elsewhere.
            name: Path(os.path.relpath(source, folder)).as_posix()
            for name, source in inputs.items()
        },
        "started": _instant(started),
        "ended": _instant(started + seconds),
        "seconds": round(seconds, 3),
        "peak_bytes": _peak_bytes(),
        "host": platform.node(),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "provenance": dict(attributes),
    }
    text = json.dumps(signed(record), indent=2, sort_keys=True) + "\n"
    with storage.atomic(_record_of(folder, relative.as_posix())) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _peak_bytes() -> int:
    """Return the most memory that this process, or one that it started, has held at a time.

    Snakemake's benchmarks sample a job, and miss short peaks.
    """
    whose = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    return 1024 * max(resource.getrusage(one).ru_maxrss for one in whose)


def signed(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return a record with a digest of all that it says, by which an edit of it is known."""
    content = {key: value for key, value in record.items() if key != "digest"}
    text = json.dumps(content, sort_keys=True)
    return content | {"digest": hashlib.sha256(text.encode()).hexdigest()}


def _record_of(folder: Path, name: str) -> Path:
    return folder / RECORDS / f"{name}.json"


def _read_record(folder: Path, name: str) -> dict[str, Any]:
    """Return the record of a result; `ValueError` says what is wrong with it."""
    try:
        record = json.loads(_record_of(folder, name).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(NO_RECORD) from None
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"its record cannot be read ({error})") from error
    if not isinstance(record, dict) or "digest" not in record:
        raise ValueError("its record is not whole")
    if record != signed(record):
        raise ValueError("its record has been edited")
    if record["file"] != name:
        raise ValueError(f"its record is that of {record['file']}")
    return record


def _instant(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")


def read_records(folder: str | Path) -> Records:
    """Return a study's records by the results' paths within its folder.

    Raises
    ------
    ValueError
        If there are none, or one cannot be read.
    """
    found = {}
    for name in _recorded(Path(folder)):
        try:
            found[name] = _read_record(Path(folder), name)
        except ValueError as error:
            path = _record_of(Path(folder), name)
            raise ValueError(
                f"{Path(folder) / name}: {error}; run the study again ({path})"
            ) from error
    return found


def _recorded(folder: Path) -> list[str]:
    """Return the results of which there are records."""
    if not (folder / RECORDS).is_dir():
        raise ValueError(f"{folder} holds no records of a study; run it first")
    paths = sorted((folder / RECORDS).rglob("*.json"))
    return [path.relative_to(folder / RECORDS).as_posix().removesuffix(".json") for path in paths]


def own_files(folder: str | Path, records: Records) -> dict[str, Path]:
    """Return the user's files that a study was made from.

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

    Raises
    ------
    ValueError
        If a record names a file that its result does not declare by its digest.
    """
    found = {}
    for result, record in records.items():
        declared = json.loads(record["provenance"].get("vinsar_inputs", "{}"))
        for key, name in record["inputs"].items():
            if ".." not in Path(name).parts and not Path(name).is_absolute():
                continue
            path = (Path(folder) / name).resolve()
            if not path.is_file() or declared.get(key) != provenance.sha256(path):
                raise ValueError(
                    f"{Path(folder) / result}: its record names {name}, which is not the file that "
                    "the result declares"
                )
            inside = path.is_relative_to(Path.cwd())
            found[name] = path.relative_to(Path.cwd()) if inside else path
    return found


def refuse_links(folder: str | Path) -> None:
    """Refuse symbolic links in a study's folder that lead out of it.

    Raises
    ------
    ValueError
        If there is one; the message names it.
    """
    home = Path(folder).resolve()
    for place, folders, files in os.walk(home):
        for name in (*folders, *files):
            path = Path(place) / name
            if path.is_symlink() and not path.resolve().is_relative_to(home):
                shown = Path(folder) / path.relative_to(home)
                raise ValueError(f"{shown} is a link that leads out of the study; remove it")


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

    # It stands before the pixels, which need not be read.
    with Image.open(path) as image:
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


# Their provenance is in their records alone.
_WITHOUT_PROVENANCE = {".json", ".md"}


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
    return _trace(Path(path), _study_folder(Path(path)), _Now(study), None, {})


def _study_folder(path: Path) -> Path:
    for parent in path.absolute().parents:
        if (parent / RECORDS).is_dir():
            return parent
    raise ValueError(f"{path} is in no study's folder: there are no {RECORDS} above it")


def _trace(
    path: Path,
    folder: Path,
    now: _Now,
    expected: str | None,
    known: dict[tuple[Path, str | None], Origin],
) -> Origin:
    """Trace a result once, however many others were made from it."""
    if (path, expected) not in known:
        known[path, expected] = _traced(path, folder, now, expected, known)
    return known[path, expected]


def _traced(
    path: Path,
    folder: Path,
    now: _Now,
    expected: str | None,
    known: dict[tuple[Path, str | None], Origin],
) -> Origin:
    if not path.is_file():
        return Origin(path, {}, ["missing"])
    name = path.absolute().relative_to(folder).as_posix()
    wrong, record = "", None
    try:
        record = _read_record(folder, name)
    except ValueError as error:
        wrong = str(error)
    try:
        attributes = read_provenance(path)
    except ValueError as error:
        if record is None:
            raise
        attributes = record["provenance"]
        if path.suffix not in _WITHOUT_PROVENANCE:
            return Origin(path, attributes, [str(error)])
    origin = Origin(path, attributes, [wrong] if wrong else [])
    digest = provenance.sha256(path)
    if record is not None:
        origin.changes += _own_changes(path, digest, record)
    if expected is not None and digest != expected:
        origin.changes.append("not the bytes that the result above was made from")
    origin.changes += now.differences(attributes)
    sources = json.loads(attributes.get("vinsar_inputs", "{}"))
    for source_name, sha in sources.items():
        source = (record or {}).get("inputs", {}).get(source_name, f"{source_name}.nc")
        if source.startswith("../"):
            origin.inputs.append(_own_file(folder / source, sha))
        else:
            origin.inputs.append(_trace(folder / source, folder, now, sha, known))
    return origin


def _own_changes(path: Path, digest: str, record: Mapping[str, Any]) -> Iterator[str]:
    """Tell what does not hold of a result by itself, beside its record."""
    if digest != record["sha256"]:
        yield MODIFIED
    elif path.suffix not in _WITHOUT_PROVENANCE:
        try:
            carried = read_provenance(path)
        except ValueError as error:
            yield str(error)
            return
        told = record["provenance"]
        other = sorted(key for key in told if carried.get(key) != told[key])
        if other:
            yield f"its record tells another {other[0]} than the file itself"


def _own_file(path: Path, expected: str) -> Origin:
    """Return a file supplied by the user, whose origin nobody knows here."""
    if not path.is_file():
        return Origin(path, {}, ["missing"])
    same = provenance.sha256(path) == expected
    changes = [] if same else ["not the bytes that the result above was made from"]
    return Origin(path.resolve(), {"vinsar_stage": "own file"}, changes)


class _Now:
    """Code, libraries and configuration as they are now, each looked up once."""

    def __init__(self, study: Study | None) -> None:
        self.study = study.study if study else None
        whole = study.model_dump(mode="json") if study else {}
        self._sweeps = whole.get("sweeps", {})
        self._values = dict(leaves(whole))
        self._code: dict[str, str | None] = {}
        self._versions = provenance.library_versions()

    def differences(self, attributes: Mapping[str, str]) -> Iterator[str]:
        """Tell what differs from when a result with these attributes was made."""
        for name, sha in json.loads(attributes["vinsar_code"]).items():
            if name not in self._code:
                self._code[name] = provenance.sha256(name) if Path(name).is_file() else None
            if self._code[name] is None:
                yield f"code {name} is gone"
            elif self._code[name] != sha:
                yield f"code {name} has changed"
        for name, version in json.loads(attributes["vinsar_libraries"]).items():
            if self._versions.get(name) != version:
                current = self._versions.get(name, "not installed")
                yield f"library {name} was {version}, is {current}"
        if self.study is None:
            return
        if attributes.get("vinsar_study", self.study) != self.study:
            yield f"a result of the study '{attributes['vinsar_study']}'"
        for key, value in leaves(json.loads(attributes["vinsar_configuration"])):
            current = self._current(attributes["vinsar_stage"], key)
            if current != value:
                yield f"configuration {key} was {value}, is {current}"

    def _current(self, stage: str, key: str) -> Any:
        if key.startswith("sweep."):
            # A sweep's own definition stands under its name.
            own = self._sweeps.get(stage.removeprefix("sweep "), {})
            return dict(leaves({"sweep": own})).get(key)
        return self._values.get(key)


def leaves(value: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys of a nested configuration, joined by dots, with their values."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from leaves(inner, f"{prefix}.{key}" if prefix else key)
    elif prefix:
        yield prefix, value


def as_text(origin: Origin) -> str:
    """Return a tree: each result with configuration and seeds, marked where something changed."""
    return "\n".join(map(printable, _lines(origin, "", "", set()))) + "\n"


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
    return {
        name: [printable(problem.text) for problem in problems]
        for name, problems in _examine(Path(folder), study, ()).items()
    }


def unsound(folder: str | Path, study: Study, names: Iterable[str]) -> dict[str, list[str]]:
    """Tell which of some results have to be made again, and why.

    Parameters
    ----------
    folder
        The study's folder.
    study
        The configuration as it is now.
    names
        The results, by their paths within the folder.

    Returns
    -------
    dict of list of str
        For each result that does not hold what is wrong with it, a sentence each; those left out
        whose only fault is that they were made from another of them.
    """
    folder, wanted = Path(folder), set(names)
    found = _examine(folder, study, wanted) if folder.is_dir() else {}
    wrong = {name for name in wanted if found.get(name)}
    result = {}
    for name in sorted(wrong):
        own = [printable(problem.text) for problem in found[name] if problem.source not in wrong]
        if own:
            result[name] = own
    return result


@dataclass(frozen=True)
class _Problem:
    """What does not hold, and the result that it is due to if it is another's fault."""

    text: str
    source: str = ""


def _examine(folder: Path, study: Study | None, wanted: Iterable[str]) -> dict[str, list[_Problem]]:
    """Return what is wrong with each result of which there is a record, or that is wanted."""
    now = _Now(study)
    shas: dict[str, str | None] = {}

    def sha(name: str) -> str | None:
        if name not in shas:
            path = folder / name
            shas[name] = provenance.sha256(path) if path.is_file() else None
        return shas[name]

    found: dict[str, list[_Problem]] = {}
    recorded = _recorded(folder) if (folder / RECORDS).is_dir() or not wanted else []
    for name in dict.fromkeys([*recorded, *wanted]):
        digest = sha(name)
        if digest is None:
            found[name] = [_Problem("missing")]
            continue
        try:
            record = _read_record(folder, name)
        except ValueError as error:
            found[name] = [_Problem(str(error))]
            continue
        attributes = record["provenance"]
        problems = [_Problem(text) for text in _own_changes(folder / name, digest, record)]
        for key, made_from in json.loads(attributes.get("vinsar_inputs", "{}")).items():
            source = record["inputs"].get(key, f"{key}.nc")
            if sha(source) != made_from:
                problems.append(_Problem(f"stale: made from another {source}", source))
        problems += [_Problem(f"stale: {text}") for text in now.differences(attributes)]
        found[name] = problems
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if name.startswith(f"{SOURCE}/"):
            continue
        ours = path.suffix in {".nc", ".png", ".pdf", ".svg"} and not path.name.startswith(".")
        if ours and path.is_file() and name not in found:
            found[name] = [_Problem(NO_RECORD)]
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
    return [printable(line) for line in lines]


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
