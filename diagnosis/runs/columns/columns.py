"""What the columns of a measurement mean: names, units and signs, given in a small JSON file beside it.

``run.csv.json`` beside ``run.csv`` may say, for each column that is not as it should be, what it is
called, in which unit it is, and how its axis lies::

    {
        "separator": ";",
        "columns": {
            "time": {"name": "t", "unit": "ms"},
            "x": "North",
            "y": {"name": "West", "unit": "mm", "flip": true},
            "psi": {"name": "Heading", "unit": "deg", "flip": true, "offset": 90},
        },
    }

Columns that it does not name keep their names, in SI or in the units that stand there (``x [mm]``).
``columns.json`` in a folder says the same of all files there, and the file next to a measurement goes
over it. What each signal means: docs/measurements.md.
"""

import codecs
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    StringConstraints,
    field_validator,
    model_validator,
)

from cosim import InputError
from cosim.errors import nearest
from cosim.results import read_options
from cosim.scenario import checked, read_model
from cosim.trials import KINDS
from cybership.message_text import name_of, quoted
from fmus.actuators.response import CommandLayout
from fmus.ship import Ship

from .name_words import words_of
from .unit_check import UNITS, spelt

FOLDER_FILE = "columns.json"  # what it says holds for every measurement in its folder
PREAMBLE = 1000  # 1, lines; chosen: far more than any file has before its names
UTF_8 = "utf-8-sig"  # with a mark at the beginning or without
POSE = ("x", "y", "psi")
TAU = ("tau_X", "tau_Y", "tau_N")
TRUE_WIND = ("wind_speed", "wind_direction")
RELATIVE_WIND = ("wind_speed_relative", "wind_direction_relative")

# Quantity of a ship's command, by the unit that its law has for it.
OF_UNIT = {"1": "command", "1/s": "shaft speed", "rad": "angle", "N": "force"}
# Signal -> quantity, of what may be measured beside pose and commands.
BESIDE = {
    **dict.fromkeys(("u", "v", "x_dot", "y_dot", "speed"), "speed"),
    "course": "angle",
    "r": "rate",
    **dict.fromkeys(("u_water", "v_water"), "speed"),
    **dict.fromkeys(("a_x", "a_y"), "acceleration"),
    "wind_speed": "speed",
    "wind_direction": "angle",
    "wind_speed_relative": "speed",
    "wind_direction_relative": "angle",
    "x_2": "length",
    "y_2": "length",
    "psi_2": "angle",
}
OUTPUTS = {"thrust": "force", "torque": "moment"}  # of an actuator
QUANTITY = {
    "time": "time",
    "x": "length",
    "y": "length",
    "psi": "angle",
    "tau_X": "force",
    "tau_Y": "force",
    "tau_N": "moment",
    **BESIDE,
}


def outputs(commands: Iterable[str]) -> dict[str, str]:
    """Outputs of a ship's actuators that may be measured -> quantity, for its ``ACTUATOR.COMMAND``."""
    actuators = dict.fromkeys(name.partition(".")[0] for name in commands if "." in name)
    return {f"{actuator}.{name}": q for actuator in actuators for name, q in OUTPUTS.items()}


def largest_commands(layout: CommandLayout, of: Ship, turning: float) -> np.ndarray:
    """(k,), largest size of each command of a layout; of an angle that turns on what is given for it."""
    limits = np.abs(layout.limits(of.nominal_drive.params)).max(axis=1)
    return np.where(layout.round or False, turning, limits)


def quantities(of: Ship) -> dict[str, str]:
    """Signal -> quantity, those of a ship's own commands, power settings and outputs too."""
    own = {name: OF_UNIT[unit] for form in of.command_forms for name, unit in form.items()}
    return QUANTITY | outputs(own) | own | dict.fromkeys(of.power_settings, "command")


def other_angles(measured: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Angles of what is measured in addition to pose and commands."""
    return {signal: values for signal, values in measured.items() if BESIDE.get(signal) == "angle"}


def no_unit(unit: str, signal: str, units: Iterable[str]) -> str:
    """The message about a unit that a signal cannot have."""
    return f"{quoted(unit)} is not a unit of {name_of(signal)}{nearest(unit, units)}"


Mark = Annotated[str, StringConstraints(min_length=1, max_length=1)]  # a character


class Named(BaseModel):
    """What a file says of a column or a variable; a text is its name alone."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    factor: FiniteFloat = 1.0  # 1, by which numbers of the column are multiplied
    offset: FiniteFloat = 0.0  # what is added then, in the unit that they have then

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: object) -> object:
        return {"name": value} if isinstance(value, str) else value


class Column(Named):
    """One column of a file, with its name there."""

    unit: str | None = None  # SI if not said
    flip: bool = False  # whether its axis points the other way, before the offset
    noise: PositiveFloat | None = Field(default=None, allow_inf_nan=False)  # its standard deviation
    sign: str | None = None  # another column, which holds the sign
    negative: str = "-1"  # the cell of that in rows with a negative value
    minutes: bool = False  # whether numbers are degrees and minutes (ddmm.mmmm), as of NMEA 0183
    late: NonNegativeFloat = Field(default=0.0, allow_inf_nan=False)  # s, of a command, behind the pose
    # Of a command, whether it is sampled of what the actuator does, and is no order, which acts from its
    # row to the next; None: not known.
    measured: bool | None = None

    @field_validator("unit")
    @classmethod
    def _spelt(cls, value: str | None) -> str | None:
        return value and spelt(value)


class Layout(BaseModel):
    """The content of the JSON file beside a measurement."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    separator: Mark = ","  # between two cells
    decimal: Mark = "."  # the decimal point
    encoding: str = UTF_8  # of the text, as Python calls it
    skip: NonNegativeInt = Field(default=0, le=PREAMBLE)  # 1, lines before that of the names
    units_line: bool = False  # whether the line below the names is of units
    columns: dict[str, Column] = {}  # x, y, psi, ... -> a column
    unused: tuple[str, ...] = ()  # commands that were zero all the time, and have no column
    period: PositiveFloat | None = Field(default=None, allow_inf_nan=False)  # s, of rows without a time
    trial: str | None = None  # the manoeuvring trial that it is, as zigzag

    @field_validator("trial")
    @classmethod
    def _is_trial(cls, value: str | None) -> str | None:
        if value is not None and value not in KINDS:
            hint = nearest(value, KINDS) or f"; there are {', '.join(KINDS)}"
            raise ValueError(f"{quoted(value)} is not a manoeuvring trial{hint}")
        return value

    @field_validator("encoding")
    @classmethod
    def _is_encoding(cls, value: str) -> str:
        try:
            "".encode(value)  # there are others than those of texts
            return codecs.lookup(value).name
        except (LookupError, UnicodeError):
            text = f"{quoted(value)} is not an encoding; there are utf-8, latin-1, ..."
            raise ValueError(text) from None

    @field_validator("columns")
    @classmethod
    def _known(cls, value: dict[str, Column]) -> dict[str, Column]:
        for key, column in value.items():
            if column.factor == 0.0:
                raise ValueError(f"{key}.factor is 0; give another number")
            own = QUANTITY | outputs([key])
            if key in own and key not in TAU:
                if column.late:
                    raise ValueError(
                        f"{key}.late is {column.late:g}; allowed is the time [s] of a command"
                    )
                if column.measured is not None:
                    raise ValueError(
                        f"{key}.measured: only a command can be an order or a measured value"
                    )
            # Which commands there are is known with the ship.
            possible = [own[key]] if key in own else OF_UNIT.values()
            units = [unit for quantity in possible for unit in UNITS[quantity]]
            if column.unit is not None and column.unit not in units:
                raise ValueError(no_unit(column.unit, key, units))
        return value

    @property
    def without_column(self) -> tuple[str, ...]:
        """Signals that need no column."""
        return self.unused if self.period is None else ("time", *self.unused)

    def even_time(self, rows: int) -> dict[str, np.ndarray]:
        """The time [s] of a table whose evenly spaced rows have none; empty where they have."""
        return {} if self.period is None else {"time": self.period * np.arange(rows)}

    def column(self, signal: str) -> Column:
        """The column of a signal."""
        return self.columns.get(signal, Column(name=signal))


def log_of(commands: Iterable[str]) -> Layout:
    """Our own log: the pose after all faults, the force after clipping, and the ship's commands."""
    names = {"x": "observer.x_m", "y": "observer.y_m", "psi": "observer.psi_m"}
    names |= {f"tau_{axis}": f"thrusters.tau_cmd_{axis}" for axis in "XYN"}
    names |= {name: f"thrusters.{name.replace('.', '_')}" for name in commands}
    return Layout(columns={signal: Column(name=name) for signal, name in names.items()})


PROPOSE = "a side-car states other names ('cybership columns FILE --write' writes one)"
WITH_UNIT = re.compile(r"(.+?)\s*[\[(]\s*(\S+|deg \w+|\w+ since [^\])]+)\s*[\])]")


def layout_of(
    names: Sequence[str],
    units: Mapping[str, str],
    where: str,
    of: Ship,
    folder: Path | None = None,
) -> Layout:
    """The layout of a log by its usual names or the roles of its scenario, or of a table by its units.

    Args:
        names: of the columns, which may end in a unit, as ``x [mm]``.
        units: column -> unit, where that is known otherwise; those of no signal do not count.
        where: what messages call the table.
        of: the ship that was measured.
        folder: in which it lies, where the run's scenario may be.

    Raises:
        InputError: a unit that the signal cannot have.
    """
    log = log_of(of.commands)
    if log.column("x").name in names:
        return log
    if folder is not None:
        roles = read_options(folder).roles
        named = dict(zip((*POSE, *TAU), roles.of("pose", "force"), strict=True))
        if set(named.values()) <= set(names):
            vessel, thrusters = (role[0].rpartition(".")[0] for role in (roles.pose, roles.force))
            further = {c: f"{thrusters}.{c.replace('.', '_')}" for c in of.commands}
            further |= {signal: f"{vessel}.{signal}" for signal in TRUE_WIND}
            named |= {signal: name for signal, name in further.items() if name in names}
            return Layout(columns={signal: Column(name=name) for signal, name in named.items()})
    return with_units_of_names(Layout(), names, units, where, of)


def with_units_of_names(
    layout: Layout, names: Sequence[str], units: Mapping[str, str], where: str, of: Ship
) -> Layout:
    """A layout with the units of further columns that are signals by their own names, as ``x [mm]``.

    Args:
        layout: which columns it has, and what it says of them, stays.
        names, units, where, of: as of :func:`layout_of`.

    Raises:
        InputError: a unit that the signal cannot have.
    """
    known = quantities(of)
    stated = {name: (name, unit) for name, unit in units.items() if name in known and name in names}
    found = (WITH_UNIT.fullmatch(name.strip()) for name in names)
    stated |= {m[1]: (name, m[2]) for name, m in zip(names, found, strict=True) if m and m[1] in known}
    taken = {column.name for column in layout.columns.values()}
    columns = {
        signal: {"name": name, "unit": unit}
        for signal, (name, unit) in stated.items()
        if signal not in layout.columns and name not in taken
    }
    further = checked(Layout, {"columns": columns}, where, strict=False).columns
    return layout.model_copy(update={"columns": {**further, **layout.columns}})


def to_si(values: Any, signal: str, column: Column, quantity: str) -> Any:
    """Numbers of a column as the signal they stand for, in SI.

    Raises:
        InputError: its unit is none of that quantity.
    """
    factor = -column.factor if column.flip else column.factor
    units = UNITS[quantity]
    if column.unit is not None and column.unit not in units:
        raise InputError(no_unit(column.unit, signal, units))
    with np.errstate(over="ignore"):  # an infinite number is no measurement, and counts as dropped
        return (factor * values + column.offset) * units.get(column.unit or "", 1.0)


def degrees(minutes: np.ndarray) -> np.ndarray:
    """Degrees of numbers (n,) in degrees and minutes, as 6325.8 is 63.43."""
    whole = np.floor(np.abs(minutes) / 100.0)
    return np.copysign(whole + (np.abs(minutes) - 100.0 * whole) / 60.0, minutes)


def beside(path: Path) -> Path:
    """The JSON file of a measurement alone."""
    return path.with_name(f"{path.name}.json")


def side_cars(path: Path) -> list[Path]:
    """The JSON files that say how to read a measurement: that of its folder, then its own."""
    return [file for file in (path.with_name(FOLDER_FILE), beside(path)) if file.is_file()]


def read_layout(path: Path) -> Layout | None:
    """What the JSON file beside a measurement says, and that of its folder; None if there is neither.

    Raises:
        InputError: one is not as it should be, or leaves a name blank.
    """
    found = stated_layout(path)
    blank = next((s for s, c in found.columns.items() if not c.name.strip()), None) if found else None
    if blank is not None:
        *_, file = (f for f in side_cars(path) if blank in _layout_in(f).columns)
        raise InputError(
            f"'{file}': columns.{blank} is blank; put the name of its column there "
            f"(cybership columns '{path}' lists likely ones), or delete the entry"
            + stated_otherwise(blank, "; if {}, with {} in its place")
        )
    return found


def stated_otherwise(signal: str, so: str) -> str:
    """What states how a command or the time is known without a column; else nothing."""
    if signal == "time":
        return so.format("rows are evenly spaced", '"period": SECONDS beside "columns"')
    if "." in signal:
        return so.format("it was never used", f'"unused": ["{signal}"] beside "columns"')
    return ""


def stated_layout(path: Path) -> Layout | None:
    """The same, in which names may be blank.

    Raises:
        InputError: one is not as it should be.
    """
    found = [_layout_in(file).model_dump(exclude_unset=True) for file in side_cars(path)]
    if not found:
        return None
    columns = {s: c for layout in found for s, c in layout.get("columns", {}).items()}
    stated = {key: value for layout in found for key, value in layout.items()}
    return Layout.model_validate(stated | {"columns": columns})


def _layout_in(beside: Path) -> Layout:
    return read_model(beside, Layout, "a side-car", strict=False)


def signals(layout: Layout, names: Sequence[str], where: str, of: Ship) -> list[str]:
    """The signals of a run that a file has: time, pose, commands in one form or more, and others.

    A force on an axis that is never commanded needs no column, unless one has nearly its name.

    Raises:
        InputError: a column is missing, or there twice.
    """
    every = _forms(of)
    groups = [g for g in every if any(layout.column(s).name in names for s in g)]
    known = quantities(of)
    commands = {s for group in every for s in group}
    _check_names(layout, known, commands, where)
    if not groups:
        forms = ", or ".join(", ".join(group) for group in every)
        raise InputError(
            f"{where} has no commands: {forms}{nearest(every[0][0], names)}; "
            f"{PROPOSE}, and 'cybership join' adds those of another file"
        )
    power = of.power_settings
    if tuple(of.command_forms[-1]) in groups and any(layout.column(s).name in names for s in power):
        groups.append(power)
    wanted = dict.fromkeys(["time", *POSE, *[s for g in groups for s in g]])
    named: Collection[str] = ()
    if layout != log_of(of.commands):  # of a log of ours only what a ship would measure is read
        named = layout.columns.keys()
        others = [s for s in (*BESIDE, *outputs(of.commands)) if layout.column(s).name in names]
        wanted |= dict.fromkeys((*named, *others))
    there = {layout.column(s).name for s in wanted}
    others = [name.casefold().replace("_", "") for name in names if name not in there]
    for signal in [s for s in wanted if s not in layout.without_column]:
        name = layout.column(signal).name
        if names.count(name) > 1:
            raise InputError(f"{where} has the column '{name}' more than once")
        nearly = any(signal.casefold().replace("_", "") in other for other in others)
        if name not in names and signal in TAU and signal not in named and not nearly:
            del wanted[signal]
        elif name not in names:
            meant = f" (for {signal})" if name != signal else ""
            known = nearest(name, names)
            propose = "" if signal in named else f"; {PROPOSE}"
            propose += stated_otherwise(signal, "; if {}, put {}")
            raise InputError(f"{where} has no column '{name}'{meant}{known}{propose}")
    return [s for s in wanted if s not in layout.without_column]


def _check_names(layout: Layout, known: Collection[str], commands: Collection[str], where: str) -> None:
    """Refuse what is not a signal of a run, or not a command."""
    if strange := next((signal for signal in layout.columns if signal not in known), None):
        raise InputError(f"{where}: {quoted(strange)} is not a signal of a run{nearest(strange, known)}")
    if strange := next((signal for signal in layout.unused if signal not in commands), None):
        raise InputError(
            f"{where}: unused: {quoted(strange)} is not a command{nearest(strange, commands)}"
        )


def missing(layout: Layout, names: Sequence[str], of: Ship) -> list[str]:
    """Signals that a run must have, and of which no column is known."""
    every = _forms(of)
    there = [g for g in every if any(layout.column(s).name in names for s in g)]
    # Of forces that are there, those on other axes are taken as zero.
    needed = [s for g in there if g != TAU for s in g] if there else _meant(every, names)
    wanted = [s for s in ("time", *POSE, *needed) if s not in layout.without_column]
    return [s for s in wanted if layout.column(s).name not in names]


def _meant(forms: Sequence[tuple[str, ...]], names: Iterable[str]) -> tuple[str, ...]:
    """The form of commands with words of which the most columns are called, else the first."""
    words = [{*words_of(name)} for name in names]
    own = [{w for s in form for w in words_of(s) if len(w) > 1} for form in forms]
    return max(zip(forms, own, strict=True), key=lambda each: sum(bool(each[1] & w) for w in words))[0]


def _forms(of: Ship) -> list[tuple[str, ...]]:
    """Forms of a ship's commands, the one that is meant where there is none first."""
    own = [tuple(form) for form in of.command_forms]
    return [TAU, *own] if of.fully_actuated else [*own, TAU]
