"""A component's functions as recordings: the initial state, what follows from parameters, a step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import is_
from typing import Any, TypeVar, cast

from ..declare import Component, flatten, packer, rebuild, width
from ..fmi.trace import Operand, TraceError
from ..ops import Number
from .tape import Kernels, RecordedFunction, RecordedValue, Tape, is_condition, like

T = TypeVar("T", bound=tuple[object, ...])
# What a function does, and (array, the results that it gets), together all results.
Written = tuple[RecordedFunction, Sequence[tuple[str, Sequence[Operand]]]]


@dataclass(frozen=True, eq=False)
class Program:
    """What a component computes.

    Attributes:
        component: the declaration.
        init: of ``params`` and ``inputs``: the state.
        prepare: of ``params``: what a step needs of them.
        step: of ``params``, ``prepared``, ``inputs``, ``state`` and ``h``: state and outputs.
        kernels: that these call, each after those that it calls itself.
        states: how many scalars the state has.
    """

    component: Component
    init: RecordedFunction
    prepare: RecordedFunction
    step: RecordedFunction
    kernels: list[RecordedFunction]
    states: int

    @property
    def written(self) -> dict[str, Written]:
        """The functions, with the arrays that they write."""
        after, outputs = self.step.results[: self.states], self.step.results[self.states :]
        return {
            "prepare": (self.prepare, [("prepared", self.prepare.results)]),
            "init": (self.init, [("state", self.init.results)]),
            "step": (self.step, [("after", after), ("outputs", outputs)]),
        }


def program(component: Component) -> Program:
    """Record a component.

    Raises:
        TraceError: it does with a value what can be done with a number only.
    """
    try:
        return _recorded(component)
    except TraceError as error:
        raise TraceError(f"{component.name} cannot be compiled: {error}") from error


def _recorded(component: Component) -> Program:
    kernels = Kernels()
    tape = Tape(kernels)
    initial = component.init(_group(tape, component.inputs, "inputs"), _params(tape, component))
    init = tape.recording(flatten(initial))

    tape = Tape(kernels)
    prepared = component.prepared(_params(tape, component))
    kept: dict[int, RecordedValue] = {}  # the values that a step needs, each once

    def keep(x: RecordedValue) -> RecordedValue:
        return x if x.operation == "variable" else kept.setdefault(id(x), x)  # a parameter is at hand

    _mapped(prepared, keep)
    prepare = tape.recording([*kept.values()])
    places = {identity: k for k, identity in enumerate(kept)}

    tape = Tape(kernels)

    def seen(x: RecordedValue) -> RecordedValue:
        """A value of ``prepare`` as a step finds it."""
        if x.operation == "variable":
            return tape.variable(x.args[0])
        return tape.variable(f"prepared[{places[id(x)]}]", is_condition(x))

    states = len(init.results)
    state, outputs = component.law(
        rebuild(initial, [tape.variable(f"state[{k}]") for k in range(states)]),
        _group(tape, component.inputs, "inputs"),
        _mapped(prepared, seen),
        cast(Number, tape.variable("h")),
    )
    after, given = flatten(state), flatten(outputs)
    if len(after) != states or len(given) != width(component.outputs):
        raise TraceError("a step does not give as many numbers as are declared")
    return Program(component, init, prepare, tape.recording(after + given), kernels.recordings, states)


def _group(tape: Tape, cls: type[T], name: str) -> T:
    """A declared group of variables."""
    return packer(cls)([tape.variable(f"{name}[{k}]") for k in range(width(cls))])


def _params(tape: Tape, component: Component) -> tuple[object, ...]:
    return _group(tape, component.params, "params")


def _mapped(part: object, function: Callable[[RecordedValue], RecordedValue]) -> Any:
    """Nested tuples, lists and dicts with a function applied to every value; all else stays."""
    if isinstance(part, RecordedValue):
        return function(part)
    if isinstance(part, dict):
        return {key: _mapped(x, function) for key, x in part.items()}
    if isinstance(part, (tuple, list)):
        items = [_mapped(x, function) for x in part]
        return part if all(map(is_, part, items)) else like(part, items)
    return part
