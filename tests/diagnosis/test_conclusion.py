"""The conclusion of a search (diagnosis/search/conclusion.py) on a model error that is linear in all values."""

from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from diagnosis.predictors.weak_form import OVERLAP
from diagnosis.search import conclusion
from diagnosis.search.conclusion import AcceptedEffect, Selection, interval
from diagnosis.search.gram import WHOLE_RUNS, Nuisance
from diagnosis.search.rivals import LinearProblem, probability_beside
from fmus.declare import Variable

K, BLOCK = 240, 12
SIGMA = np.array([0.5, 2.0, 0.1])
WEIGHT = 1.0 / SIGMA / np.sqrt(OVERLAP)
RNG = np.random.default_rng(0)
EFFECTS, COEFFICIENTS = ["a", "b", "c"], ["X_u", "N_r"]
COLUMN = {n: SIGMA * RNG.standard_normal((K, 3)) for n in (*EFFECTS, *COEFFICIENTS)}
TRUE = {"a": 0.8, "b": -0.5, "c": 0.3, "X_u": 1.5, "N_r": -0.7}
Y = sum(x * COLUMN[n] for n, x in TRUE.items()) + 0.5 * SIGMA * RNG.standard_normal((K, 3))


class Start:
    """The initial model, whose parameters have no ranges."""

    def declared(self, name):
        return Variable(name, "1", "any", 0.0)

    def value(self, name):
        return PRIOR.mean[name]


START = Start()


@dataclass(frozen=True)
class Point:
    """Values of the effects and offsets of the coefficients."""

    values: dict
    offset: np.ndarray
    start: Start = START
    failing = MappingProxyType({})  # effects with intervals

    @property
    def fitted(self):
        return [*self.values]

    def theta(self, names):
        return np.array([*(self.values[n] for n in names), *self.offset])

    def without(self, names):
        return Point({n: x for n, x in self.values.items() if n not in names}, self.offset)

    def plus(self, step, offset):
        assert [*step] == self.fitted
        return Point({n: x + step[n] for n, x in self.values.items()}, self.offset + offset)

    def model(self, prior):
        assert prior is PRIOR
        return self

    @property
    def ship(self):
        effect = SimpleNamespace(kind="environment", id="", search=SimpleNamespace(intervals=()))
        return SimpleNamespace(effects=dict.fromkeys("ABC", effect) | self.failing)


PRIOR = SimpleNamespace(std={"X_u": 0.2, "N_r": 0.0}, mean={"X_u": -1.0, "N_r": -2.0}, size=2)


def names_of(at):
    return [*at.fitted, *COEFFICIENTS]


def theta_of(at):
    return np.array([*at.values.values(), *at.offset])


def error(at):
    return Y - sum(x * COLUMN[n] for n, x in zip(names_of(at), theta_of(at), strict=True))


def precision_of(at):
    return np.diag([0.0] * len(at.values) + [1.0] * 2)


def rows(names):
    return np.stack([(WEIGHT * COLUMN[n]).ravel() for n in names], axis=1)


def best(at, keep=slice(None)):
    """The most likely values of a point's names by some rows of windows, by least squares with the prior."""
    A, P = rows(names_of(at)).reshape(K, 3, -1)[keep].reshape(-1, len(names_of(at))), precision_of(at)
    y = (WEIGHT * Y)[keep].ravel()
    return np.linalg.solve(A.T @ A + P, A.T @ y)


def nuisance_of(t, at, e):
    columns = np.stack([COLUMN[n] for n in names_of(at)], axis=2)
    return Nuisance(columns, precision_of(at), theta_of(at), np.ones(len(names_of(at))))


def refit(t, at, nuisance):
    found = best(at)
    n = len(at.values)
    return SimpleNamespace(
        estimate=Point(dict(zip(at.fitted, found[:n].tolist(), strict=True)), found[n:])
    )


@pytest.fixture(autouse=True)
def _linear(monkeypatch):
    monkeypatch.setattr(conclusion, "nuisance_of", nuisance_of)
    monkeypatch.setattr(conclusion, "refit", refit)


def effect(name, **more):
    return AcceptedEffect(name.upper(), (name,), {}, {name.upper(): 0.9, "other": 0.1}, 1.0, **more)


def selection(names="abc", runs=1):
    at = refit(None, Point(dict.fromkeys(names, 0.0), np.zeros(2)), None).estimate
    parts = np.array_split(np.arange(K // BLOCK), runs)
    run = np.repeat([k for k, part in enumerate(parts) for _ in part], BLOCK)
    blocks = np.column_stack([run, np.arange(K) // BLOCK])
    data = [SimpleNamespace(block=blocks[run == k, 1]) for k in range(runs)]
    t = SimpleNamespace(error=error, blocks=blocks, sigma=SIGMA, weight=WEIGHT, prior=PRIOR, data=data)
    stated = SimpleNamespace(std={"X_u": 0.5, "N_r": 0.3})
    return Selection(t, at, [effect(n) for n in names], ["ranked"] * 7, Y, stated)


def without(s, held):
    """The point fitted without some blocks, directly."""
    keep = ~np.isin(np.arange(K) // BLOCK, held)
    return best(s.at, keep)


@pytest.mark.parametrize("runs", [1, 2, 3, 5])
def test_fold_models_are_fits_to_the_other_blocks(runs):
    """Each whole run alone where there are three; of two also by whole runs."""
    s = selection(runs=runs)
    usual, by_run = s._fold_models()
    parts = np.array_split(np.arange(K // BLOCK), runs)
    if runs >= WHOLE_RUNS:
        assert len(usual) == runs
        assert by_run is usual
        for model, held in zip(usual, parts, strict=True):
            assert theta_of(model) == pytest.approx(without(s, held), abs=1e-6)
    assert (len(by_run) == runs) == (runs > 1)
    if runs == WHOLE_RUNS - 1:
        assert len(usual) > runs
        for model, held in zip(by_run, parts, strict=True):
            assert theta_of(model) == pytest.approx(without(s, held), abs=1e-6)


def test_shares_are_falls_of_the_cross_validated_squares_effect_by_effect():
    s = selection()
    models, shares = s._nested()
    total = np.sum((WEIGHT * Y) ** 2)
    before, expected = total, []
    for k in range(1, 4):
        at = Point(dict.fromkeys("abc"[:k], 0.0), np.zeros(2))
        left = 0.0
        folds = np.arange(K // BLOCK) % 8
        for fold in range(8):
            held = np.isin(np.arange(K) // BLOCK, np.flatnonzero(folds == fold))
            A = rows(names_of(at)).reshape(K, 3, -1)
            left += np.sum(((WEIGHT * Y)[held] - A[held] @ best(at, ~held)) ** 2)
        expected.append((before - left) / total)
        before = left
    assert shares == pytest.approx(expected, rel=1e-4)
    assert [m.fitted for m in models] == [["a"], ["a", "b"], ["a", "b", "c"]]
    assert theta_of(models[0]) == pytest.approx(best(Point({"a": 0.0}, np.zeros(2))))


def test_nuisance_parameters_of_a_part_are_those_of_the_whole():
    s = selection()
    part = s._of(s.at.without({"b"}))
    assert part.columns == pytest.approx(
        np.stack([COLUMN[n] for n in ("a", "c", *COEFFICIENTS)], axis=2)
    )
    assert part.precision == pytest.approx(np.diag([0.0, 0.0, 1.0, 1.0]))
    assert part.offset == pytest.approx(theta_of(s.at)[[0, 2, 3, 4]])
    assert part.unit.tolist() == [1.0] * 4


def test_coefficients_are_as_wide_as_stated_but_for_those_that_are_exact():
    assert selection()._wider.tolist() == [2.5, 1.0]


@pytest.mark.parametrize("gone", [(), ("b",), ("a", "b", "c")])
def test_a_rival_is_the_error_without_some_parameters_about_the_estimate(gone):
    s = selection()
    problem, charged = s._linear(gone)
    kept = [n for n in "abc" if n not in gone]
    assert charged == len(kept)
    assert problem.y == pytest.approx((WEIGHT * error(s.at.without(gone))).ravel())
    assert problem.effects == pytest.approx(rows(kept) if kept else np.zeros((3 * K, 0)))
    assert problem.coefficients == pytest.approx(rows(COEFFICIENTS))
    assert problem.per_parameter == pytest.approx(np.log(3 * K / OVERLAP))
    assert problem.offset.tolist() == s.at.offset.tolist()


@pytest.mark.parametrize("names", ["a", "abc"])
def test_an_effect_is_weighed_against_coefficients_as_stated(names):
    """Alone, and where there are others against none of them at all; with even odds of all candidates."""
    s = selection(names)

    def evidence(gone, wider):
        problem, charged = s._linear(gone)
        return LinearProblem(*problem).log_evidence(np.array(wider), charged)

    present = [evidence((), [1.0, 1.0]), evidence((), [2.5, 1.0])]
    absent = {1: [evidence(("a",), [2.5, 1.0])]}
    if len(names) > 1:
        absent[3] = [evidence(tuple(names), [2.5, 1.0])]
    found = s._beside_coefficients(s.accepted[0], 1, 2, 20)
    expected = [probability_beside(present, absent, n / max(7, n)) for n in (1, 2, 20)]
    assert found == pytest.approx(expected)


class Told(Selection):
    """With evidence that is made up."""

    def _evidence(self, p, bagged):
        return Evidence(bagged)

    def _beside_coefficients(self, p, *ids):
        return [{1: 0.5, 2: 0.75}[n] for n in ids]


class Evidence(NamedTuple):
    bagged: float
    listed: float = 1.0


def reported(names="abc"):
    s = selection(names)
    return Told(s.t, s.at, s.accepted, s.ranked, s.lacking, s.stated)


def test_findings_have_their_values_with_intervals_shares_and_evidence():
    s = reported()
    found = s.findings()
    A = rows(names_of(s.at))
    std = np.sqrt(np.diag(np.linalg.inv(A.T @ A + precision_of(s.at))))
    _, shares = s._nested()
    for k, f in enumerate(found.effects):
        name = "abc"[k]
        assert f.id == name.upper()
        assert f.values == {name: s.at.values[name]}
        assert f.ci95[name] == pytest.approx(interval(f.values[name], std[k]), rel=1e-4)
        assert f.share == pytest.approx(shares[k])
        assert f.q2 == pytest.approx(sum(shares[: k + 1]))
        assert f.alike == ["other"]
        assert f.evidence.bagged == pytest.approx(0.9 * 0.5)
        assert f.set_evidence.bagged == pytest.approx(1.0 * 0.75)
    assert found.model is s.at
    assert found.moved == pytest.approx(dict(zip(COEFFICIENTS, s.at.offset, strict=True)))
    assert found.refitted is None
    assert found.estimate is s.at
    assert [x.name for x in found.suspects] == [
        n
        for n, x, sd in zip(COEFFICIENTS, s.at.offset, std[3:], strict=True)
        if abs(x) > conclusion.beyond(2) * sd
    ]


@pytest.mark.parametrize("alone", [False, True])
def test_a_modulated_force_in_the_place_of_an_effect_is_weighed_by_its_evidence(monkeypatch, alone):
    """The true force of a is there under another name: both are as likely; another force is not."""
    forces = [("the same", 3.0 * COLUMN["a"])] + [("another", SIGMA * np.ones((K, 3)))] * (not alone)
    monkeypatch.setattr(conclusion, "may_be_modulated", lambda effect: True)
    monkeypatch.setattr(conclusion, "modulated_forces", lambda data, model: forces)
    (found, *_) = reported().findings().effects
    assert found.evidence.listed == pytest.approx(0.5 if alone else 2.0 / 3.0, abs=1e-3)
    assert found.modulation == "the same"


def test_without_a_modulated_force_an_effect_is_as_sure(monkeypatch):
    monkeypatch.setattr(conclusion, "may_be_modulated", lambda effect: True)
    monkeypatch.setattr(conclusion, "modulated_forces", lambda data, model: [])
    assert {(f.evidence.listed, f.modulation) for f in reported().findings().effects} == {(1.0, "")}


@pytest.mark.parametrize("size", [0.0, 50.0])
def test_an_outage_is_weighed_against_a_held_command_in_its_intervals(monkeypatch, size):
    """By the densities of the model error, in which the held command is one more normal coefficient."""
    outage = SimpleNamespace(kind="actuator", id="", search=SimpleNamespace(intervals=(("s", "e"),)))
    monkeypatch.setattr(Point, "failing", {"A": outage})
    monkeypatch.setattr(conclusion, "may_be_modulated", lambda effect: False)
    force = size * SIGMA * np.random.default_rng(5).standard_normal((K, 3))
    monkeypatch.setattr(conclusion, "held_forces", lambda data, model, effect: [force])
    s = reported()
    (first, *others) = s.findings().effects
    problem, charged = s._linear(())
    column = (WEIGHT * force).ravel()
    H = problem.also_uncertain(column[:, None])
    odds = [p.log_evidence(np.ones(p.offset.size), charged) for p in (problem, H)]
    assert first.evidence.listed == pytest.approx(1.0 / (1.0 + np.exp(odds[1] - odds[0])), rel=1e-6)
    assert first.modulation == "the actuator held at a constant command"
    assert (first.evidence.listed > 0.9) == (size > 0.0), "that is no force, which explains as much"
    assert {f.modulation for f in others} == {""}


def test_findings_of_some_effects_are_fitted_anew():
    s = reported()
    found = s.findings(["A", "C"])
    assert [f.id for f in found.effects] == ["A", "C"]
    expected = best(Point({"a": 0.0, "c": 0.0}, np.zeros(2)))
    assert [f.values[n] for f, n in zip(found.effects, "ac", strict=True)] == pytest.approx(expected[:2])
    assert [f.id for f in found.refit(["C"]).effects] == ["C"]
    nothing = s.findings([])
    assert nothing.effects == []
    assert nothing.model == START
    assert theta_of(nothing.refitted) == pytest.approx(best(Point({}, np.zeros(2))))


def test_exact_coefficients_are_no_suspects(monkeypatch):
    monkeypatch.setattr(PRIOR, "std", {"X_u": 0.0, "N_r": 0.0})
    found = reported().findings()
    assert found.suspects == []
    assert found.moved == {}
