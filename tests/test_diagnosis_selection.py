"""From a measured run to the model error and to the effect that is missing."""

import numpy as np
import pytest
from measured import sail

from diagnosis import clean, smooth
from diagnosis.contest import SEPARATION, candidates, novelty
from diagnosis.model import Model
from diagnosis.refining import Point, Problem
from diagnosis.selection import learn
from diagnosis.weak import integrals, kernel, kernel_integral, kernel_rate, omega
from fmus.effects import EFFECTS


def data(seconds=96.0, **hidden):
    """Windows of a run of the ship with something hidden in it, and the true velocity."""
    run, nu = sail(seconds, **hidden)
    return integrals(smooth(clean(run))), nu


def rms(x):
    return np.sqrt(np.mean(np.square(x), axis=0))


def test_kernel_has_unit_area_and_its_own_derivatives():
    s = np.linspace(-1.0, 1.0, 20001)
    assert np.trapezoid(kernel(s), s) == pytest.approx(1.0, abs=1e-9)
    assert np.gradient(kernel_integral(s), s) == pytest.approx(kernel(s), abs=1e-4)
    assert np.gradient(kernel(s), s)[1:-1] == pytest.approx(kernel_rate(s)[1:-1], abs=1e-4)
    assert kernel_integral(1.0) - kernel_integral(-1.0) == pytest.approx(1.0)


HIDDEN = [
    {"ship": {"delta_X_u": -3.0}},
    {"ship": {"mass": 3.0}},
    {"ship": {"added_mass_Y": 5.0}},
    {"ship": {"V_n": 0.05, "V_e": -0.03}},
    {"ship": {"F_n": 0.1, "F_e": 0.1}},
    {"ship": {"heading_offset": 0.1}},
    {"ship": {"marker_offset_dx": 0.1, "marker_offset_dy": -0.05}},
    {"thrusters": {"loss_yaw": 0.3}},
    {"thrusters": {"bow_failure_time": 40.0}},
    {"thrusters": {"delay": 0.3}},
    {"thrusters": {"lag": 0.4}},
    {"thrusters": {"deadband": 0.05}},
]


@pytest.mark.parametrize("hidden", HIDDEN, ids=lambda h: "-".join(n for g in h.values() for n in g))
def test_model_error_vanishes_for_the_true_model_and_only_for_it(hidden):
    w, _ = data(**hidden)
    changes = {name: x for group in hidden.values() for name, x in group.items()}
    wrong, right = rms(omega(w, Model())), rms(omega(w, Model().plus(changes)))
    assert (right < [0.008, 0.012, 0.003]).all()
    assert (wrong / [0.008, 0.012, 0.003]).max() > 2.0


def test_model_error_is_the_force_that_was_hidden():
    """Two ways to the same: the weak form of the pose, and the force by the true velocity."""
    w, nu = data(ship={"delta_X_u": -3.0})
    force = np.column_stack(np.broadcast_arrays(-3.0 * nu[:, 0], 0.0, 0.0))
    assert rms(omega(w, Model()) - w.smooth @ force).max() < 0.01


@pytest.mark.parametrize(
    ("hidden", "effect"),
    [
        ({"ship": {"delta_X_u": -3.0}}, "X_u"),
        ({"ship": {"delta_N_r": 1.0}}, "N_r"),
        ({"thrusters": {"bow_failure_time": 40.0}}, "bow_failure"),
        ({"thrusters": {"loss_yaw": 0.3}}, "loss_yaw"),
    ],
)
def test_the_hidden_effect_is_found_first(hidden, effect):
    w, _ = data(**hidden)
    learned = learn([w], prior=0.0)
    first = learned.findings[0]
    assert first.id == effect or effect in first.alike
    assert learned.ranking[0].id == first.id
    assert rms(omega(w, learned.model)).max() < 0.3 * rms(omega(w, Model())).max()


def test_interval_covers_the_truth():
    w, _ = data(ship={"delta_X_u": -3.0})
    (finding, *_) = learn([w], prior=0.0).findings
    low, high = finding.ci95["delta_X_u"]
    assert finding.id == "X_u"
    assert low < -3.0 < high
    assert high - low < 0.2
    assert finding.confidence > 0.9


@pytest.mark.parametrize("prior", [0.0, 0.1])
def test_nothing_is_found_where_nothing_is_missing(prior):
    w, _ = data()
    learned = learn([w], prior)
    assert list(learned.findings) == []
    assert {r.id for r in learned.ranking} <= set(EFFECTS)


def test_coefficients_within_the_prior_are_no_finding():
    off = {"X_u": -0.6, "Y_v": -1.45, "N_r": -2.0, "Y_r": -6.9}
    w, _ = data(ship=off)
    assert list(learn([w], prior=0.1).findings) == []


def test_what_a_curve_has_in_it_is_no_candidate_beside_it():
    """A loss of surge force is a straight curve; what needs the yaw moment or the speed is not."""
    w, _ = data()
    effect = EFFECTS["curve_vsp_x(c)"]
    names = [p.name for p in effect.parameters if p.name in effect.coefficients]
    curve = dict(zip(names, 0.1 * np.linspace(-1.0, 1.0, len(names)) ** 3, strict=True))
    at = Point(Model(), curve, stiff=np.zeros((len(names), len(names))))
    step = candidates(Problem([w], w.block, None, 0.1), at, {effect.id})
    new = {
        c.effect.id: novelty(step.wide, k, len(names)) >= SEPARATION
        for k, c in enumerate(step.candidates)
    }
    assert not new["loss_surge"]
    assert new["loss_yaw"]
    assert new["X_u"]
    assert new["curve_vsp_y(c)"]
    assert {step.candidates[j.candidate].effect.id for j in step.order} == {e for e in new if new[e]}
    assert all(novelty(step.wide, k, 0) == 1.0 for k in range(len(new))), "beside nothing all is new"
