"""Runs of an FMU with a hidden cause, made with FMPy, not with this project's master."""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from ctypes import c_double
from pathlib import Path

import numpy as np
import pandas as pd
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.model_description import ModelDescription

from .foreign_systems import ForeignSystem

NOISE, FACTOR = 0.01, 1.25  # of the output's spread; of a parameter that is off
PARAMETER, PHYSICS = ("parameter", "both"), ("physics", "both")  # causes


def measured(
    path: Path, s: ForeignSystem, values: dict[str, float], forced: bool, seed: int
) -> pd.DataFrame:
    """A run with noise.

    Args:
        path: of the FMU.
        s: the system.
        values: of its parameters.
        forced: whether the missing force acts.
        seed: of inputs, start and noise.
    """
    rng = np.random.default_rng(seed)
    held = rng.integers(15, 60, s.samples)
    steps = {n: np.repeat(rng.uniform(-1.0, 1.0, s.samples), held)[: s.samples] for n in s.inputs}
    inputs = {n: s.inputs_at_rest + s.inputs[n] * x for n, x in steps.items()}
    values = values | {n: rng.uniform(*ends) for n, ends in s.starts.items()}
    simulate = _by_rates if s.force.startswith("der(") else _by_steps
    clean = simulate(path, s, forced, values, inputs)
    noisy = clean + NOISE * clean.std() * rng.standard_normal(s.samples)
    return pd.DataFrame({"time": s.step * np.arange(s.samples), **inputs, s.output: noisy})


def truth(s: ForeignSystem, cause: str) -> dict[str, float]:
    """The true values of the parameters."""
    off = {s.off} if cause in PARAMETER else set()
    return {n: v * (FACTOR if n in off else 1.0) for n, (v, _) in s.parameters.items()}


@contextmanager
def _opened(
    path: Path, kind: type[FMU2Model] | type[FMU2Slave], values: Mapping[str, float]
) -> Iterator[tuple[FMU2Model | FMU2Slave, dict[str, int], ModelDescription]]:
    """An FMU in its initialization mode, its value references, and its description."""
    description = read_model_description(str(path), validate=False)
    mode = description.modelExchange if kind is FMU2Model else description.coSimulation
    assert mode is not None
    place = {v.name: v.valueReference for v in description.modelVariables}
    with tempfile.TemporaryDirectory() as folder:
        extract(str(path), folder)
        fmu = kind(
            guid=description.guid, unzipDirectory=folder, instanceName="truth",
            modelIdentifier=mode.modelIdentifier,
        )  # fmt: skip
        fmu.instantiate()
        # With another tolerance than its own an FMU is another model, by its solver's errors.
        own = description.defaultExperiment
        tolerance = None if own is None or own.tolerance is None else float(own.tolerance)
        fmu.setupExperiment(tolerance=tolerance, startTime=0.0)
        fmu.setReal([place[n] for n in values], [*values.values()])
        fmu.enterInitializationMode()
        yield fmu, place, description
        fmu.terminate()
        fmu.freeInstance()


def _own_step(description: ModelDescription, step: float) -> int:
    """How many steps of the FMU's own length there are between two samples."""
    suggested = description.defaultExperiment
    own = float(suggested.stepSize) if suggested is not None and suggested.stepSize else step
    return max(1, round(step / own))


def _by_steps(
    path: Path, s: ForeignSystem, forced: bool, values: dict[str, float], inputs: dict[str, np.ndarray]
) -> np.ndarray:
    """Output of a co-simulation, with the missing force on an input."""
    with _opened(path, FMU2Slave, values) as (fmu, place, description):
        assert isinstance(fmu, FMU2Slave)
        steps = _own_step(description, s.step)
        h, y, rest = s.step / steps, [], values.get(s.force, 0.0)

        def put(k: int) -> None:
            now = {n: float(x[k]) for n, x in inputs.items()}
            if forced:
                (at,) = fmu.getReal([place[s.lacks[0]]]) if s.lacks[0] else (1.0,)
                now[s.force] = now.get(s.force, rest) + s.missing(at)
            fmu.setReal([place[n] for n in now], [*now.values()])

        put(0)
        fmu.exitInitializationMode()
        for k in range(s.samples):
            y.append(fmu.getReal([place[s.output]])[0])
            for j in range(steps):
                put(k)
                fmu.doStep((k * steps + j) * h, h)
        return np.array(y)


def _by_rates(
    path: Path, s: ForeignSystem, forced: bool, values: dict[str, float], _: dict[str, np.ndarray]
) -> np.ndarray:
    """Output of the FMU's equations, with the missing force in a rate.

    By Euler's method and with events at the ends of steps, as the Reference FMUs do in a co-simulation.
    """
    with _opened(path, FMU2Model, values) as (fmu, place, description):
        assert isinstance(fmu, FMU2Model)
        fmu.exitInitializationMode()
        steps = _own_step(description, s.step)
        h, y, n = s.step / steps, [], description.numberOfContinuousStates
        rates = [getattr(u.variable, "derivative", None) for u in description.derivatives]
        states = [x.name for x in rates if x is not None]
        x, rate = (c_double * n)(), (c_double * n)()
        signs = (c_double * description.numberOfEventIndicators)()

        def indicated() -> list[bool]:
            fmu.getEventIndicators(signs, len(signs))
            return [z > 0.0 for z in signs]

        def settle() -> None:
            while fmu.newDiscreteStates()[0]:
                pass
            fmu.enterContinuousTimeMode()

        settle()
        before = indicated()
        for k in range(s.samples):
            y.append(fmu.getReal([place[s.output]])[0])
            for j in range(steps):
                fmu.getContinuousStates(x, n)
                fmu.getDerivatives(rate, n)
                if forced:
                    number = states.index(s.force[4:-1])
                    rate[number] += s.missing(x[states.index(s.lacks[0])])
                for i in range(n):
                    x[i] += h * rate[i]
                fmu.setTime((k * steps + j + 1) * h)
                fmu.setContinuousStates(x, n)
                if indicated() != before:
                    fmu.enterEventMode()
                    settle()
                before = indicated()
        return np.array(y)
