"""How likely the motion of a run is by a way to read its file, whatever the ship lacks within reason.

The force that a model lacks in weak form, e = z - T, is explained by what may be wrong with the model,

    r = e - sum_k b_k x_k,    b_k ~ N(0, s_k^2), between limits,

where x_k are the force of each thruster and that on each axis, of which any share may be lost and as
much be gained as the description's deviations allow, what each axis pushes beside the other two, the
hull's force of each axis, and forces that are steady in the body or on earth. What remains is noise of
the size that it has, but never less than a share of the inertial force, as no model is exact. The most
likely b give the density of the motion; densities are of the file's numbers, so that a length in feet
is less dense than one in metres.

So many windows tell one reading from another with any certainty, if only the model were true. It is
not, and counts as if it had been drawn from ``windows`` (:mod:`.settings`) independent ones at the most
(J. W. Miller, D. B. Dunson, Robust Bayesian inference via coarsening, J. Am. Stat. Assoc. 114, 2019).
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from ..predictors import Model, WeakWindows, omega
from ..predictors.thrust import full_thrust
from ..predictors.uncertainty import MEASURED
from ..predictors.weak_form import OVERLAP, needed_force, undamped
from ..runs.run_constants import STEPS
from .currents import in_further_current, in_likeliest_current
from .readings import Reading, reread
from .settings import SETTINGS


class ExplainedMotion(NamedTuple):
    """Logarithm of the density of a model error, and what it leaves, times its noise at the least."""

    density: float
    left: float


@dataclass
class Explanation:
    """Columns (K, 3) that may explain a model error, with deviation and limits of their factors."""

    columns: list[np.ndarray] = field(default_factory=list)
    priors: list[tuple[float, float, float]] = field(default_factory=list)

    def may(
        self, column: np.ndarray, deviation: float, low: float = -np.inf, high: float = np.inf
    ) -> None:
        """Add a column; one without any deviation explains nothing."""
        if deviation > 0.0:
            self.columns.append(column)
            self.priors.append((deviation, low, high))

    def explain(self, e: np.ndarray, least: np.ndarray, windows: float) -> ExplainedMotion:
        """The most likely explanation of a model error.

        Args:
            e: (K, 3), the model error.
            least: (3,), its noise at the least.
            windows: number of independent ones that it counts as.
        """
        s, low, high = np.array(self.priors).T
        columns, unit = np.array([*(np.array(self.columns) * s[:, None, None]), e]), np.eye(s.size)
        # (3, s + 1, s + 1), of each axis: as good as its rows, and few.
        axes = np.linalg.qr(columns.transpose(2, 1, 0)).R
        b, design = np.zeros(s.size), unit
        for _ in range(STEPS):  # noise and explanation in turn
            weight = np.sqrt(windows / len(e)) / _noise(axes, b, len(e), least)
            R = np.linalg.qr((axes * weight[:, None, None]).reshape(-1, s.size + 1)).R
            design, y = np.vstack([R[:, :-1], unit]), np.concatenate([R[:, -1], np.zeros(s.size)])
            b = bounded(design, y, low / s, high / s, b)
        noise = _noise(axes, b, len(e), least)
        known = np.linalg.slogdet(design.T @ design)[1]
        density = float(-windows * np.log(noise).sum() - 0.5 * (b @ b + known))
        return ExplainedMotion(density, float((noise / least).max()))


def bounded(
    design: np.ndarray, y: np.ndarray, low: np.ndarray, high: np.ndarray, near: np.ndarray
) -> np.ndarray:
    """b of least |y - design b| between limits, by those that hold for one nearby if they hold again.

    Where design has full rank there is one b whose free factors are within the limits, and whose others
    would only go beyond them (Karush, Kuhn and Tucker).
    """
    at_low, at_high = near <= low, near >= high
    free = ~(at_low | at_high)
    b = np.where(at_low, low, np.where(at_high, high, 0.0))
    held = y - design[:, ~free] @ b[~free]
    part = design[:, free]
    b[free] = np.linalg.solve(part.T @ part, part.T @ held)
    slope = (design @ b - y) @ design
    within = (b[free] >= low[free]).all() and (b[free] <= high[free]).all()
    if within and (slope[at_low] >= 0.0).all() and (slope[at_high] <= 0.0).all():
        return b
    return lsq_linear(design, y, (low, high), method="bvls").x


def _noise(axes: np.ndarray, b: np.ndarray, windows: int, least: np.ndarray) -> np.ndarray:
    """(3,), noise that an explanation with factors b leaves in so many windows, no less than ``least``.

    ``axes`` are the triangles (3, s + 1, s + 1) of columns and model error, with the latter last.
    """
    left = axes @ np.append(-b, 1.0)
    return np.sqrt((left**2).sum(axis=1) / windows + least**2)


class ReadingOdds:
    """The densities of readings of one run.

    Args:
        w: windows of the run as it was read; of a long one its excerpt counts.
        model: of its ship.
    """

    def __init__(self, w: WeakWindows, model: Model) -> None:
        w = w.excerpt
        self.w, self.model = w, model
        independent = w.middle.size / OVERLAP
        self._full, self._undamped = most_thrust(w, model), undamped(model)
        self.windows = independent * SETTINGS.windows / (independent + SETTINGS.windows)

    def log_density(self, reading: Reading) -> float:
        """Logarithm of the density of the run's motion by a reading."""
        return self.explained(reading).density

    def explained(self, reading: Reading) -> ExplainedMotion:
        """The motion as a reading explains it."""
        with np.errstate(all="ignore"):  # in a wrong unit forces may be beyond all numbers
            w = reread(self.w, reading, self.model)
            e, z = omega(w, self.model), needed_force(w, self.model)
            a = needed_force(w, self._undamped)
            both = self._lost, in_further_current(self.model)
            each, streams = ([omega(w, m) - e for m in some] for some in both)
            found = np.concatenate([e, z, a, *each, *streams])
        if not (np.isfinite(found).all() and (a != 0.0).any(axis=0).all()):
            return ExplainedMotion(-np.inf, np.inf)
        why, T = self._steady(w), z - e
        for stream in streams:
            why.may(stream, 1.0)
        gains = [*[self._gain] * len(each), *np.hypot(self._gain, self._inertia)]
        axes = np.eye(3)
        for part, gain in zip([*each, *(T * axis for axis in axes)], gains, strict=True):
            why.may(part, gain, 0.0)  # an inertia that is less is as well a force that is more
            why.may(-part, SETTINGS.much, 0.0, 1.0)
        for axis in axes:
            why.may((a - z) * axis, 1.0, -1.0)
        least = MEASURED * np.sqrt((a**2).mean(axis=0))
        found = why.explain(e, least, self.windows)
        return found._replace(density=found.density + self.windows * reading.density)

    def in_current(self) -> "ReadingOdds":
        """The same for a ship in the current that explains most of the run as it was read."""
        unit = np.sqrt((needed_force(self.w, self._undamped) ** 2).mean(axis=0))
        return ReadingOdds(self.w, in_likeliest_current(self.w, self.model, unit))

    def _steady(self, w: WeakWindows) -> Explanation:
        """Forces that are steady in the body or on earth."""
        north, east = (
            w.smooth @ np.where(w.known, f(np.nan_to_num(w.smoothed.eta[:, 2])), 0.0)
            for f in (np.cos, np.sin)
        )
        zero, one, why = np.zeros_like(north), np.ones_like(north), Explanation()
        for j, size in enumerate(MEASURED * self._full):
            why.may(np.column_stack([one if k == j else zero for k in range(3)]), size)
        for column in ([north, -east, zero], [east, north, zero]):
            why.may(np.column_stack(column), MEASURED * float(self._full[0]))
        return why

    @cached_property
    def _lost(self) -> list[Model]:
        """The model without each of its thrusters; of a single one the axes tell as much."""
        effects = self.model.ship.effects.of_kind("actuator")
        axes = {f"loss_{axis}" for axis in ("surge", "sway", "yaw")}
        names = [p.name for e in effects if e.id.startswith("loss_") for p in e.parameters]
        found = [name for name in names if name not in axes]
        return [self.model.plus({n: 1.0}) for n in found] if len(found) > 1 else []

    @cached_property
    def _gain(self) -> float:
        """Relative deviation of the thrusters' forces."""
        known = self.model.ship.coefficients.items()
        return max([k.share for n, k in known if k.group == "thrust"], default=0.0)

    @cached_property
    def _inertia(self) -> np.ndarray:
        """(3,), relative deviation of the inertia of each axis."""
        own, model = self.model.mass.diagonal(), self.model
        known = [(n, k) for n, k in model.ship.coefficients.items() if model.owner(n) == "vessel"]
        others = [model.plus({n: k.deviation(model.value(n))}) for n, k in known]
        changes = [other.mass.diagonal() - own for other in others]
        return np.sqrt(np.square(changes).sum(axis=0)) / own


def most_thrust(w: WeakWindows, model: Model) -> np.ndarray:
    """(3,), force and moment [N, N, N m] that a ship can do at the most, sideways as much as ahead."""
    full = np.fmax(full_thrust(model), np.abs(w.run.tau_cmd).max(axis=0))
    force = full[:2].max()
    return np.array([force, force, full[2] or 0.5 * force * model.ship.description.length])
