"""A ship whose inertia or damping is another by one factor, (2.20)-(2.22).

The factor of the thrust, (2.23), is that of ``loss_surge``, ``loss_sway`` and ``loss_yaw`` together:
delta_tau = 1 - loss. All three factors times one number are the same ship: from its motion only their
ratios can be known.
"""

from typing import Annotated

from ..declare import Range
from ..hull import Inertia, Triple, damping_force
from .effect import Loaded, Search, Wording, effect
from .families import INERTIA, SURGE_DRAG
from .text import Found, percent

_FACTOR = Range(-0.9, 10.0)


def sentence(name: str, what: str) -> Wording:
    def stated(f: Found) -> str:
        sense = "larger" if f[name] > 0.0 else "smaller"
        return f"{what} is {percent(f[name])} {sense} than in the model, on all axes by the same factor."

    return Wording(stated, INERTIA if name == "scale_inertia" else SURGE_DRAG)


@effect(
    "scale_inertia",
    "inertia",
    "XYN",
    formula="(1 + k) M and (1 + k) C(nu)",
    symbol="k = delta_M - 1",
    sign="positive is heavier",
    source="(2.20), (2.21)",
    search=Search(by="given"),
    wording=sentence("scale_inertia", "The inertia"),
)
def scale_inertia(
    i: Inertia,
    scale_inertia: Annotated[float, "1", "excess of the inertia's factor, delta_M - 1", _FACTOR] = 0.0,
) -> Inertia:
    """All of the inertia by one factor, added mass included."""
    k = 1.0 + scale_inertia
    return Inertia(
        k * i.m, k * i.I_z, i.x_g, k * i.X_udot, k * i.Y_vdot, k * i.Y_rdot, k * i.N_vdot, k * i.N_rdot
    )


@effect(
    "scale_damping",
    "force",
    "XYN",
    formula="-k D(nu) nu, D of the model",
    symbol="k = delta_D - 1",
    sign="positive damps more",
    source="(2.22)",
    search=Search(by="given"),
    wording=sentence("scale_damping", "The damping"),
)
def scale_damping(
    ship: Loaded,
    scale_damping: Annotated[float, "1", "excess of the damping's factor, delta_D - 1", _FACTOR] = 0.0,
) -> Triple:
    """All of the nominal damping by one factor."""
    X, Y, N = damping_force(ship.u, ship.v, ship.r, ship.damping)
    return scale_damping * X, scale_damping * Y, scale_damping * N
