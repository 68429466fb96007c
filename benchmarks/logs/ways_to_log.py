"""Ways in which a good log is recorded, by name: each takes its table and random numbers.

The table has the columns time [s], x, y [m], psi [rad], and commands. A way says which noise the pose
has then, by that of the good log, where that can be said.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
import pandas as pd
from scipy.signal import lfilter

PLACE = ["x", "y"]
POSE = [*PLACE, "psi"]
RATES, FILES = (1.0, 2.0, 5.0), (10.0, 20.0, 50.0)  # Hz, of a receiver and of the file
LAGS = (0.2, 0.5, 1.0, 2.0)  # s, of a low-pass filter
Record = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]
Noise = Callable[[np.ndarray, pd.DataFrame], np.ndarray]


@dataclass(frozen=True)
class Way:
    """One way to record a log.

    Attributes:
        record: from a good table and random numbers to the recorded one.
        noise: standard deviation (3,) of the pose then, from that of the good log and the table; None:
            it is not white.
        rates: at which the pose is sampled (3,) [Hz]; infinite: as the good log.
        given: what the file beside it says of the noise, in those of the good log; empty: nothing.
        columns: further keys of the file beside it, by signal.
        adds: effects of the measurement that the way itself has, which are right findings.
    """

    record: Record
    noise: Noise | None = lambda sigma, _: sigma
    rates: Sequence[float] = (np.inf, np.inf, np.inf)
    given: Mapping[str, float] = field(default_factory=dict)
    columns: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    adds: frozenset[str] = frozenset()


def sampled(table: pd.DataFrame, time: np.ndarray) -> pd.DataFrame:
    """The table as it was last measured and given at times [s]."""
    at = np.searchsorted(table["time"], time + 1e-9, side="right") - 1
    found = table.iloc[at].copy()
    found["time"] = time
    return found.reset_index(drop=True)


def even(table: pd.DataFrame, rate: float) -> np.ndarray:
    """Times [s] of a rate [Hz]."""
    return np.arange(table["time"].iloc[0], table["time"].iloc[-1], 1.0 / rate)


def held(rates: dict[str, float], rate: float, empty: bool = False) -> Record:
    """Channels of some rates [Hz], held (or empty) between in a file of a rate [Hz]."""

    def record(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        time = even(table, rate)
        made = sampled(table, time)
        for name, of in rates.items():
            start = table["time"].iloc[0]
            number = np.floor((time - start) * of + 1e-6)
            new = np.concatenate([[True], np.diff(number) > 0.0])
            made[name] = made[name].where(new) if empty else made[name].where(new).ffill()
        return made

    return record


def interpolated(of: float, rate: float) -> Record:
    """A receiver's samples of one rate [Hz], by straight lines in a file of another one."""

    def record(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        made, slow = sampled(table, even(table, rate)), sampled(table, even(table, of))
        for name in POSE:
            whole = np.unwrap(slow[name]) if name == "psi" else slow[name]
            made[name] = np.interp(made["time"], slow["time"], whole)
        return made

    return record


def filtered(names: Sequence[str], lag: float) -> Record:
    """Channels behind a low-pass filter of first order with a lag [s]."""

    def record(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        kept = float(np.exp(-np.median(np.diff(table["time"])) / lag))
        made = table.copy()
        for name in names:
            whole = np.unwrap(table[name]) if name == "psi" else table[name].to_numpy()
            made[name] = whole[0] + lfilter([1.0 - kept], [1.0, -kept], whole - whole[0])
        return made

    return record


def tracked(names: Sequence[str], gain: float, rate: float = 5.0, file: float = 10.0) -> Record:
    """Channels by a steady Kalman filter of constant velocity (alpha-beta), of a rate [Hz], held."""

    def record(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        slow = sampled(table, even(table, rate))
        beta = 2.0 * (2.0 - gain) - 4.0 * np.sqrt(1.0 - gain)  # Kalata 1984
        for name in names:
            whole = np.unwrap(slow[name]) if name == "psi" else slow[name].to_numpy()
            at, speed, found = float(whole[0]), 0.0, []
            for value in whole.tolist():
                expected = at + speed / rate
                at = expected + gain * (value - expected)
                speed += beta * rate * (value - expected)
                found.append(at)
            slow[name] = found
        return sampled(slow, even(table, file))

    return record


def rounded(names: Sequence[str], step: float) -> Record:
    """Channels rounded to a step [m or rad]."""
    return lambda table, _: table.assign(**{n: step * np.round(table[n] / step) for n in names})


def digits(names: Sequence[str], count: int) -> Record:
    """Channels with a number of significant digits."""

    def record(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        text = {n: [float(f"{v:.{count}g}") for v in table[n]] for n in names}
        return table.assign(**text)

    return record


def degrees(step: float) -> Record:
    """The heading in degrees, 0 to 360, rounded to a step [deg]."""

    def record(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        psi = np.degrees(table["psi"]) % 360.0
        return table.assign(psi=np.round(step * np.round(psi / step), 9) % 360.0)

    return record


def jumped(seconds: float, at: float = 0.4) -> Record:
    """A clock that jumps by some seconds at a share of the run."""

    def record(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        later = np.arange(len(table)) >= at * len(table)
        return table.assign(time=table["time"] + seconds * later)

    return record


def outlying(names: Sequence[str], share: float, times: float = 50.0) -> Record:
    """Outliers in a share of the samples, that many times as large as the steps between them."""

    def record(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        made = table.copy()
        for name in names:
            size = times * float(np.median(np.abs(np.diff(table[name]))))
            hit = rng.random(len(table)) < share
            made[name] = table[name] + size * hit * rng.standard_normal(len(table))
        return made

    return record


def _by_rounding(names: Sequence[str], step: float) -> Noise:
    more = np.isin(POSE, names) * step**2 / 12.0
    return lambda sigma, _: np.sqrt(sigma**2 + more)


def _by_digits(names: Sequence[str], count: int) -> Noise:
    def noise(sigma: np.ndarray, table: pd.DataFrame) -> np.ndarray:
        size = np.abs(table[POSE].to_numpy()).clip(1e-12)
        step = 10.0 ** (np.floor(np.log10(size)) - count + 1.0)
        return np.sqrt(sigma**2 + np.isin(POSE, names) * np.median(step, axis=0) ** 2 / 12.0)

    return noise


def plain(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    """The log as it is."""
    return table


DEGREES = {"psi": {"name": "psi", "unit": "deg"}}
WAYS: dict[str, Way] = {"clean": Way(plain)}
for of, file in product(RATES, FILES):
    names = dict.fromkeys(POSE, of)
    WAYS[f"{of:g} Hz held in {file:g}"] = Way(held(names, file), rates=(of, of, of))
    WAYS[f"{of:g} Hz lines in {file:g}"] = Way(interpolated(of, file), rates=(of, of, of))
for of in RATES:
    for how, empty in (("held", False), ("empty", True)):
        record = held({"x": of, "y": of, "psi": 10.0}, 10.0, empty)
        WAYS[f"place {of:g} Hz {how}, heading 10 Hz"] = Way(record, rates=(of, of, 10.0))
slow = held({"x": 10.0, "y": 10.0, "psi": 1.0}, 10.0)
WAYS["heading 1 Hz held, place 10 Hz"] = Way(slow, rates=(10.0, 10.0, 1.0))
for lag in LAGS:
    for of, names in (("place", PLACE), ("heading", ["psi"])):
        added = frozenset({"heading_lag" if of == "heading" else "position_lag"})
        WAYS[f"{of} filtered {lag:g} s"] = Way(filtered(names, lag), None, adds=added)
for gain in (0.2, 0.5):
    both = frozenset({"position_tracker", "heading_tracker"})
    WAYS[f"Kalman pose {gain:g} held"] = Way(tracked(POSE, gain), None, adds=both)
    name, added = f"Kalman heading {gain:g}, place 5 Hz held", frozenset({"heading_tracker"})
    WAYS[name] = Way(tracked(["psi"], gain), None, adds=added)
for step in (1.0, 0.1):
    noise = _by_rounding(["psi"], np.radians(step))
    WAYS[f"heading in {step:g} degrees"] = Way(degrees(step), noise, columns=DEGREES)
for step in (0.001, 0.01, 0.1):
    WAYS[f"place rounded to {step:g} m"] = Way(rounded(PLACE, step), _by_rounding(PLACE, step))
for count in (3, 4):
    WAYS[f"pose of {count} digits"] = Way(digits(POSE, count), _by_digits(POSE, count))
for seconds in (1.0, -1.0, 10.0, 3600.0):
    WAYS[f"clock jumps {seconds:+g} s"] = Way(jumped(seconds))
for share in (0.01, 0.05, 0.1):
    WAYS[f"{share:.0%} outliers of the place"] = Way(outlying(PLACE, share))
    WAYS[f"{share:.0%} outliers of the heading"] = Way(outlying(["psi"], share))
for factor in (1.0, 10.0, 0.1):
    WAYS[f"noise of the place given times {factor:g}"] = Way(plain, given=dict.fromkeys(PLACE, factor))
    WAYS[f"noise of the heading given times {factor:g}"] = Way(plain, given={"psi": factor})
