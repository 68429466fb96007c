"""Do the tests fail where the code is wrong? ``python -m benchmarks.mutation --mutants 60 --seed 2046``.

Mutants are drawn at random lines of all packages (:mod:`.line_mutants`). Each is judged by pytest in a
process of its own, on a copy of the project that has the changed file: the quick tests that execute the
line (:mod:`.line_map`) run until one fails or the time is over. A mutant of a line that no test executes
survives. A test that fails on the unchanged copy, too, judges nothing.

The map of lines and tests is made once for a commit. ``--slow`` runs the slow tests in place of the
quick ones, with a map of their own; ``--again`` judges the survivors of the log once more, on the
present code. ``benchmarks/equivalent_mutants.toml`` names mutants that no test can detect. Needs
pytest-timeout and pytest-xdist.
"""

import argparse
import compileall
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from scipy.stats import binomtest

from benchmarks.line_map import WORKERS, LineMap, measure
from benchmarks.line_mutants import PACKAGES, ROOT, Mutant, again, draw

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

EQUIVALENT = ROOT / "benchmarks" / "equivalent_mutants.toml"
KILLED, SURVIVED, SAME = "killed", "survived", "equivalent"
LATE = "time over"  # a survivor whose tests did not end
ALONE = 45  # s of one test, after which it does not end
PYTEST = (
    sys.executable, "-m", "pytest", "-q", "-x", "-rfE", "--tb=no", "--assert=plain",
    "-pno:cacheprovider", "-pno:xdist", f"--timeout={ALONE}",
)  # fmt: skip


class Outcome(NamedTuple):
    """How tests ended: exit code of pytest, None where the time was over; the test that failed."""

    code: int | None
    failed: str


class Judge:
    """Judges mutants by the tests of copies of the project.

    Args:
        copy: folder of the unchanged copy.
        lines: which tests execute a line.
        seconds: wall time of a mutant.
    """

    def __init__(self, copy: Path, lines: LineMap, seconds: float) -> None:
        self.copy, self.lines, self.seconds = copy, lines, seconds
        self._sound: dict[str, bool] = {}

    def fate(self, m: Mutant) -> tuple[str, str]:
        """What becomes of a mutant, and by which test or how many."""
        tests = self.lines.tests(m.module, m.line)
        count = len(tests)
        with tempfile.TemporaryDirectory() as folder:
            changed = shutil.copytree(self.copy, Path(folder) / "copy")
            (changed / m.module).write_text(m.text, encoding="utf-8")
            while tests:
                outcome = self._tested(changed, tests)
                if outcome.code == pytest.ExitCode.USAGE_ERROR:  # cases have other names than on the map
                    whole = dict.fromkeys(test.partition("[")[0] for test in tests)
                    outcome = self._tested(changed, [*whole])
                if outcome.code in (pytest.ExitCode.OK, None):
                    return LATE if outcome.code is None else SURVIVED, f"{count} tests"
                failed = outcome.failed or tests[0]
                if self._passes(failed):
                    return KILLED, failed
                tests = [test for test in tests if not test.startswith(failed)]
        return SURVIVED, "no test runs it"

    def _passes(self, test: str) -> bool:
        """Whether a test, or a file, passes on the unchanged copy."""
        if test not in self._sound:
            self._sound[test] = self._tested(self.copy, [test]).code == pytest.ExitCode.OK
        return self._sound[test]

    def _tested(self, copy: Path, tests: Sequence[str]) -> Outcome:
        environment = os.environ | {"PYTHONPATH": str(copy)}
        with tempfile.NamedTemporaryFile("w", encoding="utf-8") as chosen:  # too many for a command line
            chosen.write("\n".join(tests))
            chosen.flush()
            with subprocess.Popen(
                [*PYTEST, f"@{chosen.name}"], cwd=copy, env=environment, text=True,
                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True,
            ) as process:  # fmt: skip
                try:
                    stated, _ = process.communicate(timeout=self.seconds)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, 9)
                    return Outcome(None, "")
        fails = re.findall(
            r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", stated, re.MULTILINE
        )  # ids have blanks
        return Outcome(process.returncode, fails[0] if fails else "")


def table(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Survivors, and killed over judged by package, with its exact 95 % interval."""
    listed = tomllib.loads(EQUIVALENT.read_text("utf-8"))["mutant"]
    known = {(each["module"], each["after"]) for each in listed if each["reason"]}
    fates: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        same = row["fate"] in (SURVIVED, LATE) and (row["module"], row["after"]) in known
        fate = SAME if same else row["fate"]
        for name in (row["module"].partition("/")[0], "all"):
            fates[name][fate] += 1
        if fate in (SURVIVED, LATE):
            yield f"{row['module']}:{row['line']}\n  - {row['before']}\n  + {row['after']}"
    for name in (*(p for p in PACKAGES if p in fates), "all"):
        killed, made = fates[name][KILLED], fates[name].total() - fates[name][SAME]
        low, high = binomtest(killed, made).proportion_ci() if made else (0.0, 1.0)
        interval = f"{100 * low:.0f} to {100 * high:.0f} %"
        late = f"{fates[name][LATE]} of the survivors before all their tests had run"
        yield f"{name}: {killed} / {made} ({interval}), {late}, {fates[name][SAME]} equivalent"


def main() -> None:
    """Draw, judge, print."""
    options = _parser().parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out.resolve() / f"seed_{options.seed}.jsonl"
    done = _read(log)
    if options.again:
        alive = [key for key, row in done.items() if row["fate"] != KILLED]
        mutants = [m for key in alive if (m := again(*key))]
    else:
        drawn = draw(options.mutants, options.seed, options.packages)
        mutants = [m for m in drawn if (m.module, m.before, m.after) not in done]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        made = shutil.ignore_patterns("__pycache__", ".*", "*.fmu", "*.egg-info")
        top = {str(ROOT): {"results", "site"}}  # folders of the project itself
        shutil.copytree(ROOT, copy, ignore=lambda at, names: {*made(at, names), *top.get(at, ())})
        head = subprocess.check_output(["git", "rev-parse", "--short=8", "HEAD"], cwd=ROOT, text=True)
        lines = options.out.resolve() / f"map_{head.strip()}_{'slow' if options.slow else 'quick'}"
        if not lines.exists():
            measure(copy, lines, "slow" if options.slow else "not slow")
        if options.map:
            return
        judge = Judge(copy, LineMap(lines), options.seconds)
        compileall.compile_dir(copy, quiet=2)  # once for all mutants
        with ThreadPoolExecutor(WORKERS) as pool:
            for m, (fate, by) in zip(mutants, pool.map(judge.fate, mutants), strict=True):
                row = {k: v for k, v in m._asdict().items() if k != "text"} | {"fate": fate, "by": by}
                with log.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
                print(f"{fate:10} {m.module}:{m.line}  {by}", flush=True)
    print(*table([*_read(log).values()]), sep="\n")


def _read(log: Path) -> dict[tuple[str, str, str], dict[str, Any]]:
    """The last row of each mutant of a log."""
    rows = map(json.loads, log.read_text("utf-8").splitlines()) if log.exists() else ()
    return {(r["module"], r["before"], r["after"]): r for r in rows}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "packages", nargs="*", default=PACKAGES, metavar="PACKAGE", help="or FILE.py (all)"
    )
    parser.add_argument("--mutants", type=int, default=60, help="in all (60)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    parser.add_argument("--seconds", type=float, default=90.0, help="wall time of a mutant (90)")
    parser.add_argument("--slow", action="store_true", help="slow tests, in place of the quick ones")
    parser.add_argument("--map", action="store_true", help="only the map of lines and tests")
    parser.add_argument(
        "--again", action="store_true", help="the survivors of the log, on the present code"
    )
    parser.add_argument("--out", type=Path, default=Path("results/mutation"), help="folder of the logs")
    return parser


if __name__ == "__main__":
    main()
