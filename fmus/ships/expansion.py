"""The effects that a described ship may have: those of every ship, and those of its own parts."""

from functools import cache

from ..actuators.actuation import actuators
from ..actuators.failings import failings
from ..actuators.law_changes import changes
from ..declare import variables
from ..effects import STANDARD, EffectSet
from ..effects.force import further_change
from ..hull import Damping, term_variable
from ..ship_description import Description
from .hull_errors import hull_errors


@cache
def effects_of_ship(ship: Description, effects: EffectSet = STANDARD) -> EffectSet:
    """The effects of a ship, made for its size.

    Args:
        ship: each of its actuators has its failings, each further product of its damping a change, and
            so have functions of its hull.
        effects: of this project, with or without a user's; those that need thrusters of another ship
            are left out.

    Raises:
        DeclarationError: an actuator's effect has the id or a parameter of another one.
    """
    own = {v.name for v in variables(Damping)}
    return EffectSet(
        [
            *[e for a in actuators(ship) for e in failings(a)],
            *changes(actuators(ship)),
            *hull_errors(ship),
            *[e for e in effects.at(ship.scale).values() if not e.needs],
            *[further_change(term_variable(t.name)) for t in ship.terms if t.name not in own],
        ],
        effects.files,
    )
