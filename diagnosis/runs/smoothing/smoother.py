"""Pose, velocity and acceleration of a measured run without any model of the ship.

Each channel is modelled as a process driven by the commands (:mod:`.command_response`) and by white
jerk, measured with white noise at the times at which that channel was updated. The noise is given, or
estimated with the spectral density of the jerk by restricted maximum likelihood; how that varies over
time follows from the jerk that is found (:mod:`.likelihood`). A sample further than five standard
deviations from its prediction by all others is a spike.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError

from cosim import InputError
from fmus.frames import rotate_to_body
from fmus.scale import Scale

from ...execution.short_text import ShortRepr
from ..body_motion import body_velocity
from ..cleaning import BRIEF, HEADING, PLACE, WIDTH, Counts, Track, noise
from ..columns.columns import POSE
from ..frozen import repeated
from ..measured_wind import air_along
from ..run_constants import CHANCE, EVERY, HORIZON, LONG, ORDER
from ..sensors.evidence import FEWEST, VELOCITIES, velocity_over_ground
from ..sensors.sensor_finding import Examined
from .command_motion import CommandResponse, Commands, acting, idle
from .command_response import with_bend, with_commands
from .correlated_noise import with_correlated
from .likelihood import adapt, criteria, likeliest, noise_uncertainty, with_noise
from .outliers import Inliers, TooFewError, robust
from .penalised import Problem, Rates, Spline, solve
from .spline import DEGREE, Knots, SplineCovariance, basis, knots

# Seconds and metres are those of CyberShip Enterprise 1, times the scale of the ship.

# [m, m, rad]; a smaller noise is implausible, and the kinks of a stepwise force would be spikes.
LEAST_NOISE = 2e-5
# 1, times what the samples scatter by, from which on a given noise is doubted. Chosen: with less,
# weights of channels against each other are wrong by less than four.
MISSTATED = 2.0
FILTERED = "; after a filter samples scatter less than their error"

# Channel -> standard deviation of what it says over a sampling period, in SI.
Agreeing = Mapping[str, float]
ALONE: Agreeing = {}


class PoseOnly(NamedTuple):
    """How the pose alone is smoothed, its response to the commands left out.

    Attributes:
        rows: of the run, that are tried.
        weights: (n, 3), of those in a stretch: 1, and 0 for a spike.
        sigma: (3,), noise.
        stiffness, smoothness: (3, intervals) and (3,), see :mod:`.penalised`.
    """

    rows: np.ndarray
    weights: np.ndarray
    sigma: np.ndarray
    stiffness: np.ndarray
    smoothness: np.ndarray


class SmoothMotion(NamedTuple):
    """Pose, its derivatives and body-fixed velocity, (n, 3) each, as those of :class:`Smoothed`."""

    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray
    nu: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Smoothed(ShortRepr):
    """A smoothed run. All arrays (n, 3) are NaN where too much is missing.

    Attributes:
        track: the run with its samples judged; a heading that was not measured with a position, or is a
            spike, is the smoothed one.
        spikes: (n,), samples of the position refused by the outlier test.
        agrees: (n, 3), which channels were measured anew and are not outliers.
        eta, eta_dot, eta_ddot: pose, heading continuous, and derivatives [m, m, rad; /s; /s2].
        nu: body-fixed velocity over ground [m/s, m/s, rad/s].
        eta_std, eta_dot_std, eta_ddot_std, nu_std: their standard deviations.
        noise: (3,), standard deviation of the measurement [m, m, rad].
        jerk: (3,), mean spectral density of the jerk that is not the commands' [m2/s5, m2/s5, rad2/s5].
        delay: from a command to its effect [s], as far as the pose shows it; NaN where it does not.
        late: whether the whole run agrees on that delay.
        pose_only: how the pose is smoothed without the commands, see :func:`without_commands`.
        doubted: lines on noise that was given and contradicts the samples.
        misread: how the file may be meant otherwise than it was read, with the line that states it.
        sensors: what the run's channels say of each other; None where nobody asked.
        noise_rel_std: (3,), relative standard deviation of the noise; zero where it was given.
        noise_at_most: (3,), whether the noise is an upper bound, see :mod:`.likelihood`.
        covariance: what the samples leave uncertain of the splines; None: not known.
    """

    track: Track
    spikes: np.ndarray
    agrees: np.ndarray
    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray
    nu: np.ndarray
    eta_std: np.ndarray
    eta_dot_std: np.ndarray
    eta_ddot_std: np.ndarray
    nu_std: np.ndarray
    noise: np.ndarray
    jerk: np.ndarray
    delay: float
    late: bool
    pose_only: PoseOnly
    doubted: tuple[str, ...] = ()
    misread: str = ""
    sensors: Examined | None = None
    noise_rel_std: np.ndarray = field(default_factory=lambda: np.zeros(3))
    noise_at_most: np.ndarray = field(default_factory=lambda: np.zeros(3, bool))
    covariance: SplineCovariance | None = None

    @property
    def time(self) -> np.ndarray:
        """(n,) [s]."""
        return self.track.run.time

    @property
    def scale(self) -> Scale:
        """Of the ship."""
        return self.track.scale

    def rows(self, keep: np.ndarray) -> "Smoothed":
        """The motion at some of its rows (n,) alone, as it was found by all."""
        arrays = {n: x for n in self.__annotations__ if isinstance(x := getattr(self, n), np.ndarray)}
        of_rows = {n: x[keep] for n, x in arrays.items() if len(x) == keep.size}
        return replace(self, track=self.track.rows(keep), **of_rows)

    def state_covariance(self, rows: np.ndarray) -> np.ndarray:
        """Covariance (w, 6, 6) of x, y, psi, u, v, r in some rows (w,)."""
        return _state_covariance(*(x[rows] for x in (self.eta, self.nu, self.eta_std, self.eta_dot_std)))

    @cached_property
    def air(self) -> np.ndarray | None:
        """(n, 2), velocity of the air to north and east [m/s]; None: no wind was measured."""
        return air_along(self.track.run, self.eta[:, 2], self.nu)

    @property
    def used(self) -> np.ndarray:
        """(n,), samples that count: new, no spike, in a stretch that could be smoothed."""
        return self.track.valid & ~self.spikes & np.isfinite(self.eta[:, 0])

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the data, a line each."""
        notes = (*self.track.notes, *self.doubted, *filter(None, [self.misread]))
        # The pose alone does not tell a delay from the lag that the ship's file describes.
        if not (self.late and self.delay >= max(BRIEF * self.scale.time, self.track.lag)):
            return notes
        delay = (
            f"commands act {self.delay:.2f} s after they are given, as the pose shows without a model"
        )
        return (*notes, delay)

    @property
    def counts(self) -> Counts:
        """Counts of the samples by their use."""
        return self.track.counts(int(self.spikes.sum()))


def smooth(track: Track, agreeing: Agreeing = ALONE) -> Smoothed:
    """Smooth a run.

    Args:
        track: the run.
        agreeing: channels of velocity and yaw rate that count beside the pose, and their noise.

    Raises:
        InputError: no stretch of it is dense enough, or its samples do not determine a motion.
    """
    try:
        return _smooth(track, agreeing)
    except LinAlgError as error:
        raise InputError(
            f"run '{track.run.name}': its samples do not determine a smooth motion ({error})"
        ) from None


def without_commands(run: Smoothed, pose: np.ndarray | None = None) -> SmoothMotion:
    """The motion by the pose alone: its spline follows whatever is quick, and noise with it.

    Args:
        run: a smoothed run.
        pose: (n, 3), in place of the run's; the spline is as stiff as that of the run.
    """
    rows, weights, sigma, stiffness, smoothness = run.pose_only
    track = run.track if pose is None else replace(run.track, pose=pose)
    p, origin = _problem(track, rows)
    p = p._replace(sigma=sigma).adapted(stiffness=stiffness)
    grid, time = p.spline.grid, run.time - run.time[0]
    where = within(grid, time)
    coefficients = solve(p, smoothness, weights).coefficients
    derivatives = (spread(basis(grid, time[where], k)(coefficients), where) for k in range(3))
    return _motion(origin, *derivatives)


def _motion(
    origin: np.ndarray, offset: np.ndarray, eta_dot: np.ndarray, eta_ddot: np.ndarray
) -> SmoothMotion:
    """The motion by the pose about an origin (3,), and its derivatives."""
    eta = offset + origin
    return SmoothMotion(eta, eta_dot, eta_ddot, body_velocity(eta[:, 2], eta_dot))


def _problem(track: Track, rows: np.ndarray) -> tuple[Problem, np.ndarray]:
    """The spline that is to follow some rows of a run, with an even penalty, and its origin (3,)."""
    time, scale = track.run.time - track.run.time[0], track.scale
    with np.errstate(over="ignore"):  # of poses that are no place on earth
        origin = np.nanmedian(track.pose, axis=0)
    spacing = max(0.1 * EVERY * scale.time, float(np.median(np.diff(time[rows]))))
    grid = knots(*stretches(rows[track.valid[rows]], track), spacing)
    dense = rows[within(grid, time[rows])]
    z = track.pose[dense] - origin
    given = given_noise(track)
    sigma = np.where(np.isnan(given), _first_guess(track, dense), given)
    share = np.where(track.fresh[dense], _share(track, sigma, dense), 0.0)
    stiffness = np.ones((3, int(grid.intervals.sum())))
    # The squared jerk is averaged over a prediction window.
    average = max(1, round(HORIZON * scale.time / grid.spacing))
    spline = Spline(grid, basis(grid, time[dense]), stiffness, Rates.none(grid))
    return Problem(dense, np.where(share > 0.0, z, 0.0), sigma, share, average, spline), origin


def _first_guess(track: Track, rows: np.ndarray) -> np.ndarray:
    """(3,), noise of the pose by third differences, of some rows of a run [m, m, rad]."""
    pose = track.pose[rows]
    guess = [noise(pose[there, k : k + 1])[0] for k, there in enumerate(track.fresh[rows].T)]
    return np.maximum(guess, least_noise(track))


def given_noise(track: Track) -> np.ndarray:
    """(3,), standard deviations of the pose that the file states [m, m, rad]; NaN where it does not."""
    return np.array([track.run.noise.get(name, np.nan) for name in POSE])


def least_noise(track: Track) -> np.ndarray:
    """(3,), standard deviation by rounding of the pose, or the least that is believed [m, m, rad]."""
    least = np.multiply(LEAST_NOISE, (track.scale.length, track.scale.length, 1.0))
    return np.maximum(least, track.usual_rounding)


def _share(track: Track, sigma: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(n, 3), precision of rows by that of noise (3,): less where rounding grows with the value."""
    more = track.rounding[rows] ** 2 - track.usual_rounding**2
    return 1.0 / (1.0 + np.maximum(more, 0.0) / sigma**2)


def _judged(track: Track) -> tuple[np.ndarray, Problem, np.ndarray, Inliers]:
    """Rows of a run in stretches that agree, their problem and origin, and the splines through them."""
    rows = np.flatnonzero(track.fresh.any(axis=1))
    least = np.where(np.isnan(given_noise(track)), least_noise(track), np.inf)
    while True:
        even, origin = _problem(track, rows)
        # A spline that follows a few samples: its time constant is two sampling periods.
        local = 2.0 * (2.0 * track.periods / even.spline.grid.spacing) ** DEGREE
        resolved = bool(2.0 * track.periods.max() <= EVERY * track.scale.time)
        try:
            alone = robust(even, local, least, resolved)
            even = even._replace(sigma=alone.problem.sigma)
            free, longest = np.isnan(given_noise(track)), WIDTH * track.scale.time
            alone = with_correlated(alone, even, track.run.time[even.rows], longest, free)
            return rows, even._replace(sigma=alone.problem.sigma), origin, alone
        except TooFewError as stretch:
            rows = np.setdiff1d(rows, stretch.rows)


def _smooth(track: Track, agreeing: Agreeing) -> Smoothed:
    time, scale = track.run.time - track.run.time[0], track.scale
    rows, even, origin, alone = _judged(track)
    p, smoothness, weights, _ = alone
    grid, dense, sigma = even.spline.grid, even.rows, even.sigma
    pose_only = PoseOnly(rows, weights, sigma, p.spline.stiffness, smoothness)
    inside = within(grid, time)
    bases = [basis(grid, time[inside], k) for k in range(3)]
    fit = solve(p, smoothness, weights)
    psi = origin[2] + spread(bases[0](fit.coefficients), inside)[:, 2]
    first = basis(grid, time[dense[:1]], 1)(fit.coefficients)[0]
    still = idle(scale)
    slow = np.hypot(*first[:2]) < still[0] and abs(first[2]) < still[2]
    north, east, turn = bases[1](fit.coefficients).T
    ahead, _ = rotate_to_body(psi[inside], north, east)
    surge, swing = (np.interp(time, time[inside], x) for x in (ahead, ahead * turn))
    late, steered = acting(track, surge)
    commands = Commands(late, psi, grid, bool(slow), swing)
    p, smoothness, by_commands = with_commands(even, alone, fit, commands)
    response = by_commands
    if (steered or by_commands.described) and not np.isnan(by_commands.delay):
        response = with_bend(even, solve(p, smoothness, weights), commands, by_commands)
    rates = measured_rates(track, dense, psi, agreeing, grid)

    def without(p: Problem, motion: CommandResponse) -> Problem:
        """The measurements less a motion."""
        p = p._replace(z=even.z - motion.eta[dense])
        if rates is None:
            return p
        at, beside = rates
        z = np.where(beside.share > 0.0, beside.z - motion.eta_dot[at], 0.0)
        return p.adapted(rates=beside._replace(z=z))

    if rates is not None:
        p, smoothness = adapt(without(p, by_commands), smoothness, weights)
    p = without(p, response)
    fit = solve(p, smoothness, weights)
    covariance = fit.covariance
    estimated = np.isnan(given_noise(track))
    rel_std, at_most = noise_uncertainty(p, smoothness, weights, fit)
    spikes = track.valid.copy()  # those of parts that agree with nothing
    spikes[rows] = False
    spikes[dense] = track.valid[dense] & (weights[:, 0] == 0.0)
    known = zip(bases, response[:3], strict=True)
    motion = _motion(origin, *(spread(b(fit.coefficients) + x[inside], inside) for b, x in known))
    measured = np.zeros_like(track.fresh)
    measured[dense] = (weights > 0.0) & track.fresh[dense]
    track = replace(track, pose=np.where(measured | ~track.valid[:, None], track.pose, motion.eta))
    eta_std, eta_dot_std, eta_ddot_std = (spread(np.sqrt(b.variance(covariance)), inside) for b in bases)
    covariances = _state_covariance(motion.eta, motion.nu, eta_std, eta_dot_std)
    return Smoothed(
        track,
        spikes,
        measured,
        *motion,
        eta_std,
        eta_dot_std,
        eta_ddot_std,
        np.sqrt(covariances[:, range(3, 6), range(3, 6)]),
        sigma,
        sigma**2 / (smoothness * grid.spacing**DEGREE),
        response.delay,
        response.sure,
        pose_only,
        tuple(_doubted(track, alone, even)),
        noise_rel_std=np.where(estimated, rel_std, 0.0),
        noise_at_most=estimated & at_most,
        covariance=SplineCovariance(
            grid, np.array([system.factor for system in fit.systems]), float(track.run.time[0])
        ),
    )


def _doubted(track: Track, found: Inliers, even: Problem) -> Iterator[str]:
    """Given noise that the samples contradict, a line each: a free one is far likelier, and far off."""
    given = given_noise(track)
    if np.isnan(given).all():
        return
    free = even._replace(sigma=_first_guess(track, even.rows))
    free, smoothness = with_noise(
        free, likeliest(free, found.weights), found.weights, least_noise(track)
    )
    pairs = zip(criteria(even, found.weights), criteria(free, found.weights), strict=True)
    for k, (held, other) in enumerate(pairs):
        size = float(free.sigma[k] / given[k])
        if np.isnan(size) or 1.0 / MISSTATED < size < MISSTATED:
            continue
        fall = held.cost(np.log10(found.even[k])) - other.cost(np.log10(smoothness[k]))
        decades = 0.5 * fall / float(np.log(10.0))
        if decades > -np.log10(CHANCE):
            unit = "rad" if POSE[k] == "psi" else "m"
            odds = f"10^{decades:.0f}" if decades < 100.0 else "more than 10^100"
            yield (
                f"the noise of {POSE[k]} is given as {given[k]:.3g} {unit}, its samples scatter by "
                f"{free.sigma[k]:.2g} {unit} ({odds} : 1): remove the noise of the side-car, then "
                "it is estimated" + FILTERED * (size < 1.0)
            )


def measured_rates(
    track: Track, rows: np.ndarray, psi: np.ndarray, agreeing: Agreeing, grid: Knots
) -> tuple[np.ndarray, Rates] | None:
    """Rows with a pose that have derivatives that agree with it, and these; None: there are none.

    A value that repeats is no sample. The noise of a channel is no less than that of its third
    differences.
    """
    run = track.run
    by = next((pair for pair in VELOCITIES if pair[0] in agreeing), None)
    fresh = np.zeros((run.time.size, 3), bool)
    for axes, names in ((PLACE, by), (HEADING, ("r",) if "r" in agreeing else None)):
        if names:
            values = np.column_stack([run.measured[name] for name in names])
            there = np.asarray(np.isfinite(values).all(axis=1))
            fresh[:, axes] = (there & ~repeated(values, there))[:, None]
    at = rows[fresh[rows].any(axis=1)]
    if not at.size:
        return None
    z, sigma, share = np.zeros((at.size, 3)), np.full(3, np.inf), fresh[at].astype(float)
    if by is not None:
        z[:, :2] = velocity_over_ground(run.rows(at), by, psi[at])
        sigma[:2] = max(agreeing[by[0]], run.noise.get(by[0], 0.0))
    if "r" in agreeing:
        z[:, 2] = run.measured["r"][at]
        sigma[2] = max(agreeing["r"], run.noise.get("r", 0.0))
    scatter = [
        noise(z[new, k : k + 1])[0] if new.sum() > ORDER else 0.0 for k, new in enumerate(share.T > 0.0)
    ]
    z = np.where(share > 0.0, z, 0.0)
    return at, Rates(z, basis(grid, run.time[at] - run.time[0], 1), np.maximum(sigma, scatter), share)


def breaks(rows: np.ndarray, track: Track) -> np.ndarray:
    """(n - 1,): between which of some rows (n,) of a run too much is missing to be bridged.

    Where a pose is missing, the commands lead over the gap; where they are missing, too, nothing does.
    """
    long = np.diff(track.run.time[rows]) > max(WIDTH * track.scale.time, LONG * track.period)
    return long | (np.diff(track.silences[rows]) > 0)


def stretches(rows: np.ndarray, track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Start and end [s], since the run's, of the parts between long gaps that have enough samples."""
    time = track.run.time[rows] - track.run.time[0]
    cut = np.flatnonzero(breaks(rows, track))
    first, last = np.concatenate([[0], cut + 1]), np.concatenate([cut, [time.size - 1]])
    # A heading may be measured in rows of its own.
    until = np.vstack([np.zeros((1, 3), int), np.cumsum(track.fresh, axis=0)])
    of_channel = (until[rows[last] + 1] - until[rows[first]]).min(axis=1)
    enough = (last - first + 1 >= FEWEST) & (of_channel > ORDER)
    if not enough.any():
        raise InputError(f"run '{track.run.name}': fewer than {FEWEST} samples between long gaps")
    return time[first[enough]], time[last[enough]]


def within(grid: Knots, time: np.ndarray) -> np.ndarray:
    """(n,), which times [s] lie in a stretch."""
    stretch = np.searchsorted(grid.start, time, side="right") - 1
    return (stretch >= 0) & (time <= grid.end[stretch])


def spread(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Values (k, 3) in the k rows of a mask (n,), NaN in the others."""
    found = np.full((where.size, values.shape[1]), np.nan)
    found[where] = values
    return found


def _state_covariance(
    eta: np.ndarray, nu: np.ndarray, eta_std: np.ndarray, eta_dot_std: np.ndarray
) -> np.ndarray:
    """Covariance (n, 6, 6) of x, y, psi, u, v, r; pose, its rate and the channels are independent.

    A velocity over ground is seen from the body: with the heading's error, u and v have one, too.
    """
    (c, s), (u, v) = (np.cos(eta[:, 2]), np.sin(eta[:, 2])), nu.T[:2]
    J = np.broadcast_to(np.eye(6), (len(eta), 6, 6)).copy()
    J[:, 3, 2], J[:, 4, 2] = v, -u
    J[:, 3, 3], J[:, 3, 4], J[:, 4, 3], J[:, 4, 4] = c, s, -s, c
    variance = np.hstack([eta_std, eta_dot_std])[:, None] ** 2
    return J * variance @ J.transpose(0, 2, 1)
