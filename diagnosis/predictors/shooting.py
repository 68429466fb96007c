"""Windows that models are fitted on: predicted pose at a few instants of each, and what is known of it.

Every window starts from the smoothed state. All windows of all runs are integrated together, all
parameters' finite differences as further rows, with the functions of vessel and thrusters.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from fmus.ops import wrap
from fmus.vessel import vessel

from ..runs import Smoothed
from ..runs.run_constants import DIGITS, NEGLIGIBLE
from .prediction import WindowStarts, arriving, filtered, propagate, stacked
from .ship_model import Model, parameter_and_run
from .thrust import Response
from .traced.recorded_step import Inputs, Ready, thrust_at
from .windows import usable_windows

INSTANTS = 16  # 1, of a window at which pose and prediction are compared
# 1, steps between two instants: at least a tenth of the quickest motion's time in the longest windows;
# at most, where a command that changes within a step has other effects than its mean.
PARTS, MOST_PARTS = 4, 64
UNKNOWN = 1e6  # rad2, and m2 times the scale of the ship; variance of an instant without a sample


@dataclass(frozen=True, eq=False)
class Linear:
    """A model's motion about its predictions.

    Attributes:
        slope: (w, T, 6, 6), derivative of the rate of (x, y, psi, u, v, r), from instant to instant.
        by_mass: (3, 3), acceleration by a force; (w, 1, 3, 3) where the load differs between runs.
        every: time between instants [s].
    """

    slope: np.ndarray
    by_mass: np.ndarray
    every: float

    def __getitem__(self, windows: np.ndarray) -> "Linear":
        """The motion in some of the windows."""
        by_mass = self.by_mass[windows] if self.by_mass.ndim > 2 else self.by_mass
        return Linear(self.slope[windows], by_mass, self.every)


@dataclass(frozen=True, eq=False)
class Around:
    """A model's predictions in windows, and what changes them.

    Attributes:
        residuals: (w, T, 3), measured minus predicted pose [m, m, rad], heading wrapped.
        slopes: (w, T, 3, q), change of the predicted pose by one unit of each of some parameters.
        motion: about the predictions, for their uncertainty.
    """

    residuals: np.ndarray
    slopes: np.ndarray
    motion: Linear


class Shooting:
    """The windows of one length of some runs with one kind of commands.

    Args:
        runs: smoothed runs.
        length: of the windows [s].

    Attributes:
        runs: as given.
        run, start: (w,), number of each window's run, and when it starts [s].
        since: (T,), time from a window's start to its instants [s].
        measured: (w, T, 3), pose [m, m, rad], the mean of the samples around each instant.
        noise: (w, T, 3), its variance by the measurement's noise, UNKNOWN without a sample.
        at_start: (w, 6, 6), covariance of x, y, psi, u, v, r where windows begin.
    """

    def __init__(self, runs: Sequence[Smoothed], length: float) -> None:
        self.runs = tuple(runs)
        rows = [usable_windows(smoothed, length).first_rows for smoothed in runs]
        self.every = length / INSTANTS
        groups = tuple(zip(runs, rows, strict=True))
        self.starts = WindowStarts(groups, self.every / PARTS, INSTANTS * PARTS)
        self.since = self.every * np.arange(1.0, INSTANTS + 1.0)
        self.run = np.repeat(np.arange(len(runs)), [r.size for r in rows])
        self.start = np.concatenate([s.time[r] for s, r in groups])
        seen = [_seen(s, s.time[r][:, None] + self.since, 0.5 * self.every) for s, r in groups]
        self.measured, self.noise = (np.concatenate(part) for part in zip(*seen, strict=True))
        self.at_start = np.concatenate([s.state_covariance(r) for s, r in groups])
        self._thrust: dict[object, tuple[np.ndarray, np.ndarray]] = {}
        self._of_runs: list[Shooting] = []

    @classmethod
    def accurate(cls, runs: Sequence[Smoothed], length: float, model: Model) -> "Shooting":
        """Windows with steps so short that a model's residuals hardly change if they are halved."""
        found = cls(runs, length)
        residuals = found.residuals(model)
        while found.parts < MOST_PARTS:
            finer = found.in_parts(2 * found.parts)
            coarse, residuals = residuals, finer.residuals(model)
            changes, left = _squares(_off(residuals, coarse)), _squares(residuals)
            if (changes <= NEGLIGIBLE**2 * left).all():
                break
            found = finer
        return found

    @property
    def parts(self) -> int:
        """Steps between two instants."""
        return self.starts.steps // INSTANTS

    def in_parts(self, parts: int) -> "Shooting":
        """The same windows with another number of steps between two instants."""
        found = copy(self)
        found.starts = replace(self.starts, h=self.every / parts, steps=INSTANTS * parts)
        found._thrust, found._of_runs = {}, []
        return found

    def _alone(self, model: Model) -> list[tuple["Shooting", str]]:
        """Windows that have the same values of a model: all, or those of each run, with its name."""
        if not model.runs:
            return [(self, "")]
        if not self._of_runs:
            groups = [(k, one) for k, one in enumerate(self.starts.runs) if one[1].size]
            self._of_runs = [self._part(self.run == k, one) for k, one in groups]
        return [(one, one.runs[0].track.run.name) for one in self._of_runs]

    def _part(self, own: np.ndarray, group: tuple[Smoothed, np.ndarray]) -> "Shooting":
        """The windows of one run, of which ``own`` (w,) are true."""
        found = copy(self)
        found.runs, found.starts = (group[0],), replace(self.starts, runs=(group,))
        found.run, found.start = np.zeros(own.sum(), int), self.start[own]
        found.measured, found.noise, found.at_start = (
            x[own] for x in (self.measured, self.noise, self.at_start)
        )
        found._thrust, found._of_runs = {}, []
        return found

    def _states(self, model: Model, like: Model | None = None) -> list[vessel.State]:
        """States at the start and at the instants; the thrusters respond as those of ``like``."""
        steps = propagate(self.starts, model, self._arriving(like or model))
        return [s for k, s in enumerate(steps) if k % self.parts == 0]

    def _arriving(self, model: Model) -> tuple[np.ndarray, np.ndarray]:
        """Commands that arrive and shares that act, kept for models whose thrusters respond alike."""
        key = Response.key(model)
        if key not in self._thrust:
            self._thrust = {key: arriving(self.starts, model)}
        return self._thrust[key]

    def residuals(self, model: Model) -> np.ndarray:
        """(w, T, 3): measured minus predicted pose [m, m, rad], heading wrapped."""
        return np.concatenate([one._residuals(model.during(run)) for one, run in self._alone(model)])

    def _residuals(self, model: Model) -> np.ndarray:
        return _off(self.measured, self._poses(self._states(model), model)[0])

    def around(self, model: Model, steps: Mapping[str, float]) -> Around:
        """A model's predictions and what changes them."""
        changed = {n: model.plus({n: h}) for n, h in steps.items()}
        parts = []
        for one, run in self._alone(model):
            own = {n: m.during(run) for n, m in changed.items() if parameter_and_run(n)[1] in ("", run)}
            parts.append(one._around(model.during(run), own, steps))
        return parts[0] if len(parts) == 1 else _together(parts)

    def _around(self, model: Model, changed: Mapping[str, Model], steps: Mapping[str, float]) -> Around:
        key = Response.key(model), model.filters
        same = {n: m for n, m in changed.items() if (Response.key(m), m.filters) == key}
        together = stacked([model, *same.values()])
        states = self._states(together, model)
        motion = self._linear(states, model)
        base, *others = self._poses(states, together)
        found = dict(zip(same, others, strict=True))
        found |= {n: self._poses(self._states(m), m)[0] for n, m in changed.items() if n not in found}
        slopes = [_off(found.get(n, base), base) / h for n, h in steps.items()]
        by_parameter = np.stack(slopes, axis=-1) if slopes else np.zeros((*base.shape, 0))
        return Around(_off(self.measured, base), by_parameter, motion)

    def _poses(self, states: Sequence[vessel.State], model: Model) -> np.ndarray:
        """(p, w, T, 3): measured pose at the instants; parameters of the model may be arrays (p, 1)."""
        with np.errstate(all="ignore"):
            poses = np.stack(
                np.broadcast_arrays(*(x for s in states for x in vessel.measured(s, model.hull)))
            )
            poses = poses.reshape(len(states), 3, *poses.shape[1:])
            found = filtered(poses, model, self.starts, self.every)
        return np.ascontiguousarray(found[1:].transpose(2, 3, 0, 1))

    def _linear(self, states: Sequence[vessel.State], model: Model) -> Linear:
        first = [[np.broadcast_arrays(x, s.u)[0][0] for x in s] for s in states]
        s = vessel.State._make(np.array(first).swapaxes(0, 1))
        least = DIGITS * np.array([1.0, *model.ship.scale.speeds])
        variance = self.at_start[:, range(2, 6), range(2, 6)].T
        reach = np.maximum(np.sqrt(3.0 * variance), least[:, None])
        ready = Ready(model.hull, self.starts.drive(model))
        with np.errstate(all="ignore"):
            rates = _slopes(s, self._inputs(model), ready, reach)
        i11, i22, i23, i32, i33 = model.hull.hull.inverse
        by_mass = np.array([[i11, 0.0, 0.0], [0.0, i22, i23], [0.0, i32, i33]])
        return Linear(0.5 * (rates[:, 1:] + rates[:, :-1]), by_mass, self.every)

    def _inputs(self, model: Model) -> Inputs:
        """What acts at the start and at the instants, each (T + 1, w)."""
        starts = self.starts
        row = np.minimum(self.parts * np.arange(INSTANTS + 1), starts.steps - 1)
        given, acting = (x[row][:, :, 0].swapaxes(0, 1) for x in self._arriving(model))
        power, air = starts.power(model.clock), starts.air(model)
        return Inputs(
            given,
            acting,
            None if power is None else power[row].swapaxes(0, 1),
            None if air is None else air[row][:, :, 0].swapaxes(0, 1),
        )


def _seen(s: Smoothed, times: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Pose (w, T, 3) about some times (w, T) [s], and its variance by noise: means of samples in reach.

    The mean is that of the samples' distance from the smoothed pose, which hardly bends in between.
    """
    known = np.isfinite(s.eta[:, 0])
    smooth = CubicHermiteSpline(s.time[known], s.eta[known], s.eta_dot[known])(times)
    off = np.where(s.used[:, None], s.track.pose - s.eta, 0.0)
    off[:, 2] = wrap(off[:, 2])
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(off, axis=0)])
    counts = np.concatenate([[0], np.cumsum(s.used)])
    low, high = (np.searchsorted(s.time, times + side) for side in (-reach, reach))
    number = (counts[high] - counts[low])[..., None]
    some = np.maximum(number, 1)
    area = s.scale.length**2
    noise = np.where(number > 0, s.noise**2 / some, UNKNOWN * np.array([area, area, 1.0]))
    return smooth + (sums[high] - sums[low]) / some, noise


def _together(parts: Sequence[Around]) -> Around:
    """Predictions in the windows of some runs, one after the other."""
    motions = [part.motion for part in parts]
    by_mass = [np.broadcast_to(m.by_mass, (len(m.slope), 1, 3, 3)) for m in motions]
    slope = np.concatenate([m.slope for m in motions])
    return Around(
        np.concatenate([part.residuals for part in parts]),
        np.concatenate([part.slopes for part in parts]),
        Linear(slope, np.concatenate(by_mass), motions[0].every),
    )


def _squares(off: np.ndarray) -> np.ndarray:
    """(2,): sums of squares of position and heading (w, T, 3), but for windows that run away."""
    x, y, psi = np.square(off[np.isfinite(off).all(axis=(1, 2))]).sum(axis=(0, 1))
    return np.array([x + y, psi])


def _off(pose: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Difference of poses (..., 3), heading wrapped."""
    with np.errstate(invalid="ignore"):
        off = pose - other
        off[..., 2] = wrap(off[..., 2])
    return off


def _slopes(s: vessel.State, i: Inputs, b: Ready, reach: np.ndarray) -> np.ndarray:
    """(w, T, 6, 6), derivative of the rate of pose and velocity by themselves, with what acts.

    Args:
        s, i: states and inputs, each (T, w).
        b: of the model.
        reach: (4, w), of psi, u, v and r; the slope is the mean between both sides. Over the square root
            of three standard deviations it is right for a normal distribution to the third order
            (M. Nørgaard, N. K. Poulsen, O. Ravn, Automatica 36, 2000), and a small jump does no harm.
    """

    def rate(at: vessel.State) -> np.ndarray:
        tau, hull = thrust_at(at, i, b)
        return np.stack(np.broadcast_arrays(*vessel.disturbed(at, tau, hull), at.u)[:3], axis=-1)

    c, sn = np.cos(s.psi), np.sin(s.psi)
    found = np.zeros((*s.u.shape, 6, 6))
    found[..., 0, 2], found[..., 1, 2] = -sn * s.u - c * s.v, c * s.u - sn * s.v
    found[..., 0, 3], found[..., 0, 4], found[..., 1, 3], found[..., 1, 4] = c, -sn, sn, c
    found[..., 2, 5] = 1.0
    for k, (name, step) in enumerate(zip(("psi", "u", "v", "r"), reach, strict=True)):
        low, high = (rate(s._replace(**{name: getattr(s, name) + side})) for side in (-step, step))
        found[..., 3:, 2 + k] = (high - low) / (2.0 * step)[:, None]
    return found.swapaxes(0, 1)
