"""What one model predicts better than another: paired errors in the same windows of data that decide."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..predictors import Model, WeakWindows
from ..predictors.weak_form import SMALL
from ..runs.run_constants import FAR_OFF
from ..search.candidates import model_error, shape
from ..search.findings import Finding, Findings
from ..search.prior import NominalPrior
from ..search.shortlist import TIE
from ..search.significance import predicts_better, predicts_worse
from .pruning import judgeable
from .validation_data import ValidationData

# Group of coefficients -> the kind of force that they make up with others.
KIND = {"mass": "inertia", "added_mass": "inertia", "place": "thrust"}
DYNAMICS = ("lag", "rate")  # groups of the actuators' coefficients by which commands act late


@dataclass(frozen=True)
class PairedChange:
    """The error of two models in the same windows.

    Attributes:
        before, after: root mean square error of each [m] or [rad].
        difference: mean of the paired differences of the squares, before minus after [m2] or [rad2].
        standard_error: of ``difference``.
    """

    before: float
    after: float
    difference: float
    standard_error: float

    @classmethod
    def of(cls, before: np.ndarray, after: np.ndarray) -> "PairedChange":
        """The change between mean squares (windows,), but where a model runs away."""
        known = np.isfinite(before) & np.isfinite(after)
        before, after = before[known], after[known]
        if before.size < 2:
            return cls(np.nan, np.nan, np.nan, np.nan)
        d = before - after
        error = float(d.std(ddof=1) / np.sqrt(d.size))
        return cls(float(np.sqrt(before.mean())), float(np.sqrt(after.mean())), float(d.mean()), error)

    @property
    def is_worse(self) -> bool:
        """Whether the error grows by more than twice its paired standard error."""
        return self.difference < -TIE * self.standard_error


@dataclass(frozen=True)
class PredictionGain:
    """What a model gains over another in the predictions of the data that decide.

    Attributes:
        where: these data, in words.
        windows: their number.
        position, heading: errors of both models.
        gained: whether the predictions are better, by more than twice their paired standard error or in
            most windows by a test of ranks.
        over: the model with which it is compared: "initial" or "calibrated".
        of_other_runs: whether the data are validation runs.
    """

    where: str
    windows: int
    position: PairedChange
    heading: PairedChange
    gained: bool
    over: Literal["initial", "calibrated"] = "initial"
    of_other_runs: bool = False


def prediction_gain(
    data: ValidationData, before: Findings | Model, after: Findings | Model
) -> PredictionGain | None:
    """The gain of a model over another; findings are fitted without the fold that they are judged on.

    Returns:
        None where that is not known: no window has enough samples, or a method does not fit its findings
        without a part of the data.
    """
    if not all(isinstance(each, Model) or data.judges(each) for each in (before, after)):
        return None
    its, others = data.losses(after, before)
    if its.position.size < 2:
        return None
    position, heading = (PairedChange.of(*pair) for pair in zip(others[1:], its[1:], strict=True))
    gained = predicts_better(its, others)
    size, of_other_runs = its.position.size, bool(data.validate)
    return PredictionGain(data.where, size, position, heading, gained, of_other_runs=of_other_runs)


def gain_of_search(
    data: ValidationData,
    calibrated: Findings | None,
    found: Findings,
    after: Findings | Model,
) -> PredictionGain | None:
    """What the search for effects gained over calibration alone.

    A calibration that predicts worse than the initial model is none that anybody would use: the initial
    model takes its place. A search that ends without an effect gains nothing.

    Args:
        data: the data that decide.
        calibrated: the calibration; None: there is none.
        found, after: the end of the search, and what of it predicts the data that decide.

    Returns:
        None where that is not known, see :func:`prediction_gain`.
    """
    if calibrated is None or predicts_worse(*data.losses(calibrated, data.start)):
        gain = prediction_gain(data, data.start, after)
    else:
        gain = prediction_gain(data, calibrated, after)
        gain = gain and replace(gain, over="calibrated")
    return gain and replace(gain, gained=gain.gained and bool(found.effects))


def without_gain(
    gain: PredictionGain | None,
    found: Findings,
    start: Model,
    runs: Sequence[WeakWindows],
    prior: NominalPrior,
    plausible: bool = False,
) -> set[str]:
    """Ids of the findings that predictions do not show: calibration alone predicts as well.

    An effect that is a change of coefficients of one kind, as an added mass or a lag, is a calibration,
    and stays; not if it is beyond their priors and other coefficients do as well within theirs. What
    only inertia, damping and thrust together make up, each far from its prior, is none: a sway force
    by u r is, as the equation of each axis may be multiplied by a factor. Waves and failures are in no
    prediction of other data, and values of single runs in none of other runs.

    Args:
        gain: of the search over calibration; None: not known, so that nothing follows.
        found: the findings.
        start: the initial model.
        runs: training runs.
        prior: of the coefficients that calibration may change.
        plausible: whether these are within their priors in the calibrated model.
    """
    if gain is None or gain.gained:
        return set()
    effects = start.ship.effects
    ids = judgeable(found, start, gain.of_other_runs)
    shown = [f for f in found.effects if f.id in ids]
    if gain.over == "initial" or not shown:
        return {f.id for f in shown}
    base, kinds = model_error(runs, start), dict[str, list[str]]()
    for n in prior.std:
        group = start.ship.coefficients[n].group
        kinds.setdefault(KIND.get(group, group), []).append(n)
    by_kind = [columns_of(runs, start, base, names, found.sigma) for names in kinds.values()]
    deviations = [np.array([prior.std[n] for n in names]) for names in kinds.values()]
    of_dynamics = {
        start.declared(n).unit for n in prior.std if start.ship.coefficients[n].group in DYNAMICS
    }

    def is_coefficient(f: Finding) -> bool:
        """A further lag is a time constant of the actuators, though not the same function of it.

        So is a rate limit behind theirs.
        """
        if effects[f.id].memory and {start.declared(n).unit for n in f.values} <= of_dynamics:
            return True
        own = columns_of(runs, start, base, [*f.values], found.sigma)
        size = np.array([*f.values.values()])
        pairs = zip(by_kind, deviations, strict=True)
        return any(
            _spanned(own, of_kind) and not (plausible and _beyond(own @ size, of_kind * std))
            for of_kind, std in pairs
        )

    return {f.id for f in shown if not is_coefficient(f)}


def columns_of(
    runs: Sequence[WeakWindows], start: Model, base: np.ndarray, names: Sequence[str], sigma: np.ndarray
) -> np.ndarray:
    """(3 K, names), the model error by small steps of some parameters, in units of the noise."""
    columns = shape(runs, start, base, {}, names, SMALL).columns / sigma[:, None]
    return columns.reshape(-1, len(names))


def _beyond(force: np.ndarray, columns: np.ndarray) -> bool:
    """Whether a force (n,) takes more than FAR_OFF of any of some columns (n, q), the least of each.

    What a small step makes of a column is no other one: m is X_udot and Y_vdot together.
    """
    return bool((np.abs(np.linalg.lstsq(columns, force, SMALL)[0]) > FAR_OFF).any())


def _spanned(columns: np.ndarray, others: np.ndarray) -> bool:
    """Whether some columns (n, p) are made up of others (n, q), to the error of a small step."""
    left = columns - others @ np.linalg.lstsq(others, columns)[0]
    own = np.sum(columns**2, axis=0)
    return bool((own > 0.0).all() and (np.sum(left**2, axis=0) <= SMALL**2 * own).all())
