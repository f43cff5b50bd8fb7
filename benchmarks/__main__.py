"""Measure, print the table, write JSON and plots: `./run benchmarks [--quick]`.

Results go to results/benchmarks; the scaling study's plot also to docs/performance.png with --docs.
"""

from __future__ import annotations

import os
import sys

# One core a contender. Before anything loads OpenMP or a BLAS.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

if "--without-avx512" in sys.argv:  # For ours and for the peer that is compiled here.
    os.environ["NUMBA_CPU_NAME"] = "haswell"
    os.environ["NUMBA_CPU_FEATURES"] = "+avx,+avx2,+fma,+bmi,+bmi2,+f16c"
    os.environ["FFBP_CPU_FLAGS"] = "-O3 -march=haswell"

import argparse  # noqa: E402
import json  # noqa: E402

from benchmarks import chain, kernels, report, scaling, sweep_scaling, timing  # noqa: E402


def main():
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(prog="./run benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few rounds, no scaling study")
    parser.add_argument("--docs", action="store_true", help="also write docs/performance.png")
    parser.add_argument(
        "--without-avx512",
        action="store_true",
        help="the kernels alone, as a processor of 2013 runs them",
    )
    arguments = parser.parse_args()
    rounds = 3 if arguments.quick else 15
    folder = chain.ROOT / "results" / "benchmarks"
    if arguments.without_avx512:
        folder /= "without-avx512"
    folder.mkdir(parents=True, exist_ok=True)
    result = {"machine": timing.machine(), "kernels": {}}
    result["kernels"]["back-projection"] = kernels.backprojection(rounds)
    result["kernels"]["echo"] = kernels.echoes(rounds)
    for scene, part in kernels.sight(rounds).items():
        result["kernels"][f"visibility, {scene}"] = part
    if not arguments.without_avx512:
        result["frames"] = chain.frames()
        result["stages"] = chain.stages()
        result["stages_coarse"] = chain.stages(coarse=True)
    if not (arguments.quick or arguments.without_avx512):
        result["sweep"] = sweep_scaling.measure()
        result["scaling"], result["large"] = scaling.measure(rounds=3)
        report.plot_scaling(result, folder / "scaling.png")
        if arguments.docs:
            report.plot_scaling(result, chain.ROOT / "docs" / "performance.png")
    report.plot_kernels(result, folder / "kernels.png")
    text = report.table(result)
    (folder / "table.md").write_text(text, encoding="utf-8")
    (folder / "benchmarks.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
    print(text)


main()
