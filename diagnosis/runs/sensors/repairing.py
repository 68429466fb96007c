"""A run without the faults of its channels, by what these say of each other, without a ship's model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline

from fmus.frames import rotate_to_body, rotate_to_earth

from ..files.reading import Run
from .constants import DEVIATIONS
from .evidence import Evidence, straight
from .sensor_finding import SensorFinding


@dataclass(frozen=True, eq=False)
class Correction:
    """What is to be done.

    Attributes:
        values: (channel, kind) -> size of each constant fault.
        clock: times (m,) of the log, and true times of the same instants [s]; empty: it is right.
        gaps: jumps of the clock.
    """

    values: Mapping[tuple[str, str], float]
    clock: tuple[np.ndarray, ...] = ()
    gaps: Sequence[SensorFinding] = ()

    def of(self, channel: str, kind: str, usual: float = 0.0) -> float:
        """Size of a fault; some usual value where there is none."""
        return self.values.get((channel, kind), usual)


def corrected(e: Evidence, fix: Correction) -> Run:
    """The run with a right clock, and with velocity and yaw rate as the place of the position has them.

    Of a log that was filled between telegrams only the rows with a telegram keep a pose where the clock
    is repaired: others are on no line any more.
    """
    run, time = e.run, e.time
    measured, pose = dict(run.measured), run.pose.copy()
    deviation = np.sum([fix.of("psi", k) * law(e.psi) for k, law in DEVIATIONS.items()], axis=0)
    psi, pose[:, 2] = e.psi - deviation, pose[:, 2] - deviation
    rate = e.rate
    if rate is not None:
        late = _later(time, rate, fix.of("r", "delay"))
        rate = (late - fix.of("r", "offset")) / fix.of("r", "scale", 1.0)
        measured["r"] = np.where(np.isfinite(measured["r"]), rate, np.nan)
    if e.velocity is not None and e.by is not None:
        velocity = _punctual(e, fix.of(e.by[0], "delay")) / fix.of(e.by[0], "scale", 1.0)
        heading = fix.of("psi", "offset")
        axes = fix.of(e.by[1], "offset") * (-1.0 if e.by[1] == "y_dot" else 1.0)
        turned = (heading or axes) + deviation * (e.by == ("u", "v"))
        velocity = np.column_stack(rotate_to_body(turned, *velocity.T))
        if heading and heading_is_off(e, heading):
            psi, pose[:, 2] = psi - heading, pose[:, 2] - heading
        ahead, aside = fix.of("x", "place"), fix.of("y", "place")
        turning = rate if rate is not None else np.gradient(psi, time)
        swing = rotate_to_earth(psi, -aside * turning, ahead * turning)
        measured |= _as_given(e, velocity + np.column_stack(swing), psi)
    repaired = replace(run, pose=pose, measured=measured)
    return _retimed(repaired, e, fix) if fix.clock else repaired


def heading_is_off(e: Evidence, offset: float) -> bool:
    """Whether rather the heading is off than the axes of the velocity, which differ by an offset [rad].

    A ship goes ahead where nothing pushes: what of track against heading, and of the velocity in its own
    axes, has clearly less leeway on straight legs is right.
    """
    assert e.velocity is not None
    legs = straight(np.gradient(e.psi, e.time) if e.rate is None else e.rate)
    u, v = rotate_to_body(e.psi, *e.velocity.T)
    leeway = float(np.median(np.arctan2(v, np.abs(u))[legs]))
    return 2.0 * abs(leeway) < abs(leeway - offset)


def _later(time: np.ndarray, values: np.ndarray, delay: float) -> np.ndarray:
    """Values (n,) or (n, k) as they are some time [s] later."""
    return make_interp_spline(time, values, 1)(np.clip(time + delay, time[0], time[-1]))


def _punctual(e: Evidence, delay: float) -> np.ndarray:
    """Velocity (n, 2) over ground without a delay [s] of its channels."""
    assert e.velocity is not None
    if e.by != ("u", "v"):
        return _later(e.time, e.velocity, delay)
    body = _later(e.time, np.column_stack(rotate_to_body(e.psi, *e.velocity.T)), delay)
    return np.column_stack(rotate_to_earth(e.psi, *body.T))


def _as_given(e: Evidence, velocity: np.ndarray, psi: np.ndarray) -> dict[str, np.ndarray]:
    """Velocity (n, 2) over ground in the channels in which it was measured."""
    assert e.by is not None
    if e.by == ("x_dot", "y_dot"):
        made = velocity.T
    elif e.by == ("speed", "course"):
        made = np.array([np.hypot(*velocity.T), np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))])
    else:
        made = np.array(rotate_to_body(psi, *velocity.T))
    there = [np.isfinite(e.run.measured[name]) for name in e.by]
    return {name: np.where(t, m, np.nan) for name, t, m in zip(e.by, there, made, strict=True)}


def _retimed(run: Run, e: Evidence, fix: Correction) -> Run:
    """The run on its true time: rows within a jump of the clock are left out."""
    log, true = fix.clock
    clock = np.interp(run.time, log, true)
    clock += np.minimum(run.time - log[0], 0.0) + np.maximum(run.time - log[-1], 0.0)
    keep = np.ones(run.time.size, bool)
    for gap in fix.gaps:
        clock += np.where(run.time >= gap.end, gap.value, 0.0)
        keep &= (run.time <= gap.start) | (run.time >= gap.end)
    pose = np.where(e.filled[:, None], np.nan, run.pose)
    return replace(run, time=clock, pose=pose).rows(keep)
