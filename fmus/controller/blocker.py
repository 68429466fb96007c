"""Algorithm 4, corrected: a gate that keeps spikes out of what is learned."""

from typing import Annotated, NamedTuple

from ..declare import POSITIVE
from ..hull import Triple
from ..ops import Condition, Number, choose, where
from .eigen import dot

OFF = 1e6


class BlockerOptions(NamedTuple):
    """Norms above which learning stops.

    Those of velocity and acceleration are so large by default that they never act. That of the force
    does: it is the force that acts where the inputs ``tau_cmd`` are connected, as in the shipped
    scenarios, else the force that is asked for, which may be more than thrusters give.
    """

    nu_dot_max: Annotated[
        float, "1", "norm of the acceleration above which learning is blocked", POSITIVE
    ] = OFF
    nu_max: Annotated[float, "1", "norm of the velocity above which learning is blocked", POSITIVE] = OFF
    tau_max: Annotated[float, "1", "norm of the force above which learning is blocked", POSITIVE] = 2.0
    block_time: Annotated[float, "s", "quiet time before learning resumes", POSITIVE] = 1.0


class Blocker(NamedTuple):
    """beta = 1 lets learning happen; the timer [s] counts quiet time while it does not."""

    beta: Number = 1.0
    timer: Number = 0.0


def exceeds(nu: Triple, nu_dot: Triple, tau: Triple, p: BlockerOptions) -> Condition:
    """True where one of the three norms is above its threshold."""
    return (
        (dot(nu_dot, nu_dot) > p.nu_dot_max * p.nu_dot_max)
        | (dot(nu, nu) > p.nu_max * p.nu_max)
        | (dot(tau, tau) > p.tau_max * p.tau_max)
    )


def blocked(s: Blocker, spike: Condition, block_time: Number, h: Number) -> Blocker:
    """The gate after a step of h [s]: shut by a spike, open again when ``block_time`` was quiet."""
    waited = s.timer > block_time
    quiet = Blocker(
        where((s.beta > 0.5) | waited, 1.0, 0.0),
        where((s.beta > 0.5) | waited, s.timer, s.timer + h),
    )
    return choose(h > 0.0, choose(spike, Blocker(0.0, 0.0), quiet), s)
