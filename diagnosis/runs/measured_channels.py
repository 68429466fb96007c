"""Each channel of a run as it was measured: how often, with which noise, and whether it is used."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fmus.ops import wrap

from .cleaning import noise, repeated
from .columns.columns import POSE, QUANTITY, outputs
from .columns.unit_check import UNITS
from .sensors.evidence import SURE
from .smoothing.smoother import Smoothed

FIRST = 3  # outliers whose times are stated
GIVEN, ESTIMATED = "given", "estimated"
UNUSED = "not used for the motion"


@dataclass(frozen=True)
class MeasuredChannel:
    """One channel of a run.

    Attributes:
        name: of its signal.
        rate: of its samples [Hz].
        held: share of its rows that repeat the sample before, or lie on a line between two samples.
        noise: standard deviation.
        unit: of that, SI.
        noise_from: whether that is given or estimated.
        correlation: time constant of the correlation of its residuals [s]; 0: they are white.
        delay: by which it is later than the pose [s], where that was found.
        outliers: number of samples that contradict all others.
        outlier_times: of the first ones [s].
        reason: why it is not used; empty: it is.
    """

    name: str
    rate: float
    held: float
    noise: float
    unit: str
    noise_from: str
    correlation: float = 0.0
    delay: float = 0.0
    outliers: int = 0
    outlier_times: tuple[float, ...] = ()
    reason: str = ""


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
            _unit(name),
            GIVEN if name in given else ESTIMATED,
            _correlation(s.time[right], off[right, k]),
            outliers=wrong.size,
            outlier_times=tuple(s.time[wrong[:FIRST]].tolist()),
        )
    if s.sensors is None:
        return
    reasons = {name: f.sentence for f in s.sensors.findings for name in f.aside}
    delays = {f.channel: f.value for f in s.sensors.findings if f.kind == "delay"}
    time = s.sensors.run.time
    for name, values in {**s.sensors.run.measured, **s.sensors.aside}.items():
        there = np.isfinite(values) & np.isfinite(time)
        new = there & ~repeated(values[:, None], there)
        if new.sum() > FIRST:
            yield MeasuredChannel(
                name,
                _rate(time[new]),
                1.0 - float(new.sum() / there.sum()),
                given.get(name, float(noise(values[new, None])[0])),
                _unit(name),
                GIVEN if name in given else ESTIMATED,
                delay=delays.get(name, 0.0),
                reason="" if name in s.sensors.agreeing else reasons.get(name, UNUSED),
            )


def _unit(name: str) -> str:
    """The SI unit of a signal."""
    quantity = (QUANTITY | outputs([name])).get(name, "command")
    return next(unit for unit, factor in UNITS[quantity].items() if factor == 1.0)


def _rate(time: np.ndarray) -> float:
    """Samples per second, at the times (n,) [s] of samples."""
    return 1.0 / float(np.median(np.diff(time))) if time.size > 1 else 0.0


def _correlation(time: np.ndarray, off: np.ndarray) -> float:
    """Time constant [s] of residuals (n,) at times (n,) [s], if their correlation is significant."""
    step = np.diff(time)
    if step.size < FIRST:
        return 0.0
    period = float(np.median(step))
    near = step < 1.5 * period
    size = float(np.mean(off**2))
    rho = float(np.mean((off[1:] * off[:-1])[near])) / size if size > 0.0 and near.any() else 0.0
    sure = SURE / float(np.sqrt(near.sum() + 1.0))  # of white residuals
    return -period / float(np.log(min(rho, 0.999))) if rho > sure else 0.0
