"""Whether a run's file is read as it was meant, by the data themselves: units, signs, axes, columns.

The force that a motion needs, z = M nu_dot + hull forces in weak form, follows the commanded force T.
For each mistake that a file may have (an axis that points the other way, another unit, ...) the motion
is put right, and the commands of each axis are explained by it,

    U = min_c sum (T - c z)^2 / sum T^2,    LEAST <= c <= MOST or c = 0,    T, z without their means,

the share of the commands of which the motion shows nothing. T is the same whatever the motion, so that
U of two readings can be compared; c is one for the model's inertia and the right units. A hull,
thrusters or surroundings that differ from the model raise U in every reading, and an axis on which
nothing arrives has c = 0 in each; only a mistake lets *another* reading explain the commands.

The likeliest mistake is told if it lowers the product of the three U by FACTOR, and by more than chance
in so many windows (likelihood ratio), makes no axis worse and leaves none mostly unexplained, and an
offset of the heading does not do as well. A mistake in the pose needs commands on all three axes: one
alone is explained by another ship's hull as well.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from cosim import InputError

from ..data import Run, line_beside
from ..data.columns import POSE, TAU
from ..model import Integrals, Model, omega

# Of c: a mass or a thruster that is wrong by ten is still a matter of the diagnosis. Derived: half of
# the way, in logarithms, to the nearest wrong unit, centimetres.
LEAST, MOST = 0.1, 10.0
# Chosen: with a right file, whatever the effect in it, another reading explains as much at the most.
FACTOR = 4.0
# Of U: by so much an axis may be worse in the right reading. Chosen; noise alone changes less.
WORSE = 0.05
# Of U: a run whose commands show in every axis but for so little needs no other reading. Chosen.
MISSING = 0.1
# Of U: so much an axis may lack in the right reading. Chosen: where more is missing, no model is a judge.
EXPLAINED = 0.5
# Windows of the weak form that count as one. Derived: the correlations of their kernel sum to 3.7.
OVERLAP = 4
CHANCE = 0.01  # of a mistake where there is none, divided by the number of readings
# rad; a heading that is off by any of them is an effect of the library, and no mistake where it explains
# a run as well. Chosen: 30 degrees apart, so that one is within 15 degrees.
TURNS = tuple(np.arange(1, 12) * np.pi / 6.0)
LEAST_SHARE = 1e-4  # of the commands, below which nothing is told apart (chosen)
SILENT = 1e-6  # of the largest sum of squares; commands of an axis that are less are none


class Reading(NamedTuple):
    """Another way to read a file.

    Attributes:
        mistake: what is wrong if it is right, as a clause.
        motion: (3, 3), from the pose as it was read to the pose as it was meant.
        commands: (3,), the same of the commanded force, factors.
        changes: signal -> the signal whose column it should have, its sign, and the factor of its unit.
    """

    mistake: str
    motion: np.ndarray
    commands: np.ndarray
    changes: Mapping[str, tuple[str, float, float]]


def _of_pose(mistake: str, sign: Sequence[float], unit: Sequence[float] = (1.0, 1.0, 1.0)) -> Reading:
    changes = {
        signal: (signal, s, u) for signal, s, u in zip(POSE, sign, unit, strict=True) if s * u != 1.0
    }
    return Reading(mistake, np.diag(np.multiply(sign, unit)), np.ones(3), changes)


def _of_commands(mistake: str, signals: Sequence[str], sign: Sequence[float]) -> Reading:
    return Reading(mistake, np.eye(3), np.array(sign), {s: (s, -1.0, 1.0) for s in signals})


SWAPPED = Reading(
    "x and y are swapped",
    np.eye(3)[[1, 0, 2]],
    np.ones(3),
    {"x": ("y", 1.0, 1.0), "y": ("x", 1.0, 1.0)},
)
READINGS = (
    _of_pose("its heading is mirrored (clockwise is positive here)", (1.0, 1.0, -1.0)),
    _of_pose("y points west (east is positive here)", (1.0, -1.0, 1.0)),
    _of_pose("x points south (north is positive here)", (-1.0, 1.0, 1.0)),
    SWAPPED,
    _of_pose("its heading is in degrees", (1.0, 1.0, 1.0), (1.0, 1.0, np.pi / 180.0)),
    _of_pose("its position is in mm", (1.0, 1.0, 1.0), (1e-3, 1e-3, 1.0)),
    _of_pose("its position is in cm", (1.0, 1.0, 1.0), (1e-2, 1e-2, 1.0)),
)


def refuse_implausible(runs: Sequence[Integrals], paths: Sequence[Path], model: Model) -> None:
    """Refuse runs whose files were read otherwise than meant.

    Args:
        runs: see :func:`diagnosis.gather`.
        paths: of their files.
        model: the initial one.

    Raises:
        InputError: with the likeliest mistake, and the line for the file beside the measurement.
    """
    for w, path in zip(runs, paths, strict=True):
        where, last = f"run '{w.run.name}'", "--anyway goes on all the same"
        twice = same_columns(w.run)
        if twice:
            told = line_beside(path, {twice[1]: (twice[1], 1.0, 1.0)}, "the name of its column")
            raise InputError(f"{where}: {twice[0]} and {twice[1]} are the same numbers{told}; {last}")
        found = likeliest_mistake(w, model)
        if found:
            told = line_beside(path, found.reading.changes)
            raise InputError(
                f"{where}: it seems that {found.reading.mistake}: then {found.after:.0%} of its "
                f"commands show in its motion, as it was read {found.before:.0%}{told}; {last}"
            )


def same_columns(run: Run) -> tuple[str, str] | None:
    """Two signals of a run that are the same numbers, if there are any."""
    signals = {"time": run.time, **dict(zip(POSE, run.pose.T, strict=True))}
    pairs = list(combinations(signals, 2))
    if run.u is None and run.five is None:
        signals |= dict(zip(TAU, run.tau_cmd.T, strict=True))
        pairs += combinations(TAU, 2)
    for a, b in pairs:
        if np.array_equal(signals[a], signals[b], equal_nan=True) and np.nanstd(signals[a]) > 0.0:
            return a, b
    return None


class Mistake(NamedTuple):
    """A reading that explains a run far better than its file as it was read.

    Attributes:
        reading: how it was meant.
        before, after: 1 - U as it was read and as it was meant, mean of the axes.
    """

    reading: Reading
    before: float
    after: float


def likeliest_mistake(w: Integrals, model: Model) -> Mistake | None:
    """The mistake without which the commands of a run are explained far better, if there is any.

    Args:
        w: windows of the run.
        model: whose inertia and hull tell which force a motion needs.
    """
    commands = w.held @ w.run.tau_cmd
    commands = commands - commands.mean(axis=0)
    size = (commands**2).sum(axis=0)
    heard = size > SILENT * size.max()
    if not heard.any():
        return None
    as_read = _needed(w, model, np.eye(3))

    def shares(reading_of_commands: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.maximum(_unexplained(reading_of_commands, z)[heard] / size[heard], LEAST_SHARE)

    now = shares(commands, as_read)
    if now.max() < MISSING:
        return None
    found, readings = [], [*READINGS, *_flipped_commands(w.run)]
    least = chi2.isf(CHANCE / len(readings), 1) / (w.middle.size / OVERLAP)
    for reading in readings:
        still = np.array_equal(reading.motion, np.eye(3))
        z = as_read if still else _needed(w, model, reading.motion)
        then = shares(reading.commands * commands, z)
        better = float(np.log(now / then).sum())
        sound = (then <= now + WORSE).all() and then.max() < EXPLAINED
        if better > max(np.log(FACTOR), least) and sound and (still or heard.all()):
            found.append((better, reading, then))
    if not found:
        return None
    better, reading, then = max(found, key=lambda each: each[0])
    turned = (shares(commands, _needed(w, model, np.eye(3), turn)) for turn in TURNS)
    lawful = max(float(np.log(now / each).sum()) for each in turned)
    if better < np.log(FACTOR) + max(lawful, 0.0):
        return None
    return Mistake(reading, 1.0 - float(now.mean()), 1.0 - float(then.mean()))


def _flipped_commands(run: Run) -> Iterator[Reading]:
    """Readings in which commands have the other sign."""
    if run.u is None and run.five is None:
        yield _of_commands("its commands have the wrong sign", TAU, (-1.0, -1.0, -1.0))
        for k, name in enumerate(TAU):
            yield _of_commands(f"{name} has the wrong sign", (name,), 1.0 - 2.0 * np.eye(3)[k])
        return
    signals = [f"u{k}" for k in range(1, 6)] if run.five is not None else ["u_vsp_x", "u_vsp_y", "u_bow"]
    yield _of_commands("its commands have the wrong sign", signals, (-1.0, -1.0, -1.0))


def _needed(w: Integrals, model: Model, motion: np.ndarray, turn: float = 0.0) -> np.ndarray:
    """Force (K, 3) that the motion of a run needs [N, N, N m], less its mean.

    Args:
        w: windows of the run.
        model: its inertia and hull.
        motion: (3, 3), what the pose is multiplied with.
        turn: what is added to the heading [rad].
    """
    s = w.smoothed
    idle = replace(s.track.run, tau_cmd=0.0 * s.track.run.tau_cmd, u=None, five=None, power=None)
    track = replace(s.track, run=idle)
    meant = replace(
        s, track=track, eta=s.eta @ motion.T + [0.0, 0.0, turn], eta_dot=s.eta_dot @ motion.T
    )
    with np.errstate(all="ignore"):  # in a wrong unit forces may be beyond all numbers
        z = np.nan_to_num(omega(replace(w, smoothed=meant, memory={}), model), posinf=0.0, neginf=0.0)
    return z - z.mean(axis=0)


def _unexplained(commands: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Sum of squares (3,) of what of commands (K, 3) does not follow from the needed force z (K, 3)."""
    with np.errstate(all="ignore"):
        c = np.nan_to_num((commands * z).sum(axis=0) / (z * z).sum(axis=0))
        off = ((commands - np.clip(c, LEAST, MOST) * z) ** 2).sum(axis=0)
    return np.fmin(off, (commands**2).sum(axis=0))
