"""A heavier ship, or more water that moves with it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

from ..declare import Range, Variable
from ..hull import Inertia
from .effect import Effect, Search, Values, Wording, effect
from .families import INERTIA
from .text import Found, number

_SIGN = "positive is heavier"
_SOURCE = "(2.5)-(2.7), corrected"


def half(name: str, moving: Callable[[Values], float]) -> Search:
    """A much heavier ship is not a little heavier one many times: tried is half of what moves, too."""
    return Search(differentiable=True, tries=lambda nominal: [{name: 0.5 * moving(nominal)}])


@effect(
    "mass",
    "inertia",
    "XYN",
    formula="m + Δm, I_z (1 + Δm/m), in M and C(nu)",
    symbol="Δm",
    sign=_SIGN,
    source=_SOURCE,
    search=replace(half("mass", lambda p: p["m"]), of_each_run=True),
    wording=Wording(
        lambda f: (
            f"The ship has {number(f['mass'])} kg {'more' if f['mass'] > 0.0 else 'less'} mass than the "
            "model."
        ),
        INERTIA,
        measured=lambda more, model: f"a ship of {model('m') + more:.4g} kg: weigh it",
    ),
)
def mass(
    i: Inertia, mass: Annotated[float, "kg", "additional mass", Range(-10.0, 100.0)] = 0.0
) -> Inertia:
    """Additional mass; the moment of inertia grows in proportion."""
    return i._replace(m=i.m + mass, I_z=i.I_z * (1.0 + mass / i.m))


@effect(
    "centre_of_gravity",
    "inertia",
    "XYN",
    formula="x_g + Δ, in M and C(nu)",
    symbol="Δ",
    sign="positive: ahead of the assumed place",
    source=_SOURCE,
    search=Search(differentiable=True),
    wording=Wording(
        lambda f: (
            f"The centre of gravity is {number(abs(f['centre_of_gravity']))} m further "
            f"{'ahead' if f['centre_of_gravity'] > 0.0 else 'astern'} than in the model."
        ),
        INERTIA,
    ),
)
def centre_of_gravity(
    i: Inertia,
    centre_of_gravity: Annotated[
        float, "m", "centre of gravity ahead of the assumed place", Range(-0.3, 0.3)
    ] = 0.0,
) -> Inertia:
    """The centre of gravity at another place, as by a load fore or aft."""
    return i._replace(x_g=i.x_g + centre_of_gravity)


def _water(
    axis: str, axes: str, own: str, derivative: str, where: str, unit: str, text: str, least: float
) -> Effect:
    """More water that moves along on one axis.

    Args:
        axis, axes: the axis, and those on which its force acts.
        own, derivative: names of the ship's own inertia and of the added one, which is negative.
        where: the matrices that it is in.
        unit, text, least: of the parameter, with its lowest value.
    """
    name, how = f"added_mass_{axis}", {"X": "surge", "Y": "sway", "N": "yaw"}[axis]

    def sentence(f: Found) -> str:
        sense = "larger" if f[name] > 0.0 else "smaller"
        size = f"{number(f[name])} {unit.replace('.', ' ')}"
        return f"The added mass in {how} is {size} {sense} than in the model."

    @effect(
        name,
        "inertia",
        axes,
        formula=f"{derivative} - Δ, in {where}",
        symbol="Δ",
        sign=_SIGN,
        source=_SOURCE,
        search=half(name, lambda p: p[own] - p[derivative]),
        wording=Wording(sentence, INERTIA),
        parameters=(Variable(name, unit, f"additional {text} in {how}", 0.0, Range(least, 100.0)),),
        description=f"More water that {'turns' if axis == 'N' else 'moves'} along in {how}.",
    )
    def function(i: Inertia, extra: float) -> Inertia:
        return i._replace(**{derivative: getattr(i, derivative) - extra})

    return function


surge_water = _water("X", "XN", "m", "X_udot", "M and C(nu)", "kg", "added mass", -5.0)
sway_water = _water("Y", "XYN", "m", "Y_vdot", "M and C(nu)", "kg", "added mass", -10.0)
yaw_water = _water("N", "N", "I_z", "N_rdot", "M", "kg.m2", "added inertia", -1.0)
