"""The commands behind ``cybership NAME``, each a module that ``python -m`` runs as well.

An installed package adds commands by entry points of the group ``cybership.commands``: name = module.
The first line of the module's docstring is the command's purpose.
"""

import ast
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

GROUP = "cybership.commands"


class Subcommand(NamedTuple):
    """A command.

    Attributes:
        module: that runs it.
        purpose: in one line.
    """

    module: str
    purpose: str


# Those that are always there, in the order in which people meet them.
SUBCOMMANDS = {
    "demo": Subcommand(
        "cybership.demo", "run a ship with hidden drag, diagnose it, run it with the learned model"
    ),
    "run": Subcommand("cosim.run", "run a scenario: log, metrics, pictures"),
    "open": Subcommand("cosim.live", "a page in which a scenario runs, to look at and to change"),
    "metrics": Subcommand("cosim.metrics", "metrics of a finished run"),
    "plots": Subcommand("cosim.plots", "pictures of runs in the same axes; PNG, SVG or PDF"),
    "trial": Subcommand(
        "diagnosis.measure_trial", "measures of a manoeuvring trial, simulated or measured"
    ),
    "join": Subcommand("diagnosis.join", "make one table of the files of one run"),
    "columns": Subcommand(
        "diagnosis.propose_columns", "propose the JSON file that states how to read your measurement"
    ),
    "repair": Subcommand(
        "diagnosis.repair", "repair faults of a measurement that its redundant channels show"
    ),
    "compare": Subcommand(
        "diagnosis.compare", "compare a model with measured runs: size and location of its error"
    ),
    "criteria": Subcommand("diagnosis.criteria", "a template of criteria for compare --criteria"),
    "verify": Subcommand("diagnosis.verify", "check a validation record that compare has written"),
    "learn": Subcommand("diagnosis.learn", "find the physical effect that a model lacks"),
    "next": Subcommand("diagnosis.design_run", "design the run that discriminates candidate causes"),
    "parameters": Subcommand("diagnosis.parameters", "parameters of an FMU that can be calibrated"),
    "linearise": Subcommand("diagnosis.linearise", "A, B, C, D of an FMU in a state"),
    "campaign": Subcommand("cosim.campaign", "many runs: grids and samples, one table, differences"),
    "build": Subcommand("fmus.build", "build the FMUs, or one from a component file of your own"),
    "check": Subcommand("fmus.check", "check FMUs against the FMI 2.0 standard"),
    "effects": Subcommand("fmus.effects", "table of the effects that a model may lack"),
    "export": Subcommand("cosim.export", "a scenario for other tools: SSP, OSP, one FMU"),
    "interface": Subcommand("cosim.interface", "inputs and outputs of each FMU of a scenario"),
    "schema": Subcommand("cosim.scenario", "the JSON schema of scenario files"),
    "completion": Subcommand("cybership.completion", "completion for bash, zsh or fish"),
}


def all_modules() -> dict[str, str]:
    """Command -> module: those above, and those of installed packages, which replace none of them."""
    own = {name: command.module for name, command in SUBCOMMANDS.items()}
    return {**own, **{p.name: p.value for p in sorted(entry_points(group=GROUP))}, **own}


def purpose(name: str, module: str) -> str:
    """The purpose of a command in one line; the module of an installed package is read, not run."""
    if name in SUBCOMMANDS:
        return SUBCOMMANDS[name].purpose
    try:
        spec = find_spec(module)  # imports the package around it
        source = Path(spec.origin if spec and spec.origin else "").read_text(encoding="utf-8")
        stated = ast.get_docstring(ast.parse(source)) or ""
    except (Exception, SystemExit) as error:
        return f"cannot be run: {module}: {error}"
    first = stated.partition("\n")[0].rstrip(".")
    return first[:1].lower() + first[1:]
