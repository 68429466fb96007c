"""Effects that are a shape, such as a thruster's force over its command: the shape itself."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fmus.actuators.response import CommandLayout
from fmus.effects import Effect, Motion
from fmus.effects.devices import with_one
from fmus.effects.effect import Picture
from fmus.hull import damping_force

from ...predictors import Model
from ...predictors.evaluation import Evaluation
from ...predictors.thrust import commanded_shares
from ...runs.run_constants import CHANCE
from ..reported_effect import ReportedCoefficient, ReportedEffect
from .chart import WIDTH


@dataclass(frozen=True, eq=False)
class Curve:
    """A shape that was learned.

    Attributes:
        id: of the effect.
        over, what: labels of the axes, with units.
        x, nominal, learned: (n,).
        sure: lower and upper bound (n,) of the learned one, 95 %; None if not known.
        covered: range of x that the data cover.
    """

    id: str
    over: str
    what: str
    x: np.ndarray
    nominal: np.ndarray
    learned: np.ndarray
    sure: tuple[np.ndarray, np.ndarray] | None
    covered: tuple[float, float]


class Sweep(NamedTuple):
    """How a shape is drawn: labels, its values over x, where a run's data lie, and ends of the axis.

    Where the ends are None, they are those of the data.
    """

    over: str
    what: str
    force: Callable[[np.ndarray, Model], Any]
    data: Callable[[Evaluation], np.ndarray]
    reach: tuple[float, float] | None = None


def surge_speed(e: Evaluation) -> np.ndarray:
    u = e.smoothed.nu[:, 0]
    return u[np.isfinite(u)]


def given(p: Picture, m: Model, command: Any, u: Any = 0.0) -> Any:
    """The force [N] of the actuator that a picture shows, by its command and the surge speed [m/s]."""
    layout, drive = _apart(m), m.drive
    commands = with_one((0.0 * command,) * len(layout.commands), p.commands[0], command)
    f = layout.thrust(commands, layout.running(0.0, u, 0.0, 0.0, commands, drive), drive)
    return (f.X if p.axis == "X" else f.Y)[p.members[0]]


def _apart(m: Model) -> CommandLayout:
    """The layout in which each actuator has commands of its own."""
    return m.ship.layouts[-1]


def _limits(p: Picture, m: Model) -> tuple[float, float]:
    """Of the command of the actuator that a picture shows."""
    return _apart(m).limits(m.drive.params)[p.commands[0]]


def _commands(p: Picture, m: Model, e: Evaluation) -> np.ndarray:
    """The commands in a run of the actuators that a picture shows."""
    run = e.weak_windows.run
    shared = m.ship.layout_of(run.commands).shared
    given = sorted({shared[k] if shared else k for k in p.commands})
    return np.concatenate(commanded_shares(run, m).T[given])


def _over_command(p: Picture, e: Effect, m: Model) -> Sweep:
    way = {"X": "surge", "Y": "sway"}[p.axis]
    over, what = f"{p.whose}: command in {way}", f"{p.whose}: {way} force [N]"
    return Sweep(over, what, lambda c, m: given(p, m, c), lambda e: _commands(p, m, e), _limits(p, m))


def _force_given(p: Picture, e: Effect, m: Model) -> Sweep:
    # The nominal force over the command is inverted by interpolation.
    c = np.linspace(*_limits(p, m), int(WIDTH))
    nominal = np.broadcast_to(given(p, m, c), c.shape)
    order = np.argsort(nominal, kind="stable")

    def force(f: np.ndarray, learned: Model) -> np.ndarray:
        return given(p, learned, np.interp(f, nominal[order], c[order]))

    over, what = f"{p.whose}: force commanded [N]", f"{p.whose}: force given [N]"
    reach = float(nominal.min()), float(nominal[-1])
    return Sweep(over, what, force, lambda e: given(p, m, _commands(p, m, e)), reach)


def _effectiveness(p: Picture, e: Effect, m: Model) -> Sweep:
    _, most = _limits(p, m)

    def share(u: np.ndarray, learned: Model) -> np.ndarray:
        nominal = np.broadcast_to(given(p, m, most, u), u.shape)
        left = np.broadcast_to(given(p, learned, most, u), u.shape)
        return np.divide(left, nominal, out=np.ones_like(u), where=nominal != 0.0)

    over, what = "surge speed |u| [m/s]", f"{p.whose}: effectiveness [1]"
    return Sweep(over, what, share, lambda e: np.abs(surge_speed(e)))


def _damping(p: Picture, e: Effect, m: Model) -> Sweep:
    def force(u: np.ndarray, learned: Model) -> np.ndarray:
        nominal = damping_force(u, 0.0, 0.0, m.hull.params.damping)[0]
        return nominal + e(Motion(u=u), *[learned.value(v.name) for v in e.parameters])[0]

    return Sweep("surge speed u [m/s]", "damping in surge [N]", force, surge_speed)


SWEEPS: dict[str, Callable[[Picture, Effect, Model], Sweep]] = {
    "damping over speed": _damping,
    "force over command": _over_command,
    "force given": _force_given,
    "effectiveness over speed": _effectiveness,
}


def curves(effects: Sequence[ReportedEffect], evaluations: Sequence[Evaluation]) -> Iterator[Curve]:
    """The shapes among the effects of a diagnosis.

    Args:
        effects: of the diagnosis.
        evaluations: the runs, for where their data lie.
    """
    model = evaluations[0].model
    for found in effects:
        effect = model.ship.effects[found.id]
        for picture in effect.wording.pictures:
            sweep = SWEEPS[picture.what](picture, effect, model)
            made = _curve(found, effect, sweep, evaluations, model)
            if not np.allclose(made.learned, made.nominal):
                yield made


def _curve(
    found: ReportedEffect, effect: Effect, s: Sweep, evaluations: Sequence[Evaluation], model: Model
) -> Curve:
    of_effect = {v.name for v in effect.parameters}
    data = np.concatenate([s.data(e) for e in evaluations])
    x = np.linspace(*(s.reach or (data.min(), data.max())), int(WIDTH))

    def by(value: Callable[[ReportedCoefficient], float]) -> np.ndarray:
        wanted = {name: value(c) for name, c in found.coefficients.items() if name in of_effect}
        learned = model.plus({name: v - model.value(name) for name, v in wanted.items()})
        return np.broadcast_to(s.force(x, learned), x.shape)

    sure = None
    if effect.linear:  # in weights that are never negative
        sure = by(lambda c: (c.ci95 or (c.value,))[0]), by(lambda c: (c.ci95 or (c.value,))[-1])
    low, high = np.quantile(data, [CHANCE, 1.0 - CHANCE])
    nominal, learned = by(lambda _: 0.0), by(lambda c: c.value)
    return Curve(effect.id, s.over, s.what, x, nominal, learned, sure, (float(low), float(high)))
