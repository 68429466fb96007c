"""Print the table of all model effects: ``python -m fmus.effects [FILE.py ...]``."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from cybership.command_arguments import complain, program

from ..declare import DeclarationError, Variable
from ..installed import plus_files
from ..interruption import run_interruptible
from ..ship import ship
from . import STANDARD
from .effect import Effect
from .effect_set import EffectSet

HEAD = """# Model effects

This page lists the effects that a real ship may have and its nominal model lacks. Every effect is off
(its coefficients are zero) until a parameter of the vessel or the thrusters sets it. All parameters can
change during a run. The effects of actuators are those of the default ship. `python -m fmus.effects`
prints this page.

| id | kind | axis | formula | symbol | parameters [unit] | sign | source |
|---|---|---|---|---|---|---|---|
"""
OF_EACH_RUN = """
The values of these may differ from run to run, as weather, load, fouling and sensors do: {}.
"""


def _cell(text: str) -> str:
    """Text that cannot end a cell of a table."""
    return text.replace("|", "\\|") or "–"


def _parameters(e: Effect) -> str:
    """Names of the parameters with their units, a curve's nodes or many times as one."""
    if len(e.search.intervals) > 1:
        first, *_, last = e.parameters
        return f"`{first.name}`, `{e.parameters[1].name}` … `{last.name}` [{first.unit}]"
    if e.search.by == "given" and len(e.parameters) > 8:
        first, *_, last = e.parameters
        return f"`{first.name}` … `{last.name}`, their units in the FMU"
    if len(e.parameters) > 8:
        first, *_, last, reach = e.parameters
        return f"`{first.name}` … `{last.name}` [{first.unit}], {_one(reach)}"
    return ", ".join(map(_one, e.parameters))


def _one(p: Variable) -> str:
    return f"`{p.name}` [{p.unit}]" + (f" = {p.start:g}" if p.start else "")


def table(effects: EffectSet) -> str:
    """Effects as a table in Markdown."""
    rows = [
        " | ".join(
            [
                f"| `{_cell(e.id)}`<br>{_cell(e.description)}",
                e.kind,
                e.axis,
                _cell(e.formula),
                _cell(e.symbol),
                _parameters(e) or "–",
                _cell(e.sign),
                _cell(e.source) + " |",
            ]
        )
        for e in sorted(effects.values(), key=lambda e: ORDER.index(e.kind))
    ]
    of_each_run = (f"`{e.id}`" for e in effects.values() if e.search.of_each_run)
    return HEAD + "\n".join(rows) + "\n" + OF_EACH_RUN.format(", ".join(of_each_run))


ORDER = ["force", "inertia", "actuator", "environment", "measurement"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog=program("fmus.effects"),
        description="Print the table of all model effects as Markdown.",
        epilog="example:  %(prog)s my_effects.py",
    )
    parser.add_argument(
        "files",
        nargs="*",
        type=Path,
        metavar="FILE.py|NAME",
        help="effects of your own, or of an installed package",
    )
    options = parser.parse_args(arguments)
    try:
        effects = plus_files(STANDARD, options.files)
    except DeclarationError as error:
        complain(error)
        return 2
    print(table(ship(effects).effects), end="")
    return 0


if __name__ == "__main__":
    run_interruptible(main)
