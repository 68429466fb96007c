"""What a trial has to work with: instances of one FMU, and ways to shake them."""

import math
import random
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from .api import ERROR, InstanceOnTrial, Library, StatusError
from .description import DescribedVariable, FmuDescription, flag, number, whole
from .registry import NotApplicableError

Row = list[Any]


class FmuOnTrial:
    """The FMU under trial.

    Args:
        description: of the FMU.
        folder: where it is unpacked.
        library: its loaded library.

    Attributes:
        start, step: start time [s] and communication step [s] of the default experiment.
    """

    def __init__(self, description: FmuDescription, folder: Path, library: Library) -> None:
        self.description = description
        self.folder = folder
        self.library = library
        self.start, self.step = description.time()
        self.instances: list[InstanceOnTrial] = []

    def needs(self, capability: str) -> None:
        """End the trial unless the FMU says that it can do this."""
        if not self.description.has(capability):
            raise NotApplicableError(f"{capability} is not declared")

    def instance(self) -> InstanceOnTrial:
        """A new instance, just instantiated."""
        if self.instances and self.description.has("canBeInstantiatedOnlyOncePerProcess"):
            raise NotApplicableError("canBeInstantiatedOnlyOncePerProcess is declared")
        resources = (self.folder / "resources").as_uri()
        guid = self.description.root.get("guid", "")
        name = f"instance_{len(self.instances)}"
        asynchronous = self.description.has("canRunAsynchronuously")  # the standard's spelling
        try:
            self.instances.append(InstanceOnTrial(self.library, name, guid, resources, asynchronous))
        except StatusError as refused:
            if self.description.has("needsExecutionTool"):
                raise NotApplicableError(f"needsExecutionTool is declared, and {refused}") from None
            raise
        return self.instances[-1]

    def initialising(self) -> InstanceOnTrial:
        """A new instance in initialisation mode."""
        made = self.instance()
        made.set_up(self.start)
        made.enter()
        return made

    def ready(self) -> InstanceOnTrial:
        """A new instance that waits for its first step."""
        made = self.initialising()
        made.exit()
        return made

    def advance(self, instance: InstanceOnTrial, k: int) -> None:
        """The communication step number ``k``."""
        instance.step(self.start + k * self.step, self.step)

    def given(self) -> list[DescribedVariable]:
        """What a master gives to the FMU: inputs and parameters."""
        return [v for v in self.description.variables if v.causality in ("input", "parameter")]

    def disturb(self, instance: InstanceOnTrial) -> None:
        """Change what may change between steps, inputs and tunable parameters; not to be stepped with,
        since no FMU must be able to do with just any values.
        """
        loose = [v for v in self.given() if v.variability != "fixed"]
        for v, value in zip(loose, instance.get(loose), strict=True):
            try:
                instance.set({v: other(v, value)})
            except NotApplicableError:
                continue
            except StatusError as refused:
                if refused.status != ERROR:
                    raise

    def play(self, instance: InstanceOnTrial, steps: int, seed: int, first: int = 0) -> list[Row]:
        """Outputs after each of some steps with inputs that depend on seed and number of the step.

        Args:
            instance: which to step.
            steps: how many.
            seed: of the inputs.
            first: number of the first step.
        """
        shaken = [v for v in self.description.inputs() if v.type == "Real"]
        outputs = self.description.outputs()
        rows = []
        for k in range(first, first + steps):
            rng = random.Random(f"{seed} {k}")
            instance.set({v: near(v, rng.uniform(-1.0, 1.0)) for v in shaken})
            self.advance(instance, k)
            rows.append(instance.get(outputs))
        return rows


def start_value(v: DescribedVariable) -> Any:
    """The start value that the description gives, as the API takes it; None if there is none."""
    if v.start is None:
        return None
    if v.type == "Real":
        return number(v.start)
    if v.type == "Boolean":
        return int(flag(v.start))
    return v.start.encode() if v.type == "String" else whole(v.start)


def near(v: DescribedVariable, share: float) -> float:
    """A value of a Real variable near its start, of the same sign, and inside its limits.

    Args:
        v: the variable.
        share: how far away, as a share (-1 to 1) of a tenth of its start, or its nominal for zero.
    """
    start = start_value(v) or 0.0
    size = abs(start) or abs(number(v.all.get("nominal")) or 1.0)
    low, high = v.limits
    value = start + 0.1 * share * size
    if not low <= value <= high:
        value = start - 0.1 * share * size
    return min(max(value, low), high)


def other(v: DescribedVariable, value: Any) -> Any:
    """A value of a variable that is not the one it has, if there is one; a String stays."""
    if v.type == "Real":
        changed = near(v, 1.0)
        return near(v, -0.5) if same(changed, value) else changed
    if v.type == "Boolean":
        return 1 - value
    if v.items:
        return next((item for item in v.items if item != value), value)
    if v.type == "Integer":
        return value + 1 if value < v.limits[1] else value - 1
    return value


def same(a: Any, b: Any) -> bool:
    """Whether two values are equal but for rounding."""
    if not isinstance(a, float):
        return a == b
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12) or (math.isnan(a) and math.isnan(b))


def unlike(names: Sequence[DescribedVariable], meant: Row, found: Row) -> Iterator[str]:
    """One text for each variable that is not what it is meant to be."""
    for v, a, b in zip(names, meant, found, strict=True):
        if not same(a, b):
            yield f"{v.name} is {b!r}, not {a!r}"


def differing(names: Sequence[DescribedVariable], rows: Sequence[Row], others: Sequence[Row]) -> str:
    """Names of the columns in which two runs differ, and where first; empty if they are the same."""
    found: dict[str, int] = {}
    for k, (row, other) in enumerate(zip(rows, others, strict=True)):
        for v, a, b in zip(names, row, other, strict=True):
            if not same(a, b):
                found.setdefault(v.name, k)
    shown = ", ".join(list(found)[:5]) + (f" and {len(found) - 5} more" if len(found) > 5 else "")
    return f"{shown} from step {min(found.values()) + 1} on" if found else ""
