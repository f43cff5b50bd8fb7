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
FRAME = ("profiles", "images", "interferogram", "filtered", "unwrapped", "dem")


def study(*, coarse):
    """Return the paper's study, on its grid of 2 cm or on the variant's of 5 cm."""
    paper = vinsar.load()
    if not coarse:
        return paper
    override = paper.variants["grid of 5 cm"]
    sections = {
        name: getattr(paper, name).model_copy(update=values) for name, values in override.items()
    }
    return paper.model_copy(update=sections)


def frames(count=60, workers=2):
    """Measure frames a second from echo in memory to coded DEM, several frames at once.

    Each frame is computed by one thread; Dask's threads compute frames side by side.
    """
    chosen: Study = study(coarse=True)
    products = pipeline.run(chosen, only="dem")
    expected = products["dem"]["height"].values

    def frame(_):
        with blocks.serially():
            made = dict(products)
            for name in FRAME:
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
            {"workers": threads, "frames_per_s": float(np.median(rates)), "all": rates,
             "core_seconds": spent, "same_bits": same}
        )  # fmt: skip
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
