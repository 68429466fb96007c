"""The process of a run: its state where another process reads it, scratch folders, more processes."""

from ..lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .run_state import STATE
    from .scratch import scratch_folder
    from .spawned import end_with_parent, without_program

__all__ = ["STATE", "end_with_parent", "scratch_folder", "without_program"]

__getattr__ = lazy_names(
    __name__,
    {
        "STATE": "run_state",
        "end_with_parent": "spawned",
        "scratch_folder": "scratch",
        "without_program": "spawned",
    },
)
