"""Concurrent learning with a window of samples, driven by eps, of two factors, (2.20)-(2.23).

Samples are smoothed over two seconds: the factor of the inertia multiplies the acceleration, whose lag
and noise in an observer would otherwise be taken for a wrong mass.
"""

from .concurrent import concurrent
from .models import SCALED
from .store import window

COMPONENT = concurrent(
    name="controller_cl_win_eps_scaled",
    description="Concurrent learning: window, prediction error, factors of inertia and damping",
    model=SCALED,
    storage=window,
    by_eps=True,
    store_change=0.2,
    smoothing=2.0,
)
