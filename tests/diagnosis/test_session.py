"""The steps of ``learn`` (diagnosis/session.py), with parts that are made up."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import LinAlgError

from cosim import InputError
from diagnosis import Model, session
from diagnosis.search.findings import Findings
from diagnosis.session import Session, well_posed

START = Model()


def run(name, h=1.0):
    smoothed = SimpleNamespace(nu=np.array([[1.0, 2.0, 3.0], [9.0, 9.0, 9.0]]) * h)
    return SimpleNamespace(
        run=SimpleNamespace(name=name),
        smoothed=smoothed,
        known=np.array([True, False]),
        middle=np.zeros(2),
    )


RUNS = {name: run(name, k + 1.0) for k, name in enumerate("abcde")}


def made(parametric=True, prior=0.1, said=None, **changes):
    predictor = SimpleNamespace(model=START, parametric=parametric, in_windows=lambda: "in windows")
    given = {
        "train": [RUNS["a"], RUNS["b"]],
        "validate": [RUNS["c"]],
        "test": [RUNS["d"], RUNS["e"]],
        "predictor": predictor,
        "prior": prior,
        "method": None,
        "harms": "harms",
        "advance": (said if said is not None else []).append,
        "seed": 7,
    }
    return Session(**given | changes)


def test_runs_are_in_order_and_the_data_that_decide_have_no_test_runs():
    s = made()
    assert s.runs == list(RUNS.values())
    data = s.data(np.array([1.0, 2.0, 3.0]))
    assert (data.train, data.validate) == (s.train, s.validate)
    assert data.start is START
    assert data.sigma.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("error", [LinAlgError("singular matrix"), None])
def test_a_system_that_is_singular_is_bad_input(error):
    @well_posed()
    def asked():
        if error:
            raise error
        return "answer"

    if error is None:
        assert asked() == "answer"
    else:
        with pytest.raises(InputError, match="do not determine the requested values: singular matrix"):
            asked()


# Calibration


def calibrator(monkeypatch, windows=(1,), fails=False):
    asked = []

    class Fits:
        def __init__(self, found, train, start, prior):
            asked.append((found, train, start, prior))
            self.windows = windows

        def coefficients(self):
            if fails:
                raise LinAlgError("no")
            return "fit"

    monkeypatch.setattr(session, "Calibrator", Fits)
    return asked


def test_coefficients_are_calibrated_on_the_training_runs_without_an_effect(monkeypatch):
    asked, said = calibrator(monkeypatch), []
    s = made(said=said)
    assert s.calibration == "fit"
    ((found, train, start, prior),) = asked
    assert found.effects == []
    assert found.searched is prior is s.known
    assert (train, start) == (s.train, START)
    assert said == ["calibration of the coefficients"]


@pytest.mark.parametrize(
    ("changes", "of_fits", "asks"),
    [
        ({"parametric": False}, {}, False),
        ({"prior": 0.0}, {}, False),
        ({}, {"windows": ()}, True),
        ({}, {"fails": True}, True),
    ],
)
def test_there_is_no_calibration_without_coefficients_windows_or_a_solution(
    monkeypatch, changes, of_fits, asks
):
    asked = calibrator(monkeypatch, **of_fits)
    s = made(**changes)
    assert s.calibration is None
    assert bool(asked) == asks
    assert s._losses == []
    assert s.calibrate() is None


def fitted(sigma=2.0):
    findings = Findings(model="calibrated", sigma=np.full(3, sigma))
    return SimpleNamespace(findings=findings, posterior="posterior")


def with_fit(s, fit):
    s.__dict__["calibration"] = fit
    return s


def test_the_second_answer_is_the_calibrated_model_with_its_gain(monkeypatch):
    fit, s = fitted(), made(measured=True)
    seen = []
    monkeypatch.setattr(
        session,
        "prediction_gain",
        lambda data, start, found: seen.append((data, start, found)) or "gain",
    )
    monkeypatch.setattr(session, "_compared", lambda *arguments: arguments)
    found = with_fit(s, fit).calibrate()
    ((data, start, findings),) = seen
    assert data.sigma.tolist() == [2.0] * 3
    assert (start, findings) == (START, fit.findings)
    assert (found.gain, found.posterior, found.measured) == ("gain", "posterior", True)
    assert found.comparison[:4] == (s.predictor, s.runs[:3], "calibrated", s.runs[3:])


# Commands as measured values


def likelier(monkeypatch, changed=("a",), worse=()):
    """The session after the question, where the commands of some runs are not stated.

    ``worse`` are the readings that predict worse than measured values: orders, and rows that follow.
    """
    later = {rows: {name: run(name) for name in "abcde"} for rows in (0.5, 1.0)}
    monkeypatch.setattr(
        session,
        "with_measured_commands",
        lambda w, rows: later[rows][w.run.name] if w.run.name in changed else w,
    )
    asked = []

    def measured(others, losses):
        asked.append((others, losses))
        return others[0] in worse

    def losses(s):
        of = {k: [w is later[k][w.run.name] for w in s.runs] for k in later}
        return ["measured" if any(of[0.5]) else "following" if any(of[1.0]) else "orders"]

    monkeypatch.setattr(session, "are_measured", measured)
    monkeypatch.setattr(Session, "_losses", property(losses))
    s = made()
    return s, s.with_likelier_commands(), later[0.5], asked


@pytest.mark.parametrize("changed", ["a", "c", "abcde"])
def test_commands_are_measured_values_if_the_runs_that_decide_are_predicted_better(monkeypatch, changed):
    _, found, others, asked = likelier(monkeypatch, changed, ("orders", "following"))
    assert asked == [(["orders"], ["measured"]), (["following"], ["measured"])]
    assert found.measured
    assert [w is others[w.run.name] for w in found.runs] == [n in changed for n in "abcde"]
    assert [len(part) for part in (found.train, found.validate, found.test)] == [2, 1, 2]
    for worse in ((), ("orders",), ("following",)):
        assert likelier(monkeypatch, changed, worse)[1].measured is False


@pytest.mark.parametrize("changed", ["", "d", "de"])
def test_test_runs_alone_decide_nothing(monkeypatch, changed):
    s, found, _, asked = likelier(monkeypatch, changed)
    assert found is s
    assert asked == []


@pytest.mark.parametrize("missing", [0, 1])
def test_commands_stay_where_there_is_no_calibration(monkeypatch, missing):
    s, *_ = likelier(monkeypatch)
    losses = [["orders"], ["measured"]]
    losses[missing] = []
    monkeypatch.setattr(Session, "_losses", property(lambda s: losses[s.measured]))
    assert s.with_likelier_commands() is s


# Diagnosis


@pytest.mark.parametrize("parametric", [True, False])
def test_a_search_is_judged_by_the_data_that_decide(monkeypatch, parametric):
    found = SimpleNamespace(sigma=np.full(3, 5.0))
    method = SimpleNamespace(fit=lambda *arguments: (seen.append(arguments), found)[1])
    seen, judged = [], []
    monkeypatch.setattr(
        session, "judge", lambda *arguments: judged.append(arguments) or ("verdict", "gain")
    )
    monkeypatch.setattr(
        session, "OperatingRegion", SimpleNamespace(of=lambda nu, scale: (nu.tolist(), scale))
    )
    monkeypatch.setattr(Session, "_concluded", lambda self, *arguments: arguments)
    s = made(parametric=parametric, method=method)
    s = with_fit(s, "calibration") if parametric else s
    verdict, region, gain = s.diagnose()
    assert (verdict, gain) == ("verdict", "gain")
    assert seen == [(s.train, START, 0.1, s.advance, 7)]
    assert region == ([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]], START.ship.scale), "where it is known"
    ((of, data, prior, harms, where, calibrates, calibration, advance),) = judged
    assert (of, prior, harms, where, advance) == (found, s.known, "harms", region, s.advance)
    assert data.sigma.tolist() == [5.0] * 3
    assert (calibrates, calibration) == ((True, "calibration") if parametric else (False, None))


def test_comparisons_are_of_all_runs_with_the_test_runs_held_out(monkeypatch):
    monkeypatch.setattr(session, "_compared", lambda *arguments: arguments)
    s = made()
    assert s.compare()[:4] == (s.predictor, s.runs[:3], None, s.runs[3:])
    one = replace(s, validate=[])
    assert one.compare()[1] == one.train


@pytest.mark.parametrize("held_out", [0, 1, 2])
def test_errors_are_of_runs_held_out_or_not(monkeypatch, held_out):
    monkeypatch.setattr(
        session, "evaluate_runs", lambda runs, predictor, after, held: [*zip(runs, held, strict=True)]
    )
    monkeypatch.setattr(session, "in_halves", lambda of_some, which, known, share: of_some([*which]))
    monkeypatch.setattr(session, "omega_std", lambda w, model: (w.run.name, model))
    monkeypatch.setattr(session, "Comparison", lambda *arguments: arguments)
    said, s = [], made()
    runs = s.runs
    first, last = runs[: 5 - held_out], runs[5 - held_out :]
    evaluations, std, predictor = session._compared(s.predictor, first, None, last, said.append)
    assert evaluations == [(w, k >= 5 - held_out) for k, w in enumerate(runs)]
    assert std == [(w.run.name, START) for w in runs]
    assert predictor is s.predictor
    assert said == ["predicting a, b, c, d, e"]
