"""One run as it travels to whoever makes it, and what comes back."""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.metadata import version
from types import MappingProxyType
from typing import Any, NamedTuple

from ..scenario.schema import Scenario
from ..system.instance_pool import InstancePool
from .travelling_files import Files

# Keys of a scenario that change no number of a run; a ship does by its FMUs, which have hashes.
WITHOUT_EFFECT = ("name", "description", "log", "native", "ship")


class RunRow(NamedTuple):
    """What is kept of a run.

    Attributes:
        status: ``done``, ``failed``, or ``lost`` where it is not the run that failed, but what ran it.
        message: why it failed, or why there are no metrics; else empty.
        wall_s: how long it took [s].
        metrics: as in metrics.json; empty if there are none.
        log: name -> content of the files of its result folder, where those are kept.
        value: what an analysis has made of it, or the exception that came in place of it.
    """

    status: str
    message: str
    wall_s: float = 0.0
    metrics: Mapping[str, float] = {}
    log: Mapping[str, bytes] = {}
    value: Any = None


# Makes a run on the FMUs of a process; it is pickled on its way there.
Task = Callable[[InstancePool, Scenario], RunRow]


@cache
def own_version() -> str:
    """The version of this package, which takes a while to find."""
    return version("cybership")


class Job:
    """One run.

    Args:
        content: of its scenario, with the FMUs and tables named by the hashes of their contents.
        files: those names.
        task: makes the run.
        identities: what stands in the hash for those files whose content may differ with equal numbers.

    Attributes:
        hash: of all that its numbers follow from; equal runs have equal ones.
    """

    def __init__(
        self,
        content: dict[str, Any],
        files: Iterable[str],
        task: Task,
        identities: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.content = content
        self.files = tuple(files)
        self.task = task
        counted = {key: value for key, value in content.items() if key not in WITHOUT_EFFECT}
        counted["fmus"] = {
            name: entry | {"path": identities.get(entry["path"], entry["path"])}
            for name, entry in content["fmus"].items()
        }
        text = json.dumps([counted, own_version()], sort_keys=True)
        self.hash = hashlib.sha256(text.encode()).hexdigest()


def job_of(scenario: Scenario, files: Files, task: Task) -> Job:
    """What travels of a scenario.

    Raises:
        InputError: a file that cannot be read.
    """
    files.read([scenario])
    content = scenario.model_dump(mode="json", by_alias=True, exclude_unset=True)
    models = files.models(scenario)
    names: list[str] = []
    for name, entry in content["fmus"].items():
        entry["path"] = f"{models[name].sha256}.fmu"
        names.append(entry["path"])
        if entry.get("table") is not None:
            entry["table"] = files.table(scenario.folder, entry["table"])
            names.append(entry["table"])
    return Job(content, dict.fromkeys(names), task, files.identities)
