"""Timing of contenders that take turns."""

from __future__ import annotations

import os
import platform
import time
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import numpy as np


def interleaved(contenders, rounds):
    """Return each contender's seconds, round by round, of the process and by the wall clock.

    They take turns, so that what else the machine does meets them alike. The process's own time
    counts on one core, of which all contenders use one; beside other work it is the shorter one.
    """
    for run in contenders.values():
        run()
    clocks = time.process_time, time.perf_counter
    taken = tuple({name: [] for name in contenders} for _ in clocks)
    for _ in range(rounds):
        for name, run in contenders.items():
            begin = [clock() for clock in clocks]
            run()
            for seconds, clock, start in zip(taken, clocks, begin, strict=True):
                seconds[name].append(clock() - start)
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
    names = ("numpy", "scipy", "numba", "llvmlite", "dask", "xarray", "whirlwind-insar")
    return {
        "date": datetime.now(tz=UTC).date().isoformat(),
        "processor": model,
        "microarchitecture": binding.get_host_cpu_name(),
        "avx512": bool(features.get("avx512f")) and "NUMBA_CPU_FEATURES" not in os.environ,
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        "versions": {name: metadata.version(name) for name in names},
    }
