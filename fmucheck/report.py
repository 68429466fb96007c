"""What was found, as a table with explanations, as JSON, and the page of all rules."""

from collections.abc import Iterator, Sequence
from typing import Any

from .fmu import FmuArchive
from .registry import Outcome, Rule, in_order

MOST_LINES = 8  # of one rule on one FMU in the terminal; JSON tells all

Outcomes = dict[str, Outcome]  # of one FMU, by the name of the rule

HEAD = """# What `python -m fmus.check` checks

This page lists each rule, its demand on an FMI 2.0 co-simulation FMU, and the clause of the standard
(version 2.0.4). A rule that runs the FMU does so in its own process, so a crash or a hang is a finding.
`python -m fmus.check --list` prints this page.

| rule | demand | clause | |
|---|---|---|---|
"""


def show(fmus: Sequence[FmuArchive], chosen: Sequence[Rule], outcomes: Sequence[Outcomes]) -> None:
    """The table, in as many parts as the terminal needs, and what is to be said of it."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    names = [fmu.path.stem for fmu in fmus]
    heads = names if len(fmus) <= 3 else [str(k) for k in range(1, len(fmus) + 1)]
    widest = max(map(len, heads))
    part = max(1, (console.width - max(len(r.name) for r in chosen)) // (widest + 2))
    for first in range(0, len(fmus), part):
        table = Table(box=None, pad_edge=False)
        table.add_column("check", no_wrap=True)
        for head in heads[first : first + part]:
            table.add_column(head, justify="right", min_width=widest)
        for rule in chosen:
            cells = [_cell(of[rule.name]) for of in outcomes[first : first + part]]
            table.add_row(rule.name, *cells)
        console.print(table, end="\n\n")
    if heads != names:
        console.print(", ".join(f"{k} {name}" for k, name in zip(heads, names, strict=True)))
    for rule in chosen:
        for line in _explain(rule, names, [of[rule.name] for of in outcomes]):
            console.print(line, markup=False, soft_wrap=True)
    for line in _skipped(chosen, names, outcomes):
        console.print(line, markup=False, soft_wrap=True, style="dim")
    total = sum(len(o.found) for of in outcomes for o in of.values())
    console.print(f"{_count(total, 'finding')} in {_count(len(fmus), 'FMU')}")


def _cell(outcome: Outcome) -> str:
    if outcome.found:
        return f"[red]{len(outcome.found)}[/]"
    if outcome.missing:
        return "[yellow]?[/]"
    return "[dim]-[/]" if outcome.skipped else "ok"


def _explain(rule: Rule, names: Sequence[str], outcomes: Sequence[Outcome]) -> Iterator[str]:
    """What a rule found, once for all FMUs of which the same is true."""
    said: dict[str, list[str]] = {}
    for name, outcome in zip(names, outcomes, strict=True):
        texts = outcome.found[:MOST_LINES]
        if len(outcome.found) > MOST_LINES:
            texts = [*texts, f"{len(outcome.found) - MOST_LINES} more, see --json"]
        for text in texts:
            said.setdefault(text, []).append(name)
    if said:
        yield f"{rule.name} (FMI 2.0.4, {rule.clause}): {rule.demand}"
        yield from (f"    {', '.join(those)}: {text}" for text, those in said.items())
        yield ""


def _skipped(
    chosen: Sequence[Rule], names: Sequence[str], outcomes: Sequence[Outcomes]
) -> Iterator[str]:
    """Why rules say nothing, once for all rules and FMUs with the same reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for rule in chosen:
        why: dict[str, list[str]] = {}
        for name, of in zip(names, outcomes, strict=True):
            if of[rule.name].skipped:
                why.setdefault(of[rule.name].skipped, []).append(name)
        for reason, those in why.items():
            reasons.setdefault((reason, ", ".join(those)), []).append(rule.name)
    for (reason, those), rules in reasons.items():
        yield f"not checked: {', '.join(rules)} of {those}: {reason}"


def as_json(
    fmus: Sequence[FmuArchive], chosen: Sequence[Rule], outcomes: Sequence[Outcomes]
) -> dict[str, Any]:
    """Everything, for other programs to read."""
    return {
        "rules": {r.name: {"clause": r.clause, "demand": r.demand, "runs": r.runs} for r in chosen},
        "fmus": [
            {"file": str(fmu.path), "checks": {name: vars(o) for name, o in of.items()}}
            for fmu, of in zip(fmus, outcomes, strict=True)
        ],
        "findings": sum(len(o.found) for of in outcomes for o in of.values()),
    }


def _count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def listing() -> str:
    """All rules as a page in Markdown."""
    rows = [
        f"| `{r.name}` | {r.demand} | {r.clause} | {'runs the FMU' if r.runs else ''} |\n"
        for r in in_order()
    ]
    return HEAD + "".join(rows)
