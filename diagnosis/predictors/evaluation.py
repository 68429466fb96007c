"""Evaluation of a model on a measured run, before and after something was learned."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.special import chdtri

from ..execution.short_text import ShortRepr
from ..runs import Smoothed
from .described_ship import DescribedShip
from .predictor import Predictor
from .ship_model import Model
from .weak_form import WeakWindows, omega
from .windows import WindowErrors, Windows

LEVELS = (0.5, 0.9)  # 1, probabilities of the bands that are shown; 90 % of the contract, and half


@dataclass(frozen=True, eq=False, repr=False)
class Bands(ShortRepr):
    """The covariance of predictions in the windows of a run.

    Attributes:
        windows: of the run.
        since: (T,), time from a window's start [s], zero included.
        predicted: (w, T, 3), pose [m, m, rad].
        covariance: (w, T, 3, 3), of measured minus predicted pose.
    """

    windows: Windows
    since: np.ndarray
    predicted: np.ndarray
    covariance: np.ndarray

    @property
    def at_samples(self) -> np.ndarray:
        """(samples, 3, 3), covariance at each sample that is used, see :class:`Windows`."""
        place = self.windows.since / (self.since[1] - self.since[0])
        k = np.clip(np.floor(place).astype(int), 0, self.since.size - 2)
        share = (place - k)[:, None, None]
        window = self.windows.sample_window
        return (1.0 - share) * self.covariance[window, k] + share * self.covariance[window, k + 1]

    def inside(self, residuals: np.ndarray, level: float) -> np.ndarray:
        """(samples, 2), whether position and heading lie within a band; not where a prediction diverges.

        Args:
            residuals: (samples, 3), measured minus predicted pose, see :meth:`Windows.residuals`.
            level: probability of the band: of an ellipse about the position, an interval of heading.
        """
        V = self.at_samples
        x, y, _ = residuals.T
        xx, xy, yy = V[:, 0, 0], V[:, 0, 1], V[:, 1, 1]
        with np.errstate(over="ignore", invalid="ignore"):
            squares, det = yy * x**2 - 2.0 * xy * x * y + xx * y**2, xx * yy - xy**2
            position = squares <= chdtri(2, 1.0 - level) * det
        heading = residuals[:, 2] ** 2 <= chdtri(1, 1.0 - level) * V[:, 2, 2]
        return np.column_stack([position, heading])

    def ellipses(self, window: int, level: float) -> np.ndarray:
        """(T, points, 2), closed lines about the predicted positions of a window [m].

        NaN where the prediction diverges.
        """
        around = np.linspace(0.0, 2.0 * np.pi)
        circle = np.sqrt(chdtri(2, 1.0 - level)) * np.column_stack([np.cos(around), np.sin(around)])
        V = self.covariance[window, :, :2, :2]
        known = np.asarray(np.isfinite(V).all(axis=(1, 2)))
        squares, axes = np.linalg.eigh(np.where(known[:, None, None], V, 0.0))
        lengths = np.where(known[:, None], np.sqrt(np.maximum(squares, 0.0)), np.nan)
        factor = axes * lengths[:, None, :]
        return self.predicted[window, :, None, :2] + circle @ np.swapaxes(factor, -1, -2)

    def headings(self, window: int, level: float) -> np.ndarray:
        """(2, T), lower and upper end of the band about the predicted heading of a window [rad].

        Half a turn to both sides is any heading.
        """
        reach = np.minimum(np.sqrt(chdtri(1, 1.0 - level) * self.covariance[window, :, 2, 2]), np.pi)
        return np.stack([-reach, reach]) + self.predicted[window, :, 2]

    def coverage(self, residuals: np.ndarray, level: float = LEVELS[1]) -> float:
        """Share of the samples, positions and headings alike, within a band; arguments as above."""
        return float(np.mean(self.inside(residuals, level)))


DataUse = Literal["train", "validate", "test"]


@dataclass(frozen=True, eq=False, repr=False)
class PredictionError(ShortRepr):
    """Errors of one model on one run.

    Attributes:
        omega: (K, 3), model error in each window of the weak form [N, N, N m].
        residuals: (samples, 3), measured minus predicted pose [m, m, rad] in the windows of prediction;
            empty if none has enough samples.
        errors: of those windows; None if none has enough samples.
    """

    omega: np.ndarray
    residuals: np.ndarray
    errors: WindowErrors | None

    @property
    def position(self) -> float:
        """Window prediction error [m]; NaN without a window."""
        return float("nan") if self.errors is None else float(self.errors.over_all()[0])

    @property
    def heading(self) -> float:
        """Window prediction error [rad]; NaN without a window."""
        return float("nan") if self.errors is None else float(self.errors.over_all()[1])

    @property
    def omega_rms(self) -> np.ndarray:
        """(3,), root mean square of the model error [N, N, N m]."""
        return np.sqrt(np.mean(self.omega**2, axis=0))


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(ShortRepr):
    """One run with the errors of the initial and of the learned model on it.

    Attributes:
        predictor: what predicts the run.
        weak_windows: the run, in windows of the weak form.
        windows: the run, in windows of prediction; None if none has enough samples.
        before, after: errors of the initial and of the learned model; the same object where nothing was
            learned.
        bands: about the predictions of the learned model; None if there are none.
        learned: the learned model; None where nothing was learned.
        use: what the data were used for.
        calibrated: errors of the calibrated model on a test run; None where that is not known.
    """

    predictor: Predictor
    weak_windows: WeakWindows
    windows: Windows | None
    before: PredictionError
    after: PredictionError
    bands: Bands | None = None
    learned: Model | None = None
    use: DataUse = "train"
    calibrated: WindowErrors | None = None

    @property
    def model(self) -> Model:
        """The initial model, or one that moves as the predictor does."""
        return self.predictor.model

    @property
    def held_out(self) -> bool:
        """Whether nothing was learned from the run, and nothing decided by it."""
        return self.use == "test"

    @cached_property
    def constant_velocities(self) -> WindowErrors | None:
        """Errors of a ship that keeps its velocities; None without a window."""
        return None if self.windows is None else self.windows.errors_at_constant_velocities()

    @property
    def smoothed(self) -> Smoothed:
        return self.weak_windows.smoothed

    @property
    def name(self) -> str:
        return self.weak_windows.run.name

    def free_runs(self, begin: float = -np.inf) -> tuple[np.ndarray, list[np.ndarray]]:
        """The run as it is predicted from one state, see :meth:`.predictor.Predictor.free_runs`."""
        return self.predictor.free_runs(self.smoothed, self.learned, begin)


def evaluate_run(
    w: WeakWindows, before: Model | Predictor, after: Model | None = None, held_out: bool = False
) -> Evaluation:
    """Evaluate one model, or two, on a run.

    Args:
        w: windows of the run.
        before: the initial model, or what else predicts the run.
        after: the learned model; None: nothing was learned.
        held_out: whether nothing was learned from the run.

    Raises:
        InputError: the predictor fails, or the run is shorter than its run-in.
    """
    predictor = DescribedShip(before) if isinstance(before, Model) else before
    return evaluate_runs([w], predictor, after, [held_out])[0]


def evaluate_runs(
    runs: Sequence[WeakWindows], predictor: Predictor, after: Model | None, held_out: Sequence[bool]
) -> list[Evaluation]:
    """Evaluate one model, or two, on some runs of one ship, which are predicted at once where that goes.

    Arguments and errors as of :func:`evaluate_run`, the first and the last one for each run.
    """
    learned = [] if after is None else [after]
    models = [predictor.model, *learned]
    windows = [predictor.windows([w.smoothed], w.horizon) for w in runs]
    found = []
    for w, own, held, missed in zip(
        runs, windows, held_out, _missed(runs, windows, predictor, learned), strict=True
    ):
        errors = [
            PredictionError(omega(w, model), off, own and own.summary(off))
            for model, off in zip(models, missed, strict=True)
        ]
        use: DataUse = "test" if held else "train"
        found.append(Evaluation(predictor, w, own, errors[0], errors[-1], None, after, use))
    return found


def _missed(
    runs: Sequence[WeakWindows],
    windows: Sequence[Windows | None],
    predictor: Predictor,
    learned: Sequence[Model],
) -> list[list[np.ndarray]]:
    """Of each run the residuals (samples, 3) of each model in its windows; empty where it has none."""
    none = [np.zeros((0, 3))] * (1 + len(learned))
    usable = [(w, own) for w, own in zip(runs, windows, strict=True) if own is not None]
    if not predictor.parametric or len(usable) < 2 or len({w.horizon for w in runs}) > 1:
        return [none if own is None else predictor.residuals(own, learned) for own in windows]
    together = predictor.windows([w.smoothed for w, _ in usable], runs[0].horizon)
    assert together is not None  # each of them has windows
    edges = np.cumsum([own.since.size for _, own in usable])[:-1]
    by_model = [np.split(off, edges) for off in predictor.residuals(together, learned)]
    each = iter([*zip(*by_model, strict=True)])
    return [none if own is None else [*next(each)] for own in windows]
