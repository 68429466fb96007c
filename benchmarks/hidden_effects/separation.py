"""How much of a hidden force each other effect could not have given: from the truth alone.

The separation of a hidden effect from another is the share of the hidden force, as a sum of squares with
the axes weighted by noise, that the best fit of the other leaves over. Nominal coefficients
that are nuisance parameters may change by up to 10 % each in favour of the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scipy.optimize import lsq_linear

from fmus.ship import ship

from .truth import WEIGHTS, Motion, Values, over

EFFECTS = ship().effects

SEPARABLE = 0.05
# The nominal coefficients of hull and thrusters.
COEFFICIENTS = {
    name: declared[name].start
    for name in ship().coefficients
    for declared in (ship().parameters["vessel"] | ship().parameters["thrusters"],)
    if declared[name].start != 0.0
}
MOST_CHANGE = 0.1  # of a coefficient; as much as the plants of the benchmark differ
NOTHING = ""  # the id of no effect at all
# A free curve that holds an effect as a special case is no rival of it: the simpler one must win.
CONTAINS = {
    "curve_X(u)": {"X_u", "X_|u|u", "X_uuu", "X_uu"},
    "curve_vsp_x(c)": {"loss_surge", "thrust_curve"},
    "curve_bow(|u|)": {"loss_bow", "bow_speed_loss"},
    "thrust_curve": {"loss_surge"},
    "bow_outage": {"bow_failure"},
}
STEPS = np.arange(0.02, 0.6, 0.02)
GRIDS: dict[str, list[dict[str, float]]] = {
    "bow_speed_loss": [{"bow_speed_loss": k} for k in np.geomspace(0.1, 20.0, 30)],
    "bow_failure": [{"bow_failure_time": t} for t in np.arange(5.0, 240.0, 2.5)],
    "deadband": [{"deadband": d} for d in np.geomspace(0.004, 0.6, 30)],
    "saturation": [
        {name: share * full}
        for name, full in (("saturation_vsp", 1.165), ("saturation_bow", 2.629))
        for share in np.geomspace(0.05, 0.95, 20)
    ],
    "lag": [{"lag": T} for T in np.geomspace(0.01, 3.0, 30)],
    "delay": [{"delay": T} for T in (*STEPS, *np.arange(0.6, 2.0, 0.1))],
    "clock_offset": [{"clock_offset": sign * d} for sign, d in product((1.0, -1.0), STEPS)],
    "thrust_curve": [{"thrust_curve_deadband": d} for d in (0.0, *np.geomspace(0.01, 0.6, 14))],
}
# Linear parameters of an effect that is nonlinear in those of its grid.
SCALES = {"thrust_curve": ("thrust_curve_ahead", "thrust_curve_astern")}
GAUSS_NEWTON_STEPS = 3  # for effects that are differentiable and not linear
SMALL = 1e-3
DIFFERENTIABLE = {
    "current",
    "mass",
    "centre_of_gravity",
    "added_mass_X",
    "added_mass_Y",
    "added_mass_N",
    "marker_offset",
    "heading_offset",
}


@dataclass(eq=False)
class Rivals:
    """All effects, as rivals on some runs.

    Attributes:
        runs: true motions of the training runs, of one plant.
        nuisance: whether nominal coefficients may change.
        known: forces that were computed, by the values of their parameters.
        Q, R: of the changes of nominal coefficients.
    """

    runs: Sequence[Motion]
    nuisance: bool
    known: dict[tuple[tuple[str, float], ...], np.ndarray] = field(init=False, default_factory=dict)
    Q: np.ndarray = field(init=False)
    R: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        changes = [
            self._force({name: (1.0 + SMALL) * x}) / SMALL for name, x in self.coefficients.items()
        ]
        none = np.zeros((self._force({}).size, 0))
        self.Q, self.R = np.linalg.qr(np.column_stack([*changes, none]))

    @property
    def coefficients(self) -> dict[str, float]:
        """Those that may change."""
        return COEFFICIENTS if self.nuisance else {}

    def separations(self, hidden: np.ndarray, right: Sequence[str]) -> dict[str, float]:
        """Separation of a hidden force from every rival.

        Args:
            hidden: (K, 3), windows of the force.
            right: ids that count as the effect itself.
        """
        target = flat(hidden)
        contained = [e for e, held in CONTAINS.items() if held & set(right)]
        looked_for = (e for e in EFFECTS.values() if e.search.by != "given")
        possible = [e.id for e in looked_for if not e.apart]
        found = {e: self.left(target, e) for e in possible if e not in {*right, *contained, "waves"}}
        if self.nuisance:
            found[NOTHING] = self._share(target, target, [])
        return found

    def left(self, target: np.ndarray, effect: str) -> float:
        """Share of a force, flat and weighted, that the best fit of an effect leaves over."""
        if effect in DIFFERENTIABLE:
            return self._gauss_newton(target, effect)
        if effect not in GRIDS:
            names = EFFECTS[effect].coefficients
            return self._share(target, target, [self._force({name: 1.0}) for name in names])
        shares = []
        for given in GRIDS[effect]:
            offset = self._force(given) if any(given.values()) else 0.0 * target
            columns = [self._slope(given, {name: 1.0}, 1.0) for name in SCALES.get(effect, ())]
            shares.append((self._share(target, target - offset, columns), offset))
        if effect == "saturation":  # two limits, which act on different thrusters
            half = len(shares) // 2
            near = [sorted(part, key=lambda s: s[0])[:4] for part in (shares[:half], shares[half:])]
            both = [a + b for (_, a), (_, b) in product(*near)]
            shares += [(self._share(target, target - offset, []), offset) for offset in both]
        return min(1.0, *(share for share, _ in shares))  # it may as well be absent

    def _gauss_newton(self, target: np.ndarray, effect: str) -> float:
        """Share left by a differentiable effect, by Gauss-Newton steps."""
        names = EFFECTS[effect].coefficients
        values, best = dict.fromkeys(names, 0.0), 1.0
        for _ in range(GAUSS_NEWTON_STEPS):
            offset = self._force(values) if any(values.values()) else 0.0 * target
            columns = [self._slope(values, {name: SMALL}, SMALL) for name in names]
            best = min(best, self._share(target, target - offset, columns))
            beta = np.linalg.lstsq(np.column_stack(columns), target - offset, rcond=None)[0]
            values = {name: values[name] + float(b) for name, b in zip(names, beta, strict=True)}
        return best

    def _force(self, values: Values) -> np.ndarray:
        """What effects add, flat and weighted; kept, as it is asked for again for each hidden effect."""
        key = tuple(sorted(values.items()))
        if key not in self.known:
            self.known[key] = flat(over(self.runs, values))
        return self.known[key]

    def _slope(self, given: Values, step: Values, size: float) -> np.ndarray:
        """Force for one unit of a parameter, by a step of ``size``."""
        moved = self._force({**given, **{name: given.get(name, 0.0) + x for name, x in step.items()}})
        return (moved - self._force(given) if any(given.values()) else moved) / size

    def _share(self, target: np.ndarray, wanted: np.ndarray, free: Sequence[np.ndarray]) -> float:
        """Least share of ``target`` left of ``wanted`` with free columns and changed coefficients."""
        columns = [c / size for c in free if (size := np.linalg.norm(c)) > 1e-9 * np.linalg.norm(target)]
        A = np.column_stack([*columns, np.zeros((target.size, 0))])
        beside = A - self.Q @ (self.Q.T @ A)
        q, r = np.linalg.qr(beside)
        by_changes, by_free = self.Q.T @ wanted, q.T @ (wanted - self.Q @ (self.Q.T @ wanted))
        left = float(wanted @ wanted - by_changes @ by_changes - by_free @ by_free)
        if self.nuisance:
            matrix = np.block([[self.R, self.Q.T @ A], [np.zeros((len(r), len(self.R))), r]])
            most = np.concatenate([np.full(len(self.R), MOST_CHANGE), np.full(len(r), np.inf)])
            fit = lsq_linear(matrix, np.concatenate([by_changes, by_free]), (-most, most), tol=1e-6)
            left += 2.0 * float(fit.cost)
        return max(left, 0.0) / float(target @ target)


def flat(force: np.ndarray) -> np.ndarray:
    """Windows (K, 3) of a force as one vector in units of noise."""
    return (force * WEIGHTS).reshape(-1)
