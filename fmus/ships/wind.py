"""The wind on what a ship has above the water: by drag coefficients, or by Fujiwara's regression.

Which of the two a ship has follows from its description: with a superstructure it is the regression. The
wind is one that nobody measured, constant and an effect that a diagnosis looks for, or one that was
measured over time, an input of the vessel; both add up.
"""

from collections.abc import Iterable
from dataclasses import replace
from math import hypot
from typing import Annotated, NamedTuple

from ..declare import POSITIVE, Known, Variable, parameters_of, variables
from ..effects.effect import Effect, Motion, Search, Wording, effect
from ..effects.families import EARTH_FIXED
from ..effects.text import Found, compass, number
from ..frames import rotate_to_body
from ..hull import Triple
from ..ops import Number, atan2, cos, sin, sqrt
from ..ship_description import Description

VELOCITY = ("W_n", "W_e")  # of the wind over the water, parameters of the effect
# How well the regression's force is known in a measured wind. Chosen: by the profile z^(1/7) the square
# of the wind is 0.7 to 0.8 of that at an anemometer two to three times as high, and the regression adds
# a tenth or two.
REGRESSED = Known("wind", "Fujiwara's regression, anemometer at another place than the sides", 0.3)
# Wind of 10 m height drives the surface at 3 % of its speed (Wu, J. Fluid Mech. 68, 1975). The mean over
# a draft is less, and an anemometer aboard is lower. Chosen: zero within 2 %.
DRIFT = Known("wind", "3 % of the wind at the surface, less in the depth; none is described", 0.0, 0.02)


def wind_force(
    ship: Motion,
    W_n: Annotated[float, "m/s", "velocity of the wind over the water, to the north"] = 0.0,
    W_e: Annotated[float, "m/s", "velocity of the wind over the water, to the east"] = 0.0,
    frontal_area: Annotated[float, "m2", "area above the water from ahead", POSITIVE] = 1.0,
    lateral_area: Annotated[float, "m2", "area above the water from the side", POSITIVE] = 1.0,
    lateral_centre: Annotated[float, "m", "forward place of the lateral area's centre"] = 0.0,
    frontal_drag: Annotated[float, "1", "drag coefficient from ahead", POSITIVE] = 0.7,
    lateral_drag: Annotated[float, "1", "drag coefficient from the side", POSITIVE] = 0.9,
    air_density: Annotated[float, "kg/m3", "density of the air", POSITIVE] = 1.25,
) -> Triple:
    """Wind on the areas above the water, beside the resistance of the ship in still air.

    By the relative wind (Fossen 2021, ch. 10): 1/2 rho C A V_rw u_rw, and so across. The ship's
    velocity is that through the water, so that the wind is that over the water, not over ground.
    """

    def drag(u: Number, v: Number) -> tuple[Number, Number]:
        pressure = 0.5 * air_density * sqrt(u * u + v * v)
        return (
            pressure * frontal_drag * frontal_area * u,
            pressure * lateral_drag * lateral_area * v,
        )

    u, v = rotate_to_body(ship.psi, W_n, W_e)
    (X, Y), (still_X, still_Y) = drag(u - ship.u, v - ship.v), drag(-ship.u, -ship.v)
    Y = Y - still_Y
    return X - still_X, Y, lateral_centre * Y


def wind_by_regression(
    ship: Motion,
    W_n: Annotated[float, "m/s", "velocity of the wind over the water, to the north"] = 0.0,
    W_e: Annotated[float, "m/s", "velocity of the wind over the water, to the east"] = 0.0,
    frontal_area: Annotated[float, "m2", "area above the water from ahead", POSITIVE] = 1.0,
    lateral_area: Annotated[float, "m2", "area above the water from the side", POSITIVE] = 1.0,
    wind_length: Annotated[float, "m", "length L of the ship, of the wind's moment", POSITIVE] = 1.0,
    air_density: Annotated[float, "kg/m3", "density of the air", POSITIVE] = 1.25,
    wind_X_0: Annotated[float, "1", "wind force ahead, constant part"] = 0.0,
    wind_X_1: Annotated[float, "1", "wind force ahead, by the cosine of the wind's angle"] = 0.0,
    wind_X_3: Annotated[float, "1", "wind force ahead, by that of three times the angle"] = 0.0,
    wind_X_5: Annotated[float, "1", "wind force ahead, by that of five times the angle"] = 0.0,
    wind_Y_1: Annotated[float, "1", "wind force to starboard, by the sine of the wind's angle"] = 0.0,
    wind_Y_3: Annotated[float, "1", "wind force to starboard, by that of three times the angle"] = 0.0,
    wind_Y_5: Annotated[float, "1", "wind force to starboard, by that of five times the angle"] = 0.0,
    wind_N_1: Annotated[float, "1", "wind moment, by the sine of the wind's angle"] = 0.0,
    wind_N_2: Annotated[float, "1", "wind moment, by that of twice the angle"] = 0.0,
    wind_N_3: Annotated[float, "1", "wind moment, by that of three times the angle"] = 0.0,
) -> Triple:
    """Relative wind on a ship by Fujiwara's regression, its resistance in still air included.

    With q = 1/2 rho V_rw^2 and the angle gamma from ahead to port from which it blows, X = q A_F (X_0 +
    X_1 cos gamma + X_3 cos 3 gamma + X_5 cos 5 gamma), Y = q A_L (Y_1 sin gamma + ...), N = q A_L L
    (N_1 sin gamma + ...) about midship.
    """
    u, v = rotate_to_body(ship.psi, W_n, W_e)
    u, v = u - ship.u, v - ship.v
    angle = atan2(v, -u)
    q = 0.5 * air_density * (u * u + v * v)
    X = wind_X_0 + wind_X_1 * cos(angle) + wind_X_3 * cos(3.0 * angle) + wind_X_5 * cos(5.0 * angle)
    third = sin(3.0 * angle)
    Y = wind_Y_1 * sin(angle) + wind_Y_3 * third + wind_Y_5 * sin(5.0 * angle)
    N = wind_N_1 * sin(angle) + wind_N_2 * sin(2.0 * angle) + wind_N_3 * third
    return q * frontal_area * X, q * lateral_area * Y, q * lateral_area * wind_length * N


class Superstructure(NamedTuple):
    """What the regression needs to know of a ship; its centres are forward of midship."""

    frontal_area: Annotated[float, "m2", "area above the water from ahead, A_F", POSITIVE] = 1.0
    lateral_area: Annotated[float, "m2", "area above the water from the side, A_L", POSITIVE] = 1.0
    lateral_centre: Annotated[float, "m", "forward place of the lateral area's centre, C"] = 0.0
    lateral_height: Annotated[float, "m", "height of the lateral area's centre, H_C", POSITIVE] = 1.0
    superstructure_area: Annotated[float, "m2", "lateral area of the deck equipment, A_OD", POSITIVE] = (
        1.0
    )
    superstructure_centre: Annotated[float, "m", "forward place of its centre, C_BR"] = 0.0
    superstructure_height: Annotated[float, "m", "height of its top, H_BR", POSITIVE] = 1.0
    air_density: Annotated[float, "kg/m3", "density of the air", POSITIVE] = 1.25


def regression(L: float, B: float, s: Superstructure) -> dict[str, float]:
    """Coefficients of :func:`wind_by_regression` (Fujiwara, Ueno and Nimura, J. SNAJ 183, 1998).

    Args:
        L, B: length and breadth [m].
        s: what is above the water.
    """
    A_F, A_L, C, H_C, A_OD, C_BR, H_BR, _ = s
    plan, front = L * B, A_F / (B * H_BR)
    return {
        "wind_X_0": -0.330 + 0.293 / front + 0.0193 * C / H_C + 0.6820 * A_OD / L**2,
        "wind_X_1": -1.353
        + 1.700 * A_L / plan
        + 2.87 * L * H_C / A_L
        - 0.463 * L * H_BR / A_L
        - 0.570 * A_OD / A_L
        - 6.640 * A_F / plan
        - 0.0123 * L**2 / A_F
        + 0.0202 * L / H_C,
        "wind_X_3": 0.830
        - 0.413 * A_L / (L * H_BR)
        - 0.0827 * A_L / A_F
        - 0.563 * L * H_C / A_L
        + 0.804 * A_OD / A_L
        - 5.670 * A_OD / L**2
        + 0.0401 * C / H_C
        - 0.132 * C_BR / L,
        "wind_X_5": 0.0372 - 0.0075 * A_L / A_OD - 0.103 * C_BR / L + 0.0921 * A_L / plan,
        "wind_Y_1": 0.684
        + 0.717 * C_BR / L
        - 3.22 * C / L
        + 0.0281 * A_L / A_OD
        + 0.0661 * C / H_C
        + 0.298 * front,
        "wind_Y_3": -0.400
        + 0.282 * A_L / plan
        + 0.307 * L * H_C / A_L
        + 0.0519 * C_BR / L
        + 0.0526 * B / H_BR
        - 0.0814 * A_OD / A_L
        + 0.0582 * front,
        "wind_Y_5": 0.122
        - 0.166 * A_L / plan
        - 0.0054 * L / H_BR
        - 0.0481 * C_BR / L
        - 0.0136 * B**2 / A_F
        + 0.0864 * C / L
        - 0.0297 * C * H_C / A_L,
        "wind_N_1": 0.299
        + 1.71 * C / L
        + 0.183 * L * H_C / A_L
        - 1.09 * A_F / A_L
        - 0.0442 * C / H_C
        - 0.289 * A_L / plan
        + 4.24 * A_F / L**2
        - 0.0646 * B**2 / A_F
        + 0.0306 * C_BR / L,
        "wind_N_2": 0.117
        + 0.123 * C_BR / L
        - 0.323 * C / L
        + 0.0041 * A_L / A_OD
        - 0.166 * A_F / B**2
        - 0.0109 * L / H_BR
        + 0.174 * front
        + 0.214 * A_L / plan
        - 1.06 * A_L / L**2,
        "wind_N_3": 0.023 + 0.0385 * C_BR / L - 0.0339 * front + 0.0023 * A_L / A_F,
    }


def by_regression(names: Iterable[str]) -> bool:
    """Whether numbers of a ship's wind are those of the regression: it has a superstructure."""
    return "superstructure_area" in set(names)


def described_numbers(names: Iterable[str]) -> tuple[Variable, ...]:
    """Declarations of the numbers that the wind of a description may have, among some names of them."""
    if by_regression(names):
        return variables(Superstructure)
    return tuple([v for v in parameters_of("wind", 1, wind_force) if v.name not in VELOCITY])


def wind(ship: Description) -> Effect:
    """The wind on a ship whose areas are described."""
    given = {v.name: v.value for v in ship.wind}
    regressed = by_regression(given)
    function = wind_by_regression if regressed else wind_force
    if regressed:
        given |= regression(ship.length, ship.beam, Superstructure(**given))
        given["wind_length"] = ship.length
    parameters = [
        replace(v, start=given.get(v.name, v.start)) for v in parameters_of("wind", 1, function)
    ]
    if ship.wind_measured:  # a wind that nobody measured says nothing of the coefficients of its force
        known = {v.name: v.known("wind") for v in ship.wind if v.share and not regressed}
        known |= {name: REGRESSED for name in given if name.startswith(("wind_X", "wind_Y", "wind_N"))}
        parameters = [replace(v, known=known.get(v.name)) for v in parameters]
    formula = "X = ρ/2 C_X A_F V_rw u_rw, Y = ρ/2 C_Y A_L V_rw v_rw, N = x_L Y, less still air"
    return effect(
        "wind",
        "environment",
        "XYN",
        formula="X, Y = ρ/2 V_rw² A C(γ), N = ρ/2 V_rw² A_L L C_N(γ)" if regressed else formula,
        symbol="W_n, W_e",
        sign="direction that the air moves towards, relative to the water",
        source="Fujiwara et al. 1998" if regressed else "Fossen 2021, ch. 10",
        linear=False,
        parameters=tuple(parameters),
        description=(function.__doc__ or "").splitlines()[0],
        settings=[v.name for v in parameters if v.name not in VELOCITY],
        search=Search(differentiable=True),
        wording=Wording(_blown, EARTH_FIXED),
    )(function)


@effect(
    "wind_drift",
    "environment",
    "XYN",
    formula="nu_r = nu - R^T(psi) k (W_n, W_e), W the wind as it is measured over time",
    symbol="k",
    sign="the water moves to where the air moves",
    source="Wu 1975",
    linear=False,
    gives="water velocity",
    settings=("air_n", "air_e"),
    parameters=(
        Variable("wind_drift", "1", "velocity of the water, as a share of the wind's", 0.0, known=DRIFT),
        Variable("air_n", "m/s", "measured velocity of the air to the north; set in each step", 0.0),
        Variable("air_e", "m/s", "measured velocity of the air to the east; set in each step", 0.0),
    ),
    search=Search(by="given"),  # with its prior it is a coefficient of each ship that has this
    wording=Wording(
        lambda f: f"The water moves with {number(100.0 * f['wind_drift'])} % of the measured wind.",
        EARTH_FIXED,
    ),
)
def wind_drift(ship: Motion, share: Number, air_n: Number, air_e: Number) -> tuple[Number, Number]:
    """Current that the measured wind drives; gives the water's body-fixed velocity [m/s, m/s]."""
    return rotate_to_body(ship.psi, share * air_n, share * air_e)


def _blown(f: Found) -> str:
    speed = number(hypot(f["W_n"], f["W_e"]))
    return f"A wind of {speed} m/s over the water blows towards {compass(f['W_n'], f['W_e'])}."
