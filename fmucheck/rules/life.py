"""The life of an instance (2.1.4 to 2.1.6, 4.2)."""

from collections.abc import Iterator
from ctypes import c_char_p

from ..api import InstanceOnTrial
from ..fmu_on_trial import FmuOnTrial
from ..registry import trial


@trial("2.1, 4.2")
def exports(fmu: FmuOnTrial) -> Iterator[str]:
    """The library exports all functions of co-simulation, and reports version 2.0 and the default
    platform.
    """
    for name in fmu.library.missing:
        yield f"{name} is not exported"
    for name, meant in (("fmi2GetVersion", b"2.0"), ("fmi2GetTypesPlatform", b"default")):
        if name not in fmu.library.missing:
            stated = fmu.library.function(name, c_char_p)()
            if stated != meant:
                yield f"{name} returns {stated!r}"


@trial("2.1.5, 2.1.6, 4.2.4")
def life(fmu: FmuOnTrial) -> Iterator[str]:
    """Instantiate with the guid of the description, initialise, step, terminate, free: no error, no
    crash, and its files remain for the next instance.
    """
    files = [path for path in fmu.folder.rglob("*") if path.is_file()]
    one = fmu.ready()
    everything = [v for v in fmu.description.variables if v.type]
    one.get(everything)
    for k in range(10):
        fmu.advance(one, k)
        one.get(everything)
    yield from _undeclared(fmu, one)
    one.terminate()
    one.get(everything)
    one.free()
    removed = [path.relative_to(fmu.folder).as_posix() for path in files if not path.exists()]
    if removed:
        yield f"it removed {len(removed)} of its own files, such as '{min(removed)}'"


def _undeclared(fmu: FmuOnTrial, one: InstanceOnTrial) -> Iterator[str]:
    """Categories of messages that a description with categories does not list."""
    known = {c.get("name", "") for c in fmu.description.root.iterfind("LogCategories/Category")}
    for category in sorted({category for _, category, _ in one.messages} - known) if known else []:
        yield f"a message is of category '{category}', which LogCategories does not list"


@trial("2.1.5")
def free(fmu: FmuOnTrial) -> Iterator[str]:
    """An instance can be freed at any time: after instantiation, during initialisation, and without
    termination.
    """
    fmu.instance().free()
    fmu.initialising().free()
    fmu.ready().free()
    yield from ()


@trial("2.1.5, 2.2.4")
def logging(fmu: FmuOnTrial) -> Iterator[str]:
    """fmi2SetDebugLogging accepts every log category that the description lists."""
    names = [c.get("name", "") for c in fmu.description.root.iterfind("LogCategories/Category")]
    one = fmu.instance()
    one.debug(names)
    one.free()
    yield from ()


@trial("4.2.2, 4.3.1")
def step_size(fmu: FmuOnTrial) -> Iterator[str]:
    """With canHandleVariableCommunicationStepSize the step size may change from step to step."""
    fmu.needs("canHandleVariableCommunicationStepSize")
    one = fmu.ready()
    time = fmu.start
    for share in (1.0, 0.5, 0.1, 2.0, 1.0 / 3.0, 1.0):
        one.step(time, share * fmu.step)
        time += share * fmu.step
    one.terminate()
    one.free()
    yield from ()
