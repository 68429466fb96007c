"""Recordings as C functions that compute the same bits.

Every operation is one of C's or a function of libm; nothing is folded, reordered or left out but what
nothing uses and cannot fail. Where Python raises, which it does on a division by zero, the function
returns 1 at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from ..fmi.trace import Operand
from .tape import Block, Branch, Call, RecordedFunction, RecordedValue

INFIX = {
    "add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "gt": ">", "ge": ">=",
    "eq": "==", "ne": "!=", "and": "&&", "or": "||",
}  # fmt: skip
_FORMS = {
    "neg": "-{0}",
    "abs": "FABS({0})",
    "sqrt": "SQRT({0})",
    "floor": "whole({0})",
    "logical_not": "!{0}",
    "where": "{0} ? {1} : {2}",
    # As fmus.ops has it; C's fmin and fmax treat NaN otherwise.
    "fmin": "{0} < {1} ? {0} : {1}",
    "fmax": "{0} > {1} ? {0} : {1}",
    **{name: f"{name}({{0}})" for name in ("sin", "cos", "exp", "log")},
    "atan2": "atan2({0}, {1})",
}

# What every source of recordings begins with. The compiler's own sqrt is one instruction and exact; its
# own sin or exp of a constant may differ from libm's, and so could those that it joins to a sincos.
PREAMBLE = """\
#include <math.h>

#if defined(__GNUC__) || defined(__clang__)
#define FABS __builtin_fabs
#define SQRT __builtin_sqrt
#else
#define FABS fabs
#define SQRT sqrt
#endif

/* Largest whole number not above x; of an infinity NaN, as in Python. */
static inline double whole(double x) { return x - x == 0.0 ? floor(x) : x - x; }
"""


def number(x: Operand) -> str:
    """A number or truth value of Python in C."""
    if isinstance(x, bool):
        return str(int(x))
    if x != x:
        return "NAN"
    text = repr(float(x)).replace("inf", "INFINITY")
    return f"({text})" if text.startswith("-") else text


class Writer:
    """Writes functions that may call each other's kernels.

    Args:
        raises: whether a function returns 1 where Python raises, or goes on with an infinity or NaN.
    """

    def __init__(self, raises: bool = True) -> None:
        self._raises = raises
        self._kernels: dict[int, str] = {}

    def kernel(self, recording: RecordedFunction) -> str:
        """A kernel as a static function of its arguments and results."""
        name = f"kernel_{len(self._kernels) + 1}"
        self._kernels[id(recording)] = name
        head = f"static int {name}(const double *given, double *results)"
        return self.function(head, recording, [("results", recording.results)])

    def function(
        self, head: str, recording: RecordedFunction, targets: Iterable[tuple[str, Sequence[Operand]]]
    ) -> str:
        """A function that writes its results into arrays.

        Args:
            head: its declaration; the parameters are called as the recording's variables.
            recording: what it does.
            targets: (array, the results that it gets), together all results.
        """
        unused = ", ".join(f"(void){name}" for name in re.findall(r"(\w+)[,)]", head))
        body = Body(self._kernels, self._raises).text(recording, targets)
        return f"{head}\n{{\n    {unused};{body[1:]}"


class Body:
    """The body of one function: names of its values, and lines."""

    def __init__(self, kernels: Mapping[int, str], raises: bool = True) -> None:
        self.kernels, self._raises = kernels, raises
        self.names: dict[int, str] = {}
        self.needed: set[int] = set()
        self.lines: list[str] = []

    def text(self, recording: RecordedFunction, targets: Iterable[tuple[str, Sequence[Operand]]]) -> str:
        self.write_all(recording)
        for array, results in targets:
            self.lines += [f"    {array}[{k}] = {self.of(x)};" for k, x in enumerate(results)]
        return "\n".join(["{", *self.lines, "    return 0;", "}", ""])

    def write_all(self, recording: RecordedFunction) -> None:
        """Lines of all that is needed of a recording."""
        self.need(recording.results)
        for statement in reversed(recording.body):
            self._mark(statement)
        self._write(recording.body, 1)

    def need(self, values: Iterable[object]) -> None:
        self.needed.update(id(x) for x in values if isinstance(x, RecordedValue))

    def _mark(self, statement: RecordedValue | Branch | Call) -> bool:
        """Note what a statement needs, if it is needed itself: for its value, or as it may fail."""
        if isinstance(statement, RecordedValue):
            wanted = id(statement) in self.needed or (self._raises and may_fail(statement))
            if wanted:
                self.needed.add(id(statement))
                self.need(statement.args)
            return wanted
        if isinstance(statement, Call):  # may fail
            self.need(statement.args)
            return True
        wanted = any(id(x) in self.needed for x in statement.results)
        for block, given in zip(statement.blocks, statement.given, strict=True):
            self.need(x for x, to in zip(given, statement.results, strict=True) if id(to) in self.needed)
            for inner in reversed(block):
                wanted = self._mark(inner) or wanted
        if wanted:
            self.needed.add(id(statement))
            self.need([statement.condition])
        return wanted

    def of(self, x: Operand) -> str:
        """How a value is written where it is used."""
        if not isinstance(x, RecordedValue):
            return number(x)
        if x.operation == "variable":
            return f"({x.args[0]} != 0.0)" if x.condition else x.args[0]
        return self.names[id(x)]

    def _named(self, x: RecordedValue) -> str:
        return self.names.setdefault(id(x), f"x{len(self.names)}")

    def _write(self, block: Block, depth: int) -> None:
        indent = "    " * depth
        for statement in block:
            if isinstance(statement, Branch):
                if id(statement) in self.needed:
                    self._branch(statement, depth)
            elif isinstance(statement, Call):
                self.lines += [indent + line for line in self._call(statement)]
            elif id(statement) in self.needed:
                self.lines += [indent + line for line in self._operation(statement)]

    def _operation(self, x: RecordedValue) -> Iterator[str]:
        args = [self.of(a) for a in x.args]
        if self._raises and may_fail(x):
            yield f"if ({args[1]} == 0.0) return 1;"
        if x.operation in INFIX:
            value = f"{args[0]} {INFIX[x.operation]} {args[1]}"
        else:
            value = _FORMS[x.operation].format(*args)
        yield f"const {_type(x)} {self._named(x)} = {value};"

    def _call(self, call: Call) -> Iterator[str]:
        a, r = f"a{len(self.names)}", f"r{len(self.names)}"
        yield f"double {a}[] = {{{', '.join(map(self.of, call.args))}}}, {r}[{len(call.results)}];"
        yield f"if ({self.kernels[id(call.kernel)]}({a}, {r})) return 1;"
        for k, x in enumerate(call.results):
            if id(x) in self.needed:
                yield f"const {_type(x)} {self._named(x)} = {r}[{k}];"

    def _branch(self, branch: Branch, depth: int) -> None:
        indent = "    " * depth
        used = [k for k, x in enumerate(branch.results) if id(x) in self.needed]
        for kind in ("double", "int"):
            names = [self._named(x) for x in map(branch.results.__getitem__, used) if _type(x) == kind]
            if names:
                self.lines.append(f"{indent}{kind} {', '.join(names)};")
        self.lines.append(f"{indent}if ({self.of(branch.condition)}) {{")
        for case, (block, given) in enumerate(zip(branch.blocks, branch.given, strict=True)):
            if case:
                self.lines.append(f"{indent}}} else {{")
            self._write(block, depth + 1)
            for k in used:
                target = self._named(branch.results[k])
                self.lines.append(f"{indent}    {target} = {self.of(given[k])};")
        self.lines.append(f"{indent}}}")


def _type(x: RecordedValue) -> str:
    return "int" if x.condition else "double"


def may_fail(x: RecordedValue) -> bool:
    """Whether Python might raise: on a division by what may be zero."""
    return x.operation == "div" and (isinstance(x.args[1], RecordedValue) or x.args[1] == 0.0)
