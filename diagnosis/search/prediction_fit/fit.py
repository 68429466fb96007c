"""Fit to predictions in windows of the ship's length, of half and of twice that.

The fit minimises

    k sum_w r_w^T W_w r_w + theta^T P theta,

r_w the departure of the prediction from the measured pose at the instants of a window, theta all fitted
parameters about their prior means, P their prior precision. The inverse of W is the covariance that the
initial state and the measurement's noise give, plus on its diagonal the mean square of what the model
misses in that run, position and heading apart. The three lengths share the weight.

What the model misses is that of the parameters at hand, so that the cost counts its logarithm as well:
else a model that misses more would have lower weights and a lower cost. To it the log determinant of
W^-1 is added.

W takes the instants of a window as independent beyond the initial state; what really correlates them
is the unrecorded force, :mod:`.disturbance`. With V the covariance that it gives, H = J^T W J and
G = J^T W V W J, the information in the data is that of a likelihood to the power k = tr(S H) / tr(S G),
S the covariance at hand, and the posterior has the covariance

    (k H + P)^-1 (k^2 G + P) (k H + P)^-1

(F. Pauli, W. Racugno and L. Ventura, Bayesian composite marginal likelihoods, Statistica Sinica 21,
2011). Scores of the three lengths are taken as fully correlated, as they come from the same data.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from ...execution.parallel import for_each
from ...predictors import Model, WeakWindows
from ...predictors.shooting import UNKNOWN, Around, Shooting
from ...predictors.uncertainty import measurement_std
from ...runs.run_constants import DIGITS, STEPS
from ..candidates import SMALL, model_error
from ..gram import WHOLE_RUNS, run_folds
from ..most_likely import Quadratic, most_likely, ridge
from ..prior import NominalPrior
from ..refinement import RefinedModel
from .disturbance import ForceDisturbance, covariance, estimate

LENGTHS = (0.5, 1.0, 2.0)  # 1, of the windows in which predictions are shown
# 1, of a prior deviation, a value or its unit: step of a slope of predictions, whose relative error is
# as large. A factor of all forces and masses changes no prediction; with errors of 1e-3 precise data
# would determine it.
STEP = SMALL**2


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model that is fitted to predictions.

    Attributes:
        estimate: the model.
        names: of all fitted parameters.
        covariance: (q, q), of them, SI.
        disturbance: the unrecorded force.
        fold_models: the model fitted without each fold of the runs, by one step about the fit to all.
        run_models: the same, but each of two runs is a fold.
    """

    estimate: RefinedModel
    names: Sequence[str]
    covariance: np.ndarray
    disturbance: ForceDisturbance
    fold_models: Sequence[Model]
    run_models: Sequence[Model]


def shootings(
    runs: Sequence[WeakWindows], model: Model, lengths: Sequence[float] = LENGTHS
) -> list[Shooting]:
    """The windows of some lengths, those of runs with one kind of commands together.

    Steps are as short as a model needs.
    """
    found = []
    for signals in sorted({w.run.signals for w in runs}):
        these = [w for w in runs if w.run.signals == signals]
        smoothed = [w.smoothed for w in these]
        found += [Shooting.accurate(smoothed, share * these[0].horizon, model) for share in lengths]
    return [s for s in found if s.run.size]


def disturbance_of(
    runs: Sequence[WeakWindows], error: np.ndarray, std: np.ndarray
) -> tuple[ForceDisturbance, list[ForceDisturbance]]:
    """The disturbance of all runs, and of each with the same times, by :func:`.disturbance.estimate`."""
    edges = np.cumsum([w.middle.size for w in runs])[:-1]
    parts = zip(runs, np.split(error, edges), np.split(std, edges), strict=True)
    whole = estimate(runs, error, std)
    each = [estimate([w], e, s, whole.time) for w, e, s in parts]
    speed = [np.sqrt(np.mean(np.sum(w.smoothed.nu[w.known, :2] ** 2, axis=1))) for w in runs]
    return whole.growing(each, np.array(speed)), each


@dataclass(frozen=True, eq=False)
class Information:
    """What the windows say about the parameters at an estimate, in the parameters' own units.

    Attributes:
        H, G: (q, q), see the module.
        g: (q,), J^T W r.
        spreads: of each length the covariance (w, 3T, 3T) of residuals by initial state and noise; zero
            where a model runs away.
        disturbance: the unrecorded force.
        fold_H, fold_g: (folds, q, q) and (folds, q), what each fold says; their sums are H and g.
    """

    H: np.ndarray
    G: np.ndarray
    g: np.ndarray
    spreads: Sequence[np.ndarray]
    disturbance: ForceDisturbance
    fold_H: np.ndarray
    fold_g: np.ndarray

    def power(self, P: np.ndarray) -> float:
        """k, for a prior precision P (q, q)."""
        k = 1.0
        for _ in range(STEPS):
            S = np.linalg.inv(k * self.H + P + ridge(k * self.H + P))
            k = float(np.sum(S * self.H) / np.sum(S * self.G))
        return k


class PredictionFit:
    """The problem: runs, windows, prior.

    Args:
        runs, windows: to learn from.
        at: where to begin.
        prior: of the nominal coefficients.
    """

    def __init__(
        self,
        runs: Sequence[WeakWindows],
        windows: Sequence[Shooting],
        at: RefinedModel,
        prior: NominalPrior,
    ) -> None:
        self.runs, self.prior, self.windows = runs, prior, windows
        self._place = {id(w.smoothed): k for k, w in enumerate(runs)}
        self.std = np.concatenate([measurement_std(w, at.start) for w in runs])
        names, believed = at.fitted, [*prior.std.values()]
        self._kept = np.array([True] * len(names) + [s > 0.0 for s in believed])
        units = [at.start.unit(n) for n in names]
        self._own = np.array([*units, *[1.0] * len(believed)])
        self.unit = np.array([*units, *believed])[self._kept]
        scale = {n: max(abs(at.values[n]), u) for n, u in zip(names, units, strict=True)}
        scale |= {n: s for n, s in prior.std.items() if s}
        self.names = [n for n, kept in zip([*names, *prior.std], self._kept, strict=True) if kept]
        self._steps = {n: STEP * s for n, s in scale.items()}
        # Of an effect that adds to a nominal coefficient, such as a lag, the name stands twice.
        self._columns = [[*self._steps].index(n) for n in self.names]
        P = np.asarray(block_diag(at.precision, np.eye(len(believed)))) * np.outer(self._own, self._own)
        self.precision = P[np.ix_(self._kept, self._kept)]

    @cached_property
    def folds(self) -> list[tuple[int, np.ndarray]]:
        """The folds of the runs, see :func:`.gram.run_folds`."""
        return run_folds(self.runs)

    @cached_property
    def fold_of_window(self) -> list[np.ndarray]:
        """Of each group of windows the number of the fold (w,) in which each begins."""
        begins = [w.middle[np.unique(w.block, True)[1]] for w in self.runs]
        found = []
        for s in self.windows:
            of = np.array([self._place[id(run)] for run in s.runs])[s.run]
            place = np.zeros(of.size, int)
            for k, (run, blocks) in enumerate(self.folds):
                first = -np.inf if blocks[0] == 0 else begins[run][blocks[0]]
                place[(of == run) & (s.start >= first)] = k
            found.append(place)
        return found

    def without_each_fold(
        self, at: RefinedModel, known: Information, power: float
    ) -> tuple[list[Model], list[Model]]:
        """The model fitted without each fold, by one step about the fit to all.

        Returns:
            By folds as they usually are, and by whole runs where there are two.
        """
        right = power * known.g - self.precision @ self.theta(at)
        H = power * known.H + self.precision
        H += ridge(H)
        run = np.array([number for number, _ in self.folds])

        def without(held: np.ndarray) -> Model:
            h, v = (x[held].sum(axis=0) for x in (known.fold_H, known.fold_g))
            return self.moved(at, np.linalg.solve(H - power * h, right - power * v)).model(self.prior)

        usual = [without(np.arange(run.size) == k) for k in range(run.size)]
        if len(self.runs) != WHOLE_RUNS - 1:
            return usual, usual
        return usual, [without(run == k) for k in range(len(self.runs))]

    def theta(self, at: RefinedModel) -> np.ndarray:
        """(q,), fitted parameters about their prior means, in units of the ship's size; coefficients in
        prior standard deviations.
        """
        return (at.theta(at.fitted) / self._own)[self._kept]

    def moved(self, at: RefinedModel, step: np.ndarray) -> RefinedModel:
        """The estimate after a step (q,)."""
        whole = np.zeros(self._kept.size)
        whole[self._kept] = step
        whole *= self._own
        names = at.fitted
        return at.plus(dict(zip(names, whole.tolist(), strict=False)), whole[len(names) :])

    def around(self, s: Shooting, model: Model) -> Around:
        """Predictions in some windows, and their slopes in units of the parameters."""
        found = s.around(model, self._steps)
        return replace(found, slopes=found.slopes[..., self._columns] * self.unit)

    def spread(self, s: Shooting, around: Around) -> np.ndarray:
        """The covariance (w, 3T, 3T) of residuals by start and noise; zero where one runs away."""
        r = around.residuals
        fine = np.isfinite(r.sum(axis=(1, 2)) + around.slopes.sum(axis=(1, 2, 3)))
        none = ForceDisturbance(np.zeros(3), np.ones(3))
        V = covariance(around.motion[fine], s.at_start[fine], none)
        # A small change at the start may be beyond all numbers at the end, where the prediction is not.
        steady = np.isfinite(V).all(axis=(1, 2, 3, 4))
        fine[fine], V = steady, V[steady]
        found = np.zeros((len(r), r[0].size, r[0].size))
        found[fine] = _square(V, s.noise[fine])
        return found

    def factors(self, s: Shooting, spread: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Cholesky's factors (w, 3T, 3T) of W^-1 where the model of the spread runs: of that, and what
        residuals r (w, T, 3) miss.
        """
        fine = running(spread)
        seen = fine[:, None] & (s.noise[..., 2] < UNKNOWN)
        missed = self.missed(s, np.where(seen[..., None], r, 0.0) ** 2, seen)
        whole = spread[fine]
        diagonal = np.einsum("wii->wi", whole)
        diagonal += np.broadcast_to(missed[fine], r[fine].shape).reshape(len(whole), -1)
        # Of a ship that turns far within a window rounding alone would make it indefinite.
        diagonal += DIGITS * diagonal.max(axis=1, keepdims=True)
        return np.linalg.cholesky(whole)

    def whitening(self, s: Shooting, spread: np.ndarray, r: np.ndarray) -> np.ndarray:
        """The factor (w, 3T, 3T) that whitens residuals (w, T, 3); zero where a model runs away."""
        found = np.zeros_like(spread)
        found[running(spread)] = np.linalg.inv(self.factors(s, spread, r))
        return found

    def scatter(
        self, s: Shooting, around: Around, W: np.ndarray, disturbances: Sequence[ForceDisturbance]
    ) -> np.ndarray:
        """Covariance (w, 3T, 3T) of residuals by initial state, noise and each run's disturbance.

        Args:
            s, around, W: windows, predictions in them, and what whitens these.
            disturbances: of each run.
        """
        fine, found = running(W), np.zeros_like(W)
        each = [disturbances[self._place[id(run)]] for run in s.runs]
        disturbance = ForceDisturbance(np.array([p.size for p in each])[s.run[fine]], each[0].time)
        V = covariance(around.motion[fine], s.at_start[fine], disturbance)
        found[fine] = W[fine] @ _square(V, s.noise[fine]) @ W[fine].transpose(0, 2, 1)
        return found

    def missed(self, s: Shooting, squares: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(w, 1, 3): mean square of what the model misses in the run of each window, both places alike.

        ``squares`` (w, T, 3) are those of the residuals, 0 where the instants (w, T) are not seen.
        """
        missed = np.zeros((len(s.runs), 3))
        np.add.at(missed, s.run, squares.sum(axis=1))
        missed /= np.maximum(np.bincount(s.run, seen.sum(axis=1), len(s.runs)), 1.0)[:, None]
        missed[:, :2] = missed[:, :2].mean(axis=1, keepdims=True)
        return missed[s.run][:, None]

    def misfit(self, s: Shooting, spread: np.ndarray, model: Model) -> float:
        """r^T W r + log det W^-1 of a model in windows of one length; infinite where it runs away."""
        r, fine = s.residuals(model), running(spread)
        if not np.isfinite(r[fine]).all():
            return np.inf
        L = self.factors(s, spread, r)
        z = np.linalg.solve(L, r[fine].reshape(len(L), -1, 1))
        return float(np.sum(z**2) + 2.0 * np.sum(np.log(np.einsum("wii->wi", L))))

    def cost(self, at: RefinedModel, spreads: Sequence[np.ndarray], power: float) -> float:
        """Twice the negative logarithm of the posterior, but for a constant."""
        theta, model = self.theta(at), at.model(self.prior)
        pairs = zip(self.windows, spreads, strict=True)
        misfit = float(np.mean([self.misfit(s, spread, model) for s, spread in pairs]))
        return float(theta @ self.precision @ theta) + power * misfit

    def share(self, missed: float, expected: float) -> float:
        """Of the sum of squares that disturbance and noise are expected to give, what counts.

        Args:
            missed, expected: sums of squares of the whitened residuals.
        """
        return 1.0

    def information(self, at: RefinedModel) -> Information:
        """What the windows say, by slopes at a point and the disturbance that is left in each run."""
        disturbance, disturbances = disturbance_of(
            self.runs, model_error(self.runs, at.model(self.prior)), self.std
        )
        model, q, folds = at.model(self.prior), self.unit.size, len(self.folds)

        def of_windows(group: tuple[Shooting, np.ndarray]) -> tuple[np.ndarray, ...]:
            s, of = group
            around = self.around(s, model)
            spread = self.spread(s, around)
            W = self.whitening(s, spread, around.residuals)
            A = whitened(W, around.slopes)
            r = whitened(W, around.residuals)
            parts = [(A[of == k].reshape(-1, q), r[of == k].ravel()) for k in range(folds)]
            H = np.array([J.T @ J for J, _ in parts])
            g = np.array([J.T @ left for J, left in parts])
            V = self.scatter(s, around, W, disturbances)
            share = self.share(float(np.sum(r**2)), float(np.einsum("wii->", V)))
            return H, share * information_of(A, V), g, spread

        groups = [*zip(self.windows, self.fold_of_window, strict=True)]
        Hs, Gs, gs, spreads = zip(*for_each(of_windows, groups), strict=True)
        H, G, g = (np.mean(each, axis=0) for each in (Hs, Gs, gs))
        return Information(H.sum(axis=0), G, g.sum(axis=0), spreads, disturbance, H, g)


def _square(V: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Covariance (w, 3T, 3T): one (w, T, 3, T, 3), and independent variances (w, T, 3) on top."""
    size = own[0].size if len(own) else 0
    flat = V.reshape(len(V), size, size)
    flat[:, range(size), range(size)] += own.reshape(len(V), size)
    return flat


def information_of(A: np.ndarray, V: np.ndarray) -> np.ndarray:
    """G (q, q), the covariance of the scores of whitened slopes A (w, 3T, q) by that of residuals V."""
    return np.einsum("wia,wib->ab", A, V @ A)


def running(W: np.ndarray) -> np.ndarray:
    """(w,), windows in which the model does not run away, by their factors (w, 3T, 3T)."""
    return np.asarray(W.any(axis=(1, 2)))


def whitened(W: np.ndarray, x: np.ndarray) -> np.ndarray:
    """W (w, 3T, 3T) times residuals (w, T, 3) or slopes (w, T, 3, q); zero where W is."""
    fine = running(W)
    flat = x.reshape(len(x), W.shape[1], -1)
    found = np.zeros(flat.shape)
    with np.errstate(invalid="ignore"):  # another model may run away in a window: its cost is infinite
        found[fine] = W[fine] @ flat[fine]
    return found


@dataclass(frozen=True, eq=False)
class _Weighed(Quadratic[RefinedModel]):
    """The cost with what the windows say, at the power of their likelihood."""

    known: Information
    power: float


def fit_to(problem: PredictionFit, at: RefinedModel) -> Fitted:
    """The most likely model of a problem, from where to begin, and how sure it is."""
    P = problem.precision

    def about(at: RefinedModel) -> _Weighed:
        known = problem.information(at)
        k, spreads = known.power(P), known.spreads
        H, right = k * known.H + P, k * known.g - P @ problem.theta(at)
        return _Weighed(H + ridge(H), right, lambda e: problem.cost(e, spreads, k), known, k)

    at, here = most_likely(at, about, problem.moved)
    S = np.linalg.inv(here.H)
    covariance = S @ (here.power**2 * here.known.G + P) @ S * np.outer(problem.unit, problem.unit)
    folds, runs = problem.without_each_fold(at, here.known, here.power)
    return Fitted(at, problem.names, covariance, here.known.disturbance, folds, runs)
