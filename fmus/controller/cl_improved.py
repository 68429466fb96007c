"""Improved concurrent learning, 7.2.2: surge and losses of thrust are learned too, spikes are kept out.

Samples are smoothed over two seconds (chapter 8): with a force among the regressors, the lag of an
observer's acceleration would otherwise be taken for a loss of thrust. The thresholds lie above what the
ship does on the ellipse; 3 N is what its thrusters give. All of it is more than 7.5 prints, which is
(7.1) alone: ``cl_win_eps_surge``.
"""

from .concurrent import concurrent
from .models import SURGE
from .store import window

COMPONENT = concurrent(
    name="controller_cl_improved",
    description="Concurrent learning: window, prediction error, surge and loss of thrust",
    model=SURGE,
    storage=window,
    by_eps=True,
    store_change=0.1,
    smoothing=2.0,
    nu_dot_max=0.2,
    nu_max=1.0,
    tau_max=3.0,
)
