"""The systems: what is measured of each, what is off, and which force is missing."""

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from .c_fmu import CSystem, Quantity, build_c_fmu


class ForeignSystem(NamedTuple):
    """An FMU under test.

    Attributes:
        name: of the file, without its ending.
        inputs: variable -> size of its random steps.
        output: variable that is measured.
        off: parameter that is off, to ``FACTOR`` times its value.
        parameters: all that are calibrated -> start value and relative standard deviation of the prior.
        force: input on which a force acts, or ``der(state)``, a rate that it changes.
        lacks: output that the missing force goes with, and its power, as y |y|^(power - 1); power 0:
            constant.
        size: coefficient of the force.
        step: from sample to sample [s].
        inputs_at_rest: values of the inputs about which they step.
        samples: of a run.
        stated: whether the map names ``force``: without it the missing force cannot be found.
        starts: state -> range of its random start value.
        start: the map's start values.
    """

    name: str
    inputs: dict[str, float]
    output: str
    off: str
    parameters: dict[str, tuple[float, float]]
    force: str
    lacks: tuple[str, int]
    size: float
    step: float = 0.05
    inputs_at_rest: float = 0.0
    samples: int = 600
    stated: bool = True
    starts: Mapping[str, tuple[float, float]] = MappingProxyType({})
    start: Mapping[str, str] = MappingProxyType({})

    def missing(self, y: float) -> float:
        """The missing force where ``lacks`` has the value y."""
        power = self.lacks[1]
        return self.size * (y * abs(y) ** (power - 1) if power else 1.0)

    def write_inputs(self, folder: Path) -> None:
        """Write ``map.json`` and ``parameters.json``."""
        content = {
            "inputs": {n: n for n in self.inputs},
            "outputs": {self.output: self.output},
            "start": dict(self.start),
            "disturbance_inputs": [self.force] if self.stated else [],
        }
        given = [
            {"name": n, "value": v, "log": v > 0.0, "prior": {"rel_std": share}}
            for n, (v, share) in self.parameters.items()
        ]
        (folder / "map.json").write_text(json.dumps(content))
        (folder / "parameters.json").write_text(json.dumps({"parameters": given}))


N, M, V = Quantity(0.0, "N"), Quantity(0.0, "m"), Quantity(0.0, "m/s")
NM, RAD, W = Quantity(0.0, "N.m"), Quantity(0.0, "rad"), Quantity(0.0, "rad/s")
# Written from FMI's standard and textbook equations.
OWN = {
    "oscillator": CSystem(
        {"f": N},
        {"x": M, "v": V},
        {"m": Quantity(2.0, "kg"), "c": Quantity(10.0, "N/m"), "d": Quantity(1.0, "N.s/m")},
        "der_x = v; der_v = (f - c * x - d * v) / m;",
    ),
    "pendulum": CSystem(
        {"f": NM},
        {"th": RAD, "w": W},
        {"l": Quantity(0.8, "m"), "d": Quantity(0.15, "N.m.s")},
        "der_th = w; der_w = (f - 9.81 * l * sin(th) - d * w) / (l * l);",
    ),
    "motor": CSystem(
        {"u": Quantity(0.0, "V"), "load": NM},
        {"i": Quantity(0.0, "A"), "w": W},
        {"R": Quantity(1.0, "Ohm"), "k": Quantity(0.5, "N.m/A"), "J": Quantity(0.4, "kg.m2")},
        "der_i = (u - R * i - k * w) / 0.2; der_w = (k * i - 0.1 * w + load) / J;",
    ),
    "heater": CSystem(
        {"P": Quantity(0.0, "W")},
        {"T": Quantity(0.0, "K")},
        {"C": Quantity(50.0, "J/K"), "G": Quantity(5.0, "W/K")},
        "der_T = (P - G * T) / C;",
    ),
    "two_masses": CSystem(
        {"f": N},
        {"x": M, "y": M, "v": V, "w": V},
        {"c": Quantity(8.0, "N/m"), "k": Quantity(3.0, "N/m"), "d": Quantity(0.8, "N.s/m")},
        "der_x = v; der_y = w; der_v = f - c * x - k * (x - y) - d * v; "
        "der_w = (k * (x - y) - 2.0 * y - d * w) / 1.5;",
    ),
    "duffing": CSystem(
        {"f": N},
        {"x": M, "v": V},
        {"c": Quantity(4.0, "N/m"), "c3": Quantity(20.0, "N/m3"), "d": Quantity(0.6, "N.s/m")},
        "der_x = v; der_v = f - c * x - c3 * x * x * x - d * v;",
    ),
    "surge": CSystem(
        {"f": N},
        {"u": V},
        {"m": Quantity(15.0, "kg"), "d1": Quantity(2.0, "N.s/m"), "d2": Quantity(6.0, "N.s2/m")},
        "der_u = (f - d1 * u - d2 * fabs(u) * u) / m;",
    ),
    "crane": CSystem(
        {"f": N},
        {"x": M, "th": RAD, "v": V, "w": W},
        {"M": Quantity(4.0, "kg"), "l": Quantity(1.2, "m"), "d": Quantity(3.0, "N.s/m")},
        "double s = sin(th), q = cos(th), F = f - d * v; "
        "der_x = v; der_th = w; der_v = (F + s * (l * w * w + 9.81 * q)) / (M + s * s); "
        "der_w = -(der_v * q + 9.81 * s + 0.1 * w) / l;",
    ),
}
CASES = (
    ForeignSystem("oscillator", {"f": 3.0}, "x", "c",
                  {"m": (2.0, 0.1), "c": (10.0, 0.3), "d": (1.0, 0.5)},
                  "f", ("v", 2), -3.0),
    ForeignSystem("pendulum", {"f": 3.0}, "th", "l",
                  {"l": (0.8, 0.2), "d": (0.15, 0.5)},
                  "f", ("w", 2), -0.3),
    ForeignSystem("motor", {"u": 6.0}, "w", "R",
                  {"R": (1.0, 0.3), "k": (0.5, 0.3), "J": (0.4, 0.3)},
                  "load", ("w", 2), -0.05),
    ForeignSystem("heater", {"P": 60.0}, "T", "G",
                  {"C": (50.0, 0.3), "G": (5.0, 0.3)},
                  "P", ("T", 2), -0.4, 1.0, 60.0),
    ForeignSystem("two_masses", {"f": 4.0}, "x", "k",
                  {"c": (8.0, 0.3), "k": (3.0, 0.3), "d": (0.8, 0.5)},
                  "f", ("v", 2), -2.0),
    ForeignSystem("duffing", {"f": 3.0}, "x", "c3",
                  {"c": (4.0, 0.3), "c3": (20.0, 0.3), "d": (0.6, 0.5)},
                  "f", ("v", 2), -2.0),
    ForeignSystem("surge", {"f": 4.0}, "u", "d1",
                  {"m": (15.0, 0.1), "d1": (2.0, 0.5), "d2": (6.0, 0.5)},
                  "f", ("", 0), 0.5, 0.2),
    ForeignSystem("crane", {"f": 4.0}, "x", "d",
                  {"M": (4.0, 0.1), "l": (1.2, 0.1), "d": (3.0, 0.5)},
                  "f", ("v", 2), -3.0),
)  # fmt: skip


def built(system: ForeignSystem, folder: Path) -> Path:
    """Path of the FMU of one of the systems that are written here."""
    return build_c_fmu(folder, system.name, OWN[system.name])
