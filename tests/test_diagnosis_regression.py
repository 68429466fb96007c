"""The regressions of the identification against direct least squares, and when a candidate is accepted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import optimize
from scipy.linalg import block_diag

from diagnosis.predictors.weak_form import OVERLAP
from diagnosis.runs.run_constants import DIGITS
from diagnosis.search import candidates
from diagnosis.search.candidates import Candidate, CandidateShape, scaled, smoothness
from diagnosis.search.gram import Nuisance, gram_table
from diagnosis.search.map_regression import Scored, held_out_loss, regression, score
from diagnosis.search.most_likely import Quadratic, most_likely, ridge
from diagnosis.search.nonlinear import profile
from diagnosis.search.shortlist import in_order, novelty
from diagnosis.search.significance import better, beyond_chance, harmful, matters
from fmus.declare import Range

K, BLOCK = 240, 12
SIGMA = np.array([0.5, 2.0, 0.1])
BLOCKS = np.column_stack([np.arange(K) >= 150, np.arange(K) // BLOCK])
PRIOR = np.array([[0.0, 0.0], [0.0, 1.0]])


def drawn(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def shape(columns, fitted=("a", "b"), **others):
    return CandidateShape({}, fitted, None, columns, np.ones(columns.shape[2]), **others)


PLAIN = shape(drawn(K, 3, 2))
CURVED = shape(drawn(K, 3, 2, seed=1), precision=np.array([[40.0, 5.0], [5.0, 30.0]]))
GIVEN = CandidateShape({"a": 0.7, "c": 2.0}, ["a"], drawn(K, 3, seed=2), drawn(K, 3, 1, seed=3), np.ones(1), np.array([0.2, 0.9]))  # fmt: skip
FORCED = drawn(K, 3, 2, seed=4)
Y = PLAIN.columns @ [1.0, -2.0] + GIVEN.offset + FORCED @ [0.3, -0.4] + 0.3 * SIGMA * drawn(K, 3, seed=5)
NUISANCE = Nuisance(FORCED, PRIOR, np.array([0.5, -1.5]), np.ones(2))
FAR = replace(PLAIN, given={"a": 50.0}, precision=0.05 * np.eye(2))  # fits as well, at a high price
SHAPES = [[PLAIN], [CURVED], [GIVEN, PLAIN], [FAR, PLAIN]]


@pytest.fixture(scope="module")
def table():
    return gram_table(Y, BLOCKS, [Candidate(None, s) for s in SHAPES], NUISANCE, SIGMA)


def direct(s, rows, nuisance=NUISANCE):
    """Coefficients, loss of each block and penalty of the fit to some rows, without Gram matrices."""
    start = [s.given.get(n, 0.0) for n in s.fitted]
    offset = nuisance.offset if s.nuisance_offset is None else s.nuisance_offset
    P = np.zeros((len(start),) * 2) if s.precision is None else s.precision
    at, P = np.concatenate([start, offset]), block_diag(P, nuisance.precision)
    weight = 1.0 / SIGMA / np.sqrt(OVERLAP)
    y = weight * (Y if s.offset is None else Y - s.offset)
    A = weight[:, None] * np.concatenate([s.columns, nuisance.columns], axis=2)
    X, z = A[rows].reshape(-1, at.size), y[rows].ravel()
    b = np.linalg.solve(X.T @ X + P, X.T @ z - P @ at)
    left = np.square(y - A @ b).sum(axis=1)
    losses = np.bincount(np.unique(BLOCKS, axis=0, return_inverse=True)[1].ravel(), left)
    H = X[:, : len(start)].T @ X[:, : len(start)]
    size = np.trace(np.linalg.solve(H + P[: len(start), : len(start)], H)) + len(
        set(s.given) - set(s.fitted)
    )
    return b[: len(start)], losses, (at + b) @ P @ (at + b), size


@pytest.mark.parametrize(("candidate", "number"), [(0, 0), (1, 0), (2, 0), (2, 1), (3, 0)])
def test_a_fit_by_gram_matrices_is_direct_least_squares(table, candidate, number):
    s = SHAPES[candidate][number]
    beta, losses, penalty, size = direct(s, np.arange(K))
    r = regression(table, candidate, number)
    fit = r.fitted(table.total)
    assert fit.beta == pytest.approx(beta, rel=1e-6)
    assert fit.penalty == pytest.approx(penalty, rel=1e-6)
    assert fit.loss(table.grams) == pytest.approx(losses, rel=1e-6)
    assert fit.loss(table.total) == pytest.approx(losses.sum(), rel=1e-6)
    assert r.size(table.total) == pytest.approx(size, rel=1e-6)


@pytest.mark.parametrize("candidate", [2, 3])
@pytest.mark.parametrize("by_run", [False, True])
def test_blocks_are_judged_by_fits_that_have_not_seen_them(table, by_run, candidate):
    names, block = np.unique(BLOCKS, axis=0, return_inverse=True)
    number = names[:, 0] if by_run else np.arange(len(names)) % 8
    expected = np.empty(len(names))
    sizes = [direct(s, np.arange(K))[3] for s in SHAPES[candidate]]
    charges = np.array(sizes) * np.log(3.0 * K / OVERLAP)
    for n in np.unique(number):
        train = np.flatnonzero(number[block.ravel()] != n)
        found = [direct(s, train) for s in SHAPES[candidate]]
        training = charges + [f[1][number != n].sum() + f[2] for f in found]
        expected[number == n] = found[int(np.argmin(training))][1][number == n]
    options = [regression(table, candidate, k) for k in range(2)]
    found = held_out_loss(table, options, charges, table.by_run if by_run else table.by_block)
    assert found == pytest.approx(expected, rel=1e-6)
    s = score(table, candidate, 2)
    assert (s.runs if by_run else s.blocks) == pytest.approx(expected, rel=1e-6)


def test_a_score_has_the_shape_that_fits_best_by_log_n_for_each_parameter(table):
    for k, shapes in enumerate(SHAPES):
        s = score(table, k, len(shapes))
        fits = [direct(each, np.arange(K)) for each in shapes]
        charged = [f[1].sum() + f[2] + f[3] * np.log(3.0 * K / OVERLAP) for f in fits]
        best = int(np.argmin(charged))
        assert (s.candidate, s.shape) == (k, best)
        assert s.prior == pytest.approx(fits[best][2], rel=1e-6)
        assert s.complexity == pytest.approx(fits[best][3] * np.log(3.0 * K / OVERLAP), rel=1e-6)
        assert s.penalty == s.prior + s.complexity
        assert s.score == pytest.approx(s.blocks.sum() + s.penalty)
    nothing = score(table, -1, 1)
    assert nothing.complexity == 0.0
    assert nothing.prior == pytest.approx(regression(table, -1, 0).fitted(table.total).penalty)
    first = BLOCKS[:, 0] == 0
    alone = gram_table(Y[first], BLOCKS[first], [], replace(NUISANCE, columns=FORCED[first]), SIGMA)
    assert score(alone, -1, 1).runs == pytest.approx(score(alone, -1, 1).blocks)
    assert alone.rows.tolist() == [BLOCK] * 12 + [6]


def test_a_column_that_holds_nothing_is_not_fitted_unless_it_has_a_prior():
    empty = PLAIN.columns * [1.0, 1e-12]
    prior = np.eye(2)
    made = [Candidate(None, [shape(empty)]), Candidate(None, [shape(empty, precision=prior)])]
    t = gram_table(Y, BLOCKS, made, NUISANCE, SIGMA)
    assert [regression(t, k, 0).free for k in (0, 1)] == [1, 2]
    large = [Candidate(None, [replace(shape(empty), unit=np.array([1.0, 1e9]))])]
    assert regression(gram_table(Y, BLOCKS, large, NUISANCE, SIGMA), 0, 0).free == 2


def test_novelty_is_the_share_that_what_was_found_cannot_give():
    along, across = np.zeros((2, K, 3, 1))
    along[::2], across[1::2] = 1.0, 1.0
    half = Candidate(None, [shape(along + across, ("a",))])
    found = Nuisance(np.concatenate([along, across], axis=2), PRIOR, np.zeros(2), np.ones(2))
    t = gram_table(Y, BLOCKS, [half], found, np.ones(3))
    assert [novelty(t, 0, free) for free in (0, 1, 2)] == pytest.approx([1.0, 0.5, 0.0], abs=1e-6)


def test_a_ridge_is_a_tiny_share_of_the_information_and_of_that_of_one_unit():
    H = np.array([[4.0, 1.0], [1.0, 9.0]])
    assert ridge(H) == pytest.approx(DIGITS**1.5 * np.diag([5.0, 10.0]))
    assert ridge(H, np.array([0.5, np.inf])) == pytest.approx(DIGITS**1.5 * np.diag([8.0, 9.0]))


@pytest.mark.parametrize("start", [-0.5, 4.0])
def test_the_most_likely_value_is_that_of_scipy_and_each_step_is_downhill(start):
    """A decay whose rate is sought, and a prior of unit deviation about zero, in Gauss-Newton steps."""
    t, seen = np.linspace(0.0, 3.0, 30), []
    y = np.exp(-1.3 * t)

    def residual(x):
        return (y - np.exp(-x * t)) / 0.05

    def cost(x):
        return float(residual(x) @ residual(x) + x * x)

    def about(x):
        seen.append(cost(x))
        J = -t * np.exp(-x * t) / 0.05
        return Quadratic(np.array([[J @ J + 1.0]]), np.array([J @ residual(x) - x]), cost)

    found, last = most_likely(start, about, lambda x, step: x + float(step[0]))
    true = optimize.minimize_scalar(cost, bracket=(1.0, 1.5)).x
    assert cost(found) - cost(true) < 0.02
    assert seen == sorted(seen, reverse=True)
    assert last.cost(found) == seen[-1] == cost(found)


@pytest.mark.parametrize(
    ("cost", "count", "first"), [(lambda x: x**2 + x, 2, 0.0), (lambda x: (x - 1.0) ** 2, 4, 1.25)]
)
def test_a_step_is_halved_unless_the_cost_rises_from_the_start(cost, count, first):
    tried = []

    def about(x):
        slope = 10.0 if x == 0.0 else 0.0  # wrong in the first case; it ends after a step in the other
        return Quadratic(np.array([[1.0]]), np.array([slope]), cost)

    def moved(x, step):
        tried.append(x + float(step[0]))
        return tried[-1]

    assert most_likely(0.0, about, moved)[0] == first
    assert tried == [10.0, 5.0, 2.5, 1.25][:count]


# What is accepted


def scored(candidate=0, blocks=(100.0,) * 40, prior=0.0, complexity=0.0, runs=None):
    losses = np.array(blocks, float)
    return Scored(candidate, 0, losses, losses if runs is None else np.array(runs), prior, complexity)


@pytest.mark.parametrize(
    ("best", "total", "accepted"),
    [
        (scored(blocks=[180.0] * 40), 8000.0, True),
        (scored(blocks=[180.0] * 40), 7200.0 / 0.95 - 1.0, False),  # 5 % of the model error
        (scored(blocks=[180.0] * 40), 7200.0 / 0.95 + 1.0, True),
        (scored(blocks=[199.8] * 40), 1e5, False),  # less than 10, and than 0.25 % of the error
        (scored(blocks=[199.52] * 40), 1e5, False),  # more than 10
        (scored(blocks=[199.48] * 40), 1e5, True),
        (scored(blocks=[199.48] * 40, complexity=1.0), 1e5, False),
    ],
)
def test_a_candidate_explains_more_than_chance_does(best, total, accepted):
    assert beyond_chance(scored(blocks=[200.0] * 40), best, total) == accepted
    fewer = replace(best, blocks=best.blocks / 100.0, complexity=0.0)
    assert not beyond_chance(scored(blocks=[2.0] * 40), fewer, 1e5), "a fall below 10 is chance"


def test_runs_that_a_candidate_was_not_fitted_to_count_with_what_the_prior_charges():
    alike = scored(runs=[100.0] * 40)
    assert harmful(alike, scored(runs=[101.0] * 40, blocks=[0.0] * 40))
    assert not harmful(alike, scored(runs=[99.0] * 40, blocks=[200.0] * 40))
    assert harmful(alike, scored(runs=[99.0] * 40, prior=41.0))
    assert not harmful(scored(prior=2.0), scored(runs=[99.0] * 40, prior=41.0))


@pytest.mark.parametrize("axis", range(3))
def test_an_effect_matters_from_the_size_on_from_which_a_residual_counts(axis):
    """5 % of the first error of an axis, 2 % of its command."""
    on = np.eye(3)[axis]
    first, command = 10.0 * drawn(K, 3), 10.0 * drawn(K, 3, seed=1)
    force = np.sqrt(np.square(first).sum(axis=0) / K) * on
    for share, does in ((0.051, True), (0.049, False)):
        assert matters(first, share * np.tile(force, (K, 1)), np.zeros((K, 3)), command) == does
    ordered = np.sqrt(np.square(command).sum(axis=0) / K) * on
    for share, does in ((0.021, True), (0.019, False)):
        left = np.zeros((K, 3))
        assert matters(left, share * np.tile(ordered, (K, 1)), left, command) == does
        assert not matters(left, left, share * np.tile(ordered, (K, 1)), command)


LAWS = SimpleNamespace(effects={n: SimpleNamespace(search=SimpleNamespace(smooth=n == "curve")) for n in ("curve", "law", "other")})  # fmt: skip


@pytest.mark.parametrize(
    ("present", "order", "falls", "chosen"),
    [
        ("law", ["law", "other"], [0.0, 50.0], None),
        ("law", ["other", "law"], [0.0, 9.0], None),  # of no more than an effect must bring
        ("law", ["other", "law"], [0.0, 11.0], 0),
        ("gone", ["other", "law"], [0.0, 1.0], 0),
        ("curve", ["curve", "law"], [0.0, 5.0], 1),  # a simple law that is no worse
        ("curve", ["curve", "law"], [0.0, 800.0], None),
        ("law", ["curve", "law"], [0.0, 800.0], 0),
        ("law", ["curve", "law", "other"], [0.0, 5.0, 5.0], None),
        ("other", ["curve", "law", "other"], [0.0, 0.0, 50.0], 1),
    ],
)
def test_a_place_is_taken_by_what_is_clearly_better_and_a_law_goes_before_a_curve(
    present, order, falls, chosen
):
    noise = 3.0 * drawn(40)
    noise -= noise.mean()
    found = [scored(k, 100.0 + f / 40.0 + (f > 0.0) * noise) for k, f in enumerate(falls)]
    best = SimpleNamespace(ids=order, scored=found)
    assert better(present, best, LAWS) == chosen
    backwards = [replace(s, candidate=len(order) - 1 - k) for k, s in enumerate(found)]
    assert better(present, SimpleNamespace(ids=order[::-1], scored=backwards), LAWS) == chosen


# Values that are tried, and their intervals


def test_an_interval_ends_where_the_cost_passes_its_least_by_the_quantile():
    for best, std in ((2.0, 0.1), (-5.0, 1.0)):

        def trial(x, best=best, std=std):
            return SimpleNamespace(cost=7.0 + ((x - best) / std) ** 2)

        for size in (-abs(best), abs(best)):
            end = profile._end(trial, 7.0, best, best + 1.5 * size)
            assert end - best == pytest.approx(np.sign(size) * np.sqrt(3.841) * std, rel=0.02)
    flat = profile._end(lambda x: SimpleNamespace(cost=0.0), 0.0, 1.0, 2.5)
    assert flat == 2.5, "where the cost passes nowhere the interval ends with the search"


@pytest.mark.parametrize(("most", "full"), [(1e9, 1.0), (0.2, None)])
@pytest.mark.parametrize("allowed", [Range(), Range(0.0, None), Range(None, 5e-3)])
def test_a_coefficient_is_tried_about_the_value_whose_force_is_the_model_error(
    monkeypatch, most, full, allowed
):
    """Force 30 N per unit, the error 3 N; or saturated at a fifth of a newton."""
    base = np.full((10, 3), 3.0)
    monkeypatch.setattr(candidates, "model_error", lambda data, x: base - np.clip(30.0 * x, -most, most))
    model = SimpleNamespace(
        unit=lambda n: 1.0,
        value=lambda n: 4.0,
        plus=lambda values: values["k"],
        ship=SimpleNamespace(scale=SimpleNamespace(forces=np.ones(3))),
    )
    e = SimpleNamespace(
        parameters=[SimpleNamespace(name="k", range=allowed)],
        shape_parameters=["s"],
        coefficients=["k", "l"],
    )
    found = list(scaled([], model, base, e, "k"))
    assert all((v["s"], v["l"]) == (4.0, 0.0) for v in found)
    size = 0.1 if full else 0.01
    each = [sign * k * size for sign in (1.0, -1.0) for k in (0.1, 0.3, 1.0, 3.0, 10.0)]
    inside = [
        x for x in each if (allowed.min is None or x >= 0.0) and (allowed.max is None or x <= 5e-3)
    ]
    if allowed.max is None:
        assert [v["k"] for v in found] == pytest.approx(inside)
    else:
        assert max(v["k"] for v in found) <= 5e-3
        assert [v["k"] for v in found if v["k"] < 0.0] == pytest.approx([x for x in each if x < 0.0])


def test_a_curve_is_as_rough_as_the_model_error_is_large():
    """With s the value of a constant curve that is as large as the error, a bend of s costs one."""
    columns = np.zeros((K, 3, 5))
    columns[np.arange(K), 0, np.arange(K) % 5] = 2.0
    base = np.column_stack([np.full(K, 6.0), np.full(K, 9.0), np.zeros(K)])
    P = smoothness(base, columns, np.ones(5, bool))
    straight = np.arange(5.0)
    assert straight @ P @ straight == pytest.approx(0.0, abs=1e-9)
    kink = np.maximum(straight - 2.0, 0.0)
    assert kink @ P @ kink == pytest.approx(1.0 / 3.0**2)
    assert smoothness(4.0 * base, columns, np.ones(5, bool)) == pytest.approx(P / 16.0)
    assert np.ones(5) @ P @ np.ones(5) == pytest.approx(0.0, abs=1e-9)


def test_of_scores_that_are_the_same_the_first_declared_goes_first():
    made = [scored(k, [x] * 40) for k, x in ((2, 1.0), (0, 3.0), (1, 1.0), (3, 0.9))]
    assert [s.candidate for s in in_order(made)] == [3, 1, 2, 0]
