"""The motion of a plan as a run that was never measured, and the thrust that it needs."""

from dataclasses import dataclass, replace

import numpy as np

from fmus.signals import Force
from fmus.vessel import vessel

from ..predictors import Model, WeakWindows, weak_windows
from ..predictors.uncertainty import MEASURED
from ..runs import Run, Smoothed, body_acceleration, body_velocity

# 1, of the limit of an actuator: two standard deviations of a model remain for control
USABLE_THRUST = 1.0 - 2.0 * MEASURED


@dataclass(frozen=True)
class Basin:
    """A rectangle for the whole hull: lowest and highest north and east [m]."""

    north: tuple[float, float]
    east: tuple[float, float]

    @property
    def middle(self) -> np.ndarray:
        return np.array([sum(self.north), sum(self.east)]) / 2.0

    @property
    def size(self) -> np.ndarray:
        return np.array([self.north[1] - self.north[0], self.east[1] - self.east[0]])

    def margin(self, eta: np.ndarray, outline: np.ndarray) -> np.ndarray:
        """(n,), least distance of a ship from the walls [m], negative where it is outside or ran away.

        Args:
            eta: (n, 3), pose.
            outline: (k, 2), corners of the hull in the body frame [m].
        """
        with np.errstate(invalid="ignore"):  # of a ship that ran away
            c, s = np.cos(eta[:, 2:]), np.sin(eta[:, 2:])
            north = eta[:, :1] + c * outline[:, 0] - s * outline[:, 1]
            east = eta[:, 1:2] + s * outline[:, 0] + c * outline[:, 1]
            walls = [north - self.north[0], self.north[1] - north]
            walls += [east - self.east[0], self.east[1] - east]
        return np.nan_to_num(np.min(walls, axis=(0, 2)), nan=-np.inf, posinf=np.inf, neginf=-np.inf)


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A target over time, with derivatives by central differences.

    Attributes:
        time: (n,) [s].
        eta, eta_dot, eta_ddot: (n, 3), in the basin.
        orders: (n, k), what the thrusters' FMU is asked; None: a controller follows the target.
    """

    time: np.ndarray
    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray
    orders: np.ndarray | None = None

    @classmethod
    def along(
        cls, eta: np.ndarray, h: float, basin: Basin, orders: np.ndarray | None = None
    ) -> "PlannedMotion":
        """The motion along a track (n, 3), one sample every h [s], moved to the middle of the basin."""
        low, high = eta[:, :2].min(axis=0), eta[:, :2].max(axis=0)
        eta = np.column_stack([eta[:, :2] + basin.middle - 0.5 * (low + high), eta[:, 2]])
        first = np.gradient(eta, h, axis=0)
        return cls(h * np.arange(len(eta)), eta, first, np.gradient(first, h, axis=0), orders)

    def faster(self, factor: float) -> "PlannedMotion":
        """The same track at some times the speed."""
        rates = factor * self.eta_dot, factor**2 * self.eta_ddot
        return replace(self, time=self.time / factor, eta_dot=rates[0], eta_ddot=rates[1])

    @property
    def nu(self) -> np.ndarray:
        """(n, 3), body-fixed velocity."""
        return body_velocity(self.eta[:, 2], self.eta_dot)

    def thrust(self, model: Model) -> np.ndarray:
        """(n, 3), force that is commanded, or that a model needs for the motion [N, N, N m]."""
        if self.orders is not None:
            ship = model.ship
            return self.orders if ship.description.allocates else ship.commanded_force(self.orders)
        nu = self.nu
        nu_dot = body_acceleration(self.eta[:, 2], nu, self.eta_ddot)
        state = vessel.State._make([*self.eta.T, *nu.T, self.time])
        free = vessel.disturbed(state, Force(0.0, 0.0, 0.0), model.hull)
        needed = (nu_dot - np.column_stack(np.broadcast_arrays(*free))) @ model.mass.T
        return needed @ np.linalg.inv(model.effective_thrust).T


def load(tau: np.ndarray, model: Model) -> float:
    """The largest share of its limit that a force (n, 3) [N, N, N m] asks of an actuator."""
    layout, p = model.drive.effects.layout, model.drive.params
    # Where the allocation is linear below its limits, a small force shows what a large one would ask.
    small = 1.0 if layout.curved else 1e-3
    given = layout.allocate(tuple(small * tau.T), p)
    limits = zip(given, layout.limits(p), strict=True)
    return max(float(np.max(np.maximum(x / high, x / low))) / small for x, (low, high) in limits)


def as_windows(motion: PlannedMotion, tau: np.ndarray, like: Smoothed) -> WeakWindows:
    """The motion as a smoothed run of the same ship and measurement as a measured one.

    Args:
        motion: of the ship.
        tau: (n, 3), commanded force [N, N, N m].
        like: a measured run, whose noise and uncertainty the new one gets.
    """
    n, period = motion.time.size, float(motion.time[1] - motion.time[0])
    old, known = like.track, np.isfinite(like.nu[:, 0])
    commands = None if motion.orders is tau else motion.orders
    signals = old.run.signals
    run = Run("planned run", motion.time, motion.eta, tau, commands, ship=old.run.ship, signals=signals)
    no, yes = np.zeros(n, bool), np.ones(n, bool)
    every = np.ones((n, 3), bool)
    track = replace(
        old,
        run=run,
        pose=motion.eta,
        fresh=every,
        frozen=no,
        dropped=no,
        between=no,
        period=period,
        out=0,
    )
    std = {
        name: np.tile(np.median(getattr(like, name)[known], axis=0), (n, 1))
        for name in ("eta_std", "eta_dot_std", "eta_ddot_std", "nu_std")
    }
    smoothed = replace(
        like,
        track=track,
        spikes=~yes,
        agrees=every,
        eta=motion.eta,
        eta_dot=motion.eta_dot,
        eta_ddot=motion.eta_ddot,
        nu=motion.nu,
        noise=like.noise * np.sqrt(old.period / period),
        sensors=None,
        **std,
    )
    return weak_windows(smoothed)
