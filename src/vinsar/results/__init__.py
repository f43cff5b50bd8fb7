"""Results on disk: storage, provenance, lineage, crate, reproduction."""

from pathlib import Path

FOLDER = "results"
"""The folder of all studies' results, in the repository."""


def folder(study: str) -> Path:
    """Return the folder of a study's results, from the repository."""
    return Path(FOLDER) / study
