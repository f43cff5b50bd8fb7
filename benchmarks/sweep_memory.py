"""Peak memory of a sweep of many cheap cases against one of few.

    .venv/bin/python benchmarks/sweep_memory.py [--few 500] [--many 5000]

Each sweep runs in a process of its own, on one thread; the figures are what the system saw at its
peak. The study is the tests' tiny one, swept over heights of the level ground.
"""

import argparse
import resource
import subprocess
import sys
from pathlib import Path

import vinsar
from vinsar.study.options import Dask, Sweep
from vinsar.sweeps import cluster, sweep

ROOT = Path(__file__).parents[1]


def run(count):
    """Run a sweep of so many cases and print the peak, MiB."""
    study = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    heights = [number * 1e-6 for number in range(count // 5)]
    one = {"over": {"height.level_ground_height_m": heights}, "realizations": 5, "base": {}}
    study = study.model_copy(update={"sweeps": {"many": Sweep.model_validate(one)}})
    rows = {}
    with cluster.workers(Dask(scheduler="threads", address=None), 1) as compute:
        sweep.run(
            study,
            "many",
            finished={},
            keep=rows.update,
            progress=lambda *_: None,
            compute=compute,
        )
    print(len(rows), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def main():
    """Print both peaks and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--few", type=int, default=500)
    parser.add_argument("--many", type=int, default=5000)
    parser.add_argument("--alone", type=int, help="run one sweep here")
    arguments = parser.parse_args()
    if arguments.alone:
        run(arguments.alone)
        return
    peaks = []
    for count in (arguments.few, arguments.many):
        command = [sys.executable, __file__, "--alone", str(count)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        cases, peak = done.stdout.split()
        peaks.append(float(peak))
        print(f"{cases:>6} cases: {float(peak):6.0f} MiB")
    print(f"ratio {peaks[1] / peaks[0]:.2f}")


if __name__ == "__main__":
    main()
