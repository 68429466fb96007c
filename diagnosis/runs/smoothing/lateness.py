"""How late commands act, as the pose shows it: a delay that is sure, and one that is likeliest.

The likeliest delay alone proves nothing: the response of :mod:`.command_motion` knows neither damping
nor any other force, and where commands are slow, a delay makes up for what is missing. Therefore each
delay is compared with none *beside* what a ship with damping would make of commands that act at once:
motions by the commands behind some lags. A slow command cannot tell those from a delay, a jump can.

The likelihood ratio of two delays is a sum over blocks of time. A delay is sure if it is above zero by
Student's test over the blocks, which needs no assumption on how residuals are correlated within one.

The smoothed motion has the delay or the lag that is likeliest beside described gains, sure or not:
commands that act too early shift it to the front.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import orth

from ..cleaning import BRIEF
from ..paired_test import surely_positive
from ..run_constants import CHANCE
from .command_motion import FORGETTING, PROMPT, Commands, Lateness
from .command_regression import Regression, least_squares, unlike

# s, times the scale of the ship; CyberShip Enterprise 1 has 0.4 s (docs/studies/measured_ship)
LONGEST = 1.0


class Searched(NamedTuple):
    """A delay found by search, in sampling periods.

    Attributes:
        best: the likeliest, or 0: that is likelier than none by less than chance finds among so many,
            by Akaike's criterion, and twice the logarithm of their number.
        tried: all that were tried.
    """

    best: int
    tried: set[int]


def searched(left: Callable[[int], float], commands: Commands) -> Searched:
    """The delay that leaves least of -2 log L: coarse at first, then downhill with halved steps.

    Args:
        left: -2 log L by a delay in sampling periods.
        commands: whose delay it is.
    """
    period, time_scale = commands.track.period, commands.track.scale.time
    noticed = BRIEF * time_scale
    step = 2.0 * noticed / period  # between the delays that are tried first
    tried = {round(k * step) for k in range(round(LONGEST / (2.0 * BRIEF)) + 1)}
    best = min(sorted(tried), key=left)
    while step > 1:
        step = np.ceil(step / 2.0)
        near = {max(best - int(step), 0), best + int(step)}
        tried |= near
        best = min((best, *sorted(near)), key=left)
    chance = left(0) - left(best) < 2.0 + 2.0 * np.log(len(tried))
    return Searched(0 if chance else best, tried)


def likeliest_delay(regression: Regression) -> tuple[float, bool]:
    """From a command to its effect [s], and whether the blocks of the run agree on a delay."""
    commands, block, time_scale = regression.commands, regression.block, regression.time_scale
    period, noticed = commands.track.period, BRIEF * time_scale
    # Lags of a ship's own. A thruster's, shorter than the longest delay, is one for what follows.
    lags = np.geomspace(LONGEST, FORGETTING, 3) * time_scale
    prompt = commands.delayed(0.0)
    lagged = [regression.motions(commands.lagging(prompt, lag)) for lag in lags.tolist()]
    aside = [orth(np.hstack(part)) for part in zip(*lagged, strict=True)]
    pose = [z - q @ (q.T @ z) for q, z in zip(aside, regression.pose, strict=True)]

    @cache
    def blocks(periods: int) -> Any:
        """(blocks,), what a delay leaves of -2 log L in each block."""
        total = np.zeros(block.max() + 1)
        motions = regression.motions(commands.delayed(periods * period))
        for q, z, a in zip(aside, pose, motions, strict=True):
            own = a - q @ (q.T @ a)
            off = z[:, 0] - own @ least_squares(own, z[:, 0])
            total += np.bincount(np.tile(block, off.size // block.size), off**2)
        return total

    def left(periods: int) -> float:
        return float(blocks(periods).sum())

    best, tried = searched(left, commands)
    if not best:
        return 0.0, False
    short = min((k for k in tried if k * period < noticed), key=left)
    sure = best != short and surely_positive(blocks(short) - blocks(best), CHANCE / len(tried))
    return best * period, sure


def likeliest_late(regression: Regression, way: str, described: np.ndarray) -> Lateness:
    """How late commands act by a delay or by a lag, with the gains (3, 3) of the ship's description.

    Fitted beside are H, and the size of the described gains: too large ones would pass for late ones.
    Where there is hardly noise, what is not described is likelier with some lateness, which is brief.
    """
    commands = regression.commands
    period = commands.track.period

    @cache
    def left(periods: int) -> float:
        """-2 log L, but for a constant."""
        late = PROMPT._replace(**{way: periods * period})
        quick = regression.motion(commands.tau_late(late) @ described.T)
        slow = regression.motions(commands.slow(late))
        each = zip(map(np.hstack, zip(quick, slow, strict=True)), regression.pose, strict=True)
        return sum(float(np.square(z[:, 0] - a @ unlike(a, z)).sum()) for a, z in each)

    found = searched(left, commands).best * period
    return PROMPT._replace(**{way: found if found >= BRIEF * commands.track.scale.time else 0.0})
