"""What a hull may have otherwise than described: parameters of functions, and the wind on its areas.

One declaration for all, made for each function of a ship's hull, as
:mod:`fmus.actuators.failings` has them for its actuators.
"""

from dataclasses import replace
from math import hypot
from typing import Annotated

from ..declare import POSITIVE, Range, Variable, parameters_of
from ..effects.effect import Effect, Loaded, Motion, Search, Wording, effect
from ..effects.families import EARTH_FIXED, Family
from ..effects.text import Found, capital, compass, number
from ..frames import rotate_to_body
from ..hull import Triple
from ..hull_functions import CHANGES, FUNCTIONS, Change
from ..ops import Number, sqrt
from ..ship_description import Description

HULL = Family("hull", "steady legs at several speeds, and turns of several radii both ways")


def changed(function: str, change: Change) -> Effect:
    """Parameters of a function of the hull that are others than described."""
    known = {v.name: v for v in parameters_of(function, 3, FUNCTIONS[function])}
    parameters = tuple(
        [
            Variable(
                f"delta_{p}", known[p].unit, f"addition to {known[p].description}", 0.0, Range(), False
            )
            for p in change.parameters
        ]
    )

    def sentence(f: Found) -> str:
        told = [f"{f[v.name]:+.3g} {v.unit}".removesuffix(" 1") for v in parameters]
        return f"{capital(change.text)} is another than the model believes, by {', '.join(told)}."

    @effect(
        change.stem,
        "force",
        "XYN",
        formula=f"{', '.join(change.parameters)} + δ, in {function}",
        symbol="δ",
        sign="an addition to the described value",
        description=change.text,
        parameters=parameters,
        wording=Wording(sentence, HULL),
    )
    def force(ship: Loaded, *additions: Number) -> Triple:
        p = getattr(ship.damping.functions, function)
        more = {n: getattr(p, n) + d for n, d in zip(change.parameters, additions, strict=True)}
        law = FUNCTIONS[function]
        with_it = law(ship.u, ship.v, ship.r, *p._replace(**more))
        without = law(ship.u, ship.v, ship.r, *p)
        X, Y, N = (a - b for a, b in zip(with_it, without, strict=True))
        return X, Y, N

    return force


def wind_force(
    ship: Motion,
    W_n: Annotated[float, "m/s", "velocity of the wind over the water, to the north"] = 0.0,
    W_e: Annotated[float, "m/s", "velocity of the wind over the water, to the east"] = 0.0,
    frontal_area: Annotated[float, "m2", "area above the water from ahead", POSITIVE] = 1.0,
    lateral_area: Annotated[float, "m2", "area above the water from the side", POSITIVE] = 1.0,
    lateral_centre: Annotated[float, "m", "forward place of the lateral area's centre"] = 0.0,
    frontal_drag: Annotated[float, "1", "drag coefficient from ahead", POSITIVE] = 0.7,
    lateral_drag: Annotated[float, "1", "drag coefficient from the side", POSITIVE] = 0.9,
    air_density: Annotated[float, "kg/m3", "density of the air", POSITIVE] = 1.25,
) -> Triple:
    """Wind on the areas above the water, beside the resistance of the ship in still air.

    By the relative wind (Fossen 2021, ch. 10): 1/2 rho C A V_rw u_rw, and so across. The ship's
    velocity is that through the water, so that the wind is that over the water, not over ground.
    """

    def drag(u: Number, v: Number) -> tuple[Number, Number]:
        pressure = 0.5 * air_density * sqrt(u * u + v * v)
        return (
            pressure * frontal_drag * frontal_area * u,
            pressure * lateral_drag * lateral_area * v,
        )

    u, v = rotate_to_body(ship.psi, W_n, W_e)
    (X, Y), (still_X, still_Y) = drag(u - ship.u, v - ship.v), drag(-ship.u, -ship.v)
    Y = Y - still_Y
    return X - still_X, Y, lateral_centre * Y


WIND = parameters_of("wind", 1, wind_force)
WIND_SETTINGS = tuple([v for v in WIND if v.name not in ("W_n", "W_e")])


def wind(ship: Description) -> Effect:
    """The wind on a ship whose areas are described."""
    given = {v.name: v.value for v in ship.wind}
    return effect(
        "wind",
        "environment",
        "XYN",
        formula="X = ρ/2 C_X A_F V_rw u_rw, Y = ρ/2 C_Y A_L V_rw v_rw, N = x_L Y, less still air",
        symbol="W_n, W_e",
        sign="direction that the air moves towards, as seen from the water",
        source="Fossen 2021, ch. 10",
        linear=False,
        parameters=tuple([replace(v, start=given.get(v.name, v.start)) for v in WIND]),
        description=(wind_force.__doc__ or "").splitlines()[0],
        settings=[v.name for v in WIND_SETTINGS],
        search=Search(differentiable=True),
        wording=Wording(_blown, EARTH_FIXED),
    )(wind_force)


def _blown(f: Found) -> str:
    speed = number(hypot(f["W_n"], f["W_e"]))
    return f"A wind of {speed} m/s over the water blows towards {compass(f['W_n'], f['W_e'])}."


def hull_errors(ship: Description) -> list[Effect]:
    """All that a ship's hull may have otherwise than described."""
    found = [changed(part.law, c) for part in ship.functions for c in CHANGES[part.law]]
    return [*found, *([wind(ship)] if ship.wind else [])]
