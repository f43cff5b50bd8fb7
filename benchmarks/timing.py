"""Timing of contenders that take turns."""

from __future__ import annotations

import os
import platform
import time
from importlib import metadata
from pathlib import Path

import numpy as np


def interleaved(contenders, rounds, clock=time.process_time):
    """Return each contender's seconds, round by round.

    They take turns, so that what else the machine does meets them alike. The clock counts the
    process's own time on a core, of which all contenders use one.
    """
    for run in contenders.values():
        run()
    taken = {name: [] for name in contenders}
    for _ in range(rounds):
        for name, run in contenders.items():
            begin = clock()
            run()
            taken[name].append(clock() - begin)
    return taken


def summary(seconds):
    """Return the median and the quartiles."""
    low, middle, high = np.percentile(seconds, [25, 50, 75])
    return {"median_s": middle, "quartiles_s": [low, high], "rounds": len(seconds)}


def machine():
    """Return what the figures were measured on."""
    model = platform.processor()
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
            model = next(line.split(":")[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        pass
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    names = ("numpy", "scipy", "numba", "llvmlite", "finufft", "dask", "xarray", "whirlwind-insar")
    return {
        "processor": model,
        "microarchitecture": binding.get_host_cpu_name(),
        "avx512": bool(features.get("avx512f")),
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        "versions": {name: metadata.version(name) for name in names},
    }
