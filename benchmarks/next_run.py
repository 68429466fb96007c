"""Does a designed run decide what a first run leaves open: ``python -m benchmarks.next_run``.

A cell is a ship with a hidden effect and coefficients up to 10 % wrong (:mod:`.hidden_effects`), after
one ellipse of 100 s at noise n4. Of the cells in a random order those count in which no cause reaches
95 %. Each then gets one run of some minutes of each kind, and the diagnosis of both runs judges it.
"""

import argparse
import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import cosim
import diagnosis
from cosim import InputError
from cosim.command import BAD_INPUT, command_parser, complain, run_command
from diagnosis import Model
from diagnosis.design import (
    DIMENSIONS,
    SURE,
    Designer,
    Knowledge,
    Limits,
    Question,
    ScoredPlan,
    checked,
    prepared,
    scenario_file,
    sequence,
    sure_of,
    write_run,
)
from studies.study_command import progress

from .hidden_effects.cells import PAIRS, Cell
from .hidden_effects.draw import SINGLE, Draw, draw
from .hidden_effects.manoeuvres import manoeuvres
from .hidden_effects.problems import pilots, plant
from .hidden_effects.simulated_runs import NOISE, scenario

KINDS = ("designed", "eight", "zig-zag", "random", "d-optimal")
FIRST, PRIOR, NOISY = 100.0, 0.1, "n4"  # s of the first run; as the plants of the benchmark; noise
COLUMNS = ("cell", "seed", "kind", "result", "confidence", "found", "sure", "half_width", "margin")
OPEN, RIGHT, WRONG = "open", "right", "wrong"
OUT = Path("results") / "next_run"


def order(seed: int) -> list[Cell]:
    """All cells of a seed in a random order."""
    every = [(e,) for e in SINGLE] + list(PAIRS)
    mixed = np.random.default_rng(seed).permutation(len(every))
    return [Cell(tuple(every[k]), NOISY, True, seed) for k in mixed]


def simulated(content: dict | Path, truth: Path, out: Path, seed: int) -> Path:
    """The log of a run of the true ship.

    Raises:
        InputError: the run failed.
    """
    result = cosim.simulate(content, out, [truth], seed=seed, log="compact", pictures=False)
    if result.status != "done":
        raise InputError(result.message)
    return out


def learned(q: Question, data: Sequence) -> dict:
    """What ``diagnosis.json`` holds after the runs."""
    return diagnosis.diagnose(data, prior=q.prior, model=q.start).content


def judged(content: Mapping, hidden: Sequence[Draw]) -> tuple[str, float, str, float]:
    """Right, wrong or open; largest confidence, what was found, half width of the first interval."""
    certain = [e for e in content["effects"] if (e["confidence"] or 0.0) >= SURE]
    first = max((e["confidence"] or 0.0 for e in content["effects"]), default=0.0)
    found = " + ".join(e["id"] for e in content["effects"])
    allowed = {i for d in hidden for i in (d.effect, *d.right)}
    wrong = any(e["id"] not in allowed for e in certain)
    right = sum(any(e["id"] in {d.effect, *d.right} for e in certain) for d in hidden) == len(hidden)
    spans = [c["ci95"] for e in certain for c in e["coefficients"].values() if c["ci95"]]
    width = 0.5 * (spans[0][1] - spans[0][0]) if spans else float("nan")
    return WRONG if wrong else RIGHT if right else OPEN, first, found, width


def chosen(d: Designer, k: Knowledge, kind: str, seed: int) -> ScoredPlan:
    """The run of a kind.

    Raises:
        InputError: none keeps the limits.
    """
    if kind in ("eight", "zig-zag"):
        return d.usual(k, kind)
    if kind == "random":
        rng = np.random.default_rng(seed)
        for _ in range(200):
            found = d.scored(k, sequence(rng.random(4 * DIMENSIONS), d.limits.seconds))
            if found.excess == 0.0:
                return found
        raise InputError("no random run keeps the limits")
    return d.search(k, seed)


def cell_rows(cell: Cell, folder: Path, kinds: Sequence[str], limits: Limits) -> list[dict]:
    """The rows of a cell: after the first run, and, where that is open, after one of each kind."""
    pilot = pilots([cell.seed], folder)[cell.seed]
    rng = cell.rng(1)
    hidden = [draw(e, rng, pilot, 1.0) for e in cell.effects]
    ship = plant(cell, hidden)
    if ship.other or ship.clock:
        return []
    parts = {"vessel": ship.vessel, "thrusters": ship.thrusters}
    values = {p: {n: cosim.Parameter(x) for n, x in v.items()} for p, v in parts.items()}
    with TemporaryDirectory() as scratch:
        work = Path(scratch)
        truth = work / "truth.ssv"
        cosim.write_parameters(truth, cosim.ParameterSet(values))
        ellipse = manoeuvres(cell.seed)[0]
        nominal = replace(ship, vessel={}, thrusters={}, clock=0.0)
        content = scenario(ellipse, nominal, NOISE[NOISY], cell.seed, Path()) | {"stop": FIRST}
        log = simulated(content, truth, work / "first", cell.seed)
        start = Model()
        data = diagnosis.load(log, model=start)
        q = Question(data, {}, start, PRIOR, limits)
        q = replace(q, content=learned(q, data))
        result, first, found, width = judged(q.content, hidden)
        base = {"cell": cell.name, "seed": cell.seed}
        row = {"result": result, "confidence": first, "found": found, "half_width": width}
        rows = [base | {"kind": "first"} | row]
        if first >= SURE or not (q.content["effects"] or q.content["possibilities"]):
            return rows
        for kind in kinds:
            criterion = kind if kind == "d-optimal" else "certainty"
            try:
                d, k = prepared(replace(q, criterion=criterion))
                scored = chosen(d, k, kind, cell.seed)
                run, *_ = checked(d, k, scored, cell.seed)
                sure = sure_of(k, run.gram, cell.seed)
                target = work / kind
                target.mkdir()
                write_run(d, run, 1, target, None)
                after = simulated(target / scenario_file(1), truth, target / "log", cell.seed + 1000)
                both = [*data, *diagnosis.load(after, model=start)]
                result, best, found, width = judged(learned(q, both), hidden)
                eta = both[-1].smoothed.eta[both[-1].known]
                margin = float(d.basin.margin(eta, d.outline).min())
            except InputError as error:
                rows.append(base | {"kind": kind, "result": f"failed: {error}"})
                continue
            row = {"result": result, "confidence": best, "found": found, "sure": sure}
            rows.append(base | {"kind": kind} | row | {"half_width": width, "margin": margin})
    return rows


def summary(rows: Sequence[dict]) -> str:
    """How many cells each kind of run decides, as a Markdown table."""
    lines = [
        "| run | cells | right | wrong | open | failed | least margin [m] |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    opened = {(r["cell"], r["seed"]) for r in rows if r["kind"] != "first"}
    for kind in dict.fromkeys(r["kind"] for r in rows):
        mine = [r for r in rows if r["kind"] == kind and (r["cell"], r["seed"]) in opened]
        counts = [sum(r["result"] == x for r in mine) for x in (RIGHT, WRONG, OPEN)]
        failed = len(mine) - sum(counts)
        margins = [float(r["margin"]) for r in mine if r.get("margin") not in (None, "")]
        least = f"{min(margins):.2f}" if margins else ""
        lines.append(f"| {kind} | {len(mine)} | {' | '.join(map(str, counts))} | {failed} | {least} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "cells.csv"
    rows = list(csv.DictReader(path.open())) if path.is_file() else []
    done = {(r["cell"], int(r["seed"])) for r in rows}
    limits = Limits(60.0 * options.minutes, size=(6.0, 6.0))
    try:
        with progress(options.cells, "cells that the first run leaves open") as advance:
            for cell in order(options.seed):
                if len({r["cell"] for r in rows if r["kind"] != "first"}) >= options.cells:
                    break
                if (cell.name, cell.seed) in done:
                    continue
                found = cell_rows(cell, options.out, options.kinds, limits)
                rows += found
                with path.open("a", newline="") as file:
                    writer = csv.DictWriter(file, COLUMNS)
                    if not file.tell():
                        writer.writeheader()
                    writer.writerows(found)
                if len(found) > 1:
                    advance()
    except InputError as error:
        complain(error)
        return BAD_INPUT
    text = summary(rows)
    (options.out / "summary.json").write_text(json.dumps(rows, indent=1, default=str) + "\n")
    print(text)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "benchmarks.next_run",
        "Test whether a designed run decides what a first run leaves open.",
        "example:  python -m benchmarks.next_run --cells 4 --kinds designed eight --seed 0\n"
        "Cells that are in DIR/cells.csv are not run again.\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted",
    )
    parser.add_argument("--cells", type=int, default=40, metavar="N", help="open cells (40)")
    parser.add_argument(
        "--kinds", nargs="+", choices=KINDS, default=KINDS, help="of the second run (all)"
    )
    parser.add_argument("--minutes", type=float, default=4.0, metavar="M", help="of the second run (4)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is drawn (0)")
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"of the results ({OUT})")
    return parser


if __name__ == "__main__":
    run_command(main)
