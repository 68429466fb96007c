"""Runs in several processes, here or on other computers, on FMUs that stay loaded."""

from ..lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .analysed_run import FinishedRun, analyse_runs

__all__ = ["FinishedRun", "analyse_runs"]

__getattr__ = lazy_names(__name__, {"FinishedRun": "analysed_run", "analyse_runs": "analysed_run"})
