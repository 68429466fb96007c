"""A checked system: models, signals and connections, laid out for running."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import PurePath

from ..conversion import Conversion
from ..errors import InputError, nearest
from ..fmu.fmu_model import FmuModel, FmuVariable, Value
from ..formats.outline import AnnotatedOutline, AnnotatedTrial, CommandLimit, read_outline, read_trial
from ..scenario.schema import Scenario
from .recordings import Recorded


@dataclass(frozen=True)
class Signal:
    """A variable of an instance."""

    instance: str
    variable: FmuVariable

    @cached_property
    def name(self) -> str:
        """``instance.variable``."""
        return f"{self.instance}.{self.variable.name}"


@dataclass(frozen=True)
class Connection:
    """A checked connection, with the conversion of units that it needs."""

    source: Signal
    target: Signal
    conversion: Conversion


@dataclass
class System:
    """A checked system: what the master runs.

    Attributes:
        scenario: as read.
        models: FMU of each instance, by instance name.
        order: instances in the order of stepping.
        every: base steps in one step of each instance.
        steps: number of base steps.
        connections: all connections, groups resolved.
        recordings: what files give to the inputs of an instance, by instance.
        signals: signals of the value table, by name.
        logged: names of the logged signals, in the order of the log's columns.
        parameters: start values to set, by instance.
        warnings: oddities that are no reason to refuse.
    """

    scenario: Scenario
    models: dict[str, FmuModel]
    every: dict[str, int] = field(default_factory=dict)
    steps: int = 0
    order: list[str] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    recordings: dict[str, list[Recorded]] = field(default_factory=dict)
    signals: dict[str, Signal] = field(default_factory=dict)
    logged: list[str] = field(default_factory=list)
    parameters: dict[str, list[tuple[FmuVariable, Value]]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @property
    def fed(self) -> set[str]:
        """Names of the inputs that get values during the run, from outputs or files."""
        return self.recorded | {c.target.name for c in self.connections}

    @property
    def recorded(self) -> set[str]:
        """Names of the inputs that get values from files."""
        return {n for parts in self.recordings.values() for part in parts for n in part.names}

    @property
    def own(self) -> list[str]:
        """Instances of the project's own FMUs: those with a bare name, in the builder's folder."""
        entries, beside = self.scenario.fmus, self.scenario.folder
        return [
            n
            for n, model in self.models.items()
            if PurePath(path := entries[n].path).name == path and model.path != beside / path
        ]

    @property
    def native(self) -> bool | None:
        """Whether the project's own FMUs are compiled; None where there are none."""
        return self.models[self.own[0]].is_native if self.own else None

    @property
    def outline(self) -> AnnotatedOutline | None:
        """The ship to draw: that of the first FMU which says so."""
        outlines = (read_outline(model.annotations) for model in self.models.values())
        return next((outline for outline in outlines if outline is not None), None)

    @property
    def trial(self) -> AnnotatedTrial | None:
        """The manoeuvring trial that the first connected FMU which says so conducts."""
        sources = {c.source.instance for c in self.connections}
        orders = {n: m for n, m in self.models.items() if n in sources and "order" in m.variables}
        trials = (read_trial(m.annotations, n) for n, m in orders.items())
        return next((trial for trial in trials if trial is not None), None)

    @property
    def commands(self) -> dict[str, CommandLimit]:
        """Logged commands of actuators, with their limits."""
        return {name: limit for name, limit in self.limited.items() if name in self.logged}

    @property
    def limited(self) -> dict[str, CommandLimit]:
        """Commands of actuators, with their limits: of ``X`` these are ``X_max``, ``X_min``."""
        found = {}
        for part, model in self.models.items():
            numbers = {n: v.start for n, v in model.variables.items() if v.type == "Real" and v.start}
            numbers |= {v.name: value for v, value in self.parameters.get(part, ()) if v.type == "Real"}
            values = {n: float(x) for n, x in numbers.items() if n.endswith(("_max", "_min"))}
            for name, variable in model.variables.items():
                high = values.get(f"{name}_max")
                if high is not None and variable.causality in ("input", "output"):
                    low, unit = values.get(f"{name}_min", -high), variable.unit
                    found[f"{part}.{name}"] = CommandLimit(low, high, unit.name if unit else "")
        return found

    def close(self) -> None:
        """Remove the unpacked FMUs."""
        for model in set(self.models.values()):
            model.close()

    def find(self, name: str, where: str) -> Signal:
        """The variable behind ``instance.variable``.

        Raises:
            InputError: no such instance or variable.
        """
        instance, _, variable = name.partition(".")
        if instance not in self.models:
            raise InputError(f"{where}: no instance '{instance}'{nearest(instance, self.models)}")
        known = self.models[instance].variables
        if variable not in known:
            hint = nearest(variable, [f"{v}" for v in known])
            raise InputError(f"{where}: '{instance}' has no variable '{variable}'{hint}")
        return Signal(instance, known[variable])


def causality_of(signal: Signal) -> str:
    """The causality of a signal for messages: an input, a parameter."""
    causality = signal.variable.causality
    return f"an {causality}" if causality[0] in "aeiou" else f"a {causality}"
