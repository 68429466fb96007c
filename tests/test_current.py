"""A uniform current is a change of the frame, for hull, propellers and rudders alike."""

import numpy as np
import pandas as pd
import pytest
from support.ships import SHIPS

import diagnosis
from diagnosis import Model
from diagnosis.predictors import omega
from diagnosis.predictors.windows import Windows
from fmus.declare import packer, variables
from fmus.frames import rotate_to_body
from fmus.ship import ship
from fmus.signals import Force

# Commands of each ship, or the force that it allocates, and its speed ahead [m/s].
UNDER_WAY = {
    "kvlcc2": ((10.2, 0.3), 1.1),
    "gunnerus": ((0.2, 2.8), 4.0),
    "otter": ((60.0, 0.0, 10.0), 0.8),
}
V_N, V_E, HEADING = 0.15, -0.1, 0.7  # of a ship's speed, and rad


def water(d, share=1.0):
    """The water's velocity [m/s, m/s] for a ship."""
    _, speed = UNDER_WAY[d.name]
    return share * V_N * speed, share * V_E * speed


def in_water(d, share):
    """Parameters of a ship's vessel in a current."""
    parts = ship(description=d)
    V_n, V_e = water(d, share)
    given = {"x_0": 0.0, "y_0": 0.0, "V_n": V_n, "V_e": V_e}
    p = [given.get(v.name, v.start) for v in variables(parts.vessel.params)]
    return parts.vessel.prepared(packer(parts.vessel.params)(p))


def under_way(d, share, seconds, u=None):
    """Time, pose, force of the thrusters and commands of a ship in a current, step by step.

    Args:
        d: the ship.
        share: of the current; 0: still water.
        seconds: how long.
        u: its speed ahead through the water; by default its usual one.
    """
    parts, hull = ship(description=d), in_water(d, share)
    thrusters = parts.thrusters
    drive = thrusters.prepared(thrusters.params())
    asked, usual = UNDER_WAY[d.name]
    speed = usual if u is None else u
    u_c, v_c = rotate_to_body(HEADING, *water(d, share))
    s = parts.vessel.init(Force(), hull.params)._replace(psi=HEADING, u=speed + u_c, v=v_c)
    request = type(thrusters.inputs().request)
    h = 0.02 * d.scale.time
    past, rows = thrusters.init(None, thrusters.params()), []
    seen = parts.vessel.advance(s, Force(), hull, 0.0)[1].velocity
    for k in range(round(seconds / h)):
        now = [c * np.cos(0.9 * k * h / d.scale.time) if j else c for j, c in enumerate(asked)]
        past, out = thrusters.advance(past, thrusters.inputs(request(*now), seen), drive, h)
        tau = Force(out.tau_act_X, out.tau_act_Y, out.tau_act_N)
        rows.append((k * h, s.x, s.y, s.psi, *tau, *now))
        s, stated = parts.vessel.advance(s, tau, hull, h)
        seen = stated.velocity
    return np.array(rows)


@pytest.mark.parametrize("name", UNDER_WAY)
def test_a_ship_in_a_current_has_the_forces_and_the_track_of_still_water(name):
    """Galileo: in the frame that moves with the water nothing tells of it."""
    d = SHIPS[name]
    still, flowing = (under_way(d, share, 8.0 * d.scale.time) for share in (0.0, 1.0))
    time, size = still[:, 0], d.length
    drift = np.outer(time, water(d))
    np.testing.assert_allclose(flowing[:, 1:3] - drift, still[:, 1:3], atol=1e-6 * size)
    np.testing.assert_allclose(flowing[:, 3], still[:, 3], atol=1e-6)
    force = np.abs(still[:, 4:7]).max(axis=0) + 1e-9
    np.testing.assert_allclose(flowing[:, 4:7] / force, still[:, 4:7] / force, atol=1e-5)


@pytest.mark.parametrize("name", UNDER_WAY)
def test_a_ship_that_drifts_with_the_water_is_pushed_as_at_rest(name):
    d = SHIPS[name]
    still, drifting = (under_way(d, share, 0.2 * d.scale.time, u=0.0) for share in (0.0, 1.0))
    assert np.abs(still[:, 4:7]).max() > 0.0
    np.testing.assert_allclose(drifting[:, 4:7], still[:, 4:7], rtol=1e-5, atol=1e-6)


def test_the_diagnosis_sees_thrusters_in_the_water_as_their_fmu_does():
    """Weak form and prediction know all of a ship in a current, and miss it where that is left out."""
    d = SHIPS["kvlcc2"]
    table = under_way(d, 1.0, 30.0 * d.scale.time)[::10]
    names = ["time", "x", "y", "psi", "X", "Y", "N", "propeller.n", "rudder.delta"]
    run = pd.DataFrame(table, columns=names).drop(columns=["X", "Y", "N"])
    nominal = Model(ship=ship(description=d))
    V_n, V_e = water(d)
    (w,) = diagnosis.load([run], model=nominal)
    stated = nominal.plus({"V_n": V_n, "V_e": V_e})
    left, missed = (np.sqrt(np.mean(omega(w, m) ** 2, axis=0)) for m in (stated, nominal))
    assert (left < 0.05 * missed).all()
    windows = Windows([w.smoothed], w.horizon)
    off, off_nominal = (windows.errors(m).over_all()[0] for m in (stated, nominal))
    assert off < 0.02 * off_nominal
