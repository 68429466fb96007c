"""Small decisions of assessment, search and verdict, each against its definition by other means."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import norm

from diagnosis.assessment.gains import ThrustGains, _own
from diagnosis.assessment.residual import recurrence as recurrences
from diagnosis.assessment.settings import SETTINGS
from diagnosis.runs.run_constants import NEGLIGIBLE
from diagnosis.search.conclusion import interval, laplace_std, suspected
from diagnosis.search.gram import (
    Nuisance,
    block_folds,
    block_numbers,
    gram_table,
    noise,
    run_folds,
)
from diagnosis.search.most_likely import beyond, ridge
from diagnosis.search.significance import Losses, gain, harm, predicts_worse
from fmus.declare import Range, Variable
from fmus.scale import REFERENCE

seeds = st.integers(0, 10**6)


# With what an error repeats


def windows_of_runs(seed, rows=60):
    """Places (K, 2), runs (K,), and times (K,) of the windows of two runs."""
    rng = np.random.default_rng(seed)
    run = np.repeat([0, 1], [rows - 20, 20])
    return rng.standard_normal((rows, 2)), run, np.concatenate([np.arange(rows - 20.0), np.arange(20.0)])


@given(seeds, st.sampled_from([0.0, 3.0, np.inf]), st.sampled_from([12, 60, 99]))
def test_neighbours_are_the_nearest_of_another_run_or_time(seed, least, count):
    x, run, time = windows_of_runs(seed)
    rows, there = recurrences._neighbours(x, run, time, least, count)
    for k in range(len(x)):
        nearest = np.argsort(np.hypot(*(x - x[k]).T), kind="stable")[:count]
        far = [j for j in nearest if run[j] != run[k] or abs(time[j] - time[k]) >= least]
        wanted = far[: SETTINGS.neighbours]
        way = x[wanted].mean(axis=0) - x[k] if wanted else 0.0 - x[k]
        if way @ way > SETTINGS.repeats * x.var(axis=0).sum():  # alone
            wanted = []
        assert rows[k][there[k]].tolist() == wanted
        assert there[k].sum() == len(wanted)
    if least > 0.0:
        assert not (rows[there] == np.arange(len(x)).repeat(there.sum(axis=1))).any(), "not itself"


@given(seeds, st.floats(0.0, 1.0))
def test_the_share_that_repeats_is_a_squared_correlation_beyond_chance(seed, repeats):
    """Of an error and the mean of its neighbours; by shifts of the error against them."""
    rng = np.random.default_rng(seed)
    x, run, time = windows_of_runs(seed)
    near = recurrences._neighbours(x, run, time, 2.0, 30)
    error = repeats * np.sin(2.0 * x[:, 0]) + (1.0 - repeats) * rng.standard_normal(len(x))
    rows, there = near
    mean = np.array([error[r[t]].mean() if t.any() else 0.0 for r, t in zip(rows, there, strict=True)])
    cosine = mean @ error / np.linalg.norm(mean) / np.linalg.norm(error)
    share = cosine**2 if cosine > 0.0 else 0.0
    offsets = np.array([7, 19, 31])
    found = recurrences._share(error, near, offsets)
    assert found in (0.0, pytest.approx(share))
    if share < SETTINGS.repeats:
        assert found == 0.0
    assert recurrences._share(error, near, np.zeros(0, int)) == pytest.approx(
        share if share >= SETTINGS.repeats else 0.0
    )
    assert recurrences._share(error, near, np.array([0])) == 0.0, "no more than by a shift"
    assert recurrences._share(0.0 * error, near, offsets) == 0.0


def test_speeds_that_are_reached_once_say_nothing_of_what_repeats():
    """A drag with a hump repeats with the speed, though only one of the runs is fast."""
    speed = np.concatenate([np.linspace(4.0, 12.0, 100), np.linspace(4.0, 8.0, 100)])
    run, time = np.repeat([0, 1], 100), np.tile(np.arange(100.0), 2)
    error = np.where(speed < 8.0, -np.exp(-((speed - 6.5) ** 2)), 0.3 * (speed - 8.0))
    near = recurrences._neighbours(speed[:, None], run, time, 60.0, 130)
    assert not near[1][speed > 10.0].any()
    assert near[1][speed < 8.0].all()
    assert recurrences._share(error, near, np.zeros(0, int)) > 0.3


def with_motion(eta, nu, orders=None, every=0.5):
    """Windows of a run, one each sample, with a constant force, or also the orders of two actuators."""
    n = len(eta)
    run = SimpleNamespace(
        tau_cmd=np.ones((n, 3)), name="one", commands=orders, signals=("a.n", "b.n"), given=orders
    )
    return SimpleNamespace(
        middle=every * np.arange(n),
        every=every,
        scale=REFERENCE,
        known=np.ones(n, bool),
        smoothed=SimpleNamespace(eta=eta, nu=nu),
        smooth=np.eye(n),
        held=np.eye(n),
        run=run,
    )


@pytest.mark.parametrize(
    ("error", "best"),
    [
        (lambda x, u: np.where(x > 0.0, u, 0.0), recurrences.TOGETHER),  # a drag at some places
        (lambda x, u: u, "motion"),
        (lambda x, u: np.random.default_rng(3).standard_normal(x.size), None),
    ],
)
def test_a_damping_that_differs_from_place_to_place_repeats_with_both_together(error, best):
    """The ship comes by each place in both directions at several speeds."""
    n, rng = 900, np.random.default_rng(1)
    slow = np.cumsum(rng.standard_normal((n, 2)), axis=0)
    x, u = np.sin(0.3 * slow[:, 0]), np.sin(0.3 * slow[:, 1])
    zero = np.zeros(n)
    w = with_motion(np.column_stack([x, zero, zero]), np.column_stack([u, zero, zero]))
    left = np.zeros((n, 3))
    left[:, 0] = error(x, u)
    assert recurrences.recurrence([w], left)[0].best == best


@pytest.mark.parametrize("known", [True, False])
def test_a_force_by_the_commands_of_two_actuators_repeats_with_these(known):
    """A jet takes force from the actuator behind it, of which the sum of both forces tells nothing."""
    n, rng = 900, np.random.default_rng(1)
    slow = np.cumsum(rng.standard_normal((n, 2)), axis=0)
    orders = np.sin(0.3 * slow)
    w = with_motion(np.zeros((n, 3)), np.zeros((n, 3)), orders if known else None)
    left = np.zeros((n, 3))
    left[:, 0] = orders[:, 0] * orders[:, 1]
    assert recurrences.recurrence([w], left)[0].best == ("command" if known else None)


def test_an_error_of_short_runs_is_compared_with_itself_at_many_shifts(monkeypatch):
    """By one shift alone half of all errors would repeat."""
    offsets = []
    monkeypatch.setattr(recurrences, "_share", lambda error, near, at, *_: offsets.append(at) or 0.0)
    rng, n = np.random.default_rng(0), 130
    w = with_motion(rng.standard_normal((n, 3)), rng.standard_normal((n, 3)), every=1.0)
    recurrences.recurrence([w], rng.standard_normal((n, 3)))
    assert all(np.unique(at).size > 20 for at in offsets)


@given(seeds, st.sampled_from([0.3, 0.9]))
def test_a_command_with_an_amplitude_for_each_stretch_is_compared_with_a_force_for_each(seed, always):
    rng = np.random.default_rng(seed)
    stretch = np.repeat(np.arange(6), 8)
    command, velocity, error = rng.standard_normal((3, 48))
    error = error + rng.choice([0.0, 3.0], 6)[stretch] * (command if seed % 2 else velocity)
    others = [np.ones(48), velocity]

    def explained(x):
        X = np.where(stretch[:, None] == np.arange(6), x[:, None], 0.0)
        left = error - X @ np.linalg.lstsq(X, error, rcond=None)[0]
        return 1.0 - left @ left / (error @ error)

    expected = explained(command) > max(*map(explained, others), always) + NEGLIGIBLE
    assert recurrences._in_part(error, command, others, stretch, always) == expected
    assert not recurrences._in_part(0.0 * error, command, others, stretch, 0.0)


def test_motions_count_by_their_spread_and_one_that_rests_does_not():
    x = np.column_stack([[1.0, 3.0, 5.0], [2.0, 2.0, 2.0]])
    scaled = recurrences._scaled(x)
    assert scaled[:, 0].std() == pytest.approx(1.0)
    assert scaled[:, 1].tolist() == [2.0, 2.0, 2.0]
    found = recurrences.Recurrence({"place": SETTINGS.repeats, "motion": 0.1}, 1.0, False)
    assert found.best == "place"
    assert found._replace(shares={"place": 0.24, "motion": 0.1}).best is None


# Gains of the commands

sizes = st.floats(0.02, 30.0)


@given(st.tuples(*[sizes] * 3), st.tuples(*[st.floats(0.001, 0.3)] * 3), st.tuples(*[st.booleans()] * 3))
def test_a_gain_is_wrong_that_no_ship_has(value, share, stated):
    value, stated = np.array(value), np.array(stated)
    error = value * share
    found = ThrustGains(value, error, stated)
    low, high = value - 3.0 * error, value + 3.0 * error
    all_weak = all(t and h < 0.4 for t, h in zip(stated, high, strict=True))
    for k in range(3):
        assert found.wrong[k] == (stated[k] and (low[k] > 2.5 or high[k] < 0.1 or all_weak))
    wrong = [k for k in range(3) if found.wrong[k]]
    turned = ThrustGains(value * [-1.0, 1.0, 1.0], error, np.array([True, False, False]))
    assert turned.wrong.tolist() == [value[0] * (1.0 - 3.0 * share[0]) > -0.1, False, False]
    assert turned.mean is None, "no factor mends a sign"
    unknown = ThrustGains(np.full(3, np.nan), error, np.zeros(3, bool))
    assert not unknown.wrong.any()
    if not wrong:
        assert found.mean is None
    else:
        weights = [1.0 / share[k] ** 2 for k in wrong]
        logs = sum(w * np.log(value[k]) for w, k in zip(weights, wrong, strict=True)) / sum(weights)
        assert found.mean == pytest.approx(np.exp(logs))


@given(seeds, st.floats(0.0, 2.0))
def test_a_command_has_for_its_own_what_a_regression_on_the_others_leaves(seed, follows):
    rng = np.random.default_rng(seed)
    others = list(rng.standard_normal((2, 50)) + 3.0)
    command = follows * others[0] + rng.standard_normal(50)
    X = np.column_stack([*others, np.ones(50)])
    left = command - X @ np.linalg.lstsq(X, command, rcond=None)[0]
    assert _own(command, others) == pytest.approx(left.var() / command.var(), rel=1e-9)
    assert _own(command, []) == pytest.approx(1.0)
    assert _own(2.0 * others[0] - 1.0, others) == pytest.approx(0.0, abs=1e-12)


# The most likely values


@pytest.mark.parametrize("places", [0, 1, 3, 40])
def test_limits_of_one_and_of_several_normal_values(places):
    chance = 0.01 / max(places, 1)
    assert beyond(places) == pytest.approx(norm.ppf(1.0 - chance / 2.0))
    assert interval(3.0, 0.5) == pytest.approx((3.0 - 0.98, 3.0 + 0.98), abs=1e-3)


@given(seeds)
def test_a_posterior_deviation_is_that_of_the_information_of_the_weighted_rows(seed):
    rng = np.random.default_rng(seed)
    columns, weight = rng.standard_normal((30, 3, 4)), np.array([1.0, 2.0, 0.5])
    precision = np.diag([1.0, 1.0, 0.0, 0.0])
    nuisance = Nuisance(columns, precision, np.zeros(4), np.ones(4))
    std = laplace_std(SimpleNamespace(weight=weight), nuisance)
    H = precision + sum(
        weight[a] ** 2 * columns[k, a][:, None] * columns[k, a] for k in range(30) for a in range(3)
    )
    assert std == pytest.approx(np.sqrt(np.diag(np.linalg.inv(H))), rel=1e-4)
    assert np.diag(ridge(H, 2.0)) == pytest.approx(1e-6 * (np.diag(H) + 0.25), rel=1.0)


def test_coefficients_are_suspects_whose_posterior_excludes_what_is_known_of_them():
    names = ["a", "b", "c"]
    prior = SimpleNamespace(
        std=dict(zip(names, (0.1, 2.0, 1.0), strict=True)),
        mean=dict(zip(names, (1.0, -3.0, 0.0), strict=True)),
    )
    limit = norm.ppf(1.0 - 0.01 / 3.0 / 2.0)
    std = np.array([0.1, 0.2, 0.3])
    free = SimpleNamespace(declared=lambda name: Variable(name, "1", "any", 0.0), value=prior.mean.get)
    found = suspected(prior, np.array([limit * 0.1 + 1e-6, -1.5, 0.3 * limit - 1e-6]), std, free)
    assert [s.name for s in found] == ["b", "a"]
    assert found[0].value == pytest.approx(-3.0 - 1.5 * 2.0)
    assert found[0].z == pytest.approx(-1.5)
    assert found[1].value == pytest.approx(1.0 + 0.1 * (0.1 * limit), abs=1e-6)


def test_a_suspect_coefficient_stays_within_its_range():
    """As a lag that the posterior has below zero."""
    lag = SimpleNamespace(
        declared=lambda name: Variable(name, "s", "lag", 1.0, Range(0.0, None)), value=lambda name: 4.0
    )
    prior = SimpleNamespace(std={"lag": 1.2}, mean={"lag": 4.0})
    (found,) = suspected(prior, np.array([-4.1]), np.array([0.1]), lag)
    assert (found.value, found.z) == (0.0, -4.1)


# Blocks, folds and Gram matrices


def run_of_blocks(count, rows=4):
    return SimpleNamespace(block=np.repeat(np.arange(count) + 5, rows))


@pytest.mark.parametrize(
    ("counts", "folds"),
    [([8], 4), ([3], 3), ([8, 8], 4), ([9, 2], 4), ([8, 8, 8], 3), ([2, 1, 5, 4], 4)],
)
def test_folds_leave_out_each_block_once_whole_runs_from_three_on(counts, folds):
    data = [run_of_blocks(n) for n in counts]
    parts, every = run_folds(data), block_folds(data)
    assert len(parts) == len(every) == folds
    assert sorted(np.concatenate(every)) == [*range(sum(counts))]
    first = np.cumsum([0, *counts])
    for (run, blocks), whole in zip(parts, every, strict=True):
        assert whole.tolist() == (first[run] + blocks).tolist()
        assert np.diff(blocks).tolist() == [1] * (blocks.size - 1), "a stretch of time"
        if len(counts) >= 3:
            assert blocks.size == counts[run]
    numbers = block_numbers(data)
    assert numbers[:, 0].tolist() == np.repeat(np.arange(len(counts)), np.multiply(counts, 4)).tolist()
    assert len(np.unique(numbers, axis=0)) == sum(counts)


@given(seeds)
def test_a_gram_table_holds_the_products_of_the_weighted_columns_of_each_block(seed):
    rng = np.random.default_rng(seed)
    y, X = rng.standard_normal((24, 3)), rng.standard_normal((24, 3, 2))
    sigma = np.array([0.5, 1.0, 2.0])
    blocks = np.column_stack([np.repeat([0, 1], 12), np.repeat(np.arange(6), 4)])
    nuisance = Nuisance(X, np.eye(2), np.zeros(2), np.array([1.0, 3.0]))
    table = gram_table(y, blocks, [], nuisance, sigma)
    from diagnosis.predictors.weak_form import OVERLAP

    A = np.concatenate([y[..., None], X], axis=2) / sigma[:, None] / np.sqrt(OVERLAP)
    for k in range(6):
        part = A[4 * k : 4 * k + 4].reshape(-1, 3)
        assert table.grams[k] == pytest.approx(part.T @ part)
    assert table.rows.tolist() == [4] * 6
    assert table.runs.tolist() == [0, 0, 0, 1, 1, 1]
    assert table.nuisance == [1, 2]
    assert table.unit.tolist() == [1.0, 1.0, 3.0]
    assert table.total == pytest.approx(table.grams.sum(axis=0))
    assert table.per_parameter == pytest.approx(np.log(72.0 / OVERLAP))
    for folds, number in ((table.by_run, [0, 0, 0, 1, 1, 1]), (table.by_block, [*range(6)])):
        for held, train in zip(*folds, strict=True):
            others = [k for k in range(6) if k not in held]
            assert len({number[k] for k in held}) == 1
            assert train == pytest.approx(table.grams[others].sum(axis=0))


@given(seeds)
def test_noise_is_what_all_columns_leave_on_each_axis(seed):
    rng = np.random.default_rng(seed)
    y, X = rng.standard_normal((50, 3)), rng.standard_normal((50, 3, 4))
    X[:, 1, 2] = 0.0  # acts on no sway
    floor = np.array([0.0, 0.0, 5.0])
    found = noise(y, X, floor)
    for axis in (0, 1):
        A = X[:, axis][:, np.abs(X[:, axis]).max(axis=0) > 0.0]
        left = y[:, axis] - A @ np.linalg.lstsq(A, y[:, axis], rcond=None)[0]
        assert found[axis] == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-4)
    assert found[2] == 5.0


# Losses on data that were not fitted


def losses(omega=1.0, position=1.0, heading=1.0, seed=0, size=40):
    """Losses about a common part, each times a factor."""
    base = 1.0 + 0.1 * np.random.default_rng(seed).random((3, size))
    return Losses(*(f * x for f, x in zip((omega, position, heading), base, strict=True)))


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (losses(), ""),
        (losses(omega=1.2), "the model fits {where} worse"),
        (losses(omega=0.8), ""),
        (losses(position=1.2), "predictions of {where} are worse"),
        (losses(heading=1.2), "predictions of {where} are worse"),
        (losses(position=1.2, heading=0.9), "predictions of {where} are worse"),
        (losses(position=1.1, heading=0.8), ""),
        (losses(position=1.0 - 0.9 * (np.arange(40) == 0), heading=1.001), ""),
        (losses(position=0.8, heading=1.1), ""),
        (losses(position=0.5, heading=0.5), ""),
        (losses(position=np.inf), "predictions of {where} are worse"),
    ],
)
def test_a_model_harms_where_a_loss_is_surely_larger(now, words):
    """Where it predicts places better and headings worse, both changes count together."""
    assert harm(now, losses()) == words
    assert predicts_worse(now, losses()) == words.startswith("predictions")
    assert harm(now, losses(), 5) == words
    none = np.zeros(0)
    assert not predicts_worse(now._replace(position=none, heading=none), Losses(none, none, none))


@pytest.mark.parametrize(("position", "worse"), [(0.4, False), (0.6, True)])
def test_of_two_models_at_most_one_predicts_worse(position, worse):
    """One halves the mean square of the place, to 0.4 or 0.6, and doubles that of the heading."""
    one, other = losses(position=position, heading=2.0), losses()
    assert predicts_worse(one, other) is worse
    assert predicts_worse(other, one) is not worse


@given(st.tuples(*[st.floats(0.2, 5.0)] * 3))
def test_a_gain_is_the_sum_of_the_logarithms_of_the_losses_ratios(factors):
    assume(all(f != 1.0 for f in factors))
    its, others = losses(*factors), losses()
    assert gain(its, others) == pytest.approx(np.log(np.prod(factors)), abs=1e-9)
    assert gain(others, its) == pytest.approx(-gain(its, others))
    none = np.zeros(0)
    alone = [x._replace(position=none, heading=none) for x in (its, others)]
    assert gain(*alone) == pytest.approx(np.log(factors[0]))
