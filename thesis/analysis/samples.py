"""Samples of a measured run for the analyses: velocity, acceleration, force, model error (7.7)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim import InputError
from diagnosis.execution import Advance, silent
from diagnosis.predictors import Model
from diagnosis.runs import PreparedRun, body_acceleration, prepare, read_each
from fmus.controller.models import ROTATIONAL
from fmus.controller.parametrisation import ControllerModel
from fmus.hull import mass_matrix
from fmus.observer import mdf
from fmus.observer.screen import Inputs
from fmus.ship import Ship, ship
from fmus.signals import Force, Measurement
from fmus.vessel.vessel import State, disturbed

from .principal_components import fit_components, outliers

NU = ("u", "v", "r")
TAU = ("tau_X", "tau_Y", "tau_N")
OMEGA = ("omega_X", "omega_Y", "omega_N")
# s, times the scale of the ship; until the derivative filter has found the ship: ten times the longer of
# its time constants (chosen).
SETTLED = 5.0
# Samples below which nothing is analysed; chosen: ten for each of the columns of the largest recipe.
FEWEST = 300


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of one run, or of several in a row. Arrays are (n, 3) for surge, sway and yaw.

    Attributes:
        run: (n,), name of the run that each is of.
        time: (n,) [s].
        nu: velocity [m/s, m/s, rad/s].
        nu_dot: acceleration [m/s2, m/s2, rad/s2].
        tau: commanded force [N, N, N m], the mean of the steps before and after the sample.
        omega: model error [N, N, N m], (7.7): relative to (2.27), rotational damping included; of a
            described ship relative to all of its nominal model.
    """

    run: np.ndarray
    time: np.ndarray
    nu: np.ndarray
    nu_dot: np.ndarray
    tau: np.ndarray
    omega: np.ndarray

    def rows(self, keep: np.ndarray) -> "Samples":
        """Only some of the samples."""
        return Samples(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))

    @property
    def names(self) -> list[str]:
        """The runs, in order."""
        return list(dict.fromkeys(self.run.tolist()))

    @property
    def x(self) -> np.ndarray:
        """(n, 6), the columns u, v, r, tau_X, tau_Y, tau_N of (7.13)."""
        return np.hstack([self.nu, self.tau])


def model_error(
    nu: np.ndarray, nu_dot: np.ndarray, tau: np.ndarray, of: Ship | None = None
) -> np.ndarray:
    """omega = M nu_dot + C(nu) nu + g(nu) - tau (n, 3) [N, N, N m], (7.7).

    Args:
        nu, nu_dot, tau: (n, 3), velocity, acceleration and force.
        of: the ship; by default control model (2.27), of a described ship its nominal model.
    """
    if of is None or of.name == ship().name:
        error = ROTATIONAL.error(tuple(nu.T), tuple(nu_dot.T), tuple(tau.T), ControllerModel())
        return np.column_stack(np.broadcast_arrays(*error))
    body = Model(ship=of).hull
    free = disturbed(State(0.0, 0.0, 0.0, *nu.T), Force(*tau.T), body)
    excess = nu_dot - np.column_stack(np.broadcast_arrays(*free))
    return excess @ np.array(mass_matrix(body.hull.inertia)).T


def joined(parts: Sequence[Samples]) -> Samples:
    """Several runs in a row."""
    names = Samples.__dataclass_fields__
    return Samples(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


def by_run(samples: Samples) -> list[Samples]:
    """Each run by itself, as what acts in time must have it; of one name where time goes back."""
    joint = (samples.run[1:] != samples.run[:-1]) | (np.diff(samples.time) < 0.0)
    parts = np.split(np.arange(samples.time.size), np.flatnonzero(joint) + 1)
    return [samples.rows(rows) for rows in parts]


def without_outliers(samples: Samples) -> Samples:
    """The samples within the limits of a PCA of model error, velocity and force (7.3).

    Raises:
        InputError: a column is constant.
    """
    X = np.hstack([samples.omega, samples.nu, samples.tau])
    model = fit_components(X, [*OMEGA, *NU, *TAU])
    return samples.rows(~outliers(model, X))


def gather_samples(
    paths: Sequence[str | Path],
    estimates: str = "smoothed",
    advance: Advance = silent,
    of: Ship | None = None,
    anyway: bool = False,
) -> list[Samples]:
    """Read and prepare measured runs, and estimate velocity and acceleration.

    Args:
        paths: files or folders of logs, see :func:`diagnosis.read`.
        estimates: ``smoothed``: by the smoother, which sees the whole run and leaves spikes out;
            ``mdf``: by the thesis' causal derivative filter, spikes and lag included.
        advance: progress callback.
        of: the ship that was measured; None: the default ship.
        anyway: see :func:`.runs.prepare`.

    Returns:
        The samples of each run.

    Raises:
        InputError: a run cannot be used, is given twice, or has too few samples.
    """
    advance("reading")
    of = of or ship()
    found = []
    for run in read_each(paths, of):
        advance(f"{estimates} states of {run.name}")
        prepared = prepare(run, of, anyway)
        s = _smoothed(prepared, of) if estimates == "smoothed" else _filtered(prepared, of)
        if s.time.size < FEWEST:
            raise InputError(f"run '{run.name}': {s.time.size} samples are too few; {FEWEST} are needed")
        found.append(s)
    return found


def _samples(
    prepared: PreparedRun, keep: np.ndarray, nu: np.ndarray, nu_dot: np.ndarray, of: Ship
) -> Samples:
    """The rows to keep, with their forces."""
    run = prepared.track.run
    before = np.vstack([run.tau_cmd[:1], run.tau_cmd[:-1]])
    tau = 0.5 * (before + run.tau_cmd)
    good = keep & np.isfinite(nu).all(axis=1) & np.isfinite(nu_dot).all(axis=1)
    good &= np.isfinite(tau).all(axis=1)
    nu, nu_dot, tau = nu[good], nu_dot[good], tau[good]
    names = np.full(nu.shape[0], run.name, dtype=object)
    return Samples(names, run.time[good], nu, nu_dot, tau, model_error(nu, nu_dot, tau, of))


def _smoothed(prepared: PreparedRun, of: Ship) -> Samples:
    """By the smoother, at all samples."""
    s = prepared.smoothed
    nu_dot = body_acceleration(s.eta[:, 2], s.nu, s.eta_ddot)
    return _samples(prepared, prepared.samples, s.nu, nu_dot, of)


def _filtered(prepared: PreparedRun, of: Ship) -> Samples:
    """By the modified derivative filter of 4.3.2, row by row: it copes with spikes and frozen rows."""
    run, observer = prepared.track.run, of.serving(mdf.COMPONENT)
    p: Any = observer.params()
    pose = run.pose.tolist()
    inputs = [Inputs(Measurement(*row)) for row in pose]
    state, rows = observer.init(inputs[0], p), []
    steps = np.diff(run.time, prepend=run.time[0]).tolist()
    for i, h in zip(inputs, steps, strict=True):
        state, e = observer.step(state, i, p, h)
        rows.append((e.u_hat, e.v_hat, e.r_hat, e.u_dot_hat, e.v_dot_hat, e.r_dot_hat))
    found = np.array(rows)
    settled = (run.time >= run.time[0] + SETTLED * of.scale.time) & ~prepared.track.between
    return _samples(prepared, settled, found[:, :3], found[:, 3:], of)
