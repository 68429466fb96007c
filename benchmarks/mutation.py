"""Do the tests fail where the code is wrong? ``python -m benchmarks.mutation --mutants 60 --seed 2046``.

Mutants are drawn at random lines of all packages (:mod:`.line_mutants`). Each is judged by pytest in a
process of its own, on a copy of the project that has the changed file: the quick tests of the nearest
files (:mod:`.near_tests`) run until one fails or the time is over. A test that fails on the unchanged
copy, too, judges nothing.

A mutant that survives may still be detected by a test further away, or by a slow one (``--slow``,
``--tests``); ``--again`` judges the survivors of the log once more, on the present code.
``benchmarks/equivalent_mutants.toml`` names mutants that no test can detect. Needs pytest-timeout.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import tomllib
from scipy.stats import binomtest

from benchmarks.line_mutants import PACKAGES, ROOT, Mutant, again, draw
from benchmarks.near_tests import FARTHEST, WHOLE, Nearness, around

EQUIVALENT = ROOT / "benchmarks" / "equivalent_mutants.toml"
KILLED, SURVIVED, SAME, OPEN = "killed", "survived", "equivalent", "not judged"
LATE = "time over"  # a survivor whose tests did not end
FILES = 8  # the nearest, which run; chosen: they hardly ever end within the time
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
    """Judges mutants by the tests of a copy of the project.

    Args:
        copy: folder of the copy.
        seconds: wall time of a mutant.
        marks: arguments by which pytest selects tests.
        wanted: expression that the path of a test file has to contain.
    """

    def __init__(self, copy: Path, seconds: float, marks: Sequence[str], wanted: str) -> None:
        self.copy, self.seconds, self.marks, self.wanted = copy, seconds, marks, wanted
        self.near = Nearness()
        self._sound: dict[str, bool] = {}

    def fate(self, m: Mutant) -> tuple[str, str]:
        """What becomes of a mutant, and by which test or files."""
        files = self._files(m)
        if not files:
            return OPEN, "no test file imports or names it"
        target = self.copy / m.module
        whole = target.read_text(encoding="utf-8")
        target.write_text(m.text, encoding="utf-8")
        try:
            outcome = self._tested(files)
        finally:
            target.write_text(whole, encoding="utf-8")
        if outcome.code in (pytest.ExitCode.OK, None):
            return LATE if outcome.code is None else SURVIVED, " ".join(files)
        if outcome.code == pytest.ExitCode.NO_TESTS_COLLECTED:
            return OPEN, "no test of these files runs"
        test = outcome.failed or files[0]
        if not self._passes(test):
            return OPEN, f"{test} fails on the unchanged code, too"
        return KILLED, test

    def _files(self, m: Mutant) -> list[str]:
        names = around(m)
        ranked = sorted(
            (self.near(m, names, file), len(text), file) for file, text in self.near.texts.items()
        )
        near = [file for rank, _, file in ranked if rank < FARTHEST or self.wanted]
        found = [file for file in near if re.search(self.wanted, file)][:FILES]
        whole = WHOLE.get(m.package, "")
        return found if self.wanted or not whole or whole in found else [*found[: FILES - 1], whole]

    def _passes(self, test: str) -> bool:
        """Whether a test, or a file, passes on the unchanged copy."""
        if test not in self._sound:
            self._sound[test] = self._tested([test]).code == pytest.ExitCode.OK
        return self._sound[test]

    def _tested(self, tests: Sequence[str]) -> Outcome:
        environment = os.environ | {"PYTHONPATH": str(self.copy), "PYTHONDONTWRITEBYTECODE": "1"}
        with subprocess.Popen(
            [*PYTEST, *self.marks, *tests], cwd=self.copy, env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True,
        ) as process:  # fmt: skip
            try:
                told, _ = process.communicate(timeout=self.seconds)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, 9)
                return Outcome(None, "")
        fails = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", told, re.MULTILINE)  # ids have blanks
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
        killed, made = fates[name][KILLED], fates[name].total() - fates[name][SAME] - fates[name][OPEN]
        low, high = binomtest(killed, made).proportion_ci() if made else (0.0, 1.0)
        interval = f"{100 * low:.0f} to {100 * high:.0f} %"
        late = f"{fates[name][LATE]} of the survivors before all their tests had run"
        rest = f"{late}, {fates[name][SAME]} equivalent, {fates[name][OPEN]} not judged"
        yield f"{name}: {killed} / {made} ({interval}), {rest}"


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
        marks = [] if options.slow else ["-mnot slow"]
        judge = Judge(copy, options.seconds, marks, options.tests)
        for m in mutants:
            fate, by = judge.fate(m)
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
    parser.add_argument("--slow", action="store_true", help="slow tests, too")
    parser.add_argument(
        "--tests", default="", metavar="REGEX", help="only test files with this in their path"
    )
    parser.add_argument(
        "--again", action="store_true", help="the survivors of the log, on the present code"
    )
    parser.add_argument("--out", type=Path, default=Path("results/mutation"), help="folder of the logs")
    return parser


if __name__ == "__main__":
    main()
