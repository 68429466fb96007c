"""The values with which runs are predicted of which nothing was learned, where values differ by run."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from ...predictors import Model
from ...runs.run_constants import CHANCE
from ..refinement import timed
from .joint_posterior import JointPosterior


class OtherRuns(NamedTuple):
    """What is known of a parameter in a run of which nothing was learned.

    Attributes:
        name: of the parameter.
        addition: most likely difference to the value that holds in all runs.
        variance: of this difference.
    """

    name: str
    addition: float
    variance: float


def shrunk_mean(values: np.ndarray) -> float:
    """The mean of values (k,) of single runs, shrunk towards zero by what of it is chance.

    It has the variance s^2 / k, with s^2 that of the values: in proportion to the square of the mean, so
    much of it is chance (positive-part estimator of James and Stein, Proc. 4th Berkeley Symp. 1, 1961).
    """
    mean, variance = float(values.mean()), float(values.var(ddof=1)) / values.size
    return mean - variance / mean if mean * mean > variance else 0.0


def has_a_side(values: np.ndarray) -> bool:
    """Whether the mean of values (k,) of single runs differs from zero by more than chance."""
    error = float(values.std(ddof=1)) / np.sqrt(values.size)
    return abs(float(values.mean())) > error * float(stdtrit(values.size - 1, 1.0 - 0.5 * CHANCE))


def differing_by_run(model: Model) -> Iterator[OtherRuns]:
    """The parameters with values of several runs, but times within a run, which no other run has.

    Weather has no usual side, unless the values show one: where the means of all its components may be
    zero, by Student's t, they are.
    """
    weather = [e for e in model.ship.effects.values() if e.kind == "environment"]
    of_runs: dict[str, np.ndarray] = {}
    for name in dict.fromkeys(n for values in model.runs.values() for n in values):
        own = [of_run[name] for of_run in model.runs.values() if name in of_run]
        if timed(model.ship, name) is None and len(own) > 1:
            of_runs[name] = np.array(own) - model.value(name)
    sided = {n for n, values in of_runs.items() if has_a_side(values)}
    for name, values in of_runs.items():
        of_weather = [e for e in weather if name in e.coefficients]
        expected = not of_weather or any(sided.intersection(e.coefficients) for e in of_weather)
        mean = shrunk_mean(values) if expected else 0.0
        variance = float(np.square(values - mean).sum()) / (values.size - 1)
        yield OtherRuns(name, mean, variance)


def with_other_runs(model: Model, posterior: JointPosterior) -> tuple[Model, JointPosterior]:
    """A model with values for other runs where its own differ by run, and the posterior with these.

    The runs that have values keep them.
    """
    names, units, mean = [*posterior.names], [*posterior.units], [*posterior.mean.tolist()]
    covariance = posterior.covariance
    for other in differing_by_run(model):
        name = f"{model.owner(other.name)}.{other.name}"
        value = model.value(other.name) + other.addition
        model = replace(model.plus({other.name: other.addition}), origin=model.origin)
        if name not in names:
            names.append(name)
            units.append(model.declared(other.name).unit)
            mean.append(value)
            covariance = np.pad(covariance, (0, 1))
        k = names.index(name)
        mean[k] = value
        covariance = covariance.copy()
        covariance[k, k] += other.variance
    return model, JointPosterior(names, units, np.array(mean), covariance)
