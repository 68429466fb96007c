"""What a model leaves of the measurement: whether that is more than noise, and whether it matters."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from ..predictors.uncertainty import SHARE_OF_COMMAND
from ..runs.run_constants import CHANCE, NEGLIGIBLE
from ..search.gram import FOLDS
from .measured_system import Window
from .residuals import WindowResiduals

BINS = (4, 16, 64)  # 1, samples whose mean is compared with that of white noise; chosen


@dataclass(frozen=True)
class OutputRemainder:
    """What is left of one output.

    Attributes:
        name, unit: of the output.
        rms: of what is left beyond noise [unit].
        share: of the first sum of squares beyond noise.
        p: probability of as much by chance.
        matters: whether it is above what contract asks for.
    """

    name: str
    unit: str
    rms: float
    share: float
    p: float
    matters: bool


@dataclass(frozen=True)
class SystemRemainder:
    """What is left of all outputs."""

    outputs: Sequence[OutputRemainder]

    @property
    def worst(self) -> list[OutputRemainder]:
        """Outputs of which it is more than chance, and matters."""
        return [o for o in self.outputs if o.p < CHANCE / len(self.outputs) and o.matters]

    @property
    def significant(self) -> bool:
        """Whether that of some output is more than chance, and matters."""
        return bool(self.worst)

    @property
    def by_chance(self) -> bool:
        """Whether that of every output may be chance."""
        return all(o.p >= CHANCE / len(self.outputs) for o in self.outputs)

    @property
    def sentence(self) -> str:
        """In words."""
        if not self.worst:
            return "The residual is not distinguishable from noise, or too small to be relevant."
        each = ", ".join(
            f"{o.name}: {o.rms:.3g} {o.unit} ({o.share:.0%} of its initial squared error)"
            for o in self.worst
        )
        return f"A residual above the noise remains in {each}."


def remainder(
    r: WindowResiduals,
    white: np.ndarray,
    first: np.ndarray,
    fitted: int,
    names: Sequence[str],
    units: Sequence[str],
) -> SystemRemainder:
    """What is left in whitened residuals (size,)."""
    found = []
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        own, before = _of_output(r, white, k), _of_output(r, first, k)
        known = [np.isfinite(w.measured[:, k]) for w in r.windows]
        left, at_first = _beyond(own, known), _beyond(before, known)
        spread = _spread(r, k) / r.noise[k]
        # What makes the motion, of which a command is a part, is here the motion itself.
        least = max(SHARE_OF_COMMAND * spread, NEGLIGIBLE * at_first if white is not first else 0.0)
        share = min(1.0, (left / at_first) ** 2) if at_first > 0.0 else 0.0
        p = _chance(own, known, fitted / len(names))
        found.append(OutputRemainder(name, unit, left * r.noise[k], share, p, bool(left > least)))
    return SystemRemainder(found)


def _of_output(r: WindowResiduals, white: np.ndarray, k: int) -> list[np.ndarray]:
    return [x.reshape(w.measured.shape)[:, k] for w, x in r.parts(white)]


def _spread(r: WindowResiduals, k: int) -> float:
    """Standard deviation of a measured output about a straight line in each window.

    A straight line is what a window begins with, such as the velocity of a ship.
    """
    every = []
    for w in r.windows:
        known = np.isfinite(w.measured[:, k])
        y, t = w.measured[known, k], w.time[known]
        y = np.unwrap(y) if k in r.angles else y
        X = np.vander(t, 2)
        every.append(y - X @ np.linalg.lstsq(X, y, rcond=None)[0])
    return float(np.sqrt(np.mean(np.concatenate(every) ** 2)))


def _means(parts: Sequence[np.ndarray], known: Sequence[np.ndarray], size: int) -> np.ndarray:
    """Means of some samples each, times the root of their number: standard normal if white."""
    found = []
    for x, there in zip(parts, known, strict=True):
        x = x[there]
        n = x.size // size * size
        found.append(x[:n].reshape(-1, size).sum(axis=1) / np.sqrt(size))
    return np.concatenate(found)


def _beyond(parts: Sequence[np.ndarray], known: Sequence[np.ndarray]) -> float:
    """Root mean square beyond white noise, in units of the noise."""
    size = BINS[0]
    z = _means(parts, known, size)
    return float(np.sqrt(max(np.mean(z**2) - 1.0, 0.0) / size)) if z.size else 0.0


def _chance(parts: Sequence[np.ndarray], known: Sequence[np.ndarray], fitted: float) -> float:
    """Probability that white noise has as large means, over all bins tried."""
    least = 1.0
    for size in BINS:
        z = _means(parts, known, size)
        if z.size - fitted >= 2.0:
            least = min(least, float(chi2.sf(z @ z, z.size - fitted)))
    return min(1.0, least * len(BINS))


def inflation(r: WindowResiduals, white: np.ndarray, slopes: np.ndarray, precision: np.ndarray) -> float:
    """By how much variances are larger than those of white residuals, by the scores of blocks.

    The scores J^T r of blocks of time have the covariance J^T J if residuals are white; 1 at the least.
    """
    q = slopes.shape[1]
    if not q:
        return 1.0
    G = np.zeros((q, q))
    for w, rows in zip(r.windows, r.rows, strict=True):
        shape = w.measured.shape
        parts = np.array_split(np.arange(shape[0]), _blocks(r, w))
        J, e = slopes[rows].reshape(*shape, q), white[rows].reshape(shape)
        for part in parts:
            score = np.einsum("tmq,tm->q", J[part], e[part])
            G += np.outer(score, score)
    return max(1.0, float(np.trace(np.linalg.solve(precision, G))) / q)


def _blocks(r: WindowResiduals, w: Window) -> int:
    """Number of blocks of a window: those of its run, shared by its windows."""
    return max(1, FOLDS // sum(v.run == w.run for v in r.windows))


def change_of_squares(
    r: WindowResiduals, before: np.ndarray, after: np.ndarray, runs: Collection[str]
) -> tuple[float, float]:
    """Change of the sum of squares of whitened residuals (size,) in some runs, and its standard error.

    The error is that of pairs, over blocks of time.
    """
    change = []
    for (w, x), (_, y) in zip(r.parts(before), r.parts(after), strict=True):
        if w.run in runs:
            e = (y**2 - x**2).reshape(w.measured.shape).sum(axis=1)
            change += [part.sum() for part in np.array_split(e, _blocks(r, w))]
    error = np.std(change, ddof=1) * np.sqrt(len(change)) if len(change) > 1 else 0.0
    return float(np.sum(change)), float(error)
