"""The public Python interface as a page: ``python tests/support/public_api.py > docs/public_api.md``.

It lists each public name, and names, kinds and defaults of its arguments, for other programs. Types are in
docs/python.md; ``...`` is a default that is not a plain value.
"""

import inspect
import sys
from collections.abc import Iterator
from importlib import import_module
from types import ModuleType
from typing import Any

from pydantic import BaseModel

PACKAGES = ("cosim", "diagnosis", "fmus")
PLAIN = (type(None), bool, int, float, str)
HEAD = """# Public names

This page lists the names that other programs may use. A test checks that these names, their arguments and their order stay. Their documentation is
[the reference](python.md); [CONTRIBUTING](../CONTRIBUTING.md#a-name-that-goes-away) describes how a name is removed. `...` is a default that is
not a plain value. `python tests/support/public_api.py` prints this page.
"""


def arguments(called: Any) -> str:
    """The arguments of something that can be called, without types."""
    if isinstance(called, type) and issubclass(called, BaseModel):
        called.model_rebuild()  # it knows its arguments once it was used
    try:
        signature = inspect.signature(called)
    except (TypeError, ValueError):  # a class of exceptions
        return "(...)"
    shown = []
    for p in signature.parameters.values():
        plain = p.default is p.empty or isinstance(p.default, PLAIN)
        default = p.default if plain else inspect.Parameter.empty
        text = str(p.replace(annotation=p.empty, default=default))
        shown.append(text if plain else f"{text}=...")
        if p.kind is p.KEYWORD_ONLY and "*" not in [s[:1] for s in shown]:
            shown.insert(-1, "*")
    return f"({', '.join(shown)})"


def lines(name: str, value: Any) -> Iterator[str]:
    """A public name, and the methods of a class that it has itself."""
    ending = "  # deprecated" if hasattr(value, "__deprecated__") else ""
    if isinstance(value, ModuleType):
        yield f"{name}  # module, callable" if callable(value) else f"{name}  # module"
    elif not callable(value):
        yield f"{name}{ending}"
    else:
        yield f"{name}{arguments(value)}{ending}"
        if isinstance(value, type):
            yield from _members(name, value)


def _members(name: str, of: type) -> Iterator[str]:
    for member, held in sorted(vars(of).items()):
        inner = held.__func__ if isinstance(held, classmethod | staticmethod) else held
        if member.startswith("_") or not (inspect.isfunction(inner) or isinstance(held, property)):
            continue
        ending = "  # deprecated" if hasattr(inner, "__deprecated__") else ""
        shown = "" if isinstance(held, property) else arguments(inner)
        yield f"    {name}.{member}{shown}{ending}"


def listing(package: str) -> list[str]:
    """All lines of a package."""
    module = import_module(package)
    return [line for name in module.__all__ for line in lines(name, getattr(module, name))]


def page() -> str:
    """The page."""
    parts = [f"## {p}\n\n```text\n" + "\n".join(listing(p)) + "\n```\n" for p in PACKAGES]
    return "\n".join([HEAD, *parts])


if __name__ == "__main__":
    sys.stdout.write(page())
