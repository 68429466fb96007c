"""Which tests execute a line, and how long they take, by coverage.py on a copy of the project."""

import ast
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Container
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from coverage import CoverageData

from benchmarks.line_contexts import CONTEXT
from benchmarks.line_mutants import PACKAGES, ROOT

WORKERS = 2  # processes of pytest
SETTINGS = f"""[run]
data_file = {{folder}}/lines
parallel = true
relative_files = true
include =
    {{copy}}/*
    */resources/*
omit = {{copy}}/tests/*, {{copy}}/benchmarks/*
context = ${{{{{CONTEXT}-}}}}
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
        "-pbenchmarks.line_contexts", f"--junitxml={folder / 'junit.xml'}", "-m", marks,
    ]  # fmt: skip
    told = {"COVERAGE_PROCESS_START": str(settings), "PYTHONPATH": str(copy), CONTEXT: ""}
    subprocess.run(tests, cwd=copy, env=os.environ | told, check=False)
    combine = [sys.executable, "-m", "coverage", "combine", "-q", f"--rcfile={settings}", str(folder)]
    subprocess.run(combine, cwd=copy, check=True)
    folder.rename(target)


class LineMap:
    """The map of a folder."""

    def __init__(self, folder: Path) -> None:
        lines = CoverageData(str(folder / "lines"))
        lines.read()
        self._contexts_of = lru_cache(maxsize=64)(lines.contexts_by_lineno)
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
        the module, or of modules that name it. What one test of a file executes, in each process, may be
        a result that the others use, too: they come last.
        """
        tree = ast.parse((ROOT / module).read_text(encoding="utf-8"))
        where = reached(tree, line)
        if where is None:
            found = self._executing(module, in_functions(tree)) or set().union(
                *(self._executing(name, in_functions(other)) for name, other in naming(module))
            )
        else:
            found = self._executing(module, where)
        of_files = Counter(map(file_of, found))
        others = {t for t in self.seconds if 0 < of_files[file_of(t)] <= WORKERS}
        whole = Counter[str]()
        for test in found:
            whole[file_of(test)] += self.seconds[test]
        return sorted(
            found | others,
            key=lambda t: (t not in found, whole[file_of(t)], file_of(t), self.seconds[t], t),
        )

    def _executing(self, module: str, lines: Container[int]) -> set[str]:
        found = (self._contexts_of(file).items() for file in self._files[module])
        contexts = {c for each in found for line, by in each if line in lines for c in by}
        return contexts & self.seconds.keys()


def file_of(test: str) -> str:
    """The file of a test."""
    return test.partition("::")[0]


def body(node: ast.FunctionDef) -> range:
    """Lines of the body of a function."""
    return range(node.body[0].lineno, (node.end_lineno or 0) + 1)


def in_functions(tree: ast.Module) -> set[int]:
    """Lines of a module that are in a function."""
    functions = (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef))
    return {line for function in functions for line in body(function)}


def reached(tree: ast.Module, line: int) -> range | None:
    """Lines of the statement of a line, or of the function whose head it is; None: it runs at import."""
    around = [
        node
        for node in ast.walk(tree)  # level by level
        if isinstance(node, ast.stmt | ast.ExceptHandler)
        and node.lineno <= line <= (node.end_lineno or 0)
    ]
    if around and isinstance(inner := around[-1], ast.FunctionDef):
        return body(inner)
    if not any(isinstance(node, ast.FunctionDef) for node in around):
        return None
    first = inner.body[0].lineno if hasattr(inner, "body") else (inner.end_lineno or 0) + 1
    return range(inner.lineno, first) if line < first else range(line, line + 1)


def naming(module: str) -> list[tuple[str, ast.Module]]:
    """Modules whose text has the name of a module, with their syntax trees."""
    path = ROOT / module
    name = re.compile(rf"\b{path.parent.name if path.stem == '__init__' else path.stem}\b")
    texts = {f: f.read_text("utf-8") for place in PACKAGES for f in (ROOT / place).rglob("*.py")}
    return [
        (file.relative_to(ROOT).as_posix(), ast.parse(text))
        for file, text in texts.items()
        if file != path and name.search(text)
    ]
