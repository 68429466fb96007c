"""Components as plain C for users' programs: ``python -m fmus.build --native NAME --source DIR``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..declare import Component
from .model_source import repeated_source, sizes
from .program import Program, program

README = Path(__file__).with_name("source_readme.md")

EXAMPLE = """\
#include <stdio.h>
#include <string.h>

#include "{name}.h"

int main(void) {{
    /* One place more, because C has no empty arrays. */
    double params[{name}_params + 1], prepared[{name}_prepared + 1], inputs[{name}_inputs + 1];
    double state[{name}_states + 1], after[{name}_states + 1], outputs[{name}_outputs + 1];
    int k;

    {name}_starts(params, inputs);
    if ({name}_prepare(params, prepared) || {name}_init(params, inputs, state)) return 1;
    for (k = 0; k < 100; k++) {{
        if ({name}_step(params, prepared, inputs, state, 0.01, after, outputs)) return 1;
        memcpy(state, after, sizeof state);
    }}
    for (k = 0; k < {name}_outputs; k++) printf("%.17g\\n", outputs[k]);
    return 0;
}}
"""


def exported_source(components: Iterable[Component]) -> dict[str, str]:
    """The source of some components and a README, text by name of the file.

    Raises:
        TraceError: a component does what C cannot.
    """
    recorded = [program(component) for component in components]
    files = {"README.md": _readme(recorded)}
    for each in recorded:
        files |= repeated_source(each)
    return files


def _readme(recorded: list[Program]) -> str:
    rows = [
        "| {name} | {params} | {inputs} | {outputs} | {states} | {prepared} |".format(
            name=each.component.name, **sizes(each)
        )
        for each in recorded
    ]
    name = recorded[0].component.name
    return README.read_text(encoding="utf-8").format(
        table="\n".join(rows), example=EXAMPLE.format(name=name)
    )
