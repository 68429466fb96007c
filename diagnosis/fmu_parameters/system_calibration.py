"""Is a parameter off, or is something missing? The fit of parameters, the search, and one verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import chdtri

from ..execution.progress import Advance, silent
from ..predictors.prediction import FAR_OFF
from ..runs.cleaning import normal_within
from ..runs.run_constants import CHANCE
from ..search.findings import MOST_REPORTED
from ..search.prediction_fit.joint_posterior import together
from ..search.shortlist import TIE
from ..verdict.confidence import EVEN_ODDS, FOUND
from .additional_force import AdditionalForce
from .force_search import Accepted, search
from .parameter_file import CalibratedParameter
from .parameter_fit import ParameterFit, fit, fitted, intervals
from .residuals import Setting, WindowResiduals, rms_of
from .system_remainder import SystemRemainder, change_of_squares, inflation, remainder

Verdict = Literal["found", "ambiguous", "parameters", "unexplained", "none"]


@dataclass(frozen=True)
class CalibratedValue:
    """A parameter after the calibration.

    Attributes:
        parameter: with its prior.
        value, ci95: in its unit.
        z: prior standard deviations from its prior mean.
        moved: whether the runs show that it is off.
    """

    parameter: CalibratedParameter
    value: float
    ci95: tuple[float, float]
    z: float
    moved: bool


@dataclass(frozen=True, eq=False)
class SystemCalibration:
    """A verdict, and what it rests on.

    Attributes:
        verdict: by the rule of :func:`verdict_of`.
        values: of all parameters, as the learned model has them.
        forces: what was accepted.
        remainder: what the learned model leaves.
        rejected: why nothing was learned though something was fitted; empty: it was kept.
        together: groups of values that are known only together.
        fit: the most likely values.
        covariance: (q, q), of z and of coefficients, the latter in their units.
        errors: run -> output -> rms before and after.
        changes: run that was not learned from -> change of the whitened sum of squares, and its paired
            standard error [1].
        faults: what could not be asked.
    """

    verdict: Verdict
    values: Sequence[CalibratedValue]
    forces: Sequence[Accepted]
    remainder: SystemRemainder
    rejected: str
    together: Sequence[Sequence[str]]
    fit: ParameterFit
    covariance: np.ndarray
    errors: Mapping[str, Mapping[str, tuple[float, float]]]
    changes: Mapping[str, tuple[float, float]]
    faults: Sequence[str]

    @property
    def changed(self) -> bool:
        """Whether the learned model differs from the first."""
        return not self.rejected and self.verdict != "none"


def calibrate(
    parts: Mapping[str, WindowResiduals],
    possible: Sequence[AdditionalForce],
    names: Sequence[str],
    units: Sequence[str],
    usual: Mapping[str, float],
    advance: Advance = silent,
) -> SystemCalibration:
    """Fit parameters to runs, find what is missing in addition, and judge.

    Args:
        parts: residuals of the runs to learn from, ``train``, and as far as there are any, of those that
            decide, ``validate``, and of those that only judge, ``test``.
        possible: forces that may act in addition.
        names, units: of the measured outputs.
        usual: of each input on which such a force acts a usual size.
        advance: receives the name of each step.

    Raises:
        InputError: the FMU fails at its start values.
    """
    train, start = parts["train"], parts["train"].start
    advance("predictions with the start values")
    train.whiten_about(start)
    before = fit(train, start, (), range(len(start.z)))
    advance("fit of the parameters")
    alone = fitted(train, start)
    (first_white,) = train.whitened([start])
    first = remainder(train, first_white, first_white, 0, names, units)

    def left(f: ParameterFit) -> SystemRemainder:
        return remainder(train, f.residuals, first_white, f.slopes.shape[1], names, units)

    def far(f: ParameterFit) -> bool:
        return any(abs(z) > FAR_OFF for z in f.setting.z)

    best, accepted = alone, []

    def temper(f: ParameterFit) -> float:
        return 1.0 if left(f).by_chance else inflation(train, f.residuals, f.slopes, f.precision)

    while possible and len(accepted) < MOST_REPORTED and (left(best).significant or far(best)):
        # Parameters that imitate a force may be far from where they are with it.
        held = Setting(start.z, best.setting.forces)
        others = [fit(train, held, best.sizes, range(len(start.z)))] if far(best) else []
        found = search(train, best, others, possible, dict(usual), temper, advance)
        if found is None:
            break
        best = fitted(train, found[0].setting, found[0].sizes)
        # The fit may have moved the earlier forces as well.
        accepted = [
            replace(a, force=f) for a, f in zip([*accepted, found[1]], best.setting.forces, strict=True)
        ]
    rest, grown = left(best), temper(best)
    covariance = best.covariance * grown
    moved = _moved(train, best, grown)
    rejected = _rejected(parts.get("validate"), best, start)
    verdict = verdict_of(accepted, moved, best, rest, bool(rejected))
    advance("intervals")
    ends = intervals(train, best, grown)
    kept = not rejected and verdict != "none"
    values = [
        CalibratedValue(p, p.at(z) if kept else p.value, e, z, bool(m))
        for p, z, e, m in zip(train.parameters, best.setting.z, ends, moved.each, strict=True)
    ]
    learned = best.setting if kept else start
    errors: dict[str, dict[str, tuple[float, float]]] = {}
    changes: dict[str, tuple[float, float]] = {}
    for use, part in parts.items():
        errors |= _errors(part, start, learned, names)
        if use != "train":
            part.whiten_about(start)
            old, new = part.whitened([start, learned])
            changes |= {w.run: change_of_squares(part, old, new, [w.run]) for w in part.windows}
    every = [*(p.name for p in train.parameters), *(f.id for f in best.setting.forces)]
    return SystemCalibration(
        verdict,
        values,
        accepted if kept else [],
        rest if kept else first,
        rejected,
        together(every, covariance),
        best,
        covariance,
        errors,
        changes,
        (*before.faults, *best.faults, *filter(None, [train.failures])),
    )


@dataclass(frozen=True)
class Moved:
    """Whether parameters are off: together by a likelihood ratio, and each."""

    any: bool
    each: Sequence[bool]


def _moved(r: WindowResiduals, best: ParameterFit, grown: float) -> Moved:
    """Which parameters the runs show to be off, forces fitted anew where they are not."""
    p = len(best.setting.z)
    if not p:
        return Moved(False, ())
    held = Setting(r.start.z, best.setting.forces)
    if not np.isfinite(r.whitened([held])[0]).all():  # forces of other parameters make the FMU diverge
        held = held.with_coefficients([0.0] * len(held.forces))
    other = fit(r, held, best.sizes, range(p))
    ratio = (other.data_cost - best.data_cost) / grown
    some = bool(ratio > chdtri(p, CHANCE))
    # Beyond the interval that holds all of them with 99 %.
    wide = normal_within(1.0 - CHANCE / max(p, 1))
    std = np.sqrt(grown * np.diag(best.covariance)[:p])
    each = [some and abs(z) > wide * s for z, s in zip(best.setting.z, std.tolist(), strict=True)]
    return Moved(some, each)


def verdict_of(
    forces: Sequence[Accepted], moved: Moved, best: ParameterFit, rest: SystemRemainder, rejected: bool
) -> Verdict:
    """The verdict, by the rule of ships with parameters in place of coefficients.

    A force with a probability of 0.8 or more is found, with less than that its set is ambiguous; else
    parameters that are off explain the runs if nothing significant is left. Which of them is off must be
    known. Beyond three prior standard deviations a force was looked for, and explained less.
    """
    if rejected:
        return "unexplained"
    # Where half of the first squares of an output or more is left nothing is explained.
    large = rest.significant and any(o.share > EVEN_ODDS and o.matters for o in rest.outputs)
    if forces and forces[0].together >= EVEN_ODDS and not large:
        return "found" if forces[0].probability >= FOUND and not forces[0].alike else "ambiguous"
    if rest.significant:
        return "unexplained"
    if not moved.any:
        return "none"
    return "parameters" if any(moved.each) else "ambiguous"


def _rejected(validate: WindowResiduals | None, best: ParameterFit, start: Setting) -> str:
    """Why validation runs reject what was learned; empty: they do not."""
    if validate is None:
        return ""
    validate.whiten_about(start)
    before, after = validate.whitened([start, best.setting])
    if not np.isfinite(after).all():
        return "with it the FMU fails on the validation runs"
    change, error = change_of_squares(validate, before, after, {w.run for w in validate.windows})
    worse = change > TIE * error and change > 0.0
    return "with it the prediction error of the validation runs is larger" if worse else ""


def _errors(
    r: WindowResiduals, start: Setting, learned: Setting, names: Sequence[str]
) -> dict[str, dict[str, tuple[float, float]]]:
    before, after = (rms_of(r, raw, names) for raw in r.raw([start, learned]))
    return {run: {n: (x, after[run][n]) for n, x in each.items()} for run, each in before.items()}
