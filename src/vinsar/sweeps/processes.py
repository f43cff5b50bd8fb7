"""Worker processes of this machine, spoken to through pipes: no other user can reach them.

A worker that dies is replaced, and what it had in hand is tried once more, case by case.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing.connection import Connection

    Function = Callable[[Any], Any]
    Receive = Callable[[Any], None]
    Lost = Callable[[Any, str], None]

_CONTEXT = multiprocessing.get_context("spawn")

# Workers share the processors between them: threads within one would be in the others' way.
_ALONE = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "MKL", "OPENBLAS")}


class Runs:
    """Neighbouring blocks for each worker: they share what their cases have in common."""

    def __init__(self, blocks: list[Any]) -> None:
        # Each backwards, so that its next block is its last item.
        self._runs: dict[str, list[Any]] = {"": blocks[::-1]}

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


class _Worker:
    """A process and this end of its pipe."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.block: Any = None
        self._function: Function | None = None
        self.pipe, theirs = _CONTEXT.Pipe()
        with _environment(_ALONE):
            self.process = _CONTEXT.Process(target=_work, args=(theirs,), daemon=True)
            self.process.start()
        theirs.close()

    def begin(self, function: Function, block: Any) -> None:
        """Send a block, and the function if it is another than before."""
        self.block = block
        new, self._function = function is not self._function, function
        # If it is dead, whoever waits for its answer is told.
        with suppress(OSError):
            self.pipe.send((function if new else None, block))

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _work(pipe: Connection) -> None:
    # Ctrl-C reaches workers too, but it is the process above that ends them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    function: Any = None
    while True:
        try:
            new, block = pipe.recv()
        except EOFError:
            return
        function = function if new is None else new
        try:
            answer = True, function(block)
        except Exception as error:  # the sweep goes on without this block
            answer = False, f"{type(error).__name__}: {error}"
        pipe.send(answer)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class Pool:
    """So many workers, until they are ended.

    Parameters
    ----------
    count
        How many.
    """

    def __init__(self, count: int) -> None:
        self.workers = [_Worker(str(number)) for number in range(count)]

    def end(self) -> None:
        """End the workers, whatever they are at."""
        for worker in self.workers:
            worker.end()

    def __call__(self, function: Function, blocks: list[Any], receive: Receive, lost: Lost) -> None:
        """Run a function on blocks (`cluster.workers`)."""
        runs = Runs(blocks)
        again: list[Any] = []

        def take(worker: _Worker) -> Any | None:
            return again.pop() if again else runs.take(worker.name)

        def feed() -> None:
            for worker in self.workers:
                if worker.block is None and (block := take(worker)) is not None:
                    worker.begin(function, block)

        tried: list[Any] = []
        try:
            feed()
            while busy := [worker for worker in self.workers if worker.block is not None]:
                ready = wait([worker.pipe for worker in busy])
                for worker in busy:
                    if worker.pipe not in ready:
                        continue
                    block = worker.block
                    try:
                        done, answer = worker.pipe.recv()
                    except (EOFError, OSError):
                        self._replace(worker)
                        if any(block is one for one in tried):
                            lost(block, "its worker died each time that it was tried")
                        else:
                            tried += (alone := [[case] for case in block])
                            again += alone
                        continue
                    worker.block = None
                    if done:
                        receive(answer)
                    else:
                        lost(block, answer)
                feed()
        finally:
            # What is still at work was given up: an answer to come would be taken for another's.
            for worker in self.workers:
                if worker.block is not None:
                    self._replace(worker)

    def _replace(self, worker: _Worker) -> None:
        worker.end()
        self.workers[self.workers.index(worker)] = _Worker(worker.name)


@contextmanager
def pool(count: int) -> Iterator[Pool]:
    """Give so many workers, and end them afterwards.

    Parameters
    ----------
    count
        How many.

    Yields
    ------
    Pool
        Call it as `cluster.workers` describes.
    """
    made = Pool(count)
    try:
        yield made
    finally:
        made.end()
