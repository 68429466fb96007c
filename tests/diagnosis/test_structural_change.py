"""The moment at which a model error changes, if there is one."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.assessment.residual.structural_change import STRETCH, moment_of_change, most_changed
from diagnosis.assessment.settings import SETTINGS

N, EVERY, AT = 800, 0.5, 170.0  # windows, s, s
STD = 0.1  # 1, of the noise, of a change by about one


def wandering(rng, lasting):
    """(N,), force of unit power whose correlation falls to 1 / e in so many seconds."""
    a = np.exp(-EVERY / lasting)
    steps = np.sqrt(1.0 - a * a) * rng.standard_normal(N)
    x = np.zeros(N)
    for k in range(1, N):
        x[k] = a * x[k - 1] + steps[k]
    return x


def series(seed):
    """Time, constant, velocity and command (N,) of a run with slow manoeuvres, and its noise."""
    rng = np.random.default_rng(seed)
    u, command = wandering(rng, 10.0), wandering(rng, 10.0)
    return EVERY * np.arange(N), np.ones(N), u, command, STD * rng.standard_normal(N)


def moment(seed, error, before=(), always=0.0):
    t, *regressors, noise = series(seed)
    runs = [
        SimpleNamespace(middle=t, run=SimpleNamespace(name=f"run{k}")) for k in range(len(before) + 1)
    ]
    x = np.tile(np.column_stack(regressors), (len(runs), 1))
    return moment_of_change(runs, np.concatenate([*before, error(t, *regressors) + noise]), x, always)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "error",
    [
        lambda t, one, u, command: np.where(t < AT, 0.0, one),
        lambda t, one, u, command: np.where(t < AT, 0.5 * u, -0.5 * u),
        lambda t, one, u, command: np.where(t < AT, 0.0, command),
    ],
)
def test_the_moment_of_a_change_is_found_in_its_run(seed, error):
    name, at = moment(seed, error)
    assert (name, at) == ("run0", pytest.approx(AT, abs=EVERY * STRETCH))
    name, at = moment(seed, error, before=[series(seed + 7)[-1]])
    assert (name, at) == ("run1", pytest.approx(AT, abs=EVERY * STRETCH))
    assert moment(seed, error, always=0.96) is None, "as much is explained without a change"


@pytest.mark.parametrize(
    "error",
    [
        lambda t, one, u, command: 0.0 * one,
        lambda t, one, u, command: one + u + command,
        lambda t, one, u, command: u * np.abs(u),
        lambda t, one, u, command: 0.01 * t * command,
        lambda t, one, u, command: (t // 40.0 % 2.0) * command,
        lambda t, one, u, command: ((t > AT - 60.0) & (t < AT + 60.0)) * one,
        lambda t, one, u, command: np.where(t < 6.0, 10.0, 0.0),
    ],
)
def test_no_moment_is_named_where_an_error_does_not_change_once(error):
    """Noise, a wrong coefficient, a law of another shape, a drift, what comes and goes, and a start."""
    assert [moment(seed, error) for seed in range(3)] == [None] * 3


@pytest.mark.parametrize("lasting", [5.0, 50.0, 400.0])
def test_a_force_that_wanders_is_no_change(lasting):
    errors = [wandering(np.random.default_rng([9, seed]), lasting) for seed in range(8)]
    assert [moment(k, lambda t, *_, e=e: e) for k, e in enumerate(errors)] == [None] * 8


def test_a_run_shorter_than_four_stretches_has_no_moment():
    x = np.ones((4 * STRETCH, 1))
    error = np.repeat([0.0, 1.0], 2 * STRETCH)
    assert most_changed(error, x)[:2] == (pytest.approx(STRETCH), 2 * STRETCH)
    assert most_changed(error[1:], x[1:]) == (0.0, 0, 0)


@given(st.integers(0, 9999), st.integers(0, STRETCH))
def test_the_gain_is_that_of_two_fits_over_one(seed, more):
    """A regressor of zeros adds nothing."""
    rng, n = np.random.default_rng(seed), 6 * STRETCH + more
    x = np.column_stack([rng.standard_normal((n, 2)), np.zeros(n)])
    error = rng.standard_normal(n)

    def left(part):
        rest = error[part] - x[part] @ np.linalg.lstsq(x[part], error[part], rcond=None)[0]
        return rest @ rest

    rows = range(2 * STRETCH, 4 * STRETCH + more + 1, STRETCH)
    gains = [left(slice(n)) - left(slice(row)) - left(slice(row, n)) for row in rows]
    found = most_changed(error, x)
    assert (found.gain, found.tried) == (pytest.approx(max(gains)), len(gains))
    assert found.row == rows[int(np.argmax(gains))]


def test_a_change_that_explains_a_small_share_is_not_named():
    size = np.sqrt(SETTINGS.repeats)  # half of the difference is the deviation: a quarter of the squares

    def error(t, one, u, command):
        return np.where(t < AT, 0.0, size * one) + np.sin(40.0 * t)

    assert moment(0, error) is None
    assert moment(0, lambda *x: 4.0 * error(*x) - 3.0 * np.sin(40.0 * x[0])) is not None
