"""A traced component as C, compiled and called: proof that the source can run without Python."""

import ctypes
import shutil
import subprocess

from fmus.fmi.trace import Symbol, ordered

COMPILER = shutil.which("cc") or shutil.which("gcc")

_INFIX = {
    "add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "gt": ">", "ge": ">=",
    "eq": "==", "ne": "!=", "and": "&&", "or": "||",
}  # fmt: skip
_FORMS = {
    "neg": "(-{0})",
    "abs": "fabs({0})",
    "logical_not": "(!{0})",
    "where": "({0} ? {1} : {2})",
    # As fmus.ops has it; C's fmin and fmax treat NaN otherwise.
    "fmin": "({0} < {1} ? {0} : {1})",
    "fmax": "({0} > {1} ? {0} : {1})",
}


def function(results):
    """C source of ``void run(params, inputs, state, h, out)`` that computes traced results."""
    names = {}
    lines = []

    def text(node):
        if isinstance(node, Symbol):
            return names[id(node)]
        return repr(float(node)) if not isinstance(node, bool) else str(int(node))

    for k, node in enumerate(ordered(results)):
        if node.operation == "variable":
            names[id(node)] = node.args[0]
            continue
        args = [text(a) for a in node.args]
        if node.operation in _INFIX:
            value = f"({args[0]} {_INFIX[node.operation]} {args[1]})"
        else:
            value = _FORMS.get(node.operation, f"{node.operation}({', '.join(args)})").format(*args)
        names[id(node)] = f"x{k}"
        lines.append(f"const double x{k} = {value};")
    lines += [f"out[{k}] = {text(result)};" for k, result in enumerate(results)]
    head = "const double *params, const double *inputs, const double *state, double h, double *out"
    body = "\n".join(lines)
    return f"#include <math.h>\nvoid run({head}) {{\n{body}\n}}\n"


def compiled(results, folder):
    """The same as a Python function of (params, inputs, state, h)."""
    (folder / "run.c").write_text(function(results))
    library = folder / "run.so"
    subprocess.run(
        [
            COMPILER,
            "-O0",  # the compiler is most of these tests' time
            "-ffp-contract=off",
            "-shared",
            "-fPIC",
            "-o",
            library,
            folder / "run.c",
            "-lm",
        ],
        check=True,
    )
    run = ctypes.CDLL(str(library)).run
    run.restype = None

    def call(params, inputs, state, h):
        def array(values):
            return (ctypes.c_double * max(1, len(values)))(*values)

        out = array([0.0] * len(results))
        run(array(params), array(inputs), array(state), ctypes.c_double(h), out)
        return list(out)

    return call
