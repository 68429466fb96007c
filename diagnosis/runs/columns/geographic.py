"""Columns of latitude and longitude as metres to north and east, by a factor and an offset each.

    x = M (latitude - latitude_0),    y = N cos(latitude_0) (longitude - longitude_0)

with the radii of curvature M and N of the ellipsoid of WGS 84 at the median position, the origin. The
relative error of y is tan(latitude) times the distance to north over the earth's radius: at 60 degrees
0.03 % for a kilometre.
"""

import re
from collections.abc import Mapping, Sequence
from math import tau

import numpy as np
import pandas as pd

from cosim import InputError

from ..run_constants import NEGLIGIBLE
from .columns import Column
from .name_words import words_of
from .unit_check import TURN, UNITS

EQUATOR, SQUARED_ECCENTRICITY = 6_378_137.0, 6.694_379_990_14e-3  # m, 1; WGS 84
SIDES = {"x": "NS", "y": "EW"}  # letters of the hemispheres, the negative one last
NEAR_ZERO = 0.1  # 1, of both angles: 11 km about the origin in degrees (chosen)
# degrees, of whole numbers in messages of receivers and of MAVLink, and of AIS (ITU-R M.1371)
WHOLE, AIS = 1e-7, 1.0 / 600_000.0
NOT_AVAILABLE = {"x": 91.0, "y": 181.0}  # degrees, where there is no position (ITU-R M.1371, AIS)
TURNS = TURN, TURN / WHOLE, TURN / AIS, tau  # in degrees, whole numbers, rad
# An angle as a text: 63.44° N, N63.44, 63°26.4'N, 63 26 24.0 N; 63.44°.
ANGLE = re.compile(
    r"(?P<before>[NSEW])?\s*(?P<deg>[+-]?\d+(?:\.\d+)?)(?:\s*[°º]\s*|\s+|(?=[NSEW])|$)"
    r"(?:(?P<min>\d+(?:\.\d+)?)\s*['′’]?\s*)?(?:(?P<s>\d+(?:\.\d+)?)\s*(?:[\"″”]|'')?\s*)?(?P<behind>[NSEW])?"
)
# Words of a name.
WORDS = {"x": {"lat", "latitude"}, "y": {"lon", "lng", "long", "longitude"}}


def geographic_pair(named: Mapping[str, tuple[str, str]], stated: Mapping[str, str]) -> dict[str, str]:
    """Signals x and y -> names of the columns of latitude and longitude; empty without one of each.

    Of several that one counts which is stated, whose name has no other word, or the last part of it, as
    ``GPS.Lat`` beside ``GPS.Lat.Quality``; of receivers with numbers, as ``GPS1 Lat``, the first.

    Args:
        named: column -> its name without the unit, and its unit (empty if not known).
        stated: signal -> its column, if that is stated.
    """
    found = {
        signal: [
            column
            for column, (bare, unit) in named.items()
            if words & {*words_of(bare)} and unit in ("", "-", *UNITS["angle"])
        ]
        for signal, words in WORDS.items()
    }
    for signal, columns in found.items():
        names = {c: named[c][0] for c in columns}
        last = {c: re.split("[./]", name)[-1] for c, name in names.items()}
        for parts in (last, names):  # the narrower one last
            own = [c for c, part in parts.items() if WORDS[signal].issuperset(words_of(part))]
            found[signal] = own if len(own) == 1 else found[signal]
        found[signal] = found[signal] if len(found[signal]) == 1 else _of_first(columns)
        if stated.get(signal) in columns:
            found[signal] = [stated[signal]]
    if any(len(columns) != 1 for columns in found.values()):
        return {}
    return {signal: columns[0] for signal, columns in found.items()}


def _of_first(columns: list[str]) -> list[str]:
    """Of columns whose names differ in a number alone the one with the least; else all."""
    apart = {re.sub(r"\d+", "", column) for column in columns}
    numbers = {column: [int(n) for n in re.findall(r"\d+", column)] for column in columns}
    return [min(columns, key=numbers.__getitem__)] if len(apart) == 1 else columns


def is_of_position(name: str) -> bool:
    """Whether a name is that of a latitude or longitude."""
    return any(words & {*words_of(name)} for words in WORDS.values())


def degrees_in(cells: pd.Series) -> np.ndarray:
    """Degrees (n,) of cells with angles as texts, see :data:`ANGLE`, where all are; else NaN.

    South and west are negative. A cell without a letter of a side has the sign of a degree.
    """
    texts = cells.astype("string").str.strip().str.replace(",", ".")
    there = texts.notna() & (texts != "")
    found = np.full(len(cells), np.nan)
    if not (there.any() and texts[there].str.contains("[NSEW°º]").all()):
        return found
    if not texts[there].str.fullmatch(ANGLE).all():
        return found
    parts = texts.str.extract(ANGLE)
    size = parts[["deg", "min", "s"]].astype(float).fillna({"min": 0.0, "s": 0.0})
    negative = parts["before"].fillna(parts["behind"]).isin(["S", "W"]) | (size["deg"] < 0.0)
    degrees = size["deg"].abs() + size["min"] / 60.0 + size["s"] / 60.0**2
    found[there] = np.where(negative, -degrees, degrees)[there]
    return found


def across_date_line(longitude: np.ndarray) -> np.ndarray:
    """Longitudes (n,), in whatever unit, without the jump of a whole turn at the date line."""
    most = float(np.abs(np.diff(longitude[np.isfinite(longitude)])).max(initial=0.0))
    turn = next((t for t in TURNS if abs(most - t) < NEGLIGIBLE * t), None)
    if turn is None:
        return longitude
    return unwrapped(longitude, turn)


def unwrapped(angle: np.ndarray, turn: float = 2.0 * np.pi) -> np.ndarray:
    """An angle (n,) without jumps by half a turn or more; NaN where it is missing."""
    there = np.isfinite(angle)
    found = np.full(angle.size, np.nan)
    found[there] = np.unwrap(angle[there], period=turn)
    return found


def is_side(cells: pd.Series, letters: str) -> bool:
    """Whether cells are the letters of a hemisphere, the negative one among them."""
    found = {*cells.dropna().astype("string").str.strip()}
    return letters[1] in found and found <= {*letters}


def local_columns(pair: Mapping[str, str], degrees: Mapping[str, np.ndarray]) -> dict[str, Column]:
    """How columns of latitude and longitude are read as x and y [m]; empty where they are none.

    Args:
        pair: of :func:`geographic_pair`.
        degrees: signals x and y -> the numbers (n,) of their columns; zero at both is no position.
    """
    there = np.isfinite(degrees["x"]) & np.isfinite(degrees["y"])
    there &= (degrees["x"] != 0.0) | (degrees["y"] != 0.0)
    if not there.any():
        return {}
    known = {s: values[there] for s, values in degrees.items()}
    scale = _scale(known["x"], known["y"])
    origin = {s: scale * float(np.median(values)) for s, values in known.items()}
    largest = {s: np.radians(scale * np.abs(values).max()) for s, values in known.items()}
    if largest["x"] > np.pi / 2 or largest["y"] > (1.0 + NEGLIGIBLE) * np.pi:
        return {}
    metres, columns = metres_in_degree(origin["x"]), {}
    for signal, name in pair.items():
        in_degree = round(metres[signal], 3)
        offset = round(-in_degree * origin[signal], 3)
        columns[signal] = Column(name=name, factor=float(f"{scale * in_degree:.9g}"), offset=offset)
    return columns


def metres_in_degree(latitude: float) -> dict[str, float]:
    """Length [m] of a degree of latitude (x) and of longitude (y), at a latitude [degrees]."""
    flat = 1.0 - SQUARED_ECCENTRICITY * float(np.sin(np.radians(latitude))) ** 2
    radius = {
        "x": EQUATOR * (1.0 - SQUARED_ECCENTRICITY) / flat**1.5,
        "y": EQUATOR / flat**0.5 * float(np.cos(np.radians(latitude))),
    }
    return {signal: float(np.radians(r)) for signal, r in radius.items()}


def _scale(latitude: np.ndarray, longitude: np.ndarray) -> float:
    """The size of the unit of latitudes and longitudes (n,) [degrees].

    Whole numbers beyond degrees and minutes are in 1/10,000 minutes if both may be, else 1e-7 degrees.
    Both within half a turn in rad are rad. In the smaller unit that would be the Gulf of Guinea. Next to
    zero, where simulations start, they are in degrees.
    """
    values = np.concatenate([latitude, longitude])
    reach = [np.abs(angle).max() for angle in (latitude, longitude)]
    if (values == np.round(values)).all() and max(reach) > 1e6:
        return AIS if AIS * reach[0] <= TURN / 4.0 and AIS * reach[1] <= TURN / 2.0 else WHOLE
    is_rad = reach[0] <= np.pi / 2 and reach[1] <= np.pi and max(reach) > NEAR_ZERO
    return float(np.degrees(1.0)) if is_rad else 1.0


def available(signal: str, degrees: np.ndarray) -> np.ndarray:
    """Latitudes (x) or longitudes (y), in degrees or as AIS sends them, without those that are none."""
    none = NOT_AVAILABLE[signal]
    return np.where(np.isin(np.abs(degrees), (none, none / AIS)), np.nan, degrees)


def is_geographic(signal: str, column: Column) -> bool:
    """Whether the column of x or y is a latitude or longitude, of degrees and nothing else."""
    return column.factor != 1.0 and bool(WORDS[signal] & {*words_of(column.name)})


def refuse_letters(pair: Mapping[str, str], cells: Mapping[str, pd.Series]) -> None:
    """Refuse positions with a letter in each cell.

    Args:
        pair: of :func:`geographic_pair`.
        cells: signals x and y -> the cells (n,) of their columns.

    Raises:
        InputError: no cell of a column is a number.
    """
    for each in (cells[signal].dropna() for signal in pair):
        if each.size and np.isnan(np.asarray(pd.to_numeric(each, errors="coerce"), float)).all():
            raise InputError(
                f"a cell of {' and '.join(pair.values())} is not a number: '{each.iloc[0]}'; write "
                "decimal degrees, negative to south and west"
            )


def are_minutes(x: np.ndarray, y: np.ndarray) -> bool:
    """Whether latitudes and longitudes (n,) are degrees and minutes (ddmm.mmmm), as of NMEA 0183.

    In degrees they would be beyond 90 and 180, and none has minutes beyond 60.
    """
    values = [np.abs(v[np.isfinite(v)]) for v in (x, y)]
    beyond = [v.max(initial=0.0) > most for v, most in zip(values, (90.0, 180.0), strict=True)]
    return any(beyond) and all((v % 100.0 < 60.0).all() and (v < 18_100.0).all() for v in values)


def one_origin(files: Sequence[Mapping[str, Column]]) -> dict[str, Column]:
    """How all of some files are read as x and y [m] of one origin, that of the first.

    Args:
        files: of each signals x and y -> its column, as of :func:`local_columns`.

    Returns:
        Empty where any has no latitude and longitude by the same names, or is so far to north or south
        that the length of a degree of longitude differs by more than 0.25 %.
    """
    pairs = [{s: file.get(s, Column(name="")) for s in WORDS} for file in files]
    for signal in WORDS:
        columns = [pair[signal] for pair in pairs]
        largest, least = (of(abs(c.factor) for c in columns) for of in (max, min))
        if (
            len({(c.name, c.unit, c.flip) for c in columns}) > 1
            or largest > (1.0 + NEGLIGIBLE**2) * least
        ):
            return {}
        if not all(is_geographic(signal, column) for column in columns):
            return {}
    return pairs[0]
