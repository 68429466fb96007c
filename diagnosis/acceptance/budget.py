"""The uncertainty of a comparison, by its sources.

As in ASME V&V 20, u_val^2 = u_num^2 + u_input^2 + u_D^2. Each is a standard
uncertainty of the judged quantity at the judged horizon, the RMS over windows. What goes into a
prediction is changed by one standard deviation at a time (of parameters: along the principal axes of
their covariance), and the changes of the prediction are added in quadrature. All in SI.

u_num is the error that Richardson's extrapolation from steps h, h/2 and h/4 leaves to those of h, with
the order of convergence that these show (ASME V&V 20, section 2); where they show none, it is not known.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import hypot, isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from cosim import InputError
from cosim.campaign import Posterior, read_posterior

from ..predictors import Model
from ..predictors.shooting import Shooting
from ..runs import Fingerprint, body_velocity, fingerprints
from ..runs.run_constants import DIGITS
from ..search.prediction_fit.disturbance import ForceDisturbance, covariance
from .criterion import JUDGED, InputStd
from .predictions import Predictions, difference, judged

# Parameters of the effects current and earth_force.
CURRENT, WIND = ("V_n", "V_e"), ("F_n", "F_e")
# 1, order of convergence below which there is none; chosen, an explicit Euler method has 1
SLOWEST = 0.5
# 1, order above which halving did not act on each step; chosen, the method of Runge and Kutta has 4
HIGHEST = 5.0
Variances = Mapping[str, np.ndarray]  # quantity -> variance in each window (w,)
# Source, as a field of Budget -> variances of the predictions, or why they are not known.
Sources = Mapping[str, Variances | str]


class Learned(NamedTuple):
    """What a diagnosis knows of the model that it made.

    Attributes:
        posterior: of its parameters; None where nothing was fitted.
        disturbance: the force that no command and no effect explains.
        files: that it was read from.
        learned_from: runs of which it was made.
    """

    posterior: Posterior | None
    disturbance: ForceDisturbance
    files: tuple[Path, ...]
    learned_from: tuple[Fingerprint, ...] = ()

    def is_of(self, model: Model) -> bool:
        """Whether a model has the values that the posterior is about."""
        if self.posterior is None:
            return True
        p, known = self.posterior, model.values
        names = [name.partition(".")[2] for name in p.names]
        values = np.array([model.value(n) if "@" in n or n in known else np.nan for n in names])
        reach = DIGITS * np.maximum(p.std, np.abs(p.mean))
        return bool(np.all(np.abs(values - p.mean) <= reach))


def read_learned(folder: str | Path) -> Learned:
    """What the result folder of ``diagnosis.learn`` knows.

    Raises:
        InputError: it is none.
    """
    path, other = Path(folder) / "diagnosis.json", Path(folder) / "posterior.json"
    try:
        stated = json.loads(path.read_text(encoding="utf-8"))["unrecorded"]
        size, time = (np.array(stated[key], float).reshape(3) for key in ("size", "time"))
        rest = json.loads(other.read_text(encoding="utf-8")) if other.exists() else {"names": []}
        some, learned_from = rest["names"], fingerprints(rest.get("learned_from", []), other)
    except OSError as error:
        raise InputError(f"'{error.filename}' cannot be read: {error.strerror or error}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(
            f"'{folder}' does not state the disturbance that 'learn' has estimated"
        ) from None
    if not (np.isfinite([size, time]).all() and (size >= 0.0).all() and (time > 0.0).all()):
        raise InputError(f"'{path}': the disturbance has no size and no correlation time")
    posterior = read_posterior(other) if some else None
    files = (path, *([other] if other.exists() else []))
    return Learned(posterior, ForceDisturbance(size, time), files, learned_from)


class Budget(NamedTuple):
    """Standard uncertainties of one quantity, SI; None: not known. Combined ones hold what is known.

    Attributes:
        measurement: of what a prediction is compared with (u_D).
        initial_state, parameters, process_noise, current, wind: of what goes into it (u_input).
        numerical: of the steps (u_num).
    """

    measurement: float | None
    initial_state: float | None
    parameters: float | None
    process_noise: float | None
    current: float | None
    wind: float | None
    numerical: float | None

    @property
    def u_D(self) -> float:
        return self.measurement or 0.0

    @property
    def u_input(self) -> float:
        return combined(self.initial_state, self.parameters, self.process_noise, self.current, self.wind)

    @property
    def u_num(self) -> float:
        return self.numerical or 0.0

    @property
    def u_val(self) -> float:
        return combined(self.u_num, self.u_input, self.u_D)

    @property
    def unknown(self) -> list[str]:
        """The sources that are not known."""
        return [name.replace("_", " ") for name, u in self._asdict().items() if u is None]


def combined(*parts: float | None) -> float:
    """Root of the sum of squares of independent standard uncertainties; unknown ones are left out."""
    return hypot(*(u for u in parts if u is not None))


def budget(quantity: str, sources: Sequence[Sources], counted: list[np.ndarray]) -> Budget:
    """The budget of a quantity over the windows of some runs that count, of each a mask (w,)."""

    def over_runs(name: str) -> float | None:
        found = []
        for s, rows in zip(sources, counted, strict=True):
            variances = s[name]
            if isinstance(variances, str) or quantity not in variances:
                return None
            found.append(variances[quantity][rows])
        u = float(np.sqrt(np.mean(np.concatenate(found)))) if found else np.nan
        return u if isfinite(u) else None

    return Budget(*(over_runs(name) for name in Budget._fields))


def sources_of(p: Predictions, learned: Learned | None, acting: InputStd | None = None) -> Sources:
    """The uncertainty of a run's predictions, by source; ``acting``: that of current and wind."""
    base = p.motion
    parts: dict[str, Callable[[], Variances]] = {
        "measurement": lambda: _measurement(p),
        "initial_state": lambda: _initial(p, base),
        "parameters": lambda: _parameters(p, base, learned),
        "process_noise": lambda: _process_noise(p, learned),
        "current": lambda: _acting(p, base, CURRENT, acting and acting.current),
        "wind": lambda: _acting(p, base, WIND, acting and acting.wind),
        "numerical": lambda: _numerical(p, base),
    }
    found: dict[str, Variances | str] = {}
    for name, of in parts.items():
        try:
            found[name] = of()
        except InputError as error:
            found[name] = str(error)
    return found


def _squares(*changes: np.ndarray) -> dict[str, np.ndarray]:
    """Variance of each quantity by independent changes (w, 6) of one standard deviation."""
    zero = np.zeros(len(changes[0])) if changes else np.zeros(0)
    return {q: sum((judged(q, c) ** 2 for c in changes), zero) for q in JUDGED}


def _measurement(p: Predictions) -> Variances:
    """Noise of the pose's samples; of the velocity the smoother's standard deviation."""
    x, y, psi = np.broadcast_to(p.smoothed.noise**2, (p.rows.size, 3)).T
    u, v, r = p.smoothed.nu_std[p.rows].T ** 2
    return {"position": x + y, "heading": psi, "u": u, "v": v, "r": r}


def _initial(p: Predictions, base: np.ndarray) -> Variances:
    """By the smoother's standard deviation of each part of pose and rates, as if independent."""
    if p.predictor.whole:
        raise InputError(
            f"the velocity of {p.predictor.name} cannot be set: the error of its initial state is "
            "part of the judged error"
        )
    s, states = p.smoothed, []
    for name in ("eta", "eta_dot"):
        value, std = getattr(s, name), np.nan_to_num(getattr(s, f"{name}_std"))
        for k in range(3):
            moved = value.copy()
            moved[:, k] += std[:, k]
            other = replace(s, **{name: moved})
            states.append(replace(other, nu=body_velocity(other.eta[:, 2], other.eta_dot)))
    return _squares(*(difference(m, base) for m in p.from_others(states)))


def _parameters(p: Predictions, base: np.ndarray, learned: Learned | None) -> Variances:
    if not p.predictor.parametric:
        raise InputError(f"the uncertainty of the parameters of {p.predictor.name} is not known")
    if learned is None or learned.posterior is None:
        raise InputError("no posterior was given (--learned)")
    names = [name.partition(".")[2] for name in learned.posterior.names]
    variances, axes = eigh(np.array(learned.posterior.covariance))
    steps = (axes * np.sqrt(np.maximum(variances, 0.0))).T
    models = [p.model.plus(dict(zip(names, step.tolist(), strict=True))) for step in steps if step.any()]
    return _squares(np.zeros_like(base), *(difference(m, base) for m in p.motions(models)))


def _acting(p: Predictions, base: np.ndarray, names: Sequence[str], std: float | None) -> Variances:
    """By what acts from north and from east, each by its standard deviation."""
    if std is None:
        raise InputError("the criteria do not state it (input_std)")
    return _squares(*(difference(p.with_addition({name: std}), base) for name in names))


def _numerical(p: Predictions, base: np.ndarray) -> Variances:
    """By two halvings of the step; of a quantity that they do not let converge nothing."""
    half, quarter = p.finer(2), p.finer(4)
    first, second = difference(base, half), difference(half, quarter)
    moved = difference(base, np.pad(p.smoothed.eta[p.first], ((0, 0), (0, 3))))
    found: dict[str, np.ndarray] = {}
    for q in JUDGED:
        d, d_2, size = (judged(q, x) for x in (first, second, moved))
        with np.errstate(invalid="ignore", over="ignore"):
            one, two, all_ = (float(np.sqrt(np.mean(x**2))) for x in (d, d_2, size))
        if one <= DIGITS * all_:
            if p.predictor.parametric:
                found[q] = d**2
        elif isfinite(one) and two * 2.0**SLOWEST <= one <= two * 2.0**HIGHEST + DIGITS * all_:
            found[q] = (d * one / (one - two)) ** 2
    if not found:
        raise InputError(
            f"the predictions of {p.predictor.name} do not converge if the step is halved: the "
            "model has a step of its own, or reacts to it"
        )
    return found


def _process_noise(p: Predictions, learned: Learned | None) -> Variances:
    """By the unrecorded force, about the motion of the predictor's model."""
    if p.predictor.whole:
        raise InputError(f"the velocity of {p.predictor.name} cannot be set")
    if learned is None:
        raise InputError("no diagnosis states the disturbance (--learned)")
    shots = Shooting([p.smoothed], p.windows.length)
    motion = shots.around(p.model, {}).motion
    later = covariance(motion, np.zeros_like(shots.at_start), learned.disturbance)[:, -1, :, -1]
    x, y, psi = later[np.searchsorted(shots.start, p.start - 1e-6)].diagonal(axis1=1, axis2=2).T
    return {"position": x + y, "heading": psi}
