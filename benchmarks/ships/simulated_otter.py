"""Runs of the Otter by the simulator of the model's author (T. I. Fossen), in six degrees of freedom.

Nothing of this project is in them but the orders of the propellers and the noise.
"""

from collections.abc import Callable, Iterator
from math import degrees, pi, radians
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from cosim import InputError
from fmus.ops import wrap

# The model of this commit is the one that ships/otter.toml describes. A later one has a linear sway
# damping, other propellers and the Munk moment, and takes the direction of the current in degrees.
INSTALLED_BY = (
    "pip install git+https://github.com/cybergalactic/PythonVehicleSimulator"
    "@21cae21185ca51972e96949ae84cbdd6a2d1a11e"
)
LAG = 1.0  # s, of the propellers
STEP = 0.02  # s, of the simulator's method of Euler
EACH = 5  # steps of it are one sample
LENGTH = 120.0  # s, of a run
CURRENT = 0.25, radians(60.0)  # m/s, and where it flows to, clockwise from north: the hidden effect
NOISE = 0.02, radians(0.3)  # m, rad: of a satellite receiver with corrections, and of a compass
SEED = 20261129
WHAT = (
    f"in a current of {CURRENT[0]:g} m/s to {degrees(CURRENT[1]):.0f}° that the model does not have; "
    f"noise of {NOISE[0]:g} m and {degrees(NOISE[1]):.1g}°"
)

Orders = Callable[[float, float], tuple[float, float]]  # of time [s], heading [rad]: shaft speeds [rps]


class ZigZag:
    """Zig-zag: the propellers change their difference where the heading passes an angle.

    Args:
        n: shaft speed [rps].
        difference: of one propeller to that [rps].
        angle: of the heading [rad].
    """

    def __init__(self, n: float, difference: float, angle: float) -> None:
        self.n, self.difference, self.angle, self.side = n, difference, angle, 1.0

    def __call__(self, time: float, psi: float) -> tuple[float, float]:
        if self.side * psi > self.angle:
            self.side = -self.side
        turn = self.side * self.difference
        return self.n + turn, self.n - turn


class Steps(NamedTuple):
    """Orders of both propellers [rps], each for as long as the others."""

    orders: tuple[tuple[float, float], ...]

    def __call__(self, time: float, psi: float) -> tuple[float, float]:
        return self.orders[min(int(time / LENGTH * len(self.orders)), len(self.orders) - 1)]


def manoeuvres() -> Iterator[tuple[str, Orders]]:
    """Name and orders of each run."""
    for n in (6.0, 10.0, 13.0):
        yield f"zigzag_{n:.0f}", ZigZag(n, 3.0, radians(20.0))
    yield "turn_port", Steps(((10.0, 10.0), (7.0, 11.0), (5.0, 12.0)))
    yield "turn_starboard", Steps(((8.0, 8.0), (10.0, 7.0), (12.0, 3.0)))
    yield "stop", Steps(((12.0, 12.0), (-8.0, -8.0), (9.0, 9.0), (-6.0, -10.0), (0.0, 0.0)))
    draw = np.random.default_rng(SEED)
    for k in range(3):
        steps = draw.uniform(-4.0, 13.0, (12, 1)) + draw.uniform(-3.0, 3.0, (12, 2))
        yield f"random_{k + 1}", Steps(tuple((float(a), float(b)) for a, b in steps))


def simulated() -> Iterator[tuple[str, pd.DataFrame]]:
    """Name and log of each run: signals of the ship file in SI units, the pose with noise.

    Raises:
        ModuleNotFoundError: the simulator is not installed.
        InputError: it is another version.
    """
    try:
        from python_vehicle_simulator.vehicles import otter
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"{error}; {INSTALLED_BY}", name=error.name) from None
    for k, (name, orders) in enumerate(manoeuvres()):
        ship = otter(V_current=CURRENT[0], beta_current=CURRENT[1])
        if (ship.beta_c, ship.T_n) != (CURRENT[1], LAG):
            raise InputError(f"the model of the Otter is of another version; {INSTALLED_BY}")
        eta, nu, n = np.zeros(6), np.zeros(6), np.zeros(2)
        rows = []
        for i in range(round(LENGTH / STEP)):
            order = orders(i * STEP, eta[5])
            if i % EACH == 0:
                rows.append((i * STEP, *eta[[0, 1, 5]], *order))
            nu, n = ship.dynamics(eta, nu, n, 2.0 * pi * np.array(order), STEP)
            turn = Rotation.from_euler("ZYX", eta[[5, 4, 3]])
            eta[:3] += STEP * turn.apply(nu[:3])
            attitude = (turn * Rotation.from_rotvec(STEP * nu[3:])).as_euler("ZYX")[::-1]
            eta[3:5] = attitude[:2]
            eta[5] += wrap(attitude[2] - eta[5])
        log = pd.DataFrame(rows, columns=["time", "x", "y", "psi", "port.n", "starboard.n"])
        noise = np.random.default_rng([SEED, k])
        log[["x", "y"]] += noise.normal(0.0, NOISE[0], (len(log), 2))
        log["psi"] += noise.normal(0.0, NOISE[1], len(log))
        yield name, log
