"""Runs with and without a failing thruster: several ships, manoeuvres and noise, many at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thesis.basin_trials import sysid4

from .hidden_effects.fleet import Fleet, Order
from .hidden_effects.manoeuvres import manoeuvres
from .hidden_effects.simulated_runs import NOISE, STEP, STOP, Hidden

# What the ships have that the detector's model lacks, over the whole run: instance.parameter -> value.
SHIPS: dict[str, dict[str, float]] = {
    "nominal": {},
    "SYSID4": sysid4.parameters(),
    "drag": {"vessel.delta_X_u": -2.0, "vessel.delta_N_r": -0.6},
    "current": {"vessel.V_n": 0.02, "vessel.V_e": -0.015},
    "lag": {"thrusters.lag": 0.4},
}
SHARES = (1.0, 0.5, 0.3)
# s; when a thruster fails: after two minutes at the latest, so that there is time to notice.
FAILS = (80.0, 160.0)
FAR = 3.0  # m; a ship that is further from its target is given up, and its run ends there


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes:
        ship: of SHIPS.
        noise: of NOISE.
        thruster: that fails, ``vsp`` or ``bow``; None.
        share: of its force that is lost.
        time: of the failure [s].
        order: the run.
    """

    ship: str
    noise: str
    thruster: str | None
    share: float
    time: float
    order: Order


@dataclass(frozen=True, eq=False)
class Watched:
    """Measurements of a run: time (n,) [s], pose (n, 3), commanded force (n, 3)."""

    case: Case
    time: np.ndarray
    pose: np.ndarray
    tau: np.ndarray


def cases(failing: int, sound: int, seed: int) -> list[Case]:
    """So many runs with and without a failure, drawn evenly over ships, noise and failures."""
    rng = np.random.default_rng([seed, 17])
    found = []
    kinds = [(t, s) for t in ("vsp", "bow") for s in SHARES]
    for k in range(failing + sound):
        thruster, share = kinds[k % len(kinds)] if k < failing else (None, 0.0)
        ship = list(SHIPS)[int(rng.integers(len(SHIPS)))]
        noise = list(NOISE)[int(rng.integers(len(NOISE)))]
        time = round(float(rng.uniform(*FAILS)), 1)
        number = seed * 1000 + k
        path = manoeuvres(number)[int(rng.integers(3))]
        parts = {
            part: {n.partition(".")[2]: x for n, x in SHIPS[ship].items() if n.startswith(part)}
            for part in ("vessel", "thrusters")
        }
        order = Order(path, Hidden(parts["vessel"], parts["thrusters"]), NOISE[noise], number)
        found.append(Case(ship, noise, thruster, share, time if thruster else STOP, order))
    return found


def sail_watched(todo: Sequence[Case]) -> list[Watched]:
    """Run all of them at once."""
    with np.errstate(all="ignore"):
        fleet = Fleet([c.order for c in todo])
        steps = round(STOP / STEP)
        kept = np.empty((steps + 1, 8, len(todo)))
        for k in range(steps + 1):
            for lane, c in enumerate(todo):
                if c.thruster and k == round(c.time / STEP):
                    fleet.thrusters.change(lane, {f"loss_{c.thruster}": c.share})
            if k:
                fleet.step(k)
            row = fleet.row()
            for column, values in enumerate([*row[:2], *row[15:]]):
                kept[k, column] = values
    time = np.round(np.arange(steps + 1) * STEP, 12)
    found = []
    for lane, c in enumerate(todo):
        away = np.hypot(*(kept[:, :2, lane] - fleet.targets[lane, :, :2]).T)
        gone = np.flatnonzero(~(away < FAR) & (time > 20.0))
        end = int(gone[0]) if gone.size else time.size
        found.append(Watched(c, time[:end], kept[:end, 2:5, lane], kept[:end, 5:, lane]))
    return found
