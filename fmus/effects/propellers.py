"""What the real ship's propellers do beside their nominal force: across, by the inflow, by power."""

from typing import Annotated

from ..declare import Range
from ..ops import power
from .actuator import SHARE
from .effect import EACH_VSP, Running, Search, Thrust, Wording, effect
from .families import PROPELLERS
from .single_propellers import ASIDE, part, pushed
from .text import Found, number, percent

# Additions to the exponent 1 to try: up to thrust by the square of a setting, as by a propeller's speed.
EXPONENTS = (-0.5, 0.5, 1.0)


def cross_sentence(f: Found) -> str:
    inwards = {True: "to starboard", False: "to port"}
    sway, surge = f["cross_vsp_sway"], f["cross_vsp_surge"]
    parts = [
        f"{percent(sway)} of its surge force {inwards[sway < 0.0]}" if sway else "",
        f"{percent(surge)} of its sway force {'ahead' if surge > 0.0 else 'astern'}" if surge else "",
    ]
    return (
        f"The propeller to port also pushes across its command: {' and '.join(filter(None, parts))}; "
        "that to starboard the other way."
    )


@effect(
    "cross_vsp",
    "actuator",
    "XYN",
    formula="f_y ∓ k_sway f_x, f_x ± k_surge f_y: upper sign to port, lower to starboard",
    symbol="k_sway, k_surge",
    sign="k_sway: pushing ahead drives both outwards; k_surge: to starboard drives the port one ahead",
    source="(2.12); measured runs of the ship",
    needs=("vsp", EACH_VSP),
    wording=Wording(cross_sentence, PROPELLERS, {"attack_point": "turn by one propeller alone"}),
)
def cross_vsp(
    f: Thrust,
    now: Running,
    cross_vsp_sway: Annotated[float, "1", "sway force by a propeller's surge force", SHARE] = 0.0,
    cross_vsp_surge: Annotated[float, "1", "surge force by a propeller's sway force", SHARE] = 0.0,
) -> Thrust:
    """Force of each propeller across its command, mirrored between port and starboard."""
    outwards = part(now, 1) - part(now, 0)
    across = pushed(f, now, 0, cross_vsp_surge * f.vsp_y)
    across = pushed(across, now, 1, -cross_vsp_surge * f.vsp_y)
    return across._replace(vsp_y=f.vsp_y + outwards * cross_vsp_sway * f.vsp_x)


def inflow_sentence(f: Found) -> str:
    u, v, _ = f.speeds
    lost = {"ahead": f["inflow_vsp_x"] * u, "sideways": f["inflow_vsp_y"] * v}
    parts = [
        f"{number(x)} N {'less' if x > 0.0 else 'more'} {way} at {number(at)} m/s"
        for (way, x), at in zip(lost.items(), (u, v), strict=True)
        if x
    ]
    return f"The propellers lose force with the inflow: {', '.join(parts)}, at full command."


@effect(
    "inflow_vsp",
    "actuator",
    "XYN",
    formula="f_x - k_x |c_x| (u - y r), f_y - k_y |c_y| (v + l r), at a propeller's place (l, y)",
    symbol="k_x, k_y",
    sign="positive: less force where the water comes against it",
    source="(2.12): a propeller's force depends on the inflow; measured runs of the ship",
    needs=("vsp", EACH_VSP),
    wording=Wording(
        inflow_sentence, PROPELLERS, {"X_u": "coast, and drive at the same speed", "Y_v": "drift freely"}
    ),
)
def inflow_vsp(
    f: Thrust,
    now: Running,
    inflow_vsp_x: Annotated[float, "N.s/m", "surge force lost by the inflow, full command"] = 0.0,
    inflow_vsp_y: Annotated[float, "N.s/m", "sway force lost by the inflow, full command"] = 0.0,
) -> Thrust:
    """Force of the propellers that is lost with the water's speed at their place."""
    slowed = f._replace(vsp_y=f.vsp_y - inflow_vsp_y * abs(now.u_vsp_y) * (now.v + now.l_vsp * now.r))
    for k, aside in enumerate(ASIDE):
        slowed = pushed(slowed, now, k, -inflow_vsp_x * abs(now.u_vsp_x) * (now.u - aside * now.r))
    return slowed


def exponent_sentence(f: Found) -> str:
    found = {"propellers": f["exponent_vsp"], "bow thruster": f["exponent_bow"]}
    parts = [f"of the {who} is {number(1.0 + x)}" for who, x in found.items() if x]
    return f"Thrust is no straight line over the power setting: the exponent {', '.join(parts)}."


@effect(
    "power_exponent",
    "actuator",
    "XYN",
    formula="f · setting^e, so that thrust ∝ setting^(1 + e)",
    symbol="e",
    sign="positive: less force at part power",
    source="measured runs of the ship; thrust of a propeller by the square of its speed, (2.11)",
    linear=False,
    needs=("vsp", EACH_VSP),
    search=Search(
        tries=[
            {"exponent_vsp": vsp, "exponent_bow": bow}
            for vsp in (0.0, *EXPONENTS)
            for bow in (0.0, *EXPONENTS)
            if vsp or bow
        ]
    ),
    wording=Wording(exponent_sentence, PROPELLERS),
)
def power_exponent(
    f: Thrust,
    now: Running,
    exponent_vsp: Annotated[
        float, "1", "exponent of the VSP's power setting, less 1", Range(-0.9, 2.0)
    ] = 0.0,
    exponent_bow: Annotated[
        float, "1", "exponent of the bow thruster's power setting, less 1", Range(-0.9, 2.0)
    ] = 0.0,
) -> Thrust:
    """Exponent of the power settings by which the thrust is scaled."""
    vsp = power(now.power_vsp, exponent_vsp)
    return f._replace(
        vsp_x=vsp * f.vsp_x,
        vsp_y=vsp * f.vsp_y,
        turn=vsp * f.turn,
        bow=f.bow * power(now.power_bow, exponent_bow),
    )
