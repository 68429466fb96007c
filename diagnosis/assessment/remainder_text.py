"""The remainder in words: how much is left, where, with what it repeats, and what causes do so."""

from collections.abc import Mapping, Sequence

import numpy as np

from fmus.scale import REFERENCE, Scale

from ..predictors.weak_form import WIDTH
from .recurrence import Recurrence
from .regions import NAMES, UNITS, Region
from .remainder import AxisRemainder

NOTHING_LEFT = "What the model leaves is within the uncertainty of the measurement."
LITTLE_LEFT = (
    "What the model leaves is beyond the noise of the measurement, but less than 5 % of the first error "
    "or 2 % of the commanded force."
)
# Space in which most repeats -> how, and what kind of cause does so.
REPEATS = {
    "place": (
        "repeats with the place",
        "a cause that stands in the basin, such as a bank, shallow water or a current",
    ),
    "motion": (
        "repeats with speed, drift and turn",
        "a force on the hull that no effect of the list has the shape of",
    ),
    "command": (
        "repeats with the commands",
        "thrusters that give another force than the model of them, in a shape that no effect has",
    ),
    "time": (
        "repeats with the time since a run began",
        "something that happens at the same time of each run, or a drift",
    ),
}
IN_PART = (
    "is in proportion to the command of its axis for a while and then not",
    "a thruster that fails and comes back, or whose power changes",
)
LASTS = (
    "repeats with neither place, motion, command nor time, but lasts for about {0:.0f} s at a time",
    "something that comes and goes, such as gusts, a changing current, or a towed cable",
)
BRIEF = (
    "repeats with neither place, motion, command nor time, and is soon over",
    "waves, a disturbance of the measurement, or commands other than those recorded",
)


def remainder_sentence(
    axes: Mapping[str, AxisRemainder],
    how: Sequence[Recurrence] | None,
    regions: Sequence[Region],
    waves: bool,
    scale: Scale = REFERENCE,
) -> str:
    """The remainder of all axes in words.

    Args:
        axes: X, Y, N -> what is left.
        how: of each axis how it comes again; None where nothing is left.
        regions: where the model that is judged fails, the clearest of an axis first.
        waves: whether waves were found, which the model cannot take away.
        scale: of the ship.
    """
    left = [axis for axis in axes if axes[axis].significant]
    if not left or how is None:
        return LITTLE_LEFT if any(a.beyond_chance for a in axes.values()) else NOTHING_LEFT
    parts: dict[tuple[str, str], list[str]] = {}
    for k, axis in enumerate(axes):
        if axis in left:
            parts.setdefault(_kind(how[k], WIDTH * scale.time), []).append(axis)
    texts = []
    for (comes, cause), group in parts.items():
        amounts = " and ".join(_amount(axis, axes[axis]) for axis in group)
        where = [r for axis in group for r in regions if r.axis == axis][:1]
        place = f", most {where[0].phrase}" if where else ""
        texts.append(f"{amounts} not explained{place}. It {comes}: that suggests {cause}.")
    if waves:
        texts.append("A part of it are the waves that were found, which no model can foretell.")
    return " ".join(texts)


def _amount(axis: str, r: AxisRemainder) -> str:
    share = 100.0 * np.sqrt(r.share)
    of_first = f", {share:.2g} % of the first error" if share < 99.5 else ""
    return f"{NAMES[axis]}: {r.rms:.2g} {UNITS[axis]} (uncertainty {r.uncertainty:.1g}{of_first})"


def _kind(r: Recurrence, briefly: float) -> tuple[str, str]:
    if r.in_part and r.best != "place":
        return IN_PART
    if r.best is not None:
        return REPEATS[r.best]
    if r.lasts > briefly:
        return LASTS[0].format(r.lasts), LASTS[1]
    return BRIEF
