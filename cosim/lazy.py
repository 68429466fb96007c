"""Import of a package's public names at their first use, so that a command loads only what it needs.

They stand once, in the package's ``__init__.pyi``, where type checkers read them as well.
"""

from __future__ import annotations

import sys
from importlib import import_module

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Callable


def lazy_names(
    package: str, file: str
) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """``__all__``, ``__getattr__`` (PEP 562) and ``__dir__`` of a package.

    Args:
        package: its ``__name__``.
        file: its ``__file__``; the stub next to it holds lines ``from .module import name as name``, or
            ``from . import module as module``.
    """
    homes: dict[str, str] = {}
    with open(f"{file.rpartition('.')[0]}.pyi", encoding="utf-8") as stub:
        for line in filter(str.strip, stub):
            _, module, _, _, _, name = line.split()
            homes[name] = module
    names = sorted(homes)

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        inside = homes[name] != "."
        module = import_module(homes[name] if inside else f".{name}", package)
        value = getattr(module, name) if inside else module
        setattr(sys.modules[package], name, value)
        return value

    return names, get, lambda: names
