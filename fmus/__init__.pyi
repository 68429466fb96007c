from .build import build as build_fmus
from .declare import Component as Component
from .declare import Range as Range
from .effects import Memory as Memory
from .effects import Search as Search
from .effects import Wording as Wording
from .effects import effect as effect
from .ship import Ship as Ship
from .ship import ship as make_ship

__all__ = [
    "Component",
    "Memory",
    "Range",
    "Search",
    "Ship",
    "Wording",
    "build_fmus",
    "effect",
    "make_ship",
]
