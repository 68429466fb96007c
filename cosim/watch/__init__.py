"""The process that watches a command: however that ends, the command says so."""

from ..lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .watching import watched

__all__ = ["watched"]

__getattr__ = lazy_names(__name__, {"watched": "watching"})
