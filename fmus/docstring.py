"""Docstrings as text for users, also under ``python -OO``, which removes them."""

from collections.abc import Callable
from typing import Any


def docstring(function: Callable[..., Any]) -> str:
    """The docstring of a function; empty if it has none."""
    return function.__doc__ or (_from_source(function) if not __debug__ else "")


def _from_source(function: Callable[..., Any]) -> str:
    import ast  # only here: FMUs have no use for it
    import inspect
    import textwrap

    try:
        definition = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, TypeError, SyntaxError):
        return ""
    if not isinstance(definition, ast.FunctionDef):
        return ""
    return ast.get_docstring(definition, clean=False) or ""
