"""Calibration: all coefficients at once, by predictions and priors, where no cause is found.

In addition to the nominal coefficients, each with the prior of where its value is from, those of all
further products of speeds are fitted that the hull may have (lift by sway and yaw, drag in turns,
resistance that is not quadratic, ...), zero give or take their size, and the axis of the heading. Usual
imperfections of actuators and instruments can be added, and a current. The windows are weighed by what
the model misses in the run of each, as in :mod:`.fit`, and at each time since their start: errors of
slow runs count as much as those of quick ones, early errors as much as late ones. Where the information
is counted, the disturbance that the model error shows is scaled to what the windows miss: a part of that
error does not add up over a window.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from fmus.effects.force import CHANGES

from ...predictors import Model, WeakWindows
from ...predictors.shooting import UNKNOWN, Shooting
from ..conclusion import suspected
from ..findings import Findings
from ..prior import NominalPrior
from ..refinement import RefinedModel
from .disturbance import ForceDisturbance
from .disturbance_summary import unrecorded
from .fit import Fitted, PredictionFit, fit_to, shootings
from .joint_posterior import JointPosterior
from .refit import RefitOutcome, WindowSpread

# 1; effects whose coefficients models of few terms leave out, and their prior deviation in units
# of the ship's size. Chosen: for R/V Gunnerus and KVLCC2 the regression of Clarke, Gedling and Hine
# (1983, RINA 125, 45-68) gives lift 2 to 25 units. Models have some of these by other terms. Half
# a unit of X_uuu is three tenths of the resistance of both at their speed.
LIFT, FURTHER = 3.0, 0.5
BY_LIFT = ("Y_uv", "Y_ur", "N_uv", "N_ur", "X_vr", "X_rr")
LEFT_OUT = {e.id: LIFT if e.id in BY_LIFT else FURTHER for e in CHANGES}
# 1, prior standard deviation of the water's velocity in units of the ship's size: 0.28 m/s, half a knot,
# for a ship of 34 m; chosen.
STREAM = 0.05
HEADING = "heading_offset"
LEAST = 1e-4  # 1, factor of the variance of the disturbance, or one over it; chosen


class Calibration(PredictionFit):
    """The fit: the disturbance is scaled to what the windows miss, at each time since their start."""

    def missed(self, s: Shooting, squares: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(w, T, 3): the mean square of each run, as it grows with the time since a window's start."""
        growth = squares.sum(axis=0) / np.maximum(seen.sum(axis=0), 1.0)[:, None]
        growth[:, :2] = growth[:, :2].mean(axis=1, keepdims=True)
        growth /= np.maximum(growth.mean(axis=0), np.finfo(float).tiny)
        return super().missed(s, squares, seen) * growth

    def share(self, missed: float, expected: float) -> float:
        return missed / expected if expected > 0.0 else 1.0


@dataclass(frozen=True, eq=False)
class Calibrator:
    """Fits of all coefficients to some runs.

    Attributes:
        found: the findings, whose effects the calibrated model does not have.
        train: runs to learn from.
        start: the initial model.
        prior: of the nominal coefficients.
    """

    found: Findings
    train: Sequence[WeakWindows]
    start: Model
    prior: NominalPrior

    @cached_property
    def windows(self) -> list[Shooting]:
        """Those in which predictions are shown."""
        return shootings(self.train, self.start, [1.0])

    def still(self) -> RefitOutcome:
        """The calibrated model in still water."""
        return self._fitted(begin(self.start, self.prior))

    def plus(self, fit: RefitOutcome, std: Mapping[str, float]) -> RefitOutcome:
        """A calibrated model with further parameters, by their prior standard deviations about zero."""
        at = fit.findings.estimate
        assert at is not None
        values = dict(at.values) | dict.fromkeys(std, 0.0)
        precision = block_diag(at.precision, np.diag([s**-2.0 for s in std.values()]))
        return self._fitted(replace(at, values=values, precision=precision))

    @property
    def imperfections(self) -> dict[str, float]:
        """What every ship has to some degree: parameter -> prior standard deviation."""
        effects = self.start.ship.effects.values()
        usual = {n: e.usual for e in effects if e.usual for n in e.coefficients}
        return {n: std for n, std in usual.items() if n != HEADING and n not in self.prior.mean}

    @property
    def current(self) -> dict[str, float]:
        """The water's velocity: parameter -> prior standard deviation."""
        flow = self.start.ship.effects.get("current")
        return {n: STREAM * self.start.unit(n) for n in flow.coefficients} if flow else {}

    def coefficients(self) -> RefitOutcome:
        """The first model with other values of the nominal coefficients, and nothing else."""
        return self._fitted(RefinedModel.at(self.start, self.prior))

    def _fitted(self, at: RefinedModel) -> RefitOutcome:
        problem = Calibration(self.train, self.windows, at, self.prior)
        fitted = fit_to(problem, at)
        at = fitted.estimate
        model, folds = at.model(self.prior), fitted.fold_models
        moved = dict(zip(self.prior.mean, at.offset.tolist(), strict=True))
        f = self.found
        posterior = JointPosterior.of(fitted, self.prior)
        wrong = suspected(self.prior, at.offset, posterior.shares(self.prior), at.start)
        learned = Findings(
            [], f.ranking, model, wrong, f.sigma, model, moved, folds, None, at, f.searched
        )
        disturbance = as_missed(problem, fitted, model, posterior)
        return RefitOutcome(learned, posterior, unrecorded(self.train, model, disturbance, {}))


def as_missed(
    problem: Calibration, fitted: Fitted, model: Model, posterior: JointPosterior
) -> ForceDisturbance:
    """The disturbance, so large that windows left out of the fit are missed as bands expect.

    Then the mean square of what is missed there is one, in standard deviations of the bands.
    """
    names = [n for n, std in posterior.std.items() if std > 0.0]
    squares, still, pushed = [], [], []
    for shots, fold in zip(problem.windows, problem.fold_of_window, strict=True):
        about = WindowSpread.of(shots, model, posterior, fitted.disturbance)
        missed = np.zeros(shots.measured.shape)
        for k, other in enumerate(fitted.fold_models):
            step = [other.value(n) - model.value(n) for n in names]
            missed[fold == k] = about.residuals[fold == k] - about.slopes[fold == k] @ step
        noise = shots.noise + np.einsum("wtii->wti", about.still)
        seen = np.isfinite(missed.sum(axis=2)) & (shots.noise[..., 2] < UNKNOWN)
        squares.append(missed[seen] ** 2)
        still.append(noise[seen])
        pushed.append(np.einsum("wtii->wti", about.pushed)[seen])
    s, v, p = (np.concatenate(x) for x in (squares, still, pushed))

    def off(log_factor: float) -> float:
        return float(np.log(np.mean(s / (v + np.exp(log_factor) * p))))

    low, high = np.log(LEAST), -np.log(LEAST)
    if off(low) <= 0.0:
        factor = LEAST
    elif off(high) >= 0.0:
        factor = 1.0 / LEAST
    else:
        factor = np.exp(float(brentq(off, low, high)))  # pyright: ignore
    return replace(fitted.disturbance, size=fitted.disturbance.size * np.sqrt(factor))


def begin(start: Model, prior: NominalPrior) -> RefinedModel:
    """The first model with coefficients that it leaves out, zero as yet, and their prior precision."""
    effects = start.ship.effects
    std = {
        n: size * start.unit(n)
        for i, size in LEFT_OUT.items()
        if i in effects and effects[i].gives not in prior.mean
        for n in effects[i].coefficients
    } | ({HEADING: effects[HEADING].usual} if HEADING in effects else {})
    precision = np.diag([s**-2.0 for s in std.values()])
    return RefinedModel(start, np.zeros(prior.size), dict.fromkeys(std, 0.0), precision)
