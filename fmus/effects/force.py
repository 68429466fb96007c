"""Forces by the ship's motion: a change of each damping coefficient, and a free curve over speed."""

from math import degrees

from ..declare import Variable, variables
from ..hull import Damping, Triple, product, term_force
from ..ops import Number
from .curve import interpolate, node_parameters
from .effect import Effect, Motion, Picture, Search, Wording, effect
from .families import (
    SURGE_BY_TURNING,
    SURGE_DRAG,
    SWAY_AT_SPEED,
    SWAY_BY_TURNING,
    SWAY_DRAG,
    UNKNOWN,
    YAW_AT_SPEED,
    YAW_BY_DRIFT,
    YAW_DRAG,
    Family,
)
from .text import Found, number, peak, reach, towards

_MEMBERS: dict[str, Family] = {
    "X_u X_|u|u X_uuu X_uu": SURGE_DRAG,
    "X_|u|r X_vr X_vv X_rr": SURGE_BY_TURNING,
    "Y_v Y_|v|v Y_vvv": SWAY_DRAG,
    "Y_r Y_|r|r Y_|r|v Y_|v|r": SWAY_BY_TURNING,
    "Y_ur Y_uv": SWAY_AT_SPEED,
    "N_r N_|r|r": YAW_DRAG,
    "N_v N_|v|v N_|r|v N_|v|r": YAW_BY_DRIFT,
    "N_ur N_uv": YAW_AT_SPEED,
}
FAMILY = {name: family for names, family in _MEMBERS.items() for name in names.split()}
APART = {
    "X_u": {
        "X_|u|u": "run three or more speeds, from very slow to full",
        "body_bias": "run astern as well",
    },
    "N_r": {"N_ur": "turn on the spot, and at speed"},
    "N_v": {"N_uv": "drift purely sideways, with no speed ahead"},
}
# Of each axis the velocity along it, and what its damping is called.
DRAG = {"X": ("u", "surge drag"), "Y": ("v", "sway drag"), "N": ("r", "resistance to turning")}
MOTION = {
    "u": "Going ahead",
    "v": "Drifting sideways",
    "r": "Turning",
    "uv": "Drifting sideways while going ahead",
    "ru": "Turning while going ahead",
    "rv": "Turning while drifting sideways",
    "ruv": "Turning while going ahead and drifting sideways",
}


def damping_sentence(f: Found) -> str:
    """A damping-like term, as a force at the speeds that the ship reached."""
    axis, _, term = f.effect.id.partition("_")
    moved = "".join(sorted(set(term) - {"|"}))
    u, v, r = f.speeds
    force = float(f.effect(Motion(u=u, v=v, r=r), *f.values.values())["XYN".index(axis)])
    unit = "N m" if axis == "N" else "N"
    own, drag = DRAG[axis]
    if moved == own and term != "uu":
        sense = "more" if force < 0.0 else "less"
        at = _at(moved, f.speeds)
        return f"The ship has {sense} {drag} than the model: {number(force)} {unit} {sense} at {at}."
    at = _at(moved, f.speeds, sides=True)
    what = "a moment" if axis == "N" else "a force"
    size = towards(force, unit, axis)
    return f"{MOTION[moved]} gives {what} that the model lacks: {size} at {at}."


def _at(moved: str, speeds: tuple[float, float, float], sides: bool = False) -> str:
    """The speeds that count, such as ``0.1 m/s ahead and 6°/s to starboard``."""
    u, v, r = speeds
    parts = {"u": (f"{u:.2g} m/s", "ahead"), "v": (f"{v:.2g} m/s", "to starboard")}
    parts["r"] = (f"{degrees(r):.2g}°/s", "to starboard")
    return " and ".join(" ".join(parts[m][: 1 + sides]) for m in "uvr" if m in moved)


def change(coefficient: Variable) -> Effect:
    """The effect that changes the coefficient of a product of speeds."""
    axis, term = coefficient.name[0], product(coefficient.name)
    name = f"{axis}_{term}"
    text = f"addition to {coefficient.name}"
    delta = Variable(f"delta_{coefficient.name}", coefficient.unit, text, 0.0)

    @effect(
        name,
        "force",
        axis,
        formula=f"{axis} = Δ{name} · {term}",
        symbol=f"Δ{name}",
        sign="an addition on the side of the forces",
        source="(2.8)-(2.9), corrected",
        description=f"addition to {coefficient.name}: {coefficient.description}",
        parameters=(delta,),
        gives=coefficient.name,
        adds_to={delta.name: (coefficient.name,)},
        search=Search(of_each_run=name == "X_|u|u"),  # a hull is fouled, or cleaned
        wording=Wording(damping_sentence, FAMILY.get(name, UNKNOWN), APART.get(name, {})),
    )
    def force(ship: Motion, delta: Number) -> Triple:
        return term_force(coefficient.name, delta, ship.u, ship.v, ship.r)

    return force


# In the order of Damping.
CHANGES = tuple([change(coefficient) for coefficient in variables(Damping)])


def surge_curve_sentence(f: Found) -> str:
    place, value = peak(f)
    at = (2.0 * place - 1.0) * reach(f)
    return (
        "The surge force over the speed differs from the model, most by "
        f"{towards(value, 'N', 'X')} at {at:.2g} m/s."
    )


@effect(
    "curve_X(u)",
    "force",
    "X",
    formula="X = Σ c_k · hat_k(u), 21 nodes over [-range, range]",
    symbol="c_1 … c_21",
    sign="positive acts ahead",
    source="3.2.3, on a triangle basis",
    settings=("curve_X_u_range",),
    parameters=node_parameters("curve_X_u", "N", "surge force", "surge speed, both ways", "m/s", 0.6),
    search=Search(smooth=True),
    wording=Wording(surge_curve_sentence, SURGE_DRAG, pictures=(Picture("damping over speed"),)),
)
def surge_force_curve(ship: Motion, *values: Number) -> Triple:
    """free surge force over the surge speed"""
    *nodes, span = values
    return interpolate(ship.u, -span, span, nodes), 0.0, 0.0
