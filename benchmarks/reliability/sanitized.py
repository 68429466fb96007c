"""The C files under the address and undefined-behaviour sanitizers, with random calls.

A compiler that adds the sanitizers is put before that of the system, so that all that is compiled has
them: the face and the model of a native FMU, which gets random sequences of FMI calls, and the step loop
and the text of the log, which run shipped scenarios beside those in Python. The process has to start
with the sanitizer's library; :func:`sanitized_calls` does so.
"""

import argparse
import ctypes
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import read_model_description

import cosim
from cosim.scenario import with_settings
from fmus.build import build, native_targets

ROOT = Path(__file__).parent.parent.parent
FLAGS = "-O0 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
FMUS = ("vessel", "observer_mdf", "guidance_ellipse")
SCENARIOS = ("ellipse",)
MODULE = "benchmarks.reliability.sanitized"
CALLS = 60  # in a sequence
EACH = 250  # sequences in one process
NUMBERS = (0.0, 1.0, -1.0, 1e-300, 1e300, math.inf, -math.inf, math.nan, 0.01, 5.0, 1e9)


def sanitized_calls(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Random sequences of calls, and random runs, in processes of their own; what misbehaved."""
    if sys.platform != "linux" or shutil.which("gcc") is None:
        return []
    asan = subprocess.run(
        ["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    folder = work / "compiler"
    folder.mkdir(exist_ok=True)
    gcc = folder / "gcc"
    gcc.write_text(f'#!/bin/sh\nunset LD_PRELOAD\nexec {shutil.which("gcc")} "$@" {FLAGS}\n')
    gcc.chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{folder}:{os.environ['PATH']}",
        "CYBERSHIP_CACHE": str(work / "sanitized"),
        "LD_PRELOAD": asan,
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",
    }
    wrong = []
    for first in range(0, count, EACH):
        some = min(EACH, count - first)
        done = subprocess.run(
            [sys.executable, "-m", MODULE, "--sequences", str(some), "--seed", str(seed + first)],
            capture_output=True, text=True, errors="replace", cwd=ROOT, env=environment, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            said = [line for line in done.stderr.splitlines() if "ERROR" in line or "error" in line]
            wrong.append(f"sequences from {first}: exit code {done.returncode}: {(said or ['?'])[0]}")
        for _ in range(some):
            advance()
    return wrong


class Calls:
    """Random calls of the FMI functions of one instance.

    Args:
        fmu: whose library has the sanitizers.
        rng: of all choices.
    """

    def __init__(self, fmu: Path, folder: Path, rng: random.Random) -> None:
        described: Any = read_model_description(str(fmu))
        name = described.coSimulation.modelIdentifier
        library = folder / fmu.stem / f"binaries/{fmpy.platform}/{name}{fmpy.sharedLibraryExtension}"
        if not library.exists():
            fmpy.extract(str(fmu), str(folder / fmu.stem))
        self._dll, self._rng = ctypes.CDLL(str(library)), rng
        self._dll.fmi2Instantiate.restype = ctypes.c_void_p
        self._count = len(described.modelVariables)
        outputs = [v.valueReference for v in described.modelVariables if v.causality == "output"]
        self._outputs = (ctypes.c_uint * len(outputs))(*outputs)
        self._states: list[tuple[ctypes.c_void_p, bytes | None]] = []
        guid = str(described.guid).encode()
        self._c = ctypes.c_void_p(self._dll.fmi2Instantiate(b"a", 1, guid, None, None, 0, 1))
        self._initialised = False

    def _call(self, name: str, *arguments: Any) -> int:
        status = getattr(self._dll, name)(self._c, *arguments)
        if not 0 <= status <= 4:
            raise AssertionError(f"{name} returned {status}")
        return status

    def _number(self) -> ctypes.c_double:
        return ctypes.c_double(self._rng.choice((*NUMBERS, self._rng.gauss(0.0, 3.0))))

    def values(self) -> None:
        """Set or get Reals, some of which do not exist."""
        n = self._rng.choice((0, 1, 5, self._count))
        chosen = [self._rng.randrange(self._count + 2) for _ in range(n)]
        references = (ctypes.c_uint * max(1, n))(*chosen[:n])
        numbers = (ctypes.c_double * max(1, n))(*(self._number().value for _ in range(n)))
        self._call(
            self._rng.choice(("fmi2SetReal", "fmi2GetReal")), references, ctypes.c_size_t(n), numbers
        )

    def step(self) -> None:
        status = self._call("fmi2DoStep", self._number(), self._number(), 1)
        if status == 0 and not self._initialised:
            raise AssertionError("a step before initialisation has ended")

    def life(self) -> None:
        """A call of the life cycle, in any order."""
        name = self._rng.choice(("SetupExperiment", "Enter", "Exit", "Exit", "Terminate", "Reset"))
        if name == "SetupExperiment":
            self._call("fmi2SetupExperiment", 0, self._number(), self._number(), 0, self._number())
            return
        name = f"{name}InitializationMode" if name in ("Enter", "Exit") else name
        status = self._call(f"fmi2{name}")
        if status == 0 and name in ("ExitInitializationMode", "Reset"):
            self._initialised = name != "Reset"

    def _shown(self) -> bytes | None:
        """The outputs, if there are any to compare."""
        numbers = (ctypes.c_double * max(1, len(self._outputs)))()
        status = self._call("fmi2GetReal", self._outputs, ctypes.c_size_t(len(self._outputs)), numbers)
        return bytes(numbers) if self._initialised and status == 0 else None

    def state(self) -> None:
        """Save, set, free or serialise a state; one that is set gives its outputs again."""
        kind = self._rng.randrange(5)
        if kind == 0 or not self._states:
            state = ctypes.c_void_p()
            self._call("fmi2GetFMUstate", ctypes.byref(state))
            self._states.append((state, self._shown()))
            return
        k = self._rng.randrange(len(self._states))
        state, shown = self._states[k]
        if kind == 1:
            self._call("fmi2SetFMUstate", state)
            self._initialised = shown is not None
            if self._shown() != shown:
                raise AssertionError("a state that was set gives other outputs")
        elif kind == 2:
            self._call("fmi2FreeFMUstate", ctypes.byref(state))
            del self._states[k]
        else:
            self._serialise(state, shown, damaged=kind == 3)

    def _serialise(self, state: ctypes.c_void_p, shown: bytes | None, damaged: bool) -> None:
        size = ctypes.c_size_t()
        self._call("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
        data = ctypes.create_string_buffer(size.value)
        self._call("fmi2SerializeFMUstate", state, data, size)
        content = bytearray(data.raw)
        if damaged:
            place = self._rng.choice((*range(8), *range(64, len(content))))  # in the guid, or behind it
            content[place] ^= 1 << self._rng.randrange(8)
            del content[self._rng.choice((len(content), place)) :]
        again, given = ctypes.c_void_p(), (ctypes.c_char * len(content)).from_buffer(content)
        status = self._call(
            "fmi2DeSerializeFMUstate", given, ctypes.c_size_t(len(content)), ctypes.byref(again)
        )
        if (status == 0) == damaged:
            raise AssertionError(f"a serialised state: status {status}, damaged: {damaged}")
        if status == 0:
            self._states.append((again, shown))

    def rest(self) -> None:
        """What the description does not offer, and questions."""
        one, number, whole = (ctypes.c_uint * 1)(0), ctypes.c_double(), ctypes.c_int()
        size = ctypes.c_size_t(self._rng.randrange(2))
        kind = self._rng.randrange(7)
        if kind < 3:
            what = ("Integer", "Boolean", "String")[kind]
            room = (ctypes.c_void_p * 1)()
            self._call(f"fmi2{self._rng.choice(('Get', 'Set'))}{what}", one, size, room)
        elif kind == 3:
            self._call("fmi2GetRealStatus", self._rng.randrange(5), ctypes.byref(number))
        elif kind == 4:
            self._call("fmi2GetBooleanStatus", self._rng.randrange(5), ctypes.byref(whole))
        elif kind == 5:
            self._call("fmi2CancelStep")
        else:
            names = (ctypes.c_char_p * 1)(self._rng.choice((b"logAll", b"", b"x" * 3000)))
            self._call("fmi2SetDebugLogging", self._rng.randrange(2), size, names)

    def sequence(self) -> None:
        """Many calls, then the end of the instance."""
        kinds = (self.values, self.values, self.step, self.step, self.life, self.state, self.rest)
        for _ in range(CALLS):
            self._rng.choice(kinds)()
        for state, _ in self._states:
            self._call("fmi2FreeFMUstate", ctypes.byref(state))
        self._dll.fmi2FreeInstance(self._c)


def same_logs(scenario: str, seed: int, rng: random.Random, work: Path) -> None:
    """A run with the compiled loop and one without, of native FMUs: the same bytes."""
    content = json.loads((ROOT / "scenarios" / f"{scenario}.json").read_text())
    every = rng.choice((1, 3))
    content |= {"stop": rng.choice((0.05, 1.0, 4.0)), "metrics": {}, "seed": seed, "native": True}
    content["log"] = {"signals": rng.choice(("all", "compact")), "every": every}
    logs = []
    for loop in ("compiled", "plain"):
        os.environ["CYBERSHIP_LOOP"] = loop
        varied = with_settings(cosim.load_scenario(content), [], ROOT / "scenarios")
        result = cosim.simulate(varied, work / loop)
        if (result.status, result.loop) != ("done", loop):
            raise AssertionError(f"{scenario}: {result.status}, {result.loop}: {result.loop_reason}")
        logs.append((work / loop / "log.csv").read_bytes())
    if logs[0] != logs[1]:
        raise AssertionError(f"{scenario} with seed {seed}: the loops differ")


def main() -> None:
    """Make the sequences, and a run for each hundred; a sanitizer ends the process."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sequences", type=int, default=EACH)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory(prefix="sanitized_") as work:
        built = build(FMUS, native=native_targets())
        for k in range(options.sequences):
            Calls(rng.choice(built), Path(work), rng).sequence()
            if k % 100 == 0:
                same_logs(rng.choice(SCENARIOS), k, rng, Path(work))
    sys.stdout.flush()
    os._exit(0)  # libraries are not unloaded in the order that a sanitizer wants


if __name__ == "__main__":
    main()
