"""An effect: weed on the hull."""

from typing import Annotated

from fmus.effects import effect


@effect("weed", kind="force", axis="X", formula="X = k |u|u", symbol="k")
def weed(ship, weed_drag: Annotated[float, "N.s2/m2", "surge force by |u|u of weed"] = 0.0):
    """Weed on the hull adds drag."""
    return weed_drag * abs(ship.u) * ship.u, 0.0, 0.0
