"""The rivals of an effect that are no candidates: other coefficients, and modulated forces.

**Other nominal coefficients, as uncertain as the ship's description states.** The search takes each
coefficient as known to a tenth, see :mod:`.prior`. A ship whose coefficients are all off by what its
description allows differs by more, and a single effect may imitate that. So models are compared in which
the coefficients are known to a tenth, or as stated, at even odds:

    with the effects, known to a tenth       with the effects, as stated
    without one of them, as stated           without any, as stated

The evidence of each is that of a linear Gaussian model (Laplace's approximation), in which an effect's
parameters have the prior that one sample would give (unit information: log n for each, R. E. Kass and
L. Wasserman, Journal of the American Statistical Association 90, 1995). Where all other coefficients
turn out to be right within a tenth, wide priors cost their Occam factors, and the effect stays.

**The force of an actuator in proportion to what another one does.** Where two commands follow each
other, a curve over the one, or a loss by the speed that follows, is also a force that depends on the
other: of a bow thruster whose generator serves the propeller, too, less is left at each shaft speed.
And a rudder behind a shaft that slows down in turns is another drag of yaw. There are as many such
forces as pairs of actuators and channels. So the evidence of an effect that is a force is compared with
the mean evidence of them all, each alone in its place.

**Held commands.** An actuator that sticks gives another force than is ordered, at times, as one does
that fails at times. An outage, without force in its intervals, is compared with a constant command in
each of them, which is as large as the usual ones of the run (standard deviation of its prior).
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import expit, logsumexp

from fmus.actuators.actuation import actuators
from fmus.actuators.actuator import Actuator
from fmus.effects import Effect
from fmus.ship import Ship

from ..predictors import Model, WeakWindows
from ..predictors.weak_form import common_commands
from ..runs.run_constants import NEGLIGIBLE
from .candidates import model_error
from .most_likely import ridge

LOSS = "loss_"  # beginning of the id of an actuator's loss, a constant share of its force
OUTAGE = "_outage"  # end of the id of one that fails at times
HELD = "the actuator held at a constant command"


class LinearProblem(NamedTuple):
    """A model error that effects and coefficients are fitted to, linear about an estimate.

    Attributes:
        y: (n,), model error of the estimate, in units of the noise.
        effects: (n, p), columns of the effects' parameters.
        coefficients: (n, q), columns of the coefficients, in prior standard deviations.
        offset: (q,), how far each coefficient already is from its prior mean.
        per_parameter: log of the number of samples.
    """

    y: np.ndarray
    effects: np.ndarray
    coefficients: np.ndarray
    offset: np.ndarray
    per_parameter: float

    def beside(self, others: np.ndarray) -> list["LinearProblem"]:
        """The same with a further column of the effects, each of others (n, m) in turn.

        The evidence is by inner products alone, which those of a triangle are, of many fewer rows.
        """
        parts = [self.y[:, None], self.effects, self.coefficients, others]
        R = np.linalg.qr(np.concatenate(parts, axis=1), mode="r")
        y, effects, coefficients, each = np.split(R, np.cumsum([p.shape[1] for p in parts])[:-1], axis=1)
        known = self._replace(y=y[:, 0], coefficients=coefficients)
        return [known._replace(effects=np.column_stack([effects, column])) for column in each.T]

    def also_uncertain(self, columns: np.ndarray) -> "LinearProblem":
        """The same with further coefficients, of which columns (n, m) are one standard deviation."""
        coefficients = np.concatenate([self.coefficients, columns], axis=1)
        return self._replace(
            coefficients=coefficients, offset=np.append(self.offset, np.zeros(columns.shape[1]))
        )

    def log_evidence(self, wider: np.ndarray, charged: int) -> float:
        """Logarithm of the evidence, but for a constant that all models of one noise share.

        Args:
            wider: (q,), prior standard deviation of each coefficient, in those of its column.
            charged: number of parameters of the effects, those that have no column included.
        """
        A = np.concatenate([self.effects, self.coefficients], axis=1)
        p = self.effects.shape[1]
        precision = np.concatenate([np.zeros(p), wider**-2.0])
        offset = np.concatenate([np.zeros(p), self.offset])
        H = A.T @ A + np.diag(precision)
        H += ridge(H)
        step = np.linalg.solve(H, A.T @ self.y - precision * offset)
        loss = np.sum((self.y - A @ step) ** 2) + np.sum(precision * (offset + step) ** 2)
        occam = np.linalg.slogdet(H)[1] - np.linalg.slogdet(H[:p, :p])[1] + 2.0 * np.sum(np.log(wider))
        return float(-0.5 * (loss + occam + charged * self.per_parameter))


def probability_beside(
    present: Sequence[float], absent: Mapping[int, Sequence[float]], prior: float = 1.0
) -> float:
    """Probability of an effect, or of one of a set, beside models without it.

    Args:
        present: log evidences of models with all effects.
        absent: number of effects that are left out, 0 where a rival takes the place of one -> log
            evidences of models without them.
        prior: odds of one effect before the data: of a missing effect they are even, shared by all
            candidates (J. G. Scott and J. O. Berger, Annals of Statistics 38, 2010).
    """
    without = [e - k * np.log(prior) for k, models in absent.items() for e in models]
    odds = logsumexp(present) - np.log(len(present)) - logsumexp(without) + np.log(len(without))
    return float(expit(odds))


def may_be_modulated(e: Effect) -> bool:
    """Whether a modulated force may look like an effect: a force, but no constant share of one."""
    return e.kind in ("actuator", "force") and not e.id.startswith(LOSS)


def modulated_forces(data: Sequence[WeakWindows], model: Model) -> Iterator[tuple[str, np.ndarray]]:
    """Forces of actuators in proportion to the size of a channel that no effect has: name, (K, 3).

    Such channels are the commands of the other actuators, the speed aside and the yaw rate, averaged
    over windows. Of runs with the commanded force alone, or with different commands, there are none; nor
    are the commands of a twin, which are the actuator's own.

    Args:
        data: windows of every run.
        model: of the ship, without the effect.
    """
    if not (signals := common_commands(data)):
        return
    base, ship = model_error(data, model), model.ship
    for a in actuators(ship.description):
        effect = ship.effects.get(f"{LOSS}{a.part.name}")
        if effect is None:
            continue
        own = _columns(a, signals, ship)
        lost = base - model_error(data, model.plus({effect.parameters[0].name: 1.0}))
        if not lost.any():
            continue
        others = {name: k for k, name in enumerate(signals) if k not in own}
        sizes = np.concatenate([_sizes(w, [*others.values(), *own]) for w in data]).T
        its = sizes[len(others) : len(others) + len(own)]
        named = dict(zip(others, sizes, strict=False)) | dict(
            zip(("|v|", "|r|"), sizes[-2:], strict=True)
        )
        for name, size in named.items():
            if size.any() and not any(_alike(size, x) for x in its):
                yield f"the force of the {a.part.title} in proportion to {name}", lost * size[:, None]


def held_forces(data: Sequence[WeakWindows], model: Model, outage: Effect) -> list[np.ndarray]:
    """Forces of an actuator that is held in the intervals of an outage, (K, 3) of each interval.

    Its first command is held at what it is in the root mean square of the run, the others at their
    medians in the interval.

    Args:
        data: windows of every run.
        model: with the outage.
        outage: of an actuator, with intervals.

    Returns:
        Empty where the outage is of no single actuator, or the commands of runs are different.
    """
    ship, signals = model.ship, common_commands(data)
    its = [a for a in actuators(ship.description) if outage.id == f"{a.part.name}{OUTAGE}"]
    if not (signals and its):
        return []
    columns = [*_columns(its[0], signals, ship)]
    found = []
    for number, w in enumerate(data):
        here = model.during(w.run.name)
        times = [(here.value(a), here.value(b)) for a, b in outage.search.intervals]
        works = here.plus({b: -here.value(b) for _, b in outage.search.intervals})
        for start, end in times:
            rows = slice(*np.searchsorted(w.run.time, (start, end)))
            if rows.stop > rows.start:
                parts = [np.zeros((v.middle.size, 3)) for v in data]
                parts[number] = _held(w, works, rows, columns)
                found.append(np.concatenate(parts))
    return found


def _held(w: WeakWindows, model: Model, rows: slice, columns: Sequence[int]) -> np.ndarray:
    """(K, 3), force of commands in some rows of a run that are held, beyond that of none."""
    forces, given = [], w.run.given
    for size in (0.0, float(np.sqrt(np.mean(given[:, columns[0]] ** 2)))):
        held = given.copy()
        held[rows, columns] = [size, *np.median(given[rows, columns[1:]], axis=0)]
        forces.append(model_error([w.commanded_as(w.run.with_given(held))], model))
    return forces[0] - forces[1]


def _columns(a: Actuator, signals: Sequence[str], ship: Ship) -> range:
    """Columns of an actuator's commands in a run: its own, or those of its group."""
    count, apart = len(a.law.commands), len(signals) != len(ship.layouts[0].commands)
    return range(a.own, a.own + count * len(a.sides)) if apart else range(a.first, a.first + count)


def _alike(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether all but a negligible part of a channel (K,) is in proportion to another one."""
    return (
        float(one @ other) ** 2 >= (1.0 - NEGLIGIBLE**2) * float(one @ one) * float(other @ other) > 0.0
    )


def _sizes(w: WeakWindows, commands: Sequence[int]) -> np.ndarray:
    """(K, m), means over windows of the sizes of some commands, of v and of r."""
    nu = np.where(w.known, w.smoothed.nu.T, 0.0)
    given = w.held @ np.abs(w.run.given[:, commands])
    return np.column_stack([given, *(w.smooth @ np.abs(x) for x in nu[1:])])
