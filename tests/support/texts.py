"""What the code says to people: texts in modules, help of commands, report templates, public docstrings."""

import argparse
import ast
import inspect
import re
import sys
from collections.abc import Iterator
from functools import cache
from html import unescape
from importlib import import_module
from pathlib import Path
from unittest.mock import patch

from support.project import ROOT
from support.public_api import PACKAGES
from support.syntax import nodes

FEWEST = 3  # words from which on a string is taken as a text
NAMES = r"\w+(?:, \w+)*"  # of arguments, before their text
PARSED = re.compile(r"\ndef main\((?:.*\n)*.*\.parse_(?:intermixed_)?args\(")


def module_texts(path: Path, fewest: int = FEWEST) -> Iterator[tuple[int, str]]:
    """(line, text) of each string of a module that is no docstring; `` is in place of what is filled in.

    These are messages, warnings and notes, sentences of reports, labels, descriptions of variables and
    of keys, and help of options.
    """
    return (found for found in _module_texts(path) if len(found[1].split()) >= fewest)


@cache
def _module_texts(path: Path) -> list[tuple[int, str]]:
    """All of them, whatever their length: two tests want those of all modules."""
    docstrings = {
        id(n.body[0].value)
        for n in nodes(path)
        if isinstance(n, ast.Module | ast.ClassDef | ast.FunctionDef) and n.body and isinstance(n.body[0], ast.Expr)
    }  # fmt: skip
    pieces = {id(p) for n in nodes(path) if isinstance(n, ast.JoinedStr) for p in n.values}
    exempt = docstrings | pieces
    found: list[tuple[int, str]] = []
    for node in nodes(path):
        if not isinstance(node, ast.JoinedStr | ast.Constant) or id(node) in exempt:
            continue
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        if any(isinstance(p, ast.Constant) and isinstance(p.value, str) for p in parts):
            text = "".join(p.value if isinstance(p, ast.Constant) else "``" for p in parts)
            found.append((node.lineno, text))
    return found


def template_texts(path: Path) -> Iterator[tuple[int, str]]:
    """(line, text) of each text between two tags of a template."""
    template = re.sub(
        r"{{.*?}}|{[%#].*?[%#]}|<small>|</small>|</?b>",
        lambda m: "``" if m[0][1] == "{" else re.sub(r"[^\n]", "", m[0]),
        path.read_text("utf-8"),
        flags=re.S,
    )
    for m in re.finditer(r"[^<>]+(?=<)", template):
        yield template.count("\n", 0, m.start()) + 1, unescape(re.sub(r"\s+", " ", m[0]))


class MadeError(Exception):
    """A parser that is complete, in place of what it would parse."""


@cache
def parsers() -> dict[str, argparse.ArgumentParser]:
    """Module -> the parser of the command that it is, of all commands."""
    found = {}
    for package in ("cosim", "cybership", "diagnosis", "fmucheck", "fmus", "studies", "thesis"):
        for path in sorted((ROOT / package).rglob("*.py")):
            if PARSED.search(path.read_text("utf-8")):
                name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                found[name] = _parser(name)
    return found


def _parser(module: str) -> argparse.ArgumentParser:
    def stop(made: argparse.ArgumentParser, *_: object, **__: object) -> None:
        raise MadeError(made)

    kind = argparse.ArgumentParser
    stopped = patch.multiple(kind, parse_known_args=stop, parse_known_intermixed_args=stop)
    with stopped, patch.object(sys, "argv", [module]):
        try:
            import_module(module).main()
        except MadeError as made:
            return made.args[0]
    raise AssertionError(f"{module}.main parses nothing")


def help_texts(parser: argparse.ArgumentParser) -> Iterator[str]:
    """The description of a command, and the help of its options, as they are shown."""
    yield parser.description or ""
    yield from (shown for _, shown in help_of_arguments(parser))


def help_of_arguments(parser: argparse.ArgumentParser) -> Iterator[tuple[argparse.Action, str]]:
    """Arguments of a command, with their help as it is shown."""
    shown = parser._get_formatter()  # which fills in the defaults
    for action in parser._actions:
        if action.help and action.help is not argparse.SUPPRESS:
            yield action, shown._expand_help(action)


def public_docstrings() -> Iterator[tuple[str, str]]:
    """Public name, and members of public classes, with their docstrings."""
    for package in PACKAGES:
        module = import_module(package)
        for name in module.__all__:
            value = getattr(module, name)
            if callable(value):
                yield f"{package}.{name}", _prose(inspect.getdoc(value) or "")
            for member, held in vars(value).items() if isinstance(value, type) else ():
                inner = held.__func__ if isinstance(held, classmethod | staticmethod) else held
                if member[0] != "_" and (inspect.isfunction(inner) or isinstance(held, property)):
                    yield f"{package}.{name}.{member}", _prose(inspect.getdoc(inner) or "")


def _prose(docstring: str) -> str:
    """A docstring with an entry or a paragraph in each line; `` is in place of names and inline code."""
    text = re.sub(r"``.+?``", "``", docstring, flags=re.DOTALL)
    entries = re.split(rf"\n(?= *(?:{NAMES}: |- |\n))", text)
    return "\n".join(re.sub(rf"^{NAMES}: ", "``: ", " ".join(e.split())) for e in entries)
