"""All that the commands find out, for those who want it from Python."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from cosim import InputError

from .evidence import Evidence, examine
from .model import Model
from .selection import Learned, learn
from .stability import Region, Stability, check
from .steps import Advance, silent
from .uncertainty import omega_std
from .weak import BLOCK, Integrals, omega
from .where import Where, where

FEWEST_BLOCKS = 4

Verdict = Literal["found", "ambiguous", "none"]


@dataclass(frozen=True, eq=False)
class Confronted:
    """Runs held against a model, or against two.

    Attributes:
        evidence: of each run.
        std: of each run the uncertainty (K, 3) of its model error [N, N, N m].
    """

    evidence: Sequence[Evidence]
    std: Sequence[np.ndarray]

    @cached_property
    def before(self) -> Where:
        """Where the model fails at first."""
        return self._where([e.before.omega for e in self.evidence])

    @cached_property
    def after(self) -> Where:
        """Where it still fails at last."""
        return self._where([e.after.omega for e in self.evidence])

    def _where(self, errors: Sequence[np.ndarray]) -> Where:
        return where([e.integrals for e in self.evidence], errors, self.std)


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """What was learned from some runs.

    Attributes:
        learned: the findings.
        shares: for each finding the share of the error's sum of squares that it takes away.
        runs: those for training, then those held out, before and after.
        start: the model at first.
        stability: of the learned model.
        speeds: u, v, r that the ship reached [m/s, m/s, rad/s].
        prior, seed: that it was learned with.
    """

    learned: Learned
    shares: Sequence[float]
    runs: Confronted
    start: Model
    stability: Stability
    speeds: tuple[float, float, float]
    prior: float
    seed: int

    @property
    def verdict(self) -> Verdict:
        if not self.learned.findings:
            return "none"
        return "ambiguous" if self.learned.findings[0].alike else "found"

    @property
    def sound(self) -> bool:
        """Whether the learned model has a mass and stays bounded in closed loop."""
        return bool(self.stability.safe)


def confront(
    runs: Sequence[Integrals],
    model: Model | None = None,
    after: Model | None = None,
    held_out: Sequence[Integrals] = (),
    advance: Advance = silent,
) -> Confronted:
    """Hold runs against a model.

    Args:
        runs: see :func:`diagnosis.gather`.
        model: the nominal one by default.
        after: the model with what was learned; None: nothing was.
        held_out: further runs, of which nothing was learned.
        advance: told what is being done.
    """
    model, found = model or Model(), []
    for out, group in ((False, runs), (True, held_out)):
        for w in group:
            advance(f"predicting {w.run.name}")
            found.append(examine(w, model, after, out))
    return Confronted(found, [omega_std(e.integrals) for e in found])


def diagnose(
    train: Sequence[Integrals],
    held_out: Sequence[Integrals] = (),
    prior: float = 0.1,
    model: Model | None = None,
    advance: Advance = silent,
    seed: int = 0,
) -> Diagnosed:
    """Learn what a model lacks.

    Args:
        train: runs to learn from, see :func:`diagnosis.gather`.
        held_out: runs to test on only.
        prior: relative standard deviation believed of every nominal coefficient.
        model: to start from; the nominal one by default.
        advance: told what is being done.
        seed: of the bootstrap.

    Raises:
        InputError: too little data, or a prior that is none.
    """
    if not 0.0 <= prior < np.inf:
        raise InputError(f"the prior must be zero or more, not {prior:g}")
    blocks = sum(np.unique(w.block).size for w in train)
    if blocks < FEWEST_BLOCKS:
        raise InputError(
            f"too little to learn from: {blocks * BLOCK:g} s with thrusters at work, "
            f"at least {FEWEST_BLOCKS * BLOCK:g} s are needed"
        )
    start = model or Model()
    learned = learn(train, prior, start, advance, seed)
    runs = confront(train, start, learned.model if learned.findings else None, held_out, advance)
    advance("stability")
    reached = Region.of(np.concatenate([w.smoothed.nu[w.known] for w in train]))
    stability = check(learned.model, start, advance, reached)
    shares = _shares(learned, start, held_out)
    return Diagnosed(learned, shares, runs, start, stability, _reached(train), prior, seed)


def _shares(learned: Learned, start: Model, held_out: Sequence[Integrals]) -> list[float]:
    """Fall of the sum of squares by each finding, as a part of that at first; axes weighted by noise."""
    if not held_out:
        return [min(1.0, max(0.0, f.share)) for f in learned.findings]
    models = [start, *(f.model for f in learned.findings)]
    sums = np.array(
        [sum(np.sum((omega(w, model) / learned.sigma) ** 2) for w in held_out) for model in models]
    )
    return [min(1.0, max(0.0, share)) for share in (-np.diff(sums) / sums[0]).tolist()]


def _reached(runs: Sequence[Integrals]) -> tuple[float, float, float]:
    """Speeds that the ship seldom went beyond."""
    nu = np.concatenate([w.smoothed.nu[w.known] for w in runs])
    u, v, r = np.quantile(np.abs(nu), 0.9, axis=0).tolist()
    return u, v, r
