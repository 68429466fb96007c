"""Check whether a learned model may be simulated and controlled, see docs/stability.md.

Three conditions: the mass matrix is positive definite, the hull dissipates at least as much as that of
the nominal model, and the reference controller keeps the ship on the reference paths. The thesis left
such a criterion as future work (7.4, chapter 8), after a regression model had failed (Fig. 7.16).
"""

from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from cosim import InputError
from fmus.effects import Loaded
from fmus.hull import damping_force
from fmus.scale import REFERENCE, Scale
from fmus.signals import Force
from fmus.vessel import vessel
from fmus.vessel.vessel_effects import NONE

from ..execution.parallel import for_each
from ..execution.progress import Advance, silent
from ..predictors import Model
from ..predictors.thrust import FORGOTTEN
from ..predictors.uncertainty import MEASURED
from ..runs.cleaning import BRIEF
from ..runs.run_constants import CHANCE, NEGLIGIBLE
from .closed_loop import REFERENCES, bound_of, largest_distance
from .settings import SETTINGS

MOTIONS = (("surge", "m/s"), ("sway", "m/s"), ("yaw", "rad/s"))


class OperatingRegion(NamedTuple):
    """Largest speeds at which a ship operates.

    The default holds 99 % of each of the four runs that NTNU published of CyberShip Enterprise 1; the
    thesis' paths stay below half of it.

    Attributes:
        u, v, r: largest speed ahead and |v| [m/s], largest |r| [rad/s].
        astern: largest speed astern [m/s]. Terms such as Y_uv u v are those of a ship that goes ahead;
            astern they drive it on, so that a ship is judged there only as far as it goes there.
    """

    u: float = SETTINGS.limits[0]
    v: float = SETTINGS.limits[1]
    r: float = SETTINGS.limits[2]
    astern: float = SETTINGS.limits[0]

    @property
    def edges(self) -> np.ndarray:
        """(2, 3), lowest and highest u, v, r [m/s, m/s, rad/s]."""
        return np.array([(-self.astern, -self.v, -self.r), (self.u, self.v, self.r)])

    @property
    def largest(self) -> tuple[float, float, float]:
        """Largest |u|, |v| [m/s] and |r| [rad/s]."""
        return max(self.u, self.astern), self.v, self.r

    @classmethod
    def at(cls, scale: Scale) -> "OperatingRegion":
        """The default region of a ship of some size."""
        u, v, r = scale.speeds
        return cls(*(x * f for x, f in zip(cls(), (u, v, r, u), strict=True)))

    @classmethod
    def of(cls, nu: np.ndarray, scale: Scale = REFERENCE) -> "OperatingRegion":
        """The region that holds 99 % of a motion nu (n, 3), and at least a tenth of the default one."""
        u, v, r = nu[np.isfinite(nu).all(axis=1)].T
        sizes = (u[u > 0.0], np.abs(v), np.abs(r), -u[u < 0.0])
        most = [np.quantile(size, 1.0 - CHANCE) if size.size else 0.0 for size in sizes]
        return cls(*map(float, np.maximum(most, SETTINGS.least_region * np.array(cls.at(scale)))))


OPERATING = OperatingRegion()
NOT_BY_HULL = (
    "its hull is held there without wind, waves and current by the thrusters of the initial model; "
    "these are too strong for the learned thrusters"
)
NOT_HELD = "the initial model is not held there either"
NOR_NOMINAL = "nor does that of the initial model"
NO_THRUST = "its thrusters give no force on some axis, so no reference controller can hold it"
NO_ALLOCATION = (
    "its thrusters get commands and no force request (thrust_allocation = false), so no reference "
    "controller can hold it"
)


@dataclass(frozen=True)
class Stability:
    """Result of the check.

    Attributes:
        mass_definite: whether M is positive definite.
        nominal_min_dissipation, learned_min_dissipation: smallest dissipation over the region [1/s].
        bounded: whether the ship stays within some ship lengths of its target on every reference path.
            Of a ship that no controller holds there: whether its motion decays without thrust.
        closed_loop: which of the two was judged.
        from_start: whether the initial model fails wherever the learned one does, and its hull
            dissipates no more: then nothing that was learned is the reason.
        region: where the learned hull dissipates less than the nominal one, with numbers; None: nowhere.
        notes: further remarks, a sentence each.
        weak: whether the ship is lost because its thrusters are too weak, and nowhere by its hull, which
            is held on each path on which the initial model is.
        driven_on: motions in which the learned hull gains energy, and the nominal one less or none.
    """

    mass_definite: bool
    nominal_min_dissipation: float
    learned_min_dissipation: float
    bounded: bool
    region: str | None
    notes: tuple[str, ...]
    closed_loop: bool = True
    from_start: bool = False
    driven_on: tuple[str, ...] = ()
    weak: bool = False

    @property
    def safe(self) -> bool:
        """Whether the model may be written without ``--allow-unstable``."""
        return self.mass_definite and (self.bounded or self.from_start or self.weak)


def check_stability(
    model: Model,
    nominal: Model,
    advance: Advance = silent,
    region: OperatingRegion | None = None,
    measured: np.ndarray | None = None,
) -> Stability:
    """Check a learned model against the nominal one.

    Args:
        model, nominal: the learned model and the initial one.
        advance: receives the name of each step when it begins.
        region: where the dissipation is compared; by default that of the size of the ship.
        measured: (n, 3), velocities [m/s, m/s, rad/s] from which a ship that no controller holds has to
            stay bounded; by default the border of the region, with motions that no run may have.

    Raises:
        InputError: the nominal model's mass matrix is not positive definite, the learned model's has no
            inverse, or the region has no size.
    """
    region = region or OperatingRegion.at(model.ship.scale)
    if not all(isfinite(most) and most > 0.0 for most in region):
        raise InputError("the operating region needs positive limits of u, v and r")
    metric = mass(nominal)
    if not is_definite(metric):
        raise InputError("the mass matrix of the nominal model is not positive definite")
    mass_definite = is_definite(mass(model))
    advance("dissipation")
    everywhere = sampled_motions(region)
    before = dissipation(nominal, everywhere, metric)
    after = dissipation(model, everywhere, metric)
    indefinite = (
        "the mass matrix is not positive definite: in some direction a force would accelerate the "
        "ship backwards"
    )
    notes = [] if mass_definite else [indefinite]
    worse = [*filter(None, (_compare(k, model, nominal, metric, region) for k in range(3)))]
    if not worse and _less(after.min(), before.min()):
        u, v, r = everywhere[np.argmin(after)]
        worse = [
            f"motions like u = {u:.2g} m/s, v = {v:.2g} m/s, r = {r:.2g} rad/s: "
            f"{after.min():.3g} 1/s (nominal at least {before.min():.3g})"
        ]
    bounded, both, weak, held = False, False, False, model.ship.fully_actuated
    if held and mass_definite:
        bounded, both, weak = _on_paths(model, nominal, advance, notes)
        held = not both  # paths on which the nominal ship is lost as well tell nothing of the other
    if not held:
        advance("the decay of the motion without thrust")
        border = np.split(everywhere, SETTINGS.directions)[-1]
        first = border if measured is None else measured[:: -(-len(measured) // len(border))]
        if not model.ship.fully_actuated:
            notes.append(NO_THRUST if model.ship.description.allocates else NO_ALLOCATION)
        bounded = mass_definite and comes_to_rest(model, first, region, notes)
        both = not (bounded or comes_to_rest(nominal, first, region, []))
        notes += [NOR_NOMINAL] if both else []
    return Stability(
        mass_definite,
        float(before.min()),
        float(after.min()),
        bounded,
        "; ".join(worse) or None,
        tuple(dict.fromkeys(notes)),
        held,
        both and not _less(after.min(), before.min()),
        driven_on(model, nominal, region),
        weak,
    )


def mass(model: Model) -> np.ndarray:
    """(3, 3) symmetric part of M [kg, kg m, kg m2], effects included."""
    try:
        M = model.mass
    except ZeroDivisionError:
        raise InputError("a mass matrix is singular: no force can accelerate the ship") from None
    return 0.5 * (M + M.T)


def is_definite(M: np.ndarray) -> bool:
    """Whether a symmetric matrix is positive definite."""
    return bool(np.linalg.eigvalsh(M).min() > 0.0)


def force(model: Model, nu: np.ndarray) -> np.ndarray:
    """Force (n, 3) [N, N, N m] on the hull by its motion nu (n, 3) through the water.

    Damping, its changes, free curves and the user's effects. Of an effect from outside only what
    depends on the velocity counts: its force at rest is taken off. Coriolis forces do no work.
    """
    b = model.hull

    def total(u: np.ndarray, v: np.ndarray, r: np.ndarray) -> np.ndarray:
        at = Loaded(u=u, v=v, r=r, damping=b.hull.damping)
        # An axis without any damping is the number zero.
        parts = [damping_force(u, v, r, b.hull.damping)]
        for member, acts in zip(b.effects.outside.members, b.outside, strict=True):
            parts.append(member.apply(acts, b.params.outside, NONE, at))
        each = [np.stack([np.broadcast_to(axis, u.shape) for axis in part]) for part in parts]
        return np.sum(each, axis=0).T

    return total(*nu.T) - total(*np.zeros((3, 1)))


def dissipation(model: Model, nu: np.ndarray, metric: np.ndarray) -> np.ndarray:
    """-nu . F(nu) / (nu . M nu) (n,) [1/s]: relative rate at which the hull's force slows it down.

    For linear damping F = -D nu its minimum over all directions is the smallest eigenvalue of the
    symmetric part of D relative to M. Unlike a matrix D(nu) it does not depend on how F is factorised.
    """
    power = -np.einsum("ij,ij->i", nu, force(model, nu))
    return power / np.einsum("ij,jk,ik->i", nu, metric, nu)


def least_dissipation(model: Model, region: OperatingRegion = OPERATING) -> float:
    """The smallest dissipation [1/s] of a hull over a region, relative to the nominal mass."""
    return float(dissipation(model, sampled_motions(region), mass(Model())).min())


def sampled_motions(region: OperatingRegion) -> np.ndarray:
    """Velocities (n, 3) [m/s, m/s, rad/s] in all directions of a region, from slow to its border."""
    edge = np.linspace(-1.0, 1.0, SETTINGS.directions)
    side, a, b = (grid.ravel() for grid in np.meshgrid([-1.0, 1.0], edge, edge))
    faces = [np.roll(np.column_stack([side, a, b]), k, axis=1) for k in range(3)]
    speeds = np.linspace(0.0, 1.0, SETTINGS.directions + 1)[1:, None, None]
    return _scaled((speeds * np.concatenate(faces)).reshape(-1, 3), region)


def alone(k: int, region: OperatingRegion) -> np.ndarray:
    """Velocities (n, 3) in surge, sway or yaw alone, from one border of a region to the other."""
    nu = np.zeros((2 * SETTINGS.directions, 3))  # an even number, without rest
    nu[:, k] = np.linspace(-1.0, 1.0, len(nu))
    return _scaled(nu, region)


def _scaled(nu: np.ndarray, region: OperatingRegion) -> np.ndarray:
    """Velocities (n, 3) of a region from those of a region of size one."""
    return np.abs(nu) * np.where(nu < 0.0, *region.edges)


def driven_on(model: Model, other: Model, region: OperatingRegion) -> tuple[str, ...]:
    """The motions, surge, sway or yaw alone, in which a hull drives the ship on, and another less.

    A motion that grows by less than NEGLIGIBLE until the ship has forgotten its commands does not count.
    """
    metric, found = mass(other), []
    slow = NEGLIGIBLE / (FORGOTTEN * model.ship.scale.time)
    for k, (name, _) in enumerate(MOTIONS):
        lowest, of_other = (dissipation(m, alone(k, region), metric).min() for m in (model, other))
        if lowest < -slow and _less(lowest, of_other):
            found.append(name)
    return tuple(found)


def _less(after: Any, before: Any) -> Any:
    return after < before - MEASURED**2 * np.abs(before)


def _compare(k: int, model: Model, nominal: Model, metric: np.ndarray, region: OperatingRegion) -> str:
    """Where and how the learned hull dissipates less in one motion alone; empty: nowhere."""
    name, unit = MOTIONS[k]
    nu = alone(k, region)
    before, after = dissipation(nominal, nu, metric), dissipation(model, nu, metric)
    if not _less(after.min(), before.min()):
        return ""
    speeds = nu[:, k]
    worse = speeds[_less(after, before)]
    how = "gains energy" if after.min() < 0.0 else "is damped less"
    return (
        f"{name} from {worse.min():.2g} to {worse.max():.2g} {unit}: the hull {how}, {after.min():.3g} "
        f"1/s at {speeds[np.argmin(after)]:.2g} {unit} (nominal at least {before.min():.3g})"
    )


def comes_to_rest(model: Model, motions: np.ndarray, region: OperatingRegion, notes: list[str]) -> bool:
    """Whether a ship without thrust stays near the speeds of its region, from motions (n, 3) there.

    In still water and without what acts from outside; ``notes`` receives what was found.
    """
    scale = model.ship.scale
    still = np.zeros(len(motions))
    s = vessel.State._make([still, still, still, *motions.T, still])
    most, h = 0.0, BRIEF
    with np.errstate(all="ignore"):
        for _ in range(round(FORGOTTEN / h)):
            s = vessel.integrate(s, Force(0.0, 0.0, 0.0), model.hull.hull, h * scale.time)
            speeds = np.abs(np.stack([s.u, s.v, s.r])) / np.array(region.largest)[:, None]
            most = max(most, float(np.nan_to_num(speeds, nan=np.inf).max()))
            if most > SETTINGS.runaway:
                break
    kept = most <= SETTINGS.runaway
    what = f"{'stays below' if kept else 'exceeds'} {SETTINGS.runaway:g} times"
    notes.append(f"the motion without thrust is checked, and {what} the speeds of its region")
    return kept


def _on_paths(
    model: Model, nominal: Model, advance: Advance, notes: list[str]
) -> tuple[bool, bool, bool]:
    """Let the reference controller steer a model along every path; adds to the notes how well.

    Returns:
        Whether it keeps the ship on every path; whether it does not, and the nominal ship is lost
        wherever this one is; and whether the model is weak, see :class:`Stability`.
    """
    bounded, both, weak, bound = True, True, False, bound_of(model)
    advance(f"closed loop on the {' and the '.join(r.name for r in REFERENCES)}")
    distances = for_each(lambda r: largest_distance(r, model), REFERENCES)
    outside = {p.name for e in model.ship.effects.of_kind("environment") for p in e.parameters}
    calm = {k: v for k, v in model.vessel.items() if k not in outside}
    hull, by_hull = replace(model, vessel=calm, thrusters=nominal.thrusters), False
    of_hull = (hull.vessel, hull.thrusters) != (model.vessel, model.thrusters)
    for reference, distance in zip(REFERENCES, distances, strict=True):
        if distance < bound:
            notes.append(f"{reference.name}: at most {distance:.2g} m from the target")
            continue
        bounded = False
        notes.append(f"{reference.name}: more than {bound:.3g} m from the target")
        if of_hull and largest_distance(reference, hull) < bound:
            notes.append(NOT_BY_HULL)
            both, weak = False, True
        elif largest_distance(reference, nominal) >= bound:
            notes.append(NOT_HELD)
        else:
            both, by_hull = False, True
    return bounded, both and not bounded, weak and not by_hull
