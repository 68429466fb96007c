"""Pose, velocity and acceleration of a measured run without any model of the ship.

Each channel is taken for a process driven by the commands (:mod:`.push`) and by white jerk, and measured
with white noise. The noise is estimated from third differences, the jerk's spectral density by
likelihood, its course over time from the jerk that is found; a sample further than five standard
deviations from where all the others say it should be is a spike.
"""

from dataclasses import dataclass

import numpy as np

from cosim import InputError
from fmus.frames import rotate_to_body

from .cleaning import Counts, Track, noise
from .fitting import Problem, TooFewError, solve, trusted
from .push import Course, Push, followed
from .spline import Knots, basis, inverse_band, knots, penalty, variance

BREAK = 3.0  # s; over a longer gap nothing is said
SPACING = 0.05  # s between knots, or a sampling period if that is longer
FEWEST = 20  # samples in a stretch
NOTICED = 0.1  # s; a delay that is worth a word
# Below this a measurement means nothing, and the kinks of a stepwise force would be spikes [m, m, rad].
LEAST_NOISE = 2e-5


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A run as it most likely was. All arrays (n, 3) are NaN where too much is missing.

    Attributes:
        track: the run with its samples judged.
        spikes: (n,), samples refused by the gate.
        eta, eta_dot, eta_ddot: pose, heading continuous, and derivatives [m, m, rad; /s; /s2].
        nu: body-fixed velocity over ground [m/s, m/s, rad/s].
        eta_std, eta_dot_std, eta_ddot_std, nu_std: their standard deviations.
        noise: (3,), standard deviation of the measurement [m, m, rad].
        jerk: (3,), mean spectral density of the jerk that is not the commands' [m2/s5, m2/s5, rad2/s5].
        late: after how long the commands act [s], as far as the pose tells; NaN where it does not.
    """

    track: Track
    spikes: np.ndarray
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
    late: float

    @property
    def time(self) -> np.ndarray:
        """(n,) [s]."""
        return self.track.run.time

    @property
    def used(self) -> np.ndarray:
        """(n,), samples that count: new, no spike, in a stretch that could be smoothed."""
        return self.track.valid & ~self.spikes & np.isfinite(self.eta[:, 0])

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found in the data, a line each."""
        if not self.late >= NOTICED:
            return self.track.notes
        late = f"commands act {self.late:.2f} s after they are given, as the pose tells without a model"
        return (*self.track.notes, late)

    @property
    def counts(self) -> Counts:
        """What became of the samples."""
        return self.track.counts(int(self.spikes.sum()))


def smooth(track: Track, driven: bool = True) -> Smoothed:
    """Smooth a run.

    Args:
        track: the run.
        driven: whether what jerks with the commands is known for that, see :mod:`.push`. Without, the
            spline follows whatever is quick, and noise with it.

    Raises:
        InputError: no stretch of it is dense enough.
    """
    rows = np.flatnonzero(track.valid)
    while True:
        try:
            return _smooth(track, rows, driven)
        except TooFewError as stretch:
            rows = np.setdiff1d(rows, stretch.rows)


def _smooth(track: Track, rows: np.ndarray, driven: bool) -> Smoothed:
    """Smooth a run by some of its rows."""
    time, origin = track.run.time - track.run.time[0], np.nanmedian(track.pose, axis=0)
    grid = knots(*stretches(time[rows], track), max(SPACING, track.period))
    inside = within(grid, time)
    dense = rows[inside[rows]]
    z = track.pose[dense] - origin
    sigma = np.maximum(noise(z), LEAST_NOISE)
    stiff = np.array(3 * [penalty(grid, np.ones(int(grid.intervals.sum())))])
    even = Problem(dense, z, basis(grid, time[dense]), grid, stiff, sigma)
    local = np.full(3, 64.0 * (track.period / grid.spacing) ** 5)  # follows a few samples
    adapted, smoothness, weights = trusted(even, local)
    fit, pushed = solve(adapted, smoothness, weights), Push.none(time.size)
    if driven:
        psi = origin[2] + spread(basis(grid, time[inside])(fit.coefficients), inside)[:, 2]
        smoothness, fit, pushed = followed(even, smoothness, fit, weights, Course(track, psi, grid))
    inverse = inverse_band(fit.factors) * sigma[:, None] ** 2
    spikes = track.valid.copy()
    spikes[rows] = False
    spikes[dense] = weights == 0.0
    found = []
    for derivative, known in enumerate(pushed[:3]):
        b = basis(grid, time[inside], derivative)
        found += [spread(b(fit.coefficients) + known[inside], inside)]
        found += [spread(np.sqrt(variance(b, inverse)), inside)]
    eta, eta_std, eta_dot, eta_dot_std, eta_ddot, eta_ddot_std = found
    eta += origin
    u, v = rotate_to_body(eta[:, 2], eta_dot[:, 0], eta_dot[:, 1])
    return Smoothed(
        track,
        spikes,
        eta,
        eta_dot,
        eta_ddot,
        np.column_stack([u, v, eta_dot[:, 2]]),
        eta_std,
        eta_dot_std,
        eta_ddot_std,
        _body_std(eta, u, v, eta_std, eta_dot_std),
        sigma,
        sigma**2 / (smoothness * grid.spacing**5),
        pushed.late,
    )


def breaks(time: np.ndarray, track: Track) -> np.ndarray:
    """(n - 1,): which gaps between times (n,) [s] of a run are too long to say anything over them."""
    return np.diff(time) > max(BREAK, 10.0 * track.period)


def stretches(time: np.ndarray, track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Start and end [s] of the parts of a run between long gaps that have enough samples."""
    cut = np.flatnonzero(breaks(time, track))
    first, last = np.concatenate([[0], cut + 1]), np.concatenate([cut, [time.size - 1]])
    enough = last - first + 1 >= FEWEST
    if not enough.any():
        raise InputError(f"run '{track.run.name}': nowhere {FEWEST} samples without a long gap")
    return time[first[enough]], time[last[enough]]


def within(grid: Knots, time: np.ndarray) -> np.ndarray:
    """(n,), which times [s] lie in a stretch."""
    stretch = np.searchsorted(grid.start, time, side="right") - 1
    return (stretch >= 0) & (time <= grid.end[stretch])


def spread(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Values (k, 3) at the k rows that are meant, NaN at the others."""
    found = np.full((where.size, values.shape[1]), np.nan)
    found[where] = values
    return found


def _body_std(
    eta: np.ndarray, u: np.ndarray, v: np.ndarray, eta_std: np.ndarray, eta_dot_std: np.ndarray
) -> np.ndarray:
    """Standard deviation of nu (n, 3), the heading's included; the channels are independent."""
    c2, s2 = np.cos(eta[:, 2]) ** 2, np.sin(eta[:, 2]) ** 2
    x, y = eta_dot_std[:, 0] ** 2, eta_dot_std[:, 1] ** 2
    turn = eta_std[:, 2] ** 2
    ahead, aside = c2 * x + s2 * y + v**2 * turn, s2 * x + c2 * y + u**2 * turn
    return np.column_stack([np.sqrt(ahead), np.sqrt(aside), eta_dot_std[:, 2]])
