"""Do the tests fail where the code is wrong? ``python -m benchmarks.mutation``.

Seeded mutants of each package (mutmut's operators on what stands in functions, texts left out), each
held against the quick tests that touch its module: those that import it by the fewest steps first, until
one fails. One that no test kills, and that ``benchmarks/equivalent_mutants.toml`` does not call
equivalent, survives. Needs ``pip install -e ".[dev,mutation]"``.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import libcst
from mutmut.mutation.file_mutation import Mutation, create_mutations, deep_replace

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
PACKAGES = ("fmus", "cosim", "diagnosis", "studies")
EQUIVALENT = ROOT / "benchmarks" / "equivalent_mutants.toml"
LEFT_OUT = (
    ".git",
    "results",
    "site",
    "__pycache__",
    ".pytest_cache",
    ".ruff_cache",
    "*.fmu",
    "*.egg-info",
)
KILLED, SURVIVED, SAME, UNTESTED = "killed", "survived", "equivalent", "no test"


class Mutant(NamedTuple):
    """A changed module: its path, the line before and after, and the whole text."""

    module: Path
    before: str
    after: str
    text: str


def draw(files: Sequence[Path], count: int, seed: int) -> tuple[int, list[Mutant]]:
    """How many mutants of files there are, those of texts left out, and some of them."""
    every = []
    for module in files:
        tree, found, *_ = create_mutations(str(module), module.read_text(encoding="utf-8"))
        texts = (libcst.BaseString, libcst.FormattedString)
        every += [(module, tree, m) for m in found if not isinstance(m.original_node, texts)]
    drawn = random.Random(seed).sample(every, min(count, len(every)))
    return len(every), [made(*one) for one in drawn]


def made(module: Path, tree: libcst.Module, mutation: Mutation) -> Mutant:
    """One mutant, as text."""
    changed = deep_replace(tree, mutation.original_node, mutation.mutated_node)
    assert isinstance(changed, libcst.Module)
    pairs = zip(tree.code.splitlines(), changed.code.splitlines(), strict=False)
    before, after = next(((a, b) for a, b in pairs if a != b), ("", ""))
    return Mutant(module.relative_to(ROOT), before.strip(), after.strip(), changed.code)


def imported(path: Path) -> Iterator[Path]:
    """The project's modules that a file imports, also inside of functions."""
    package = path.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else ()
            base = [*up, *(node.module or "").split(".")]
            names = [[part for part in base if part], *([*base, alias.name] for alias in node.names)]
        for parts in names:
            for root in (ROOT, ROOT / "tests"):
                place = root.joinpath(*(part for part in parts if part))
                for file in (place.with_suffix(".py"), place / "__init__.py"):
                    if file.is_file():
                        yield file


def distances(start: Path, graph: Mapping[Path, Sequence[Path]]) -> dict[Path, int]:
    """Steps of imports from a file to every module that it reaches."""
    found, reached = {start: 0}, [start]
    for file in reached:  # grows while it is walked
        for module in graph.get(file, ()):
            if module not in found:
                found[module] = found[file] + 1
                reached.append(module)
    return found


def touching(most: int) -> dict[Path, list[str]]:
    """Module -> test files that import it, by the fewest steps and then the smallest first."""
    files = [
        p
        for name in (*PACKAGES, "cybership", "benchmarks", "tests")
        for p in ROOT.glob(f"{name}/**/*.py")
    ]
    graph = {p: list(dict.fromkeys(imported(p))) for p in files}
    ranked: dict[Path, list[tuple[int, int, str]]] = {}
    for test in sorted(ROOT.glob("tests/test_*.py")):
        for module, steps in distances(test, graph).items():
            if steps:
                row = (steps, test.stat().st_size, str(test.relative_to(ROOT)))
                ranked.setdefault(module, []).append(row)
    return {module: [name for *_, name in sorted(rows)[:most]] for module, rows in ranked.items()}


def fails(copy: Path, test: str, seconds: float) -> bool:
    """Whether a test file fails in the copy, or does not end."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-m",
        "not slow",
        test,
    ]
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, timeout=seconds, check=False
        )
    except subprocess.TimeoutExpired:
        return True
    return done.returncode not in (0, 5)  # 5: all of its tests are slow


def fate(mutant: Mutant, copy: Path, tests: Sequence[str], seconds: float) -> str:
    """What becomes of a mutant."""
    if not tests:
        return UNTESTED
    target = copy / mutant.module
    whole = target.read_text(encoding="utf-8")
    target.write_text(mutant.text, encoding="utf-8")
    try:
        return KILLED if any(fails(copy, test, seconds) for test in tests) else SURVIVED
    finally:
        target.write_text(whole, encoding="utf-8")


def is_equivalent(mutant: Mutant, known: Sequence[Mapping[str, str]]) -> bool:
    """Whether the list says, with a reason, that no test can tell a mutant from the code."""
    return any(
        row["module"] == mutant.module.as_posix() and row["after"] == mutant.after and row["reason"]
        for row in known
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw, test, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "packages", nargs="*", default=PACKAGES, metavar="PACKAGE", help="or FILE.py (all)"
    )
    parser.add_argument("--mutants", type=int, default=300, help="of each package (300)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    parser.add_argument(
        "--tests", type=int, default=8, help="test files tried for a mutant, at most (8)"
    )
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds of a test file (300)")
    options = parser.parse_args(arguments)
    tests, known = touching(options.tests), tomllib.loads(EQUIVALENT.read_text("utf-8"))["mutant"]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*LEFT_OUT))
        broken: dict[str, bool] = {}
        for package in options.packages:
            place = ROOT / package
            files = [place] if place.is_file() else sorted(place.glob("**/*.py"))
            every, drawn = draw(files, options.mutants, options.seed)
            fates: Counter[tuple[str, str]] = Counter()
            for mutant in drawn:
                each = tests.get(ROOT / mutant.module, [])
                for test in each:
                    if test not in broken:
                        broken[test] = fails(copy, test, options.timeout)
                sound = [test for test in each if not broken[test]]
                came = (
                    SAME if is_equivalent(mutant, known) else fate(mutant, copy, sound, options.timeout)
                )
                fates[mutant.module.as_posix(), came] += 1
                if came in (SURVIVED, UNTESTED):
                    print(
                        f"{came}: {mutant.module.as_posix()}\n  - {mutant.before}\n  + {mutant.after}",
                        flush=True,
                    )
            print_table(package, every, fates)
        if any(broken.values()):
            print("fail without any mutant, left out: " + ", ".join(t for t, b in broken.items() if b))


def print_table(package: str, every: int, fates: Mapping[tuple[str, str], int]) -> None:
    """Killed over made by module."""
    modules = sorted({module for module, _ in fates})
    count = Counter[str]()
    for (_, came), n in fates.items():
        count[came] += n
    print(f"\n{package}: {sum(count.values())} of {every} mutants; {dict(count)}")
    for module in modules:
        made = sum(n for (m, _), n in fates.items() if m == module)
        print(f"  {fates.get((module, KILLED), 0)} / {made}  {module}")


if __name__ == "__main__":
    main()
