"""What an instance remembers, and that nobody else's doings change it (2.1.5, 2.1.6, 2.1.8)."""

from collections.abc import Iterator

from ..bench import Bench, differing
from ..registry import trial

STEPS = 20


@trial("2.1.6")
def reset(bench: Bench) -> Iterator[str]:
    """After fmi2Reset the FMU runs again as it did when it was new."""
    one = bench.ready()
    first = bench.play(one, STEPS, seed=0)
    one.reset()
    one.set_up(bench.start)
    one.enter()
    one.exit()
    again = bench.play(one, STEPS, seed=0)
    where = differing(bench.description.outputs(), first, again)
    if where:
        yield f"another run after fmi2Reset differs: {where}"


@trial("2.1.8")
def state(bench: Bench) -> Iterator[str]:
    """A state got with fmi2GetFMUstate and set again, even more than once, continues as it did."""
    bench.needs("canGetAndSetFMUstate")
    one = bench.ready()
    bench.play(one, STEPS, seed=0)
    kept = one.state()
    first = bench.play(one, STEPS, seed=1, first=STEPS)
    for _ in range(2):
        one.restore(kept)
        again = bench.play(one, STEPS, seed=1, first=STEPS)
        where = differing(bench.description.outputs(), first, again)
        if where:
            yield f"after fmi2SetFMUstate the run differs: {where}"
            break
    one.release(kept)


@trial("2.1.8")
def serialised_state(bench: Bench) -> Iterator[str]:
    """A serialised state continues as it did, in the same instance and in a new one."""
    bench.needs("canSerializeFMUstate")
    one = bench.ready()
    bench.play(one, STEPS, seed=0)
    kept = one.state()
    data = one.serialize(kept)
    one.release(kept)
    first = bench.play(one, STEPS, seed=1, first=STEPS)
    fellows = [("the same", one)]
    if not bench.description.has("canBeInstantiatedOnlyOncePerProcess"):
        fellows.append(("a new", bench.ready()))
    for which, fellow in fellows:
        read = fellow.deserialize(data)
        fellow.restore(read)
        fellow.release(read)
        again = bench.play(fellow, STEPS, seed=1, first=STEPS)
        where = differing(bench.description.outputs(), first, again)
        if where:
            yield f"in {which} instance the deserialised state runs otherwise: {where}"


@trial("2.1.5, 4.3.1")
def instances(bench: Bench) -> Iterator[str]:
    """Two instances do not disturb each other, unless canBeInstantiatedOnlyOncePerProcess is
    declared.
    """
    alone = bench.play(bench.ready(), STEPS, seed=0)
    one, other = bench.ready(), bench.ready()
    rows = []
    for k in range(STEPS):
        rows += bench.play(one, 1, seed=0, first=k)
        bench.play(other, 1, seed=1, first=k)
    where = differing(bench.description.outputs(), alone, rows)
    if where:
        yield f"beside another instance the run differs: {where}"
