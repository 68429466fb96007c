"""Which quick tests execute a line: measured once with coverage.py, kept, and brought up to date.

A test file that has changed since is measured anew. Of a module that has changed, the tests of any of
its lines count, since lines have moved. Lines that run while modules are imported, whose results lie in
caches, or that only processes execute which end without a word to coverage.py, fall back on the tests
that import the module.
"""

import ast
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from importlib.util import resolve_name
from pathlib import Path, PurePath
from xml.etree import ElementTree

from coverage import CoverageData

LEFT_OUT = (".git", "__pycache__", ".*_cache", "*.fmu", "*.egg-info")
MADE = {"results", "site"}  # folders of the project itself
OURS = (
    "fmus",
    "fmucheck",
    "cosim",
    "diagnosis",
    "studies",
    "thesis",
    "cybership",
    "benchmarks",
    "tests",
)
# Results of this code lie in caches: the test that runs it need not be the one that uses the result.
CACHED = ("fmus/", "cosim/compiled/")
PHASE = r"(\|\w+| \(\w+\))$"  # of a test, at the end of its name
NODE = "node_id"  # property of a test in the report, by tests/conftest.py
EACH = 0.05  # s, pytest's own time for a test
# Processes that a test starts are measured under its name; the source inside of an FMU counts as ours.
COVERAGE = """
[run]
parallel = true
patch = subprocess
context = ${PYTEST_CURRENT_TEST-}
disable_warnings = no-data-collected, module-not-imported
include =
    */fmus/*
    */fmucheck/*
    */cosim/*
    */diagnosis/*
    */studies/*
    */thesis/*
    */resources/*_????????????????/*
[paths]
fmus =
    fmus
    */resources/*_????????????????
"""


def copied(root: Path, copy: Path) -> Path:
    """A copy of the project, without what is made from it."""
    left_out = shutil.ignore_patterns(*LEFT_OUT)
    shutil.copytree(
        root,
        copy,
        ignore=lambda folder, names: left_out(folder, names) | (MADE if folder == str(root) else set()),
    )
    return copy


def imported(root: Path, path: Path) -> Iterator[Path]:
    """The project's modules that a file imports, also inside of functions."""
    package = ".".join(path.relative_to(root).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = resolve_name("." * node.level + (node.module or ""), package)
            names = [base, *(f"{base}.{alias.name}" for alias in node.names)]
        places = [f.joinpath(*name.split(".")) for name in names for f in (root, root / "tests")]
        files = [file for p in places for file in (p.with_suffix(".py"), p / "__init__.py")]
        yield from filter(Path.is_file, files)


def distances(start: Path, graph: Mapping[Path, Sequence[Path]]) -> dict[Path, int]:
    """Steps of imports from a file to every module that it reaches."""
    steps, reached = {start: 0}, [start]
    for file in reached:  # grows while it is walked
        for module in graph.get(file, ()):
            if module not in steps:
                steps[module] = steps[file] + 1
                reached.append(module)
    return steps


def statement(source: str, line: int) -> tuple[range, bool]:
    """Lines of the innermost statement around one (its head, if it has a body); is it in a function?"""
    lines, inside, head = range(line, line + 1), False, False
    for node in ast.walk(ast.parse(source)):  # outer ones come first
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            inside |= head
            body = getattr(node, "body", None)
            end = body[0].lineno - 1 if body else node.end_lineno or node.lineno
            lines = range(node.lineno, max(end, node.lineno) + 1)
            head = isinstance(node, ast.FunctionDef)
    return lines, inside


class Covering:
    """The tests of a line, from a measurement that is kept in a folder."""

    def __init__(self, root: Path, out: Path, processes: int) -> None:
        self.root, self.out = root, out
        self.cache = out / "session" / "cache"
        self.unsound: set[str] = set()
        kept = out / "measured.json"
        every = [path for name in OURS for path in root.glob(f"{name}/**/*.py")]
        now = {path.relative_to(root).as_posix(): self._hash(path) for path in every}
        old = json.loads(kept.read_text("utf-8")) if kept.exists() else {"hashes": {}, "seconds": {}}
        self.hashes, self.seconds = old["hashes"], old["seconds"]
        tests = [name for name in now if PurePath(name).match("test_*.py")]
        changed = [name for name in tests if now[name] != self.hashes.get(name)]
        if changed:
            measured = self._measure(changed if kept.exists() else [], processes)
            others = {t: s for t, s in self.seconds.items() if t.partition("::")[0] not in changed}
            self.hashes = now | self.hashes | {name: now[name] for name in changed}
            self.seconds = others | measured
            kept.write_text(json.dumps({"hashes": self.hashes, "seconds": self.seconds}), "utf-8")
        self.moved = {name for name in now if now[name] != self.hashes.get(name)}

    @staticmethod
    def _hash(path: Path) -> str:
        return hashlib.sha256(path.read_bytes()).hexdigest()

    def _measure(self, files: Sequence[str], processes: int) -> dict[str, float]:
        """Seconds of each quick test that passes, of some files or of all."""
        self.out.mkdir(parents=True, exist_ok=True)
        settings, report = self.out / "settings.ini", self.out / "junit.xml"
        session = self.out / "changed" if files else self.cache.parent
        settings.write_text(COVERAGE, encoding="utf-8")
        copy = self.out / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        options = f"-q -n {processes} -p no:cacheprovider --cov --cov-context=test --cov-append"
        places = [f"--cov-config={settings}", f"--junitxml={report}", f"--basetemp={session}"]
        options = [*options.split(), "--cov-report=", "-mnot slow", *places]
        subprocess.run(
            [sys.executable, "-m", "pytest", *options, *files],
            cwd=copied(self.root, copy),
            env={**os.environ, "PYTHONPATH": str(copy), "COVERAGE_FILE": str(self.out / "coverage")},
            check=False,  # tests that fail without a mutant are left out
        )
        seconds = {}
        for case in ElementTree.parse(report).iter("testcase"):
            if not [child for child in case if child.tag in ("failure", "error", "skipped")]:
                (name,) = (p.get("value") for p in case.iter("property") if p.get("name") == NODE)
                seconds[name] = float(case.get("time", "0"))
        return seconds

    @cached_property
    def _lines(self) -> dict[str, dict[int, dict[str, bool]]]:
        """Module -> line -> tests, and whether each executes it itself, not only its fixtures."""
        data = CoverageData(str(self.out / "coverage"))
        data.read()
        found: dict[str, dict[int, dict[str, bool]]] = {}
        for file in data.measured_files():
            name = file.removeprefix(f"{self.out / 'copy'}{os.sep}").replace(os.sep, "/")
            found[name] = {
                line: {
                    re.sub(PHASE, "", context): "setup" not in context[-7:]
                    for context in sorted(contexts, key=lambda c: "setup" not in c[-7:])
                }
                for line, contexts in data.contexts_by_lineno(file).items()
            }
        return found

    @cached_property
    def _importing(self) -> dict[str, dict[str, int]]:
        """Module -> test files that import it, and by how many steps."""
        files = [path for name in OURS for path in self.root.glob(f"{name}/**/*.py")]
        graph = {path: list(dict.fromkeys(imported(self.root, path))) for path in files}
        found: defaultdict[str, dict[str, int]] = defaultdict(dict)
        for test in self.root.glob("tests/**/test_*.py"):
            for module, steps in distances(test, graph).items():
                name = test.relative_to(self.root).as_posix()
                found[module.relative_to(self.root).as_posix()][name] = steps
        return found

    def tests(
        self, module: str, line: int, budget: float
    ) -> tuple[list[tuple[str, float]], Path | None]:
        """Quick tests that execute a line, most telling first, with their seconds; FMUs for them.

        Args:
            module: path below the root.
            line: the first that a mutant changes.
            budget: of all tests together [s].
        """
        lines = self._lines.get(module, {})
        around, inside = statement((self.root / module).read_text(encoding="utf-8"), line)
        executed = lines if module in self.moved else [each for each in around if each in lines]
        names = {name for each in executed for name in lines[each]}
        fallback = module.startswith(CACHED) or not inside or names <= {""}
        # A fixture that tests share takes far longer than the test that is said to have made it.
        itself = {name for each in executed for name, does in lines[each].items() if does}
        tests = self._one_of_each_first(itself & self.seconds.keys())
        tests += self._one_of_each_first((names - itself) & self.seconds.keys())
        if fallback:
            steps = self._importing.get(module, {})
            beside = [t for t in self.seconds if t.partition("::")[0] in steps and t not in names]
            near = self._one_of_each_first(beside)
            tests += sorted(near, key=lambda test: steps[test.partition("::")[0]])
        found, spent = [], 0.0
        for test in tests:
            seconds = self.seconds[test] + EACH
            if test not in self.unsound and spent + seconds <= budget:
                spent += seconds
                found.append((test, seconds))
        return found, None if module.startswith(CACHED) else self.cache

    def _one_of_each_first(self, tests) -> list[str]:
        """The quickest case of every test function, then the second of each, and so on."""
        functions: defaultdict[str, list[str]] = defaultdict(list)
        for test in sorted(tests, key=lambda test: (self.seconds[test], test)):
            functions[test.partition("[")[0]].append(test)
        ranked = [(rank, self.seconds[t], t) for f in functions.values() for rank, t in enumerate(f)]
        return [test for *_, test in sorted(ranked)]
