"""An FMU as FMPy opens it, with variables by name."""

import random
import zlib
from functools import cache
from pathlib import Path

import fmpy
from fmpy import fmi2
from fmpy.model_description import ModelDescription, read_model_description


@cache
def _described(path: Path, changed: int) -> ModelDescription:
    """The description of a file as it was at a time of change [ns]."""
    return read_model_description(str(path))


class Opened:
    """An FMU instance with variables by name.

    Args:
        path: of the FMU.
        folder: where it is unpacked; instances of one file share what is unpacked.
        name: of the instance.
    """

    def __init__(self, path: Path, folder: Path, name: str = "instance") -> None:
        self.messages: list[tuple[int, str]] = []
        # Files of one name that are not the same, such as two versions, lie in different folders.
        self.folder = folder / f"{path.stem}_{zlib.crc32(bytes(path))}"
        if not self.folder.exists():
            fmpy.extract(str(path), str(self.folder))
        d = _described(path, path.stat().st_mtime_ns)
        self.references = {v.name: v.valueReference for v in d.modelVariables}
        self.outputs = [v.name for v in d.modelVariables if v.causality == "output"]
        self.inputs = [v.name for v in d.modelVariables if v.causality == "input"]
        self.fmu = fmi2.FMU2Slave(
            instanceName=name,
            guid=d.guid,
            modelIdentifier=d.coSimulation.modelIdentifier,
            unzipDirectory=str(self.folder),
        )
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
            lambda env, instance, status, category, text: self.messages.append((status, text.decode()))
        )
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self.fmu.instantiate(callbacks=callbacks, loggingOn=True)

    def initialise(self, **values):
        self.fmu.setupExperiment(startTime=0.0)
        self.set(**values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        self.fmu.setReal([self.references[k] for k in values], list(values.values()))

    def get(self, *names):
        return self.fmu.getReal([self.references[n] for n in names or self.outputs])

    def step(self, t, h=0.01):
        return self.fmu.doStep(t, h)

    def play(self, seed, steps=20):
        """Outputs after each of some steps with random inputs."""
        rng, rows = random.Random(seed), []
        for k in range(steps):
            self.set(**{name: rng.uniform(-0.5, 0.5) for name in self.inputs})
            self.step(k * 0.01)
            rows.append(self.get())
        return rows

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
