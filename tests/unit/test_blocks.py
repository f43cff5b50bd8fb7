"""Blocks of work on Dask's threads."""

from __future__ import annotations

import threading

import dask
import numpy as np
import pytest

from vinsar.foundations import blocks


@pytest.mark.parametrize("workers", [1, 4])
def test_results_come_in_the_order_of_the_blocks(workers):
    with dask.config.set(num_workers=workers):
        results = blocks.run(lambda a, b: (a, b), ((i, -i) for i in range(50)))
    assert results == [(i, -i) for i in range(50)]


def test_arguments_reach_the_work_as_they_are():
    values = np.zeros(3)
    assert blocks.run(lambda array, text: array is values and text == "a", [(values, "a")]) == [
        True
    ]


def test_results_are_not_looked_into():
    assert blocks.run(lambda: [1, (2, {"a": None})], [()]) == [[1, (2, {"a": None})]]


def test_equal_blocks_are_each_run():
    calls = []
    blocks.run(calls.append, [(1,)] * 5)
    assert calls == [1] * 5


def test_several_blocks_run_at_once():
    # Both must be inside the barrier at one time, or it breaks.
    barrier = threading.Barrier(2, timeout=20)
    with dask.config.set(num_workers=2):
        assert sorted(blocks.run(barrier.wait, [(), ()])) == [0, 1]


def test_the_configured_scheduler_is_used():
    with dask.config.set(scheduler="synchronous"):
        assert blocks.run(threading.current_thread, [()]) == [threading.current_thread()]


def test_work_that_is_itself_run_in_parallel_runs_its_blocks_serially():
    def threads():
        return set(blocks.run(threading.current_thread, [()] * 8))

    with blocks.serially():
        assert threads() == {threading.current_thread()}
    assert threading.current_thread() not in threads()


def test_blocks_are_parallel_again_after_an_error_in_serial_work():
    with pytest.raises(ZeroDivisionError), blocks.serially():
        blocks.run(lambda: 1 / 0, [()])
    assert blocks.run(threading.current_thread, [()]) != [threading.current_thread()]


def test_an_error_in_the_work_comes_out():
    with pytest.raises(ZeroDivisionError):
        blocks.run(lambda value: 1 / value, [(1,), (0,)])


def test_no_blocks_no_results():
    assert blocks.run(print, []) == []
