"""Many short predictions at once, with the very physics of the vessel and the thrusters.

The functions of :mod:`fmus` run on arrays: one column for each window, one row for each set of
parameters. Of the five commands of the real ship each propeller is a thruster set of its own; elsewhere
there is one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from fmus.declare import Component, packer, variables
from fmus.frames import rotate_to_body
from fmus.ops import when, wrap
from fmus.signals import Force, Velocity
from fmus.thrusters.allocation import thrust
from fmus.thrusters.chain import Inputs, Power
from fmus.thrusters.thrusters import COMPONENT as THRUSTERS
from fmus.vessel import vessel

from .measurement import ASIDE, propellers
from .smoothing import Smoothed

Values = Mapping[str, Any]
LONGEST_STEP = 0.02  # s
LAGS = 10.0  # time constants after which a lag has forgotten
LONGEST_MEMORY = 30.0  # s; thrusters slower than that are beyond any windows of some seconds
IDLE = (0.02, 0.02, 0.05)  # m/s, m/s, rad/s: below, the thrusters had not been at work before the run
INSTANT = 1e-3  # s; for the velocity of what the measurement effects make of a moving pose


def parameters(component: Component, values: Values) -> Any:
    """The parameters of a component, nominal but for some.

    Args:
        component: vessel or thrusters.
        values: name -> number, or array (p, 1) for p sets of parameters.

    Raises:
        InputError: a name that the component does not have.
    """
    declared = variables(component.params)
    names = [v.name for v in declared]
    for name in values:
        if name not in names:
            raise InputError(f"{component.name} has no parameter '{name}'{nearest(name, names)}")
    flat = [values.get(v.name, v.start) for v in declared]
    return packer(component.params)([v if isinstance(v, np.ndarray) else float(v) for v in flat])


@dataclass(frozen=True, eq=False)
class Starts:
    """Windows, of one run or more, that are predicted together.

    Attributes:
        runs: each run with the rows of the first samples of its windows.
        h: step of integration [s], a whole part of the time between two rows.
        steps: in a window.
        five: whether there are five commands.
    """

    runs: tuple[tuple[Smoothed, np.ndarray], ...]
    h: float
    steps: int
    five: bool

    def first(self, values: Callable[[Smoothed], np.ndarray]) -> np.ndarray:
        """(..., w): what an array (n, ...) of each run holds where windows begin."""
        return np.concatenate([values(smoothed)[rows].T for smoothed, rows in self.runs], axis=-1)

    @property
    def powered(self) -> bool:
        """Whether any run tells the power of its thrusters."""
        return any(smoothed.track.run.power is not None for smoothed, _ in self.runs)

    def times(self, first: int, steps: int, clock: float) -> list[np.ndarray]:
        """Middle of each step, (steps, w) for each run; arguments as of :meth:`commands`."""
        middle = (np.arange(first, first + steps)[:, None] + 0.5) * self.h - clock
        return [smoothed.time[rows] + middle for smoothed, rows in self.runs]

    def power(self, first: int, steps: int, clock: float) -> np.ndarray:
        """(steps, 2, w): power of VSP and bow thruster, arguments as of :meth:`commands`."""
        found = []
        for (smoothed, _), time in zip(self.runs, self.times(first, steps, clock), strict=True):
            run = smoothed.track.run
            row = np.maximum(np.searchsorted(run.time, time, side="right") - 1, 0)
            found.append(np.ones((*row.shape, 2)) if run.power is None else run.power[row])
        return np.concatenate(found, axis=1).transpose(0, 2, 1)

    def commands(self, first: int, steps: int, clock: float) -> np.ndarray:
        """What is asked of the thrusters, held from sample to sample.

        Args:
            first: step to begin with; negative before the window.
            steps: how many.
            clock: seconds by which a pose is older than its stamp.

        Returns:
            (steps, 3, sets, 1, w): shares of full force where there are five commands, else tau
            [N, N, N m].
        """
        times = self.times(first, steps, clock)
        found = [held(smoothed, time) for (smoothed, _), time in zip(self.runs, times, strict=True)]
        return np.concatenate(found, axis=1).transpose(0, 3, 2, 1)[:, :, :, None]


def held(smoothed: Smoothed, time: np.ndarray) -> np.ndarray:
    """Commands (steps, w, sets, 3) of a run at times (steps, w) [s]."""
    run = smoothed.track.run
    asked = run.tau_cmd[:, None] if run.five is None else propellers(run.five)
    row = np.searchsorted(run.time, time, side="right") - 1
    found = asked[np.maximum(row, 0)]
    known = np.isfinite(smoothed.nu[:, 0])
    if (np.abs(smoothed.nu[known.argmax()]) < IDLE).all():
        found[row < 0] = 0.0
    return found


def predict(starts: Starts, ship: Values, thrusters: Values, clock: float = 0.0) -> np.ndarray:
    """The measured pose as the model foretells it.

    Args:
        starts: where to begin.
        ship, thrusters: parameters that are not nominal, see :func:`parameters`.
        clock: seconds by which a pose is older than its stamp.

    Returns:
        (steps + 1, 3, p, w): pose [m, m, rad] at each step.
    """
    p, plan = parameters(vessel.COMPONENT, ship), parameters(THRUSTERS, thrusters)
    if starts.five:  # each propeller pushes from its own side
        aside = plan.plant.plant_p_y + np.array(ASIDE)[:, None, None]
        plan = plan._replace(plant=plan.plant._replace(plant_p_y=aside))
    body, machine, h = vessel.prepare(p), THRUSTERS.prepared(plan), starts.h
    s = first_state(starts, body)
    before = int(np.ceil(memory(plan) / h))
    past = THRUSTERS.init(Inputs(), plan)._replace(t=s.t - (before + 1) * h)
    found = np.empty((starts.steps + 1, 3, *np.broadcast_shapes(*sizes(p, plan), s.x.shape)))
    with np.errstate(all="ignore"):  # a model that runs away gives infinities, which count
        found[0] = vessel.measured(s, body)
        span = -before, before + starts.steps, clock
        power = starts.power(*span) if starts.powered else None
        for k, asked in enumerate(starts.commands(*span), -before):
            if power is not None:
                machine = THRUSTERS.prepared(plan._replace(power=Power(*power[k + before])))
            a, b, c = asked
            request = Force(*(thrust(a, b, c, plan.allocation) if starts.five else (a, b, c)))
            speed = Velocity(s.u, s.v, s.r) if k >= 0 else Velocity()
            past, out = THRUSTERS.advance(past, Inputs(request, speed), machine, h)
            if k < 0:
                continue
            tau = Force(*[np.sum(f, axis=0) for f in (out.tau_act_X, out.tau_act_Y, out.tau_act_N)])
            s = moved(s, tau, body, h)
            found[k + 1] = vessel.measured(s, body)
    return found


def moved(s: vessel.State, tau: Force, b: vessel.Prepared, h: float) -> vessel.State:
    """The ship a step later."""
    return when(
        b.stirred,
        lambda: vessel.integrate(s, tau, b, h, vessel.stirred),
        lambda: vessel.integrate(s, tau, b.hull, h),
    )


def sizes(*groups: Any) -> list[tuple[int, ...]]:
    """Shapes (p, 1) of the parameters that are arrays, those of single propellers aside."""
    found: list[tuple[int, ...]] = []
    for item in groups:
        found += sizes(*item) if isinstance(item, tuple) else [np.shape(item)[-2:]]
    return found


def memory(plan: Any) -> float:
    """How long [s] the thrusters remember a command."""
    delay, lag = plan.dynamics
    rate = plan.rate.plant_rate
    slow = np.where(np.asarray(rate) > 0.0, 2.0 / np.maximum(rate, 1e-3), 0.0)
    return min(LONGEST_MEMORY, float(np.max(delay + LAGS * np.asarray(lag) + slow)))


def first_state(starts: Starts, b: vessel.Prepared) -> vessel.State:
    """Where the smoother says that each window begins, seen through the model's measurement effects."""
    pose, nu = true_motion(starts.first(lambda s: s.eta), starts.first(lambda s: s.eta_dot), b)
    time = starts.first(lambda s: s.time) + 0.0 * pose[0]
    return vessel.State._make([*pose, *nu, time])


def true_motion(eta: Any, eta_dot: Any, b: vessel.Prepared) -> tuple[list[Any], list[Any]]:
    """Pose and body-fixed velocity, each three of (p, w), behind a measured motion of three (w,)."""
    x, y, psi = true_pose(eta, b)
    ahead, astern = true_pose(eta + INSTANT * eta_dot, b), true_pose(eta - INSTANT * eta_dot, b)
    x_dot, y_dot, r = ((a - b) / (2.0 * INSTANT) for a, b in zip(ahead, astern, strict=True))
    return [x, y, psi], [*rotate_to_body(psi, x_dot, y_dot), r]


def true_pose(measured: Any, b: vessel.Prepared) -> list[Any]:
    """The pose, each (p, w), that the measurement effects turn into a measured one; by iteration."""
    pose = [m[None] for m in measured]
    for _ in range(8):
        x, y, psi = vessel.measured(vessel.State(*pose), b)
        off = (measured[0] - x, measured[1] - y, wrap(measured[2] - psi))
        pose = [a + b for a, b in zip(pose, off, strict=True)]
    return pose
