"""Wind, waves and current: what acts on the ship from outside."""

import math
from typing import Annotated

from ..declare import POSITIVE, Range
from ..frames import rotate_to_body
from ..hull import Triple
from ..ops import Number, cos, sin
from .effect import Motion, Search, Wording, effect
from .families import BODY_FIXED, EARTH_FIXED
from .text import Found, compass, number, towards

# Frequencies of the waves as shares of the peak; no two have a common period within an hour.
_SHARES = tuple(0.72 + 0.0717 * k + 0.00113 * k * k for k in range(8))
_GOLDEN = 2.0 * math.pi * (math.sqrt(5.0) - 1.0) / 2.0


@effect(
    "earth_force",
    "environment",
    "XY",
    formula="(X, Y) = R^T(psi) (F_n, F_e) (1 + swing sin(2 pi t / period))",
    sign="F_n acts north, F_e acts east",
    source="(2.3), (2.33)",
    settings=("earth_force_period", "earth_force_swing"),
    search=Search(of_each_run=True),
    wording=Wording(
        lambda f: (
            f"A constant force of {number(math.hypot(f['F_n'], f['F_e']))} N acts towards "
            f"{compass(f['F_n'], f['F_e'])}, as by wind."
        ),
        EARTH_FIXED,
        {"body_bias": "run a full circle of headings"},
    ),
)
def earth_force(
    ship: Motion,
    F_n: Annotated[float, "N", "earth-fixed force to the north"] = 0.0,
    F_e: Annotated[float, "N", "earth-fixed force to the east"] = 0.0,
    earth_force_period: Annotated[float, "s", "period of its slow oscillation", Range(min=1.0)] = 100.0,
    earth_force_swing: Annotated[
        float, "1", "amplitude of its oscillation, relative to the force"
    ] = 0.0,
) -> Triple:
    """Constant or slowly varying earth-fixed force."""
    swing = 1.0 + earth_force_swing * sin(2.0 * math.pi * ship.t / earth_force_period)
    return *rotate_to_body(ship.psi, swing * F_n, swing * F_e), 0.0


def bias_sentence(f: Found) -> str:
    units = {"X": "N", "Y": "N", "N": "N m"}
    parts = [towards(f[f"body_bias_{a}"], unit, a) for a, unit in units.items() if f[f"body_bias_{a}"]]
    return f"A constant force in the body frame: {', '.join(parts)}."


@effect(
    "body_bias",
    "environment",
    "XYN",
    formula="(X, Y, N) = constant",
    symbol="X, Y, N",
    sign="positive acts ahead, to starboard, and turns to starboard",
    source="(2.33)",
    search=Search(of_each_run=True),
    wording=Wording(bias_sentence, BODY_FIXED),
)
def body_bias(
    ship: Motion,
    body_bias_X: Annotated[float, "N", "constant surge force"] = 0.0,
    body_bias_Y: Annotated[float, "N", "constant sway force"] = 0.0,
    body_bias_N: Annotated[float, "N.m", "constant yaw moment"] = 0.0,
) -> Triple:
    """Constant body-fixed force."""
    return body_bias_X, body_bias_Y, body_bias_N


def surface(t: Number, peak: Number) -> Number:
    """A wave signal of unit variance around a peak frequency [rad/s] at time t [s].

    Eight cosines with fixed phases: a narrow spectrum as of waves from afar, the same in every run.
    """
    total = 0.0
    power = 0.0
    for k, share in enumerate(_SHARES):
        amplitude = math.exp(-0.5 * ((share - 1.0) / 0.12) ** 2)
        power += 0.5 * amplitude * amplitude
        total = total + amplitude * cos(share * peak * t + _GOLDEN * (k + 1) * (k + 2))
    return total / math.sqrt(power)


def waves_sentence(f: Found) -> str:
    peak = f["wave_peak"]
    often = f", with a peak at {number(peak)} rad/s" if peak else ""
    return (
        f"An oscillating force excites the ship{often}, as by waves, a load that swings or an actuator "
        "that oscillates, or its position is measured on a mast that rolls."
    )


@effect(
    "waves",
    "environment",
    "XYN",
    formula="(X, Y) = R^T(psi) (cos b, sin b) (F_w xi(t) + drift), N = arm · Y",
    symbol="F_w, drift",
    sign="drift acts in the direction of wave propagation",
    source="(2.33), (7.15); Fossen 2011, 8.2",
    settings=("wave_direction",),
    search=Search(by="spectrum"),
    wording=Wording(waves_sentence, EARTH_FIXED),
)
def waves(
    ship: Motion,
    wave_force: Annotated[float, "N", "standard deviation of the wave force", POSITIVE] = 0.0,
    wave_drift: Annotated[float, "N", "mean drift force of the waves"] = 0.0,
    wave_peak: Annotated[float, "rad/s", "peak frequency of the waves", Range(0.1, 50.0)] = 4.0,
    wave_direction: Annotated[float, "rad", "direction of wave propagation, from north"] = 0.0,
    wave_arm: Annotated[float, "m", "forward lever of their sway force"] = 0.1,
) -> Triple:
    """Wave-frequency force with a mean drift."""
    F = wave_force * surface(ship.t, wave_peak) + wave_drift
    X, Y = rotate_to_body(ship.psi, F * cos(wave_direction), F * sin(wave_direction))
    return X, Y, wave_arm * Y


@effect(
    "current",
    "environment",
    "XYN",
    formula="nu_r = nu - R^T(psi) (V_n, V_e); all hydrodynamic force follows nu_r",
    sign="direction that the water moves towards",
    source="Fossen 2011, 8.3; irrotational",
    linear=False,
    gives="water velocity",
    search=Search(differentiable=True, of_each_run=True),
    wording=Wording(
        lambda f: (
            f"The water moves at {number(math.hypot(f['V_n'], f['V_e']))} m/s "
            f"towards {compass(f['V_n'], f['V_e'])}."
        ),
        EARTH_FIXED,
        {"earth_force": "turn, and stop, on several headings"},
    ),
)
def current(
    ship: Motion,
    V_n: Annotated[float, "m/s", "the water's velocity to the north", Range(-2.0, 2.0)] = 0.0,
    V_e: Annotated[float, "m/s", "the water's velocity to the east", Range(-2.0, 2.0)] = 0.0,
) -> tuple[Number, Number]:
    """Irrotational current; gives the water's body-fixed velocity [m/s, m/s]."""
    return rotate_to_body(ship.psi, V_n, V_e)
