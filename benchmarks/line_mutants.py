"""Mutants at random lines of code: one small mistake each, drawn from the code alone.

Every line on which a mistake can be made is as likely as any other, so that packages have their share by
lines. Mistakes are those of usual tools: another number, comparison, sign or operator, ``and`` for
``or``, a condition turned round or left out, nothing returned, a statement left out. Texts, type hints,
``strict`` of ``zip`` and messages are left out.
"""

import ast
import random
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGES = ("fmus", "fmucheck", "cosim", "diagnosis", "thesis", "studies")
COMPARED: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.In: (r"\bin\b", "not in"),
    ast.NotIn: (r"\bnot in\b", "in"),
    ast.Is: (r"\bis\b", "is not"),
    ast.IsNot: (r"\bis not\b", "is"),
}
OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}


class Change(NamedTuple):
    """Bytes of a module from start to end that become another text; the line where they begin."""

    line: int
    start: int
    end: int
    text: str


class Mutant(NamedTuple):
    """A changed module: path, first line that changes, that line before and after, the whole text."""

    module: str
    line: int
    before: str
    after: str
    text: str

    @property
    def package(self) -> str:
        """The first folder of the module."""
        return self.module.partition("/")[0]


class Source:
    """A module's text, with the places of its syntax tree in bytes."""

    def __init__(self, text: str) -> None:
        self.bytes, self.tree = text.encode(), ast.parse(text)
        self._starts = [0, *(m.end() for m in re.finditer(rb"\n", self.bytes))]

    def span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        """First byte of a node, and the one after its last."""
        first, last = self._starts[node.lineno - 1], self._starts[(node.end_lineno or 0) - 1]
        return first + node.col_offset, last + (node.end_col_offset or 0)

    def of(self, node: ast.expr) -> str:
        """The text of an expression."""
        return self.bytes[slice(*self.span(node))].decode()

    def replaced(self, node: ast.expr | ast.stmt, text: str) -> Change:
        """A node that becomes a text."""
        return Change(node.lineno, *self.span(node), text)

    def between(
        self, line: int, left: ast.expr, right: ast.expr, old: str, new: str
    ) -> Iterator[Change]:
        """An operator between two expressions that becomes another one; none across a comment."""
        start, end = self.span(left)[1], self.span(right)[0]
        text = self.bytes[start:end].decode()
        if "#" not in text:
            yield Change(line, start, end, re.sub(old, lambda _: new, text, count=1))

    def left_out(self) -> set[int]:
        """Nodes that are not changed: annotations, parts of texts, ``strict``, docstrings."""
        found: list[ast.AST] = []
        for node in ast.walk(self.tree):
            if isinstance(node, ast.FunctionDef):
                found += [x for x in (node.returns, *(a.annotation for a in arguments(node))) if x]
            elif isinstance(node, ast.AnnAssign):
                found.append(node.annotation)
            elif (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)) or (
                isinstance(node, ast.JoinedStr)
                or (isinstance(node, ast.keyword) and node.arg == "strict")
            ):
                found.append(node)
        bodies = [
            n.body
            for n in ast.walk(self.tree)
            if isinstance(n, ast.Module | ast.FunctionDef | ast.ClassDef)
        ]
        first = {id(body[0]) for body in bodies if body and isinstance(body[0], ast.Expr)}
        return first | {id(inner) for node in found for inner in ast.walk(node)}


def arguments(node: ast.FunctionDef) -> list[ast.arg]:
    """All arguments of a function."""
    a = node.args
    return [*a.posonlyargs, *a.args, *a.kwonlyargs, *(x for x in (a.vararg, a.kwarg) if x)]


def changes(source: Source) -> Iterator[Change]:
    """Every mistake that can be made in a module."""
    out = source.left_out()
    for node in ast.walk(source.tree):
        if id(node) not in out:
            yield from _of_expression(source, node)
            yield from _of_statement(source, node)


def _of_expression(s: Source, node: ast.AST) -> Iterator[Change]:
    match node:
        case ast.Constant(value=bool(value)):
            yield s.replaced(node, str(not value))
        case ast.Constant(value=int(value)):
            yield s.replaced(node, str(value + 1))
        case ast.Constant(value=float(value)):
            yield s.replaced(node, repr(2.0 * value or 1.0))
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            yield from s.between(node.lineno, left, right, *COMPARED[type(op)])
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            texts = isinstance(left, ast.JoinedStr) or (
                isinstance(left, ast.Constant) and isinstance(left.value, str)
            )
            old, new = OPERATORS[type(op)]
            yield from () if texts else s.between(node.lineno, left, right, re.escape(old), new)
        case ast.BoolOp(op=op, values=[left, right, *_]):
            pair = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
            yield from s.between(node.lineno, left, right, *pair)
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield s.replaced(node, s.of(operand))
        case ast.comprehension(ifs=tests):
            yield from (s.replaced(test, "True") for test in tests)


def _of_statement(s: Source, node: ast.AST) -> Iterator[Change]:
    match node:
        case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
            yield s.replaced(test, f"(not ({s.of(test)}))")
        case ast.Return(value=ast.expr() as value) if not isinstance(value, ast.Constant):
            yield s.replaced(value, "None")._replace(line=node.lineno)
        case ast.Expr(value=value):
            if not isinstance(value, ast.Constant | ast.Yield | ast.YieldFrom):
                yield s.replaced(node, "pass")
        case ast.AugAssign():
            yield s.replaced(node, "pass")


def made(module: str, source: Source, change: Change) -> Mutant | None:
    """The mutant of a change; None where it would be no Python, or the same text."""
    text = (source.bytes[: change.start] + change.text.encode() + source.bytes[change.end :]).decode()
    try:
        ast.parse(text)
    except SyntaxError:
        return None
    old, new = source.bytes.decode().splitlines(), text.splitlines()
    first = next((k for k, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]), None)
    if first is None:
        return None
    return Mutant(module, first + 1, old[first].strip(), new[first].strip(), text)


def every_line(places: Sequence[str] = PACKAGES) -> list[tuple[str, Source, list[Change]]]:
    """The lines of packages or modules in which a mistake can be made, with the mistakes of each."""
    found = []
    for place in (ROOT / name for name in places):
        for file in [place] if place.is_file() else sorted(place.glob("**/*.py")):
            source = Source(file.read_text(encoding="utf-8"))
            at: dict[int, list[Change]] = {}
            for change in changes(source):
                at.setdefault(change.line, []).append(change)
            name = file.relative_to(ROOT).as_posix()
            found += [(name, source, at[line]) for line in sorted(at)]
    return found


def draw(count: int, seed: int, places: Sequence[str] = PACKAGES) -> list[Mutant]:
    """Mutants at random lines, one of the mistakes of each."""
    lines, rng = every_line(places), random.Random(seed)
    rng.shuffle(lines)
    found: list[Mutant] = []
    for module, source, options in lines:
        mutant = made(module, source, rng.choice(options))
        found += [] if mutant is None else [mutant]
        if len(found) == count:
            break
    return found


def again(module: str, before: str, after: str) -> Mutant | None:
    """A mutant of an earlier draw on the present code; None where that line has changed."""
    if not (ROOT / module).is_file():
        return None
    source = Source((ROOT / module).read_text(encoding="utf-8"))
    each = (made(module, source, change) for change in changes(source))
    return next((m for m in each if m and (m.before, m.after) == (before, after)), None)
