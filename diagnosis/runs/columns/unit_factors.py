"""Factor to SI of every unit that a quantity may be in."""

import math

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": 0.3048, "in": 0.0254},
    "angle": {"rad": 1.0, "deg": 0.017453292519943295, "°": 0.017453292519943295},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "moment": {"N.m": 1.0, "N.mm": 1e-3, "N.cm": 1e-2, "kN.m": 1e3},
    "command": {"1": 1.0, "%": 1e-2},
    "shaft speed": {"1/s": 1.0, "rpm": 1.0 / 60.0, "rad/s": 0.5 / math.pi},
    "speed": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0},
    "rate": {"rad/s": 1.0}
    | dict.fromkeys(("deg/s", "°/s"), math.pi / 180.0)
    | {"deg/min": math.pi / 10800.0},
    "acceleration": {"m/s2": 1.0, "mm/s2": 1e-3, "g": 9.80665},
    "angular acceleration": {"rad/s2": 1.0, "deg/s2": 0.017453292519943295},
}
