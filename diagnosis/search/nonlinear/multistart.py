"""Nonlinear parameters of an effect: starts spread over their ranges, the best refined.

With s the parameters that the force is not linear in, beta those that it is, y the model error and X(s)
the force for one unit of each beta, all over the root mean square of y on each axis, minimised is

    |y - X(s) beta(s)|^2 over s within its limits,    beta(s) = argmin |y - X(s) beta|^2

(variable projection, Golub and Pereyra 1973), by a trust region method with bounds
(:func:`scipy.optimize.least_squares`) from the best of many points of a Sobol sequence. A parameter
without limits is tried on both sides of its start, the further the sparser. The nominal coefficients
stay where they are: the refinement moves them along afterwards.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import asinh, pi

import numpy as np
from scipy.optimize import least_squares

from fmus.declare import Variable
from fmus.effects import Effect

POINTS = 32  # 1, of a Sobol sequence, besides the start; chosen: of one number every 3 % of its range
REFINED = 3  # 1, best starts or plans that are examined further; chosen
# 1; an effect without values of its own is tried at multiples of the value at which its force is as
# large as the model error. A parameter without limits is tried as far to both sides of its scale;
# chosen.
MULTIPLES = (0.1, 0.3, 1.0, 3.0, 10.0)
WIDEST = MULTIPLES[-1]

Force = Callable[[Mapping[str, float]], np.ndarray]
Values = dict[str, float]


@dataclass(frozen=True, eq=False)
class Landscape:
    """How the model error depends on the parameters of an effect.

    Attributes:
        effect: which.
        force: what values of its parameters, by name, take away of it; (N,), as y.
        y: (N,), model error; both in units of its root mean square on each axis.
        extent: how far the ship moved [m], by which lengths without limits are tried.
        values: of the parameters in the model so far.
        units: what one unit of each parameter is at the size of the ship.
    """

    effect: Effect
    force: Force
    y: np.ndarray
    extent: float
    values: Mapping[str, float]
    units: Mapping[str, float]

    def declared(self, names: Sequence[str]) -> list[Variable]:
        """The declarations of some parameters."""
        by_name = {p.name: p for p in self.effect.parameters}
        return [by_name[name] for name in names]

    def scale(self, p: Variable) -> float:
        """Of a parameter: its start, its limits, or how far the ship moved and turned."""
        ends = [abs(x) for x in (p.range.min, p.range.max) if x is not None]
        by_unit = {"m": self.extent / 5.0, "rad": pi / WIDEST}.get(p.unit, 0.0)
        return max(abs(self.values[p.name]), by_unit) or max(ends, default=0.0) or self.units[p.name]

    def within(self, p: Variable, share: float) -> float:
        """The value at a share, 0 to 1, of the way through what is tried of a parameter."""
        low, high = p.range.min, p.range.max
        if low is not None and high is not None:
            if low > 0.0 and high > WIDEST**2 * low:  # further than both sides of a scale
                return low * (high / low) ** share
            return low + share * (high - low)
        value = self.values[p.name] + self.scale(p) * np.sinh((2.0 * share - 1.0) * asinh(WIDEST))
        return float(np.clip(value, *limits(p)))

    def points(self, names: Sequence[str]) -> Iterator[Values]:
        """Where some parameters are tried: as they are, and spread over their ranges."""
        yield {n: self.values[n] for n in names}
        if names:
            from scipy.stats import qmc  # takes a while to import

            shares = qmc.Sobol(len(names), scramble=False).random(POINTS)
            for row in shares.tolist():
                pairs = zip(self.declared(names), row, strict=True)
                yield {p.name: self.within(p, share) for p, share in pairs}

    def unit(self, name: str) -> float:
        """One, or half of a coefficient's limit if that is less: the double is within it."""
        (p,) = self.declared([name])
        one = self.units[name]
        return one if p.range.max is None else min(one, 0.5 * p.range.max)

    def columns(self, shape: Mapping[str, float], linear: Sequence[str]) -> np.ndarray:
        """(N, p), force for one unit of each linear parameter."""
        units = [(name, self.unit(name)) for name in linear]
        none = dict.fromkeys(linear, 0.0)
        columns = [self.force({**shape, **none, name: unit}) / unit for name, unit in units]
        return np.column_stack([*columns, np.zeros((self.y.size, 0))])

    def left(self, shape: Mapping[str, float], linear: Sequence[str]) -> np.ndarray:
        """(N,), what the best fit of the linear parameters leaves of the model error."""
        if not linear:
            return self.y - self.force(shape)
        X = self.columns(shape, linear)
        if not np.isfinite(X).all():
            return self.y
        return self.y - X @ np.linalg.lstsq(X, self.y, rcond=None)[0]


def limits(p: Variable) -> tuple[float, float]:
    """Of a parameter's range, infinite where it has none."""
    low, high = p.range.min, p.range.max
    return -np.inf if low is None else low, np.inf if high is None else high


def linear_ones(of: Landscape) -> tuple[list[str], list[str]]:
    """Coefficients that the force is proportional to, and those that do nothing alone.

    Seen where the shape parameters are such that there is a force at all; the rest are nonlinear.
    """
    linear, idle = [], []
    names = of.effect.coefficients
    shapes = [*of.points(of.effect.shape_parameters)]
    for name in names:
        unit = of.unit(name)
        none = dict.fromkeys(names, 0.0)
        acting = (s for s in shapes if not np.allclose(of.force({**s, **none, name: unit}), 0.0))
        shape = next(acting, None)
        if shape is None:
            idle.append(name)
            continue
        once, twice = (of.force({**shape, **none, name: k * unit}) for k in (1.0, 2.0))
        if np.allclose(twice, 2.0 * once):
            linear.append(name)
    return linear, idle


def best_values(
    of: Landscape, coefficients: Callable[[Values], Sequence[Values]]
) -> tuple[list[Values], list[str]]:
    """Values of what an effect is nonlinear in at which it explains the model error best.

    Args:
        of: the effect.
        coefficients: values to try of coefficients that the force is not proportional to, for a shape.

    Returns:
        The values, best first, and the coefficients that are fitted at them; none where nothing acts.
    """
    linear, idle = linear_ones(of)
    if len(idle) == len(of.effect.coefficients):
        return [], []
    shape = [*of.effect.shape_parameters, *(idle if linear else ())]
    starts: list[Values] = [*of.points(shape)]
    others = [n for n in of.effect.coefficients if n not in linear and n not in shape]
    if others:
        linear = []
        tried = next(filter(None, (coefficients(s) for s in starts[: POINTS // 4])), ())
        starts = [{**s, **c} for s in starts[:: len(others) + 1] for c in tried]
    losses = [float(np.sum(of.left(s, linear) ** 2)) for s in starts]
    best = np.argsort(losses, kind="stable")[:REFINED]
    found = sorted((refined(of, starts[k], linear) for k in best), key=lambda f: f[0])
    return [values for _, values in found], linear


def refined(of: Landscape, start: Values, linear: Sequence[str]) -> tuple[float, Values]:
    """Loss and values of the nearest minimum within the limits."""
    names = [*start]
    if not names:
        return float(np.sum(of.left(start, linear) ** 2)), start
    declared = of.declared(names)
    low, high = np.array([limits(p) for p in declared]).T

    def residual(x: np.ndarray) -> np.ndarray:
        return np.nan_to_num(of.left(dict(zip(names, x.tolist(), strict=True)), linear), nan=1e6)

    fit = least_squares(
        residual,
        np.clip(list(start.values()), low, high),
        bounds=(low, high),
        x_scale=[of.scale(p) for p in declared],
    )
    return 2.0 * float(fit.cost), dict(zip(names, fit.x.tolist(), strict=True))
