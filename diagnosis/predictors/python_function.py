"""A Python function as a predictor of measured runs: accelerations of a ship by its state and commands.

A file holds ``acceleration``, such as ::

    def acceleration(state, commands):
        u_dot = (commands["tau_X"] - 2.0 * abs(state.u) * state.u) / 16.0
        r_dot = (commands["tau_N"] - 0.5 * state.r) / 3.0
        return u_dot, 0.0, r_dot

``state`` has x, y [m], psi [rad] north, east and clockwise, u, v [m/s], r [rad/s] of the body over
ground, each an array (n,) of independent states. ``commands`` has ``tau_X``, ``tau_Y`` [N], ``tau_N``
[N m], and each command of the run by its name, in SI; arrays (n,) as well. The function returns u_dot,
v_dot [m/s2] and r_dot [rad/s2] of the body, each an array (n,) or a number.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from cosim import InputError
from fmus.ship import Ship
from fmus.vessel import vessel

from ..execution.progress import Advance, silent
from ..execution.user_files import from_file, takes
from ..runs import Smoothed
from .black_box import MOTION, TAU, BlackBox, Signals, commands_at
from .described_ship import nominal
from .ship_model import Model
from .weak_form import WeakWindows

NAME = "acceleration"
Acceleration = Callable[[vessel.State, Mapping[str, np.ndarray]], tuple[Any, Any, Any]]


class PythonFunction:
    """A function as a model, see :class:`.predictor.ModelSource`.

    Args:
        function: gives accelerations, see above.
        ship: that it is a model of; None: that of the runs.
        file: that it comes from.
    """

    parametric = False

    def __init__(
        self, function: Acceleration, ship: Ship | None = None, file: Path | None = None
    ) -> None:
        self.function, self.file = function, file
        self.start = None if ship is None else Model(ship=ship)

    @property
    def name(self) -> str:
        return getattr(self.function, "__name__", NAME) if self.file is None else self.file.name

    def on(self, runs: Sequence[WeakWindows], advance: Advance = silent) -> "FunctionPredictor":
        return FunctionPredictor(self, runs, self.start or nominal(runs))


class FunctionPredictor(BlackBox):
    """How a Python function predicts some runs."""

    kind = "Python function"

    def __init__(self, source: PythonFunction, runs: Sequence[WeakWindows], ship: Model) -> None:
        super().__init__(source.name, runs, ship)
        self.source, self.inputs = source, frozenset(TAU)
        self.files: list[tuple[str, Path, str]] = []
        if source.file is not None:
            self.sha256 = hashlib.sha256(source.file.read_bytes()).hexdigest()
            self.files = [("model", source.file, self.sha256)]

    def motion(self, smoothed: Smoothed, rows: np.ndarray, h: float, steps: int) -> np.ndarray:
        """By the classical Runge-Kutta method, the command constant within a step."""
        begin = np.hstack([smoothed.eta[rows], smoothed.nu[rows]]).T
        state = vessel.State._make([*begin, smoothed.time[rows]])
        found = [begin]
        with np.errstate(all="ignore"):  # a model that runs away gives infinities, which count
            for _ in range(steps):
                commands: Any = commands_at(smoothed.track.run, state.t + 0.5 * h)
                state = vessel.integrate(state, commands, self, h, lambda s, c, by: by.answer(s, c))
                found.append(np.stack(state[:6]))
        return np.stack(found)

    def accelerations(self, signals: Signals) -> np.ndarray:
        none = np.zeros(next(iter(signals.values())).shape)
        state = vessel.State._make([*(signals[name] for name in MOTION), none])
        found = np.column_stack(self.answer(state, signals))
        sound = np.isfinite(np.column_stack([signals[name] for name in (*MOTION, *TAU)])).all(axis=1)
        if (wrong := sound & ~np.isfinite(found).all(axis=1)).any():
            k = int(np.argmax(wrong))
            at = ", ".join(f"{name} = {signals[name][k]:.4g}" for name in ("u", "v", "r"))
            stated = ", ".join(f"{x:g}" for x in found[k])
            raise InputError(f"'{self.name}' gives the accelerations {stated} in a measured state: {at}")
        return found

    def answer(self, state: vessel.State, commands: Signals) -> list[np.ndarray]:
        """What the function returns, three arrays (n,).

        Raises:
            InputError: the function fails, or returns anything else.
        """
        try:
            stated = self.source.function(state, commands)
            found = [np.broadcast_to(np.asarray(x, float), state.u.shape) for x in stated]
        except Exception as error:
            raise InputError(f"'{self.name}' fails: {error!r}") from error
        if len(found) != 3:
            raise InputError(f"'{self.name}' must return u_dot, v_dot, r_dot; got {len(found)} values")
        return found


def open_function(path: Path, ship: Ship | None) -> PythonFunction:
    """The function ``acceleration`` of a file, see :func:`.predictor.open_model`.

    Raises:
        InputError: no such file or function, or the file fails.
    """
    function = from_file(path, NAME, "a model")
    if not takes(function, 2):
        raise InputError(f"'{path}' has no function {NAME}(state, commands)")
    return PythonFunction(cast(Acceleration, function), ship, path)
