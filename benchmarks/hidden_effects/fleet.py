"""Many runs at once: the closed loop of :func:`.simulated_runs.sail`, with an array for each scalar.

The components are the same pure functions that the FMUs hold, stepped in the order in which the master
steps them, and the faults are those of the scenario with the same random numbers. So a run is the same
as in co-simulation but for rounding; a hundred of them take as long as a few.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

import cosim
from diagnosis import Run
from fmus.controller import abs as controller
from fmus.declare import Component, flatten, packer, variables
from fmus.effects import EffectSet
from fmus.observer import kalman
from fmus.ship import ship
from fmus.signals import Estimate, Force, Measurement, Target

from . import other_thrusters, other_vessel
from .foreign_physics import WITH_FOREIGN
from .manoeuvres import PATHS, Manoeuvre
from .simulated_runs import (
    FAR,
    FINE,
    SETTLED,
    STEP,
    STOP,
    Hidden,
    RunawayError,
    Voyage,
    scenario,
)

OBSERVER = kalman.COMPONENT
TOGETHER = 128  # runs at once: more take more memory (2.2 MB each) and hardly less time; chosen


@dataclass(frozen=True)
class ProcessNoise:
    """A force that is nobody's: on each axis an Ornstein-Uhlenbeck process.

    Attributes:
        size: standard deviation [N, N, N m].
        time: correlation time [s].
    """

    size: tuple[float, float, float]
    time: float

    def series(self, rng: np.random.Generator, steps: int) -> np.ndarray:
        """(steps, 3) [N, N, N m], one each STEP."""
        kept = float(np.exp(-STEP / self.time))
        white = rng.standard_normal((steps, 3))
        white[1:] *= np.sqrt(1.0 - kept**2)
        return np.asarray(lfilter([1.0], [1.0, -kept], white, axis=0)) * self.size


@dataclass(frozen=True, eq=False)
class Order:
    """One run that is wanted, see :func:`.simulated_runs.sail`; perhaps in process noise."""

    manoeuvre: Manoeuvre
    hidden: Hidden
    noise: float
    seed: int
    push: ProcessNoise | None = None


class Part:
    """A component of all runs: its parameters, its state, and its outputs as they are now.

    Args:
        component: of every run.
        values: parameters of each run by name; the others are the component's start values.
        inputs: at t = 0.
    """

    def __init__(self, component: Component, values: Sequence[dict[str, float]], inputs: Any) -> None:
        self._component, self._values = component, [dict(v) for v in values]
        p = self._prepare()
        self._state = component.init(inputs, p)
        _, self.outputs = component.advance(self._state, inputs, self._prepared, 0.0)

    def _prepare(self) -> Any:
        """The parameters, and what follows from them alone."""
        declared = variables(self._component.params)
        p = packer(self._component.params)([_lanes(v, self._values) for v in declared])
        self._prepared = _one_way(self._component.prepared(p))
        return p

    def change(self, lane: int, values: dict[str, float]) -> None:
        """Other parameters for one run from now on."""
        self._values[lane] |= values
        self._prepare()

    def advance(self, inputs: Any, h: float) -> Any:
        """The outputs after a step of h [s]."""
        self._state, self.outputs = self._component.advance(self._state, inputs, self._prepared, h)
        return self.outputs


def _one_way(prepared: Any) -> Any:
    """The same with the long way for all ships where some need it: in place of both ways for all."""
    ways = {"disturbed", "any_acts"} & set(getattr(prepared, "_fields", ()))
    long = {n: True for n in ways if np.any(getattr(prepared, n))}
    return prepared._replace(**long) if long else prepared


def _lanes(declared: Any, values: Sequence[dict[str, float]]) -> Any:
    """A parameter of all runs: a float where all have the same, so that what is off costs nothing."""
    found = [v.get(declared.name, declared.start) for v in values]
    return found[0] if len(set(found)) == 1 else np.array(found)


class Fleet:
    """Ships of one kind in closed loop, a run each."""

    def __init__(self, orders: Sequence[Order], effects: EffectSet = WITH_FOREIGN) -> None:
        # The FMUs that a scenario names are not loaded: the folder does not matter.
        content = [scenario(o.manoeuvre, o.hidden, o.noise, o.seed, Path()) for o in orders]
        self.parts = round(STEP / FINE) if orders[0].hidden.other else 1
        self.h = STEP / self.parts
        self._faults = [_faults(c) for c in content]
        self.targets = np.array([target(o.manoeuvre) for o in orders])  # (runs, steps + 1, signals)
        given = {
            n: [dict(c["fmus"][n].get("parameters", {})) for c in content] for n in content[0]["fmus"]
        }
        self._pushes = np.stack([_pushed(o, self.targets.shape[1]) for o in orders], axis=-1)
        ship, machine = ships(effects)[orders[0].hidden.other]
        zero: Any = np.zeros(len(orders))
        self.vessel = Part(ship, given["vessel"], Force(zero, zero, zero))
        measured = self._measured(0.0)
        self.observer = Part(OBSERVER, given["observer"], OBSERVER.inputs(measured))
        self.controller = Part(controller.COMPONENT, given["controller"], self._seen(0))
        self.thrusters = Part(machine, given["thrusters"], self._request())
        self._measurement = measured

    def _measured(self, t: float) -> Measurement:
        """The measured pose with the faults of each run."""
        poses = np.column_stack(np.broadcast_arrays(*self.vessel.outputs.measured)).tolist()
        for values, effects in zip(poses, self._faults, strict=True):
            for effect in effects:
                effect(values, t)
        return Measurement(*np.array(poses).T)

    def _seen(self, k: int) -> Any:
        """What the controller gets at step k."""
        return controller.COMPONENT.inputs(
            Estimate(*flatten(self.observer.outputs)), Target(*self.targets[:, k].T)
        )

    def _request(self) -> Any:
        """What the thrusters get."""
        force = Force(*self.controller.outputs[0])
        return ship().thrusters.inputs(force, self.vessel.outputs.velocity)

    def row(self) -> list[Any]:
        """True pose, velocity, acceleration, force, model error, measurement, command: 21 columns."""
        s, f = self.vessel.outputs, self.thrusters.outputs
        force = f.tau_act_X, f.tau_act_Y, f.tau_act_N
        omega = s.omega_X, s.omega_Y, s.omega_N
        commands = f.tau_cmd_X, f.tau_cmd_Y, f.tau_cmd_N
        speed = *s.velocity[:3], s.u_dot, s.v_dot, s.r_dot  # over ground
        return [*s.pose, *speed, *force, *omega, *self._measurement, *commands]

    def step(self, k: int) -> None:
        """From step k - 1 to k."""
        for part in range(self.parts):
            f = self.thrusters.outputs
            X, Y, N = self._pushes[k - 1]
            self.vessel.advance(Force(f.tau_act_X + X, f.tau_act_Y + Y, f.tau_act_N + N), self.h)
            if part == self.parts - 1:
                held = Force(f.tau_cmd_X, f.tau_cmd_Y, f.tau_cmd_N)
                self._measurement = self._measured(round(k * STEP, 12))
                self.observer.advance(OBSERVER.inputs(self._measurement, held), STEP)
                self.controller.advance(self._seen(k), STEP)
            self.thrusters.advance(self._request(), self.h)

    def run(self) -> np.ndarray:
        """(steps + 1, 21, runs): every row."""
        steps, runs = round(STOP / STEP), len(self._faults)
        log = np.empty((steps + 1, 21, runs))
        for k in range(steps + 1):
            if k:
                self.step(k)
            for column, values in enumerate(self.row()):
                log[k, column] = values
        return log


def _pushed(order: Order, steps: int) -> np.ndarray:
    """(steps, 3), force of the process noise of a run [N, N, N m]."""
    if order.push is None:
        return np.zeros((steps, 3))
    return order.push.series(np.random.default_rng([order.seed, steps]), steps)


@cache
def ships(effects: EffectSet) -> dict[bool, tuple[Component, Component]]:
    """Vessel and thrusters: those of the project, and those of another form."""
    return {
        False: (ship(effects).vessel, ship(effects).thrusters),
        True: (other_vessel.COMPONENT, other_thrusters.COMPONENT),
    }


def _faults(content: dict) -> list[Any]:
    """The faults of a run, bound as the master binds them to the three channels of the pose."""
    declared = cosim.load_scenario(content).faults
    seeds = np.random.SeedSequence(content["seed"]).spawn(len(declared))
    pairs = sorted(zip(declared, seeds, strict=True), key=lambda pair: pair[0].stage)
    return [fault.bind((0, 1, 2), STEP, np.random.default_rng(seed)) for fault, seed in pairs]


@cache
def _target(kind: str, given: tuple[tuple[str, float], ...], steps: int) -> np.ndarray:
    path, values = PATHS[kind], dict(given)
    p = packer(path.params)([values.get(v.name, v.start) for v in variables(path.params)])
    state, rows = path.init(path.inputs(), p), []
    for k in range(steps + 1):
        state, found = path.step(state, path.inputs(), p, STEP if k else 0.0)
        rows.append(flatten(found))
    return np.array(rows)


def target(m: Manoeuvre) -> np.ndarray:
    """(steps + 1, signals): the target of every step."""
    return _target(m.kind, tuple(m.parameters.items()), round(STOP / STEP))


def sail_all(orders: Sequence[Order]) -> list[Voyage | RunawayError]:
    """Run all ships, each along its manoeuvre; an error in the place of one that left its path."""
    found: list[Voyage | RunawayError | None] = [None] * len(orders)
    for other in (False, True):
        mine = [k for k, o in enumerate(orders) if o.hidden.other == other]
        for first in range(0, len(mine), TOGETHER):
            some = mine[first : first + TOGETHER]
            with np.errstate(all="ignore"):  # a ship that runs away overflows, and is reported so
                log = Fleet([orders[k] for k in some]).run()
            for lane, k in enumerate(some):
                found[k] = _voyage(orders[k], np.ascontiguousarray(log[:, :, lane]))
    return [v for v in found if v is not None]


def _voyage(order: Order, log: np.ndarray) -> Voyage | RunawayError:
    time = np.round(np.arange(len(log)) * STEP, 12)
    eta, nu, nu_dot, tau, omega, pose, commands = np.split(log, 7, axis=1)
    away = np.hypot(*(eta[:, :2] - target(order.manoeuvre)[:, :2])[time > SETTLED].T)
    if not np.isfinite(log).all() or not away.max() <= FAR:
        return RunawayError(f"more than {FAR:g} m from the target")
    return Voyage(Run(order.manoeuvre.kind, time, pose, commands), eta, nu, nu_dot, tau, omega)
