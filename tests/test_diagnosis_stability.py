"""The check of a learned model: mass, dissipation, and the closed loop on the reference paths."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.optimize import brentq
from support.cases import slow

from cosim import InputError
from diagnosis.assessment import stability
from diagnosis.assessment.closed_loop import (
    REFERENCES,
    closed_loop,
    distances,
    largest_distance,
)
from diagnosis.assessment.settings import SETTINGS
from diagnosis.assessment.stability import (
    OPERATING,
    OperatingRegion,
    check_stability,
    dissipation,
    force,
    is_definite,
    mass,
    sampled_motions,
)
from diagnosis.predictors import Model, ship_with
from diagnosis.predictors.uncertainty import MEASURED
from diagnosis.predictors.weak_form import acceleration
from diagnosis.runs.cleaning import BRIEF
from fmus.declare import variables
from fmus.hull import Damping

NOMINAL = Model()
LINEAR = {"X_u", "Y_v", "Y_r", "N_v", "N_r"}
NONLINEAR_OFF = {v.name: 0.0 for v in variables(Damping) if v.name not in LINEAR}


def smallest(model, region=OPERATING):
    return dissipation(model, sampled_motions(region), mass(NOMINAL)).min()


coefficient = st.floats(-10.0, 10.0)


@settings(max_examples=30)
@given(st.fixed_dictionaries({f"delta_{name}": coefficient for name in sorted(LINEAR)}))
@example({"delta_N_r": -NOMINAL.value("N_r"), "delta_N_v": -NOMINAL.value("N_v")})
def test_for_linear_damping_it_is_the_smallest_eigenvalue(changes):
    model = Model({**NONLINEAR_OFF, **changes})
    D = -force(model, np.eye(3)).T
    exact = eigh(0.5 * (D + D.T), mass(NOMINAL), eigvals_only=True)
    found = smallest(model)
    # Directions are 0.1 of the region apart: from above, and off by less than that squared.
    assert exact[0] - 1e-9 <= found <= exact[0] + 0.01 * (exact[-1] - exact[0]) + 1e-9


@given(st.floats(-0.3, 0.3), st.floats(-0.15, 0.15), st.floats(-0.4, 0.4), coefficient, coefficient)
def test_it_is_the_rate_at_which_the_ship_loses_its_energy(u, v, r, cubic, mixed):
    nu = np.array([[u, v, r]]) + 0.01
    assume(np.abs(nu).max() > 1e-9)  # a ship at rest has no energy to lose
    model = Model({"delta_X_uuu": cubic, "delta_N_uv": mixed, "curve_X_u_7": 0.1})
    calm = SimpleNamespace(time=np.zeros(1), air=None)
    nu_dot = acceleration(model, calm, np.zeros((1, 3)), nu)  # Coriolis forces included
    rest = acceleration(model, calm, np.zeros((1, 3)), np.zeros((1, 3)))
    power = (nu @ mass(model) @ (nu_dot - rest).T)[0, 0]
    energy = 0.5 * (nu @ mass(model) @ nu.T)[0, 0]
    expected = -2.0 * dissipation(model, nu, mass(model))[0] * energy
    assert power == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_it_falls_with_every_newton_that_pushes_the_ship_on():
    found = [smallest(Model({"delta_X_u": delta})) for delta in np.linspace(-6.0, 6.0, 13)]
    assert all(b <= a for a, b in pairwise(found))
    assert found[-1] < found[0]
    assert smallest(NOMINAL, OperatingRegion(1.0, 0.5, 1.0)) <= smallest(NOMINAL) + 1e-3


@pytest.mark.parametrize(
    "outside",
    [
        {"F_n": 3.0, "F_e": -1.0},
        {"body_bias_X": 0.5},
        {"wave_force": 1.0, "wave_drift": 0.2},
        {"V_n": 0.3},
        {"mass": 5.0},
        {"heading_offset": 0.3},
    ],
)
def test_what_does_not_depend_on_the_velocity_is_exempt(outside):
    nu = sampled_motions(OPERATING)
    assert np.allclose(force(Model(outside), nu), force(NOMINAL, nu), rtol=0.0, atol=1e-12)


def test_the_damping_of_a_described_ship_and_its_changes_count():
    """More resistance, as an effect or as the coefficient, is the same force; scaled is all of its own damping."""
    nominal = Model(ship=ship_with((), "kvlcc2"))
    nu = np.array([[1.0, 0.1, 0.02], [0.8, -0.2, -0.03]])
    before = force(nominal, nu)
    changed, other = (nominal.plus({name: 0.01}) for name in ("delta_R_0_prime", "R_0_prime"))
    np.testing.assert_allclose(force(changed, nu), force(other, nu), rtol=1e-9)
    assert (force(changed, nu)[:, 0] < before[:, 0]).all()
    np.testing.assert_allclose(force(nominal.plus({"scale_damping": 0.5}), nu), 1.5 * before, rtol=1e-9)


@pytest.mark.parametrize("before", [2.0, -2.0])
def test_less_is_less_by_more_than_a_share_of_what_was_before(before):
    share = 2.0 * MEASURED**2
    found = stability._less(before + share * np.array([1.1, -0.9, -1.1]), before)
    assert found.tolist() == [False, False, True]


def test_a_hull_drives_on_where_it_adds_energy_and_the_other_adds_less():
    def is_driven(changed, other):
        return stability.driven_on(Model({"delta_X_u": changed}), Model({"delta_X_u": other}), OPERATING)

    assert is_driven(3.0, 0.0)
    assert is_driven(3.0, 2.0)
    assert not is_driven(3.0, 3.0)
    assert not is_driven(3.0, 3.1)
    assert not is_driven(0.3, 0.0), "less damping is damping"


@pytest.mark.parametrize(("grows_by", "driven"), [(0.04, False), (0.06, True)])
def test_a_hull_that_gains_next_to_no_energy_within_the_time_of_a_prediction_drives_nothing_on(
    grows_by, driven
):
    """Surge by u' = -(X_u + d) u / m alone, at the lowest speed that is sampled."""
    motions = stability.alone(0, OPERATING)

    def growth(change):
        model = Model({"delta_X_u": change})
        return -stability.dissipation(model, motions, stability.mass(NOMINAL)).min() * 60.0

    change = brentq(lambda change: growth(change) - grows_by, 0.0, 5.0)
    assert stability.driven_on(Model({"delta_X_u": change}), NOMINAL, OPERATING) == ("surge",) * driven


@pytest.mark.parametrize("whole", [False, slow(True)])
def test_the_nominal_model_is_as_good_as_itself(whole, monkeypatch):
    if whole:
        monkeypatch.setattr(stability, "REFERENCES", REFERENCES)
    found = check_stability(NOMINAL, NOMINAL)
    assert found.nominal_min_dissipation == found.learned_min_dissipation < 0.0
    assert (found.mass_definite, found.bounded, found.safe, found.region) == (True, True, True, None)
    references = stability.REFERENCES
    assert all(largest_distance(r, NOMINAL) < 0.1 * SETTINGS.bound for r in references)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"delta_X_u": 5.0}, ("surge", "gains energy")),
        ({"delta_N_r": 1.0}, ("yaw", "damped less")),
        ({"delta_N_v": -10.0}, ("motions like u = 0 m/s",)),
        (
            {"curve_X_u_1": 1.0, "curve_X_u_21": -1.0, "curve_X_u_15": 1.0},
            ("surge from", "gains energy"),
        ),
    ],
)
def test_less_dissipation_names_the_region(changes, words):
    found = check_stability(Model(changes), NOMINAL)
    assert found.region is not None
    assert all(word in found.region for word in words)
    gains = "gains energy" in words
    assert found.driven_on == ("surge",) * gains


@pytest.mark.parametrize(
    "model",
    [
        Model({"delta_X_u": -4.0, "delta_N_r": -1.0}),
        Model({"mass": 5.0, "F_n": 0.3}),
        Model({}, {"bow_speed_loss": 3.0, "loss_vsp": 0.2}, {"clock_offset": 0.2}),
    ],
)
def test_more_damping_or_none_of_its_kind_warns_of_nothing(model):
    found = check_stability(model, NOMINAL)
    assert found.region is None
    assert found.learned_min_dissipation >= found.nominal_min_dissipation
    assert found.safe


def test_an_indefinite_mass_matrix_is_told():
    for changes in ({"added_mass_X": -20.0}, {"Y_vdot": 20.0}, {"N_vdot": -12.0, "Y_rdot": -12.0}):
        found = check_stability(Model(changes), NOMINAL)
        assert not found.mass_definite
        assert not found.bounded
        assert "mass matrix" in found.notes[0]
    assert is_definite(mass(NOMINAL))
    assert not is_definite(mass(Model({"m": 0.0, "X_udot": 1.0})))


@pytest.mark.parametrize(("astern", "safe"), [(0.06, True), (2.0, False)])
def test_a_ship_is_judged_astern_as_far_as_it_goes_there(astern, safe):
    """Y_uv damps the drift of a ship that goes ahead, and drives on that of one that goes astern."""
    start = Model(ship=ship_with((), "otter"))
    u = np.linspace(-astern, 2.0, 2001)
    nu = np.column_stack([u, 0.5 * np.sin(u), 0.5 * np.cos(u)])
    region = OperatingRegion.of(nu, start.ship.scale)
    assert check_stability(start.plus({"delta_Y_uv": -400.0}), start, region=region).safe == safe


def test_what_cannot_be_checked_is_one_message():
    with pytest.raises(InputError, match="nominal model is not positive definite"):
        check_stability(NOMINAL, Model({"X_udot": 20.0}))
    with pytest.raises(InputError, match="is singular"):
        check_stability(Model({"X_udot": 14.79}), NOMINAL)
    with pytest.raises(InputError, match="region"):
        check_stability(NOMINAL, NOMINAL, region=OperatingRegion(0.0))


def test_a_force_too_strong_for_the_thrusters_is_told_apart():
    found = check_stability(Model({"F_n": 30.0}), NOMINAL)
    assert not found.bounded
    assert found.safe
    assert stability.NOT_BY_HULL in found.notes
    found = check_stability(Model({"F_n": 30.0}), Model({"body_bias_X": 30.0}))
    assert not found.bounded
    assert found.safe, "the hull is held, though the initial model is lost by a force as well"


def test_a_model_that_was_unsound_before_it_learned_is_no_reason_to_withhold_it():
    found = check_stability(Model({"X_u": 40.0}), Model({"X_u": 40.0}))
    assert not found.bounded
    assert found.safe
    assert not check_stability(Model({"X_u": 41.0}), Model({"X_u": 40.0})).safe  # is gains energy more
    assert {stability.NOT_HELD, stability.NOR_NOMINAL} <= {*found.notes}


@pytest.mark.parametrize("lost", [True, False])
@pytest.mark.parametrize(("drag", "rests"), [(0.1, True), (40.0, False)])
def test_paths_on_which_the_initial_model_is_lost_as_well_tell_nothing(lost, drag, rests, monkeypatch):
    learned = Model({"X_u": NOMINAL.value("X_u") + drag})
    far = {id(learned): True, id(NOMINAL): lost}
    monkeypatch.setattr(stability, "largest_distance", lambda _, model: 1e9 * far.get(id(model), True))
    found = check_stability(learned, NOMINAL)
    assert found.closed_loop != lost
    assert found.bounded == found.safe == (lost and rests)
    assert (stability.NOT_HELD in found.notes) == lost


def test_the_thrusters_count_in_the_loop():
    ellipse, _ = REFERENCES
    assert largest_distance(ellipse, Model({}, {"bow_failure_time": 20.0})) > 1.0
    assert (
        largest_distance(ellipse, Model({}, {"loss_surge": 1.0, "loss_sway": 1.0, "loss_yaw": 1.0}))
        > 1.0
    )
    short = ellipse._replace(seconds=60.0)
    assert largest_distance(short, Model(measurement={"clock_offset": 0.5})) != largest_distance(
        short, NOMINAL
    )


@pytest.mark.parametrize(
    "model",
    [
        NOMINAL,
        Model({"V_n": 0.01, "wave_force": 0.1, "curve_X_u_11": 0.1}, {}, {"clock_offset": 0.2}),
        Model({"heading_offset": 0.1}, {"lag": 0.1, "delay": 0.1, "bow_failure_time": 2.0}),
    ],
)
def test_recorded_loop_gives_the_same_bits(model):
    reference = REFERENCES[1]._replace(seconds=6.0)
    now, step = closed_loop(reference, model)
    h, expected = 0.0, []
    for _ in range(round(reference.seconds / BRIEF)):
        now, distance = step(now, h)
        expected.append(distance)
        h = BRIEF
    assert list(distances(reference, model)) == expected
    assert max(expected) > 0.01


def test_a_region_of_data_holds_nearly_all_of_them():
    nu = np.random.default_rng(1).normal(0.0, [0.1, 0.05, 0.0], (10_000, 3))
    nu[::7] = np.nan
    region = OperatingRegion.of(nu)
    inside = (np.abs(nu[~np.isnan(nu[:, 0])]) <= region.edges[1]).mean(axis=0)
    assert inside[:2] == pytest.approx(0.99, abs=1e-3)
    assert region.r == pytest.approx(0.06)
    assert OperatingRegion.of(np.full((3, 3), np.nan)) == pytest.approx(0.1 * np.array(OPERATING))


@pytest.mark.parametrize(
    ("name", "note"),
    [("otter", stability.NO_THRUST), ("gunnerus", stability.NO_ALLOCATION), ("cybership2", None)],
)
def test_the_reason_why_no_controller_holds_a_ship_is_its_own(name, note, monkeypatch):
    """Two azimuths give forces on every axis, of which none is requested."""
    start = Model(ship=ship_with((), name))
    monkeypatch.setattr(stability, "_on_paths", lambda *_: (True, False, False))
    monkeypatch.setattr(stability, "comes_to_rest", lambda *_: True)
    reasons = {stability.NO_THRUST, stability.NO_ALLOCATION} & set(check_stability(start, start).notes)
    assert reasons == ({note} if note else set())


@pytest.mark.parametrize("harmful", [False, True])
@pytest.mark.parametrize("nominal_rests", [False, True])
@pytest.mark.parametrize("learned_rests", [False, True])
def test_a_ship_without_thrust_on_an_axis_is_judged_by_both_motions(
    learned_rests, nominal_rests, harmful, monkeypatch
):
    """What the initial model does as well is from the start, unless the learned hull dissipates less."""
    start = Model(ship=ship_with((), "kvlcc2"))
    assert not start.ship.fully_actuated
    learned = start.plus({"delta_X_u": 0.4 * abs(start.value("X_u")) if harmful else 0.0})
    rests = {id(learned): learned_rests, id(start): nominal_rests}
    monkeypatch.setattr(stability, "comes_to_rest", lambda model, *_: rests[id(model)])
    monkeypatch.setattr(
        stability,
        "dissipation",
        lambda model, nu, M: np.full(len(nu), 0.5 if model is learned and harmful else 1.0),
    )
    monkeypatch.setattr(stability, "_compare", lambda *_: None)
    found = check_stability(learned, start)
    assert found.bounded == learned_rests
    neither = not learned_rests and not nominal_rests
    assert (stability.NOR_NOMINAL in found.notes) == neither
    assert found.from_start == (neither and not harmful)
    assert (found.region is not None) == harmful
    assert found.safe == (learned_rests or found.from_start)
    assert not found.closed_loop


@pytest.mark.parametrize("ahead", [True, False])
def test_a_hull_that_runs_away_astern_is_kept_from_motions_that_were_measured_ahead(ahead):
    """Y_uv u v brakes a drift ahead and feeds it astern, where no run of the ship went."""
    start = Model(ship=ship_with((), "kvlcc2"))
    U = start.ship.scale.speed
    learned = start.plus({"delta_Y_uv": -3.0 * start.mass[1, 1] / start.ship.description.length})
    nu = np.array([[U, 0.2 * U, 0.0], [0.5 * U, -0.2 * U, 0.0]]) * [1.0 if ahead else -1.0, 1.0, 1.0]
    assert check_stability(learned, start, measured=nu).bounded == ahead
    assert not check_stability(learned, start).bounded, "of all motions of the region"
