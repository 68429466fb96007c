"""An FMU that dies as the environment says: RELIABILITY_WAY in the function RELIABILITY_WHERE."""

import ctypes
import os
import resource
import signal
import time

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


def _stack(n=0):
    return _stack(n + 1) + 1


def _native_stack():
    """Overflow the stack of C: a comparison function that calls the sort it is called by."""
    libc, kind = ctypes.CDLL(None), ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    pair = (ctypes.c_int * 2)()
    resource.setrlimit(resource.RLIMIT_STACK, (2**20, resource.getrlimit(resource.RLIMIT_STACK)[1]))
    recurse = kind(lambda a, b: libc.qsort(pair, 2, 4, recurse) or 0)
    import sys

    sys.setrecursionlimit(10**9)
    libc.qsort(pair, 2, 4, recurse)


def _memory():
    resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))
    return [bytearray(2**24) for _ in range(10**6)]


def _flood():
    for _ in range(2000):
        os.write(1, b"output " * 200 + b"\n")


def _fork():
    if os.fork() == 0 and os.environ["RELIABILITY_WAY"] == "fork, child ends":
        os._exit(0)


def _spin():
    while True:
        pass


def _raise():
    raise ValueError("no")


WAYS = {
    "segfault": lambda: ctypes.string_at(0),
    "exit": lambda: ctypes.CDLL(None).exit(0),
    "_exit": lambda: os._exit(0),
    "abort": os.abort,
    "hang": lambda: time.sleep(1000),
    "hang in C": lambda: ctypes.PyDLL(None).sleep(1000),
    "spin": _spin,
    "fork": _fork,
    "fork, child ends": _fork,
    "closed descriptors": lambda: os.closerange(3, 256),
    "flood": _flood,
    "stack": _stack,
    "native stack": _native_stack,
    "memory": _memory,
    "SIGKILL": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "SIGTERM": lambda: os.kill(os.getpid(), signal.SIGTERM),
    "SIGINT": lambda: os.kill(os.getpid(), signal.SIGINT),
    "SIGUSR1": lambda: os.kill(os.getpid(), signal.SIGUSR1),
    "SIGTERM to parent": lambda: os.kill(os.getppid(), signal.SIGTERM),
    "SIGUSR1 to parent": lambda: os.kill(os.getppid(), signal.SIGUSR1),
    "exception": _raise,
}


COMMANDS, FORCE = [[f"{stem}_{axis}" for axis in "XYN"] for stem in ("tau_cmd", "tau")]


class mortal(Fmi2Slave):  # noqa: N801 - the file's name
    """A clock whose y is the time; with what a replay wants of a controller, which it leaves at zero."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y = 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        for name in (*(f"{a}_{b}" for a in ("x", "y", "psi") for b in ("hat", "t")), *COMMANDS):
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in FORCE:
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self._die("instantiate")

    def _die(self, where):
        if os.environ.get("RELIABILITY_WHERE") == where:
            WAYS[os.environ["RELIABILITY_WAY"]]()

    def setup_experiment(self, start, stop, tolerance):
        self._die("setup")

    def enter_initialization_mode(self):
        self._die("enter")

    def exit_initialization_mode(self):
        self._die("leave")

    def set_real(self, references, values):
        if self.y > 0.5:
            self._die("set")
        super().set_real(references, values)

    def get_real(self, references):
        if self.y > 0.5:
            self._die("get")
        return super().get_real(references)

    def do_step(self, t, h):
        if 0.5 < t < 0.5 + 1.5 * h:
            self._die("step")
        self.y = t + h
        return os.environ.get("RELIABILITY_WAY") != "wrong status" or t < 0.5

    def terminate(self):
        self._die("terminate")
