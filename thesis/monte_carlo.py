"""Variants of the shipped scenarios, run over many seeds in several processes; means with intervals."""

import copy
import json
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy import stats

import cosim
from cosim.dispatch import FinishedRun, analyse_runs
from cosim.errors import nearest

SCENARIOS = Path(__file__).parent.parent / "scenarios"

Content = dict[str, Any]
K = TypeVar("K", bound=Hashable)


def shipped(name: str) -> Content:
    """The content of ``scenarios/<name>.json``.

    Raises:
        InputError: there is no such scenario.
    """
    path = SCENARIOS / f"{name}.json"
    if not path.is_file():
        known = [p.stem for p in SCENARIOS.glob("*.json")]
        raise cosim.InputError(f"no scenario '{name}'{nearest(name, known)}")
    return json.loads(path.read_text(encoding="utf-8"))


def vary(
    content: Content,
    fmus: Mapping[str, str] | None = None,
    parameters: Mapping[str, float] | None = None,
    **keys: Any,
) -> Content:
    """A scenario with something else in it.

    Args:
        content: of a scenario; is not changed.
        fmus: instance -> FMU that takes its place; parameters of the one before go with it.
        parameters: ``instance.parameter`` -> value.
        keys: other keys of the scenario that are replaced, such as ``faults``, ``stop``, ``log``.

    Raises:
        InputError: a parameter of an instance that there is not.
    """
    varied = {**copy.deepcopy(content), **keys}
    for instance, path in (fmus or {}).items():
        varied["fmus"][instance] = {"path": path}
    for name, value in (parameters or {}).items():
        instance, _, parameter = name.partition(".")
        if instance not in varied["fmus"]:
            raise cosim.InputError(f"no instance for '{name}'{nearest(instance, varied['fmus'])}")
        varied["fmus"][instance].setdefault("parameters", {})[parameter] = value
    return varied


def without(faults: Sequence[Content], *kinds: str) -> list[Content]:
    """The faults that are of none of these kinds."""
    return [fault for fault in faults if fault["kind"] not in kinds]


def metrics(run: FinishedRun) -> dict[str, float]:
    """The metrics of a run that must have ended well.

    Raises:
        SimulationError: it did not.
    """
    run.demand()
    return run.metrics


def run_all(
    variants: Mapping[str, Content],
    seeds: Sequence[int],
    analyse: Callable[[FinishedRun], Any] = metrics,
    folder: Path | None = None,
    processes: int | None = None,
    advance: Callable[[], None] = lambda: None,
) -> dict[str, list[Any]]:
    """Run every variant with every seed.

    Args:
        variants: name -> content of a scenario.
        seeds: of noise and faults.
        analyse: function of a module (another process calls it) that takes the run, which may have
            failed, and returns the little that is kept.
        folder: keeps the logs in ``<folder>/<variant>/<seed>``; None keeps none.
        processes: how many runs at a time; None is one for each core.
        advance: called after each finished run.

    Returns:
        Variant -> what the analysis returned, in the order of the seeds.
    """
    wanted = dict.fromkeys(variants, seeds)
    return run_each(variants, wanted, analyse, folder, processes, advance)


def run_each(
    variants: Mapping[K, Content],
    seeds: Mapping[K, Sequence[int]],
    analyse: Callable[[FinishedRun], Any],
    folder: Path | None = None,
    processes: int | None = None,
    advance: Callable[[], None] = lambda: None,
) -> dict[K, list[Any]]:
    """Run every variant with seeds of its own; arguments as of :func:`run_all`."""
    jobs = [(name, seed) for name in variants for seed in seeds[name]]
    contents = [{**variants[name], "seed": seed} for name, seed in jobs]
    made = analyse_runs(
        contents,
        analyse,
        [folder / str(name) / str(seed) if folder else None for name, seed in jobs],
        processes,
        advance,
    )
    found: dict[K, list[Any]] = {name: [] for name in variants}
    for (name, _), value in zip(jobs, made, strict=True):
        found[name].append(value)
    return found


class SampleMean(NamedTuple):
    """A mean and the interval that holds the true one with 95 % confidence."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        if not all(map(math.isfinite, self)):
            return f"{self.mean:.3g}"
        return f"{self.mean:.3g} [{self.low:.3g}, {self.high:.3g}]"


def interval(values: Sequence[float]) -> SampleMean:
    """Mean of independent values with its Student t interval, which one value leaves open."""
    x = np.asarray(values, float)
    mean = float(x.mean())
    if x.size < 2 or not np.isfinite(x).all():
        return SampleMean(mean, -math.inf, math.inf)
    half = float(stats.t.ppf(0.975, x.size - 1) * x.std(ddof=1) / math.sqrt(x.size))
    return SampleMean(mean, mean - half, mean + half)


def paired(a: Sequence[float], b: Sequence[float]) -> SampleMean:
    """Interval of the mean of a - b, where both were run with the same seeds in the same order."""
    return interval(np.subtract(a, b).tolist())


def ratio(a: Sequence[float], b: Sequence[float]) -> SampleMean:
    """Interval of the geometric mean of a/b over the same seeds, for positive values."""
    logs = np.log(np.divide(a, b)).tolist()
    return SampleMean(*(math.exp(x) for x in interval(logs)))
