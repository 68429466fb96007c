"""Inputs and outputs of the FMUs of a scenario, as Markdown: ``python -m cosim.interface SCENARIO``.

An FMU that replaces another one needs the same names.
"""

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

from collections.abc import Iterable, Sequence

from .command import BAD_INPUT, Output, command_parser, complain, printable, run_command
from .errors import InputError
from .fmu.fmu_model import FmuVariable
from .scenario.load import load_scenario
from .system.preparation import prepare
from .system.system import System


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = command_parser(
        "cosim.interface",
        "Print tables of inputs and outputs of each FMU of a scenario: names, units, "
        "descriptions, sources and targets of values.",
        "examples:  %(prog)s scenarios/ellipse.json\n           %(prog)s system.ssp > interface.md",
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="JSON file, SSP archive or OSP directory")
    options = parser.parse_args(arguments)
    try:
        system = prepare(load_scenario(options.scenario))
    except InputError as error:
        complain(error)
        return BAD_INPUT
    try:
        text = "\n".join(map(printable, interface(system).split("\n")))
        Output(highlight=False, soft_wrap=True).print(text, markup=False, end="")
    finally:
        system.close()
    return 0


def interface(system: System) -> str:
    """Markdown: a section for each instance, with a table of its inputs and one of its outputs."""
    return "\n".join(_section(system, name) for name in system.models)


def _section(system: System, name: str) -> str:
    model = system.models[name]
    sources = {c.target.name: c.source.name for c in system.connections}
    sinks: dict[str, list[str]] = {}
    for c in system.connections:
        sinks.setdefault(c.source.name, []).append(c.target.name)
    groups: dict[str, list[FmuVariable]] = {"input": [], "output": []}
    for v in model.variables.values():
        groups.setdefault(v.causality, []).append(v)
    lines = [f"## `{name}`: {model.name}", "", f"{model.description.description or ''}.", ""]
    if groups["input"]:
        rows = [(v, sources.get(f"{name}.{v.name}")) for v in groups["input"]]
        rows = [(v, "nothing" if source is None else f"`{source}`") for v, source in rows]
        lines += _table("input", "comes from", rows)
    used = [v for v in groups["output"] if f"{name}.{v.name}" in sinks]
    if used:
        rows = [(v, ", ".join(f"`{to}`" for to in sinks[f"{name}.{v.name}"])) for v in used]
        lines += _table("output", "goes to", rows)
    spare = [v for v in groups["output"] if v not in used]
    if spare:
        lines += [f"Further outputs, which are logged only: {_names(spare)}.", ""]
    if "parameter" in groups:
        lines += [f"It has {len(groups['parameter'])} parameters.", ""]
    return "\n".join(lines)


def _table(kind: str, way: str, rows: Iterable[tuple[FmuVariable, str]]) -> list[str]:
    """Lines of a table, and an empty one."""
    lines = [f"| {kind} | unit | description | {way} |", "|---|---|---|---|"]
    for v, ends in rows:
        unit = v.unit.name if v.unit is not None else ""
        lines.append(f"| `{v.name}` | {unit} | {v.description.replace('|', '/')} | {ends} |")
    return [*lines, ""]


def _names(variables: Iterable[FmuVariable]) -> str:
    return ", ".join(f"`{v.name}`" for v in variables)


if __name__ == "__main__":
    run_command(main)
