"""What runs can tell of an FMU's parameters, before any fit: each alone, and groups only together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..execution.progress import Advance
from ..predictors.prediction import FAR_OFF
from ..predictors.weak_form import SMALL
from ..runs.run_constants import STEPS
from ..search.prediction_fit.joint_posterior import TOGETHER, connected
from .parameter_file import CalibratedParameter
from .residuals import Setting, WindowResiduals

# 1, share of its prior standard deviation that a value keeps with the runs, from which on they cannot
# tell it. Chosen: a tenth less is hardly news.
UNTOLD = 0.9
SHARED = 0.1  # 1, of a direction: part of a parameter in it, and cosine of two parts; chosen


@dataclass(frozen=True)
class Sensitivity:
    """What the runs say of one parameter.

    Attributes:
        parameter: with the range in which the FMU works.
        std_share: standard deviation with the runs, of that of the prior; 1: they say nothing.
        change: rms change of the outputs by one prior standard deviation, in units of their noise.
        fault: where in its range the FMU fails, and why; empty: nowhere that was tried.
    """

    parameter: CalibratedParameter
    std_share: float
    change: float
    fault: str

    @property
    def known(self) -> bool:
        """Whether the runs can tell it."""
        return self.std_share < UNTOLD


@dataclass(frozen=True)
class Sensitivities:
    """The same of all, and groups of those that are known only together."""

    each: Sequence[Sensitivity]
    together: Sequence[Sequence[str]]


def sensitivities(r: WindowResiduals, advance: Advance) -> Sensitivities:
    """What the windows of some runs can tell, by central differences.

    Raises:
        InputError: the FMU fails at its start values.
    """
    start = r.start
    advance("predictions with the start values")
    r.whiten_about(start)
    advance("ranges in which the FMU runs")
    ranges = [_working(r, start, k) for k in range(len(r.parameters))]
    r.choose([p for p, _ in ranges])
    advance("sensitivities of the predictions")
    J, faults = r.slopes(start, ())
    H = J.T @ J + np.eye(J.shape[1])
    covariance = np.linalg.inv(H)
    std = np.sqrt(np.diag(covariance))
    change = np.sqrt(np.mean(J**2, axis=0))
    unknown = {f.partition(":")[0]: f for f in faults}
    found = [
        Sensitivity(p, float(s), float(c), fault or unknown.get(p.name, ""))
        for (p, fault), s, c in zip(ranges, std, change, strict=True)
    ]
    seen = [k for k, s in enumerate(found) if s.change > 0.0]
    groups = confounded(J[:, seen], [found[k].parameter.name for k in seen])
    return Sensitivities(found, groups)


def confounded(slopes: np.ndarray, names: Sequence[str]) -> list[list[str]]:
    """Groups of parameters of which the data alone determine combinations only.

    The prior tells apart what the data do not. A parameter is in a group if the others inflate its
    variance as much as one whose slope has the correlation TOGETHER with its own, and shares with the
    group a direction in which the predictions do not change (D. A. Belsley et al., 1980, Regression
    Diagnostics, chapter 3).

    Args:
        slopes: (n, p), of the predictions by each parameter; none is zero.
        names: of the parameters.
    """
    if not names:
        return []
    unit = slopes / np.linalg.norm(slopes, axis=0)
    size, along = np.linalg.eigh(unit.T @ unit)
    inflated = along**2 @ (1.0 / np.maximum(size, SMALL**2))  # what differences show of slopes
    weak = along[:, size < 1.0 - TOGETHER**2]  # an inflated variance has one at least
    shared = np.abs(weak @ weak.T)
    own = np.sqrt(np.diag(shared))
    inside = (inflated > 1.0 / (1.0 - TOGETHER**2)) & (own > SHARED)
    return connected(names, (shared > SHARED * np.outer(own, own)) & np.outer(inside, inside))


def _working(r: WindowResiduals, start: Setting, k: int) -> tuple[CalibratedParameter, str]:
    """A parameter with the part of its range in which the FMU works in the first window."""
    p = r.parameters[k]
    low, high = p.bounds
    faults, ends = [], {}
    for side, bound in (("min", low), ("max", high)):
        z = float(np.clip(bound, -FAR_OFF, FAR_OFF))  # a range may have no end
        fault = _fault(r, start, k, z)
        if not fault or z == 0.0:
            continue
        works, fails = 0.0, z
        for _ in range(STEPS):
            middle = 0.5 * (works + fails)
            works, fails = (works, middle) if _fault(r, start, k, middle) else (middle, fails)
        ends[side] = p.at(works)
        faults.append(f"at {p.name} = {p.at(z):.4g} {p.unit} the FMU fails: {fault}; "
                      f"{side} is {p.at(works):.4g}")  # fmt: skip
    return p.model_copy(update=ends), "; ".join(faults)


def _fault(r: WindowResiduals, start: Setting, k: int, z: float) -> str:
    (predicted,) = r.predict([r.at(start, k, z)], [0])[0]
    return predicted.fault
