# Kill -9 leaves Snakemake's locks behind, and the next run would refuse to start. Whoever runs here
# shares a lock of the kernel's, which goes with its process: if nobody has it, the others are stale.
import fcntl
import glob
import os

if workflow.is_main_process:
    os.makedirs(".snakemake", exist_ok=True)
    RUNNING = open(".snakemake/running", "w")
    try:
        fcntl.flock(RUNNING, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for stale in glob.glob(".snakemake/locks/*.lock"):
            os.unlink(stale)
    except BlockingIOError:
        pass  # Another Snakemake works here, and its locks count.
    fcntl.flock(RUNNING, fcntl.LOCK_SH)
