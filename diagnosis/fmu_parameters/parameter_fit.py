"""The most likely parameters and additional forces by least squares, and how well they are known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ..runs.cleaning import Z95
from ..runs.run_constants import STEPS
from ..search.most_likely import ENOUGH
from .additional_force import AdditionalForce
from .residuals import Setting, WindowResiduals

# 1, cost at the ends of a normal 95 % interval is 3.84 higher. Where it differs by more than a fifth of
# that, the interval is that of the profile (chosen).
NOT_NORMAL = 0.2


@dataclass(frozen=True, eq=False)
class ParameterFit:
    """The end of a fit.

    Attributes:
        setting: the most likely values.
        sizes: unit of each force's coefficient.
        residuals: (n,), whitened.
        slopes: (n, q), by z and by the coefficients in their units.
        faults: values of which no slope is known, and why.
    """

    setting: Setting
    sizes: tuple[float, ...]
    residuals: np.ndarray
    slopes: np.ndarray
    faults: tuple[str, ...] = ()

    @property
    def data_cost(self) -> float:
        """Sum of squares of the residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def cost(self) -> float:
        """The same with the penalty of the prior: twice the negative logarithm of the posterior."""
        z = np.array(self.setting.z)
        return self.data_cost + float(z @ z)

    @cached_property
    def precision(self) -> np.ndarray:
        """(q, q), of all values in the units of the fit; a force's coefficient has no prior."""
        p, q = len(self.setting.z), self.slopes.shape[1]
        return self.slopes.T @ self.slopes + np.diag([1.0] * p + [1e-12] * (q - p))

    @cached_property
    def covariance(self) -> np.ndarray:
        """(q, q), in the units of the fit."""
        return np.linalg.inv(self.precision)

    @property
    def log_evidence(self) -> float:
        """Logarithm of the evidence of the parameters, by Laplace, but for forces and a constant."""
        p = len(self.setting.z)
        _, log = np.linalg.slogdet(self.precision[:p, :p]) if p else (1.0, 0.0)
        return -0.5 * self.cost - 0.5 * float(log)

    @property
    def coefficients(self) -> list[float]:
        """Of the forces."""
        return [f.coefficient for f in self.setting.forces]


def fit(
    r: WindowResiduals,
    begin: Setting,
    sizes: Sequence[float] = (),
    held: Sequence[int] = (),
) -> ParameterFit:
    """Fit parameters and coefficients.

    Args:
        r: the residuals.
        begin: where to begin; its forces are fitted.
        sizes: of each force the unit of its coefficient.
        held: numbers of the parameters that stay as they are.
    """
    p, size = len(begin.z), np.array(sizes, float)
    free = np.array([k for k in range(p + size.size) if k not in held], int)
    whole = np.array([*begin.z, *(np.array([f.coefficient for f in begin.forces]) / size)])
    last: dict[str, object] = {}

    def setting(x: np.ndarray) -> Setting:
        y = whole.copy()
        y[free] = x
        return Setting(tuple(y[:p].tolist()), begin.forces).with_coefficients((y[p:] * size).tolist())

    def residuals(x: np.ndarray) -> np.ndarray:
        s = setting(x)
        (found,) = r.whitened([s])
        return np.concatenate([found, s.z])

    def slopes(x: np.ndarray) -> np.ndarray:
        J, last["faults"] = r.slopes(setting(x), sizes)
        last["J"], last["x"] = J, x.copy()
        prior = np.eye(p, J.shape[1])
        return np.concatenate([J, prior])[:, free]

    bounds = np.array([*(b.bounds for b in r.parameters), *[(-np.inf, np.inf)] * size.size])
    low, high = bounds[free].T if free.size else (np.zeros(0), np.zeros(0))
    x = np.clip(whole[free], low, high)
    if free.size:
        # A start on a bound would end there.
        inside = np.where(np.isfinite(high - low), high - low, 1.0) * 1e-6
        x = np.clip(x, low + inside, high - inside)
        jacobian: Any = slopes  # the stubs of scipy know no function here
        x = least_squares(residuals, x, jacobian, (low, high), ftol=1e-6, xtol=1e-5).x
    s = setting(x)
    if "x" in last and np.array_equal(np.asarray(last["x"]), x):
        J, faults = np.asarray(last["J"]), last["faults"]
    else:
        J, faults = r.slopes(s, sizes)
    (white,) = r.whitened([s])
    names = tuple(str(f) for f in faults) if isinstance(faults, list) else ()
    return ParameterFit(s, tuple(size.tolist()), white, J, names)


def fitted(r: WindowResiduals, begin: Setting, sizes: Sequence[float] = ()) -> ParameterFit:
    """A fit, with the slopes by start values about its end."""
    last = fit(r, begin, sizes)
    if not any(w.start_std for w in r.windows):
        return last
    for _ in range(STEPS):
        r.whiten_about(last.setting)
        new = fit(r, last.setting, sizes)
        change = np.subtract(new.setting.z, last.setting.z)
        still = change**2 < ENOUGH * np.diag(new.covariance)[: change.size]
        last = new
        if still.all():
            break
    return last


def intervals(r: WindowResiduals, f: ParameterFit, inflation: float) -> list[tuple[float, float]]:
    """95 % interval of each parameter's value; by profile where the posterior is not normal.

    Args:
        r: the residuals.
        f: the fit.
        inflation: by which variances are larger than those of white residuals.
    """
    found = []
    std = np.sqrt(inflation * np.diag(f.covariance))
    for k, p in enumerate(r.parameters):
        z, (low, high) = f.setting.z[k], p.bounds
        ends = []
        for sign, bound in ((-1.0, low), (1.0, high)):
            reach = min(Z95 * std[k], abs(bound - z))
            ends.append(z + sign * _reach(r, f, k, sign, float(reach), float(std[k]), inflation))
        found.append((p.at(ends[0]), p.at(ends[1])))
    return found


def _reach(
    r: WindowResiduals, f: ParameterFit, k: int, sign: float, reach: float, std: float, inflation: float
) -> float:
    """How far a parameter's interval reaches to one side, in z."""
    if reach <= 0.0 or not np.isfinite(reach):
        return max(reach, 0.0) if np.isfinite(reach) else 0.0
    # Along this line a normal posterior's cost grows by (distance / std)^2.
    line = f.covariance[:, k] / f.covariance[k, k]

    def rise(d: float) -> float:
        z = np.array(f.setting.z) + sign * d * line[: len(f.setting.z)]
        z = np.array([np.clip(x, *p.bounds) for x, p in zip(z, r.parameters, strict=True)])
        z[k] = f.setting.z[k] + sign * d
        change = sign * d * line[len(z) :] * np.array(f.sizes)
        forces = (np.array(f.coefficients) + change).tolist()
        s = Setting(tuple(z.tolist()), f.setting.forces).with_coefficients(forces)
        (found,) = r.whitened([s])
        total = float(found @ found + z @ z) - f.cost
        return total / inflation if np.isfinite(total) else np.inf

    wanted = (reach / std) ** 2
    if abs(rise(reach) - wanted) <= NOT_NORMAL * wanted:
        return reach
    near, far = 0.0, 2.0 * reach
    for _ in range(12):  # to a thousandth of the interval
        middle = 0.5 * (near + far)
        near, far = (
            (middle, far) if _profile(r, f, k, sign * middle) / inflation < wanted else (near, middle)
        )
    low, high = r.parameters[k].bounds
    return float(min(0.5 * (near + far), abs((high if sign > 0 else low) - f.setting.z[k])))


def _profile(r: WindowResiduals, f: ParameterFit, k: int, change: float) -> float:
    """By how much the cost grows where a parameter is moved and all else fitted anew."""
    begin = r.at(f.setting, k, f.setting.z[k] + change)
    low, high = r.parameters[k].bounds
    if not low <= begin.z[k] <= high:
        return np.inf
    (at,) = r.whitened([begin])
    if not np.isfinite(at).all():
        return np.inf
    return fit(r, begin, f.sizes, [k]).cost - f.cost


def added(f: ParameterFit, force: AdditionalForce, size: float) -> tuple[Setting, tuple[float, ...]]:
    """Where to begin with one more force, as yet zero, and the units of all."""
    return Setting(f.setting.z, (*f.setting.forces, replace(force, coefficient=0.0))), (*f.sizes, size)
