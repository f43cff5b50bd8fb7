"""A SLURM of one node in one folder: its daemons, its keys and its ports are its own."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "sinfo")
SECONDS = 120
USUAL = Path("/etc/slurm/slurm.conf")

CONFIGURATION = """\
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={node}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
ReturnToService=2
SchedulerParameters=sched_interval=1,batch_sched_delay=0
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory}
PartitionName=short Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def lacking() -> list[str]:
    """Return the programs that are not installed, and who may start them."""
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if USUAL.exists() and not USUAL.is_symlink():
        missing.append(f"a machine without {USUAL}")
    return missing if os.geteuid() == 0 else [*missing, "root"]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@contextmanager
def running(folder: Path, cpus: int) -> Iterator[dict[str, str]]:
    """Give the environment in which SLURM's commands find this one; it ends afterwards."""
    for name in ("state", "spool", "munge"):
        (folder / name).mkdir(parents=True)
    (folder / "munge").chmod(0o700)
    key = folder / "munge/key"
    key.write_bytes(os.urandom(128))
    key.chmod(0o400)
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20
    (folder / "slurm.conf").write_text(
        CONFIGURATION.format(
            folder=folder,
            host=socket.gethostname().partition(".")[0],
            controller=free_port(),
            node=free_port(),
            cpus=cpus,
            memory=int(0.9 * total),
        )
    )
    environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
    munged = [
        "munged", "--foreground", "--force", f"--key-file={key}",
        f"--socket={folder}/munge.socket", f"--pid-file={folder}/munge/pid",
        f"--log-file={folder}/munge/log", f"--seed-file={folder}/munge/seed",
    ]  # fmt: skip
    daemons = []
    # A job's own steps ask where every SLURM is found, without this environment.
    USUAL.parent.mkdir(exist_ok=True)
    if USUAL.is_symlink():
        USUAL.unlink()
    USUAL.symlink_to(folder / "slurm.conf")
    try:
        for command in (munged, ["slurmctld", "-D"], ["slurmd", "-D"]):
            with (folder / f"{command[0]}.out").open("wb") as out:
                daemons.append(subprocess.Popen(command, env=environment, stdout=out, stderr=out))
            if command is munged:
                _wait((folder / "munge.socket").exists, daemons, folder)
        _wait(lambda: _idle(environment), daemons, folder)
        yield environment
    finally:
        USUAL.unlink()
        subprocess.run(
            ["scancel", "--user=root", "--state=PENDING,RUNNING"],
            env=environment, check=False, capture_output=True,
        )  # fmt: skip
        # What still runs for a job would look for a controller that is gone.
        until = time.monotonic() + 20
        while _jobs(environment) and time.monotonic() < until:
            time.sleep(0.2)
        for daemon in reversed(daemons):
            daemon.terminate()
        for daemon in daemons:
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                # Not awaited, it would stay in the list of processes, where other tests meet it.
                daemon.wait()


def _idle(environment: dict[str, str]) -> bool:
    done = subprocess.run(
        ["sinfo", "-h", "-o", "%t"], env=environment, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() == "idle"


def _jobs(environment: dict[str, str]) -> list[str]:
    listed = ["squeue", "-h", "--states=PENDING,RUNNING,COMPLETING", "-o", "%A"]
    done = subprocess.run(listed, env=environment, capture_output=True, text=True, check=False)
    return done.stdout.split()


def _wait(condition, daemons, folder: Path) -> None:
    end = time.monotonic() + SECONDS
    while not condition():
        for daemon in daemons:
            if daemon.poll() is not None or time.monotonic() > end:
                logs = "".join(path.read_text() for path in folder.glob("*.out"))
                raise RuntimeError(f"{daemon.args} did not start: {logs[-2000:]}")
        time.sleep(0.1)
