"""Whether a run's file is read as it was meant, by the data themselves: units, signs, axes, columns.

The force that a motion needs, z = M nu_dot + hull forces in weak form, follows the commanded force T.
For each mistake that a file may have (an axis that points the other way, another unit, ...) the motion
is put right, and the commands of each axis are explained by it,

    U = min_c sum (T - c z)^2 / sum T^2,    0.1 <= c <= 10 or c = 0,    T, z without their means,

the share of the commands of which the motion shows nothing. T is the same whatever the motion, so that
U of two readings can be compared; c is one for the model's inertia and the right units. A hull,
thrusters or surroundings that differ from the model raise U in every reading, and an axis on which
nothing arrives has c = 0 in each; only a mistake lets *another* reading explain the commands.

The likeliest mistake is told if it lowers the product of the three U by a factor, by more than chance in
so many windows (likelihood ratio), makes no axis worse and leaves none mostly unexplained, and an
offset of the heading does not do as well. A mistake in the pose needs commands on all three axes: one
alone is explained by another ship's hull as well.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from cosim import InputError

from ..predictors import Model, WeakWindows
from ..predictors.weak_form import OVERLAP, commanded_force
from ..runs import Run, line_beside
from ..runs.columns.columns import POSE, TAU
from ..runs.columns.side_car import ColumnChange
from ..runs.columns.unit_check import GO_ON
from ..runs.files.resolution import FUZZ
from .command_check import beyond_thrusters, contradicted_commands
from .gains import ThrustGains, gains
from .readings import AS_READ, Reading, directions, needed, other_factors, reread, units
from .settings import SETTINGS

# rad; a heading that is off by any of them is an effect of the library, and no mistake where it explains
# a run as well. Chosen: 30 degrees apart, so that one is within 15 degrees.
TURNS = tuple(np.arange(1, 12) * np.pi / 6.0)


def refuse_implausible(runs: Sequence[WeakWindows], model: Model) -> None:
    """Refuse runs whose files were read otherwise than meant.

    Args:
        runs: windows of the runs.
        model: the initial one.

    Raises:
        InputError: with the likeliest mistake, and the line for the file beside the measurement.
    """
    for w in runs:
        with np.errstate(all="ignore"):  # in a wrong unit sums of squares may be beyond all numbers
            found = _refusal(w, model)
        if found:
            seen, changes, name = found
            remedy = line_beside(w.run.file, changes, name)
            raise InputError(f"run '{w.run.name}': {seen}{remedy}; {GO_ON}")


def _refusal(w: WeakWindows, model: Model) -> tuple[str, Mapping[str, ColumnChange], str | None] | None:
    """What is wrong with a run, how its columns should be read, and the name that one should have."""
    twice, wrong_one = same_columns(w.run), still_column(w.run)
    seen = f"{wrong_one} is the same number in all rows, while the rest of the pose changes"
    if twice:
        wrong_one, seen = twice[1], f"{twice[0]} and {twice[1]} are the same numbers"
    if wrong_one:
        return seen, {wrong_one: ColumnChange(wrong_one)}, "the name of its column"
    beyond, silent = beyond_thrusters(w.run, model), contradicted_commands(w, model)
    if silent and beyond is None:
        return silent, {}, None
    found = likeliest_mistake(w, model)
    if found:
        seen = (
            f"it seems that {found.reading.mistake}: then {found.after:.0%} of its "
            f"commands show in its motion, as it was read {found.before:.0%}"
        )
        return seen, found.reading.changes, None
    given = gains(w, model)
    wrong = [f"{given.value[k]:.3g} times {TAU[k]}" for k in np.flatnonzero(given.wrong)]
    reading = likeliest_unit(w, model, given) if wrong else None
    if beyond is None and not wrong:
        return None
    seen = beyond or f"its accelerations follow {', '.join(wrong)}"
    if reading is None:
        return seen, {}, None
    return f"{seen}; it seems that {reading.mistake}", reading.changes, None


def likeliest_unit(w: WeakWindows, model: Model, given: ThrustGains) -> Reading | None:
    """The reading in which the commands give the accelerations that they should, if there is any.

    Of several that in which the model's error is the least part of the commands: the median of the axes
    counts, as what is hidden in the ship is mostly on one. Units without a name come last.

    Args:
        w: windows of the run.
        model: its inertia, hull and thrusters.
        given: its gains as it was read.
    """
    k = given.mean
    for readings in (units(w.run, model), () if k is None else other_factors(w.run, k)):
        found = []
        for reading in readings:
            meant = reread(w, reading)
            then = gains(meant, model)
            known = (then.told | ~given.told).all()
            if not (known and then.close) or beyond_thrusters(meant.run, model):
                continue
            T = meant.held @ commanded_force(meant, model)
            off = ((needed(meant, model) - T) ** 2).sum(axis=0) / (T**2).sum(axis=0)
            found.append((float(np.median(np.nan_to_num(off, nan=np.inf))), reading))
        if found:
            return min(found, key=lambda each: each[0])[1]
    return None


def same_columns(run: Run) -> tuple[str, str] | None:
    """Two signals of a run that are the same numbers, if there are any."""
    signals = dict(zip(("time", *POSE, *TAU), (run.time, *run.pose.T, *run.tau_cmd.T), strict=True))
    commands = combinations(TAU if run.commands is None else (), 2)
    for a, b in (*combinations(("time", *POSE), 2), *commands):
        if np.array_equal(signals[a], signals[b], equal_nan=True) and np.nanstd(signals[a]) > 0.0:
            return a, b
    return None


def still_column(run: Run) -> str | None:
    """The coordinate that is constant to the bit in a run whose other one and heading change, if one is.

    A heading may be, where a run without noise is straight.
    """
    changes = np.nanmax(run.pose, axis=0) > np.nanmin(run.pose, axis=0)
    return POSE[int(np.argmin(changes))] if changes[2] and changes[:2].sum() == 1 else None


class Mistake(NamedTuple):
    """A reading that explains a run better, and 1 - U before and after, mean of the axes."""

    reading: Reading
    before: float
    after: float


def likeliest_mistake(w: WeakWindows, model: Model) -> Mistake | None:
    """The mistake without which the commands of a run are explained far better, if there is any.

    A model's inertia and hull give the force that a motion needs.
    """
    commands = w.held @ commanded_force(w, model)
    commands = commands - commands.mean(axis=0)
    size = (commands**2).sum(axis=0)
    heard = size > FUZZ * size.max()
    if not heard.any():
        return None

    def shares(z: np.ndarray, T: np.ndarray = commands) -> np.ndarray:
        missing = _unexplained(T, z)[heard] / (T**2).sum(axis=0)[heard]
        return np.maximum(missing, SETTINGS.negligible)

    as_read = _varying(w, model, AS_READ)
    now = shares(as_read)
    if now.max() <= SETTINGS.negligible:
        return None
    found, readings = [], [*directions(w.run, model)]
    by_chance = chdtri(1, SETTINGS.chance / len(readings)) / (w.middle.size / OVERLAP)
    for reading in readings:
        z = as_read if reading.still else _varying(w, model, reading)
        then = shares(z, commands @ reading.commands.T)
        better = float(np.log(now / then).sum())
        worse = (then > now + SETTINGS.negligible).any()
        sound = not worse and then.max() < SETTINGS.explained
        alone = reading.still and np.array_equal(np.abs(reading.commands), np.eye(3))
        if better > max(np.log(SETTINGS.factor), by_chance) and sound and (alone or heard.all()):
            found.append((better, reading, then))
    if not found:
        return None
    better, reading, then = max(found, key=lambda each: each[0])
    turned = (shares(_varying(w, model, Reading("", turn=turn))) for turn in TURNS)
    lawful = max(float(np.log(now / each).sum()) for each in turned)
    if better < np.log(SETTINGS.factor) + max(lawful, 0.0):
        return None
    return Mistake(reading, 1.0 - float(now.mean()), 1.0 - float(then.mean()))


def _varying(w: WeakWindows, model: Model, reading: Reading) -> np.ndarray:
    """Force (K, 3) that the motion of a run needs by a reading [N, N, N m], less its mean."""
    z = needed(reread(w, reading), model)
    return z - z.mean(axis=0)


def _unexplained(commands: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Sum of squares (3,) of what of commands (K, 3) does not follow from the needed force z (K, 3)."""
    with np.errstate(all="ignore"):
        c = np.nan_to_num((commands * z).sum(axis=0) / (z * z).sum(axis=0))
        c = np.clip(c, SETTINGS.least_gain, 1.0 / SETTINGS.least_gain)
        off = ((commands - c * z) ** 2).sum(axis=0)
    return np.fmin(off, (commands**2).sum(axis=0))
