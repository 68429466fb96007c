"""A component's generated C, compiled and called without the FMI face around it."""

import ctypes
import shutil
import subprocess

from fmus.native.model_source import model_source, sizes
from fmus.native.program import program

COMPILER = shutil.which("cc") or shutil.which("gcc")


class Compiled:
    """The functions of a component in C, with lists in place of arrays.

    Args:
        component: what to compile.
        folder: where source and library are kept.
        optimise: option for the compiler, most of whose time goes into optimising.
    """

    def __init__(self, component, folder, optimise="-O0"):
        recorded = program(component)
        for name, text in model_source(recorded).items():
            (folder / name).write_text(text)
        library = folder / f"{component.name}.so"
        command = [
            COMPILER,
            optimise,
            "-w",
            "-std=c99",
            "-ffp-contract=off",
            "-fno-builtin",
            "-shared",
            "-fPIC",
        ]
        subprocess.run([*command, "-o", library, folder / f"{component.name}.c", "-lm"], check=True)
        dll = ctypes.CDLL(str(library))
        names = ("init", "prepare", "step")
        self._functions = {name: getattr(dll, f"{component.name}_{name}") for name in names}
        self.sizes = sizes(recorded)

    def init(self, params, inputs):
        """The initial state, None where C reports an error."""
        (state,) = self._call("init", [params, inputs], ["states"]) or [None]
        return state

    def step(self, params, inputs, state, h):
        """State and outputs after a step, one behind the other; None where C reports an error."""
        prepared = self._call("prepare", [params], ["prepared"])
        if prepared is None:
            return None
        given = [params, *prepared, inputs, state, ctypes.c_double(h)]
        results = self._call("step", given, ["states", "outputs"])
        return None if results is None else results[0] + results[1]

    def _call(self, name, given, results):
        arrays = [_array(x) if isinstance(x, list) else x for x in given]
        filled = [_array([0.0] * self.sizes[group]) for group in results]
        if self._functions[name](*arrays, *filled):
            return None
        return [list(array)[: self.sizes[group]] for array, group in zip(filled, results, strict=True)]


def _array(values):
    return (ctypes.c_double * max(1, len(values)))(*values)


def same_bits(a, b):
    """Whether two lists of numbers are equal to the sign of a zero; NaN equals NaN."""
    return [float(x).hex() for x in a] == [float(x).hex() for x in b]
