"""Builds the FMUs of this project, and those of users' component files: ``python -m fmus.build``."""

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from typing import Any

    from .building import build, export
    from .finding import BuildError
    from .platforms import native_targets

__all__ = ["BuildError", "build", "export", "native_targets"]


def __getattr__(name: str) -> "Any":
    """Import at the first use, so that the command can be interrupted while it imports."""
    if name in ("build", "export"):
        from . import building

        return getattr(building, name)
    if name == "BuildError":
        from .finding import BuildError

        return BuildError
    if name == "native_targets":
        from .platforms import native_targets

        return native_targets
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
