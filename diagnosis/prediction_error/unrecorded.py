"""The force that nobody recorded: how large, how long it lasts, and when it acts most."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..model import Integrals, Model, omega
from ..model.weak_form import WIDTH
from .push import Push

LARGE = 3.0  # robust standard deviations of what is left, beyond which a stretch is told; chosen
MOST = 5  # stretches that are told, the clearest; chosen
MAD = 1.4826  # standard deviations of a normal distribution in a median absolute deviation
AXES = ("X", "Y", "N")


class Stretch(NamedTuple):
    """A stretch of a run in which the unrecorded force is large on an axis.

    Attributes:
        run: name.
        axis: X, Y or N.
        start, end: [s].
        size: largest model error there [N or N m].
    """

    run: str
    axis: str
    start: float
    end: float
    size: float


@dataclass(frozen=True, eq=False)
class Unrecorded:
    """What acts and is in no command and no effect.

    Attributes:
        push: its size and correlation time on each axis.
        differing: values of which the two fits differ by more than their intervals -> the value by the
            model error, and by predictions.
        stretches: when it acts most, where the fits differ; the clearest first.
    """

    push: Push
    differing: Mapping[str, tuple[float, float]]
    stretches: Sequence[Stretch]

    @property
    def sentence(self) -> str:
        """What is to be said of it; empty where the fits agree."""
        if not self.differing:
            return ""
        names = ", ".join(self.differing)
        when = "; ".join(f"{s.run} {s.start:.0f} to {s.end:.0f} s ({s.axis})" for s in self.stretches)
        return (
            "Something that is not recorded acts on the ship: the fit to the model error and the fit to "
            f"predictions differ by more than their intervals in {names}. "
            + (f"It is largest in {when}." if when else "It acts all the time.")
        )


def unrecorded(
    runs: Sequence[Integrals],
    model: Model,
    push: Push,
    differing: Mapping[str, tuple[float, float]],
) -> Unrecorded:
    """What acts unrecorded, and where two fits differ, when.

    Args:
        runs: that were fitted to.
        model: the fitted one.
        push: that it leaves.
        differing: see :class:`Unrecorded`.
    """
    found = []
    for w in runs if differing else ():
        left = omega(w, model)
        for k, axis in enumerate(AXES):
            size = np.abs(left[:, k])
            usual = MAD * float(np.median(size)) or np.inf
            rows = np.flatnonzero(size > LARGE * usual)
            for part in np.split(rows, np.flatnonzero(np.diff(w.middle[rows]) > WIDTH) + 1):
                if part.size:
                    times = w.middle[part]
                    found.append((size[part].max() / usual, w.run.name, axis, times, size[part].max()))
    clearest = sorted(found, key=lambda f: -f[0])[:MOST]
    return Unrecorded(push, differing, [Stretch(n, a, t[0], t[-1], s) for _, n, a, t, s in clearest])
