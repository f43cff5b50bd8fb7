"""Time and peak memory against the sizes of the problem, each point in a process of its own.

A process that runs this file with a case on its command line prints what the case took.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import vinsar

ROOT = Path(__file__).parents[1]

# What grows along each axis, from small to large; all else is the paper's.
AXES = {
    "pixels": [{"kind": "images", "side": side} for side in (512, 1024, 2048, 4096)],
    "positions": [{"kind": "images", "positions": count} for count in (162, 324, 648, 1296)],
    "facets": [{"kind": "echo", "facets": count} for count in (25_000, 50_000, 100_000, 200_000)],
    "frequencies": [{"kind": "profiles", "frequencies": n} for n in (401, 801, 1601, 3201)],
    "cores": [{"kind": "images", "side": 1024, "workers": n} for n in (1, 2)],
}
LARGE = {"kind": "large"}


def size(axis, case):
    """Return a case's place on its axis."""
    if axis == "pixels":
        return case["side"] ** 2
    return case[{"positions": "positions", "facets": "facets", "frequencies": "frequencies",
                 "cores": "workers"}[axis]]  # fmt: skip


def measure(rounds):
    """Return all axes with fitted slopes, and the large scene."""
    result = {}
    for axis, cases in AXES.items():
        points = [
            {"size": size(axis, case)} | min((run(case) for _ in range(rounds)),
                                             key=lambda point: point["seconds"])
            for case in cases
        ]  # fmt: skip
        logs = np.log([[p["size"], p["seconds"], p["peak_mb"]] for p in points]).T
        result[axis] = {
            "kind": cases[0]["kind"],
            "points": points,
            "slope_time": float(np.polyfit(logs[0], logs[1], 1)[0]),
            "slope_memory": float(np.polyfit(logs[0], logs[2], 1)[0]),
        }
    return result, run(LARGE)


def run(case):
    """Run a case in a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "benchmarks.scaling", json.dumps(case)]
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{case}: {done.stderr[-2000:]}")
    return json.loads(done.stdout)


def resident_mb(what):
    """Return the resident size now (VmRSS) or its peak (VmHWM), MB."""
    # Not getrusage: a process inherits the peak of the one that started it.
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(status.partition(f"{what}:")[2].split()[0]) / 1024


def large_scene(small):
    """Print seconds and peak memory (all of the process's) of each stage to the DEM, on one core.

    20 m x 40 m at 2 cm with facets of 3 cm, 161 positions and 801 frequencies.
    """
    from vinsar.foundations import blocks
    from vinsar.study import pipeline

    paper = vinsar.load()
    ground = {"x_min_m": -10.0, "x_max_m": 10.0, "y_min_m": 10.0, "y_max_m": 50.0}
    changes = {
        "radar": {"aperture_length_m": 1.6, "frequency_count": 801},
        "scene": ground,
        "imaging": ground,
    }
    if small:
        changes = {"imaging": {"grid_spacing_m": 0.1}, "radar": {"aperture_length_m": 0.2}}
    study = paper.model_copy(
        update={name: getattr(paper, name).model_copy(update=to) for name, to in changes.items()}
    )
    stages = []

    products = {}
    with blocks.serially():
        for name in pipeline.needed(["dem"], pipeline.stages(study)):
            Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")  # Resets the peak.
            begin = time.perf_counter()
            products[name] = pipeline.run_stage(name, products, study)
            seconds = time.perf_counter() - begin
            stages.append({"stage": name, "seconds": seconds, "peak_mb": resident_mb("VmHWM")})
    if small:
        return
    image = products["images"]["image"]
    what = (
        f"{image.shape[-1]} x {image.shape[-2]} pixels, "
        f"{products['facets'].sizes['facet']} facets, "
        f"{products['echo'].sizes['position']} positions, "
        f"{products['echo'].sizes['frequency']} frequencies, two channels"
    )
    print(
        json.dumps(
            {
                "what": what,
                "stages": stages,
                "seconds": sum(row["seconds"] for row in stages),
                "peak_mb": max(row["peak_mb"] for row in stages),
            }
        )
    )


def main(case):
    """Compute a case and print its seconds (wall clock) and peak memory beyond its inputs'."""
    import dask

    if case == LARGE:
        large_scene(small=True)  # compiles
        large_scene(small=False)
        return
    workers = case.get("workers", 1)
    with dask.config.set(scheduler="threads", num_workers=workers):
        compute(case | {"side": 32, "positions": 3, "facets": 100})()
        work = compute(case)
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")  # Resets the peak.
        before = resident_mb("VmRSS")
        begin = time.perf_counter()
        work()
        seconds = time.perf_counter() - begin
    print(json.dumps({"seconds": seconds, "peak_mb": resident_mb("VmHWM") - before}))


def compute(case):
    """Return a function that computes the case; its inputs are made here."""
    from benchmarks.kernels import facets
    from vinsar.foundations import variables
    from vinsar.processing import focusing
    from vinsar.radar import trajectory, waveform
    from vinsar.simulation import echo

    count = case.get("positions", 81)
    frequency = waveform.frequencies(13e9, 15e9, case.get("frequencies", 401))
    rail = trajectory.rail(
        aperture_length_m=0.01 * (count - 1), position_spacing_m=0.01, rail_height_m=2.0,
        baseline_m=0.3, baseline_angle_deg=90.0,
    )  # fmt: skip
    if case["kind"] == "echo":
        scatterers = facets(case["facets"])

        def work():
            echo.simulate(scatterers, rail, frequency=frequency)

        return work
    rng = np.random.default_rng(0)
    shape = (2, count, frequency.size)
    signal = variables.dataset(
        "echo",
        {"echo": rng.normal(size=(*shape, 2)).view(complex)[..., 0]},
        {"frequency": frequency},
    )
    if case["kind"] == "profiles":

        def work():
            focusing.compress(signal, near_range_m=10.0, far_range_m=17.0)

        return work
    side = case.get("side", 512)
    spacing = 5.12 / side
    x, y = spacing * (np.arange(side) - side / 2), 10 + spacing * np.arange(side)

    def work():
        near, far = trajectory.range_extent(rail, x, y)
        profiles = focusing.compress(signal, near_range_m=near, far_range_m=far)
        focusing.backproject(profiles, rail, x=x, y=y)

    return work


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
