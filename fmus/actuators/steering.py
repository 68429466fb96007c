"""From a surge force and a yaw moment to the commands of a ship whose thrusters do not allocate.

What pushes ahead drives and what turns by an angle steers: shafts go to the same share of their limits,
rudders and azimuths over to the same share of the largest angle, each to the side that turns the ship to
starboard. Both shares follow from the forces of the ship's own laws at its speed: first that of the
shafts, at the angle of the step before, then that of the angles. They are found by halving, for which a
law needs nothing but its force; a request out of reach gets what comes nearest.
"""

from collections.abc import Callable, Sequence
from functools import cache
from math import sqrt
from typing import NamedTuple

from ..declare import Fields
from ..hull import Triple
from ..ops import Number, clip, fmax, fmin, where
from ..ship_description import Description
from .actuation import actuators, forces, limits, ordered, parameters
from .response import total

HALVINGS = 10  # of the shares; a straight line through the last two leaves 1e-6 of the full force
GRAVITY = 9.81  # m/s2
CRUISING = 0.1  # Froude number at which it is reported to which side an angle turns the ship
TRIED = 0.1  # rad, the angle for that


class CommandRoles(NamedTuple):
    """For each command of a ship what it is for.

    Attributes:
        drives: 1 where it pushes the ship ahead, else 0.
        steers: 1 for an angle that turns a ship under way to starboard, -1 for one to port, else 0.
    """

    drives: tuple[float, ...]
    steers: tuple[float, ...]


@cache
def nominal_values(ship: Description) -> tuple[Fields, ...]:
    """The parameters of a ship's actuators, as its description has them."""
    return tuple([parameters(ship, a, "", False)() for a in actuators(ship)])


@cache
def roles(ship: Description) -> CommandRoles:
    """What the commands of a ship are for, by the forces that they have in its description."""
    values = nominal_values(ship)
    angles = [c.unit == "rad" for a in ordered(ship) for c in a.law.commands]
    full = [high for _, high in limits(ship, values)]
    places = range(len(full))

    def alone(k: int, value: float, others: Sequence[float], u: float) -> Triple:
        commands = [value if k == j else x for j, x in enumerate(others)]
        return total(forces(ship, commands, (u, 0.0, 0.0), values))

    drives, steers, rest = [], [], [0.0 for _ in places]
    for k in places:
        X, Y, _ = alone(k, full[k], rest, 0.0)
        drives.append(1.0 if not angles[k] and abs(Y) < X else 0.0)
    ahead = [drive * most for drive, most in zip(drives, full, strict=True)]
    u = CRUISING * sqrt(GRAVITY * ship.length)
    for k in places:
        N = alone(k, TRIED, ahead, u)[2] - alone(k, -TRIED, ahead, u)[2]
        steers.append((N > 0.0) - (N < 0.0) if angles[k] else 0.0)
    return CommandRoles(tuple(drives), tuple(map(float, steers)))


def steerable(ship: Description) -> bool:
    """Whether a ship has what drives it ahead, and an angle that turns it."""
    return all(map(any, roles(ship)))


def commands_at(
    ship: Description, drive: Number, helm: Number, angle_max: Number, values: Sequence[Fields]
) -> tuple[Number, ...]:
    """The commands of two shares.

    Args:
        ship: its actuators.
        drive: share of full speed of the shafts, -1 astern to 1.
        helm: share of the largest angle, -1 to port to 1 to starboard.
        angle_max: the largest angle [rad], where no limit is below it.
        values: parameters of each actuator.
    """
    ahead, astern = fmax(drive, 0.0), fmax(0.0 - drive, 0.0)
    return tuple(
        [
            drives * (ahead * high + astern * low) + steers * helm * fmin(angle_max, high)
            for drives, steers, (low, high) in zip(*roles(ship), limits(ship, values), strict=True)
        ]
    )


def share(of: Callable[[Number], Number], wanted: Number) -> Number:
    """The share, -1 to 1, at which a function that only rises or only falls has a value.

    Where it does not come to that, the share at which it is nearest; of one that is constant 0.
    """
    low, high = -1.0, 1.0
    least, most = of(low), of(high)
    reach = most - least
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        there = of(middle)
        beyond = (there - wanted) * reach > 0.0
        low, least = where(beyond, low, middle), where(beyond, least, there)
        high, most = where(beyond, middle, high), where(beyond, there, most)
    rest = most - least
    part = (wanted - least) / where(rest == 0.0, 1.0, rest)
    found = low + clip(where(rest == 0.0, 0.0, part), 0.0, 1.0) * (high - low)
    return where(reach == 0.0, 0.0, found)


class SteeringCommands(NamedTuple):
    """What becomes of a request: the commands, the share of the largest angle, and tau [N, N, N m]."""

    commands: tuple[Number, ...]
    helm: Number
    tau: Triple


def steer(
    ship: Description,
    tau_X: Number,
    tau_N: Number,
    helm: Number,
    nu: Triple,
    angle_max: Number,
    values: Sequence[Fields],
) -> SteeringCommands:
    """Commands that give a surge force and a yaw moment as nearly as the ship can.

    Args:
        ship: its actuators.
        tau_X, tau_N: surge force and yaw moment asked for [N, N m].
        helm: the share of the largest angle in the step before.
        nu: u, v, r [m/s, m/s, rad/s].
        angle_max: the largest angle [rad].
        values: parameters of each actuator.
    """

    def given(drive: Number, helm: Number) -> tuple[tuple[Number, ...], Triple]:
        commands = commands_at(ship, drive, helm, angle_max, values)
        return commands, total(forces(ship, commands, nu, values))

    drive = share(lambda x: given(x, helm)[1][0], tau_X)
    helm = share(lambda x: given(drive, x)[1][2], tau_N)
    commands, tau = given(drive, helm)
    return SteeringCommands(commands, helm, tau)
