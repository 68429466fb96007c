"""Which tests are near to a place in the code: by imports, and by names that they have in common."""

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from importlib.util import resolve_name
from pathlib import Path

from benchmarks.line_mutants import PACKAGES, ROOT, Mutant

OURS = (*PACKAGES, "cybership", "benchmarks", "tests")
FAR, FARTHEST = 9, 7  # steps of imports of a test without any, and from which on a test is not run
FOUND = 6  # the same of a component, which its folder finds without an import
SHARED_NAME = 12  # a name that more test files have tells of none
NAMED = 3  # names of a module that a test file has, as far as they count a step each
# Of a package the file that runs its commands as a whole, and so most of its lines.
WHOLE = {
    "cosim": "tests/test_run.py",
    "diagnosis": "tests/test_diagnosis_commands.py",
    "fmucheck": "tests/test_check.py",
}


def imported(path: Path) -> Iterator[Path]:
    """The project's modules that a file imports, also inside of functions, and on demand by its stub."""
    package = ".".join(path.relative_to(ROOT).parent.parts)
    texts = [f.read_text(encoding="utf-8") for f in (path, path.with_suffix(".pyi")) if f.is_file()]
    for node in (n for text in texts for n in ast.walk(ast.parse(text))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = resolve_name("." * node.level + (node.module or ""), package)
            names = [base, *(f"{base}.{alias.name}" for alias in node.names)]
        places = [f.joinpath(*name.split(".")) for name in names for f in (ROOT, ROOT / "tests")]
        yield from filter(
            Path.is_file, (f for p in places for f in (p.with_suffix(".py"), p / "__init__.py"))
        )


class Nearness:
    """How near tests are to a place in the code."""

    def __init__(self) -> None:
        files = [path for name in OURS for path in ROOT.glob(f"{name}/**/*.py")]
        graph = {path: list(dict.fromkeys(imported(path))) for path in files}
        self.steps: dict[str, dict[str, int]] = defaultdict(dict)
        tests = [*(ROOT / "tests").rglob("test_*.py")]
        for test in tests:
            for module, steps in distances(test, graph).items():
                self.steps[module.relative_to(ROOT).as_posix()][test.relative_to(ROOT).as_posix()] = (
                    steps
                )
        self.texts = {t.relative_to(ROOT).as_posix(): t.read_text(encoding="utf-8") for t in tests}
        self._defined: dict[str, list[str]] = {}
        self.known = Counter(w for text in self.texts.values() for w in set(re.findall(r"\w+", text)))

    def __call__(self, m: Mutant, names: Sequence[str], file: str, own: str = "") -> float:
        """Steps of imports from a test file, less where its text or path, or a test's text, names it."""
        place = Path(m.module)
        component = f"{place.parent.name}_{place.stem}"
        telling = [n for n in names if len(n) > 3 and self.known[n] <= SHARED_NAME]
        named = sum(word(n, self.texts[file]) for n in self._telling(m.module))
        steps = self.steps[m.module].get(file, FOUND if m.package == "fmus" else FAR) - min(named, NAMED)
        by_test = any(word(n, own) for n in (*telling, component))
        by_file = any(word(n, self.texts[file]) for n in (*telling, place.stem, component))
        folders = {*re.split(r"[/_.]", m.module)[1:-1]}
        return steps - 3.0 * by_test - 1.5 * by_file - 2.0 * bool(folders & {*re.split(r"[/_.]", file)})

    def _telling(self, module: str) -> list[str]:
        """Names that a module defines, and that few test files have."""
        if module not in self._defined:
            tree = ast.parse((ROOT / module).read_text(encoding="utf-8"))
            names = [getattr(n, "name", "") for n in tree.body]
            self._defined[module] = [n for n in names if len(n) > 3 and self.known[n] <= SHARED_NAME]
        return self._defined[module]


def word(name: str, text: str) -> bool:
    """Whether a text has a name as a word."""
    return bool(re.search(rf"\b{re.escape(name)}\b", text))


def distances(start: Path, graph: dict[Path, list[Path]]) -> dict[Path, int]:
    """Steps of imports from a file to every module that it reaches."""
    steps, reached = {start: 0}, [start]
    for file in reached:  # grows while it is walked
        for module in graph.get(file, ()):
            if module not in steps:
                steps[module] = steps[file] + 1
                reached.append(module)
    return steps


def around(m: Mutant) -> list[str]:
    """Names of the functions and classes around a mutant's line."""
    return [
        node.name
        for node in ast.walk(ast.parse((ROOT / m.module).read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and node.lineno <= m.line <= (node.end_lineno or 0)
    ]
