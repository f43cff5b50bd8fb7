"""Results made by the workflow, when a command needs them."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


def make(targets: Sequence[str], configuration: Sequence[str]) -> None:
    """Let the workflow make results of a study.

    Parameters
    ----------
    targets
        Names of rules, or files.
    configuration
        The files that the study is configured with beyond ``config/paper.yaml``.

    Raises
    ------
    ValueError
        If it fails, with what it says.
    """
    # A study may be running: what is made here is made beside it.
    command = [sys.executable, "-m", "snakemake", "--nolock", "--quiet", "all"]
    files = ["--configfile", *configuration] if configuration else []
    done = subprocess.run(  # noqa: S603
        [*command, *files, "--", *targets], check=False, capture_output=True, text=True
    )
    if done.returncode:
        raise ValueError(f"the workflow failed:\n{done.stdout}{done.stderr}")
