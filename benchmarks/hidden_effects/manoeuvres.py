"""Manoeuvres, drawn by a seed: ellipse, figure of eight and multisine, speeds up to 0.16 m/s."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fmus.declare import packer, variables
from fmus.guidance import eight, ellipse, multisine

PATHS = {"ellipse": ellipse.COMPONENT, "eight": eight.COMPONENT, "rich": multisine.COMPONENT}
GUIDANCE = [path.name for path in PATHS.values()]


@dataclass(frozen=True)
class Manoeuvre:
    """A kind of path, and the parameters of its guidance FMU."""

    kind: str
    parameters: Mapping[str, float]

    @property
    def fmu(self) -> str:
        return PATHS[self.kind].name

    @cached_property
    def start(self) -> dict[str, float]:
        """Parameters that let the vessel start on the path."""
        path = PATHS[self.kind]
        p = packer(path.params)([self.parameters.get(v.name, v.start) for v in variables(path.params)])
        _, target = path.step(path.init(path.inputs(), p), path.inputs(), p, 0.0)
        return {"x_0": float(target.x_t), "y_0": float(target.y_t), "psi_0": float(target.psi_t)}


def manoeuvres(seed: int) -> list[Manoeuvre]:
    """Three manoeuvres to learn from, one of each kind, and one that is held out, of any kind."""
    rng = np.random.default_rng([seed, 1])
    kinds = [*DRAW, list(DRAW)[seed % len(DRAW)]]
    return [Manoeuvre(kind, DRAW[kind](rng)) for kind in kinds]


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _ellipse(rng: np.random.Generator) -> dict[str, float]:
    return {
        "u_t": float(rng.uniform(0.11, 0.15)) * _sign(rng),
        "theta_0": float(rng.uniform(0.0, 2.0 * np.pi)),
        "pulse": 0.8,
        "pulse_period": float(rng.uniform(13.0, 17.0)),
        "pulse_rise": 3.0,
    }


def _eight(rng: np.random.Generator) -> dict[str, float]:
    return {
        "u_t": float(rng.uniform(0.5, 0.65)) * _sign(rng),
        "a_x": 1.5,
        "a_y": 1.2,
        "theta_0": float(rng.uniform(0.0, 2.0 * np.pi)),
        "pulse": 0.6,
        "pulse_period": float(rng.uniform(16.0, 22.0)),
        "pulse_rise": 3.0,
    }


SWINGS = {
    "slow_x": 1.3,
    "slow_y": 1.3,
    "slow_psi": 1.6,
    "quick_x": 0.3,
    "quick_y": 0.3,
    "quick_psi": 0.5,
}


def _rich(rng: np.random.Generator) -> dict[str, float]:
    swings = {name: size * float(rng.uniform(0.7, 1.1)) * _sign(rng) for name, size in SWINGS.items()}
    turn, rate = float(rng.uniform(0.0, 2.0 * np.pi)), float(rng.uniform(0.9, 1.1))
    return swings | {"psi_0": turn, "rate": rate}


DRAW = {"ellipse": _ellipse, "eight": _eight, "rich": _rich}
