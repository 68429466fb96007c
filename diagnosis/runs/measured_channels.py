"""Each channel of a run as it was measured: how often, with which noise, and whether it is used."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np

from fmus.ops import wrap

from ..execution.short_text import SHOWN
from .cleaning import Z95, noise
from .columns.columns import POSE, QUANTITY, outputs
from .columns.unit_check import SI_UNIT
from .frozen import repeated
from .run_constants import DIGITS, ORDER, SAME
from .sensors.evidence import SURE, VELOCITIES
from .smoothing.smoother import Smoothed

GIVEN, ESTIMATED = "given", "estimated"
UNUSED = "not used for the motion"


@dataclass(frozen=True)
class MeasuredChannel:
    """One channel of a run, or of several runs.

    Attributes:
        name: of its signal.
        rate: of its samples [Hz].
        held: share of its rows that repeat the sample before, or lie on a line between two samples.
        noise: standard deviation.
        noise_rel_std: relative standard deviation of that estimate; zero where it is given.
        unit: of the noise, SI.
        noise_from: whether it is given or estimated.
        correlation: time constant of the correlation of its residuals [s]; 0: they are white.
        latency: by which it is later than the pose [s], where that was found.
        outliers: number of samples that contradict all others.
        outlier_times: of the first ones [s].
        why: reason why it is not used; empty: it is.
        noise_at_most: whether the noise is an upper bound, as residuals are not of a constant noise.
    """

    name: str
    rate: float
    held: float
    noise: float
    noise_rel_std: float
    unit: str
    noise_from: str
    correlation: float
    latency: float
    outliers: int
    outlier_times: tuple[float, ...] = ()
    why: str = ""
    noise_at_most: bool = False

    @property
    def used(self) -> bool:
        """Whether the smoother uses it."""
        return not self.why

    @property
    def known(self) -> bool:
        """Whether the noise tells anything: its 95 % interval begins above a half of it."""
        return Z95 * self.noise_rel_std < 1.0 / 2.0

    def content(self) -> dict[str, Any]:
        """What a result file has of it, beside its name."""
        return {n: v for n, v in vars(self).items() if n != "name"} | {"used": self.used}


def by_name(channels: Iterable[MeasuredChannel]) -> Iterator[MeasuredChannel]:
    """Each channel of some runs: medians, the sum of its outliers, the first reason not to use it."""
    middle = ("rate", "held", "noise", "noise_rel_std", "correlation", "latency")
    of_name: dict[str, list[MeasuredChannel]] = {}
    for c in channels:
        of_name.setdefault(c.name, []).append(c)
    for of in of_name.values():
        yield replace(
            of[0],
            **{name: median(getattr(c, name) for c in of) for name in middle},
            outliers=sum(c.outliers for c in of),
            outlier_times=next((c.outlier_times for c in of if c.outliers), ()),
            why=next((c.why for c in of if c.why), ""),
            noise_at_most=any(c.noise_at_most for c in of),
        )


def channels_of(s: Smoothed) -> Iterator[MeasuredChannel]:
    """The channels of a smoothed run: first its pose."""
    track, given = s.track, s.track.run.noise
    off = track.run.pose - s.eta
    off[:, 2] = wrap(off[:, 2])
    for k, name in enumerate(POSE):
        rows = np.flatnonzero(track.fresh[:, k] & np.isfinite(off[:, k]))
        wrong = rows[~s.agrees[rows, k]]
        right = rows[s.agrees[rows, k]]
        there = np.isfinite(track.run.pose[:, k]) & ~track.dropped
        yield MeasuredChannel(
            name,
            _rate(s.time[rows]),
            1.0 - float(track.fresh[there, k].mean()),
            float(s.noise[k]),
            float(s.noise_rel_std[k]),
            _unit(name),
            GIVEN if name in given else ESTIMATED,
            correlation=_correlation(s.time[right], off[right, k]),
            latency=0.0,  # all others are late against the pose
            outliers=wrong.size,
            outlier_times=tuple(s.time[wrong[:SHOWN]].tolist()),
            noise_at_most=bool(s.noise_at_most[k]),
        )
    if s.sensors is None:
        return
    reasons = {name: f.sentence for f in s.sensors.findings for name in f.aside}
    delays = {f.channel: f.value for f in s.sensors.findings if f.kind == "delay"}
    time = s.sensors.run.time
    used = set(s.sensors.agreeing)
    used |= {name for pair in VELOCITIES if pair[0] in used for name in pair}  # a course by its speed
    for name, values in {**s.sensors.run.measured, **s.sensors.aside}.items():
        there = np.isfinite(values) & np.isfinite(time)
        new = there & ~repeated(values[:, None], there)
        if new.sum() > ORDER:
            yield MeasuredChannel(
                name,
                _rate(time[new]),
                1.0 - float(new.sum() / there.sum()),
                given.get(name, max(float(noise(values[new, None])[0]), _of_rounding(values[new]))),
                0.0 if name in given else _of_differences(int(new.sum())),
                _unit(name),
                GIVEN if name in given else ESTIMATED,
                correlation=0.0,
                latency=delays.get(name, 0.0),
                outliers=0,
                why="" if name in used else reasons.get(name, UNUSED),
            )


def _unit(name: str) -> str:
    """The SI unit of a signal."""
    return SI_UNIT[(QUANTITY | outputs([name])).get(name, "command")]


def _of_rounding(values: np.ndarray) -> float:
    """Standard deviation by the rounding of values (n,): the least step between them, over sqrt(12)."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > DIGITS * np.abs(values).max()]
    return float(steps.min()) / 12.0**0.5 if steps.size else 0.0


def _of_differences(samples: int) -> float:
    """Relative standard deviation of a noise by the median of that many third differences.

    A median deviation has 37 % of the information of a root mean square, and as the differences overlap,
    62 % of that of independent ones.
    """
    return float(np.sqrt(2.2 / samples))


def _rate(time: np.ndarray) -> float:
    """Samples per second, at the times (n,) [s] of samples."""
    return 1.0 / float(np.median(np.diff(time))) if time.size > 1 else 0.0


def _correlation(time: np.ndarray, off: np.ndarray) -> float:
    """Time constant [s] of residuals (n,) at times (n,) [s], if their correlation is significant."""
    step = np.diff(time)
    if time.size <= ORDER:
        return 0.0
    period = float(np.median(step))
    near = step < 1.5 * period
    size = float(np.mean(off**2))
    rho = float(np.mean((off[1:] * off[:-1])[near])) / size if size > 0.0 and near.any() else 0.0
    sure = SURE / float(np.sqrt(near.sum() + 1.0))  # of white residuals
    return -period / float(np.log(min(rho, SAME))) if rho > sure else 0.0
