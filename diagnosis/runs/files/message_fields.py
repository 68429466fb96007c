"""Fields of messages that a table has in several columns: the heading of a quaternion, a time stamp.

Such a field has the name that its columns begin with: ``pose.orientation`` of ``pose.orientation.x``.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.constants import nano

from ..columns.name_words import words_of

MARKS = "./_"  # between the name of a field and that of its part, where there is one


class MessageField(NamedTuple):
    """A field of a message.

    Attributes:
        columns: that hold its parts.
        value: its value by these.
        is_ros: whether its axes are those of ROS: east, north and up; north, east and down otherwise.
    """

    columns: Sequence[str]
    value: Callable[..., np.ndarray]
    is_ros: bool


def heading(x: np.ndarray, y: np.ndarray, z: np.ndarray, w: np.ndarray) -> np.ndarray:
    """The rotation [rad] about the third axis by a quaternion of any length; NaN where that is zero."""
    about = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return np.where(x * x + y * y + z * z + w * w > 0.0, about, np.nan)


def stamp(whole: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """A time [s] by its whole seconds and the nanoseconds after them."""
    return whole + nano * rest


def calendar(*parts: np.ndarray) -> np.ndarray:
    """A time [s] by year, month, day, hour, minute and second; NaN where one is missing."""
    names = ("year", "month", "day", "hour", "minute", "second")
    stamps = pd.to_datetime(pd.DataFrame(dict(zip(names, parts, strict=True))), errors="coerce")
    return np.asarray((stamps - pd.Timestamp(0)) / pd.Timedelta(seconds=1), float)


ARRAY = ("[1]", "[2]", "[3]", "[0]")  # of a quaternion as PX4 logs it: its real part is first
PARTS: Mapping[tuple[str, ...], Callable[..., np.ndarray]] = {
    ("x", "y", "z", "w"): heading,
    ("sec", "nanosec"): stamp,
    ("secs", "nsecs"): stamp,
    ARRAY: heading,
}
# Parts of a date, each with other names that it has.
DATE = tuple(
    frozenset(names.split())
    for names in ("year yr yyyy", "month mon", "day", "hour hr hh", "minute min", "second sec ss")
)
QUATERNION = frozenset(("q", "quat", "quaternion"))  # last words of the names of such an array


def message_fields(names: Collection[str]) -> dict[str, MessageField]:
    """Name of a field -> its columns, of all fields that a table with columns of some names has."""
    found: dict[str, MessageField] = {}
    for parts, value in PARTS.items():
        for name in names:
            begin = name.removesuffix(parts[-1])
            columns = [begin + part for part in parts]
            if begin == name or not set(columns) <= set(names):
                continue
            if parts is not ARRAY and (field := begin.rstrip(MARKS)):
                found[field] = MessageField(columns, value, is_ros=True)
            elif parts is ARRAY and not QUATERNION.isdisjoint(words_of(begin)[-1:]):
                found[begin] = MessageField(columns, value, is_ros=False)
    dated = [[name for name in names if name.strip().casefold() in part] for part in DATE]
    if all(len(each) == 1 for each in dated):
        found["datetime"] = MessageField([each[0] for each in dated], calendar, is_ros=False)
    return found
