"""Components as plain C for programs of one's own: ``python -m fmus.build --native NAME --source DIR``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..declare import Component
from .model_source import model_source, sizes
from .program import Program, program

README = """\
# Components as plain C

Generated from the declarations of the components; the same source as that of their FMUs, and the same results
to the bit where compiler options, libm and processor are the same.

Each component is a header and a source of C99. It needs no heap, no globals and nothing but libm; all numbers
are doubles in arrays that the caller keeps. So it runs on a microcontroller, and as many instances of it as
there is memory for.

| component | parameters | inputs | outputs | state | prepared |
|---|--:|--:|--:|--:|--:|
{table}

- `NAME_starts(params, inputs)` fills in the start values.
- `NAME_prepare(params, prepared)` computes what follows from the parameters alone: once, and again after every
  change of one.
- `NAME_init(params, inputs, state)` gives the state at the start.
- `NAME_step(params, prepared, inputs, state, h, after, outputs)` gives state and outputs after a step of h
  seconds. `after` is another array than `state`; with h = 0 the outputs are those of the present state. A
  component with a `NAME_MAX_STEP` takes no longer ones.

The header has the size of each array and the place of each variable in its own. All but `NAME_starts` return 0,
or 1 where they would divide by zero: then what they have written does not count, and the state is still that
from before. Outputs that are not finite are the caller's to notice, as are inputs that are not.

Compile with `-ffp-contract=off -fno-builtin`, without `-ffast-math`; other options may change last digits.

```c
{example}```
"""

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


def export_source(components: Iterable[Component], folder: Path) -> list[Path]:
    """Write the source of some components and a README into a folder, which is made.

    Returns:
        The files.

    Raises:
        TraceError: a component does what C cannot.
        OSError: the folder cannot be written to.
    """
    recorded = [program(component) for component in components]
    files = {"README.md": _readme(recorded)}
    for each in recorded:
        files |= model_source(each)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in files]


def _readme(recorded: list[Program]) -> str:
    rows = [
        "| {name} | {params} | {inputs} | {outputs} | {states} | {prepared} |".format(
            name=each.component.name, **sizes(each)
        )
        for each in recorded
    ]
    name = recorded[0].component.name
    return README.format(table="\n".join(rows), example=EXAMPLE.format(name=name))
