"""Regression of accelerations on a Kalman smoother's states, after M. Alexandersson (2022).

An extended Kalman filter with a model of the ship as its predictor and the smoother of Rauch, Tung and
Striebel give the velocities from the raw pose; accelerations are their differences, and the terms of a
manoeuvring model are fitted to them by ordinary least squares. The nominal model is the predictor of the
first pass, with which settings are chosen; the fitted one is that of the second, which the last fit has.
"""

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd

from diagnosis import Smoothed

from ..chosen_settings import searched
from ..same_windows import DELAYS, Continuous, Nominal, Table, moved, table

STEP = 0.2  # s
SETTINGS = {
    "inputs": ("forces", "commands"),
    "delay": DELAYS,
    "terms": ("linear", "quadratic", "cubic"),
    "process": (0.02, 0.1),  # m/s2, m/s2, rad/s2 that the predictor may be off by, over a step
}
SMALL = 1e-5  # m, m, rad, m/s, m/s, rad/s; for differences


def smoothed_velocity(law: Continuous, t: Table, process: float) -> np.ndarray:
    """Velocity (n, 3) of a run by an extended Kalman filter and the smoother behind it.

    Args:
        law: the predictor.
        t: the run; where its pose is NaN nothing is measured.
        process: standard deviation of the acceleration that the predictor lacks.
    """
    h, n = t.h, len(t.pose)
    given = pd.DataFrame(t.given).ffill().bfill().to_numpy()  # in a gap as before it
    Q = np.diag([*[(0.5 * process * h * h) ** 2] * 3, *[(process * h) ** 2] * 3])
    R, H = np.diag(t.noise**2), np.eye(3, 6)
    start = np.flatnonzero(np.isfinite(t.pose[:, 0]))[0]
    x = np.concatenate([t.pose[start], np.nan_to_num(t.nu[start])])
    P = np.diag([*t.noise**2, *[0.05**2] * 3])
    filtered, predicted, slopes = [], [], []
    for k in range(n):
        if k:
            points = x + np.vstack([np.zeros(6), SMALL * np.eye(6)])
            nu = law.step(points[None, :, 3:], np.repeat(given[None, [k - 1]], 7, axis=1))
            after = np.hstack([moved(points[:, :3], 0.5 * (points[:, 3:] + nu), h), nu])
            x, F = after[0], (after[1:] - after[0]).T / SMALL
            P = F @ P @ F.T + Q
            slopes.append(F)
        predicted.append((x, P))
        if np.isfinite(t.pose[k, 0]):
            K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            x, P = x + K @ (t.pose[k] - H @ x), P - K @ H @ P
        filtered.append((x, P))
    found = [filtered[-1][0]]
    for k in range(n - 2, -1, -1):
        (x, P), (ahead, P_ahead) = filtered[k], predicted[k + 1]
        found.append(x + np.linalg.solve(P_ahead, slopes[k] @ P).T @ (found[-1] - ahead))
    return np.array(found[::-1])[:, 3:]


@cache
def by_nominal(run: Smoothed, nominal: Nominal, process: float) -> np.ndarray:
    """Velocity (n, 3) of a run with the nominal model as the predictor."""
    return smoothed_velocity(Continuous(nominal.acceleration, STEP), table(run, STEP), process)


def regressors(terms: str, nu: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """(n, m): terms of a manoeuvring model, inputs and a constant."""
    u, v, r = nu.T
    columns = [u, v, r]
    if terms != "linear":
        columns += [a * abs(b) for a in (u, v, r) for b in (u, v, r)] + [u * v, u * r, v * r]
    if terms == "cubic":
        columns += [u**3, v**3, r**3, v * v * r, v * r * r]
    return np.column_stack([*columns, inputs, np.ones_like(u)])


def law(
    runs: Sequence[Smoothed],
    nominal: Nominal,
    inputs: str,
    delay: float,
    terms: str,
    process: float,
    passes: int = 1,
) -> Continuous:
    """A manoeuvring model by ordinary least squares.

    Args:
        runs: to learn from.
        nominal: the first predictor, which also tells the forces of commands.
        inputs: forces or commands.
        delay: of the commands [s].
        terms: of the model.
        process: as of :func:`smoothed_velocity`.
        passes: of smoothing and regression, at the most.
    """
    tables = [table(r, STEP, delay) for r in runs]

    def acceleration(factors: np.ndarray, nu: np.ndarray, given: np.ndarray) -> Any:
        return regressors(terms, nu, nominal.inputs(inputs, nu, given)) @ factors

    def fitted(velocities: Sequence[np.ndarray]) -> Continuous:
        left, right = [], []
        for t, nu in zip(tables, velocities, strict=True):
            nu_dot = np.gradient(nu, STEP, axis=0)
            for known in t.parts:
                p = slice(known.start + 1, known.stop)
                # The mean command of a step acts in its middle: so do these differences of two.
                given = 0.5 * (t.given[p] + t.given[known][:-1])
                left.append(regressors(terms, nu[p], nominal.inputs(inputs, nu[p], given)))
                right.append(nu_dot[p])
        factors = np.linalg.lstsq(np.vstack(left), np.vstack(right), rcond=None)[0]
        return Continuous(partial(acceleration, factors), STEP, delay)

    found = fitted([by_nominal(r, nominal, process) for r in runs])
    for _ in range(passes - 1):
        try:
            found = fitted([smoothed_velocity(found, t, process) for t in tables])
        except np.linalg.LinAlgError:  # a fitted model may run away, as the nominal one does not
            break
    return found


fit = searched("kalman_regression", law, SETTINGS, final=partial(law, passes=2))
