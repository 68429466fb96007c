"""Manoeuvres of ships that cannot give a force on every axis: orders of thrust and rudder over time.

Such a ship cannot follow any pose, so that a plan states what its actuators are asked, and its track is
simulated. A course gives two shares from -1 to 1, of the thrust ahead and of the rudder. A ship without
rudders has the moment of its propellers in place of it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from cosim import InputError
from fmus.guidance.trial_order import HARD_OVER
from fmus.ship import Ship

from ..predictors import Model, WeakWindows
from ..predictors.black_box import TAU
from ..predictors.thrust import FORGOTTEN
from .manoeuvre_library import SOFT, PlanStep, between, registered
from .planned_motion import USABLE_THRUST, Basin, PlannedMotion
from .spread import driven

# Time (n,) [s], duration [s], numbers from 0 to 1, time scale -> shares (n, 2) of thrust and rudder.
OrderCourse = Callable[[np.ndarray, float, Sequence[float], float], np.ndarray]
ORDERS: dict[str, OrderCourse] = {}
LEAST = 0.3  # 1, share of thrust under way: less hardly steers (chosen)
order = partial(registered, ORDERS)


def _shares(t: np.ndarray, thrust: ArrayLike, rudder: ArrayLike) -> np.ndarray:
    return np.column_stack(np.broadcast_arrays(thrust, rudder, t))[:, :2]


def _level(x: float) -> float:
    return between(LEAST, 1.0, x)


def _half_period(x: float, scale: float) -> float:
    return scale * between(SOFT, FORGOTTEN / 2.0, x)  # up to half of a manoeuvre


@order("straight")
def straight(t: np.ndarray, T: float, x: Sequence[float], scale: float) -> np.ndarray:
    """Straight legs with steps of the thrust"""
    steps = np.array([_level(x[0]), _level(x[1]), _level(x[2])])
    return _shares(t, steps[np.minimum((3.0 * t / T).astype(int), 2)], 0.0)


@order("turn")
def turn(t: np.ndarray, T: float, x: Sequence[float], scale: float) -> np.ndarray:
    """Turning circle to one side"""
    return _shares(t, _level(x[0]), (1.0 if x[1] < 0.5 else -1.0) * _level(x[2]))


@order("swing")
def swing(t: np.ndarray, T: float, x: Sequence[float], scale: float) -> np.ndarray:
    """Zig-zag: rudder to both sides in turn"""
    half = _half_period(x[2], scale)
    # The first swing takes half of the others, so that the mean course stays.
    return _shares(t, _level(x[0]), _level(x[1]) * np.where((t / half + 0.5) % 2.0 < 1.0, 1.0, -1.0))


@order("stop")
def stop(t: np.ndarray, T: float, x: Sequence[float], scale: float) -> np.ndarray:
    """Stop: thrust ahead, then astern as far as the actuators can"""
    return _shares(t, np.where(t < T * (0.4 + 0.3 * x[0]), _level(x[1]), -_level(x[2])), 0.0)


@order("spiral")
def spiral(t: np.ndarray, T: float, x: Sequence[float], scale: float) -> np.ndarray:
    """Spiral: rudder in steps from one side to the other"""
    side = _level(x[1]) * (1.0 if x[2] < 0.5 else -1.0)
    return _shares(
        t, _level(x[0]), side * np.linspace(1.0, -1.0, 5)[np.minimum((5.0 * t / T).astype(int), 4)]
    )


@order("order steps")
def order_steps(t: np.ndarray, T: float, x: Sequence[float], scale: float) -> np.ndarray:
    """Steps of thrust and rudder with periods of their own"""
    first, second = _half_period(x[2], scale), _half_period(x[3], scale)
    fast = np.where((t / first) % 2.0 < 1.0, _level(x[0]), LEAST * x[4])
    return _shares(t, fast, _level(x[1]) * np.where((t / second + 0.5) % 2.0 < 1.0, 1.0, -1.0))


# 1, usual runs of the same length, for comparison.
USUAL_ORDERS = {
    "straight": (("straight", (0.6,) * 3),),
    "circle": (("turn", (0.6, 0.0, 0.6)),),
    "zig-zag": (("swing", (0.6, 0.4, 0.3)),),
}


@dataclass(frozen=True, eq=False)
class Orders:
    """What the actuators of a ship can be asked, and which of it is thrust and rudder.

    Attributes:
        names: inputs of the thrusters' FMU.
        low, high: (k,), of thrust, each; zero of a rudder.
        rudder: (k,), of full rudder; zero of thrust.
    """

    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    rudder: np.ndarray

    @classmethod
    def of(cls, model: Model, data: Sequence[WeakWindows], faster: float) -> "Orders":
        """Of a ship, up to some times the thrust of its measured runs, within its limits.

        Raises:
            InputError: the ship cannot be steered by them.
        """
        ship, params = model.ship, model.drive.params
        used = [asked_of(w, ship) for w in data]
        most = faster * np.max([np.abs(x).max(axis=0) for x in used], axis=0)
        if ship.description.allocates:
            full = USABLE_THRUST * np.array(ship.layout.full(params))
            thrust = np.array([min(most[0], full[0]), 0.0, 0.0])
            found = cls(TAU, -thrust, thrust, np.array([0.0, 0.0, min(most[2], 0.5 * full[2])]))
        else:
            angle = np.array([u == "rad" for u in ship.commands.values()])
            low, high = np.array(ship.layout.limits(params)).T
            steer = np.minimum(np.minimum(high, -low), HARD_OVER)
            found = cls(
                ship.layout.commands,
                np.where(angle, 0.0, np.maximum(-most, low)),
                np.where(angle, 0.0, np.minimum(most, high)),
                np.where(angle, steer, 0.0),
            )
        if not found.high.any() or not found.rudder.any():
            raise InputError(
                f"no run is designed for {ship.name}: its measured runs and actuators leave no thrust "
                "ahead, or nothing to steer with"
            )
        return found

    def motions(
        self,
        plans: Sequence[Sequence[PlanStep]],
        seconds: float,
        h: float,
        pace: float,
        model: Model,
        basin: Basin,
    ) -> list[PlannedMotion]:
        """The motions of a model from rest by the orders of plans, each about the middle of the basin.

        Args:
            plans: their courses.
            seconds, h: length and step [s].
            pace: share of the largest thrust and rudder.
            model: that is simulated.
            basin: in which they lie.
        """
        t = h * np.arange(round(seconds / h) + 1)
        asked = np.stack([self._asked(plan, t, pace, model) for plan in plans], axis=2)
        headings = np.array([plan[0].heading for plan in plans])
        tracks = driven([model], asked, np.stack([0.0 * headings, 0.0 * headings, headings]), h)
        pairs = zip(tracks, np.moveaxis(asked, 2, 0), strict=True)
        return [PlannedMotion.along(eta, h, basin, orders) for eta, orders in pairs]

    def _asked(self, plan: Sequence[PlanStep], t: np.ndarray, pace: float, model: Model) -> np.ndarray:
        """(n, k), the orders of a plan."""
        ends = np.cumsum([s.seconds for s in plan])
        which = np.minimum(np.searchsorted(ends - 1e-9, t, side="right"), len(plan) - 1)
        parts = [
            ORDERS[s.name](
                t[which == k] - (end - s.seconds), s.seconds, s.numbers, model.ship.scale.time
            )
            for k, (s, end) in enumerate(zip(plan, ends, strict=True))
        ]
        thrust, rudder = np.hsplit(pace * np.concatenate(parts), 2)
        ahead = np.where(thrust > 0.0, thrust * self.high, -thrust * self.low)
        return ahead + rudder * self.rudder


def asked_of(w: WeakWindows, ship: Ship) -> np.ndarray:
    """(n, k), what the thrusters were asked in a measured run, as their FMU takes it."""
    run = w.run
    return run.tau_cmd if ship.description.allocates or run.commands is None else run.commands
