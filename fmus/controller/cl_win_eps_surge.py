"""Improved concurrent learning as 7.5 prints it: CL-WIN-eps with the regressors of (7.1), nothing else.

``cl_improved`` learns losses of thrust as well, smooths its samples and keeps spikes out.
"""

from .concurrent import concurrent
from .models import SURGE_DAMPING
from .store import window

COMPONENT = concurrent(
    name="controller_cl_win_eps_surge",
    description="Concurrent learning: window, prediction error, surge too (7.1)",
    model=SURGE_DAMPING,
    storage=window,
    by_eps=True,
)
