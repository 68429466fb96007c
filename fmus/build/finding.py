"""Which component a name on the command line means: one of ours, or that of a user's file."""

import ast
import importlib.util
import keyword
import math
import traceback
from itertools import chain
from pathlib import Path

from cybership.message_text import PrintableError, failure

from ..base_units import base_exponents
from ..declare import Component, DeclarationError, nearest, variables, width
from ..effects import EffectSet
from ..fmi.trace import Symbol, trace_init, trace_step
from ..ship import Ship, ship
from ..ships.naming import DEFAULT

ROOT = Path(__file__).parent.parent


class BuildError(PrintableError):
    """What was asked for cannot be built; the message says why."""


def which(name: str) -> tuple[str, Path | None]:
    """What a name on the command line means: an FMU of ours, or a user's file and its stem."""
    if not name.endswith(".py"):
        return name.removesuffix(".fmu"), None
    own_file = Path(name)
    if not own_file.is_file():
        raise BuildError(f"no such component file: '{name}'")
    stem = own_file.stem
    taken = {path.stem for path in ROOT.iterdir()}
    if not stem.isidentifier() or keyword.iskeyword(stem) or stem in taken:
        raise BuildError(f"'{name}': a component file cannot be called '{stem}'")
    return stem, own_file


def load(name: str, own_file: Path | None, of: Ship | None = None) -> tuple[str, Component]:
    """Module name and component of an FMU of ours, made for a ship, or of a user's file."""
    if own_file is None:
        of = of or ship()
        known = of.components
        if name in known:
            if of.effects.files:
                _check_effects(known[name][1], of.effects)
            return known[name]
        hint = nearest(name, known) or f"; there are {', '.join(known)}"
        whose = "" if of.name == DEFAULT else f" for the ship '{of.name}'"
        raise BuildError(f"no FMU '{name}'{whose}{hint}")
    spec = importlib.util.spec_from_file_location(own_file.stem, own_file)
    if spec is None or spec.loader is None:
        raise BuildError(f"'{own_file}' cannot be read as a Python module")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except DeclarationError as error:
        raise BuildError(f"'{own_file}': {error}") from error
    except (Exception, SystemExit) as error:
        raise BuildError(f"'{own_file}' fails when imported: {failure(error)}") from error
    component = getattr(module, "COMPONENT", None)
    if not isinstance(component, Component):
        raise BuildError(f"'{own_file}' declares no COMPONENT = Component(...)")
    if (line := _late_import(own_file)) is not None:
        raise BuildError(f"'{own_file}', line {line}: fmus is imported at the top of the file only")
    try:
        _check(component)
        _check_ranges(component)
    except Exception as error:
        raise BuildError(f"{_place_of(error, own_file)}: {error}") from error
    return f"fmus.{own_file.stem}", component


def _check(component: Component) -> None:
    """Find out now what is wrong with a user's component, while the error can still name the line."""
    if not component.name.isidentifier() or not component.name.isascii():
        raise DeclarationError(f"'{component.name}' cannot be the name of an FMU")
    for v in component.variables:
        base_exponents(v.unit)
        if not math.isfinite(v.start):
            raise DeclarationError(f"{v.name} starts at {v.start}")
    for trace in (trace_init(component), trace_step(component)):
        given = (*trace.state, *trace.outputs)
        if wrong := [x for x in given if not isinstance(x, Symbol | float | int)]:
            raise DeclarationError(f"a state or an output is {wrong[0]!r}, and no number")
        if len(trace.outputs) != width(component.outputs):
            raise DeclarationError(
                f"step gives {len(trace.outputs)} outputs, {width(component.outputs)} are declared"
            )


def _late_import(own_file: Path) -> int | None:
    """Line of an import of fmus in a function, which an FMU cannot do; None: there is none."""
    tree = ast.parse(own_file.read_bytes())
    functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    for node in chain.from_iterable(map(ast.walk, functions)):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        if any(name.partition(".")[0] == "fmus" for name in names):
            return getattr(node, "lineno", None)
    return None


def _check_ranges(component: Component) -> None:
    """Refuse a start value outside the range of its variable."""
    for v in (*variables(component.params), *variables(component.inputs)):
        low = -math.inf if v.range.min is None else v.range.min
        high = math.inf if v.range.max is None else v.range.max
        if not low <= v.start <= high:
            raise DeclarationError(
                f"{v.name} starts at {v.start:g}, outside its range of {low:g} to {high:g}"
            )


def _check_effects(component: Component, effects: EffectSet) -> None:
    """Find out now whether a component works with the effects of a user's files."""
    try:
        _check(component)
    except Exception as error:
        places = [_place_of(error, file) for file in effects.files] or [component.name]
        named = [place for place in places if ":" in place] or places
        raise BuildError(f"{named[0]}: {error}") from error


def _place_of(error: Exception, own_file: Path) -> str:
    """File and line of a user's file where an error comes from."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [f for f in frames if Path(f.filename).resolve() == own_file.resolve()]
    return f"{own_file}:{lines[-1].lineno}: {lines[-1].line}" if lines else str(own_file)
