"""Is a learned model one that may be simulated and controlled? See docs/stability.md.

Three questions: is the mass matrix positive definite, does the hull brake at least as much as that of
the nominal model, and does the reference controller hold the ship on the reference paths. The thesis
left such a criterion as future work (7.4, chapter 8), after a regression model had failed (Fig. 7.16).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite
from typing import NamedTuple

import numpy as np

from cosim import InputError
from fmus.effects import Ship, effects
from fmus.hull import damping_force, mass_matrix
from fmus.vessel.model_errors import NONE, OUTSIDE

from .loop import BOUND, REFERENCES, largest_error
from .model import Model

MOTIONS = (("surge", "m/s"), ("sway", "m/s"), ("yaw", "rad/s"))
# Shares of the nominal dissipation below which a difference is none: nobody knows a coefficient to 1 %.
TOLERANCE = 0.01
DIRECTIONS = 21
SPEEDS = np.linspace(0.02, 1.0, 25)


class Region(NamedTuple):
    """Largest |u|, |v| [m/s] and |r| [rad/s] at which the ship operates.

    The default holds 99 % of what NTNU measured of CyberShip Enterprise 1; the thesis' paths stay below
    half of it.
    """

    u: float = 0.35
    v: float = 0.15
    r: float = 0.4

    @classmethod
    def of(cls, nu: np.ndarray) -> "Region":
        """What holds 99 % of a measured motion nu (n, 3), and at least a tenth of the default."""
        known = np.abs(nu[np.isfinite(nu).all(axis=1)])
        most = np.quantile(known, 0.99, axis=0) if len(known) else np.zeros(3)
        return cls(*map(float, np.maximum(most, 0.1 * np.array(cls()))))


OPERATING = Region()


@dataclass(frozen=True)
class Stability:
    """What the check found.

    Attributes:
        mass_definite: whether M is positive definite.
        nominal_min_dissipation, learned_min_dissipation: smallest dissipation over the region [1/s].
        bounded: whether the ship stays near its target on every reference path.
        region: where the learned hull brakes less than the nominal one, with numbers; None: nowhere.
        notes: what else is worth saying, a sentence each.
    """

    mass_definite: bool
    nominal_min_dissipation: float
    learned_min_dissipation: float
    bounded: bool
    region: str | None
    notes: tuple[str, ...]

    @property
    def safe(self) -> bool:
        """Whether the model may be written without ``--allow-unstable``."""
        return self.mass_definite and self.bounded


def check(
    model: Model,
    nominal: Model,
    advance: Callable[[str], None] = lambda _: None,
    region: Region = OPERATING,
) -> Stability:
    """Check a learned model against the nominal one.

    Args:
        model, nominal: the learned model and the one that it started from.
        advance: receives what is done next, a few words each.
        region: where the dissipation is compared.

    Raises:
        InputError: the nominal model's mass matrix is not positive definite, the learned model's has no
            inverse, or the region has no size.
    """
    if not all(isfinite(most) and most > 0.0 for most in region):
        raise InputError("the operating region needs positive limits of u, v and r")
    metric = mass(nominal)
    if not definite(metric):
        raise InputError("the mass matrix of the nominal model is not positive definite")
    sound = definite(mass(model))
    advance("dissipation")
    everywhere = motions(region)
    before = dissipation(nominal, everywhere, metric)
    after = dissipation(model, everywhere, metric)
    notes = (
        [] if sound else ["the mass matrix is not positive definite: some force would push backwards"]
    )
    found = [_compare(k, model, nominal, metric, region) for k in range(3)]
    told = [text for text in found if text]
    lowest = int(np.argmin(after))
    if not told and _less(after.min(), before.min()):
        told = [_place(everywhere[lowest], float(after.min()), float(before.min()))]
    bounded = sound and _bounded(model, nominal, advance, notes)
    return Stability(
        sound,
        float(before.min()),
        float(after.min()),
        bounded,
        "; ".join(told) or None,
        tuple(dict.fromkeys(notes)),
    )


def mass(model: Model) -> np.ndarray:
    """(3, 3) symmetric part of M [kg, kg m, kg m2], effects included."""
    try:
        M = np.array(mass_matrix(model.hull.hull.inertia), dtype=float)
    except ZeroDivisionError:
        raise InputError("a mass matrix has no inverse: no force would move the ship") from None
    return 0.5 * (M + M.T)


def definite(M: np.ndarray) -> bool:
    """Whether a symmetric matrix is positive definite."""
    return bool(np.linalg.eigvalsh(M).min() > 0.0)


def force(model: Model, nu: np.ndarray) -> np.ndarray:
    """Force (n, 3) [N, N, N m] on the hull by its motion nu (n, 3) through the water.

    Damping, its changes, free curves and the user's effects. Of an effect from outside only what
    depends on the velocity counts: its force at rest is taken off. Coriolis forces do no work.
    """
    b = model.hull

    def total(u: np.ndarray, v: np.ndarray, r: np.ndarray) -> np.ndarray:
        at = Ship(0.0, 0.0, 0.0, u, v, r, 0.0)
        found = np.stack(damping_force(u, v, r, b.hull.damping))
        for member, acts in zip(OUTSIDE.members, b.outside, strict=True):
            pushed = member.apply(acts, b.params.outside, NONE, at)
            found = found + np.stack([np.broadcast_to(axis, u.shape) for axis in pushed])
        return found.T

    return total(*nu.T) - total(*np.zeros((3, 1)))


def dissipation(model: Model, nu: np.ndarray, metric: np.ndarray) -> np.ndarray:
    """-nu . F(nu) / (nu . M nu) (n,) [1/s]: the rate at which the hull's own force takes speed off.

    For straight damping F = -D nu its minimum over all directions is the smallest eigenvalue of the
    symmetric part of D relative to M. Unlike a matrix D(nu) it does not depend on how F is factorised.
    """
    power = -np.einsum("ij,ij->i", nu, force(model, nu))
    return power / np.einsum("ij,jk,ik->i", nu, metric, nu)


def motions(region: Region) -> np.ndarray:
    """Velocities (n, 3) that fill a region: all directions, from slow to its border."""
    edge = np.linspace(-1.0, 1.0, DIRECTIONS)
    a, b = (grid.ravel() for grid in np.meshgrid(edge, edge))
    one = np.ones_like(a)
    faces = [
        np.roll(np.column_stack([side * one, a, b]), k, axis=1) for k in range(3) for side in (-1, 1)
    ]
    directions = np.concatenate(faces) * np.array(region)
    return (SPEEDS[:, None, None] * directions).reshape(-1, 3)


def _less(after: float, before: float) -> bool:
    return after < before - TOLERANCE * abs(before)


def _compare(k: int, model: Model, nominal: Model, metric: np.ndarray, region: Region) -> str:
    """Where and how the learned hull brakes less in one motion alone; empty: nowhere."""
    name, unit = MOTIONS[k]
    speeds = np.concatenate([-SPEEDS[::-1], SPEEDS]) * region[k]
    nu = np.zeros((len(speeds), 3))
    nu[:, k] = speeds
    before, after = dissipation(nominal, nu, metric), dissipation(model, nu, metric)
    if not _less(after.min(), before.min()):
        return ""
    where = speeds[after < before - TOLERANCE * np.abs(before)]
    how = "is driven on" if after.min() < 0.0 else "is braked less"
    return (
        f"{name} from {where.min():.2g} to {where.max():.2g} {unit}: the hull {how}, {after.min():.3g} "
        f"1/s at {speeds[np.argmin(after)]:.2g} {unit} (nominal at least {before.min():.3g})"
    )


def _place(nu: np.ndarray, after: float, before: float) -> str:
    u, v, r = nu
    return (
        f"motions like u = {u:.2g} m/s, v = {v:.2g} m/s, r = {r:.2g} rad/s: "
        f"{after:.3g} 1/s (nominal at least {before:.3g})"
    )


def _bounded(model: Model, nominal: Model, advance: Callable[[str], None], notes: list[str]) -> bool:
    """Whether the reference controller holds the ship on every path; says why not."""
    bounded = True
    for reference in REFERENCES:
        advance(f"closed loop on the {reference.name}")
        error = largest_error(reference, model)
        if error < BOUND:
            notes.append(f"{reference.name}: at most {error:.2g} m from the target")
            continue
        bounded = False
        notes.append(f"{reference.name}: more than {BOUND:g} m from the target")
        outside = {p.name for e in effects("environment") for p in e.parameters}
        calm = replace(model, vessel={k: v for k, v in model.vessel.items() if k not in outside})
        if calm.vessel != model.vessel and largest_error(reference, calm) < BOUND:
            notes.append(
                "it holds without wind, waves and current: they are too strong for the thrusters"
            )
        elif largest_error(reference, nominal) >= BOUND:
            notes.append("the nominal model is not held there either")
    return bounded
