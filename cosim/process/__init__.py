"""The process of a run: its state where another process reads it, scratch folders, more processes."""

from ..lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .spawned import without_program

__all__ = ["without_program"]

__getattr__ = lazy_names(__name__, {"without_program": "spawned"})
