"""Run independent blocks of work on Dask's threads: the one mechanism of parallelism."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


def run(work: Callable[..., Any], blocks: Iterable[tuple[Any, ...]]) -> list[Any]:
    """Call ``work(*block)`` for every block and return the results in the blocks' order.

    Blocks must not write to the same memory. How many run at once, and where, is Dask's
    configuration (``scheduler``, ``num_workers``); the default is one thread a processor.

    Parameters
    ----------
    work
        The function to call; it should release the interpreter lock.
    blocks
        One tuple of positional arguments a call.

    Returns
    -------
    list
        What each call returned.
    """
    import dask
    from dask.delayed import delayed

    # The arguments go in as one opaque object: Dask must neither hash nor walk the arrays.
    tasks = [delayed(_Call(work, block), pure=False)() for block in blocks]
    return list(dask.compute(*tasks, scheduler=dask.config.get("scheduler", "threads")))


class _Call:
    """A call with its arguments bound, which Dask passes on without a look inside."""

    def __init__(self, work: Callable[..., Any], block: tuple[Any, ...]) -> None:
        self.work, self.block = work, block

    def __call__(self) -> Any:
        return self.work(*self.block)
