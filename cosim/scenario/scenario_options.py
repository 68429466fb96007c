"""Options of commands that run scenarios: which ship, what differs from the file, and how FMUs run."""

import argparse
from pathlib import Path
from typing import Any

from ..command import positive, whole_number
from ..compiled.library import NATIVE
from .load import cut_short, load_scenario, with_settings
from .schema import Scenario
from .setting import parse_assignment

OPTIONS: dict[str, dict[str, Any]] = {
    "--stop": {
        "type": positive,
        "metavar": "SECONDS",
        "help": "end of the run [s] (default: that of the scenario)",
    },
    "--seed": {
        "type": whole_number(0),
        "metavar": "N",
        "help": "seed of noise and faults (default: that of the scenario)",
    },
    "--ship": {
        "metavar": "NAME|FILE.toml",
        "help": "ship for FMUs that the scenario names without a path: a shipped one, or a file of your "
        "own (default: that of the scenario)",
    },
    "--set": {
        "metavar": "PATH=VALUE",
        "action": "append",
        "default": [],
        "help": "a value of the scenario, such as vessel.m=15 (a parameter), controller=./mine.fmu, "
        "faults.0.std=0.001; may be given several times",
    },
    "--parameters": {
        "metavar": "FILE.ssv",
        "action": "append",
        "default": [],
        "help": "SSP parameter set for the plant, the simulated ship; its values override those of the "
        "scenario; may be given several times",
    },
    "--timeout": {
        "type": positive,
        "metavar": "SECONDS",
        "help": "longest time of a call to an FMU [s] (default: 100 times its usual step, at least "
        "30 s)",
    },
    "--native": {"action": argparse.BooleanOptionalAction, "help": NATIVE},
    "--quiet": {"action": "store_true", "help": "print only errors"},
}


def add_scenario_options(parser: argparse.ArgumentParser, *names: str) -> None:
    """Add the options of these names, in their order."""
    for name in names:
        parser.add_argument(name, **OPTIONS[name])


def chosen_scenario(options: argparse.Namespace, *more: tuple[str, Any]) -> Scenario:
    """The scenario that a command is given, with what its options change of it.

    Args:
        options: of the command line: ``scenario``, and of the options above those that the command has.
        more: further values by their paths.

    Raises:
        InputError: no such scenario, or a value that it cannot have.
    """
    given = vars(options)
    scenario = load_scenario(options.scenario, {k: given.get(k) for k in ("step", "stop", "seed")})
    settings = [*map(parse_assignment, given.get("set", ())), *more]
    settings += [(k, given[k]) for k in ("native", "ship") if given.get(k) is not None]
    if settings:
        scenario = with_settings(scenario, settings, Path.cwd(), "--set" if "set" in given else "--ship")
    is_chosen = given.get("stop") is not None or "stop" in dict(settings)
    return cut_short(scenario) if is_chosen else scenario
