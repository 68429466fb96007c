"""Channels in addition to pose, velocity and yaw rate, each fitted to these by least squares.

A second receiver of the pose: where its antenna is, and which is late or turned. Acceleration: in the
ship's axes u' = a_x + v r and v' = a_y - u r. Over a window the change of the velocity, less what
turning makes of it, is the integral of the true acceleration, and so of the measured one but for scale,
offsets, axes and place. The integral is nearly free of noise and does not bias least squares. Speed
through the water: nu = nu_water / scale + R(psi)^T V with a current V that is constant over the run; on
several headings the two differ. The current is not a fault; a note states it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fmus.frames import rotate_to_body, rotate_to_earth
from fmus.scale import Scale

from ..cleaning import WIDTH
from ..files.reading import Run
from .constants import LEAST, Kind, least_place
from .evidence import FEWEST, SURE, blocked_fit, evidence, integral
from .sensor_finding import Examined, SensorFinding

LEAST_OFFSET = 1e-3  # m/s2, the same on a ship of any size: a tenth of a millig (chosen)
WATER = ("u_water", "v_water")


class _Fault(NamedTuple):
    """What a value that was fitted is of; its text has a place for the value."""

    channel: str
    kind: Kind
    unit: str
    least: float
    text: str


def _findings(
    faults: Sequence[_Fault], values: np.ndarray, std: np.ndarray, time: np.ndarray
) -> list[SensorFinding]:
    """Of values and their standard deviations those that are sure and matter, at times (n,) [s]."""
    return [
        SensorFinding.estimated(
            (f.channel, f.kind, f.unit), float(v), float(s), time, f.text.format(v, np.degrees(v))
        )
        for f, v, s in zip(faults, values, std, strict=True)
        if abs(v - (f.kind == "scale")) > max(SURE * s, f.least)
    ]


def receivers(run: Run, scale: Scale) -> Examined:
    """Place and delay of a second antenna, and offset of a second heading, against the first."""
    psi, two, repaired = run.pose[:, 2], run.measured, dict(run.measured)
    found: list[SensorFinding] = []
    if {"x_2", "y_2"} <= two.keys():
        there = np.all(np.isfinite([*run.pose.T, two["x_2"], two["y_2"]]), axis=0)
        if there.sum() >= FEWEST:
            found += _places(run.rows(there), scale)
            value = {(f.channel, f.kind): f.value for f in found}
            late = value.get(("x_2", "delay"), 0.0)
            arm = rotate_to_earth(psi, *(value.get((n, "place"), 0.0) for n in ("x_2", "y_2")))
            for name, off in zip(("x_2", "y_2"), arm, strict=True):
                x = np.interp(run.time + late, run.time, two[name]) if late else two[name]
                repaired[name] = x - off
    if "psi_2" in two:
        apart = np.angle(np.exp(1j * (two["psi_2"] - psi)))
        there = np.isfinite(apart)
        if there.sum() >= FEWEST:
            time = run.time[there]
            value, std = blocked_fit(np.ones((time.size, 1)), apart[there], time)
            text = "the second heading is {1:.3g}° from the first"
            turned = _findings([_Fault("psi_2", "offset", "rad", LEAST, text)], value, std, time)
            repaired["psi_2"] = two["psi_2"] - sum(f.value for f in turned)
            found += turned
    return Examined(replace(run, measured=repaired) if found else run, tuple(found))


def _places(run: Run, scale: Scale) -> list[SensorFinding]:
    """Of the second position in the axes of the heading: an arm, and the way of a delay."""
    time, pose = run.time, run.pose
    apart = np.column_stack([run.measured["x_2"], run.measured["y_2"]]) - pose[:, :2]
    body = np.concatenate(rotate_to_body(pose[:, 2], *apart.T))
    speed = np.concatenate(rotate_to_body(pose[:, 2], *np.gradient(pose[:, :2], time, axis=0).T))
    sides = np.repeat(np.eye(2), time.size, axis=0)
    least, period = least_place(scale), float(np.median(np.diff(time)))
    antenna = "the second antenna is {:.3g} m "
    late = "the second position is {:.3g} s later than the first"
    faults = (
        _Fault("x_2", "place", "m", least, antenna + "ahead of the first"),
        _Fault("y_2", "place", "m", least, antenna + "to starboard of the first"),
        _Fault("x_2", "delay", "s", period / 2.0, late),
    )
    return _findings(faults, *blocked_fit(np.column_stack([sides, -speed]), body, time), time)


def accelerations(run: Run, scale: Scale) -> Examined:
    """Scale, offsets, axes and place of the acceleration against the velocity and the yaw rate."""
    e = evidence(run)
    given = {"a_x", "a_y"} <= run.measured.keys()
    if e is None or e.velocity is None or e.rate is None or not given:
        return Examined(run)
    a = np.column_stack([e.run.measured["a_x"], e.run.measured["a_y"]])
    time, seconds = e.time, WIDTH * scale.time
    edges = np.searchsorted(time, np.arange(time[0], time[-1], seconds))
    whole = time[edges[1:]] - time[edges[:-1]] < 2.0 * seconds
    first, last = edges[:-1][whole], edges[1:][whole]
    if not np.isfinite(a).all() or first.size < FEWEST:
        return Examined(run)
    nu = np.column_stack(rotate_to_body(e.psi, *e.velocity.T))
    turning = integral(time, np.column_stack([nu[:, 1] * e.rate, -nu[:, 0] * e.rate]))
    across, swing = np.column_stack([-a[:, 1], a[:, 0]]), integral(time, e.rate**2)
    parts = (  # what one unit of each adds to the change of u and of v
        integral(time, a),
        np.column_stack([time, 0.0 * time]),
        np.column_stack([0.0 * time, time]),
        integral(time, across),
        np.column_stack([swing, -e.rate]),
        np.column_stack([e.rate, swing]),
    )
    columns = np.column_stack([(x[last] - x[first]).T.ravel() for x in parts])
    right = ((nu - turning)[last] - (nu - turning)[first]).T.ravel()
    value, std = blocked_fit(columns, right, time[first])
    factor, turn = np.hypot(value[0], value[3]), np.arctan2(value[3], value[0])
    place, least = "the acceleration is measured {:.3g} m ", least_place(scale)
    axes = "the axes of a_x and a_y are turned by {:.3g} rad from those of the velocity"
    faults = (
        _Fault(
            "a_x", "scale", "1", LEAST, "a_x and a_y are {:.4g} times the acceleration by the velocity"
        ),
        _Fault("a_x", "offset", "m/s2", LEAST_OFFSET, "a_x is {:.3g} m/s2 too large"),
        _Fault("a_y", "offset", "m/s2", LEAST_OFFSET, "a_y is {:.3g} m/s2 too large"),
        _Fault("a_y", "offset", "rad", LEAST, axes),
        _Fault("a_x", "place", "m", least, place + "ahead of the place of the velocity"),
        _Fault("a_y", "place", "m", least, place + "to starboard of the place of the velocity"),
    )
    values = np.array([1.0 / factor, *(-value[1:3] / factor), -turn, *value[4:]])
    found = _findings(faults, values, np.array([std[0] / factor**2, *std[1:]]), time)
    if not found:
        return Examined(run)
    true = value[0] * a + value[3] * across + value[1:3]
    measured = dict(e.run.measured) | dict(zip(("a_x", "a_y"), true.T, strict=True))
    return Examined(replace(e.run, measured=measured), tuple(found))


def through_water(run: Run, scale: Scale) -> Examined:
    """Scale of the speed through the water, and the current that it leaves."""
    e = evidence(run)
    given = [k for k, name in enumerate(WATER) if name in run.measured]
    if e is None or e.velocity is None or not given:
        return Examined(run)
    nu = np.column_stack(rotate_to_body(e.psi, *e.velocity.T))
    north = np.column_stack([np.cos(e.psi), -np.sin(e.psi)])
    east = np.column_stack([np.sin(e.psi), np.cos(e.psi)])
    water = np.column_stack([e.run.measured.get(name, np.zeros(e.time.size)) for name in WATER])
    there = np.isfinite(water).all(axis=1)
    if there.sum() < FEWEST:
        return Examined(run)
    columns = np.column_stack([x[there][:, given].T.ravel() for x in (water, north, east)])
    value, std = blocked_fit(columns, nu[there][:, given].T.ravel(), e.time[there])
    notes: tuple[str, ...] = ()
    if np.hypot(*value[1:]) > SURE * np.hypot(*std[1:]):
        notes = (
            f"the water moves by {value[1]:.3g} m/s to north and {value[2]:.3g} m/s to east: a "
            "current, if the speed through the water is correct",
        )
    text = "the speed through the water is {:.4g} times that by the velocity over ground"
    fault = _Fault(WATER[given[0]], "scale", "1", LEAST, text)
    found = _findings([fault], 1.0 / value[:1], std[:1] / value[:1] ** 2, e.time)
    if not found:
        return Examined(run, notes=notes)
    measured = dict(e.run.measured)
    measured |= {WATER[k]: measured[WATER[k]] * value[0] for k in given}
    return Examined(replace(e.run, measured=measured), tuple(found), notes)
