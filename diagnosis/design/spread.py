"""Where the ship may be during a plan: the closed loop of many models drawn from the posterior."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.controller import abs as adaptive
from fmus.controller.backstepping import Inputs
from fmus.signals import Estimate, Target

from ..assessment.closed_loop import LoopPart
from ..execution.progress import Advance, silent
from ..predictors import Model
from ..predictors.prediction import merged
from .hypotheses import Space
from .information import Knowledge
from .planned_motion import Basin, PlannedMotion

STEP = 0.2  # s, times the time scale: of this loop, a tenth of the shortest ramp; chosen
MEMBERS = 20  # drawn from each hypothesis: of these the outermost is the 95 % spread on either side


@dataclass(frozen=True, eq=False)
class Spread:
    """Tracks of a plan under every likely hypothesis.

    Attributes:
        time: (n,) [s].
        eta: (h, members, n, 3), poses; the first member has the mean parameters.
        ids: numbers of the hypotheses.
        margin: (h,), least distance of the hull from the walls of the basin over all members [m].
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
    """(p, n, 3), poses of models from rest, by their orders, or kept on a target by a controller.

    The controller gets the true motion: noise of the measurement moves a ship much less than its margin.

    Args:
        models: of one ship.
        motion: the target or the orders, at equal steps.
    """
    of, h = merged(models, lambda values: values), float(motion.time[1] - motion.time[0])
    start = dict(zip(("x_0", "y_0", "psi_0"), map(float, motion.eta[0]), strict=True))
    craft = of.ship
    ship = LoopPart(craft.vessel, {**of.vessel, **start})
    drive = LoopPart(craft.thrusters, of.thrusters)
    controller = LoopPart(craft.serving(adaptive.COMPONENT), {})
    targets = np.column_stack([motion.eta, motion.eta_dot, motion.eta_ddot])
    nothing = craft.thrusters.inputs().request
    found = np.empty((len(models), len(targets), 3))
    with np.errstate(all="ignore"):  # a ship that runs away gives infinities, which count as outside
        s, out = ship.begin(craft.vessel.inputs())
        c: Any = None
        t: Any = None
        for k, row in enumerate(targets):
            for axis in range(3):
                found[:, k, axis] = out.pose[axis]
            v = out.velocity
            if motion.orders is not None:
                request = nothing._make(motion.orders[k].tolist())
            else:
                x, y, psi = out.pose[:3]
                known = Estimate(x, y, psi, v.u, v.v, v.r, out.u_dot, out.v_dot, out.r_dot)
                given = Inputs(known, Target(*map(float, row)))
                c, demand = controller.begin(given) if c is None else controller.advance(c, given, h)
                request = demand.tau
            asked = craft.thrusters.inputs(request, v)
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
    advance: Advance = silent,
) -> Spread:
    """The tracks of a plan under some hypotheses.

    Args:
        space, k: the hypotheses and their parameters.
        ids: numbers of those that are likely.
        motion: the target every ``STEP`` times the time scale.
        basin, outline: walls, and corners of the hull (k, 2) [m].
        seed: of the draws.
        advance: progress callback.
    """
    advance(f"closed loop of {len(ids) * MEMBERS} models along the plan")
    rng = np.random.default_rng(seed)
    eta = followed([m for n in ids for m in drawn(space, k, n, rng)], motion)
    eta = eta.reshape(len(ids), MEMBERS, *eta.shape[1:])
    margins = [
        np.nan_to_num([basin.margin(track, outline).min() for track in each], nan=-np.inf).min()
        for each in eta
    ]
    return Spread(motion.time, eta, list(ids), np.array(margins))
