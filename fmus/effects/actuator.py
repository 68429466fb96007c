"""What the thrusters really do, as against what they are asked for."""

from collections.abc import Callable
from typing import Annotated

from ..declare import POSITIVE, Range, Variable
from ..ops import Number, clip, fmax, where
from .curve import interpolate, node_parameters
from .registry import Effect, Running, Thrust, add, effect

SHARE = Range(-1.0, 1.0)
ABOARD = Range(-0.6, 0.6)  # the ship is 1.1 m long


@effect(
    "thrust_curve",
    "actuator",
    "X",
    formula="f = f_nominal(c') · (1 + ahead or astern), c' = c less its dead band",
    symbol="ahead, astern, dead band",
    sign="positive: more force than assumed",
    source="(2.10)-(2.12)",
    linear=False,
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


def vsp_surge_curve(f: Thrust, now: Running, *values: Number) -> Thrust:
    """A free addition to the VSP surge force over its command."""
    *nodes, reach = values
    return f._replace(vsp_x=f.vsp_x + interpolate(now.u_vsp_x, -reach, reach, nodes))


def vsp_sway_curve(f: Thrust, now: Running, *values: Number) -> Thrust:
    """A free addition to the VSP sway force over its command."""
    *nodes, reach = values
    return f._replace(vsp_y=f.vsp_y + interpolate(now.u_vsp_y, -reach, reach, nodes))


def _add_vsp_curve(axis: str, acts_on: str, way: str, function: Callable[..., Thrust]) -> None:
    """Register a free curve of the VSP's force over the command in the same direction."""
    prefix = f"curve_vsp_{axis}_c"
    add(
        Effect(
            id=f"curve_vsp_{axis}(c)",
            kind="actuator",
            axis=acts_on,
            description=f"free addition to the VSP {way} force over its command",
            formula=f"f_{axis} + Σ c_k · hat_k(u_vsp_{axis}), 21 nodes over [-range, range]",
            symbol="c_1 … c_21",
            sign=f"positive pushes {'ahead' if axis == 'x' else 'to starboard'}",
            source="(2.12); 3.2.3, on a triangle basis",
            linear=True,
            parameters=node_parameters(prefix, "N", f"VSP {way} force", "command, both ways", "1", 1.0),
            function=function,
            settings=frozenset({f"{prefix}_range"}),
        )
    )


_add_vsp_curve("x", "X", "surge", vsp_surge_curve)
_add_vsp_curve("y", "YN", "sway", vsp_sway_curve)


@effect(
    "loss_vsp",
    "actuator",
    "XYN",
    formula="f_vsp (1 - δ)",
    symbol="δ",
    sign="positive: force is lost",
    source="(2.39), on one thruster",
)
def loss_vsp(
    f: Thrust, now: Running, loss_vsp: Annotated[float, "1", "share of VSP force lost", SHARE] = 0.0
) -> Thrust:
    """Force lost by the Voith Schneider propellers."""
    return f._replace(vsp_x=f.vsp_x * (1.0 - loss_vsp), vsp_y=f.vsp_y * (1.0 - loss_vsp))


@effect(
    "loss_bow",
    "actuator",
    "YN",
    formula="f_bow (1 - δ)",
    symbol="δ",
    sign="positive: force is lost",
    source="(2.39), on one thruster",
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
)
def bow_speed_loss(
    f: Thrust,
    now: Running,
    bow_speed_loss: Annotated[float, "s/m", "bow effectiveness lost with surge speed", POSITIVE] = 0.0,
) -> Thrust:
    """Bow thruster less effective with surge speed."""
    return f._replace(bow=f.bow * fmax(0.0, 1.0 - bow_speed_loss * abs(now.u)))


def bow_curve(f: Thrust, now: Running, *values: Number) -> Thrust:
    """A free change of the bow thruster's effectiveness over the surge speed."""
    *nodes, reach = values
    return f._replace(bow=f.bow * (1.0 + interpolate(abs(now.u), 0.0, reach, nodes)))


add(
    Effect(
        id="curve_bow(|u|)",
        kind="actuator",
        axis="YN",
        description="free change of the bow thruster's effectiveness over the surge speed",
        formula="f_bow (1 + Σ c_k · hat_k(|u|)), 21 nodes over [0, range]",
        symbol="c_1 … c_21",
        sign="positive: more force than assumed",
        source="6.4.4; 3.2.3, on a triangle basis",
        linear=True,
        parameters=node_parameters(
            "curve_bow_u", "1", "change of bow effectiveness", "surge speed", "m/s", 0.6
        ),
        function=bow_curve,
        settings=frozenset({"curve_bow_u_range"}),
    )
)


@effect(
    "bow_failure",
    "actuator",
    "YN",
    formula="f_bow = 0 for t >= time",
    symbol="time",
    sign="0: never",
    source="7.2.5",
    linear=False,
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


@effect(
    "saturation",
    "actuator",
    "XYN",
    formula="clip(f, -limit, limit)",
    symbol="limits",
    sign="0: no limit",
    source="2.1.1",
    linear=False,
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


def _add_dynamics(name: str, description: str, formula: str, symbol: str, most: float) -> None:
    """Register an effect with a memory, which lives in the chain of the thrusters."""
    add(
        Effect(
            id=name,
            kind="actuator",
            axis="XYN",
            description=description,
            formula=formula,
            symbol=symbol,
            sign="0: none",
            source="6.4.5",
            linear=False,
            parameters=(Variable(name, "s", description, 0.0, Range(0.0, most), False),),
            function=None,
        )
    )


_add_dynamics("lag", "first-order lag of all thrusters", "T df/dt = f_asked - f", "T", 60.0)
_add_dynamics("delay", "pure delay of all thrusters", "f(t) = f_asked(t - T)", "T", 60.0)
