"""The library of manoeuvres: smooth target poses with parameters, each from rest to rest.

A manoeuvre is a function of time that its :func:`manoeuvre` line registers. Its parameters are numbers
from 0 to 1, of which it makes lengths, speeds and angles within the limits of the ship. Poses are
relative to the pose at its start. A plan is a sequence of manoeuvres, with a turn on the spot between
two where the next one begins with another heading.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from fmus.guidance.multisine import FREQUENCIES
from fmus.guidance.ramps import ramp


class Reach(NamedTuple):
    """What a manoeuvre may use.

    Attributes:
        speed, rate: largest speed [m/s] and yaw rate [rad/s].
        room: length of the basin for the origin of the ship [m].
        time: time scale of the ship, over that of CyberShip Enterprise 1 [1].
        aft, fore: body-fixed x of the last and the first actuator [m].
    """

    speed: float
    rate: float
    room: float
    time: float
    aft: float
    fore: float


# Time (n,) [s], duration [s], numbers from 0 to 1, limits -> pose (n, 3) from rest to rest [m, m, rad].
Course = Callable[[np.ndarray, float, Sequence[float], Reach], np.ndarray]
DIMENSIONS = 7  # 1, of a manoeuvre: which one, how it begins, and five numbers from 0 to 1 of its own
RISE = 2.0  # s, times the time scale; shortest change of speed, as of the guidance's pulses (chosen)
SOFT = 5.0  # s, times the time scale; longest of them: three time constants of the surge motion (chosen)
LIBRARY: dict[str, Course] = {}
TEXTS: dict[str, str] = {}
AnyCourse = TypeVar("AnyCourse", bound=Callable[..., np.ndarray])


def registered(library: dict[str, AnyCourse], name: str) -> Callable[[AnyCourse], AnyCourse]:
    """Register a course under a name; the first line of its docstring describes it."""

    def register(course: AnyCourse) -> AnyCourse:
        library[name], TEXTS[name] = course, (course.__doc__ or "").partition("\n")[0].rstrip(".")
        return course

    return register


manoeuvre = partial(registered, LIBRARY)


def moved(t: Any, distance: float, seconds: float, rise: float) -> Any:
    """From 0 to a distance in some seconds, at a constant speed but for smooth ramps at both ends."""
    rise = min(rise, 0.5 * seconds)
    start, stop = ramp(t, rise).integral, ramp(t - (seconds - rise), rise).integral
    return distance * (start - stop) / (seconds - rise)


def visits(t: np.ndarray, places: Sequence[float], speed: float, rise: float, T: float) -> np.ndarray:
    """One coordinate that goes from place to place, from 0 and back to it, all in T [s].

    The duration of each move is in proportion to what it needs at the speed. Where T is too short, the
    distances are less.
    """
    steps = np.diff([0.0, *places, 0.0])
    way = np.abs(steps).sum() / speed
    steps = steps * min(1.0, max(T - rise * steps.size, 0.1 * T) / way)
    times = np.abs(steps) / speed + rise
    times *= T / times.sum()
    begins = np.cumsum([0.0, *times[:-1]])
    parts = zip(steps, times, begins, strict=True)
    return np.sum([moved(t - b, step, time, rise) for step, time, b in parts], axis=0)


def there_and_back(reach: float, speed: float, rise: float, T: float) -> list[float]:
    """As many places on both sides as fit into T [s]."""
    rounds = max(1, round(T / (4.0 * reach / speed + 2.0 * rise)))
    return [reach, -reach] * rounds


def between(low: float, high: float, x: float) -> float:
    """A number at a share x of the way from one to another."""
    return low + (high - low) * x


def _rise(x: float, r: Reach) -> float:
    return r.time * between(RISE, SOFT, x)


@manoeuvre("legs")
def legs(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Legs ahead and astern at one speed, with stops"""
    return _straight(t, T, x, r, 0.0)


@manoeuvre("crab")
def crab(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Legs with a constant drift angle, up to sway alone, both ways"""
    return _straight(t, T, x, r, np.pi * between(0.1, 0.9, x[3]))


def _straight(t: np.ndarray, T: float, x: Sequence[float], r: Reach, drift: float) -> np.ndarray:
    speed, rise = r.speed * between(0.25, 1.0, x[0]), _rise(x[1], r)
    places = there_and_back(0.5 * r.room * between(0.3, 1.0, x[2]), speed, rise, T)
    s = visits(t, places, speed, rise, T)
    return np.column_stack([s * np.cos(drift), s * np.sin(drift), 0.0 * s])


@manoeuvre("stairs")
def stairs(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Legs ahead and astern with steps of the speed from slow to fast"""
    half, rise = 0.5 * r.room * between(0.4, 1.0, x[0]), _rise(x[1], r)
    fast = r.speed * between(0.5, 1.0, x[2])
    shares = np.linspace(between(0.2, 0.6, x[3]), 1.0, 3)
    steps = np.diff([0.0, half, -half, half, 0.0])
    speeds = fast * np.array([shares[0], shares[1], shares[2], shares[0]])
    way = (np.abs(steps) / speeds).sum()
    steps = steps * min(1.0, max(T - rise * steps.size, 0.1 * T) / way)
    times = np.abs(steps) / speeds + rise
    rounds = max(1, round(T / times.sum()))
    times = np.tile(times, rounds) * (T / rounds / times.sum())
    begins = np.cumsum([0.0, *times[:-1]])
    each = zip(np.tile(steps, rounds), times, begins, strict=True)
    s = np.sum([moved(t - b, step, time, rise) for step, time, b in each], axis=0)
    return np.column_stack([s, 0.0 * s, 0.0 * s])


@manoeuvre("circle")
def circle(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Circles or ellipses to one side, ahead or astern"""
    side, along = (1.0 if x[0] < 0.5 else -1.0), (1.0 if x[1] < 0.7 else -1.0)
    a = 0.5 * r.room * between(0.25, 1.0, x[2])
    b = a * between(0.5, 1.0, x[3])
    speed = min(r.speed * between(0.3, 1.0, x[4]), r.rate * b * b / a)
    length = 2.0 * np.pi * np.sqrt(0.5 * (a * a + b * b))
    turns = max(1.0, np.round(speed * T / length))
    smaller = min(1.0, speed * T / (turns * length))
    a, b = smaller * a, smaller * b
    phi = moved(t, 2.0 * np.pi * turns, T, _rise(0.5, r))
    course = np.unwrap(np.arctan2(b * np.sin(phi), a * np.cos(phi)))
    return along * np.column_stack(
        [a * np.sin(phi), side * b * (1.0 - np.cos(phi)), side * along * course]
    )


@manoeuvre("rotation")
def rotation(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Rotation to both sides about a point between the last and the first actuator"""
    rate, rise = r.rate * between(0.25, 1.0, x[0]), _rise(x[1], r)
    psi = visits(t, there_and_back(np.pi * between(0.3, 1.0, x[2]), rate, rise, T), rate, rise, T)
    pivot = between(r.aft, r.fore, x[3])
    return np.column_stack([pivot * (1.0 - np.cos(psi)), -pivot * np.sin(psi), psi])


@manoeuvre("headings")
def headings(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Station keeping at several headings in turn"""
    count = 2 + int(2.999 * x[0])
    rise, every, rate = _rise(x[2], r), T / count, r.rate * between(0.3, 1.0, x[1])
    turn = min(0.5 * every, rise + 2.0 * np.pi / count / rate)
    angle = min(2.0 * np.pi / count, rate * max(turn - rise, 0.5 * turn))
    psi = np.sum([moved(t - (k + 1) * every + turn, angle, turn, rise) for k in range(count)], axis=0)
    return np.column_stack([0.0 * psi, 0.0 * psi, psi])


@manoeuvre("zigzag")
def zigzag(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Zig-zag: legs on which heading and course swing to both sides"""
    pose = _straight(t, T, x, r, 0.0)
    period = r.time * between(10.0, 30.0, x[3])
    amplitude = min(np.radians(between(10.0, 40.0, x[4])), r.rate * period / (2.0 * np.pi))
    ends = moved(t, 1.0, 2.0 * SOFT * r.time, SOFT * r.time)
    swing = amplitude * np.sin(2.0 * np.pi * t / period) * ends * ends[::-1]
    side = np.cumsum(np.diff(pose[:, 0], prepend=0.0) * np.sin(swing))
    return np.column_stack([pose[:, 0], side - side[-1] * moved(t, 1.0, T, 0.5 * T), swing])


@manoeuvre("multisine")
def multisine(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Multisine of surge, sway and yaw at once"""
    omega = np.array(FREQUENCIES) * between(0.8, 2.0, x[0]) / r.time
    limit = np.array([r.speed, r.speed, r.rate]) * np.array([x[1], x[2], x[3]])
    share = np.array([1.0, x[4]]) / (1.0 + x[4])
    ends = moved(t, 1.0, 2.0 * SOFT * r.time, SOFT * r.time)
    waves = (share * limit[:, None] / omega)[..., None] * np.sin(omega[..., None] * t)
    return waves.sum(axis=1).T * (ends * ends[::-1])[:, None]


@manoeuvre("steps")
def steps(t: np.ndarray, T: float, x: Sequence[float], r: Reach) -> np.ndarray:
    """Steps of surge, sway and yaw force in turn: short moves"""
    rise = r.time * RISE
    size = np.array([r.speed, 0.7 * r.speed, r.rate]) * between(0.3, 1.0, x[0]) * rise
    long = 1.0 + 2.0 * x[1]  # of a move, over the time of its ramps
    third = T / 3.0
    order = np.roll(np.arange(3), int(2.999 * x[2]))

    def of(axis: int) -> np.ndarray:
        at = t - third * int(order[axis])
        inside = np.clip(at, 0.0, third)
        reach = size[axis] * long
        places = there_and_back(reach, size[axis] / rise, rise, third)
        return visits(inside, places, size[axis] / rise, rise, third)

    return np.column_stack([of(0), of(1), of(2)])


class PlanStep(NamedTuple):
    """One manoeuvre of a plan: name, numbers from 0 to 1, duration [s], first heading [rad]."""

    name: str
    numbers: tuple[float, ...]
    seconds: float
    heading: float

    def content(self) -> Mapping[str, object]:
        """For a file."""
        stated = {"manoeuvre": self.name, "description": TEXTS[self.name], "seconds": self.seconds}
        return stated | {"heading": self.heading, "numbers": [round(x, 4) for x in self.numbers]}


def poses(plan: Sequence[PlanStep], seconds: float, h: float, r: Reach) -> np.ndarray:
    """(n, 3), target of a sequence of manoeuvres every h [s], over all seconds.

    Turns on the spot join two headings; what they take, up to half of the time, is taken from the
    manoeuvres in proportion.
    """
    bends = np.diff([s.heading for s in plan])
    bends = (bends + np.pi) % (2.0 * np.pi) - np.pi
    soft = SOFT * r.time
    turns = np.array([abs(b) / (0.7 * r.rate) + soft if abs(b) > 1e-6 else 0.0 for b in bends])
    share = max(seconds - turns.sum(), 0.5 * seconds) / sum(s.seconds for s in plan)
    parts, heading, place = [], plan[0].heading, np.zeros(2)
    for k, s in enumerate(plan):
        T = s.seconds * share
        own = LIBRARY[s.name](np.arange(0.0, max(T, h), h), T, s.numbers, r)
        c, sn = np.cos(heading), np.sin(heading)
        xy = place + own[:, :2] @ np.array([[c, sn], [-sn, c]])
        parts.append(np.column_stack([xy, heading + own[:, 2]]))
        place, heading = xy[-1], heading + own[-1, 2]
        if k < len(bends) and turns[k]:
            psi = heading + moved(np.arange(0.0, turns[k], h), bends[k], turns[k], soft)
            parts.append(np.column_stack([np.tile(place, (psi.size, 1)), psi]))
            heading = heading + bends[k]
    whole = np.concatenate(parts)
    n = round(seconds / h) + 1
    return np.concatenate([whole[:n], np.repeat(whole[-1:], max(n - len(whole), 0), axis=0)])


def sequence(point: np.ndarray, seconds: float, library: Iterable[str] = LIBRARY) -> list[PlanStep]:
    """The plan at a point of the unit cube, DIMENSIONS numbers for each manoeuvre of a library."""
    rows = point.reshape(-1, DIMENSIONS)
    names, each = list(library), seconds / len(rows)
    # Any heading at first; then half of the numbers keep it, the others turn by up to a right angle.
    bends = np.where(rows[:, 1] < 0.5, 0.0, 2.0 * np.pi * (rows[:, 1] - 0.75))
    bends[0] = 2.0 * np.pi * rows[0, 1]
    return [
        PlanStep(
            names[min(int(x[0] * len(names)), len(names) - 1)],
            tuple(map(float, x[2:])),
            each,
            float(heading),
        )
        for x, heading in zip(rows, np.cumsum(bends), strict=True)
    ]


UsualRuns = Mapping[str, tuple[tuple[str, tuple[float, ...]], ...]]
# 1, usual runs of the same length, for comparison.
USUAL_MANOEUVRES: UsualRuns = {
    "ellipse": (("circle", (0.0, 0.0, 1.0, 0.4, 0.6)),),
    "circle": (("circle", (0.0, 0.0, 0.7, 1.0, 0.6)),),
    "zig-zag": (("zigzag", (0.6, 0.5, 1.0, 0.5, 0.3)),),
    "eight": (("circle", (0.0, 0.0, 0.5, 0.7, 0.6)), ("circle", (1.0, 0.0, 0.5, 0.7, 0.6))),
}


def usual(name: str, seconds: float, runs: UsualRuns = USUAL_MANOEUVRES) -> list[PlanStep]:
    """A usual run as a plan."""
    parts = runs[name]
    return [PlanStep(m, numbers, seconds / len(parts), 0.0) for m, numbers in parts]
