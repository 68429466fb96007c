"""The candidate causes that a diagnosis leaves, and what their parameters do to the model error."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ..execution.short_text import SHOWN
from ..predictors import Model, WeakWindows
from ..predictors.uncertainty import independent, omega_std
from ..predictors.weak_form import OVERLAP
from ..runs.run_constants import DIGITS, STEPS
from ..search.candidates import SMALL, CandidateShape, candidate, model_error, shape
from ..search.nonlinear.multistart import WIDEST
from ..search.prior import NominalPrior
from ..search.refinement import bounded
from ..search.shortlist import LENGTH
from .information import Hypothesis, Knowledge


class Rival(NamedTuple):
    """An effect that a diagnosis accepted, and what the data cannot discriminate from it.

    Attributes:
        ids: the effect, then the others; an empty id: nothing at all.
        confidence: of the effect; NaN: not known.
    """

    ids: tuple[str, ...]
    confidence: float


@dataclass(frozen=True, eq=False)
class EffectParameters:
    """Parameters of one effect, about a point.

    Attributes:
        given: values of the effect at the point, as additions to the model.
        names: parameters with a slope there.
        steps: of their finite differences, SI; each is the unit of a column.
        precision: (p, p), of values that follow each other, in these units; None: 0.
    """

    given: Mapping[str, float]
    names: tuple[str, ...]
    steps: tuple[float, ...]
    precision: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Space:
    """All parameters of all hypotheses, and the noise by which they are weighed.

    Attributes:
        initial: the initial model.
        start: the model that all are additions to: the initial one with the coefficients as learned.
        prior: of the nominal coefficients.
        blocks: effect -> its parameters.
        sigma: (3,), noise of the model error that counts for one window [N, N, N m].
        lasting: (3,), windows that count as one.
    """

    initial: Model
    start: Model
    prior: NominalPrior
    blocks: Mapping[str, EffectParameters]
    sigma: np.ndarray
    lasting: np.ndarray

    @property
    def nuisance(self) -> list[str]:
        """The nominal coefficients that are not known exactly."""
        return self.prior.uncertain

    @property
    def offset(self) -> np.ndarray:
        """(q,), by how many standard deviations these are off the mean of their prior in ``start``."""
        mean, std = self.prior.mean, self.prior.std
        return np.array([(self.start.value(n) - mean[n]) / std[n] for n in self.nuisance])

    def columns(self, data: Sequence[WeakWindows]) -> np.ndarray:
        """(K, 3, p): change of the model error by one unit of each parameter, in units of the noise.

        Of a nominal coefficient the unit is its prior standard deviation. Each effect has first what it
        gives at its point, then its slopes there by their steps.
        """
        base = model_error(data, self.start)
        found = [
            (base - model_error(data, self.start.plus({n: SMALL * self.prior.std[n]}))) / SMALL
            for n in self.nuisance
        ]
        for block in self.blocks.values():
            model = self.start.plus(block.given)
            at = model_error(data, model) if block.given else base
            found.append(base - at)
            for n, h in zip(block.names, block.steps, strict=True):
                found.append((at - model_error(data, model.plus({n: SMALL * h}))) / SMALL)
        return np.stack([c / self.sigma for c in found], axis=2)

    def rows(self, data: Sequence[WeakWindows]) -> np.ndarray:
        """(3 K, p), the same with a row for each axis of each window."""
        columns = self.columns(data)
        return columns.reshape(-1, columns.shape[2])

    def gram(self, data: Sequence[WeakWindows]) -> np.ndarray:
        """(p, p), Gram matrix of the columns."""
        A = self.rows(data)
        return A.T @ A

    def places(self) -> dict[str, np.ndarray]:
        """Effect -> indices of its parameters."""
        found, first = {}, len(self.nuisance)
        for name, block in self.blocks.items():
            found[name] = np.arange(first, first + 1 + len(block.names))
            first += 1 + len(block.names)
        return found

    def model(self, h: Hypothesis, z: np.ndarray) -> Model:
        """The model of a hypothesis with the parameters z (p,)."""
        changes = {
            n: float(x) * self.prior.std[n] for n, x in zip(self.nuisance, z, strict=False) if x != 0.0
        }
        for name in h.ids:
            block, own = self.blocks[name], z[self.places()[name]]
            for n in block.given:
                changes[n] = changes.get(n, 0.0) + block.given[n]
            for n, x, step in zip(block.names, own[1:], block.steps, strict=True):
                changes[n] = changes.get(n, 0.0) + float(x) * step
        return self.start.plus({n: bounded(self.start, n, x) for n, x in changes.items()})


def learned_changes(content: Mapping[str, Any]) -> dict[str, float]:
    """What a diagnosis changed: parameter -> learned value less that of the initial model, SI."""
    each = content.get("coefficients", ())
    changes = {c["name"].partition(".")[2]: c["after"] - c["before"] for c in each}
    return {name: x for name, x in changes.items() if x}


def rivals(content: Mapping[str, Any]) -> list[Rival]:
    """The effects and their rivals by the content of ``diagnosis.json``."""
    found = []
    for key in ("effects", "possibilities"):
        for e in content[key]:
            ids = (e["id"], *e["indistinguishable"], *([""] if key == "possibilities" else []))
            found.append(Rival(ids, np.nan if e["confidence"] is None else e["confidence"]))
    if not found and content["verdict"] == "unexplained":
        found = [Rival((*(r["id"] for r in content["ranking"][:SHOWN]), ""), np.nan)]
    return found


def usable(model: Model, name: str) -> bool:
    """Whether an effect can be designed for: it has parameters that do not depend on the run's clock."""
    e = model.ship.effects.get(name)
    return not name or (e is not None and e.search.by == "regression" and not e.search.times)


def space_of(
    data: Sequence[WeakWindows],
    initial: Model,
    prior: NominalPrior,
    ids: Sequence[str],
    learned: Mapping[str, float],
) -> tuple[Space, np.ndarray, np.ndarray]:
    """The parameters of some effects on measured runs; prior precision (p, p) and mean (p,) of all.

    Everything is linear about what was learned; arguments as of :func:`knowledge`.
    """
    effects = [initial.ship.effects[name] for name in ids]
    own = [{p.name: learned[p.name] for p in e.parameters if p.name in learned} for e in effects]
    # A lag is a coefficient and an effect: where it is a hypothesis, it is no part of the start.
    moved = learned.keys() - {n for values in own for n in values}
    start = initial.plus({n: learned[n] for n in prior.uncertain if n in moved})
    base = model_error(data, start)
    noise = np.sqrt(np.mean(np.concatenate([omega_std(w, start) for w in data]) ** 2, axis=0))
    blocks: dict[str, EffectParameters] = {}
    for name, effect, values in zip(ids, effects, own, strict=True):
        if values:
            shapes = [shape(data, start, base, values, effect.fitted, SMALL)]
        else:
            shapes = candidate(data, start, base, effect).shapes
        if shapes:
            blocks[name] = block_of(start, shapes, base, noise)
    A = Space(initial, start, prior, blocks, noise, np.ones(3)).rows(data)
    fit = A @ np.linalg.lstsq(A, (base / noise).ravel(), rcond=1e-8)[0]
    left = base - fit.reshape(base.shape) * noise
    spread = np.maximum(noise, np.sqrt(np.mean(left**2, axis=0)))
    lasting = OVERLAP * independent(data, left)
    space = Space(initial, start, prior, blocks, spread * np.sqrt(lasting), lasting)
    size = np.linalg.norm(base / space.sigma)
    precision, mean = [np.eye(len(space.nuisance))], [-space.offset]
    columns = space.rows(data)
    for name, place in space.places().items():
        norms = np.linalg.norm(columns[:, place[1:]], axis=0)
        width = WIDEST * size / np.maximum(norms, 1e-6 * max(norms.max(initial=0.0), size))
        smooth = blocks[name].precision
        own = np.diag(1.0 / width**2) + (0.0 if smooth is None else smooth)
        precision.append(np.asarray(block_diag(1.0 / DIGITS, own)))
        mean.append(np.array([1.0 if blocks[name].given else 0.0, *np.zeros(len(width))]))
    return space, np.asarray(block_diag(*precision)), np.concatenate(mean)


def _left(s: CandidateShape, y: np.ndarray, noise: np.ndarray) -> float:
    """Sum of squares that a shape leaves of the model error y (K, 3), in units of the noise."""
    rest = (y if s.offset is None else y - s.offset / noise).ravel()
    A = (s.columns / noise[:, None]).reshape(rest.size, -1)
    fit = A @ np.linalg.lstsq(A, rest, rcond=None)[0] if A.shape[1] else 0.0
    return float(np.sum((rest - fit) ** 2))


def block_of(
    start: Model, shapes: Sequence[CandidateShape], base: np.ndarray, noise: np.ndarray
) -> EffectParameters:
    """The parameters of an effect about its best shape: those that scale it, and those that make it.

    Args:
        start: the initial model.
        shapes: of the effect.
        base: (K, 3), model error.
        noise: (3,), by which an axis counts.
    """
    s = min(shapes, key=lambda s: _left(s, base / noise, noise))
    names = tuple(dict.fromkeys([*s.fitted, *s.given]))
    unit = [start.unit(n) for n in names]
    steps = [abs(s.given[n]) or u if n in s.given else u for n, u in zip(names, unit, strict=True)]
    smooth = None if s.precision is None else s.precision * np.outer(steps, steps)
    return EffectParameters(dict(s.given), names, tuple(steps), smooth)


def knowledge(
    data: Sequence[WeakWindows],
    start: Model,
    prior: NominalPrior,
    found: Sequence[Rival],
    learned: Mapping[str, float] = MappingProxyType({}),
) -> tuple[Space, Knowledge]:
    """The hypotheses of a diagnosis on the runs that it was made of.

    Weights are the confidences of the diagnosis; what these leave open among the rivals of an effect is
    shared by the evidence of the runs. Of an effect without a rival they leave other coefficients, or
    nothing, which are no hypotheses: then none may hold.

    Args:
        data: the runs.
        start: the initial model.
        prior: of its coefficients.
        found: effects and their rivals, see :func:`rivals`.
        learned: see :func:`learned_changes`.
    """
    sets = [tuple(i for i in r.ids if usable(start, i)) for r in found]
    ids = [*dict.fromkeys(i for s in sets for i in s if i)]
    space, precision, mean = space_of(data, start, prior, ids, learned)
    chosen = [
        tuple(dict.fromkeys(i for i in each if i in space.blocks))
        for each in product(*[s for s in sets if s])
    ]
    A, q, places = space.rows(data), len(space.nuisance), space.places()
    y = (model_error(data, space.start) / space.sigma).ravel()
    hypotheses = []
    for names in dict.fromkeys(chosen or [()]):
        own = np.concatenate([np.zeros(0, int), *(places[n] for n in names)])
        hypotheses.append(Hypothesis(names, np.concatenate([np.arange(q), own]), own))
    even = np.full(len(hypotheses), 1.0 / len(hypotheses))
    alone = [r.confidence for r in found if len(r.ids) == 1 and np.isfinite(r.confidence)]
    listed = min(alone, default=1.0)
    k = Knowledge(hypotheses, even, A.T @ A, A.T @ y, precision, mean, listed)
    weights = _weights(k, found)
    best = np.argsort(-weights, kind="stable")[:LENGTH]
    kept = weights[best] / weights[best].sum()
    return space, replace(k, hypotheses=[hypotheses[n] for n in best], weights=kept)


def _weights(k: Knowledge, found: Sequence[Rival]) -> np.ndarray:
    """(h,), the confidence of each accepted effect, its rest shared among its rivals by evidence.

    By iterative proportional fitting (Deming and Stephan 1940), as what has one effect may lack another.
    """
    evidence = np.exp(k.log_evidence - k.log_evidence.max())
    weights = evidence / evidence.sum()
    for r in [*found] * STEPS:
        has = np.array([r.ids[0] in h.ids for h in k.hypotheses])
        if np.isfinite(r.confidence) and has.any() and not has.all():
            for part, share in ((has, r.confidence), (~has, 1.0 - r.confidence)):
                total = weights[part].sum()
                weights[part] = share * (weights[part] / total if total > 0.0 else 1.0 / part.sum())
    return weights / weights.sum()
