"""What changes with each constant at half and at double? ``python -m benchmarks.sensitivity``.

Every constant of docs/constants.md is halved and doubled, one at a time. Constants of rooms after the
preparation are tried on prepared runs that are kept, the others on measured runs. A second pass takes
those that change most to whole diagnoses of other problems.
"""

import argparse
import csv
import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from cosim import atomic_write
from cosim.command import INTERRUPTED, command_parser, run_command, whole_number
from studies.study_command import progress

from ..constants import PACKAGE, constants, deciding
from .changed_constant import DOUBLE, HALF, import_changed, names_of

OUT = Path("results") / "sensitivity"
AFTER_PREPARATION = ("search", "assessment", "verdict", "session")  # rooms that get prepared runs
LIMIT = 900  # s, for one answer: many times what any takes
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CLOSE = 0.01  # relative change of a held-out error that counts
KEY = ["seed", "constant", "factor"]
COLUMNS = [*KEY, "problem", "verdict", "sets", "error"]
COUNTED = ["verdicts", "sets", "errors"]


class Task(NamedTuple):
    """A constant and its factor, "" and 1 for all constants as they are, on problems of a seed.

    The first pass has the seed 0, the second 1.
    """

    seed: int
    constant: str
    factor: float

    @property
    def prepared(self) -> bool:
        """Whether prepared runs serve: in the first pass, for rooms after the preparation."""
        room = self.constant.partition(":")[0].split(".")[1:2]
        return self.seed == 0 and (not room or room[0] in AFTER_PREPARATION)


def version() -> str:
    """Of the code that answers: prepared runs and answers of another one do not count."""
    folders = PACKAGE, PACKAGE.parent / "fmus"
    paths = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:12]


def answer_one(seed: int, constant: str, factor: float, problems: Sequence[str], out: str) -> None:
    """Print the answers of a task, a line of JSON each; in a process of its own."""
    if constant:
        import_changed(constant, factor)
    from .saved_evidence import answer

    folder = Path(out).parent / f"problems{seed}"
    evidence = Path(out) / "prepared" if Task(seed, constant, factor).prepared else None
    signal.signal(signal.SIGALRM, too_long)
    for name in problems:
        signal.alarm(LIMIT)
        try:
            found = list(answer(name, folder, evidence))
        except Exception as error:  # nothing works with this value
            found = [f"failed: {error!r}", "", float("nan")]
        signal.alarm(0)
        print(json.dumps([name, *found]), flush=True)


def too_long(number: int, frame: object) -> None:
    raise TimeoutError(f"no answer in {LIMIT} s")


def work(task: Task, problems: Sequence[str], out: Path, keep: Callable[[list], None]) -> None:
    """Let another process answer problems, and keep each answer when it is there."""
    given = json.dumps([*task, problems, str(out)])
    command = [sys.executable, "-m", "benchmarks.sensitivity", "--one", given]
    env = os.environ | dict.fromkeys(THREADS, "1")
    left = list(problems)
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) as process:
        try:
            for line in process.stdout or ():
                name, *answer = json.loads(line)
                left.remove(name)
                keep([*task, name, *answer])
            if process.wait() not in (0, INTERRUPTED):  # an exception on import
                for name in left:
                    keep([*task, name, "failed", "", float("nan")])
        finally:
            process.kill()


def run(tasks: Sequence[Task], problems: Sequence[str], out: Path, jobs: int) -> None:
    """Answer what is not in the table yet, several tasks at a time."""
    path = out / "answers.csv"
    rows = read(path)
    done = set(zip(*(rows[c] for c in [*KEY, "problem"]), strict=True))
    left = {task: [p for p in problems if (*task, p) not in done] for task in tasks}
    with path.open("a", encoding="utf-8", newline="") as file, ThreadPoolExecutor(jobs) as pool:
        writer = csv.writer(file)
        if not path.stat().st_size:
            writer.writerow(COLUMNS)
        with progress(sum(map(len, left.values())), "answers") as advance:

            def keep(row: list) -> None:
                writer.writerow(row)
                file.flush()
                advance()

            futures = [pool.submit(work, t, names, out, keep) for t, names in left.items() if names]
            try:
                for future in as_completed(futures):
                    future.result()
            finally:
                pool.shutdown(wait=False, cancel_futures=True)


def read(path: Path) -> pd.DataFrame:
    """The answers so far."""
    if not path.is_file():
        return pd.DataFrame(columns=COLUMNS)
    return pd.read_csv(path, keep_default_na=False, na_values={"error": [""]})


def summary(answers: pd.DataFrame, seed: int) -> pd.DataFrame:
    """For each constant, how many verdicts, sets and held-out errors change at half and at double.

    Args:
        answers: rows with :data:`COLUMNS`.
        seed: of the pass.

    Returns:
        Index: the constants, those that change most first. Columns: (count, factor).
    """
    mine = answers[answers["seed"] == seed].astype({"error": float})
    usual = mine[mine["constant"] == ""].set_index("problem")
    tried = mine[(mine["constant"] != "") & mine["problem"].isin(usual.index)]
    before = usual.loc[tried["problem"]].set_index(tried.index)
    for count, column in zip(COUNTED[:2], COLUMNS[4:6], strict=True):
        tried = tried.assign(**{count: tried[column] != before[column]})
    moved = (tried["error"] - before["error"]).abs()
    none = tried["error"].isna() & before["error"].isna()
    tried = tried.assign(errors=~(moved <= CLOSE * before["error"]) & ~none)
    counts = tried.groupby(["constant", "factor"])[COUNTED].sum().unstack(fill_value=0)
    order = counts.sum(axis=1).sort_values(ascending=False, kind="stable").index
    return counts.loc[order].sort_index(axis=1, level=1, sort_remaining=False)


def markdown(counts: pd.DataFrame, problems: int) -> str:
    """The summary as a table."""
    heads = [f"{count} at {'half' if factor == HALF else 'double'}" for count, factor in counts.columns]
    lines = [f"Of {problems} problems, those with another answer:\n"]
    lines += [f"| constant | {' | '.join(heads)} |", "|---" + "|--:" * len(heads) + "|"]
    lines += [f"| {name} | {' | '.join(map(str, row))} |" for name, *row in counts.itertuples()]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    if options.one:
        answer_one(*json.loads(options.one))
        return 0
    if options.evidence is not None:
        from .on_evidence import changes, read

        for name, half, double in changes(read(options.evidence)):
            print(f"{name}: {half} at half, {double} at double")
        return 0
    from .saved_evidence import make, prepare, problem_names

    names = [name for c in deciding(constants(PACKAGE)) for name in names_of(c)]
    names = [n for n in names if not options.only or any(each in n for each in options.only)]
    problems, out = problem_names(options.quick), options.out / version()
    out.mkdir(parents=True, exist_ok=True)
    for seed in (0, 1) if options.whole else (0,):
        make(problems, seed, options.out / f"problems{seed}")
        if seed == 0:
            for problem in problems:
                prepare(problem, options.out / "problems0", out / "prepared")
        else:
            names = summary(read(out / "answers.csv"), 0).index.tolist()[: options.whole]
        tasks = [Task(seed, "", 1.0), *(Task(seed, n, f) for n in names for f in (HALF, DOUBLE))]
        try:
            run(tasks, problems, out, options.jobs)
        finally:
            counts = summary(read(out / "answers.csv"), seed)
            with atomic_write(out / f"summary{seed}.md") as part:
                part.write_text(markdown(counts, len(problems)), encoding="utf-8")
    print(out)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "benchmarks.sensitivity",
        "Halve and double each constant that acts on a verdict, and count what changes.",
        "examples:\n"
        "  python -m benchmarks.sensitivity --quick --only LEAST_FALL verdict. --whole 0\n"
        "Writes answers.csv, summary0.md and summary1.md to DIR/VERSION, for each version of the code.\n"
        "After Ctrl-C the same command goes on.\n"
        "exit codes: 0 done, 2 bad input, 3 failed, 130 interrupted",
    )
    parser.add_argument(
        "--only", nargs="+", metavar="TEXT", help="constants whose module:name has it (all)"
    )
    parser.add_argument("--quick", action="store_true", help="three problems in place of sixteen")
    whole = "constants for the second pass (20)"
    parser.add_argument("--whole", type=whole_number(0), default=20, metavar="N", help=whole)
    usual = os.cpu_count()
    parser.add_argument("--jobs", type=whole_number(1), default=usual, metavar="N", help=f"({usual})")
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"for results ({OUT})")
    parser.add_argument(
        "--evidence",
        type=Path,
        metavar="FILE.csv",
        help="table of hidden effects: try the verdict's constants on its findings, and nothing else",
    )
    parser.add_argument("--one", help=argparse.SUPPRESS)
    return parser


if __name__ == "__main__":
    run_command(main)
