"""Which variable of an FMU is which signal, in the tongues of the field; what is not taken without asking."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from cosim import Unit
from cosim.fmu import FmuModel, FmuVariable
from diagnosis.predictors.black_box import commanded, planes
from diagnosis.predictors.fmu.variable_map import completed, propose, signal_lines
from diagnosis.runs import Run
from fmus.addition import Line, _polar

COMMANDS = {"tau_X": "force", "tau_Y": "force", "tau_N": "moment"}
DEG = np.pi / 180.0


def variable(name, causality, unit=None, low=None, high=None, start=None):
    stated = None if unit is None else Unit(unit)
    return FmuVariable(name, "Real", 0, causality, "continuous", stated, "", low, high, start)


def fmu(*variables):
    known = {v.name: v for v in variables}
    model = SimpleNamespace(variables=known, can_be_set=lambda v: v.causality in ("parameter", "input"))
    model.reals = partial(FmuModel.reals, model)
    return model


def outputs(*names, **limits):
    """The proposal for some outputs, by name or with their limits."""
    given = [variable(n, "output") for n in names]
    given += [variable(n, "output", None, -x, x) for n, x in limits.items()]
    found = propose(fmu(*given), COMMANDS)
    return {s: c for s, c in found.outputs.items() if c is not None}, found, fmu(*given)


SAME = [
    ("North_pos", "east_position", "Heading_deg", "surge_vel", "sway_velocity", "yaw_rate"),
    ("eta[1]", "eta[2]", "eta[6]", "nu[1]", "nu[2]", "nu[6]"),
    ("x_ned", "y_ned", "psi_ned", "vessel.surgeSpeed", "vessel.swaySpeed", "vessel.yawVelocity"),
    ("pos.north", "pos.east", "hdg", "out.surge_velocity", "out.sway_velocity", "out.heading_rate"),
    ("position_n", "position_e", "yaw_angle", "vel_surge", "vel_sway", "rate_yaw"),
]


@pytest.mark.parametrize("names", SAME)
def test_names_of_other_tongues(names):
    found, _, _ = outputs(*names)
    assert {s: c.name for s, c in found.items()} == dict(
        zip(("x", "y", "psi", "u", "v", "r"), names, strict=True)
    )


@pytest.mark.parametrize(
    "name", ["north_east_pos", "surge_force_speed", "surge_position", "rudder_angle", "n_2"]
)
def test_names_that_say_two_things_or_another_one_are_no_signals(name):
    assert outputs(name)[0] == {}


def test_a_unit_at_the_end_of_a_name_and_one_that_limits_say():
    found, _, _ = outputs("Heading_deg", "x_km")
    assert found["psi"].unit == "deg"
    found, _, _ = outputs("north", "east", heading=180.0, yaw_rate=20.0)
    assert (found["psi"].unit, found["r"].unit) == ("deg", "deg/s")
    found, _, _ = outputs("north", "east", heading=3.15, yaw_rate=0.5)
    assert (found["psi"].unit, found["r"].unit) == (None, None)


def test_east_north_up_is_turned_to_north_east_down():
    """A ship that heads north has 90 deg there, one that heads east 0."""
    found, proposal, model = outputs("x_enu", "y_enu", "yaw_enu", "u_body", "v_body", "r_body")
    assert {s: c.name for s, c in found.items() if s in "xy"} == {"x": "y_enu", "y": "x_enu"}
    lines = signal_lines(completed(proposal, model, COMMANDS, "map"), COMMANDS)["outputs"]
    heading = lines["psi"]
    assert heading.gain * (90.0 * DEG) + heading.offset == pytest.approx(0.0)
    assert heading.gain * 0.0 + heading.offset == pytest.approx(90.0 * DEG)
    degrees, proposal, model = outputs("north_enu", "east_enu", yaw_enu=180.0)
    assert (degrees["x"].name, degrees["y"].name) == ("north_enu", "east_enu")
    heading = signal_lines(completed(proposal, model, COMMANDS, "map"), COMMANDS)["outputs"]["psi"]
    assert heading.gain * 90.0 + heading.offset == pytest.approx(0.0)


def test_single_letters_alone_are_no_signals():
    """A bouncing ball has a height h and a velocity v; of a ship u, v and r are there, or x, y and psi."""
    assert outputs("h", "v")[0] == {}
    assert {*outputs("north", "east", "heading", "v")[0]} == {"x", "y", "psi"}
    assert {*outputs("u", "v", "r")[0]} == {"u", "v", "r"}
    assert {*outputs("x", "y", "psi")[0]} == {"x", "y", "psi"}
    assert {*outputs("x", "y")[0]} == set()
    ball = fmu(variable("h", "output"), variable("v", "output"), variable("v_0", "parameter"))
    assert not any(propose(ball, COMMANDS).start.values())


def test_forces_by_other_names():
    model = fmu(
        variable("force_surge", "input"),
        variable("swayForce", "input"),
        variable("yaw_moment_kN.m", "input"),
    )
    found = propose(model, COMMANDS).inputs
    names = {"tau_X": "force_surge", "tau_Y": "swayForce", "tau_N": "yaw_moment_kN.m"}
    assert {s: c and c.name for s, c in found.items() if s in COMMANDS} == names
    assert found["tau_N"].unit == "kN.m"
    found = propose(fmu(variable("tau[1]", "input"), variable("tau[6]", "input")), COMMANDS).inputs
    assert (found["tau_X"].name, found["tau_N"].name) == ("tau[1]", "tau[6]")


def test_a_force_is_there_by_its_size_and_angle():
    """From ahead to starboard; of all forces together, and of each actuator with two components."""
    tau = np.array([[3.0, 4.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -2.0, 1.0]])
    run = Run("polar", np.arange(3.0), np.zeros((3, 3)), tau)
    found = commanded(run)
    assert found["tau.force"] == pytest.approx([5.0, 1.0, 2.0])
    assert found["tau.angle"] == pytest.approx([np.arctan2(4.0, 3.0), np.pi, -0.5 * np.pi])
    assert planes(["fore.X", "fore.Y", "aft.X"]) == {"fore": ("fore.X", "fore.Y")}
    given = {"tau_force": Line(1.0), "tau_angle": Line(DEG)}
    both = _polar({"tau_X": 3.0, "tau_Y": 4.0}, given)
    assert both == {"tau_force": pytest.approx(5.0), "tau_angle": pytest.approx(np.arctan2(4.0, 3.0))}
