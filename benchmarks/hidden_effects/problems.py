"""Problems of the benchmark: ships with effects hidden in them, their measured runs, and the truth.

A problem depends on the physics alone, not on the diagnosis: it is made once and kept in a file.
"""

import json
import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cosim import atomic_write
from diagnosis import Run
from fmus.ship import ship

from .cells import Cell, Key
from .draw import (
    FOREIGN,
    NOISY,
    OUTAGES,
    UNKNOWN,
    Draw,
    added_force,
    draw,
    process_noise,
    run_names,
)
from .fleet import TOGETHER, Order, sail_all
from .manoeuvres import manoeuvres
from .separation import COEFFICIENTS, SEPARABLE, Rivals
from .simulated_runs import NOISE, Hidden, RunawayError, Voyage
from .truth import NAMES, Motion, motion

EFFECTS = ship().effects

WRONG = 0.1  # largest relative error of a coefficient, and the prior's standard deviation
TRIES = 6  # sizes to try until the ship stays on its path
LESS = 0.6  # each as large as the one before
RUNS = 4  # three to learn from, one held out
AT_ONCE = TOGETHER // RUNS  # cells that are simulated together


@dataclass(frozen=True, eq=False)
class Problem:
    """What was hidden, what is true of it, and what was measured.

    Attributes:
        effect, noise, coefficients, seed: which cell; ``none`` where nothing was hidden.
        hidden: what was drawn, one for each effect.
        redrawn: how often the ship ran away and the effects were drawn smaller.
        alike: for each effect the ids that could do the same within 5 %, by the truth; "" is no effect.
        vessel, thrusters, clock: the true model, where the diagnosis has one of its form.
        runs: what the diagnosis gets; the last one is held out.
        note: why there are none.
    """

    effect: str
    noise: str
    coefficients: str
    seed: int
    hidden: Sequence[Draw] = ()
    redrawn: int = 0
    alike: Sequence[Sequence[str]] = ()
    vessel: Mapping[str, float] | None = None
    thrusters: Mapping[str, float] | None = None
    clock: float = 0.0
    note: str = ""
    runs: Sequence[Run] = field(default_factory=list)

    @property
    def key(self) -> Key:
        return self.effect, self.noise, self.coefficients, self.seed

    @property
    def prior(self) -> float:
        return WRONG if self.coefficients == "wrong" else 0.0


def slug(key: Key) -> str:
    """A file name for a cell."""
    name = "".join(c if c.isalnum() else f"_{ord(c):x}_" for c in key[0])
    return "-".join([name, *map(str, key[1:])])


def plant(cell: Cell, hidden: Sequence[Draw]) -> Hidden:
    """The ship of a cell."""
    values = {name: x for d in hidden for name, x in d.values.items()}
    if cell.wrong:
        rng = cell.rng(2)
        # Whether intervals are what they say shows where what is believed at first is right.
        noisy = any(d.effect in NOISY for d in hidden)
        off = rng.standard_normal if noisy else partial(rng.uniform, -1.0, 1.0)
        values |= {name: x * (1.0 + WRONG * float(off())) for name, x in COEFFICIENTS.items()}
    other = any(d.effect in FOREIGN for d in hidden)
    ship = {n: x for n, x in values.items() if n in NAMES["vessel"] or n == "drag_1_5"}
    machine = {n: x for n, x in values.items() if n in NAMES["thrusters"] or n == "bow_exp"}
    return Hidden(ship, machine, values.get("clock_offset", 0.0), other)


def pilots(seeds: Sequence[int], folder: Path) -> dict[int, list[Motion]]:
    """For each seed the training manoeuvres of a ship without any effect; kept in the folder."""
    files = {seed: folder / f"pilot{seed}.pkl" for seed in sorted(set(seeds))}
    missing = [seed for seed, file in files.items() if not file.is_file()]
    orders = [
        Order(m, Hidden(), 1.0, k) for seed in missing for k, m in enumerate(manoeuvres(seed)[:-1])
    ]
    sailed = iter(sail_all(orders))
    for seed in missing:
        runs = [motion(_there(next(sailed)), {}) for _ in range(RUNS - 1)]
        with atomic_write(files[seed]) as part:
            part.write_bytes(pickle.dumps(runs))
    return {seed: pickle.loads(file.read_bytes()) for seed, file in files.items()}


def _there(voyage: Voyage | RunawayError) -> Voyage:
    if isinstance(voyage, RunawayError):
        raise voyage
    return voyage


def make(cells: Sequence[Cell], folder: Path) -> Iterator[Key]:
    """Simulate cells whose problems are not in the folder, many at once; yields each that is kept."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [c for c in cells if not (folder / f"{slug(c.key)}.npz").is_file()]
    missing.sort(key=_slow)
    for first in range(0, len(missing), AT_ONCE):
        some = missing[first : first + AT_ONCE]
        pilot = pilots([c.seed % 100 for c in some], folder)
        for tries in range(TRIES + 1):
            drawn = {c: _drawn(c, pilot[c.seed % 100], LESS**tries) for c in some}
            wanted = some if tries < TRIES else ()  # at last they are given up
            sailed = sail_all([o for c in wanted for o in _orders(c, drawn[c], pilot[c.seed % 100])])
            left = []
            for k, cell in enumerate(some):
                runs = sailed[RUNS * k : RUNS * (k + 1)]
                lost = not runs or any(isinstance(v, RunawayError) for v in runs)
                if lost and tries < TRIES:
                    left.append(cell)
                    continue
                keep(_problem(cell, drawn[cell], tries, [] if lost else runs), folder)
                yield cell.key
            some = left
            if not some:
                break


def _slow(cell: Cell) -> tuple[bool, bool]:
    """What makes all ships of a fleet slow: a finer step, a delay. Those that have it sail together."""
    return any(e in FOREIGN for e in cell.effects), any("delay" in e for e in cell.effects)


def _drawn(cell: Cell, pilot: Sequence[Motion], less: float) -> list[Draw]:
    rng = cell.rng(1)
    return [draw(e, rng, pilot, less) for e in cell.effects]


def _orders(cell: Cell, hidden: Sequence[Draw], pilot: Sequence[Motion]) -> list[Order]:
    ships = [plant(cell, [d.during(run) for d in hidden]) for run in run_names(RUNS)]
    seeds = cell.rng(3).integers(0, 2**31, RUNS) + list(NOISE).index(cell.noise)
    along = zip(manoeuvres(cell.seed % 100), ships, seeds, strict=True)
    noisy = any(d.effect in NOISY for d in hidden)
    push = process_noise(cell.rng(4), pilot) if noisy else None
    return [Order(m, ship, NOISE[cell.noise], int(s), push) for m, ship, s in along]


def _problem(cell: Cell, hidden: Sequence[Draw], redrawn: int, voyages: Sequence[Any]) -> Problem:
    if not voyages:
        return Problem(*cell.key, hidden, redrawn, note="runs away at any size")
    ship = plant(cell, hidden)
    # The diagnosis has no model of waves that are known, nor of a ship of another form; and nobody knows
    # when a thruster fails in a run held out.
    never = {*UNKNOWN, *OUTAGES, *(e.id for e in EFFECTS.values() if e.search.times)}
    known = not (ship.other or "wave_force" in ship.vessel or {d.effect for d in hidden} & never)
    alike = confusable(hidden, voyages[:-1], cell.wrong)
    true = (ship.vessel, ship.thrusters, ship.clock) if known else (None, None, 0.0)
    named = zip(voyages, run_names(len(voyages)), strict=True)
    runs = [replace(v.measured, name=name) for v, name in named]
    return Problem(*cell.key, hidden, redrawn, alike, *true, "", runs)


def confusable(hidden: Sequence[Draw], runs: Sequence[Voyage], wrong: bool) -> list[list[str]]:
    """For each hidden effect the ids that could do the same, by the truth.

    Args:
        hidden: all that is hidden in the runs.
        runs: of the training.
        wrong: whether nominal coefficients may change by 10 %.
    """
    if not hidden or hidden[0].effect in NOISY:  # of which the intervals are judged
        return []
    measurement = {name: x for d in hidden for name, x in d.measured.items()}
    motions = [motion(v, measurement) for v in runs]
    rivals, found = Rivals(motions, wrong), []
    for d in hidden:
        each = zip(motions, run_names(len(motions)), strict=True)
        forces = [added_force([m], d.effect, d.during(run).values) for m, run in each]
        left = rivals.separations(np.concatenate(forces), d.right)
        found.append(sorted(effect for effect, share in left.items() if share < SEPARABLE))
    return found


def keep(problem: Problem, folder: Path) -> None:
    """Write a problem to a file of its own."""
    stated = asdict(problem)
    del stated["runs"]
    columns: dict[str, Any] = {
        f"run{k}": np.column_stack([r.time, r.pose, r.tau_cmd]) for k, r in enumerate(problem.runs)
    }
    names = json.dumps([r.name for r in problem.runs])
    with atomic_write(folder / f"{slug(problem.key)}.npz") as part, part.open("wb") as file:
        np.savez(file, stated=np.array(json.dumps(stated)), names=np.array(names), **columns)


def kept(key: Key, folder: Path) -> Problem:
    """A problem that was made before."""
    with np.load(folder / f"{slug(key)}.npz") as file:
        stated, names = json.loads(str(file["stated"])), json.loads(str(file["names"]))
        tables = [file[f"run{k}"] for k in range(len(names))]
    stated["hidden"] = [Draw(**d) for d in stated["hidden"]]
    runs = [Run(n, t[:, 0], t[:, 1:4], t[:, 4:]) for n, t in zip(names, tables, strict=True)]
    return Problem(**stated, runs=runs)
