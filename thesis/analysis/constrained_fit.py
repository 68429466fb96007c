"""A linear model of the model error that is stable by construction, 7.4 and 8.1.

The model omega = c + B x that predicts most like a given one (least squares, PLS) under two conditions,
see docs/stability.md: every force acts to the side that it is asked for, and the hull dissipates no less
than the nominal one where it operates:

    sym(I + B_tau) >= EPSILON I,    -nu . F(nu) >= d_nominal nu . M nu

Both are convex in B: linear for each direction of a force, and for each velocity. They are met by
cutting planes: the problem is solved with some of them, and the most violated ones are added until none
is. Each problem is one of least distance, by non-negative least squares (Lawson and Hanson 1974, 23).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from cosim import InputError
from diagnosis.assessment import (
    OPERATING,
    OperatingRegion,
    dissipation,
    least_dissipation,
    mass,
    sampled_motions,
)
from diagnosis.predictors import Model
from fmus.effects.linear_map import REGRESSORS
from fmus.effects.linear_map import regressors as regressors_at

from .into_the_plant import EPSILON, as_model, force_columns, goes_into_the_plant, regressor
from .samples import TAU

# Share of the columns' mean square that is added to the diagonal; chosen: far below what data tell.
RIDGE = 1e-8
# By which a condition is met by more than it must be, so that rounding does not break it; chosen.
MARGIN = 1e-6
ROUNDS, ADDED = 200, 10  # most rounds of cuts, and cuts of one round; chosen


@dataclass(frozen=True, eq=False)
class Stable:
    """A stable linear model of the model error, and what it costs.

    Attributes:
        columns: of x, as a recipe names them.
        c, B: (3,) [N, N, N m] and (3, m), of omega = c + B x.
        r2, given_r2: (3,), share of the sum of squares of omega about the mean that it explains, and
            that the given model does.
        changed: whether the given model was not stable.
    """

    columns: list[str]
    c: np.ndarray
    B: np.ndarray
    r2: np.ndarray
    given_r2: np.ndarray
    changed: bool


@dataclass(frozen=True, eq=False)
class Conditions:
    """The dissipation as conditions G vec(B) >= h, one row for each of many velocities."""

    G: np.ndarray
    h: np.ndarray


@cache
def dissipation_conditions(columns: tuple[str, ...], region: OperatingRegion) -> Conditions:
    """Dissipation of a hull with the map, no less than the nominal one's least, over a region."""
    metric, nu = mass(Model()), sampled_motions(region)
    base = as_model(np.zeros(3), np.zeros((3, len(columns))), columns)
    least = least_dissipation(Model(), region)
    values = dict(
        zip(REGRESSORS, regressors_at(nu[:, 0], nu[:, 1], nu[:, 2], (0.0, 0.0, 0.0)), strict=True)
    )
    x = np.column_stack([np.broadcast_to(values[regressor(c)], len(nu)) for c in columns])
    energy = np.einsum("ij,jk,ik->i", nu, metric, nu)
    G = -(nu[:, :, None] * x[:, None, :]).reshape(len(nu), -1) / energy[:, None]
    return Conditions(G, least - dissipation(base, nu, metric) + MARGIN)


def thrust_cuts(B: np.ndarray, columns: Sequence[str]) -> Conditions:
    """Conditions of the directions in which a force acts too little to its side, if there are any."""
    B_tau = force_columns(B, columns)
    values, vectors = np.linalg.eigh(np.eye(3) + 0.5 * (B_tau + B_tau.T))
    rows, least = [], []
    for value, v in zip(values, vectors.T, strict=True):
        if value < EPSILON:
            row = np.zeros(B.shape)
            for k, name in enumerate(TAU):
                if name in columns:
                    row[:, columns.index(name)] = v * v[k]
            rows.append(row.ravel())
            least.append(EPSILON - 1.0 + MARGIN)
    return Conditions(np.reshape(rows, (-1, B.size)), np.array(least))


def nearest_stable(
    X: np.ndarray,
    omega: np.ndarray,
    columns: Sequence[str],
    B: np.ndarray | None = None,
    region: OperatingRegion = OPERATING,
) -> Stable:
    """The stable model that predicts most like a given one.

    Args:
        X: (n, m), samples of the columns.
        omega: (n, 3), model error relative to (2.27) [N, N, N m].
        columns: names, of those that the effect ``linear_map`` has.
        B: (3, m), given; by default that of least squares, which gives constrained least squares.
        region: speeds at which the dissipation counts.

    Raises:
        InputError: the plant has no such columns, or the cuts do not come to an end.
    """
    names = list(columns)
    if not goes_into_the_plant(names):
        raise InputError("the plant has no such columns: a stable model is not possible")
    mean_x, mean_y = X.mean(axis=0), omega.mean(axis=0)
    Z, Y = X - mean_x, omega - mean_y
    H = Z.T @ Z
    H[np.diag_indices_from(H)] += RIDGE * np.trace(H) / len(H)
    given = np.linalg.solve(H, Z.T @ Y).T if B is None else B
    root = np.linalg.cholesky(H).T  # H = root^T root
    size = np.sqrt(np.sum(Y**2, axis=0))
    hull = dissipation_conditions(tuple(names), region)
    found, G, h = given, np.empty((0, given.size)), np.empty(0)
    for _ in range(ROUNDS):
        thrust = thrust_cuts(found, names)
        lacking = hull.h - MARGIN - hull.G @ found.ravel()
        worst = np.argsort(-lacking)[:ADDED]
        worst = worst[lacking[worst] > 0.0]
        if not worst.size and not thrust.h.size:
            return _result(Z, Y, mean_x, mean_y, names, found, given)
        G = np.vstack([G, hull.G[worst], thrust.G])
        h = np.concatenate([h, hull.h[worst], thrust.h])
        found = _least_distance(given, root, size, G, h)
    raise InputError(f"no stable model of {', '.join(names)} was found in {ROUNDS} rounds")


def _least_distance(
    given: np.ndarray, root: np.ndarray, size: np.ndarray, G: np.ndarray, h: np.ndarray
) -> np.ndarray:
    """The B with G vec(B) >= h that predicts most like the given one, axes weighted by their size."""
    m = given.shape[1]
    parts = G.reshape(-1, 3, m)
    # In coordinates in which the distance is Euclidean: B_k = given_k + size_k root^-1 z_k.
    A = np.concatenate(
        [size[k] * solve_triangular(root, parts[:, k].T, trans=1).T for k in range(3)], axis=1
    )
    b = h - G @ given.ravel()
    norm = np.linalg.norm(A, axis=1)
    A, b = A / norm[:, None], b / norm
    scale = max(float(np.abs(b).max()), 1e-300)
    E = np.vstack([A.T, b / scale])
    goal = np.zeros(len(E))
    goal[-1] = 1.0
    u, _ = nnls(E, goal, maxiter=50 * E.shape[1])
    rest = E @ u - goal
    if abs(rest[-1]) < 1e-12:
        raise InputError("the conditions of a stable model contradict each other")
    z = (-rest[:-1] / rest[-1] * scale).reshape(3, m)
    return given + np.array([size[k] * solve_triangular(root, z[k]) for k in range(3)])


def _result(
    Z: np.ndarray,
    Y: np.ndarray,
    mean_x: np.ndarray,
    mean_y: np.ndarray,
    columns: list[str],
    B: np.ndarray,
    given: np.ndarray,
) -> Stable:
    total = np.sum(Y**2, axis=0)
    r2 = [1.0 - np.sum((Y - Z @ b.T) ** 2, axis=0) / total for b in (B, given)]
    return Stable(columns, mean_y - B @ mean_x, B, r2[0], r2[1], B is not given)
