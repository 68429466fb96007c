"""Clock and constant faults of the channels of motion, estimated together."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError
from scipy.special import chdtrc, chdtri

from fmus.scale import Scale

from ..cleaning import noise
from ..files.reading import Run
from ..run_constants import BLOCKS, PARTS
from .clock_path import (
    DRIFT,
    HEADING,
    NEGLIGIBLE,
    SPACING,
    TURN,
    Path,
    PathProblem,
    integral_of,
    noisier_than_pose,
)
from .constants import DEVIATIONS, LEAST, FaultColumn, columns, deviations
from .evidence import FEWEST, SURE, Evidence, evidence, large, spread_of, straight
from .gaps import gaps
from .repairing import Correction, corrected
from .sensor_finding import Examined, SensorFinding

STRETCH = 20.0  # s over which the rate is averaged to locate its error; with 15 s other clocks are found
CLOCK_OR_SCALE = "the data have too little turning: a clock at this rate has the same effect"
CLOCK_OR_COMPASS = "an offset of the compass has the same effect"
CLOCK_OR_SPEED = (
    "no yaw rate is measured: a speed that is filtered, late or wrong by direction has the same effect"
)
CLOCK_OR_RATE = "no speed is measured: a clock at this rate has the same effect"
# 1, of what a clock changes, in squares of the standard deviations of its blocks: what way and turn may
# differ by beyond noise. Chosen: with more, most of it is not common to both.
MOST_APART = 0.5
TWO_CLOCKS = (
    "position and speed imply another clock than heading and yaw rate: there is another fault, "
    "such as a filter or held values, and only a delay is repaired"
)


class MotionFaults(NamedTuple):
    """Faults that were found.

    Attributes:
        path: with the constant faults that are sure and matter, with a clock that wanders or without.
        wanders: whether it does.
        either: whether a compass that is off by heading would look like that clock.
        torn: whether way and turn would each need a clock of its own.
        by_way: whether the way alone tells of that clock.
        scatter: (k,), of its constants, see :func:`_scatter`; None: not yet known.
    """

    path: Path
    wanders: bool
    either: bool = False
    torn: bool = False
    by_way: bool = False
    scatter: np.ndarray | None = None

    @property
    def std(self) -> np.ndarray:
        """(k,), standard deviation of the constants."""
        return np.hypot(self.path.deviation, 0.0 if self.scatter is None else self.scatter)


def motion(
    run: Run, scale: Scale, before: Mapping[str, tuple[float, float]] = MappingProxyType({})
) -> Examined:
    """Clock, scales, offsets, places and delays of velocity and yaw rate against the pose.

    Args:
        run: as it was read.
        scale: of the ship.
        before: channel -> delay that was taken off it last [s], and its share of what was found.
    """
    e = evidence(run)
    if e is None:
        return Examined(run)
    jumps = gaps(e)
    try:
        found = _estimated(e, columns(e, scale), jumps)
    except LinAlgError:
        return Examined(run, notes=("the channels in addition to the pose do not determine a motion",))
    findings = [*jumps, *_clock(found, e), *_constants(found, e)]
    late = [f for f in findings if f.kind == "delay"]
    if late:  # its column is a tangent: all else is estimated once it is gone
        steps = {f.channel: _step(f.value, *before.get(f.channel, (0.0, 1.0))) for f in late}
        late = [_moved(f, steps[f.channel][0]) for f in late]
        first = corrected(e, Correction({(f.channel, f.kind): f.value for f in late}))
        rest = motion(first, scale, {**before, **steps})
        return replace(rest, findings=(*_added(late, rest.findings, e),))
    fixes = [f for f in findings if f.repaired]
    repaired = corrected(e, _correction(found, jumps, fixes)) if fixes else run
    notes = (*_leeway(e), *((TWO_CLOCKS,) if found.torn else ()))
    return Examined(repaired, tuple(findings), notes, _agreeing(found, e))


def _step(delay: float, last: float, share: float) -> tuple[float, float]:
    """How much of a delay is taken off [s], and which share: half where the last step went too far."""
    share *= 0.5 if delay * last < 0.0 else 1.0
    return share * delay, share


def _moved(f: SensorFinding, value: float) -> SensorFinding:
    """A finding about another value."""
    low, high = (end + value - f.value for end in f.ci95)
    return replace(f, value=value, ci95=(low, high))


def _added(
    late: Sequence[SensorFinding], rest: Sequence[SensorFinding], e: Evidence
) -> Iterator[SensorFinding]:
    """Delays that were taken off with what is left of them, and all else.

    What was taken off and found again with the other sign was none.
    """
    left = {(f.channel, f.kind): f.value for f in rest}
    yield from (f for f in rest if (f.channel, f.kind) not in {(d.channel, d.kind) for d in late})
    for f in late:
        more = left.get((f.channel, f.kind), 0.0)
        low, high = f.ci95[0] + more, f.ci95[1] + more
        if not low < 0.0 < high:
            value = f.value + more
            yield replace(f, value=value, ci95=(low, high), sentence=_late(f.channel, value, e))


def _correction(
    found: MotionFaults, jumps: Sequence[SensorFinding], fixes: Sequence[SensorFinding]
) -> Correction:
    """What findings say of the run."""
    values = {(f.channel, f.kind): f.value for f in fixes if f.channel != "time"}
    rates = [f.value for f in fixes if f.kind == "clock_rate"]
    wanders = found.wanders and not (found.either or found.by_way)
    if not (wanders or rates or jumps):
        return Correction(values)
    problem, clock = found.path.problem, found.path.clock
    if not wanders:
        clock = np.full_like(clock, rates[0] if rates else 1.0)
    true = problem.edges[0] + integral_of(problem.edges, np.where(problem.cut, 1.0, clock))
    return Correction(values, (problem.edges, true), jumps)


def _estimated(
    e: Evidence, every: Sequence[FaultColumn], jumps: Sequence[SensorFinding], spacing: float = SPACING
) -> MotionFaults:
    """The likeliest clock and the constants that are sure, by nodes some seconds apart."""
    cut = [*((jump.start, jump.end) for jump in jumps), *e.unlogged]
    sigma = noise(np.column_stack([e.run.pose[e.rows, :2], e.psi[e.rows]]))
    sizes = max(float(np.hypot(*sigma[:2])), NEGLIGIBLE), max(float(sigma[2]), NEGLIGIBLE)
    # Where the mean rate of the clock is free, there is one scale less.
    level = "r" if e.rate is not None else (e.by or ("",))[0]
    free = [c for c in every if (c.channel, c.kind) != (level, "scale")]
    problem = PathProblem(e, sizes, cut, spacing=spacing)
    loose = problem.solve(free)
    if without := problem.outliers(loose):
        problem = PathProblem(e, sizes, cut, without, spacing)
        loose = problem.solve(free)
    path = problem.solve(every, fixed_clock=True)
    likelier = SURE**2  # of a clock, and of a compass by the same chance
    deviates = float(chdtri(len(DEVIATIONS), chdtrc(1, likelier)))
    wanders = path.criterion - loose.criterion > likelier and _uneven(loose)
    if wanders and spacing and noisier_than_pose(e, sizes):  # that may be noise
        return _estimated(e, every, jumps, 0.0)
    if wanders:
        path = loose
    # Headings all round, as a ship is swung to adjust its compass; half of them determine it, too.
    turned, either = float(np.ptp(e.psi[e.rows])), False
    swung = turned > 2.0 * np.pi
    # A compass that is off by heading looks like a wandering clock.
    if e.rate is not None and (swung or wanders):
        deviating = problem.solve([*every, *deviations(e, loose.heading)], fixed_clock=True)
        gain = path.criterion - deviating.criterion - deviates
        either = gain > -likelier * wanders
        if either and (swung or (turned > np.pi and gain > 0.0)):
            path, wanders, either = deviating, False, False
    either = either or (wanders and e.velocity is None)  # nor does a way tell of it
    torn = wanders and not either and _two_clocks(path)
    if torn:  # nor is what is wrong a constant: of these a delay alone may have torn them
        wanders = False
        path = problem.solve([c for c in every if c.kind == "delay"], fixed_clock=True)
    found = MotionFaults(path, wanders, either, torn, wanders and e.rate is None)
    while len(kept := _sure(found)) < len(found.path.columns) or found.scatter is None:
        if len(kept) < len(found.path.columns):
            found = found._replace(path=problem.solve(kept, not wanders), scatter=None)
        else:
            found = found._replace(scatter=_scatter(found.path, not wanders))
    return found


def _sure(found: MotionFaults) -> list[FaultColumn]:
    """Constants that are sure and matter."""
    each = zip(found.path.columns, found.path.constants, found.std, strict=True)
    return [c for c, value, s in each if abs(value) > max(SURE * s, c.least) and s > 0.0]


def _scatter(path: Path, fixed_clock: bool) -> np.ndarray:
    """Standard deviation (k,) of constants by what their values in parts of the run differ by.

    An error that is no constant, as of a gyrocompass by speed and course, has another value in each
    part. The variance between parts is by DerSimonian and Laird (1986), Control. Clin. Trials 7.
    """
    if not path.columns:
        return np.zeros(0)
    time = path.problem.evidence.time
    part = np.minimum((PARTS * (time[:-1] - time[0]) / (time[-1] - time[0])).astype(int), PARTS - 1)
    in_parts = [c.during(part == k) for c in path.columns for k in range(PARTS)]
    each = path.problem.solve(in_parts, fixed_clock)
    values, own = (x.reshape(-1, PARTS) for x in (each.constants, each.deviation))
    weights = np.where(own > 0.0, own, np.inf) ** -2.0  # a part without any turn tells nothing
    total, squares = weights.sum(axis=1), (weights**2).sum(axis=1)
    mean = (weights * values).sum(axis=1) / total
    apart = (weights * (values - mean[:, None]) ** 2).sum(axis=1) - ((weights > 0.0).sum(axis=1) - 1)
    between = np.maximum(apart, 0.0) / np.maximum(total - squares / total, np.finfo(float).tiny)
    return np.sqrt(between * squares) / total


def _clock(found: MotionFaults, e: Evidence) -> list[SensorFinding]:
    """The stretches in which a clock that wanders is off; or its even rate, where all channels agree."""
    clock = ("time", "clock_rate", "1")
    if not found.wanders:
        if (rate := _even(found)) is None:
            return []
        text = f"the clock of the log is wrong throughout: {rate[0]:.4g} s pass in one second of it"
        text, alike = f"{text}, by speed and turn", ("scale of all speeds and rates",)
        return [SensorFinding.estimated(clock, *rate, found.path.problem.edges, text, alike)]
    alike, or_else, aside = (), "", ()
    if found.either:
        alike, or_else = tuple(DEVIATIONS), f"; {CLOCK_OR_COMPASS}"
    elif found.by_way:
        alike, or_else, aside = e.by or (), f"; {CLOCK_OR_SPEED}", e.by or ()
    made = []
    for begin, end, value, s in _stretches(found.path):
        way = "slow" if value > 1.0 else "fast"
        text = f"the clock of the log is {way}: {value:.3g} s pass in one second of it{or_else}"
        ends = np.array([begin, end])
        made.append(SensorFinding.estimated(clock, value, s, ends, text, alike, not alike, aside))
    return made


def _even(found: MotionFaults) -> tuple[float, float] | None:
    """Rate of a clock that runs evenly, and its standard deviation; None: channels agree on none."""
    at = [k for k, c in enumerate(found.path.columns) if c.kind == "scale"]
    if found.wanders or len(at) < 2:
        return None
    values, variances = found.path.constants[at], found.std[at] ** 2
    if abs(values[0] - values[1]) > max(SURE * np.sqrt(variances.sum()), LEAST):
        return None
    weights = 1.0 / variances
    return 1.0 - float((weights * values).sum() / weights.sum()), float(weights.sum() ** -0.5)


def _constants(found: MotionFaults, e: Evidence) -> list[SensorFinding]:
    by_clock = _even(found) is not None
    path, made, edges = found.path, [], found.path.problem.edges
    # Whether the run turns so much that its turns tell by how much the clock is off at the least.
    drift = path.std[TURN] * np.sqrt(e.time[-1] - e.time[0])
    turns = e.rate is not None and np.hypot(drift, path.std[HEADING]) < SURE * LEAST * np.ptp(e.psi)
    for c, x, s in zip(path.columns, path.constants.tolist(), found.std.tolist(), strict=True):
        value, std, text, alike, aside = x, s, "", (), ()
        if c.kind == "scale":
            if by_clock:
                continue
            value, std = 1.0 / (1.0 - x), s / (1.0 - x) ** 2
            # No speed tells whether the clock is at fault; nearer to one it does no harm.
            only = e.velocity is None and abs(value - 1.0) > LEAST
            if not found.wanders and (only or not turns):
                alike, text = ("clock_rate",), f"; {CLOCK_OR_RATE if only else CLOCK_OR_SCALE}"
                aside = (c.channel,) if c.needs == "rate" else e.by or ()
        fault = c.channel, c.kind, c.unit
        text = _told(c, value, e) + text
        made.append(SensorFinding.estimated(fault, value, std, edges, text, alike, not alike, aside))
    return made


def _channels(channel: str, e: Evidence) -> tuple[str, str]:
    """The channels that a fault of one is in, and their verb."""
    several = e.by and channel == e.by[0] and channel != "speed"
    return (" and ".join(e.by), "are") if e.by and several else (channel, "is")


def _late(channel: str, value: float, e: Evidence) -> str:
    """A delay [s] in words: of the yaw rate against the heading, as the position tells nothing of it."""
    way, of = "earlier" if value < 0.0 else "later", "heading" if channel == "r" else "pose"
    late = f", so that the {of} is probably late" if value < 0.0 else ""  # nothing is measured too early
    return f"{' '.join(_channels(channel, e))} {abs(value):.3g} s {way} than the {of}{late}"


def _told(c: FaultColumn, value: float, e: Evidence) -> str:
    """A constant fault in words."""
    name, verb = _channels(c.channel, e)
    if c.kind == "scale":
        way = "large" if value > 1.0 else "small"
        return f"{name} {verb} {100.0 * abs(value - 1.0):.1f} % too {way}"
    if c.kind == "delay":
        return _late(c.channel, value, e)
    if c.kind == "place":
        way = {"x": ("ahead", "aft"), "y": ("to starboard", "to port")}[c.channel][value < 0.0]
        return f"the position is measured {abs(value):.3g} m {way} of the place of the velocity"
    if c.kind in DEVIATIONS:
        by = c.kind.removeprefix("deviation_").replace("sin_2", "sin 2").replace("cos_2", "cos 2")
        return f"psi is {np.degrees(value):.3g}° times {by} ψ too large, as of a compass next to iron"
    if c.unit == "rad":
        return f"{name} and the axes of the velocity differ by {np.degrees(value):.3g}°"
    return f"{name} is {np.degrees(value):.3g}°/s too large"


class _Blocks(NamedTuple):
    """Mean rate of the clock over blocks of time, its standard deviation; begin and end of each [s]."""

    mean: np.ndarray
    std: np.ndarray
    first: np.ndarray
    last: np.ndarray


def _blocks(path: Path) -> _Blocks:
    edges = path.problem.edges
    steps = np.where(path.problem.cut, 0.0, np.diff(edges))
    wide = max(STRETCH, (edges[-1] - edges[0]) / BLOCKS)
    part = ((edges[:-1] - edges[0]) / wide).astype(int)
    weights = np.zeros((part.max() + 1, edges.size))
    weights[part, np.arange(part.size)] = steps
    weights = weights[weights.sum(axis=1) > 0.5 * wide]
    weights /= weights.sum(axis=1)[:, None]
    ends = np.array([np.flatnonzero(w)[[0, -1]] for w in weights]).T
    return _Blocks(
        weights[:, :-1] @ path.clock, path.mean_clock(weights), edges[ends[0]], edges[ends[1] + 1]
    )


def _uneven(path: Path) -> bool:
    """Whether the clock is off its own mean somewhere, so that no constant fault can be it."""
    b = _blocks(path)
    off = np.abs(b.mean - np.average(b.mean, weights=b.std**-2.0))
    return bool((off > np.maximum(SURE * b.std, LEAST)).any())


def _two_clocks(path: Path) -> bool:
    """Whether way and turn contradict a clock: it acts alike on both, so that each alone tells it."""
    p, e = path.problem, path.problem.evidence
    if e.velocity is None or e.rate is None:
        return False
    # A scale of the speed is the mean rate of the way's own clock, which does not count here.
    by_way = [c for c in path.columns if c.needs == "velocity" and c.kind != "scale"]
    by_turn = [c for c in path.columns if c.needs == "rate"]
    parts = (replace(e, rate=None), by_way), (replace(e, velocity=None, by=None), by_turn)
    way, turn = (
        _blocks(PathProblem(part, p.noise, p.gaps, p.without).solve(own)) for part, own in parts
    )
    weight = 1.0 / (way.std**2 + turn.std**2)
    rates = np.array([way.mean - turn.mean, _blocks(path).mean])
    rates -= np.average(rates, axis=1, weights=weight)[:, None]
    apart, off = (weight * rates**2).sum(axis=1).tolist()
    return apart - weight.size > MOST_APART * off


def _stretches(path: Path) -> list[tuple[float, float, float, float]]:
    """Begin, end [s] and mean rate of the clock with its standard deviation, where it is off."""
    mean, std, first, last = _blocks(path)
    off = np.where(np.abs(mean - 1.0) > np.maximum(SURE * std, LEAST), np.sign(mean - 1.0), 0.0)
    made = []
    for way, group in groupby(range(off.size), key=lambda k: off[k]):
        of = list(group)
        if way:
            value = float(np.average(mean[of], weights=(last - first)[of]))
            s = float(np.sqrt((std[of] ** 2).sum()) / len(of))
            made.append((float(first[of[0]]), float(last[of[-1]]), value, s))
    return made


def _leeway(e: Evidence) -> tuple[str, ...]:
    """What no redundant channel tells: a heading axis that is off, or a force from the side."""
    if e.by != ("u", "v") or e.rate is None:
        return ()
    u, v = e.run.measured["u"][e.rows], e.run.measured["v"][e.rows]
    legs = large(u) & straight(e.rate[e.rows])
    if legs.sum() < FEWEST:
        return ()
    angle = np.arctan2(v[legs], np.abs(u[legs]))
    middle = float(np.median(angle))
    if abs(middle) < max(LEAST, spread_of(angle)):
        return ()
    return (
        f"on straight legs the ship drifts {np.degrees(middle):.2g}° to one side: the heading has "
        "an offset, or a force acts to that side; position, speed and heading cannot discriminate "
        "these",
    )


def _agreeing(found: MotionFaults, e: Evidence) -> dict[str, float]:
    """Channels that the pose agrees with, and how far in one sampling period."""
    period = float(np.median(np.diff(e.time[e.rows])))
    std = found.path.std
    agreed = {name: float(std[DRIFT] / np.sqrt(period)) for name in (e.by or ()) if name != "course"}
    if e.rate is not None:
        agreed["r"] = float(std[TURN] / np.sqrt(period))
    return agreed
