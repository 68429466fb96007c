"""Concurrent learning with a window of samples, driven by eps, of two factors, (2.20)-(2.23)."""

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
)
