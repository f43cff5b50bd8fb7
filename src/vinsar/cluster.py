"""Where a sweep's blocks run: threads or processes of this machine, or any Dask cluster."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from vinsar import blocks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from vinsar import config

    Compute = Callable[[Callable[[Any], Any], list[Any], Callable[[Any], None]], None]

_PATIENCE_S = 10


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
        ``compute(function, blocks, receive)`` calls ``receive`` in this thread with each result,
        in any order.

    Raises
    ------
    ValueError
        If no scheduler answers at the address.
    """
    import dask

    address = options.address or dask.config.get("scheduler-address", None)
    if address:
        with _connect(address) as client:
            yield partial(_on_cluster, client)
    elif options.scheduler == "threads":
        yield partial(_on_threads, count)
    else:
        with _processes(count) as client:
            yield partial(_on_cluster, client)


def _connect(address: str) -> Any:
    from distributed import Client

    try:
        return Client(address, timeout=_PATIENCE_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise ValueError(
            f"no Dask scheduler answers at {address} within {_PATIENCE_S} s ({error}); start it, "
            "or take the address out of `dask.address` and DASK_SCHEDULER_ADDRESS"
        ) from error


@contextmanager
def _processes(count: int) -> Iterator[Any]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            # Nothing that we start is seen from another machine.
            host="127.0.0.1",
            dashboard_address=None,
            worker_dashboard_address=None,
            scheduler_kwargs={"dashboard": False},
            # The products that a stage keeps bound the memory.
            memory_limit=0,
            silence_logs=logging.ERROR,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def _on_threads(
    count: int,
    function: Callable[[Any], Any],
    blocks_: list[Any],
    receive: Callable[[Any], None],
) -> None:
    import dask
    from dask.callbacks import Callback

    def finished(_key: Any, result: Any, *_: Any) -> None:
        receive(result)

    with Callback(posttask=finished), dask.config.set(num_workers=count):
        blocks.run(function, ((block,) for block in blocks_))


def _on_cluster(
    client: Any,
    function: Callable[[Any], Any],
    blocks_: list[Any],
    receive: Callable[[Any], None],
) -> None:
    from distributed import as_completed

    # In order, so that neighbouring blocks share what their cases have in common. A worker that
    # dies takes its block with it; another worker gets it.
    futures = [
        client.submit(function, block, pure=False, priority=-number, retries=2)
        for number, block in enumerate(blocks_)
    ]
    for future in as_completed(futures):
        receive(future.result())
        future.release()
