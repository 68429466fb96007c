"""Forces by the ship's motion: a change of each damping coefficient, and a free curve over speed."""

import re

from ..declare import Range, Variable, packer, variables, width
from ..hull import Damping, Triple, damping_force
from ..ops import Number
from .curve import interpolate, node_parameters
from .registry import EFFECTS, Effect, Ship, add

_COUNT = width(Damping)


def product(field: str) -> str:
    """The product that a coefficient's name tells: ``absu_u`` of ``X_absu_u`` is ``|u|u``."""
    return re.sub(r"abs(.)_?", r"|\1|", field.partition("_")[2])


def change(k: int, ship: Ship, delta: Number) -> Triple:
    """Force [N, N, N m] of an addition to the k-th coefficient of :class:`~fmus.hull.Damping`."""
    only = [0.0] * _COUNT
    only[k] = delta
    return damping_force(ship.u, ship.v, ship.r, packer(Damping)(only))


def _add_change(k: int, coefficient: Variable) -> None:
    """Register the change of one damping coefficient."""
    axis, term = coefficient.name[0], product(coefficient.name)
    symbol = f"Δ{axis}_{term}"
    name = f"delta_{coefficient.name}"
    add(
        Effect(
            id=f"{axis}_{term}",
            kind="force",
            axis=axis,
            description=f"addition to {coefficient.name}: {coefficient.description}",
            formula=f"{axis} = {symbol} · {term}",
            symbol=symbol,
            sign="an addition on the side of the forces",
            source="(2.8)-(2.9), corrected",
            linear=True,
            parameters=(
                Variable(name, coefficient.unit, f"addition to {coefficient.name}", 0.0, Range(), False),
            ),
            function=lambda ship, delta: change(k, ship, delta),
        )
    )


for _k, _coefficient in enumerate(variables(Damping)):
    _add_change(_k, _coefficient)

# Those that are changes of a coefficient, in the order of Damping.
CHANGES = tuple(EFFECTS.values())[-_COUNT:]


def surge_curve(ship: Ship, *values: Number) -> Triple:
    """A free surge force over the surge speed."""
    *nodes, reach = values
    return interpolate(ship.u, -reach, reach, nodes), 0.0, 0.0


add(
    Effect(
        id="curve_X(u)",
        kind="force",
        axis="X",
        description="free surge force over the surge speed",
        formula="X = Σ c_k · hat_k(u), 21 nodes over [-range, range]",
        symbol="c_1 … c_21",
        sign="positive pushes ahead",
        source="3.2.3, on a triangle basis",
        linear=True,
        parameters=node_parameters(
            "curve_X_u", "N", "surge force", "surge speed, both ways", "m/s", 0.6
        ),
        function=surge_curve,
        settings=frozenset({"curve_X_u_range"}),
    )
)
