"""Where the ship may be during a plan: the closed loop of many models drawn from the posterior."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.controller import abs as adaptive
from fmus.controller.backstepping import Inputs
from fmus.signals import Estimate, Target

from ..assessment.closed_loop import LoopPart
from ..predictors import Model
from ..predictors.prediction import merged
from ..predictors.uncertainty import MEASURED
from .hypotheses import Space
from .information import Knowledge
from .planned_motion import Basin, PlannedMotion

MEMBERS = 20  # 1, drawn from each hypothesis: of these the outermost is the 95 % spread on either side


@dataclass(frozen=True, eq=False)
class Spread:
    """Tracks of a plan under every likely hypothesis.

    Attributes:
        time: (n,) [s].
        eta: (h, members, n, 3), poses; the first member has the mean parameters.
        ids: numbers of the hypotheses.
        margin: (h,), least distance of the hull from the walls of the basin over all members, at the
            speed of the plan and faster [m].
    """

    time: np.ndarray
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
    h, controller = float(motion.time[1] - motion.time[0]), models[0].ship.serving(adaptive.COMPONENT)
    if motion.orders is not None:
        return driven(models, motion.orders[..., None], motion.eta[0], h)
    part, now = LoopPart(controller, {}), None
    targets = np.column_stack([motion.eta, motion.eta_dot, motion.eta_ddot])

    def request(k: int, out: Any) -> Any:
        nonlocal now
        v, (x, y, psi) = out.velocity, out.pose[:3]
        known = Estimate(x, y, psi, v.u, v.v, v.r, out.u_dot, out.v_dot, out.r_dot)
        given = Inputs(known, Target(*map(float, targets[k])))
        now, demand = part.begin(given) if now is None else part.advance(now, given, h)
        return demand.tau

    return _tracks(models, motion.eta[0], h, len(targets), request)


def driven(models: Sequence[Model], orders: np.ndarray, start: np.ndarray, h: float) -> np.ndarray:
    """(p, n, 3), poses of models whose thrusters get orders, started at rest.

    Args:
        models: of one ship; one, or as many as there are orders.
        orders: (n, k, p or 1), what the thrusters' FMU is asked in each step.
        start: (3,) or (3, p), first pose.
        h: step [s].
    """
    asked = models[0].ship.thrusters.inputs().request
    rows = [[x.item() if x.size == 1 else x for x in row] for row in orders]
    return _tracks(models, start, h, len(rows), lambda k, _: asked._make(rows[k]), orders.shape[2])


def _tracks(
    models: Sequence[Model],
    start: np.ndarray,
    h: float,
    steps: int,
    request: Callable[[int, Any], Any],
    count: int = 1,
) -> np.ndarray:
    """Poses (p, steps, 3) from rest, of models or by requests (step, outputs of the ship) of several."""
    of = merged(models, lambda values: values)
    craft = of.ship
    begin = {
        n: x if x.size > 1 else x.item() for n, x in zip(("x_0", "y_0", "psi_0"), start, strict=True)
    }
    ship = LoopPart(craft.vessel, {**of.vessel, **begin})
    drive = LoopPart(craft.thrusters, of.thrusters)
    found = np.empty((max(len(models), count), steps, 3))
    with np.errstate(all="ignore"):  # a ship that runs away gives infinities, which count as outside
        s, out = ship.begin(craft.vessel.inputs())
        t: Any = None
        for k in range(steps):
            for axis in range(3):
                found[:, k, axis] = out.pose[axis]
            asked = craft.thrusters.inputs(request(k, out), out.velocity)
            t, thrust = drive.begin(asked) if t is None else drive.advance(t, asked, h)
            acting = craft.vessel.inputs(thrust.tau_act_X, thrust.tau_act_Y, thrust.tau_act_N)
            s, out = ship.advance(s, acting, h)
    return found


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
        motion: the target every ``EVERY`` times the time scale.
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
    margins = np.nan_to_num(np.min(least, axis=0), nan=-np.inf).reshape(len(ids), MEMBERS)
    return Spread(
        motion.time, eta.reshape(len(ids), MEMBERS, *eta.shape[1:]), list(ids), margins.min(axis=1)
    )
