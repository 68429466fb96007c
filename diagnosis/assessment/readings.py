"""Other ways to read a measurement: axes that point elsewhere, other units, clocks, columns."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from ..predictors import Model, WeakWindows
from ..predictors.thrust import full_thrust
from ..predictors.weak_form import OF_MOTION
from ..runs import Run
from ..runs.columns.columns import OF_UNIT, POSE, QUANTITY, TAU, Named
from ..runs.columns.geographic import is_geographic, metres_in_degree
from ..runs.columns.unit_check import SI_UNIT, STATED, UNITS

# Quantities of commands that are often logged in SI under the name of another unit.
COUNTED = ("angle", "shaft speed")


@dataclass(frozen=True, eq=False)
class Reading:
    """Another way to read a file.

    Attributes:
        mistake: what is wrong if it is right, as a clause.
        changes: signal -> what its column should be read as.
        motion: (3, 3), from the pose as it was read to the pose as it was meant.
        commands: (k, k), the same of the run's commands, or of its commanded force; None: as read.
        added: (k,), what is added to the run's commands then.

    """

    mistake: str
    changes: Mapping[str, Named] = field(default_factory=dict)
    motion: np.ndarray = field(default_factory=lambda: np.eye(3))
    commands: np.ndarray | None = None
    added: np.ndarray = field(default_factory=lambda: np.zeros(1))

    def dead(self, signals: Sequence[str]) -> "Reading | None":
        """The reading without the commands that are meant otherwise; None: all are as they were read.

        Of an angle that counts from elsewhere it is the whole actuator: at zero it may act as meant.
        """
        if self.commands is None:
            return None
        same = (self.commands == np.eye(len(self.commands))).all(axis=1)
        owners = np.array([signal.partition(".")[0] for signal in signals])
        elsewhere = owners[np.broadcast_to(self.added != 0.0, owners.shape)]
        return Reading("", commands=np.diag((same & ~np.isin(owners, elsewhere)).astype(float)))

    @property
    def turn(self) -> float:
        """What is added to the heading [rad]."""
        return self.changes["psi"].offset if "psi" in self.changes else 0.0

    @property
    def pace(self) -> float:
        """Of the clock, seconds meant for a second read."""
        return self.changes["time"].factor if "time" in self.changes else 1.0

    @property
    def density(self) -> float:
        """Logarithm of the density of numbers as they were read over that of those that were meant."""
        return float(np.log(np.abs(np.linalg.det(self.motion)))) - 6.0 * float(np.log(self.pace))


AS_READ = Reading("nothing")


def of_pose(mistake: str, factors: Sequence[float]) -> Reading:
    """A pose with factors (3,) on its channels."""
    return Reading(mistake, _scaled(POSE, factors), motion=np.diag(factors))


def of_commands(mistake: str, factors: Sequence[float], signals: Sequence[str] = TAU) -> Reading:
    """Commands with factors (k,) on their columns."""
    return Reading(mistake, _scaled(signals, factors), commands=np.diag(factors))


def off_by(mistake: str, signal: str, factor: float, offset: float, signals: Sequence[str]) -> Reading:
    """The command of a signal times a factor, plus an offset in SI."""
    mine = np.array([name == signal for name in signals])
    changes = {signal: Named(name=signal, factor=factor, offset=offset)}
    factors = np.where(mine, factor, 1.0)
    return Reading(mistake, changes, commands=np.diag(factors), added=np.where(mine, offset, 0.0))


def _in_unit(unit: str, factors: Sequence[float], signals: Sequence[str]) -> Reading:
    """Those commands in another unit that have a factor (k,)."""
    changed = [*_scaled(signals, factors)]
    return of_commands(
        f"{' and '.join(changed)} {'are' if changed[1:] else 'is'} {unit}", factors, signals
    )


def _scaled(signals: Sequence[str], factors: Sequence[float]) -> dict[str, Named]:
    pairs = zip(signals, factors, strict=True)
    return {s: Named(name=s, factor=f) for s, f in pairs if f != 1.0}


def swapped(signals: Sequence[str], i: int, k: int) -> Reading:
    """Two columns of the pose or of the commands in each other's place."""
    order = np.eye(len(signals))
    order[[i, k]] = order[[k, i]]
    pair = signals[i], signals[k]
    changes = {a: Named(name=b) for a, b in (pair, pair[::-1])}
    mistake = f"{pair[0]} and {pair[1]} are swapped"
    if signals is POSE:
        return Reading(mistake, changes, motion=order)
    return Reading(mistake, changes, commands=order)


def readings(run: Run, model: Model) -> Iterator[Reading]:
    """Ways in which the file of a run may be meant, other than it was read."""
    yield of_pose("its heading is mirrored (clockwise is positive here)", (1.0, 1.0, -1.0))
    yield of_pose("y points west (east is positive here)", (1.0, -1.0, 1.0))
    yield of_pose("x points south (north is positive here)", (-1.0, 1.0, 1.0))
    if _has_unit(run):  # latitude and longitude are to north and east
        yield of_pose(
            "y points west and its heading is mirrored, as in axes east and north", (1.0, -1.0, -1.0)
        )
    yield swapped(POSE, 0, 1) if _has_unit(run) else _exchanged_angles(run)
    from_east = {"psi": Named(name="psi", factor=-1.0, offset=0.5 * np.pi)}
    mirrored = np.diag([1.0, 1.0, -1.0])
    yield Reading("its heading counts from east, counter-clockwise", from_east, motion=mirrored)
    degree, angle = UNITS["angle"]["deg"], _size(run, "psi")
    if angle == 1.0:
        yield of_pose("its heading is in degrees", (1.0, 1.0, degree))
    if np.nanmax(np.abs(run.pose[:, 2])) <= 2.0 * np.pi * degree:
        yield of_pose("its heading is in radians in place of degrees", (1.0, 1.0, 1.0 / degree))
    if angle == degree:
        yield of_pose("its heading is in gon", (1.0, 1.0, UNITS["angle"]["gon"] / degree))
    for degrees in (180, 90, -90):
        back = Named(name="psi", offset=float(-np.radians(degrees) % (2.0 * np.pi)))
        yield Reading(f"its heading is off by {degrees} deg", {"psi": back})
    for unit, size in UNITS["length"].items() if _has_unit(run) else ():
        m, n = size / _size(run, "x"), size / _size(run, "y")
        for name, factors in (("its position", (m, n, 1.0)), ("x", (m, 1.0, 1.0)), ("y", (1.0, n, 1.0))):
            if factors != (1.0, 1.0, 1.0):
                yield of_pose(f"{name} is in {unit}", factors)
    yield from _of_force(model) if run.commands is None else _of_actuators(run, run.commands, model)


def _exchanged_angles(run: Run) -> Reading:
    """Latitude and longitude in each other's column: other factors make metres of their degrees."""
    x, y = (run.layout.column(s) for s in ("x", "y"))
    metres, motion = metres_in_degree(-y.offset / y.factor), np.diag([0.0, 0.0, 1.0])
    motion[0, 1], motion[1, 0] = metres["x"] / abs(y.factor), metres["y"] / abs(x.factor)
    return Reading("its latitude and longitude are in each other's column", motion=motion)


def _of_force(model: Model) -> Iterator[Reading]:
    """Signs, order and units of the columns of a commanded force."""
    yield of_commands("its commands have the wrong sign", (-1.0, -1.0, -1.0))
    for k, name in enumerate(TAU):
        yield of_commands(f"{name} has the wrong sign", (1.0 - 2.0 * np.eye(3)[k]).tolist())
    yield from (swapped(TAU, *pair) for pair in combinations(range(3), 2))
    percent = (0.01 * full_thrust(model)).tolist()
    yield of_commands("its commands are in percent of the full thrust", percent)
    forces, moments = UNITS["force"], UNITS["moment"]
    yield from (of_commands(f"tau_N is in {u}", (1.0, 1.0, m)) for u, m in moments.items() if m != 1.0)
    for unit, moment in (("mN", "N.mm"), ("kN", "kN.m")):
        f = forces[unit]
        yield of_commands(f"its commands are in {unit} and {moment}", (f, f, f))
        yield of_commands(f"tau_X and tau_Y are in {unit}", (f, f, 1.0))
        yield of_commands(f"tau_X is in {unit}", (f, 1.0, 1.0))
        yield of_commands(f"tau_Y is in {unit}", (1.0, f, 1.0))


def _of_actuators(run: Run, commands: np.ndarray, model: Model) -> Iterator[Reading]:
    """Signs, order and units of the columns of actuators' own commands."""
    names, form = run.signals, model.ship.form_of(commands)
    ones, unit = np.ones(len(names)), np.array([form[s] for s in names])
    turned = {s: -np.where(np.arange(len(names)) == k, 1.0, -1.0) for k, s in enumerate(names)}
    # A force turns round with its thrust, at the same angle.
    thrusts = np.where(unit == "rad", 1.0, -1.0)
    groups = {"its commands have": -ones, "its thrusts have": thrusts, "its angles have": -thrusts}
    signs = {f"{s} has": f for s, f in turned.items()} | groups
    for who, factors in {tuple(f.tolist()): (who, f) for who, f in reversed(signs.items())}.values():
        if (factors < 0.0).any():
            yield of_commands(f"{who} the wrong sign", factors.tolist(), names)
    units = [run.layout.column(s).unit for s in names]  # columns of different ones are distinguished
    pairs = ((i, k) for i, k in combinations(range(len(names)), 2) if units[i] == units[k])
    yield from (swapped(names, *pair) for pair in pairs)
    largest = np.abs(commands).max(axis=0)
    limits = np.abs(model.ship.layout_of(commands).limits(model.drive.params)).max(axis=1)
    for si, quantity in OF_UNIT.items():
        untold = STATED | {SI_UNIT[quantity]}
        for size, other in {x: n for n, x in UNITS[quantity].items() if n not in untold}.items():
            factors = np.where(unit == si, size, 1.0)
            if (factors != 1.0).any():
                yield _in_unit(f"in {other}", factors.tolist(), names)
            taken_for = (unit == si) & (largest > 0.0) & (largest <= size * limits)
            if quantity in COUNTED and size < 1.0 and taken_for.any():
                back = np.where(taken_for, 1.0 / size, 1.0).tolist()
                yield _in_unit(f"in {SI_UNIT[quantity]} in place of {other}", back, names)
    yield from of_angles(run, commands, model)
    for whole, name in ((1.0, "shares"), (100.0, "percent")):
        meant = (largest <= whole) & (limits > 1.0)
        factors = np.where(meant, limits / whole, 1.0)
        if meant.any():
            yield _in_unit(f"in {name} of the limits", factors.tolist(), names)


def of_angles(run: Run, commands: np.ndarray, model: Model) -> Iterator[Reading]:
    """Angles that count from elsewhere: the other way round, or from hard over."""
    layout = model.ship.layout_of(commands)
    ends, form = layout.limits(model.drive.params), model.ship.form_of(commands)
    for k, (name, (low, high)) in enumerate(zip(run.signals, ends, strict=True)):
        if form[name] != "rad":
            continue
        if layout.round and layout.round[k]:
            yield off_by(f"{name} points the other way, by 180 deg", name, 1.0, np.pi, run.signals)
        elif low < 0.0 <= commands[:, k].min():
            # A share of the way from hard over to hard over may have been read as one of half of it.
            whole = (high - low) / high if commands[:, k].max() <= high else 1.0
            for way, sign, end in (("port", 1.0, low), ("starboard", -1.0, high)):
                yield off_by(f"{name} counts from hard over to {way}", name, sign, end, run.signals)
                if whole > 1.0:
                    share = f"{name} is a share of the way from hard over to {way}"
                    yield off_by(share, name, sign * whole, end, run.signals)


def other_factors(run: Run, k: float, pace: float) -> Iterator[Reading]:
    """Readings in a unit without a name, or of another clock: the ship accelerates k times too much.

    Args:
        run: that is read.
        k: by which accelerations are too large, 1.
        pace: seconds meant for a second read.
    """
    if _has_unit(run):
        yield of_pose(f"its position is in units of {1.0 / k:.3g} m", (1.0 / k, 1.0 / k, 1.0))
    if run.commands is None:
        yield of_commands(f"its commands are in units of {k:.3g} N and N m", (k, k, k))
    clock = {"time": Named(name="time", factor=pace)}
    yield Reading(f"{pace:.3g} s passed in each second of its time", clock)


def _size(run: Run, signal: str) -> float:
    """The unit that a coordinate was read in [SI]."""
    column = run.layout.column(signal)
    return UNITS[QUANTITY[signal]].get(column.unit or "", 1.0)


def _has_unit(run: Run) -> bool:
    """Whether the position is in a unit of length, and not in degrees of latitude and longitude."""
    return not any(is_geographic(signal, run.layout.column(signal)) for signal in ("x", "y"))


def reread(w: WeakWindows, reading: Reading, model: Model) -> WeakWindows:
    """The thinned windows of a run of a model's ship by another reading."""
    w = w.thinned
    s, run = w.smoothed, w.run
    same = ["response"] if reading.commands is None and reading.pace == 1.0 else []
    if reading.pace == 1.0 and reading.turn == 0.0 and (reading.motion == np.eye(3)).all():
        same += OF_MOTION
    memory = {part: w.memory.setdefault(part, {}) for part in same}
    if reading.commands is not None and run.commands is None:
        run = replace(run, tau_cmd=run.tau_cmd @ reading.commands.T)
    elif reading.commands is not None and run.commands is not None:
        commands = run.commands @ reading.commands.T + reading.added
        run = replace(run, commands=commands, tau_cmd=model.ship.commanded_force(commands, run.power))
    meant = replace(
        s,
        track=replace(s.track, run=run),
        eta=s.eta @ reading.motion.T + [0.0, 0.0, reading.turn],
        eta_dot=s.eta_dot @ reading.motion.T / reading.pace,
    )
    return replace(w, smoothed=meant, slope=w.slope / reading.pace, whole=None, memory=memory)
