"""Names that columns of measurements usually have, and the signals that they mean."""

import re
from collections.abc import Iterable

from .columns import QUANTITY
from .name_words import words_of

QUATERNION = "orientation quaternion quat q"  # a heading, if it has four parts
# Other names of signals that files use, without case, blanks and marks between words.
CALLED = {
    "time": (
        "t timestamp datetime utc utctime timeutc datetimeutc utcdatetime timestamputc gpstime "
        "elapsedtime seconds stamp epoch unixtime timesincestart xvalue gpst logtime timeofweek "
        "gpstimeofweek tow gpstow itow secondsofweek sow gpssow gpsseconds "
        "timeofday datenum ticks filetime"
    ),
    "x": (
        "north northing n posx positionx xn posn positionnorth posnorth utmn northings xnorth ynorth "
        "posxnorth posynorth x0"
    ),
    "y": (
        "east easting e posy positiony ye pose positioneast poseast utme eastings xeast yeast "
        "posxeast posyeast y0"
    ),
    "psi": (
        "heading yaw hdg headingangle yawangle trueheading hdt magneticheading hdm compass gyro "
        f"gyrocompass {QUATERNION} compassheading gyroheading headingtrue headingmagnetic"
    ),
    "tau_X": "surgeforce forcex forcesurge fx taux tausurge tau1",
    "tau_Y": "swayforce forcey forcesway fy tauy tausway tau2",
    "tau_N": "yawmoment momentyaw momentz mz taun tauyaw taupsi tau3",
    "u": "surgespeed surgevelocity velocitysurge",
    "v": "swayspeed swayvelocity velocitysway",
    "r": "yawrate rateofturn rot psidot headingrate",
    "x_dot": "velocitynorth northvelocity xdot vn",
    "y_dot": "velocityeast eastvelocity ydot ve",
    "speed": "sog speedoverground",
    "course": "cog courseoverground courseovergroundtrue",
    "u_water": "stw speedthroughwater",
    "wind_speed": "truewindspeed tws",
    "wind_direction": "truewinddirection truewinddir truewindangle twd",
    "wind_speed_relative": "relativewindspeed relwindspeed windspeedrel apparentwindspeed rws aws",
    "wind_direction_relative": (
        "relativewinddirection relativewinddir relativewindangle relwinddirection relwinddir "
        "relwindangle winddirectionrel apparentwinddirection apparentwindangle rwd rwa awa"
    ),
}
VALUE = frozenset(("value", "val", "reading", "data"))  # of all values, of a table with one in a row
EAST = "est"  # in French and Italian, as a whole name; as a part of one it is an estimate
OPPOSITE = {"south": "x", "west": "y"}  # of those that point the other way


def _folded(name: str) -> str:
    """A name without case, blanks, marks between words, and the zone of UTM."""
    name = re.sub(r"(?i)(?<=utm)[\W_]*\d{1,2}[a-z]?(?=[\W_])", "", name)
    return re.sub(r"[\W_]", "", name).casefold()


# What a column may be called -> signal, and whether its axis points the other way.
MEANT = (
    {_folded(name): (signal, True) for name, signal in OPPOSITE.items()}
    | {_folded(name): (signal, False) for signal, names in CALLED.items() for name in names.split()}
    | {_folded(signal): (signal, False) for signal in QUANTITY}
)


def is_quaternion(name: str) -> bool:
    """Whether the last part of a name is that of a quaternion."""
    return _folded(re.split("[/.]", name)[-1]) in QUATERNION.split()


def value_column(names: Iterable[str]) -> str | None:
    """The column that is called as that of a table with one value in a row; None: none is."""
    return next((name for name in names if "".join(words_of(name)) in VALUE), None)


def meaning(name: str, signals: Iterable[str]) -> tuple[str, bool]:
    """Which of some signals a name means, and whether its axis points the other way.

    Of a name with a path, as ``/gnss/pose/position/x`` or ``pose.position.x``, the last two parts or the
    last one count; after a dot a letter alone, but t, is a part of any vector, and means nothing.

    Returns:
        An empty name where it means none of them.
    """
    known = MEANT | {_folded(signal): (signal, False) for signal in signals}
    if _folded(name) == EAST and "y" in signals:
        return "y", False
    parts = re.split("[/.]", name)
    parts[-2:-1] = [part.rpartition("_")[2] for part in parts[-2:-1]]  # vehicle_local_position.x
    last = parts[-1] if len(parts[-1]) > 1 or parts[-1] == "t" or "." not in name else ""
    if len(parts) > 1 and parts[-1].casefold() in VALUE:
        return meaning(".".join(parts[:-1]), signals)  # North.Value of OPC
    for part in (name, "".join(parts[-2:]), last):
        for said in (_folded(part), "".join(words_of(part))):
            found = known.get(said, ("", False))
            if found[0] in signals:
                return found
    return "", False
