"""One constant of the diagnosis at half or at double, from the moment its module is imported.

The value is changed in the syntax tree of the module before it runs, so that whatever is made of the
constant, wherever it is imported, follows: other constants, defaults of arguments, objects of settings.
"""

import ast
import sys
from collections.abc import Iterator, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType
from typing import Any

from ..constants import Constant, is_number

HALF, DOUBLE = 0.5, 2.0


def names_of(constant: Constant) -> Iterator[str]:
    """``module:name`` of each name that a statement gives values to."""
    module = "diagnosis." + constant.file.removesuffix(".py").replace("/", ".")
    apart = constant.value.startswith("(")
    for name in constant.name.split(", ") if apart else [constant.name]:
        yield f"{module}:{name}"


def changed(value: ast.expr, factor: float) -> ast.expr:
    """An expression with its numbers at half or at double.

    Shares between a half and one move by their distance from one; counts stay whole numbers, at least
    one. What follows from other constants stays.

    Args:
        value: a number, a container of some, a call with some, or arithmetic with literal numbers.
        factor: :data:`HALF` or :data:`DOUBLE`.
    """
    if is_number(value):
        return ast.Constant(scaled(ast.literal_eval(value), factor))
    if isinstance(value, ast.UnaryOp):
        value.operand = changed(value.operand, factor)
    elif isinstance(value, (ast.Tuple, ast.List, ast.Set)):
        value.elts = [changed(each, factor) for each in value.elts]
    elif isinstance(value, ast.Dict):
        value.values = [changed(each, factor) for each in value.values]
    elif isinstance(value, ast.Call):
        value.args = [changed(each, factor) for each in value.args]
        for keyword in value.keywords:
            keyword.value = changed(keyword.value, factor)
    elif isinstance(value, ast.BinOp):
        names = [n.id for n in ast.walk(value) if isinstance(n, ast.Name)]
        if not any(name.isupper() for name in names):
            value = ast.BinOp(value, ast.Mult(), ast.Constant(factor))
    return value


def scaled(number: float, factor: float) -> float:
    if isinstance(number, int):
        return number * 2 if factor == DOUBLE else number if abs(number) < 2 else number // 2
    if 0.5 < number < 1.0:
        return 1.0 - (1.0 - number) / factor
    return number * factor


def places(body: Sequence[ast.stmt], scope: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Name of each constant of a module, and where its value is: a container and the key in it."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from places(node.body, f"{node.name}.")
        if not isinstance(node, (ast.Assign, ast.AnnAssign)):
            continue
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            name = scope + ast.unparse(target).strip("()")
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                for k, each in enumerate(target.elts):
                    yield ast.unparse(each), node.value.elts, k
            elif node.value is not None:
                yield name, vars(node), "value"
            for keyword in getattr(node.value, "keywords", ()):  # of an object of settings
                yield f"{name}.{keyword.arg}", vars(keyword), "value"


def change(tree: ast.Module, name: str, factor: float) -> None:
    """Change the constant of a name, ``Class.field`` or ``OBJECT.field`` in a module's tree."""
    for found, container, key in places(tree.body):
        if found == name:
            container[key] = changed(container[key], factor)
    ast.fix_missing_locations(tree)


def import_changed(name: str, factor: float) -> None:
    """Change the constant ``module:name`` in this process, before its module is imported."""
    module, _, constant = name.partition(":")
    assert module not in sys.modules, f"{module} is imported already"

    class Loader(SourceFileLoader):
        def get_code(self, fullname: str) -> CodeType:
            tree = ast.parse(self.get_data(self.path))
            change(tree, constant, factor)
            return compile(tree, self.path, "exec")

    class Finder(MetaPathFinder):
        def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
            spec = PathFinder.find_spec(fullname, path, target) if fullname == module else None
            if spec is not None:
                spec.loader = Loader(fullname, str(spec.origin))
            return spec

    sys.meta_path.insert(0, Finder())
