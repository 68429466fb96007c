"""The effects that a described ship may have: those of every ship, and those of its own parts."""

from functools import cache

from ..actuators.actuation import actuators
from ..actuators.failings import failings, failings_of_twins, named_effects
from ..actuators.law_changes import changes
from ..declare import variables
from ..effects import STANDARD, EffectSet
from ..effects.force import change
from ..hull import Damping, term_variable
from ..ship_description import Description
from .hull_errors import hull_errors


def ship_parts(ship: Description) -> tuple[str, ...]:
    """Names of a ship's actuators, and of the units of those that have two."""
    return tuple(dict.fromkeys([name for a in actuators(ship) for name in (a.part.name, *a.names)]))


@cache
def effects_of_ship(ship: Description, effects: EffectSet = STANDARD) -> EffectSet:
    """The effects of a ship, made for its size.

    Args:
        ship: its actuators have the effects that it names, or all that an actuator may have; each
            further product of its damping has a change, and so have functions of its hull.
        effects: of every ship, with or without a user's, or those of a ship that were made from them;
            those that need actuators of another ship are left out.

    Raises:
        DeclarationError: an actuator's effect has the id or a parameter of another one.
    """
    own = {v.name for v in variables(Damping)}
    every, others = actuators(ship), effects.general.at(ship.scale)
    names = {*ship_parts(ship)}
    if ship.effects:
        acting = named_effects(every, ship.effects, others)
    else:
        acting = [e for a in every for e in failings(a)] + failings_of_twins(every)
    return EffectSet(
        [
            *acting,
            *changes(every),
            *hull_errors(ship),
            *[e for e in others.values() if e.needs <= names and e not in acting],
            *[change(term_variable(t.name)) for t in ship.terms if t.name not in own],
        ],
        effects.files,
        effects.general,
    )
