"""A law of vessel and thrusters, recorded once for all models of one structure.

It is called with symbols in place of a model's numbers (:mod:`fmus.native.tape`). What comes out
computes the same bits, without calls, tuples and attributes.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import count
from typing import Any

import numpy as np

from fmus.fmi.trace import TraceError
from fmus.native.python_text import function, series_function
from fmus.native.tape import Kernels, RecordedFunction, Tape, like

from .compiled_law import CompiledLaw, compiled_law

# Of groups of numbers, the prepared vessel and the prepared thrusters, the numbers that follow.
Law = Callable[..., Sequence[Any]]


@dataclass(frozen=True)
class Structure:
    """What a recording depends on.

    Attributes:
        law: what is recorded.
        key: the model's parts with the kind of each of their numbers in its place, and their effects.
        counts: how many numbers each of the groups has; None: it is not there.
        parts: prepared vessel and thrusters of a model with this structure.
    """

    law: Law
    key: Hashable
    counts: tuple[int | None, ...]
    parts: tuple[Any, ...] = field(compare=False)


def structure(
    law: Law, counts: Sequence[int | None], parts: tuple[Any, ...], arrays: bool = True
) -> Structure:
    """What a recording depends on.

    Args:
        law, counts, parts: as of :class:`Structure`.
        arrays: whether a number differs from an array of numbers.
    """
    kind = _kind if arrays else _meaning
    key = tuple([(_kinds(_numbers(part), kind), id(part.effects)) for part in parts])
    return Structure(law, key, tuple(counts), parts)


def numbers_of(parts: tuple[Any, ...]) -> list[Any]:
    """The numbers and arrays of a model's parts, in the order of a recording's last arguments."""
    found: list[Any] = []
    _mapped(parts, found.append)
    return found


def stepped(
    law: Law, state: Sequence[Any], inputs: np.ndarray, parts: tuple[Any, ...], kept: int
) -> np.ndarray:
    """The first numbers of a state at the start and after each step (steps + 1, kept, p).

    Args:
        law: of the state, the inputs, and the parts of a model.
        state: at the start, numbers and arrays (p,).
        inputs: (steps, k, p or 1).
        parts: prepared vessel and thrusters.
        kept: how many numbers of the state are returned.
    """
    of = structure(law, (len(state), inputs.shape[1]), parts, arrays=False)
    code = in_machine_code(of)
    if code is not None:
        return code.states(state, [*np.moveaxis(inputs, 1, 0)], numbers_of(parts), kept)[:, :, 0]
    states = [state]
    for row in inputs:
        states.append(law(states[-1], [x.item() if x.size == 1 else x for x in row], *parts))
    return np.stack([np.stack(np.broadcast_arrays(*s[:kept])) for s in states])


@lru_cache  # models of one structure follow each other in a fit
def in_python(of: Structure, single: bool) -> Callable[..., Sequence[Any]] | None:
    """A law as a function of numbers in one row, or of arrays; None: it cannot be recorded."""
    tape, names, plain = Tape(Kernels()), list[str](), list[str]()

    def variable(x: Any) -> Any:
        names.append(f"given_{len(names)}")
        if isinstance(x, float):
            plain.append(names[-1])
        return tape.variable(names[-1], _is_condition(x))

    after = _recording(of, tape, variable)
    if after is None:
        return None
    if single:
        return function(after, tape.kernels, *names)
    return series_function(after, tape.kernels, names, frozenset(plain))


@lru_cache
def in_machine_code(of: Structure) -> CompiledLaw | None:
    """A law in machine code; None: it cannot be recorded, or there is no compiler."""
    tape, number = Tape(Kernels()), count()
    after = _recording(of, tape, lambda x: tape.variable(f"given[{next(number)}]", _is_condition(x)))
    if after is None:
        return None
    return compiled_law(after, tape.kernels, sum(n or 0 for n in of.counts[1:]), next(number))


def _recording(of: Structure, tape: Tape, variable: Callable[[Any], Any]) -> RecordedFunction | None:
    groups = [None if n is None else tuple([variable(np.zeros(0)) for _ in range(n)]) for n in of.counts]
    parts = _mapped(of.parts, variable)
    try:
        return tape.recording([*of.law(*groups, *parts)])
    except (TraceError, TypeError, AttributeError):  # by an effect of a user
        return None


def _numbers(part: Any) -> dict[str, Any]:
    """What a part of a model has of numbers, by name."""
    return {n: x for n, x in part._asdict().items() if n != "effects"}


def _kind(x: Any) -> Hashable:
    return x.dtype.kind if isinstance(x, np.ndarray) else float


def _is_condition(x: Any) -> bool:
    return _kind(x) == "b"


def _meaning(x: Any) -> Hashable:
    """What differs from a condition that is known, which is in the key as it is."""
    return "condition" if _is_condition(x) else "number"


def _kinds(x: Any, kind: Callable[[Any], Hashable]) -> Hashable:
    """The kind of each number of a model, and the classes of the tuples that they are in."""
    if isinstance(x, (tuple, list)):
        return type(x), tuple([_kinds(item, kind) for item in x])
    if isinstance(x, dict):
        return tuple([(name, _kinds(item, kind)) for name, item in x.items()])
    return kind(x) if isinstance(x, (float, np.ndarray)) else x


def _mapped(parts: tuple[Any, ...], function: Callable[[Any], Any]) -> tuple[Any, ...]:
    """A model's parts with a function applied to each of their numbers and arrays."""

    def mapped(x: Any) -> Any:
        if isinstance(x, tuple):
            return like(x, [mapped(item) for item in x])
        return function(x) if isinstance(x, (float, np.ndarray)) else x

    return tuple([p._replace(**{n: mapped(x) for n, x in _numbers(p).items()}) for p in parts])
