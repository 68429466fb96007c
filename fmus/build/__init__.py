"""Builds the FMUs of this project, and those of users' component files: ``python -m fmus.build``."""

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from typing import Any

    from .building import build
    from .finding import BuildError

__all__ = ["BuildError", "build"]


def __getattr__(name: str) -> "Any":
    """Import at the first use, so that the command can be interrupted while it imports."""
    if name == "build":
        from .building import build

        return build
    if name == "BuildError":
        from .finding import BuildError

        return BuildError
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
