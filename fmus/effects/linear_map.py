"""A linear model of the model error as an effect of the plant, (3.11) and (7.15), corrected.

A regression of the model error on velocity and force (PLS, SysID) goes back to the ship by it. The part
B_tau that multiplies the thrusters' force makes their effective force (I + B_tau) tau.
"""

from ..declare import Variable
from ..hull import Triple
from ..ops import Number, Series
from .effect import Loaded, Search, Wording, effect
from .families import BODY_FIXED
from .text import Found, number

AXES = ("X", "Y", "N")
# Name of a regressor -> its unit; products |a| b as in (7.14).
REGRESSORS = {
    "1": "1",
    "u": "m/s",
    "v": "m/s",
    "r": "rad/s",
    "tau_X": "N",
    "tau_Y": "N",
    "tau_N": "N.m",
    "absu_u": "m2/s2",
    "absu_v": "m2/s2",
    "absu_r": "m.rad/s2",
    "absv_v": "m2/s2",
    "absv_r": "m.rad/s2",
    "absr_r": "rad2/s2",
    "absr_v": "m.rad/s2",
}
# Of each axis and regressor the unit of a coefficient.
UNITS = {
    "1": ("N", "N.m"),
    "m/s": ("N.s/m", "N.s"),
    "rad/s": ("N.s/rad", "N.m.s/rad"),
    "N": ("1", "m"),
    "N.m": ("1/m", "1"),
    "m2/s2": ("N.s2/m2", "N.s2/m"),
    "m.rad/s2": ("N.s2/(m.rad)", "N.s2/rad"),
    "rad2/s2": ("N.s2/rad2", "N.m.s2/rad2"),
}


def regressors(u: Series, v: Series, r: Series, tau: Triple) -> tuple[Series, ...]:
    """The values of the regressors, in the order of REGRESSORS."""
    au, av, ar = abs(u), abs(v), abs(r)
    return 1.0, u, v, r, *tau, au * u, au * v, au * r, av * v, av * r, ar * r, ar * v


def parameter(axis: str, regressor: str) -> str:
    """Name of a coefficient, such as ``map_X_tau_Y``."""
    return f"map_{axis}_{regressor}"


def _parameters() -> tuple[Variable, ...]:
    text = "linear map: force in {} by {}"
    return tuple(
        Variable(parameter(axis, name), UNITS[unit][axis == "N"], text.format(axis, name), 0.0)
        for axis in AXES
        for name, unit in REGRESSORS.items()
    )


def sentence(f: Found) -> str:
    some = {n: f[n] for axis in AXES for r in REGRESSORS if f[n := parameter(axis, r)]}
    first = max(some, key=lambda n: abs(some[n]), default="")
    text = f"; the largest is {first} = {number(some[first])}" if first else ""
    count = f"{len(some)} coefficients"
    return f"The model error is a linear function of velocity and force with {count}{text}."


@effect(
    "linear_map",
    "force",
    "XYN",
    formula="omega = c + B x, x = (u, v, r, tau_X, tau_Y, tau_N, |u|u, |u|v, …)",
    symbol="c, B",
    sign="an addition on the side of the forces",
    source="(3.11), (7.13)-(7.15), corrected",
    parameters=_parameters(),
    search=Search(by="given"),
    wording=Wording(sentence, BODY_FIXED),
)
def linear_map(ship: Loaded, *coefficients: Number) -> Triple:
    """Model error linear in velocity, the thrusters' force and products of velocities."""
    x = regressors(ship.u, ship.v, ship.r, (ship.tau_X, ship.tau_Y, ship.tau_N))
    n = len(x)
    X: Number = 0.0
    Y: Number = 0.0
    N: Number = 0.0
    for value, a, b, c in zip(
        x, coefficients[:n], coefficients[n : 2 * n], coefficients[2 * n :], strict=True
    ):
        X, Y, N = X + a * value, Y + b * value, N + c * value
    return X, Y, N
