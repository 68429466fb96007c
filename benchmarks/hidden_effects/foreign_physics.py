"""Six kinds of physics that no candidate of the diagnosis expresses; ships of the benchmark have them.

A file of effects: ``python -m fmus.build vessel thrusters --effects
benchmarks/hidden_effects/foreign_physics.py --out fmu``. The diagnosis gets none of it. They depend on
place, on time alone, or on what was commanded before, of which the library has nothing. Nothing is tuned
to them.
"""

from typing import Annotated, Any

from fmus import effects
from fmus.declare import POSITIVE, Range
from fmus.effects import STANDARD, Memory, Motion
from fmus.frames import rotate_to_body
from fmus.hull import Triple
from fmus.ops import Number, clip, cos, exp, fmax, sin, sqrt, where

# Where the paths of the benchmark lie [m]: their middle, and how far they reach from it.
MIDDLE_X, MIDDLE_Y, REACH = 5.0, 0.5, 1.5
ANYWHERE = Range(-20.0, 20.0)
# Periods [s] of a slow gust: with no common multiple in a run, from half a minute to some seconds.
PERIODS = (31.7, 19.3, 13.1, 8.9)
SINES = tuple(6.283185307179586 / period for period in PERIODS)


@effects.effect(
    "slow gusts",
    "environment",
    "XY",
    formula="(X, Y) = R^T(psi) (cos b, sin b) F sum_k sin(w_k t + k p)",
    sign="size only",
    source="a sum of sines, as gusts are simulated",
    linear=False,
)
def slow_gusts(
    m: Motion,
    gust_force: Annotated[float, "N", "amplitude of each of four sines", POSITIVE] = 0.0,
    gust_direction: Annotated[float, "rad", "where it pushes"] = 0.1,
    gust_phase: Annotated[float, "rad", "from one sine to the next"] = 1.0,
) -> Triple:
    """Wind that comes and goes with time alone, earth-fixed."""
    force: Any = 0.0
    for k, w in enumerate(SINES):
        force = force + gust_force * sin(w * m.t + (k + 1.0) * gust_phase)
    X, Y = rotate_to_body(m.psi, force * cos(gust_direction), force * sin(gust_direction))
    return X, Y, 0.0 * X


@effects.effect(
    "bank",
    "environment",
    "YN",
    formula="(Y, N) = (1, arm) F exp(-distance/width) |u| / 0.1 m/s, to the wall",
    sign="positive: to the wall",
    source="form of bank effects: grows towards the wall and with speed",
)
def bank(
    m: Motion,
    bank_force: Annotated[float, "N", "sway force at the wall at 0.1 m/s"] = 0.0,
    bank_place: Annotated[float, "m", "east position of the wall", ANYWHERE] = MIDDLE_Y + REACH,
    bank_width: Annotated[float, "m", "distance that costs 63 %", Range(0.05)] = 0.5,
    bank_arm: Annotated[float, "m", "moment over force"] = -0.3,
) -> Triple:
    """A wall that draws the ship and turns its bow away, more where it is near."""
    near = exp(-fmax(bank_place - m.y, 0.0) / bank_width)
    _, Y = rotate_to_body(m.psi, 0.0, 1.0)
    Y = bank_force * near * abs(m.u) / 0.1 * Y
    return 0.0 * Y, Y, bank_arm * Y


@effects.effect(
    "shallow water",
    "environment",
    "XYN",
    formula="D(nu) s(x), s from 0 to 1 over the north position",
    sign="positive: more damping",
    source="damping in shallow water is larger in all axes",
)
def shallow_water(
    m: Motion,
    shallow_damping: Annotated[float, "N.s/m", "added surge damping on the shoal", POSITIVE] = 0.0,
    shallow_edge: Annotated[float, "m", "north position of its edge", ANYWHERE] = MIDDLE_X,
    shallow_slope: Annotated[float, "m", "length over which it shoals", Range(0.05)] = 0.15,
) -> Triple:
    """A shoal over part of the basin, on which the damping is larger."""
    on = shallow_damping / (1.0 + exp(-clip((m.x - shallow_edge) / shallow_slope, -40.0, 40.0)))
    # In sway a hull feels the bottom more, in yaw by its length.
    return -on * m.u, -3.0 * on * m.v, -0.3 * on * m.r


@effects.effect(
    "tether",
    "environment",
    "XYN",
    formula="F = k max(0, distance - slack) towards the anchor, at the stern",
    sign="positive: pulls",
    source="a measurement cable that hangs until it is taut",
)
def tether(
    m: Motion,
    tether_stiffness: Annotated[float, "N/m", "of the taut line", POSITIVE] = 0.0,
    tether_north: Annotated[float, "m", "anchor", ANYWHERE] = MIDDLE_X - REACH,
    tether_east: Annotated[float, "m", "anchor", ANYWHERE] = MIDDLE_Y,
    tether_slack: Annotated[float, "m", "length that hangs", POSITIVE] = 1.5,
) -> Triple:
    """A line to an anchor that pulls only beyond its slack."""
    stern = 0.5  # m, how far aft of the origin it is made fast
    north = tether_north - (m.x - stern * cos(m.psi))
    east = tether_east - (m.y - stern * sin(m.psi))
    distance = sqrt(north * north + east * east + 1e-12)
    pull = tether_stiffness * fmax(distance - tether_slack, 0.0) / distance
    X, Y = rotate_to_body(m.psi, pull * north, pull * east)
    return X, Y, -stern * Y


@effects.effect(
    "backlash",
    "actuator",
    "XYN",
    formula="given = clip(given before, command - b, command + b)",
    sign="0: none",
    source="play in the linkage of the blades",
    linear=False,
    memory=Memory((0.0, 0.0, 0.0), "command", lambda backlash: 30.0),
)
def backlash(
    before: Triple,
    command: Triple,
    h: Number,
    backlash: Annotated[float, "1", "half the play, of the full command", POSITIVE] = 0.0,
) -> tuple[Triple, Triple]:
    """Thrusters that follow a command that turns only after it has taken up the play."""
    a, b, c = (
        where(h > 0.0, clip(old, new - backlash, new + backlash), old)
        for old, new in zip(before, command, strict=True)
    )
    return (a, b, c), (a, b, c)


@effects.effect(
    "bias by place",
    "measurement",
    "XYN",
    formula="p + A (sin(k x), sin(k y)), psi + A sin(k x) cos(k y) rad/m",
    sign="either",
    source="a badly calibrated camera distorts the picture by place",
)
def bias_by_place(
    pose: Triple,
    distortion: Annotated[float, "m", "largest error of a position"] = 0.0,
    distortion_length: Annotated[float, "m", "length over which it repeats", Range(0.1)] = 1.7,
) -> Triple:
    """A camera system whose error depends on the place."""
    x, y, psi = pose
    k = 6.283185307179586 / distortion_length
    along, across = sin(k * x), sin(k * y)
    return x + distortion * along, y + distortion * across, psi + distortion * along * cos(k * y)


FOREIGN_PHYSICS = (slow_gusts, bank, shallow_water, tether, backlash, bias_by_place)
WITH_FOREIGN = STANDARD.plus(FOREIGN_PHYSICS)
