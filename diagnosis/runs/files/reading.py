"""Measured runs in one form, from whatever file they are in.

Read are CSV and Parquet with the columns ``time``, ``x``, ``y``, ``psi`` and commands (see
:mod:`.columns` for other names and units), a log of this project (its folder or file), and the MATLAB
files that NTNU publishes of CyberShip Enterprise 1.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cosim import InputError
from cosim.errors import nearest
from cosim.results import RunOptions, read_options
from cybership.message_text import counted, quoted
from fmus.ops import wrap
from fmus.ship import Ship, ship
from fmus.ship_description import Description
from fmus.ships.naming import DEFAULT

from ...execution.result_folder import sha256
from ...execution.short_text import ShortRepr
from ..columns.columns import (
    BESIDE,
    POSE,
    RELATIVE_WIND,
    TAU,
    TRUE_WIND,
    Column,
    Layout,
    degrees,
    largest_commands,
    layout_of,
    outputs,
    quantities,
    read_layout,
    side_cars,
    signals,
    to_si,
    with_units_of_names,
)
from ..columns.geographic import across_date_line, available, is_geographic
from ..columns.name_words import is_magnetic
from ..columns.unit_check import LARGEST, UNITS, largest, remedy
from ..run_constants import DIGITS, FAR, NEGLIGIBLE
from .matlab_files import fits_matlab, read_matlab
from .tables import (
    MeasuredTable,
    as_table,
    clock_seconds,
    date_stamps,
    has_words,
    is_cell,
    numbers,
    resolution,
)

# degrees, degrees/min, that are not available; the rate may be coded (ITU-R M.1371, AIS)
NO_HEADING, NO_RATE = 511.0, -128.0
LOGS, LOG_OPTIONS = ("log.csv", "log.parquet"), "log.json"
TABLES = (".csv", ".parquet", ".mat")  # endings of files of measured runs


@dataclass(frozen=True, eq=False, repr=False)
class Run(ShortRepr):
    """One measured run, as it was found. A command acts from its time to the next.

    Attributes:
        name: of the file, or of the folder of a log.
        time: (n,) [s].
        pose: (n, 3), measured north, east, heading [m, m, rad]; lost samples are NaN or zeros.
        tau_cmd: (n, 3), commanded force [N, N, N m] after clipping.
        commands: (n, k), in one of :attr:`fmus.ship.Ship.layouts`; None if not known.
        power: (n, m), force of thrusters as shares of that at full power; None if full.
        notes: what was found that is not as it should be, a line each.
        held: (n, k), where one of its commands is missing in the file, and held; None if none is.
        called: signal -> its column in the file, of those with another name; None if there is none.
        file: that it was read from; None if it was not.
        absent: commands that have no column, and are taken as zero.
        signals: names of ``commands``; of a run with the force alone of those that it is allocated to.
        measured: beside the pose: signal of :mod:`.columns` -> (n,) in SI, NaN where it is missing.
        noise: signal -> standard deviation that the side-car states [SI].
        ship: that was measured; None: the default ship.
        trial: kind of manoeuvring trial that it is, such as zigzag; None: it is none.
        resolution: (n, 3), step to which the pose is rounded in the file [m, m, rad]; None: not at all.
        hashes: file that it was read from -> SHA-256 when it was read: the measurement, then side-cars.
        left_out: number of samples that are left out, as they have no time of their own.
        layout: how it was read: the side-car, units in names, or a proposal.
    """

    name: str
    time: np.ndarray
    pose: np.ndarray
    tau_cmd: np.ndarray
    commands: np.ndarray | None = None
    power: np.ndarray | None = None
    notes: tuple[str, ...] = ()
    held: np.ndarray | None = None
    called: Mapping[str, str] | None = None
    file: Path | None = None
    absent: tuple[str, ...] = ()
    signals: tuple[str, ...] = field(default_factory=lambda: ship().layout.commands)
    measured: Mapping[str, np.ndarray] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    ship: Description | None = None
    trial: str | None = None
    resolution: np.ndarray | None = None
    hashes: Mapping[Path, str] = field(default_factory=dict)
    left_out: int = 0
    layout: Layout = field(default_factory=Layout)

    @property
    def coarse(self) -> np.ndarray:
        """(n, 3), step to which the pose is rounded [m, m, rad], zero where it is not."""
        return np.zeros_like(self.pose) if self.resolution is None else self.resolution

    @property
    def commanded(self) -> dict[str, np.ndarray]:
        """Signal -> (n,), the commands in the form in which they were given."""
        settings = ship(description=self.ship).power_settings
        found: dict[str, np.ndarray] = {}
        for names, table in ((self.signals, self.commands), (settings, self.power)):
            if table is not None:
                found |= zip(names, table.T, strict=True)
        return found or dict(zip(TAU, self.tau_cmd.T, strict=True))

    @property
    def given(self) -> np.ndarray:
        """(n, k), :attr:`commands`, or (n, 3), the force of a run with the force alone."""
        return self.tau_cmd if self.commands is None else self.commands

    def with_given(self, given: np.ndarray) -> "Run":
        """The run with other commands, in the form of :attr:`given`."""
        if self.commands is None:
            return replace(self, tau_cmd=given)
        tau_cmd = ship(description=self.ship).commanded_force(given, self.power)
        return replace(self, commands=given, tau_cmd=tau_cmd)

    def rows(self, keep: np.ndarray) -> "Run":
        """The run with only some of its rows."""
        columns = {f.name: getattr(self, f.name) for f in fields(self)}
        kept = {n: c[keep] for n, c in columns.items() if isinstance(c, np.ndarray)}
        return replace(self, **kept, measured={s: c[keep] for s, c in self.measured.items()})


def _is_run(path: Path) -> bool:
    """Whether a path looks like a measured run: a table, or the folder of a log."""
    return path.suffix in TABLES or any((path / name).is_file() for name in LOGS)


def read(
    path: str | Path, layout: Layout | None = None, of: Ship | None = None, also: Iterable[str] = ()
) -> Run:
    """A measured run.

    Args:
        path: a ``.csv``, ``.parquet`` or ``.mat`` file, or the folder of a log.
        layout: in place of what the file next to it says.
        of: the ship that was measured; None: the default ship.
        also: names of other columns [SI] that are kept in :attr:`Run.measured` where there are such.

    Raises:
        InputError: absent, unreadable, a column missing, or commands in another unit.
    """
    path = Path(path)
    if path.is_dir():
        found = [path / name for name in LOGS if (path / name).is_file()]
        if not found:
            tables = sorted(file for file in path.iterdir() if _is_run(file) and file.is_file())
            hint = f"; a measurement is a file, as '{tables[0]}'" if tables else ""
            raise InputError(f"no log in '{path}': log.csv is missing{hint}")
        path = found[0]
    elif not path.is_file():
        near = [p.name for p in path.parent.iterdir() if _is_run(p)] if path.parent.is_dir() else []
        raise InputError(f"no such measurement: '{path}'{nearest(path.name, near)}")
    is_log = path.name in LOGS
    name = path.absolute().parent.name if is_log else path.stem
    of = of or ship()
    stated = [path.with_name(LOG_OPTIONS)] if is_log and path.with_name(LOG_OPTIONS).is_file() else []
    hashes = {file: sha256(file) for file in (path, *side_cars(path), *stated)}
    if path.suffix == ".mat" and fits_matlab(of):
        return replace(_run(name, read_matlab(path, of), f"'{path}'", of), file=path, hashes=hashes)
    table, layout = _tabular(path, layout, of, set(also))
    run = _of_table(name, table, layout, path, f"'{path}'", of)
    others = {n: np.asarray(pd.to_numeric(table[n], errors="coerce"), float) for n in also if n in table}
    run = replace(run, file=path, hashes=hashes, measured={**run.measured, **others})
    trial = read_options(path.parent).trial if is_log else None
    return run if trial is None else replace(run, trial=trial.kind)


def read_frame(frame: pd.DataFrame, name: str = "frame", of: Ship | None = None) -> Run:
    """A measured run in a table.

    Args:
        frame: columns as in a file, units in their names (``x [mm]``) or in ``attrs["units"]``; or the
            log of a run, :func:`cosim.log_frame`.
        name: of the run.
        of: the ship that was measured; None: the default ship.

    Raises:
        InputError: a column is missing, or commands are in another unit.
    """
    of = of or ship()
    where, names = f"the table '{name}'", [str(column) for column in frame.columns]
    layout = layout_of(names, frame.attrs.get("units", {}), where, of)
    return _of_table(name, frame.set_axis(names, axis=1), layout, Path(name), where, of)


def _tabular(path: Path, layout: Layout | None, of: Ship, also: set[str]) -> tuple[pd.DataFrame, Layout]:
    """What is needed of a CSV or Parquet file, and which column is which signal."""
    given = layout or read_layout(path)
    with as_table(path):
        table = MeasuredTable(path, given or Layout())
        names = table.names
        where = f"'{path}'"
        if given is None:
            layout = layout_of(names, {}, where, of, path.parent)
        else:
            layout = with_units_of_names(given, names, {}, where, of)
        used = [layout.column(s) for s in signals(layout, names, f"'{path}'", of)]
        wanted = {name for column in used for name in (column.name, column.sign) if name}
        if absent := next((c.sign for c in used if c.sign and c.sign not in names), None):
            raise InputError(f"'{path}' has no column '{absent}' (for a sign){nearest(absent, names)}")
        return table.columns(wanted | also.intersection(names)), layout


def signed(read: np.ndarray, table: pd.DataFrame, column: Column) -> np.ndarray:
    """Numbers (n,) of a column of a table with their sign; degrees where they have minutes."""
    read = degrees(read) if column.minutes else read
    if column.sign is not None:
        read = np.where(is_cell(table[column.sign], column.negative), -read, read)
    return across_date_line(read) if is_geographic("y", column) else read


def _of_table(name: str, table: pd.DataFrame, layout: Layout, path: Path, where: str, of: Ship) -> Run:
    """A run of a table's signals."""
    columns, noise, quantity = layout.even_time(len(table)), {}, quantities(of)
    steps: dict[str, np.ndarray] = {}
    table, remarks = _without_remarks(table.reset_index(drop=True), layout)
    table, marks = _without_marks(table, layout)
    for signal in signals(layout, list(table.columns), where, of):
        column = layout.column(signal)
        cells = table[column.name]
        values = date_stamps(cells, f"'{path}'") if signal == "time" else None
        if values is None:
            read = numbers(cells, path, layout)
            if signal == "time" and column.unit is None and column.factor == 1.0:
                read = clock_seconds(read)
            read = signed(_available(read, signal, column), table, column)
            values = to_si(read, signal, column, quantity[signal])
            if signal in POSE:
                unit = UNITS[quantity[signal]].get(column.unit or "", 1.0)
                there = np.where(np.abs(values) < LARGEST, read, np.nan)  # 1e38 is no measurement
                steps[signal] = resolution(there) * abs(column.factor) * unit
        if signal == "time":
            stamps = values[np.isfinite(values)]
            if not stamps.size:
                raise InputError(f"{where}: time has no value in any of {len(values)} rows")
            if stamps.min() > LARGEST:  # of an epoch
                values = values - stamps[0]
        columns[signal] = values
        if column.noise is not None:
            noise[signal] = column.noise * UNITS[quantity[signal]].get(column.unit or "", 1.0)
    sampled = [s for s, c in layout.columns.items() if c.measured and s in columns]
    columns |= {s: row_means(columns[s], columns["time"], quantity[s] == "angle") for s in sampled}
    columns |= {s: np.zeros(len(table)) for s in layout.unused}
    late = {s: c.late for s, c in layout.columns.items() if c.late and s in columns}
    columns |= {s: _earlier(columns[s], columns["time"], by) for s, by in late.items()}
    run = _run(name, columns, where, of)
    rounded = np.column_stack([steps[name] for name in POSE])
    notes: list[str] = []
    for signal in [s for s in columns if s not in ("time", *layout.unused)]:
        cells = table[layout.column(signal).name]
        words = has_words(cells) & np.isnan(columns[signal])
        notes += (f"{signal}: {note}" for note in _told(cells, words, "cell", "without a number"))
    notes += _by_compass(layout.column("psi"))
    called = {s: c.name for s, c in layout.columns.items() if c.name != s}
    return replace(
        run,
        called=called or None,
        notes=(*run.notes, *remarks, *marks, *notes),
        noise=noise,
        trial=layout.trial,
        resolution=rounded,
        layout=layout,
    )


def _available(read: np.ndarray, signal: str, column: Column) -> np.ndarray:
    """Numbers (n,) of a column without those of a coordinate, or a rate, that is not available."""
    if signal == "r" and column.unit in (None, "deg/min") and not (read < NO_RATE).any():
        return np.where(read == NO_RATE, np.nan, read)
    if signal == "psi" and column.unit in ("deg", "°") and not (read > NO_HEADING).any():
        return np.where(read == NO_HEADING, np.nan, read)
    of_place = signal in ("x", "y") and is_geographic(signal, column)
    return available(signal, read) if of_place else read


def _by_compass(psi: Column) -> Iterator[str]:
    """A line on a heading that is magnetic by its name, and not corrected."""
    if is_magnetic(psi.name) and not psi.offset:
        yield (
            f"'{psi.name}' is by a magnetic compass: if it is not corrected, the variation, positive to "
            'the east, is the "offset" of the column'
        )


def _without_remarks(table: pd.DataFrame, layout: Layout) -> tuple[pd.DataFrame, list[str]]:
    """A table without rows with words in place of a time, and what is said of these."""
    name = layout.column("time").name
    words = has_words(table[name]) if name in table else np.zeros(len(table), bool)
    if not words.any():
        return table, []
    stamps = date_stamps(table[name])
    words &= True if stamps is None else np.isnan(stamps)  # as of "Dec 31, 2026 23:59"
    stated = _told(table[name], words, "row", "with words in place of a time, left out")
    return table.loc[~words], stated  # the others keep their numbers, for messages


def _without_marks(table: pd.DataFrame, layout: Layout) -> tuple[pd.DataFrame, list[str]]:
    """A table without the number that a logger writes where it has no values, and what is said of it.

    In more than one row the north, the east and the heading are one number, the same in all of these.
    """
    names = [layout.column(signal).name for signal in POSE]
    if not {*names} <= {*table.columns}:
        return table, []
    pose = table[names].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    alike = (pose == pose[:, :1]).all(axis=1) & (pose[:, 0] != 0.0)
    values = np.unique(pose[alike, 0])
    if values.size != 1 or alike.sum() < 2:
        return table, []
    is_mark = table.apply(pd.to_numeric, errors="coerce") == values[0]
    return table.mask(is_mark.mul(alike, axis=0)), [
        f"{values[0]:g} in x, y and psi at once, left out in {counted(int(alike.sum()), 'row')}"
    ]


def _told(cells: pd.Series, words: np.ndarray, what: str, how: str) -> list[str]:
    """A note of the cells (n,) of a column that have words, with the first; none if there are none."""
    if not words.any():
        return []
    first = quoted(str(cells.iloc[int(words.argmax())]).strip())
    return [f"{counted(int(words.sum()), what)} {how}, such as {first}"]


def _run(name: str, columns: dict[str, np.ndarray], where: str, of: Ship) -> Run:
    """A run of its signals, commands without a gap."""
    form = next((f for f in reversed(of.command_forms) if next(iter(f), "") in columns), {})
    own, settings = tuple(form or of.commands), of.power_settings
    absent = tuple(s for s in TAU if s not in columns) if not columns.keys().isdisjoint(TAU) else ()
    columns = columns | {s: np.zeros_like(columns["time"]) for s in absent}

    def held(group: tuple[str, ...]) -> np.ndarray | None:
        """Commands that keep their last value where one is missing, zero before the first."""
        if columns.keys().isdisjoint(group[:1]):
            return None
        return np.nan_to_num(held_values(np.column_stack([columns[s] for s in group])), nan=0.0)

    false = _false_cells(columns, of)
    columns = columns | {s: np.where(cells, np.nan, columns[s]) for s, cells in false.items()}
    tau, commands, power = map(held, (TAU, own, settings))
    power = None if power is None else np.maximum(power, 0.0)
    if set(form.values()) == {"1"} and commands is not None:
        most = float(np.abs(commands).max(initial=0.0))
        if most > largest("command"):  # far beyond rounding they are in another unit
            raise InputError(
                f"{where}: commands reach {most:g}; allowed is -1 to 1; are they in percent? "
                f"{remedy(own, '%')}"
            )
    if power is not None and power.max(initial=0.0) > LARGEST:
        raise InputError(f"{where}: power reaches {power.max():g} times the full thrust; allowed is 1")
    if tau is not None and np.abs(tau).max(initial=0.0) > LARGEST:
        raise InputError(
            f"{where}: commands reach {np.abs(tau).max():g} N, more than any thruster gives"
        )
    given = [s for s in dict.fromkeys((*TAU, *own, *settings)) if s in columns]
    if empty := next((s for s in given if not np.isfinite(columns[s]).any()), None):
        raise InputError(
            f"{where}: the command {empty} has no value in any row; if it was never used, put "
            f'"unused": ["{empty}"] beside "columns" into its side-car'
        )
    missing = [~np.isfinite(columns[s]) for s in given]
    lost = sum(bool(gaps.any()) for gaps in missing)
    if tau is None:
        assert commands is not None
        tau = of.commanded_force(commands, power)
    notes = tuple(
        f"{s}: {counted(int(cells.sum()), 'cell')} far beyond its limits left out"
        for s, cells in false.items()
    )
    notes += _clipped(columns, of)
    held_in = f"commands are missing in {counted(lost, 'column')}; the last value is held"
    notes += (held_in,) if lost else ()
    notes += tuple(f"no column {signal}: zero is used" for signal in absent)
    return Run(
        name,
        columns["time"],
        np.column_stack([columns[s] for s in POSE]),
        tau,
        commands,
        power,
        notes,
        held=np.column_stack(missing) if lost else None,
        absent=absent,
        signals=own,
        ship=of.description,
        measured={s: c for s, c in columns.items() if s in {*BESIDE, *outputs(own)}},
    )


def _false_cells(columns: Mapping[str, np.ndarray], of: Ship) -> dict[str, np.ndarray]:
    """Signal -> (n,), cells of an actuator's command that are far beyond its limit, where most are not.

    Loggers write numbers such as -999 where they have no value: one number, and nothing between it and
    the limit, if that is less far. An angle without a limit is turned on. The speed of a wind is a
    magnitude: it is not below zero.
    """
    found = {}
    for signal, _, limit in _limits(columns, of):
        values = columns[signal]
        size = np.abs(values)
        far, beyond = size > FAR * limit, size > limit
        if np.unique(values[beyond]).size == 1 and size[beyond][0] > 2.0 * limit:
            far = beyond
        if 0 < far.sum() <= NEGLIGIBLE * np.count_nonzero(size):
            found[signal] = far
    speeds = {s: columns[s] < 0.0 for s in (TRUE_WIND[0], RELATIVE_WIND[0]) if s in columns}
    return found | {s: below for s, below in speeds.items() if below.any()}


def _clipped(columns: Mapping[str, np.ndarray], of: Ship) -> tuple[str, ...]:
    """Notes of commands that are often beyond their limits, as the speed of an engine with a gear."""
    notes = {}
    for signal, unit, limit in _limits(columns, of):
        size = np.abs(columns[signal])
        share = np.mean(size > (1.0 + NEGLIGIBLE) * limit)
        if share > NEGLIGIBLE:
            notes[signal] = (
                f"{signal} is beyond its limit of {limit:.4g} {unit} in {100.0 * share:.0f} % of the "
                f"rows, up to {np.nanmax(size):.4g}; it counts as the limit there"
            )
    return tuple(notes.values())


def _limits(columns: Mapping[str, np.ndarray], of: Ship) -> Iterator[tuple[str, str, float]]:
    """Commands of actuators that are there, with their units and the largest values in all forms."""
    for form, layout in zip(of.command_forms, of.layouts, strict=True):
        each = zip(form.items(), largest_commands(layout, of, np.inf).tolist(), strict=True)
        yield from ((signal, unit, limit) for (signal, unit), limit in each if signal in columns)


def _earlier(command: np.ndarray, time: np.ndarray, late: float) -> np.ndarray:
    """A command (n,) that is logged late by some seconds, at the times (n,) at which it acted.

    Where it changes within a row it is the mean over the row.
    """
    order = np.argsort(time, kind="stable")
    t, held = time[order], command[order]
    at = np.searchsorted(t, time + late * (1.0 + DIGITS), side="right") - 1
    after = np.minimum(at + 1, t.size - 1)
    row = np.maximum(t[after] - t[at], DIGITS * late)
    part = np.clip((time + late - t[at]) / row, 0.0, 1.0)
    mean = (1.0 - part) * held[at] + part * held[after]
    return np.where((part > DIGITS) & np.isfinite(mean), mean, held[at])


def held_values(values: np.ndarray) -> np.ndarray:
    """Values (n, k), the last one where one is missing; NaN before the first."""
    return pd.DataFrame(np.where(np.isfinite(values), values, np.nan)).ffill().to_numpy()


def table_of(run: Run) -> pd.DataFrame:
    """All that was measured and commanded, by its own names and in SI, as :func:`read` takes it."""
    pose = dict(zip(POSE, run.pose.T, strict=True))
    return pd.DataFrame({"time": run.time, **pose, **run.commanded, **run.measured})


def layout_beside(run: Run) -> dict[str, Any]:
    """The file beside that table: noise, and what the one beside the run's own file says of the run."""
    before = None if run.file is None else read_layout(run.file)
    kept = (before or Layout()).model_dump(exclude_defaults=True, include={"trial"})
    columns = {name: Column(name=name, noise=std) for name, std in run.noise.items()}
    return kept | Layout(columns=columns).model_dump(exclude_defaults=True)


def ship_of_logs(paths: Iterable[Path]) -> tuple[str, Path] | None:
    """The ship that logs of :mod:`cosim` are of, and the first one that says so.

    Args:
        paths: of runs; files that are no logs say nothing.

    Returns:
        The name or file of the ship; None: CyberShip Enterprise 1, or no log tells.

    Raises:
        InputError: they are of several ships.
    """
    stated = {path: log.ship or log.outline.name for path, log in _logs(paths).items() if log.outline}
    ships = dict.fromkeys(stated.values())
    if len(ships) > 1:
        each = ", ".join(f"'{path}' of {ship}" for path, ship in stated.items())
        raise InputError(f"the runs are of several ships: {each}")
    first = next(iter(stated.items()), None)
    return None if first is None or first[1] == DEFAULT else (first[1], first[0])


def ships_of_logs(paths: Iterable[Path]) -> dict[Path, str]:
    """Logs of :mod:`cosim` -> the name of their ship, of those that say it."""
    outlines = {path: log.outline for path, log in _logs(paths).items()}
    return {path: outline.name for path, outline in outlines.items() if outline is not None}


def _logs(paths: Iterable[Path]) -> dict[Path, RunOptions]:
    """What is stated beside each of some runs; of those that are no logs nothing."""
    return {path: read_options(path if path.is_dir() else path.parent) for path in paths}


def row_means(
    values: np.ndarray, time: np.ndarray, angle: bool = False, sampled: np.ndarray | None = None
) -> np.ndarray:
    """Samples (n,) at times (n,) [s] as their means from each row to the next; the last one stays.

    Args:
        values: of which a missing one is NaN, and changes no other. Between two they are on a line.
        time: in any order.
        angle: whether they are angles [rad], which take the shorter way.
        sampled: (n,), whether a row has a sample, and does not repeat one; None: each has.
    """
    order = np.argsort(time, kind="stable")
    own = order if sampled is None else order[sampled[order]]
    steps = np.diff(values[own], append=np.nan)
    if angle:
        steps = wrap(steps)
    width = np.diff(time[own], append=np.inf)
    slope = np.where(np.isfinite(steps) & (width > 0.0), steps, 0.0) / np.where(width > 0.0, width, 1.0)
    at = np.searchsorted(time[own], time[order], side="right") - 1
    middle = 0.5 * (time[order] + np.append(time[order][1:], time[order][-1]))
    means = values.copy()
    means[order] += np.nan_to_num(slope[at] * (middle - time[own][at]))  # a row may have no time
    return means
