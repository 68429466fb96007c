"""What redundant channels say of each other."""

from dataclasses import dataclass, field

from ..files.reading import Run
from .constants import Kind

Z95 = 1.96  # standard deviations, 95 % of a normal distribution


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


@dataclass(frozen=True, eq=False)
class Examined:
    """A run, and what its redundant channels say of each other.

    Attributes:
        run: as far as it could be repaired by them.
        findings: faults.
        notes: what else is to be said, a line each.
        agreeing: channels beside the pose that agree with it -> standard deviation of their mean over
            the time between two samples of the pose, in SI.
    """

    run: Run
    findings: tuple[SensorFinding, ...] = ()
    notes: tuple[str, ...] = ()
    agreeing: dict[str, float] = field(default_factory=dict)

    def plus(self, other: "Examined") -> "Examined":
        """What was found first, and then."""
        return Examined(
            other.run,
            self.findings + other.findings,
            self.notes + other.notes,
            self.agreeing | other.agreeing,
        )
