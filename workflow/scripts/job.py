"""What every script does around its one library call."""

import logging
import sys
from contextlib import contextmanager

import dask

from vinsar import provenance, storage, sweep


@contextmanager
def job(snakemake):
    """Log to the rule's file; say what went wrong in a sentence, not in a traceback."""
    logging.basicConfig(filename=snakemake.log[0], level=logging.INFO, format="%(message)s")
    logging.getLogger("distributed").setLevel(logging.WARNING)
    dask.config.set(num_workers=snakemake.threads)
    try:
        yield
    except (ValueError, OSError, sweep.SweepError) as error:
        logging.error("%s: %s", snakemake.rule, error)
        sys.exit(1)
    except Exception as error:
        logging.exception("%s: a fault of vinsar itself, %s", snakemake.rule, error)
        sys.exit(1)


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
