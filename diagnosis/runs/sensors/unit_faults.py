"""Channels in another unit, or with another sign, than was said."""

from dataclasses import replace
from itertools import permutations

import numpy as np

from fmus.frames import rotate_to_body, rotate_to_earth
from fmus.scale import Scale

from ..cleaning import between
from ..columns.columns import POSE
from ..columns.unit_check import QUICKEST, UNITS
from ..files.reading import NO_RATE, Run
from ..run_constants import HORIZON, IN_A_ROW
from .evidence import AGREED, ALIKE, SURE, Evidence, blocked_fit, evidence, integral, large, spread_of
from .sensor_finding import Examined, SensorFinding

NEAR = 0.15  # 1, relative distance within which a factor is that of a unit (chosen)
CODED = 4.733  # 1, times the root of degrees per minute: rate of turn of AIS (ITU-R M.1371)
SIGN = "the other sign"  # and nothing else
OPPOSITE = "its sign is reversed"


def units(run: Run, scale: Scale) -> Examined:
    """Velocity and yaw rate that are many times what the pose says, or its opposite."""
    plain = without_code(run)
    found = replace(mirrored(plain.run), notes=plain.notes)
    e = evidence(found.run)
    if e is None:
        return found
    if e.rate is not None:
        found = _judged(found, e, ("r",), "rate", *_windows(e, e.psi[:, None], e.turned[:, None]))
    if e.velocity is not None and e.by is not None:
        names = ("speed",) if e.by[0] == "speed" else e.by
        if e.by == ("u", "v") and (alone := _one_of_two(e)):
            channel, *factor = alone
            return _corrected(found, e, (channel,), "speed", *factor)
        found = _judged(found, e, names, "speed", *_windows(e, _position(e), e.gone))
    return found


def without_code(run: Run) -> Examined:
    """A run without a yaw rate as AIS sends it, if it is that of the pose.

    In whole numbers of CODED times the root of degrees per minute, it is too coarse beside a heading.
    """
    code = run.measured.get("r", np.zeros(0))
    known = code[np.isfinite(code)]
    most = np.abs(known).max(initial=0.0)
    if not QUICKEST < most < -NO_RATE or (known != np.round(known)).any():
        return Examined(run)
    rate = np.sign(code) * (code / CODED) ** 2 * UNITS["rate"]["deg/min"]
    e = evidence(replace(run, measured=dict(run.measured) | {"r": rate}))
    if e is None or e.rate is None:
        return Examined(run)
    pose, said = _windows(e, e.psi[:, None], e.turned[:, None])
    factor = float((pose * said).sum() / (said**2).sum())
    if _alike(pose, said) < AGREED or abs(factor - 1.0) > ALIKE:
        return Examined(run)
    others = {name: values for name, values in run.measured.items() if name != "r"}
    note = "r is coded as by AIS, by roots of degrees per minute: it is not used"
    return Examined(replace(run, measured=others), notes=(note,))


def mirrored(run: Run) -> Examined:
    """A channel of the pose that has the other sign.

    Heading and velocity in the ship's axes tell where it goes, the yaw rate how the heading turns: of
    the three signs only one puts both right.
    """
    e = evidence(run)
    if e is None or e.rate is None or e.by != ("u", "v") or _both_agree(e):
        return Examined(run)
    for k, name in enumerate(POSE):
        pose = run.pose * np.where(np.arange(3) == k, -1.0, 1.0)
        other = replace(run, pose=pose)
        meant = evidence(other)
        if meant is not None and _both_agree(meant):
            text = f"{name} contradicts u, v and r: {OPPOSITE}"
            fault = (name, "scale", "1")
            return Examined(other, (SensorFinding.estimated(fault, -1.0, 0.0, e.time, text),))
    return Examined(run)


def _both_agree(e: Evidence) -> bool:
    """Whether the pose tells of the same motion as yaw rate and velocity, signs included."""
    said = ((e.psi[:, None], e.turned[:, None]), (_position(e), e.gone))
    return all(_alike(*_windows(e, *pair)) > AGREED for pair in said)


def _alike(pose: np.ndarray, said: np.ndarray) -> float:
    """Correlation of what pose and channels say of windows (k, d), about zero; 0 where nothing moves."""
    sizes = (pose**2).sum() * (said**2).sum()
    return float((pose * said).sum() / np.sqrt(sizes)) if sizes > 0.0 else 0.0


def sway(run: Run, scale: Scale) -> Examined:
    """A sway velocity with the other sign, which looks like a position measured elsewhere aboard.

    What surge and sway alone move the ship by and that place are fitted together to the way of windows:
    what a place adds comes with the yaw rate, sway later.
    """
    e = evidence(run)
    if e is None or e.velocity is None or e.by != ("u", "v"):
        return Examined(run)
    value, std = _factors(e)
    if not value[1] < -SURE * std[1]:
        return Examined(run)
    text = f"v is {1.0 / value[1]:.3g} times that by the pose: {OPPOSITE}"
    factor, s = float(1.0 / value[1]), float(std[1] / value[1] ** 2)
    finding = SensorFinding.estimated(("v", "scale", "1"), factor, s, e.time, text)
    return Examined(replace(run, measured=dict(run.measured) | {"v": -run.measured["v"]}), (finding,))


def _factors(e: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Factors (2,) by which surge and sway move the ship as the pose does, and their deviations."""
    assert e.velocity is not None
    still, one = np.zeros_like(e.time), np.ones_like(e.time)
    surge, _ = rotate_to_body(e.psi, *e.velocity.T)
    ahead = integral(e.time, np.column_stack(rotate_to_earth(e.psi, surge, still)))
    places = (np.column_stack(rotate_to_earth(e.psi, *at)) for at in ((one, still), (still, one)))
    way, *said = _windows(e, _position(e), ahead, e.gone - ahead, *places)
    if len(way) < IN_A_ROW:
        return np.ones(2), np.full(2, np.inf)
    columns = np.column_stack([x.T.ravel() for x in said])
    value, std = blocked_fit(columns, way.T.ravel(), np.arange(len(way)))
    return value[:2], std[:2]


def _one_of_two(e: Evidence) -> tuple[str, float, float] | None:
    """A surge or a sway velocity in another unit, its factor and deviation, if the other is right."""
    value, std = _factors(e)
    right = np.abs(value - 1.0) < np.maximum(ALIKE, SURE * std)
    surely = np.abs(value) > SURE * std
    if right.sum() != 1 or not surely.all():
        return None
    k = int(np.argmin(right))
    factor = float(1.0 / value[k])
    is_unit = factor > 0.0 and _nearest(factor, "speed")[0] not in ("", SIGN)
    return (("u", "v")[k], factor, float(std[k] / value[k] ** 2)) if is_unit else None


def _position(e: Evidence) -> np.ndarray:
    """(n, 2), position in all rows [m]."""
    at, time = e.rows, e.time
    return between(time, time[at], e.run.pose[at, :2])


def _windows(e: Evidence, *paths: np.ndarray) -> list[np.ndarray]:
    """What pose and channels say of each window, (k, d) each."""
    rows = e.rows
    apart = max(1, round(HORIZON / float(np.median(np.diff(e.time[rows])))), 10)
    return [np.diff(path[rows[::apart]], axis=0) for path in paths]


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
    much = large(size)
    if much.sum() < IN_A_ROW:
        return found
    pose, said, size = pose[much], said[much], size[much]
    ratio = (pose * said).sum(axis=1) / size**2
    alike = _alike(pose, said)
    stated = " and ".join(names)
    if abs(alike) < AGREED:
        measured = {n: v for n, v in found.run.measured.items() if n not in names}
        note = f"{stated} and the pose disagree about the motion: {stated} is not used"
        return replace(found, run=replace(found.run, measured=measured), notes=(*found.notes, note))
    middle = float(np.median(ratio))
    if abs(middle - 1.0) < ALIKE:  # a scale, which is estimated with all else
        return found
    s = spread_of(1.0 / ratio) / float(np.sqrt(ratio.size))
    return _corrected(found, e, names, quantity, 1.0 / middle, s)


def _corrected(
    found: Examined, e: Evidence, names: tuple[str, ...], quantity: str, value: float, std: float
) -> Examined:
    """What was found, and channels that are some times too large, which is a unit if it is near one."""
    name, factor = _nearest(abs(value), quantity)
    true = np.copysign(factor, value) if name else value
    text = f"{' and '.join(names)} is {value:.4g} times that by the pose"
    text += f": {name}" if name and abs(true) != 1.0 else f": {OPPOSITE}" if value < 0.0 else ""
    measured = dict(found.run.measured) | {n: found.run.measured[n] / true for n in names}
    finding = SensorFinding.estimated((names[0], "scale", "1"), value, std, e.time, text)
    return replace(found, run=replace(found.run, measured=measured), findings=(*found.findings, finding))


def _nearest(value: float, quantity: str) -> tuple[str, float]:
    """The mistake of units that is nearest to a factor, and its factor; no name: it is none."""
    pairs = permutations(UNITS[quantity].items(), 2)
    known = {f"{a} in place of {b}": of_b / of_a for (a, of_a), (b, of_b) in pairs if of_a != of_b}
    if abs(value - 1.0) <= NEAR:
        known = {SIGN: 1.0}
    best = min(known, key=lambda name: abs(np.log(value / known[name])))
    return (best, known[best]) if abs(np.log(value / known[best])) < NEAR else ("", value)
