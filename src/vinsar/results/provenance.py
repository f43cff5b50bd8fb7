"""Where a result comes from: configuration, inputs, code and versions, as text attributes."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vinsar._version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

_PACKAGE = Path(__file__).parents[1]
_LIBRARIES = (
    "dask", "kamui", "matplotlib", "netCDF4", "numba", "numpy", "rasterio",
    "scikit-image", "scipy", "whirlwind-insar", "xarray",
)  # fmt: skip

# What a study is run by and from, in the repository.
_RUN_BY = (
    "CITATION.cff", "LICENSE", "README.md", "Snakefile", "docs/errata.md", "pyproject.toml",
    "requirements.in", "requirements.lock", "run",
)  # fmt: skip
_RUN_FROM = ("config", "profiles", "src", "workflow")


def sources_of(*modules: str) -> list[Path]:
    """Return the files of modules and of all they import within the package.

    Parameters
    ----------
    modules
        Names of modules, such as ``vinsar.processing.filtering``, or within the package.

    Returns
    -------
    list of Path
        Sorted, each once.

    Raises
    ------
    ValueError
        If there is no such module.
    """
    found: set[Path] = set()
    waiting = [_file_of(name) for name in modules]
    for name, path in zip(modules, waiting, strict=True):
        if path is None:
            raise ValueError(f"vinsar has no module '{name}'")
    while waiting:
        path = waiting.pop()
        if path is not None and path not in found:
            found.add(path)
            waiting.extend(_imports(path))
    return sorted(found)


def _file_of(name: str) -> Path | None:
    place = _PACKAGE.joinpath(*name.removeprefix("vinsar.").split("."))
    for candidate in (place.with_suffix(".py"), place / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None


@cache
def _imports(path: Path) -> tuple[Path, ...]:
    found: set[Path | None] = set()
    for node in _run_statements(ast.parse(path.read_text(encoding="utf-8")).body):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            top, _, inner = node.module.partition(".")
            if top == "vinsar":
                # What is imported is a module of its own, or a name in the module imported from.
                for alias in node.names:
                    member = f"{inner}.{alias.name}" if inner else alias.name
                    found.add(_file_of(member) or (_file_of(inner) if inner else None))
        elif isinstance(node, ast.Import):
            for alias in node.names:
                top, _, inner = alias.name.partition(".")
                if top == "vinsar" and inner:
                    found.add(_file_of(inner))
    return tuple(sorted(path for path in found if path is not None))


def _run_statements(block: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """Walk statements, and those within them, without what stands there for type checkers alone.

    Expressions hold no imports, and most of a syntax tree is expressions.
    """
    for node in block:
        typing_only = (
            isinstance(node, ast.If)
            and isinstance(node.test, ast.Name)
            and node.test.id == "TYPE_CHECKING"
        )
        if not typing_only:
            yield node
            for part in ("body", "handlers", "cases", "orelse", "finalbody"):
                yield from _run_statements(getattr(node, part, ()))


def workflow_files() -> list[Path]:
    """Return the files of the repository that running a study needs, from the working folder.

    Returns
    -------
    list of Path
        Relative and sorted; what is made on the way, such as compiled code, is left out.

    Raises
    ------
    ValueError
        If the working folder is not the repository, or a link in it leads elsewhere.
    """
    found = [Path(name) for name in _RUN_BY if Path(name).is_file()]
    # A link may stay among them.
    homes = [Path(name).resolve() for name in _RUN_FROM]
    for name in _RUN_FROM:
        if not Path(name).is_dir():
            raise ValueError(f"{Path.cwd()} has no folder {name}; start in the repository")
        for path in Path(name).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts and path.name[0] != ".":
                if not any(map(path.resolve().is_relative_to, homes)):
                    raise ValueError(f"{path} is a link that leads out of the sources; remove it")
                found.append(path)
    return sorted(found)


def sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def code_digest(paths: Iterable[str | Path]) -> str:
    """Return one SHA-256 over source files, whatever folder the package lies in."""
    digest = hashlib.sha256()
    for path in sorted(Path(path) for path in paths):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def describe(
    *,
    study: str,
    stage: str,
    configuration: Mapping[str, Any],
    inputs: Mapping[str, str | Path],
    code: Iterable[str | Path],
) -> dict[str, str]:
    """Return the attributes that say where a result comes from.

    The same inputs give the same text: no time, host or path is in it.

    Parameters
    ----------
    study
        Name of the study.
    stage
        Name of the stage or figure.
    configuration
        The sections that it depends on.
    inputs
        The files that it read, by name of the product.
    code
        The source files that it ran.

    Returns
    -------
    dict of str
        Attributes; structured ones as JSON.
    """
    return {
        "source": f"vinsar {__version__}",
        "vinsar_commit": commit(),
        "vinsar_study": study,
        "vinsar_stage": stage,
        "vinsar_configuration": json.dumps(configuration, sort_keys=True),
        "vinsar_inputs": json.dumps({name: sha256(inputs[name]) for name in sorted(inputs)}),
        "vinsar_code": json.dumps({str(path): sha256(path) for path in sorted(map(str, code))}),
        "vinsar_libraries": json.dumps(library_versions(), sort_keys=True),
    }


@cache
def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that compute results."""
    return {name: metadata.version(name) for name in _LIBRARIES}


@cache
def commit() -> str:
    """Return the commit of the source, with ``-dirty`` if files differ from it.

    ``unknown`` if the source is not a git repository's own: an archive of it may lie inside
    another one.
    """
    try:
        # Of an archive inside another repository, that one knows no file.
        git("ls-files", "--error-unmatch", "--", "__init__.py")
        return git("describe", "--always", "--dirty", "--abbrev=12", "--exclude=*")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def git(*arguments: str, cwd: Path = _PACKAGE) -> str:
    """Return what git says, of the repository that a folder lies in and of no other."""
    # A hook or a shell may point it elsewhere (GIT_DIR, GIT_WORK_TREE, GIT_INDEX_FILE ...).
    own = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    done = subprocess.run(  # noqa: S603
        ["git", *arguments],  # noqa: S607
        cwd=cwd,
        env=own,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()
