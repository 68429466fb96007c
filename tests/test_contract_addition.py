"""Forces that act beside an FMU: terms of its outputs, and what a changed model of a ship has beyond another."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.addition import POSE, VELOCITY, AddedTerm, Line, added_terms, addition
from fmus.declare import flatten, variables
from fmus.ship import ship

SHIP = ship()
NOMINAL = {v.name: v.start for v in variables(SHIP.vessel.params)}
# A hull without damping but for a linear one in surge.
DAMPING = [n for n in NOMINAL if n[:2] in ("X_", "Y_", "N_") and not n.endswith("dot")]
CALM = {**dict.fromkeys(DAMPING, 0.0), "X_u": -2.0}
TAU = ("tau_X", "tau_Y", "tau_N")
SEEN = {name: Line(1.0) for name in (*POSE, *VELOCITY)}


class Stepped:
    """A component, stepped with named inputs; its outputs by name."""

    def __init__(self, component):
        self.component, self.prepared = component, component.prepared(component.params())
        self.state = component.init(component.inputs(), component.params())

    def __call__(self, h, **inputs):
        known = {v.name: v.start for v in variables(self.component.inputs)}
        assert inputs.keys() <= known.keys()
        given = self.component.inputs._make({**known, **inputs}.values())
        self.state, outputs = self.component.advance(self.state, given, self.prepared, h)
        return dict(
            zip((v.name for v in variables(self.component.outputs)), flatten(outputs), strict=True)
        )


# Terms


@settings(max_examples=20)
@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.integers(0, 3))
def test_a_term_is_a_power_of_an_output_with_its_sign(y, other, power):
    run = Stepped(added_terms([0.5, -1.0], 2, [AddedTerm(1, 0, power, False, 2.0)]))
    law = {0: 1.0, 1: y, 2: y * abs(y), 3: y**3}[power]
    found = run(0.1, to_0=4.0, to_1=5.0, from_0=y, from_1=other)
    assert found == pytest.approx({"sum_0": 4.0, "sum_1": 5.0 + 2.0 * law})
    assert run(0.1, from_0=y)["sum_0"] == 0.5, "its start value"


def test_a_term_of_a_rate_has_the_change_over_the_last_step():
    run = Stepped(added_terms([0.0], 1, [AddedTerm(0, 0, 2, True, 3.0)]))
    assert run(0.0, from_0=1.0)["sum_0"] == 0.0, "nothing before"
    assert run(0.5, from_0=1.0)["sum_0"] == 0.0
    assert run(0.5, from_0=0.0)["sum_0"] == pytest.approx(-3.0 * 2.0**2)
    assert run(0.0, from_0=9.0)["sum_0"] == 0.0, "a step of no length"
    assert run(0.25, from_0=0.5)["sum_0"] == pytest.approx(3.0 * 2.0**2), "which is not kept"


def test_a_term_turns_with_an_output_and_several_add_up():
    terms = [AddedTerm(0, 1, 1, False, 2.0, 0.5, 0.3), AddedTerm(0, 0, 1, False, -1.0)]
    found = Stepped(added_terms([0.0], 2, terms))(0.1, to_0=1.0, from_0=4.0, from_1=0.8)
    assert found["sum_0"] == pytest.approx(1.0 + 2.0 * np.cos(0.5 * 0.8 + 0.3) - 4.0)


# A changed model of a ship


def values(**vessel):
    return {"vessel": {**CALM, **vessel}, "thrusters": {}}


def beside(after, stated=SEEN, given=None, acting=None, before=None):
    """The component by which an FMU gets what a changed model has beyond another one."""
    given = {n: Line(1.0) for n in TAU} if given is None else given
    return Stepped(addition(SHIP, before or values(), after, stated, given, acting or {}))


def of_state(x=0.0, y=0.0, psi=0.0, u=0.0, v=0.0, r=0.0):
    return {f"from_{n}": s for n, s in zip((*POSE, *VELOCITY), (x, y, psi, u, v, r), strict=True)}


ASKED = dict(zip(TAU, (0.6, -0.2, 0.1), strict=True))


def test_the_same_model_adds_nothing():
    found = beside(values())(0.1, **ASKED, **of_state(psi=0.4, u=0.2, v=0.05, r=0.1))
    assert found == pytest.approx({f"to_{n}": x for n, x in ASKED.items()})


def test_more_drag_is_a_force_against_the_motion():
    run = beside(values(delta_X_u=-3.0))
    for u in (0.2, -0.4):
        found = run(0.1, **ASKED, **of_state(u=u))
        assert found == pytest.approx({"to_tau_X": 0.6 - 3.0 * u, "to_tau_Y": -0.2, "to_tau_N": 0.1})


def test_an_fmu_has_its_own_units():
    stated = {**SEEN, "u": Line(0.5, 0.1)}  # u = 0.5 raw + 0.1
    run = beside(values(delta_X_u=-3.0), stated, {"tau_X": Line(2.0, 0.3)})
    found = run(0.1, **ASKED, **of_state(u=0.2))
    assert found == pytest.approx({"to_tau_X": (0.6 - 3.0 * 0.2 - 0.3) / 2.0})


def test_where_an_fmu_takes_what_acts_beside_its_commands_stay():
    run = beside(values(delta_X_u=-3.0), acting={"tau_X": Line(2.0, 0.1)})
    found = run(0.1, **ASKED, **of_state(u=0.2))
    assert found == pytest.approx(
        {f"to_{n}": x for n, x in ASKED.items()} | {"add_tau_X": (-0.6 - 0.1) / 2.0}
    )
    run = beside(values(delta_X_u=-3.0), acting={"u_dot": Line(1.0)})
    inertia = NOMINAL["m"] - NOMINAL["X_udot"]
    found = run(0.1, **ASKED, **of_state(u=0.2))
    assert found["add_u_dot"] == pytest.approx(-0.6 / inertia)
    assert found["to_tau_X"] == 0.6


def test_a_heavier_ship_needs_a_force_by_the_acceleration_that_the_fmu_has():
    """In surge alone: the force on the hull is the same, so M' nu_dot' = M nu_dot."""
    run = beside(values(added_mass_X=4.0))
    first = run(0.0, **ASKED, **of_state(u=0.1))
    assert first["to_tau_X"] == pytest.approx(0.6), "no acceleration is known yet"
    assert run(0.5, **ASKED, **of_state(u=0.1))["to_tau_X"] == pytest.approx(0.6)
    found = run(0.5, **ASKED, **of_state(u=0.35))
    assert found["to_tau_X"] == pytest.approx(0.6 - 4.0 * 0.25 / 0.5)


def test_a_velocity_that_is_not_told_is_that_of_the_pose():
    stated = {name: Line(1.0) for name in POSE}
    run = beside(values(delta_X_u=-3.0), stated)
    psi = 3.1

    def pose(way):
        return {"from_x": way * np.cos(psi), "from_y": way * np.sin(psi), "from_psi": psi}

    assert run(0.0, **ASKED, **pose(0.0))["to_tau_X"] == pytest.approx(0.6)
    assert run(0.5, **ASKED, **pose(0.0))["to_tau_X"] == pytest.approx(0.6)
    assert run(0.5, **ASKED, **pose(0.1))["to_tau_X"] == pytest.approx(0.6 - 3.0 * 0.2)
    # A turn through south is small.
    run = beside({"vessel": {**CALM, "delta_N_r": -2.0}, "thrusters": {}}, stated)
    run(0.5, from_psi=3.1)
    turned = run(0.5, from_psi=0.2 + 3.1 - 2.0 * np.pi)
    assert turned["to_tau_N"] == pytest.approx(-2.0 * 0.2 / 0.5)


def test_a_pose_that_is_not_told_is_that_of_the_velocity():
    """A force to north on a ship that has turned by half a rad/s for a second acts by its heading."""
    stated = {name: Line(1.0) for name in VELOCITY}
    run = beside(values(F_n=1.0), stated)
    moving = {"from_u": 0.0, "from_v": 0.0, "from_r": 0.5}
    for k in range(3):
        psi = 0.25 * (k + 1)
        found = run(0.5, **ASKED, **moving)
        assert found["to_tau_X"] == pytest.approx(0.6 + np.cos(psi))
        assert found["to_tau_Y"] == pytest.approx(-0.2 - np.sin(psi))


def test_what_an_fmu_never_changes_is_a_number():
    run = beside(values(delta_X_u=-3.0), {**SEEN, "u": 0.5})
    given = {k: x for k, x in of_state().items() if k != "from_u"}
    assert run(0.1, **ASKED, **given)["to_tau_X"] == pytest.approx(0.6 - 1.5)


def test_thrusters_that_lose_a_part_are_a_force_less():
    after = {"vessel": CALM, "thrusters": {"loss_surge": 0.25}}
    found = beside(after)(0.1, **ASKED, **of_state())
    assert found["to_tau_X"] == pytest.approx(0.75 * 0.6)
    assert found["to_tau_N"] == pytest.approx(0.1)


def test_a_force_in_the_plane_is_given_by_size_and_angle():
    given = {"tau_force": Line(1.0), "tau_angle": Line(1.0), "tau_N": Line(1.0)}
    run = beside(values(delta_X_u=-3.0), given=given)
    found = run(0.1, **ASKED, **of_state(u=0.1))
    assert found["to_tau_force"] == pytest.approx(np.hypot(0.3, -0.2))
    assert found["to_tau_angle"] == pytest.approx(np.arctan2(-0.2, 0.3))
