"""One cell of the benchmark: hide something, let the diagnosis look for it, score its answer."""

import pickle
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from cosim import InputError, whole
from diagnosis import Run, clean, smooth
from diagnosis.evidence import Evidence, examine
from diagnosis.model import Model
from diagnosis.selection import Learned, learn
from diagnosis.weak import Integrals, integrals

from .courses import courses
from .draw import FOREIGN, Draw, added_force, draw
from .results import Row
from .runs import NOISE, Hidden, RunawayError, Voyage, sail
from .separation import COEFFICIENTS, NOTHING, SEPARABLE, Rivals
from .truth import NAMES, Motion, motion

DOUBT = 0.1  # coefficients are up to so much wrong, and the prior says so
TRIES = 6
NONE = "none"


@dataclass(frozen=True)
class Cell:
    """One problem of the benchmark.

    Attributes:
        effects: ids of what is hidden; none, one or two.
        noise: n1, n4 or n10.
        wrong: whether the plant's coefficients are up to 10 % off those that the analysis has.
        seed: of all that is drawn.
    """

    effects: tuple[str, ...]
    noise: str
    wrong: bool
    seed: int

    @property
    def name(self) -> str:
        return " + ".join(self.effects) or NONE

    @property
    def key(self) -> tuple[str, str, str, int]:
        return self.name, self.noise, "wrong" if self.wrong else "exact", self.seed

    def rng(self, purpose: int) -> np.random.Generator:
        """Random numbers that are the same for all noises."""
        name = int.from_bytes(self.name.encode(), "little") % 2**63
        return np.random.default_rng([self.seed, purpose, self.wrong, name])


@cache
def pilot(seed: int, fmus: Path) -> list[Motion]:
    """The courses to learn from, run by a ship that lacks nothing; kept beside the FMUs."""
    kept = fmus / f"pilot{seed}.pkl"
    if not kept.is_file():
        runs = [motion(sail(c, Hidden(), 1.0, k, fmus), {}) for k, c in enumerate(courses(seed)[:-1])]
        with whole(kept) as part:
            part.write_bytes(pickle.dumps(runs))
    return pickle.loads(kept.read_bytes())


def draws(cell: Cell, fmus: Path) -> Iterator[list[Draw]]:
    """What is hidden in a cell, smaller from time to time."""
    for k in range(TRIES):
        rng = cell.rng(1)
        yield [draw(e, rng, pilot(cell.seed % 100, fmus), 0.6**k) for e in cell.effects]


def plant(cell: Cell, hidden: Sequence[Draw]) -> Hidden:
    """The ship of a cell."""
    values = {name: x for d in hidden for name, x in d.values.items()}
    if cell.wrong:
        rng = cell.rng(2)
        values |= {
            name: x * float(rng.uniform(1.0 - DOUBT, 1.0 + DOUBT)) for name, x in COEFFICIENTS.items()
        }
    other = any(d.effect in FOREIGN for d in hidden)
    ship = {n: x for n, x in values.items() if n in NAMES["vessel"] or n == "drag_1_5"}
    machine = {n: x for n, x in values.items() if n in NAMES["thrusters"] or n == "bow_exp"}
    return Hidden(ship, machine, values.get("clock_offset", 0.0), other)


def voyages(cell: Cell, fmus: Path) -> tuple[list[Draw], int, list[Voyage]]:
    """What was hidden, how often it had to be drawn smaller, and the runs, the last one held out.

    Raises:
        RunawayError: the ship leaves its course whatever the size.
    """
    for tries, hidden in enumerate(draws(cell, fmus)):
        ship = plant(cell, hidden)
        seeds = cell.rng(3).integers(0, 2**31, 4) + list(NOISE).index(cell.noise)
        along = zip(courses(cell.seed % 100), seeds, strict=True)
        try:
            return hidden, tries, [sail(c, ship, NOISE[cell.noise], int(s), fmus) for c, s in along]
        except RunawayError:
            continue
    raise RunawayError(f"{cell.name}: runs away at any size")


@dataclass(frozen=True, eq=False)
class Answer:
    """What the diagnosis says, and how much processor time it took [s]."""

    data: list[Integrals]
    learned: Learned
    held_out: Evidence
    seconds: float


def truth(hidden: Hidden, held_out: Integrals) -> float:
    """Window position error [m] of the true model; NaN where the analysis has none of its form."""
    if hidden.other or "wave_force" in hidden.vessel:
        return float("nan")
    model = Model(hidden.vessel, hidden.thrusters, hidden.clock)
    return examine(held_out, model).before.position


def ask(train: Sequence[Run], held_out: Run, prior: float) -> Answer:
    """Let the diagnosis look at measured runs; it gets nothing else."""
    begun = time.process_time()
    data = [integrals(smooth(clean(run))) for run in train]
    learned = learn(data, prior)
    seconds = time.process_time() - begun
    last = examine(integrals(smooth(clean(held_out))), Model(), learned.model, held_out=True)
    return Answer(data, learned, last, seconds)


def trial(cell: Cell, fmus: Path, peers: bool) -> Row:
    """Run a cell and score it."""
    try:
        hidden, redrawn, runs = voyages(cell, fmus)
    except (RunawayError, InputError) as error:
        return Row(*cell.key, note=str(error))
    answer = ask([v.measured for v in runs[:-1]], runs[-1].measured, DOUBT if cell.wrong else 0.0)
    found = [f.id for f in answer.learned.findings]
    first = answer.learned.findings[0] if found else None
    reported = [first.id, *first.alike] if first else []
    before, after = answer.held_out.before.position, answer.held_out.after.position
    row = Row(
        *cell.key,
        values=" ".join(f"{n}={x:.4g}" for d in hidden for n, x in d.values.items() if abs(x) > 1e-6),
        size=" ".join(f"{d.size:.3f}" for d in hidden),
        redrawn=redrawn,
        found=found,
        reported=reported,
        confidence=first.confidence if first else 0.0,
        before_mm=1e3 * before,
        after_mm=1e3 * after,
        truth_mm=1e3 * truth(plant(cell, hidden), answer.held_out.integrals),
        seconds=answer.seconds,
    )
    if peers and cell.effects:
        from .peers import firsts  # without peers, their packages need not be there

        row.sindy, row.pls = firsts(answer.data)
    if hidden:
        alike = [confusable(d, hidden, runs[:-1], cell.wrong) for d in hidden]
        row.alike = sorted(set.union(*alike))
        row.separable = not row.alike
        row.doubtful = any(NOTHING in a for a in alike)
        rights = [d.right for d in hidden]
        row.right = all(any(f in r for f in found[: len(rights)]) for r in rights)
        row.in_set = any(set(r) & set(reported) for r in rights)
    return row


def confusable(d: Draw, hidden: Sequence[Draw], runs: Sequence[Voyage], wrong: bool) -> set[str]:
    """Ids that could do what a hidden effect does, by the truth.

    Args:
        d: the effect.
        hidden: all that is hidden in the runs.
        runs: to learn from.
        wrong: whether nominal coefficients may change by 10 %.
    """
    seen = {name: x for other in hidden for name, x in other.measured.items()}
    motions = [motion(v, seen) for v in runs]
    force = added_force(motions, d.effect, d.values)
    found = Rivals(motions, wrong).separations(force, d.right)
    return {effect for effect, share in found.items() if share < SEPARABLE}
