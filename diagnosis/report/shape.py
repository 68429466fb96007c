"""Effects that are a shape, such as a thruster's force over its command: the shape itself."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from fmus.effects import Effect, Motion, Running, Thrust
from fmus.effects.effect import Picture
from fmus.effects.single_propellers import ASIDE, PICTURES
from fmus.hull import damping_force

from ..assessment.evaluation import Evaluation
from ..model import Model
from ..model.thrust import commanded_shares

COMMON = (0.01, 0.99)  # quantiles between which the data are said to lie
POINTS = 401
Force = Callable[[np.ndarray, Callable[..., Any], Model], np.ndarray]


@dataclass(frozen=True, eq=False)
class Curve:
    """A shape that was learned.

    Attributes:
        id: of the effect.
        over, what: labels of the axes, with units.
        x, nominal, learned: (n,).
        sure: lower and upper bound (n,) of the learned one, 95 %; None if not known.
        covered: range of x that the data cover; None if not known.
        points: name -> x and y of measurements that nothing was learned from.
    """

    id: str
    over: str
    what: str
    x: np.ndarray
    nominal: np.ndarray
    learned: np.ndarray
    sure: tuple[np.ndarray, np.ndarray] | None = None
    covered: tuple[float, float] | None = None
    points: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


class Sweep(NamedTuple):
    """How a shape is drawn.

    Attributes:
        over, what: labels of the axes, with units.
        reach: ends of the horizontal axis, by the model.
        force: the shape over x (n,), with an effect, of a model.
        data: where the data of a run lie on the horizontal axis.
    """

    over: str
    what: str
    reach: Callable[[Model], tuple[float, float]]
    force: Force
    data: Callable[[Evaluation, Model], np.ndarray]


def surge_speed(e: Evaluation, _: Model) -> np.ndarray:
    u = e.smoothed.nu[:, 0]
    return u[np.isfinite(u)]


def command(k: int, sets: slice = slice(None)) -> Callable[[Evaluation, Model], np.ndarray]:
    """The k-th command of sets of thrusters, by default of all; the bow thruster is of the first."""
    sets = sets if k < 2 else slice(1)
    return lambda e, m: commanded_shares(e.integrals.run, m)[:, sets, k].T.ravel()


def force_commanded(name: str, k: int) -> Callable[[Evaluation, Model], np.ndarray]:
    return lambda e, m: m.value(name) * command(k)(e, m)


def hull(u: np.ndarray, effect: Callable[..., Any], m: Model) -> np.ndarray:
    nominal = damping_force(u, 0.0, 0.0, m.hull.params.damping)[0]
    return nominal + effect(Motion(u=u))[0]


def vsp_surge(c: np.ndarray, effect: Callable[..., Any], m: Model) -> np.ndarray:
    return effect(Thrust(vsp_x=m.value("plant_F_vsp") * c), Running(u_vsp_x=c)).vsp_x


def vsp_sway(c: np.ndarray, effect: Callable[..., Any], m: Model) -> np.ndarray:
    return effect(Thrust(vsp_y=m.value("plant_F_vsp") * c), Running(u_vsp_y=c)).vsp_y


def one_vsp(k: int, way: str) -> Force:
    """The force of VSP k + 1 over its command, in the direction ``x`` or ``y``."""
    law = {"x": vsp_surge, "y": vsp_sway}[way]

    def force(c: np.ndarray, effect: Callable[..., Any], m: Model) -> np.ndarray:
        return law(c, lambda f, now: effect(f, now._replace(aside=ASIDE[k])), m)

    return force


def vsp_given(f: np.ndarray, effect: Callable[..., Any], m: Model) -> np.ndarray:
    return effect(Thrust(vsp_x=f), Running()).vsp_x


def bow_given(f: np.ndarray, effect: Callable[..., Any], m: Model) -> np.ndarray:
    return effect(Thrust(bow=f), Running()).bow


def bow_effectiveness(u: np.ndarray, effect: Callable[..., Any], m: Model) -> np.ndarray:
    return effect(Thrust(bow=1.0 + 0.0 * u), Running(u=u)).bow


def full(name: str) -> Callable[[Model], tuple[float, float]]:
    """From full force astern or to port to full force ahead or to starboard [N]."""
    return lambda m: (-m.value(name), m.value(name))


# m/s, times the scale of the ship; beyond the 0.4 m/s that CyberShip Enterprise 1 reaches.
FASTEST = 0.6
SWEEPS: dict[Picture, Sweep] = {
    "hull surge force over surge speed": Sweep(
        "surge speed u [m/s]",
        "damping in surge [N]",
        lambda m: (-FASTEST * m.ship.scale.speed, FASTEST * m.ship.scale.speed),
        hull,
        surge_speed,
    ),
    "VSP surge force over command": Sweep(
        "VSP command in surge [1]",
        "VSP surge force [N]",
        lambda _: (-1.0, 1.0),
        vsp_surge,
        command(0),
    ),
    "VSP sway force over command": Sweep(
        "VSP command in sway [1]",
        "VSP sway force [N]",
        lambda _: (-1.0, 1.0),
        vsp_sway,
        command(1),
    ),
    **{
        picture: Sweep(
            f"VSP {k + 1} command in {(way := {'x': 'surge', 'y': 'sway'}[axis])} [1]",
            f"VSP {k + 1} {way} force [N]",
            lambda _: (-1.0, 1.0),
            one_vsp(k, axis),
            command("xy".index(axis), slice(k, k + 1)),
        )
        for (k, axis), picture in PICTURES.items()
    },
    "bow effectiveness over surge speed": Sweep(
        "surge speed |u| [m/s]",
        "bow effectiveness [1]",
        lambda m: (0.0, FASTEST * m.ship.scale.speed),
        bow_effectiveness,
        lambda e, m: np.abs(surge_speed(e, m)),
    ),
    "VSP force given over commanded": Sweep(
        "VSP force commanded [N]",
        "VSP force given [N]",
        full("plant_F_vsp"),
        vsp_given,
        force_commanded("plant_F_vsp", 0),
    ),
    "bow force given over commanded": Sweep(
        "bow force commanded [N]",
        "bow force given [N]",
        full("plant_F_bow"),
        bow_given,
        force_commanded("plant_F_bow", 2),
    ),
}


def curves(
    effects: Sequence[Mapping[str, Any]],
    evaluations: Sequence[Evaluation],
) -> list[Curve]:
    """The shapes among the effects of a diagnosis.

    Args:
        effects: as in ``diagnosis.json``.
        evaluations: the runs, for where their data lie.
    """
    model = evaluations[0].model
    declared = model.ship.effects
    drawn = [
        _curve(e, declared[e["id"]], SWEEPS[picture], evaluations, model)
        for e in effects
        for picture in declared[e["id"]].wording.pictures
    ]
    return [c for c in drawn if not np.allclose(c.learned, c.nominal)]


def _curve(
    found: Mapping[str, Any],
    effect: Effect,
    sweep: Sweep,
    evaluations: Sequence[Evaluation],
    model: Model,
) -> Curve:
    coefficients = found["coefficients"]
    covered = np.concatenate([sweep.data(e, model) for e in evaluations])
    x = np.linspace(*sweep.reach(model), POINTS)

    def by(value: Callable[[Mapping[str, Any]], float]) -> np.ndarray:
        given = {name: value(c) for name, c in coefficients.items()}
        return np.broadcast_to(sweep.force(x, _with(effect, given), model), x.shape)

    sure = None
    if effect.linear:  # in weights that are never negative
        sure = by(lambda c: _bound(c, 0)), by(lambda c: _bound(c, 1))
    nominal, learned = by(lambda _: 0.0), by(lambda c: c["value"])
    low, high = np.quantile(covered, COMMON)
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
