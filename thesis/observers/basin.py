"""Measured runs of the real ship, and a reference to hold estimates against.

Of the real ship nobody knows the true velocity. The reference is a smoother that also looks ahead: at
each instant a cubic is fitted to the measured pose within half a second on either side, frozen and lost
samples left out.
"""

from pathlib import Path

import numpy as np

import diagnosis
from diagnosis.runs import body_acceleration, body_velocity, lost, repeated
from fmus.frames import rotate_to_body

from .estimates_replayed import SETTLED, Log, rms

REACH = 0.5  # s to either side that the smoother looks
AHEAD = 0.5  # s of prediction


def read(path: Path) -> dict[str, np.ndarray]:
    """A measured run with the columns that an observer's log has.

    Raises:
        InputError: no file of this kind.
    """
    run = diagnosis.read(path)
    # A command acts from its time to the next: at a sample, the one before has acted.
    columns = [*run.pose.T, *np.roll(run.tau_cmd, 1, axis=0).T]
    names = ("x_m", "y_m", "psi_m", "tau_X", "tau_Y", "tau_N")
    return {"time": run.time - run.time[0]} | {
        f"observer.{name}": column for name, column in zip(names, columns, strict=True)
    }


def valid(log: Log) -> np.ndarray:
    """Where the pose is a new measurement: neither lost nor frozen."""
    pose = np.column_stack([log[f"observer.{name}"] for name in ("x_m", "y_m", "psi_m")])
    gone = lost(pose)
    return ~gone & ~repeated(pose, ~gone)


def local_cubic(values: np.ndarray, good: np.ndarray, h: float) -> tuple[np.ndarray, ...]:
    """Value and first two derivatives of a cubic fitted around each sample to the good ones.

    Args:
        values: (n,), samples at a distance of ``h`` [s].
        good: (n,), which of them count.
        h: sampling period [s].

    Returns:
        Three arrays (n,); NaN where good samples are too few or lie on one side.
    """
    half = round(REACH / h)
    t = np.arange(-half, half + 1) * h / REACH
    kernel = (1.0 - np.abs(t) ** 3) ** 3 + 1e-9
    filled = np.where(good, values, 0.0)

    def around(x: np.ndarray, power: int) -> np.ndarray:
        return np.convolve(x, (kernel * t**power)[::-1], "same")

    moments = [around(good, k) for k in range(7)]
    matrix = np.array([[moments[i + j] for j in range(4)] for i in range(4)]).transpose(2, 0, 1)
    right = np.array([around(filled, k) for k in range(4)]).T[:, :, None]
    enough = np.convolve(good, np.ones(2 * half + 1), "same") >= 0.6 * (2 * half + 1)
    found = np.full((values.size, 4), np.nan)
    found[enough] = np.linalg.solve(matrix[enough], right[enough])[:, :, 0]
    return found[:, 0], found[:, 1] / REACH, 2.0 * found[:, 2] / REACH**2


def reference(log: Log) -> dict[str, np.ndarray]:
    """Smoothed body-fixed velocity and acceleration, by the names of an observer's signals."""
    good = valid(log)
    h = float(np.median(np.diff(log["time"])))
    psi = log["observer.psi_m"].copy()
    psi[good] = np.unwrap(psi[good])
    each = [local_cubic(x, good, h) for x in (log["observer.x_m"], log["observer.y_m"], psi)]
    eta, eta_dot, eta_ddot = (np.column_stack(x) for x in zip(*each, strict=True))
    nu = body_velocity(eta[:, 2], eta_dot)
    nu_dot = body_acceleration(eta[:, 2], nu, eta_ddot)
    names = ("u", "v", "r", "u_dot", "v_dot", "r_dot")
    return dict(zip(names, [*nu.T, *nu_dot.T], strict=True))


def prediction_error(log: Log, estimate: Log, seconds: float) -> float:
    """Median distance [m] of a measured position from where nu_hat and its derivative said it would be.

    Args:
        log: measured run.
        estimate: of an observer.
        seconds: how far ahead; the velocity changes as the acceleration says.
    """
    h = float(np.median(np.diff(log["time"])))
    k = max(1, round(seconds / h))
    ahead, aside = 0.0, 0.0
    psi = estimate["psi_hat"][:-k]
    for step in range(k):
        t = (step + 0.5) * h
        u = estimate["u"][:-k] + t * estimate["u_dot"][:-k]
        v = estimate["v"][:-k] + t * estimate["v_dot"][:-k]
        turn = estimate["r"][:-k] * t
        du, dv = rotate_to_body(-turn, u, v)
        ahead, aside = ahead + h * du, aside + h * dv
    dx, dy = rotate_to_body(-psi, ahead, aside)
    good = valid(log)[k:] & valid(log)[:-k] & (log["time"][:-k] >= SETTLED)
    distance = np.hypot(
        log["observer.x_m"][k:] - estimate["x_hat"][:-k] - dx,
        log["observer.y_m"][k:] - estimate["y_hat"][:-k] - dy,
    )[good]
    return float(np.median(distance))


def measures(log: Log, estimate: Log) -> dict[str, float]:
    """How far an observer is from the reference, and how well it predicts."""
    smooth, h = reference(log), float(np.median(np.diff(log["time"])))
    found = {}
    for name, values in smooth.items():
        known = np.isfinite(values) & (log["time"] >= SETTLED)
        difference = np.abs(estimate[name] - values)[known]
        found[f"median_{name}"] = float(np.median(difference))
        found[f"rms_{name}"] = rms(difference)
    found["one_sample"] = prediction_error(log, estimate, h)
    found["half_second"] = prediction_error(log, estimate, AHEAD)
    return found
