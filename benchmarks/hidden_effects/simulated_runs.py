"""One run: the ship in closed loop with an effect hidden in it, and the measurement of it.

240 s at 50 Hz. Noise, freezes of up to 1 s and spikes are on the pose that the controller gets, too.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from diagnosis import Run

from .manoeuvres import Manoeuvre

STEP, STOP = 0.02, 240.0  # s
FINE = 0.005  # s, step of ships that are integrated otherwise
NOISE = {"n1": 1.0, "n4": 4.0, "n10": 10.0}
POSITION, HEADING = 5e-4, np.radians(0.05)  # m, rad; standard deviation at n1
SETTLED = 20.0  # s until the ship is on its path
FAR = 5.0  # m; a ship that is further from its target then has run away

MEASURED = ["observer.x_m", "observer.y_m", "observer.psi_m"]
COMMANDS = ["thrusters.tau_cmd_X", "thrusters.tau_cmd_Y", "thrusters.tau_cmd_N"]
SHIP = [f"vessel.{n}" for n in ("x", "y", "psi", "u", "v", "r", "u_dot", "v_dot", "r_dot")]
FORCE = [f"thrusters.tau_act_{a}" for a in "XYN"]
OMEGA = [f"vessel.omega_{a}" for a in "XYN"]
TARGET = ["guidance.x_t", "guidance.y_t"]
OTHER = ("other_vessel", "other_thrusters")

CONNECTIONS = [
    ["vessel.*", "observer.*"],
    ["thrusters.tau_cmd_*", "observer.tau_*"],
    ["observer.*", "controller.*"],
    ["guidance.*", "controller.*"],
    ["controller.tau_*", "thrusters.tau_*"],
    ["vessel.*", "thrusters.*"],
    ["thrusters.tau_act_*", "vessel.tau_*"],
]


class RunawayError(Exception):
    """The ship left its path: the hidden effect is more than the controller can compensate."""


@dataclass(frozen=True)
class Hidden:
    """What the plant has and the diagnosis does not know of.

    Attributes:
        vessel, thrusters: parameters of the FMUs, totals.
        clock: delay of the measured pose [s].
        other: whether ship and thrusters are :mod:`.other_vessel` and :mod:`.other_thrusters`.
    """

    vessel: Mapping[str, float] = field(default_factory=dict)
    thrusters: Mapping[str, float] = field(default_factory=dict)
    clock: float = 0.0
    other: bool = False


@dataclass(frozen=True, eq=False)
class Voyage:
    """A run and its truth.

    Attributes:
        measured: all that the diagnosis gets.
        eta, nu, nu_dot: (n, 3), true pose, velocity and acceleration.
        tau: (n, 3), force of the thrusters from each sample to the next [N, N, N m].
        omega: (n, 3), force on the hull that a ship without the vessel's effects lacks [N, N, N m].
    """

    measured: Run
    eta: np.ndarray
    nu: np.ndarray
    nu_dot: np.ndarray
    tau: np.ndarray
    omega: np.ndarray


def scenario(manoeuvre: Manoeuvre, hidden: Hidden, noise: float, seed: int, fmus: Path) -> dict:
    """Content of the scenario of a run.

    Args:
        manoeuvre: path and speed.
        hidden: what the plant has.
        noise: times that of n1.
        seed: of noise, freezes and spikes.
        fmus: folder of the FMUs.
    """
    std = [noise * POSITION, noise * POSITION, noise * HEADING]
    filtering = {"position_std": std[0], "heading_std": std[2]}
    start = manoeuvre.start | dict(hidden.vessel)
    along = dict(manoeuvre.parameters)
    ship, machine = OTHER if hidden.other else ("vessel", "thrusters")
    every = {"step": STEP} if hidden.other else {}
    entries = {
        "vessel": {"path": str(fmus / f"{ship}.fmu"), "parameters": start},
        "thrusters": {"path": str(fmus / f"{machine}.fmu"), "parameters": dict(hidden.thrusters)},
        "observer": {"path": str(fmus / "observer_kalman.fmu"), "parameters": filtering} | every,
        "guidance": {"path": str(fmus / f"{manoeuvre.fmu}.fmu"), "parameters": along} | every,
        "controller": {"path": str(fmus / "controller_abs.fmu")} | every,
    }
    faults = [
        {"kind": "noise", "signals": MEASURED, "std": std},
        {"kind": "freeze", "signals": MEASURED, "rate": 0.05, "duration": [0.1, 1.0]},
        {"kind": "spikes", "signals": MEASURED, "rate": 0.02, "size": [0.2, 0.2, 0.3]},
    ]
    if hidden.clock:
        faults.append({"kind": "delay", "signals": MEASURED, "time": hidden.clock})
    logged = [*SHIP, *FORCE, *OMEGA, *MEASURED, *COMMANDS, *TARGET]
    return {
        "name": "hidden",
        "step": FINE if hidden.other else STEP,
        "stop": STOP,
        "seed": seed,
        "fmus": entries,
        "connections": CONNECTIONS,
        "faults": faults,
        "log": {"signals": logged, "every": round(STEP / FINE) if hidden.other else 1},
        "metrics": {},
    }
