"""Recordings as WebAssembly, without a compiler: operations are instructions or functions of ``Math``.

A module has its own memory, in which each array has a fixed place. Its functions take no arguments: they
read arrays and write arrays, and return 1 where a denominator is zero, else 0. The module imports
functions of ``Math``. In JavaScript::

    const { exports } = new WebAssembly.Instance(new WebAssembly.Module(bytes), { Math });
    const inputs = new Float64Array(exports.memory.buffer, exports.inputs.value, count);

Source: WebAssembly Core Specification 1.0, chapter 5 (binary format).
"""

from __future__ import annotations

import json
import struct
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from ..declare import Component
from ..fmi.trace import Operand
from .c_text import Body, may_fail
from .model_source import sizes
from .program import Program, Written, program
from .tape import Branch, Call, RecordedFunction, RecordedValue

MAGIC = b"\0asm\1\0\0\0"
PAGE = 65536  # bytes of a page of memory, chapter 4.2.8
WIDTH = 8  # bytes of a number
F64, I32, FUNCTION = 0x7C, 0x7F, 0x60  # codes of types, chapter 5.3
VOID = 0x40  # type of a block without a result
# Instruction -> code, chapter 5.4.
CODES = {
    "if": 0x04, "else": 0x05, "end": 0x0B, "return": 0x0F, "call": 0x10, "select": 0x1B,
    "local.get": 0x20, "local.set": 0x21, "f64.load": 0x2B, "f64.store": 0x39,
    "i32.const": 0x41, "f64.const": 0x44, "i32.eqz": 0x45, "i32.and": 0x71, "i32.or": 0x72,
    "f64.eq": 0x61, "f64.ne": 0x62, "f64.lt": 0x63, "f64.gt": 0x64, "f64.le": 0x65, "f64.ge": 0x66,
    "f64.abs": 0x99, "f64.neg": 0x9A, "f64.floor": 0x9C, "f64.sqrt": 0x9F,
    "f64.add": 0xA0, "f64.sub": 0xA1, "f64.mul": 0xA2, "f64.div": 0xA3, "f64.convert_i32_s": 0xB7,
}  # fmt: skip
# Function of Math -> number of its arguments.
MATH = {"sin": 1, "cos": 1, "exp": 1, "log": 1, "atan2": 2}
_LOGIC = {"and": "i32.and", "or": "i32.or", "logical_not": "i32.eqz"}
_FORMS = {
    "fmin": "{0} {1} {0} {1} f64.lt select",
    "fmax": "{0} {1} {0} {1} f64.gt select",
    # Of an infinity NaN, as in Python.
    "floor": "{0} f64.floor {0} {0} f64.sub {0} {0} f64.sub f64.const 0.0 f64.eq select",
    "where": "{1} {2} {0} select",
}


def component_module(recorded: Program) -> bytes:
    """The functions ``prepare``, ``init`` and ``step`` of a component, as in its C.

    The arrays are ``params``, ``inputs``, ``outputs``, ``prepared``, ``state``, ``after`` and ``h`` [s].
    The first three follow each other from the beginning of the memory on, as value references count.
    """
    counts = sizes(recorded)
    states = counts.pop("states")
    return module(recorded.written, {**counts, "state": states, "after": states, "h": 1})


def exported_webassembly(components: Iterable[Component]) -> dict[str, str]:
    """Components for a page: text by name of the file.

    Each file is JSON: the module (``code``, in base64) and the properties that a master must respect:
    ``max_step`` [s], 0 where there is none, and ``hold_nonfinite``.

    Raises:
        TraceError: a component does with a value what can be done with a number only.
    """
    return {
        f"{c.name}.json": json.dumps(
            {
                "code": b64encode(component_module(program(c))).decode(),
                "max_step": c.max_step or 0.0,
                "hold_nonfinite": c.hold_nonfinite,
            }
        )
        for c in components
    }


def module(functions: Mapping[str, Written], arrays: Mapping[str, int]) -> bytes:
    """A module of recorded functions.

    Args:
        functions: exported by these names.
        arrays: name -> count of numbers. The recordings' variables are ``name[k]``, or ``name`` for the
            first number. The place of an array [bytes] is an exported global of its name.

    Returns:
        The module in binary format: the same for the same recordings.
    """
    return _ModuleWriter(functions, arrays).content()


class _Frame(NamedTuple):
    """A kernel's number among all functions, and the places of its arguments and results [bytes]."""

    function: int
    given: int
    results: int


class _ModuleWriter:
    def __init__(self, functions: Mapping[str, Written], arrays: Mapping[str, int]) -> None:
        self.functions, self.used = functions, 0
        self.arrays = {name: self.room(count) for name, count in arrays.items()}
        self.frames: dict[int, _Frame] = {}
        self.kernels: list[RecordedFunction] = []

    def room(self, count: int) -> int:
        """Place of new numbers in memory [bytes]."""
        self.used += WIDTH * count
        return self.used - WIDTH * count

    def frame(self, call: Call) -> _Frame:
        """That of the kernel of a call. No kernel calls itself, so each needs one."""
        if id(call.kernel) not in self.frames:
            index = len(MATH) + len(self.functions) + len(self.kernels)
            given, results = self.room(len(call.args)), self.room(len(call.results))
            self.frames[id(call.kernel)] = _Frame(index, given, results)
            self.kernels.append(call.kernel)
        return self.frames[id(call.kernel)]

    def content(self) -> bytes:
        codes = [_WasmBody(self, self.arrays).code(*written) for written in self.functions.values()]
        for kernel in self.kernels:  # grows while its bodies are written
            frame = self.frames[id(kernel)]
            places = {"given": frame.given, "results": frame.results}
            codes.append(_WasmBody(self, places).code(kernel, [("results", kernel.results)]))
        of_math = [bytes([FUNCTION, count, *[F64] * count, 1, F64]) for count in (1, 2)]
        types = [bytes([FUNCTION, 0, 1, I32]), *of_math]
        imports = [_name("Math") + _name(name) + bytes([0, count]) for name, count in MATH.items()]
        memory = bytes([0]) + _unsigned(-(-max(self.used, 1) // PAGE))
        places = [bytes([I32, 0]) + _constant(at) + bytes([CODES["end"]]) for at in self.arrays.values()]
        exports = [
            _name("memory") + bytes([2, 0]),
            *[_name(f) + bytes([0]) + _unsigned(len(MATH) + k) for k, f in enumerate(self.functions)],
            *[_name(array) + bytes([3]) + _unsigned(k) for k, array in enumerate(self.arrays)],
        ]
        sections = {1: types, 2: imports, 3: [b"\0"] * len(codes), 5: [memory], 6: places, 7: exports,
                    10: codes}  # fmt: skip
        return MAGIC + b"".join(bytes([k]) + _sized(_listed(items)) for k, items in sections.items())


class _WasmBody(Body):
    """The body of one function, as instructions in text form."""

    def __init__(self, module: _ModuleWriter, places: Mapping[str, int]) -> None:
        super().__init__({})
        self.module, self.places = module, places
        self.kinds = bytearray()  # types of the locals

    def code(
        self, recording: RecordedFunction, targets: Iterable[tuple[str, Sequence[Operand]]]
    ) -> bytes:
        """The function as an entry of the section of code."""
        self.write_all(recording)
        for array, results in targets:
            self.lines += [
                self._stored(self.places[array] + WIDTH * k, x) for k, x in enumerate(results)
            ]
        self.lines.append("i32.const 0 end")
        local_types = [b"\1" + bytes([kind]) for kind in self.kinds]
        return _sized(_listed(local_types) + assembled(" ".join(self.lines)))

    def of(self, x: Operand) -> str:
        """Instructions that give a value as a number."""
        if not isinstance(x, RecordedValue):
            return f"f64.const {float(x)!r}"
        if x.operation == "variable":
            array, _, place = x.args[0].rstrip("]").partition("[")
            return f"i32.const 0 f64.load {self.places[array] + WIDTH * int(place or 0)}"
        return f"local.get {self.names[id(x)]}" + (" f64.convert_i32_s" if x.condition else "")

    def _truth(self, x: Operand) -> str:
        """Instructions that give a value as a truth value."""
        if not isinstance(x, RecordedValue):
            return f"i32.const {int(bool(x))}"
        if x.condition and x.operation != "variable":
            return f"local.get {self.names[id(x)]}"
        return f"{self.of(x)} f64.const 0.0 f64.ne"

    def _stored(self, place: int, x: Operand) -> str:
        return f"i32.const 0 {self.of(x)} f64.store {place}"

    def _named(self, x: RecordedValue) -> str:
        if id(x) not in self.names:
            self.names[id(x)] = str(len(self.kinds))
            self.kinds.append(I32 if x.condition else F64)
        return self.names[id(x)]

    def _set(self, x: RecordedValue, to: Operand) -> str:
        return f"{self._truth(to) if x.condition else self.of(to)} local.set {self._named(x)}"

    def _operation(self, x: RecordedValue) -> Iterator[str]:
        args = [self.of(a) for a in x.args]
        if may_fail(x):
            yield f"{args[1]} f64.const 0.0 f64.eq {_FAIL}"
        if x.operation in _LOGIC:
            value = " ".join([*map(self._truth, x.args), _LOGIC[x.operation]])
        elif x.operation == "where":
            cases = map(self._truth, x.args[1:]) if x.condition else args[1:]
            value = _FORMS["where"].format(self._truth(x.args[0]), *cases)
        elif x.operation in _FORMS:
            value = _FORMS[x.operation].format(*args)
        elif x.operation in MATH:
            value = " ".join([*args, f"call {list(MATH).index(x.operation)}"])
        else:
            value = " ".join([*args, f"f64.{x.operation}"])
        yield f"{value} local.set {self._named(x)}"

    def _call(self, call: Call) -> Iterator[str]:
        frame = self.module.frame(call)
        for k, x in enumerate(call.args):
            yield self._stored(frame.given + WIDTH * k, x)
        yield f"call {frame.function} {_FAIL}"
        for k, x in enumerate(call.results):
            if id(x) in self.needed:
                test = " f64.const 0.0 f64.ne" if x.condition else ""
                place = frame.results + WIDTH * k
                yield f"i32.const 0 f64.load {place}{test} local.set {self._named(x)}"

    def _branch(self, branch: Branch, depth: int) -> None:
        self.lines.append(f"{self._truth(branch.condition)} if")
        for word, block, given in zip(("else", "end"), branch.blocks, branch.given, strict=True):
            self._write(block, depth + 1)
            self.lines += [
                self._set(x, to)
                for x, to in zip(branch.results, given, strict=True)
                if id(x) in self.needed
            ]
            self.lines.append(word)


_FAIL = "if i32.const 1 return end"


def assembled(text: str) -> bytes:
    """Instructions in text form, each followed by its operands, in binary format."""
    code = bytearray()
    words = iter(text.split())
    for word in words:
        code.append(CODES[word])
        if word == "f64.const":
            code += struct.pack("<d", float(next(words)))
        elif word == "if":
            code.append(VOID)
        elif word in ("f64.load", "f64.store"):
            code += b"\3" + _unsigned(int(next(words)))  # aligned to 2**3 bytes
        elif word in ("call", "local.get", "local.set", "i32.const"):  # constants here are 0 and 1
            code += _unsigned(int(next(words)))
    return bytes(code)


def _unsigned(value: int) -> bytes:
    """A number in LEB128, chapter 5.2.2."""
    code = bytearray()
    while value > 0x7F:
        code.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*code, value])


def _constant(value: int) -> bytes:
    """Instruction for a constant that is not negative: its last byte has a sign bit, which is 0."""
    code = _unsigned(value)
    return bytes([CODES["i32.const"]]) + (
        code if code[-1] < 0x40 else code[:-1] + bytes([code[-1] | 0x80, 0])
    )


def _sized(content: bytes) -> bytes:
    return _unsigned(len(content)) + content


def _listed(items: Sequence[bytes]) -> bytes:
    return _unsigned(len(items)) + b"".join(items)


def _name(text: str) -> bytes:
    return _sized(text.encode())
