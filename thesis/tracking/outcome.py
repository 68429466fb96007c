"""What is kept of a tracking run: errors, model error and its estimate, effort, the store of samples."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import signal
from scipy.spatial import KDTree

from cosim.dispatch import FinishedRun
from fmus.hull import RotationalDamping

Log = Mapping[str, np.ndarray]

AXES = "XYN"
# The model error, its estimate, and what it does to both parts of the requested force (5.1).
LEARNED_FROM = [
    f"{signal}_{a}"
    for signal in (
        "vessel.omega_star",
        "controller.omega_hat",
        "controller.tau_lin",
        "controller.tau_nonlin",
        "thrusters.tau_act",
        "thrusters.tau_cmd",
    )
    for a in AXES
]
# s; the start of a run, which depends on where the ship lay, is left out.
SETTLED = 20.0


class TrackingOutcome(NamedTuple):
    """Numbers of one run; RMS values over the window of its metrics.

    Attributes:
        done: False where the run broke off.
        start: first time of that window [s].
        position: distance to the target [m].
        second: the same over the second half, which is the second lap of the ellipse [m].
        cross_track, heading: errors e [m] and heading [rad].
        surge: mean error along the ship over the second half, z1_x [m].
        omega_X, omega_Y, omega_N: error of the estimated model error (7.7), lost thrust included
            [N, N, N m].
        omega_hat_X: mean estimate of the model error in surge over the second half [N].
        iaew, iaewwt: metrics (4.59), (4.60).
        swing: RMS of the requested yaw moment above 0.5 Hz [N m]: oscillation.
        sigma: smallest singular value of the store at the end [1].
        rank: share of the time with the rank condition met [1].
        sway: RMS of v [m/s].
        signs: mean of the sign of v r, -1 to 1; at both ends |r|v and |v|r are one column.
        bias: mean e over the second half [m]; positive to starboard.
        inside: how far inside of the path the ship is, mean over the second half [m].
        end: position over the last tenth [m].
        linear, nonlinear: norm of both parts of the requested force (5.1) [N, N, N m].
        agree_Y, agree_N: correlation of the estimated model error with the true one, -1 to 1; NaN
            without an estimate.
        phi: estimates of (2.30), mean over the second half; empty without adaptation.
    """

    done: bool
    start: float
    position: float
    second: float
    cross_track: float
    heading: float
    surge: float
    omega_X: float
    omega_Y: float
    omega_N: float
    omega_hat_X: float
    iaew: float
    iaewwt: float
    swing: float
    sigma: float
    rank: float
    sway: float
    signs: float
    bias: float
    inside: float
    end: float
    linear: float
    nonlinear: float
    agree_Y: float
    agree_N: float
    phi: tuple[float, ...] = ()

    @property
    def omega(self) -> float:
        """Error of the estimated force in sway, where the rotational damping acts most [N]."""
        return self.omega_Y


BROKEN = TrackingOutcome(False, *[float("nan")] * 24, phi=())
TRUE_PHI = tuple(RotationalDamping())
PHI = [f"controller.phi_hat_{k + 1}" for k in range(len(TRUE_PHI))]


def rms(x: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def quick(x: np.ndarray, step: float, above: float = 0.5) -> np.ndarray:
    """The part of a signal above a frequency [Hz], without a shift in time."""
    high_pass = signal.butter(4, above, "high", fs=1.0 / step, output="sos")
    return signal.sosfiltfilt(high_pass, x)


def missing(log: Log, axis: str) -> np.ndarray:
    """All that the control model lacks [N, N m], (7.7): the thrust that was commanded and lost is part
    of it, which ``omega_star`` of the vessel does not know of."""
    lost = log[f"thrusters.tau_act_{axis}"] - log[f"thrusters.tau_cmd_{axis}"]
    return log[f"vessel.omega_star_{axis}"] + lost


def inside(log: Log, part: np.ndarray) -> float:
    """Mean distance [m] by which the ship is on the inner side of the curve, from its nearest point."""
    path = np.column_stack([log["guidance.x_t"], log["guidance.y_t"]])
    psi = np.unwrap(log["guidance.psi_t"])
    ship = np.column_stack([log["vessel.x"], log["vessel.y"]])[part]
    _, nearest = KDTree(path).query(ship)
    off = ship - path[nearest]
    aside = -np.sin(psi[nearest]) * off[:, 0] + np.cos(psi[nearest]) * off[:, 1]
    return float(np.mean(aside * np.sign(np.gradient(psi))[nearest]))


def size(log: Log, signals: str, part: np.ndarray) -> float:
    """RMS of the norm of a force, ``signals`` without the axis [N, N, N m]."""
    return rms(np.sqrt(sum(np.square(log[f"{signals}_{a}"][part]) for a in AXES)))


def agreement(log: Log, axis: str, part: np.ndarray) -> float:
    """Correlation of the estimated model error with the true one; NaN where one does not change."""
    pair = [log[f"controller.omega_hat_{axis}"][part], missing(log, axis)[part]]
    return float(np.corrcoef(pair)[0, 1]) if min(np.ptp(x) for x in pair) > 0.0 else float("nan")


def outcome(run: FinishedRun) -> TrackingOutcome:
    """The numbers of a run; those of one that broke off are NaN."""
    if run.status == "failed":
        return BROKEN
    log = run.log
    m = run.metrics
    settled = log["time"] >= m["from"]
    half, end = (log["time"] >= share * log["time"][-1] for share in (0.5, 0.9))
    psi_t = log["guidance.psi_t"]
    wrong = {a: rms((log[f"controller.omega_hat_{a}"] - missing(log, a))[settled]) for a in AXES}
    north, east = (log[f"vessel.{a}"] - log[f"guidance.{a}_t"] for a in "xy")
    distance = np.hypot(north, east)
    learns = "controller.sigma_min" in log
    return TrackingOutcome(
        done=True,
        start=m["from"],
        position=rms(distance[settled]),
        second=rms(distance[half]),
        cross_track=m["cross_track_rms"],
        heading=m["heading_rms"],
        surge=float(log["controller.z1_x"][half].mean()),
        omega_X=wrong["X"],
        omega_Y=wrong["Y"],
        omega_N=wrong["N"],
        omega_hat_X=float(log["controller.omega_hat_X"][half].mean()),
        iaew=m["IAEW"],
        iaewwt=m["IAEWWT"],
        swing=rms(quick(log["controller.tau_N"], log["time"][1] - log["time"][0])[settled]),
        sigma=float(log["controller.sigma_min"][-1]) if learns else float("nan"),
        rank=float(log["controller.rank_met"][settled].mean()) if learns else float("nan"),
        sway=rms(log["vessel.v"][settled]),
        signs=float(np.sign(log["vessel.v"] * log["vessel.r"])[settled].mean()),
        bias=float((np.cos(psi_t) * east - np.sin(psi_t) * north)[half].mean()),
        inside=inside(log, half),
        end=rms(distance[end]),
        linear=size(log, "controller.tau_lin", settled),
        nonlinear=size(log, "controller.tau_nonlin", settled),
        agree_Y=agreement(log, "Y", settled),
        agree_N=agreement(log, "N", settled),
        phi=tuple(float(log[name][half].mean()) for name in PHI if name in log),
    )


def true_states(content: dict[str, Any]) -> dict[str, Any]:
    """The scenario with the ship's true state in place of the observer's estimate, and no faults."""
    state = ("x", "y", "psi", "u", "v", "r", "u_dot", "v_dot", "r_dot")
    true = [[f"vessel.{name}", f"controller.{name}_hat"] for name in state]
    kept = [pair for pair in content["connections"] if pair != ["observer.*", "controller.*"]]
    return {**content, "connections": [*kept, *true], "faults": []}


def columns(outcomes: Sequence[Any], name: str) -> list[float]:
    """One number of every run."""
    return [float(getattr(o, name)) for o in outcomes]
