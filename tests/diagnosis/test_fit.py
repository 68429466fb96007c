"""The fit to predictions (diagnosis/search/prediction_fit/fit.py) by linear algebra in full matrices."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis import Model
from diagnosis.predictors.shooting import UNKNOWN
from diagnosis.search.candidates import SMALL
from diagnosis.search.prediction_fit import fit as fits
from diagnosis.search.prediction_fit.coefficient_calibration import Calibration
from diagnosis.search.prediction_fit.fit import (
    Information,
    PredictionFit,
    _square,
    fit_to,
    information_of,
    running,
    whitened,
)
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel

W, T, Q = 5, 4, 3  # windows, instants, parameters
seeds = st.integers(0, 1000)


def spd(rng, n):
    A = rng.standard_normal((n, n))
    return A @ A.T + n * np.eye(n)


def information(rng, folds=4, G=None):
    each = np.array([spd(rng, Q) for _ in range(folds)])
    g = rng.standard_normal((folds, Q))
    H = each.sum(axis=0)
    return Information(H, spd(rng, Q) if G is None else G, g.sum(axis=0), [], None, each, g)


@given(seeds)
def test_independent_variances_are_added_on_the_diagonal(seed):
    rng = np.random.default_rng(seed)
    V, own = rng.standard_normal((W, T, 3, T, 3)), rng.random((W, T, 3))
    expected = V.reshape(W, 3 * T, 3 * T) + np.array([np.diag(x.ravel()) for x in own])
    assert _square(V.copy(), own) == pytest.approx(expected)
    assert _square(np.zeros((0, T, 3, T, 3)), np.zeros((0, T, 3))).shape == (0, 0, 0)


@given(seeds)
def test_what_scores_vary_by_is_a_sum_over_windows(seed):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((W, 3 * T, Q))
    V = np.array([spd(rng, 3 * T) for _ in range(W)])
    assert information_of(A, V) == pytest.approx(sum(a.T @ v @ a for a, v in zip(A, V, strict=True)))


def test_windows_in_which_a_model_runs_away_have_no_weight():
    rng = np.random.default_rng(0)
    factor, x = rng.standard_normal((W, 3 * T, 3 * T)), rng.standard_normal((W, T, 3, Q))
    factor[2] = 0.0
    assert running(factor).tolist() == [True, True, False, True, True]
    x[2] = np.nan
    found = whitened(factor, x)
    assert (found[2] == 0.0).all()
    assert found[3] == pytest.approx(factor[3] @ x[3].reshape(3 * T, Q))
    assert whitened(factor, x[..., 0])[4, :, 0] == pytest.approx(factor[4] @ x[4, ..., 0].ravel())


@pytest.mark.parametrize("true", [0.05, 1.0, 3.0])
def test_the_power_is_that_at_which_the_posterior_is_as_sure_as_its_scores_vary(true):
    """Where G = H / k, the likelihood counts k-fold, whatever the prior."""
    rng = np.random.default_rng(1)
    H = spd(rng, Q)
    known = Information(H, H / true, np.zeros(Q), [], None, H[None], np.zeros((1, Q)))
    for P in (np.zeros((Q, Q)), spd(rng, Q)):
        assert known.power(P) == pytest.approx(true)
    other = information(rng)
    P = spd(rng, Q)
    k = other.power(P)
    S = np.linalg.inv(k * other.H + P)
    assert np.sum(S * other.H) / np.sum(S * other.G) == pytest.approx(k, rel=0.01)


# A problem without runs, whose parts are called alone


def windows(rng, runs=2):
    run = np.array([0, 0, 1, 1, 1])[:W]
    noise = np.broadcast_to([1e-4, 4e-4, 1e-2], (W, T, 3)).copy()
    at_start = np.zeros((W, 6, 6))
    return SimpleNamespace(runs=[object() for _ in range(runs)], run=run, noise=noise, at_start=at_start)


def around(rng, size=1.0):
    return SimpleNamespace(
        residuals=size * rng.standard_normal((W, T, 3)),
        slopes=rng.standard_normal((W, T, 3, Q)),
        motion=np.arange(W),
    )


def alone(kind=PredictionFit):
    return object.__new__(kind)


@given(seeds)
def test_what_is_missed_is_the_mean_square_of_each_run_both_places_alike(seed):
    rng = np.random.default_rng(seed)
    s, squares = windows(rng), rng.random((W, T, 3))
    seen = rng.random((W, T)) < 0.7
    squares[~seen] = 0.0
    found = alone().missed(s, squares, seen)
    assert found.shape == (W, 1, 3)
    for r in range(2):
        of = s.run == r
        mean = squares[of].sum(axis=(0, 1)) / max(seen[of].sum(), 1.0)
        place = mean[:2].mean()
        for w in np.flatnonzero(of):
            assert found[w, 0] == pytest.approx([place, place, mean[2]])


@given(seeds)
def test_a_calibration_weighs_times_by_how_what_is_missed_grows(seed):
    """The mean over the times is that of the run: early errors count as much as late ones."""
    rng = np.random.default_rng(seed)
    s, squares, seen = windows(rng), rng.random((W, T, 3)), np.ones((W, T), bool)
    squares *= np.arange(1.0, T + 1.0)[:, None] ** 2
    found = alone(Calibration).missed(s, squares, seen)
    plain = alone().missed(s, squares, seen)
    assert found.shape == (W, T, 3)
    assert found.mean(axis=1) == pytest.approx(plain[:, 0])
    growth = squares.mean(axis=0)
    place = growth[:, :2].mean(axis=1)
    assert found[0, :, 0] / found[0, 0, 0] == pytest.approx(place / place[0])
    assert found[0, :, 2] / found[0, 0, 2] == pytest.approx(growth[:, 2] / growth[0, 2])


def test_a_calibration_counts_of_the_disturbance_what_the_windows_miss():
    assert alone(Calibration).share(3.0, 4.0) == 0.75
    assert alone(Calibration).share(3.0, 0.0) == 1.0
    assert alone().share(3.0, 4.0) == 1.0


def test_whitened_residuals_of_what_is_expected_have_unit_covariance(monkeypatch):
    """Initial state, noise and what the run misses; a window that runs away has no weight."""
    rng = np.random.default_rng(2)
    s, a = windows(rng), around(rng)
    s.noise[1, 2, 2] = 2.0 * UNKNOWN
    a.residuals[1, 2] = 99.0  # not seen
    V = np.array([spd(rng, 3 * T).reshape(T, 3, T, 3) for _ in range(W)])
    monkeypatch.setattr(fits, "covariance", lambda motion, at_start, disturbance: V[motion].copy())
    a.slopes[4, 0, 0, 0] = np.nan
    V[3, 0, 0, 0, 0] = np.nan  # the prediction does not run away, the motion about it does
    found = alone().whitening(s, alone().spread(s, a), a.residuals)
    assert (found[3:5] == 0.0).all()
    seen = s.noise[..., 2] < UNKNOWN
    seen[3:5] = False
    squares = np.where(seen[..., None], a.residuals, 0.0) ** 2
    missed = alone().missed(s, squares, seen)
    for w in range(3):
        whole = V[w].reshape(3 * T, 3 * T) + np.diag((s.noise[w] + missed[w]).ravel())
        close = 1e-6 if seen[w].all() else 1e-2  # what is not known is large, and rounded
        assert found[w] @ whole @ found[w].T == pytest.approx(np.eye(3 * T), abs=close)


def test_the_scatter_is_that_of_the_push_of_each_run(monkeypatch):
    rng = np.random.default_rng(3)
    s, a, problem = windows(rng), around(rng), alone()
    problem._place = {id(run): k for k, run in enumerate(s.runs)}
    factor = rng.standard_normal((W, 3 * T, 3 * T))
    factor[0] = 0.0
    disturbances = [
        SimpleNamespace(size=np.full(3, 2.0), time="times"),
        SimpleNamespace(size=np.full(3, 5.0), time="times"),
    ]

    def covariance(motion, at_start, disturbance):
        assert disturbance.time == "times"
        return disturbance.size[:, :1, None, None, None] * np.broadcast_to(
            np.eye(3 * T).reshape(T, 3, T, 3), (len(motion), T, 3, T, 3)
        )

    monkeypatch.setattr(fits, "covariance", covariance)
    found = problem.scatter(s, a, factor, disturbances)
    assert (found[0] == 0.0).all()
    for w, size in ((1, 2.0), (2, 5.0), (4, 5.0)):
        V = size * np.eye(3 * T) + np.diag(s.noise[w].ravel())
        assert found[w] == pytest.approx(factor[w] @ V @ factor[w].T)


# The whole of a problem that is linear


class Linear:
    """Data y = A theta + noise of two runs in two folds each, whose likelihood counts by its power."""

    def __init__(self, seed, spread=1.0):
        rng = np.random.default_rng(seed)
        self.A, self.y = rng.standard_normal((40, Q)), rng.standard_normal(40)
        self.part = np.arange(40) % 4
        self.precision, self.unit, self.names = spd(rng, Q), np.array([1.0, 10.0, 0.1]), ["a", "b", "c"]
        self.spread, self.prior = spread, None
        self.runs, self.folds = ["one", "other"], [(k // 2, np.zeros(1)) for k in range(4)]

    def theta(self, at):
        return at

    def moved(self, at, step):
        return Estimate(at + step)

    def parts(self, at):
        r = self.y - self.A @ at
        H = np.array([self.A[self.part == k].T @ self.A[self.part == k] for k in range(4)])
        g = np.array([self.A[self.part == k].T @ r[self.part == k] for k in range(4)])
        return H, g

    def information(self, at):
        H, g = self.parts(at)
        whole = H.sum(axis=0)
        return Information(whole, whole * self.spread, g.sum(axis=0), [], "disturbance", H, g)

    def cost(self, at, weights, power):
        return float(at @ self.precision @ at + power * np.sum((self.y - self.A @ at) ** 2))

    without_each_fold = PredictionFit.without_each_fold


class Estimate(np.ndarray):
    """A point (q,) that is its own model."""

    def __new__(cls, x):
        return np.asarray(x, float).view(cls)

    def model(self, prior):
        return np.asarray(self)


@settings(max_examples=10, deadline=None)
@given(seeds, st.sampled_from([1.0, 4.0]))
def test_a_linear_problem_is_solved_with_its_covariance_and_without_each_fold(seed, spread):
    p = Linear(seed, spread)
    found = fit_to(p, Estimate(np.full(Q, 3.0)))
    k, P = 1.0 / spread, p.precision
    S = np.linalg.inv(k * p.A.T @ p.A + P)
    assert np.asarray(found.estimate) == pytest.approx(S @ (k * p.A.T @ p.y), abs=1e-5)
    scores = k**2 * spread * p.A.T @ p.A
    assert found.covariance == pytest.approx(S @ (scores + P) @ S * np.outer(p.unit, p.unit), rel=1e-4)
    assert (found.names, found.disturbance) == (p.names, "disturbance")
    left_out = [[0], [1], [2], [3], [0, 1], [2, 3]]
    for parts, model in zip(left_out, [*found.fold_models, *found.run_models], strict=True):
        A, y = (x[~np.isin(p.part, parts)] for x in (p.A, p.y))
        expected = np.linalg.solve(k * A.T @ A + P, k * A.T @ y)
        assert model == pytest.approx(expected, abs=1e-5), "without the folds, exactly"


# Its parameters and folds


def made(monkeypatch, exact=()):
    """A problem of two runs of six blocks, with an effect beside the coefficients."""
    monkeypatch.setattr(fits, "measurement_std", lambda w, model: np.zeros((w.middle.size, 3)))
    start = Model()
    prior = NominalPrior.of(start, 0.1)
    for name in exact:
        prior.std[name] = 0.0
    runs = [
        SimpleNamespace(
            middle=10.0 * k + np.arange(12.0), block=np.repeat(np.arange(6), 2), smoothed=f"run {k}"
        )
        for k in range(2)
    ]
    values = {"lag": 0.4, "V_n": 0.0}
    at = RefinedModel(start, 0.1 * np.arange(prior.size), values, np.diag([4.0, 25.0]))
    windows = [
        SimpleNamespace(
            runs=["run 1", "run 0"],
            run=np.array([0, 0, 1, 1, 1, 1]),
            start=np.array([9.0, 16.5, -1.0, 5.9, 6.0, 11.5]),
        )
    ]
    return PredictionFit(runs, [], at, prior), at, prior, windows, {id("run 0"): 0, id("run 1"): 1}


def test_parameters_are_in_units_of_the_ship_and_coefficients_in_standard_deviations(monkeypatch):
    p, at, prior, *_ = made(monkeypatch)
    units = [at.start.unit("lag"), at.start.unit("V_n")]
    assert p.names == ["lag", "V_n", *prior.std]
    assert p.unit == pytest.approx([*units, *prior.std.values()])
    assert p.theta(at) == pytest.approx([0.4 / units[0], 0.0, *at.offset])
    expected = [4.0 * units[0] ** 2, 25.0 * units[1] ** 2, *[1.0] * prior.size]
    assert p.precision == pytest.approx(np.diag(expected))
    steps = {"lag": max(0.4, units[0]), "V_n": units[1], **prior.std}
    assert p._steps == pytest.approx({n: SMALL**2 * s for n, s in steps.items()})


@given(st.lists(st.floats(0.0, 2.0), min_size=4, max_size=4))
@settings(max_examples=10)
def test_a_step_moves_the_parameters_by_it(step):
    with pytest.MonkeyPatch.context() as patch:
        p, at, *_ = made(patch)
    whole = np.zeros(len(p.names))
    whole[[0, 1, 2, -1]] = step
    assert p.theta(p.moved(at, whole)) - p.theta(at) == pytest.approx(whole)


def test_a_coefficient_that_is_exact_is_no_parameter(monkeypatch):
    first = next(iter(NominalPrior.of(Model(), 0.1).std))
    p, at, prior, *_ = made(monkeypatch, exact=[first])
    assert p.names == ["lag", "V_n", *(n for n in prior.std if n != first)]
    moved = p.moved(at, np.ones(len(p.names)))
    assert moved.offset == pytest.approx(at.offset + np.array([0.0, *[1.0] * (prior.size - 1)]))
    assert first not in p._steps


def test_a_window_is_of_the_fold_in_which_it_begins(monkeypatch):
    """One that begins before the first block is of the first fold of its run."""
    p, _, _, windows, place = made(monkeypatch)
    p.windows, p._place = windows, place
    halves = [[0, 1, 2], [3, 4, 5]]
    assert [(run, blocks.tolist()) for run, blocks in p.folds] == [
        (k, h) for k in (0, 1) for h in halves
    ]
    (found,) = p.fold_of_window
    assert found.tolist() == [2, 3, 0, 0, 1, 1], "the fourth block begins after six seconds"


def test_the_cost_is_the_prior_and_the_likelihood_at_its_power(monkeypatch):
    p, at, *_ = made(monkeypatch)
    rng = np.random.default_rng(0)
    residuals = rng.standard_normal((2, W, T, 3))
    spreads = np.array([[spd(rng, 3 * T) for _ in range(W)] for _ in range(2)])
    spreads[0, 3] = 0.0  # a window in which the model ran away counts no more
    p.windows = [
        SimpleNamespace(
            residuals=lambda model, r=r: r, noise=np.zeros((W, T, 3)), run=np.zeros(W, int), runs=[0]
        )
        for r in residuals
    ]

    def misfit(s, spread):
        counts = running(spread)
        r = np.where(counts[:, None, None], s.residuals(None), 0.0)
        missed = p.missed(s, r**2, counts[:, None].repeat(T, axis=1))
        each = [
            S + np.diag(np.broadcast_to(m, (T, 3)).ravel())
            for S, m in zip(spread[counts], missed[counts], strict=True)
        ]
        squares = [
            x.ravel() @ np.linalg.solve(S, x.ravel()) for S, x in zip(each, r[counts], strict=True)
        ]
        return sum(squares) + sum(np.linalg.slogdet(S)[1] for S in each)

    theta = p.theta(at)
    likelihood = np.mean([misfit(*pair) for pair in zip(p.windows, spreads, strict=True)])
    expected = theta @ p.precision @ theta + 0.3 * likelihood
    assert p.cost(at, spreads, 0.3) == pytest.approx(expected, rel=1e-6)
    residuals[0, 3] = np.nan
    assert p.cost(at, spreads, 0.3) < np.inf, "in a window that does not count"
    residuals[1, 2] = np.nan
    assert p.cost(at, spreads, 0.3) == np.inf, "it runs away in a window"


def test_windows_of_one_kind_of_commands_are_together_and_empty_ones_left_out(monkeypatch):
    def accurate(smoothed, length, model):
        return SimpleNamespace(smoothed=smoothed, length=length, run=np.zeros(0 if length > 15.0 else 2))

    monkeypatch.setattr(fits, "Shooting", SimpleNamespace(accurate=accurate))
    runs = [
        SimpleNamespace(run=SimpleNamespace(signals=s), smoothed=k, horizon=h)
        for k, (s, h) in enumerate([(("a",), 8.0), (("b",), 6.0), (("a",), 8.0)])
    ]
    found = fits.shootings(runs, None, [0.5, 1.0, 2.0])
    assert [(s.smoothed, s.length) for s in found] == [
        ([0, 2], 4.0),
        ([0, 2], 8.0),
        ([1], 3.0),
        ([1], 6.0),
        ([1], 12.0),
    ]
