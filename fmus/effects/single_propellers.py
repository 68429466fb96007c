"""One of the two Voith Schneider propellers differs: its loss, and free curves over its commands.

VSP 1 sits to port and VSP 2 to starboard of the middle, so that the surge force of each turns the ship.
Where the two have commands of their own, each is a set of thrusters at its place. Where one set stands
for both, as in the FMU, each propeller is half of it: the same change of both is a change of the set.
"""

from collections.abc import Callable
from typing import Annotated, Any

from ..ops import Number, sign
from .actuator import SHARE
from .curve import interpolate, node_parameters
from .effect import EACH_VSP, Effect, Picture, Running, Search, Thrust, Wording, effect
from .families import PROPELLERS
from .text import Found, lost, peak, reach, towards

ASIDE = (-0.055, 0.055)  # m; to starboard: where the two VSP sit (inferred from data)
SIDES = ("to port", "to starboard")
PICTURES: dict[tuple[int, str], Picture] = {
    (0, "x"): "surge force of VSP 1 over its command",
    (0, "y"): "sway force of VSP 1 over its command",
    (1, "x"): "surge force of VSP 2 over its command",
    (1, "y"): "sway force of VSP 2 over its command",
}


def part(now: Running, k: int) -> Number:
    """Share of a set's propellers that is VSP k + 1: all, none, or half where it stands for both."""
    return 0.5 + 0.5 * sign(now.aside * ASIDE[k])


def pushed(f: Thrust, now: Running, k: int, extra: Number) -> Thrust:
    """The forces with more surge force [N] of VSP k + 1, which turns the ship by its place."""
    given = part(now, k) * extra
    return f._replace(vsp_x=f.vsp_x + given, turn=f.turn - (ASIDE[k] - now.aside) * given)


def curve_function(k: int, axis: str) -> Callable[..., Thrust]:
    """The function of a free curve of VSP k + 1."""

    def surge(f: Thrust, now: Running, *values: Number) -> Thrust:
        *nodes, span = values
        return pushed(f, now, k, interpolate(now.u_vsp_x, -span, span, nodes))

    def sway(f: Thrust, now: Running, *values: Number) -> Thrust:
        *nodes, span = values
        return f._replace(vsp_y=f.vsp_y + part(now, k) * interpolate(now.u_vsp_y, -span, span, nodes))

    return {"x": surge, "y": sway}[axis]


def curve_sentence(f: Found, k: int, axis: str) -> str:
    place, value = peak(f)
    at = (2.0 * place - 1.0) * reach(f)
    way = {"X": "pushes", "Y": "pushes aside"}[axis]
    return (
        f"The propeller {SIDES[k]} (VSP {k + 1}) {way} by another curve over its command than the "
        f"model's: {towards(value, 'N', axis)} is missing at command {at:.2g}."
    )


def _curve(k: int, axis: str) -> Effect:
    """A free curve of one propeller's force over its command in the same direction."""
    way, name = {"x": "surge", "y": "sway"}[axis], f"vsp{k + 1}_{axis}"
    prefix, one = f"curve_{name}_c", f"VSP {k + 1} {way}"
    return effect(
        f"curve_{name}(c)",
        "actuator",
        {"x": "XN", "y": "YN"}[axis],
        formula=f"f_{axis} of VSP {k + 1} + Σ c_k · hat_k(its command), 21 nodes over [-range, range]",
        symbol="c_1 … c_21",
        sign=f"positive pushes {'ahead' if axis == 'x' else 'to starboard'}",
        source="(2.12); 3.2.3, on a triangle basis",
        settings=(f"{prefix}_range",),
        needs=("vsp", EACH_VSP),
        description=f"free addition to the {way} force of VSP {k + 1}, {SIDES[k]}, over its command",
        parameters=node_parameters(prefix, "N", f"{one} force", "command, both ways", "1", 1.0),
        search=Search(smooth=True),
        wording=Wording(
            lambda f: curve_sentence(f, k, axis.upper()), PROPELLERS, pictures=(PICTURES[k, axis],)
        ),
    )(curve_function(k, axis))


CURVES = tuple(_curve(k, axis) for k in (0, 1) for axis in "xy")


def without(f: Thrust, now: Running, k: int, loss: Any) -> Thrust:
    """The forces less a share of those of VSP k + 1."""
    less = f._replace(vsp_y=f.vsp_y * (1.0 - part(now, k) * loss))
    return pushed(less, now, k, -loss * f.vsp_x)


def _loss(k: int) -> dict[str, Any]:
    """What the losses of the two propellers declare."""
    who = f"The propeller {SIDES[k]} (VSP {k + 1}) gives {{}}"
    name = f"loss_vsp{k + 1}"
    return {
        "id": name,
        "kind": "actuator",
        "axis": "XYN",
        "formula": f"f of VSP {k + 1} (1 - δ)",
        "symbol": "δ",
        "sign": "positive: force is lost; negative: more power than is known",
        "source": "(2.39), on one propeller",
        "needs": ("vsp", EACH_VSP),
        "wording": Wording(
            lost(
                name,
                who + " less force than the model believes.",
                who + " more force than the model believes.",
            ),
            PROPELLERS,
        ),
    }


@effect(**_loss(0))
def loss_vsp1(
    f: Thrust, now: Running, loss_vsp1: Annotated[float, "1", "share of VSP 1 force lost", SHARE] = 0.0
) -> Thrust:
    """Force lost by the propeller to port, VSP 1: power that is not known."""
    return without(f, now, 0, loss_vsp1)


@effect(**_loss(1))
def loss_vsp2(
    f: Thrust, now: Running, loss_vsp2: Annotated[float, "1", "share of VSP 2 force lost", SHARE] = 0.0
) -> Thrust:
    """Force lost by the propeller to starboard, VSP 2: power that is not known."""
    return without(f, now, 1, loss_vsp2)
