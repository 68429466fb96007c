"""Improved concurrent learning, 7.2.2: surge and losses of thrust are learned too, spikes are kept out.

The thresholds lie above what the ship does on the ellipse and in the eight; 3 N is what the thrusters
of CyberShip Enterprise 1 can give.
"""

from .blocker import BlockerOptions
from .concurrent import concurrent
from .models import SURGE
from .store import StoreOptions, window

COMPONENT = concurrent(
    name="controller_cl_improved",
    description="Concurrent learning: window, prediction error, surge and loss of thrust",
    model=SURGE,
    storage=window,
    by_eps=True,
    store=StoreOptions(store_change=0.1),
    blocker=BlockerOptions(nu_dot_max=0.5, nu_max=1.0, tau_max=3.0),
)
