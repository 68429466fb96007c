"""Processes of the diagnosis in tests: one, as the workers of the tests take the cores, or two as in a command."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from diagnosis.execution import parallel

FORKS = parallel.forks


@contextmanager
def one_process() -> Iterator[None]:
    """No copy of this process takes a share of the work: copying a process with all tests costs a sixth more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parallel, "forks", lambda: False)
        yield


@contextmanager
def two_processes() -> Iterator[None]:
    """Where the system can fork."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parallel, "forks", FORKS)
        yield
