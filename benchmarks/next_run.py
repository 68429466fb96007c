"""Does a designed run decide what a first run leaves open: ``python -m benchmarks.next_run``.

A cell is a ship with one or two hidden effects and coefficients up to 10 % wrong, after a usual first
run at noise n4. Of the cells in a random order those count in which no cause reaches 95 %. Each then
gets one run of each kind, and the diagnosis of both runs judges it. ``--basin`` simulates designed runs
with ships that the candidates allow, and counts those that leave the basin; nothing is learned there.
"""

import argparse
import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import cosim
import diagnosis
from cosim import InputError
from cosim.command import BAD_INPUT, command_parser, complain, run_command
from cosim.scenario import find_scenario
from diagnosis import Model
from diagnosis.design import (
    DIMENSIONS,
    Designer,
    Knowledge,
    Limits,
    Question,
    Rehearsal,
    ScoredPlan,
    prepared,
    scenario_file,
    sequence,
    write_run,
)
from diagnosis.predictors import WeakWindows, ship_with
from diagnosis.predictors.parameter_set import write_model
from diagnosis.predictors.weak_form import commanded
from diagnosis.runs.run_constants import LEVEL
from diagnosis.search.candidates import SMALL, model_error
from studies.study_command import progress

from .hidden_effects.draw import LARGEST, SMALLEST
from .hidden_effects.simulated_runs import HEADING, MEASURED, NOISE, POSITION


@dataclass(frozen=True)
class FirstRun:
    """The usual run after which a ship is diagnosed first.

    Attributes:
        scenario, seconds: of the run.
        basin: north and east length for all later runs [m].
    """

    scenario: str
    seconds: float
    basin: tuple[float, float]


# Basins of ships without a force on all axes hold a turning circle and the way of the second run.
SHIPS = {
    "cse1": FirstRun("ellipse", 100.0, (6.0, 6.0)),
    "cybership2": FirstRun("ellipse", 100.0, (6.0, 6.0)),
    "otter": FirstRun("otter_zigzag", 100.0, (300.0, 300.0)),
    "kvlcc2": FirstRun("kvlcc2_zigzag", 150.0, (800.0, 800.0)),
}
DESIGNED, TWICE = "designed", "designed twice"  # where one designed run does not decide
KINDS = (DESIGNED, "usual", "random", "d-optimal")
PRIOR, NOISY = 0.1, "n4"  # 1, largest relative error of a coefficient; noise
PAIRS = 20  # of random effects
TRIES = 4  # sizes of an effect, each LESS of the one before, until the ship stays on its path
LESS = 0.6
PATIENCE = 200  # random plans until one keeps the limits
BRIEF = 16  # plans that are searched where only the basin counts
RIVALS = 2  # random candidates next to the true one, where nothing is learned
NUMBERS = ("confidence", "found", "sure", "half_width", "margin")
COLUMNS = ("ship", "cell", "seed", "kind", "result", *NUMBERS)
OPEN, RIGHT, WRONG = "open", "right", "wrong"
OUT = Path("results") / "next_run"


@dataclass(frozen=True, eq=False)
class Cell:
    """A ship with hidden effects.

    Attributes:
        ship: name.
        effects: ids of what is hidden.
        seed: of all that is drawn.
    """

    ship: str
    effects: tuple[str, ...]
    seed: int

    @property
    def start(self) -> Model:
        """The nominal model."""
        return Model(ship=ship_with([], self.ship))

    @property
    def name(self) -> str:
        return " + ".join(self.effects)

    def limits(self, minutes: float) -> Limits:
        """Of the second run: minutes for a ship of the size of CyberShip Enterprise 1."""
        return Limits(60.0 * minutes * self.start.ship.scale.time, size=SHIPS[self.ship].basin)

    def rng(self) -> np.random.Generator:
        """Random numbers of this cell."""
        return np.random.default_rng([self.seed, *f"{self.ship} {self.name}".encode()])

    def first_run(self, truth: Path, out: Path, noisy: bool = True) -> Path:
        """The log of the first run.

        Raises:
            InputError: it failed.
        """
        first, ship = SHIPS[self.ship], self.start.ship
        content = json.loads(find_scenario(first.scenario).read_text(encoding="utf-8"))
        place, turn = (NOISE[NOISY] * x for x in (POSITION * ship.scale.length, HEADING))
        noise = {"kind": "noise", "signals": MEASURED, "std": [place, place, turn]}
        content |= {"stop": first.seconds, "ship": self.ship, "metrics": {}}
        return simulated(content | ({"faults": [noise]} if noisy else {}), truth, out, self.seed)


def order(ship: str, seed: int) -> list[Cell]:
    """Singles and pairs of a ship in a random order.

    A single one is of what acts as a force by a few values, at any time.
    """
    rng, effects = np.random.default_rng(seed), ship_with([], ship).effects
    singles = [
        e.id
        for e in effects.values()
        if e.search.by == "regression"
        and e.kind in ("force", "inertia", "actuator", "environment")
        and e.differentiable
        and not (e.search.times or e.search.smooth or e.apart or e.memory is not None)
    ]
    pairs = [tuple(rng.choice(singles, 2, replace=False)) for _ in range(PAIRS)]
    every = [*((e,) for e in singles), *pairs]
    return [Cell(ship, tuple(map(str, every[k])), seed) for k in rng.permutation(len(every))]


def hidden_ship(cell: Cell, nominal: Sequence, size: float) -> Model:
    """The true ship: coefficients up to PRIOR wrong, and effects of a drawn size.

    The size is the RMS of an effect's force over that of the commanded one, on the axis where that is
    most, log-uniform as in :mod:`.hidden_effects`, along the first run of the nominal ship.

    Args:
        cell: what is hidden.
        nominal: that run.
        size: factor on the size that is drawn.
    """
    rng, start = cell.rng(), cell.start
    base, command = model_error(nominal, start), _rms(commanded(nominal, start))
    changes = {n: start.value(n) * PRIOR * rng.uniform(-1.0, 1.0) for n in start.ship.coefficients}
    for name in cell.effects:
        names = start.ship.effects[name].coefficients
        steps = {n: SMALL * start.unit(n) * rng.standard_normal() for n in names}
        force = _rms(base - model_error(nominal, start.plus(steps)))
        share = np.max(force[command > 0.0] / command[command > 0.0])
        wanted = size * np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST)))
        for n, step in steps.items():
            changes[n] = changes.get(n, 0.0) + step * wanted / max(share, np.finfo(float).tiny)
    return start.plus({n: x for n, x in changes.items() if x})


def _rms(x: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(x), axis=0))


def simulated(content: Any, truth: Path, out: Path, seed: int) -> Path:
    """The log of a run of the true ship.

    Raises:
        InputError: the run failed.
    """
    result = cosim.simulate(content, out, [truth], seed=seed, log="compact", pictures=False)
    if result.status != "done":
        raise InputError(result.message)
    return out


def first_runs(cell: Cell, work: Path, truth: Path) -> list[WeakWindows]:
    """The first run of the true ship, of which the parameters are written.

    Raises:
        InputError: at no size the ship stays on its path.
    """
    nominal = work / "nominal.ssv"
    write_model(nominal, cell.start)
    pilot = diagnosis.load(cell.first_run(nominal, work / "pilot", noisy=False), model=cell.start)
    for tries in range(TRIES):
        write_model(truth, hidden_ship(cell, pilot, LESS**tries))
        with suppress(InputError):  # it leaves its path
            log = cell.first_run(truth, work / f"first_{tries}")
            return diagnosis.load(log, model=cell.start)
    raise InputError("the ship leaves its path with effects of any size that was tried")


def judged(content: Mapping, hidden: Sequence[str]) -> dict[str, Any]:
    """Right, wrong or open; largest confidence, what was found, half width of the first interval."""
    certain = [e for e in content["effects"] if (e["confidence"] or 0.0) >= LEVEL]
    first = max((e["confidence"] or 0.0 for e in content["effects"]), default=0.0)
    found = " + ".join(e["id"] for e in content["effects"])
    ids = {e["id"] for e in certain}
    result = WRONG if ids - set(hidden) else RIGHT if ids == set(hidden) else OPEN
    spans = [c["ci95"] for e in certain for c in e["coefficients"].values() if c["ci95"]]
    width = 0.5 * (spans[0][1] - spans[0][0]) if spans else float("nan")
    return {"result": result, "confidence": first, "found": found, "half_width": width}


def chosen(d: Designer, k: Knowledge, kind: str, seed: int) -> Iterator[tuple[str, ScoredPlan]]:
    """The runs of a kind, with their names.

    Raises:
        InputError: none keeps the limits.
    """
    if kind == "usual":
        found = {name: d.usual(k, name) for name in d.usual_runs}
        yield from ((n, s) for n, s in found.items() if n in ("eight", "circle", "zig-zag"))
    elif kind == "random":
        rng = np.random.default_rng(seed)
        points = rng.random((PATIENCE, 4 * DIMENSIONS))
        plans = (sequence(point, d.limits.seconds, d.library) for point in points)
        found = next((s for p in plans if (s := d.scored(k, [p])[0]).excess == 0.0), None)
        if found is None:
            raise InputError("no random run keeps the limits")
        yield kind, found
    else:
        yield kind, d.search(k, seed)


def best(d: Designer, k: Knowledge, found: ScoredPlan) -> list[ScoredPlan]:
    """A plan, and those that take its place where it leaves the basin."""
    return d.best(found, (d.usual(k, name) for name in d.usual_runs))


@dataclass(frozen=True, eq=False)
class FurtherRuns:
    """The runs of a cell that the first one leaves open.

    Attributes:
        cell: the ship.
        truth: parameters of the true ship.
        work: a folder.
    """

    cell: Cell
    truth: Path
    work: Path

    def row(self, kind: str, content: Mapping | None, **more: Any) -> dict[str, Any]:
        """One row of the results."""
        base = {"ship": self.cell.ship, "cell": self.cell.name, "seed": self.cell.seed, "kind": kind}
        return base | ({} if content is None else judged(content, self.cell.effects)) | more

    def of_kind(self, q: Question, kind: str) -> Iterator[tuple[dict[str, Any], Question]]:
        """The row of each run of a kind, and what is asked after it."""
        q = replace(q, criterion=kind if kind == "d-optimal" else q.criterion)
        try:
            d, k = prepared(q)
            found = [*chosen(d, k, kind, self.cell.seed)]
        except InputError as error:
            yield self.row(kind, None, result=f"failed: {error}"), q
            return
        for name, plan in found:
            try:
                # A usual or random run is the one that is named, or none.
                plans = [plan] if kind in ("usual", "random") else best(d, k, plan)
                run, _ = d.checked(k, plans, self.cell.seed)
                sure = Rehearsal(q.data, d.space, k).sure([d.windows(run.motion)], self.cell.seed)
                data = [*q.data, self._measured(d, run, f"{name}_{len(q.data)}", len(q.data))]
                content = diagnosis.diagnose(data, prior=PRIOR, model=self.cell.start).content
                eta = data[-1].smoothed.eta[data[-1].known]
                margin = float(d.basin.margin(eta, d.outline).min())
                result = self.row(name, content, sure=sure, margin=margin)
                yield result, replace(q, data=data, content=content)
            except InputError as error:
                yield self.row(name, None, result=f"failed: {error}"), q

    def _measured(self, d: Designer, run: ScoredPlan, name: str, number: int) -> WeakWindows:
        """A planned run of the true ship."""
        folder = self.work / name
        folder.mkdir()
        write_run(d, run, 1, folder, self.cell.ship)
        seed = self.cell.seed + 1000 * number
        log = simulated(folder / scenario_file(1), self.truth, folder / "log", seed)
        return diagnosis.load(log, model=self.cell.start)[0]

    def twice(self, found: dict[str, Any], q: Question) -> dict[str, Any]:
        """The row after a second designed run, where one does not decide."""
        if found["result"] == OPEN:
            found, _ = next(self.of_kind(q, DESIGNED))
        return found | {"kind": TWICE}


def cell_rows(cell: Cell, kinds: Sequence[str], limits: Limits) -> Iterator[dict]:
    """The rows of a cell: after the first run, and, where that is open, after one of each kind."""
    with TemporaryDirectory() as scratch:
        further = FurtherRuns(cell, Path(scratch) / "truth.ssv", Path(scratch))
        try:
            data = first_runs(cell, further.work, further.truth)
            content = diagnosis.diagnose(data, prior=PRIOR, model=cell.start).content
        except InputError as error:
            yield further.row("first", None, result=f"failed: {error}")
            return
        yield (first := further.row("first", content))
        if first["confidence"] >= LEVEL or not (content["effects"] or content["possibilities"]):
            return
        q = Question(data, content, cell.start, PRIOR, limits, ship=cell.ship)
        for kind in kinds:
            for found, after in further.of_kind(q, kind):
                yield found
                if kind == DESIGNED:
                    yield further.twice(found, after)


def basin_rows(ship: str, count: int, minutes: float, seed: int) -> Iterator[dict]:
    """Designs of a ship, each run by fresh ships of every candidate above 5 %, at the speed of the plan.

    The diagnosis that a design begins with is made up: the hidden effects, each with random rivals, at
    even odds. The ships are drawn from the posterior of each candidate anew.
    """
    for cell in order(ship, seed)[:count]:
        base = {"ship": ship, "cell": cell.name, "seed": seed}
        with TemporaryDirectory() as scratch:
            try:
                data = first_runs(cell, Path(scratch), Path(scratch) / "truth.ssv")
                q = Question(data, _made_up(cell), cell.start, PRIOR, cell.limits(minutes), ship=ship)
                d, k = prepared(q)
                plans = best(d, k, d.search(k, seed, points=BRIEF, evolved=0))
                run, spread = d.checked(k, plans, seed)
                fresh = d.spread(k, run, seed + 1)
            except InputError as error:
                yield base | {"result": f"no design: {error}"}
                continue
            margins = [d.basin.margin(eta, d.outline).min() for eta in np.concatenate(fresh.eta)]
            margin = {"planned": float(spread.margin.min()), "margin": float(min(margins))}
            yield base | margin | {"ships": len(margins)}


def _made_up(cell: Cell) -> dict:
    others = [c.name for c in order(cell.ship, cell.seed) if len(c.effects) == 1]
    rng = cell.rng()
    effects = [
        {"id": e, "confidence": 0.5, "indistinguishable": [*map(str, rng.choice(others, RIVALS))]}
        for e in cell.effects
    ]
    return {"verdict": "ambiguous", "effects": effects, "possibilities": [], "ranking": []}


def summary(rows: Sequence[Mapping]) -> str:
    """How many cells each kind of run decides, and how often its probability came true, as tables."""
    lines = [
        "| ship | run | cells | right | wrong | open | failed | least margin [m] |",
        "|---|---|--:|--:|--:|--:|--:|--:|",
    ]
    opened = {_cell(r) for r in rows if r["kind"] != "first"}
    for ship, kind in dict.fromkeys((r["ship"], r["kind"]) for r in rows):
        mine = [r for r in rows if (r["ship"], r["kind"]) == (ship, kind) and _cell(r) in opened]
        counts = [sum(r["result"] == x for r in mine) for x in (RIGHT, WRONG, OPEN)]
        margins = [float(r["margin"]) for r in mine if r.get("margin") not in (None, "")]
        least = f"{min(margins):.2f}" if margins else ""
        numbers = [len(mine), *counts, len(mine) - sum(counts), least]
        lines.append(f"| {ship} | {kind} | {' | '.join(map(str, numbers))} |")
    known = [r for r in rows if r.get("sure") not in (None, "")]
    stated = [(float(r["sure"]), r["result"] == RIGHT) for r in known]
    lines += ["", "| stated probability | runs | mean stated | right |", "|---|--:|--:|--:|"]
    for low, high in ((0.0, 0.1), (0.1, 0.5), (0.5, 0.9), (0.9, 1.01)):
        mine = [x for x in stated if low <= x[0] < high]
        if mine:
            mean, right = np.mean(mine, axis=0)
            span = f"{low:.0%} to {min(high, 1.0):.0%}"
            lines.append(f"| {span} | {len(mine)} | {mean:.0%} | {right:.0%} |")
    return "\n".join(lines)


def _cell(row: Mapping) -> tuple[str, str, int]:
    return row["ship"], row["cell"], int(row["seed"])


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        return _basin(options) if options.basin else _cells(options)
    except InputError as error:
        complain(error)
        return BAD_INPUT


def _basin(options: argparse.Namespace) -> int:
    found = []
    with progress(options.cells * len(options.ships), "designs") as advance:
        for ship in options.ships:
            for row in basin_rows(ship, options.cells, options.minutes, options.seed):
                found.append(row)
                (options.out / "basin.json").write_text(json.dumps(found, indent=1) + "\n")
                advance()
    for ship in options.ships:
        mine = [r for r in found if r["ship"] == ship]
        made = [r["margin"] for r in mine if "margin" in r]
        left = sum(m < 0.0 for m in made)
        least = min(made, default=float("nan"))
        print(f"{ship}: {len(made)} of {len(mine)} designed, {left} left the basin; least {least:.2f} m")
    return 0


def _cells(options: argparse.Namespace) -> int:
    path = options.out / "cells.csv"
    rows: list[dict] = list(csv.DictReader(path.open())) if path.is_file() else []
    done = {_cell(r) for r in rows}
    with progress(options.cells * len(options.ships), "cells that the first run leaves open") as advance:
        for ship in options.ships:
            for cell in order(ship, options.seed):
                count = len({_cell(r) for r in rows if r["kind"] != "first" and r["ship"] == ship})
                if count >= options.cells:
                    break
                if (ship, cell.name, cell.seed) in done:
                    continue
                found = [*cell_rows(cell, options.kinds, cell.limits(options.minutes))]
                rows += found
                with path.open("a", newline="") as file:
                    writer = csv.DictWriter(file, COLUMNS)
                    if not file.tell():
                        writer.writeheader()
                    writer.writerows(found)
                if len(found) > 1:
                    advance()
    print(summary(rows))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "benchmarks.next_run",
        "Test whether a designed run decides what a first run leaves open.",
        "example:  python -m benchmarks.next_run --ships cse1 --cells 4 --kinds designed usual\n"
        "          python -m benchmarks.next_run --basin --ships cse1 otter --cells 50\n"
        "Cells that are in DIR/cells.csv are not run again.\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted",
    )
    parser.add_argument("--ships", nargs="+", choices=SHIPS, default=[*SHIPS], help="(all)")
    parser.add_argument(
        "--cells", type=int, default=40, metavar="N", help="open cells, or designs, a ship (40)"
    )
    parser.add_argument("--basin", action="store_true", help="count designed runs that leave the basin")
    parser.add_argument(
        "--kinds", nargs="+", choices=KINDS, default=KINDS, help="of the second run (all)"
    )
    parser.add_argument("--minutes", type=float, default=4.0, metavar="M", help="of the second run (4)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is drawn (0)")
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"of the results ({OUT})")
    return parser


if __name__ == "__main__":
    run_command(main)
