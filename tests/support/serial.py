"""An executor that stands for a pool of processes, and does everything at once in this process."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any


class Serial(Executor):
    """Takes the arguments of a ProcessPoolExecutor and starts nothing."""

    def __init__(self, *_: Any) -> None:
        """No process is needed."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        future: Future = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future
