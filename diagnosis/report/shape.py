"""Effects that are a shape, such as a thruster's force over its command: the shape itself."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from fmus.effects import EFFECTS, Effect
from fmus.effects.registry import Running, Ship, Thrust
from fmus.hull import Damping, damping_force
from fmus.thrusters.chain import Plant

from ..evidence import Evidence
from ..model import Model, shares

COMMON = (0.01, 0.99)  # quantiles between which the data are said to lie
POINTS = 401
FULL = Plant()
Force = Callable[[np.ndarray, Callable[..., Any]], np.ndarray]


@dataclass(frozen=True, eq=False)
class Curve:
    """A shape that was learned.

    Attributes:
        id: of the effect.
        over, what: labels of the axes, with units.
        x, nominal, learned: (n,).
        sure: lower and upper bound (n,) of the learned one, 95 %; None if not known.
        seen: range of x that the data cover; None if not known.
        points: name -> x and y of measurements that nothing was learned from.
    """

    id: str
    over: str
    what: str
    x: np.ndarray
    nominal: np.ndarray
    learned: np.ndarray
    sure: tuple[np.ndarray, np.ndarray] | None = None
    seen: tuple[float, float] | None = None
    points: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


class Sweep(NamedTuple):
    """How a shape is laid open: ``force(x, effect)`` over x, and where the data of a run lie on x."""

    over: str
    what: str
    reach: tuple[float, float]
    force: Force
    data: Callable[[Evidence], np.ndarray]


def surge_speed(e: Evidence) -> np.ndarray:
    u = e.smoothed.nu[:, 0]
    return u[np.isfinite(u)]


def surge_command(e: Evidence) -> np.ndarray:
    return np.concatenate([each[:, 0] for each, _ in shares(e.integrals.run, Model())])


def sway_command(e: Evidence) -> np.ndarray:
    return np.concatenate([each[:, 1] for each, _ in shares(e.integrals.run, Model())])


def vsp_force(e: Evidence) -> np.ndarray:
    return FULL.plant_F_vsp * surge_command(e)


def bow_force(e: Evidence) -> np.ndarray:
    return FULL.plant_F_bow * shares(e.integrals.run, Model())[0][0][:, 2]


def hull(u: np.ndarray, effect: Callable[..., Any]) -> np.ndarray:
    return damping_force(u, 0.0, 0.0, Damping())[0] + effect(Ship(u=u))[0]


def vsp(c: np.ndarray, effect: Callable[..., Any]) -> np.ndarray:
    return effect(Thrust(vsp_x=FULL.plant_F_vsp * c), Running(u_vsp_x=c)).vsp_x


def vsp_aside(c: np.ndarray, effect: Callable[..., Any]) -> np.ndarray:
    return effect(Thrust(vsp_y=FULL.plant_F_vsp * c), Running(u_vsp_y=c)).vsp_y


def one_vsp(f: np.ndarray, effect: Callable[..., Any]) -> np.ndarray:
    return effect(Thrust(vsp_x=f), Running()).vsp_x


def one_bow(f: np.ndarray, effect: Callable[..., Any]) -> np.ndarray:
    return effect(Thrust(bow=f), Running()).bow


def bow_share(u: np.ndarray, effect: Callable[..., Any]) -> np.ndarray:
    return effect(Thrust(bow=1.0 + 0.0 * u), Running(u=u)).bow


_HULL = Sweep("surge speed u [m/s]", "damping in surge [N]", (-0.6, 0.6), hull, surge_speed)
_VSP = Sweep("VSP command in surge [1]", "VSP surge force [N]", (-1.0, 1.0), vsp, surge_command)
_ASIDE = Sweep("VSP command in sway [1]", "VSP sway force [N]", (-1.0, 1.0), vsp_aside, sway_command)
_BOW = Sweep(
    "surge speed |u| [m/s]",
    "bow effectiveness [1]",
    (0.0, 0.6),
    bow_share,
    lambda e: np.abs(surge_speed(e)),
)
_VSP_FORCE = Sweep(
    "VSP force asked [N]",
    "VSP force given [N]",
    (-FULL.plant_F_vsp, FULL.plant_F_vsp),
    one_vsp,
    vsp_force,
)
_BOW_FORCE = Sweep(
    "bow force asked [N]",
    "bow force given [N]",
    (-FULL.plant_F_bow, FULL.plant_F_bow),
    one_bow,
    bow_force,
)
SWEEPS: dict[str, tuple[Sweep, ...]] = {
    "curve_X(u)": (_HULL,),
    "curve_vsp_x(c)": (_VSP,),
    "curve_vsp_y(c)": (_ASIDE,),
    "thrust_curve": (_VSP,),
    "curve_bow(|u|)": (_BOW,),
    "bow_speed_loss": (_BOW,),
    "deadband": (_VSP_FORCE, _BOW_FORCE),
    "saturation": (_VSP_FORCE, _BOW_FORCE),
}


def curves(effects: Sequence[Mapping[str, Any]], evidence: Sequence[Evidence]) -> list[Curve]:
    """The shapes among the effects of a diagnosis.

    Args:
        effects: as in ``diagnosis.json``.
        evidence: the runs, for where their data lie.
    """
    drawn = [
        _curve(e, EFFECTS[e["id"]], sweep, evidence)
        for e in effects
        for sweep in SWEEPS.get(e["id"], ())
    ]
    return [c for c in drawn if not np.allclose(c.learned, c.nominal)]


def _curve(
    found: Mapping[str, Any], effect: Effect, sweep: Sweep, evidence: Sequence[Evidence]
) -> Curve:
    coefficients = found["coefficients"]
    seen = np.concatenate([sweep.data(e) for e in evidence])
    x = np.linspace(*sweep.reach, POINTS)

    def by(value: Callable[[Mapping[str, Any]], float]) -> np.ndarray:
        given = {name: value(c) for name, c in coefficients.items()}
        return np.broadcast_to(sweep.force(x, _with(effect, given)), x.shape)

    sure = None
    if effect.linear:  # in weights that are never negative
        sure = by(lambda c: _bound(c, 0)), by(lambda c: _bound(c, 1))
    nominal, learned = by(lambda _: 0.0), by(lambda c: c["value"])
    low, high = np.quantile(seen, COMMON)
    where = float(low), float(high)
    return Curve(effect.id, sweep.over, sweep.what, x, nominal, learned, sure, where)


def _with(effect: Effect, given: Mapping[str, float]) -> Callable[..., Any]:
    """The effect's function with parameters by name, the others as they start."""
    function = effect.function
    assert function is not None
    values = [given.get(p.name, p.start) for p in effect.parameters]
    return lambda *at: function(*at, *values)


def _bound(coefficient: Mapping[str, Any], end: int) -> float:
    """An end of the interval of a coefficient; the value itself where there is none."""
    interval = coefficient.get("ci95")
    bound = interval[end] if interval else None
    return float(coefficient["value"] if bound is None else bound)
