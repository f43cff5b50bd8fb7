"""The smoke study, and a sweep, on a SLURM of one node, as docs/sweeps.md says."""

import importlib.util
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import dask
import pytest
import xarray as xr

sys.path.insert(0, str(Path(__file__).parent))
import slurm

import vinsar
from vinsar import figures
from vinsar.study import composition
from vinsar.study.options import Dask, Sweep
from vinsar.sweeps import cluster, sweep

ROOT = Path(__file__).parents[2]
PLUGINS = ("snakemake_executor_plugin_slurm", "dask_jobqueue")
LACKING = [*slurm.lacking(), *(n for n in PLUGINS if importlib.util.find_spec(n) is None)]
CORES = min(2, os.cpu_count() or 1)

pytestmark = pytest.mark.skipif(
    bool(LACKING) and "CI" not in os.environ,
    reason=f".ci/run installs what SLURM needs: {', '.join(LACKING)}",
)


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The environment in which commands find SLURM."""
    assert not LACKING
    with slurm.running(tmp_path_factory.mktemp("slurm") / "node", CORES) as variables:
        yield variables


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("workflow", "config", "profiles", "docs"):
        shutil.copytree(ROOT / name, folder / name)
    shutil.copy(ROOT / "Snakefile", folder)
    # The library itself, whose kernels are compiled.
    (folder / "src").symlink_to(ROOT / "src")
    return folder


# Each job of SLURM starts Snakemake twice, which takes longer than the rule. But for two they go in
# jobs together, where Snakemake runs them in their order, each with the cores that it takes.
ALONE = ("trajectory", "claims")
GROUPS = {
    "chain": [*composition.STAGES, "accuracy_summary"],
    "sweeps": ["sweep"],
    "figures": [*(f"figure_{name}" for name in figures.FIGURES), "figure_fig3_panels"],
}
IN_GROUPS = [
    "--groups",
    *(f"{rule}={group}" for group, rules in GROUPS.items() for rule in rules if rule not in ALONE),
    "--group-components",
    *(f"{group}=100" for group in GROUPS),
]
# Not the waits that spare the controller of a cluster.
AT_ONCE = ("--seconds-between-status-checks", "1")


def started(checkout, environment, *arguments):
    with (checkout / "out.txt").open("wb") as out:
        return subprocess.Popen(
            [sys.executable, "-P", "workflow/start.py", "--workflow-profile", "profiles/slurm",
             "--configfile", "config/smoke.yaml", "--nocolor", *AT_ONCE, *arguments],
            cwd=checkout,
            env=environment | {"PYTHONPATH": str(checkout / "src")},
            stdout=out,
            stderr=subprocess.STDOUT,
        )  # fmt: skip


def said(checkout):
    return (checkout / "out.txt").read_text()


def jobs(environment, state):
    done = subprocess.run(
        ["squeue", "-h", f"--states={state}", "-o", "%A"],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.split()


def test_the_smoke_study_runs_to_its_end_though_a_job_is_killed(checkout, environment):
    process = started(checkout, environment, *IN_GROUPS)
    victim, first = None, set()
    while process.poll() is None:
        running = jobs(environment, "RUNNING")
        # Not the first of all, which may be about to end: something is finished by then.
        if not (checkout / "results/smoke/trajectory.nc").exists():
            first |= set(running)
        elif victim is None and set(running) - first:
            (victim, *_) = set(running) - first
            subprocess.run(["scancel", victim], env=environment, check=True)
        time.sleep(0.2)
    assert process.returncode == 0, said(checkout)
    assert victim is not None
    assert "Trying to restart job" in said(checkout)
    assert (checkout / "results/smoke/claims.json").exists()
    verified = subprocess.run(
        [sys.executable, "-m", "vinsar", "verify", "results/smoke"],
        cwd=checkout, env=environment | {"PYTHONPATH": str(checkout / "src")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert verified.returncode == 0, verified.stdout
    # A rule that takes all cores had those of the node.
    assert f"threads: {CORES}" in said(checkout)


def test_a_job_that_fails_shows_its_log(checkout, environment):
    broken = checkout / "results/smoke/terrain.nc"
    if not broken.exists():
        pytest.skip("the study has not run")
    content = broken.read_bytes()
    script = checkout / "workflow/scripts/stage.py"
    text = script.read_text()
    raising = "with job(snakemake):\n    raise ValueError('no such luck')"
    script.write_text(text.replace("with job(snakemake):", raising, 1))
    try:
        process = started(checkout, environment, "--retries", "0", "--", "trajectory")
        assert process.wait() == 1
        assert "trajectory: no such luck" in said(checkout)
    finally:
        script.write_text(text)
        assert broken.read_bytes() == content


def test_a_sweep_on_dask_jobqueue_has_the_bits_of_one_thread(environment, tmp_path, monkeypatch):
    from dask_jobqueue import SLURMCluster

    tiny = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    over = {"motion.level_wavelengths": [0.0, 0.1], "filtering.goldstein_alpha": [0.3, 0.8]}
    quick = Sweep.model_validate({"over": over, "realizations": 2, "base": {}})
    study = tiny.model_copy(update={"sweeps": {"quick": quick}})

    def run(address):
        options = Dask(scheduler="threads", address=address)
        with cluster.workers(options, 1) as compute:
            return sweep.run(
                study, "quick", finished={}, keep=lambda _: None, progress=lambda *_: None,
                compute=compute,
            )  # fmt: skip

    expected = run(None)
    monkeypatch.setenv("SLURM_CONF", environment["SLURM_CONF"])
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "src"))
    monkeypatch.chdir(tmp_path)
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "60s"}),
        SLURMCluster(
            cores=1, processes=1, memory="2GB", walltime="00:30:00", python=sys.executable,
            scheduler_options={"host": "127.0.0.1", "dashboard": False,
                               "dashboard_address": "127.0.0.1:0"},
        ) as jobqueue,
    ):  # fmt: skip
        jobqueue.scale(jobs=CORES)
        jobqueue.wait_for_workers(CORES, timeout=300)
        assert len(jobs(environment, "RUNNING")) == CORES
        xr.testing.assert_identical(run(jobqueue.scheduler_address), expected)
