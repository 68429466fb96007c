"""Units of columns: their factors to SI, and those that a run cannot be in, whatever the ship."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy import constants as c

from cosim import InputError
from fmus.scale import REFERENCE, Scale

from ..run_constants import CHANCE, NEGLIGIBLE, WIDTH

# Quantity -> its units, that of SI first -> factor to that [1].
UNITS: dict[str, dict[str, float]] = {
    "time": {
        "s": 1.0,
        "ms": c.milli,
        "us": c.micro,
        "ns": c.nano,
        "d": c.day,
        "h": c.hour,
        "min": c.minute,
    },
    "length": {"m": 1.0, "mm": c.milli, "cm": c.centi, "km": c.kilo, "ft": c.foot, "in": c.inch},
    "angle": {"rad": 1.0, "deg": c.degree, "°": c.degree, "gon": 0.9 * c.degree},
    "force": {"N": 1.0, "mN": c.milli, "kN": c.kilo},
    "moment": {"N.m": 1.0, "N.mm": c.milli, "N.cm": c.centi, "kN.m": c.kilo},
    "command": {"1": 1.0, "%": c.centi},
    "shaft speed": {"1/s": 1.0, "rps": 1.0, "rpm": 1.0 / c.minute, "rad/s": 1.0 / math.tau},
    "speed": {"m/s": 1.0, "mm/s": c.milli, "cm/s": c.centi, "km/h": c.kmh, "kn": c.knot},
    "rate": {"rad/s": 1.0, "deg/s": c.degree, "°/s": c.degree, "deg/min": c.degree / c.minute},
    "acceleration": {"m/s2": 1.0, "mm/s2": c.milli, "g": c.g},
    "angular acceleration": {"rad/s2": 1.0, "deg/s2": c.degree},
}
# Units that columns state: numbers of commands alone would not tell them from others.
STATED = frozenset(("gon",))
# Other spellings of units in files -> the one above.
SPELT = {
    **{unit.replace(".", mark): unit for unit in UNITS["moment"] for mark in ("", "·", "*", " ", "-")},
    **dict.fromkeys(("kt", "kts", "knot", "knots", "nd"), "kn"),  # codespell:ignore
    **dict.fromkeys(("degree", "degrees", "grader", "Grad", "graden", "grados", "gradi"), "deg"),
    **dict.fromkeys(("graus", "stopnie", "stopni", "度"), "deg"),
    **dict.fromkeys(("deg T", "deg M", "deg true", "degT", "degM", "°T", "°M"), "deg"),
    **dict.fromkeys(("gons", "grade", "grades"), "gon"),
    **dict.fromkeys(("sec", "seconds"), "s"),
    **dict.fromkeys(("day", "days"), "d"),
    **dict.fromkeys(("hour", "hours", "hr", "hrs"), "h"),
    **{f"{unit}ec": unit for unit in ("ms", "us", "ns")},
    **dict.fromkeys(("millis", "milliseconds"), "ms"),
    **dict.fromkeys(("micros", "microseconds"), "us"),
    **dict.fromkeys(("pct", "percent"), "%"),
    **dict.fromkeys(("m/s²", "m/s^2", "m.s-2"), "m/s2"),
    **dict.fromkeys(("m.s-1", "m s-1", "m s^-1"), "m/s"),
    **dict.fromkeys(("1/min", "min-1", "min^-1", "r/min", "rev/min", "U/min", "tr/min"), "rpm"),
    **dict.fromkeys(("o/min", "omdr/min", "omw/min", "varv/min", "giri/min", "obr/min"), "rpm"),
    **dict.fromkeys(("°/min",), "deg/min"),
    **{f"{unit}/sec": f"{unit}/s" for unit in ("m", "rad", "deg")},
}
WORDS = (
    *("rpm", "rps", "deg", "degree", "degrees", "kts", "knot", "knots", "sec", "seconds"),
    *("pct", "percent"),
)
SI_UNIT = {quantity: next(iter(units)) for quantity, units in UNITS.items()}
NAMED_SO: Mapping[str, str] = {}  # columns have the names of their signals
GO_ON = "--anyway continues nevertheless"
OFTENEST = 1e-4  # s between two samples; no camera is quicker (chosen)
# s of a run, m or rad of a pose, N or N m of a force, times the full power: no ship has as much, and
# sums of squares are far from overflow (chosen). A pose beyond it is missing.
LARGEST = 1e9
# Beyond these no ship moves, so that the unit must be another one (chosen).
FASTEST, QUICKEST = 30.0, 3.0  # m/s, rad/s
# m/s, times the scale of the ship: a Froude number of 0.12, where most ships manoeuvre (chosen); it only
# orders units ten times apart.
USUAL = 0.4
TURN = 360.0  # degrees, all the way round
# 1, counts in a turn: tenths and hundredths of a degree, as of some compasses and of MAVLink, gon, mils,
# parts of 16 bits, thousandths of a radian.
COUNTS = (10.0 * TURN, 100.0 * TURN, 400.0, 6400.0, 65536.0, 2000.0 * math.pi)
AHEAD = 0.5  # 1, of the way that a constant heading does not explain, what one in degrees does (chosen)


class Doubt(NamedTuple):
    """Signals that seem to be in another unit: which, in which, and why."""

    signals: tuple[str, ...]
    unit: str
    reason: str


def largest(quantity: str) -> float:
    """The largest number in SI of a column or variable, with what overshoots: a turn, the full command.

    Infinite for quantities of which none is known.
    """
    return (1.0 + NEGLIGIBLE) * {"angle": math.tau, "command": 1.0, "rate": QUICKEST}.get(
        quantity, math.inf
    )


def spelt(unit: str) -> str:
    """A unit as this project spells it: ``Nm`` is ``N.m``; one that is not known stays.

    Capitals count in symbols (``mN``) and not in words (``Knots``). What follows ``since`` is no unit.
    """
    unit = unit.partition(" since ")[0]
    word = unit.lower() if unit.lower() in WORDS else unit
    return SPELT.get(word, word)


def refuse_time(
    row: float, seconds: float, where: str, called: Mapping[str, str], scale: Scale = REFERENCE
) -> None:
    """Refuse a time in another unit than stated, by the median between two rows and the length [s].

    Raises:
        InputError: rows are too rare or too frequent, or the run is too long.
    """
    rare = row > WIDTH * scale.time
    if rare or row < OFTENEST:
        unit = likely_unit(row)
        what_to_do = f" {remedy(('time',), unit, called)}" if unit else ""
        raise InputError(
            f"{where}: a sample each {row:.4g} s is too {'rare' if rare else 'frequent'}; "
            f"is the time in another unit?{what_to_do}"
        )
    if seconds > LARGEST:
        raise InputError(f"{where} lasts {seconds:.3g} s: a time stamp is wrong")


def refuse_units(
    time: np.ndarray,
    pose: np.ndarray,
    angles: Mapping[str, np.ndarray],
    where: str,
    anyway: bool,
    called: Mapping[str, str],
    scale: Scale = REFERENCE,
) -> None:
    """Refuse units of a pose (n, 3), as it was read at times (n,) [s], that no ship's motion can be in.

    Args:
        time, pose: as in :func:`doubts`.
        angles: other angles of the run, by their signals.
        scale: of the ship.

    Raises:
        InputError: it goes or turns too fast, or an angle is in degrees.
    """
    if anyway:
        return
    for signals, unit, reason in chain(doubts(time, pose, scale), doubts_of_angles(angles)):
        raise InputError(f"{where} {reason} {remedy(signals, unit, called)}; {GO_ON}")


def doubts(time: np.ndarray, pose: np.ndarray, scale: Scale = REFERENCE) -> Iterator[Doubt]:
    """Units that no ship's motion can be in, of a pose (n, 3) as it was read at valid times (n,) [s].

    Position and heading are NaN in rows without their measurement. Of several possible units that of the
    usual speed of a ship of this scale is the likeliest.
    """
    there, turned = np.isfinite(pose[:, :2]).all(axis=1), np.isfinite(pose[:, 2])
    if there.sum() < 2 or not turned.any():
        return
    heading = np.interp(time[there], time[turned], pose[turned, 2])
    time, pose = time[there], np.column_stack([pose[there, :2], heading])
    second = np.searchsorted(time, time + 1.0)
    second = second[second < time.size]
    dt, step = time[second] - time[: second.size], pose[second] - pose[: second.size]
    moved = np.abs(step) / dt[:, None]
    speed = float(np.median(np.hypot(moved[:, 0], moved[:, 1]))) if dt.size else 0.0
    if speed > FASTEST:
        slow = (u for u, size in UNITS["length"].items() if speed * size < FASTEST)
        usual = USUAL * scale.speed
        units = sorted(slow, key=lambda u: abs(math.log(speed * UNITS["length"][u] / usual)))
        reason = f"goes {speed:.3g} m/s: is its position in {' or '.join(units)}?"
        yield Doubt(("x", "y"), units[0] if units else "mm", reason)
    psi = pose[:, 2]
    reach = float(np.quantile(np.abs(psi), 0.9))
    if reach <= math.tau:
        return
    jumps = np.abs(np.abs(np.diff(psi)) - 360.0) < 10.0
    turn = float(np.quantile(moved[:, 2], 0.75)) if dt.size else 0.0
    if turn > QUICKEST or (jumps.any() and reach < 365.0):
        reason = f"turns at {turn:.3g} rad/s or jumps by 360: is its heading in deg?"
        yield Doubt(("psi",), "deg", reason)
        return
    way, start = step[:, 0] + 1j * step[:, 1], psi[: second.size]
    still, in_rad, in_deg = (follows(way, start * unit) for unit in (0.0, 1.0, c.degree))
    if in_rad < still and in_deg - still > AHEAD * (1.0 - still):
        reason = f"goes where its heading is only in degrees ({in_deg:.0%} of the way): is it in deg?"
        yield Doubt(("psi",), "deg", reason)


def part_of_degree(pose: np.ndarray) -> float:
    """The part of a degree that the heading of a pose (n, 3) is in, within a turn; 1: whole ones.

    Where it goes from the end of a turn to the beginning, it jumps by the counts of one. Where it does
    not, it is in degrees, in tenths or in hundredths, whichever the ship's way follows.
    """
    there = np.isfinite(pose).all(axis=1)
    psi = pose[there, 2]
    most, steps = _most(psi), np.abs(np.diff(psi))
    if most > TURN and (jumps := steps[(2.0 * steps > most) & (steps < 2.0 * most)]).size:
        return TURN / min((TURN, *COUNTS), key=lambda n: abs(np.median(jumps) - n))
    if most <= 2.0 * TURN:
        return 1.0
    way = np.diff(pose[there, 0]) + 1j * np.diff(pose[there, 1])
    within = [1.0, *(TURN / n for n in COUNTS[:2] if most <= n)]
    return max(within, key=lambda part: follows(way, psi[:-1] * c.degree * part))


def part_by_span(angle: np.ndarray) -> float | None:
    """The part of a degree that an angle (n,) is in that is anywhere in a turn; None: it is not known.

    An angle that jumps as it likes spans hardly less than the counts of a turn, or less than 360.
    """
    span = float(np.nanmax(angle) - np.nanmin(angle))
    if span <= TURN:
        return 1.0 if _most(angle) <= TURN else None
    turn = min((n for n in COUNTS if n >= span), default=math.inf)
    return TURN / turn if span > (1.0 - NEGLIGIBLE) * turn else None


def _most(angle: np.ndarray) -> float:
    """The largest size of an angle (n,), without spikes; 0 where there is none."""
    known = np.abs(angle[np.isfinite(angle)])
    return float(np.quantile(known, 1.0 - CHANCE)) if known.size else 0.0


def doubts_of_angles(angles: Mapping[str, np.ndarray]) -> Iterator[Doubt]:
    """Angles (signal -> (n,), NaN where missing) that are in degrees: none in rad has such values.

    One in rad is within a turn, or it begins there and goes on without a jump by half a turn.
    """
    turn = largest("angle")
    for signal, values in angles.items():
        values = values[np.isfinite(values)]
        if values.size == 0 or np.quantile(np.abs(values), 0.9) <= turn:
            continue
        if abs(values[0]) > turn or np.abs(np.diff(values)).max() > math.pi:
            yield Doubt(
                (signal,),
                "deg",
                f"has {signal} up to {np.abs(values).max():.4g}: is it in deg, or in a part of one?",
            )


def follows(way: np.ndarray, psi: np.ndarray) -> float:
    """Share of a way that is in one direction as seen from the ship, 0...1 (mean resultant length).

    Args:
        way: (n,), steps to the north plus i times those to the east [m].
        psi: (n,), headings [rad].
    """
    length = float(np.abs(way).sum())
    return float(np.abs(np.sum(way * np.exp(-1j * psi)))) / length if length else 0.0


def remedy(signals: Sequence[str], unit: str, called: Mapping[str, str] = NAMED_SO) -> str:
    """The line that states a unit."""
    columns = {s: {"name": called.get(s, s), "unit": unit} for s in signals}
    line = json.dumps({"columns": columns}, ensure_ascii=False)
    return f"Then put {line} into its side-car, the .json file next to it"


def likely_unit(row: float) -> str | None:
    """The unit of a time in which a row each so many seconds is neither too rare nor too frequent."""
    units = ((unit, row * size) for unit, size in UNITS["time"].items() if unit != "s")
    return next((unit for unit, period in units if OFTENEST <= period < WIDTH), None)
