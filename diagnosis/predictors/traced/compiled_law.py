"""A recorded law of a step in C, which takes all steps of all windows and models in one call.

It takes a tenth of the time of numpy, where a step is some hundred operations on short arrays. The
compiler is that of the system; where there is none, numpy does the same work. Both differ in the last
bit of a sine or an exponential.
"""

import ctypes
import hashlib
import shutil
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cybership.user_cache import RefusedError, cache_folder, kept
from fmus.native.c_text import PREAMBLE, Writer
from fmus.native.compilers import OPTIONS, SYSTEM, TARGETS, CompilerError, compiled, this_platform
from fmus.native.tape import Kernels, RecordedFunction

# Each argument has a pointer, and its strides by step, model and window in numbers, which are zero where
# it does not change. A step is done for as many windows as fill a line of the cache.
LOOP = """
#define STATE {state}
#define MOVING (STATE + {inputs})
#define COUNT {count}
#define BLOCK 8

#if defined(_WIN32)
__declspec(dllexport)
#else
__attribute__((visibility("default")))
#endif
void steps(const long long *size, const double *const *at, const long long *stride, double *out)
{{
    const long long models = size[1], windows = size[2], kept = size[3], points = models * windows;
    double given[BLOCK][COUNT];
    double after[STATE];
    for (long long m = 0; m < models; m++)
        for (long long first = 0; first < windows; first += BLOCK) {{
            const int block = windows - first < BLOCK ? windows - first : BLOCK;
            double *to = out + m * windows + first;
            for (int k = 0; k < COUNT; k++)
                for (int w = 0; w < block; w++)
                    given[w][k] = at[k][stride[3 * k + 1] * m + stride[3 * k + 2] * (first + w)];
            for (int k = 0; k < kept; k++)
                for (int w = 0; w < block; w++)
                    to[k * points + w] = given[w][k];
            for (long long n = 0; n < size[0]; n++) {{
                to += kept * points;
                for (int w = 0; w < block; w++) {{
                    for (int k = STATE; k < MOVING; k++) {{
                        const long long *by = stride + 3 * k;
                        given[w][k] = at[k][by[0] * n + by[1] * m + by[2] * (first + w)];
                    }}
                    recorded(given[w], after);
                    for (int k = 0; k < STATE; k++)
                        given[w][k] = after[k];
                    for (int k = 0; k < kept; k++)
                        to[k * points + w] = after[k];
                }}
            }}
        }}
}}
"""


class CompiledLaw(NamedTuple):
    """A law of a step, compiled.

    Attributes:
        library: the machine code.
        state: how many numbers its state has.
        arguments: how many there are, the state's included.
    """

    library: ctypes.CDLL
    state: int
    arguments: int

    def states(
        self,
        start: Sequence[np.ndarray],
        inputs: Sequence[np.ndarray],
        numbers: Sequence[np.ndarray],
        kept: int | None = None,
    ) -> np.ndarray:
        """The state at the start and after each step.

        Args:
            start: the state's numbers, each like (p, w), of p models and w windows.
            inputs: what acts during a step, each (steps, ...) and like (p, w) beside that, floats.
            numbers: all else, each like (p, w).
            kept: how many numbers of a state are returned, the first ones; by default all.

        Returns:
            (steps + 1, kept, p, w).

        Raises:
            TypeError: not as many arguments as the law has.
        """
        if len(start) + len(inputs) + len(numbers) != self.arguments:
            raise TypeError(f"the law takes {self.arguments} numbers")
        still = [np.asarray(x, float) for x in (*start, *numbers)]
        steps, kept = len(inputs[0]), self.state if kept is None else kept
        moving = [
            np.asarray(x, float).reshape(steps, *(1,) * (3 - x.ndim), *x.shape[1:]) for x in inputs
        ]
        shape = np.broadcast_shapes((1, 1), *(x.shape for x in still), *(x.shape[1:] for x in moving))
        each = [np.broadcast_to(x, (1, *shape)) for x in still]
        each[len(start) : len(start)] = [np.broadcast_to(x, (steps, *shape)) for x in moving]
        strides = np.array([x.strides for x in each]) // np.dtype(float).itemsize
        strides[[len(x) == 1 for x in each], 0] = 0
        out = np.empty((steps + 1, kept, *shape))
        at = np.array([x.ctypes.data for x in each])
        parts = np.array([steps, *shape, kept]), at, strides, out
        self.library.steps(*(ctypes.c_void_p(x.ctypes.data) for x in parts))
        return out


def compiled_law(
    recording: RecordedFunction, kernels: Kernels, inputs: int, count: int
) -> CompiledLaw | None:
    """A recording as machine code; None: this computer has no compiler, or it refuses.

    Args:
        recording: gives the state, of arguments ``given[0]`` and so on: the state, then the inputs.
        kernels: those that it calls.
        inputs: how many of the arguments are inputs.
        count: of all arguments.
    """
    writer, state = Writer(raises=False), len(recording.results)
    text = [PREAMBLE, *(writer.kernel(k) for k in kernels.recordings)]
    head = "static int recorded(const double *given, double *after)"
    text.append(writer.function(head, recording, [("after", recording.results)]))
    text.append(LOOP.format(state=state, inputs=inputs, count=count))
    library = _library("\n".join(text))
    return None if library is None else CompiledLaw(library, state, count)


@cache
def compiler() -> bool:
    """Whether the system has a C compiler for this computer."""
    return this_platform() in TARGETS and any(map(shutil.which, SYSTEM))


@cache
def _library(text: str) -> ctypes.CDLL | None:
    """The library of a source, from the user's cache if it is there."""
    target = this_platform()
    if not compiler() or (root := cache_folder()) is None:
        return None
    key = repr((text, OPTIONS, target))
    path = (
        root / "predictions" / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}{TARGETS[target].suffix}"
    )

    def make(work: Path) -> Path:
        source, built = work / "step.c", work / "built"
        source.write_text(text)
        built.write_bytes(compiled(source, target, work))
        return built

    try:
        return ctypes.CDLL(str(kept(root, path, make)))
    except (OSError, CompilerError, RefusedError):
        return None
