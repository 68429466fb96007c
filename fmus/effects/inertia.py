"""A heavier ship, or more water that moves with it."""

from collections.abc import Callable
from typing import Annotated

from ..declare import Range
from ..hull import Inertia
from .effect import Search, Values, Wording, effect
from .families import INERTIA
from .text import Found, number

_SIGN = "positive is heavier"
_SOURCE = "(2.5)-(2.7), corrected"


def half(name: str, moving: Callable[[Values], float]) -> Search:
    """A much heavier ship is not a little heavier one many times: tried is half of what moves, too."""
    return Search(differentiable=True, tries=lambda nominal: [{name: 0.5 * moving(nominal)}])


def water_sentence(name: str, how: str, unit: str) -> Callable[[Found], str]:
    def sentence(f: Found) -> str:
        sense = "larger" if f[name] > 0.0 else "smaller"
        size = f"{number(f[name])} {unit}"
        return f"The added mass in {how} is {size} {sense} than in the model."

    return sentence


@effect(
    "mass",
    "inertia",
    "XYN",
    formula="m + Δm, I_z (1 + Δm/m), in M and C(nu)",
    symbol="Δm",
    sign=_SIGN,
    source=_SOURCE,
    search=half("mass", lambda p: p["m"]),
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


@effect(
    "added_mass_X",
    "inertia",
    "XN",
    formula="X_udot - Δ, in M and C(nu)",
    symbol="Δ",
    sign=_SIGN,
    source=_SOURCE,
    search=half("added_mass_X", lambda p: p["m"] - p["X_udot"]),
    wording=Wording(water_sentence("added_mass_X", "surge", "kg"), INERTIA),
)
def added_mass_X(
    i: Inertia,
    added_mass_X: Annotated[float, "kg", "additional added mass in surge", Range(-5.0, 100.0)] = 0.0,
) -> Inertia:
    """More water that moves along in surge."""
    return i._replace(X_udot=i.X_udot - added_mass_X)


@effect(
    "added_mass_Y",
    "inertia",
    "XYN",
    formula="Y_vdot - Δ, in M and C(nu)",
    symbol="Δ",
    sign=_SIGN,
    source=_SOURCE,
    search=half("added_mass_Y", lambda p: p["m"] - p["Y_vdot"]),
    wording=Wording(water_sentence("added_mass_Y", "sway", "kg"), INERTIA),
)
def added_mass_Y(
    i: Inertia,
    added_mass_Y: Annotated[float, "kg", "additional added mass in sway", Range(-10.0, 100.0)] = 0.0,
) -> Inertia:
    """More water that moves along in sway."""
    return i._replace(Y_vdot=i.Y_vdot - added_mass_Y)


@effect(
    "added_mass_N",
    "inertia",
    "N",
    formula="N_rdot - Δ, in M",
    symbol="Δ",
    sign=_SIGN,
    source=_SOURCE,
    search=half("added_mass_N", lambda p: p["I_z"] - p["N_rdot"]),
    wording=Wording(water_sentence("added_mass_N", "yaw", "kg m2"), INERTIA),
)
def added_mass_N(
    i: Inertia,
    added_mass_N: Annotated[float, "kg.m2", "additional added inertia in yaw", Range(-1.0, 100.0)] = 0.0,
) -> Inertia:
    """More water that turns along in yaw."""
    return i._replace(N_rdot=i.N_rdot - added_mass_N)
