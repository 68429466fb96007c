"""The law of a water jet, and a function of the hull."""

from typing import Annotated, NamedTuple

from fmus.actuators.law import Command, Law
from fmus.declare import POSITIVE
from fmus.hull_functions import hull_function
from fmus.ops import fmax


class Jet(NamedTuple):
    """Parameters of a jet."""

    flow: Annotated[float, "kg/s", "water that it moves at full command", POSITIVE] = 2.0
    speed: Annotated[float, "m/s", "speed of the jet at full command", POSITIVE] = 3.0


class JetPump(Law):
    """Momentum of a jet less that of the water that it takes in."""

    name = "jet_pump"
    commands = (Command("c", "1", "command, 0...1"),)
    components = "X"
    limiting = ()
    Parameters = Jet

    @classmethod
    def limits(cls, p):
        return ((0.0, 1.0),)

    @classmethod
    def force(cls, commands, flow, p):
        (c,) = commands
        return p.flow * c * (p.speed * c - flow.u), 0.0 * c

    @classmethod
    def reach(cls, flow, p):
        return ((0.0, p.flow * (p.speed - flow.u)),)

    @classmethod
    def commanded(cls, forces, flow, p):
        return (forces[0] / (p.flow * p.speed),)


@hull_function()
def bow_wave(
    u,
    v,
    r,
    bow_wave_drag: Annotated[float, "N.s2/m2", "drag of the bow wave, above its speed"] = 0.0,
    bow_wave_speed: Annotated[float, "m/s", "speed at which the wave begins", POSITIVE] = 0.5,
):
    """Drag of the bow wave, which begins at a speed ahead."""
    above = fmax(u - bow_wave_speed, 0.0)
    return -bow_wave_drag * above * above, 0.0 * v, 0.0 * r
