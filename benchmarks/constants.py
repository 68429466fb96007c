"""How many numbers decide in a package? ``python -m benchmarks.constants``.

Numbers are counted in the syntax tree, wherever they are, so that moving one is no removal: constants
of modules, fields of settings, defaults of arguments, literals within functions, data files. An index
does not count, nor does what follows from named constants alone. A field that is 0 or 1 by default is
without effect unless somebody sets it, as an argument is, and does not count either.
"""

import argparse
import ast
import csv
import io
import json
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cosim.command import command_parser, run_command

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

KINDS = ("module", "field", "default", "literal", "data")
PACKAGE = Path(__file__).parents[1] / "diagnosis"
# Rooms whose constants act on a verdict; the others show it, or judge a model by criteria of a user's.
DECIDING = ("runs", "predictors", "search", "verdict", "assessment", "session.py")
UNIT = r"(?:1/s|rad2?|m2?|s|Hz|kg|N2?|N m|K|deg(?:rees)?|bytes|%|1)(?:/(?:s2?|min))?(?!\w)"
LEADING_UNIT = re.compile(rf"^{UNIT}(?:(?:,| and| or) {UNIT})*(?=[;,.: ]|$)|\[({UNIT}[^\]]*)\]")
# An entry of a docstring, with its continuation lines.
ENTRY = re.compile(r"^    (\w[\w, ]*): ((?:.*\n?)(?:^     +\S.*\n?)*)", re.MULTILINE)
LONG = 60  # characters of a value that the page shows
HEADER = """# Constants that act on a verdict

This page lists the constants by which the diagnosis decides, each with its value, unit and reason.
With it you can look up a constant and its place in the code. No command has an option for them.
Their influence is in
[sensitivity](../benchmarks/README.md#which-numbers-decide-and-which-of-them-matter).

<!-- not run: writes this page, and takes hours -->
```sh
python -m benchmarks.constants --page > docs/constants.md    # write this page from the code
python -m benchmarks.sensitivity    # what changes with each at half and at double
```
"""


class Constant(NamedTuple):
    """A name with numbers, or a number without a name.

    Attributes:
        file: relative to the package.
        line: from 1 on; 0 in data files.
        kind: one of :data:`KINDS`.
        name: as the code says it, ``Class.field`` or ``OBJECT.field`` of settings; "" of a literal.
        numbers: how many there are.
        value: as it is written.
        reason: comment beside or above, or the entry of the class' docstring.
    """

    file: str
    line: int
    kind: str
    name: str
    numbers: int
    value: str
    reason: str = ""

    @property
    def room(self) -> str:
        return self.file.partition("/")[0]


def is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def size(node: ast.AST) -> int:
    """Numbers in an expression: arithmetic is one at most, a tuple has as many as are in it."""
    if isinstance(node, ast.Subscript):
        return size(node.value)
    if isinstance(node, ast.Lambda) or (
        isinstance(node, ast.Call) and ast.unparse(node.func) == "range"
    ):
        return 0  # literals of a function; names of indices
    parts = [size(child) for child in ast.iter_child_nodes(node)]
    if isinstance(node, (ast.BinOp, ast.UnaryOp)):
        return 0 if is_derived(node) else max(parts)
    return int(is_number(node)) + sum(parts)


def is_derived(node: ast.AST) -> bool:
    """Whether an expression follows from named constants by small numbers: a double, a square."""
    parts = [*ast.walk(node)]
    named = any(isinstance(n, ast.Name) and n.id.isupper() for n in parts)
    return named and all(small(n) for n in parts if is_number(n))


def is_neutral(value: ast.AST) -> bool:
    """Whether a field's default is 0 or 1, without effect; also in a ``Field(...)``."""
    numbers = [n for n in ast.walk(value) if is_number(n)]
    return not isinstance(value, ast.Tuple) and all(n.value in (0, 1) for n in numbers)


class Reader(ast.NodeVisitor):
    """Finds the constants of one module.

    Args:
        text: source of the module.
        file: its name, for the constants.
    """

    def __init__(self, text: str, file: str) -> None:
        self.found: list[Constant] = []
        self._file, self._kind = file, "module"
        self._lines = text.splitlines()
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        self._comments = {
            t.start[0]: t.string.lstrip("# ") for t in tokens if t.type == tokenize.COMMENT
        }
        tree = ast.parse(text)
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        self._documented = {c.name: attributes(ast.get_docstring(c) or "") for c in classes}
        self._docs: dict[str, str] = {}
        self._class = ""
        self.visit(tree)

    def _add(self, node: ast.AST, name: str, value: ast.AST, reason: str = "", kind: str = "") -> None:
        if count := 0 if (kind or self._kind) == "field" and is_neutral(value) else size(value):
            line = getattr(node, "lineno", 0)
            self.found.append(
                Constant(self._file, line, kind or self._kind, name, count, ast.unparse(value), reason)
            )

    def _reason(self, node: ast.stmt) -> str:
        """Comments on the lines of a statement, and those directly above it."""
        above = node.lineno - 1
        while above in self._comments and self._lines[above - 1].lstrip().startswith("#"):
            above -= 1
        places = range(node.lineno, (node.end_lineno or node.lineno) + 1), range(above + 1, node.lineno)
        stated = [" ".join(self._comments[k] for k in lines if k in self._comments) for lines in places]
        return ". ".join(
            text.rstrip(".") if text is stated[0] and stated[1] else text for text in stated if text
        )

    def _assignment(self, node: ast.Assign | ast.AnnAssign) -> None:
        value = node.value
        if value is None:
            return
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        name, reason = " = ".join(map(ast.unparse, targets)), self._reason(node)
        name = name.strip("()")
        if isinstance(value, ast.Call) and ast.unparse(value.func) in self._documented:
            docs = self._documented[ast.unparse(value.func)]
            for given in value.keywords:  # an object of settings
                stated = docs.get(given.arg or "", reason)
                self._add(given.value, f"{name}.{given.arg}", given.value, stated, "field")
            value = ast.Tuple(value.args, ast.Load())
        self._add(
            node, self._class + name, value, self._docs.get(name, "") or reason or description(value)
        )
        self._inside(node)

    def _inside(self, node: ast.AST) -> None:
        """Numbers of lambdas in an assignment."""
        for each in ast.walk(node):
            if isinstance(each, ast.Lambda):
                self.visit_Lambda(each)

    def visit_Assign(self, node: ast.Assign) -> None:
        self.generic_visit(node) if self._kind == "literal" else self._assignment(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if self._kind != "literal":
            self._assignment(node)
        elif node.value is not None:
            self.visit(node.value)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        before = self._kind, self._docs, self._class
        if self._kind == "module":
            self._kind = "field"
        self._docs, self._class = attributes(ast.get_docstring(node) or ""), f"{node.name}."
        for each in node.body:
            self.visit(each)
        self._kind, self._docs, self._class = before

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) -> None:
        given = node.args
        names = [a.arg for a in [*given.posonlyargs, *given.args]]
        pairs = list(zip(names[len(names) - len(given.defaults) :], given.defaults, strict=True))
        pairs += [(a.arg, d) for a, d in zip(given.kwonlyargs, given.kw_defaults, strict=True) if d]
        for name, default in pairs:
            if not small(default):
                self._add(default, name, default, kind="default")
        for decorator in getattr(node, "decorator_list", []):
            self.visit(decorator)
        before, self._kind = self._kind, "literal"
        for each in node.body if isinstance(node.body, list) else [node.body]:
            self.visit(each)
        self._kind = before

    visit_AsyncFunctionDef = visit_Lambda = visit_FunctionDef

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self.visit(node.value)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if is_number(node.operand):
            self.visit_Constant(node)
        else:
            self.visit(node.operand)

    def visit_Constant(self, node: ast.Constant | ast.UnaryOp) -> None:
        if self._kind != "literal" or not small(node):
            self._add(node, "", node)


def description(value: ast.AST) -> str:
    """What a field of a pydantic model says of itself."""
    given = value.keywords if isinstance(value, ast.Call) else []
    return next((str(ast.literal_eval(k.value)) for k in given if k.arg == "description"), "")


def small(node: ast.AST) -> bool:
    """Whether an expression is a whole number from -2 to 2: a sign, a half by division, a square."""
    node = node.operand if isinstance(node, ast.UnaryOp) else node
    return is_number(node) and node.value in (0, 1, 2)  # type: ignore[attr-defined]


def attributes(docstring: str) -> dict[str, str]:
    """Name -> text of the entries under ``Attributes:`` of a class."""
    _, _, listed = docstring.partition("Attributes:\n")
    found = {}
    for names, stated in ENTRY.findall(listed):
        found |= dict.fromkeys(names.split(", "), " ".join(stated.split()))
    return found


def of_data(path: Path, file: str) -> Iterator[Constant]:
    """Numbers of a data file: JSON, TOML, CSV, a style of matplotlib."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        content: Any = json.loads(text)
    elif path.suffix == ".toml":
        content = tomllib.loads(text)
    elif path.suffix == ".csv":
        content = [list(map(parsed, row)) for row in csv.reader(io.StringIO(text))]
    else:
        lines = [line.partition("#")[0].partition(":") for line in text.splitlines()]
        content = {key.strip(): [parsed(v) for v in value.split(",")] for key, _, value in lines}
    for name, value in leaves(content):
        if type(value) in (int, float):
            yield Constant(file, 0, "data", name, 1, str(value))


def parsed(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def leaves(content: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Path and value of each leaf of nested dicts and lists."""
    if not isinstance(content, (dict, list)):
        yield name.lstrip("."), content
        return
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        yield from leaves(value, f"{name}.{key}")


def constants(package: Path, without: Sequence[str] = ()) -> list[Constant]:
    """Every number of a package.

    Args:
        package: its folder.
        without: folders and files directly in it that are left out.
    """
    found: list[Constant] = []
    for path in sorted(package.rglob("*")):
        file = path.relative_to(package).as_posix()
        if file.partition("/")[0] in without:
            continue
        if path.suffix == ".py":
            found += Reader(path.read_text(encoding="utf-8"), file).found
        elif path.suffix in (".json", ".toml", ".csv", ".mplstyle"):
            found += of_data(path, file)
    return found


def table(found: Sequence[Constant], by: str) -> Iterator[str]:
    """Rows of a table in Markdown: numbers of each kind, by room or file."""
    counts = Counter()
    for c in found:
        counts[getattr(c, by), c.kind] += c.numbers
    yield f"| {by} | {' | '.join(KINDS)} | all |"
    yield "|---" + "|--:" * (len(KINDS) + 1) + "|"
    for each in sorted({getattr(c, by) for c in found}):
        row = [counts[each, kind] for kind in KINDS]
        yield "| " + " | ".join(map(str, [each, *row, sum(row)])) + " |"
    total = [sum(c.numbers for c in found if c.kind == kind) for kind in KINDS]
    yield "| " + " | ".join(map(str, ["all", *total, sum(total)])) + " |"


def deciding(found: Sequence[Constant]) -> list[Constant]:
    """Constants with a name, of the rooms that a verdict comes from; settings before others.

    Fields of pydantic's models are keys of files that a user writes.
    """
    named = [c for c in found if c.room in DECIDING and c.kind in ("module", "field") and c.name]
    named = [c for c in named if not c.value.startswith("Field(")]
    return sorted(named, key=lambda c: (DECIDING.index(c.room), c.kind != "field", c.file, c.line))


def page(found: Sequence[Constant]) -> Iterator[str]:
    """The page of the docs, line by line."""
    yield HEADER
    room = ""
    for c in deciding(found):
        if c.room != room:
            room = c.room
            yield f"\n## `{room}`\n\n| constant | value | unit | reason |\n|---|---|---|---|"
        unit = LEADING_UNIT.search(c.reason)
        stated = c.reason.replace(unit[0], "", 1).lstrip(" ;,.:") if unit else c.reason
        place = c.file.removeprefix(f"{room}/").removesuffix(".py").replace("/", ".")
        value = c.value if len(c.value) <= LONG else f"{c.value[:LONG]} ..."
        cells = f"`{place}: {c.name}`", f"`{value}`", (unit[1] or unit[0]) if unit else "", stated
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; 1 if there are more numbers than allowed."""
    options = _parser().parse_args(arguments)
    found = [c for c in constants(options.package, options.without) if c.kind in options.kinds]
    if options.page:
        print("\n".join(page(found)))
        return 0
    if options.list or options.unexplained:
        for c in found:
            if options.list or (not c.reason and c.kind in ("module", "field")):
                print(
                    f"{c.file}:{c.line}: {c.kind} {c.name or '-'} = {c.value}  # {c.reason}".rstrip("# ")
                )
        return 0
    print("\n".join(table(found, options.by)))
    named = [name for c in found if c.kind in ("module", "field") for name in c.name.split(", ")]
    print(f"\n{len(named)} names of constants of modules and fields of settings")
    return int(options.most is not None and sum(c.numbers for c in found) > options.most)


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "benchmarks.constants",
        "Count the numbers in the code of a package.",
        "examples:\n"
        "  python -m benchmarks.constants --without report acceptance\n"
        "  python -m benchmarks.constants --kinds module field --most 200\n"
        "  python -m benchmarks.constants --list --kinds literal\n"
        "  python -m benchmarks.constants --page > docs/constants.md\n"
        "exit codes: 0 done, 1 there are more than --most, 2 bad input",
    )
    parser.add_argument("package", type=Path, nargs="?", default=PACKAGE, help="folder (diagnosis)")
    parser.add_argument("--by", choices=("room", "file", "kind"), default="room", help="rows (room)")
    parser.add_argument(
        "--kinds",
        nargs="+",
        choices=KINDS,
        default=KINDS,
        metavar="KIND",
        help=f"{', '.join(KINDS)} (all)",
    )
    parser.add_argument(
        "--without",
        nargs="+",
        default=[],
        metavar="NAME",
        help="leave out folders or files of the package",
    )
    parser.add_argument("--most", type=int, metavar="N", help="exit with 1 if there are more numbers")
    parser.add_argument("--list", action="store_true", help="each with its place, value and reason")
    parser.add_argument("--unexplained", action="store_true", help="those of modules without a comment")
    parser.add_argument("--page", action="store_true", help="the page of the docs")
    return parser


if __name__ == "__main__":
    run_command(main)
