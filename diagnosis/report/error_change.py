"""The errors of a run before and after, and whether a change is more than noise."""

from collections.abc import Iterator
from math import degrees
from typing import NamedTuple

import numpy as np

from ..predictors.uncertainty import NOISE_TOLERANCE
from ..runs.cleaning import Z95
from ..verdict.prediction_gain import PairedChange
from .formatting import times
from .report_data import ReportData


class ErrorChange(NamedTuple):
    """An error before and after, in the unit of its column.

    Attributes:
        before, after: root mean square.
        is_noise: whether the noise of the measurement explains the difference.
    """

    before: float
    after: float
    is_noise: bool

    @property
    def ratio(self) -> str:
        """By which the error fell, such as ``17×``."""
        return times(self.before, self.after)

    @property
    def kind(self) -> str:
        """A ``fall``, a ``rise``, or within the ``noise``."""
        if not self.after > self.before:
            return "fall"
        return "noise" if self.is_noise else "rise"


def error_changes(r: ReportData, k: int) -> list[ErrorChange]:
    """Position [mm], heading [°] and model error [N, N, N m] of the k-th run."""
    return [*_of_predictions(r, k), *_of_forces(r, k)]


def _of_predictions(r: ReportData, k: int) -> Iterator[ErrorChange]:
    """A change within two paired standard errors over the windows is noise."""
    e = r.evaluations[k]
    for name, factor in (("position", 1e3), ("heading", degrees(1.0))):
        before, after = getattr(e.before, name), getattr(e.after, name)
        errors = [x.errors for x in (e.before, e.after)]
        squares = [np.square(getattr(x, name)) for x in errors if x is not None]
        change = PairedChange.of(squares[0], squares[-1]) if squares else None
        is_noise = change is not None and abs(change.difference) <= Z95 * change.standard_error
        yield ErrorChange(factor * before, factor * after, is_noise)


def _of_forces(r: ReportData, k: int) -> Iterator[ErrorChange]:
    """A model error that stays within its uncertainty is noise."""
    e = r.evaluations[k]
    noise = NOISE_TOLERANCE * np.sqrt(np.mean(np.square(r.comparison.omega_std[k]), axis=0))
    for before, after, most in zip(e.before.omega_rms, e.after.omega_rms, noise, strict=True):
        yield ErrorChange(float(before), float(after), bool(after <= most))
