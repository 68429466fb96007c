"""What is measured of actuators beside their commands, such as thrust, held against a model.

Such a measurement judges: no fit of the motion uses it; :mod:`..search.prediction_fit.output_fit` is for
who asks for that.
"""

from collections.abc import Sequence

import numpy as np

from fmus.actuators.actuation import actuators, measurable, output

from .ship_model import Model
from .uncertainty import SHARE_OF_COMMAND
from .weak_form import WeakWindows, arriving, inflow_along


def named(w: WeakWindows, model: Model) -> list[str]:
    """The measured outputs of a run that the ship's laws give, ``ACTUATOR.OUTPUT``."""
    known = measurable(model.ship.description)
    return [name for name in w.run.measured if name in known]


def residual(w: WeakWindows, model: Model, name: str) -> np.ndarray:
    """Measured less modelled output (n,) of a run; NaN where either is not known."""
    description = model.ship.description
    model = model.during(w.run.name)
    s, known = w.smoothed, w.known[:, None]
    eta, nu = (np.where(known, x, np.nan) for x in (s.eta, s.nu))
    met = tuple(inflow_along(w, model, eta, nu).T)
    commands, plant = tuple(arriving(w, model)), model.drive.params.plant
    return w.run.measured[name] - output(description, name, commands, met, plant)


def rms(w: WeakWindows, model: Model, name: str) -> float:
    """Root mean square of :func:`residual`."""
    return float(np.sqrt(np.nanmean(residual(w, model, name) ** 2)))


def inseparable(runs: Sequence[WeakWindows], model: Model) -> list[str]:
    """What the commands of some runs leave open between thrust and resistance, a sentence each."""
    stated = []
    for a in actuators(model.ship.description):
        shafts = [a.first + k for k, c in enumerate(a.law.commands) if c.unit == "1/s"]
        given = [w.run.commands for w in runs if w.run.commands is not None]
        if not (a.leads and shafts and given):
            continue
        speed = np.concatenate([commands[:, shafts[0]] for commands in given])
        if speed.std() > SHARE_OF_COMMAND * abs(speed.mean()) or not speed.any():
            continue
        stated.append(
            f"The {a.part.title} turns at {speed.mean():.3g} 1/s throughout: motion alone cannot "
            "discriminate its thrust from the resistance of the hull; run other shaft speeds."
        )
    return stated
