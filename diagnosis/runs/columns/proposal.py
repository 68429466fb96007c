"""The content of the file beside a measurement, proposed by a look at the measurement itself."""

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cosim import InputError
from fmus.ship import Ship, ship

from ..cleaning import in_order, lost, repeated
from ..files.reading import Run, column_names, read
from ..files.text_layout import bare_unit, table_cells, text_layout
from .columns import (
    QUANTITY,
    UNITS,
    UTF_8,
    WITH_UNIT,
    Column,
    Layout,
    log_of,
    no_unit,
    quantities,
    signals,
)
from .unit_check import OFTENEST, RAREST, doubts, likely_unit

UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # how such a text begins
NO_UNIT = ("", "-")
# Other names of signals that files use, without case, blanks and marks between words.
CALLED: dict[str, tuple[str, ...]] = {
    "time": ("t", "timestamp", "datetime", "utc", "utctime", "elapsedtime", "seconds"),
    "x": ("north", "northing", "n", "posx", "positionx", "xn"),
    "y": ("east", "easting", "e", "posy", "positiony", "ye"),
    "psi": ("heading", "yaw", "hdg", "headingangle", "yawangle"),
    "tau_X": ("surgeforce", "forcex", "forcesurge", "fx", "taux", "tausurge", "tau1"),
    "tau_Y": ("swayforce", "forcey", "forcesway", "fy", "tauy", "tausway", "tau2"),
    "tau_N": ("yawmoment", "momentyaw", "momentz", "mz", "taun", "tauyaw", "taupsi", "tau3"),
    "u": ("surgespeed", "surgevelocity", "velocitysurge"),
    "v": ("swayspeed", "swayvelocity", "velocitysway"),
    "r": ("yawrate", "rateofturn", "rot", "psidot", "headingrate"),
    "x_dot": ("velocitynorth", "northvelocity", "xdot", "vn"),
    "y_dot": ("velocityeast", "eastvelocity", "ydot", "ve"),
    "speed": ("sog", "speedoverground"),
    "course": ("cog", "courseoverground"),
    "u_water": ("stw", "speedthroughwater"),
    "wind_speed": ("truewindspeed", "tws"),
    "wind_direction": ("truewinddirection", "twd"),
}
OPPOSITE = {"south": "x", "west": "y"}  # of those that point the other way


def _folded(name: str) -> str:
    """A name without case, blanks and marks between words."""
    return re.sub(r"[\W_]", "", name).casefold()


# What a column may be called -> signal, and whether its axis points the other way.
MEANT = (
    {_folded(name): (signal, True) for name, signal in OPPOSITE.items()}
    | {_folded(name): (signal, False) for signal, names in CALLED.items() for name in names}
    | {_folded(signal): (signal, False) for signal in QUANTITY}
)


def meaning(name: str, signals: Iterable[str]) -> tuple[str, bool]:
    """Which of some signals a name means, and whether its axis points the other way.

    Returns:
        An empty name where it means none of them.
    """
    known = {_folded(signal): (signal, False) for signal in signals}
    found = (MEANT | known).get(_folded(name), ("", False))
    return found if found[0] in signals else ("", False)


class Proposal(NamedTuple):
    """How a measurement seems to be meant.

    Attributes:
        layout: the content of the file beside it.
        unused: names of columns that are no signals, as far as is known.
        run: the measurement, read so.
    """

    layout: Layout
    unused: Sequence[str]
    run: Run

    @property
    def needed(self) -> dict[str, Any]:
        """What has to be stated, as JSON holds it; a log of this project needs nothing."""
        if self.layout.column("x") == log_of(()).column("x"):
            return {}
        told = self.layout.model_dump(exclude_defaults=True)
        for signal, column in told.get("columns", {}).items():
            told["columns"][signal] = column["name"] if column.keys() == {"name"} else column
        return told


def propose(path: Path, of: Ship | None = None) -> Proposal:
    """Look at a file: its text, its names and units, and at the numbers where units are not told.

    Args:
        path: a CSV or Parquet file; what is told beside it does not count.
        of: the ship that was measured; None: the default ship.

    Raises:
        InputError: no such file, no table of numbers below names, a unit that is not known, or a signal
            without a column.
    """
    of = of or ship()
    quantity = quantities(of)
    if path.suffix not in (".csv", ".parquet") or path.is_dir():
        raise InputError(f"'{path}' is not a CSV or Parquet file, whose columns have names")
    text = Layout()
    if path.is_file() and path.suffix == ".csv":
        encoding = _encoding(path)
        found = text_layout(path, encoding)
        if found is None:
            raise InputError(f"'{path}' has no table of numbers below a line of names")
        text = found.model_copy(update={"encoding": encoding})
    elif not path.is_file():
        read(path, of=of)  # says so
    names = column_names(path, text)
    log = log_of(of.commands)
    if log.column("x").name in names:
        return Proposal(log, [], read(path, log, of))
    units = _units_line(path, text) if text.units_line else [""] * len(names)
    columns = _columns(path, names, units, quantity)
    layout = text.model_copy(update={"columns": columns})
    unused = [name for name in names if name not in {layout.column(s).name for s in quantity}]
    try:
        signals(layout, names, f"'{path}'", of)
    except InputError as error:
        more = f"; columns that are no signals as far as is known: {', '.join(unused)}" if unused else ""
        raise InputError(f"{error}{more}") from None
    run = read(path, layout, of)
    for signal, unit in _seen_units(run):
        if not layout.column(signal).unit:
            columns[signal] = layout.column(signal).model_copy(update={"unit": unit})
    needed = {s: c for s, c in columns.items() if c != Column(name=s)}
    layout = text.model_copy(update={"columns": needed})
    return Proposal(layout, unused, read(path, layout, of))


def _encoding(path: Path) -> str:
    content = path.read_bytes()
    if content.startswith(UTF_16):
        return "utf-16"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return UTF_8


def _units_line(path: Path, text: Layout) -> list[str]:
    with path.open(encoding=text.encoding) as file:
        return table_cells(next(islice(file, text.skip + 1, None)), text.separator)


def _columns(
    path: Path, names: Sequence[str], units: Sequence[str], quantity: Mapping[str, str]
) -> dict[str, Column]:
    """The columns that names and units tell; of two for one signal, that of its own name or the first.

    Raises:
        InputError: a unit that is none of the signal.
    """
    columns: dict[str, Column] = {}
    pairs = zip(names, units, strict=False)
    for name, below in sorted(pairs, key=lambda pair: pair[0] not in quantity):
        told = WITH_UNIT.fullmatch(name)
        bare, unit = (told[1], told[2]) if told else (name, bare_unit(below))
        signal, flip = meaning(bare, quantity)
        if not signal:
            bare, _, unit = bare.rpartition("_")  # as x_mm
            signal, flip = meaning(bare, quantity)
            if unit not in UNITS.get(quantity.get(signal, ""), {}):
                continue
        if signal in columns:
            continue
        known = UNITS[quantity[signal]]
        if unit not in NO_UNIT and unit not in known:
            raise InputError(f"'{path}', column '{name}': {no_unit(unit, signal, known)}")
        is_si = known.get(unit, 1.0) == 1.0
        columns[signal] = Column(name=name, unit=None if is_si else unit, flip=flip)
    return columns


def _seen_units(run: Run) -> Iterable[tuple[str, str]]:
    """Signals that seem to be in another unit, and in which."""
    if not np.isfinite(run.time).any():
        return
    run = run.rows(in_order(run.time))
    apart = float(np.median(np.diff(run.time))) if run.time.size > 1 else 1.0
    unit = likely_unit(apart) if not OFTENEST < apart < RAREST else None
    if unit:
        yield "time", unit
    there = ~lost(run.pose)
    fresh = there & ~repeated(run.pose, there)
    if fresh.sum() > 1:
        time = UNITS["time"][unit or "s"] * run.time[fresh]
        for doubt in doubts(time, run.pose[fresh]):
            yield from ((signal, doubt.unit) for signal in doubt.signals)
