"""Builds the FMUs of this project, and those of users' component files: ``python -m fmus.build``."""

from importlib import import_module

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from typing import Any

    from .building import build, export
    from .finding import BuildError
    from .platforms import native_targets

__all__ = ["BuildError", "build", "export", "native_targets"]
_HOME = {
    "BuildError": "finding",
    "build": "building",
    "export": "building",
    "native_targets": "platforms",
}  # module of each


def __getattr__(name: str) -> "Any":
    """Import at the first use, so that the command can be interrupted while it imports."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)
