import json
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

from vinsar.study import config, validation
from vinsar.sweeps import cluster, sweep

ROOT = Path(__file__).parents[2]
OVER = {"motion.level_wavelengths": [0.0, 0.1, 0.2], "filtering.goldstein_alpha": [0.3, 0.8]}


@pytest.fixture(scope="module")
def study():
    tiny = validation.load(ROOT / "config/paper.yaml", ROOT / "tests/workflow/tiny.yaml")
    quick = config.Sweep.model_validate({"over": OVER, "realizations": 3, "base": {}})
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
    return config.Dask(scheduler=scheduler, address=address)


def squares(numbers):
    return [number**2 for number in numbers]


@pytest.fixture(scope="module")
def alone(study):
    """What one thread computes."""
    with cluster.workers(options(), 1) as compute:
        return run(study, compute)


@pytest.fixture(scope="module")
def processes():
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


def test_what_is_started_listens_on_the_loopback_alone(processes):
    assert processes
    listening = {
        (socket.laddr.ip)
        for one in [psutil.Process(), *descendants()]
        for socket in one.net_connections(kind="inet")
        if socket.status == psutil.CONN_LISTEN or not socket.raddr
    }
    assert listening == {"127.0.0.1"}


def test_a_killed_worker_costs_nothing_but_time(study, alone, processes):
    victims = worker_processes()
    assert len(victims) == 2

    def kill_one(done, _total):
        if done >= 4 and victims:
            os.kill(victims[0].pid, signal.SIGKILL)
            victims.clear()

    xr.testing.assert_identical(run(study, processes, progress=kill_one), alone)
    assert not victims


def test_a_scheduler_elsewhere_gives_the_same_bits(study, alone, processes):
    address = processes.args[0].scheduler.address
    with cluster.workers(options(address=address), 1) as compute:
        xr.testing.assert_identical(run(study, compute), alone)
    with (
        dask.config.set({"scheduler-address": address}),
        cluster.workers(options("processes"), 1) as compute,
    ):
        xr.testing.assert_identical(run(study, compute), alone)
    # It is left as it was.
    assert len(processes.args[0].scheduler_info(n_workers=-1)["workers"]) == 2


def die_at_three(numbers):
    if 3 in numbers:
        os.kill(os.getpid(), signal.SIGKILL)
    return squares(numbers)


def test_a_case_that_kills_its_worker_is_told_apart_from_its_neighbours(processes):
    results, lost = [], []

    def blame_at_once(dask_scheduler):
        dask_scheduler.allowed_failures = 0

    processes.args[0].run_on_scheduler(blame_at_once)
    processes(
        die_at_three,
        [[1], [2, 3, 4], [5, 6]],
        results.append,
        lambda block, reason: lost.append((block, reason)),
    )
    assert sorted(number for block in results for number in block) == [1, 4, 16, 25, 36]
    assert lost == [([3], "its worker died each time that it was tried")]


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
    begin = time.monotonic()
    given = options(address=None if by_variable else address)
    with (
        dask.config.set({"scheduler-address": address if by_variable else None}),
        pytest.raises(ConnectionError, match=f"no Dask scheduler answers at {address}"),
        cluster.workers(given, 1),
    ):
        pass
    assert time.monotonic() - begin < 5


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
    runs = cluster._Runs(list(range(10)))
    first = [runs.take("a") for _ in range(2)]
    second = [runs.take("b") for _ in range(4)]
    assert first == [0, 1]
    # Half of what the longest run has left.
    assert second == [6, 7, 8, 9]
    rest = [runs.take("b") for _ in range(4)]
    assert sorted([*rest, *(runs.take("a") for _ in range(2))], key=str) == [2, 3, 4, 5, None, None]
