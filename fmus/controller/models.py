"""The parametrisations of the thesis, 2.2 and (7.1): each one object, which any law can learn by."""

from typing import NamedTuple

from ..declare import variables
from ..hull import (
    Inertia,
    RotationalDamping,
    TowedDamping,
    Triple,
    coriolis_force,
    inertia_force,
    rotational_damping_force,
    rotational_regressors,
    towed_damping_force,
)
from ..ops import Number
from .parametrisation import ControllerModel, LearnedCoefficient, Parametrisation, Regressors

# Table 5.1, in the order of (2.31).
ROTATIONAL_GAINS = (8.0, 4.0, 8.0, 8.0, 8.0, 4.0, 8.0, 8.0)
_ROTATIONAL = tuple(
    LearnedCoefficient(c.name, c.unit, c.description, c.start, gain)
    for c, gain in zip(variables(RotationalDamping), ROTATIONAL_GAINS, strict=True)
)


def towed_and_coriolis(u: Number, v: Number, r: Number, b: ControllerModel) -> Triple:
    """-C(nu) nu - g(nu), (2.27)."""
    CX, CY, CN = coriolis_force(u, v, r, b.inertia)
    X, Y, N = towed_damping_force(u, v, b.towed)
    return X - CX, Y - CY, N - CN


def _rotational(nu: Triple, nu_dot: Triple, tau: Triple, b: ControllerModel) -> Regressors:
    f = rotational_regressors(nu[1], nu[2])
    return (), f, f


# (2.27)-(2.32). Sway and yaw have the same regressors, so one block stands for both.
ROTATIONAL = Parametrisation(
    coefficients=_ROTATIONAL,
    pattern=((), (0, 1, 2, 3), (4, 5, 6, 7)),
    regressors=_rotational,
    known=towed_and_coriolis,
    blocks=((1,),),
)


def _surge_damping(nu: Triple, nu_dot: Triple, tau: Triple, b: ControllerModel) -> Regressors:
    u, v, r = nu
    f = rotational_regressors(v, r)
    return (abs(u) * u, u, abs(u) * r), f, f


_SURGE = (
    LearnedCoefficient("X_absu_u", "N.s2/m2", "surge force, |u|u", 0.0, 8.0, added=True),
    LearnedCoefficient("X_u", "N.s/m", "surge force, u", 0.0, 4.0, added=True),
    LearnedCoefficient("X_absu_r", "N.s2/(m.rad)", "surge force, |u|r", 0.0, 8.0),
)

# (7.1), (7.2). The surge coefficients add to g(nu).
SURGE_DAMPING = Parametrisation(
    coefficients=(*_SURGE, *_ROTATIONAL),
    pattern=((0, 1, 2), (3, 4, 5, 6), (7, 8, 9, 10)),
    regressors=_surge_damping,
    known=towed_and_coriolis,
    # Yaw has the regressors of sway.
    blocks=((0,), (1,)),
)


def _surge(nu: Triple, nu_dot: Triple, tau: Triple, b: ControllerModel) -> Regressors:
    X, Y, N = _surge_damping(nu, nu_dot, tau, b)
    return (*X, -tau[0]), (*Y, -tau[1]), (*N, -tau[2])


# (7.1)-(7.5). The surge coefficients add to g(nu). The gains of the losses are small because a force is
# some ten times as large as the other regressors.
SURGE = Parametrisation(
    coefficients=(
        *_SURGE,
        *_ROTATIONAL,
        LearnedCoefficient("delta_X", "1", "loss of thrust in surge", 0.0, 0.1),
        LearnedCoefficient("delta_Y", "1", "loss of thrust in sway", 0.0, 0.1),
        LearnedCoefficient("delta_N", "1", "loss of moment in yaw", 0.0, 0.1),
    ),
    pattern=((0, 1, 2, 11), (3, 4, 5, 6, 12), (7, 8, 9, 10, 13)),
    regressors=_surge,
    known=towed_and_coriolis,
    blocks=((0,), (1,), (2,)),
    loss=(11, 12, 13),
)


class InertiaOnly(NamedTuple):
    """A controller that knows M and nothing else."""

    inertia: Inertia = Inertia()


def nothing(u: Number, v: Number, r: Number, b: InertiaOnly) -> Triple:
    return 0.0, 0.0, 0.0


def _all(nu: Triple, nu_dot: Triple, tau: Triple, b: InertiaOnly) -> Regressors:
    u, v, r = nu
    av, uv, vv = abs(v), u * v, v * v
    f = rotational_regressors(v, r)
    return (
        (-r * r, -v * r, u, abs(u) * u, u * u * u, vv),
        (-u * r, v, av * v, vv * v, *f),
        (r * u, uv, uv, v, av * v, *f),
    )


_I = Inertia()
# Gains of the cubic terms: small regressors, large coefficients.
CUBIC = {"X_uuu": 100.0, "Y_vvv": 100.0}

# (2.24)-(2.26), corrected: c1, c2, c3 of C(nu), and all damping of Table 2.1.
ALL_UNKNOWN = Parametrisation(
    coefficients=(
        LearnedCoefficient("c1", "kg.m", "Y_rdot - m x_g of C(nu)", _I.Y_rdot - _I.m * _I.x_g, 20.0),
        LearnedCoefficient("c2", "kg", "Y_vdot - m of C(nu)", _I.Y_vdot - _I.m, 20.0),
        LearnedCoefficient("c3", "kg", "m - X_udot of C(nu)", _I.m - _I.X_udot, 20.0),
        *(
            LearnedCoefficient(c.name, c.unit, c.description, c.start, CUBIC.get(c.name, 8.0))
            for c in variables(TowedDamping)
        ),
        *_ROTATIONAL,
    ),
    pattern=(
        (0, 1, 3, 4, 5, 6),
        (2, 7, 8, 9, 12, 13, 14, 15),
        (0, 1, 2, 10, 11, 16, 17, 18, 19),
    ),
    regressors=_all,
    known=nothing,
    blocks=((0, 1, 2),),
    controller_model=InertiaOnly(),
)


class FullControllerModel(NamedTuple):
    """The whole hull, right up to two factors."""

    inertia: Inertia = Inertia()
    towed: TowedDamping = TowedDamping()
    rotational: RotationalDamping = RotationalDamping()


def _damping(u: Number, v: Number, r: Number, b: FullControllerModel) -> Triple:
    X1, Y1, N1 = towed_damping_force(u, v, b.towed)
    X2, Y2, N2 = rotational_damping_force(v, r, b.rotational)
    return X1 + X2, Y1 + Y2, N1 + N2


def everything(u: Number, v: Number, r: Number, b: FullControllerModel) -> Triple:
    """-C(nu) nu - D(nu) nu."""
    CX, CY, CN = coriolis_force(u, v, r, b.inertia)
    X, Y, N = _damping(u, v, r, b)
    return X - CX, Y - CY, N - CN


def _scaled(nu: Triple, nu_dot: Triple, tau: Triple, b: FullControllerModel) -> Regressors:
    MX, MY, MN = inertia_force(*nu_dot, b.inertia)
    CX, CY, CN = coriolis_force(*nu, b.inertia)
    X, Y, N = _damping(*nu, b)
    return (-MX - CX, X, -tau[0]), (-MY - CY, Y, -tau[1]), (-MN - CN, N, -tau[2])


# (2.20)-(2.23): phi is what the factors of inertia and damping exceed 1 by, and what the thrust's factor
# lacks to 1. All three factors times one number are the same ship, so that one must be known: the
# thrust's, as its gain is zero. To learn it, set the gain of the inertia to zero: a balance tells that.
SCALED = Parametrisation(
    coefficients=(
        LearnedCoefficient("delta_M - 1", "1", "excess of the inertia's factor", 0.0, 1.0),
        LearnedCoefficient("delta_D - 1", "1", "excess of the damping's factor", 0.0, 1.0),
        LearnedCoefficient("1 - delta_tau", "1", "loss of thrust; 0 gain: known", 0.0, 0.0),
    ),
    pattern=((0, 1, 2), (0, 1, 2), (0, 1, 2)),
    regressors=_scaled,
    known=everything,
    blocks=((0, 1, 2),),
    controller_model=FullControllerModel(),
    loss=(2, 2, 2),
)
