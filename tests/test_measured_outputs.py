"""What is measured of an actuator beside its commands: it judges, and is fitted to only where asked."""

import numpy as np
import pandas as pd
import pytest

import diagnosis
from cosim import InputError
from diagnosis.predictors import Model, ship_with
from diagnosis.predictors.measured_outputs import inseparable, named, rms
from diagnosis.report.content import comparison_content
from diagnosis.search.prediction_fit.output_fit import fitted
from fmus.actuators.actuation import forces, output
from fmus.actuators.response import total
from fmus.signals import Force
from fmus.vessel import vessel

THRUST = "propeller.thrust"
STRONGER = 0.02  # of K_T0, that the tanker of these runs has more


@pytest.fixture(scope="module")
def tanker():
    return ship_with((), "kvlcc2")


def zigzag(tanker, shaft):
    """A run of the tanker with a stronger propeller, and its thrust measured, at shaft speeds (t) [1/s]."""
    d, h = tanker.description, 0.1
    start = tanker.thrusters.params().plant
    own = start.propeller._replace(plant_propeller_K_T0=start.propeller.plant_propeller_K_T0 + STRONGER)
    plant = start._replace(propeller=own)
    b = tanker.vessel.prepared(tanker.vessel.params()).hull
    s, rows = vessel.State(0.0, 0.0, 0.0, 1.1, 0.0, 0.0, 0.0), []
    for k in range(1500):
        t = k * h
        commands = (shaft(t), 0.35 * np.sign(np.sin(0.12 * t)))
        thrust = output(d, THRUST, commands, s[3:6], plant)
        rows.append([t, *s[:3], *commands, thrust])
        s = vessel.integrate(s, Force(*total(forces(d, commands, s[3:6], plant))), b, h)
    columns = ["time", "x", "y", "psi", "propeller.n", "rudder.delta", THRUST]
    frame = pd.DataFrame(rows, columns=columns)
    noise = np.random.default_rng(1).normal(0.0, 1e-4, (len(frame), 3))
    frame[["x", "y", "psi"]] += noise
    return frame


@pytest.fixture(scope="module")
def steady(tanker):
    (w,) = diagnosis.load(zigzag(tanker, lambda t: 10.0), ship="kvlcc2", anyway=True)
    return w


def test_a_measured_thrust_is_held_against_the_model(tanker, steady):
    model = Model(ship=tanker)
    assert named(steady, model) == [THRUST]
    stronger = 1000.0 * 0.204**4 * 10.0**2 * STRONGER
    assert rms(steady, model, THRUST) == pytest.approx(stronger, rel=0.02)
    right = model.plus({"plant_propeller_K_T0": STRONGER})
    assert rms(steady, right, THRUST) < 0.02 * stronger


def test_thrust_follows_the_shaft_speed(tanker):
    frame = zigzag(tanker, lambda t: 10.0 + 2.0 * np.sin(0.05 * t))
    (w,) = diagnosis.load(frame, ship="kvlcc2", anyway=True)
    model = Model(ship=tanker).plus({"plant_propeller_K_T0": STRONGER})
    assert rms(w, model, THRUST) < 0.01 * frame[THRUST].std()


def test_it_stands_in_the_errors_of_a_comparison(tanker, steady):
    content = comparison_content(diagnosis.evaluate([steady], Model(ship=tanker)), None, [])
    error = content.errors[0].measured[THRUST]
    assert error.rms_before == error.rms_after > 3.0


def test_a_fit_to_it_takes_the_prior_and_the_measurement(tanker, steady):
    model = Model(ship=tanker)
    asked = fitted([steady], model, None, [THRUST])
    assert rms(steady, asked, THRUST) < 0.2 * rms(steady, model, THRUST)
    assert set(asked.thrusters) <= {n for n in tanker.coefficients if n.startswith("plant_propeller_")}
    assert not asked.vessel
    assert fitted([steady], model, 0.0, [THRUST]).values == model.values
    with pytest.raises(InputError, match=r"no run has the measured output 'propeller.thurst'; did you"):
        fitted([steady], model, None, ["propeller.thurst"])


def test_thrust_and_resistance_are_told_apart_by_other_shaft_speeds_alone(tanker, steady):
    model = Model(ship=tanker)
    (warning,) = inseparable([steady], model)
    assert "propeller turns at 10 1/s throughout" in warning
    (other,) = diagnosis.load(
        zigzag(tanker, lambda t: 10.0 if t < 70.0 else 8.0), ship="kvlcc2", anyway=True
    )
    assert inseparable([other], model) == []
    assert inseparable([steady, other], model) == []
