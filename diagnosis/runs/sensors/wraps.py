"""Angles that were interpolated where they wrap: a line from 359 to 1 degree leads through 180."""

from dataclasses import replace

import numpy as np

from fmus.scale import Scale

from ..files.reading import Run
from ..files.telegrams import groups_of
from ..run_constants import FAR
from .evidence import LEAST_TURN
from .sensor_finding import Examined, SensorFinding

ANGLES = ("psi", "psi_2", "course")


def wraps(run: Run, scale: Scale) -> Examined:
    """Rows of angles between a value before and one after a wrap."""
    pose, measured, findings = run.pose.copy(), dict(run.measured), []
    for name in ANGLES:
        values = pose[:, 2] if name == "psi" else measured.get(name)
        if values is None:
            continue
        repaired, rows = unwrapped(values)
        if not rows.size:
            continue
        if name == "psi":
            pose[:, 2] = repaired
        else:
            measured[name] = repaired
        text = f"{name} was interpolated where it wraps, in {rows.size} rows"
        many, time = float(rows.size), run.time[rows]
        findings.append(SensorFinding.estimated((name, "wrap", "1"), many, 0.0, time, text))
    return Examined(replace(run, pose=pose, measured=measured) if findings else run, tuple(findings))


def unwrapped(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An angle (n,) [rad] whose rows within a wrap are on the short way, and which rows these are."""
    there = np.flatnonzero(np.isfinite(values))
    angle, step = values[there].copy(), np.diff(values[there])
    usual = float(np.median(np.abs(step))) if step.size else 0.0
    large = np.abs(step) > max(FAR * usual, LEAST_TURN)
    same = large[1:] & large[:-1] & (np.sign(step[1:]) == np.sign(step[:-1]))
    changed = []
    for begin, end in groups_of(same):
        a, b = begin, end + 1  # rows before and after all those large steps
        total = angle[b] - angle[a]
        turn = float(np.angle(np.exp(1j * total)))
        if (b - a) * LEAST_TURN > 2.0 * np.pi or abs(total) < max(np.pi, 2.0 * abs(turn)):
            continue
        if large[a - 1 : a].any() or large[b : b + 1].any():  # a course at rest, which jumps to and fro
            continue
        inside = np.arange(a + 1, b)
        angle[inside] = angle[a] + turn * (inside - a) / (b - a)
        changed += there[inside].tolist()
    whole = values.copy()
    whole[there] = angle
    return whole, np.array(changed, int)
