"""Parameters and inputs of the FMUs as a page: ``python tests/support/fmu_variables.py > docs/fmu_variables.md``."""

import sys
from collections.abc import Iterable, Iterator

from fmus.actuators.law import Law
from fmus.declare import Variable, parameters_of, variables
from fmus.hull_functions import FUNCTIONS
from fmus.ship import ship

HEAD = """# Parameters of the FMUs

With this page you can look up the parameters and inputs of each FMU of CyberShip Enterprise 1, with start values, units and ranges, and those that a
ship file may give. A start value holds where a scenario or a ship file gives none. `python -m fmus.build --list vessel` prints the variables of one
FMU with their descriptions, its outputs included. `python tests/support/fmu_variables.py` prints this page.
"""


def limits(v: Variable) -> str:
    """What a table says of the values that a variable may have, and of how well it is known."""
    low, high = v.range.min, v.range.max
    found = [f"≥ {low!r}"] * (low is not None) + [f"≤ {high!r}"] * (high is not None)
    found += ["at initialisation"] * v.fixed
    if v.known:
        found.append(f"± {v.known.std!r}" if v.known.std else f"± {100.0 * v.known.share:.3g} %")
    return ", ".join(found)


def table(owners: Iterable[tuple[str, Iterable[Variable]]]) -> Iterator[str]:
    """Lines of a table: variables of the same owners and limits share one line."""
    of: dict[tuple[str, float, str, str], list[str]] = {}
    for owner, declared in owners:
        for v in declared:
            of.setdefault((v.name, v.start, v.unit, limits(v)), []).append(owner)
    rows: dict[tuple[str, str], dict[str, list[str]]] = {}
    for (name, start, unit, allowed), names in of.items():
        more = f" and {len(names) - 2} more" * (len(names) > 3)
        owned = ", ".join(f"`{n}`" for n in names[: 2 if more else 3]) + more
        rows.setdefault((owned, allowed), {}).setdefault(f"{start!r} {unit}", []).append(f"`{name}`")
    yield "| of | allowed, known to | start values |\n|---|---|---|"
    for cells, starts in rows.items():
        stated = "; ".join(f"{start}: {', '.join(names)}" for start, names in starts.items())
        yield f"| {' | '.join(cells)} | {stated} |"


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
