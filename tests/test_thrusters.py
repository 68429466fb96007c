"""Thrust map and allocation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.closed_form import Allocation, allocate, thrust
from support.cse1 import THRUSTERS as COMPONENT
from support.cse1 import Inputs

from fmus.declare import packer, variables
from fmus.signals import Force, VelocityInCurrent

Params = COMPONENT.params


def with_values(**values):
    """Parameters of the thrusters, some of another value."""
    return packer(Params)([values.get(v.name, v.start) for v in variables(Params)])


command = st.floats(-1.0, 1.0)
offset = st.floats(-0.1, 0.1)


def run(X, Y, N, p=Params()):
    return COMPONENT.step(COMPONENT.init(None, p), Inputs(Force(X, Y, N), VelocityInCurrent()), p, 0.01)[
        1
    ]


@given(command, command, command, offset, offset)
def test_allocation_inverts_the_thrust_map_inside_saturation(a, b, c, p_x, p_y):
    p = Allocation(p_x=p_x, p_y=p_y)
    assert allocate(*thrust(a, b, c, p), p) == pytest.approx((a, b, c), abs=1e-12)


@given(command, command, command)
def test_request_within_limits_acts_in_full(a, b, c):
    tau = thrust(a, b, c, Allocation())
    out = run(*tau)
    assert (out.tau_act_X, out.tau_act_Y, out.tau_act_N) == pytest.approx(tau, abs=1e-12)
    assert (out.tau_cmd_X, out.tau_cmd_Y, out.tau_cmd_N) == pytest.approx(tau, abs=1e-12)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_commands_stay_within_limits(X, Y, N):
    out = run(X, Y, N)
    assert all(abs(u) <= 1.0 for u in (out.u_vsp_x, out.u_vsp_y, out.u_bow))


def test_largest_forces_are_those_of_the_ship():
    assert run(99.0, 0.0, 0.0).tau_cmd_X == pytest.approx(1.165)
    assert run(0.0, 99.0, 0.0).tau_cmd_Y == pytest.approx(1.165 + 2.629)
    # The errata: the allocation can give 1.55 N m, less than Table 1 claims.
    assert run(0.0, 0.0, 99.0).tau_cmd_N == pytest.approx(1.55, abs=0.01)


def test_wrong_point_of_attack_turns_the_ship_when_it_is_pushed_sideways():
    wrong = run(0.0, 0.5, 0.0, with_values(plant_p_x=0.03))
    assert wrong.tau_cmd_N == pytest.approx(0.0, abs=1e-12)
    assert wrong.tau_act_N == pytest.approx(0.03 * 0.5)
    right = run(0.0, 0.5, 0.0, with_values(p_x=0.03, plant_p_x=0.03))
    assert right.tau_act_N == pytest.approx(0.0, abs=1e-12)


def test_surge_with_a_lateral_point_of_attack():
    assert run(0.5, 0.0, 0.0, with_values(plant_p_y=0.02)).tau_act_N == pytest.approx(-0.02 * 0.5)


@given(command, command, command, st.floats(0.0, 2.0), st.floats(0.0, 2.0), st.booleans())
def test_power_scales_what_a_thruster_and_its_effects_give(a, b, c, vsp, bow, bent):
    tau = thrust(a, b, c, Allocation())
    curve = COMPONENT.params().wrong._replace(curve_vsp_x_c_11=0.3 * bent, curve_vsp_y_c_9=0.1 * bent)
    full = COMPONENT.params()._replace(wrong=curve)

    def acting(p_vsp, p_bow):
        out = run(*tau, full._replace(power=type(full.power)(p_vsp, p_bow)))
        return np.array([out.tau_act_X, out.tau_act_Y, out.tau_act_N])

    by_parts = vsp * acting(1.0, 0.0) + bow * acting(0.0, 1.0)
    assert acting(vsp, bow) == pytest.approx(by_parts, abs=1e-12)
