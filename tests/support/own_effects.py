"""A user's effects: those of docs/own_effects.md, and one whose formula a test chooses."""

import re

from .project import ROOT

BLOCKS = re.findall(
    r"```python\n(.*?)```",
    (ROOT / "docs" / "own_effects.md").read_text("utf-8"),
    re.DOTALL,
)


def example(name):
    """The example of docs/own_effects.md that declares something of this name."""
    (block,) = [b for b in BLOCKS if re.search(rf"^(def|class) {name}\b", b, re.MULTILINE)]
    return block


LINEAR, DECLARED, SECOND_ORDER = map(example, ("N_uuv", "power_drag", "second_lag"))
LEAST_SQUARES = example("LeastSquares")
OWN = '''
from typing import Annotated
from fmus.effects import effect

@effect("N_uuv", "force", "N", formula="N = k u u v")
def N_uuv(ship, N_uuv: Annotated[float, "N.s3/m3", "moment by u u v"] = 0.0):
    """A moment of my own."""
    return 0.0, 0.0, {body}
'''
GOOD = "N_uuv * ship.u * ship.u * ship.v"
