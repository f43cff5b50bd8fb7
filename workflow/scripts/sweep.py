"""Run a sweep, going on from what an interrupted run has finished."""

import json
import logging
from pathlib import Path

from job import attributes, job, read_products, refuse_other_code
from progress import Progress

from vinsar.results import provenance, storage
from vinsar.study import validation
from vinsar.sweeps import checkpoint, cluster, sweep


def main():
    """Run the sweep of the rule's wildcard."""
    name = snakemake.wildcards.sweep
    study = validation.check(snakemake.config)
    versions = json.dumps(provenance.library_versions(), sort_keys=True)
    code = f"{provenance.code_digest(snakemake.input.code)} {versions}"
    output = Path(snakemake.output[0])
    finished = checkpoint.Checkpoint(output.with_name(f".{output.stem}.jsonl"), code)

    def keep(rows):
        refuse_other_code(snakemake)
        finished.keep(rows)

    with cluster.workers(study.dask, snakemake.threads) as compute, Progress(name) as progress:
        result = sweep.run(
            study,
            name,
            finished=finished.rows(),
            keep=keep,
            progress=progress,
            compute=compute,
            given=read_products(snakemake),
        )
    storage.write(result, output, "sweep", attributes(snakemake, f"sweep {name}"))
    finished.remove()


# Worker processes import this file.
if __name__ == "__main__":
    with job(snakemake):
        # A line a stage and case would drown the progress.
        logging.getLogger("vinsar").setLevel(logging.WARNING)
        main()
