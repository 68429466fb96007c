"""What is hidden, and how much of it: sizes log-uniform, 5 to 40 % of the force on its axis.

The size of an effect is the RMS of the force that it adds over the RMS of the force that the thrusters
give, on the axis where that is most, over the training runs. It is set by the motion of a ship without
any effect: with the effect the controller follows the same path.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.predictors import of_one_run, of_run
from fmus.ship import ship

from .effect_forms import form
from .fleet import ProcessNoise
from .foreign_physics import FOREIGN_PHYSICS
from .simulated_runs import STOP
from .truth import NAMES, Motion, Values, force, over, windows

EFFECTS = ship().effects

SMALLEST, LARGEST = 0.05, 0.4
# Ids of hidden effects whose form the diagnosis does not have, and the ids that come nearest.
FOREIGN: dict[str, tuple[str, ...]] = {
    "drag |u|^1.5": ("X_u", "X_|u|u", "curve_X(u)"),
    "bow exp(-(u/u0)^2)": ("bow_speed_loss", "curve_bow(|u|)"),
    "delay off the grid": ("delay",),
}
# The runs have one set of commands: what acts on one of the two propellers is no candidate there.
# Their measurement has no filters, which benchmarks.logs has.
FILTERS = [e.id for e in EFFECTS.values() if e.wording.family.name == "filter"]
LOOKED_FOR = [
    e for e in EFFECTS.values() if not e.apart and e.search.by != "given" and e.id not in FILTERS
]
SINGLE = [*(e.id for e in LOOKED_FOR), *FOREIGN]
OUT, SHORTEST = 0.2, 2.0  # share of the time that an outage takes, and its shortest interval [s]
# Physics of which the diagnosis has nothing: no id is a right answer.
UNKNOWN = [e.id for e in FOREIGN_PHYSICS]
# An effect whose times are drawn anew for each run, the held-out one among them.
OTHER_TIMES = " at other times"
OUTAGES = [e.id + OTHER_TIMES for e in LOOKED_FOR if len(e.search.intervals) > 1]
# An effect, or none, beside a force that is nobody's: filtered noise on all axes.
IN_NOISE = " in process noise"
NOTHING_HIDDEN = "nothing"
NOISY = [e + IN_NOISE for e in (NOTHING_HIDDEN, "X_u", "Y_v", "N_r", "N_|r|r", "loss_yaw")]
NOISE_SHARE, NOISE_TIME = (0.02, 0.1), (1.0, 5.0)  # of the commanded force; s, correlation time
MOST_PLAY = 0.12  # of the full command: about the largest size, 40 % of the force on an axis


@dataclass(frozen=True)
class Draw:
    """An effect of a certain size.

    Attributes:
        effect: its id.
        values: its parameters.
        size: share of the force on its axis.
    """

    effect: str
    values: Values
    size: float

    @property
    def right(self) -> tuple[str, ...]:
        """The ids that are a right answer."""
        if self.effect in OUTAGES:
            return (self.effect.removesuffix(OTHER_TIMES),)
        if self.effect in NOISY:
            return tuple(e for e in [self.plain] if e != NOTHING_HIDDEN)
        return () if self.effect in UNKNOWN else FOREIGN.get(self.effect, (self.effect,))

    @property
    def plain(self) -> str:
        """The id of what is hidden beside process noise."""
        return self.effect.removesuffix(IN_NOISE)

    def during(self, run: str) -> "Draw":
        """What of it a run has: parameters are named ``parameter@run`` where each run has its own."""
        return replace(self, values=of_one_run(self.values, run))

    @property
    def measured(self) -> dict[str, float]:
        """Its parameters that are of the measurement."""
        names = ("marker_offset_dx", "marker_offset_dy", "heading_offset", "clock_offset")
        return {name: value for name, value in self.values.items() if name in names}


def draw(effect: str, rng: np.random.Generator, pilot: Sequence[Motion], less: float = 1.0) -> Draw:
    """An effect with its form, sign and size drawn.

    Args:
        effect: id.
        rng: of the draw.
        pilot: runs of a ship without it.
        less: factor on the size drawn.
    """
    if effect in NOISY:
        plain = effect.removesuffix(IN_NOISE)
        if plain == NOTHING_HIDDEN:
            return Draw(effect, {}, 0.0)
        return replace(draw(plain, rng, pilot, less), effect=effect)
    if effect == "bow_failure":  # its time is drawn, not its size
        values = {"bow_failure_time": float(rng.uniform(0.25, 0.75)) * STOP}
    elif effect in OUTAGES:  # and so are these
        return outages(effect, rng, pilot)
    elif effect in EFFECTS and EFFECTS[effect].search.intervals:
        values = outage(effect, rng)
    elif effect == "backlash":  # so is its play, of which a series takes seconds
        values = {"backlash": less * MOST_PLAY * float(rng.uniform(0.25, 1.0))}
    else:
        scaled = form(effect, rng, pilot)
        size = less * float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
        values = scaled(_solve(lambda s: share(pilot, effect, scaled(s)), size))
    return Draw(effect, values, share(pilot, effect, values))


def process_noise(rng: np.random.Generator, pilot: Sequence[Motion]) -> ProcessNoise:
    """A force on each axis, of the same share of the commanded one."""
    tau = np.sqrt(np.mean([np.mean(m.tau**2, axis=0) for m in pilot], axis=0))
    size, time = rng.uniform(*NOISE_SHARE) * tau, rng.uniform(*NOISE_TIME)
    return ProcessNoise(tuple(size.tolist()), float(time))


def outage(effect: str, rng: np.random.Generator) -> dict[str, float]:
    """Three to eight intervals that take a share of the time, one in each equal part of it."""
    names = EFFECTS[effect].search.intervals
    count = int(rng.integers(3, len(names) + 1))
    room = STOP / count
    lasts = np.maximum(SHORTEST, OUT * room * rng.uniform(0.5, 1.5, count))
    starts = room * np.arange(count) + rng.uniform(0.1, 0.5, count) * room
    spans = zip(names, starts.tolist(), lasts.tolist(), strict=False)
    return {name: t for (a, b), start, last in spans for name, t in ((a, start), (b, start + last))}


def outages(effect: str, rng: np.random.Generator, pilot: Sequence[Motion]) -> Draw:
    """The same with other intervals in each run, the held-out one among them."""
    plain = effect.removesuffix(OTHER_TIMES)
    each = [outage(plain, rng) for _ in run_names(len(pilot) + 1)]
    sizes = [share([m], plain, values) for m, values in zip(pilot, each, strict=False)]
    names = zip(run_names(len(each)), each, strict=True)
    values = {of_run(n, run): t for run, own in names for n, t in own.items()}
    return Draw(effect, values, float(np.sqrt(np.mean(np.square(sizes)))))


def run_names(count: int) -> list[str]:
    """The names of the runs of a cell, in their order."""
    return [f"run{k}" for k in range(1, count + 1)]


def share(pilot: Sequence[Motion], effect: str, values: Values) -> float:
    """RMS of the added force over that of the thrusters, on the axis where that is most.

    Both are averaged over windows of 3 s, but for waves, which would vanish. The thrusters must give the
    force that an effect on the hull takes, too.
    """
    if effect == "waves":
        added, tau = (
            np.concatenate(x) for x in zip(*[(force(m, values), m.tau) for m in pilot], strict=True)
        )
    else:
        added = added_force(pilot, effect, values)
        tau = np.concatenate([windows(m.tau) for m in pilot])
    if not set(values) <= NAMES["thrusters"] and effect not in FOREIGN:
        tau = tau - added
    return float(np.max(np.sqrt((added**2).mean(axis=0) / (tau**2).mean(axis=0))))


def added_force(pilot: Sequence[Motion], effect: str, values: Values) -> np.ndarray:
    """Windows (K, 3) of the force of an effect, those of foreign form included."""
    if effect not in LAWS:
        return over(pilot, values)
    return np.concatenate([windows(LAWS[effect](m, *values.values())) for m in pilot])


def drag(m: Motion, at_one: float) -> np.ndarray:
    """Force (n, 3) of a drag by |u|^1.5 that is ``at_one`` [N] at 1 m/s."""
    u = m.nu[:, 0]
    X = -at_one * u * np.sqrt(np.abs(u))
    return np.column_stack([X, 0.0 * X, 0.0 * X])


def fading(m: Motion, inverse: float) -> np.ndarray:
    """Force (n, 3) that is lost of a bow thruster as effective as exp(-(inverse u)^2)."""
    kept = np.exp(-((inverse * m.nu[:, 0]) ** 2))
    commanded = m.commanded * np.column_stack([np.ones_like(kept), np.ones_like(kept), kept])
    return Motion(m.time, m.eta, m.nu, m.nu_dot, commanded).tau - m.tau


LAWS = {"drag |u|^1.5": drag, "bow exp(-(u/u0)^2)": fading}


def _solve(size: Callable[[float], float], wanted: float) -> float:
    """The least scale that gives a size, or the one that comes nearest."""
    scales = np.geomspace(1e-3, 1e3, 31)
    low = high = scales[0]
    for high in scales:
        if size(high) >= wanted:
            break
        low = high
    for _ in range(12):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if size(middle) >= wanted else (middle, high)
    return float(high)
