"""Where a calibration begins, and how large the disturbance is that windows left out of the fit show."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import Model
from diagnosis.predictors.parameter_set import ship_with
from diagnosis.predictors.shooting import UNKNOWN
from diagnosis.search.findings import Findings
from diagnosis.search.prediction_fit import coefficient_calibration
from diagnosis.search.prediction_fit.coefficient_calibration import (
    LEAST,
    LEFT_OUT,
    STREAM,
    Calibrator,
    as_missed,
    begin,
)
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel

W, T = 200, 3
NAMES = ["X_u", "N_r", "known"]


@dataclass(frozen=True)
class Disturbance:
    size: np.ndarray


def problem(monkeypatch, scale, noise=0.01, pushed=0.04, seed=0, lengths=1):
    """Windows in two folds, whose residuals are ``scale`` times what noise and disturbance give."""
    rng = np.random.default_rng(seed)
    shots, abouts = [], {}
    for _ in range(lengths):
        s = SimpleNamespace(measured=np.zeros((W, T, 3)), noise=np.full((W, T, 3), 0.5 * noise))
        slopes = rng.standard_normal((W, T, 3, 2))
        spread = np.sqrt(noise + pushed)
        white = scale * spread * rng.standard_normal((W, T, 3))
        fold = np.arange(W) % 2
        step = np.array([[0.3, -0.2], [-0.1, 0.4]])
        residuals = white + np.einsum("wtid,wd->wti", slopes, step[fold])
        still = np.broadcast_to(0.5 * noise * np.eye(3), (W, T, 3, 3))
        move = np.broadcast_to(pushed * np.eye(3), (W, T, 3, 3))
        abouts[id(s)] = SimpleNamespace(residuals=residuals, slopes=slopes, still=still, pushed=move)
        shots.append(s)
    model = SimpleNamespace(value=lambda n: {"X_u": 1.0, "N_r": 2.0, "known": 5.0}[n])
    others = [
        SimpleNamespace(
            value=lambda n, k=k: {"X_u": 1.0 + step[k][0], "N_r": 2.0 + step[k][1], "known": 9.0}[n]
        )
        for k in range(2)
    ]
    monkeypatch.setattr(
        coefficient_calibration, "WindowSpread", SimpleNamespace(of=lambda s, *_: abouts[id(s)])
    )
    made = SimpleNamespace(windows=shots, fold_of_window=[fold] * lengths)
    fitted = SimpleNamespace(disturbance=Disturbance(np.array([1.0, 2.0, 3.0])), fold_models=others)
    posterior = SimpleNamespace(std={"X_u": 0.1, "N_r": 0.1, "known": 0.0})
    return made, fitted, model, posterior


@pytest.mark.parametrize("scale", [0.7, 1.0, 3.0])
@pytest.mark.parametrize("lengths", [1, 2])
def test_the_disturbance_is_as_large_as_windows_left_out_are_missed(monkeypatch, scale, lengths):
    """Each is predicted by the model fitted without its fold: noise and f times the disturbance give its square."""
    found = as_missed(*problem(monkeypatch, scale, lengths=lengths))
    factor = (scale**2 * 0.05 - 0.01) / 0.04
    assert found.size == pytest.approx(np.sqrt(factor) * np.array([1.0, 2.0, 3.0]), rel=0.06)


@pytest.mark.parametrize(("scale", "factor"), [(0.01, LEAST), (1e5, 1.0 / LEAST)])
def test_the_factor_of_the_disturbance_has_ends(monkeypatch, scale, factor):
    found = as_missed(*problem(monkeypatch, scale))
    assert found.size == pytest.approx(np.sqrt(factor) * np.array([1.0, 2.0, 3.0]))


def test_instants_that_are_not_seen_or_not_predicted_do_not_count(monkeypatch):
    """Their residuals would be anything."""
    made, *rest = problem(monkeypatch, 1.0)
    expected = as_missed(made, *rest)
    (s,) = made.windows
    s.noise[3, 1, 2] = 2.0 * UNKNOWN
    about = coefficient_calibration.WindowSpread.of(s)
    about.residuals[3, 1] = 1e6
    about.residuals[7, 2, 0] = np.nan
    found = as_missed(made, *rest)
    assert found.size == pytest.approx(expected.size, rel=0.01)
    about.residuals[3, 0] = 1e3
    assert (as_missed(made, *rest).size > 10.0 * expected.size).all()


def test_a_calibration_begins_with_the_terms_that_models_leave_out():
    """Each zero, with its deviation in units of the ship's size as prior."""
    start = Model()
    prior = NominalPrior.of(start, 0.1)
    at = begin(start, prior)
    assert at.start is start
    assert (at.offset == 0.0).all()
    effects = start.ship.effects
    own = {f"delta_{n}" for n in prior.mean}
    names = [n for i in LEFT_OUT for n in effects[i].coefficients if n not in own]
    assert "delta_X_absu_u" in own
    assert {"delta_N_v", "delta_X_uu", "delta_N_uv"} <= {*names}
    assert [*at.values] == [*names, "heading_offset"]
    assert not any(at.values.values())
    sizes = [
        size * start.unit(n)
        for i, size in LEFT_OUT.items()
        for n in effects[i].coefficients
        if n in names
    ]
    assert np.diag(at.precision) == pytest.approx(
        [*(s**-2.0 for s in sizes), effects["heading_offset"].usual ** -2.0]
    )
    assert np.count_nonzero(at.precision) == len(at.values)


def test_a_current_begins_where_still_water_ended():
    start = Model()
    prior = NominalPrior.of(start, 0.1)
    still = begin(start, prior)
    ended = replace(
        still, offset=still.offset + 0.3, values={n: 0.1 * k for k, n in enumerate(still.values)}
    )
    calibrator = Begins(Findings(), [], start, prior)
    at = calibrator.plus(SimpleNamespace(findings=Findings(estimate=ended)), calibrator.current)
    assert isinstance(at, RefinedModel)
    assert at.fitted == [*at.values]
    assert at.offset.tolist() == ended.offset.tolist()
    water = start.ship.effects["current"].coefficients
    assert {n: at.values[n] for n in ended.values} == ended.values
    assert {n: at.values[n] for n in water} == dict.fromkeys(water, 0.0)
    at_water = [[*at.values].index(n) for n in water]
    units = [STREAM * start.unit(n) for n in water]
    assert np.diag(at.precision)[at_water] == pytest.approx(np.array(units) ** -2.0)
    assert np.diag(at.precision)[: len(ended.values)].tolist() == np.diag(ended.precision).tolist()


class Begins(Calibrator):
    """Gives where each fit begins."""

    def _fitted(self, at):
        return at


def test_imperfections_are_those_of_actuators_and_instruments_each_with_its_usual_size():
    cse1 = Begins(Findings(), [], Model(), NominalPrior.of(Model(), 0.1)).imperfections
    assert {*cse1} == {
        "deadband",
        "cross_vsp_sway",
        "cross_vsp_surge",
        "position_latency",
        "heading_latency",
        "loss_surge",
        "loss_sway",
        "loss_yaw",
    }
    otter = Model(ship=ship_with((), "otter"))
    boat = Begins(Findings(), [], otter, NominalPrior.of(otter, 0.1)).imperfections
    assert {"deadband_port", "deadband_starboard", "angle_port", "heading_latency"} <= {*boat}
    assert not {"heading_offset", "V_n"} & {*boat}
    full = max(t["deadband_port"] for t in otter.ship.effects["deadband_port"].search.values({}))
    assert 0.1 * full < boat["deadband_port"] < full
    assert boat["heading_latency"] == cse1["heading_latency"], "no time of the ship's size"
