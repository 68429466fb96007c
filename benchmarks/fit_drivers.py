"""Gauss-Newton steps of the project beside ``scipy.optimize.least_squares``, on the two costly fits.

Both drivers get the same residuals, slopes and prior and begin at the same values: a candidate for a
hidden drag (``refinement``), and the drag with all nominal coefficients fitted to predictions
(``prediction``). In the latter the weights follow from the residuals: least_squares holds them, and is
called again until the cost stays. The table has how often residuals and slopes are computed until a step
promises no more than the tolerance, processor time relative to Gauss-Newton, and the cost above the
least of the three.
"""

import argparse
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

import diagnosis
from diagnosis.predictors import Model, WeakWindows
from diagnosis.search.candidates import model_error
from diagnosis.search.gram import noise
from diagnosis.search.most_likely import ENOUGH, most_likely
from diagnosis.search.prediction_fit.fit import PredictionFit, fit_to, shootings, whitened
from diagnosis.search.prior import MEASURED, NominalPrior
from diagnosis.search.refinement import (
    CandidateStart,
    RefinedModel,
    Refinement,
    TrainingSet,
    nuisance_of,
)

from .learning_time import simulated

EFFECT = "delta_X_u"  # hidden in the runs
FLOOR = np.array([1e-3, 1e-3, 3e-4])  # N, N, N m
DRIVERS = ("Gauss-Newton", "trf", "lm")
PASSES = 6  # of least_squares, the weights found anew before each


class Tally(NamedTuple):
    """What a driver took: calls of residuals and slopes, seconds; and the cost that it reached."""

    residuals: int
    slopes: int
    seconds: float
    cost: float


def root(P: np.ndarray) -> np.ndarray:
    """L with L^T L = P, of a positive semidefinite matrix (q, q)."""
    size, axes = np.linalg.eigh(P)
    return np.sqrt(np.maximum(size, 0.0))[:, None] * axes.T


def scipy_fit(residual: Callable[[np.ndarray], np.ndarray], slopes: Any, x: np.ndarray, by: str) -> Any:
    """least_squares to the tolerance of the cost at which the project's steps end."""
    least = float(np.sum(residual(x) ** 2))
    return least_squares(residual, x, slopes, method=by, x_scale="jac", ftol=ENOUGH / least)


def refinement(runs: Sequence[WeakWindows], driver: str) -> Tally:
    """The candidate refined along with all nominal coefficients, on the model error."""
    model, count = Model(), Counter[str]()
    prior, at = (p := NominalPrior.of(model, None, MEASURED)), RefinedModel.at(model, p)
    base = model_error(runs, model)
    nuisance = nuisance_of(TrainingSet(runs, None, prior), at, base)
    t = TrainingSet(runs, noise(base, nuisance.columns, FLOOR), prior)
    problem = Refinement(t, at, nuisance, CandidateStart({EFFECT: 0.0}, [EFFECT], np.zeros((1, 1))))
    begun, begin, L = time.process_time(), problem.begin(), root(problem.precision)
    first = problem.theta(begin.estimate)

    def reached(x: np.ndarray) -> Any:
        count["residuals"] += 1
        return problem.moved(begin, x - first)

    def residual(x: np.ndarray) -> np.ndarray:
        return np.append((reached(x).left * t.weight).ravel(), L @ x)

    def slopes(x: np.ndarray) -> np.ndarray:
        count["slopes"] += 1
        columns = problem.about(problem.moved(begin, x - first)).columns
        return np.concatenate([-problem.rows(columns), L])

    def about(r: Any) -> Any:
        count["slopes"] += 1
        return problem.about(r)

    def moved(r: Any, step: np.ndarray) -> Any:
        count["residuals"] += 1
        return problem.moved(r, step)

    if driver == DRIVERS[0]:
        cost = most_likely(begin, about, moved)[0].cost
    else:
        cost = problem.moved(begin, scipy_fit(residual, slopes, first, driver).x - first).cost
    return Tally(count["residuals"], count["slopes"], time.process_time() - begun, cost)


def prediction(runs: Sequence[WeakWindows], driver: str) -> Tally:
    """The drag and all nominal coefficients, fitted to predictions."""
    model, count = Model(), Counter[str]()
    prior = NominalPrior.of(model)
    at = RefinedModel(model, np.zeros(prior.size), {EFFECT: 0.0}, np.zeros((1, 1)))
    problem = PredictionFit(runs, shootings(runs, model), at, prior)
    L, first, begun = root(problem.precision), problem.theta(at), time.process_time()
    if driver == DRIVERS[0]:
        cost, information = problem.cost, problem.information

        def counted_cost(*given: Any) -> float:
            count["residuals"] += 1
            return cost(*given)

        def counted_information(at: RefinedModel) -> Any:
            count["slopes"] += 1
            return information(at)

        problem.cost, problem.information = counted_cost, counted_information  # pyright: ignore
        found = fit_to(problem, at).estimate
        problem.cost, problem.information = cost, information
    else:
        found, before = at, np.inf
        for _ in range(PASSES):
            count["slopes"] += 1
            known: Any = problem.information(found)
            share = np.sqrt(known.power(problem.precision) / len(problem.windows))

            def weighed(x: np.ndarray, share: Any = share, known: Any = known) -> np.ndarray:
                count["residuals"] += 1
                there = problem.moved(at, x - first).model(prior)
                pairs = zip(known.weights, problem.windows, strict=True)
                parts = [whitened(W, s.residuals(there)).ravel() for W, s in pairs]
                return np.concatenate([share * np.nan_to_num(p) for p in parts] + [L @ x])

            def sloped(x: np.ndarray, share: Any = share, known: Any = known) -> np.ndarray:
                count["slopes"] += 1
                there = problem.moved(at, x - first).model(prior)
                pairs = zip(known.weights, problem.windows, strict=True)
                parts = [whitened(W, problem.around(s, there).slopes) for W, s in pairs]
                return np.concatenate([*(-share * p.reshape(-1, x.size) for p in parts), L])

            fit = scipy_fit(weighed, sloped, problem.theta(found), driver)
            found = problem.moved(at, fit.x - first)
            if before - 2.0 * fit.cost < ENOUGH:
                break
            before = 2.0 * fit.cost
    seconds = time.process_time() - begun
    known = problem.information(found)
    cost_there = problem.cost(found, known.weights, known.power(problem.precision))
    return Tally(count["residuals"], count["slopes"], seconds, cost_there)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.fit_drivers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("runs", nargs="*", help="measured runs (three simulated ones)")
    options = parser.parse_args()
    with TemporaryDirectory() as folder:
        runs = diagnosis.load(options.runs or simulated(Path(folder)))
    print("| fit | driver | residuals | slopes | time | cost |")
    print("|---|---|--:|--:|--:|--:|")
    for fit in (refinement, prediction):
        tallies = {}
        for driver in DRIVERS:
            for w in runs:
                w.memory.clear()
            tallies[driver] = fit(runs, driver)
        least = min(t.cost for t in tallies.values())
        base = tallies[DRIVERS[0]].seconds
        for driver, t in tallies.items():
            print(
                f"| {fit.__name__} | {driver} | {t.residuals} | {t.slopes} | {t.seconds / base:.1f} "
                f"| +{t.cost - least:.2f} |"
            )


if __name__ == "__main__":
    main()
