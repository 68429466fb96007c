"""The search for the plan that discriminates best: Sobol points over the library, then evolution."""

import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from cosim import InputError
from cosim.scenario import read_model

from ..execution.progress import Advance, silent
from ..predictors import Model, WeakWindows
from ..predictors.thrust import FORGOTTEN
from ..runs.cleaning import BRIEF
from ..runs.run_constants import CHANCE, NEGLIGIBLE
from ..search.nonlinear.multistart import POINTS, REFINED
from ..search.shortlist import LENGTH
from .hypotheses import Space
from .information import CRITERIA, Knowledge, check_criterion, inseparable
from .manoeuvre_library import (
    DIMENSIONS,
    LIBRARY,
    USUAL_MANOEUVRES,
    PlanStep,
    Reach,
    UsualRuns,
    poses,
    sequence,
    usual,
)
from .order_library import ORDERS, USUAL_ORDERS, Orders
from .planned_motion import USABLE_THRUST, Basin, PlannedMotion, as_windows, load
from .spread import MEMBERS, Spread, spread

SECONDS = 40.0  # s, of a search at the most; a design with its check takes at most a minute
EVOLVED = 160  # 1, points tried by evolution at the most; chosen: some ten seconds
MOST_PIECES = 6  # 1, manoeuvres of a run; chosen: of more the search finds no good ones in its time
FASTER = 1.5  # 1, times the fastest measured motion: as far as a model is used beyond its data (chosen)
Size = tuple[float, float]  # shares of the largest speeds and of the room
# 1, shares of the largest speeds and of the room that are tried until a plan keeps the limits; chosen.
SMALLER: tuple[Size, ...] = ((1.0, 1.0), (1.0, 0.7), (0.75, 0.7), (0.6, 0.5), (0.4, 0.4))
NO_SPREAD = (
    "the spread of the likely candidates leaves the basin in every plan that was checked; give a larger "
    "basin or fewer minutes"
)
ROUNDED = 1.3  # 1, times the largest speeds, which ramps and turned axes exceed a little (chosen)


@dataclass(frozen=True)
class Limits:
    """What a plan must keep.

    Attributes:
        seconds: length of a run [s].
        basin: for the whole hull; None: as far as the measured runs reach, and a ship's length more.
        size: north and east length of a basin about the middle of the measured tracks [m].
    """

    seconds: float
    basin: Basin | None = None
    size: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class ScoredPlan:
    """A plan that was evaluated.

    Attributes:
        steps: the manoeuvres.
        size: shares of the largest speeds and of the room.
        motion: the target.
        gram: (p, p), information of a run along it; zero where it cannot be carried out.
        excess: by how much it exceeds limits, zero where it keeps them [1].
        score: by the criterion; below that of any plan that keeps the limits where one is exceeded.
    """

    steps: Sequence[PlanStep]
    size: Size
    motion: PlannedMotion
    gram: np.ndarray
    excess: float
    score: float


@dataclass(eq=False)
class Designer:
    """Plans for a ship within limits, and what they would show.

    Attributes:
        data: measured training runs.
        space: the parameters.
        model: the likeliest model, by which thrust is computed.
        limits: to keep.
        criterion: name of one of :data:`.information.CRITERIA`.
    """

    data: Sequence[WeakWindows]
    space: Space
    model: Model
    limits: Limits
    criterion: str = "certainty"
    advance: Advance = silent
    tried: list[ScoredPlan] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_criterion(self.criterion)
        room = self.basin.size - 2.0 * (self.margin + np.ptp(self.outline[:, 0]) / 2.0)
        if room.min() <= 0.0:
            need = self.basin.size - room
            raise InputError(
                f"the basin of {self.basin.size[0]:.3g} m by {self.basin.size[1]:.3g} m is too small: "
                f"ship and margin need more than {need[0]:.3g} m"
            )
        shortest = FORGOTTEN * self.scale / 2.0
        if not shortest <= self.limits.seconds:
            raise InputError(f"a run takes {shortest / 60.0:.2g} minutes or more for this ship")

    @property
    def scale(self) -> float:
        """Time scale of the ship."""
        return self.model.ship.scale.time

    @property
    def outline(self) -> np.ndarray:
        """(k, 2), corners of the hull [m]."""
        return np.array(self.model.ship.description.outline)

    @property
    def margin(self) -> float:
        """Least distance of the hull from the walls [m]: a tenth of the ship."""
        return 0.1 * np.ptp(self.outline[:, 0])

    @cached_property
    def measured(self) -> tuple[np.ndarray, np.ndarray]:
        """Poses and velocities (n, 3) of all measured runs."""
        eta = np.concatenate([w.smoothed.eta[w.known] for w in self.data])
        return eta, np.concatenate([w.smoothed.nu[w.known] for w in self.data])

    @cached_property
    def basin(self) -> Basin:
        """The basin that is given, or what the runs have used and a ship's length more."""
        if self.limits.basin is not None:
            return self.limits.basin
        low, high = (f(self.measured[0][:, :2], axis=0) for f in (np.min, np.max))
        half = 0.5 * (high - low) + 1.5 * np.ptp(self.outline[:, 0])
        if self.limits.size is not None:
            half = 0.5 * np.array(self.limits.size)
        (x0, y0), (x1, y1) = 0.5 * (low + high) - half, 0.5 * (low + high) + half
        return Basin((float(x0), float(x1)), (float(y0), float(y1)))

    @cached_property
    def reach(self) -> Reach:
        """Speeds and room that manoeuvres may use."""
        nu = np.abs(self.measured[1])
        speed, rate = (np.quantile(x, 1.0 - CHANCE) for x in (np.hypot(nu[:, 0], nu[:, 1]), nu[:, 2]))
        half = np.abs(self.outline[:, 0]).max()
        room = float(self.basin.size.min() - 2.0 * (half + self.margin))
        rate = max(FASTER * rate, FASTER * speed / max(0.5 * room, half))
        return Reach(float(FASTER * speed), float(rate), room, self.scale, -half, half)

    @cached_property
    def orders(self) -> Orders | None:
        """What the thrusters are asked; None: they follow a controller, which any pose is given to."""
        if self.model.ship.fully_actuated:
            return None
        return Orders.of(self.model, self.data, FASTER)

    @property
    def library(self) -> Iterable[str]:
        """Names of the manoeuvres of such a ship."""
        return LIBRARY if self.orders is None else ORDERS

    @property
    def usual_runs(self) -> UsualRuns:
        """Usual runs of such a ship."""
        return USUAL_MANOEUVRES if self.orders is None else USUAL_ORDERS

    def motions(self, plans: Sequence[Sequence[PlanStep]], size: Size, h: float) -> list[PlannedMotion]:
        """The motion of each plan every h [s], at shares of the largest speeds and of the room."""
        (pace, room), T = size, self.limits.seconds
        if self.orders is not None:
            return self.orders.motions(plans, T, h, pace, self.model, self.basin)
        r = self.reach
        smaller = r._replace(speed=pace * r.speed, rate=pace * r.rate, room=room * r.room)
        return [PlannedMotion.along(poses(steps, T, h, smaller), h, self.basin) for steps in plans]

    def scored(
        self, k: Knowledge, plans: Sequence[Sequence[PlanStep]], sizes: Sequence[Size] = SMALLER
    ) -> list[ScoredPlan]:
        """Each plan, evaluated at the first of some sizes that keeps the limits, else at the last."""
        found: dict[int, ScoredPlan] = {}
        for size in sizes:
            left = [n for n in range(len(plans)) if n not in found]
            motions = self.motions([plans[n] for n in left], size, BRIEF * self.scale) if left else []
            for n, motion in zip(left, motions, strict=True):
                excess = self.excess(motion)
                if excess == 0.0:
                    gram = self.space.gram([self.windows(motion)])
                    score = CRITERIA[self.criterion](k, gram)
                    found[n] = ScoredPlan(plans[n], size, motion, gram, excess, score)
                elif size == sizes[-1]:
                    none = np.zeros_like(k.G)
                    found[n] = ScoredPlan(plans[n], size, motion, none, excess, -1.0 - excess)
        self.tried += (each := [found[n] for n in range(len(plans))])
        return each

    def windows(self, motion: PlannedMotion) -> WeakWindows:
        """A motion as a measured run."""
        return as_windows(motion, motion.thrust(self.model), self.data[0].smoothed)

    def excess(self, motion: PlannedMotion) -> float:
        """By how much a motion exceeds basin, actuators and speeds [1]."""
        nu = np.abs(motion.nu)
        speed = float(np.hypot(nu[:, 0], nu[:, 1]).max() / self.reach.speed)
        fast = max(speed, float(nu[:, 2].max() / self.reach.rate)) / ROUNDED
        margin = float(self.basin.margin(motion.eta, self.outline).min())
        outside = (self.margin - margin) / float(np.ptp(self.outline[:, 0]))
        share = (
            0.0
            if motion.orders is not None
            else load(motion.thrust(self.model), self.model) / USABLE_THRUST
        )
        return max(outside, 0.0) + max(share - 1.0, 0.0) + max(fast - 1.0, 0.0)

    def search(
        self, k: Knowledge, seed: int, points: int = POINTS, evolved: int = EVOLVED
    ) -> ScoredPlan:
        """The best plan that is found, by the same seed the same unless time is short.

        Args:
            k: what is known.
            seed: of the points.
            points: of a Sobol sequence, a power of two.
            evolved: points that evolution tries at the most.

        Raises:
            InputError: no plan keeps the limits.
        """
        T, end = self.limits.seconds, time.monotonic() + SECONDS
        pieces = int(np.clip(round(T / (FORGOTTEN * self.scale)), 1, MOST_PIECES))
        first: Any = qmc.Sobol(DIMENSIONS * pieces, rng=seed).random(points)
        found: list[tuple[ScoredPlan, np.ndarray]] = []

        def cost(some: np.ndarray) -> np.ndarray | float:
            if time.monotonic() > end or len(found) >= len(first) + evolved:
                raise _OutOfTimeError
            self.advance(f"searching a plan: {len(found)} of {len(first) + evolved}")
            each = np.clip(some.T.reshape(-1, first.shape[1]), 0.0, 1.0 - 1e-9)
            plans = [sequence(point, T, self.library) for point in each]
            found.extend(zip(scored := self.scored(k, plans), each, strict=True))
            costs = np.array([-s.score for s in scored])
            return costs if some.ndim > 1 else float(costs[0])

        # Simulated tracks take a fraction of the time at once; targets need no simulation.
        at_once = self.orders is not None
        with suppress(_OutOfTimeError):
            for part in [first] if at_once else first:
                cost(part.T)
            kept: Any = np.array([p for _, p in sorted(found, key=lambda f: -f[0].score)[:LENGTH]])
            spans: Any = [(0.0, 1.0)] * len(first[0])
            how: Any = {"vectorized": True, "updating": "deferred"} if at_once else {}
            differential_evolution(cost, spans, init=kept, rng=seed, polish=False, **how)
        best = max((s for s, _ in found), key=lambda s: s.score)
        if best.excess > 0.0:
            raise InputError(
                "no manoeuvre of the library keeps the limits of basin, actuators and speeds; give a "
                "larger basin or more minutes"
            )
        return best

    def usual(self, k: Knowledge, name: str) -> ScoredPlan:
        """A usual run of the same length."""
        return self.scored(k, [usual(name, self.limits.seconds, self.usual_runs)])[0]

    def spread(self, k: Knowledge, s: ScoredPlan, seed: int) -> Spread:
        """The tracks of a plan under every likely hypothesis."""
        (motion,) = self.motions([s.steps], s.size, BRIEF * self.scale)
        likely = [n for n, w in enumerate(k.weights) if w > NEGLIGIBLE] or [int(np.argmax(k.weights))]
        self.advance(f"closed loop of {len(likely) * MEMBERS} models along the plan")
        return spread(self.space, k, likely, motion, self.basin, self.outline, seed)

    def best(self, found: ScoredPlan, usual: Iterable[ScoredPlan]) -> list[ScoredPlan]:
        """A plan, the best of the others that were tried, then usual runs, all within the limits."""

        def in_order(plans: Iterable[ScoredPlan]) -> list[ScoredPlan]:
            return sorted((s for s in plans if s.excess == 0.0), key=lambda s: -s.score)

        others = in_order(s for s in self.tried if s is not found)
        return [*dict.fromkeys([found, *others[: REFINED - 1], *in_order(usual)])]

    def checked(self, k: Knowledge, plans: Iterable[ScoredPlan], seed: int) -> tuple[ScoredPlan, Spread]:
        """The first of some plans that keeps the basin with its spread, and this spread.

        Where the spread leaves the basin, the same plan is tried slower and in less room.

        Raises:
            InputError: none of them does.
        """
        for s in plans:
            for smaller in self._smaller(k, s):
                tracks = self.spread(k, smaller, seed)
                if tracks.margin.min() > 0.0:
                    return smaller, tracks
        raise InputError(NO_SPREAD)

    def _smaller(self, k: Knowledge, s: ScoredPlan) -> Iterator[ScoredPlan]:
        """A plan at its own size, then at each smaller one that keeps the limits."""
        yield s
        for size in SMALLER[SMALLER.index(s.size) + 1 :]:
            (smaller,) = self.scored(k, [s.steps], [size])
            if smaller.excess == 0.0:
                yield smaller

    def inseparable(self, k: Knowledge) -> list[tuple[int, int]]:
        """Pairs that no plan tried so far separates, see :func:`.information.inseparable`."""
        return inseparable(k, [s.gram for s in self.tried if s.excess == 0.0])


class _OutOfTimeError(Exception):
    """The time of a search is over."""


class Span(BaseModel):
    """A basin: lowest and highest north and east of its walls [m]."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    north: tuple[float, float] = Field(description="lowest and highest north [m]")
    east: tuple[float, float] = Field(description="lowest and highest east [m]")


def limits_of(minutes: float, basin: str | Path | tuple[float, float] | None) -> Limits:
    """The limits of a run.

    Args:
        minutes: length of the run.
        basin: length to the north and to the east [m], also as ``6x4``, or the path of a JSON file.

    Raises:
        InputError: a length that is not positive, or no such file.
    """
    most = 1e4  # a week
    if not 0.0 < minutes < most:
        raise InputError(f"a run takes more than 0 and less than {most:g} minutes; got {minutes:g}")
    if basin is None:
        return Limits(60.0 * minutes)
    if isinstance(basin, tuple):
        sizes = [float(x) for x in basin]
    else:
        try:
            sizes = [float(x) for x in str(basin).lower().split("x")]
        except ValueError:
            return Limits(60.0 * minutes, _basin_file(Path(basin)))
    if len(sizes) != 2 or not all(0.0 < x < 1e6 for x in sizes):
        raise InputError(f"a basin is two positive lengths [m] as in 6x4, or a JSON file; got '{basin}'")
    return Limits(60.0 * minutes, size=(sizes[0], sizes[1]))


def _basin_file(path: Path) -> Basin:
    what = "a basin (two lengths [m] to the north and to the east as in 6x4, or a JSON file)"
    span = read_model(path, Span, what, strict=False)
    for name, (low, high) in (("north", span.north), ("east", span.east)):
        if not low < high:
            raise InputError(f"'{path}': {name} must be the lowest, then the highest value [m]")
    return Basin(span.north, span.east)
