"""What installed packages add: ships, effects, laws of actuators and functions of the hull.

A package declares it by entry points:

- ``cybership.ships``: name of the ship = package that holds ``NAME.toml``;
- ``cybership.effects``: name for ``--effects`` = module with functions decorated by
  :func:`fmus.effects.effect`;
- ``cybership.laws``: name of a law of an actuator, or of a function of the hull = module that
  registers it.

Such a module is one file that imports ``fmus`` alone, as FMUs carry a copy of it. Installing a package
changes no ship: what it adds is used where a ship, a description or an option names it.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from .declare import DeclarationError, nearest

if TYPE_CHECKING:
    from .effects import EffectSet

SHIPS, EFFECTS, LAWS = "cybership.ships", "cybership.effects", "cybership.laws"


def names(group: str) -> list[str]:
    """The names that installed packages declare in a group of entry points."""
    return sorted({point.name for point in entry_points(group=group)})


def ship_file(name: str) -> Path | None:
    """The description of a ship of an installed package; None: there is none of this name.

    Raises:
        DeclarationError: the package has no such file.
    """
    point = _point(SHIPS, name)
    if point is None:
        return None
    spec = find_spec(point.value)
    folders = [] if spec is None else spec.submodule_search_locations or []
    for folder in folders:
        if (file := Path(folder, f"{name}.toml")).is_file():
            return file
    raise _missing(point, f"{name}.toml")


def module_file(group: str, name: str) -> Path | None:
    """The file of a module with effects or laws; None: no package declares this name.

    Raises:
        DeclarationError: there is no such module.
    """
    point = _point(group, name)
    if point is None:
        return None
    spec = find_spec(point.value)
    if spec is None or not spec.origin:
        raise _missing(point, "such module")
    return Path(spec.origin)


def plus_files(effects: EffectSet, given: Iterable[str | Path]) -> EffectSet:
    """A set with the effects that ``--effects`` names: Python files, or names of installed effects.

    Raises:
        DeclarationError: neither, or a file fails, or declares nothing, or what is taken.
    """
    for path in map(Path, given):
        named = not path.suffix and not path.is_file()
        file = module_file(EFFECTS, str(path)) if named else path
        if file is None:
            hint = nearest(str(path), names(EFFECTS))
            raise DeclarationError(f"no such Python file of effects: '{path}'{hint}")
        effects = effects.plus_file(file)
    return effects


def _point(group: str, name: str) -> EntryPoint | None:
    return next(iter(entry_points(group=group, name=name)), None)


def _missing(point: EntryPoint, what: str) -> DeclarationError:
    return DeclarationError(
        f"entry point '{point.name}' of {point.group}: '{point.value}' has no {what}"
    )
