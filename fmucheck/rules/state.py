"""What an instance remembers, and that nobody else's doings change it (2.1.5, 2.1.6, 2.1.8)."""

from collections.abc import Iterator
from ctypes import c_void_p

from ..api import Instance
from ..bench import Bench, Row, differing, unlike
from ..registry import trial

STEPS = 20


@trial("2.1.6")
def reset(bench: Bench) -> Iterator[str]:
    """After fmi2Reset the FMU has its start values again, and runs like a new instance."""
    given = bench.given()
    one = bench.initialising()
    new = one.get(given)
    one.exit()
    first = bench.play(one, STEPS, seed=0)
    bench.disturb(one)
    one.reset()
    one.set_up(bench.start)
    one.enter()
    yield from (f"after fmi2Reset {text}" for text in unlike(given, new, one.get(given)))
    one.exit()
    where = differing(bench.description.outputs(), first, bench.play(one, STEPS, seed=0))
    if where:
        yield f"another run after fmi2Reset differs: {where}"


@trial("2.1.8")
def state(bench: Bench) -> Iterator[str]:
    """A state of fmi2GetFMUstate that is set again, also more than once, has the same values and
    the same continuation.
    """
    bench.needs("canGetAndSetFMUstate")
    one, before = _on_the_way(bench)
    kept = one.state()
    first = bench.play(one, STEPS, seed=1, first=STEPS)
    for _ in range(2):
        wrong = list(_amiss(bench, one, kept, before, first))
        yield from (f"after fmi2SetFMUstate {text}" for text in wrong)
        if wrong:
            break
    one.release(kept)


@trial("2.1.8")
def serialised_state(bench: Bench) -> Iterator[str]:
    """A serialised state has the same continuation, in the same instance and in a new one."""
    bench.needs("canSerializeFMUstate")
    one, before = _on_the_way(bench)
    kept = one.state()
    data = one.serialize(kept)
    one.release(kept)
    first = bench.play(one, STEPS, seed=1, first=STEPS)
    fellows = [("the same", one)]
    if not bench.description.has("canBeInstantiatedOnlyOncePerProcess"):
        fellows.append(("a new", bench.ready()))
    for which, fellow in fellows:
        read = fellow.deserialize(data)
        wrong = _amiss(bench, fellow, read, before, first)
        yield from (f"with the deserialised state in {which} instance {text}" for text in wrong)
        fellow.release(read)


def _on_the_way(bench: Bench) -> tuple[Instance, Row]:
    """An instance after some steps, and what a master sees of it."""
    one = bench.ready()
    bench.play(one, STEPS, seed=0)
    return one, one.get([*bench.given(), *bench.description.outputs()])


def _amiss(bench: Bench, one: Instance, kept: c_void_p, before: Row, first: list[Row]) -> Iterator[str]:
    """What differs, at once and in a run, when a state is set.

    Args:
        bench: the FMU.
        one: whose state is set, after everything in it was changed.
        kept: the state.
        before: what a master saw at that state.
        first: the run from there.
    """
    outputs = bench.description.outputs()
    bench.disturb(one)
    one.restore(kept)
    shown = [*bench.given(), *outputs]
    yield from unlike(shown, before, one.get(shown))
    where = differing(outputs, first, bench.play(one, STEPS, seed=1, first=STEPS))
    if where:
        yield f"the run differs: {where}"


@trial("2.1.5, 4.3.1")
def instances(bench: Bench) -> Iterator[str]:
    """Two instances do not influence each other, unless canBeInstantiatedOnlyOncePerProcess is
    declared.
    """
    given = bench.given()
    lonely = bench.ready()
    alone = bench.play(lonely, STEPS + 1, seed=0)
    meant = lonely.get(given)
    one, other = bench.ready(), bench.ready()
    rows = []
    for k in range(STEPS):
        rows += bench.play(one, 1, seed=0, first=k)
        bench.play(other, 1, seed=1, first=k)
    bench.disturb(other)
    rows += bench.play(one, 1, seed=0, first=STEPS)
    yield from (f"with another instance {text}" for text in unlike(given, meant, one.get(given)))
    where = differing(bench.description.outputs(), alone, rows)
    if where:
        yield f"with another instance the run differs: {where}"
