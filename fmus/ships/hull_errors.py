"""What a hull may have otherwise than described: parameters of functions, and the wind on it.

One declaration for all, made for each function of a ship's hull, as
:mod:`fmus.actuators.failings` has them for its actuators.
"""

from ..actuators.law_changes import additions, differs
from ..declare import parameters_of
from ..effects.effect import Effect, Loaded, Wording, effect
from ..effects.families import Family
from ..effects.text import capital
from ..hull import Triple
from ..hull_functions import CHANGES, FUNCTIONS, Change
from ..ops import Number
from ..ship_description import Description
from .wind import wind, wind_drift

HULL = Family("hull", "steady legs at several speeds, and turns of several radii both ways")


def changed(function: str, change: Change) -> Effect:
    """Parameters of a function of the hull that are others than described."""
    parameters = additions(change, parameters_of(function, 3, FUNCTIONS[function]))

    @effect(
        change.stem,
        "force",
        "XYN",
        formula=f"{', '.join(change.parameters)} + δ, in {function}",
        symbol="δ",
        sign="an addition to the described value",
        description=change.text,
        parameters=parameters,
        adds_to={v.name: (n,) for v, n in zip(parameters, change.parameters, strict=True)},
        wording=Wording(lambda f: capital(differs(change, parameters, f)), HULL),
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


def hull_errors(ship: Description) -> list[Effect]:
    """All that a ship's hull may have otherwise than described."""
    found = [changed(part.law, c) for part in ship.functions for c in CHANGES[part.law]]
    blown = [wind(ship)] if ship.wind else []
    return [*found, *blown, *([wind_drift] if ship.wind_measured else [])]
