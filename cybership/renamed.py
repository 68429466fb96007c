"""Names that users type and that have changed: the old ones are read, with a warning, until version 2.

The tables below are the whole list; CHANGELOG has it for people. In a place ``*`` is any key or entry.
"""

import warnings
from collections.abc import Callable, Iterator
from functools import cache, wraps
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

# Kind of file -> place of the old key -> new key.
KEYS = {
    "ship": {
        "allocates": "thrust_allocation",
        "actuators.*.order": "command_group",
        "actuators.*.behind": "upstream_propeller",
        "actuators.*.abreast": "half_spacing",
        "actuators.*.*.share": "rel_std",
        "inertia.*.share": "rel_std",
        "hull.terms.*.share": "rel_std",
        "hull.functions.*.*.share": "rel_std",
        "wind.*.share": "rel_std",
    },
    "map": {"beside": "disturbance_inputs"},
    "criteria": {"criteria.*.within": "operating_range"},
}
# Kind of file -> place of a value -> old value -> new value.
VALUES = {
    "ship": {
        "actuators.*.law": {
            "force_table_ahead": "force_table_surge",
            "force_table_aside": "force_table_sway",
        }
    },
    "map": {},
    "criteria": {"criteria.*.statistic": {"share": "fraction"}},
}
# Command's new option -> old option.
OPTIONS = {"--controller-model": "--believe", "--operating-point": "--at"}


class OldNameWarning(UserWarning):
    """An old name, which is still read."""


def old_names(used: dict[str, str]) -> str:
    """The warning of old names: 'share' is now 'rel_std'; the old name is read until version 2.

    Args:
        used: old name -> new name.
    """
    now = ", ".join(f"'{old}' is now '{new}'" for old, new in used.items())
    return f"{now}; the old name{' is' if len(used) == 1 else 's are'} read until version 2"


def with_new_names(content: Any, kind: str, where: object) -> Any:
    """The content of a file under the new names, with one warning if it had old ones.

    Args:
        content: as parsed; is changed.
        kind: of the file, a key of ``KEYS``.
        where: its path.

    Raises:
        ValueError: a table has the same key under both names.
    """
    used: dict[str, str] = {}
    for place, new in KEYS[kind].items():
        *outer, old = place.split(".")
        for at, table in _tables(content, outer):
            if old not in table:
                continue
            if new in table:
                raise ValueError(
                    f"{at}{': ' if at else ''}'{old}' is the old name of '{new}'; keep '{new}' alone"
                )
            used[old] = new
            entries = [(new if key == old else key, value) for key, value in table.items()]
            table.clear()
            table.update(entries)
    for place, renamed in VALUES[kind].items():
        *outer, key = place.split(".")
        for _, table in _tables(content, outer):
            value = table.get(key)
            if isinstance(value, str) and value in renamed:
                used[value] = table[key] = renamed[value]
    if used:
        _warn(f"'{where}': {old_names(used)}")
    return content


@cache
def _warn(text: str) -> None:
    """Warn once of a file, however often a command reads it."""
    warnings.warn(OldNameWarning(text), stacklevel=3)


def _tables(content: Any, place: list[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables at a place of a file, each with its keys joined by dots."""
    found: list[tuple[str, Any]] = [("", content)]
    for part in place:
        inner: list[tuple[str, Any]] = []
        for at, each in found:
            if isinstance(each, dict):
                named = [key for key in each if part in ("*", key)]
                inner += [(f"{at}.{key}" if at else key, each[key]) for key in named]
            elif isinstance(each, list) and part == "*":
                inner += [(f"{at}[{k}]", entry) for k, entry in enumerate(each)]
        found = inner
    yield from ((at, each) for at, each in found if isinstance(each, dict))


def renamed_keyword(old: str, new: str) -> Callable[[F], F]:
    """Let a function take a keyword argument under its old name, too."""

    def decorated(function: F) -> F:
        @wraps(function)
        def called(*args: Any, **kwargs: Any) -> Any:
            if old in kwargs:
                if new in kwargs:
                    raise TypeError(f"{function.__name__}() got '{new}' and its old name '{old}'")
                warnings.warn(old_names({old: new}), DeprecationWarning, stacklevel=2)
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return cast(F, called)

    return decorated
