"""Faults of a run's channels in words."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

MOST_STRETCHES = 3  # of a clock, each with its line; chosen


class Told(Protocol):
    """What is needed of a finding, or of its result in a file."""

    @property
    def kind(self) -> str: ...
    @property
    def value(self) -> float | None: ...
    @property
    def start(self) -> float | None: ...
    @property
    def end(self) -> float | None: ...
    @property
    def sentence(self) -> str: ...
    @property
    def repaired(self) -> bool: ...


def sensor_lines(found: Iterable[Told]) -> Iterator[str]:
    """A line for each fault; many stretches of a clock share one."""
    found = list(found)
    rates = [f for f in found if f.kind == "clock_rate"]
    if len(rates) > MOST_STRETCHES:
        yield _rates(rates)
        found = [f for f in found if f.kind != "clock_rate"]
    for f in found:
        when = f", {f.start:.1f} to {f.end:.1f} s" if f.kind == "clock_rate" else ""
        yield f"{f.sentence}{when}{'' if f.repaired else ' (not repaired)'}"


def _rates(rates: Sequence[Told]) -> str:
    values = [f.value for f in rates if f.value is not None]
    span = f"{min(values):.3g} to {max(values):.3g} s pass in a second of it"
    return f"the log's clock runs unevenly: {span}, in {len(rates)} stretches"
