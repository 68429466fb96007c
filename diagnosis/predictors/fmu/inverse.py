"""The force of an FMU beyond that of a ship's model, along measured runs, by inverse use.

In the measured state and with the command of each sample, the FMU accelerates by nu_dot, and the model
of the ship by another nu_dot. The difference, times the inertia, is a force over time, linear in pose
and velocity about the measured ones, that makes the model what the FMU is along the run. With it as a
given force (:class:`..ship_model.GivenForce`) all that is done with a model can be done with the FMU:
its model error, and the library's effects beside it. An FMU whose velocity cannot be set is asked along
its own prediction of the run, in place of the measured one.

Where the FMU takes forces, its inertia is that by which it answers them, and the model has the same, so
that forces are the FMU's own; else that of the ship.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing

import numpy as np

from fmus.frames import rotate_to_body

from ..ship_model import GivenForce, Model
from ..weak_form import WeakWindows, acceleration, inflow_along, thrust_along
from .fmu_windows import Use, at_samples, whole_run
from .foreign_fmu import TAU
from .short_steps import FIRST, LONGEST, SECOND, STEP, ShortSteps
from .variable_map import MOTION, POSE, VELOCITY

SMALL = 1e-3  # of the ship's speeds; step of the slopes by velocity
ALIKE = 1e-6  # relative; inertias that differ by less are the same
LIGHTEST, HEAVIEST = 1e-3, 1e3  # of the ship's inertia, within which an FMU's is believed; chosen


def as_model(runs: Sequence[WeakWindows], use: Use, ship: Model) -> Model:
    """A model that moves as an FMU does along some runs.

    Args:
        runs: no two of the same name.
        use: how the FMU predicts them.
        ship: the model to begin with.

    Raises:
        InputError: the FMU refuses to be set to a measured state, or fails.
    """
    inputs, outputs = ([c.name for c in use.map.told(g).values()] for g in ("inputs", "outputs"))
    h = min(use.fmu.step or STEP * runs[0].scale.time, LONGEST * runs[0].scale.time)
    with closing(ShortSteps(use.fmu.model, inputs, outputs, h)) as steps:
        body = Model({**ship.vessel, **_inertia(steps, use, ship)}, ship.thrusters, ship=ship.ship)
        given = {w.run.name: _given(w, use, body, steps) for w in runs}
    return Model(body.vessel, body.thrusters, ship=ship.ship, given=given)


def _given(w: WeakWindows, use: Use, body: Model, steps: ShortSteps) -> GivenForce:
    """Force of an FMU beyond that of a model, along a run."""
    time = w.run.time
    slope = np.zeros((time.size, 3, len(MOTION)))
    if use.whole:
        eta, nu = whole_run(w.smoothed, use)
        motion = np.concatenate([eta, nu], axis=1)
        return GivenForce(_beyond(w, body, motion, np.gradient(nu, time, axis=0)), slope)
    known = np.flatnonzero(w.known)
    motion = np.concatenate([w.smoothed.eta, w.smoothed.nu], axis=1)
    motion[~w.known] = 0.0
    signals = at_samples(w.smoothed)

    def beyond(rows: np.ndarray, moving: np.ndarray) -> np.ndarray:
        """(n, 3), by accelerations of the FMU in some rows, and between them by interpolation."""
        at = {**signals, **dict(zip(MOTION, moving.T, strict=True))}
        found = [_acceleration(steps, use, {s: x[k] for s, x in at.items()}) for k in rows]
        columns = [np.interp(time, time[rows], x) for x in np.transpose(found)]
        return _beyond(w, body, moving, np.column_stack(columns))

    force = beyond(known, motion)
    places = np.searchsorted(time[known], np.arange(time[known].min(), time[known].max(), w.every))
    sparse = known[np.unique(places)]
    plain = beyond(sparse, motion)
    sizes = (w.scale.length, w.scale.length, 1.0, *w.scale.speeds)
    for k, (name, size) in enumerate(zip(MOTION, sizes, strict=True)):
        if name not in use.map.told("start"):
            continue
        moved = motion.copy()
        moved[:, k] += SMALL * size
        change = (beyond(sparse, moved) - plain)[sparse] / (SMALL * size)
        slope[:, :, k] = np.column_stack([np.interp(time, time[sparse], x) for x in change.T])
    gone = ~w.known
    force[gone], slope[gone] = 0.0, 0.0
    return GivenForce(force - np.einsum("nij,nj->ni", slope, motion), slope)


def _beyond(w: WeakWindows, body: Model, motion: np.ndarray, nu_dot: np.ndarray) -> np.ndarray:
    """Force (n, 3) that a model of a ship lacks in a motion (n, 6)."""
    eta, nu = motion[:, :3], motion[:, 3:]
    free = acceleration(body, w.run.time, eta, nu)
    return (nu_dot - free) @ body.mass.T - thrust_along(w, body, inflow_along(w, body, eta, nu))


def _acceleration(steps: ShortSteps, use: Use, signals: Mapping[str, float]) -> np.ndarray:
    """nu_dot (3,) of an FMU that begins with some signals [SI]."""

    def variables(group: str) -> dict[str, float]:
        told = use.map.told(group)
        return {
            c.name: float(use.in_variable(s, c, signals[s])) for s, c in told.items() if s in signals
        }

    told = steps.run(variables("start"), variables("inputs"))
    columns = use.map.told("outputs")
    motion = {s: use.in_si(s, told[c.name]) for s, c in columns.items()}
    motion |= {s: np.full(FIRST.size, x) for s, x in use.map.fixed.items()}
    if set(VELOCITY) <= motion.keys():
        return np.array([FIRST @ motion[s] for s in VELOCITY]) / steps.h
    x, y, psi = (motion[s] for s in POSE)
    rate = [FIRST @ p / steps.h for p in (x, y, np.unwrap(psi))]
    change = [SECOND @ p / steps.h**2 for p in (x, y, np.unwrap(psi))]
    u, v = rotate_to_body(psi[0], rate[0], rate[1])
    u_dot, v_dot = rotate_to_body(psi[0], change[0], change[1])
    return np.array([u_dot + rate[2] * v, v_dot - rate[2] * u, change[2]])


def _inertia(steps: ShortSteps, use: Use, ship: Model) -> dict[str, float]:
    """Coefficients by which a model has the inertia of an FMU, as far as that takes forces."""
    axes = [k for k, name in enumerate(TAU) if name in use.map.told("inputs")]
    still = dict.fromkeys([*MOTION, *use.quantity], 0.0)
    at_rest = _acceleration(steps, use, still)
    by_force = np.linalg.inv(ship.mass)
    for k in axes:
        push = ship.ship.scale.forces[k]
        pushed = (_acceleration(steps, use, {**still, TAU[k]: push}) - at_rest) / push
        if not LIGHTEST < pushed[k] * ship.mass[k, k] < HEAVIEST:
            return {}  # something lags between force and motion, or there is none
        by_force[axes, k] = pushed[axes]
    M = np.linalg.inv(by_force)
    if np.abs(M - ship.mass).max() <= ALIKE * np.abs(ship.mass).max():
        return {}
    i = ship.hull.hull.inertia
    heavier = {"X_udot": i.m - M[0, 0], "Y_vdot": i.m - M[1, 1], "N_rdot": i.I_z - M[2, 2]}
    across = i.m * i.x_g
    coupled = {"Y_rdot": across - M[1, 2], "N_vdot": across - M[2, 1]}
    return {name: float(value) for name, value in {**heavier, **coupled}.items()}
