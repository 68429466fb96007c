"""A plugin of pytest: coverage.py names the test that executes a line, also in its processes."""

import functools
import gc
import os
from collections.abc import Iterator

import coverage
import pytest

CONTEXT = "LINE_CONTEXT"  # variable of the environment: the test, for processes
CACHED = type(functools.cache(int))


def pytest_sessionfinish() -> None:
    """Processes of pytest-xdist do not end in order."""
    if measured := coverage.Coverage.current():
        measured.stop()
        measured.save()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Lines have the name of the test, those of its fixtures too."""
    os.environ[CONTEXT] = item.nodeid
    coverage.Coverage.current().switch_context(item.nodeid)
    return (yield)


@pytest.fixture(autouse=True, scope="module")
def _made_anew(_session_cache, tmp_path_factory):
    """Each file of tests executes all that it depends on: caches are empty, and no result is kept."""
    from support.shared import keep_in

    keep_in(tmp_path_factory.mktemp("kept"))
    gc.unfreeze()
    for each in gc.get_objects():
        if isinstance(each, CACHED):
            each.cache_clear()
    gc.freeze()
