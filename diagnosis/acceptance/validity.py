"""What the judged data cover: speeds, drift, rates and commands, by quantiles and extremes."""

from collections.abc import Mapping, Sequence

import numpy as np

from cosim import InputError
from cosim.errors import nearest

from ..predictors import at_samples
from ..predictors.evaluation import Evaluation
from ..runs import OF_UNIT, QUANTITY, Smoothed
from ..runs.columns.unit_check import SI_UNIT
from ..runs.run_constants import NEGLIGIBLE
from .criterion import MOTION, Criteria
from .predictions import Predictions

QUANTILES = {"least": 0.0, "q05": 0.05, "median": 0.5, "q95": 0.95, "greatest": 1.0}  # 1; by keys


def signals(smoothed: Smoothed) -> dict[str, np.ndarray]:
    """Signal -> its values (n,) at the samples of a run, SI; NaN where it is not known."""
    u, v, r = smoothed.nu.T
    speed = np.hypot(u, v)
    with np.errstate(invalid="ignore"):
        under_way = speed > NEGLIGIBLE * np.nanmax(speed)  # slower, it has no drift angle
    drift = np.where(under_way, np.arctan2(-v, u), np.nan)
    motion = {"u": u, "v": v, "r": r, "speed": speed, "drift": drift}
    known = {*motion, "x", "y", "psi"}
    return motion | {n: x for n, x in at_samples(smoothed).items() if n not in known}


def refuse_unknown_ranges(criteria: Criteria, runs: Sequence[Smoothed]) -> None:
    """Refuse criteria whose operating range names what no run has.

    Raises:
        InputError: with the nearest name.
    """
    known = {signal for run in runs for signal in signals(run)}
    for c in criteria.criteria:
        if unknown := next((signal for signal in c.operating_range if signal not in known), None):
            hint = nearest(unknown, sorted(known))
            raise InputError(f"criterion '{c.title}': operating_range: no run has '{unknown}'{hint}")


def unit_of(signal: str, evaluation: Evaluation) -> str:
    """SI unit of a signal of a run."""
    if signal in MOTION:
        return MOTION[signal]
    commands = evaluation.model.ship.commands
    quantity = OF_UNIT[commands[signal]] if signal in commands else QUANTITY.get(signal, "command")
    return SI_UNIT[quantity]


def window_means(p: Predictions) -> dict[str, np.ndarray]:
    """Signal -> its mean (w,) over each window that is judged; of none known NaN."""
    found = {}
    for name, values in signals(p.smoothed).items():
        known = np.isfinite(values)
        sums = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
        counts = np.concatenate([[0], np.cumsum(known)])
        n = counts[p.rows + 1] - counts[p.first]
        with np.errstate(invalid="ignore", divide="ignore"):
            found[name] = (sums[p.rows + 1] - sums[p.first]) / n
    return found


def covered(
    judged: Sequence[tuple[Predictions, np.ndarray]], evaluations: Mapping[str, Evaluation]
) -> list[dict[str, str | float]]:
    """Each signal over all samples that are used of windows that are judged.

    Args:
        judged: of each run its predictions, and a mask (w,) of the windows.
        evaluations: of the runs, by name.
    """
    found: dict[str, list[np.ndarray]] = {}
    units = {}
    for p, chosen in judged:
        smoothed, e = p.smoothed, evaluations[p.name]
        inside = np.zeros(smoothed.time.size, bool)
        for first, last in zip(p.first[chosen], p.rows[chosen], strict=True):
            inside[first : last + 1] = True
        for name, values in signals(smoothed).items():
            if (known := values[inside & smoothed.used & np.isfinite(values)]).size:
                found.setdefault(name, []).append(known)
                units[name] = unit_of(name, e)
    at = [*QUANTILES.values()]
    spread = {n: np.quantile(np.concatenate(parts), at).tolist() for n, parts in found.items()}
    return [
        {"signal": n, "unit": units[n], **dict(zip(QUANTILES, values, strict=True))}
        for n, values in spread.items()
    ]
