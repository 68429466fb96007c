"""Channels in another unit, or with another sign, than was said."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fmus.scale import Scale

from ..data import Run
from ..data.unit_factors import UNITS
from .evidence import Evidence, evidence
from .sensor_finding import Z95, Examined, SensorFinding

WINDOW = 10.0  # s over which channels are compared, or ten samples; chosen
MOST = 0.35  # a factor nearer to one than this is a scale, and is estimated with all else (chosen)
NEAR = 0.15  # relative distance within which a factor is that of a unit (chosen)
FEWEST = 8  # windows; chosen
SIGN = "the other sign"  # and nothing else
AGREED = 0.7  # correlation from which on two channels tell of the same (chosen)


def unit_factors(quantity: str) -> dict[str, float]:
    """``UNIT in place of UNIT`` -> by how much numbers are too large when units are mistaken so."""
    sizes = UNITS[quantity]
    return {
        f"{a} in place of {b}": sizes[b] / sizes[a] for a in sizes for b in sizes if sizes[a] != sizes[b]
    }


def units(run: Run, scale: Scale) -> Examined:
    """Velocity and yaw rate that are many times what the pose says, or its opposite."""
    e = evidence(run)
    if e is None:
        return Examined(run)
    found = Examined(run)
    if e.rate is not None:
        found = _judged(found, e, ("r",), "rate", *_windows(e, e.psi[:, None], e.turned[:, None]))
    if e.velocity is not None and e.by is not None:
        names = ("speed",) if e.by[0] == "speed" else e.by
        found = _judged(found, e, names, "speed", *_windows(e, _position(e), e.gone))
    return found


def _position(e: Evidence) -> np.ndarray:
    """(n, 2), position in all rows [m]."""
    at, time = e.rows, e.time
    return np.column_stack([np.interp(time, time[at], e.run.pose[at, k]) for k in (0, 1)])


def _windows(e: Evidence, pose: np.ndarray, said: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What pose and channel say of each window, (k, d) both."""
    rows = e.rows
    apart = max(1, round(WINDOW / float(np.median(np.diff(e.time[rows])))), 10)
    at = rows[::apart]
    return np.diff(pose[at], axis=0), np.diff(said[at], axis=0)


def _judged(
    found: Examined,
    e: Evidence,
    names: tuple[str, ...],
    quantity: str,
    pose: np.ndarray,
    said: np.ndarray,
) -> Examined:
    """What the ratio of a channel to the pose says, and the run with the channel in its right unit."""
    size = np.hypot.reduce(said, axis=1) if said.shape[1] > 1 else np.abs(said[:, 0])
    much = size > 0.5 * np.quantile(size, 0.9)
    if much.sum() < FEWEST:
        return found
    pose, said, size = pose[much], said[much], size[much]
    ratio = (pose * said).sum(axis=1) / size**2
    moved = np.sqrt((pose**2).sum(axis=1))
    alike = float((pose * said).sum() / np.sqrt((moved**2).sum() * (size**2).sum()))
    told = " and ".join(names)
    if abs(alike) < AGREED:
        measured = {n: v for n, v in found.run.measured.items() if n not in names}
        note = f"{told} and the pose do not tell of the same motion: {told} is left out"
        return replace(found, run=replace(found.run, measured=measured), notes=(*found.notes, note))
    middle = float(np.median(ratio))
    if abs(middle - 1.0) < MOST:
        return found
    value = 1.0 / middle
    half = Z95 * 1.4826 * float(np.median(np.abs(1.0 / ratio - value))) / np.sqrt(ratio.size)
    name, factor = _nearest(abs(value), unit_factors(quantity))
    true = np.copysign(factor, value) if name else value
    text = f"{told} is {value:.4g} times what the pose says"
    text += (
        f": {name}"
        if name and abs(true) != 1.0
        else ": its sign is the other one"
        if value < 0.0
        else ""
    )
    measured = dict(found.run.measured) | {n: found.run.measured[n] / true for n in names}
    begin, end = float(e.time[0]), float(e.time[-1])
    finding = SensorFinding(
        names[0], "scale", value, "1", (value - half, value + half), begin, end, text
    )
    return replace(found, run=replace(found.run, measured=measured), findings=(*found.findings, finding))


def _nearest(value: float, factors: Mapping[str, float]) -> tuple[str, float]:
    """The mistake of units that is nearest to a factor, and its factor; no name: it is none."""
    known = {"": value, **factors} if abs(value - 1.0) > NEAR else {SIGN: 1.0}
    apart = {name: abs(np.log(value / f)) for name, f in known.items() if name}
    best = min(apart, key=lambda name: apart[name])
    return (best, known[best]) if apart[best] < NEAR else ("", value)
