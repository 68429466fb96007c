"""Where the ship may be during a plan: the closed loop of many models drawn from the posterior."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from fmus.controller import abs as adaptive
from fmus.controller.backstepping import Inputs
from fmus.declare import flatten, rebuild
from fmus.ship import Ship
from fmus.signals import Estimate, Target

from ..assessment.closed_loop import LoopPart
from ..predictors import Model
from ..predictors.black_box import POSE
from ..predictors.prediction import merged
from ..predictors.traced.recorded_law import stepped
from ..predictors.uncertainty import MEASURED
from ..runs.run_constants import CHANCE
from .hypotheses import Space
from .information import Knowledge
from .planned_motion import Basin, PlannedMotion

# Ships drawn from each hypothesis: if none of them leaves the basin, the next one does so with this
# chance (rule of succession). So many outcomes have a standard error of 5 % at the most.
MEMBERS = round(1.0 / CHANCE)


@dataclass(frozen=True, eq=False)
class Spread:
    """Tracks of a plan under every likely hypothesis.

    Attributes:
        eta: (h, members, n, 3), poses; the first member has the mean parameters.
        ids: numbers of the hypotheses.
        margin: (h,), least distance of the hull from the walls of the basin over all members, at the
            speed of the plan and faster [m].
    """

    eta: np.ndarray
    ids: Sequence[int]
    margin: np.ndarray


def drawn(space: Space, k: Knowledge, n: int, rng: np.random.Generator) -> list[Model]:
    """Models of a hypothesis: that of its mean parameters, then some by their posterior."""
    h, e = k.hypotheses[n], k.estimates[n]
    draws = rng.multivariate_normal(e.mean[h.columns], e.covariance, MEMBERS - 1, method="eigh")
    found = [space.model(h, e.mean)]
    for values in draws:
        z = np.zeros(e.mean.size)
        z[h.columns] = values
        found.append(space.model(h, z))
    return found


def followed(models: Sequence[Model], motion: PlannedMotion) -> np.ndarray:
    """(p, n, 3), poses of models that a controller keeps on a target, or by orders, started at rest.

    The controller gets the true motion: noise of the measurement moves a ship much less than its margin.
    """
    h = float(motion.time[1] - motion.time[0])
    if motion.orders is not None:
        return driven(models, motion.orders[..., None], motion.eta[0], h)
    targets = np.column_stack([motion.eta, motion.eta_dot, motion.eta_ddot])
    return _tracks(models, motion.eta[0], targets[..., None], Loop(models[0].ship, h, True))


def driven(models: Sequence[Model], orders: np.ndarray, start: np.ndarray, h: float) -> np.ndarray:
    """(p, n, 3), poses of models whose thrusters get orders, started at rest.

    Args:
        models: of one ship; one, or as many as there are orders.
        orders: (n, k, p or 1), what the thrusters' FMU is asked in each step.
        start: (3,) or (3, p), first pose.
        h: step [s].
    """
    return _tracks(models, start, orders, Loop(models[0].ship, h, False))


class Moving(NamedTuple):
    """What a loop carries from step to step.

    Attributes:
        pose, velocity, rates: of the ship; rates are those of its velocity.
        vessel, thrusters, controller: states of the components; the last two are None before the first
            step.
    """

    pose: tuple[Any, ...]
    velocity: tuple[Any, ...]
    rates: tuple[Any, ...]
    vessel: Any
    thrusters: Any = None
    controller: Any = None


@dataclass(frozen=True)
class Loop:
    """Ships that a controller keeps on targets, or that orders drive.

    Attributes:
        ship: of all models.
        h: step [s].
        held: whether there is a controller.
        like: what is carried, of any model.
    """

    ship: Ship
    h: float
    held: bool
    like: Moving | None = field(default=None, compare=False)

    def __call__(self, flat: Sequence[Any], given: Sequence[Any], *parts: Any) -> list[Any]:
        """A step on numbers in one row."""
        return flatten(self.step(rebuild(cast(Moving, self.like), flat), given, *parts))

    def step(self, now: Moving, given: Sequence[Any], hull: Any, drive: Any) -> Moving:
        """A step with a target or orders, by the prepared vessel and thrusters; the first one begins."""
        vessel, thrusters = self.ship.vessel, self.ship.thrusters
        begins = now.thrusters is None
        h = 0.0 if begins else self.h
        controller, request = self._request(now, given)
        velocity = vessel.outputs().velocity._make(now.velocity)
        asked = thrusters.inputs(thrusters.inputs().request._make(request), velocity)
        state = thrusters.init(asked, drive.params) if begins else now.thrusters
        state, thrust = thrusters.advance(state, asked, drive, h)
        acting = vessel.inputs(thrust.tau_act_X, thrust.tau_act_Y, thrust.tau_act_N)
        return seen(*vessel.advance(now.vessel, acting, hull, self.h), state, controller)

    def _request(self, now: Moving, given: Sequence[Any]) -> tuple[Any, Sequence[Any]]:
        """The state of the controller, and what it asks of the thrusters."""
        if not self.held:
            return (), given
        inputs = Inputs(Estimate(*now.pose, *now.velocity[:3], *now.rates), Target(*given))
        if now.controller is None:
            state, demand = self._controller.begin(inputs)
        else:
            state, demand = self._controller.advance(now.controller, inputs, self.h)
        return state, demand.tau

    @cached_property
    def _controller(self) -> LoopPart:
        return LoopPart(self.ship.serving(adaptive.COMPONENT), {})


def seen(state: Any, out: Any, thrusters: Any = None, controller: Any = None) -> Moving:
    """What is carried, of the vessel's state and outputs."""
    rates = out.u_dot, out.v_dot, out.r_dot
    return Moving(tuple(out.pose[:3]), tuple(out.velocity), rates, state, thrusters, controller)


def _tracks(models: Sequence[Model], start: np.ndarray, given: np.ndarray, loop: Loop) -> np.ndarray:
    """Poses (p, n, 3) from rest, of models or by targets or orders (n, k, p or 1) of several."""
    of, craft = merged(models, lambda values: values), models[0].ship
    begin = {
        n: x if x.size > 1 else x.item() for n, x in zip(("x_0", "y_0", "psi_0"), start, strict=True)
    }
    ship = LoopPart(craft.vessel, {**of.vessel, **begin})
    parts = ship.prepared, LoopPart(craft.thrusters, of.thrusters).prepared
    rows = [[x.item() if x.size == 1 else x for x in row] for row in given]
    with np.errstate(all="ignore"):  # a ship that runs away gives infinities, which count as outside
        first = seen(*ship.begin(craft.vessel.inputs()))
        now = loop.step(first, rows[0], *parts)
        further = stepped(replace(loop, like=now), flatten(now), given[1:-1], parts, len(POSE))
    count = max(len(models), given.shape[2], np.size(start[0]))
    poses = [np.broadcast_to(x, count) for x in first.pose]
    tracks = np.concatenate(
        [np.stack(poses)[None], np.broadcast_to(further, (len(further), len(POSE), count))]
    )
    return tracks.transpose(2, 0, 1)


def spread(
    space: Space,
    k: Knowledge,
    ids: Sequence[int],
    motion: PlannedMotion,
    basin: Basin,
    outline: np.ndarray,
    seed: int,
) -> Spread:
    """The tracks of a plan under some hypotheses.

    Args:
        space, k: the hypotheses and their parameters.
        ids: numbers of those that are likely.
        motion: the target every ``BRIEF`` times the time scale.
        basin, outline: walls, and corners of the hull (k, 2) [m].
        seed: of the draws.
    """
    rng = np.random.default_rng(seed)
    models = [m for n in ids for m in drawn(space, k, n, rng)]
    eta = followed(models, motion)
    every = [eta]
    if motion.orders is None:  # which have no speed of their own
        # The controller of a ship that is close to diverging loses control at a higher speed: by two
        # prior standard deviations of a coefficient.
        every.append(followed(models, motion.faster(1.0 + 2.0 * MEASURED)))
    least = [[basin.margin(track, outline).min() for track in each] for each in every]
    margins = np.min(least, axis=0).reshape(len(ids), MEMBERS)
    tracks = eta.reshape(len(ids), MEMBERS, *eta.shape[1:])
    return Spread(tracks, list(ids), margins.min(axis=1))
