"""The columns of a table that their names and units tell."""

import json
import re
from collections.abc import Collection, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import NoReturn

from cosim import InputError

from ..files.tables import MeasuredTable
from .columns import UNITS, Column, no_unit
from .geographic import WORDS
from .likely_columns import (
    MEASURED,
    ORDERS,
    SIGN,
    is_of_shaft,
    is_steering,
    meaning_of_words,
    names_no_other_machine,
    signal_of_symbol,
    unit_in,
)
from .name_units import NAMED_UNITS, NO_UNIT, bare_name, unit_at_the_end, without_unit
from .name_words import is_magnetic, words_of
from .unit_check import SI_UNIT
from .units_by_numbers import is_fraction, is_stamped, names_of
from .usual_names import is_quaternion, meaning

LETTERS = ("R", "T", "U", "V")  # that are no yaw rate, time and velocity without a unit
SIGNED = ("shaft speed", "command")  # quantities whose sign may have a column of its own
PATH = re.compile(r"[./]")  # between the parts of a name with a path


def named_columns(
    table: MeasuredTable,
    names: Sequence[str],
    units: Sequence[str],
    quantity: Mapping[str, str],
    kept: Mapping[str, Column],
    fields: Collection[str] = (),
) -> dict[str, Column]:
    """The columns that names and units tell; of two for one signal, that of its own name or the first.

    A magnetic heading is the last of several.

    Those that are stated are kept. A name of which words alone are known counts where it has a unit of
    the signal, and no other column is as likely.
    """
    columns = dict(kept)
    free = [pair for pair in zip(names, units, strict=False) if pair[0] not in names_of(kept)]
    for name, below in sorted(free, key=lambda p: (p[0] not in quantity, is_magnetic(p[0]))):
        bare, unit = bare_name(name, below)
        signal, flip = meaning(bare, quantity)
        if not signal:
            bare, unit = unit_at_the_end(bare)
            signal, flip = meaning(bare, quantity)
            if unit not in UNITS.get(quantity.get(signal, ""), {}):
                continue
        if signal in columns or _is_beside_speed(bare, names) or _is_letter(bare, unit, names):
            continue
        if is_quaternion(bare) and name not in fields:  # q is the pitch rate as well
            continue
        known = UNITS[quantity[signal]]
        if signal == "time" and unit not in known and is_stamped(table, name):
            unit = ""  # a time zone, or the form of the stamps
        if unit not in known and (unit.isdigit() or (bare != signal and unit in NAMED_UNITS)):
            continue  # an index, or of another quantity: n in rps is no position to the north
        if unit not in NO_UNIT and unit not in known:
            refuse_unit(table.path, signal, name, unit, quantity)
        is_si = known.get(unit, 1.0) == 1.0
        columns[signal] = Column(name=name, unit=None if is_si else unit, flip=flip)
    found = _by_words([pair for pair in free if pair[0] not in names_of(columns)], columns, quantity)
    columns |= {s: c for s, c in found.items() if not is_fraction(table, s, c, quantity)}
    return {s: columns[s] for s in (*quantity, *kept) if s in columns}


def refuse_unit(path: Path, signal: str, name: str, unit: str, quantity: Mapping[str, str]) -> NoReturn:
    """Refuse a column in a unit that its signal cannot have, with the line that states a factor."""
    line = json.dumps({"columns": {signal: {"name": name, "factor": 1.0}}}, ensure_ascii=False)
    raise InputError(
        f"'{path}', column '{name}': {no_unit(unit, signal, UNITS[quantity[signal]])}; "
        f"if it is another one, put {line} with its factor to {SI_UNIT[quantity[signal]]} "
        f"into '{path}.json'"
    )


def _is_beside_speed(name: str, names: Sequence[str]) -> bool:
    """Whether a name is ``ax`` beside ``vx``: along the axes of that, which are not known."""
    low, axis = name.casefold(), name[-1:].casefold()
    return low.endswith(("ax", "ay")) and f"{low[:-2]}v{axis}" in {n.casefold() for n in names}


def _is_letter(name: str, unit: str, names: Sequence[str]) -> bool:
    """Whether a name is a letter that more often means another quantity than a signal.

    ``n`` and ``e`` alone, or beside a latitude, are revolutions and an error. Capitals without a unit
    are a voltage (U, V), a temperature (T), a resistance or radius (R).
    """
    if name.casefold() not in ("n", "e"):
        return name in LETTERS and unit in NO_UNIT
    bare = [without_unit(each, "")[0].casefold() for each in names]
    return not {"n", "e"} <= {*bare} or any(not WORDS["x"].isdisjoint(words_of(each)) for each in bare)


def _by_words(
    free: Sequence[tuple[str, str]], columns: Mapping[str, Column], quantity: Mapping[str, str]
) -> dict[str, Column]:
    """Signals that words of names and units tell of columns (name, unit below), where one alone does.

    The part of a path that all names with a path have in common, as of a device, tells nothing.
    """
    found: dict[str, list[Column]] = {}
    only: dict[str, list[Column]] = {"shaft speed": [], "angle": []}  # of a ship with one of them
    paths = [parts for name, _ in free if (parts := PATH.split(name)[:-1])]
    common = [p[0] for p in takewhile(lambda p: len({*p}) == 1, zip(*paths, strict=False))]
    for name, below in free:
        bare, unit = without_unit(name, below)
        unit = unit or unit_in(bare)
        parts = PATH.split(bare)
        own = " ".join(parts[len(common) :] if parts[: len(common)] == common else parts)
        is_sign = not unit and not SIGN.isdisjoint(words_of(bare))  # shaft_dir is no speed of a shaft
        signal = signal_of_symbol(bare, unit, quantity) or meaning_of_words(own, unit, quantity)
        if is_sign and (quantity.get(signal) in SIGNED or is_of_shaft(own, unit)):
            continue
        if signal:
            is_si = UNITS[quantity[signal]].get(unit, 1.0) == 1.0
            found.setdefault(signal, []).append(Column(name=name, unit=None if is_si else unit))
        elif is_of_shaft(own, unit):
            only["shaft speed"].append(Column(name=name, unit=unit))
        elif unit in UNITS["angle"] and is_steering(own):
            only["angle"].append(Column(name=name, unit=unit))
    for kind, stated in only.items():
        left = [s for s, q in quantity.items() if q == kind and "." in s and s not in {*columns, *found}]
        bare = [c for c in stated if names_no_other_machine(c.name)]
        of_one = _orders(bare or stated)
        if len(left) == len(of_one) == 1:
            found[left[0]] = of_one
    # Beside a command its sign may have a column, as rudder_dir beside rudder_deg.
    own = {
        s: [c for c in each if SIGN.isdisjoint(words_of(c.name))] or each for s, each in found.items()
    }
    own = {s: _orders(each) if "." in s else each for s, each in own.items()}
    own |= {f"{s}_2": [each.pop()] for s, each in own.items() if f"{s}_2" in quantity and _are_two(each)}
    return {s: each[0] for s, each in own.items() if len(each) == 1 and s not in columns}


def _orders(columns: list[Column]) -> list[Column]:
    """Columns of a command: those called orders, else those not called measured, else the latter."""
    words = [{*words_of(column.name)} for column in columns]
    orders = [c for c, own in zip(columns, words, strict=True) if not ORDERS.isdisjoint(own)]
    others = [c for c, own in zip(columns, words, strict=True) if MEASURED not in own]
    return orders or others or [c.model_copy(update={"measured": True}) for c in columns]


def _are_two(columns: list[Column]) -> bool:
    """Whether columns are those of two sensors, by numbers in their names, and in their order."""
    number = {c.name: [int(w) for w in words_of(c.name) if w.isdigit()] for c in columns}
    columns.sort(key=lambda c: number[c.name])
    return len(columns) == 2 and all(number.values()) and len({*map(str, number.values())}) == 2
