"""The model of ship and thrusters, evaluated on a measured motion.

A model is what differs from the nominal parameters, by the names of the FMUs; the physics are those of
:mod:`fmus`, called on whole series.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.signal import lfilter

from cosim import InputError
from cosim.errors import nearest
from fmus.declare import variables
from fmus.effects.registry import Running
from fmus.signals import Force
from fmus.thrusters import chain
from fmus.thrusters.allocation import allocate
from fmus.thrusters.thrusters import COMPONENT as THRUSTERS
from fmus.vessel import vessel as ship
from fmus.vessel.vessel import COMPONENT as VESSEL

from .measurement import ASIDE, Run, propellers
from .prediction import parameters

Series = np.ndarray
INSTANCES = {"vessel": VESSEL, "thrusters": THRUSTERS}


@dataclass(frozen=True, eq=False)
class Model:
    """Parameters of vessel and thrusters, by name; what is not named is nominal.

    Attributes:
        vessel, thrusters: parameter -> value.
        clock: seconds by which a pose is older than its stamp, the effect clock_offset.
    """

    vessel: Mapping[str, float] = field(default_factory=dict)
    thrusters: Mapping[str, float] = field(default_factory=dict)
    clock: float = 0.0

    def plus(self, changes: Mapping[str, float]) -> "Model":
        """The model with additions to some parameters, wherever they belong."""
        parts: dict[str, dict[str, float]] = {k: dict(getattr(self, k)) for k in INSTANCES}
        clock = self.clock
        for name, value in changes.items():
            if name == "clock_offset":
                clock += value
                continue
            part = owner(name)
            parts[part][name] = parts[part].get(name, START[part][name]) + value
        return Model(parts["vessel"], parts["thrusters"], clock)

    @cached_property
    def hull(self) -> ship.Prepared:
        return ship.prepare(parameters(VESSEL, self.vessel))

    @cached_property
    def drive(self) -> Any:
        return parameters(THRUSTERS, self.thrusters)


START = {
    part: {v.name: v.start for v in variables(component.params)} for part, component in INSTANCES.items()
}


def owner(name: str) -> str:
    """Which FMU a parameter belongs to.

    Raises:
        InputError: none has it.
    """
    for part, starts in START.items():
        if name in starts:
            return part
    known = [name for starts in START.values() for name in starts]
    raise InputError(f"no parameter '{name}'{nearest(name, known)}")


def acceleration(model: Model, time: Series, eta: Series, nu: Series) -> Series:
    """nu_dot (n, 3) [m/s2, m/s2, rad/s2] of the hull without thrust.

    Args:
        time: (n,) [s].
        eta: (n, 3) true pose [m, m, rad].
        nu: (n, 3) body-fixed velocity over ground.
    """
    s = ship.State._make([*eta.T, *nu.T, time])
    return np.column_stack(np.broadcast_arrays(*ship.stirred(s, Force(0.0, 0.0, 0.0), model.hull)))


def by_mass(model: Model, force: Series) -> Series:
    """M^-1 of a force (n, 3)."""
    i11, i22, i23, i32, i33 = model.hull.hull.inverse
    X, Y, N = force.T
    return np.column_stack([i11 * X, i22 * Y + i23 * N, i32 * Y + i33 * N])


def shares(run: Run, model: Model) -> list[tuple[Series, float]]:
    """For each set of thrusters its shares of full force (n, 3), and where it sits to starboard [m]."""
    if run.five is not None:
        both = propellers(run.five)
        return [(both[:, k], aside) for k, aside in enumerate(ASIDE)]
    if run.u is not None:
        return [(run.u, 0.0)]
    X, Y, N = run.tau_cmd.T
    return [(np.column_stack(allocate(X, Y, N, model.drive.allocation)), 0.0)]


def delayed(time: Series, commands: Series, delay: float) -> Series:
    """Commands (n, 3) of ``delay`` [s] ago, mean over each interval, zero before the first."""
    if delay == 0.0:
        return commands
    dt = np.append(np.diff(time), np.median(np.diff(time)))
    edges = np.append(time, time[-1] + dt[-1])
    sums = np.vstack([np.zeros(3), np.cumsum(commands * dt[:, None], axis=0)])
    at = np.column_stack([np.interp(edges - delay, edges, sums[:, k]) for k in range(3)])
    return np.diff(at, axis=0) / dt[:, None]


def lagged(time: Series, commands: Series, T: float) -> Series:
    """Mean over each interval of a first-order lag behind held commands (n, 3)."""
    if T <= 0.0:
        return commands
    dt = float(np.median(np.diff(time)))
    keep = np.exp(-dt / T)
    at = lfilter([0.0, 1.0 - keep], [1.0, -keep], commands, axis=0)
    return commands + (at - commands) * (T / dt) * (1.0 - keep)


def thrust(run: Run, model: Model, nu: Series) -> Series:
    """tau (n, 3) [N, N, N m] that acts from each sample to the next."""
    p = model.drive
    delay, lag = p.dynamics
    acting = [member.acting(p.wrong) for member in chain.IN_THRUSTERS.members]
    power = chain.FULL_POWER if run.power is None else chain.Power(*run.power.T)
    total = np.zeros_like(run.tau_cmd)
    for commands, aside in shares(run, model):
        given = delayed(run.time, commands, delay + model.clock)
        now = Running._make([run.time, *nu.T, *given.T])
        forces = lagged(run.time, given, lag)
        plant = p.plant._replace(plant_p_y=p.plant.plant_p_y + aside)
        total += np.column_stack(
            np.broadcast_arrays(*chain.act(tuple(forces.T), now, plant, acting, p.wrong, power))
        )
    return total
