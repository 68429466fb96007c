"""What an instance remembers, and that nobody else's doings change it (2.1.5, 2.1.6, 2.1.8)."""

from collections.abc import Iterator
from ctypes import c_void_p

from ..api import InstanceOnTrial
from ..fmu_on_trial import FmuOnTrial, Row, differing, unlike
from ..registry import trial

STEPS = 20


@trial("2.1.6")
def reset(fmu: FmuOnTrial) -> Iterator[str]:
    """After fmi2Reset the FMU has its start values again, and runs like a new instance."""
    given = fmu.given()
    one = fmu.initialising()
    new = one.get(given)
    one.exit()
    first = fmu.play(one, STEPS, seed=0)
    fmu.disturb(one)
    one.reset()
    one.set_up(fmu.start)
    one.enter()
    yield from (f"after fmi2Reset {text}" for text in unlike(given, new, one.get(given)))
    one.exit()
    where = differing(fmu.description.outputs(), first, fmu.play(one, STEPS, seed=0))
    if where:
        yield f"another run after fmi2Reset differs: {where}"


@trial("2.1.8")
def state(fmu: FmuOnTrial) -> Iterator[str]:
    """A state of fmi2GetFMUstate that is set again, also more than once, has the same values and
    the same continuation.
    """
    fmu.needs("canGetAndSetFMUstate")
    one, before = _on_the_way(fmu)
    kept = one.state()
    first = fmu.play(one, STEPS, seed=1, first=STEPS)
    for _ in range(2):
        wrong = list(_amiss(fmu, one, kept, before, first))
        yield from (f"after fmi2SetFMUstate {text}" for text in wrong)
        if wrong:
            break
    one.release(kept)


@trial("2.1.8")
def serialised_state(fmu: FmuOnTrial) -> Iterator[str]:
    """A serialised state has the same continuation, in the same instance and in a new one."""
    fmu.needs("canSerializeFMUstate")
    one, before = _on_the_way(fmu)
    kept = one.state()
    data = one.serialize(kept)
    one.release(kept)
    first = fmu.play(one, STEPS, seed=1, first=STEPS)
    fellows = [("the same", one)]
    if not fmu.description.has("canBeInstantiatedOnlyOncePerProcess"):
        fellows.append(("a new", fmu.ready()))
    for which, fellow in fellows:
        read = fellow.deserialize(data)
        wrong = _amiss(fmu, fellow, read, before, first)
        yield from (f"with the deserialised state in {which} instance {text}" for text in wrong)
        fellow.release(read)


def _on_the_way(fmu: FmuOnTrial) -> tuple[InstanceOnTrial, Row]:
    """An instance after some steps, and what a master sees of it."""
    one = fmu.ready()
    fmu.play(one, STEPS, seed=0)
    return one, one.get([*fmu.given(), *fmu.description.outputs()])


def _amiss(
    fmu: FmuOnTrial, one: InstanceOnTrial, kept: c_void_p, before: Row, first: list[Row]
) -> Iterator[str]:
    """What differs, at once and in a run, when a state is set.

    Args:
        fmu: the FMU.
        one: whose state is set, after everything in it was changed.
        kept: the state.
        before: what a master saw at that state.
        first: the run from there.
    """
    outputs = fmu.description.outputs()
    fmu.disturb(one)
    one.restore(kept)
    shown = [*fmu.given(), *outputs]
    yield from unlike(shown, before, one.get(shown))
    where = differing(outputs, first, fmu.play(one, STEPS, seed=1, first=STEPS))
    if where:
        yield f"the run differs: {where}"


@trial("2.1.5, 4.3.1")
def instances(fmu: FmuOnTrial) -> Iterator[str]:
    """Two instances do not influence each other, unless canBeInstantiatedOnlyOncePerProcess is
    declared.
    """
    given = fmu.given()
    lonely = fmu.ready()
    alone = fmu.play(lonely, STEPS + 1, seed=0)
    meant = lonely.get(given)
    one, other = fmu.ready(), fmu.ready()
    rows = []
    for k in range(STEPS):
        rows += fmu.play(one, 1, seed=0, first=k)
        fmu.play(other, 1, seed=1, first=k)
    fmu.disturb(other)
    rows += fmu.play(one, 1, seed=0, first=STEPS)
    yield from (f"with another instance {text}" for text in unlike(given, meant, one.get(given)))
    where = differing(fmu.description.outputs(), alone, rows)
    if where:
        yield f"with another instance the run differs: {where}"
