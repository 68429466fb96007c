"""Do the tests fail where the code is wrong? ``python -m benchmarks.mutation``.

Seeded mutants of each package (mutmut's operators on what stands in functions, texts left out). The
quick tests run once with coverage, which tells the tests that execute a line; each mutant runs those of
its line in a process of its own, the quickest of every test function first, until one fails. One that no
test kills, and that ``benchmarks/equivalent_mutants.toml`` does not call equivalent, survives.

Needs ``pip install -e ".[dev]" --group mutation`` and a system that can fork. The log has each mutant as
it is judged; what stands there is not done again. ``--again`` takes its survivors, where they exist.
"""

import argparse
import importlib
import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from itertools import islice, repeat, starmap
from pathlib import Path
from typing import Any, NamedTuple

import libcst
import pytest
from mutmut.mutation.file_mutation import Mutation, create_mutations, deep_replace
from scipy.stats import binomtest

from benchmarks.covering_tests import Covering, copied

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
PACKAGES = ("fmus", "fmucheck", "cosim", "diagnosis", "studies", "thesis")
EQUIVALENT = ROOT / "benchmarks" / "equivalent_mutants.toml"
# What the tests import that is not ours: taken over by every process that is forked.
LIBRARIES = (
    *("fmpy.fmi2", "hypothesis", "jinja2", "matplotlib.pyplot", "numpy", "orjson", "pandas", "pydantic"),
    *("pyarrow.parquet", "pythonfmu.builder", "rich.progress", "scipy.optimize", "scipy.signal"),
    *("scipy.stats", "sklearn.cross_decomposition", "sklearn.decomposition"),
)
# Package -> those that may import it; cosim and fmus know nothing of each other.
USERS = {
    "thesis": ("thesis", "benchmarks"),
    "studies": ("studies", "thesis", "benchmarks"),
    "diagnosis": ("diagnosis", "studies", "thesis", "benchmarks", "cybership"),
    "cosim": ("cosim", "diagnosis", "studies", "thesis", "benchmarks", "cybership"),
    "fmucheck": ("fmucheck", "fmus"),
    "fmus": ("fmus", "fmucheck", "diagnosis", "studies", "thesis", "benchmarks", "cybership"),
}
KILLED, SURVIVED, SAME, UNTESTED, GONE = "killed", "survived", "equivalent", "no test", "gone"
STRICT = r",?\s*strict=\w+,?"
FIRST = 4.0  # s, the tests that are tried before all others are collected
MEMORY = 8 * 2**30  # bytes of address space that a mutant may take


class Mutant(NamedTuple):
    """A changed module: path, first line that changes, number among its mutants, and the whole text."""

    module: str
    line: int
    number: int
    before: str
    after: str
    text: str

    def row(self) -> dict[str, Any]:
        """What the log tells of it."""
        return {k: v for k, v in self._asdict().items() if k != "text"}


def found(module: str) -> tuple[libcst.Module, list[Mutation]]:
    """A module's tree and its mutations, those of texts left out."""
    tree, every, *_ = create_mutations(module, (ROOT / module).read_text(encoding="utf-8"))
    texts = (libcst.BaseString, libcst.FormattedString)
    return tree, [m for m in every if not isinstance(m.original_node, texts)]


def made(module: str, tree: libcst.Module, number: int, mutation: Mutation) -> Mutant:
    """One mutant, as text."""
    changed = deep_replace(tree, mutation.original_node, mutation.mutated_node)
    assert isinstance(changed, libcst.Module)
    old, new = tree.code.splitlines(), changed.code.splitlines()
    first = next((i for i, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]), 0)
    return Mutant(module, first + 1, number, old[first].strip(), new[first].strip(), changed.code)


def draw(package: str, count: int, seed: int) -> tuple[int, list[Mutant]]:
    """How many mutants a package or a module has, and some of them."""
    place = ROOT / package
    files = [place] if place.is_file() else sorted(place.glob("**/*.py"))
    every = []
    for module in (file.relative_to(ROOT).as_posix() for file in files):
        tree, mutations = found(module)
        every += [(module, tree, number, mutation) for number, mutation in enumerate(mutations)]
    random.Random(seed).shuffle(every)
    drawn = (mutant for mutant in starmap(made, every) if not asserts(mutant))
    return len(every), list(islice(drawn, count))


def asserts(mutant: Mutant) -> bool:
    """Whether all that changes is ``strict`` of a zip, by which the code asserts what it knows."""
    return re.sub(STRICT, "", mutant.before) == re.sub(STRICT, "", mutant.after)


def drawn_again(rows: Sequence[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], Mutant | None]]:
    """Each row of a log with its mutant; None where the code has changed so that there is none."""
    for row in rows:
        module, lines = row["module"], (row["before"], row["after"])
        tree, mutations = found(module) if (ROOT / module).is_file() else (libcst.Module([]), [])
        order = sorted(range(len(mutations)), key=lambda number: abs(number - row["number"]))
        every = (made(module, tree, number, mutations[number]) for number in order)
        yield row, next((m for m in every if (m.before, m.after) == lines), None)


def key(row: dict[str, Any]) -> tuple[str, int, str, str]:
    """What tells mutants apart."""
    return row["module"], row["number"], row["before"], row["after"]


class Judge:
    """A plugin of pytest: notes the tests that fail, and hands over FMUs of unchanged source."""

    def __init__(self, killer: Path, cache: Path | None) -> None:
        self.killer, self.cache = killer, cache

    @pytest.fixture(scope="session", autouse=True)
    def _fmus_of_unchanged_source(self, tmp_path_factory):
        if self.cache is not None:
            shutil.copytree(self.cache, tmp_path_factory.getbasetemp() / "cache", copy_function=os.link)

    def pytest_runtest_logreport(self, report):
        if report.failed:
            with open(self.killer, "a", encoding="utf-8") as file:
                file.write(f"{report.nodeid}\n")


def loaded(copies: Path) -> Path:
    """This process' copy of the project, all modules of which it has imported."""
    copy = copies / str(os.getpid()) / "copy"
    if copy.exists():
        return copy
    copied(ROOT, copy)
    os.chdir(copy)
    sys.path[0], sys.dont_write_bytecode = str(copy), False
    for path in sorted(path for package in PACKAGES for path in Path(package).glob("**/*.py")):
        if path.name not in ("__init__.py", "__main__.py"):
            with suppress(Exception):  # the tests that need it fail without a mutant, too
                importlib.import_module(".".join(path.with_suffix("").parts))
    return copy


def tested(
    copy: Path, killer: Path, cache: Path | None, changed: str, seconds: int, arguments: Sequence[str]
) -> None:
    """Run pytest in this process, which was forked for it; what may use the changed package is new."""
    import resource

    os.setsid()
    quiet = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(quiet, stream)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    for name in [n for n in sys.modules if n.partition(".")[0] in USERS[changed]]:
        del sys.modules[name]
    os.environ["PYTHONPATH"] = str(copy)
    without = [f"-pno:{plugin}" for plugin in ("cacheprovider", "pytest_cov", "xdist")]
    options = ["-q", "--assert=plain", "-mnot slow", f"--basetemp={copy.parent / 'session'}"]
    os._exit(pytest.main([*without, *options, *arguments], plugins=[Judge(killer, cache)]))


def fails(
    copy: Path, tests: Sequence[str], seconds: float, cache: Path | None, changed: str, stop: str = "-x"
) -> list[str]:
    """The tests that fail in the copy, a package of which has changed; none if all pass.

    They have some time of the processor [s], and ten times of it by the clock.
    """
    killer = copy.parent / "killer"
    killer.unlink(missing_ok=True)
    process = multiprocessing.get_context("fork").Process(
        target=tested, args=(copy, killer, cache, changed, int(seconds), [stop, *tests])
    )
    process.start()
    process.join(10.0 * seconds)
    code = process.exitcode
    with suppress(ProcessLookupError):
        os.killpg(process.pid or 0, signal.SIGKILL)
    process.join()
    if killer.exists():
        return killer.read_text(encoding="utf-8").split("\n")[:-1]
    if code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        return []
    files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
    if code == pytest.ExitCode.USAGE_ERROR and list(tests) != files:  # a test is called otherwise now
        return fails(copy, files, 4.0 * seconds, cache, changed, stop)
    return ["does not end" if code in (None, -signal.SIGXCPU) else f"exit code {code}"]


def judged(
    mutant: Mutant, tests: Sequence[tuple[str, float]], cache: Path | None, limit: float, copies: Path
) -> dict[str, Any]:
    """What becomes of a mutant by its tests, each with its seconds, in a limit of processor time [s]."""
    began, copy = time.monotonic(), loaded(copies)
    target, package = copy / mutant.module, mutant.module.partition("/")[0]
    whole, then = target.read_text(encoding="utf-8"), target.stat().st_mtime
    batches, spent = ([], []), 0.0
    for test, seconds in tests:
        spent += seconds
        batches[spent > FIRST].append(test)
    target.write_text(mutant.text, encoding="utf-8")
    os.utime(target, (then, random.uniform(1e9, 1.2e9)))  # byte code is told apart by this time
    try:
        found = (fails(copy, each, limit, cache, package) for each in batches if each)
        killers = next(filter(None, found), [])
    finally:
        target.write_text(whole, encoding="utf-8")
        os.utime(target, (then, then))
    fate = KILLED if killers else SURVIVED if tests else UNTESTED
    by = killers[0] if killers else len(tests)
    return {**mutant.row(), "fate": fate, "by": by, "seconds": round(time.monotonic() - began, 1)}


def unsound(tests: Sequence[str], copies: Path) -> list[str]:
    """Tests that fail in such a process without a mutant, too."""
    return fails(loaded(copies), tests, 3600.0, None, "fmus", "--maxfail=9999") if tests else []


def print_table(rows: Sequence[dict[str, Any]]) -> None:
    """Killed over made by module and package, with its exact 95 % interval, and the survivors."""
    listed = tomllib.loads(EQUIVALENT.read_text("utf-8"))["mutant"]
    known = {(each["module"], each["after"]) for each in listed if each["reason"]}
    fates: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        if row["fate"] == SURVIVED and (row["module"], row["after"]) in known:
            row = {**row, "fate": SAME}
        fates[row["module"]][row["fate"]] += 1
        fates[row["module"].partition("/")[0]][row["fate"]] += 1
        if row["fate"] in (SURVIVED, UNTESTED):
            print(
                f"{row['fate']}: {row['module']}:{row['line']}\n  - {row['before']}\n  + {row['after']}"
            )
    for name in sorted(fates):
        count = fates[name]
        rest = ", ".join(f"{n} {fate}" for fate, n in sorted(count.items()) if fate != KILLED)
        made, within = sum(count.values()) - count[GONE], ""
        if made and "/" not in name:
            low, high = binomtest(count[KILLED], made).proportion_ci()
            within = f" ({100 * low:.0f} to {100 * high:.0f} %)"
        print(f"{count[KILLED]} / {made}{within}  {name}  {rest}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the tests, draw, test, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "packages", nargs="*", default=PACKAGES, metavar="PACKAGE", help="or FILE.py (all)"
    )
    parser.add_argument("--mutants", type=int, default=300, help="of each package (300)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    parser.add_argument("--seconds", type=float, default=20.0, help="tests of a mutant, without it (20)")
    parser.add_argument("--limit", type=float, default=90.0, help="processor time of a mutant, s (90)")
    parser.add_argument("--processes", type=int, default=2, help="at the same time (2)")
    parser.add_argument("--out", type=Path, default=Path("results/mutation"), help="logs, and the tests")
    parser.add_argument("--again", action="store_true", help="the survivors of the log, not new mutants")
    options = parser.parse_args(arguments)
    out = options.out.resolve()
    covering = Covering(ROOT, out, options.processes)
    log = out / f"seed_{options.seed}.jsonl"
    rows = [json.loads(line) for line in log.read_text("utf-8").splitlines()] if log.exists() else []
    done = {key(row): row for row in rows}  # the last one of each
    places = tuple(
        (ROOT / package).resolve().relative_to(ROOT).as_posix() for package in options.packages
    )
    mutants: list[Mutant] = []
    if options.again:
        alive = [r for r in done.values() if r["fate"] in (SURVIVED, UNTESTED)]
        for row, mutant in drawn_again([row for row in alive if row["module"].startswith(places)]):
            if mutant is None:
                done[key(row)] = {**row, "fate": GONE}
            else:
                mutants.append(mutant._replace(number=row["number"]))
    else:
        for package in places:
            every, drawn = draw(package, options.mutants, options.seed)
            print(f"{package}: {len(drawn)} of {every} mutants", flush=True)
            mutants += [mutant for mutant in drawn if key(mutant.row()) not in done]
        random.Random(0).shuffle(mutants)  # what is done so far is a sample of all packages
    for name in LIBRARIES:
        importlib.import_module(name)
    with (
        tempfile.TemporaryDirectory() as folder,
        open(log, "a", encoding="utf-8") as file,
        ProcessPoolExecutor(options.processes, multiprocessing.get_context("fork")) as pool,
    ):
        copies = Path(folder)
        while mutants:
            tasks = [
                pool.submit(judged, m, *covering.tests(*m[:2], options.seconds), options.limit, copies)
                for m in mutants
            ]
            for task in as_completed(tasks):
                row = task.result()
                done[key(row)] = row
                file.write(json.dumps(row) + "\n")
                file.flush()
            killers = sorted({done[key(m.row())]["by"] for m in mutants} & covering.seconds.keys())
            parts = [killers[k :: options.processes] for k in range(options.processes)]
            covering.unsound |= {
                test for tests in pool.map(unsound, parts, repeat(copies)) for test in tests
            }
            mutants = [m for m in mutants if done[key(m.row())]["by"] in covering.unsound]
    print_table([row for row in done.values() if row["module"].startswith(places)])


if __name__ == "__main__":
    main()
