"""What may go wrong with the thrusters of CyberShip Enterprise 1.

VSP 1 sits to port and VSP 2 to starboard of the middle, so that the surge force of each turns the ship.
Where one set of commands stands for both, as in the FMU, each has half of the force: the same change of
both is a change of the set.
"""

from typing import Annotated

from ..declare import Range
from ..ops import power
from .all_thrusters import attack_point, loss_surge, loss_sway, loss_yaw
from .devices import SHARE, Devices, added, changed, parameter
from .effect import APART, Running, Search, Thrust, Wording, effect
from .families import BOW_THRUSTER, PROPELLERS, SMALL_OR_LARGE
from .lost_force import Inflow, deadband, failure, inflow, loss, outage, saturation, speed_loss
from .own_curves import ALONG, force_curve, speed_curve, thrust_curve
from .text import Found, number, percent

ASIDE = (-0.055, 0.055)  # m; to starboard: where the two VSP sit (inferred from data)
PORT, STARBOARD, BOW = 0, 1, 2  # numbers of the thrusters
F_VSP, F_BOW = 1.165, 2.629  # N; full force, Table 2.1
# Additions to the exponent 1 to try: up to thrust by the square of a setting, as by a propeller's speed.
EXPONENTS = (-0.5, 0.5, 1.0)

vsp = Devices(
    "vsp",
    "propellers",
    "VSP",
    (PORT, STARBOARD),
    ((0, 1), (2, 3)),
    "XYN",
    PROPELLERS,
    F_VSP,
    "plant_F_vsp",
    plural=True,
    needs=frozenset({"vsp"}),
)
vsp1, vsp2 = (
    vsp._replace(
        name=f"vsp{k + 1}",
        title=f"propeller {side} (VSP {k + 1})",
        label=f"VSP {k + 1}",
        members=(k,),
        commands=vsp.commands[k : k + 1],
        plural=False,
        needs=frozenset({"vsp", APART}),
    )
    for k, side in enumerate(("to port", "to starboard"))
)
bow = Devices(
    "bow",
    "bow thruster",
    "bow",
    (BOW,),
    ((4, 4),),
    "YN",
    BOW_THRUSTER,
    F_BOW,
    "plant_F_bow",
    needs=frozenset({"bow"}),
)
thrusters = Devices(
    "",
    "thrusters",
    "thruster",
    (PORT, STARBOARD, BOW),
    (*vsp.commands, *bow.commands),
    "XYN",
    SMALL_OR_LARGE,
    F_VSP,
    plural=True,
    needs=frozenset({"vsp", "bow"}),
)


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
    needs=vsp1.needs,
    wording=Wording(cross_sentence, PROPELLERS, {"attack_point": "turn by one propeller alone"}),
)
def cross_vsp(
    f: Thrust,
    now: Running,
    cross_vsp_sway: Annotated[float, "1", "sway force by a propeller's surge force", SHARE] = 0.0,
    cross_vsp_surge: Annotated[float, "1", "surge force by a propeller's sway force", SHARE] = 0.0,
) -> Thrust:
    """Force of each propeller across its command, mirrored between port and starboard."""
    for k, way in ((PORT, 1.0), (STARBOARD, -1.0)):
        X, Y = f.X[k], f.Y[k]
        f = added(f, [k], "X", way * cross_vsp_surge * Y)
        f = added(f, [k], "Y", -way * cross_vsp_sway * X)
    return f


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
    needs=vsp1.needs,
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
    for d, exponent in ((vsp, exponent_vsp), (bow, exponent_bow)):
        gain = power(now.power[d.members[0]], exponent)
        f = changed(f, d.members, lambda x, gain=gain: gain * x)
    return f


# They act in this order.
EFFECTS = (
    thrust_curve(vsp),
    *[force_curve(d, axis) for d in (vsp, vsp1, vsp2) for axis in "XY"],
    loss(vsp1, others=False),
    loss(vsp2, others=False),
    cross_vsp,
    inflow(
        vsp._replace(needs=vsp1.needs),
        [
            Inflow(
                parameter(
                    f"inflow_vsp_{axis.lower()}",
                    "N.s/m",
                    f"{way} force lost by the inflow, full command",
                ),
                axis,
                axis,
            )
            for axis, way in ALONG.items()
        ],
        {"X_u": "coast, and drive at the same speed", "Y_v": "drift freely"},
    ),
    power_exponent,
    loss(vsp, others=False),
    loss(bow),
    speed_loss(bow),
    speed_curve(bow),
    failure(bow),
    deadband(thrusters, (vsp, bow), "deadband"),
    saturation((vsp, bow), thrusters, "saturation"),
    loss_surge,
    loss_sway,
    loss_yaw,
    attack_point,
    outage(bow, "bow_failure"),
    outage(vsp),
)
