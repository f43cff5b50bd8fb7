"""The whole chain: frames a second, and where the time of the paper's study goes."""

from __future__ import annotations

import hashlib
import time
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

import vinsar
from vinsar.foundations import blocks
from vinsar.foundations.configuration import Study
from vinsar.study import pipeline
from vinsar.sweeps import processes

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
    """Measure frames a second of one of `CHAINS`, by worker processes as a sweep has them."""
    result = []
    for number in (1, workers):
        with processes.pool(number) as pool:
            compute(pool, chain, number)
            rates, answers = [], []
            for _ in range(3):
                begin = time.perf_counter()
                answers += compute(pool, chain, count)
                rates.append(count / (time.perf_counter() - begin))
        result.append(
            {
                "chain": chain,
                "workers": number,
                "frames_per_s": float(np.median(rates)),
                "all": rates,
                "core_seconds": float(np.mean([spent for spent, _ in answers])),
                "same_bits": len({digest for _, digest in answers}) == 1,
            }
        )
    return result


def compute(pool, chain, count):
    """Have workers compute so many frames; return the core's seconds and a digest of each."""
    answers, lost = [], []
    pool(
        partial(frame, chain),
        [[n] for n in range(count)],
        answers.append,
        lambda *a: lost.append(a),
    )
    if lost:
        raise RuntimeError(f"frames were lost: {lost}")
    return answers


def frame(chain, _):
    """Compute a frame in a worker; return the core's seconds, and a digest of the heights."""
    chosen, products, again = prepared(chain)
    begin = time.process_time()
    with blocks.serially():
        for name in again:
            products[name] = pipeline.run_stage(name, products, chosen)
    spent = time.process_time() - begin
    return spent, hashlib.sha256(products["dem"]["height"].values.tobytes()).hexdigest()


@lru_cache
def prepared(chain):
    """Return the study of a chain, its products, and the names of those that a frame computes."""
    chosen: Study = changed(study(coarse=True), CHAINS[chain])
    products = pipeline.run(chosen, only="dem")
    stages = pipeline.stages(chosen)
    given = pipeline.needed(BEFORE, stages)
    again = [name for name in pipeline.needed(("dem",), stages) if name not in given]
    return chosen, products, again


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
