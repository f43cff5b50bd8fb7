"""The whole chain: frames a second, and where the time of the paper's study goes."""

from __future__ import annotations

import time
from pathlib import Path

import dask
import numpy as np

import vinsar
from vinsar.foundations import blocks
from vinsar.foundations.configuration import Study
from vinsar.study import pipeline

ROOT = Path(__file__).parents[1]
# What the echo does not change.
BEFORE = ("trajectory", "recorded_trajectory", "received")
CHAINS = {
    "echo to DEM with class and standard deviation": {},
    "with a second pass on the surface": {"imaging": {"surface": "estimated"}},
    "with autofocus": {"autofocus": {"method": "echoes"}},
}


def study(*, coarse):
    """Return the paper's study, on its grid of 2 cm or on the variant's of 5 cm."""
    paper = vinsar.load()
    if not coarse:
        return paper
    return changed(paper, paper.variants["grid of 5 cm"])


def changed(one, changes):
    """Return a study with some keys of its sections changed."""
    sections = {
        name: getattr(one, name).model_copy(update=values) for name, values in changes.items()
    }
    return one.model_copy(update=sections)


def frames(count=60, workers=2):
    """Measure frames a second from echo in memory to DEM, several frames at once."""
    return [row for name in CHAINS for row in frames_of(name, count, workers)]


def frames_of(chain, count, workers):
    """Measure frames a second of one of `CHAINS`.

    Each frame is computed by one thread; Dask's threads compute frames side by side.
    """
    chosen: Study = changed(study(coarse=True), CHAINS[chain])
    products = pipeline.run(chosen, only="dem")
    expected = products["dem"]["height"].values
    stages = pipeline.stages(chosen)
    given = pipeline.needed(BEFORE, stages)
    again = [name for name in pipeline.needed(("dem",), stages) if name not in given]

    def frame(_):
        with blocks.serially():
            made = {name: products[name] for name in given}
            for name in again:
                made[name] = pipeline.run_stage(name, made, chosen)
        return made["dem"]["height"].values

    result = []
    for threads in (1, workers):
        with dask.config.set(scheduler="threads", num_workers=threads):
            blocks.run(frame, ((n,) for n in range(threads)))
            rates, spent = [], time.process_time()
            for _ in range(3):
                begin = time.perf_counter()
                heights = blocks.run(frame, ((n,) for n in range(count)))
                rates.append(count / (time.perf_counter() - begin))
        spent = (time.process_time() - spent) / (3 * count)
        same = all(np.array_equal(height, expected, equal_nan=True) for height in heights)
        result.append(
            {
                "chain": chain,
                "workers": threads,
                "frames_per_s": float(np.median(rates)),
                "all": rates,
                "core_seconds": spent,
                "same_bits": same,
            }
        )
    return result


def stages(rounds=5, *, coarse=False):
    """Measure a core's seconds in each stage of the study."""
    chosen = study(coarse=coarse)
    with blocks.serially():
        products = pipeline.run(chosen, only="accuracy")
        taken = {}
        for name in products:
            seconds = []
            for _ in range(rounds):
                begin = time.process_time()
                pipeline.run_stage(name, products, chosen)
                seconds.append(time.process_time() - begin)
            taken[name] = float(np.median(seconds))
    total = sum(taken.values())
    return [{"stage": name, "seconds": t, "share": t / total} for name, t in taken.items()]
