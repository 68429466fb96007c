"""Which additional force explains what parameters do not."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..execution.progress import Advance
from ..predictors.weak_form import SMALL
from ..runs.run_constants import DIGITS, LEVEL, SAME
from ..search.shortlist import LENGTH
from .additional_force import SYMBOLS, AdditionalForce
from .parameter_fit import ParameterFit, added, fit
from .residuals import Setting, WindowResiduals

# Central, forward, backward: how an FMU integrates decides which difference its own rate is.
RATES = (np.gradient, lambda y: np.diff(y, append=y[-1]), lambda y: np.diff(y, prepend=y[0]))


@dataclass(frozen=True, eq=False)
class Accepted:
    """An additional force that is in the model.

    Attributes:
        force: with its coefficient.
        probability: that it is the cause, of all candidates and of none.
        together: the same of it and of those that cannot be distinguished from it.
        alike: these.
    """

    force: AdditionalForce
    probability: float
    together: float
    alike: tuple[str, ...]


def candidates(
    inputs: Sequence[str], outputs: Sequence[str], measured: Sequence[str]
) -> list[AdditionalForce]:
    """The forces that are tried.

    Args:
        inputs: on which they may act.
        outputs: that they may be functions of.
        measured: those of which the derivative by time is tried as well.
    """
    found = []
    for i in inputs:
        found.append(AdditionalForce(i))
        for y in outputs:
            rates = (False, True) if y in measured else (False,)
            found += [AdditionalForce(i, y, k, rate) for rate in rates for k in range(1, len(SYMBOLS))]
    return found


def search(
    r: WindowResiduals,
    at: ParameterFit,
    others: Sequence[ParameterFit],
    possible: Sequence[AdditionalForce],
    usual: dict[str, float],
    temper_of: Callable[[ParameterFit], float],
    advance: Advance,
) -> tuple[ParameterFit, Accepted] | None:
    """The force that explains most beyond the parameters, if it is more than chance.

    Every candidate is as probable as any other, and all together as none (Schwarz, 1978, for the
    coefficient; Laplace for the parameters).

    Args:
        r: the residuals.
        at: the fit without it.
        others: further fits from which the search begins.
        possible: the candidates.
        usual: of each input a usual size.
        temper_of: by which squares are divided where the residuals of a fit are not as white as noise.
        advance: receives the name of each step.
    """
    advance("which additional force explains the residual")
    present = {f.id for f in at.setting.forces}
    best: dict[str, tuple[ParameterFit, AdditionalForce, Sequence[str]]] = {}
    charge = 0.0
    for begin in (at, *others):
        tried = [f for f in _distinct(r, begin, possible) if f.id not in present]
        scaled = _scaled(r, begin, tried, usual)
        if not scaled:
            continue
        kept, same = _promising(begin, scaled)
        charge = max(charge, float(np.log(r.samples) + 2.0 * np.log(len(scaled))))
        for gain, force, size in kept:
            if gain < charge / 4.0:  # a fit gains hardly more than its slopes promise
                continue
            advance(f"fit with {force.id}")
            one = fit(r, *added(begin, force, size))
            if force.id not in best or one.cost < best[force.id][0].cost:
                best[force.id] = one, force, same.get(force.id, ())
    if not best:
        return None
    temper = temper_of(min((one for one, *_ in best.values()), key=lambda one: one.cost))
    fits = [
        (2.0 * (one.log_evidence - at.log_evidence) / temper - charge, one, force)
        for one, force, _ in best.values()
    ]
    fits.sort(key=lambda x: -x[0])
    if fits[0][0] <= 0.0:
        return None
    log = 0.5 * np.array([0.0, *(score for score, *_ in fits)])
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    own, unlikely = weight[1:], 1.0 - LEVEL
    first, (_, one, force) = float(own[0]), fits[0]
    near = [f.id for w, (_, _, f) in zip(own, fits, strict=True) if f.id != force.id and w > unlikely]
    alike = (*dict.fromkeys((*best[force.id][2], *near)),)
    together = float(own[own > unlikely].sum())
    return one, Accepted(one.setting.forces[-1], first, together, alike)


def _promising(
    at: ParameterFit, scaled: Sequence[tuple[AdditionalForce, float, np.ndarray]]
) -> tuple[list[tuple[float, AdditionalForce, float]], dict[str, list[str]]]:
    """The forces that promise most by slopes, all parameters free, and to each those like it.

    Returns:
        Gain in cost, force, and unit of its coefficient, of each; id -> ids of those like it.
    """
    p = len(at.setting.z)
    J = np.concatenate([at.slopes, np.eye(p, at.slopes.shape[1])])
    e = np.concatenate([at.residuals, at.setting.z])
    Q = np.linalg.qr(J)[0] if J.shape[1] else np.zeros((len(e), 0))
    ranked = []
    for force, size, s in scaled:
        beyond = np.concatenate([s, np.zeros(p)])
        beyond = beyond - Q @ (Q.T @ beyond)
        norm = float(np.linalg.norm(beyond))
        # What the parameters do as well is no candidate: its change is theirs to rounding.
        if norm > SMALL * np.linalg.norm(s):
            ranked.append((float(beyond @ e) ** 2 / norm**2, force, size, beyond / norm))
    ranked.sort(key=lambda x: -x[0])
    kept, same = [], {}
    for entry in ranked:
        twin = next((k for k in kept if _same(k[0], float(k[3] @ entry[3]))), None)
        if twin is not None:
            same.setdefault(twin[1].id, []).append(entry[1].id)
        elif len(kept) < LENGTH:
            kept.append(entry)
    return [entry[:3] for entry in kept], same


def _same(gain: float, correlation: float) -> bool:
    """Whether the runs do not discriminate two forces: the second would gain hardly less."""
    lost = gain * (1.0 - correlation**2)
    return abs(correlation) > SAME and lost < -2.0 * float(np.log(1.0 - LEVEL))


def _distinct(
    r: WindowResiduals, at: ParameterFit, possible: Sequence[AdditionalForce]
) -> list[AdditionalForce]:
    """The forces without those of a signal that is another one by another name."""
    outputs = [p.outputs for p in r.predict([at.setting])[0]]
    signals: dict[tuple[str, bool], np.ndarray] = {("", False): np.zeros(0)}
    wanted = {(f.output, f.rate) for f in possible if f.output}
    for name, rate in sorted(wanted, key=lambda key: (key[1], r.processes.outputs.index(key[0]))):
        k = r.processes.outputs.index(name)
        each = [_unit([along(y[:, k]) for y in outputs]) for along in (RATES if rate else (np.array,))]
        known = [x for x in signals.values() if x.size]
        if each[0].any() and all(abs(float(y @ x)) < SAME for y in each for x in known):
            signals[name, rate] = each[0]
    return [f for f in possible if (f.output, f.rate) in signals]


def _unit(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Signals about their means, as one of length 1; zero where they are constant."""
    y = np.concatenate([part - part.mean() for part in parts])
    size = float(np.linalg.norm(y))
    return y / size if size > 0.0 else y


def _scaled(
    r: WindowResiduals, at: ParameterFit, forces: Sequence[AdditionalForce], usual: dict[str, float]
) -> list[tuple[AdditionalForce, float, np.ndarray]]:
    """Each force with a unit of its coefficient, and the slope (n,) of the residuals by that unit.

    A unit changes the residuals by their own size. Those that change nothing are left out.
    """
    base = at.residuals
    wanted = max(float(np.linalg.norm(base)), 1.0)
    sizes = {o: _size(r, k) for k, o in enumerate(r.processes.outputs)}

    def by(pairs: Sequence[tuple[AdditionalForce, float]]) -> list[np.ndarray]:
        settings = [
            Setting(at.setting.z, (*at.setting.forces, replace(f, coefficient=c))) for f, c in pairs
        ]
        return [x - base for x in r.whitened(settings)]

    def first(f: AdditionalForce) -> float:
        y = sizes.get(f.output, 1.0) if f.output else 1.0
        if f.rate:
            y /= max(float(np.median([w.time[-1] for w in r.windows])) / 10.0, DIGITS)
        return SMALL * usual[f.input] / max(y, DIGITS) ** f.power

    guess = [(f, first(f)) for f in forces]
    found = []
    for (f, c), change in zip(guess, by(guess), strict=True):
        norm = float(np.linalg.norm(change))
        if np.isfinite(norm) and norm > DIGITS:
            found.append((f, c * 0.1 * wanted / norm))
    changes = zip(found, by(found), strict=True)
    return [
        (f, 10.0 * c, 10.0 * change)
        for (f, c), change in changes
        if np.isfinite(change).all() and change.any()
    ]


def _size(r: WindowResiduals, k: int) -> float:
    """A usual size of an output: of a measured one its spread, of another one that of its prediction."""
    if k < r.noise.size:
        y = np.concatenate([w.measured[:, k] for w in r.windows])
    else:
        y = np.concatenate([p.outputs[:, k] for p in r.predict([r.start])[0]])
    return max(float(np.sqrt(np.nanmean(y**2))), DIGITS) if np.isfinite(y).any() else 1.0
