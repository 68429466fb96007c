"""How fast concurrent learning moves its estimates, 4.1.2-4.1.5, corrected.

    phi_hat'     = Gamma (F^T e + w sum_j F_j^T eps_j)
    omega_n_hat' = Gamma_omega (R e + w sum_j R_j eps_j), or (4.35) with rho > 0

where F = -Phi and e is z2 or eps. The errors eps_j are formed anew with today's estimates; ``stale`` = 1
uses them as they were when stored, as printed. w is ``store_weight``: footnote 1 has w = 0.1.

The part driven by eps is a linear feedback with the information matrix Q. Explicit Euler is unstable
where h Gamma lambda_max(Q) > 2, so that part goes slower where h times the trace of Gamma Q exceeds 1.
Q counts the stored samples with their weight.
With rho > 0, where the matrix is not symmetric, this holds for phi and omega_n each.
"""

from collections.abc import Sequence
from typing import NamedTuple

from ..declare import Fields
from ..hull import Triple
from ..ops import Condition, Number, fmax, sqrt, when, where
from .adaptive import Disturbance, climb, to_earth
from .eigen import dot
from .parametrisation import Parametrisation, Regressors
from .store import StoredSample, StoreOptions, Sums, plus, times


class StoreIntegral(NamedTuple):
    """Sum or integral over samples: weight, R target, and F^T R^T."""

    weight: Number
    turned: Triple
    cross: tuple[Triple, ...]


def remembered(sums: Sums, integral: StoreIntegral, rho: Number, weight: Number) -> StoreIntegral:
    """What omega_n learns by: rho times the integral, or with rho = 0 the weighted store."""
    return when(
        rho > 0.0,
        lambda: times(rho, integral),
        lambda: times(weight, StoreIntegral(sums.count, sums.turned, sums.cross)),
    )


def stored_slopes(
    model: Parametrisation,
    sums: Sums,
    phi: Sequence[Number],
    omega: Triple,
    omega_on: Condition,
    stale: Number,
) -> tuple[Number, ...]:
    """sum_j F_j^T eps_j, from the sums over the store."""

    def explained() -> tuple[Number, ...]:
        parts = list(
            when(
                omega_on,
                lambda: tuple([dot(row, omega) for row in sums.cross]),
                lambda: (0.0,) * len(sums.cross),
            )
        )
        for indices, gram in zip(model.pattern, sums.grams, strict=True):
            own = [phi[k] for k in indices]
            for k, line in zip(indices, gram, strict=True):
                parts[k] = parts[k] + dot(line, own)
        return tuple([b - x for b, x in zip(sums.projected, parts, strict=True)])

    return when(stale > 0.5, lambda: sums.projected, explained)


def earth_slopes(memory: StoreIntegral, phi: Sequence[Number], omega: Triple, stale: Number) -> Triple:
    """sum_j R_j eps_j, or its integral."""
    fresh = where(stale > 0.5, 0.0, 1.0)
    a, b, c = (
        turned - fresh * (dot(column, phi) + memory.weight * x)
        for turned, column, x in zip(memory.turned, zip(*memory.cross, strict=True), omega, strict=True)
    )
    return a, b, c


def information(
    model: Parametrisation,
    gamma: Sequence[Number],
    sums: Sums,
    F: Regressors,
    weight: Number,
    own: Number,
) -> Number:
    """Trace of Gamma Q, of ``weight`` times the store and ``own`` times the present sample."""
    total = 0.0
    for indices, gram, row in zip(model.pattern, sums.grams, F, strict=True):
        for position, k in enumerate(indices):
            f = row[position]
            total = total + gamma[k] * (weight * gram[position][position] + own * f * f)
    return total


def integrated(model: Parametrisation, s: StoreIntegral, row: StoredSample, dt: Number) -> StoreIntegral:
    """The integral of (4.35) after dt [s]."""
    now = StoreIntegral(1.0, to_earth(row.psi, row.target), model.turned(row.F, row.psi))
    return StoreIntegral._make(plus(s, times(dt, now)))


class Drive(NamedTuple):
    """An instantaneous error, z2 or eps, with its regressors and heading."""

    F: Regressors
    psi: Number
    error: Triple


def learned(
    model: Parametrisation,
    estimates: tuple[Fields, Triple],
    gains: tuple[Fields, Disturbance | Fields],
    drive: Drive,
    by_eps: Number,
    sums: Sums,
    memory: StoreIntegral,
    options: StoreOptions,
    dt: Number,
) -> tuple[Fields, Triple, tuple[Number, Number]]:
    """The estimates after dt [s].

    Args:
        model: what is learned.
        estimates: phi_hat and omega_n_hat.
        gains: diagonals of Gamma and Gamma_omega.
        drive: the instantaneous error.
        by_eps: 1 where that is eps, and so belongs to the guarded part, else 0.
        sums: over the store.
        memory: what omega_n learns by.
        options: whether stored errors are stale, and the weight of their sum.
        dt: 0 where nothing is learned.

    Returns:
        phi_hat, omega_n_hat, and the norms of the rates of phi_hat by the store and by the present
        error.
    """
    phi, omega = estimates
    gamma, gamma_omega = gains
    on = dot(gamma_omega, (1.0, 1.0, 1.0))
    stale, weight = options.stale, options.store_weight
    trace = information(model, gamma, sums, drive.F, weight, by_eps) + on * (memory.weight + by_eps)
    guarded = dt / fmax(1.0, dt * trace)
    pace = where(by_eps > 0.5, guarded, dt)
    slopes = times(weight, stored_slopes(model, sums, phi, omega, on > 0.0, stale))
    earth = when(
        on > 0.0,
        lambda: earth_slopes(memory, phi, omega, stale),
        lambda: (0.0, 0.0, 0.0),
    )
    pull = model.project(drive.F, drive.error)
    phi = climb(climb(phi, gamma, slopes, guarded), gamma, pull, pace)
    rates = _norm(gamma, slopes, guarded, dt), _norm(gamma, pull, pace, dt)
    a, b, c = climb(
        climb(omega, gamma_omega, earth, guarded), gamma_omega, to_earth(drive.psi, drive.error), pace
    )
    return model.hat._make(phi), (a, b, c), rates


def _norm(gamma: Sequence[Number], slopes: Sequence[Number], pace: Number, dt: Number) -> Number:
    """The norm of Gamma times slopes, as much slower as the step ``pace`` is shorter than dt [s]."""
    moves = [g * f for g, f in zip(gamma, slopes, strict=True)]
    return sqrt(dot(moves, moves)) * (pace / fmax(dt, 1e-300))
