"""What every script does around its one library call."""

import hashlib
import logging
import os
import signal
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path


def digests(snakemake):
    """Return the digests of the rule's code as it is now."""
    return {path: hashlib.sha256(Path(path).read_bytes()).digest() for path in snakemake.input.code}


# Before the library is imported: what runs is what was read here, or a digest differs afterwards.
# Worker processes import this file, too, but make no results.
_main = sys.modules["__main__"]
_rule = getattr(_main, "snakemake", None)
CODE = digests(_rule) if _rule else {}
# Of a process that forked with the library loaded: what was read then.
CODE |= {path: told for path, told in getattr(_main, "loaded", {}).items() if path in CODE}

import dask  # noqa: E402
import psutil  # noqa: E402

from vinsar import results  # noqa: E402
from vinsar.foundations.text import printable  # noqa: E402
from vinsar.results import lineage, provenance, storage  # noqa: E402
from vinsar.sweeps import sweep  # noqa: E402


@contextmanager
def job(snakemake):
    """Log to the rule's file; say what went wrong in a sentence, not in a traceback."""
    logging.basicConfig(filename=snakemake.log[0], level=logging.INFO, format="%(message)s")
    logging.raiseExceptions = False  # The disk may be full for the log as well.
    dask.config.set(num_workers=snakemake.threads)
    end_with_snakemake()
    started, clock = time.time(), time.monotonic()
    try:
        inputs = {name: provenance.sha256(path) for name, path in product_paths(snakemake).items()}
        yield
        refuse_changes(snakemake, inputs)
        record(snakemake, started, time.monotonic() - clock)
    except (ValueError, OSError, sweep.SweepError) as error:
        logging.error("%s: %s", snakemake.rule, printable(str(error), lines=True))
        sys.exit(1)
    except MemoryError:
        logging.error("%s: there is not enough memory for it", snakemake.rule)
        sys.exit(1)
    except Exception as error:
        logging.exception("%s: a fault of vinsar itself, %s", snakemake.rule, error)
        sys.exit(1)
    except KeyboardInterrupt:
        logging.error("%s: interrupted; the next run goes on", snakemake.rule)
        logging.shutdown()
        # At once: the end of Python would wait for threads that are at work.
        os._exit(130)


def refuse_other_code(snakemake):
    """Fail if the code is no longer what runs: no result tells of code that did not make it."""
    now = digests(snakemake)
    changed = [path for path, digest in CODE.items() if now[path] != digest]
    if changed:
        raise ValueError(f"{', '.join(changed)} changed while this ran; start ./run again")


def refuse_changes(snakemake, inputs):
    """Fail if code or inputs changed meanwhile; Snakemake removes what a failed job has made."""
    refuse_other_code(snakemake)
    for name, path in product_paths(snakemake).items():
        if provenance.sha256(path) != inputs[name]:
            raise ValueError(f"{path} changed while this ran; start ./run again")


def end_with_snakemake():
    """Interrupt this process when the Snakemake that wants it is gone, as after kill -9."""
    above = [
        process
        for process in psutil.Process().parents()
        if any(Path(part).name in ("snakemake", "start.py") for part in process.cmdline())
    ]

    def watch():
        while all(process.is_running() and process.status() != "zombie" for process in above):
            time.sleep(1)
        os.kill(os.getpid(), signal.SIGTERM)

    def interrupt(*_):
        # Once is enough: another, as Snakemake sends it, would cut the cleaning up short.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    # A shell lets its background jobs ignore it.
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, interrupt)
    threading.Thread(target=watch, daemon=True).start()


def record(snakemake, started, seconds):
    """Record the making of every output."""
    for path in snakemake.output:
        lineage.write_record(
            path,
            folder=results.folder(snakemake.params.configuration["study"]),
            attributes=attributes(snakemake, stage_of(snakemake, path)),
            started=started,
            seconds=seconds,
            rule=snakemake.rule,
            job=" ".join([snakemake.rule, *snakemake.wildcards]),
            threads=snakemake.threads,
            inputs=product_paths(snakemake),
        )


def stage_of(snakemake, path):
    """Return what an output is called in its provenance: its figure, its sweep, or its stage."""
    if snakemake.rule == "sweep":
        return f"sweep {snakemake.wildcards.sweep}"
    several = "/figures/" in path or snakemake.rule == "measurement"
    return Path(path).stem if several else snakemake.rule


def product_paths(snakemake):
    """Return the rule's named inputs, each the file of the product of that name."""
    return {name: path for name, path in snakemake.input.items() if name != "code"}


def read_products(snakemake):
    """Read the rule's products."""
    return {
        name: storage.read(path, "sweep" if name.startswith("sweeps/") else name)
        for name, path in product_paths(snakemake).items()
    }


def attributes(snakemake, stage):
    """Return the provenance of the rule's output."""
    configuration = dict(snakemake.params.configuration)
    return provenance.describe(
        study=configuration.pop("study"),
        stage=stage,
        configuration=configuration,
        inputs=product_paths(snakemake),
        code=snakemake.input.code,
    )
