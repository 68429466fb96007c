"""The part of the motion that follows from the commands: known beforehand but for gains and a delay.

A thruster's force jumps with its command, and a smoother that does not know it takes every jump for
noise or noise for a jump. The pose is therefore modelled as

    eta(t) = f(t) + x(t),    (d/dt + 1/T)^2 x = R(psi) [G tau(t - delay) + H tau_slow(t - delay)],

f a smoothing spline (:mod:`.penalised`), G and H constant gains from the commanded force to a body-fixed
acceleration, one 2 x 3 block for the plane and one row for yaw. tau is that of the described actuators
at the ship's speed, behind their lags (:func:`.command_motion.acting`), tau_slow the same behind a lag
of a second. Gains and delay have the largest likelihood with f integrated out, which is generalised
least squares: with A the motions for unit gains, P the hat matrix of the spline, and r(a) the residuals
[sqrt(W) (a - P a), sqrt(s) roughness of P a],

    g = argmin |r(z) - r(A) g|^2,    taken = r(z)^T r(A) g / sigma^2.

Under control a fitted G is too small, by 9 to 28 % in runs of CyberShip Enterprise 1 with noise: the
controller answers the noise of the measurement, so that quick commands and noise are correlated. G is
therefore M^-1 of the ship's description, and H, which answers slow commands, is fitted. A fitted G
without H takes their place where it is likelier: the description is then of another ship.

Damping enters by H alone. The likeliest delay alone proves nothing: the response of
:mod:`.command_motion` knows neither damping nor any other force, and where commands are slow, a delay
makes up for what is missing. Therefore each delay is compared with none *beside* what a ship with
damping would make of commands that act at once: motions by the commands behind some lags. A
slow command cannot tell those from a delay, a jump can.

The likelihood ratio of two delays is a sum over blocks of time. A delay is sure if it is above zero by
Student's test over the blocks, which needs no assumption on how residuals are correlated within one.

The motion has the delay or the lag that is likeliest beside described gains, sure or not: commands
that act too early shift the smoothed motion to the front.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, orth
from scipy.special import stdtrit

from fmus.ship import ship

from ..cleaning import BRIEF, WIDTH, between
from ..run_constants import CHANCE, DIGITS, NEGLIGIBLE
from .command_motion import FORGETTING, CommandResponse, Commands, Gains, Late
from .likelihood import adapt, deviance, likeliest
from .outliers import Inliers
from .penalised import Fit, Problem, solve
from .spline import middles

# s, times the scale of the ship; CyberShip Enterprise 1 has 0.4 s (docs/studies/measured_ship)
LONGEST = 1.0


class Regression:
    """Generalised least squares of a run's pose on its commands, beside a spline.

    Args:
        problem: the pose.
        fit: a smoothing spline of it.
        commands: commands and headings.
        time: (n,), of the pose, since the run's start [s].
    """

    def __init__(self, problem: Problem, fit: Fit, commands: Commands, time: np.ndarray) -> None:
        self.problem, self.fit, self.commands, self.time = problem, fit, commands, time
        self.time_scale = commands.track.scale.time
        pose = [self._residual(c, problem.z[:, [c]]) for c in range(3)]
        self.pose = np.vstack(pose[:2]), pose[2]

    def gains(self, late: Late, described: np.ndarray | None = None, bent: bool = False) -> Gains:
        """What the commands accelerate.

        Args:
            late: how late they act.
            described: G (3, 3), as the ship's description has it, by which H is fitted; None: G is, and
                H is zero.
            bent: whether the bend of the way counts.
        """
        (plane, north_east), turned = self._equations(late, described)
        if bent:
            plane = np.hstack([plane, self.bend])
        flat, turn = (unlike(a, z) for a, z in ((plane, north_east), turned))
        fitted, share = np.vstack([flat[:6].reshape(2, 3), turn]), float(flat[6:].sum())
        return Gains(fitted, share) if described is None else Gains(described, share, fitted)

    def _equations(
        self, late: Late, described: np.ndarray | None
    ) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """r(A) and r(z) for the gains that are fitted, of the plane and of yaw."""
        plane, yaw = self.motions(self.commands.acting(late))
        north_east, heading = self.pose[0], self.pose[1]
        if described is not None:
            north_east = north_east - plane @ described[:2].reshape(6, 1)
            heading = heading - yaw @ described[2:].T
            plane, yaw = self.motions(self.commands.slow(late))
        return (plane, north_east), (yaw, heading)

    @property
    def bend(self) -> np.ndarray:
        """r(A) of the plane for the bend of the way, in one column."""
        x = self._sampled(self.commands.bend[:, None])
        return np.vstack([self._residual(0, np.real(x)), self._residual(1, np.imag(x))])

    def motions(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r(A) for unit gains of commands tau (m, 3): of the plane, north above east, and of yaw."""
        ahead, yaw = self._sampled(self.commands.rotation[:, None] * tau), self._sampled(tau)
        # A force to starboard moves the ship as one ahead does, a right angle further.
        north, east = np.real(ahead), np.imag(ahead)
        plane = {0: np.hstack([north, -east]), 1: np.hstack([east, north])}
        found = np.vstack([self._residual(c, x) for c, x in plane.items()]), self._residual(2, yaw)
        if not all(np.isfinite(part).all() for part in found):  # LAPACK may not end
            raise LinAlgError("the response to its commands is not finite")
        return found

    def motion(self, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r(a) for accelerations in the body frame (m, 3): of the plane (2 n, 1), and of yaw (n, 1)."""
        plane = self._sampled((self.commands.rotation * (body[:, 0] + 1j * body[:, 1]))[:, None])
        flat = [self._residual(0, np.real(plane)), self._residual(1, np.imag(plane))]
        return np.vstack(flat), self._residual(2, self._sampled(body[:, [2]]))

    def _sampled(self, a: np.ndarray) -> np.ndarray:
        """Positions (n, k) in the rows of the pose, by accelerations (m, k) of even steps."""
        time = self.time + self.commands.track.run.time[0]
        return between(time, self.commands.even, self.commands.motion(a)[0])

    def _residual(self, channel: int, x: np.ndarray) -> np.ndarray:
        """r(x) of signals (n, k) in a channel, in units of the noise."""
        system, y = self.fit.systems[channel], self.problem.data(channel, x)
        return system.residual(y, system.solve(y))

    @property
    def block(self) -> np.ndarray:
        """Number of the block of time of each row of r(x).

        Residuals of a spline are correlated over less than its time constant, a second.
        """
        rows = np.concatenate([self.time, middles(self.problem.spline.grid)])
        return np.unique(rows // (WIDTH * self.time_scale), return_inverse=True)[1]


def least_squares(a: np.ndarray, z: np.ndarray, apart: float = DIGITS) -> np.ndarray:
    """x of least |z - a x|; columns that do not differ share their effect evenly.

    Args:
        a, z: (n, k) and (n,).
        apart: share of the largest squared singular value, of columns of length one, below which they
            do not differ.
    """
    size = np.linalg.norm(a, axis=0)
    size[size == 0.0] = np.inf  # what never acts has no effect
    scaled = a / size
    return np.linalg.lstsq(scaled.T @ scaled, scaled.T @ z, rcond=apart)[0] / size


def unlike(a: np.ndarray, z: np.ndarray) -> np.ndarray:
    """x of least |z - a x| of z (n, 1), where motions (n, k) that hardly differ share their effect.

    Side force and yaw moment of a rudder go together; where they differ for once, gains of their
    difference, by which nothing else is explained, would be anything.
    """
    return least_squares(a, z[:, 0], NEGLIGIBLE**2)


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


def delayed(time: float) -> Late:
    """Commands act a time [s] later."""
    return Late(delay=time)


def lagging(time: float) -> Late:
    """Commands act behind a lag [s]."""
    return Late(lag=time)


def likeliest_late(regression: Regression, way: Callable[[float], Late], described: np.ndarray) -> Late:
    """How late commands act, in one way, whose gains (3, 3) are those of the ship's description.

    Fitted beside are H, and the size of the described gains: too large ones would pass for late ones.
    """
    commands = regression.commands
    period = commands.track.period

    @cache
    def left(periods: int) -> float:
        """-2 log L, but for a constant."""
        late = way(periods * period)
        quick = regression.motion(commands.acting(late) @ described.T)
        slow = regression.motions(commands.slow(late))
        each = zip(map(np.hstack, zip(quick, slow, strict=True)), regression.pose, strict=True)
        return sum(float(np.square(z[:, 0] - a @ unlike(a, z)).sum()) for a, z in each)

    return way(searched(left, commands).best * period)


def surely_positive(values: np.ndarray, chance: float) -> bool:
    """Whether the mean of independent values (k,) is above zero, by Student's one-sided test."""
    k = values.size
    return k > 1 and bool(values.mean() > values.std(ddof=1) / k**0.5 * -stdtrit(k - 1, chance))


def described_gains(commands: Commands) -> np.ndarray:
    """G (3, 3) = M^-1 of the ship's description [1/kg, 1/(kg m), 1/(kg m2)]."""
    return np.linalg.inv(ship(description=commands.track.run.ship).mass)


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
    late: Late,
    described: np.ndarray | None,
    way: Callable[[float], Late] | None = None,
) -> Explained:
    """Gains, smoothness and lateness in turn, as long as the pose becomes likelier.

    Args:
        by: the pose beside a spline.
        smoothness: (3,), of a spline, from which the search begins.
        weights: (n, 3), of the samples.
        late: how late the commands act at first.
        described: G (3, 3), or None where it is fitted.
        way: in which they may act later, beside described gains; None: as at first.
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
    for way in (delayed, lagging):
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
        explained(first, alone.even, weights, Late(delay), gains) for gains in (G, None)
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
