"""One cell of the benchmark: hide effects, let the diagnosis identify them, score its findings."""

import pickle
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from cosim import InputError, atomic_write
from diagnosis import (
    Evaluation,
    Findings,
    Integrals,
    Model,
    Run,
    clean,
    evaluate_run,
    integrals,
    method,
    smooth,
)
from diagnosis.progress import silent

from .draw import FOREIGN, Draw, added_force, draw
from .manoeuvres import manoeuvres
from .results import Row
from .separation import COEFFICIENTS, NOTHING, SEPARABLE, Rivals
from .simulated_runs import NOISE, Hidden, RunawayError, Voyage, sail
from .truth import NAMES, Motion, motion

WRONG = 0.1  # largest relative error of a coefficient, and the prior's standard deviation
PEERS = ("sindy", "pls")
NOTHING_FOUND, FAILED = "nothing", "failed"  # in place of a peer's first effect
TRIES = 6
NONE = "none"


@dataclass(frozen=True)
class Cell:
    """One problem of the benchmark.

    Attributes:
        effects: ids of what is hidden; none, one or two.
        noise: n1, n4 or n10.
        wrong: whether the plant's coefficients are up to 10 % off the nominal ones.
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
    """The training manoeuvres of a ship without any effect; kept beside the FMUs."""
    kept = fmus / f"pilot{seed}.pkl"
    if not kept.is_file():
        runs = [motion(sail(c, Hidden(), 1.0, k, fmus), {}) for k, c in enumerate(manoeuvres(seed)[:-1])]
        with atomic_write(kept) as part:
            part.write_bytes(pickle.dumps(runs))
    return pickle.loads(kept.read_bytes())


def draws(cell: Cell, fmus: Path) -> Iterator[list[Draw]]:
    """What is hidden in a cell, smaller in each try."""
    for k in range(TRIES):
        rng = cell.rng(1)
        yield [draw(e, rng, pilot(cell.seed % 100, fmus), 0.6**k) for e in cell.effects]


def plant(cell: Cell, hidden: Sequence[Draw]) -> Hidden:
    """The ship of a cell."""
    values = {name: x for d in hidden for name, x in d.values.items()}
    if cell.wrong:
        rng = cell.rng(2)
        values |= {
            name: x * float(rng.uniform(1.0 - WRONG, 1.0 + WRONG)) for name, x in COEFFICIENTS.items()
        }
    other = any(d.effect in FOREIGN for d in hidden)
    ship = {n: x for n, x in values.items() if n in NAMES["vessel"] or n == "drag_1_5"}
    machine = {n: x for n, x in values.items() if n in NAMES["thrusters"] or n == "bow_exp"}
    return Hidden(ship, machine, values.get("clock_offset", 0.0), other)


def voyages(cell: Cell, fmus: Path) -> tuple[list[Draw], int, list[Voyage]]:
    """What was hidden, how often it had to be drawn smaller, and the runs, the last one held out.

    Raises:
        RunawayError: the ship leaves its path whatever the size.
    """
    for tries, hidden in enumerate(draws(cell, fmus)):
        ship = plant(cell, hidden)
        seeds = cell.rng(3).integers(0, 2**31, 4) + list(NOISE).index(cell.noise)
        along = zip(manoeuvres(cell.seed % 100), seeds, strict=True)
        try:
            return hidden, tries, [sail(c, ship, NOISE[cell.noise], int(s), fmus) for c, s in along]
        except RunawayError:
            continue
    raise RunawayError(f"{cell.name}: runs away at any size")


@dataclass(frozen=True, eq=False)
class Answer:
    """What the diagnosis finds, and how much processor time it took [s]."""

    data: list[Integrals]
    findings: Findings
    held_out: Evaluation
    seconds: float


def truth(hidden: Hidden, held_out: Integrals) -> float:
    """Window position error [m] of the true model; NaN where the diagnosis has none of its form."""
    if hidden.other or "wave_force" in hidden.vessel:
        return float("nan")
    model = Model(hidden.vessel, hidden.thrusters, {"clock_offset": hidden.clock})
    return evaluate_run(held_out, model).before.position


def answer(train: Sequence[Run], held_out: Run, prior: float) -> Answer:
    """What the diagnosis makes of measured runs; it gets nothing else."""
    begun = time.process_time()
    data = [integrals(smooth(clean(run))) for run in train]
    findings = method().fit(data, Model(), prior, silent, 0)
    seconds = time.process_time() - begun
    last = evaluate_run(integrals(smooth(clean(held_out))), Model(), findings.model, held_out=True)
    return Answer(data, findings, last, seconds)


def first_effect(peer: str, data: Sequence[Integrals]) -> str:
    """Id of the first effect that another method finds."""
    chosen = method(peer)
    try:
        found = chosen.fit(data, Model(), 0.0, silent, 0).effects
    except InputError:
        return FAILED
    return found[0].id if found else NOTHING_FOUND


def trial(cell: Cell, fmus: Path, peers: bool) -> Row:
    """Run a cell and score it."""
    try:
        hidden, redrawn, runs = voyages(cell, fmus)
    except (RunawayError, InputError) as error:
        return Row(*cell.key, note=str(error))
    given = [v.measured for v in runs]
    result = answer(given[:-1], given[-1], WRONG if cell.wrong else 0.0)
    effects = result.findings.effects
    found = [f.id for f in effects]
    first = effects[0] if effects else None
    reported = [first.id, *first.alike] if first else []
    before, after = result.held_out.before.position, result.held_out.after.position
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
        truth_mm=1e3 * truth(plant(cell, hidden), result.held_out.integrals),
        seconds=result.seconds,
    )
    if peers and cell.effects:
        row.sindy, row.pls = (first_effect(peer, result.data) for peer in PEERS)
    if hidden:
        alike = [confusable(d, hidden, runs[:-1], cell.wrong) for d in hidden]
        row.alike = sorted(set.union(*alike))
        row.separable = not row.alike
        row.absorbed = any(NOTHING in a for a in alike)
        rights = [d.right for d in hidden]
        row.right = all(any(f in r for f in found[: len(rights)]) for r in rights)
        row.in_set = any(set(r) & set(reported) for r in rights)
    return row


def confusable(d: Draw, hidden: Sequence[Draw], runs: Sequence[Voyage], wrong: bool) -> set[str]:
    """Ids that could do what a hidden effect does, by the truth.

    Args:
        d: the effect.
        hidden: all that is hidden in the runs.
        runs: of the training.
        wrong: whether nominal coefficients may change by 10 %.
    """
    measurement = {name: x for other in hidden for name, x in other.measured.items()}
    motions = [motion(v, measurement) for v in runs]
    force = added_force(motions, d.effect, d.values)
    found = Rivals(motions, wrong).separations(force, d.right)
    return {effect for effect, share in found.items() if share < SEPARABLE}
