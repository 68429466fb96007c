"""Acceleration against velocity: what it integrates to over some seconds.

In the ship's axes u' = a_x + v r and v' = a_y - u r. Over a window the change of the velocity, less what
turning makes of it, is the integral of the true acceleration, and so of the measured one but for scale,
offsets, axes and place. The integral is nearly free of noise, so that least squares is not biased by it.
"""

from dataclasses import replace

import numpy as np

from fmus.frames import rotate_to_body
from fmus.scale import Scale

from ..files.reading import Run
from .blocked_fit import SURE, blocked_fit
from .constants import LEAST_ANGLE, LEAST_PLACE, LEAST_SCALE, Kind
from .evidence import Evidence, evidence, integral
from .sensor_finding import Z95, Examined, SensorFinding

WINDOW = 2.0  # s, times the scale of the ship: the velocity then changes by more than its noise (chosen)
FEWEST = 60  # windows; chosen
LEAST_OFFSET = 1e-3  # m/s2, the same on a ship of any size: a tenth of a millig (chosen)


def accelerations(run: Run, scale: Scale) -> Examined:
    """Scale, offsets, axes and place of the acceleration against the velocity and the yaw rate."""
    e = evidence(run)
    given = {"a_x", "a_y"} <= run.measured.keys()
    if e is None or e.velocity is None or e.rate is None or not given:
        return Examined(run)
    a = np.column_stack([e.run.measured["a_x"], e.run.measured["a_y"]])
    if not np.isfinite(a).all():
        return Examined(run)
    time, windows = e.time, _windows(e, WINDOW * scale.time)
    if windows.shape[1] < FEWEST:
        return Examined(run)
    nu = np.column_stack(rotate_to_body(e.psi, *e.velocity.T))
    turning = integral(time, np.column_stack([nu[:, 1] * e.rate, -nu[:, 0] * e.rate]))
    parts = {  # what one unit of each adds to the change of u and of v
        "scale": integral(time, a),
        "a_x": np.column_stack([time, 0.0 * time]),
        "a_y": np.column_stack([0.0 * time, time]),
        "axes": integral(time, np.column_stack([-a[:, 1], a[:, 0]])),
        "ahead": np.column_stack([integral(time, e.rate**2), -e.rate]),
        "starboard": np.column_stack([e.rate, integral(time, e.rate**2)]),
    }
    first, last = windows
    columns = np.column_stack([(x[last] - x[first]).T.ravel() for x in parts.values()])
    right = ((nu - turning)[last] - (nu - turning)[first]).T.ravel()
    value, std = blocked_fit(columns, right, time[first])
    factor, turn = np.hypot(value[0], value[3]), np.arctan2(value[3], value[0])
    found: list[tuple[str, Kind, str, float, float, float, str]] = [
        ("a_x", "scale", "1", 1.0 / factor, std[0] / factor**2, LEAST_SCALE, _SCALE),
        (
            "a_x",
            "offset",
            "m/s2",
            -value[1] / factor,
            std[1],
            LEAST_OFFSET,
            _OFFSET.format("a_x"),
        ),
        (
            "a_y",
            "offset",
            "m/s2",
            -value[2] / factor,
            std[2],
            LEAST_OFFSET,
            _OFFSET.format("a_y"),
        ),
        ("a_y", "offset", "rad", -turn, std[3], LEAST_ANGLE, _AXES),
        ("a_x", "place", "m", value[4], std[4], LEAST_PLACE * scale.length, _AHEAD),
        ("a_y", "place", "m", value[5], std[5], LEAST_PLACE * scale.length, _STARBOARD),
    ]
    findings = [
        SensorFinding(
            channel, kind, float(v), unit, (v - Z95 * s, v + Z95 * s), time[0], time[-1], text.format(v)
        )
        for channel, kind, unit, v, s, least, text in found
        if abs(v - (kind == "scale")) > max(SURE * s, least)
    ]
    if not findings:
        return Examined(run)
    true = value[0] * a + value[3] * np.column_stack([-a[:, 1], a[:, 0]]) + value[1:3]
    measured = dict(e.run.measured) | {"a_x": true[:, 0], "a_y": true[:, 1]}
    return Examined(replace(e.run, measured=measured), tuple(findings))


_SCALE = "a_x and a_y are {:.4g} times what the velocity says"
_OFFSET = "{} is {{:.3g}} m/s2 too large"
_AXES = "the axes of a_x and a_y are turned by {:.3g} rad from those of the velocity"
_AHEAD = "the acceleration is measured {:.3g} m ahead of where the velocity is"
_STARBOARD = "the acceleration is measured {:.3g} m to starboard of where the velocity is"


def _windows(e: Evidence, seconds: float) -> np.ndarray:
    """(2, k), first and last rows of windows one after the other."""
    edges = np.searchsorted(e.time, np.arange(e.time[0], e.time[-1], seconds))
    whole = e.time[edges[1:]] - e.time[edges[:-1]] < 2.0 * seconds
    return np.array([edges[:-1][whole], edges[1:][whole]])
