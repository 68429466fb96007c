"""Ways in which a good measurement is spoilt, by name: each takes its table and random numbers.

The table has the columns time [s], x, y [m], psi [rad], tau_X, tau_Y [N], tau_N [N m]. A way that puts
something in that the diagnosis knows as an effect says which: then that is a true cause as well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

PLACE = ["x", "y"]
POSE = [*PLACE, "psi"]
TAU = ["tau_X", "tau_Y", "tau_N"]
Spoil = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]


@dataclass(frozen=True)
class Way:
    """One way to spoil a table.

    Attributes:
        spoil: from a good table and random numbers to the spoilt one.
        causes: ids of the effects that it amounts to.
    """

    spoil: Spoil
    causes: tuple[str, ...] = ()


WAYS: dict[str, Way] = {}


def add(name: str, spoil: Spoil, *causes: str) -> None:
    """Register a way."""
    WAYS[name] = Way(spoil, causes)


def edit(columns: Sequence[str], change: Callable[[pd.DataFrame], pd.DataFrame]) -> Spoil:
    """Some columns are replaced by a function of them."""

    def spoil(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        table = table.copy()
        table[list(columns)] = change(table.loc[:, list(columns)]).to_numpy()
        return table

    return spoil


def scaled(columns: Sequence[str], factor: float) -> Spoil:
    return edit(columns, lambda part: part * factor)


def exchanged(a: str, b: str) -> Spoil:
    return edit([a, b], lambda part: part.loc[:, [b, a]])


def constant(columns: Sequence[str], values: Sequence[float], since: float = 0.0) -> Spoil:
    """Columns hold one value from a share of the run on."""

    def change(part: pd.DataFrame) -> pd.DataFrame:
        part = part.copy()
        part.iloc[int(since * len(part)) :] = values
        return part

    return edit(columns, change)


def rows(choose: Callable[[int], np.ndarray]) -> Spoil:
    """Other rows, or the same in another order, by their number."""
    return lambda table, _: table.iloc[choose(len(table))]


def while_time(seconds: float) -> Spoil:
    return lambda table, _: table.loc[table["time"] - table["time"].iloc[0] < seconds]


def held(columns: Sequence[str], kept: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Columns are new in some rows, by their share of the way, and keep their value in between."""

    def change(part: pd.DataFrame) -> pd.DataFrame:
        row = np.arange(len(part))
        return part.iloc[np.maximum.accumulate(np.where(kept(row / len(part)), row, 0))]

    return edit(columns, change)


def frozen(columns: Sequence[str], start: float, end: float) -> Spoil:
    return held(columns, lambda share: (share < start) | (share > end))


def late(columns: Sequence[str], by: int) -> Spoil:
    return edit(columns, lambda part: part.shift(by).bfill())


def holes(columns: Sequence[str], share: float, count: int) -> Spoil:
    """Empty cells in so many stretches, which take a share of the run."""

    def spoil(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        table, length = table.copy(), int(share * len(table) / count)
        for start in rng.integers(0, len(table) - length, count):
            table.loc[table.index[start : start + length], list(columns)] = np.nan
        return table

    return spoil


def struck(column: str, share: float, size: float) -> Spoil:
    """A share of the samples is off by a size, up or down."""

    def spoil(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        hit = rng.random(len(table)) < share
        off = size * rng.choice([-1.0, 1.0], int(hit.sum()))
        values = table[column].to_numpy(copy=True)
        values[hit] += off
        return table.assign(**{column: values})

    return spoil


def noisy(columns: Sequence[str], std: float) -> Spoil:
    """White noise on columns."""

    def spoil(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        noise = std * rng.standard_normal((len(table), len(columns)))
        return table.assign(**{c: table[c] + noise[:, k] for k, c in enumerate(columns)})

    return spoil


def turned(radians: float) -> Spoil:
    return edit(["psi"], lambda psi: (psi + radians + np.pi) % (2.0 * np.pi) - np.pi)


def twice_some(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Every twentieth row, at random, is there twice."""
    n = len(table)
    return table.iloc[np.sort(np.concatenate([np.arange(n), rng.integers(0, n, n // 20)]))]


def shuffled(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return table.iloc[rng.permutation(len(table))]


def east_north_up(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    """Axes east and north, heading from east towards north."""
    return table.assign(x=table.y, y=table.x, psi=0.5 * np.pi - table.psi)


def at_rest(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The ship stays where it is, and only noise is measured."""
    noise = 2e-4 * rng.standard_normal((len(table), 3))
    return table.assign(**dict(zip(POSE, (noise + np.array([5.0, 2.0, 0.1])).T, strict=True)))


def two_runs(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    """The second half is another run: long after, and elsewhere."""
    later = table.index >= len(table) // 2
    moves = {"time": 1000.0, "x": 5.0, "y": 5.0}
    return table.assign(**{c: table[c] + by * later for c, by in moves.items()})


def fast_commands(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    """The clock of the commands is one percent fast."""
    row = np.minimum((1.01 * np.arange(len(table))).astype(int), len(table) - 1)
    return table.assign(**{c: table[c].to_numpy()[row] for c in TAU})


def antenna(table: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    """The place of an antenna 0.3 m ahead of the ship's origin."""
    return table.assign(x=table.x + 0.3 * np.cos(table.psi), y=table.y + 0.3 * np.sin(table.psi))


add("good", lambda table, _: table)

for name, unit in {
    "mm": 1e3,
    "cm": 1e2,
    "dm": 10.0,
    "feet": 1.0 / 0.3048,
    "inch": 1.0 / 0.0254,
    "half": 0.5,
}.items():
    add(name, scaled(PLACE, unit))
add("x_mm", scaled(["x"], 1e3))
add("feet_x", scaled(["x"], 1.0 / 0.3048))
add("degrees", scaled(["psi"], 180.0 / np.pi))
add("degrees_360", edit(["psi"], lambda psi: psi * (180.0 / np.pi) % 360.0))
add("wrap_2pi", edit(["psi"], lambda psi: psi % (2.0 * np.pi)))

for name, columns in {
    "psi": ["psi"],
    "x": ["x"],
    "y": ["y"],
    "y_psi": ["y", "psi"],
    "tau": TAU,
    **{t: [t] for t in TAU},
}.items():
    add(f"flip_{name}", scaled(columns, -1.0))
add("swap_xy", exchanged("x", "y"))
add("swap_tau", exchanged("tau_X", "tau_Y"))
add("east_north_up", east_north_up)
add("psi_5", turned(np.radians(5.0)), "heading_offset")
add("psi_90", turned(0.5 * np.pi), "heading_offset")
add("psi_180", turned(np.pi), "heading_offset")
add("antenna", antenna, "marker_offset")
add("drift", lambda table, _: table.assign(x=table.x + 0.01 * table.time), "current")

for name, unit in {"tau_mN": 1e3, "tau_kN": 1e-3, "tau_percent": 1e2}.items():
    add(name, scaled(TAU, unit))
# Half of the commanded force arrives: on each axis, which is the same as of each thruster.
HALF = ("loss_surge", "loss_sway", "loss_yaw", "loss_vsp", "loss_bow")
add("tau_double", scaled(TAU, 2.0), *HALF)
add("tau_N_Nmm", scaled(["tau_N"], 1e3))
add("const_psi", constant(["psi"], [0.3]))
add("const_x", constant(["x"], [5.0]))
add("const_tau_N", constant(["tau_N"], [0.1]))
add("const_tau_X", constant(["tau_X"], [0.4]))
add("const_tau", constant(TAU, [0.4, -0.5, -0.1]))
add("commands_zero", constant(TAU, [0.0] * 3))
add("commands_zero_half", constant(TAU, [0.0] * 3, since=0.5))
add("no_commands", lambda table, _: table.drop(columns=TAU))
add("commands_holes", holes(TAU, 0.5, 10))
add("commands_late", late(TAU, 50), "clock_offset", "delay")
add("pose_late", late(POSE, 50), "clock_offset", "delay")
add("command_clock_1_percent", fast_commands)
add("noise_tau", noisy(TAU, 0.3))

for name, factor in {
    "ms": 1e3,
    "min": 1.0 / 60.0,
    "double": 2.0,
    "tenth": 0.1,
    "1_percent": 1.01,
}.items():
    add(f"time_{name}", scaled(["time"], factor))
add("epoch", edit(["time"], lambda time: time + 1.7e9))
add("midnight", edit(["time"], lambda time: (time + 86_300.0) % 86_400.0))
add("jitter", noisy(["time"], 0.002))
add("reversed", rows(lambda n: np.arange(n)[::-1]))
add("shuffled", shuffled)
add("twice_5", twice_some)
add("twice_all", rows(lambda n: np.arange(n).repeat(2)))
add("two_runs", two_runs)
add("one_row", rows(lambda n: np.arange(min(n, 1))))
add("100_rows", rows(lambda n: np.arange(min(n, 100))))
for seconds in (9, 40, 70):
    add(f"{seconds}_s", while_time(float(seconds)))
for hertz in (10, 5, 2, 1):
    add(f"{hertz}_Hz", rows(lambda n, k=100 // hertz: np.arange(0, n, k)))
add("held_10_Hz", held(POSE, lambda share: np.arange(share.size) % 10 == 0))

add("holes_10", holes(POSE, 0.1, 10))
add("holes_60", holes(POSE, 0.6, 12))
add("holes_x", holes(["x"], 0.3, 6))
add("frozen", frozen(POSE, 0.28, 0.44))
add("frozen_x", frozen(["x"], 0.28, 0.39))
add("frozen_y_from", frozen(["y"], 0.22, 1.0))
add("outliers_1", struck("x", 0.01, 1.0))
add("outliers_5", struck("x", 0.05, 1.0))
add("outliers_1e6", struck("x", 0.01, 1e6))
add("outliers_psi", struck("psi", 0.01, 1.0))
add("outliers_tau", struck("tau_X", 0.01, 40.0))
add("infinite", struck("x", 0.01, np.inf))
add("huge", struck("y", 0.01, 1e300))
add("noise_5_mm", noisy(PLACE, 0.005))
add("noise_3_deg", noisy(["psi"], 0.05))
add("rounded_1_cm", edit(PLACE, lambda place: place.round(2)))
add("at_rest", at_rest)
