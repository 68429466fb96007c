"""Concurrent learning with a window of samples, driven by z2: CL-WIN-z2, Table 4.1."""

from .concurrent import concurrent
from .models import ROTATIONAL
from .store import window

COMPONENT = concurrent(
    name="controller_cl_win_z2",
    description="Concurrent learning: window, tracking error",
    model=ROTATIONAL,
    storage=window,
    by_eps=False,
)
