"""Guidance of a stopping trial: full astern after a steady approach; no inputs.

The shaft speed ``n``, or the force ``tau_X`` where thrusters are asked for one, changes from the setting
of the approach to that of full astern, the rudder being amidships (IMO, MSC.137(76), 4.2.9; ISO
13643-4:2017).
"""

from typing import Annotated, NamedTuple

from ..declare import POSITIVE, Range, component
from ..ops import Number, where
from ..signals import Nothing
from .trial_order import START, TrialTime, begun

ASTERN = Range(max=0.0)


class Params(NamedTuple):
    start: START = 20.0
    n_ahead: Annotated[float, "1/s", "shaft speed of the approach", POSITIVE] = 5.0
    n_astern: Annotated[float, "1/s", "shaft speed full astern", ASTERN] = -5.0
    X_ahead: Annotated[float, "N", "force of the approach", POSITIVE] = 0.1
    X_astern: Annotated[float, "N", "force full astern", ASTERN] = -1.0


class Outputs(NamedTuple):
    order: Annotated[float, "1", "order under trial: -1 full astern, 0 approach"] = 0.0
    n: Annotated[float, "1/s", "shaft speed"] = 0.0
    tau_X: Annotated[float, "N", "surge force"] = 0.0


def init(i: Nothing, p: Params) -> TrialTime:
    return TrialTime()


def step(s: TrialTime, i: Nothing, p: Params, h: Number) -> tuple[TrialTime, Outputs]:
    t = s.t + h
    astern = begun(t, p.start, h)
    return TrialTime(t), Outputs(
        where(astern, -1.0, 0.0),
        where(astern, p.n_astern, p.n_ahead),
        where(astern, p.X_astern, p.X_ahead),
    )


COMPONENT = component(
    name="guidance_stop",
    description="Stopping trial: full astern",
    init=init,
    step=step,
    trial="stop",
)
