"""Which samples of a measured run are usable: faults are counted and reported, never repaired."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, ndtri

from cosim import InputError
from fmus.actuators.response import CommandLayout, layouts
from fmus.ops import wrap
from fmus.scale import REFERENCE, Scale

from ..execution.short_text import ShortRepr
from .columns.columns import other_angles
from .columns.geographic import unwrapped
from .columns.unit_check import GO_ON, LARGEST, QUICKEST, refuse_time, refuse_units
from .files.reading import Run
from .files.telegrams import filled
from .frozen import goes_straight, repeated, stuck
from .position_jumps import parted
from .row_order import in_bursts, missing_rows, ordered
from .run_constants import EVERY, HORIZON, LEVEL, LONG, NEGLIGIBLE, ORDER, WIDTH

BRIEF = 0.1  # s; a delay or an interval that is shorter makes no difference to a motion (chosen)

PLACE, HEADING = np.s_[:2], np.s_[2:]  # channels of the pose, each of one receiver


def normal_within(share: float) -> float:
    """Standard deviations of a normal distribution within which a share of it lies [1]."""
    return float(ndtri((1.0 + share) / 2.0))


Z95 = normal_within(LEVEL)


class Counts(NamedTuple):
    """Samples of a run, and what became of them: used is the rest."""

    samples: int
    frozen: int
    dropped: int
    spikes: int
    used: int


@dataclass(frozen=True, eq=False, repr=False)
class Track(ShortRepr):
    """A run with its samples judged.

    Attributes:
        run: its rows in the order of time, rows without a time of their own left out.
        pose: (n, 3), pose [m, m, rad], heading continuous over turns; NaN where it is not fresh.
        fresh: (n, 3), which channels were measured anew in each row.
        frozen: (n,), all three channels repeat the measurement before.
        dropped: (n,), no position: NaN, infinite, or all three zero.
        between: (n,), rows of a log between two measurements of a slower measurement system.
        period: of the measurement [s].
        out: number of samples that are left out, as they have no time of their own.
        notes: what was found, a line each.
        scale: of the ship.
    """

    run: Run
    pose: np.ndarray
    fresh: np.ndarray
    frozen: np.ndarray
    dropped: np.ndarray
    between: np.ndarray
    period: float
    out: int
    notes: tuple[str, ...]
    scale: Scale = REFERENCE

    def rows(self, keep: np.ndarray) -> "Track":
        """The track with some of its rows (n,) alone."""
        judged = {
            name: getattr(self, name)[keep] for name in ("pose", "fresh", "frozen", "dropped", "between")
        }
        return replace(self, run=self.run.rows(keep), **judged)

    @property
    def lag(self) -> float:
        """The longest lag [s] of the ship's actuators, as its file describes them."""
        parts = self.run.ship.actuators if self.run.ship else ()
        return max([part.number("lag") for part in parts], default=0.0)

    @cached_property
    def slewing(self) -> float:
        """Time [s] that commands with a limited rate take for all of their way in a run, or to zero."""
        layout, commands = _layout(self.run), self.run.commands
        if layout is None or commands is None:
            return 0.0
        rates = np.array(layout.rates)
        ways = np.ptp(np.vstack([commands, np.zeros_like(rates)]), axis=0)
        ways = np.where(layout.round, np.minimum(ways, np.pi), ways)
        return float(np.max(np.divide(ways, rates, out=np.zeros_like(ways), where=rates > 0.0)))

    @property
    def responded(self) -> float:
        """Time [s] from which commands before the run, which are not known, hardly act any more."""
        return float(self.run.time[0]) - float(np.log(NEGLIGIBLE)) * self.lag + self.slewing

    @cached_property
    def periods(self) -> np.ndarray:
        """(3,), from a measurement of each channel to its next, the median [s]."""
        return np.array([np.median(np.diff(self.run.time[there])) for there in self.fresh.T])

    @cached_property
    def valid(self) -> np.ndarray:
        """(n,), rows with a new measurement of the position."""
        return self.fresh[:, 0]

    @cached_property
    def rounding(self) -> np.ndarray:
        """(n, 3), standard deviation by rounding [m, m, rad]; zero where there is no measurement."""
        return np.where(self.fresh, self.run.coarse, 0.0) / 12.0**0.5

    @cached_property
    def usual_rounding(self) -> np.ndarray:
        """(3,), the median of it over the measurements [m, m, rad]."""
        return np.array(
            [np.median(r[there]) for r, there in zip(self.rounding.T, self.fresh.T, strict=True)]
        )

    @cached_property
    def silences(self) -> np.ndarray:
        """(n,), number of the part of the run that each row lies in; odd parts are without commands.

        A log in which most commands are missing, between most of the others, too, or where hardly one
        that is there repeats the one before, writes them when they change: there they are held.
        """
        time, held, given = self.run.time, self.run.held, self.run.given
        each = np.zeros((1, time.size), bool) if held is None else held.T
        values = given.T if given.shape == each.T.shape else np.zeros(each.shape)
        begun, ended = np.concatenate(
            [self._unstated(*pair) for pair in zip(each, values, strict=True)], axis=1
        )
        order = np.argsort(begun, kind="stable")
        begun, ended = begun[order], np.maximum.accumulate(ended[order])
        meet = np.flatnonzero(begun[1:] <= ended[:-1])  # of two that overlap one part is made
        begun, ended = np.delete(begun, meet + 1), np.delete(ended, meet)
        return np.searchsorted(begun, time, "left") + np.searchsorted(ended, time, "right")

    def _unstated(self, held: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(2, m), begin and end [s] of the parts in which a command, values (n,), is not known."""
        time, stated = self.run.time, np.flatnonzero(~held)
        apart = 2 * int((np.diff(stated) == 1).sum()) < stated.size
        changes = (
            float(np.mean(np.diff(values[stated]) == 0.0)) <= NEGLIGIBLE if stated[1:].size else True
        )
        written = 2 * stated.size < time.size and (apart or changes)
        given = time if written else time[stated]
        longest = long_gap(float(np.median(np.diff(time))), self.scale)
        # Before the first command and behind the last one nothing is known of them either.
        first = [-np.inf] if given[0] - time[0] > longest else []
        last = [np.inf] if time[-1] - given[-1] > longest else []
        given = np.concatenate([first, given, last])
        silent = np.diff(given) > longest
        return np.array([given[:-1][silent], given[1:][silent]])

    def counts(self, spikes: int = 0) -> Counts:
        """Counts of the samples by their use."""
        frozen, dropped = int(self.frozen.sum()), int(self.dropped.sum()) + self.out
        samples = int((~self.between).sum()) + self.out
        return Counts(samples, frozen, dropped, spikes, samples - frozen - dropped - spikes)


def clean(run: Run, anyway: bool = False, scale: Scale = REFERENCE) -> Track:
    """Judge the samples of a run.

    Args:
        run: as it was read.
        anyway: whether a speed that no ship has, or a heading in degrees, is accepted.
        scale: of the ship.

    Raises:
        InputError: too short, time not in order, another unit than said, nothing valid, no motion.
    """
    where, run = f"run '{run.name}'", ordered(run, scale)
    run = replace(
        run, pose=np.where(np.maximum(np.abs(run.pose), run.coarse) < LARGEST, run.pose, np.nan)
    )
    run = parted(run, scale)
    row, seconds = refuse_short(run, scale)
    notes = list(run.notes)
    gone = (run.pose == 0.0).all(axis=1)
    seen, repeats, between = updates(run, PLACE, gone)
    alone, lines = stuck(run, seen)
    notes += lines
    seen, repeats = seen & ~alone, repeats | alone
    turned, constant, lined = updates(run, HEADING, gone)
    straight = goes_straight(run, seen, constant, WIDTH * scale.time)
    turned, constant = turned | straight, constant & ~straight
    late, lines = perhaps_late(run.time, seen, repeats | between, row, "positions")
    notes += lines
    turned_late, lines = perhaps_late(run.time, turned, constant | lined, row, "headings")
    notes += lines
    seen, turned = seen & ~late, turned & ~turned_late
    if turned.sum() <= ORDER < min(seen.sum(), constant.sum()):
        if not anyway:
            raise InputError(f"{where}: psi is constant while the ship moves; {GO_ON}")
        turned = turned | constant
    # Where no heading is near, a place tells nothing of surge and sway.
    own = float(np.median(np.diff(run.time[turned]))) if turned.sum() > 1 else row
    apart = min(max(WIDTH * scale.time, LONG * row), long_gap(own, scale))
    headless = seen & ~near(run.time, turned, apart)
    dropped = ~(seen | repeats | between | late) | headless
    if many := int(headless.sum()):
        begin = run.time[np.argmax(headless)] - run.time[0]
        notes.append(
            f"{many} positions have no heading near them, the first {begin:.3g} s from the start: they "
            "are not used"
        )
    fresh = np.flatnonzero(seen & ~dropped)
    if min(fresh.size, turned.sum()) <= ORDER:  # there is no third difference
        raise InputError(f"{where} does not move: its pose is frozen or missing in all rows")
    if between.any() or lined.any():
        notes.append("rows between two measurements were linearly interpolated: they are not counted")
    between |= late
    period = float(np.median(np.diff(run.time[fresh])))
    refuse_time(row, seconds, where, run.called or {}, scale)
    # With a few of the samples that regular sampling would give, nothing can be differentiated.
    if in_bursts(run, scale):
        mean = float(np.diff(run.time).mean())
        raise InputError(
            f"{where}: its samples come in bursts, {row:.3g} s apart and {mean:.3g} s on average"
        )
    if np.round(period / row) > 1.0:  # a log that is faster than the measurement
        after = np.searchsorted(fresh, np.arange(repeats.size))
        last = run.time[fresh][np.maximum(after - 1, 0)]
        between |= repeats & (run.time - last < period - 0.5 * row)
        until = run.time[fresh][np.minimum(after, fresh.size - 1)] - last
        # Rows are empty between two measurements if no other one was due meanwhile.
        between |= np.isnan(run.pose[:, :2]).all(axis=1) & (until < 2.0 * period)
        dropped &= ~between
        notes.append(f"a measurement every {period:.4g} s, a row every {row:.4g} s")
    between |= repeats & turned  # a position that is held while the heading goes on
    frozen = repeats & ~between
    measured = np.column_stack([seen, seen, turned]) & np.column_stack([~dropped, ~dropped, ~gone])
    pose = np.where(measured, run.pose, np.nan)
    gap = long_gap(period, scale)
    of_heading = np.flatnonzero(measured[:, 2])
    refuse_units(run.time, pose, angles_beside(run), where, anyway, run.called or {}, scale)
    pose[of_heading, 2] = unwrap(run.time[of_heading], pose[of_heading, 2], gap)
    channels = [pose[rows, k] for k, rows in enumerate(measured.T)]
    reach = np.array([np.ptp(np.quantile(values, (0.1, 0.9))) for values in channels])
    if not (reach > [6.0 * noise(values[:, None])[0] for values in channels]).any():
        raise InputError(f"{where} does not move: its pose is noise about a fixed position")
    steps = np.diff(run.time[fresh])
    if many := int((steps > gap).sum()):
        begin = run.time[fresh][steps.argmax()] - run.time[0]
        longest = f"{steps.max():.4g} s, {begin:.4g} s from the start"
        notes.append(f"a gap of {longest}" if many == 1 else f"{many} gaps, the longest {longest}")
    track = Track(
        run, pose, measured, frozen, dropped, between, period, run.left_out, tuple(notes), scale
    )
    return replace(track, notes=(*notes, *_without_commands(track)))


def _without_commands(track: Track) -> list[str]:
    """A line on the time without commands."""
    rows = np.flatnonzero(track.silences % 2 == 1)
    if not rows.size:
        return []
    time = track.run.time
    seconds = float(np.median(np.diff(time))) * rows.size
    begin = time[rows[0]] - time[0]
    return [
        f"commands are missing for {seconds:.3g} s, first {begin:.3g} s from the start: no model is "
        "judged there"
    ]


def long_gap(period: float, scale: Scale) -> float:
    """Time [s] from which on a gap between samples some period [s] apart is one."""
    return max(EVERY * scale.time, LONG * period)


def refuse_short(run: Run, scale: Scale) -> tuple[float, float]:
    """Median time between two rows and length [s] of a run whose rows are in order.

    Raises:
        InputError: the run is shorter than a window of prediction.
    """
    with np.errstate(over="ignore"):
        row = float(np.median(np.diff(run.time))) if run.time.size > 1 else 0.0
    seconds = float(run.time[-1] - run.time[0]) + row if run.time.size > 1 else 0.0
    shortest = HORIZON * scale.time
    if seconds < shortest * (1.0 - 1e-6):
        raise InputError(
            f"run '{run.name}' is too short: {seconds:.3g} s, at least {shortest:.3g} s are needed"
        )
    return row, seconds


def between(time: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, m) at some times (n,) by linear interpolation of those (k, m) at known ones (k,)."""
    return np.column_stack([np.interp(time, known, x) for x in values.T])


def angles_beside(run: Run) -> dict[str, np.ndarray]:
    """Angles of a run beside its heading: those that are measured, and commands that may go round."""
    layout, commands, found = _layout(run), run.commands, other_angles(run.measured)
    if layout is None or commands is None or len(run.signals) != commands.shape[1]:
        return found
    turns = np.broadcast_to(layout.round, commands.shape[1])
    return found | {s: x for s, x, turn in zip(run.signals, commands.T, turns, strict=True) if turn}


def _layout(run: Run) -> CommandLayout | None:
    """How a ship's description lays out the commands of a run; None: they are others, or none."""
    layout = layouts(run.ship)[0] if run.ship else None
    fits = layout and run.commands is not None and len(layout.rates) == run.commands.shape[1]
    return layout if fits else None


def lost(pose: np.ndarray) -> np.ndarray:
    """(n,): where a pose (n, 3) is no measurement: NaN, infinite, or all zero."""
    return ~np.isfinite(pose).all(axis=1) | (pose == 0.0).all(axis=1)


def updates(run: Run, channels: slice, gone: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows in which channels of the pose of a run were measured, held, or filled by straight lines.

    A value that repeats is no new sample, unless it would repeat by rounding alone: then the steps
    between values are those of the rounding.

    Args:
        run: its rows in order.
        channels: of the pose, of one receiver.
        gone: (n,), rows that hold no pose.

    Returns:
        Three arrays (n,).
    """
    values, coarse = run.pose[:, channels], run.coarse[:, channels]
    if channels == HEADING:
        values = unwrapped(values[:, 0])[:, None]
    there = np.isfinite(values).all(axis=1) & ~gone
    repeats = repeated(values, there)
    rows = np.flatnonzero(there & ~repeats)
    step = np.any(np.abs(np.diff(values[rows], axis=0)) > 1.5 * coarse[rows[1:]], axis=1)
    after = np.searchsorted(rows, np.flatnonzero(repeats))  # the value that follows, where there is one
    if after.size and step.size:
        by_step = step[np.minimum(after, step.size) - 1]
        if not by_step.mean() > 0.5:
            repeats[repeats] = by_step
    rows = np.flatnonzero(there & ~repeats)
    between = np.zeros_like(there)
    between[rows] = filled(run.time[rows], values[rows], float(coarse.max(initial=0.0)))
    return there & ~repeats & ~between, repeats, between


def perhaps_late(
    time: np.ndarray, new: np.ndarray, repeats: np.ndarray, row: float, what: str
) -> tuple[np.ndarray, list[str]]:
    """New values that are not known to be of their row.

    A value that is held for several rows may have been new in one that is missing, or that is empty: it
    has the time of that.

    Args:
        time: (n,) [s].
        new: (n,), rows with a value that is not that of the row before.
        repeats: (n,), rows in which that is held.
        row: median time between two rows [s].
        what: is measured.

    Returns:
        A mask (n,), and a line if there are any.
    """
    held = 2 * repeats.sum() > new.sum() > 1
    if not held or not np.round(np.median(np.diff(time[new])) / row) > 1.0:
        return np.zeros_like(new), []
    empty = np.append(False, ~(new | repeats)[:-1])
    late = new & (empty | (np.append(0.0, missing_rows(time)) > 0.0))
    line = f"{late.sum()} {what} are not used: each is held for some rows, and the one before is missing"
    return late, [line] if late.any() else []


def near(time: np.ndarray, there: np.ndarray, apart: float) -> np.ndarray:
    """(n,): which times (n,) [s] are at most ``apart`` [s] from one of those that are there (n,)."""
    known = np.concatenate([[-np.inf], time[there], [np.inf]])
    after = np.searchsorted(known, time)
    return np.minimum(time - known[after - 1], known[after] - time) <= apart


def unwrap(time: np.ndarray, psi: np.ndarray, gap: float) -> np.ndarray:
    """The heading [rad] continuous over turns.

    Over a longer gap [s] it may have turned by more than half a turn: then that step is taken which
    comes nearest to what the yaw rate as long before and after would have turned it. A jump that no ship
    makes, as of a marker that is taken for another one, goes back the way that it came.
    """
    step, dt = wrap(np.diff(psi)), np.diff(time)
    rate = step / dt
    for k in np.flatnonzero(dt > gap):
        near = (np.abs(time[1:] - time[k]) < gap) | (np.abs(time[:-1] - time[k + 1]) < gap)
        near &= dt <= gap
        turn = dt[k] * float(np.median(rate[near])) if near.any() else 0.0
        step[k] = turn + wrap(step[k] - turn)
    away = 0.0
    for k in np.flatnonzero(np.abs(step) > np.maximum(0.5 * np.pi, QUICKEST * dt)):
        if away * step[k] > 0.0:
            step[k] -= 2.0 * np.pi * np.sign(away)
        away = 0.0 if away else float(step[k])
    return np.concatenate([psi[:1], psi[0] + np.cumsum(step)])


def noise(values: np.ndarray) -> np.ndarray:
    """Standard deviation of the noise of each channel of values (n, channels), from third differences.

    That some steps are longer than others does little harm, as the median is taken.
    """
    third = np.diff(values, ORDER, axis=0)
    factors = np.diff(np.eye(ORDER + 1), ORDER, axis=0)
    return median_std(third) / np.linalg.norm(factors)


def median_std(values: np.ndarray) -> np.ndarray:
    """Standard deviation of normal values (n, ...) about zero, by the median of their magnitudes."""
    return np.median(np.abs(values), axis=0) / np.sqrt(chdtri(1.0, 1.0 / 2.0))
