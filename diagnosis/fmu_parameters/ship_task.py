"""The FMU of a ship, and the windows in which its predictions are compared with measured poses."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.fmu import ConfinedFmu

from ..execution.progress import Advance
from ..predictors import Execution, Fmu, WeakWindows
from ..predictors.black_box import MOTION, POSE, TAU, VELOCITY, at_samples
from ..predictors.fmu.foreign_fmu import FmuPredictor
from ..predictors.fmu.variable_map import BESIDE, DISTURBANCES
from ..predictors.shooting import INSTANTS, PARTS
from ..predictors.windows import step_of, usable_windows
from ..runs import QUANTITY, Smoothed
from ..runs.columns.unit_check import SI_UNIT
from ..runs.sensors.evidence import FEWEST
from .additional_force import AdditionalForce, EarthDirection
from .calibration_task import CalibrationTask
from .force_search import candidates
from .measured_system import Window
from .parameter_file import CalibratedParameter, chosen_parameters

# Angle [rad] from the heading to that whose cosine is the part of a force on surge and sway.
EARTH = {"F_n": {"tau_X": 0.0, "tau_Y": np.pi / 2}, "F_e": {"tau_X": -np.pi / 2, "tau_Y": 0.0}}


class ShipTask(CalibrationTask):
    """An FMU of a ship, and measured runs.

    Args:
        predictor: how the FMU and its map are read for these runs.
        parameters, notes: see :class:`.calibration_task.CalibrationTask`.
        runs: use -> runs.
    """

    names, angles = POSE, (POSE.index("psi"),)
    units = tuple(SI_UNIT[QUANTITY[s]] for s in POSE)

    def __init__(
        self,
        predictor: FmuPredictor,
        parameters: list[CalibratedParameter],
        notes: list[str],
        runs: Mapping[str, Sequence[WeakWindows]],
    ) -> None:
        super().__init__(parameters, notes)
        self.predictor, self.runs, stated = predictor, runs, predictor.map.stated
        self.content = predictor.given.content()
        self.use = {w.run.name: use for use, every in runs.items() for w in every}
        self.driven = predictor.processes.inputs
        given = {**stated("inputs"), **stated(DISTURBANCES)}
        self.forces_on = [c.name for s, c in given.items() if s in BESIDE]
        self.outputs = [stated("outputs")[s].name for s in MOTION if s in stated("outputs")]
        lines = [predictor.lines["outputs"][s] for s in POSE]
        self.lines = np.array([[line.gain for line in lines], [line.offset for line in lines]])

    @cached_property
    def confined(self) -> ConfinedFmu:
        return self.predictor.confined

    @property
    def usual(self) -> dict[str, float]:
        """Of each of these inputs a usual size: that of its commands, else of the ship's full force."""
        stated, found = self.predictor.map, {}
        for group in (DISTURBANCES, "inputs"):
            for s, c in stated.stated(group).items():
                if s in TAU:
                    k = TAU.index(s)
                    every = np.concatenate([w.run.tau_cmd[:, k] for w in self.runs["train"]])
                    size = float(np.sqrt(np.mean(every**2)))
                    size = size or float(self.predictor.ship.ship.scale.forces[k])
                    found[c.name] = size / abs(self.predictor.lines[group][s].gain)
        return dict.fromkeys(self.forces_on, 1.0) | found

    @property
    def possible(self) -> list[AdditionalForce]:
        """Forces that may act in addition: constant in body or earth frame, or of one velocity."""
        stated = self.predictor.map.stated("outputs")
        of_velocity = candidates(self.forces_on, [stated[s].name for s in VELOCITY if s in stated], ())
        return [*of_velocity, *self._earth_forces()]

    def _earth_forces(self) -> Iterator[AdditionalForce]:
        """A force to the north, and one to the east, where the FMU has both inputs and a heading."""
        stated, lines = self.predictor.map, self.predictor.lines
        found = {
            s: (c.name, 1.0 / lines[group][s].gain)
            for group in ("inputs", DISTURBANCES)
            for s, c in stated.stated(group).items()
            if s in EARTH["F_n"]
        }
        if len(found) < len(EARTH["F_n"]) or "psi" not in stated.stated("outputs"):
            return
        heading, line = stated.stated("outputs")["psi"].name, lines["outputs"]["psi"]
        for name, angles in EARTH.items():
            parts = tuple((*found[s], line.offset + angle) for s, angle in angles.items())
            direction = EarthDirection(name, heading, line.gain, parts)
            yield AdditionalForce(parts[0][0], earth=direction)

    def windows(self) -> tuple[dict[str, list[Window]], np.ndarray]:
        windows = {use: [x for w in runs for x in self._windows(w)] for use, runs in self.runs.items()}
        if not windows["train"]:
            names = ", ".join(w.run.name for w in self.runs["train"])
            raise InputError(f"no window of {names} has enough samples")
        return windows, np.median([w.smoothed.noise for w in self.runs["train"]], axis=0)

    def _windows(self, w: WeakWindows) -> list[Window]:
        """Those of a run: of the ship's length from smoothed states, or the whole run."""
        s, p = w.smoothed, self.predictor
        if p.whole:
            length, rows = float(s.time[-1] - s.time[0]), np.array([0])
        else:
            length, rows = w.horizon, usable_windows(s, w.horizon).first_rows
        found = (self._window(s, row, length) for row in rows.tolist())
        return [window for window in found if window is not None]

    def _window(self, s: Smoothed, row: int, length: float) -> Window | None:
        """The window of a run that begins in a row; None: it has too few samples."""
        p, run, begin = self.predictor, s.track.run, s.time[row]
        h = p.fmu.fixed_step or step_of(s)
        since = s.time - begin
        rows = np.flatnonzero((since >= p.run_in(s)) & (since <= length + 1e-9) & s.used)
        if rows.size < FEWEST // 2:
            return None
        if not p.whole:
            rows = rows[:: max(1, rows.size // (INSTANTS * PARTS))]  # as many as steps
        steps = int(np.ceil(since[rows[-1]] / h - 1e-6))
        (course,) = p.requests(s, np.array([row]), h, steps)
        sure = dict(zip(MOTION, [*s.eta_std[row], *s.nu_std[row]], strict=True))
        std = {
            c.name: float(sure[signal]) / abs(p.lines["start"][signal].gain)
            for signal, c in p.map.stated("start").items()
            if signal in sure and not p.whole
        }
        onto = s.eta[rows[0]] if p.placed else None
        return Window(run.name, float(begin), course, since[rows], s.track.pose[rows], std, onto)

    def state_at(self, time: float) -> dict[str, float]:
        """Start values and inputs of the FMU in the smoothed state of the first run at a time [s].

        Raises:
            InputError: there is none then.
        """
        s = self.runs["train"][0].smoothed
        known = np.flatnonzero(np.isfinite(s.nu).all(axis=1))
        row = known[np.argmin(np.abs(s.time[known] - time))]
        if not abs(float(s.time[row]) - time) <= s.track.period:  # a time may be NaN
            raise InputError(f"run '{s.track.run.name}' has no state at {time:g} s")
        at = {n: x[row : row + 1] for n, x in at_samples(s).items()}
        both = {**self.predictor.of_variables("start", at), **self.predictor.of_variables("inputs", at)}
        return {n: float(x[0]) for n, x in both.items()}


def ship_task(
    options: argparse.Namespace,
    paths: Mapping[str, Sequence[Path]],
    advance: Advance,
    execution: Execution,
) -> ShipTask:
    """Read the FMU of a ship, its map, its parameters and measured runs.

    Raises:
        InputError: one of them is not as it should be.
    """
    from ..assessment.gathering import gather
    from ..predictors import ship_with

    craft = ship_with(options.effects, options.ship)
    path = getattr(options, "model", None) or options.fmu
    fmu = Fmu(path, options.map, craft, execution)
    every = [p for each in paths.values() for p in each]
    gathered = gather(every, advance, options.anyway, fmu.start, options.horizon)
    ends = np.cumsum([0, *(len(each) for each in paths.values())])
    runs = {use: gathered[a:b] for use, a, b in zip(paths, ends[:-1], ends[1:], strict=True)}
    predictor = fmu.begun_on(gathered)
    stated = predictor.map
    if not set(POSE) <= stated.stated("outputs").keys():
        raise InputError(f"'{fmu.name}' needs outputs for x, y and psi to calibrate its parameters")
    groups = ("inputs", "outputs", "start", DISTURBANCES)
    mapped = {c.name for g in groups for c in stated.stated(g).values()}
    chosen, notes = chosen_parameters(getattr(options, "parameters", None), fmu.model, mapped)
    if not chosen:
        raise InputError(f"'{fmu.name}' has no parameter that can be calibrated")
    return ShipTask(predictor, chosen, notes, runs)
