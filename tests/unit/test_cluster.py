import json
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import dask
import psutil
import pytest
import xarray as xr

import vinsar
from vinsar.study.options import Dask, Sweep
from vinsar.sweeps import cluster, sweep
from vinsar.sweeps import processes as processes_module

ROOT = Path(__file__).parents[2]
OVER = {"motion.level_wavelengths": [0.0, 0.1, 0.2], "filtering.goldstein_alpha": [0.3, 0.8]}


@pytest.fixture(scope="module")
def study():
    tiny = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    quick = Sweep.model_validate({"over": OVER, "realizations": 3, "base": {}})
    return tiny.model_copy(update={"sweeps": {"quick": quick}})


@pytest.fixture(autouse=True)
def _nothing_ready(monkeypatch):
    monkeypatch.setattr(sweep, "_MEMO", sweep.Memo())


def nothing(*_):
    pass


def run(study, compute, **options):
    told = {"finished": {}, "keep": nothing, "progress": nothing} | options
    return sweep.run(study, "quick", compute=compute, **told)


def options(scheduler="threads", address=None):
    return Dask(scheduler=scheduler, address=address)


def squares(numbers):
    return [number**2 for number in numbers]


@pytest.fixture(scope="module")
def alone(study):
    """What one thread computes."""
    with cluster.workers(options(), 1) as compute:
        return run(study, compute)


@pytest.fixture(scope="module")
def open_before():
    """Sockets of this process that are none of the workers' business."""
    return psutil.Process().net_connections(kind="all")


@pytest.fixture(scope="module")
def processes(open_before):  # noqa: ARG001, which must look before they start
    """Two processes of this machine, started once for several tests."""
    with cluster.workers(options("processes"), 2) as compute:
        yield compute


def descendants():
    return psutil.Process().children(recursive=True)


def worker_processes():
    return [one for one in descendants() if any("spawn_main" in part for part in one.cmdline())]


def sockets(processes):
    return {
        (one.pid, socket.laddr, socket.status)
        for one in processes
        for socket in one.net_connections(kind="inet")
    }


def test_two_threads_give_the_same_bits_and_open_no_socket(study, alone):
    before, seen = sockets([psutil.Process()]), set()

    def look(*_):
        seen.update(sockets([psutil.Process()]))

    with cluster.workers(options(), 2) as compute:
        assert not worker_processes()
        found = run(study, compute, progress=look)
    xr.testing.assert_identical(found, alone)
    assert seen <= before


def test_threads_hand_results_over_in_the_thread_that_asks():
    threads, results = set(), []

    def receive(result):
        threads.add(threading.get_ident())
        results.append(result)

    with cluster.workers(options(), 2) as compute:
        compute(squares, [[number] for number in range(20)], receive, nothing)
    assert sorted(results) == [[number**2] for number in range(20)]
    assert threads == {threading.get_ident()}


def test_two_processes_give_the_same_bits(study, alone, processes):
    xr.testing.assert_identical(run(study, processes), alone)


def test_nobody_can_speak_to_the_workers(processes, open_before):
    assert len(processes.workers) == 2
    ours = [psutil.Process(), *worker_processes()]
    assert len(ours) == 3
    # A pair of sockets joins each worker to this process; it has no name to connect to.
    found = [socket for one in ours for socket in one.net_connections(kind="all")]
    pairs = [socket for socket in found if socket not in open_before]
    assert pairs
    assert not [socket for socket in pairs if socket.laddr or socket.status == psutil.CONN_LISTEN]


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")
def test_another_user_cannot_open_the_workers_pipes(processes):
    ends = [path for one in worker_processes() for path in Path(f"/proc/{one.pid}/fd").iterdir()]
    assert len(ends) >= 2 * len(processes.workers)
    assert opened_by(0, ends) == len(ends)
    assert opened_by(65534, ends) == 0


def opened_by(uid, paths):
    """Count the paths that a user can open, in a process that becomes this user."""
    child = os.fork()
    if child == 0:
        os.setgroups([])
        os.setgid(uid)
        os.setuid(uid)
        count = 0
        for path in paths:
            try:
                # O_PATH suffices to hold a file, and a pair of sockets can be opened no other way.
                os.open(path, os.O_PATH)
                count += 1
            except OSError:
                pass
        os._exit(count)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_a_killed_worker_costs_nothing_but_time(study, alone, processes):
    victims = worker_processes()
    assert len(victims) == 2

    def kill_one(done, _total):
        if done >= 4 and victims:
            os.kill(victims[0].pid, signal.SIGKILL)
            victims.clear()

    xr.testing.assert_identical(run(study, processes, progress=kill_one), alone)
    assert not victims


@pytest.fixture(scope="module")
def elsewhere():
    """Return the address of a cluster of two processes that somebody else has started."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=None,
        worker_dashboard_address=None,
        scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
        silence_logs=logging.ERROR,
    ) as made:
        yield made


def test_a_scheduler_elsewhere_gives_the_same_bits(study, alone, elsewhere):
    address = elsewhere.scheduler_address
    with cluster.workers(options(address=address), 1) as compute:
        xr.testing.assert_identical(run(study, compute), alone)
    with (
        dask.config.set({"scheduler-address": address}),
        cluster.workers(options("processes"), 1) as compute,
    ):
        xr.testing.assert_identical(run(study, compute), alone)
    # It is left as it was.
    assert len(elsewhere.scheduler_info["workers"]) == 2


def test_a_cluster_without_the_encryption_that_dask_is_to_require_is_a_sentence(elsewhere):
    address = elsewhere.scheduler_address
    with (
        dask.config.set({"distributed.comm.require-encryption": True}),
        pytest.raises(ConnectionError, match=f"{address} .*encryption required"),
        cluster.workers(options(address=address), 1),
    ):
        pass


def test_required_encryption_is_no_matter_of_processes_of_this_machine():
    with (
        dask.config.set({"distributed.comm.require-encryption": True}),
        cluster.workers(options("processes"), 1) as compute,
    ):
        results = []
        compute(squares, [[3]], results.append, nothing)
    assert results == [[9]]


def die_at_three(numbers):
    if 3 in numbers:
        os.kill(os.getpid(), signal.SIGKILL)
    return squares(numbers)


def kills_a_case(compute, blocks):
    """Run blocks, a case of which kills its worker; return the results and what is lost."""
    results, lost = [], []
    compute(die_at_three, blocks, results.append, lambda *told: lost.append(told))
    return sorted(number for block in results for number in block), lost


def test_a_case_that_kills_its_worker_is_told_apart_from_its_neighbours(processes):
    found, lost = kills_a_case(processes, [[1], [2, 3, 4], [5, 6]])
    assert found == [1, 4, 16, 25, 36]
    assert lost == [([3], "its worker died each time that it was tried")]


def test_a_case_that_kills_the_workers_of_a_cluster_is_told_apart_as_well(elsewhere):
    elsewhere.scheduler.allowed_failures = 0
    with cluster.workers(options(address=elsewhere.scheduler_address), 1) as compute:
        found, lost = kills_a_case(compute, [[1], [2, 3, 4], [5, 6]])
    assert found == [1, 4, 16, 25, 36]
    assert lost == [([3], "its worker died each time that it was tried")]


def give_up(_):
    raise OSError("the disk is full")


def test_what_is_given_up_does_not_answer_later(processes):
    with pytest.raises(OSError, match="the disk is full"):
        processes(squares, [[1], [2], [3], [4]], give_up, nothing)
    results = []
    processes(squares, [[5]], results.append, nothing)
    assert results == [[25]]


def test_workers_go_with_the_process_that_started_them(tmp_path):
    program = f"""
import os, signal, time
from vinsar.sweeps import processes
if __name__ == "__main__":
    pool = processes.Pool(2)
    pids = [str(worker.process.pid) for worker in pool.workers]
    open({str(tmp_path / "pids")!r}, "w").write(" ".join(pids))
    # In the middle of work, too.
    for worker in pool.workers:
        worker.begin(time.sleep, 600)
    time.sleep(0.5)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    (tmp_path / "program.py").write_text(program)
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run([sys.executable, tmp_path / "program.py"], env=environment, check=False)
    assert done.returncode == -signal.SIGKILL
    pids = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    until = time.monotonic() + 30
    while any(map(psutil.pid_exists, pids)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(psutil.pid_exists, pids))


def raise_at_three(numbers):
    if 3 in numbers:
        raise RuntimeError("no such mount")
    return squares(numbers)


def test_a_block_that_raises_is_reported_and_costs_no_other(processes):
    results, lost = [], []
    processes(raise_at_three, [[1], [3]], results.append, lambda *told: lost.append(told))
    assert results == [[1]]
    assert lost == [([3], "RuntimeError: no such mount")]


@pytest.mark.parametrize("by_variable", [True, False])
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense://127.0.0.1:9"])
def test_an_address_where_nobody_answers_is_said_soon(monkeypatch, address, by_variable):
    monkeypatch.setattr(cluster, "_PATIENCE_S", 1)
    given = options(address=None if by_variable else address)
    with (
        dask.config.set({"scheduler-address": address if by_variable else None}),
        pytest.raises(ConnectionError, match=f"no Dask scheduler answers at {address}"),
        cluster.workers(given, 1),
    ):
        pass


def test_what_answers_and_is_no_scheduler_is_said(monkeypatch):
    import socket

    monkeypatch.setattr(cluster, "_PATIENCE_S", 1)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            caller, _ = server.accept()
            with caller:
                caller.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        answering = threading.Thread(target=answer)
        answering.start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with (
            pytest.raises(ConnectionError, match="no Dask scheduler answers"),
            cluster.workers(options(address=address), 1),
        ):
            pass
        answering.join()


def test_a_scheduler_that_goes_away_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE_S", 1)
    file = tmp_path / "scheduler.json"
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    scheduler = subprocess.Popen(
        [*command, "--port", "0", "--dashboard-address", "127.0.0.1:0", "--no-dashboard",
         "--scheduler-file", file],
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        while not file.exists():
            time.sleep(0.05)
            assert scheduler.poll() is None
        time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        threading.Timer(1, scheduler.kill).start()
        with (
            pytest.raises(ConnectionError, match="is gone; the finished cases are kept"),
            cluster.workers(options(address=address), 1) as compute,
        ):
            compute(squares, [[1], [2]], nothing, nothing)
    finally:
        scheduler.kill()
        scheduler.wait()


def test_each_worker_has_neighbouring_blocks():
    runs = processes_module.Runs(list(range(10)))
    first = [runs.take("a") for _ in range(2)]
    second = [runs.take("b") for _ in range(4)]
    assert first == [0, 1]
    # Half of what the longest run has left.
    assert second == [6, 7, 8, 9]
    rest = [runs.take("b") for _ in range(4)]
    assert sorted([*rest, *(runs.take("a") for _ in range(2))], key=str) == [2, 3, 4, 5, None, None]
