"""The commands behind ``cybership NAME``, each a module that ``python -m`` runs as well."""

from typing import NamedTuple


class Subcommand(NamedTuple):
    """A command.

    Attributes:
        module: that runs it.
        purpose: in one line.
    """

    module: str
    purpose: str


# In the order in which people meet them.
SUBCOMMANDS = {
    "demo": Subcommand("cybership.demo", "all in one: sail, diagnose, sail with what was found"),
    "run": Subcommand("cosim.run", "run a scenario: log, metrics, pictures"),
    "metrics": Subcommand("cosim.metrics", "metrics of a finished run"),
    "plots": Subcommand("cosim.plots", "pictures of runs, laid over each other; PNG, SVG or PDF"),
    "trial": Subcommand("diagnosis.measure_trial", "measures of a manoeuvring trial, run or measured"),
    "columns": Subcommand("diagnosis.propose_columns", "what must be told of a measurement of your own"),
    "repair": Subcommand("diagnosis.repair", "what a run's own channels show to be wrong, repaired"),
    "compare": Subcommand("diagnosis.compare", "where does a model fail against measured runs?"),
    "criteria": Subcommand("diagnosis.criteria", "a first file of criteria for compare --criteria"),
    "verify": Subcommand("diagnosis.verify", "check a validation record that compare has made"),
    "learn": Subcommand("diagnosis.learn", "which physical effect does the model lack?"),
    "campaign": Subcommand("cosim.campaign", "many runs: grids and samples, one table, differences"),
    "build": Subcommand("fmus.build", "build the FMUs, or one from a component file of your own"),
    "check": Subcommand("fmus.check", "hold FMUs against the FMI 2.0 standard"),
    "effects": Subcommand("fmus.effects", "table of what the ship may have and its model lacks"),
    "export": Subcommand("cosim.export", "a scenario for other tools: SSP, OSP, one FMU"),
    "interface": Subcommand("cosim.interface", "what each FMU of a scenario gets and gives"),
    "schema": Subcommand("cosim.scenario", "the JSON schema of scenario files"),
    "replay": Subcommand("diagnosis.replay", "a measured run through an observer: what it blocks"),
    "sysid": Subcommand("diagnosis.sysid", "system identification by concurrent learning"),
    "watch": Subcommand("diagnosis.watch", "thrusters that fail during a run"),
    "pca": Subcommand("diagnosis.pca", "principal components and outliers of runs"),
    "pls": Subcommand("diagnosis.pls", "partial least squares of the model error"),
    "completion": Subcommand("cybership.completion", "completion for bash, zsh or fish"),
}
