"""The basin trials of chapter 6 in simulation: their scenarios, and what is kept of a run."""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import NamedTuple

import numpy as np
from scipy import signal

from cosim.dispatch import FinishedRun
from cosim.scenario import Roles
from fmus.declare import packer, variables

from ..analysis import model_error
from ..monte_carlo import Content, shipped, vary
from ..tracking.outcome import AXES, SETTLED, inside, quick, rms
from . import sysid4

RBS, ABS = "controller_bs", "controller_abs"
CLZ, CLE = "controller_cl_win_z2", "controller_cl_win_eps"
CONTROLLERS = (RBS, ABS, CLZ, CLE)
LABELS = {RBS: "RBS", ABS: "ABS", CLZ: "CLZ", CLE: "CLE"}

# Tables 5.1 and 6.4: diagonals of K_p and K_d.
AXIS_NAMES: tuple[str, ...] = ("p_x", "p_y", "p_psi", "d_u", "d_v", "d_r")
SOFT: dict[str, float] = dict(zip(AXIS_NAMES, (0.4, 1.0, 0.2, 1.0, 5.0, 1.0), strict=True))
HARD: dict[str, float] = dict(zip(AXIS_NAMES, (0.2, 0.6, 0.2, 3.0, 6.0, 3.0), strict=True))

# A marker taken for its neighbour once a minute; its velocity is a spike like those of Fig. 6.8.
POSE = ["observer.x_m", "observer.y_m", "observer.psi_m"]
SPIKES = {"kind": "spikes", "signals": POSE, "size": [0.1, 0.1, 0.1], "rate": 1.0 / 60.0}
MOTION = [f"vessel.{name}" for name in ("u", "v", "r", "u_dot", "v_dot", "r_dot")]
Z1 = [f"controller.z1_{n}" for n in ("x", "y", "psi")]
LOGGED = [*dict.fromkeys([*Roles().columns[1:], *Z1, *MOTION])]
LOST = 2.0  # m; the target is then on the other side of the path
TINY = 1e-12  # N² and (N m)²; mean square of a model error that is none, far below the noise's
SLOW = 0.1  # Hz, edge of what counts as swing; harmonics of the path lie above it as well; chosen


class Trial(NamedTuple):
    """A path at a speed setting [m/s], two rounds of the ellipse or one of the eight [s]."""

    path: str
    u_t: float
    seconds: float

    @property
    def name(self) -> str:
        return f"{self.path} {self.u_t:g}"


TRIALS = (
    Trial("ellipse", 0.08, 198.0),
    Trial("eight", 0.16, 422.0),
    Trial("ellipse", 0.16, 99.0),
    Trial("eight", 0.32, 211.0),
)


def gains(values: Mapping[str, float], factor: float = 1.0) -> dict[str, float]:
    """The gains as parameters of a scenario."""
    return {f"controller.K_{name}": factor * x for name, x in values.items()}


def scenario(
    trial: Trial,
    controller: str,
    faulty: bool = False,
    spikes: bool = True,
    parameters: Mapping[str, float] | None = None,
    plant: Mapping[str, float] | None = None,
) -> Content:
    """A trial with something hidden in the plant and the gains of Table 6.4.

    Args:
        trial: path and true speed of the target.
        controller: name of its FMU.
        faulty: guidance is set to a quarter of the speed and called four times as often.
        spikes: whether the pose has spikes, beside the noise and freezes of the shipped scenario.
        parameters: further ``instance.parameter`` -> value; they win.
        plant: what is hidden, ``instance.parameter`` -> value; SYSID4 by default.
    """
    base = shipped(trial.path)
    calls = 4.0 if faulty else 1.0
    hidden = sysid4.parameters() if plant is None else dict(plant)
    return vary(
        base,
        {"controller": f"{controller}.fmu"},
        hidden
        | gains(HARD)
        | {"guidance.u_t": trial.u_t / calls, "guidance.calls": calls}
        | dict(parameters or {}),
        stop=trial.seconds,
        faults=base["faults"] + ([SPIKES] if spikes else []),
        metrics={"from": min(SETTLED, 0.5 * trial.seconds)},
        log={"signals": LOGGED, "every": 2},
    )


@cache
def path_swing(trial: Trial, step: float = 0.02) -> float:
    """Yaw rate faster than SLOW that the path itself asks for, as ``swing`` of a run [rad/s]."""
    given = shipped(trial.path)["fmus"]["guidance"].get("parameters", {}) | {"u_t": trial.u_t}
    guide = import_module(f"fmus.guidance.{trial.path}").COMPONENT
    p = packer(guide.params)([given.get(v.name, v.start) for v in variables(guide.params)])
    i = packer(guide.inputs)([v.start for v in variables(guide.inputs)])
    state, target = guide.step(guide.init(i, p), i, p, 0.0)
    rates = [target.psi_t_dot]
    for _ in range(round(trial.seconds / step)):
        state, target = guide.step(state, i, p, step)
        rates.append(target.psi_t_dot)
    settled = step * np.arange(len(rates)) >= min(SETTLED, 0.5 * trial.seconds)
    return rms(quick(np.array(rates), step, SLOW)[settled])


class Sailed(NamedTuple):
    """Numbers of one run; from 20 s on where nothing else is said.

    Attributes:
        lost: 1 where the run broke off or the ship fell back by more than LOST, else 0.
        position: distance to the target, RMS over the second half [m].
        cross_track, heading: RMS of e [m] and of the heading error [rad].
        first, lag: z1_x [m], by the observer, mean over the first and the second half.
        along: part of the distance to the target along the ship, RMS over the second half [m].
        inside: how far inside of the path the ship is, mean over the second half [m].
        omega_X: model error in surge, (7.7) with the force after clipping, mean magnitude [N].
        omega_Y: the same in sway, mean [N]; positive pushes to starboard.
        omega_hat_X: its estimate, largest magnitude [N].
        iae, work, iaew, iaewwt: metrics of 4.4.
        swing: true yaw rate faster than 0.1 Hz, that of the path included, RMS [rad/s].
        frequency: where the spectrum of that is highest [Hz].
        bias: e of the true pose, mean over the second half [m].
        z1_y: the same by the observer, in the ship's axes [m].
        known_Y, known_N: share of the mean square of the model error that its estimate explains,
            below 0 where it makes the error larger [1].
    """

    lost: float
    position: float
    cross_track: float
    heading: float
    first: float
    lag: float
    along: float
    inside: float
    omega_X: float
    omega_Y: float
    omega_hat_X: float
    iae: float
    work: float
    iaew: float
    iaewwt: float
    swing: float
    frequency: float
    bias: float
    z1_y: float
    known_Y: float
    known_N: float


BROKEN = Sailed(1.0, *[float("nan")] * 20)


def sailed(run: FinishedRun) -> Sailed:
    """The numbers of a run; those of one that broke off are NaN."""
    if run.status == "failed":
        return BROKEN
    log = run.log
    t = log["time"]
    settled, half = t >= min(SETTLED, 0.5 * t[-1]), t >= 0.5 * t[-1]
    m, z1_x, h = run.metrics, log["controller.z1_x"], t[1] - t[0]
    north, east = (log[f"vessel.{a}"] - log[f"guidance.{a}_t"] for a in "xy")
    distance, psi = np.hypot(north, east), log["vessel.psi"]
    swing = quick(log["vessel.r"], h, SLOW)[settled]
    # Of the control model, whatever parameters the plant has; omega_star of the vessel is of its own.
    motion = np.column_stack([log[name] for name in MOTION])[settled]
    tau = np.column_stack([log[f"thrusters.tau_cmd_{a}"] for a in AXES])[settled]
    omega = model_error(motion[:, :3], motion[:, 3:], tau)
    estimate = np.column_stack([log[f"controller.omega_hat_{a}"] for a in AXES])[settled]
    left, all_of_it = (np.square(x).mean(axis=0) for x in (omega - estimate, omega))
    known = 1.0 - left / np.maximum(all_of_it, TINY)
    psi_t = log["guidance.psi_t"]
    frequencies, power = signal.periodogram(swing, 1.0 / h)
    return Sailed(
        lost=float(distance[half].max() > LOST),
        position=rms(distance[half]),
        cross_track=m["cross_track_rms"],
        heading=m["heading_rms"],
        first=float(z1_x[settled & ~half].mean()) if (settled & ~half).any() else float("nan"),
        lag=float(z1_x[half].mean()),
        along=rms((np.cos(psi) * north + np.sin(psi) * east)[half]),
        inside=inside(log, half),
        omega_X=float(np.abs(omega[:, 0]).mean()),
        omega_Y=float(omega[:, 1].mean()),
        omega_hat_X=float(np.abs(log["controller.omega_hat_X"]).max()),
        iae=m["IAE"],
        work=m["W"],
        iaew=m["IAEW"],
        iaewwt=m["IAEWWT"],
        swing=rms(swing),
        frequency=float(frequencies[power.argmax()]),
        bias=float((np.cos(psi_t) * east - np.sin(psi_t) * north)[half].mean()),
        z1_y=float(log["controller.z1_y"][half].mean()),
        known_Y=float(known[1]),
        known_N=float(known[2]),
    )
