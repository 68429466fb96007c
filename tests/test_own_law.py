"""A law of an actuator in a user's own file: built, sailed and learned from like the project's."""

import subprocess
import sys

import numpy as np
import pytest
from support.project import ROOT

from diagnosis.predictors import Model, ship_with
from fmus.declare import DeclarationError
from fmus.effects import STANDARD

LAW = '''
from typing import Annotated, NamedTuple

from fmus.actuators.law import Command, Law
from fmus.declare import POSITIVE


class Jet(NamedTuple):
    flow: Annotated[float, "kg/s", "water that it moves at full command", POSITIVE] = 2.0
    speed: Annotated[float, "m/s", "speed of the jet at full command", POSITIVE] = 3.0


class Waterjet(Law):
    """Momentum of a jet less that of the water that it takes in."""

    name = "waterjet"
    commands = (Command("c", "1", "command, 0...1"),)
    components = "X"
    limiting = ()
    Parameters = Jet

    @staticmethod
    def limits(p):
        return ((0.0, 1.0),)

    @staticmethod
    def force(commands, flow, p):
        (c,) = commands
        return p.flow * c * (p.speed * c - flow.u), 0.0 * c

    @staticmethod
    def reach(flow, p):
        return ((0.0, p.flow * (p.speed - flow.u)),)

    @staticmethod
    def commanded(forces, flow, p):
        return (forces[0] / (p.flow * p.speed),)
'''
SHIP = """
name = "jet_boat"
title = "Jet boat"
source = "made up"
length = 1.8
beam = 0.5

[inertia]
m = 30.0
I_z = 6.0
Y_vdot = -20.0
N_rdot = -4.0

[hull]
terms = [
    { axis = "X", product = "|u|u", value = -3.0 },
    { axis = "Y", product = "|v|v", value = -30.0 },
    { axis = "N", product = "|r|r", value = -6.0 },
]

[[actuators]]
name = "port"
law = "waterjet"
x = -0.8
y = -0.2

[[actuators]]
name = "starboard"
law = "waterjet"
x = -0.8
y = 0.2
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "jets.py").write_text(LAW)
    (tmp_path / "jet_boat.toml").write_text(SHIP)
    return tmp_path


@pytest.fixture
def boat(folder):
    return ship_with([folder / "jets.py"], folder / "jet_boat.toml")


def test_it_drives_the_ship_by_its_own_force(boat):
    model = Model(ship=boat)
    layout = boat.layout
    now = layout.running(0.0, 0.5, 0.0, 0.0, (0.8, 0.4), model.drive)
    X, Y, N = layout.act((0.8, 0.4), now, model.drive)
    port, starboard = 2.0 * 0.8 * (2.4 - 0.5), 2.0 * 0.4 * (1.2 - 0.5)
    np.testing.assert_allclose((X, Y, N), (port + starboard, 0.0, 0.2 * (port - starboard)))
    assert {"loss_port", "port_failure", "curve_port(c)"} <= set(boat.candidates)


@pytest.mark.parametrize("kind", [(), ("--native",)], ids=["Python", "native"])
def test_fmus_are_built_with_it(folder, kind):
    command = [sys.executable, "-m", "fmus.build", "thrusters", "--effects", folder / "jets.py"]
    command += ["--ship", folder / "jet_boat.toml", "--out", folder / "fmu", *kind]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    import fmpy

    start = {"tau_X": 3.0, "tau_Y": 0.0, "tau_N": 0.0}
    out = fmpy.simulate_fmu(folder / "fmu" / "thrusters.fmu", stop_time=0.1, start_values=start)
    # Of 3 N each jet is asked for half, a quarter of the 6 N that the allocation believes of it.
    assert out["tau_act_X"][-1] == pytest.approx(2.0 * 2.0 * 3.0 * 0.25**2)


def test_a_law_of_the_project_cannot_be_replaced(tmp_path):
    (tmp_path / "mine.py").write_text(LAW.replace('"waterjet"', '"tunnel_thruster"'))
    with pytest.raises(DeclarationError, match="there is a law 'tunnel_thruster' already"):
        STANDARD.plus_file(tmp_path / "mine.py")


def test_a_file_that_declares_nothing_is_refused(tmp_path):
    (tmp_path / "nothing.py").write_text("from fmus.actuators.law import Law\n")
    with pytest.raises(DeclarationError, match="registers no effect"):
        STANDARD.plus_file(tmp_path / "nothing.py")
