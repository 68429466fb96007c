"""When other coefficients take the place of effects (diagnosis/verdict/coefficients.py): each condition alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from diagnosis import Model
from diagnosis.runs.run_constants import CHANCE
from diagnosis.search.findings import Finding, Findings
from diagnosis.search.gram import WHOLE_RUNS
from diagnosis.verdict import coefficients
from diagnosis.verdict.coefficients import (
    Calibrations,
    _differs,
    any_sure,
)

START = Model()
WATER = START.ship.effects["current"].coefficients


def effect(name="X_u", confidence=0.5, interval=(-1.0, 1.0)):
    return Finding(name, {"delta": 0.3}, {"delta": interval}, confidence, [], 0.5, 0.5)


@pytest.mark.parametrize(
    ("confidences", "sure"),
    [([], False), ([0.79], False), ([0.8], True), ([0.1, 0.9], True), ([np.nan], True)],
)
def test_any_effect_is_sure_with_the_confidence_of_a_finding_or_with_none(confidences, sure):
    assert any_sure(Findings([effect(confidence=c) for c in confidences])) == sure


# Losses by name: the smaller, the better; a model is worse by more than chance if it is by one or more


def worse(its, other):
    return "worse" if its >= other + 1.0 else ""


@pytest.fixture
def by_numbers(monkeypatch):
    monkeypatch.setattr(coefficients, "harm", worse)
    monkeypatch.setattr(coefficients, "predicts_worse", lambda its, other: bool(worse(its, other)))
    monkeypatch.setattr(coefficients, "gain", lambda its, other: its - other)
    monkeypatch.setattr(coefficients, "as_good", lambda its, other: its <= other)


def outcome(name, V=(0.0, 0.0), std=1.0):
    names = ["vessel.X_u", *(f"vessel.{n}" for n in WATER)]
    posterior = SimpleNamespace(
        names=names, mean=np.array([99.0, *V]), covariance=np.diag([1.0, std**2, std**2])
    )
    return SimpleNamespace(findings=Findings(moved={name: 0.0}), posterior=posterior)


@pytest.mark.parametrize("std", [1.0, 0.1])
@pytest.mark.parametrize(("size", "flows"), [(0.99, False), (1.01, True)])
@pytest.mark.parametrize("course", [0.3, 2.0])
def test_a_current_flows_beyond_the_quantile_of_its_uncertainty(std, size, flows, course):
    """V^T C^-1 V is chi-square with two degrees of freedom."""
    V = size * std * np.sqrt(chi2.isf(CHANCE, 2)) * np.array([np.cos(course), np.sin(course)])
    assert _differs(outcome("", V, std), WATER) == flows


def test_what_a_fit_does_not_have_does_not_differ():
    still = outcome("", (9.0, 9.0))
    still.posterior.names = ["vessel.X_u", "vessel.X_uuu", "vessel.N_r"]
    assert not _differs(still, WATER)
    assert _differs(still, ["X_uuu"])


CASE = {
    "runs": WHOLE_RUNS,
    "std": 0.1,
    "missing": True,
    "windows": [1],
    "effects": [],
    "first": 10.0,
    "found": 10.0,
    "still": 5.0,
    "imperfect": 5.0,
    "flowing": 5.0,
    "late": False,
    "left": True,
    "better": False,
    "plain": None,
    "V": (0.0, 0.0),
    "validate": [],
    "its": 5.0,
    "others": 10.0,
}


@pytest.mark.parametrize(
    ("changes", "taken"),
    [
        ({}, "still"),
        ({"runs": WHOLE_RUNS - 1}, None),
        ({"std": 0.0}, None),
        ({"missing": False}, None),
        ({"windows": []}, None),
        ({"still": 9.5}, "still"),
        ({"still": 10.0}, None),  # no better than the first
        ({"still": 11.5}, None),
        ({"effects": [effect()], "found": 5.0}, "still"),  # it is as good as the effects
        ({"effects": [effect()], "found": 4.9}, None),
        ({"effects": [effect()], "found": 4.9, "better": True}, "still"),  # of the predictions alone
        ({"effects": [effect()], "found": 4.9, "first": 3.5, "better": True}, None),
        ({"still": 10.0, "better": True}, None),
        ({"effects": [effect()], "first": 3.5}, None),  # worse than the first
        ({"flowing": 3.0, "V": (9.0, 9.0)}, "flowing"),
        ({"flowing": 3.0}, "still"),  # a current that may be none
        ({"flowing": 4.5, "V": (9.0, 9.0)}, "still"),
        ({"still": 11.5, "flowing": 3.0, "V": (9.0, 9.0)}, "flowing"),
        ({"effects": [effect()], "found": 3.0, "flowing": 3.0, "V": (9.0, 9.0)}, "flowing"),
        ({"imperfect": 4.0, "late": True}, "imperfect"),
        ({"imperfect": 4.0}, "still"),  # imperfections that may be none
        ({"imperfect": 4.5, "late": True}, "still"),
        ({"imperfect": 1.0, "flowing": 3.0, "late": True, "V": (9.0, 9.0)}, "imperfect"),
        ({"imperfect": 2.5, "flowing": 3.0, "late": True, "V": (9.0, 9.0)}, "flowing"),
        ({"imperfect": 3.0, "late": True, "left": False}, "still"),  # coefficients leave nothing
        ({"flowing": 3.0, "V": (9.0, 9.0), "left": False}, "still"),
        ({"plain": 5.0}, "plain"),  # as good, of fewer coefficients
        ({"plain": 4.0}, "plain"),
        ({"plain": 5.1}, "still"),
        ({"plain": 3.0, "flowing": 3.0, "V": (9.0, 9.0)}, "plain"),
        ({"plain": 4.0, "flowing": 3.0, "V": (9.0, 9.0)}, "flowing"),
        ({"still": 11.5, "plain": 5.0}, "plain"),
        ({"still": 11.5, "plain": 11.4}, None),
        ({"plain": 5.0, "validate": [1], "its": 11.5}, None),
        ({"validate": [1], "its": 10.5}, "still"),
        ({"validate": [1], "its": 11.5}, None),
        ({"its": 11.5}, "still"),
    ],
)
def test_a_calibration_is_taken_where_it_predicts_better(changes, taken, by_numbers, monkeypatch):
    case = CASE | changes
    found = Findings(case["effects"])
    still, flowing = outcome("still"), outcome("flowing", case["V"])
    still.findings = replace(still.findings, model=Model())
    imperfect = outcome("imperfect")
    imperfect.posterior.mean[0] *= case["late"]
    fits = {"X_u": imperfect, **dict.fromkeys(WATER, flowing)}
    began = []

    def plus(fit, std):
        began.append(fit)
        return fits[next(iter(std))]

    plain = outcome("plain") if case["plain"] else None
    losses = {
        id(found): "found",
        id(START): "first",
        id(still.findings): "still",
        id(flowing.findings): "flowing",
        id(imperfect.findings): "imperfect",
        id(plain and plain.findings): "plain",
    }

    class Runs:
        def __init__(self, train, validate, start, sigma):
            assert list(validate) == []
            assert start is START

        def losses(self, *models):
            return [case[losses[id(m)]] for m in models]

    calibrator = SimpleNamespace(
        windows=case["windows"],
        still=lambda: still,
        plus=plus,
        imperfections={"X_u": 0.2},
        current=dict.fromkeys(WATER, 0.05),
    )
    monkeypatch.setattr(coefficients, "predicts_better", lambda its, other: case["better"])
    monkeypatch.setattr(coefficients, "ValidationData", Runs)
    monkeypatch.setattr(coefficients, "Calibrator", lambda *_: calibrator)
    monkeypatch.setattr(
        coefficients,
        "remains",
        lambda runs, start, model: case["missing"] if model is START else case["left"],
    )
    data = SimpleNamespace(
        train=[None] * case["runs"],
        validate=case["validate"],
        start=START,
        losses=lambda model, start: [case["its"], case["others"]],
    )
    prior = SimpleNamespace(std={"X_u": case["std"]})
    chosen = Calibrations(found, data, prior, plain).in_place_of(found)
    known = {"still": still, "imperfect": imperfect, "flowing": flowing, "plain": plain, None: None}
    assert chosen is known[taken]
    if began:  # imperfections are added to a current that was taken
        flows = any(case["V"]) and case["flowing"] <= case["still"] - 1.0
        assert began == [still, flowing if flows else still]
