"""Parameters and inputs of the FMUs as a page: ``python tests/support/fmu_variables.py > docs/fmu_variables.md``."""

import re
import sys
from collections.abc import Iterable, Iterator

from fmus.actuators.law import Law
from fmus.declare import Variable, parameters_of, variables
from fmus.hull_functions import FUNCTIONS
from fmus.ship import ship

HEAD = """# Parameters of the FMUs

With this page you can look up the parameters and inputs of each FMU of CyberShip Enterprise 1, with start values, units and ranges, and those that a
ship file may give. A start value holds where a scenario or a ship file gives none. `python -m fmus.build --list vessel` prints the variables of one
FMU, its outputs included; `python tests/support/fmu_variables.py` prints this page.
"""


def row(v: Variable) -> tuple[str, ...]:
    """What a table says of a variable after its name."""
    low, high = v.range.min, v.range.max
    allowed = [f"≥ {low!r}"] * (low is not None) + [f"≤ {high!r}"] * (high is not None)
    allowed += ["at initialisation"] * v.fixed
    known = ""
    if v.known:
        known = f", known to ± {v.known.std!r}" if v.known.std else f", ± {100.0 * v.known.share:.3g} %"
    return repr(v.start), v.unit, ", ".join(allowed), v.description + known


def table(owners: Iterable[tuple[str, Iterable[Variable]]]) -> Iterator[str]:
    """Lines of a table: the variables of a series, and equal ones of several owners, share one line."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for owner, declared in owners:
        series: dict[tuple[str, ...], list[Variable]] = {}
        for v in declared:
            *first, text = row(v)
            key = *(re.sub(r"(?<=[_ ])\d+\b", "K", of) for of in (v.name, text)), *first
            series.setdefault(key, []).append(v)
        for members in series.values():
            names, cells = [v.name for v in members], row(members[0])
            name = f"`{names[0]}`" + f" … `{names[-1]}` ({len(names)})" * (len(names) > 1)
            rows.setdefault((name, *(c.replace("|", "\\|") for c in cells)), []).append(owner)
    yield "| name | start | unit | allowed | description | of |\n|---|--:|---|---|---|---|"
    for cells, names in rows.items():
        more = f" and {len(names) - 2} more" * (len(names) > 3)
        yield f"| {' | '.join(cells)} | {', '.join(f'`{n}`' for n in names[: 2 if more else 3])}{more} |"


def page() -> str:
    """The whole page."""
    components = [c for _, c in ship().components.values()]
    lines = [HEAD, "## Parameters of FMUs", ""]
    lines += [*table((c.name, variables(c.params)) for c in components), "", "## Inputs of FMUs", ""]
    lines += [*table((c.name, variables(c.inputs)) for c in components), ""]
    lines += ["## Actuators of a ship file", ""]
    ours = {n: law for n, law in Law.known.items() if law.__module__.startswith("fmus.actuators.")}
    lines += [*table((name, variables(law.Parameters)) for name, law in ours.items()), ""]
    lines += ["## Hull functions of a ship file", ""]
    lines += table((name, parameters_of(name, 3, f)) for name, f in FUNCTIONS.items())
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.reconfigure(encoding="utf-8")
    sys.stdout.write(page())
