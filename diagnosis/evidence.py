"""A measured run held against a model, before and after something was learned."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim import InputError

from .model import Model
from .smoothing import Smoothed
from .weak import Integrals, omega
from .windows import WindowErrors, Windows


@dataclass(frozen=True, eq=False)
class Seen:
    """What one model makes of a run.

    Attributes:
        omega: (K, 3), force that the model lacks in each window of the weak form [N, N, N m].
        off: (samples, 3), measured minus predicted pose [m, m, rad] in the windows of 8 s; empty if none
            has enough samples.
        errors: of those windows; None if none has enough samples.
    """

    omega: np.ndarray
    off: np.ndarray
    errors: WindowErrors | None

    @property
    def position(self) -> float:
        """Window prediction error [m]; NaN without a window."""
        return float("nan") if self.errors is None else float(self.errors.over_all()[0])

    @property
    def heading(self) -> float:
        """Window prediction error [rad]; NaN without a window."""
        return float("nan") if self.errors is None else float(self.errors.over_all()[1])

    @property
    def omega_rms(self) -> np.ndarray:
        """(3,) [N, N, N m]."""
        return np.sqrt(np.mean(self.omega**2, axis=0))


@dataclass(frozen=True, eq=False)
class Evidence:
    """One run and what the models make of it.

    Attributes:
        integrals: the run, in windows of the weak form.
        windows: the run, in windows of 8 s; None if none has enough samples.
        held_out: whether nothing was learned from it.
        before, after: the model at first and at last; after is before where nothing was learned.
    """

    integrals: Integrals
    windows: Windows | None
    held_out: bool
    before: Seen
    after: Seen

    @property
    def smoothed(self) -> Smoothed:
        return self.integrals.smoothed

    @property
    def name(self) -> str:
        return self.integrals.run.name


def examine(w: Integrals, before: Model, after: Model | None = None, held_out: bool = False) -> Evidence:
    """Hold a run against a model, or against two.

    Args:
        w: windows of the run.
        before: the model at first.
        after: the model with what was learned; None: nothing was.
        held_out: whether nothing was learned from the run.
    """
    windows = _windows([w.smoothed])
    first = _seen(w, windows, before)
    last = first if after is None else _seen(w, windows, after)
    return Evidence(w, windows, held_out, first, last)


def _windows(runs: Sequence[Smoothed]) -> Windows | None:
    try:
        return Windows(runs)
    except InputError:
        return None


def _seen(w: Integrals, windows: Windows | None, model: Model) -> Seen:
    if windows is None:
        return Seen(omega(w, model), np.zeros((0, 3)), None)
    off = windows.residuals(model.vessel, model.thrusters, model.clock)
    return Seen(omega(w, model), off, windows.summary(off))
