"""Where a sweep's blocks run: threads or processes of this machine, or any Dask cluster."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from vinsar.foundations import blocks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from vinsar.study import config

    Function = Callable[[Any], Any]
    Receive = Callable[[Any], None]
    Lost = Callable[[Any, str], None]
    Compute = Callable[[Function, list[Any], Receive, Lost], None]

logger = logging.getLogger(__name__)

_PATIENCE_S = 5

# What worker processes do beside their work, by default, takes a fifth of their time.
_LEAN = {
    # Looking at the working thread, and at the clock, many times a second.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    # Giving each freed array back to the system; one thread a library remains of this setting.
    "distributed.nanny.pre-spawn-environ": {
        f"{library}_NUM_THREADS": 1 for library in ("OMP", "MKL", "OPENBLAS")
    },
}

# What a thread of a worker is given at a time: one to run, one to begin with next.
_AT_A_TIME = 2


@contextmanager
def workers(options: config.Dask, count: int) -> Iterator[Compute]:
    """Give a function that runs another on blocks in parallel.

    Parameters
    ----------
    options
        Section ``dask`` of the configuration. An address there, or one in Dask's own
        configuration (``scheduler-address``; the variable ``DASK_SCHEDULER_ADDRESS``), takes
        precedence over workers of this machine.
    count
        How many threads or processes of this machine to use.

    Yields
    ------
    callable
        ``compute(function, blocks, receive, lost)`` calls, in this thread and in any order,
        ``receive`` with each result, or ``lost`` with a block, a list, that could not be run and a
        sentence that says why.

    Raises
    ------
    ConnectionError
        If no scheduler answers at the address, or it goes away.
    """
    import dask

    address = options.address or dask.config.get("scheduler-address", None)
    # Distributed tells of each connection otherwise; it sets its loggers when it is imported.
    if "logging" not in dask.config.config:
        dask.config.set({"logging.distributed": "warning"})
    if address:
        with _connect(address) as client:
            yield partial(_on_cluster, client)
    elif options.scheduler == "threads":
        yield partial(_on_threads, count)
    else:
        with _processes(count) as client:
            yield partial(_on_cluster, client)


def _connect(address: str) -> Any:
    import asyncio

    from distributed import Client, Security
    from distributed.comm import connect

    async def knock() -> None:
        arguments = Security().get_connection_args("client")
        (await connect(address, timeout=_PATIENCE_S, **arguments)).abort()

    try:
        # A client whose first connection fails cannot be closed and holds up the end of Python.
        asyncio.run(knock())
        return Client(address, timeout=_PATIENCE_S)
    except Exception as error:  # what answers may be anything
        raise ConnectionError(
            f"no Dask scheduler answers at {address} ({error}); start it, or take the address out "
            "of `dask.address` and DASK_SCHEDULER_ADDRESS"
        ) from error


@contextmanager
def _processes(count: int) -> Iterator[Any]:
    import signal

    import dask
    from distributed import Client, LocalCluster, WorkerPlugin

    class LeaveInterrupts(WorkerPlugin):  # type: ignore[misc]
        """Ctrl-C reaches workers too, but it is this process that ends them."""

        def setup(self, worker: Any) -> None:
            del worker
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    with (
        dask.config.set(_LEAN),
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            # Nothing that we start is seen from another machine.
            host="127.0.0.1",
            dashboard_address=None,
            worker_dashboard_address=None,
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            # The products that a stage keeps bound the memory.
            memory_limit=0,
            silence_logs=logging.ERROR,
        ) as cluster,
        Client(cluster) as client,
    ):
        client.register_plugin(LeaveInterrupts())
        yield client


def _on_threads(
    count: int, function: Function, blocks_: list[Any], receive: Receive, lost: Lost
) -> None:
    import dask
    from dask.callbacks import Callback

    del lost  # A thread that dies takes the process with it.

    def finished(_key: Any, result: Any, *_: Any) -> None:
        receive(result)

    with Callback(posttask=finished), dask.config.set(scheduler="threads", num_workers=count):
        blocks.run(function, ((block,) for block in blocks_))


class _Runs:
    """Neighbouring blocks for each worker: they share what their cases have in common."""

    def __init__(self, blocks_: list[Any]) -> None:
        # Each backwards, so that its next block is its last item.
        self._runs: dict[str, list[Any]] = {"": blocks_[::-1]}

    def take(self, worker: str) -> Any | None:
        """Return a worker's next block; one that has none left takes half of the longest run."""
        if "" in self._runs:
            self._runs[worker] = self._runs.pop("")
        elif not self._runs.get(worker):
            longest = max(self._runs.values(), key=len)
            half = (len(longest) + 1) // 2
            self._runs[worker], longest[:half] = longest[:half], []
        own = self._runs[worker]
        return own.pop() if own else None


def _on_cluster(
    client: Any, function: Function, blocks_: list[Any], receive: Receive, lost: Lost
) -> None:
    from distributed import KilledWorker, as_completed
    from distributed.client import FutureCancelledError

    runs = _Runs(blocks_)
    running: dict[Any, tuple[str, Any]] = {}
    completed = as_completed()
    suspects = []

    def submit(block: Any, **where: Any) -> Any:
        return client.submit(function, block, pure=False, **where)

    def feed() -> None:
        for worker, facts in client.scheduler_info(n_workers=-1)["workers"].items():
            mine = sum(1 for name, _ in running.values() if name == worker)
            for _ in range(_AT_A_TIME * facts["nthreads"] - mine):
                block = runs.take(worker)
                if block is not None:
                    # Another worker gets it if this one dies.
                    future = submit(block, workers=worker, allow_other_workers=True)
                    running[future] = worker, block
                    completed.add(future)

    def gather(future: Any, block: Any) -> None:
        try:
            result = future.result()
        except FutureCancelledError as error:
            raise _gone(client) from error
        except KilledWorker:
            suspects.append(block)
        except Exception as error:
            lost(block, f"{type(error).__name__}: {error}")
        else:
            receive(result)
        future.release()

    if not client.scheduler_info(n_workers=-1)["workers"]:
        logger.warning("waiting for a worker at %s", client.scheduler.address)
        try:
            client.wait_for_workers(1)
        except OSError as error:
            raise _gone(client) from error
    feed()
    for future in completed:
        _, block = running.pop(future)
        gather(future, block)
        feed()
    # What was on a worker when it died may have killed it, or been beside what did: each case by
    # itself, with nothing beside it, tells.
    for one in [[case] for block in suspects for case in block]:
        suspects.clear()
        gather(submit(one), one)
        if suspects:
            lost(one, "its worker died each time that it was tried")


def _gone(client: Any) -> ConnectionError:
    return ConnectionError(
        f"the Dask scheduler at {client.scheduler.address} is gone; the finished cases are kept, "
        "and the next run goes on from them"
    )
