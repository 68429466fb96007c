"""What a hidden effect did, and which other effects could have done the same: from the truth alone.

Nothing here comes from the diagnosis: forces are computed with :mod:`fmus` on the true motion and the
true commands, without noise. They are averaged over windows of 3 s, as the diagnosis does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.signal import lfilter

from fmus.declare import packer, variables
from fmus.frames import rotate_to_body
from fmus.hull import Inertia, mass_matrix
from fmus.ship import ship
from fmus.signals import Force
from fmus.vessel import vessel

from .foreign_physics import WITH_FOREIGN, backlash, bias_by_place
from .simulated_runs import HEADING, POSITION, STEP, Voyage

SHIP = ship(WITH_FOREIGN)
VESSEL, THRUSTERS = SHIP.vessel, SHIP.thrusters
WINDOW, EVERY = 3.0, 0.5  # s, width of a window and from one to the next
THIN = 5  # samples in a step for forces on the hull, which change slowly
MASS = np.array(mass_matrix(Inertia()))
# An acceleration of pose noise, as a force: how much a newton counts on each axis.
WEIGHTS = 1.0 / (np.diag(MASS) * [POSITION, POSITION, HEADING])
WEIGHTS = WEIGHTS / WEIGHTS[0]
Values = Mapping[str, float]
NAMES = {c.name: {v.name for v in variables(c.params)} for c in (VESSEL, THRUSTERS)}


def filled(component: Any, values: Values) -> Any:
    """Parameters of a component, nominal but for the values that it has."""
    declared = variables(component.params)
    return packer(component.params)([float(values.get(v.name, v.start)) for v in declared])


@dataclass(frozen=True, eq=False)
class Motion:
    """What would be measured without noise, and what was commanded.

    Attributes:
        time: (n,) [s].
        eta, nu, nu_dot: (n, 3), SI.
        commanded: (n, 3), shares of full force of VSP surge, VSP sway and bow.
    """

    time: np.ndarray
    eta: np.ndarray
    nu: np.ndarray
    nu_dot: np.ndarray
    commanded: np.ndarray

    @cached_property
    def thin(self) -> "Motion":
        """Every fifth sample."""
        return Motion(*(x[::THIN] for x in (self.time, self.eta, self.nu, self.nu_dot, self.commanded)))

    @cached_property
    def tau(self) -> np.ndarray:
        """(n, 3), force of nominal thrusters [N, N, N m]."""
        return thrust(self, self.nu, {})

    @cached_property
    def lacking(self) -> np.ndarray:
        """(n, 3), force that the nominal model lacks."""
        return lack(self, {})


def motion(voyage: Voyage, values: Values) -> Motion:
    """The motion of a run as it is measured where the measurement has the effects in ``values``."""
    time = voyage.measured.time
    commanded = np.column_stack(
        SHIP.layout.allocate(tuple(voyage.measured.tau_cmd.T), SHIP.nominal_drive.params)
    )
    true = Motion(time, voyage.eta, voyage.nu, voyage.nu_dot, commanded)
    eta, nu, nu_dot = behind(true, {name: -value for name, value in values.items()})
    return Motion(time, eta, nu, nu_dot, commanded)


def behind(m: Motion, values: Values) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose, velocity and acceleration behind what a measurement with these effects gives."""
    clock = values.get("clock_offset", 0.0)
    eta, nu, nu_dot = (ahead(m.time, x, clock) for x in (m.eta, m.nu, m.nu_dot))
    if "distortion" in values:
        return _undistorted(m, values)
    turn = values.get("heading_offset", 0.0)
    dx, dy = values.get("marker_offset_dx", 0.0), values.get("marker_offset_dy", 0.0)
    x, y, psi = eta.T
    psi = psi - turn
    u, v = turned(turn, *nu.T[:2])
    u_dot, v_dot = turned(turn, *nu_dot.T[:2])
    r, r_dot = nu.T[2], nu_dot.T[2]
    c, s = np.cos(psi), np.sin(psi)
    return (
        np.column_stack([x - c * dx + s * dy, y - s * dx - c * dy, psi]),
        np.column_stack([u + r * dy, v - r * dx, r]),
        np.column_stack([u_dot + r_dot * dy, v_dot - r_dot * dx, r_dot]),
    )


def _undistorted(m: Motion, values: Values) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same for an error that depends on the place, to first order in it."""
    e = bias_by_place
    bias = [values.get(v.name, v.start) for v in e.parameters]
    eta = 2.0 * m.eta - np.column_stack(e(tuple(m.eta.T), *bias))
    slope = np.gradient(eta, m.time, axis=0)
    u, v = rotate_to_body(eta[:, 2], slope[:, 0], slope[:, 1])
    nu = np.column_stack([u, v, slope[:, 2]])
    return eta, nu, np.gradient(nu, m.time, axis=0)


def turned(angle: float, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A body-fixed vector seen from a heading that is less by ``angle``."""
    c, s = np.cos(angle), np.sin(angle)
    return c * a - s * b, s * a + c * b


def ahead(time: np.ndarray, x: np.ndarray, by: float) -> np.ndarray:
    """A signal (n, 3) ``by`` seconds later."""
    if by == 0.0:
        return x
    return np.column_stack([np.interp(time + by, time, column) for column in x.T])


def thrust(m: Motion, nu: np.ndarray, values: Values) -> np.ndarray:
    """tau (n, 3) from each sample to the next, of thrusters with these effects."""
    p = filled(THRUSTERS, values)
    delay, lag = p.dynamics.delay, p.dynamics.lag
    shares = m.commanded
    if delay:
        shares = np.where((m.time >= delay)[:, None], held(m.time, shares, delay), 0.0)
    if "backlash" in values:
        shares = followed(shares, values["backlash"])
    ready = THRUSTERS.prepared(p)
    now = SHIP.layout.running(m.time, *nu.T, tuple(shares.T), ready)
    if lag:
        shares = lfilter(*SHIP.effects["lag"].memory.filter(STEP, lag), shares, axis=0)
    tau = SHIP.layout.act(tuple(shares.T), now, ready)
    return np.column_stack(np.broadcast_arrays(*tau))


def followed(commands: np.ndarray, play: float) -> np.ndarray:
    """Commands (n, 3) after a linkage with play."""
    given, rows = (0.0, 0.0, 0.0), []
    for row in commands.tolist():
        given, _ = backlash(given, tuple(row), STEP, play)
        rows.append(given)
    return np.array(rows)


def held(time: np.ndarray, x: np.ndarray, delay: float) -> np.ndarray:
    """Mean over each interval of a signal (n, 3) that is held between samples, ``delay`` [s] ago."""
    steps, part = divmod(delay / STEP + 1e-9, 1.0)
    rows = np.arange(time.size) - int(steps)
    return (1.0 - part) * x[np.maximum(rows, 0)] + part * x[np.maximum(rows - 1, 0)]


def lack(m: Motion, values: Values) -> np.ndarray:
    """Force (n, 3) that a model with these additions lacks for the motion."""
    eta, nu, nu_dot = behind(m, values)
    body = VESSEL.prepared(filled(VESSEL, values))
    # An offset of the pose's clock leaves the commands where they are.
    tau = thrust(m, nu, values) if NAMES["thrusters"] & set(values) else thrust(m, nu, {})
    free = vessel.disturbed(vessel.State(*eta.T, *nu.T, m.time), Force(*tau.T), body)
    mass = np.array(mass_matrix(body.hull.inertia))
    return (nu_dot - np.column_stack(np.broadcast_arrays(*free))) @ mass.T


def force(m: Motion, values: Values) -> np.ndarray:
    """What effects add to the nominal model, (n, 3) [N, N, N m].

    Args:
        m: motion and commands.
        values: parameters of vessel and thrusters, and ``clock_offset``.
    """
    if set(values) <= NAMES["thrusters"]:
        return thrust(m, m.nu, values) - m.tau
    return m.lacking - lack(m, values)


def windows(x: np.ndarray, step: float = STEP) -> np.ndarray:
    """Means (K, 3) of a signal (n, 3), a sample each ``step`` [s], over windows of 3 s, every 0.5 s."""
    width = round(WINDOW / step) + 1
    s = np.linspace(-1.0, 1.0, width)
    weights = (1.0 - s * s) ** 3
    parts = np.lib.stride_tricks.sliding_window_view(x, width, axis=0)[:: round(EVERY / step)]
    return parts @ (weights / weights.sum())


def over(runs: Sequence[Motion], values: Values) -> np.ndarray:
    """Windows (K, 3) of what effects add, over some runs one after the other."""
    if set(values) <= NAMES["thrusters"]:
        return np.concatenate([windows(force(m, values)) for m in runs])
    return np.concatenate([windows(force(m.thin, values), THIN * STEP) for m in runs])
