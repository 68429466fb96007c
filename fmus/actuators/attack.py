"""Where the force of a ship's actuators acts, beside the places that are described, (2.17)-(2.19)."""

from typing import Annotated, NamedTuple

from ..declare import Fields


class Attack(NamedTuple):
    """How far from the places of the actuators their force acts, (2.17)-(2.19)."""

    p_x: Annotated[float, "m", "assumed point of attack, forward"] = 0.0
    p_y: Annotated[float, "m", "assumed point of attack, to starboard"] = 0.0


class RealAttack(NamedTuple):
    """The same of the real ship."""

    plant_p_x: Annotated[float, "m", "real point of attack, forward"] = 0.0
    plant_p_y: Annotated[float, "m", "real point of attack, to starboard"] = 0.0


def attacking(values: Fields, attack: Attack | RealAttack) -> Fields:
    """Parameters of actuators, of which the last two are the place, with a point of attack."""
    p_x, p_y = attack
    return type(values)._make(
        [type(own)._make((*own[:-2], own[-2] + p_x, own[-1] + p_y)) for own in values]
    )
