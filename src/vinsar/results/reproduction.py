"""Run a study afresh, elsewhere and on another number of cores, and compare every byte."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vinsar import results
from vinsar.results import lineage, provenance

if TYPE_CHECKING:
    from collections.abc import Sequence

# Rules whose results tell how long jobs took, and so are never the same bytes.
_TIMED = frozenset({"report"})
# Where kernels are kept, compiled: the same sources elsewhere need not be compiled again.
_COMPILED = Path(__file__).parents[1] / "kernels/__pycache__"


@dataclass(frozen=True)
class Verdict:
    """How a fresh run came out.

    Attributes
    ----------
    compared
        The results that were compared, by their paths in the study's folder.
    differing
        Those whose bytes differ, or that the fresh run did not make.
    reasons
        What differs in configuration, code, libraries and statistics, a sentence each.
    cores
        On how many cores the study, and the fresh run, had run at most.
    kept
        Where the fresh run is kept because something differs.
    """

    compared: list[str]
    differing: list[str]
    reasons: list[str]
    cores: tuple[int, int]
    kept: Path | None


def reproduce(
    folder: str | Path, *, configuration: Sequence[str | Path], cores: int | None = None
) -> Verdict:
    """Run a study afresh in another folder and compare every result byte by byte.

    Only the report, which tells how long the jobs took, is left out.

    The sources come from the commit that the results name; where they name none, because they were
    not made in a git repository, the files at hand are copied.

    Parameters
    ----------
    folder
        The finished study's folder; it is only read.
    configuration
        The files that the study was run with beyond ``config/paper.yaml``.
    cores
        On how many cores to run; one less than before unless given, or two if that was one.

    Returns
    -------
    Verdict
        What was compared, and what differs.

    Raises
    ------
    ValueError
        If the study has not run, its files are not those that it wrote, they come from several
        commits or from sources that were never committed, or the fresh run fails.
    """
    folder = Path(folder)
    if cores is not None and cores < 1:
        raise ValueError(f"a study runs on 1 core at least, not on {cores}")
    records = {
        name: record
        for name, record in lineage.read_records(folder).items()
        if record["rule"] not in _TIMED
    }
    changed = [
        name
        for name, record in records.items()
        if not (folder / name).is_file() or provenance.sha256(folder / name) != record["sha256"]
    ]
    if changed:
        raise ValueError(
            f"{folder} is not as its study left it ({', '.join(changed[:5])} missing or modified); "
            "run the study again first"
        )
    before = max(record["threads"] for record in records.values())
    now = cores or (before - 1 if before > 1 else 2)
    place = Path(tempfile.mkdtemp(prefix=f"vinsar-{folder.name}-"))
    verdict = None
    try:
        _check_out(_commit(folder, records), place)
        for own in lineage.own_files(folder, records).values():
            if not own.is_absolute() and not (place / own).exists():
                (place / own).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(own, place / own)
        own_folder = results.folder(folder.name)
        _run(place, [(own_folder / name).as_posix() for name in records], configuration, now)
        fresh = place / own_folder
        differing = [
            name
            for name, record in records.items()
            if not (fresh / name).is_file() or provenance.sha256(fresh / name) != record["sha256"]
        ]
        verdict = Verdict(
            compared=sorted(records),
            differing=differing,
            reasons=lineage.compare(folder, fresh) if differing else [],
            cores=(before, now),
            kept=fresh if differing else None,
        )
    finally:
        if verdict is None or verdict.kept is None:
            shutil.rmtree(place, ignore_errors=True)
    return verdict


def _commit(folder: Path, records: lineage.Records) -> str:
    commits = sorted({record["provenance"]["vinsar_commit"] for record in records.values()})
    if len(commits) > 1:
        raise ValueError(
            f"the results in {folder} come from several commits ({', '.join(commits)}), each of "
            "which is in its files' bytes; delete the folder and run the study once more"
        )
    if commits[0].endswith("-dirty"):
        raise ValueError(
            f"the results in {folder} come from sources that no commit holds ({commits[0]}); "
            "commit them, delete the folder and run the study once more"
        )
    return str(commits[0])


def _check_out(commit: str, place: Path) -> None:
    if commit == "unknown":
        for path in provenance.workflow_files():
            (place / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place / path)
        return
    try:
        here = Path.cwd()
        provenance.git("clone", "--quiet", "--shared", "--no-checkout", ".", str(place), cwd=here)
        provenance.git("checkout", "--quiet", "--detach", commit, cwd=place)
    except subprocess.CalledProcessError as error:
        raise ValueError(
            f"commit {commit} cannot be had from here: {error.stderr.strip()}"
        ) from error


def _run(place: Path, targets: list[str], configuration: Sequence[str | Path], cores: int) -> None:
    files = [str(Path(path).absolute()) for path in configuration]
    # As ./run starts it; the oldest commits have no such file.
    start = ["-P", "workflow/start.py"]
    command = [
        *(sys.executable, *(start if (place / start[1]).exists() else ["-m", "snakemake"])),
        *("--cores", str(cores)),
        *(["--configfile", *files] if files else []),
        *("--", *targets),
    ]
    done = subprocess.run(  # noqa: S603
        command,
        cwd=place,
        env={"NUMBA_CACHE_DIR": str(_COMPILED)} | os.environ | {"PYTHONPATH": str(place / "src")},
        stdout=sys.stderr,
        check=False,
    )
    if done.returncode != 0:
        raise ValueError("the fresh run failed; its messages are above")
