"""With what a model error repeats: with place, heading, motion, commands or time, or none of them.

A window's error is predicted by the mean over its neighbours in a space (place, heading, motion,
commands), of windows that are two blocks from it in time or in another run. The squared correlation of
prediction and error is the share that repeats there. At a place surge and sway may repeat in the body
frame, as drag does, or to north and east, as the pull of a cable. By chance it is as in series that are
shifted in time against that space, which keeps how long an error lasts.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...predictors import WeakWindows
from ...predictors.uncertainty import correlated_windows
from ...predictors.weak_form import BLOCK, common_commands
from ...runs.run_constants import CHANCE, NEGLIGIBLE
from ..regions import numbered
from ..settings import SETTINGS
from .structural_change import STRETCH, moment_of_change

TOGETHER = "place and motion"  # the space of both, where an error repeats in none alone


class Recurrence(NamedTuple):
    """How an axis' model error comes again.

    Attributes:
        shares: space -> share of the sum of squares that repeats in it; 0 where that is chance.
        lasts: s, how long the error stays correlated; infinite: through whole runs.
        in_part: whether it is in proportion to the command of its axis, at times more and at times less.
        run: the only one of several runs that has it, but for a negligible rest; empty: there is none.
        changes: name of the run and time [s] at which it changes; None: at no moment.
    """

    shares: dict[str, float]
    lasts: float
    in_part: bool
    run: str = ""
    changes: tuple[str, float] | None = None

    @property
    def best(self) -> str | None:
        """The space in which most repeats; None: there is none."""
        name = max(self.shares, key=lambda n: self.shares[n])
        return name if self.shares[name] >= SETTINGS.repeats else None


def recurrence(data: Sequence[WeakWindows], left: np.ndarray) -> list[Recurrence]:
    """How the model error of each axis comes again.

    Args:
        data: windows of each run.
        left: (K, 3), model error in them, one run after the other [N, N, N m].
    """
    run = np.repeat(np.arange(len(data)), [w.middle.size for w in data])
    time = np.concatenate([w.middle for w in data])
    place, motion, command, turn = (np.concatenate(x) for x in zip(*map(_of_run, data), strict=True))
    to_earth = (left[:, 0] + 1j * left[:, 1]) * turn
    apart = 2 * BLOCK * data[0].scale.time
    least = round(apart / data[0].every) + 1  # windows, of a shift after which none is its own neighbour
    count = SETTINGS.neighbours + 2 * least  # a pass of so long to both sides has fewer windows
    heading = np.column_stack([np.real(turn), np.imag(turn)])
    spaces = {
        "place": place,
        "motion": _scaled(motion),
        "command": _scaled(command),
        "heading": heading,
    }
    neighbours = {name: _neighbours(x, run, time, apart, count) for name, x in spaces.items()}
    neighbours["time"] = _neighbours(time[:, None], run, time, np.inf, count)
    by_orders = None
    if common_commands(data):
        orders = np.concatenate([w.held @ w.run.given for w in data])
        by_orders = _neighbours(_scaled(orders), run, time, apart, count)
    at_a_place = np.hstack([_scaled(place), spaces["motion"]])
    together = _neighbours(at_a_place, run, time, apart, count)
    rng = np.random.default_rng(0)
    shifts = round(1.0 / CHANCE) - 1
    offsets = rng.integers(least, max(len(left) - least, least + 1), shifts)
    lasts = data[0].every * correlated_windows(data, left)
    lasts[lasts > max(np.ptp(w.middle) for w in data)] = np.inf
    stretch = numbered([np.arange(w.middle.size) // STRETCH for w in data])
    found = []
    for k in range(3):
        error = left[:, k]
        shares = {name: _share(error, near, offsets) for name, near in neighbours.items()}
        if k < 2:
            fixed = _share(to_earth, neighbours["place"], offsets, (np.real, np.imag)[k], turn)
            shares["place"] = max(shares["place"], fixed)
        if by_orders is not None:  # as of a jet that takes force from another actuator
            shares["command"] = max(shares["command"], _share(error, by_orders, offsets))
        if not any(shares.values()):  # as of a damping that is larger at some places
            shares[TOGETHER] = _share(error, together, offsets)
        others = (np.ones_like(error), motion[:, k])
        in_part = _in_part(error, command[:, k], others, stretch, shares["command"])
        size = np.bincount(run, error**2) / np.bincount(run)
        one = int(size.argmax())
        alone = len(data) > 1 and size[one] > (1.0 - NEGLIGIBLE) * size.sum()
        regressors = _scaled(np.column_stack([*others, command[:, k]]))
        changes = moment_of_change(data, error, regressors, max(shares.values()))
        one_run = data[one].run.name if alone else ""
        found.append(Recurrence(shares, float(lasts[k]), in_part, one_run, changes))
    return found


def _of_run(w: WeakWindows) -> tuple[np.ndarray, ...]:
    """Means over the windows of a run: place (K, 2), motion (K, 3), command (K, 3), heading (K,).

    The heading is a rotation in the complex plane, north its real axis.
    """
    eta, nu = (np.where(w.known[:, None], x, 0.0) for x in (w.smoothed.eta, w.smoothed.nu))
    ahead = w.smooth @ np.exp(1j * eta[:, 2])
    return w.smooth @ eta[:, :2], w.smooth @ nu, w.held @ w.run.tau_cmd, ahead / np.abs(ahead)


def _scaled(x: np.ndarray) -> np.ndarray:
    spread = x.std(axis=0)
    return x / np.where(spread > 0.0, spread, 1.0)


def _neighbours(
    x: np.ndarray, run: np.ndarray, time: np.ndarray, least: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (K, n) of the nearest windows of another run or time, and which of them there are.

    Nearest by places x (K, k), among so many, and apart by at least so many seconds; infinite: only of
    other runs. A window has none where it is alone, as at a speed that is reached once: of a linear
    function of x too little repeats at such a distance.
    """
    rows = KDTree(x).query(x, min(count, len(x)))[1].reshape(len(x), -1)
    apart = (run[rows] != run[:, None]) | (np.abs(time[rows] - time[:, None]) >= least)
    order = np.argsort(~apart, axis=1, kind="stable")[:, : SETTINGS.neighbours]
    rows, there = (np.take_along_axis(each, order, axis=1) for each in (rows, apart))
    alone = np.sum((_mean(x, rows, there) - x) ** 2, axis=1) > SETTINGS.repeats * x.var(axis=0).sum()
    return rows, there & ~alone[:, None]


def _mean(x: np.ndarray, rows: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Mean over the neighbours (K, n) of each window, of x (K, k); zero where there is none."""
    return np.einsum("kn,kn...->k...", there, x[rows]) / np.maximum(there.sum(axis=1), 1)[:, None]


def _share(
    error: np.ndarray,
    near: tuple[np.ndarray, np.ndarray],
    offsets: np.ndarray,
    part: Callable[[np.ndarray], np.ndarray] = np.real,
    turn: np.ndarray | float = 1.0,
) -> float:
    """Share of an error that its neighbours foretell; 0 if that is chance.

    Args:
        error: (K,); of surge and sway together to north and east, in the complex plane.
        near: of :func:`_neighbours`.
        offsets: shifts in time, of which chance is made.
        part: of it after a rotation, the real or the imaginary one.
        turn: (K,), heading in the complex plane.
    """

    def foretold(x: np.ndarray) -> float:
        mean = part(_mean(x[:, None], *near)[:, 0] * np.conj(turn))
        own = part(x * np.conj(turn))
        size = float(np.sqrt((mean @ mean) * (own @ own)))
        return max(float(mean @ own), 0.0) ** 2 / size**2 if size > 0.0 else 0.0

    share = foretold(error)
    if share < SETTINGS.repeats:
        return 0.0
    return share if all(foretold(np.roll(error, int(n))) < share for n in offsets) else 0.0


def _in_part(
    error: np.ndarray,
    command: np.ndarray,
    others: Sequence[np.ndarray],
    stretch: np.ndarray,
    always: float,
) -> bool:
    """Whether the command with an amplitude of its own for each stretch gives far more of an error than
    others with theirs, and than the command gives ``always``.

    The others (K,) are a constant force, and a damping by the velocity of the axis.
    """

    def explained(x: np.ndarray) -> float:
        top, bottom = np.bincount(stretch, x * error), np.bincount(stretch, x * x)
        squares = np.sum(top[bottom > 0.0] ** 2 / bottom[bottom > 0.0])
        return float(squares / max(error @ error, np.finfo(float).tiny))

    return explained(command) > max(*map(explained, others), always) + NEGLIGIBLE
