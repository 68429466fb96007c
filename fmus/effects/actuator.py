"""What the thrusters lose of the force that they are commanded to give."""

from typing import Annotated

from ..declare import POSITIVE, Range
from ..ops import Number, clip, fmax, where
from .curve import interpolate, node_parameters
from .effect import Running, Search, Thrust, Values, Wording, effect
from .families import BOW_THRUSTER, PROPELLERS, SIDE_THRUST, SMALL_OR_LARGE
from .text import Found, capital, lost, number, offset, peak, percent, reach

SHARE = Range(-1.0, 1.0)
ABOARD = Range(-0.6, 0.6)  # the ship is 1.1 m long
# s/m to try: from an effect that is small at full speed to a bow thruster that is dead at 0.07 m/s.
SPEED_LOSSES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 15.0)
# N to try, up to a quarter of full force.
DEADBANDS = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.13, 0.17, 0.22, 0.3)
LIMITS = (0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)  # shares of full force to try


@effect(
    "loss_vsp",
    "actuator",
    "XYN",
    formula="f_vsp (1 - δ)",
    symbol="δ",
    sign="positive: force is lost",
    source="(2.39), on one thruster",
    needs=("vsp",),
    wording=Wording(
        lost(
            "loss_vsp",
            "The propellers give {} less force than the model believes.",
            "The propellers give {} more force than the model believes.",
        ),
        PROPELLERS,
    ),
)
def loss_vsp(
    f: Thrust, now: Running, loss_vsp: Annotated[float, "1", "share of VSP force lost", SHARE] = 0.0
) -> Thrust:
    """Force lost by the Voith Schneider propellers."""
    left = 1.0 - loss_vsp
    return f._replace(vsp_x=f.vsp_x * left, vsp_y=f.vsp_y * left, turn=f.turn * left)


@effect(
    "loss_bow",
    "actuator",
    "YN",
    formula="f_bow (1 - δ)",
    symbol="δ",
    sign="positive: force is lost",
    source="(2.39), on one thruster",
    needs=("bow",),
    wording=Wording(
        lost(
            "loss_bow",
            "The bow thruster gives {} less force than the model believes.",
            "The bow thruster gives {} more force than the model believes.",
        ),
        BOW_THRUSTER,
        {
            "bow_speed_loss": "use the bow thruster at rest and at speed",
            "bow_failure": "use the bow thruster from the very start of a run to its end",
        },
    ),
)
def loss_bow(
    f: Thrust, now: Running, loss_bow: Annotated[float, "1", "share of bow force lost", SHARE] = 0.0
) -> Thrust:
    """Force lost by the bow thruster."""
    return f._replace(bow=f.bow * (1.0 - loss_bow))


@effect(
    "bow_speed_loss",
    "actuator",
    "YN",
    formula="f_bow max(0, 1 - k |u|)",
    symbol="k",
    sign="positive: less force at speed",
    source="6.4.4, after Skjetne et al. 2004",
    linear=False,
    needs=("bow",),
    search=Search(tries=[{"bow_speed_loss": k} for k in SPEED_LOSSES]),
    wording=Wording(
        lambda f: (
            "The bow thruster loses force with the speed: "
            f"{percent(min(1.0, f['bow_speed_loss'] * f.speeds[0]))} of it at {f.speeds[0]:.2g} m/s."
        ),
        BOW_THRUSTER,
        pictures=("bow effectiveness over surge speed",),
    ),
)
def bow_speed_loss(
    f: Thrust,
    now: Running,
    bow_speed_loss: Annotated[float, "s/m", "bow effectiveness lost with surge speed", POSITIVE] = 0.0,
) -> Thrust:
    """Bow thruster less effective with surge speed."""
    return f._replace(bow=f.bow * fmax(0.0, 1.0 - bow_speed_loss * abs(now.u)))


@effect(
    "curve_bow(|u|)",
    "actuator",
    "YN",
    formula="f_bow (1 + Σ c_k · hat_k(|u|)), 21 nodes over [0, range]",
    symbol="c_1 … c_21",
    sign="positive: more force than assumed",
    source="6.4.4; 3.2.3, on a triangle basis",
    settings=("curve_bow_u_range",),
    needs=("bow",),
    parameters=node_parameters(
        "curve_bow_u", "1", "change of bow effectiveness", "surge speed", "m/s", 0.6
    ),
    search=Search(smooth=True),
    wording=Wording(
        lambda f: (
            "The bow thruster's force changes with the speed: "
            f"{percent(peak(f)[1])} {'less' if peak(f)[1] < 0.0 else 'more'} than the model believes "
            f"at {peak(f)[0] * reach(f):.2g} m/s."
        ),
        BOW_THRUSTER,
        pictures=("bow effectiveness over surge speed",),
    ),
)
def bow_curve(f: Thrust, now: Running, *values: Number) -> Thrust:
    """free change of the bow thruster's effectiveness over the surge speed"""
    *nodes, span = values
    return f._replace(bow=f.bow * (1.0 + interpolate(abs(now.u), 0.0, span, nodes)))


@effect(
    "bow_failure",
    "actuator",
    "YN",
    formula="f_bow = 0 for t >= time",
    symbol="time",
    sign="0: never",
    source="7.2.5",
    linear=False,
    needs=("bow",),
    search=Search(intervals=(("bow_failure_time", ""),)),
    wording=Wording(
        lambda f: f"The bow thruster is dead from t = {number(f['bow_failure_time'])} s on.",
        BOW_THRUSTER,
    ),
)
def bow_failure(
    f: Thrust,
    now: Running,
    bow_failure_time: Annotated[float, "s", "time from which the bow is dead; 0: never", POSITIVE] = 0.0,
) -> Thrust:
    """Bow thruster dead from a time on."""
    dead = (bow_failure_time > 0.0) & (now.t >= bow_failure_time - 1e-9)
    return f._replace(bow=where(dead, 0.0, f.bow))


def reduced(f: Number, d: Number) -> Number:
    """A force without what lies below d [N], and less by d above."""
    return f - clip(f, -d, d)


@effect(
    "deadband",
    "actuator",
    "XYN",
    formula="f - clip(f, -d, d) for each thruster",
    symbol="d",
    sign="forces below d are lost, the rest is reduced by d",
    source="7.2.5; static tests of the ship",
    linear=False,
    needs=("vsp", "bow"),
    search=Search(tries=[{"deadband": d} for d in DEADBANDS]),
    wording=Wording(
        lambda f: (
            f"Each thruster gives nothing below {number(f['deadband'])} N, "
            f"and {number(f['deadband'])} N less above."
        ),
        SMALL_OR_LARGE,
        pictures=("VSP force given over commanded", "bow force given over commanded"),
    ),
)
def deadband(
    f: Thrust,
    now: Running,
    deadband: Annotated[float, "N", "thruster force without effect", POSITIVE] = 0.0,
) -> Thrust:
    """Dead band of every thruster."""
    return f._replace(
        vsp_x=reduced(f.vsp_x, deadband), vsp_y=reduced(f.vsp_y, deadband), bow=reduced(f.bow, deadband)
    )


def limited(f: Number, limit: Number) -> Number:
    """A force within ±limit [N], where 0 means no limit."""
    return where(limit > 0.0, clip(f, -limit, limit), f)


def limits(nominal: Values) -> list[Values]:
    """Limits [N] to try on one kind of thruster."""
    full = {"saturation_vsp": nominal["plant_F_vsp"], "saturation_bow": nominal["plant_F_bow"]}
    return [{name: share * force} for name, force in full.items() for share in LIMITS]


def saturation_sentence(f: Found) -> str:
    who = {"saturation_vsp": "propellers give", "saturation_bow": "bow thruster gives"}
    parts = [f"the {who[name]} at most {number(x)} N" for name, x in f.values.items() if x]
    return capital(f"{' and '.join(parts)}, whatever is commanded.")


@effect(
    "saturation",
    "actuator",
    "XYN",
    formula="clip(f, -limit, limit)",
    symbol="limits",
    sign="0: no limit",
    source="2.1.1",
    linear=False,
    needs=("vsp", "bow"),
    search=Search(tries=limits),
    wording=Wording(
        saturation_sentence,
        SMALL_OR_LARGE,
        pictures=("VSP force given over commanded", "bow force given over commanded"),
    ),
)
def saturation(
    f: Thrust,
    now: Running,
    saturation_vsp: Annotated[float, "N", "real limit of the VSP force; 0: none", POSITIVE] = 0.0,
    saturation_bow: Annotated[float, "N", "real limit of the bow force; 0: none", POSITIVE] = 0.0,
) -> Thrust:
    """Real limits lower than those of the commands."""
    return f._replace(
        vsp_x=limited(f.vsp_x, saturation_vsp),
        vsp_y=limited(f.vsp_y, saturation_vsp),
        bow=limited(f.bow, saturation_bow),
    )


@effect(
    "loss_surge",
    "actuator",
    "X",
    formula="X_act = (1 - δ) X_cmd",
    symbol="δ",
    sign="positive: force is lost",
    source="(2.39), (7.3)-(7.6)",
    wording=Wording(
        lost(
            "loss_surge",
            "Of the commanded surge force {} do not arrive.",
            "The surge force is {} larger than commanded.",
        ),
        PROPELLERS,
        {"X_u": "pulse the speed instead of keeping it", "mass": "run steady and accelerating legs"},
    ),
)
def loss_surge(
    f: Thrust, now: Running, loss_surge: Annotated[float, "1", "share of surge force lost", SHARE] = 0.0
) -> Thrust:
    """Force lost in surge."""
    return f._replace(loss_X=f.loss_X + loss_surge)


@effect(
    "loss_sway",
    "actuator",
    "Y",
    formula="Y_act = (1 - δ) Y_cmd",
    symbol="δ",
    sign="positive: force is lost",
    source="(2.39), (7.3)-(7.6)",
    wording=Wording(
        lost(
            "loss_sway",
            "Of the commanded sway force {} do not arrive.",
            "The sway force is {} larger than commanded.",
        ),
        SIDE_THRUST,
        {"Y_r": "crab to both sides with no turn"},
    ),
)
def loss_sway(
    f: Thrust, now: Running, loss_sway: Annotated[float, "1", "share of sway force lost", SHARE] = 0.0
) -> Thrust:
    """Force lost in sway."""
    return f._replace(loss_Y=f.loss_Y + loss_sway)


@effect(
    "loss_yaw",
    "actuator",
    "N",
    formula="N_act = (1 - δ) N_cmd",
    symbol="δ",
    sign="positive: moment is lost",
    source="(2.39), (7.3)-(7.6)",
    wording=Wording(
        lost(
            "loss_yaw",
            "Of the commanded yaw moment {} do not arrive.",
            "The yaw moment is {} larger than commanded.",
        ),
        SIDE_THRUST,
        {"N_r": "turn on the spot, with starts and stops of the turn"},
    ),
)
def loss_yaw(
    f: Thrust, now: Running, loss_yaw: Annotated[float, "1", "share of yaw moment lost", SHARE] = 0.0
) -> Thrust:
    """Moment lost in yaw."""
    return f._replace(loss_N=f.loss_N + loss_yaw)


@effect(
    "attack_point",
    "actuator",
    "N",
    formula="N + dx · Y - dy · X",
    symbol="dx, dy",
    sign="positive: ahead and to starboard of where it is assumed",
    source="(2.17)-(2.19)",
    wording=Wording(
        lambda f: f"The thrust acts {offset(f, 'attack_point')} of where the model believes.",
        SIDE_THRUST,
    ),
)
def attack_point(
    f: Thrust,
    now: Running,
    attack_point_dx: Annotated[float, "m", "point of attack forward of the assumed one", ABOARD] = 0.0,
    attack_point_dy: Annotated[
        float, "m", "point of attack to starboard of the assumed one", ABOARD
    ] = 0.0,
) -> Thrust:
    """The force acts elsewhere than assumed."""
    return f._replace(dx=f.dx + attack_point_dx, dy=f.dy + attack_point_dy)
