"""The moment at which a model error changes, as when an actuator sticks or ballast is taken.

A model error that is linear in a constant, the velocity and the command of its axis, with coefficients
of its own before and after a moment of one run, is compared with one whose coefficients stay, by the
F-test of Chow (1960) with as many samples as the autocorrelation of what is left allows. A force that
wanders has a largest change, too: the test is as clear in none of the series with the same spectrum and
random phases (Theiler et al., Testing for nonlinearity in time series, Physica D 58, 1992). Coefficients
that drift, as a polynomial of the time, are no change, nor is one after which the error changes a second
time as much.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from ...predictors import WeakWindows
from ...predictors.weak_form import BLOCK, EVERY
from ...runs.run_constants import CHANCE, NEGLIGIBLE
from ..settings import SETTINGS

CUBIC = 3  # 1, degree of the polynomial of a drift: the least with a change to and fro
STRETCH = round(BLOCK / (2 * EVERY))  # windows between moments that are tried, of one amplitude


class StructuralChange(NamedTuple):
    """Where a series changes most.

    Attributes:
        gain: squares that two sets of coefficients explain beyond one.
        row: the first one after the change; 0 where the series is too short for one.
        tried: number of rows that were compared.
    """

    gain: float
    row: int
    tried: int


def moment_of_change(
    data: Sequence[WeakWindows], error: np.ndarray, regressors: np.ndarray, always: float
) -> tuple[str, float] | None:
    """The name of the run and the time [s] at which an error changes; None: at no moment.

    Args:
        data: windows of each run.
        error: (K,), model error of an axis in them, one run after the other.
        regressors: (K, p), of which the error is a linear function for some time.
        always: share of the squares that is explained without a change.
    """
    edges = np.cumsum([w.middle.size for w in data])[:-1]
    parts = list(zip(np.split(error, edges), np.split(regressors, edges), strict=True))
    changes = [most_changed(*part) for part in parts]
    k = max(range(len(data)), key=lambda k: changes[k].gain)
    found, (own, x) = changes[k], parts[k]
    if not 3 * STRETCH <= found.row <= len(x) - 3 * STRETCH:
        return None  # at an edge of what is tried: what lies beyond may be the start of a run
    drift = np.hstack([x * (np.linspace(-1.0, 1.0, len(x)) ** k)[:, None] for k in range(CUBIC + 1)])
    halves = _halves(own, x, found.row)
    rest = sum(float(np.sum(_rest(*half) ** 2)) for half in halves)
    changes_once = (
        found.gain >= SETTINGS.repeats * (error @ error)
        and own @ own - rest > (always + NEGLIGIBLE) * (error @ error)
        and rest < float(np.sum(_rest(own, drift) ** 2))
        and found.gain > max(most_changed(*half).gain for half in halves)
    )
    if not changes_once:
        return None
    clear = _chance(own, x)
    if clear >= CHANCE or any(_chance(e, x) <= clear for e in _surrogates(_rest(own, x))):
        return None
    return data[k].run.name, float(data[k].middle[found.row])


def _chance(error: np.ndarray, x: np.ndarray) -> float:
    """Chance of so large a change of a series of independent samples, of all moments that are tried."""
    found = most_changed(error, x)
    rest = np.concatenate([_rest(*half) for half in _halves(error, x, found.row)])
    count, free = x.shape[1], len(rest) / _correlated(rest) - 2 * x.shape[1]
    if free <= 0.0:
        return 1.0
    variance = max(float(rest @ rest) / free, np.finfo(float).tiny)
    return found.tried * float(fdtrc(count, free, found.gain / count / variance))


def _halves(error: np.ndarray, x: np.ndarray, row: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """A series (K,) and its regressors (K, p) before a row, and from it on."""
    return [(error[:row], x[:row]), (error[row:], x[row:])]


def _correlated(series: np.ndarray) -> float:
    """Samples of a series that carry as much as one independent one; as of ``correlated_windows``."""
    power = np.abs(np.fft.rfft(series, 2 * series.size)) ** 2
    covariance = np.fft.irfft(power)[: series.size // 2]
    rho = covariance / max(covariance[0], np.finfo(float).tiny)
    return float(2.0 * np.sum(rho * np.cumprod(rho > 0.0)) - 1.0)


def _surrogates(series: np.ndarray) -> Iterator[np.ndarray]:
    """Series with the spectrum of one, as many as a test at the level of chance needs."""
    rng, size = np.random.default_rng(0), np.abs(np.fft.rfft(series))
    for _ in range(round(1.0 / CHANCE) - 1):
        yield np.fft.irfft(size * np.exp(2j * np.pi * rng.random(size.size)), series.size)


def most_changed(error: np.ndarray, x: np.ndarray) -> StructuralChange:
    """Where a series (K,) changes most as a function of regressors x (K, p).

    At least two stretches lie on both sides.
    """
    rows = np.arange(2 * STRETCH, len(x) - 2 * STRETCH + 1, STRETCH)
    if not rows.size:
        return StructuralChange(0.0, 0, 0)
    squares = np.cumsum(x[:, :, None] * x[:, None, :], axis=0)
    products = np.cumsum(x.T * error, axis=1).T
    before = _explained(squares[rows - 1], products[rows - 1])
    after = _explained(squares[-1] - squares[rows - 1], products[-1] - products[rows - 1])
    gain = before + after - _explained(squares[-1:], products[-1:])
    top = int(gain.argmax())
    return StructuralChange(float(gain[top]), int(rows[top]), rows.size)


def _explained(squares: np.ndarray, products: np.ndarray) -> np.ndarray:
    """Squares (n,) that are explained where sums of squares are (n, p, p), and of products (n, p)."""
    return np.einsum("ni,nij,nj->n", products, np.linalg.pinv(squares, hermitian=True), products)


def _rest(error: np.ndarray, x: np.ndarray) -> np.ndarray:
    """What a linear function of regressors x (K, p) leaves of a series (K,)."""
    return error - x @ np.linalg.lstsq(x, error, rcond=None)[0]
