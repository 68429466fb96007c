"""What redundant channels say of each other."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ...execution.short_text import SHOWN
from ..cleaning import Z95
from ..files.reading import Run
from .constants import Kind


@dataclass(frozen=True, eq=False)
class SensorFinding:
    """A fault of a channel, found by other channels alone.

    Attributes:
        channel: that is wrong; ``time`` is the clock of the log.
        kind: of the fault.
        value: of the clock d(true time)/d(log), or seconds that are missing in the log; of others
            measured = value x true (scale), true + value (offset), that far off (place), later (delay).
        unit: of the value.
        ci95: its interval.
        start, end: of the stretch of the log's time in which it is so [s].
        sentence: the same for people.
        alike: what the same data would look like.
        repaired: whether the redundant channels repair it.
        aside: channels without which there is no contradiction; empty: the pose itself is in doubt.
    """

    channel: str
    kind: Kind
    value: float
    unit: str
    ci95: tuple[float, float]
    start: float
    end: float
    sentence: str
    alike: tuple[str, ...] = ()
    repaired: bool = True
    aside: tuple[str, ...] = ()

    @property
    def remark(self) -> str:
        """What becomes of a fault that is not repaired, to follow the sentence; else nothing."""
        unused = f"; {' and '.join(self.aside)} not used" if self.aside else ""
        return "" if self.repaired else f" (not repaired{unused})"

    @classmethod
    def estimated(
        cls,
        fault: tuple[str, Kind, str],
        value: float,
        std: float,
        time: np.ndarray,
        sentence: str,
        alike: tuple[str, ...] = (),
        repaired: bool = True,
        aside: tuple[str, ...] = (),
    ) -> "SensorFinding":
        """A fault (channel, kind, unit) with a normal error, from the first to the last of times [s]."""
        interval, (channel, kind, unit) = (value - Z95 * std, value + Z95 * std), fault
        ends = float(time[0]), float(time[-1])
        return cls(channel, kind, value, unit, interval, *ends, sentence, alike, repaired, aside)


@dataclass(frozen=True, eq=False)
class Examined:
    """A run, and what its redundant channels say of each other.

    Attributes:
        run: as far as it could be repaired by them.
        findings: faults.
        notes: what else is to be said, a line each.
        agreeing: channels in addition to the pose that agree with it -> standard deviation of their mean
            over the time between two samples of the pose, in SI.
        aside: channels that were set aside.
    """

    run: Run
    findings: tuple[SensorFinding, ...] = ()
    notes: tuple[str, ...] = ()
    agreeing: dict[str, float] = field(default_factory=dict)
    aside: dict[str, np.ndarray] = field(default_factory=dict)

    def plus(self, other: "Examined") -> "Examined":
        """What was found first, and then."""
        findings, notes = self.findings + other.findings, self.notes + other.notes
        return Examined(other.run, findings, notes, self.agreeing | other.agreeing)

    def without(self, aside: Collection[str]) -> "Examined":
        """The run with some channels set aside."""
        measured = {name: x for name, x in self.run.measured.items() if name not in aside}
        agreeing = {name: std for name, std in self.agreeing.items() if name not in aside}
        set_aside = {name: x for name, x in self.run.measured.items() if name in aside}
        return replace(
            self, run=replace(self.run, measured=measured), agreeing=agreeing, aside=set_aside
        )


def sensor_lines(found: Iterable[SensorFinding]) -> Iterator[str]:
    """A line for each fault; many stretches of a clock share one."""
    found = list(found)
    rates = [f for f in found if f.kind == "clock_rate"]
    if len(rates) > SHOWN:
        values = [f.value for f in rates]
        span = f"{min(values):.3g} to {max(values):.3g} s pass in one second of it"
        yield f"the clock of the log runs unevenly: {span}, in {len(rates)} stretches"
        found = [f for f in found if f.kind != "clock_rate"]
    for f in found:
        when = f", {f.start:.1f} to {f.end:.1f} s" if f.kind == "clock_rate" else ""
        yield f"{f.sentence}{when}{f.remark}"
