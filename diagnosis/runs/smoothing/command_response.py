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
from .likelihood import adapt, deviance, likeliest
from .penalised import Fit, Problem, solve

ROUNDS = 3  # of gains and smoothness in turn; further ones change neither (chosen)
# Least fall of -2 log L by gains and delay: twice their number, 9 + 1 (Akaike's criterion).
PARAMETERS = 20.0
# Least fall of -2 log L by another round: far above rounding, and far below what any parameter is worth.
BETTER = 1e-3


def with_commands(
    even: Problem,
    alone: Problem,
    smoothness: np.ndarray,
    fit: Fit,
    weights: np.ndarray,
    commands: Commands,
) -> tuple[Problem, np.ndarray, Fit, CommandResponse]:
    """A smoothing spline beside the response to the commands, if that is likelier than a spline alone.

    Args:
        even: the pose, with an even penalty.
        alone: with the penalty of a spline that knows of no commands.
        smoothness, fit: (3,), of that spline, and the spline.
        weights: (n,), of the samples.
        commands: commands and headings.

    Returns:
        What is left beside the response, its smoothness (3,) and spline, and the response.
    """
    response = CommandResponse.none(commands.psi.size)
    least = deviance(even, weights, likeliest(even, weights, smoothness)) - PARAMETERS
    delay, sure = likeliest_delay(Regression(even, fit, commands))
    rest, smoother, near = even, smoothness, None
    for _ in range(ROUNDS):
        gains = Regression(even, fit, commands).gains(delay)
        tried = commands.response(gains, delay)._replace(sure=sure)
        left = even._replace(z=even.z - tried.eta[even.rows])
        near = likeliest(left, weights, near)
        cost = deviance(left, weights, near)
        if cost >= least:
            break
        rest, smoother, response, least = left, near, tried, cost - BETTER
        fit = solve(rest, smoother, weights)
    if rest is even:
        return alone, smoothness, fit, response
    adapted, smoother = adapt(rest, smoother, weights)
    return adapted, smoother, solve(adapted, smoother, weights), response
