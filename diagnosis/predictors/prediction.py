"""Many short predictions at once, with the very physics of the vessel and the thrusters.

The functions of :mod:`fmus` run on arrays: one column for each window, one row for each set of
parameters.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from fmus.actuators.response import PreparedThrusters
from fmus.frames import rotate_to_body
from fmus.ops import wrap
from fmus.signals import Force
from fmus.vessel import vessel

from ..runs import Smoothed, idle
from ..runs.cleaning import WIDTH
from ..runs.held_signal import Integral
from ..runs.run_constants import DIGITS, FAR_OFF
from .filters import FilterStart
from .ship_model import Model
from .thrust import LONGEST_STEP, Response, drive_of
from .traced.compiled_law import compiler
from .traced.recorded_step import Inputs, Ready, compiled_states, recorded_step, thrust_at


@dataclass(frozen=True, eq=False)
class WindowStarts:
    """Windows, of one run or more with commands in one layout, that are predicted together.

    Attributes:
        runs: each run with the rows of the first samples of its windows.
        h: step of the thrusters [s], a whole part of the time between two rows.
        steps: of these in a window.
    """

    runs: tuple[tuple[Smoothed, np.ndarray], ...]
    h: float
    steps: int

    def first(self, values: Callable[[Smoothed], np.ndarray]) -> np.ndarray:
        """(..., w): what an array (n, ...) of each run holds where windows begin."""
        return np.concatenate([values(smoothed)[rows].T for smoothed, rows in self.runs], axis=-1)

    def motion(self, model: Model) -> tuple[np.ndarray, np.ndarray]:
        """Smoothed pose and its rate (3, w) where windows begin, before a model's filters."""
        pose, rate = (self.first(lambda s, k=k: before_filters(s, model)[k]) for k in (0, 1))
        return pose, rate

    def drive(self, model: Model) -> PreparedThrusters:
        """The thrusters of a model, in the layout of the runs' commands."""
        return drive_of(self.runs[0][0].track.run, model)

    def power(self, clock: float) -> np.ndarray | None:
        """(steps, m, w): settings of the thrusters' power; None: no run has any.

        Args:
            clock: seconds by which a pose is older than its stamp.
        """
        given = [s.track.run.power for s, _ in self.runs]
        settings = [power.shape[1] for power in given if power is not None]
        if not settings:
            return None
        found = []
        for (smoothed, rows), power in zip(self.runs, given, strict=True):
            middle = smoothed.time[rows] + (np.arange(self.steps)[:, None] + 0.5) * self.h - clock
            row = np.maximum(np.searchsorted(smoothed.time, middle, side="right") - 1, 0)
            found.append(np.ones((*row.shape, settings[0])) if power is None else power[row])
        return np.concatenate(found, axis=1).transpose(0, 2, 1)

    def given(self, model: Model) -> tuple[np.ndarray, np.ndarray] | None:
        """What is given beside all else, mean over each step; None: nothing is.

        Returns:
            Force (steps, 3, 1, w), and its slopes by pose and velocity (steps, 3, 6, 1, w).
        """
        if not model.given:
            return None

        def table(smoothed: Smoothed) -> np.ndarray:
            given = model.given[smoothed.track.run.name]
            return np.concatenate([given.still[..., None], given.slope], axis=2)

        means = self._means(table)
        return means[:, :, 0], means[:, :, 1:]

    def air(self, model: Model) -> np.ndarray | None:
        """(steps, 2, 1, w): velocity of the air to north and east [m/s], mean over each step.

        None: the model's ship takes no measured wind, or none was measured. In a run without it is calm.
        """
        if model.hull.effects.wind < 0 or all(s.air is None for s, _ in self.runs):
            return None
        return self._means(lambda s: np.zeros((s.time.size, 2)) if s.air is None else s.air)

    def _means(self, values: Callable[[Smoothed], np.ndarray]) -> np.ndarray:
        """(steps, ..., 1, w): means over each step of what an array (n, ...) of each run holds."""
        found = []
        for smoothed, rows in self.runs:
            t, table = smoothed.time, values(smoothed)
            edges = np.concatenate([t[:1], 0.5 * (t[1:] + t[:-1]), t[-1:]])
            time = t[rows] + self.h * np.arange(self.steps + 1)[:, None]
            found.append(np.diff(Integral(edges, table, table[0])(time), axis=0) / self.h)
        return np.moveaxis(np.concatenate(found, axis=1), 1, -1)[..., None, :]

    def arriving(self, model: Model) -> tuple[np.ndarray, np.ndarray]:
        """Commands that arrive and shares of full force that act, each (steps, k, 1, w)."""
        found, steps = [], np.arange(self.steps + 1)
        for smoothed, rows in self.runs:
            response = Response(smoothed.track.run, model, not at_rest(smoothed))
            found.append(response.means(smoothed.time[rows] + steps[:, None] * self.h))
        given, acting = (np.concatenate(part, axis=1) for part in zip(*found, strict=True))
        return given.transpose(0, 2, 1)[:, :, None], acting.transpose(0, 2, 1)[:, :, None]


def at_rest(smoothed: Smoothed) -> bool:
    """Whether a ship is at rest at the start of a run, so that nothing was commanded before.

    Its speeds are below those of an idle ship or their uncertainty, or they change by more than
    themselves within a window. A ship under way that has followed its first command hardly changes them.
    """
    rows = np.flatnonzero(np.isfinite(smoothed.nu[:, 0]))
    first = rows[0] if rows.size else 0
    soon = smoothed.time[first] + WIDTH * smoothed.scale.time
    later = rows[min(np.searchsorted(smoothed.time[rows], soon), rows.size - 1)] if rows.size else first
    still = np.maximum(idle(smoothed.scale), FAR_OFF * smoothed.nu_std[first])
    still = np.maximum(still, np.abs(smoothed.nu[later] - smoothed.nu[first]))
    return bool((np.abs(smoothed.nu[first]) < still).all())


def at_constant_velocities(starts: WindowStarts) -> np.ndarray:
    """The pose of a ship that keeps its surge, sway and yaw rate: an arc of a circle, by no model.

    Args:
        starts: where to begin.

    Returns:
        (steps + 1, 3, 1, w), pose at each step [m, m, rad].
    """
    (x, y, psi), (x_dot, y_dot, r) = starts.first(lambda s: s.eta), starts.first(lambda s: s.eta_dot)
    t = starts.h * np.arange(starts.steps + 1)[:, None]
    half = 0.5 * r * t
    chord = t * np.sinc(half / np.pi)
    ahead, aside = chord * np.cos(half), chord * np.sin(half)
    place = x + x_dot * ahead - y_dot * aside, y + x_dot * aside + y_dot * ahead
    return np.stack([*place, psi + r * t], axis=1)[:, :, None]


def predict(starts: WindowStarts, model: Model) -> np.ndarray:
    """The measured pose as a model predicts it.

    Args:
        starts: where to begin.
        model: its parameters may be arrays (p, 1), for p models at once.

    Returns:
        (steps + 1, 3, p, w): pose [m, m, rad] at each step.
    """
    names = [smoothed.track.run.name for smoothed, _ in starts.runs]
    if model.runs.keys() & set(names):
        each = zip(starts.runs, names, strict=True)
        parts = [predict(replace(starts, runs=(run,)), model.during(name)) for run, name in each]
        return np.concatenate(parts, axis=-1)
    return _predicted(starts, model, arriving(starts, model))


def predict_each(starts: WindowStarts, models: Sequence[Model]) -> np.ndarray:
    """The measured pose (steps + 1, 3, 1, w) of runs, as a model of its own predicts each.

    Args:
        starts: where to begin.
        models: one for each of the runs, single ones, measured alike.
    """
    alone = [replace(starts, runs=(run,)) for run in starts.runs]
    models = [m.during(s.track.run.name) for m, (s, _) in zip(models, starts.runs, strict=True)]
    thrust = [arriving(one, m) for one, m in zip(alone, models, strict=True)]
    given, acting = (np.concatenate(part, axis=-1) for part in zip(*thrust, strict=True))
    counts = [rows.size for _, rows in starts.runs]
    return _predicted(starts, merged(models, lambda x: np.repeat(x, counts)[None]), (given, acting))


def _predicted(starts: WindowStarts, model: Model, thrust: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """See :func:`predict`; thrust as of :func:`propagate`."""
    with np.errstate(all="ignore"):  # a model that runs away gives infinities, which count
        alone = [] if compiler() else _states_of_one(starts, model, thrust)
        states = alone or [*propagate(starts, model, thrust)]
        x, y, psi, *_ = zip(*states, strict=True)
        s = vessel.State(*(np.stack(np.broadcast_arrays(*each)) for each in (x, y, psi)))
        pose = np.stack(np.broadcast_arrays(*vessel.measured(s, model.hull)), axis=1)
        pose = pose.reshape(*pose.shape[:2], *(pose.shape[2:] or (1, 1)))
        return filtered(pose, model, starts, starts.h)


def _states_of_one(
    starts: WindowStarts, model: Model, thrust: tuple[np.ndarray, np.ndarray]
) -> list[vessel.State]:
    """The states of one model in one window in plain numbers, which takes a quarter of the time.

    Arguments as of :func:`propagate`. Empty where there are several, or numbers cannot do what arrays
    can, such as a division by zero.
    """
    values = [*model.vessel.values(), *model.thrusters.values()]
    if sum(rows.size for _, rows in starts.runs) != 1 or any(isinstance(v, np.ndarray) for v in values):
        return []
    with suppress(ArithmeticError, ValueError):
        return [*propagate(starts, model, thrust, single=True)]
    return []


def arriving(starts: WindowStarts, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Commands that arrive and shares of full force that act, each (steps, k, p or 1, w)."""
    found = [starts.arriving(single) for single in singles(model)]
    given, acting = (np.concatenate(part, axis=2) for part in zip(*found, strict=True))
    return given, acting


def propagate(
    starts: WindowStarts, model: Model, thrust: tuple[np.ndarray, np.ndarray], single: bool = False
) -> Iterator[vessel.State]:
    """The state at the start and after each step of the integration; arrays (p, w) or like them.

    Args:
        starts: where to begin.
        model: as of :func:`predict`.
        thrust: commands that arrive and shares that act, from :func:`arriving`.
        single: whether there is one model and one window, and states are of numbers.
    """
    ready, h = Ready(model.hull, starts.drive(model)), starts.h
    power, beside, air = starts.power(model.clock), starts.given(model), starts.air(model)
    # The smoothed motion, seen through the model's measurement effects.
    pose, nu = true_motion(*starts.motion(model), model)
    s = vessel.State._make([*pose, *nu, starts.first(lambda s: s.time) + 0.0 * pose[0]])
    given: list[Any] = [*thrust, power, air]
    if single:
        s = vessel.State._make([x.item() for x in s])
        given = [None if x is None else x.reshape(*x.shape[:2]).tolist() for x in given]
    elif beside is None and (states := compiled_states(ready, s, given, h)) is not None:
        yield from map(vessel.State._make, states)
        return
    none = [None] * starts.steps
    each = zip(*(none if x is None else x for x in given), strict=True)
    steps = [Inputs(*x) for x in each]
    yield s
    if beside is None:
        advance = recorded_step(ready, steps[0], single)
        for i in steps:
            with np.errstate(all="ignore"):
                flat = (x for part in i if part is not None for x in part)
                s = vessel.State._make(advance(*s, *flat, h))
            yield s
        return
    for k, i in enumerate(steps):
        with np.errstate(all="ignore"):
            s = vessel.integrate(s, i, ready, h, _with(beside[0][k], beside[1][k]))
        yield s


def _with(still: np.ndarray, slope: np.ndarray) -> Callable[..., Any]:
    """Law of the motion with a force (3, 1, w) beside all else, and its slopes (3, 6, 1, w)."""

    def law(s: vessel.State, i: Inputs, b: Ready) -> Any:
        tau, hull = thrust_at(s, i, b)
        beside = still + sum(slope[:, k] * x for k, x in enumerate(s[:6]))
        return vessel.disturbed(s, Force(*(f + g for f, g in zip(tau, beside, strict=True))), hull)

    return law


def by_measurement(models: Sequence[Model]) -> Iterator[tuple[list[int], Model]]:
    """Models of one ship that are predicted at once, those measured alike; which, and in one."""
    measurements = [(m.logging, m.filters) for m in models]
    for measurement in sorted({*measurements}):
        chosen = [k for k, m in enumerate(measurements) if m == measurement]
        yield chosen, stacked([models[k] for k in chosen])


def stacked(models: Sequence[Model]) -> Model:
    """Several models, measured alike, as one whose parameters are arrays (p, 1) where they differ."""
    return merged(models, lambda x: x[:, None])


def merged(models: Sequence[Model], spread: Callable[[np.ndarray], np.ndarray]) -> Model:
    """Several models as one; of parameters that differ, the values (p,) are spread over an array."""

    def together(part: str) -> dict[str, Any]:
        values: list[Mapping[str, float]] = [getattr(m, part) for m in models]
        names = dict.fromkeys(name for each in values for name in each)
        of = models[0].ship.parameters[part]
        columns = {n: np.array([v.get(n, of[n].start) for v in values]) for n in names}
        return {n: spread(x) if np.ptp(x) else float(x[0]) for n, x in columns.items()}

    return replace(models[0], vessel=together("vessel"), thrusters=together("thrusters"))


def singles(model: Model) -> list[Model]:
    """The models of one whose thrusters' parameters are arrays (p, 1); itself where none is."""
    many = {n: v[:, 0].tolist() for n, v in model.thrusters.items() if isinstance(v, np.ndarray)}
    each = [dict(zip(many, values, strict=True)) for values in zip(*many.values(), strict=True)]
    return [replace(model, thrusters={**model.thrusters, **one}) for one in each] or [model]


def filtered(poses: np.ndarray, model: Model, starts: WindowStarts, h: float) -> np.ndarray:
    """Poses (n, 3, p, w) behind a model's filters.

    Args:
        poses: of windows, at their start and at equal intervals from there.
        model: whose measurement it is.
        starts: the windows, which begin with the measured pose.
        h: interval [s].
    """
    filters = model.filters
    if not filters:
        return poses
    start = FilterStart(
        between=starts.first(lambda s: filters.undone(s).between),
        timely=starts.first(lambda s: filters.undone(s).timely),
        timely_rate=starts.first(lambda s: filters.undone(s).timely_rate),
        measured=starts.first(attrgetter("eta")),
    )
    return filters.behind(poses, start, h)


def before_filters(s: Smoothed, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed pose and its rate (n, 3) of a run, before a model's filters."""
    if not model.filters:
        return s.eta, s.eta_dot
    before = model.filters.undone(s)
    return before.pose, before.rate


def true_motion(
    eta: Any, eta_dot: Any, model: Model, solved: Callable[..., list[Any]] | None = None
) -> tuple[list[Any], list[Any]]:
    """Pose and body-fixed velocity, each three of (p, w), of a measured pose and its rate (3, w).

    ``solved`` gives the pose behind a measured one: :func:`true_pose`, or the same for symbols.
    """
    b, step, solved = model.hull, LONGEST_STEP, solved or true_pose
    poses = ([y + h * y_dot for y, y_dot in zip(eta, eta_dot, strict=True)] for h in (0.0, step, -step))
    (x, y, psi), ahead, astern = (solved(pose, b) for pose in poses)
    x_dot, y_dot, r = ((a - b) / (2.0 * step) for a, b in zip(ahead, astern, strict=True))
    return [x, y, psi], [*rotate_to_body(psi, x_dot, y_dot), r]


def true_pose(measured: Any, b: vessel.PreparedVessel) -> list[Any]:
    """The pose, each (p, w), that the measurement effects turn into a measured one; by iteration."""
    pose = [np.atleast_2d(m) for m in measured]
    for _ in range(8):
        pose, off = nearer_pose(pose, measured, b)
        if not any((np.abs(o) > DIGITS).any() for o in off):
            break
    return pose


def nearer_pose(pose: Any, measured: Any, b: vessel.PreparedVessel) -> tuple[list[Any], list[Any]]:
    """One step of that iteration, and by how much the pose changes."""
    x, y, psi = vessel.measured(vessel.State(*pose), b)
    off = [measured[0] - x, measured[1] - y, wrap(measured[2] - psi)]
    return [a + b for a, b in zip(pose, off, strict=True)], off
