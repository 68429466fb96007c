"""The contents of a concurrent-learning controller's store at the end of a run.

A controller does not show its samples, so the run's estimates and targets are given to it once more, and
its state is looked at.
"""

import importlib
from typing import Any, NamedTuple

import numpy as np

from cosim.dispatch import FinishedRun
from fmus.declare import Component, packer, variables

from ..observers.estimates_replayed import Log, parameters

WITHIN = 1.0  # s after a spike in which an observer's estimate still shows it


class StoreContents(NamedTuple):
    """The share of a store that comes from spikes.

    Attributes:
        spikes: how many there were in the run.
        time: share of the time within a second after one.
        stored: share of the samples in the store at the end that were taken then.
        oldest: age of the oldest of these [s], 0 without any.
        gained: share of all the growth of sigma_min that happened then.
    """

    spikes: float
    time: float
    stored: float
    oldest: float
    gained: float


def controller(path: str) -> Component:
    """The component of ``controller_<name>.fmu``."""
    name = path.removeprefix("controller_").removesuffix(".fmu")
    return importlib.import_module(f"fmus.controller.{name}").COMPONENT


def logged(path: str) -> list[str]:
    """What must be logged, in every step, of a run with this controller."""
    inputs = [f"controller.{v.name}" for v in variables(controller(path).inputs)]
    return [*inputs, "observer.x_m", "controller.sigma_min"]


def replayed(component: Component, log: Log, values: dict[str, float]) -> tuple[np.ndarray, Any]:
    """sigma_min over time of a controller that gets its inputs from a log, and its last state."""
    p = parameters(component, values)
    pack = packer(component.inputs)
    rows = np.column_stack([log[f"controller.{v.name}"] for v in variables(component.inputs)]).tolist()
    h = float(np.median(np.diff(log["time"])))
    first: Any = pack(rows[0])
    state, out = component.step(component.init(first, p), first, p, 0.0)
    sigma = [out.learning.sigma_min]
    for row in rows[1:]:
        state, out = component.step(state, pack(row), p, h)
        sigma.append(out.learning.sigma_min)
    return np.array(sigma), state


def spike_times(log: Log) -> np.ndarray:
    """When a single sample of the measured north position stands out by about 0.1 m.

    The jump at the end of a freeze has one side only.
    """
    x, t = log["observer.x_m"], log["time"]
    before, after = x[1:-1] - x[:-2], x[1:-1] - x[2:]
    return t[1:-1][np.fmin(np.abs(before), np.abs(after)) * (before * after > 0.0) > 0.05]


def echo(times: np.ndarray, spikes: np.ndarray) -> np.ndarray:
    """Which of the times [s] lie within a second after a spike."""
    since = times[:, None] - spikes[None, :]
    return np.any((since >= 0.0) & (since < WITHIN), axis=1)


def store_contents(run: FinishedRun) -> StoreContents:
    """The contents of the store of a finished run.

    Raises:
        SimulationError: the run broke off.
    """
    run.demand()
    log = run.log
    entry = run.scenario["fmus"]["controller"]
    sigma, state = replayed(controller(entry["path"]), log, entry.get("parameters", {}))
    spikes = spike_times(log)
    taken = np.array([row.time for row in state.store.rows if row.filled > 0.5])
    growth = np.diff(sigma).clip(min=0.0)
    from_spikes = echo(taken, spikes)
    near = echo(log["time"][1:], spikes)
    return StoreContents(
        float(spikes.size),
        float(near.mean()),
        float(from_spikes.mean()),
        float((log["time"][-1] - taken[from_spikes]).max(initial=0.0)),
        float(growth[near].sum() / max(growth.sum(), 1e-300)),
    )
