"""What every script does around its one library call."""

import logging
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import dask

from vinsar import lineage, provenance, storage, sweep


@contextmanager
def job(snakemake):
    """Log to the rule's file; say what went wrong in a sentence, not in a traceback."""
    logging.basicConfig(filename=snakemake.log[0], level=logging.INFO, format="%(message)s")
    logging.getLogger("distributed").setLevel(logging.WARNING)
    dask.config.set(num_workers=snakemake.threads)
    started, clock = time.time(), time.monotonic()
    try:
        yield
        record(snakemake, started, time.monotonic() - clock)
    except (ValueError, OSError, sweep.SweepError) as error:
        logging.error("%s: %s", snakemake.rule, error)
        sys.exit(1)
    except Exception as error:
        logging.exception("%s: a fault of vinsar itself, %s", snakemake.rule, error)
        sys.exit(1)


def record(snakemake, started, seconds):
    """Record the making of every output."""
    for path in snakemake.output:
        lineage.write_record(
            path,
            folder=Path("results") / snakemake.params.configuration["study"],
            attributes=attributes(snakemake, stage_of(snakemake, path)),
            started=started,
            seconds=seconds,
            rule=snakemake.rule,
            inputs=product_paths(snakemake),
        )


def stage_of(snakemake, path):
    """Return what an output is called in its provenance: its figure, its sweep, or its rule."""
    if snakemake.rule == "sweep":
        return f"sweep {snakemake.wildcards.sweep}"
    return Path(path).stem if "/figures/" in path else snakemake.rule


def product_paths(snakemake):
    """Return the rule's named inputs, each the file of the product of that name."""
    return {name: path for name, path in snakemake.input.items() if name != "code"}


def read_products(snakemake):
    """Read the rule's products."""
    return {name: storage.read(path, name) for name, path in product_paths(snakemake).items()}


def attributes(snakemake, stage):
    """Say where the rule's output comes from."""
    configuration = dict(snakemake.params.configuration)
    return provenance.describe(
        study=configuration.pop("study"),
        stage=stage,
        configuration=configuration,
        inputs=product_paths(snakemake),
        code=snakemake.input.code,
    )
