"""Concurrent learning with a window of samples, driven by eps, of all but the inertia, (2.24)."""

from .concurrent import concurrent
from .models import ALL_UNKNOWN
from .store import window

COMPONENT = concurrent(
    name="controller_cl_win_eps_all",
    description="Concurrent learning: window, prediction error, all but inertia unknown",
    model=ALL_UNKNOWN,
    storage=window,
    by_eps=True,
)
