"""Run independent blocks of work on Dask's threads: the one mechanism of parallelism."""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

_SERIAL = ContextVar("_SERIAL", default=False)


@contextmanager
def serially() -> Iterator[None]:
    """Run blocks one after the other in this context: for work that is itself run in parallel."""
    token = _SERIAL.set(True)
    try:
        yield
    finally:
        _SERIAL.reset(token)


def run(work: Callable[..., Any], blocks: Iterable[tuple[Any, ...]]) -> list[Any]:
    """Call ``work(*block)`` for every block and return the results in the blocks' order.

    Blocks must not write to the same memory. How many run at once, and where, is Dask's
    configuration (``scheduler``, ``num_workers``); the default is one thread a processor. Within
    `serially` they run one after the other.

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
    if _SERIAL.get():
        return [work(*block) for block in blocks]
    import dask
    from dask.delayed import delayed

    # The arguments go in as one opaque object: Dask must neither hash nor walk the arrays.
    calls = [_Call(work, block) for block in blocks]
    # Dask starts independent tasks by name, the last one first.
    tasks = [
        delayed(call, pure=False)(dask_key_name=f"block-{len(calls) - number:09d}")
        for number, call in enumerate(calls)
    ]
    return list(dask.compute(*tasks, scheduler=dask.config.get("scheduler", "threads")))


class _Call:
    """A call with its arguments bound, which Dask passes on without a look inside."""

    def __init__(self, work: Callable[..., Any], block: tuple[Any, ...]) -> None:
        self.work, self.block = work, block

    def __call__(self) -> Any:
        return self.work(*self.block)
