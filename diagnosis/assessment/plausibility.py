"""Whether a run's file is read as it was meant, by the data themselves: units, signs, axes, columns.

Each mistake that a file may have (an axis that points the other way, another unit, columns in each
other's place, ...) is put right in turn, and the densities of the motion are compared
(:mod:`.reading_odds`). A mistake is reported, with its odds, if it is likelier than the file as it was
read by more than chance gives to one of all, and lawful effects, a constant offset of the heading, a
current or dead actuators, do not do as well; if these hardly do worse, as one that may be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, compress
from typing import NamedTuple

import numpy as np

from cosim import InputError

from ..execution.parallel import for_each
from ..predictors import Model, WeakWindows, omega
from ..predictors.weak_form import thrust_along
from ..runs import Run, line_beside
from ..runs.columns.columns import POSE, TAU, Column, Named
from ..runs.columns.unit_check import GO_ON
from ..runs.run_constants import CHANCE, STEPS
from ..runs.sensors.evidence import ALIKE, VELOCITIES
from ..runs.sensors.sensor_finding import Examined
from .command_check import beyond_thrusters, constant_commands, contradicted_commands
from .gains import gains, varying
from .late_commands import late_commands, slower
from .reading_odds import ReadingOdds, most_thrust
from .readings import AS_READ, Reading, other_factors, readings, reread
from .settings import SETTINGS

# rad; a heading that is off by any of them is an effect of the library, and no mistake where it explains
# a run as well. Chosen: 30 degrees apart, so that one is within 15 degrees, and less than a right angle,
# to which the search for effects, which begins at zero, finds no way.
TURNS = tuple(k * np.pi / 6.0 for k in range(-2, 3) if k)
COMMANDED = ("surge force", "sway force", "yaw moment")  # that is commanded on each axis
MOST = 6  # 1, power of ten of the odds that are stated; no model is true enough for more


class Misreading(NamedTuple):
    """What is wrong with a run, how its columns should be read, and the name that one should have."""

    seen: str
    changes: Mapping[str, Named] | None = None
    name: str | None = None
    sure: bool = True


def refuse_implausible(runs: Sequence[WeakWindows], model: Model) -> list[WeakWindows]:
    """Refuse runs whose files were read otherwise than meant.

    Returns:
        The runs, with a line on a mistake that is likely, but not as sure as a refusal needs.

    Raises:
        InputError: with the likeliest mistake, and the line for the file next to the measurement.
    """
    found = []
    for w, doubt in zip(runs, for_each(lambda w: _misread(w, model), runs), strict=True):
        if doubt:
            remedy = line_beside(w.run.file, w.run.layout, doubt.changes or {}, doubt.name)
            if doubt.sure:
                raise InputError(f"run '{w.run.name}': {doubt.seen}{remedy}; {GO_ON}")
            misread = f"{doubt.seen}{remedy.replace('; ', '; if so, ', 1)}"
            w = replace(w, smoothed=replace(w.smoothed, misread=misread))
        found.append(w)
    return found


def _misread(w: WeakWindows, model: Model) -> Misreading | None:
    """What is wrong with a run, be its actuators slower than described or not."""
    with np.errstate(all="ignore"):  # in a wrong unit sums of squares may be beyond all numbers
        doubt = _doubt(w, model)
        if doubt and all(_doubt(w, each) for each in slower(w, model)):
            return doubt
        return _late(w, model)  # actuators that are slower than described are no mistake


def _doubt(w: WeakWindows, model: Model) -> Misreading | None:
    twice, wrong_one = same_columns(w.run), still_column(w.run)
    seen = f"{wrong_one} is constant in all rows, while the other channels of the pose change"
    if twice:
        wrong_one, seen = twice[1], f"{twice[0]} and {twice[1]} have the same values"
    if wrong_one:
        return Misreading(seen, {wrong_one: Named(name=wrong_one)}, "the name of its column")
    beyond, silent = beyond_thrusters(w.run, model), contradicted_commands(w, model)
    if silent and beyond is None:
        return Misreading(silent)
    given = gains(w, model)
    wrong = [f"{given.value[k]:.3g} times the {COMMANDED[k]}" for k in np.flatnonzero(given.wrong)]
    seen = beyond or (None if wrong else pushed_aside(w, model))
    # Where the samples contradict the stated noise, no motion follows from which readings have odds.
    readable = not w.smoothed.doubted
    found = likeliest_mistake(w, model, bool(beyond or wrong), given.mean) if readable else None
    if found and (found.sure or not seen):
        clause = f"{beyond}; {found.clause}" if beyond else found.clause
        return Misreading(clause, found.readings[0].changes, sure=found.sure)
    if seen:
        return Misreading(seen)
    if not wrong:
        return None
    # No other reading puts that right: it may be what the ship does, as in shallow water.
    follow = f"perhaps misread, as its accelerations follow {', '.join(wrong)}"
    return Misreading(f"{follow}; a feedback of the motion may have the same effect", sure=False)


def _late(w: WeakWindows, model: Model) -> Misreading | None:
    """Commands that are logged late; a line, as the actuators may be faster than their description."""
    late = late_commands(w, model)
    if late is None:
        return None
    return Misreading(
        f"{' and '.join(late.signals)}: probably logged {late.seconds:.2g} s late "
        f"(odds {odds_of(late.log_odds)})",
        {s: Column(name=s, late=round(late.seconds, 6)) for s in late.signals},
        sure=False,
    )


def pushed_aside(w: WeakWindows, model: Model) -> str | None:
    """A clause about a force that a ship cannot give, on an axis on which no actuator acts.

    A rudder acts sideways on a ship under way. What a current or a wind may give does not count: a
    constant force in the ship's or the earth's axes, and that of the current that explains most.
    """
    full = most_thrust(w, model)

    def beyond(of: Model) -> tuple[np.ndarray, np.ndarray]:
        lacking = varying(w, omega(w, of))
        return lacking, lacking > SETTINGS.much * full

    lacking, idle = beyond(model)
    if not idle.any():
        return None
    idle &= ~np.nan_to_num(thrust_along(w, model)).any(axis=0)
    if idle.any():
        lacking, too_much = beyond(ReadingOdds(w, model).in_current().model)
        idle &= too_much
    if not idle.any():
        return None
    k = int(np.argmax(idle))
    unit = "N.m" if k == 2 else "N"
    return (
        f"its motion needs {lacking[k]:.3g} {unit} {('ahead', 'sideways', 'in yaw')[k]}, where no "
        f"actuator acts, and all together give {full[k]:.3g} {unit}: check columns, units and axes"
    )


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
    """Readings that are far likelier than the file as it was read, the likeliest first, and the odds.

    It is sure where chance hardly gives such odds to any of all readings, not only to this one.
    """

    readings: Sequence[Reading]
    log_odds: float
    sure: bool = True
    otherwise: str = ""  # what is no mistake and would look the same

    @property
    def clause(self) -> str:
        """What seems to be wrong, and how sure that is."""
        how = "probably" if self.sure else "perhaps"
        found = ", or ".join([*(r.mistake for r in self.readings), *filter(None, [self.otherwise])])
        return f"{how} {found} (odds {odds_of(self.log_odds)})"


def odds_of(logarithm: float) -> str:
    """Odds in words, by their logarithm."""
    ten = logarithm / np.log(10.0)
    if ten < 2.0:
        return f"{np.exp(logarithm):.2g} : 1"
    return f"10^{ten:.0f} : 1" if ten < MOST else f"more than 10^{MOST} : 1"


def scale_is_confirmed(sensors: Examined | None) -> bool:
    """Whether a measured velocity agrees, in its stated unit, with the units of pose and time."""
    if sensors is None:
        return False
    other = {
        f.channel for f in sensors.findings if f.kind == "scale" and abs(1.0 / f.value - 1.0) >= ALIKE
    }
    return any(
        names[0] in sensors.agreeing and other.isdisjoint((*POSE, *names)) for names in VELOCITIES
    )


def pace_of(w: WeakWindows, model: Model) -> float:
    """Seconds meant for a second read, where the clock is wrong: accelerations are off by its square.

    The lags of the thrusters are read in the same clock, so that the factor is found with those of the
    one before, by half of each step: with lags that are too long the commands tell nothing.
    """
    pace = 1.0
    for _ in range(2 * STEPS):
        slow = model.plus({name: lag * (1.0 / pace - 1.0) for name, lag in model.lags.items()})
        given = gains(w, slow)
        factor = given.mean_of(given.stated)
        if factor is None:
            break
        pace = float(np.sqrt(pace * np.sqrt(factor)))
    return pace


def likeliest_mistake(
    w: WeakWindows, model: Model, doubted: bool = False, factor: float | None = None
) -> Mistake | None:
    """The readings of a run that are far likelier than the file as it was read, if there are any.

    Args:
        w: windows of the run.
        model: of its ship.
        doubted: whether commands or accelerations show that the file is wrong.
        factor: by which a column without a unit may be off; None: by none.
    """
    odds, possible = ReadingOdds(w, model), [*readings(w.run, model)]
    others = [] if factor is None else [*other_factors(w.run, factor, pace_of(w, model))]
    # Without a response to commands, another scale is as well a thrust that is lost.
    if scale_is_confirmed(w.smoothed.sensors) or constant_commands(w.run):
        possible, others = ([r for r in some if r.density == 0.0] for some in (possible, others))
    named = len(possible)
    possible += others
    if beyond_thrusters(w.run, model):
        sound = [not beyond_thrusters(reread(w, r, model).run, model) for r in possible]
        named, possible = sum(sound[:named]), [*compress(possible, sound)]
        if not possible:
            return None
    asked = -np.log(CHANCE)
    needed = asked if doubted else asked + np.log(len(possible))
    found = np.array([odds.log_density(reading) for reading in possible])
    as_read = odds.log_density(AS_READ)
    if not found.max() > as_read + asked:
        return None
    best = possible[int(np.argmax(found))]
    lawful, dead = as_read, None
    if not doubted:  # no lawful effect gives accelerations the other way, or so many times too large
        turned = (Reading("", {"psi": Named(name="psi", offset=turn)}) for turn in TURNS)
        in_current = odds.in_current().log_density(AS_READ)
        lawful = max(as_read, in_current, *map(odds.log_density, turned))
        dead = best.dead(TAU if w.run.commands is None else w.run.signals)
    # Of an actuator that acts the other way a dead one explains half: it may be nearly as likely.
    without = odds.log_density(dead) if dead else -np.inf
    if found.max() < lawful + asked or found.max() < without + np.log(2.0):
        return None
    better = found.max() - max(lawful, without)
    near = np.flatnonzero(found > found.max() + np.log(CHANCE))
    # Of a ship that is the same on both sides, axes that are mirrored are as well commands that are
    # swapped, which is a rarer mistake, unless it is twice as likely or more.
    order = sorted(
        near,
        key=lambda k: (
            k >= named,
            found[k] < found.max() - np.log(2.0),
            possible[k].commands is not None,
            len(possible[k].changes),
            -found[k],
        ),
    )
    if order[0] < named:  # a unit with a name is as good as a number
        order = [k for k in order if k < named]
    found_best = [possible[k] for k in order]
    otherwise = "" if order[0] < named else _weak_thrusters(odds, found_best[0], factor)
    return Mistake(found_best, better, bool(better >= needed and not otherwise), otherwise)


def _weak_thrusters(odds: ReadingOdds, likeliest: Reading, factor: float | None) -> str:
    """Thrusters that are all weak, as by a flat battery, in words; empty where they are no explanation.

    They are as usual as a unit or a clock without a name, unless this alone explains all of the motion,
    which may be twice the noise off. Where damping is quadratic, both explain the same.

    Args:
        odds: of the run.
        likeliest: reading in such a unit, or by such a clock.
        factor: that the accelerations are off by; None: by none.
    """
    if factor is None or not SETTINGS.least_gain < factor < 1.0:
        return ""
    left, as_read = (odds.explained(reading).left for reading in (likeliest, AS_READ))
    return "" if left <= 2.0 < as_read else f"all thrusters give {factor:.2g} of theirs"
