"""Recordings as flat Python functions that compute the same bits, several times as fast.

What takes time in Python is calls, tuples and attributes, of which nothing is left; unlike C this needs
neither a compiler nor a file. On numbers a sine of an infinity, or a division by zero, raises; on arrays
numpy gives what it gives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

from .. import ops
from ..fmi.trace import Operand
from ..ops import Number
from .c_text import INFIX, Body
from .tape import Branch, Call, Kernels, RecordedFunction, RecordedValue

_INFIX = {**INFIX, "and": "and", "or": "or"}
_FORMS = {
    "neg": "-{0}",
    "floor": "{0} // 1.0",
    "logical_not": "not {0}",
    "where": "{1} if {0} else {2}",
    "fmin": "{0} if {0} < {1} else {1}",
    "fmax": "{0} if {0} > {1} else {1}",
    "atan2": "atan2({0}, {1})",
    **{name: f"{name}({{0}})" for name in ("abs", "sin", "cos", "exp", "log", "sqrt")},
}
_SPACE: dict[str, Any] = {
    **{name: getattr(math, name) for name in ("sin", "cos", "atan2", "nan", "inf")},
    **{name: getattr(ops, name) for name in ("exp", "log", "sqrt")},
}
# The same of arrays, by functions of numpy.
_OF_NUMPY = {
    "fmin": "minimum",
    "fmax": "maximum",
    "atan2": "arctan2",
    "where": "where",
    "floor": "floor",
}
_OF_NUMPY |= {name: name for name in ("logical_not", "sin", "cos", "exp", "log", "sqrt")}
_SERIES_FORMS = _FORMS | {name: f"np_{function}({{}})" for name, function in _OF_NUMPY.items()}
_SERIES_FORMS |= {"and": "{0} & {1}", "or": "{0} | {1}"}


def function(
    recording: RecordedFunction, kernels: Kernels, *given: str
) -> Callable[..., tuple[Number, ...]]:
    """A recording as a function of what its variables are called after, which gives its results.

    Args:
        recording: what it does.
        kernels: those that it may call.
        given: names of its arguments.
    """
    names: dict[int, str] = {}
    return _compiled(recording, kernels, given, names, _PythonBody(names), _PythonBody, _SPACE)


def series_function(
    recording: RecordedFunction, kernels: Kernels, given: Sequence[str], plain: Collection[str]
) -> Callable[..., tuple[Any, ...]]:
    """The same for arrays: of a branch by an array both sides are computed.

    Args:
        recording, kernels, given: as of :func:`function`.
        plain: names of those arguments that are numbers.
    """
    import numpy as np

    names: dict[int, str] = {}
    space = _SPACE | {f"np_{name}": getattr(np, name) for name in _OF_NUMPY.values()}
    body = _SeriesBody(names, plain)
    return _compiled(recording, kernels, given, names, body, _SeriesBody, space)


def _compiled(
    recording: RecordedFunction,
    kernels: Kernels,
    given: Sequence[str],
    names: dict[int, str],
    body: _PythonBody,
    of_kernel: Callable[[dict[int, str]], _PythonBody],
    space: Mapping[str, Any],
) -> Callable[..., Any]:
    """A recording, written by a body after its kernels, which get their ``names``, as a function."""
    text = []
    for k, kernel in enumerate(kernels.recordings):
        text += of_kernel(names).lines_of(f"kernel_{k}", kernel, "given")
        names[id(kernel)] = f"kernel_{k}"
    text += body.lines_of("recorded", recording, *given)
    found = dict(space)
    exec("\n".join(text), found)  # a text of recorded operations alone
    return found["recorded"]


class _PythonBody(Body):
    def lines_of(self, name: str, recording: RecordedFunction, *given: str) -> list[str]:
        self.write_all(recording)
        results = "".join(f"{self.of(x)}, " for x in recording.results)
        return [f"def {name}({', '.join(given)}):", *self.lines, f"    return ({results})"]

    def of(self, x: Operand) -> str:
        return super().of(x) if isinstance(x, RecordedValue) else f"({x!r})"

    def _form(self, x: RecordedValue) -> str | None:
        """How an operation is written, if not between its arguments."""
        return _FORMS.get(x.operation)

    def _operation(self, x: RecordedValue) -> Iterator[str]:
        args = [self.of(a) for a in x.args]
        form = self._form(x) or f"{{0}} {_INFIX[x.operation]} {{1}}"
        text = form.format(*args) if "{}" not in form else form.format(", ".join(args))
        yield f"{self._named(x)} = {text}"

    def _call(self, call: Call) -> Iterator[str]:
        results = "".join(f"{self._named(x)}, " for x in call.results)
        yield f"{results}= {self.kernels[id(call.kernel)]}(({', '.join(map(self.of, call.args))},))"

    def _branch(self, branch: Branch, depth: int) -> None:
        indent = "    " * depth
        used = [k for k, x in enumerate(branch.results) if id(x) in self.needed]
        words = (f"if {self.of(branch.condition)}:", "else:")
        for word, block, given in zip(words, branch.blocks, branch.given, strict=True):
            self.lines.append(indent + word)
            self._write(block, depth + 1)
            targets = [f"{self._named(branch.results[k])} = {self.of(given[k])}" for k in used]
            self.lines += [f"{indent}    {line}" for line in targets or ["pass"]]


class _SeriesBody(_PythonBody):
    def __init__(self, kernels: Mapping[int, str], plain: Collection[str] = ()) -> None:
        super().__init__(kernels)
        self._numbers, self._plain = plain, set[int]()

    def _is_plain(self, x: Operand) -> bool:
        """Whether a value is a number at run time."""
        if not isinstance(x, RecordedValue):
            return True
        return x.args[0] in self._numbers if x.operation == "variable" else id(x) in self._plain

    def _form(self, x: RecordedValue) -> str | None:
        if not all(map(self._is_plain, x.args)):
            return _SERIES_FORMS.get(x.operation)
        self._plain.add(id(x))
        return super()._form(x)

    def _branch(self, branch: Branch, depth: int) -> None:
        if self._is_plain(branch.condition):
            super()._branch(branch, depth)
            return
        for block in branch.blocks:
            self._write(block, depth)
        for x, *given in zip(branch.results, *branch.given, strict=True):
            if id(x) in self.needed:
                args = ", ".join(map(self.of, (branch.condition, *given)))
                self.lines.append(f"{'    ' * depth}{self._named(x)} = np_where({args})")
