"""What a pure function does with numbers, recorded in the order in which it does it.

:mod:`fmus.fmi.trace` keeps expressions, which is enough to see what depends on what. Code that behaves
like the Python function to the bit, its failures included, needs the order of the operations as well,
and which of them belong to a branch: ``when`` becomes a branch here, and a function marked as ``kernel``
is recorded once and called. An operation that is done again on the same numbers, which gives the same
bits, is recorded at the first time only: compilers do so with all but the functions of libm.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeGuard, TypeVar, cast

from ..fmi.trace import Operand, Symbol, TraceError

T = TypeVar("T")  # a number, or nested tuples and lists of numbers

_CONDITIONS = frozenset({"lt", "le", "gt", "ge", "eq", "ne", "and", "or", "logical_not"})
# The truth value of one side that decides for both.
_DECIDED = {"and": False, "or": True}


class RecordedValue(Symbol):
    """A number or a condition that is known at run time only.

    Attributes:
        tape: that it is recorded on.
        block: where it comes into being.
        condition: True for a truth value, False for a number.
    """

    __slots__ = ("block", "condition", "tape")

    def __init__(self, tape: Tape, operation: str, args: Sequence[object], condition: bool) -> None:
        super().__init__(operation, args)
        self.tape = tape
        self.block = tape.block
        self.condition = condition

    def apply_operation(self, name: str, args: Sequence[Operand]) -> Operand:
        """The hook of operators and of :mod:`fmus.ops`."""
        return self.tape.operation(name, args)

    def branch(self, a: Callable[[], T], b: Callable[[], T]) -> T:
        """The hook of ``when``."""
        return self.tape.branch(self, a, b)

    def call_kernel(self, function: Callable[..., T], args: tuple[object, ...]) -> T:
        """The hook of functions marked as ``kernel``."""
        return self.tape.call(function, args)


class Block(list["RecordedValue | Branch | Call"]):
    """Statements in their order; an operation is the value that it gives."""


@dataclass(frozen=True, eq=False)
class Branch:
    """One of two blocks, and what it gives.

    Attributes:
        condition: chooses the first block.
        blocks: of both cases.
        results: values behind the branch.
        given: for each block what the results are.
    """

    condition: RecordedValue
    blocks: tuple[Block, Block]
    results: list[RecordedValue]
    given: tuple[list[Operand], list[Operand]]


@dataclass(frozen=True, eq=False)
class Call:
    """A call of a kernel: its arguments, and the values that it gives."""

    kernel: RecordedFunction
    args: list[Operand]
    results: list[RecordedValue]


@dataclass(frozen=True, eq=False)
class RecordedFunction:
    """A whole function.

    Attributes:
        body: its statements.
        results: numbers or values that it gives.
    """

    body: Block
    results: Sequence[Operand]


@dataclass(frozen=True, eq=False)
class Kernels:
    """The kernels that some functions call.

    Attributes:
        recordings: those that a kernel calls come before it.
        known: function and shape of its arguments -> kernel, its result, and the arguments, which keeps
            the objects among them from making way for others in their place.
    """

    recordings: list[RecordedFunction] = field(default_factory=list)
    known: dict[Hashable, tuple[RecordedFunction, Any, tuple[object, ...]]] = field(default_factory=dict)


class Tape:
    """Records one function.

    Args:
        kernels: receives the kernels that the function calls.
    """

    def __init__(self, kernels: Kernels) -> None:
        self.kernels = kernels
        self.body = self.block = Block()
        self._open = {id(self.body)}
        # What has been done so far in the open blocks, the innermost first.
        self._done: ChainMap[Hashable, RecordedValue] = ChainMap()

    def variable(self, name: str, condition: bool = False) -> RecordedValue:
        """A value from outside."""
        return self._once("variable", (name,), condition)

    def _once(self, name: str, args: Sequence[object], condition: bool) -> RecordedValue:
        """The value of an operation: of the same one before, if there was one, else a new one."""
        key = name, tuple([id(x) if isinstance(x, RecordedValue) else repr(x) for x in args])
        value = self._done.get(key)
        if value is None:
            value = self._done[key] = RecordedValue(self, name, args, condition)
            if name != "variable":
                self.block.append(value)
        return value

    def recording(self, results: Sequence[Operand]) -> RecordedFunction:
        """All that is recorded, as a function with these results."""
        self._check(results)
        return RecordedFunction(self.body, results)

    def operation(self, name: str, args: Sequence[Operand]) -> Operand:
        """Record an operation, but for one with a known truth value."""
        self._check(args)
        if name in _DECIDED and any(isinstance(x, bool) for x in args):
            known, other = args if isinstance(args[0], bool) else args[::-1]
            return known if known is _DECIDED[name] else other
        condition = name in _CONDITIONS or (name == "where" and all(map(is_condition, args[1:])))
        return self._once(name, args, condition)

    def branch(self, condition: RecordedValue, a: Callable[[], T], b: Callable[[], T]) -> T:
        """Record a branch; the value behind it has the shape of both cases."""
        self._check([condition])
        first, one = self._inner(a)
        second, other = self._inner(b)
        branch = Branch(condition, (first, second), [], ([], []))

        def merged(x: Any, y: Any) -> Any:
            if isinstance(x, (tuple, list)):
                return like(x, [merged(p, q) for p, q in zip(x, y, strict=True)])
            if x is y or (not isinstance(x, RecordedValue) and repr(x) == repr(y)):
                return x
            value = RecordedValue(self, "merged", (), is_condition(x) and is_condition(y))
            branch.results.append(value)
            branch.given[0].append(x)
            branch.given[1].append(y)
            return value

        result = merged(one, other)
        self.block.append(branch)
        return result

    def _inner(self, case: Callable[[], T]) -> tuple[Block, T]:
        outer, self.block = self.block, Block()
        before, self._done = self._done, self._done.new_child()
        self._open.add(id(self.block))
        try:
            result = case()
            self._check(leaves(result))
            return self.block, result
        finally:
            self._open.remove(id(self.block))
            self.block, self._done = outer, before

    def call(self, function: Callable[..., T], args: tuple[object, ...]) -> T:
        """Record a call of a kernel, which is recorded itself at its first call."""
        flat = list(leaves(args))
        self._check(flat)
        key = function, shape(args)
        if key not in self.kernels.known:
            tape = Tape(self.kernels)
            inner = iter([tape.variable(f"given[{k}]", is_condition(x)) for k, x in enumerate(flat)])
            refilled_args = refilled(args, inner)
            given = function(*refilled_args)
            recording = tape.recording(list(leaves(given)))
            self.kernels.recordings.append(recording)
            self.kernels.known[key] = recording, given, refilled_args
        recording, given, _ = self.kernels.known[key]
        results = [RecordedValue(self, "called", (), is_condition(x)) for x in recording.results]
        self.block.append(Call(recording, flat, results))
        return refilled(given, iter(results))

    def _check(self, used: Iterable[object]) -> None:
        """Refuse a value that is not there: of another function, or of a branch that is over."""
        for x in used:
            if isinstance(x, Symbol) and (
                not isinstance(x, RecordedValue) or id(x.block) not in self._open
            ):
                raise TraceError("a value is used outside of the branch or the function that it is from")


def is_condition(x: object) -> bool:
    """Whether something is a truth value, known or not."""
    return x.condition if isinstance(x, RecordedValue) else isinstance(x, bool)


def is_number(x: object) -> TypeGuard[Operand]:
    """Whether something is a number or a truth value, known or not."""
    return isinstance(x, (RecordedValue, float, int))


def leaves(value: object) -> Iterator[Operand]:
    """The numbers that nested tuples and lists hold, in order."""
    if isinstance(value, (tuple, list)):
        for item in value:
            yield from leaves(item)
    elif is_number(value):
        yield value


def like(template: Any, items: list[object]) -> Any:
    """Items as a list or a tuple of the template's class."""
    if isinstance(template, list):
        return items
    return type(template)._make(items) if hasattr(template, "_make") else tuple(items)


def refilled(template: T, values: Iterator[object]) -> T:
    """Numbers in place of those in nested tuples and lists: the inverse of :func:`leaves`."""
    if isinstance(template, (tuple, list)):
        return like(template, [refilled(item, values) for item in template])
    return cast(T, next(values)) if is_number(template) else template


def shape(value: object) -> Hashable:
    """What tells nested tuples of other lengths, classes, kinds of numbers or objects apart."""
    if isinstance(value, (tuple, list)):
        return type(value), tuple([shape(item) for item in value])
    return is_condition(value) if is_number(value) else id(value)
