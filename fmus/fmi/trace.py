"""Run a component on symbols: what its functions compute, as an expression graph.

Tracing shows which outputs use which inputs (the ``dependencies`` of an FMU), and it proves that a
component keeps to the style that makes one source run everywhere: branching on a value, ``float()``
or ``math.sin()`` of one raises :class:`TraceError`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, cast

from .. import ops
from ..declare import Component, flatten, packer, rebuild, variables, width

OPERATIONS = {
    "sin": ops.sin,
    "cos": ops.cos,
    "exp": ops.exp,
    "log": ops.log,
    "sqrt": ops.sqrt,
    "floor": ops.floor,
    "atan2": ops.atan2,
    "where": ops.where,
    "fmin": ops.fmin,
    "fmax": ops.fmax,
    "logical_not": ops.not_,
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "abs": abs,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "gt": lambda a, b: a > b,
    "ge": lambda a, b: a >= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "and": lambda a, b: a & b,
    "or": lambda a, b: a | b,
}
FACTORS = {"mul": 2, "div": 1}  # how many arguments of an operation make it 0 where they are

T = TypeVar("T", bound=tuple[object, ...])


class TraceError(Exception):
    """A component does with a value what cannot be traced."""


def _operator(name: str, swapped: bool = False) -> Callable[[Symbol, Any], Any]:
    """The method of a binary operation, with the symbol on its left, or swapped on its right."""

    def method(self: Symbol, other: Operand) -> Operand:
        return self.apply_operation(name, (other, self) if swapped else (self, other))

    return method


class Symbol:
    """A value that is not known yet: a variable, or an operation on other values."""

    __slots__ = ("args", "operation")
    __array_ufunc__ = None

    def __init__(self, operation: str, args: Sequence[object]) -> None:
        self.operation = operation
        self.args: tuple[Any, ...] = tuple(args)

    def apply_operation(self, name: str, args: Sequence[Operand]) -> Operand:
        """The hook that :mod:`fmus.ops` looks for."""
        return Symbol(name, args)

    __add__, __radd__ = _operator("add"), _operator("add", swapped=True)
    __sub__, __rsub__ = _operator("sub"), _operator("sub", swapped=True)
    __mul__, __rmul__ = _operator("mul"), _operator("mul", swapped=True)
    __truediv__, __rtruediv__ = _operator("div"), _operator("div", swapped=True)
    __and__ = __rand__ = _operator("and")
    __or__ = __ror__ = _operator("or")
    __lt__, __le__ = _operator("lt"), _operator("le")
    __gt__, __ge__ = _operator("gt"), _operator("ge")
    __eq__, __ne__ = _operator("eq"), _operator("ne")

    def __neg__(self) -> Operand:
        return self.apply_operation("neg", (self,))

    def __abs__(self) -> Operand:
        return self.apply_operation("abs", (self,))

    __hash__ = object.__hash__

    def _refuse(self, *_: object) -> Any:
        raise TraceError(
            "a component may not branch on a value, convert it, raise it by **, or pass it to math or "
            "numpy; use where, clip, fmin, fmax, power and the functions of fmus.ops"
        )

    __bool__ = __float__ = __int__ = __index__ = __iter__ = __len__ = _refuse
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __pow__ = __rpow__ = _refuse
    __invert__ = __round__ = __array__ = _refuse


Operand = Symbol | ops.Number


def variable(name: str) -> ops.Number:
    """A symbol that stands for a value from outside; checkers take it for a number, as components do."""
    return cast(ops.Number, Symbol("variable", (name,)))


@dataclass(frozen=True)
class Trace:
    """A component's state and outputs as expressions of its variables.

    The variables are called ``params[k]``, ``inputs[k]``, ``state[k]`` (k counts scalars) and ``h``.
    """

    state: list[ops.Number]
    outputs: list[ops.Number]


def _symbols(group: str, count: int) -> list[ops.Number]:
    return [variable(f"{group}[{k}]") for k in range(count)]


def trace_init(component: Component) -> Trace:
    """The initial state, and the outputs that belong to it (a step with h = 0)."""
    params = _pack(component.params, "params")
    inputs = _pack(component.inputs, "inputs")
    state = component.init(inputs, params)
    _, outputs = component.step(state, inputs, params, 0.0)
    return Trace(flatten(state), flatten(outputs))


def trace_step(component: Component, h: ops.Number | None = None) -> Trace:
    """State and outputs after a step of ``h`` (default: a symbol) from a state of symbols."""
    start = component.init(component.inputs(), component.params())
    symbols = _symbols("state", len(flatten(start)))
    state, outputs = component.step(
        rebuild(start, symbols),
        _pack(component.inputs, "inputs"),
        _pack(component.params, "params"),
        variable("h") if h is None else h,
    )
    return Trace(flatten(state), flatten(outputs))


def _pack(cls: type[T], group: str) -> T:
    return packer(cls)(_symbols(group, width(cls)))


def ordered(results: Iterable[object]) -> list[Symbol]:
    """Every symbol that the results need, arguments before what uses them."""
    order: list[Symbol] = []
    seen: set[int] = set()
    pending: list[tuple[object, bool]] = [(r, False) for r in results]
    while pending:
        node, ready = pending.pop()
        if not isinstance(node, Symbol) or (id(node) in seen):
            continue
        if ready or node.operation == "variable":
            seen.add(id(node))
            order.append(node)
        else:
            pending.append((node, True))
            pending += [(arg, False) for arg in node.args]
    return order


def used_variables(results: Sequence[object]) -> list[frozenset[str]]:
    """Names of the variables that each result depends on; a factor that is exactly 0 cuts."""
    names: list[str] = []
    followed: dict[int, int] = {}  # bit k stands for names[k]; none is set where the value is constant
    constant: dict[int, object] = {}

    def of(arg: object) -> tuple[int, Any]:
        return (followed[id(arg)], constant.get(id(arg))) if isinstance(arg, Symbol) else (0, arg)

    for node in ordered(results):
        if node.operation == "variable":
            followed[id(node)] = 1 << len(names)
            names += node.args
            continue
        args = [of(arg) for arg in node.args]
        bits, value = 0, None
        for more, _ in args:
            bits |= more
        if not bits:
            value = OPERATIONS[node.operation](*[x for _, x in args])
        elif any(x == 0.0 for _, x in args[: FACTORS.get(node.operation, 0)]):
            bits, value = 0, 0.0
        elif node.operation == "where" and not args[0][0]:
            bits, value = args[1] if args[0][1] else args[2]
        elif node.operation == "and" and any(x is False for _, x in args):
            bits, value = 0, False
        followed[id(node)], constant[id(node)] = bits, value
    masks = [of(result)[0] for result in results]
    return [frozenset(name for k, name in enumerate(names) if mask >> k & 1) for mask in masks]


def output_dependencies(component: Component) -> list[frozenset[str]]:
    """Inputs that each output follows at the same communication point.

    A sampled law uses the input of the instant at which it acts, unless it is held. A plant's state at
    the end of a step of vanishing length does not depend on the input, so there only direct feedthrough
    is left.
    """
    trace = trace_step(component, None if component.sampled else 0.0)
    followed = {
        f"inputs[{k}]" for k, v in enumerate(variables(component.inputs)) if v.name not in component.held
    }
    return [names & followed for names in used_variables(trace.outputs)]


def initial_dependencies(component: Component) -> list[frozenset[str]]:
    """Parameters and inputs that each output depends on at initialisation."""
    return used_variables(trace_init(component).outputs)
