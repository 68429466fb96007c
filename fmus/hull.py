"""Manoeuvring model of a hull in surge, sway and yaw: inertia, Coriolis and damping forces.

Written with +, -, *, / and abs() only, so that every expression runs on floats, on numpy arrays and
on traced symbols. The values are those of CyberShip Enterprise 1 (Table 2.1, corrected). The plant
and the controller model of it are two separate sets of these parameters.
"""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Annotated, NamedTuple

from .declare import POSITIVE, Fields, Known, Variable, bundle, group_of, variables
from .hull_functions import FUNCTIONS
from .ops import Number, Series
from .signals import Force

Triple = tuple[Number, Number, Number]
Inverse = tuple[Number, Number, Number, Number, Number]  # of the mass matrix

# How well the values of Table 2.1 are known. A model of 15 kg is weighed to some ten grams, and what
# lies on it from one day to the next adds a little.
WEIGHED = Known("mass", "weighed (Table 6.1)", 0.01)
# Found by balancing the hull, to less than a centimetre; the print is off by a factor of ten.
BALANCED = Known("inertia", "balanced", 0.2)
# Table 2.1 marks these as taken from CyberShip II, a longer and heavier ship.
BORROWED_INERTIA = Known("inertia", "borrowed from CyberShip II", 0.3)
BORROWED_MASS = Known("added_mass", "borrowed from CyberShip II", 0.5)
BORROWED = Known("damping", "borrowed from CyberShip II", 1.0)
# The table's curves miss the tow tests that they were fitted to by up to a quarter of the force below
# 0.3 m/s, and neighbouring powers of the speed stand for one another.
TOWED = Known("damping", "tow tests (2011)", 0.3)


class Inertia(NamedTuple):
    """Rigid-body and added mass, (2.5), corrected: x_g = 0.0375 m, N_rdot = -1."""

    m: Annotated[float, "kg", "mass", POSITIVE, WEIGHED] = 14.79
    I_z: Annotated[
        float, "kg.m2", "moment of inertia about the body z axis", POSITIVE, BORROWED_INERTIA
    ] = 1.760
    x_g: Annotated[float, "m", "centre of gravity, forward of the body origin", BALANCED] = 0.0375
    X_udot: Annotated[float, "kg", "added mass: surge force by surge acceleration", BORROWED_MASS] = -2.0
    Y_vdot: Annotated[float, "kg", "added mass: sway force by sway acceleration", BORROWED_MASS] = -10.0
    Y_rdot: Annotated[float, "kg.m", "added mass: sway force by yaw acceleration", BORROWED_MASS] = 0.0
    N_vdot: Annotated[float, "kg.m", "added mass: yaw moment by sway acceleration", BORROWED_MASS] = 0.0
    N_rdot: Annotated[float, "kg.m2", "added mass: yaw moment by yaw acceleration", BORROWED_MASS] = -1.0


class TowedDamping(NamedTuple):
    """Damping coefficients found by towing: the part g(nu) that a controller knows, (2.29)."""

    X_u: Annotated[float, "N.s/m", "surge damping, linear", TOWED] = -0.6555
    X_absu_u: Annotated[float, "N.s2/m2", "surge damping, |u|u", TOWED] = 0.3545
    X_uuu: Annotated[float, "N.s3/m3", "surge damping, cubic", TOWED] = -3.787
    X_vv: Annotated[float, "N.s2/m2", "surge force by sway, v^2", TOWED] = -2.443
    Y_v: Annotated[float, "N.s/m", "sway damping, linear", TOWED] = -1.33
    Y_absv_v: Annotated[float, "N.s2/m2", "sway damping, |v|v", TOWED] = -2.776
    Y_vvv: Annotated[float, "N.s3/m3", "sway damping, cubic", TOWED] = -64.91
    N_v: Annotated[float, "N.s", "yaw moment by sway, linear", TOWED] = 0.0
    N_absv_v: Annotated[float, "N.s2/m", "yaw moment by sway, |v|v", TOWED] = -0.2088


class RotationalDamping(NamedTuple):
    """Damping coefficients of the yaw rate, phi in the order of (2.30); from CyberShip II."""

    Y_absr_v: Annotated[float, "N.s2/(m.rad)", "sway force, |r|v", BORROWED] = -0.805
    Y_r: Annotated[float, "N.s/rad", "sway force, r", BORROWED] = -7.250
    Y_absv_r: Annotated[float, "N.s2/(m.rad)", "sway force, |v|r", BORROWED] = -0.845
    Y_absr_r: Annotated[float, "N.s2/rad2", "sway force, |r|r", BORROWED] = -3.450
    N_absr_v: Annotated[float, "N.s2/rad", "yaw moment, |r|v", BORROWED] = 0.130
    N_r: Annotated[float, "N.m.s/rad", "yaw moment, r", BORROWED] = -1.900
    N_absv_r: Annotated[float, "N.s2/rad", "yaw moment, |v|r", BORROWED] = 0.080
    N_absr_r: Annotated[float, "N.m.s2/rad2", "yaw moment, |r|r", BORROWED] = -0.750


# Terms that Table 2.1 does not have; zero unless somebody finds them.
EXTRA = (
    Variable("X_uu", "N.s2/m2", "surge force, u^2: differs ahead and astern", 0.0),
    Variable("X_absu_r", "N.s2/(m.rad)", "surge force, |u|r", 0.0),
    Variable("X_vr", "N.s2/(m.rad)", "surge force, v r", 0.0),
    Variable("X_rr", "N.s2/rad2", "surge force, r^2", 0.0),
    Variable("Y_ur", "N.s2/(m.rad)", "sway force, u r", 0.0),
    Variable("Y_uv", "N.s2/m2", "sway force, u v", 0.0),
    Variable("N_ur", "N.s2/rad", "yaw moment, u r", 0.0),
    Variable("N_uv", "N.s2/m", "yaw moment, u v", 0.0),
)
Terms = group_of("Terms", [*variables(TowedDamping), *variables(RotationalDamping), *EXTRA])
# Parameters of damping that is no product of speeds, which a ship's description adds.
HullFunctions = bundle("HullFunctions")


class Damping(NamedTuple):
    """All damping: coefficients of products of speeds by their names, and other functions."""

    terms: Fields = Terms()
    functions: Fields = HullFunctions()


def mass_matrix(p: Inertia) -> tuple[Triple, Triple, Triple]:
    """M = M_RB + M_A, (2.4)-(2.5), as three rows [kg, kg m, kg m2]."""
    return (
        (p.m - p.X_udot, 0.0, 0.0),
        (0.0, p.m - p.Y_vdot, p.m * p.x_g - p.Y_rdot),
        (0.0, p.m * p.x_g - p.N_vdot, p.I_z - p.N_rdot),
    )


def described_mass(numbers: Mapping[str, float]) -> tuple[Triple, Triple, Triple]:
    """M as in :func:`mass_matrix` by named numbers; those that are not given are 0."""
    return mass_matrix(Inertia(**dict.fromkeys(Inertia._fields, 0.0) | dict(numbers)))


def inertia_force(u_dot: Number, v_dot: Number, r_dot: Number, p: Inertia) -> Triple:
    """M nu_dot [N, N, N m], (2.2)."""
    (m11, _, _), (_, m22, m23), (_, m32, m33) = mass_matrix(p)
    return m11 * u_dot, m22 * v_dot + m23 * r_dot, m32 * v_dot + m33 * r_dot


def inverse_mass(p: Inertia) -> Inverse:
    """The five entries of the inverse of M that are not zero: 11, 22, 23, 32, 33."""
    (m11, _, _), (_, m22, m23), (_, m32, m33) = mass_matrix(p)
    det = m22 * m33 - m23 * m32
    return 1.0 / m11, m33 / det, -m23 / det, -m32 / det, m22 / det


def coriolis_force(u: Number, v: Number, r: Number, p: Inertia) -> Triple:
    """C(nu) nu [N, N, N m], (2.6)-(2.7), corrected (Fossen 2011): skew-symmetric C."""
    m, _, x_g, X_udot, Y_vdot, Y_rdot, _, _ = p
    c13 = (Y_vdot - m) * v + (Y_rdot - m * x_g) * r
    c23 = (m - X_udot) * u
    return c13 * r, c23 * r, -c13 * u - c23 * v


def towed_damping_force(u: Number, v: Number, c: TowedDamping) -> Triple:
    """-g(nu) [N, N, N m]: damping force on the hull without yaw, (2.29), X_vv corrected."""
    X_u, X_absu_u, X_uuu, X_vv, Y_v, Y_absv_v, Y_vvv, N_v, N_absv_v = c
    uu = u * u
    vv = v * v
    av = abs(v)
    return (
        (X_u + X_absu_u * abs(u) + X_uuu * uu) * u + X_vv * vv,
        (Y_v + Y_absv_v * av + Y_vvv * vv) * v,
        (N_v + N_absv_v * av) * v,
    )


def rotational_regressors(v: Number, r: Number) -> tuple[Number, Number, Number, Number]:
    """|r|v, r, |v|r, |r|r: minus the nonzero entries of a row of Phi(nu), (2.32)."""
    ar = abs(r)
    return ar * v, r, abs(v) * r, ar * r


def rotational_damping_force(v: Number, r: Number, c: RotationalDamping) -> Triple:
    """-Phi(nu) phi [N, N, N m]: damping force on the hull by yaw, (2.28) with (2.32)."""
    Y_absr_v, Y_r, Y_absv_r, Y_absr_r, N_absr_v, N_r, N_absv_r, N_absr_r = c
    arv, r1, avr, arr = rotational_regressors(v, r)
    return (
        0.0,
        Y_absr_v * arv + Y_r * r1 + Y_absv_r * avr + Y_absr_r * arr,
        N_absr_v * arv + N_r * r1 + N_absv_r * avr + N_absr_r * arr,
    )


@cache
def term(name: str) -> tuple[int, tuple[tuple[bool, int], ...]]:
    """What the name of a coefficient says: its axis, and for each factor whether of its size, and which.

    Args:
        name: such as ``Y_absu_v`` for Y = c |u| v.

    Raises:
        ValueError: it is no such name.
    """
    found = re.fullmatch(r"([XYN])_((?:abs[uvr]_?)*[uvr]*)", name)
    factors = re.findall(r"(abs)?([uvr])_?", found[2]) if found else ()
    if found is None or not factors:
        raise ValueError(f"'{name}' is not a product of u, v, r and their absolute values")
    return "XYN".index(found[1]), tuple([(bool(sign), "uvr".index(speed)) for sign, speed in factors])


def product(name: str) -> str:
    """The product of speeds that a coefficient's name tells: of ``X_absu_u`` it is ``|u|u``."""
    _, factors = term(name)
    return "".join([f"|{'uvr'[k]}|" if sign else "uvr"[k] for sign, k in factors])


def term_variable(name: str) -> Variable:
    """The declaration of the coefficient of a product of speeds."""
    axis, factors = term(name)
    speeds = [("rad/s" if k == 2 else "m/s") for _, k in factors]
    metres, radians = speeds.count("m/s"), speeds.count("rad/s")
    below = ".".join(
        [f"m{metres if metres > 1 else ''}"] * bool(metres)
        + [f"rad{radians if radians > 1 else ''}"] * bool(radians)
    )
    seconds = len(factors)
    force = "N.m" if axis == 2 else "N"
    unit = f"{force}.s{seconds if seconds > 1 else ''}/{f'({below})' if '.' in below else below}"
    what = ("surge force", "sway force", "yaw moment")[axis]
    return Variable(name, unit, f"{what}, {product(name)}", 0.0)


def term_force(name: str, value: Number, u: Number, v: Number, r: Number) -> Triple:
    """Force [N, N, N m] of a coefficient times the product of speeds that its name tells."""
    axis, factors = term(name)
    for sign, k in factors:
        speed = (u, v, r)[k]
        value = value * (abs(speed) if sign else speed)
    return value if axis == 0 else 0.0, value if axis == 1 else 0.0, value if axis == 2 else 0.0


@cache
def _plan(names: tuple[str, ...]) -> tuple[Sequence[tuple[int, bool, int]], Sequence[tuple[int, int]]]:
    """How products of speeds follow from each other, and what each coefficient is of.

    Returns:
        For each product the number of the one that it extends (-1: none), and its last factor: whether
        of its size, and which; for each coefficient its axis and the number of its product.
    """
    known: dict[tuple[tuple[bool, int], ...], int] = {}
    steps: list[tuple[int, bool, int]] = []
    uses = []
    for name in names:
        axis, factors = term(name)
        for k in range(1, len(factors) + 1):
            if factors[:k] not in known:
                known[factors[:k]] = len(steps)
                steps.append((known.get(factors[: k - 1], -1), *factors[k - 1]))
        uses.append((axis, known[factors]))
    return tuple(steps), tuple(uses)


def without_zeros(c: Damping) -> Damping:
    """The same damping without coefficients that are zero: the force is the same, in fewer products."""
    kept = {name: x for name, x in zip(c.terms._fields, c.terms, strict=True) if _acts(x)}
    return c._replace(terms=_terms(tuple(kept))._make(kept.values()))


def _acts(x: Series) -> bool:
    return bool(x) if isinstance(x, float) else True


@cache
def _terms(names: tuple[str, ...]) -> type[Fields]:
    """The class of coefficients of some products of speeds."""
    return group_of("Terms", [term_variable(name) for name in names])


def terms_force(u: Series, v: Series, r: Series, terms: Fields) -> Triple:
    """Force on the hull [N, N, N m] by coefficients of products of speeds, named by them."""
    steps, uses = _plan(terms._fields)
    speeds, sizes = (u, v, r), (abs(u), abs(v), abs(r))
    products: list[Series] = []
    for before, sign, k in steps:
        factor = sizes[k] if sign else speeds[k]
        products.append(factor if before < 0 else products[before] * factor)
    found: list[Series] = [0.0, 0.0, 0.0]
    for (axis, k), c in zip(uses, terms, strict=True):
        found[axis] = found[axis] + c * products[k]
    return found[0], found[1], found[2]


def damping_force(u: Series, v: Series, r: Series, c: Damping) -> Triple:
    """-D(nu) nu [N, N, N m]: all velocity-dependent force on the hull, (2.8)-(2.9), corrected.

    The coefficients c are a Damping, or a tuple of terms and functions.
    """
    terms, functions = c
    X, Y, N = terms_force(u, v, r, terms)
    for name, p in zip(functions._fields, functions, strict=True):
        dX, dY, dN = FUNCTIONS[name](u, v, r, *p)
        X, Y, N = X + dX, Y + dY, N + dN
    return X, Y, N


class Hull(NamedTuple):
    """Inertia, its inverse and damping: what does not change during a step, computed once."""

    inertia: Inertia
    inverse: Inverse
    damping: Damping


def accelerated(inverse: Inverse, X: Series, Y: Series, N: Series) -> tuple[Series, Series, Series]:
    """M^-1 tau [m/s2, m/s2, rad/s2] by the inverse of the mass matrix; of whole time series, too."""
    i11, i22, i23, i32, i33 = inverse
    return i11 * X, i22 * Y + i23 * N, i32 * Y + i33 * N


def motion(u: Number, v: Number, r: Number, tau: Force, b: Hull) -> Triple:
    """nu_dot [m/s2, m/s2, rad/s2] of the hull under a force, (2.2), corrected: C(nu) nu."""
    inertia, inverse, damping = b
    CX, CY, CN = coriolis_force(u, v, r, inertia)
    DX, DY, DN = damping_force(u, v, r, damping)
    return accelerated(inverse, tau[0] - CX + DX, tau[1] - CY + DY, tau[2] - CN + DN)
