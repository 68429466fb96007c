"""The syntax tree of a file, which several tests go through."""

import ast
from functools import cache
from pathlib import Path


@cache
def nodes(path: Path) -> list[ast.AST]:
    """All nodes of a file as ``ast.walk`` has them, the file first, each in front of its parts.

    Without the contexts of names (load, store), which are half of all.
    """
    found: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    for node in found:  # which grows
        for part in vars(node).values():
            if isinstance(part, list):
                found += [p for p in part if isinstance(p, ast.AST)]
            elif isinstance(part, ast.AST) and not isinstance(part, ast.expr_context):
                found.append(part)
    return found
