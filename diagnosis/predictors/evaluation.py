"""Evaluation of a model on a measured run, before and after something was learned."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim import InputError

from ..runs import Smoothed
from .bands import Bands
from .ship_model import Model
from .weak_form import WeakWindows, omega
from .windows import WindowErrors, Windows, free_runs


@dataclass(frozen=True, eq=False)
class PredictionError:
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


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One run with the errors of the initial and of the learned model on it.

    Attributes:
        model: the initial model.
        weak_windows: the run, in windows of the weak form.
        windows: the run, in windows of prediction; None if none has enough samples.
        held_out: whether nothing was learned from it, and nothing decided by it.
        before, after: errors of the initial and of the learned model; the same object where nothing was
            learned.
        bands: about the predictions of the learned model; None if there are none.
        learned: the learned model; None where nothing was learned.
        foreign: how an FMU predicts the run from a time on, in place of the model; None: it is no FMU.
        use: what the data were used for, ``train``, ``validate`` or ``test``; by default the last if the
            run is held out, else the first.
    """

    model: Model
    weak_windows: WeakWindows
    windows: Windows | None
    held_out: bool
    before: PredictionError
    after: PredictionError
    bands: Bands | None = None
    learned: Model | None = None
    foreign: Callable[[float], tuple[np.ndarray, np.ndarray]] | None = None
    use: str = ""

    def __post_init__(self) -> None:
        if not self.use:
            object.__setattr__(self, "use", "test" if self.held_out else "train")

    @property
    def smoothed(self) -> Smoothed:
        return self.weak_windows.smoothed

    @property
    def name(self) -> str:
        return self.weak_windows.run.name

    def free_runs(self, begin: float = -np.inf) -> tuple[np.ndarray, list[np.ndarray]]:
        """The run as it is predicted from one state, see :func:`.windows.free_runs`.

        Args:
            begin: the state is that of the last sample before [s], else of the first there is.

        Returns:
            Times (n,) [s], and the pose (n, 3) [m, m, rad] by the initial and by the learned model.
        """
        if self.foreign is not None:
            time, pose = self.foreign(begin)
            return time, [pose, pose]
        models = [self.model, self.learned or self.model]
        return free_runs(self.smoothed, models, begin)


def evaluate_run(
    w: WeakWindows, before: Model, after: Model | None = None, held_out: bool = False
) -> Evaluation:
    """Evaluate one model, or two, on a run.

    Args:
        w: windows of the run.
        before: the initial model.
        after: the learned model; None: nothing was learned.
        held_out: whether nothing was learned from the run.
    """
    windows = _windows([w.smoothed], w.horizon)
    models = [before] if after is None else [before, after]
    errors = _prediction_errors(w, windows, [m.during(w.run.name) for m in models])
    return Evaluation(before, w, windows, held_out, errors[0], errors[-1], learned=after)


def _windows(runs: Sequence[Smoothed], length: float) -> Windows | None:
    try:
        return Windows(runs, length)
    except InputError:
        return None


def _prediction_errors(
    w: WeakWindows, windows: Windows | None, models: Sequence[Model]
) -> list[PredictionError]:
    if windows is None:
        return [PredictionError(omega(w, model), np.zeros((0, 3)), None) for model in models]
    return [
        PredictionError(omega(w, model), residuals, windows.summary(residuals))
        for model, residuals in zip(models, windows.residuals_of_each(models), strict=True)
    ]
