"""Actuators that act at another place, or in another direction, than they are described."""

from math import degrees

from ..declare import Range, Variable
from ..ops import Number, cos, sin
from ..scale import Scale
from .devices import SHARE, Devices, declared, parameter, pushed, with_one
from .effect import Effect, Running, Search, Thrust
from .text import offset

MOUNTED = 0.02  # rad, by which actuators are mounted in another direction: one degree; chosen


def place_parameters(name: str, whose: str, scale: Scale) -> tuple[Variable, Variable]:
    """How far a force acts from the assumed place [m]."""
    aboard = Range(-0.6 * scale.length, 0.6 * scale.length)
    return (
        parameter(f"{name}_dx", "m", f"{whose} forward of the assumed one", aboard),
        parameter(f"{name}_dy", "m", f"{whose} to starboard of the assumed one", aboard),
    )


def elsewhere(d: Devices) -> Effect:
    """The force acts elsewhere than described."""
    name = f"place_{d.name}"

    @declared(
        d,
        name,
        place_parameters(name, f"place of the {d.label}", d.scale),
        lambda f: f"{d.does('act')} {offset(f, name)} of the place in the model.",
        axis="N",
        formula="N + dx · Y - dy · X",
        symbol="dx, dy",
        sign="positive: ahead and to starboard of the assumed place",
        description=f"the {d.title} acts at another place than assumed",
    )
    def function(f: Thrust, now: Running, dx: Number, dy: Number) -> Thrust:
        for k in d.members:
            f = f._replace(x=with_one(f.x, k, f.x[k] + dx), y=with_one(f.y, k, f.y[k] + dy))
        return f

    return function


def turned(d: Devices) -> Effect:
    """The force points elsewhere than described."""
    name = f"angle_{d.name}"

    @declared(
        d,
        name,
        (
            parameter(
                name, "rad", f"angle of the {d.label} force to starboard of the assumed one", SHARE
            ),
        ),
        lambda f: (
            f"{d.does('act')} {degrees(abs(f[name])):.3g}° to "
            f"{'starboard' if f[name] > 0.0 else 'port'} of the direction in the model."
        ),
        axis="XYN",
        formula="(X cos a - Y sin a, Y cos a + X sin a)",
        symbol="a",
        sign="positive: to starboard",
        linear=False,
        search=Search(differentiable=True),
        usual=MOUNTED,
        description=f"the {d.title} acts in another direction than assumed",
    )
    def function(f: Thrust, now: Running, angle: Number) -> Thrust:
        c, s = cos(angle), sin(angle)
        for k in d.members:
            f = pushed(f, k, f.X[k] * c - f.Y[k] * s, f.Y[k] * c + f.X[k] * s)
        return f

    return function
