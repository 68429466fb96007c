"""The current that explains most of the model error of a run."""

import numpy as np

from ..predictors import Model, WeakWindows, omega
from ..predictors.uncertainty import MEASURED
from ..runs.run_constants import STEPS

CURRENT = ("V_n", "V_e")  # parameters of a current to the north and to the east [m/s]


def usual_current(model: Model) -> float:
    """Deviation [m/s] of a current of the ship's size."""
    return MEASURED * model.ship.scale.speed


def in_further_current(model: Model) -> list[Model]:
    """A model in a current to the north, and to the east, that is larger by its deviation."""
    return [model.plus({name: usual_current(model)}) for name in CURRENT]


def in_likeliest_current(w: WeakWindows, model: Model, unit: np.ndarray) -> Model:
    """A model in the current with the least model error in a run, by Gauss and Newton.

    Args:
        w: windows of the run.
        model: to which a constant current is added.
        unit: (3,), in which the error of each axis counts [N, N, N m].
    """
    with np.errstate(all="ignore"):  # in a wrong unit forces may be beyond all numbers
        for _ in range(STEPS):
            e = omega(w, model)
            slopes = np.array([((omega(w, m) - e) / unit).ravel() for m in in_further_current(model)])
            if not np.isfinite(slopes).all():
                break
            steps = np.linalg.lstsq(slopes.T, -(e / unit).ravel(), rcond=None)[0]
            more = (usual_current(model) * steps).tolist()
            model = model.plus(dict(zip(CURRENT, more, strict=True)))
    return model
