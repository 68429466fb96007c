"""The force of the Voith Schneider propellers over their command, other than it is assumed."""

from typing import Annotated

from ..declare import Range
from ..ops import Number, fmax, where
from .actuator import SHARE
from .curve import interpolate, node_parameters
from .effect import Effect, Picture, Running, Search, Thrust, Wording, effect
from .families import PROPELLERS
from .text import SIDES, Found, peak, percent, reach, towards

# Dead bands to try [1], shares of the full command: closer where a small one matters.
COMMAND_DEADBANDS = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4)


def thrust_curve_sentence(f: Found) -> str:
    change = {way: f[f"thrust_curve_{way}"] for way in SIDES["X"]}
    parts = [f"{percent(x)} {'more' if x > 0.0 else 'less'} {way}" for way, x in change.items() if x]
    push = f"push {' and '.join(parts)} than the model believes" if parts else ""
    dead = f["thrust_curve_deadband"]
    still = f"do nothing at commands below {percent(dead)}" if dead else ""
    return f"The propellers {' and '.join(filter(None, (push, still)))}."


@effect(
    "thrust_curve",
    "actuator",
    "X",
    formula="f = f_nominal(c') · (1 + ahead or astern), c' = c less its dead band",
    symbol="ahead, astern, dead band",
    sign="positive: more force than assumed",
    source="(2.10)-(2.12)",
    linear=False,
    needs=("vsp",),
    search=Search(
        tries=[{"thrust_curve_deadband": d} if d else {} for d in COMMAND_DEADBANDS],
        fitted=("thrust_curve_ahead", "thrust_curve_astern"),
    ),
    wording=Wording(thrust_curve_sentence, PROPELLERS, pictures=("VSP surge force over command",)),
)
def thrust_curve(
    f: Thrust,
    now: Running,
    thrust_curve_ahead: Annotated[float, "1", "relative change of the VSP force ahead", SHARE] = 0.0,
    thrust_curve_astern: Annotated[float, "1", "relative change of the VSP force astern", SHARE] = 0.0,
    thrust_curve_deadband: Annotated[
        float, "1", "VSP surge command without effect", Range(0.0, 0.9)
    ] = 0.0,
) -> Thrust:
    """VSP surge force asymmetric and with a dead band over the command."""
    c = now.u_vsp_x
    size = abs(c)
    left = fmax(0.0, size - thrust_curve_deadband) / fmax(size, 1e-9)
    gain = 1.0 + where(c > 0.0, thrust_curve_ahead, thrust_curve_astern)
    return f._replace(vsp_x=f.vsp_x * left * gain)


def surge_curve(f: Thrust, now: Running, *values: Number) -> Thrust:
    """A free addition to the VSP surge force over its command."""
    *nodes, span = values
    return f._replace(vsp_x=f.vsp_x + interpolate(now.u_vsp_x, -span, span, nodes))


def sway_curve(f: Thrust, now: Running, *values: Number) -> Thrust:
    """A free addition to the VSP sway force over its command."""
    *nodes, span = values
    return f._replace(vsp_y=f.vsp_y + interpolate(now.u_vsp_y, -span, span, nodes))


def curve_sentence(f: Found, axis: str) -> str:
    place, value = peak(f)
    at = (2.0 * place - 1.0) * reach(f)
    way = {"X": "push", "Y": "push aside"}[axis]
    return (
        f"The propellers {way} by another curve over their command than the model's: "
        f"{towards(value, 'N', axis)} is missing at command {at:.2g}."
    )


def _curve(axis: str) -> Effect:
    """A free curve of the VSP's force over the command in the same direction."""
    way = {"x": "surge", "y": "sway"}[axis]
    prefix = f"curve_vsp_{axis}_c"
    pictures: dict[str, Picture] = {
        "x": "VSP surge force over command",
        "y": "VSP sway force over command",
    }
    return effect(
        f"curve_vsp_{axis}(c)",
        "actuator",
        {"x": "X", "y": "YN"}[axis],
        formula=f"f_{axis} + Σ c_k · hat_k(u_vsp_{axis}), 21 nodes over [-range, range]",
        symbol="c_1 … c_21",
        sign=f"positive pushes {'ahead' if axis == 'x' else 'to starboard'}",
        source="(2.12); 3.2.3, on a triangle basis",
        settings=(f"{prefix}_range",),
        needs=("vsp",),
        description=f"free addition to the VSP {way} force over its command",
        parameters=node_parameters(prefix, "N", f"VSP {way} force", "command, both ways", "1", 1.0),
        search=Search(smooth=True),
        wording=Wording(
            lambda f: curve_sentence(f, {"x": "X", "y": "Y"}[axis]),
            PROPELLERS,
            pictures=(pictures[axis],),
        ),
    )({"x": surge_curve, "y": sway_curve}[axis])


CURVES = (_curve("x"), _curve("y"))
