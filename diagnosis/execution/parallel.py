"""The same work for several items, in two processes where the system can fork.

The second process begins as a copy of this one, so that nothing is sent to it; it takes the next item
whenever it is free, and sends back what it found.
"""

import os
import sys
import threading
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from io import BytesIO
from multiprocessing import current_process, get_context
from pickle import Pickler, Unpickler
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

from cosim.interrupts import ignore_interrupts, uninterrupted_processes
from cosim.process import end_with_parent

Item = TypeVar("Item")
Found = TypeVar("Found")

_alone = False  # whether this process shares no work: it is a second one itself


def forks() -> bool:
    """Elsewhere a process begins with imports of some seconds, or libraries do not outlive a fork."""
    return sys.platform == "linux" and os.cpu_count() != 1


@cache
def _libraries() -> ThreadpoolController:
    """The loaded libraries with threads of their own, which take milliseconds to find."""
    return ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """Let linear algebra use one thread: matrices here are small, and waiting threads take the cores."""
    with _libraries().limit(limits=1, user_api="blas"):
        yield


def for_each(
    function: Callable[[Item], Found],
    items: Sequence[Item],
    common: Sequence[object] = (),
    meanwhile: Callable[[], object] | None = None,
) -> list[Found]:
    """What a function gives for each item, in their order.

    Args:
        function: depends on nothing that it changes.
        items: what it is called with.
        common: objects that results may contain and that are not sent, as both processes have them.
        meanwhile: what this process does before its first item, such as imports that it needs later;
            left out where there is no second process.
    """
    # Another thread might hold what a fork needs, and a process of a pool may have none of its own.
    main = threading.current_thread() is threading.main_thread()
    if _alone or not forks() or not main or current_process().daemon or len(items) < 2:
        return [function(item) for item in items]
    context, parent = get_context("fork"), os.getpid()
    receiver, sender = context.Pipe(duplex=False)
    known = {id(x): x for x in common}
    following, filled = os.pipe()  # both take the next item's number from it
    numbers = array("H", range(len(items)))  # all fit into a pipe's 64 kB
    os.write(filled, numbers)
    os.close(filled)

    def work() -> dict[int, Found]:
        found: dict[int, Found] = {}
        with suppress(Exception):  # what is missing is computed at last, in order, and meets the same
            while number := os.read(following, numbers.itemsize):
                k = int.from_bytes(number, sys.byteorder)
                found[k] = function(items[k])
        return found

    def beside() -> None:
        global _alone
        _alone = True
        ignore_interrupts()
        end_with_parent(parent)
        receiver.close()
        with suppress(Exception):  # a result that cannot be sent is missing, too
            sender.send_bytes(_packed(work(), known))

    second = context.Process(target=beside, daemon=True)
    with one_thread():  # or each process would have a thread for each core
        with uninterrupted_processes():
            second.start()
        sender.close()
        try:
            if meanwhile is not None:
                meanwhile()
            found = work()
            with suppress(EOFError):  # the second process was killed
                found |= _unpacked(receiver.recv_bytes(), known)
        finally:
            receiver.close()
            os.close(following)
            second.kill()
            second.join()
    return [found[k] if k in found else function(item) for k, item in enumerate(items)]


def in_halves(
    function: Callable[[Sequence[Item]], Sequence[Found]],
    items: Sequence[Item],
    common: Sequence[object] = (),
    share: bool = True,
) -> list[Found]:
    """What a function gives for each item, where it takes many at once as fast as one.

    Args:
        function: gives a result for each of the items that it is called with.
        items: every second one goes to the other process, if there are two.
        common: see :func:`for_each`.
        share: whether a second process may take any.
    """
    halves = [items[::2], items[1::2]][: len(items)]
    parts = for_each(function, halves, common) if share else [*map(function, halves)]
    return [parts[k % 2][k // 2] for k in range(len(items))]


def _packed(content: Any, known: dict[int, Any]) -> bytes:
    class Packer(Pickler):
        def persistent_id(self, obj: Any) -> int | None:
            return id(obj) if id(obj) in known else None

    buffer = BytesIO()
    Packer(buffer, protocol=5).dump(content)
    return buffer.getvalue()


def _unpacked(content: bytes, known: dict[int, Any]) -> Any:
    class Unpacker(Unpickler):
        def persistent_load(self, pid: int) -> Any:
            return known[pid]

    return Unpacker(BytesIO(content)).load()
