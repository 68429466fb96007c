"""Findings that together make up a law which no candidate has, so that none of them is known."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, combinations

import numpy as np

from fmus.effects.effect import Effect

from ..predictors import Model, WeakWindows, omega
from ..runs.run_constants import FAR_OFF, NEGLIGIBLE
from ..search.findings import Finding, Findings
from .confidence import EVEN_ODDS, Confidence, most_by_intervals


def in_parts(found: Findings, start: Model, alone: Sequence[Confidence]) -> set[str]:
    """Axes on which a finding and another one are laws of the hull of one family.

    Of a law in a shape that no candidate has, they make up the parts: of a cubic one, too much by its
    square and too little by its line. A coefficient that is FAR_OFF from its prior is such a part, too:
    with it the fit has another law than the one that is described.

    Args:
        found: the findings.
        start: the initial model.
        alone: the confidence of each, all others left out of account.
    """
    effects = start.ship.effects
    laws = [
        effect
        for f, c in zip(found.effects, alone, strict=True)
        if c.is_finding and (effect := effects[f.id]).kind == "force"
    ]
    moved = {name for name, z in found.moved.items() if abs(z) > FAR_OFF}
    forces = (e for e in effects.values() if e.kind == "force" and e not in laws)
    others = [e for e in forces if e.adds_to and moved.issuperset(chain(*e.adds_to.values()))]
    known, count = (Counter(map(_family, part)) for part in (laws, [*laws, *others]))
    return {axis for family in known if count[family] > 1 for axis in family[0]}


def _family(law: Effect) -> tuple[str, str]:
    """The axes of a law, and the manoeuvres that bring it out."""
    return law.axis, law.wording.family.name


def shape_corrected(
    found: Findings, start: Model, falls: np.ndarray, squares: np.ndarray, alone: Sequence[Confidence]
) -> dict[str, float]:
    """The findings on one axis of which one explains next to nothing there, and the other more.

    Of a cause in a shape that no candidate has, the nearest candidate is found first. Small effects then
    mend its shape, until no residual is left to speak against it; they need not be findings themselves.
    What is so near zero that of all candidates one is by chance mends nothing, nor does a possibility
    that is a change of coefficients within their stated deviations: these are likelier, and no cause.
    A small effect on the measurement is in doubt, and says nothing of a force; a large one hides forces
    that are smaller, and may be corrected by another on the measurement.

    Args:
        found: the findings.
        start: the initial model.
        falls: (findings, 3), shares of the error's sum of squares of each axis, by which it falls with
            each finding.
        squares: (findings, 3), sums of squares of the force of each [N2, N2, N2 m2].
        alone: the confidence of each, all others left out of account.

    Returns:
        Id -> square of the force of a smaller one, as a share of that of the finding, the largest of the
        axes on which that explains more; of a smaller one it is 1.
    """
    effects, shares = start.ship.effects, dict[str, float]()
    of_measurement = {i for i, effect in effects.items() if effect.kind == "measurement"}
    judged = [
        (f, fall, square, c.is_finding)
        for f, fall, square, c in zip(found.effects, falls, squares, alone, strict=True)
        if effects[f.id].search.by == "regression"
    ]
    for small, fall, square, believed in judged:
        axes = ["XYN".index(axis) for axis in effects[small.id].axis]
        if fall[axes].max() >= NEGLIGIBLE or most_by_intervals(small, start) <= EVEN_ODDS:
            continue
        if not believed and _as_stated(small, found.model, start):
            continue
        for large, more, own, is_finding in judged:
            # Coefficients fitted with the larger one may explain an axis on which it has no force.
            shown = [k for k in axes if more[k] - fall[k] > NEGLIGIBLE and own[k] > 0.0]
            mending = {small.id, large.id} & of_measurement
            if not (shown and is_finding) or mending == {large.id}:
                continue
            if believed:
                shares[small.id] = 1.0
            if len(mending) != 1:
                share = max(float(square[k] / own[k]) for k in shown)
                shares[large.id] = max(share, shares.get(large.id, 0.0))
    return shares


def _as_stated(f: Finding, model: Model, start: Model) -> bool:
    """Whether an effect of a model is a change of coefficients that their stated deviations allow."""
    known, adds_to = start.ship.coefficients, start.ship.effects[f.id].adds_to

    def is_allowed(name: str, added: float) -> bool:
        if name not in known:
            return False
        change = model.value(name) - start.value(name) + added
        return abs(change) <= FAR_OFF * known[name].deviation(start.value(name))

    # A lag is a coefficient and an effect, by one name: it is not added to itself.
    added = ((name, x * (name != p)) for p, x in f.values.items() for name in adds_to.get(p, (p,)))
    return all(is_allowed(name, x) for name, x in added)


def next_to_possibility(
    found: Findings, explained: Sequence[float], alone: Sequence[Confidence]
) -> dict[str, float]:
    """The findings that explain next to nothing, and less than a mere possibility, by their ids.

    Of a cause that no candidate has, the nearest candidates take the most. What is found in the rest is
    what these have left, and another explanation of the most would leave something else.

    Args:
        found: the findings.
        explained: share of the error that each explains.
        alone: the confidence of each, all others left out of account.

    Returns:
        Id -> probability that the possibility which explains the most, or its set, is a true cause.
    """
    each = [*zip(found.effects, explained, alone, strict=True)]
    possible = ((share, c.of_set) for _, share, c in each if not c.is_finding)
    most, sure = max(possible, default=(0.0, 1.0))
    effects = found.model.ship.effects
    small = (f for f, share, _ in each if share < min(NEGLIGIBLE, most))
    return {f.id: sure for f in small if not effects[f.id].search.times}


def on_one_line(found: Findings, start: Model, runs: Sequence[WeakWindows]) -> set[str]:
    """Ids of the changes of actuators whose forces act on one line, two or more.

    Of a force in a shape that no candidate has, they make up the parts: of a side force at the stern
    with the square of the shaft speed, an inclined propeller and a rudder that is off. What acts later
    than the command, or only at times of one run, is a part of no force that does not. Forces act on
    one line where less than NEGLIGIBLE of the square of either is off the line of the other.

    Args:
        found: the findings, and the model with them.
        start: the initial model.
        runs: training runs.
    """
    effects = start.ship.effects
    of_actuators = [
        f
        for f in found.effects
        if (e := effects[f.id]).kind == "actuator" and e.memory is None and not f.of_runs
    ]
    if len(of_actuators) < 2:
        return set()
    lines = {f.id: _line(f, found.model, runs) for f in of_actuators}
    pairs = combinations(lines, 2)
    on_line = [(a, b) for a, b in pairs if np.sum(np.cross(lines[a], lines[b]) ** 2) < NEGLIGIBLE]
    return {i for pair in on_line for i in pair}


def of_several(found: Findings, start: Model) -> set[str]:
    """Ids of the changes of one actuator, of which another one's coefficient has changed half as much.

    Lags of two propellers are longer, and one is a finding: the other is only a coefficient.

    Args:
        found: the findings, and the model with them.
        start: the initial model.
    """
    names = [a.name for a in start.ship.description.actuators]

    def is_shared(name: str, change: float) -> bool:
        own = next((n for n in names if name.endswith(f"_{n}")), "")
        others = {f"{name.removesuffix(own)}{n}" for n in names if own and n != own} & found.moved.keys()
        return any((found.model.value(n) - start.value(n)) / change >= 0.5 for n in others)

    return {f.id for f in found.effects if any(x and is_shared(n, x) for n, x in f.values.items())}


def squares(found: Findings, runs: Sequence[WeakWindows]) -> np.ndarray:
    """(findings, 3), sums of squares of the force of each effect on each axis [N2, N2, N2 m2]."""
    forces = ([*_forces(f, found.model, runs)] for f in found.effects)
    return np.array([np.square(np.concatenate(each)).sum(axis=0) for each in forces]).reshape(-1, 3)


def _forces(f: Finding, model: Model, runs: Sequence[WeakWindows]) -> Iterator[np.ndarray]:
    """Of each run the force (K, 3) of an effect of a model [N, N, N m]."""
    without = model.plus({name: -value for name, value in f.values.items()})
    return (omega(w, without) - omega(w, model) for w in runs)


def _line(f: Finding, model: Model, runs: Sequence[WeakWindows]) -> np.ndarray:
    """(3,), unit vector of the line of an effect's force (X, Y, N), in units of the size of the ship."""
    each = zip(_forces(f, model, runs), runs, strict=True)
    force = np.concatenate([one / w.scale.forces for one, w in each])
    return np.asarray(np.linalg.svd(force, full_matrices=False)[2][0])
