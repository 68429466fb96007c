"""What a rule is, what it finds, and the table of all rules.

A rule is a generator function that yields one line of text for each violation. Its name is that of the
function, its first paragraph tells what it demands; the clause is one of FMI 2.0.4.

    @rule("2.2.5")
    def experiment(fmu):
        '''The default experiment ends after it starts.'''
        ...

    @trial("2.1.6")
    def reset(fmu):
        '''fmi2Reset brings back the FMU as it was instantiated.'''
        ...
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from fmus.docstring import docstring


class NotApplicableError(Exception):
    """The rule does not concern this FMU, or cannot be checked here; the message says why."""


class NotInstalledError(NotApplicableError):
    """The rule asks a tool that is not there."""


@dataclass(frozen=True)
class Rule:
    """One demand on an FMU.

    Attributes:
        name: what the table calls it.
        clause: of FMI 2.0.4, or of several.
        demand: what it demands, one sentence.
        group: the module it is from.
        check: gives the violations, one line each.
        runs: whether it runs the FMU, and so wants a process of its own.
    """

    name: str
    clause: str
    demand: str
    group: str
    check: Callable[[Any], Iterable[str]]
    runs: bool


@dataclass
class Outcome:
    """What one rule found on one FMU.

    Attributes:
        found: violations, one line each.
        skipped: why the rule says nothing (more); empty if it was checked.
        missing: whether that is because a tool is not installed.
    """

    found: list[str] = field(default_factory=list)
    skipped: str = ""
    missing: bool = False


RULES: dict[str, Rule] = {}


def in_order() -> list[Rule]:
    """All rules, those that only read the FMU first."""
    return sorted(RULES.values(), key=lambda rule: rule.runs)


_Check = Callable[[Any], Iterable[str]]


def _register(clause: str, runs: bool) -> Callable[[_Check], _Check]:
    def add(check: _Check) -> _Check:
        name = check.__name__.replace("_", "-")
        if name in RULES:
            raise ValueError(f"two rules are called '{name}'")
        demand = " ".join(docstring(check).split("\n\n")[0].split())
        RULES[name] = Rule(name, clause, demand, check.__module__.rpartition(".")[2], check, runs)
        return check

    return add


def rule(clause: str) -> Callable[[_Check], _Check]:
    """Register a function of an :class:`~fmucheck.fmu.FmuArchive` that reads the archive."""
    return _register(clause, runs=False)


def trial(clause: str) -> Callable[[_Check], _Check]:
    """Register a function of a :class:`~fmucheck.fmu_on_trial.FmuOnTrial` that runs the FMU."""
    return _register(clause, runs=True)
