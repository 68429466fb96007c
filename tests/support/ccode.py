"""A component's generated C, compiled and called without the FMI face around it."""

import ctypes
import hashlib
import shutil
import subprocess
from functools import cache

from fmus.declare import flatten, packer, rebuild
from fmus.native.model_source import model_source, sizes
from fmus.native.program import program

from .shared import made_once

OPTIONS = ("-w", "-std=c99", "-ffp-contract=off", "-fno-builtin", "-shared", "-fPIC")
COMPILER = shutil.which("cc") or shutil.which("gcc")


class Compiled:
    """The functions of a component in C, with lists in place of arrays; compiled once in a session.

    Args:
        component: what to compile.
        optimise: option for the compiler, most of whose time goes into optimising.
    """

    def __init__(self, component, optimise="-O0"):
        recorded = program(component)
        texts = model_source(recorded)
        content = hashlib.sha256("".join([optimise, *texts.values()]).encode()).hexdigest()[:16]

        def make(folder):
            for name, text in texts.items():
                (folder / name).write_text(text)
            command = [COMPILER, optimise, *OPTIONS, "-o", folder / "run.so"]
            subprocess.run([*command, folder / f"{component.name}.c", "-lm"], check=True)

        library = made_once(f"{component.name}_{content}", make) / "run.so"
        dll = ctypes.CDLL(str(library))
        names = ("init", "prepare", "step")
        self.functions = {name: getattr(dll, f"{component.name}_{name}") for name in names}
        self.sizes = sizes(recorded)

    def init(self, params, inputs):
        """The initial state, None where C reports an error."""
        (state,) = self.call("init", [params, inputs], ["states"]) or [None]
        return state

    def step(self, params, inputs, state, h):
        """State and outputs after a step, one behind the other; None where C reports an error."""
        prepared = self.call("prepare", [params], ["prepared"])
        if prepared is None:
            return None
        given = [params, *prepared, inputs, state, ctypes.c_double(h)]
        results = self.call("step", given, ["states", "outputs"])
        return None if results is None else results[0] + results[1]

    def call(self, name, given, results):
        """Each of the results, of which a name tells the size, as a list; None where C reports an error."""
        arrays = [_array(x) if isinstance(x, list) else x for x in given]
        filled = [_array([0.0] * self.sizes[group]) for group in results]
        if self.functions[name](*arrays, *filled):
            return None
        return [list(array)[: self.sizes[group]] for array, group in zip(filled, results, strict=True)]


def _array(values):
    return (ctypes.c_double * max(1, len(values)))(*values)


class Stepped:
    """A component that moves on with fixed parameters, by its Python.

    Args:
        component: what moves.
        params: its parameters, nested.
        inputs: nested, those before the first step.
    """

    def __init__(self, component, params, inputs):
        self.component, self._prepared = component, component.prepared(params)
        self._pack = packer(component.inputs)
        self._state = component.init(inputs, params)

    @property
    def state(self):
        """The state now, nested."""
        return self._state

    def advance(self, inputs, h):
        """Outputs, flat, after a step of h [s] with flat inputs."""
        self._state, outputs = self.component.advance(self._state, self._pack(inputs), self._prepared, h)
        return flatten(outputs)


class SteppedInC(Stepped):
    """The same by its C, of which ``test_c_gives_the_same_bits`` holds that the bits are the same."""

    def __init__(self, component, params, inputs):
        super().__init__(component, params, inputs)
        run = _compiled(component)
        flat = flatten(params)
        (prepared,) = run.call("prepare", [flat], ["prepared"])
        self._step = run.functions["step"]
        self._known = _array(flat), _array(prepared)
        self._inputs = _array([0.0] * run.sizes["inputs"])
        self._now, self._after = (_array(flatten(self._state)) for _ in range(2))
        self._outputs = _array([0.0] * run.sizes["outputs"])

    @property
    def state(self):
        return rebuild(self._state, list(self._now))

    def advance(self, inputs, h):
        longest = self.component.max_step
        parts = 1 if longest is None or h <= longest * (1.0 + 1e-9) else -int(-h / longest // 1.0)
        self._inputs[: len(inputs)] = inputs
        for _ in range(parts):
            if self._step(
                *self._known, self._inputs, self._now, ctypes.c_double(h / parts), self._after,
                self._outputs,
            ):  # fmt: skip
                raise ZeroDivisionError
            self._now, self._after = self._after, self._now
        return list(self._outputs)


_compiled = cache(Compiled)
# For long loops.
stepped = Stepped if COMPILER is None else SteppedInC


def same_bits(a, b):
    """Whether two lists of numbers are equal to the sign of a zero; NaN equals NaN."""
    return [float(x).hex() for x in a] == [float(x).hex() for x in b]
