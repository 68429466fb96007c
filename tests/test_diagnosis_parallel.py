"""The same work for several items in two processes."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from diagnosis.execution.parallel import for_each, forks, one_thread

pytestmark = pytest.mark.usefixtures("two_processes")
forked = pytest.mark.skipif(not forks(), reason="needs fork and two cores")


def patient(x):
    """Leaves time for the other process to take something."""
    time.sleep(0.02)
    return x


@forked
def test_both_processes_work_and_results_are_in_order():
    found = for_each(lambda k: (k, os.getpid(), patient(None)), range(12))
    assert [k for k, *_ in found] == list(range(12))
    assert {pid for _, pid, _ in found} > {os.getpid()}


def test_the_error_is_that_of_the_first_item_that_has_one():
    def fails(k):
        patient(k)
        if k in (3, 4, 9):
            raise ValueError(f"item {k}")
        return k

    with pytest.raises(ValueError, match="item 3"):
        for_each(fails, range(12))


@forked
def test_what_a_killed_process_did_not_find_is_computed():
    here = os.getpid()

    def once(k):
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return patient(k)

    assert for_each(once, range(6)) == list(range(6))


def test_a_common_object_stays_the_same_object():
    class Local:  # cannot be pickled
        pass

    common = Local()
    assert all(x is common for x, _ in for_each(lambda k: (common, patient(k)), range(4), [common]))


def children():
    """Processes of this one, those that have ended and were not waited for included."""
    found = set()
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended
            parent = (process / "stat").read_text().rpartition(")")[2].split()[1]
            found |= {process.name} if int(parent) == os.getpid() else set()
    return found


@forked
def test_no_process_and_no_open_file_is_left():
    before, others = len(os.listdir("/proc/self/fd")), children()
    for_each(patient, range(4))
    with pytest.raises(KeyboardInterrupt):
        for_each(interrupted, range(4))
    assert len(os.listdir("/proc/self/fd")) == before
    assert children() <= others


def in_a_pool(k):
    return for_each(patient, range(k))


@forked
def test_a_process_of_a_pool_and_a_thread_work_alone():
    with get_context("fork").Pool(1) as pool:
        assert pool.apply(in_a_pool, (3,)) == [0, 1, 2]
    with ThreadPoolExecutor(1) as threads:
        pids = threads.submit(for_each, lambda k: (patient(k), os.getpid()), range(4)).result()
    assert {pid for _, pid in pids} == {os.getpid()}


HERE = os.getpid()


def interrupted(k):
    if os.getpid() == HERE:
        raise KeyboardInterrupt
    time.sleep(60.0)


def test_linear_algebra_has_one_thread_while_it_lasts_and_as_many_as_before_after_it():
    def threads():
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    with threadpool_limits(limits=2, user_api="blas"):
        with one_thread():
            assert threads() == {1}
        assert threads() == {2}
