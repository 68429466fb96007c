"""The part of the motion that follows from the commands: known beforehand but for gains and a delay.

A thruster's force jumps with its command, and a smoother that does not know it takes every jump for
noise or noise for a jump. The pose is therefore modelled as

    eta(t) = f(t) + x(t),    (d/dt + 1/T)^2 x = R(psi) G tau(t - delay),

f a smoothing spline (:mod:`.penalised`), G constant gains from the commanded force to a body-fixed
acceleration, one 2 x 3 block for the plane and one row for yaw. Gains and delay have the largest
likelihood with f integrated out, which is generalised least squares: with A the motions for unit gains,
P the hat matrix of the spline, and r(a) the residuals [sqrt(W) (a - P a), sqrt(s) roughness of P a],

    g = argmin |r(z) - r(A) g|^2,    taken = r(z)^T r(A) g / sigma^2.

No model of a ship enters.
"""

import numpy as np

from .command_motion import CommandResponse, Commands
from .delay import Regression, likeliest_delay
from .likelihood import ROUNDS, adapt, deviance, likeliest
from .outliers import Inliers
from .penalised import Fit, Problem, solve


def with_commands(
    p: Problem, alone: Inliers, fit: Fit, commands: Commands
) -> tuple[Problem, np.ndarray, CommandResponse]:
    """A smoothing spline in addition to the response to the commands, if that is likelier than it alone.

    Returns:
        What is left by the response, its smoothness (3,), and the response.
    """
    weights, run = alone.weights, commands.track.run
    time = run.time[p.rows] - run.time[0]
    near = alone.even
    regression = Regression(p, fit, commands, time)
    delay, sure = likeliest_delay(regression)
    gains = regression.gains(delay)
    # By Akaike's criterion -2 log L falls by more than twice the number of gains and delay.
    least = deviance(p, weights, near) - 2.0 * (gains.size + 1)
    found: tuple[Problem, np.ndarray, CommandResponse] | None = None
    for _ in range(ROUNDS):
        response = commands.response(gains, delay)
        rest = p._replace(z=p.z - response.eta[p.rows])
        near = likeliest(rest, weights, near)
        cost = deviance(rest, weights, near)
        if cost >= least:
            break
        found, least = (rest, near, response._replace(sure=sure)), cost
        gains = Regression(p, solve(rest, near, weights), commands, time).gains(delay)
    if found is None:
        still = np.zeros((commands.psi.size, 3))
        return alone.problem, alone.smoothness, CommandResponse(still, still, still)
    rest, near, response = found
    return *adapt(rest, near, weights), response
