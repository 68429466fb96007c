"""A second receiver of the pose beside the first: where its antenna is, and which is late or turned."""

from dataclasses import replace

import numpy as np

from fmus.frames import rotate_to_body
from fmus.scale import Scale

from ..cleaning import in_order
from ..files.reading import Run
from .blocked_fit import SURE, blocked_fit
from .constants import LEAST_ANGLE, LEAST_DELAY, LEAST_PLACE, Kind
from .sensor_finding import Z95, Examined, SensorFinding

FEWEST = 60  # rows that both have; chosen


def receivers(run: Run, scale: Scale) -> Examined:
    """Place and delay of a second antenna, and offset of a second heading, against the first."""
    run = run.rows(in_order(run.time))
    pose, two = run.pose, run.measured
    found: list[SensorFinding] = []
    repaired = dict(two)
    if {"x_2", "y_2"} <= two.keys():
        there = np.isfinite(pose).all(axis=1) & np.isfinite(two["x_2"]) & np.isfinite(two["y_2"])
        if there.sum() >= FEWEST:
            found += _places(run, there, scale)
            arm = {f.channel: f.value for f in found if f.kind == "place"}
            late = next((f.value for f in found if f.kind == "delay"), 0.0)
            c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
            ahead, aside = arm.get("x_2", 0.0), arm.get("y_2", 0.0)
            at = run.time + late
            x, y = (np.interp(at, run.time, two[n]) if late else two[n] for n in ("x_2", "y_2"))
            repaired |= {"x_2": x - c * ahead + s * aside, "y_2": y - s * ahead - c * aside}
    if "psi_2" in two:
        apart = np.angle(np.exp(1j * (two["psi_2"] - pose[:, 2])))
        there = np.isfinite(apart)
        if there.sum() >= FEWEST:
            finding = _offset(run, apart, there)
            if finding:
                found.append(finding)
                repaired["psi_2"] = two["psi_2"] - finding.value
    return Examined(replace(run, measured=repaired) if found else run, tuple(found))


def _places(run: Run, there: np.ndarray, scale: Scale) -> list[SensorFinding]:
    """Of the second position in the axes of the heading: an arm, and the way of a delay."""
    time, pose = run.time[there], run.pose[there]
    apart = np.column_stack([run.measured["x_2"][there], run.measured["y_2"][there]]) - pose[:, :2]
    body = np.concatenate(rotate_to_body(pose[:, 2], *apart.T))
    speed = np.concatenate(rotate_to_body(pose[:, 2], *np.gradient(pose[:, :2], time, axis=0).T))
    one, none = np.ones(time.size), np.zeros(time.size)
    columns = np.column_stack([np.concatenate([one, none]), np.concatenate([none, one]), -speed])
    value, std = blocked_fit(columns, body, time)
    period = float(np.median(np.diff(time)))
    kinds: list[tuple[str, Kind, str, float]] = [
        ("x_2", "place", "m", LEAST_PLACE * scale.length),
        ("y_2", "place", "m", LEAST_PLACE * scale.length),
        ("x_2", "delay", "s", LEAST_DELAY * period),
    ]
    words = (
        "the second antenna is {:.3g} m ahead of the first",
        "the second antenna is {:.3g} m to starboard of the first",
        "the second position comes {:.3g} s later than the first",
    )
    return [
        _finding(channel, kind, unit, v, s, time, text)
        for (channel, kind, unit, least), v, s, text in zip(kinds, value, std, words, strict=True)
        if abs(v) > max(SURE * s, least)
    ]


def _offset(run: Run, apart: np.ndarray, there: np.ndarray) -> SensorFinding | None:
    """Of the second heading."""
    time = run.time[there]
    (value,), (std,) = blocked_fit(np.ones((time.size, 1)), apart[there], time)
    if abs(value) <= max(SURE * std, LEAST_ANGLE):
        return None
    text = f"the second heading is {np.degrees(value):.3g}° from the first"
    return _finding("psi_2", "offset", "rad", value, std, time, text)


def _finding(
    channel: str, kind: Kind, unit: str, value: float, std: float, time: np.ndarray, text: str
) -> SensorFinding:
    interval = value - Z95 * std, value + Z95 * std
    ends = float(time[0]), float(time[-1])
    return SensorFinding(channel, kind, value, unit, interval, *ends, text.format(value))
