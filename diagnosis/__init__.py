"""Holds a ship model against measurements; what it lacks is to be learned from them.

A measured run goes through three steps, each model-free, before a model sees it::

    import diagnosis

    track = diagnosis.clean(diagnosis.read("run.csv"))  # what is missing, frozen, out of order
    smoothed = diagnosis.smooth(track)  # pose, velocity, acceleration, and how sure they are
    windows = diagnosis.Windows([smoothed])
    nominal = windows.errors()
    slower = windows.errors(vessel={"delta_X_u": -4.0})

or all at once, as ``python -m diagnosis.learn`` does it::

    runs = diagnosis.gather(["run1.csv", "run2.csv"])
    found = diagnosis.diagnose(runs[:1], held_out=runs[1:])
    print(found.verdict, [f.id for f in found.learned.findings])
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cosim import InputError

    from .cleaning import Counts, Track, clean
    from .gathering import gather
    from .measurement import Run, read
    from .model import Model
    from .session import Confronted, Diagnosed, confront, diagnose
    from .smoothing import Smoothed, smooth
    from .windows import WindowErrors, Windows

__all__ = [
    "Confronted",
    "Counts",
    "Diagnosed",
    "InputError",
    "Model",
    "Run",
    "Smoothed",
    "Track",
    "WindowErrors",
    "Windows",
    "clean",
    "confront",
    "diagnose",
    "gather",
    "read",
    "smooth",
]

_HOME = {
    "InputError": "cosim",
    "Counts": "diagnosis.cleaning",
    "Track": "diagnosis.cleaning",
    "clean": "diagnosis.cleaning",
    "gather": "diagnosis.gathering",
    "Model": "diagnosis.model",
    "Confronted": "diagnosis.session",
    "Diagnosed": "diagnosis.session",
    "confront": "diagnosis.session",
    "diagnose": "diagnosis.session",
    "Run": "diagnosis.measurement",
    "read": "diagnosis.measurement",
    "Smoothed": "diagnosis.smoothing",
    "smooth": "diagnosis.smoothing",
    "WindowErrors": "diagnosis.windows",
    "Windows": "diagnosis.windows",
}


def __getattr__(name: str) -> Any:
    """Import on demand: a user's effects must be loaded before the vessel that is to have them."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
