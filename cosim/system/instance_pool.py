"""FMUs that serve several runs, so that each is read, unpacked and loaded once in a process.

Between two runs an instance is reset. FMI promises that fmi2Reset leaves it as instantiation does, but
nothing can prove that of an unknown FMU, which may keep numbers in global variables. So only FMUs that
are known to hold nothing outside of what a reset makes anew are kept; any other one is freed and
instantiated again, library included, as in a process that runs one scenario after the other.
"""

from collections import OrderedDict
from collections.abc import Collection
from pathlib import Path

from ..errors import SimulationError
from ..fmu.fmu_model import FmuModel
from ..fmu.instance import Instance, OnMessage
from ..fmu.isolation.isolated import IsolatedInstance
from ..fmu.local import LocalInstance
from ..process.run_state import STATE
from ..scenario.schema import FmuEntry, Scenario

# Instances that wait for another run; chosen: beyond what a comparison of controllers needs. The one
# that has waited longest is freed.
MOST_KEPT = 64


class InstancePool:
    """Instances for runs one after the other in this process.

    Args:
        resettable: SHA-256 of the FMUs whose instances may be reset for another run.
    """

    def __init__(self, resettable: Collection[str] = ()) -> None:
        self.resettable = set(resettable)
        self._models: dict[Path, FmuModel] = {}
        # By file and instance name, which an FMU knows from its instantiation on.
        self._waiting: OrderedDict[tuple[str, str], LocalInstance] = OrderedDict()

    def models(self, scenario: Scenario) -> dict[str, FmuModel]:
        """The FMU of each instance of a scenario whose paths are all files.

        Raises:
            InputError: no such FMU, or one that cannot be read.
        """
        paths = {name: scenario.folder / entry.path for name, entry in scenario.fmus.items()}
        for path in paths.values():
            if path not in self._models:
                self._models[path] = FmuModel(path)
        return {name: self._models[path] for name, path in paths.items()}

    def know(self, path: Path, model: FmuModel) -> None:
        """Take what has been read of the FMU elsewhere for that of a copy of its file."""
        if path not in self._models:
            self._models[path] = model.copied_to(path)

    def take(self, name: str, model: FmuModel, entry: FmuEntry, on_message: OnMessage) -> Instance:
        """An instance in the state after instantiation.

        Args:
            name: of the instance.
            model: what to run.
            entry: of the scenario: whether it has a process of its own.
            on_message: receives the messages that the FMU logs.

        Raises:
            InputError: no binary for this platform, or instantiation refused.
        """
        if entry.isolate:
            return IsolatedInstance(name, model, on_message, entry.timeout or STATE.timeout)
        waiting = self._waiting.pop((model.sha256, name), None)
        if waiting is not None:
            try:
                waiting.reset(on_message)
                return waiting
            except SimulationError:
                waiting.free()
        return LocalInstance(name, model, on_message)

    def give_back(self, instance: Instance) -> None:
        """Keep a terminated instance for another run, or free it."""
        key = (instance.model.sha256, instance.name)
        if (
            isinstance(instance, LocalInstance)
            and instance.sound
            and instance.model.sha256 in self.resettable
            and key not in self._waiting
        ):
            self._waiting[key] = instance
            if len(self._waiting) > MOST_KEPT:
                self._waiting.popitem(last=False)[1].free()
        else:
            instance.free()

    def close(self) -> None:
        """Free all that wait, and remove what was unpacked."""
        while self._waiting:
            self._waiting.popitem()[1].free()
        while self._models:
            self._models.popitem()[1].close()
