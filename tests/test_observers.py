"""Every observer in the closed loop of the ellipse: faults survived, velocities found."""

import math
from functools import cache

import numpy as np
import pytest
from support.cases import in_part
from support.project import COMPONENTS
from support.shared import once

import cosim
from fmus.declare import packer, variables
from thesis.monte_carlo import shipped

OBSERVERS = [name for name in COMPONENTS if name.startswith("observer_")]
SIGNALS = ["observer.x_m", "observer.y_m", "observer.psi_m"]


def run(ellipse, out, observer, stop=60.0, faults=()):
    content = ellipse | {"stop": stop, "metrics": {}}
    content["fmus"]["observer"] = {"path": f"{observer}.fmu"}
    content["faults"] = [*ellipse["faults"], *faults]
    result = cosim.simulate(cosim.load_scenario(content), out)
    assert result.status == "done"
    return cosim.read_log(out)


def error(log, name, after=20.0):
    """RMS error of an estimate against the truth."""
    difference = log[f"observer.{name}_hat"] - log[f"vessel.{name}"]
    return float(np.sqrt(np.mean(difference[log["time"] >= after] ** 2)))


@pytest.fixture(scope="module")
def on_the_ellipse(shared):
    """A function that gives the log of 60 s with an observer, which is run once in a session."""

    def log(observer):
        folder = shared / f"ellipse_{observer}"
        return cosim.read_log(once(folder, lambda out: run(shipped("ellipse"), out, observer)))

    return log


@pytest.mark.parametrize("name", OBSERVERS)
def test_a_measurement_that_moves_is_not_frozen_and_only_what_screens_finds_one_that_is(name):
    component = COMPONENTS[name]
    pack, params = packer(component.inputs), component.params()
    screens = "rest_time" in [v.name for v in variables(component.params)]
    state = component.init(pack([0.0] * 6), params)
    found = []
    for k in range(60):
        k = min(k, 40)  # then it repeats, shorter than a ship at rest
        state, e = component.step(
            state, pack([1e-3 * k, 2e-3 * k, 1e-3 * k, 0.0, 0.0, 0.0]), params, 0.01
        )
        found.append(e.frozen)
    assert found[5:41] == [0.0] * 36
    assert found[-1] == float(screens)


@pytest.mark.parametrize("observer", in_part(OBSERVERS, keep=["observer_mdf", "observer_kalman"]))
def test_faults_of_the_measurement_are_survived(ellipse, tmp_path, observer):
    """NaN, zeros and spikes one after the other; three seconds later all is well again."""
    faults = [
        {"kind": "dropout", "signals": SIGNALS, "at": [5.0], "duration": 0.5, "value": "nan"},
        {"kind": "spikes", "signals": SIGNALS, "at": [12.0], "size": 0.05},
        {"kind": "dropout", "signals": SIGNALS, "at": [8.0], "duration": 0.05, "value": "zero"},
    ]
    log = run(ellipse, tmp_path, observer, 20.0, faults)
    assert all(
        np.isfinite(v).all() for n, v in log.items() if n.startswith("observer") and n not in SIGNALS
    )
    late = log["time"] >= 17.0
    assert np.abs(log["observer.x_hat"] - log["vessel.x"])[late].max() < 0.05
    assert np.abs(log["observer.u_hat"] - log["vessel.u"])[late].max() < 0.05


UPSETS = {
    "1 km": lambda pose: [pose[0] + 1e3, *pose[1:]],
    "1000 km": lambda pose: [pose[0] - 1e6, pose[1] + 1e6, pose[2]],
    "1000 turns and a half": lambda pose: [*pose[:2], pose[2] + 2001.0 * math.pi],
    "NaN": lambda pose: [math.nan] * 3,
    "one NaN": lambda pose: [pose[0], math.nan, pose[2]],
    "zeros": lambda pose: [0.0] * 3,
    "infinite force": lambda pose: pose,
}


def replayed(component, rows, h, state=None):
    """Last state, and estimates for rows of x_m, y_m, psi_m, tau_X, tau_Y, tau_N; the first only starts."""
    pack, named = packer(component.inputs), variables(component.params)
    starts = [h if v.name == "measurement_period" else v.start for v in named]
    params = packer(component.params)(starts)
    state, found = state or component.init(pack(rows[0]), params), []
    for row in rows[1:]:
        state, estimate = component.step(state, pack(row), params, h)
        found.append(list(estimate[:9]))
    return state, np.array(found)


@cache
def calm(observer, h):
    """Rows of 20 s without a bad sample, the state after ten, and the estimates of the other ten."""
    rows = []
    for k in range(round(20.0 / h)):
        psi = 0.1 * k * h
        wobble = 1e-4 * math.sin(1e3 * k * h)
        pose = [5.0 + 0.8 * math.sin(psi) + wobble, 2.0 - 0.8 * math.cos(psi), psi + wobble]
        rows.append([*pose, 0.1, 0.0, 0.0])
    half = len(rows) // 2
    state, _ = replayed(COMPONENTS[observer], rows[:half], h)
    return rows, state, replayed(COMPONENTS[observer], rows[half - 1 :], h, state)[1]


@pytest.mark.parametrize("upset", in_part(UPSETS, keep=["1 km", "NaN", "infinite force"]))
@pytest.mark.parametrize("h", [0.01, 0.1])
@pytest.mark.parametrize("observer", OBSERVERS)
def test_no_upset_is_for_good(observer, h, upset):
    """Finite always, and eight seconds after one bad sample what it would have been without."""
    rows, state, usual = calm(observer, h)
    rows = rows[len(rows) // 2 - 1 :]
    tau = [math.inf] * 3 if upset == "infinite force" else [0.1, 0.0, 0.0]
    rows[1] = [*UPSETS[upset](rows[1][:3]), *tau]
    _, found = replayed(COMPONENTS[observer], rows, h, state)
    assert np.isfinite(found).all()
    late = slice(round(8.0 / h), None)
    assert found[late] == pytest.approx(usual[late], abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("observer", ["observer_luenberger", "observer_nonlinear"])
def test_heading_runs_on_over_turns(on_the_ellipse, observer):
    log = on_the_ellipse(observer)
    assert np.abs(log["vessel.psi"]).max() > math.pi
    assert np.abs(log["observer.psi_hat"] - log["vessel.psi"]).max() < 0.1


@pytest.mark.slow
def test_filter_of_before_the_thesis_takes_a_wrap_for_a_turn(on_the_ellipse):
    """What the modification is for: the yaw rate it reports there is absurd."""
    before, modified = on_the_ellipse("observer_df"), on_the_ellipse("observer_mdf")
    assert np.abs(before["observer.r_hat"]).max() > 1.0
    assert np.abs(modified["observer.r_hat"]).max() < 0.3


@pytest.mark.slow
def test_model_makes_better_velocities(on_the_ellipse):
    """With the true model, the Luenberger observer is the thesis' best in every velocity."""
    logs = {o: on_the_ellipse(o) for o in OBSERVERS if o != "observer_kalman"}
    for name in ("u", "v", "r"):
        errors = {o: error(log, name) for o, log in logs.items()}
        assert min(errors, key=errors.__getitem__) == "observer_luenberger"
        assert errors["observer_luenberger"] < 0.5 * errors["observer_mdf"]


def test_nonlinear_observer_has_the_poles_of_its_gains():
    """From a wrong velocity, the error of the pose follows s2 + k1 s + k2."""
    component = COMPONENTS["observer_nonlinear"]
    inputs = packer(component.inputs)
    k1, k2, h = 3.0, 2.0, 0.001
    names = [v.name for v in variables(component.params)]
    values = {"k1_x": k1, "k2_u": k2, "rest_time": 0.0}
    params = packer(component.params)([values.get(v.name, v.start) for v in variables(component.params)])
    assert {"k1_x", "k2_u", "rest_time"} <= set(names)
    state = component.init(inputs([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), params)
    times = np.arange(1, 3001) * h
    errors = []
    for t in times:  # a ship that moves ahead at 1 m/s, while the observer starts from rest
        state, estimate = component.step(state, inputs([1.0 + t, 0.0, 0.0, 0.0, 0.0, 0.0]), params, h)
        errors.append(1.0 + t - estimate.x_hat)
    expected = np.exp(-times) - np.exp(-2.0 * times)  # poles -1 and -2, unit slope
    assert np.allclose(errors, expected, atol=2e-3)


@pytest.mark.parametrize("name", ["observer_nonlinear", "observer_luenberger"])
def test_no_pose_makes_a_velocity_that_no_ship_has(name):
    """2 m/s and 5 rad/s at the most, whichever way and how far the measured pose jumps."""
    component = COMPONENTS[name]
    pack, params = packer(component.inputs), component.params()
    for sign in (1.0, -1.0):
        state = component.init(pack([0.0] * 6), params)
        most = np.zeros(3)
        for k in range(300):
            pose = [sign * 3.0 * k, sign * 2.0 * k, sign * 2.0 * k]
            state, e = component.step(state, pack([*pose, 0.0, 0.0, 0.0]), params, 0.01)
            most = np.maximum(most, np.abs([e.u_hat, e.v_hat, e.r_hat]))
        assert (most <= [2.0, 2.0, 5.0]).all()
        reached = 2 if name == "observer_luenberger" else 3  # its damping brakes the yaw rate before
        assert most[:reached].tolist() == [2.0, 2.0, 5.0][:reached]


def test_luenberger_without_measurement_is_the_model():
    component, vessel = COMPONENTS["observer_luenberger"], COMPONENTS["vessel"]
    pack, force = packer(component.inputs), packer(vessel.inputs)
    params, p = component.params(), vessel.params()
    h, tau = 0.001, [0.5, -0.2, 0.05]
    ship, ready = vessel.init(None, p), vessel.prepared(p)
    state = component.init(pack([ship.x, ship.y, ship.psi, *tau]), params)
    for _ in range(2000):
        state, estimate = component.step(state, pack([math.nan] * 3 + tau), params, h)
        ship, _ = vessel.advance(ship, force(tau), ready, h)
    assert estimate[3:6] == pytest.approx((ship.u, ship.v, ship.r), rel=0.01)
    assert estimate[:3] == pytest.approx((ship.x, ship.y, ship.psi), abs=1e-3)
    assert estimate.frozen == 1.0
