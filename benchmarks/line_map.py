"""Which tests execute a line, and how long they take: by coverage.py, on a copy of the project.

The module is the plugin of pytest there: coverage.py names the test, also in processes that it starts.
"""

import ast
import functools
import gc
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Container, Iterator
from pathlib import Path
from xml.etree import ElementTree

import coverage
import pytest

from benchmarks.line_mutants import PACKAGES, ROOT

WORKERS = 2  # processes of pytest
TEST = "MAPPED_TEST"  # variable of the environment: the test, for processes
CACHED = type(functools.cache(int))
SETTINGS = f"""[run]
data_file = {{folder}}/lines
parallel = true
relative_files = true
include =
    {{copy}}/*
    */resources/*
omit = {{copy}}/tests/*, {{copy}}/benchmarks/*
context = ${{{{{TEST}-}}}}
patch = _exit
[paths]
"""


def measure(copy: Path, target: Path, marks: str) -> None:
    """Run the tests of a copy of the project.

    Args:
        copy: the folder of the copy.
        target: folder of the map, which is there once the map is whole.
        marks: expression by which pytest selects tests.
    """
    folder = Path(tempfile.mkdtemp(dir=target.parent))
    settings = folder / "settings.ini"
    places = (f"{name} =\n    {name}\n    {copy}/{name}\n" for name in (*PACKAGES, "cybership"))
    settings.write_text(SETTINGS.format(folder=folder, copy=copy) + "".join(places), encoding="utf-8")
    tests = [
        sys.executable, "-m", "pytest", "-q", "--assert=plain", "-pno:cacheprovider", "-n", str(WORKERS),
        f"-p{__name__}", f"--junitxml={folder / 'junit.xml'}", "-m", marks,
    ]  # fmt: skip
    stated = {"COVERAGE_PROCESS_START": str(settings), "PYTHONPATH": str(copy), TEST: ""}
    subprocess.run(tests, cwd=copy, env=os.environ | stated, check=False)
    combine = [sys.executable, "-m", "coverage", "combine", "-q", f"--rcfile={settings}", str(folder)]
    subprocess.run(combine, cwd=copy, check=True)
    folder.rename(target)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Lines have the name of the test, those of its fixtures too."""
    os.environ[TEST] = item.nodeid
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


def pytest_sessionfinish() -> None:
    """Processes of pytest-xdist do not end in order."""
    measured = coverage.Coverage.current()
    measured.stop()
    measured.save()


class LineMap:
    """The map of a folder."""

    def __init__(self, folder: Path) -> None:
        lines = coverage.CoverageData(str(folder / "lines"))
        lines.read()
        self._contexts_of = functools.lru_cache(maxsize=64)(lines.contexts_by_lineno)
        self._files: defaultdict[str, list[str]] = defaultdict(list)
        for file in lines.measured_files():  # an unpacked FMU has them in a folder with a hash
            self._files[re.sub(r".*/resources/\w+_[0-9a-f]{16}/", "fmus/", file)].append(file)
        self.seconds = {
            p.get("value", ""): float(case.get("time", "0"))
            for case in ElementTree.parse(folder / "junit.xml").iter("testcase")
            if not any(case.findall(ending) for ending in ("failure", "error", "skipped"))
            for p in case.iter("property")
            if p.get("name") == "node_id"
        }

    def tests(self, module: str, line: int) -> list[str]:
        """Tests that execute a line, file by file and the fastest first.

        A line that runs while its module is imported is executed by the tests that execute functions of
        the module; if it has none, of modules in its folder. Others of the same files may use what it
        made without a function, and what one or two tests of a file execute, in each process, may be a
        result that the others use, too: they come last.
        """
        path = ROOT / module
        where = executed_with(path, line)
        found = set() if where is None else self._executing(path, where)
        for places in ([path], path.parent.glob("*.py")) if where is None else ():
            found = found or {test for place in places for test in self._using(place)}
        of_files = Counter(map(file_of, found))
        few = WORKERS if where is not None else len(self.seconds)
        others = {t for t in self.seconds if 0 < of_files[file_of(t)] <= few}
        whole = Counter[str]()
        for test in found:
            whole[file_of(test)] += self.seconds[test]
        return sorted(
            found | others,
            key=lambda t: (t not in found, whole[file_of(t)], file_of(t), self.seconds[t], t),
        )

    def _using(self, path: Path) -> set[str]:
        functions = (node for node in statements(path) if isinstance(node, ast.FunctionDef))
        return self._executing(path, *map(body, functions))

    def _executing(self, path: Path, *places: Container[int]) -> set[str]:
        of_files = map(self._contexts_of, self._files[path.relative_to(ROOT).as_posix()])
        executed = [row for contexts in of_files for row in contexts.items()]
        tests = {t for line, by in executed if any(line in place for place in places) for t in by}
        return tests & self.seconds.keys()


def file_of(test: str) -> str:
    """The file of a test."""
    return test.partition("::")[0]


def statements(path: Path) -> list[ast.stmt | ast.ExceptHandler]:
    """All statements of a file, level by level."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.stmt | ast.ExceptHandler)]


def body(node: ast.FunctionDef) -> range:
    """Lines of the body of a function."""
    return range(node.body[0].lineno, (node.end_lineno or 0) + 1)


def executed_with(path: Path, line: int) -> range | None:
    """Lines of the statement of a line, or of the function whose head it is; None: it runs at import."""
    around = [n for n in statements(path) if n.lineno <= line <= (n.end_lineno or 0)]
    if around and isinstance(inner := around[-1], ast.FunctionDef):
        return body(inner)
    if not any(isinstance(node, ast.FunctionDef) for node in around):
        return None
    first = inner.body[0].lineno if hasattr(inner, "body") else (inner.end_lineno or 0) + 1
    return range(inner.lineno, first) if line < first else range(line, line + 1)
