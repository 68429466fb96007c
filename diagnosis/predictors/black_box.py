"""A predictor that is known by its answers only: a motion from a state on, and accelerations in states.

**Windows.** Where its velocity can be set, a black box starts in each window from the smoothed state,
as the models of this project do. Else it runs through the whole run from its own start; of a ship that
is under way when the run begins, the first part, the run-in, does not count. Where its pose cannot be
set, the track that it gives is laid onto the measured pose where the comparison begins, in place and
heading.

**Model error, by inverse use.** In the measured state and with the command of each sample, the black
box accelerates by nu_dot, and the model of the ship by another nu_dot. The difference, times the
inertia, is a force over time, linear in pose and velocity about the measured ones, that makes the model
what the black box is along the run. With it as a given force (:class:`.ship_model.SampledForce`) all
that is done with a model can be done with the black box: its model error, and the library's effects in
addition to it. A black box whose velocity cannot be set is asked along its own prediction of the run,
in place of the measured one.

Where it takes forces, its inertia is that by which it answers them, and the model has the same, so that
forces are its own; else that of the ship.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from cosim import InputError
from fmus.frames import rotate_to_earth
from fmus.ops import wrap

from ..runs import Fingerprint, Run, Smoothed, body_velocity
from ..runs.cleaning import between
from ..runs.columns.columns import TAU
from ..runs.run_constants import DIGITS
from .described_ship import DescribedShip, windows_of
from .prediction import WindowStarts, at_rest
from .predictor import Predictor, PredictorDescription
from .ship_model import Model, SampledForce
from .thrust import FORGOTTEN
from .weak_form import SMALL, WeakWindows, acceleration, inflow_along, thrust_along
from .windows import Windows, between_steps, first_row, first_time, free_runs, step_of

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")
MOTION = (*POSE, *VELOCITY)

# Name of a pose, velocity, force or command -> values (n,) [SI].
Signals = Mapping[str, np.ndarray]


class BlackBox(ABC):
    """The part of :class:`.predictor.Predictor` that follows from answers.

    Args:
        name: of the black box, as messages have it.
        runs: that it predicts, no two of the same name.
        ship: model of the ship.

    Attributes:
        kind, sha256, given_map: see :class:`.predictor.PredictorDescription`.
        learned_from: runs of which it was learned, as far as it tells.
        starts: what a prediction can begin with, of :data:`MOTION`.
        inputs: the forces and commands that it takes.
        own_run_in: the run-in of every run [s]; None: none from rest, else the usual one.
    """

    parametric = False
    kind, sha256 = "black box", ""
    learned_from: tuple[Fingerprint, ...] = ()

    def __init__(self, name: str, runs: Sequence[WeakWindows], ship: Model) -> None:
        self.name, self.runs, self.ship = name, runs, ship
        self.starts: frozenset[str] = frozenset(MOTION)
        self.inputs: frozenset[str] = frozenset()
        self.given_map: Mapping[str, Any] = {}
        self.own_run_in: float | None = None

    @abstractmethod
    def motion(self, smoothed: Smoothed, rows: np.ndarray, h: float, steps: int) -> np.ndarray:
        """Predictions of a run that begin in some of its rows, with the commands of the run.

        Args:
            smoothed: the run.
            rows: (w,), where they begin.
            h: length of a step [s]; a command acts from its time to the next.
            steps: of each.

        Returns:
            (steps + 1, 6, w), see :data:`MOTION`; NaN where the black box does not give a quantity.

        Raises:
            InputError: the black box fails.
        """

    @abstractmethod
    def accelerations(self, signals: Signals) -> np.ndarray:
        """nu_dot (n, 3) [m/s2, m/s2, rad/s2] of the body in some states.

        Raises:
            InputError: the black box fails.
        """

    @property
    def _started_by(self) -> str:
        """What sets a measured state, a part of a sentence."""
        return ""

    @property
    def whole(self) -> bool:
        return not set(VELOCITY) <= self.starts

    @property
    def placed(self) -> bool:
        """Whether predictions are laid onto the measured pose, for that cannot be set."""
        return not set(POSE) <= self.starts

    def run_in(self, smoothed: Smoothed) -> float:
        if not self.whole or (self.own_run_in is None and at_rest(smoothed)):
            return 0.0
        return FORGOTTEN * smoothed.scale.time if self.own_run_in is None else self.own_run_in

    @property
    def model(self) -> Model:
        return self._along_runs

    @cached_property
    def _along_runs(self) -> Model:
        """A model that moves as the black box does along its runs."""
        body = Model({**self.ship.vessel, **self._inertia()}, self.ship.thrusters, ship=self.ship.ship)
        given = {w.run.name: self._beyond_along(w, body) for w in self.runs}
        known = self.learned_from
        return Model(body.vessel, body.thrusters, ship=body.ship, given=given, learned_from=known)

    def windows(self, runs: Sequence[Smoothed], length: float) -> Windows | None:
        if not self.whole:
            return windows_of(runs, length)
        (smoothed,) = runs
        seconds = smoothed.time[-1] - first_time(smoothed) + 0.75 * smoothed.track.period
        try:
            return Windows(runs, seconds).after(self.run_in(smoothed))
        except InputError as error:
            raise InputError(f"run '{smoothed.track.run.name}': {error}") from None

    def residuals(self, windows: Windows, learned: Sequence[Model] = ()) -> list[np.ndarray]:
        """Those of additions: as the residuals of :attr:`model` change by them."""
        (own,) = windows.residuals_by(self._poses)
        if not learned:
            return [own]
        run = windows.runs[0].track.run.name
        base, *others = windows.residuals_of_each([m.during(run) for m in (self.model, *learned)])
        changed = [own + other - base for other in others]
        for residuals in changed:
            residuals[:, 2] = wrap(residuals[:, 2])
        return [own, *changed]

    def free_runs(
        self, smoothed: Smoothed, learned: Model | None = None, begin: float = -np.inf
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """By its own answers; with additions, those of :attr:`model`."""
        if learned is not None:
            return free_runs(smoothed, [self.model, learned], begin)
        row, h = first_row(smoothed, begin), step_of(smoothed)
        start = 0 if self.whole else row
        steps = int((smoothed.time[-1] - smoothed.time[start]) / h)
        since = smoothed.time[row] - smoothed.time[start]
        first = int(np.ceil(since / h - DIGITS))
        motion = self.motion(smoothed, np.array([start]), h, steps)
        pose = self._placed_at(motion, h, np.array([since]), smoothed.eta[[row]])[first:, :, 0]
        return smoothed.time[start] + h * np.arange(first, steps + 1), [pose, pose]

    def description(self) -> PredictorDescription:
        waits = {w.run.name: self.run_in(w.smoothed) for w in self.runs}
        stated = [*self._sentences(max(waits.values()))]
        return PredictorDescription(
            self.kind, self.name, self.sha256, self.given_map, self.whole, waits, stated
        )

    def in_windows(self) -> Predictor:
        return DescribedShip(self.model) if self.whole else self

    def write(
        self, folder: Path, learned: Model | None = None, runs: Sequence[WeakWindows] = ()
    ) -> list[str]:
        stated = f"The findings are not written: {self.name} has no parameters."
        return [] if learned is None else [stated]

    def _sentences(self, wait: float) -> Iterator[str]:
        if not self.whole:
            yield f"Each window starts from the measured state{self._started_by}."
        else:
            began = f"after a run-in of {wait:.3g} s" if wait else "from rest"
            yield (
                f"Its velocity cannot be set ({', '.join(VELOCITY)} of the map's start): runs are "
                f"predicted as a whole, {began}. Its model error is computed along its prediction."
            )
        if self.placed:
            yield "At the start of a prediction its pose is aligned with the measured pose."

    def _poses(self, starts: WindowStarts) -> np.ndarray:
        """The predicted pose (steps + 1, 3, 1, w) in windows."""
        found, h = [], starts.h
        for smoothed, rows in starts.runs:
            time = smoothed.time
            onto = np.searchsorted(time, time[rows] + self.run_in(smoothed) - DIGITS)
            motion = self.motion(smoothed, rows, h, starts.steps)
            since = time[onto] - time[rows]  # a sample, which need not be a step
            found.append(self._placed_at(motion, h, since, smoothed.eta[onto]))
        return np.concatenate(found, axis=-1)[:, :, None]

    def _placed_at(self, motion: np.ndarray, h: float, since: np.ndarray, eta: np.ndarray) -> np.ndarray:
        """Pose (steps + 1, 3, w), laid onto others (w, 3) at times (w,) [s] if it cannot be set."""
        return laid(_pose(motion, h), since / h, eta.T) if self.placed else _pose(motion, h)

    def _whole_run(self, smoothed: Smoothed) -> np.ndarray:
        """Pose and velocity (n, 6) along a run from its start."""
        h = step_of(smoothed)
        steps = int(np.ceil((smoothed.time[-1] - smoothed.time[0]) / h)) + 1
        motion = self.motion(smoothed, np.array([0]), h, steps)
        pose = laid(_pose(motion, h), np.zeros(1), smoothed.eta[:1].T)[:, :, 0]
        nu = motion[:, 3:, 0]
        if np.isnan(nu).any():
            rate = np.gradient(np.column_stack([pose[:, :2], np.unwrap(pose[:, 2])]), h, axis=0)
            nu = body_velocity(pose[:, 2], rate)
        time = smoothed.time[0] + h * np.arange(steps + 1)
        columns = np.column_stack([pose[:, :2], np.unwrap(pose[:, 2]), nu])
        return between(smoothed.time, time, columns)

    def _beyond_along(self, w: WeakWindows, body: Model) -> SampledForce:
        """The force of the black box beyond that of a model, along a run."""
        time = w.run.time
        slope = np.zeros((time.size, 3, len(MOTION)))
        if self.whole:
            motion = self._whole_run(w.smoothed)
            return SampledForce(
                _beyond(w, body, motion, np.gradient(motion[:, 3:], time, axis=0)), slope
            )
        known = np.flatnonzero(w.known)
        motion = np.concatenate([w.smoothed.eta, w.smoothed.nu], axis=1)
        motion[~w.known] = 0.0
        signals = at_samples(w.smoothed)

        def beyond(rows: np.ndarray, moving: np.ndarray) -> np.ndarray:
            """(n, 3), by accelerations in some rows, and between them by interpolation."""
            at = {**signals, **dict(zip(MOTION, moving.T, strict=True))}
            found = self.accelerations({name: x[rows] for name, x in at.items()})
            return _beyond(w, body, moving, between(time, time[rows], found))

        force = beyond(known, motion)
        places = np.searchsorted(time[known], np.arange(time[known].min(), time[known].max(), w.every))
        sparse = known[np.unique(places)]
        plain = beyond(sparse, motion)
        sizes = (w.scale.length, w.scale.length, 1.0, *w.scale.speeds)
        for k, (name, size) in enumerate(zip(MOTION, sizes, strict=True)):
            if name not in self.starts:
                continue
            moved = motion.copy()
            moved[:, k] += SMALL * size
            change = (beyond(sparse, moved) - plain)[sparse] / (SMALL * size)
            slope[:, :, k] = between(time, time[sparse], change)
        force[~w.known], slope[~w.known] = 0.0, 0.0
        return SampledForce(force - np.einsum("nij,nj->ni", slope, motion), slope)

    def _inertia(self) -> dict[str, float]:
        """Coefficients that give a model the inertia of the black box, as far as it takes forces."""
        ship = self.ship
        axes = [k for k, name in enumerate(TAU) if name in self.inputs]
        still = dict.fromkeys(at_samples(self.runs[0].smoothed), np.zeros(1))
        at_rest = self.accelerations(still)[0]
        by_force = np.linalg.inv(ship.mass)
        for k in axes:
            push = ship.ship.scale.forces[k]
            pushed = (self.accelerations({**still, TAU[k]: np.array([push])})[0] - at_rest) / push
            if not SMALL < pushed[k] * ship.mass[k, k] < 1.0 / SMALL:
                return {}  # something lags between force and motion, or there is none
            by_force[axes, k] = pushed[axes]
        M = np.linalg.inv(by_force)
        if np.allclose(M, ship.mass):
            return {}
        i = ship.hull.hull.inertia
        rigid = np.array([[i.m, 0.0, 0.0], [0.0, i.m, i.m * i.x_g], [0.0, i.m * i.x_g, i.I_z]])
        (X, *_), (_, Y, Y_r), (_, N_v, N) = (rigid - M).tolist()
        return {"X_udot": X, "Y_vdot": Y, "Y_rdot": Y_r, "N_vdot": N_v, "N_rdot": N}


def commanded(run: Run, rows: np.ndarray | slice = slice(None)) -> dict[str, np.ndarray]:
    """Force or command -> values (n,) in rows of a run [SI]; forces in a plane as size and angle too."""
    every = dict(zip(TAU, run.tau_cmd.T, strict=True)) | run.commanded
    found = {name: values[rows] for name, values in every.items()}
    for name, (ahead, aside) in planes(found).items():
        found[f"{name}.force"] = np.hypot(found[ahead], found[aside])
        found[f"{name}.angle"] = np.arctan2(found[aside], found[ahead])
    return found


def planes(signals: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Name of a force in the plane -> its components ahead and to starboard, among some signals."""
    known = [*signals]
    pairs = {"tau": (TAU[0], TAU[1])}
    pairs |= {n[:-2]: (n, f"{n[:-2]}.Y") for n in known if n.endswith(".X")}
    return {name: pair for name, pair in pairs.items() if {*pair} <= {*known}}


def commands_at(run: Run, time: np.ndarray) -> dict[str, np.ndarray]:
    """Force or command -> its values at some times [s]; a command acts from its time to the next."""
    row = np.maximum(np.searchsorted(run.time, time, side="right") - 1, 0)
    return commanded(run, row)


def at_samples(smoothed: Smoothed) -> dict[str, np.ndarray]:
    """Signal -> its values (n,) at the samples of a run [SI]: commands, and the smoothed motion."""
    motion = np.concatenate([smoothed.eta, smoothed.nu], axis=1).T
    return commanded(smoothed.track.run) | dict(zip(MOTION, motion, strict=True))


def _beyond(w: WeakWindows, body: Model, motion: np.ndarray, nu_dot: np.ndarray) -> np.ndarray:
    """Force (n, 3) that a model of a ship lacks in a motion (n, 6)."""
    eta, nu = motion[:, :3], motion[:, 3:]
    free = acceleration(body, w.smoothed, eta, nu)
    return (nu_dot - free) @ body.mass.T - thrust_along(w, body, inflow_along(w, body, eta, nu))


def _pose(motion: np.ndarray, h: float) -> np.ndarray:
    """Pose of a motion (steps + 1, 6, w); where it has none, by its velocity from the origin on."""
    if not np.isnan(motion[0, :3]).any():
        return motion[:, :3]
    sums = partial(cumulative_trapezoid, dx=h, axis=0, initial=0.0)
    u, v, r = motion[:, 3:].transpose(1, 0, 2)
    psi = sums(r)
    north, east = rotate_to_earth(psi, u, v)
    return np.stack([sums(north), sums(east), psi], axis=1)


def laid(pose: np.ndarray, place: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """Tracks laid onto other poses.

    Args:
        pose: (steps + 1, 3, w), the tracks [m, m, rad].
        place: (w,), after how many steps, or parts of one, each is in its other pose.
        onto: (3, w), these poses.
    """
    at = between_steps(pose[:, :, None], np.arange(place.size), place)[0].T
    x, y, psi = (pose - at).transpose(1, 0, 2)
    north, east = rotate_to_earth(onto[2] - at[2], x, y)
    return np.stack([onto[0] + north, onto[1] + east, onto[2] + psi], axis=1)
