"""Where a sweep's blocks run: threads or processes of this machine, or any Dask cluster."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from vinsar.foundations import blocks
from vinsar.sweeps import processes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from vinsar.study.options import Dask
    from vinsar.sweeps.processes import Function, Lost, Receive

    Compute = Callable[[Function, list[Any], Receive, Lost], None]

logger = logging.getLogger(__name__)

_PATIENCE_S = 5

# What a thread of a worker is given at a time: one to run, one to begin with next.
_AT_A_TIME = 2


@contextmanager
def workers(options: Dask, count: int) -> Iterator[Compute]:
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
        with processes.pool(count) as pool:
            yield pool


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


def _on_threads(
    count: int, function: Function, pieces: list[Any], receive: Receive, lost: Lost
) -> None:
    import dask
    from dask.callbacks import Callback

    del lost  # A thread that dies takes the process with it.

    def finished(_key: Any, result: Any, *_: Any) -> None:
        receive(result)

    with Callback(posttask=finished), dask.config.set(scheduler="threads", num_workers=count):
        blocks.run(function, ((block,) for block in pieces))


def _on_cluster(
    client: Any, function: Function, pieces: list[Any], receive: Receive, lost: Lost
) -> None:
    from distributed import KilledWorker, as_completed
    from distributed.client import FutureCancelledError

    runs = processes.Runs(pieces)
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
