"""Models on the way to the most likely one (diagnosis/search/refinement.py), by a linear model error."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis import Model
from diagnosis.search import candidates, refinement
from diagnosis.search.candidates import SMALL
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import (
    CandidateStart,
    RefinedModel,
    Refinement,
    bounded,
    nuisance_of,
    refit,
    slope,
    timed,
    weighted_rows,
)

START = Model()
K, SIGMA = 40, np.array([0.5, 2.0, 0.1])


def point(values, held=(), offset=None):
    prior = NominalPrior.of(START, 0.1)
    offset = np.zeros(prior.size) if offset is None else offset
    at = RefinedModel(START, offset, values, np.diag([1.0 + k for k in range(len(values))]))
    return at.holding(held) if held else at


def test_an_addition_stays_within_the_range_of_the_whole_value():
    (_, high), present = refinement.limits(START.declared("lag")), START.value("lag")
    assert bounded(START, "lag", -9.0) == -present
    assert bounded(START, "lag", 0.2) == 0.2
    assert bounded(START, "lag", 1e300) == high - present
    shifted = START.plus({"lag": 0.4})
    assert bounded(shifted, "lag", -0.3) == -0.3
    assert bounded(shifted, "lag", -9.0) == pytest.approx(-shifted.value("lag"))


def test_a_model_has_its_values_and_its_coefficients_in_standard_deviations():
    prior = NominalPrior.of(START, 0.1)
    offset = np.zeros(prior.size)
    offset[[*prior.mean].index("X_u")] = 2.0
    model = point({"lag": 0.4}, offset=offset).model(prior)
    assert model.value("lag") == pytest.approx(START.value("lag") + 0.4)
    assert model.value("X_u") == pytest.approx(prior.mean["X_u"] + 2.0 * prior.std["X_u"])
    assert model.value("N_r") == START.value("N_r")


def test_values_that_are_held_or_are_times_within_a_run_are_not_fitted():
    name = "bow_failure_time"
    assert timed(START.ship, name) is not None
    assert timed(START.ship, f"{name}@run 2") is timed(START.ship, name)
    assert timed(START.ship, "lag") is None
    at = point({"lag": 0.4, "V_n": 0.1, "V_e": 0.2})
    assert at.fitted == ["lag", "V_n", "V_e"]
    one = at.holding(["V_n"])
    assert one.fitted == ["lag", "V_e"]
    assert one.values == at.values
    assert np.diag(one.precision).tolist() == [1.0, 3.0]
    assert one.holding(["lag"]).fitted == ["V_e"]
    times = RefinedModel(START, np.zeros(3), {name: 3.0, "lag": 0.1}, np.eye(1))
    assert times.fitted == ["lag"]


def test_an_estimate_without_an_effect_keeps_the_precision_of_the_others():
    at = point({"lag": 0.4, "V_n": 0.1, "V_e": 0.2}, held=["lag"])
    left = at.without({"V_n"})
    assert left.values == {"lag": 0.4, "V_e": 0.2}
    assert left.precision.tolist() == [[3.0]]
    assert at.without({"lag"}).precision.tolist() == [[2.0, 0.0], [0.0, 3.0]]


@settings(max_examples=20)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_additions_add_up_within_their_ranges(first, second):
    at = point({"lag": 0.4, "V_n": 0.1})
    moved = at.plus({"lag": first, "V_e": second}, np.full(at.offset.size, 0.5))
    assert moved.values["lag"] == pytest.approx(bounded(START, "lag", 0.4 + first))
    assert moved.values["V_n"] == 0.1
    assert moved.values["V_e"] == pytest.approx(bounded(START, "V_e", second))
    assert (moved.offset == 0.5).all()


def test_rows_are_weighted_axis_by_axis():
    columns = np.random.default_rng(0).standard_normal((K, 3, 4))
    weight = np.array([1.0, 2.0, 3.0])
    found = weighted_rows(columns, weight)
    assert found.shape == (3 * K, 4)
    assert found[3 * 7 + 1, 2] == pytest.approx(2.0 * columns[7, 1, 2])


# The whole of a fit that is linear


class Linear:
    """A model error that every value changes by a force of its own, and what a fit asks of its data."""

    data, weight = (), 1.0 / SIGMA

    def __init__(self, names, prior, seed=0):
        rng = np.random.default_rng(seed)
        self.prior = prior
        self.force = {n: SIGMA * rng.standard_normal((K, 3)) / START.unit(n) for n in names}
        self.force |= {n: SIGMA * rng.standard_normal((K, 3)) / s for n, s in prior.std.items() if s}
        self.y = SIGMA * rng.standard_normal((K, 3))
        true = dict(zip(names, rng.uniform(0.2, 0.5, len(names)), strict=True))
        self.y = self.y + sum(3.0 * START.unit(n) * x * self.force[n] for n, x in true.items())

    def of(self, model):
        return self.y - sum((model.value(n) - START.value(n)) * f for n, f in self.force.items())

    def error(self, at):
        return self.of(at.model(self.prior))

    def rows(self, names):
        return np.stack([(self.force[n] * self.weight).ravel() for n in names], axis=1)


@pytest.fixture
def linear(monkeypatch):
    prior = NominalPrior.of(START, 0.1)
    t = Linear(["lag", "V_n", "V_e"], prior)
    for module in (refinement, candidates):
        monkeypatch.setattr(module, "model_error", lambda data, model: t.of(model))
    return t


def test_a_slope_is_the_force_by_one_unit_of_a_value(linear):
    for scale in (0.0, 0.3):
        found = slope(linear, START, linear.of(START), "V_n", scale)
        assert found == pytest.approx(
            linear.force["V_n"], abs=1e-6 / SMALL * np.abs(linear.force["V_n"]).max()
        )


def test_nuisance_parameters_are_what_was_found_and_the_coefficients(linear):
    prior = linear.prior
    at = point({"lag": 0.4, "V_n": 0.1}, offset=0.1 * np.arange(prior.size))
    found = nuisance_of(linear, at, linear.error(at))
    exact = [n for n, s in prior.std.items() if not s]
    for k, n in enumerate(["lag", "V_n", *prior.std]):
        std = prior.std.get(n, 1.0)
        expected = np.zeros((K, 3)) if n in exact else std * linear.force[n]
        assert found.columns[..., k] == pytest.approx(
            expected, abs=1e-4 * max(np.abs(expected).max(), 1e-9)
        )
    assert found.precision == pytest.approx(np.diag([1.0, 2.0, *[1.0] * prior.size]))
    assert found.offset == pytest.approx([0.4, 0.1, *at.offset])
    assert found.unit == pytest.approx([START.unit("lag"), START.unit("V_n"), *[1.0] * prior.size])


def test_a_candidate_and_all_else_end_at_the_least_squares_with_their_priors(linear):
    """Of a candidate with a prior, an effect found before, and the coefficients about theirs."""
    prior = linear.prior
    at = point({"V_n": 0.0})
    nuisance = nuisance_of(linear, at, linear.error(at))
    begin = CandidateStart({"V_e": 0.1}, ("V_e",), np.array([[7.0]]))
    found = Refinement(linear, at, nuisance, begin).solved()
    kept = [n for n, s in prior.std.items() if s]
    scale = np.array([1.0, 1.0, *(prior.std[n] for n in kept)])
    A = linear.rows(["V_e", "V_n", *kept]) * scale
    P = np.diag([7.0, 1.0, *[1.0] * len(kept)])
    y = (linear.y * linear.weight).ravel()
    expected = np.linalg.solve(A.T @ A + P, A.T @ y)
    assert found.estimate.values["V_e"] == pytest.approx(expected[0], rel=1e-3, abs=1e-4)
    assert found.estimate.values["V_n"] == pytest.approx(expected[1], rel=1e-3, abs=1e-4)
    offset = dict(zip(prior.mean, found.estimate.offset, strict=True))
    assert [offset[n] for n in kept] == pytest.approx(expected[2:], abs=2e-3)
    left = y - A @ expected
    assert found.cost == pytest.approx(left @ left + expected @ P @ expected, rel=1e-4)
    assert found.own(at) == {"V_e": found.estimate.values["V_e"]}
    again = refit(linear, found.estimate, nuisance_of(linear, replaced(found.estimate), found.left))
    assert again.estimate.values["V_e"] == pytest.approx(
        found.estimate.values["V_e"], rel=0.05, abs=0.01
    )


def replaced(at):
    """The estimate with a precision for each of its values."""
    return RefinedModel(at.start, at.offset, at.values, np.diag([1.0, 7.0]))
