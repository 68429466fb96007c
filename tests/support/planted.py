"""Runs of the ship with a cause that no candidate has, or one of the library, under open-loop commands."""

from collections.abc import Callable

import numpy as np

from diagnosis import Run, WeakWindows, clean, smooth, weak_windows
from diagnosis.predictors.ship_model import parameters
from fmus.hull import Triple
from fmus.signals import Force
from fmus.vessel import vessel
from support.ccode import stepped
from support.cse1 import THRUSTERS, VESSEL, Inputs
from support.measured import ACTING, MEASURED, NOISE, START, VELOCITY, commands
from support.shared import kept

APART = 700.0  # s by which the commands of one run are later than those of the one before
Push = Callable[[float, vessel.State], Triple]


def gusts(t: float, s: vessel.State) -> Triple:
    """A body-fixed force of 0.25 N RMS, with periods from 5 to 40 s and phases without any order."""
    w = 2.0 * np.pi / np.geomspace(5.0, 40.0, 12)
    phase = np.random.default_rng(5).uniform(0.0, 2.0 * np.pi, (2, w.size))
    x, y = 0.25 * np.sqrt(2.0 / w.size) * np.sin(w * t * 1.03 + phase).sum(axis=1)
    return float(x), float(y), 0.0


def bank(t: float, s: vessel.State) -> Triple:
    """A moment of up to 0.3 N m that depends on the place alone, with hills of 0.6 m."""
    return 0.0, 0.0, 0.3 * np.sin(2.0 * np.pi * s.x / 2.5) * np.cos(2.0 * np.pi * s.y / 2.5)


def dead_bow(t: float) -> bool:
    """Whether the bow thruster is dead: a fifth of the time, in bursts of 4 to 9 s."""
    return any(first < t % 60.0 < last for first, last in ((11.0, 15.0), (40.0, 48.0)))


def voyages(
    count: int = 3,
    seconds: float = 120.0,
    ship: dict[str, float] | None = None,
    thrusters: dict[str, float] | None = None,
    push: Push | None = None,
    dead: Callable[[float], bool] | None = None,
    noise: float = 1.0,
    h: float = 0.1,
) -> list[WeakWindows]:
    """Windows of some runs under different commands, made once in a session.

    Args:
        count, seconds: how many, and how long each.
        ship, thrusters: parameters of the plant.
        push: further force on the hull [N, N, N m], of time [s] and state.
        dead: whether the bow thruster is dead, of time [s].
        noise: times that of the other tests.
        h: from sample to sample [s].
    """
    given = (seconds, ship or {}, thrusters or {}, push, dead, noise, h)
    return [kept(_windows, k, *given) for k in range(count)]


def _windows(k: int, seconds, ship, thrusters, push, dead, noise, h) -> WeakWindows:
    t = np.arange(round(seconds / h)) * h
    tau_cmd = commands(t + APART * k)
    body = stepped(VESSEL, parameters(VESSEL, START | ship), Force())
    machines = [
        stepped(THRUSTERS, parameters(THRUSTERS, thrusters | x), Inputs())
        for x in ({}, {"loss_bow": 1.0})
    ]
    poses, before, seen = [], 0.0, body.advance([0.0, 0.0, 0.0], 0.0)
    for now, tau in zip(t.tolist(), tau_cmd.tolist(), strict=True):
        poses.append([seen[k] for k in MEASURED])
        given = [*tau, *(seen[k] for k in VELOCITY)]
        acting = [machine.advance(given, before)[ACTING] for machine in machines]
        force = acting[dead is not None and dead(now)]
        if push:
            force = np.add(force, push(now, body.state)).tolist()
        seen, before = body.advance(force, h), h
    rng = np.random.default_rng(k + 1)
    pose = np.array(poses) + noise * NOISE * rng.standard_normal((t.size, 3))
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    return weak_windows(smooth(clean(Run(f"run{k}", t, pose, tau_cmd))))
