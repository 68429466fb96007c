"""Other ways to read a measurement: axes that point elsewhere, other units, clocks, columns."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.declare import variables

from ..predictors import Model, WeakWindows, omega
from ..predictors.thrust import full_thrust
from ..runs import Run
from ..runs.columns.columns import POSE, TAU, UNITS
from ..runs.columns.side_car import ColumnChange


@dataclass(frozen=True, eq=False)
class Reading:
    """Another way to read a file.

    Attributes:
        mistake: what is wrong if it is right, as a clause.
        changes: signal -> what its column should be read as.
        motion: (3, 3), from the pose as it was read to the pose as it was meant.
        commands: (3, 3), the same of the commanded force.
        turn: what is added to the heading [rad].
        pace: of the clock, seconds meant for a second read.
        force: (n, 3), commanded force at rest where actuators' own commands are others; None: as read.
    """

    mistake: str
    changes: Mapping[str, ColumnChange] = field(default_factory=dict)
    motion: np.ndarray = field(default_factory=lambda: np.eye(3))
    commands: np.ndarray = field(default_factory=lambda: np.eye(3))
    turn: float = 0.0
    pace: float = 1.0
    force: np.ndarray | None = None

    @property
    def still(self) -> bool:
        """Whether the motion is as it was read."""
        return np.array_equal(self.motion, np.eye(3)) and self.turn == 0.0 and self.pace == 1.0


AS_READ = Reading("nothing")


def of_pose(mistake: str, factors: Sequence[float]) -> Reading:
    """A pose with factors (3,) on its channels."""
    return Reading(mistake, _scaled(POSE, factors), motion=np.diag(factors))


def of_commands(mistake: str, factors: Sequence[float]) -> Reading:
    """A commanded force with factors (3,)."""
    return Reading(mistake, _scaled(TAU, factors), commands=np.diag(factors))


def _scaled(signals: Sequence[str], factors: Sequence[float]) -> dict[str, ColumnChange]:
    pairs = zip(signals, factors, strict=True)
    return {s: ColumnChange(s, np.sign(f), abs(f)) for s, f in pairs if f != 1.0}


def swapped(signals: Sequence[str], i: int, k: int) -> Reading:
    """Two columns of the pose or of the commands in each other's place."""
    order = np.eye(3)
    order[[i, k]] = order[[k, i]]
    pair = signals[i], signals[k]
    changes = {a: ColumnChange(b) for a, b in (pair, pair[::-1])}
    motion, commands = (order, np.eye(3)) if signals is POSE else (np.eye(3), order)
    return Reading(f"{pair[0]} and {pair[1]} are swapped", changes, motion, commands)


def directions(run: Run, model: Model) -> Iterator[Reading]:
    """Readings in which axes point elsewhere, columns are swapped, or the heading is in degrees."""
    yield of_pose("its heading is mirrored (clockwise is positive here)", (1.0, 1.0, -1.0))
    yield of_pose("y points west (east is positive here)", (1.0, -1.0, 1.0))
    yield of_pose("x points south (north is positive here)", (-1.0, 1.0, 1.0))
    yield of_pose(
        "y points west and its heading is mirrored, as in axes east and north", (1.0, -1.0, -1.0)
    )
    yield swapped(POSE, 0, 1)
    yield of_pose("its heading is in degrees", (1.0, 1.0, np.pi / 180.0))
    wrong = "its commands have the wrong sign"
    if run.commands is None:
        yield of_commands(wrong, (-1.0, -1.0, -1.0))
        for k, name in enumerate(TAU):
            yield of_commands(f"{name} has the wrong sign", (1.0 - 2.0 * np.eye(3)[k]).tolist())
        yield from (swapped(TAU, *pair) for pair in ((0, 1), (0, 2), (1, 2)))
    else:
        unit = model.ship.commands  # a force turns round with its thrust, at the same angle
        thrusts = [s for s in run.signals if unit.get(s) != "rad"]
        changes = {s: ColumnChange(s, -1.0) for s in thrusts or run.signals}
        yield Reading(wrong, changes, commands=-np.eye(3))


def units(run: Run, model: Model) -> Iterator[Reading]:
    """Readings in which the pose or the commands are in other units, or percent of the full thrust."""
    for unit, m in UNITS["length"].items():
        for name, factors in (("its position", (m, m, 1.0)), ("x", (m, 1.0, 1.0)), ("y", (1.0, m, 1.0))):
            yield of_pose(f"{name} is in {unit}", factors)
    half = ColumnChange("psi", offset=np.pi)
    yield Reading("its heading is off by 180 deg", {"psi": half}, turn=np.pi)
    if run.commands is not None:
        yield from _shares(run, run.commands, model)
        return
    forces, moments = UNITS["force"], UNITS["moment"]
    percent = (0.01 * full_thrust(model)).tolist()
    yield of_commands("its commands are in percent of the full thrust", percent)
    yield from (of_commands(f"tau_N is in {u}", (1.0, 1.0, moments[u])) for u in moments if u != "N.m")
    for unit, moment in (("mN", "N.mm"), ("kN", "kN.m")):
        f = forces[unit]
        yield of_commands(f"its commands are in {unit} and {moment}", (f, f, f))
        yield of_commands(f"tau_X and tau_Y are in {unit}", (f, f, 1.0))
        yield of_commands(f"tau_X is in {unit}", (f, 1.0, 1.0))
        yield of_commands(f"tau_Y is in {unit}", (1.0, f, 1.0))


def _shares(run: Run, commands: np.ndarray, model: Model) -> Iterator[Reading]:
    """Readings in which commands that no share is a unit of are shares of their limits, or percent."""
    limits = np.abs(model.ship.layout_of(commands).limits(model.drive.params)).max(axis=1)
    for whole, name in ((1.0, "shares"), (100.0, "percent")):
        meant = (np.abs(commands).max(axis=0) <= whole) & (limits > 1.0)
        factor = np.where(meant, limits / whole, 1.0)
        changes = _scaled(run.signals, factor.tolist())
        if changes:
            force = model.ship.commanded_force(commands * factor)
            yield Reading(f"{' and '.join(changes)} are {name} of their limits", changes, force=force)


def other_factors(run: Run, k: float) -> Iterator[Reading]:
    """Readings in a unit without a name, or of another clock: the ship accelerates k times too much."""
    yield of_pose(f"its position is in units of {1.0 / k:.3g} m", (1.0 / k, 1.0 / k, 1.0))
    if run.commands is None:
        yield of_commands(f"its commands are in units of {k:.3g} N and N m", (k, k, k))
    clock = {"time": ColumnChange("time", factor=k**0.5)}
    yield Reading(f"{k**0.5:.3g} s passed in each second of its time", clock, pace=k**0.5)


def reread(w: WeakWindows, reading: Reading) -> WeakWindows:
    """The windows of a run by another reading, its commands as forces."""
    s, run = w.smoothed, w.run
    force = run.tau_cmd if reading.force is None else reading.force
    given = replace(run, tau_cmd=force @ reading.commands.T, commands=None, power=None)
    meant = replace(
        s,
        track=replace(s.track, run=given),
        eta=s.eta @ reading.motion.T + [0.0, 0.0, reading.turn],
        eta_dot=s.eta_dot @ reading.motion.T / reading.pace,
    )
    return replace(w, smoothed=meant, slope=w.slope / reading.pace, memory={})


def needed(w: WeakWindows, model: Model) -> np.ndarray:
    """Force (K, 3) that the motion of a run needs by a model's inertia and hull [N, N, N m]."""
    idle = reread(w, Reading("", force=0.0 * w.run.tau_cmd))
    with np.errstate(all="ignore"):  # in a wrong unit forces may be beyond all numbers
        return np.nan_to_num(omega(idle, model), posinf=0.0, neginf=0.0)


def inertial(w: WeakWindows, model: Model) -> np.ndarray:
    """The part (K, 3) of it that is not damping: M nu_dot + C nu [N, N, N m]."""
    none = {v.name: 0.0 for v in variables(type(model.hull.params.damping))}
    return needed(w, replace(model, vessel=dict(model.vessel) | none))
