"""The part of the motion that follows from the commands: known beforehand but for gains and lateness.

A thruster's force jumps with its command, and a smoother that does not know it takes every jump for
noise or noise for a jump. The pose is therefore modelled as

    eta(t) = f(t) + x(t),    (d/dt + 1/T)^2 x = R(psi) [G tau_late + H tau_slow],

f a smoothing spline (:mod:`.penalised`), G and H constant gains from the commanded force to a body-fixed
acceleration, one 2 x 3 block for the plane and one row for yaw. tau is that of the described actuators
at the ship's speed, behind their lags (:func:`.command_motion.acting`), tau_late the same behind a delay
or a lag (:mod:`.lateness`), tau_slow behind a lag of a second besides. The gains are fitted by
:mod:`.command_regression`.

Under control a fitted G is too small, by 9 to 28 % in runs of CyberShip Enterprise 1 with noise: the
controller answers the noise of the measurement, so that quick commands and noise are correlated. G is
therefore M^-1 of the ship's description, and H, which answers slow commands, is fitted: damping enters
by H alone. A fitted G without H takes their place where it is likelier: the description is then of
another ship.
"""

from typing import NamedTuple

import numpy as np

from ..run_constants import NEGLIGIBLE
from .command_motion import CommandResponse, Commands, Lateness
from .command_regression import Regression, described_gains
from .lateness import likeliest_delay, likeliest_late
from .likelihood import adapt, deviance, likeliest
from .outliers import Inliers
from .penalised import Fit, Problem, solve


class Explained(NamedTuple):
    """A pose less its response to the commands.

    Attributes:
        cost: -2 log L.
        rest: the problem that is left.
        smoothness: (3,), the likeliest.
        response: the motion by the commands.
        again: the pose beside the spline that is left.
    """

    cost: float
    rest: Problem
    smoothness: np.ndarray
    response: CommandResponse
    again: Regression


def explained(
    by: Regression,
    smoothness: np.ndarray,
    weights: np.ndarray,
    late: Lateness,
    described: np.ndarray | None,
    way: str | None = None,
) -> Explained:
    """Gains, smoothness and lateness in turn, as long as the pose becomes likelier.

    Args:
        by: the pose beside a spline.
        smoothness: (3,), of a spline, from which the search begins.
        weights: (n, 3), of the samples.
        late: how late the commands act at first.
        described: G (3, 3), or None where it is fitted.
        way: delay or lag, by which they may act later, beside described gains; None: as at first.
    """
    p, commands, found = by.problem, by.commands, None
    while True:
        response = commands.response(by.gains(late, described), late)
        response = response._replace(described=described is not None)
        rest = p._replace(z=p.z - response.eta[p.rows])
        smoothness = likeliest(rest, weights, smoothness)
        cost = deviance(rest, weights, smoothness)
        # Less than a parameter that explains nothing is expected to take.
        if found is not None and not cost < found.cost - 2.0:
            return found
        by = Regression(p, solve(rest, smoothness, weights), commands, by.time)
        found = Explained(cost, rest, smoothness, response, by)
        if described is not None and way is not None:
            late = likeliest_late(by, way, described)


def explained_late(
    prompt: Explained, weights: np.ndarray, described: np.ndarray, base: float
) -> Explained:
    """The same with commands that act later, if they do.

    What commands do is described but for a share. A fall of -2 log L by less than that share of what
    they explain proves no lateness, if there was none before.

    Args:
        prompt: as late as they were before.
        weights: (n, 3), of the samples.
        described: G (3, 3).
        base: -2 log L without any command.
    """
    found, before = prompt, prompt.response.late
    least = 0.0 if before.delay else NEGLIGIBLE * (base - prompt.cost)
    for way in Lateness._fields:
        late = likeliest_late(prompt.again, way, described)
        if late != before:
            one = explained(prompt.again, prompt.smoothness, weights, late, described, way)
            if one.cost < min(found.cost, prompt.cost - least):
                found = one
    return found


def with_commands(
    p: Problem, alone: Inliers, fit: Fit, commands: Commands
) -> tuple[Problem, np.ndarray, CommandResponse]:
    """A smoothing spline in addition to the response to the commands, if that is likelier than it alone.

    Returns:
        What is left by the response, its smoothness (3,), and the response.
    """
    time, weights = commands.track.run.time, alone.weights
    first = Regression(p, fit, commands, time[p.rows] - time[0])
    delay, sure = likeliest_delay(first)
    base, G = deviance(p, weights, alone.even), described_gains(commands)
    by_description, by_fit = (
        explained(first, alone.even, weights, Lateness(delay), gains) for gains in (G, None)
    )
    by_description = explained_late(by_description, weights, G, base)
    found = min(by_description, by_fit, key=lambda one: one.cost)
    # By Akaike's criterion -2 log L falls by more than twice the number of gains and delay.
    if not found.cost < base - 2.0 * (9 + 1):
        still = np.zeros((commands.psi.size, 3))
        return alone.problem, alone.smoothness, CommandResponse(still, still, still)
    response = found.response._replace(delay=delay, sure=sure)
    return *adapt(found.rest, found.smoothness, weights), response


def with_bend(p: Problem, fit: Fit, commands: Commands, response: CommandResponse) -> CommandResponse:
    """The response to the commands and the bend of the way, beside a spline as smooth as that of a fit.

    A force to the side that turns the ship as well, as a rudder's, is soon followed by the larger force
    of the turn, m u r, the other way. Gains alone would be those of the sum of both. Beside described
    gains the spline is stiffer, and would smooth the force of the turn away.
    """
    time = commands.track.run.time[p.rows] - commands.track.run.time[0]
    described = described_gains(commands) if response.described else None
    gains = Regression(p, fit, commands, time).gains(response.late, described, bent=True)
    bent = commands.response(gains, response.late)
    return bent._replace(delay=response.delay, sure=response.sure, described=response.described)
