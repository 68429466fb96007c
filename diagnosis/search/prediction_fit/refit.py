"""What was found, fitted to predictions: the same effects, with values, intervals and a posterior."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...predictors import Model, WeakWindows
from ...predictors.evaluation import Bands
from ...predictors.shooting import Shooting
from ...predictors.uncertainty import measurement_std
from ...predictors.windows import Windows
from ...runs import Smoothed
from ..candidates import SMALL, model_error
from ..conclusion import interval, laplace_std, suspected
from ..findings import Findings
from ..prior import NominalPrior
from ..refinement import RefinedModel, TrainingSet, nuisance_of, refit
from .disturbance import ForceDisturbance, covariance, estimate
from .disturbance_summary import Unrecorded, unrecorded
from .fit import PredictionFit, fit_to, shootings
from .joint_posterior import JointPosterior


@dataclass(frozen=True, eq=False)
class RefitOutcome:
    """The end of a fit.

    Attributes:
        findings: with the values of the fit.
        posterior: of all fitted values; of none where nothing was fitted.
        unrecorded: the force that nobody recorded.
    """

    findings: Findings
    posterior: JointPosterior
    unrecorded: Unrecorded

    def bands(self, smoothed: Smoothed, windows: Windows | None) -> Bands | None:
        """The bands about the predictions of a run, see :func:`prediction_bands`."""
        disturbance = self.unrecorded.disturbance
        return prediction_bands(smoothed, windows, self.findings.model, self.posterior, disturbance)

    def about(self, found: Findings, prior: NominalPrior) -> "RefitOutcome":
        """Other findings with the covariance of this fit, by the same parameters.

        Their coefficients are off by standard deviations of the prior of the fit, not of the search.
        """
        values = [found.model.value(n.partition(".")[2]) for n in self.posterior.names]
        if found.searched is not None:
            ones = prior.rescaled(np.ones(prior.size), found.searched).tolist()
            z = dict(zip(prior.mean, ones, strict=True))
            suspects = [replace(s, z=s.z * z[s.name]) for s in found.suspects]
            suspects.sort(key=lambda s: -abs(s.z))
            moved = {n: k * z[n] for n, k in found.moved.items()}
            found = replace(found, suspects=suspects, moved=moved)
        return replace(self, findings=found, posterior=replace(self.posterior, mean=np.array(values)))


def to_predictions(
    found: Findings, runs: Sequence[WeakWindows], prior: NominalPrior, fits: bool
) -> RefitOutcome:
    """Fit what was found to predictions of the runs that it was found on.

    Args:
        found, runs: the findings by the model error, and the runs.
        prior: of the nominal coefficients.
        fits: whether anything was learned that can be fitted.
    """
    begin, searched = found.estimate, found.searched
    windows = shootings(runs, found.model) if fits else []
    known = begin is None or not (begin.fitted or any(prior.std.values()))
    if known or begin is None or searched is None or not windows:
        std = np.concatenate([measurement_std(w, found.model) for w in runs])
        disturbance = estimate(runs, model_error(runs, found.model), std)
        return RefitOutcome(
            found, JointPosterior.nothing(), unrecorded(runs, found.model, disturbance, {})
        )
    begin = replace(begin, offset=prior.rescaled(begin.offset, searched))
    weak, weak_std = fit_model_error(begin, found.sigma, runs, prior)
    fitted = fit_to(PredictionFit(runs, windows, weak, prior), weak)
    posterior, at = JointPosterior.of(fitted, prior), fitted.estimate
    model, std = at.model(prior), posterior.std
    effects = []
    for f in found.effects:
        values = {n: at.values.get(n, v) for n, v in f.values.items()}
        own = {n: interval(v, std[n]) for n, v in values.items() if n in std}
        if any(values.values()):  # predictions may take an effect back to nothing
            effects.append(replace(f, values=values, ci95=dict(f.ci95) | own))
    if effects:
        effects[-1] = replace(effects[-1], model=model)
    first = weak.model(prior)
    differ = {
        n: (first.value(n), model.value(n))
        for n, s in std.items()
        if abs(first.value(n) - model.value(n)) > interval(0.0, s + weak_std[n])[1]
    }
    learned = replace(
        found,
        effects=effects,
        model=model,
        suspects=suspected(prior, at.offset, posterior.shares(prior), at.start),
        moved=dict(zip(prior.mean, at.offset.tolist(), strict=True)),
        estimate=at,
        fold_models=fitted.fold_models,
        run_models=fitted.run_models,
    )
    return RefitOutcome(learned, posterior, unrecorded(runs, model, fitted.disturbance, differ))


def fit_model_error(
    at: RefinedModel, sigma: np.ndarray, runs: Sequence[WeakWindows], prior: NominalPrior
) -> tuple[RefinedModel, dict[str, float]]:
    """The fit to the model error with the prior of the fit, and its standard deviations [SI]."""
    t = TrainingSet(runs, sigma, prior)
    nuisance = nuisance_of(t, at, t.error(at))
    last = refit(t, at, nuisance).estimate
    unit = np.array([*[1.0] * len(at.fitted), *prior.std.values()])
    std = laplace_std(t, nuisance) * unit
    return last, dict(zip([*at.fitted, *prior.std], std.tolist(), strict=True))


def prediction_bands(
    smoothed: Smoothed,
    windows: Windows | None,
    model: Model,
    posterior: JointPosterior,
    disturbance: ForceDisturbance,
) -> Bands | None:
    """The bands about a model's predictions in the windows of a run; None: it has none.

    Args:
        smoothed, windows: the run.
        model, posterior: that predicts, and of its fitted values.
        disturbance: the unrecorded force.
    """
    if windows is None:
        return None
    shots = Shooting.accurate([smoothed], windows.length, model)
    about = WindowSpread.of(shots, model, posterior, disturbance)
    found = np.concatenate([np.zeros_like(about.still[:, :1]), about.still + about.pushed], axis=1)
    found[:, 0] = shots.at_start[:, :3, :3]
    found[..., range(3), range(3)] += smoothed.noise**2
    return Bands(windows, np.concatenate([[0.0], shots.since]), about.predicted, found)


class WindowSpread(NamedTuple):
    """How uncertain predicted poses are at the instants of windows.

    Attributes:
        predicted: (w, T + 1, 3), pose at the start and at the instants [m, m, rad].
        residuals: (w, T, 3), measured minus predicted pose.
        slopes: (w, T, 3, q), change of the predicted pose by each fitted value.
        still: (w, T, 3, 3), covariance by the initial state and the fitted values.
        pushed: (w, T, 3, 3), covariance by the unrecorded force.
    """

    predicted: np.ndarray
    residuals: np.ndarray
    slopes: np.ndarray
    still: np.ndarray
    pushed: np.ndarray

    @classmethod
    def of(
        cls, shots: Shooting, model: Model, posterior: JointPosterior, disturbance: ForceDisturbance
    ) -> "WindowSpread":
        """About a model's predictions, see :func:`prediction_bands`."""
        std = posterior.std
        around = shots.around(model, {n: SMALL * s for n, s in std.items() if s > 0.0})
        kept = [k for k, s in enumerate(std.values()) if s > 0.0]
        C = posterior.covariance[np.ix_(kept, kept)]
        first = shots.starts.first(lambda s: s.eta).T
        predicted = np.concatenate([first[:, None], shots.measured - around.residuals], axis=1)
        moved = np.diff(predicted[..., :2], axis=1) / shots.every
        speed = np.nan_to_num(np.sqrt(np.mean(np.sum(moved**2, axis=2), axis=1)), nan=0.0, posinf=0.0)
        parts = (
            covariance(around.motion, shots.at_start, replace(disturbance, size=np.zeros(3))),
            covariance(around.motion, np.zeros_like(shots.at_start), disturbance.at(speed)),
        )
        instants = np.arange(shots.since.size)
        still, pushed = (V[:, instants, :, instants].swapaxes(0, 1) for V in parts)
        still = still + around.slopes @ C @ np.swapaxes(around.slopes, -1, -2)
        return cls(predicted, around.residuals, around.slopes, still, pushed)
