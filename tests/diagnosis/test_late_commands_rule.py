"""The rule by which commands are late (diagnosis/assessment/late_commands.py), and commands moved in time."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis import Run
from diagnosis.assessment import late_commands as module
from diagnosis.assessment.late_commands import Timing, _Score, earlier, late_commands
from diagnosis.assessment.settings import SETTINGS
from diagnosis.predictors.uncertainty import MEASURED
from diagnosis.predictors.weak_form import OVERLAP
from diagnosis.runs.cleaning import BRIEF
from diagnosis.runs.run_constants import CHANCE
from diagnosis.runs.smoothing.lateness import LONGEST

N = 60
TIMES = BRIEF * np.arange(1, round(LONGEST / BRIEF) + 1)


@settings(max_examples=15)
@given(st.integers(0, 1000), st.floats(-0.6, 0.6), st.lists(st.integers(0, 2), min_size=1, unique=True))
def test_columns_are_earlier_by_their_mean_over_each_row(seed, seconds, columns):
    """The first is held before the run, the last behind it; other columns stay."""
    rng = np.random.default_rng(seed)
    time = 5.0 + np.cumsum(rng.uniform(0.1, 0.3, N))
    tau = rng.standard_normal((N, 3))
    found = earlier(Run("made", time, np.zeros((N, 3)), tau), columns, seconds).tau_cmd
    edges = np.append(time, time[-1] + np.median(np.diff(time)))
    for k in (0, 7, 30, N - 1):
        fine = edges[k] + seconds + (np.arange(500) + 0.5) / 500.0 * (edges[k + 1] - edges[k])
        rows = np.clip(np.searchsorted(time, fine, side="right") - 1, 0, N - 1)
        for j in range(3):
            expected = tau[rows, j].mean() if j in columns else tau[k, j]
            assert found[k, j] == pytest.approx(expected, abs=0.03)


# The rule, by likelihoods that are given


BLOCKS = 12


class Given:
    """Likelihoods: that of commands as they are is 0, and those of columns as stated."""

    unknowns = 4
    independent = np.full(3, 20.0)
    as_logged = "as logged"

    def __init__(self, likelihoods, factor=1.0, factor_as_logged=0.4, sure=True, rival=0.0):
        self.likelihoods, self.factor, self.logged = likelihoods, factor, factor_as_logged
        self.sure, self.rival = sure, rival

    def at(self, total, factor, better):
        rng = np.random.default_rng(0)
        squares = (1.0 if better else 3.0) + 0.1 * rng.random((BLOCKS, 3))
        if better and not self.sure:
            squares[1:] = 3.2
            squares[0] = 0.0
        size = np.array([1.0, 3.0 if not better else 1.0, 1.0])
        return _Score(total, size, squares, np.array([9.0, factor, 9.0]))

    def score(self, force):
        assert force == "as logged"
        return self.at(0.0, self.logged, False)

    def likeliest(self, columns, times):
        assert times.tolist() == TIMES.tolist()
        total, k = self.likelihoods.get(tuple(columns), (-5.0, 0))
        return float(times[k]), self.at(total, self.factor, True)

    def rivals(self, columns, times):
        yield self.at(-3.0, 1.0, False)
        yield self.at(self.rival, 1.0, False)


def late(monkeypatch, given, varies=(True, True, False), windows=1000):
    tau = np.where(varies, np.arange(N)[:, None], 1.0)
    run = Run("made", np.arange(float(N)), np.zeros((N, 3)), tau)
    w = SimpleNamespace(run=run, scale=SimpleNamespace(time=1.0), middle=np.zeros(windows))
    given.w = w
    monkeypatch.setattr(module, "Timing", lambda w, model: given)
    return late_commands(w, None)


def tries(groups=3):
    return groups * len(TIMES)


def test_the_likeliest_column_is_reported_with_its_time_and_odds(monkeypatch):
    found = late(monkeypatch, Given({(1,): (50.0, 3)}))
    assert found.signals == ["tau_Y"]
    assert found.seconds == TIMES[3]
    assert found.log_odds == pytest.approx(50.0 - np.log(tries()))


def test_of_one_column_and_all_the_first_is_reported_unless_all_are_far_likelier(monkeypatch):
    asked = -np.log(CHANCE)
    near = {(0,): (50.0, 2), (0, 1): (50.0 + 0.9 * asked, 4)}
    assert late(monkeypatch, Given(near)).signals == ["tau_X"]
    far = {(0,): (50.0, 2), (0, 1): (50.0 + 1.1 * asked, 4)}
    found = late(monkeypatch, Given(far))
    assert (found.signals, found.seconds) == (["tau_X", "tau_Y"], TIMES[4])


def test_one_column_that_varies_is_no_group_beside_itself(monkeypatch):
    found = late(monkeypatch, Given({(2,): (50.0, 3)}), varies=(False, False, True))
    assert found.log_odds == pytest.approx(50.0 - np.log(tries(1)))
    assert late(monkeypatch, Given({}), varies=(False,) * 3) is None


@pytest.mark.parametrize(("margin", "stated"), [(0.9, False), (1.1, True)])
def test_odds_must_be_beyond_chance_for_all_that_is_tried_and_the_best_rival(
    monkeypatch, margin, stated
):
    needed = margin * -np.log(CHANCE) + np.log(tries())
    assert bool(late(monkeypatch, Given({(0,): (needed, 1)}))) == stated
    assert bool(late(monkeypatch, Given({(0,): (needed + 7.0, 1)}, rival=7.0))) == stated


def test_one_block_alone_makes_no_column_late(monkeypatch):
    assert late(monkeypatch, Given({(0,): (50.0, 1)}, sure=False)) is None


@pytest.mark.parametrize(
    ("factor", "logged", "stated"),
    [
        (1.0 + 0.99 * MEASURED, 1.0, True),
        (1.0 - 0.99 * MEASURED, 1.0, True),
        (1.0 + 1.01 * MEASURED, 1.0, False),
        (1.3, 1.0 - 0.31, True),  # nearer to one than as it is logged
        (1.3, 1.0 - 0.29, False),
        (1.0 + 1.01 * SETTINGS.much, 99.0, False),
    ],
)
def test_the_force_must_act_once_or_nearer_to_once_than_as_it_is_logged(
    monkeypatch, factor, logged, stated
):
    """On the axis that it explains most."""
    assert bool(late(monkeypatch, Given({(0,): (50.0, 1)}, factor, logged))) == stated


@pytest.mark.parametrize(("windows", "stated"), [(OVERLAP * 4 - 1, False), (OVERLAP * 4, True)])
def test_a_run_has_as_many_independent_windows_as_factors_that_are_fitted(monkeypatch, windows, stated):
    assert bool(late(monkeypatch, Given({(0,): (50.0, 1)}), windows=int(windows))) == stated


# The likelihood


def timing(force_share=1.0, seed=0, n=400):
    """Inertial forces that are those of the thrusters, one other force on each axis, and noise."""
    rng = np.random.default_rng(seed)
    t = object.__new__(Timing)
    force, other = rng.standard_normal((n, 3)), rng.standard_normal((n, 1))
    t._a = force_share * force + 0.5 * other + 0.1 * rng.standard_normal((n, 3))
    t._others = [other, np.hstack([other, rng.standard_normal((n, 1))]), other]
    t._noise, t._block = np.full(3, 2.0), np.arange(n) // 50
    t.__dict__["independent"] = np.array([30.0, 20.0, 10.0])
    return t, force


def test_a_force_is_fitted_with_all_else_that_may_act():
    t, force = timing(0.8)
    s = t.score(force)
    assert s.factor == pytest.approx([0.8] * 3, abs=0.02)
    left = np.empty_like(force)
    for j in range(3):
        x = np.column_stack([force, t._others[j]])
        left[:, j] = t._a[:, j] - x @ np.linalg.lstsq(x, t._a[:, j], rcond=None)[0]
    squares = left**2
    assert s.size == pytest.approx(squares.sum(axis=0) + 2.0, rel=1e-6)
    assert s.squares == pytest.approx(squares.reshape(8, 50, 3).sum(axis=1), rel=1e-5)
    assert s.total == pytest.approx(-0.5 * t.independent @ np.log(s.size))
    assert t.unknowns == 3 + 2
    other, _ = timing(seed=1)
    assert t.score(other._a).total < s.total
