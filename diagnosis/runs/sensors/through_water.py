"""Speed through the water against velocity over ground: they differ by the current, or by a scale.

In the ship's axes nu = nu_water / scale + R(psi)^T V with a current V that is constant over the run. On
several headings the two are told apart. The current is no fault; a note says what it is.
"""

from dataclasses import replace

import numpy as np

from fmus.frames import rotate_to_body
from fmus.scale import Scale

from ..files.reading import Run
from .blocked_fit import SURE, blocked_fit
from .constants import LEAST_SCALE
from .evidence import FEWEST, evidence
from .sensor_finding import Z95, Examined, SensorFinding

CHANNELS = ("u_water", "v_water")


def through_water(run: Run, scale: Scale) -> Examined:
    """Scale of the speed through the water, and the current that it leaves."""
    e = evidence(run)
    given = [k for k, name in enumerate(CHANNELS) if name in run.measured]
    if e is None or e.velocity is None or not given:
        return Examined(run)
    nu = np.column_stack(rotate_to_body(e.psi, *e.velocity.T))
    north = np.column_stack([np.cos(e.psi), -np.sin(e.psi)])
    east = np.column_stack([np.sin(e.psi), np.cos(e.psi)])
    water = np.column_stack([e.run.measured.get(name, np.zeros(e.time.size)) for name in CHANNELS])
    there = np.isfinite(water).all(axis=1)
    if there.sum() < FEWEST:
        return Examined(run)
    columns = np.column_stack([x[there][:, given].T.ravel() for x in (water, north, east)])
    value, std = blocked_fit(columns, nu[there][:, given].T.ravel(), e.time[there])
    notes: tuple[str, ...] = ()
    if np.hypot(*value[1:]) > SURE * np.hypot(*std[1:]):
        notes = (
            f"the water moves by {value[1]:.3g} m/s to north and {value[2]:.3g} m/s to east: "
            "that is a current, if the speed through the water is right",
        )
    factor, half = 1.0 / value[0], Z95 * std[0] / value[0] ** 2
    if abs(factor - 1.0) <= max(SURE * std[0] / value[0] ** 2, LEAST_SCALE):
        return Examined(run, notes=notes)
    name = CHANNELS[given[0]]
    text = f"the speed through the water is {factor:.4g} times what the velocity over ground says"
    ends = float(e.time[0]), float(e.time[-1])
    finding = SensorFinding(name, "scale", factor, "1", (factor - half, factor + half), *ends, text)
    measured = dict(e.run.measured)
    measured |= {CHANNELS[k]: measured[CHANNELS[k]] / factor for k in given}
    return Examined(replace(e.run, measured=measured), (finding,), notes)
