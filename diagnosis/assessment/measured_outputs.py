"""What is measured of actuators beside their commands, such as thrust, held against a model.

Such a measurement judges: no fit of the motion uses it. :func:`fitted` is for who asks for that.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from fmus.actuators.actuation import actuators, measurable, output

from ..identification.prior import NominalPrior, Prior
from ..model import Integrals, Model
from ..model.weak_form import OVERLAP, arriving

STEADY = 0.02  # of the mean shaft speed: a spread below which thrust hardly changes by it; chosen
STEP = 0.01  # of a prior standard deviation; thrust is smooth in its coefficients
STEPS = 4  # of Gauss-Newton; thrust is nearly linear in its coefficients


def named(w: Integrals, model: Model) -> list[str]:
    """The measured outputs of a run that the ship's laws give, ``ACTUATOR.OUTPUT``."""
    known = {} if model.ship.description is None else measurable(model.ship.description)
    return [name for name in w.run.measured if name in known]


def residual(w: Integrals, model: Model, name: str) -> np.ndarray:
    """Measured less modelled output (n,) of a run; NaN where either is not known."""
    description = model.ship.description
    assert description is not None
    model = model.during(w.run.name)
    nu = np.where(w.known[:, None], w.smoothed.nu, np.nan)
    commands, plant = tuple(arriving(w, model)[0]), model.drive.params.plant
    return w.run.measured[name] - output(description, name, commands, tuple(nu.T), plant)


def rms(w: Integrals, model: Model, name: str) -> float:
    """Root mean square of :func:`residual`."""
    return float(np.sqrt(np.nanmean(residual(w, model, name) ** 2)))


def inseparable(runs: Sequence[Integrals], model: Model) -> list[str]:
    """What the commands of some runs leave open between thrust and resistance, a sentence each."""
    description = model.ship.description
    if description is None:
        return []
    told = []
    for a in actuators(description):
        shafts = [a.first + k for k, c in enumerate(a.law.commands) if c.unit == "1/s"]
        given = [w.run.commands for w in runs if w.run.commands is not None]
        if not (a.leads and shafts and given):
            continue
        speed = np.concatenate([commands[:, shafts[0]] for commands in given])
        if speed.std() > STEADY * abs(speed.mean()) or not speed.any():
            continue
        told.append(
            f"The {a.part.title} turns at {speed.mean():.3g} 1/s throughout: its thrust and the "
            "resistance of the hull cannot be told apart by motion alone; run other shaft speeds."
        )
    return told


def fitted(runs: Sequence[Integrals], model: Model, prior: Prior, names: Iterable[str]) -> Model:
    """The model with the coefficients of actuators fitted to what is measured of them.

    Averages over the windows of the weak form, of which :data:`OVERLAP` count as one, by Gauss-Newton
    from the prior.

    Args:
        runs: to learn from.
        model: the initial one.
        prior: of the nominal coefficients.
        names: of the outputs, ``ACTUATOR.OUTPUT``.

    Raises:
        InputError: no run has such a measurement, or no law gives it.
    """
    for name in names:
        having = [w for w in runs if name in named(w, model)]
        if not having:
            known = sorted({n for w in runs for n in named(w, model)})
            raise InputError(f"no run has the measured output '{name}'{nearest(name, known)}")
        model = _fitted(having, model, NominalPrior.of(model, prior), name)
    return model


def _fitted(having: Sequence[Integrals], start: Model, belief: NominalPrior, name: str) -> Model:
    """The model with one actuator's coefficients fitted to one measured output of it."""
    stem = f"plant_{name.partition('.')[0]}_"
    of = [n for n, std in belief.std.items() if n.startswith(stem) and std > 0.0]
    if not of:
        return start
    std = np.array([belief.std[n] for n in of])

    def at(offset: np.ndarray) -> Model:
        return start.plus(dict(zip(of, (offset * std).tolist(), strict=True)))

    def left(offset: np.ndarray) -> np.ndarray:
        parts = [w.smooth @ np.nan_to_num(residual(w, at(offset), name)) for w in having]
        return np.concatenate(parts)

    offset = np.zeros(len(of))
    for _ in range(STEPS):
        error = left(offset)
        size = float(np.std(error)) * np.sqrt(OVERLAP)
        if size == 0.0:
            break
        J = np.column_stack([(left(offset + h) - error) / STEP for h in np.eye(len(of)) * STEP]) / size
        right = J.T @ error / size + offset
        offset = offset - np.linalg.solve(J.T @ J + np.eye(len(of)), right)
    return at(offset)
