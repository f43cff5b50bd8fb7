"""Cases a second of the paper's vibration sweep, by kind and number of workers, in one run.

    .venv/bin/python benchmarks/sweep_scaling.py [--realizations 2] [--rounds 3]

The kinds take turns, so that what else the machine does meets them alike; the table has the
fastest round of each. Workers are up and have compiled before the clock starts. Each round has a
seed of its own, so that no worker has anything ready.
"""

import argparse
import time
from pathlib import Path

import vinsar
from vinsar.sweeps import cluster, sweep

ROOT = Path(__file__).parents[1]
KINDS = [(kind, count) for kind in ("threads", "processes") for count in (1, 2)]


def nothing(*_):
    """Take what a sweep tells."""


def seconds(study, kind, count, name="vibration"):
    """Return how long the sweep and the start of its workers take, s."""
    begin = time.perf_counter()
    options = study.dask.model_copy(update={"scheduler": kind})
    with cluster.workers(options, count) as compute:

        def run(seed, realizations):
            part = study.sweeps[name].model_copy(update={"realizations": realizations})
            one = study.model_copy(update={"seed": seed, "sweeps": {name: part}})
            started = time.perf_counter()
            sweep.run(
                one,
                name,
                finished={},
                keep=nothing,
                progress=nothing,
                compute=compute,
            )
            return time.perf_counter() - started

        run(study.seed + 1000, 1)
        ready = time.perf_counter() - begin
        return run(study.seed, study.sweeps[name].realizations), ready


def measure(realizations=2, rounds=3):
    """Measure cases a second by kind and number of workers."""
    study = vinsar.load()
    part = study.sweeps["vibration"].model_copy(update={"realizations": realizations})
    fastest = dict.fromkeys(KINDS, float("inf"))
    for number in range(rounds):
        for kind, count in KINDS:
            one = study.model_copy(update={"seed": number, "sweeps": {"vibration": part}})
            taken, _ = seconds(one, kind, count)
            fastest[kind, count] = min(fastest[kind, count], taken)
    cases = len(sweep.cases(study.model_copy(update={"sweeps": {"vibration": part}}), "vibration"))
    return [
        {
            "kind": kind,
            "workers": count,
            "cases": cases,
            "cases_per_s": cases / taken,
            "to_one": fastest[kind, 1] / taken,
        }
        for (kind, count), taken in fastest.items()
    ]


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--realizations", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    rows = measure(arguments.realizations, arguments.rounds)
    print(f"{rows[0]['cases']} cases, best of {arguments.rounds} rounds")
    print("workers       cases/s   to one")
    for row in rows:
        print(f"{row['workers']} {row['kind']:10} {row['cases_per_s']:8.1f} {row['to_one']:8.2f}")


if __name__ == "__main__":
    main()
