"""A component as C source: its functions in plain C, and the tables that its FMI face reads."""

from __future__ import annotations

import re

from ..declare import Variable, variables, width
from ..fmi.trace import TraceError
from .c_text import PREAMBLE, Writer, number
from .program import Program, program

FACE = "face.c"
TABLES = "tables.h"


def model_source(recorded: Program) -> dict[str, str]:
    """The functions of a component as plain C: neither memory from a heap, nor globals, only libm.

    Returns:
        File name -> text, of a header and a source.
    """
    name = recorded.component.name
    return {f"{name}.h": _header(recorded), f"{name}.c": _source(recorded)}


def repeated_source(recorded: Program) -> dict[str, str]:
    """The source of a component, where a second recording of it gives the same.

    Raises:
        TraceError: they differ, as its functions use a random number, a time or a count of their calls.
    """
    source = model_source(recorded)
    if source != model_source(program(recorded.component)):
        raise TraceError(
            f"{recorded.component.name} cannot be compiled: its functions give another result "
            "when they are called again; they may use their arguments alone, and no random number, "
            "time or count"
        )
    return source


def _heads(name: str) -> dict[str, str]:
    """Function -> its declaration."""
    return {
        "starts": f"void {name}_starts(double *params, double *inputs)",
        "prepare": f"int {name}_prepare(const double *params, double *prepared)",
        "init": f"int {name}_init(const double *params, const double *inputs, double *state)",
        "step": f"int {name}_step(const double *params, const double *prepared, const double *inputs,\n"
        "    const double *state, double h, double *after, double *outputs)",
    }


def sizes(recorded: Program) -> dict[str, int]:
    """How many numbers each array of the functions holds."""
    c = recorded.component
    return {
        "params": width(c.params),
        "inputs": width(c.inputs),
        "outputs": width(c.outputs),
        "states": recorded.states,
        "prepared": len(recorded.prepare.results),
    }


def _header(recorded: Program) -> str:
    c = recorded.component
    guard = f"{c.name.upper()}_H"
    heads = _heads(c.name)
    lines = [
        f"/* {c.name}: {_words(c.description)}. Generated from the component's declaration. */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "/* How many numbers the arrays hold. */",
        "enum {",
        *[f"    {c.name}_{group} = {size}," for group, size in sizes(recorded).items()],
        "};",
        "",
    ]
    for kind, group in (("param", c.params), ("input", c.inputs), ("output", c.outputs)):
        lines += _places(c.name, kind, variables(group))
    if c.max_step is not None:
        lines.append(f"/* Longest step [s]; a longer one has to be divided into equal parts. */\n"
                     f"#define {c.name.upper()}_MAX_STEP {number(c.max_step)}\n")  # fmt: skip
    lines += [
        "/* Start values of parameters and inputs. */",
        f"{heads['starts']};",
        "",
        "/* What follows from the parameters alone: after every change of one. Like the functions below",
        "   it gives 0, or 1 where it divides by zero: what it has written does not count then. */",
        f"{heads['prepare']};",
        "",
        "/* The state at the start; the outputs that belong to it are those of a step with h = 0. */",
        f"{heads['init']};",
        "",
        '/* State and outputs after a step of h [s]. "after" is another array than "state". */',
        f"{heads['step']};",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _places(component: str, kind: str, group: tuple[Variable, ...]) -> list[str]:
    """Names for the places of a group's variables in their array."""
    if not group:
        return []
    entries = [
        f"    {component}_{kind}_{re.sub(r'[^A-Za-z0-9_]', '_', v.name)}, "
        f"/* [{_words(v.unit)}] {_words(v.description)} */"
        for v in group
    ]
    return [f"/* Where each {kind} is in its array. */", "enum {", *entries, "};", ""]


def _words(text: str) -> str:
    return " ".join(text.replace("*/", "* /").split())


def _source(recorded: Program) -> str:
    c = recorded.component
    heads, writer = _heads(c.name), Writer()
    parameters = width(c.params)
    starts = [number(v.start) for v in c.variables[: parameters + width(c.inputs)]]
    return "\n".join(
        [
            f'#include "{c.name}.h"',
            "",
            PREAMBLE,
            *[writer.kernel(kernel) for kernel in recorded.kernels],
            f"{heads['starts']}\n{{",
            "    (void)params, (void)inputs;",
            *[f"    params[{k}] = {x};" for k, x in enumerate(starts[:parameters])],
            *[f"    inputs[{k}] = {x};" for k, x in enumerate(starts[parameters:])],
            "}\n",
            *[writer.function(heads[name], *written) for name, written in recorded.written.items()],
        ]
    )


def tables(recorded: Program, guid: str) -> str:
    """What the FMI face reads of a component: names, sizes, and how values may be set."""
    c = recorded.component
    names = ", ".join(f'"{v.name}"' for v in c.variables)
    fixed = ", ".join(str(int(v.fixed)) for v in c.variables[: width(c.params)])
    held = {"HOLD_NONFINITE": int(c.hold_nonfinite), "MAX_STEP": number(c.max_step or 0.0)}
    defined = {**{k.upper(): n for k, n in sizes(recorded).items()}, **held, "GUID": f'"{guid}"'}
    functions = {f"model_{f}": f"{c.name}_{f}" for f in _heads(c.name)}
    return "\n".join(
        [
            f'#include "{c.name}.c"',
            "",
            *[f"#define {name} {value}" for name, value in {**defined, **functions}.items()],
            "",
            f"static const char *const names[] = {{{names or '0'}}};",
            f"static const char fixed[] = {{{fixed or '0'}}};",
            "",
        ]
    )
