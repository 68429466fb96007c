"""Mathematics that runs unchanged on floats, on numpy arrays and on traced symbols.

Components use these instead of ``math``, ``if`` and ``min``/``max``, so that one source serves the
step of an FMU (floats), a batch of runs (arrays) and code generation (symbols). Numpy is imported
only when an array turns up. On floats every function follows C: out of its domain it gives NaN or
an infinity instead of raising.
"""

import math
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, ParamSpec, TypeVar

# A number and a truth value of a component: a float and a bool in an FMU, arrays of them for whole
# series, traced symbols for code generation. Checkers take all of them for floats and bools, whose
# operations arrays and symbols have, too.
Number = float
Condition = bool
# A number, or an array of one for each instant, of functions that a diagnosis calls on whole series:
# what goes in decides what comes out, which checkers cannot say of both.
Series = Any

P = ParamSpec("P")
T = TypeVar("T")  # a number, or nested tuples of numbers

TWO_PI = 2.0 * math.pi
TINY = 1e-300  # in place of zero, of which there is no logarithm
_SCALARS = (float, int, bool)


def _call(name: str, *args: object) -> Any:
    """Apply ``name`` to arguments of which at least one is not a float."""
    for arg in args:
        apply = getattr(arg, "apply_operation", None)
        if apply is not None:
            return apply(name, args)
    import numpy

    return getattr(numpy, _NUMPY_NAMES.get(name, name))(*args)


_NUMPY_NAMES = {"atan2": "arctan2", "fmin": "minimum", "fmax": "maximum"}


def _guarded(
    name: str, function: Callable[[float], float], beyond: Callable[[float], float]
) -> Callable[[Number], Number]:
    """A function of ``math`` that outside its domain gives what C gives."""

    def guarded(x: Number) -> Number:
        if x.__class__ is float:
            try:
                return function(x)
            except (ValueError, OverflowError):
                return beyond(x)
        return _call(name, x)

    return guarded


sin = _guarded("sin", math.sin, lambda x: math.nan)
cos = _guarded("cos", math.cos, lambda x: math.nan)
exp = _guarded("exp", math.exp, lambda x: math.inf)
log = _guarded("log", math.log, lambda x: -math.inf if x == 0.0 else math.nan)
sqrt = _guarded("sqrt", math.sqrt, lambda x: math.nan)


def floor(x: Number) -> Number:
    """Largest whole number not above x, as a float (NaN stays NaN)."""
    if x.__class__ is float:
        return x // 1.0
    return _call("floor", x)


def atan2(y: Number, x: Number) -> Number:
    if y.__class__ is float and x.__class__ is float:
        return math.atan2(y, x)
    return _call("atan2", y, x)


def where(condition: Condition, a: Number, b: Number) -> Number:
    """``a`` where the condition holds, else ``b``. Both are evaluated: guard denominators."""
    if condition.__class__ is bool:
        return a if condition else b
    return _call("where", condition, a, b)


def choose(condition: Condition, a: T, b: T) -> T:
    """:func:`where` for two numbers, or two nested tuples of numbers of the same shape."""
    if condition.__class__ is bool:
        return a if condition else b
    return _chosen(condition, a, b)


def _chosen(condition: Condition, a: Any, b: Any) -> Any:
    if not isinstance(a, tuple):
        return a if a is b else where(condition, a, b)
    items = [_chosen(condition, x, y) for x, y in zip(a, b, strict=True)]
    return type(a)._make(items) if hasattr(a, "_make") else tuple(items)  # pyright: ignore


def when(condition: Condition, a: Callable[[], T], b: Callable[[], T]) -> T:
    """What ``a`` gives where the condition holds, else what ``b`` gives: for rare, costly work.

    Both give numbers in the same nested tuples. On a bool only the one that counts is called, and so it
    is in generated code.
    """
    if condition.__class__ is bool:
        return a() if condition else b()
    branch = getattr(condition, "branch", None)
    return choose(condition, a(), b()) if branch is None else branch(a, b)


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Marks a pure function of nested tuples or lists of numbers as heavy work that is done often.

    Generated code has it once, as a function of its own, in place of a copy for each call.
    """

    @wraps(function)
    def called(*args: P.args, **named: P.kwargs) -> T:
        first: object = args
        while first.__class__ is not float and isinstance(first, (tuple, list)):
            first = first[0]
        call = getattr(first, "call_kernel", None)
        return function(*args, **named) if call is None else call(function, args)

    return called


def put(rows: tuple[T, ...], index: Number, row: T) -> tuple[T, ...]:
    """The rows with another one at a place that may be a number; -1 is nowhere."""
    return tuple([choose(index == float(k), row, old) for k, old in enumerate(rows)])


def pick(rows: Sequence[T], index: Number) -> T:
    """The row whose place is nearest to ``index``; the first or last one beyond the ends."""
    if index.__class__ is float:
        return rows[min(max(int(index + 0.5), 0), len(rows) - 1)]
    found, place = rows[0], index + 0.5
    for k in range(1, len(rows)):
        found = choose(place >= k, rows[k], found)
    return found


def is_series(x: Number) -> bool:
    """Whether x is an array."""
    return x.__class__ not in _SCALARS and not hasattr(x, "apply_operation")


def series_between(x: Number, low: float, high: float, values: Sequence[float]) -> Number:
    """An array interpolated linearly between values at equally spaced nodes from low to high."""
    import numpy

    return numpy.interp(x, numpy.linspace(low, high, len(values)), values)


def fmin(a: Number, b: Number) -> Number:
    if a.__class__ in _SCALARS and b.__class__ in _SCALARS:
        return a if a < b else b
    return _call("fmin", a, b)


def fmax(a: Number, b: Number) -> Number:
    if a.__class__ in _SCALARS and b.__class__ in _SCALARS:
        return a if a > b else b
    return _call("fmax", a, b)


def clip(x: Number, low: Number, high: Number) -> Number:
    """x limited to [low, high]."""
    return fmax(low, fmin(x, high))


def sign(x: Number) -> Number:
    """-1, 0 or 1."""
    return where(x > 0.0, 1.0, where(x < 0.0, -1.0, 0.0))


def signed_root(x: Number) -> Number:
    """The number whose square, with its sign, is x."""
    size = sqrt(abs(x))
    return where(x < 0.0, -size, size)


def tanh(x: Number) -> Number:
    """Hyperbolic tangent, to a few times the rounding of 1."""
    e = exp(-2.0 * abs(x))
    return sign(x) * (1.0 - e) / (1.0 + e)


def power(x: Number, exponent: Number) -> Number:
    """x^exponent of x >= 0 and an exponent > 0 that need be no whole number."""
    return exp(exponent * log(fmax(x, TINY)))


def not_(condition: Condition) -> Condition:
    """Negation of a condition (``~True`` is -2 on a Python bool)."""
    if condition.__class__ is bool:
        return not condition
    return _call("logical_not", condition)


def is_finite(x: Number) -> Condition:
    """True where x is neither NaN nor infinite."""
    return x - x == 0.0


def finite(x: Number, otherwise: Number) -> Number:
    """x where it is finite, else ``otherwise``."""
    return where(x - x == 0.0, x, otherwise)


def wrap(angle: Series) -> Series:
    """The angle [rad] brought to (-pi, pi]."""
    return angle + TWO_PI * floor((math.pi - angle) / TWO_PI)
