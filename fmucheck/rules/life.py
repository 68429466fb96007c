"""The life of an instance (2.1.4 to 2.1.6, 4.2)."""

from collections.abc import Iterator
from ctypes import c_char_p

from ..api import Instance
from ..bench import Bench
from ..registry import trial


@trial("2.1, 4.2")
def exports(bench: Bench) -> Iterator[str]:
    """The library exports all functions of co-simulation, and reports version 2.0 and the default
    platform.
    """
    for name in bench.library.missing:
        yield f"{name} is not exported"
    for name, meant in (("fmi2GetVersion", b"2.0"), ("fmi2GetTypesPlatform", b"default")):
        if name not in bench.library.missing:
            told = bench.library.function(name, c_char_p)()
            if told != meant:
                yield f"{name} returns {told!r}"


@trial("2.1.5, 2.1.6, 4.2.4")
def life(bench: Bench) -> Iterator[str]:
    """Instantiate with the guid of the description, initialise, step, terminate, free: no error, no
    crash, and its files remain for the next instance.
    """
    files = [path for path in bench.folder.rglob("*") if path.is_file()]
    one = bench.ready()
    everything = [v for v in bench.description.variables if v.type]
    one.get(everything)
    for k in range(10):
        bench.advance(one, k)
        one.get(everything)
    yield from _undeclared(bench, one)
    one.terminate()
    one.get(everything)
    one.free()
    removed = [path.relative_to(bench.folder).as_posix() for path in files if not path.exists()]
    if removed:
        yield f"it removed {len(removed)} of its own files, such as '{min(removed)}'"


def _undeclared(bench: Bench, one: Instance) -> Iterator[str]:
    """Categories of messages that a description with categories does not list."""
    known = {c.get("name", "") for c in bench.description.root.iterfind("LogCategories/Category")}
    for category in sorted({category for _, category, _ in one.messages} - known) if known else []:
        yield f"a message is of category '{category}', which LogCategories does not list"


@trial("2.1.5")
def free(bench: Bench) -> Iterator[str]:
    """An instance can be freed at any time: after instantiation, during initialisation, and without
    termination.
    """
    bench.instance().free()
    bench.initialising().free()
    bench.ready().free()
    yield from ()


@trial("2.1.5, 2.2.4")
def logging(bench: Bench) -> Iterator[str]:
    """fmi2SetDebugLogging accepts every log category that the description lists."""
    names = [c.get("name", "") for c in bench.description.root.iterfind("LogCategories/Category")]
    one = bench.instance()
    one.debug(names)
    one.free()
    yield from ()


@trial("4.2.2, 4.3.1")
def step_size(bench: Bench) -> Iterator[str]:
    """With canHandleVariableCommunicationStepSize the step size may change from step to step."""
    bench.needs("canHandleVariableCommunicationStepSize")
    one = bench.ready()
    time = bench.start
    for share in (1.0, 0.5, 0.1, 2.0, 1.0 / 3.0, 1.0):
        one.step(time, share * bench.step)
        time += share * bench.step
    one.terminate()
    one.free()
    yield from ()
