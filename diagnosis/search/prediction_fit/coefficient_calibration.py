"""Calibration: all coefficients at once, by predictions and priors, where no cause is found.

In addition to the nominal coefficients, each with the prior of where its value is from, those that
simple models leave out are fitted (lift of the hull by sway and yaw, drag in turns, resistance that is
not quadratic), and the axis of the heading. The windows are weighed as in :mod:`.fit`, by what the model
misses in the run of each: errors of slow runs count as much as those of quick ones. In each run a
constant sway force and a constant yaw moment of the size of the usual disturbance act, integrated out:
the angle of an actuator that nobody recorded is no coefficient. So a run counts as hardly more than one
sample of what lasts, and as many of what changes with its motion. Where the information is counted, the
disturbance that the model error shows is scaled to what the windows miss: a part of that error does not
add up over a window.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...predictors import Model, WeakWindows, omega
from ...predictors.shooting import Shooting
from ..candidates import SMALL, model_error
from ..findings import Findings
from ..gram import run_folds
from ..prior import NominalPrior
from ..refinement import RefinedModel
from .disturbance_summary import unrecorded
from .fit import (
    Information,
    PredictionFit,
    fit_to,
    information_of,
    push_of,
    shootings,
    whitened,
)
from .joint_posterior import JointPosterior
from .refit import RefitOutcome

# 1; effects whose coefficients models of few terms leave out, and their prior deviation in units
# of the ship's size. Chosen: for R/V Gunnerus and KVLCC2 the regression of Clarke, Gedling and Hine
# (1983, RINA 125, 45-68) gives such terms 2 to 25 units. Models have some of these by other terms. Half
# a unit of X_uuu is three tenths of the resistance of both at their speed.
LIFT, RESISTANCE = 3.0, 0.5
LEFT_OUT = dict.fromkeys(("Y_uv", "Y_ur", "N_uv", "N_ur", "X_vr", "X_rr"), LIFT)
LEFT_OUT |= dict.fromkeys(("X_u", "X_uuu"), RESISTANCE)
AXIS = 0.035  # rad, prior standard deviation of a heading's axis: two degrees; chosen
# 1, prior standard deviation of the water's velocity in units of the ship's size: 0.28 m/s, half a knot,
# for a ship of 34 m; chosen.
STREAM = 0.05
CONSTANTS = ("body_bias_Y", "body_bias_N")  # of each run


class Calibration(PredictionFit):
    """The fit: coefficients of all runs, with constants of each fold of the runs integrated out.

    Attributes:
        constant: of each group of windows, by fold its rows, slopes of the constants and covariance.
    """

    @cached_property
    def folds(self) -> list[tuple[int, np.ndarray]]:
        """The folds of the runs, see :func:`.gram.run_folds`."""
        return run_folds(self.runs)

    def information(self, at: RefinedModel) -> Information:
        model, q = at.model(self.prior), self.unit.size
        whole, pushes = push_of(self.runs, model_error(self.runs, model), self.std)
        steps = self._steps | {n: SMALL * model.unit(n) for n in CONSTANTS}
        columns = [*self._columns, *([*steps].index(n) for n in CONSTANTS)]
        usual = np.median([p.size for p in pushes], axis=0)
        unit = np.concatenate([self.unit, usual[1:]])
        folds = len(self.folds)
        H, G, g = np.zeros((folds, q, q)), np.zeros((q, q)), np.zeros((folds, q))
        by_constants, missed, expected = np.zeros((q, q)), 0.0, 0.0
        weights, self.constant = [], []
        for s, of in zip(self.windows, self.fold_of_window, strict=True):
            around = s.around(model, steps)
            W = self.whitening(s, around)
            A, r = whitened(W, around.slopes[..., columns] * unit), whitened(W, around.residuals)
            V = self.scatter(s, around, W, pushes)
            missed += float(np.sum(r**2))
            expected += float(np.einsum("wii->", V))
            constant = []
            for place in np.unique(of):
                rows = of == place
                both, left = A[rows].reshape(-1, unit.size), r[rows].ravel()
                J, U = both[:, :q], both[:, q:]
                K = np.linalg.inv(U.T @ U + np.eye(len(CONSTANTS)))
                free = J - U @ K @ (U.T @ J)
                H[place] += J.T @ free
                g[place] += free.T @ left
                scores, along = free.reshape(*A[rows].shape[:2], q), U.T @ free
                G += information_of(scores, V[rows])
                by_constants += along.T @ along
                constant.append((rows, U, K))
            weights.append(W)
            self.constant.append(constant)
        share = missed / expected if expected > 0.0 else 1.0
        G = share * G + by_constants
        return Information(H.sum(axis=0), G, g.sum(axis=0), weights, whole, H, g)

    def squares(self, k: int, weights: np.ndarray, model: Model) -> float:
        r, total = whitened(weights, self.windows[k].residuals(model)), 0.0
        for rows, U, K in self.constant[k]:
            left = r[rows].ravel()
            along = U.T @ left
            total += float(left @ left - along @ K @ along)
        return total


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
        return shootings(self.train, [1.0])

    def still(self) -> RefitOutcome:
        """The calibrated model in still water."""
        return self._fitted(begin(self.start, self.prior))

    def flowing(self, still: RefitOutcome) -> RefitOutcome:
        """The same with a current that all runs are in."""
        near = still.findings.estimate
        return self._fitted(begin(self.start, self.prior, {"current": STREAM}, near))

    def coefficients(self) -> RefitOutcome:
        """The first model with other values of the nominal coefficients, and nothing else."""
        return self._fitted(RefinedModel.at(self.start, self.prior))

    def with_shared(self) -> RefitOutcome:
        """The same with an axis of the heading and constants that all runs share.

        The constants of each run stand for them otherwise, and another run is predicted without. The fit
        begins with the mean of the model error, which is part of the disturbance otherwise. Its prior
        deviation is the mean size of the runs' own means.
        """
        at = RefinedModel.at(self.start, self.prior)
        means = np.array([omega(w, self.start).mean(axis=0)[1:] for w in self.train])
        sizes = np.sqrt(np.mean(means**2, axis=0))
        found = zip(CONSTANTS, sizes.tolist(), means.mean(axis=0).tolist(), strict=True)
        shared = {name: (size, mean) for name, size, mean in found if size > 0.0}
        if "heading_offset" in self.start.ship.effects:
            shared = {**shared, "heading_offset": (AXIS, 0.0)}
        values = {name: mean for name, (_, mean) in shared.items()}
        precision = np.diag([size**-2.0 for size, _ in shared.values()])
        return self._fitted(replace(at, values=values, precision=precision))

    def _fitted(self, at: RefinedModel) -> RefitOutcome:
        problem = Calibration(self.train, self.windows, at, self.prior)
        fitted = fit_to(problem, at)
        at = fitted.estimate
        model, folds = at.model(self.prior), fitted.fold_models
        moved = dict(zip(self.prior.mean, at.offset.tolist(), strict=True))
        f = self.found
        learned = Findings([], f.ranking, model, [], f.sigma, model, moved, folds, None, at, f.searched)
        posterior = JointPosterior.of(fitted, self.prior)
        return RefitOutcome(learned, posterior, unrecorded(self.train, model, fitted.push, {}))


def begin(
    start: Model,
    prior: NominalPrior,
    further: Mapping[str, float] | None = None,
    near: RefinedModel | None = None,
) -> RefinedModel:
    """The first model with coefficients that it leaves out, zero as yet, and their prior precision.

    Args:
        start, prior: the first model, and the prior of its coefficients.
        further: effects beside those of LEFT_OUT, and their prior standard deviations.
        near: where to begin; None: at the first model.
    """
    effects = start.ship.effects
    std = {
        n: size * start.unit(n)
        for i, size in (LEFT_OUT | dict(further or {})).items()
        if i in effects and i not in prior.mean
        for n in effects[i].coefficients
    } | ({"heading_offset": AXIS} if "heading_offset" in effects else {})
    precision = np.diag([s**-2.0 for s in std.values()])
    values = dict.fromkeys(std, 0.0)
    if near is None:
        return RefinedModel(start, np.zeros(prior.size), values, precision)
    return RefinedModel(start, near.offset, {**values, **near.values}, precision)
