"""Concurrent learning with a window of samples, driven by eps: CL-WIN-eps, Table 4.1."""

from .concurrent import concurrent
from .models import ROTATIONAL
from .store import window

COMPONENT = concurrent(
    name="controller_cl_win_eps",
    description="Concurrent learning: window, prediction error",
    model=ROTATIONAL,
    storage=window,
    by_eps=True,
)
