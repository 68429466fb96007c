"""Recordings as flat Python functions that compute the same bits, several times as fast.

What takes time in Python is calls, tuples and attributes, of which nothing is left; unlike C this needs
neither a compiler nor a file. A sine of an infinity, or a division by zero, raises.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

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
_SPACE = {
    **{name: getattr(math, name) for name in ("sin", "cos", "atan2", "nan", "inf")},
    **{name: getattr(ops, name) for name in ("exp", "log", "sqrt")},
}


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
    text = []
    for k, kernel in enumerate(kernels.recordings):
        text += _PythonBody(names).lines_of(f"kernel_{k}", kernel, "given")
        names[id(kernel)] = f"kernel_{k}"
    text += _PythonBody(names).lines_of("recorded", recording, *given)
    space = dict(_SPACE)
    exec("\n".join(text), space)  # a text of recorded operations alone
    return space["recorded"]


class _PythonBody(Body):
    def lines_of(self, name: str, recording: RecordedFunction, *given: str) -> list[str]:
        self.write_all(recording)
        results = "".join(f"{self.of(x)}, " for x in recording.results)
        return [f"def {name}({', '.join(given)}):", *self.lines, f"    return ({results})"]

    def of(self, x: Operand) -> str:
        return super().of(x) if isinstance(x, RecordedValue) else f"({x!r})"

    def _operation(self, x: RecordedValue) -> Iterator[str]:
        args = [self.of(a) for a in x.args]
        form = _FORMS.get(x.operation) or f"{{0}} {_INFIX[x.operation]} {{1}}"
        yield f"{self._named(x)} = {form.format(*args)}"

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
