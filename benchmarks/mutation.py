"""Do the tests fail where the code is wrong? ``python -m benchmarks.mutation --mutants 60 --seed 2046``.

Mutants are drawn at random lines of all packages (:mod:`.line_mutants`). pytest collects the quick tests
once. Each mutant is judged in a fork of that process, in which the functions of the module get the
changed code, and a copy of the project the changed file, for the processes that tests start. Tests run
in the order of how near they are to the changed line by imports and by the names of its function, class
and module, one case of each first, until one fails or the mutant has spent its processor time. What is
changed outside of the bodies of functions needs a new process, which runs the nearest files.

A mutant that survives may still be detected by a test further away, or by a slow one (``--slow``,
``--tests``); ``--again`` judges the survivors of the log once more, on the present code.
``benchmarks/equivalent_mutants.toml`` names mutants that no test can detect. Needs CPython 3.11 and a
system that forks.
"""

import argparse
import functools
import gc
import inspect
import json
import os
import re
import resource
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import types
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import tomllib
from scipy.stats import binomtest

from benchmarks.line_mutants import PACKAGES, ROOT, Mutant, again, draw
from benchmarks.near_tests import FARTHEST, FOUND, OURS, Nearness, around

EQUIVALENT = ROOT / "benchmarks" / "equivalent_mutants.toml"
KILLED, SURVIVED, SAME, OPEN = "killed", "survived", "equivalent", "not judged"
MEMORY = 8 * 2**30  # bytes of address space of a mutant
ALONE = 45  # s of processor time of one test, after which it does not end
# Pages that tests compare with the code, for what stands outside of functions.
PAGES = {
    "fmus": "tests/test_ship_files.py::test_the_page_of_parameters_has_the_start_values_of_the_code",
    "diagnosis": "tests/test_constants.py::test_the_page_is_current",
}
QUIET = ("-q", "--assert=plain", "-pno:cacheprovider", "-pno:xdist")


def functions(code: types.CodeType) -> Iterator[types.CodeType]:
    """The outermost functions of a module's code, those of classes included."""
    for c in code.co_consts:
        if isinstance(c, types.CodeType) and not c.co_name.startswith("<"):
            if c.co_flags & inspect.CO_NEWLOCALS:
                yield c
            else:
                yield from functions(c)


class Judge:
    """A plugin of pytest that judges mutants in place of a run of its tests."""

    def __init__(self, mutants: Sequence[Mutant], copy: Path, log: Path, options: Any) -> None:
        self.mutants, self.copy, self.log, self.options = mutants, copy, log, options
        self.near, self.seconds = Nearness(), {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Judge every mutant by the collected tests."""
        self.items = session.items
        self.texts = {
            i.nodeid: inspect.getsource(i.function) for i in self.items if hasattr(i, "function")
        }
        for name in ("fmus", "native"):  # what sessions share is made before the forks
            for item in [i for i in self.items if name in getattr(i, "fixturenames", ())][:1]:
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=self.items[-1])
        self._look_for_code()
        self.shared = Path(session.config._tmp_path_factory.getbasetemp())  # pyright: ignore
        later = []
        for m in self.mutants:
            names, inside = around(m)
            if inside:
                self._write(m, *self._changed(m, lambda m=m, names=names: self._forked(m, names)))
            else:
                later.append((m, names))
        for m, names in later:
            self._write(m, *self._changed(m, lambda m=m, names=names: self._anew(m, names)))
        return True

    def _look_for_code(self) -> None:
        """The functions of this process by their code, and what remembers results."""
        gc.unfreeze()
        self.code, self.caches = defaultdict(list), []
        for x in gc.get_objects():
            if isinstance(x, types.FunctionType):
                self.code[x.__code__.co_filename, x.__code__.co_qualname].append(x)
            elif isinstance(x, functools._lru_cache_wrapper) and x.__module__.partition(".")[0] in OURS:
                self.caches.append(x)
        gc.freeze()

    def _changed(self, m: Mutant, judge: Any) -> tuple[str, str]:
        """What becomes of a mutant, whose text is in the copy meanwhile."""
        target = self.copy / m.module
        whole, before = target.read_text(encoding="utf-8"), {p.name for p in self.shared.iterdir()}
        target.write_text(m.text, encoding="utf-8")
        try:
            return judge()
        finally:
            target.write_text(whole, encoding="utf-8")
            for path in self.shared.iterdir():  # what a mutant has made is not shared
                if path.name not in before and path.name != "cache":
                    shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()

    def _ordered(self, m: Mutant, names: Sequence[str]) -> list[pytest.Item]:
        cases: Counter[str] = Counter()
        found = []
        for n, item in enumerate(self.items):
            file, function = item.nodeid.partition("::")[0], item.nodeid.partition("[")[0]
            near = self.near(m, names, file, self.texts.get(item.nodeid, ""))
            if near < FARTHEST or self.options.tests:
                rank = near + 0.5 * min(cases[function], 5)
                found.append((rank, self.seconds.get(item.nodeid, 0.3), n, item))
            cases[function] += 1
        return [item for *_, item in sorted(found, key=lambda each: each[:3])]

    def _forked(self, m: Mutant, names: Sequence[str]) -> tuple[str, str]:
        """Fate and the test that fails, or how many ran, of a change in a function."""
        order = self._ordered(m, names)
        read, write = os.pipe()
        pid = os.fork()
        if not pid:
            os.close(read)
            try:
                self._run(m, order, write)
            except BaseException as error:
                os.write(write, f"error\t{error!r}\n".encode())
            os._exit(3)
        os.close(write)
        told, end = b"", time.monotonic() + 100.0 * self.options.cpu
        while (left := end - time.monotonic()) > 0.0 and select.select([read], [], [], left)[0]:
            if not (part := os.read(read, 65536)):
                break
            told += part
        with suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        os.close(read)
        lines = [line.split("\t") for line in told.decode(errors="replace").splitlines()]
        passed = {line[1]: float(line[2]) for line in lines if line[0] == "passed"}
        self.seconds |= passed
        fails = [line[1] for line in lines if line[0] == "failed"]
        if errors := [line[1] for line in lines if line[0] == "error"]:
            return OPEN, errors[0]
        if fails or not [line for line in lines if line[0] == "end"]:
            return KILLED, fails[0] if fails else "does not end"
        return SURVIVED, str(len(passed))

    def _run(self, m: Mutant, order: Sequence[pytest.Item], write: int) -> None:
        """In the fork: put the code in place, and run tests until one fails or the time is over."""
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        quiet = os.open(os.devnull, os.O_RDWR)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        out, path, failed = os.fdopen(write, "w", buffering=1), str(self.copy / m.module), []
        for code in functions(compile(m.text, path, "exec")):
            for function in self.code[path, code.co_qualname]:
                with suppress(ValueError):  # another one of that name
                    function.__code__ = code
        for cache in self.caches:
            cache.cache_clear()

        class Watch:
            def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
                failed.extend([report.nodeid] * report.failed)

        if order:
            order[0].config.pluginmanager.register(Watch())
        spent = 0.0
        for item, after in zip(order, [*order[1:], None], strict=True):
            began = sum(os.times()[:4])
            limit = int(sum(os.times()[:2])) + ALONE, resource.RLIM_INFINITY
            resource.setrlimit(resource.RLIMIT_CPU, limit)
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=after or item)
            if failed:
                out.write(f"failed\t{failed[0]}\n")
                break
            seconds = sum(os.times()[:4]) - began
            out.write(f"passed\t{item.nodeid}\t{seconds:.2f}\n")
            spent += seconds
            if spent > self.options.cpu:
                break
        out.write("end\n")
        out.flush()
        os._exit(0)

    def _anew(self, m: Mutant, names: Sequence[str]) -> tuple[str, str]:
        """The same of a change outside of functions: the page that shows it, then the nearest files."""
        near = sorted((self.near(m, names, file), len(t), file) for file, t in self.near.texts.items())
        files = [file for rank, _, file in near if rank < 4.0][:3]
        limit = round(10.0 + 3.0 * self.options.cpu)
        for tests in ([PAGES[m.package]] if m.package in PAGES else [], files):
            if tests:
                done = subprocess.run(
                    [
                        sys.executable,
                        "-m",
                        "pytest",
                        *QUIET,
                        "-x",
                        "-rfE",
                        "--tb=no",
                        *self.options.marks,
                        *tests,
                    ],
                    cwd=self.copy,
                    capture_output=True,
                    text=True,
                    check=False,
                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
                )
                fails = re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
                if fails or done.returncode in (
                    pytest.ExitCode.INTERRUPTED,
                    pytest.ExitCode.USAGE_ERROR,
                ):
                    return KILLED, fails[0] if fails else "cannot be imported"
        return SURVIVED, " ".join(files)

    def _write(self, m: Mutant, fate: str, by: str) -> None:
        row = {k: v for k, v in m._asdict().items() if k != "text"} | {"fate": fate, "by": by}
        with self.log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def table(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Survivors, and killed over judged by package, with its exact 95 % interval."""
    listed = tomllib.loads(EQUIVALENT.read_text("utf-8"))["mutant"]
    known = {(each["module"], each["after"]) for each in listed if each["reason"]}
    fates: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        same = row["fate"] == SURVIVED and (row["module"], row["after"]) in known
        fate = SAME if same else row["fate"]
        for name in (row["module"].partition("/")[0], "all"):
            fates[name][fate] += 1
        if fate == SURVIVED:
            yield f"{row['module']}:{row['line']}\n  - {row['before']}\n  + {row['after']}"
    for name in (*(p for p in PACKAGES if p in fates), "all"):
        killed, made = fates[name][KILLED], fates[name].total() - fates[name][SAME] - fates[name][OPEN]
        low, high = binomtest(killed, made).proportion_ci() if made else (0.0, 1.0)
        interval = f"{100 * low:.0f} to {100 * high:.0f} %"
        yield f"{name}: {killed} / {made} ({interval}), {fates[name][SAME]} equivalent"


def main() -> None:
    """Draw, judge, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "packages", nargs="*", default=PACKAGES, metavar="PACKAGE", help="or FILE.py (all)"
    )
    parser.add_argument("--mutants", type=int, default=60, help="in all (60)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    parser.add_argument(
        "--cpu", type=float, default=7.0, help="processor time of a mutant's tests, s (7)"
    )
    parser.add_argument("--slow", action="store_true", help="slow tests, too")
    parser.add_argument(
        "--tests", default="", metavar="REGEX", help="only test files with this in their path"
    )
    parser.add_argument(
        "--again", action="store_true", help="the survivors of the log, on the present code"
    )
    parser.add_argument("--out", type=Path, default=Path("results/mutation"), help="folder of the logs")
    options = parser.parse_args()
    options.marks = [] if options.slow else ["-mnot slow"]
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out.resolve() / f"seed_{options.seed}.jsonl"
    rows = [json.loads(line) for line in log.read_text("utf-8").splitlines()] if log.exists() else []
    done = {(r["module"], r["before"], r["after"]): r for r in rows}  # the last one of each
    if options.again:
        alive = [key for key, row in done.items() if row["fate"] in (SURVIVED, OPEN)]
        mutants = [m for key in alive if (m := again(*key))]
    else:
        drawn = draw(options.mutants, options.seed, options.packages)
        mutants = [m for m in drawn if (m.module, m.before, m.after) not in done]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        made = shutil.ignore_patterns("__pycache__", ".*", "*.fmu", "*.egg-info")
        top = {str(ROOT): {"results", "site"}}  # folders of the project itself
        shutil.copytree(ROOT, copy, ignore=lambda at, names: {*made(at, names), *top.get(at, ())})
        judge = Judge(mutants, copy, log, options)
        modules = {m.module for m in mutants}
        files = [
            f
            for f in judge.near.texts
            if any(judge.near.steps[m].get(f, FOUND) <= FOUND for m in modules)
        ]
        files = [f for f in files if re.search(options.tests, f)]
        os.chdir(copy)
        sys.path[:] = [str(copy), *(p for p in sys.path if Path(p or ".").resolve() != ROOT)]
        for name in [n for n in sys.modules if n.partition(".")[0] in OURS]:
            del sys.modules[name]
        os.environ["PYTHONPATH"] = str(copy)
        if mutants:
            pytest.main(
                [*QUIET, "-s", *options.marks, f"--basetemp={folder}/base", *files], plugins=[judge]
            )
        os.chdir(ROOT)
    rows = {
        (r["module"], r["before"], r["after"]): r
        for r in map(json.loads, log.read_text("utf-8").splitlines())
    }
    print(*table([*rows.values()]), sep="\n")


if __name__ == "__main__":
    main()
