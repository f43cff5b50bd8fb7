# Kill -9 leaves Snakemake's locks behind, and the next run would refuse to start. Whoever runs a study
# shares a lock of the kernel's, which goes with its process: if nobody has it, the study's are stale.
import fcntl
import os
from pathlib import Path

from vinsar import results


def drop_stale_locks(study):
    """Drop the locks that name results of a study that nobody runs; return what says that we do."""
    Path(".snakemake/studies").mkdir(parents=True, exist_ok=True)
    running = open(f".snakemake/studies/{study}", "w")
    own = f"{results.folder(study).as_posix()}/"
    try:
        fcntl.flock(running, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for lock in Path(".snakemake/locks").glob("*.lock"):
            if any(line.startswith(own) for line in lock.read_text().splitlines()):
                lock.unlink()
    except (BlockingIOError, FileNotFoundError):
        pass  # Another Snakemake runs the study, or ended its own meanwhile.
    fcntl.flock(running, fcntl.LOCK_SH)
    return running


if workflow.is_main_process:
    RUNNING = drop_stale_locks(STUDY.study)
