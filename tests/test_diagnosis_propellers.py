"""Effects of propellers with commands of their own: their forces, found where hidden and nowhere else."""

import numpy as np
import pytest
from support.cse1 import ASIDE, EFFECTS, FIVE, SHIP
from support.measured import NOISE, learn, smoothed

from diagnosis import Model, Run, weak_windows
from fmus.actuators.response import total
from fmus.effects import Running, Thrust
from fmus.signals import Force
from fmus.vessel.vessel import State

H = 0.02
HIDDEN = {
    "cross_vsp": {"cross_vsp_sway": 0.28, "cross_vsp_surge": 0.3},
    "inflow_vsp": {"inflow_vsp_x": 0.85, "inflow_vsp_y": 1.2},
    "power_exponent": {"exponent_vsp": 0.4, "exponent_bow": 0.5},
}


def given(seconds):
    """Five commands that swing at frequencies of their own, and settings of the power that jump."""
    t = H * np.arange(round(seconds / H))
    rates = np.array([0.31, 0.47, 0.37, 0.53, 0.41])
    five = 0.25 * np.sin(np.outer(t, rates) + np.arange(5)) + 0.2 * np.sin(np.outer(t, 2.3 * rates))
    five[:, [0, 2]] += 0.2
    setting = np.array([[1.0, 0.8], [0.5, 1.0], [0.7, 0.4]])[(t / 11.0).astype(int) % 3]
    return t, five, setting


def voyage(seconds=90.0, **values):
    """Windows of a run of the ship, whose propellers are these."""
    t, five, setting = given(seconds)
    model = Model(thrusters=values)
    ready, s, poses = model.hull, State(psi=3.0), []
    for now, shares, power in zip(t.tolist(), five.tolist(), setting.tolist(), strict=True):
        poses.append(s[:3])
        drive = SHIP.layouts[-1].powered(model.drive, power)
        running = SHIP.layouts[-1].running(now, *s[3:6], tuple(shares), drive)
        force = SHIP.layouts[-1].act(tuple(shares), running, drive)
        s, _ = model.ship.vessel.advance(s, Force(*force), ready, H)
    pose = np.array(poses) + NOISE * np.random.default_rng(4).standard_normal((t.size, 3))
    force = model.ship.commanded_force(five, setting)
    run = Run("made", t, pose, force, commands=five, power=setting, signals=FIVE)
    return weak_windows(smoothed(run))


AT = (-0.4575, -0.4575, 0.3875)


def act(name, now, **values):
    """Thrust of an effect on propellers of 0.5 N ahead and 0.2 N to starboard, and a bow of 0.1 N."""
    e = EFFECTS[name]
    f = Thrust((0.5, 0.5, 0.0), (0.2, 0.2, 0.1), AT, (*ASIDE, 0.0), (0.5, 0.5, 1.0))
    return e(f, now, *[values.get(p.name, p.start) for p in e.parameters])


def test_cross_forces_are_mirrored_and_cancel_but_for_a_turn():
    found = act("cross_vsp", Running(), cross_vsp_sway=0.3, cross_vsp_surge=0.1)
    np.testing.assert_allclose(found.Y, (0.05, 0.35, 0.1))
    np.testing.assert_allclose(found.X, (0.52, 0.48, 0.0))
    # Port ahead and starboard astern turn the bow to starboard.
    turn = AT[0] * 0.2 + AT[2] * 0.1 + 0.055 * 0.1 * 0.2
    np.testing.assert_allclose(total(found), (0.5, 0.3, turn))


def test_inflow_takes_force_from_where_the_water_comes():
    turning = Running(u=0.2, v=0.0, r=0.1, part=(-0.5, 0.5, -0.5, 0.5, 0.0))
    found = act("inflow_vsp", turning, inflow_vsp_x=1.0, inflow_vsp_y=1.0)
    assert found.X[0] == pytest.approx(0.5 - 0.5 * (0.2 + 0.0055))
    assert found.X[1] == pytest.approx(0.5 - 0.5 * (0.2 - 0.0055))
    np.testing.assert_allclose(found.Y, (0.2 + 0.5 * 0.04575, 0.2 + 0.5 * 0.04575, 0.1))
    still = act("inflow_vsp", turning._replace(part=(0.0,) * 5), inflow_vsp_x=1.0)
    assert (still.X, still.Y) == ((0.5, 0.5, 0.0), (0.2, 0.2, 0.1))


def test_exponent_matters_at_part_power_only():
    exponents = {"exponent_vsp": 1.0, "exponent_bow": 0.5}
    full = act("power_exponent", Running(power=(1.0, 1.0, 1.0)), **exponents)
    assert (*full.X, *full.Y) == pytest.approx((0.5, 0.5, 0.0, 0.2, 0.2, 0.1))
    part = act("power_exponent", Running(power=(0.5, 0.5, 0.25)), **exponents)
    assert (*part.X, *part.Y) == pytest.approx((0.25, 0.25, 0.0, 0.1, 0.1, 0.05))
    none = act("power_exponent", Running(power=(0.0, 0.0, 0.0)), **exponents)
    assert np.isfinite((*none.X, *none.Y)).all()


@pytest.mark.slow
@pytest.mark.parametrize("hidden", HIDDEN)
def test_hidden_one_is_found_with_its_values(hidden):
    first = learn([voyage(**HIDDEN[hidden])], prior=0.0).effects[0]
    assert first.id == hidden
    for name, value in HIDDEN[hidden].items():
        assert first.values[name] == pytest.approx(value, rel=0.15), name


@pytest.mark.slow
def test_none_is_claimed_where_it_is_not():
    (found,) = learn([voyage(loss_vsp1=0.3)], prior=0.0).effects
    assert found.id not in HIDDEN


def test_only_exponents_that_differ_are_told():
    stated = EFFECTS["power_exponent"].wording.sentence
    bow = stated({"exponent_vsp": 0.0, "exponent_bow": 0.5})
    both = stated({"exponent_vsp": 0.25, "exponent_bow": 0.5})
    assert "bow thruster is 1.5" in bow
    assert "1.25" not in bow
    assert bow.count(" is ") == 2, "that it is not linear, and one exponent"
    assert both.count(" is ") == 3
