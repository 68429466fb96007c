"""A measured run as every command uses it: one file gives one set of samples.

A run is read, repaired by its own redundant channels (:mod:`.sensors`), cleaned, thinned if it is long,
and smoothed with the velocities and rates that agree with its pose.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import inf
from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from fmus.scale import Scale
from fmus.ship import Ship, ship

from .cleaning import Track, clean, refuse_short
from .columns.unit_check import GO_ON
from .files.reading import Run, read
from .frozen import without_frozen
from .row_order import ordered
from .sensors.further_channels import accelerations, receivers, through_water
from .sensors.motion import motion
from .sensors.sensor_finding import Examined
from .sensors.unit_faults import sway, units
from .sensors.wraps import wraps
from .smoothing.smoother import Smoothed, smooth
from .thinning import filled_up, thinned

# A part of a log contains less information on its clock than the whole.
WHOLE_FIRST = (
    "repair the whole log by its redundant channels (cybership repair) and use the part of the result"
)


@dataclass(frozen=True, eq=False)
class PreparedRun:
    """A measured run, and the samples of it that every command uses.

    Attributes:
        raw: the run as it was read.
        sensors: faults that its redundant channels show, and the run as far as they repair it.
        track: its samples in the order of time, judged, of a long run thinned.
        anyway: whether a run is accepted in which more is wrong than can be repaired.
    """

    raw: Run
    sensors: Examined
    track: Track
    anyway: bool = False

    @cached_property
    def smoothed(self) -> Smoothed:
        """The motion by the samples.

        Raises:
            InputError: the samples do not determine a motion, or too many of them are spikes.
        """
        found = smooth(self.track, agreeing=self.sensors.agreeing)
        fresh, spikes = int(self.track.valid.sum()), int(found.spikes.sum())
        if 2 * spikes > fresh and not self.anyway:
            raise InputError(
                f"run '{self.raw.name}': {spikes} of {fresh} samples ({spikes / fresh:.0%}) are "
                "more than five standard deviations from the track of all others. The pose or its "
                "time is wrong. Leave the cells of false samples empty, or, of a part of a log, "
                f"{WHOLE_FIRST}; {GO_ON}"
            )
        return replace(found, sensors=self.sensors)

    @property
    def samples(self) -> np.ndarray:
        """(n,), rows of the track that are samples: a new measurement that is no spike."""
        return self.smoothed.used

    def part(self, rows: np.ndarray) -> "PreparedRun":
        """The run with some rows (n,) of its track alone, which is examined, cleaned and thinned whole.

        Raises:
            InputError: the part is too short.
        """
        part = self.track.rows(rows)
        refuse_short(part.run, self.track.scale)
        return replace(self, track=part)


def prepare(
    source: str | Path | Run, of: Ship | None = None, anyway: bool = False, also: Iterable[str] = ()
) -> PreparedRun:
    """Prepare a measured run: the only way in for all commands.

    Args:
        source: a file or the folder of a log, see :func:`.read`, or a run that was read.
        of: the ship that was measured; None: the default ship.
        anyway: whether a run is accepted whose units seem to be other ones than stated, whose channels
            contradict each other beyond repair, or many of whose samples are spikes.
        also: see :func:`.read`.

    Raises:
        InputError: the run cannot be read or used.
    """
    of = of or ship()
    raw = source if isinstance(source, Run) else read(source, of=of, also=also)
    raw = raw if raw.ship else replace(raw, ship=of.description)
    sensors = examine(raw, of.scale)
    unrepaired = [finding for finding in sensors.findings if not finding.repaired]
    in_doubt = next((finding for finding in unrepaired if not finding.aside), None)
    if in_doubt and not anyway:
        raise InputError(
            f"run '{raw.name}': {in_doubt.sentence}; no other channel shows how to repair this; if "
            f"the run is a part of a log, {WHOLE_FIRST}; {GO_ON}"
        )
    sensors = sensors.without({name for finding in unrepaired for name in finding.aside})
    repaired = replace(sensors.run, notes=(*sensors.run.notes, *sensors.notes))
    return PreparedRun(raw, sensors, filled_up(thinned(clean(repaired, anyway, of.scale))), anyway)


def examine(run: Run, scale: Scale) -> Examined:
    """Cross-check channels that are redundant.

    Args:
        run: as it was read.
        scale: of the ship.

    Returns:
        The run as far as its own channels repair it, and what they say of each other.
    """
    found = Examined(without_frozen(ordered(run, scale)))
    # In the order in which one needs what others repair.
    for check in (wraps, units, sway, receivers, motion, accelerations, through_water):
        found = found.plus(check(found.run, scale))
    return found


def read_each(sources: Sequence[str | Path | Run], of: Ship | None = None) -> list[Run]:
    """Read several runs, each under a name of its own.

    The first run of a name keeps it, a later one has more of its path in it: names of training runs do
    not depend on the test runs that follow.

    Args:
        sources: files, folders of logs, or runs that were read.
        of: the ship that was measured; None: the default ship.

    Raises:
        InputError: a run cannot be read, or two hold the same measurement, which would count twice, and
            as validation data would prove nothing.
    """
    runs = [source if isinstance(source, Run) else read(source, of=of) for source in sources]
    paths = [source.name if isinstance(source, Run) else source for source in sources]
    known: dict[bytes, str | Path] = {}
    found: list[Run] = []
    for run, path in zip(runs, paths, strict=True):
        content = np.column_stack([run.time, run.pose]).tobytes()
        if content in known:
            again = f"'{path}' is given twice; a run is training, validation or test data, once"
            same = f"'{path}' holds the same measurement as '{known[content]}'"
            raise InputError(again if Path(path) == Path(known[content]) else same)
        known[content] = path
        taken = any(run.name == other.name for other in found)
        found.append(replace(run, name=Path(path).absolute().as_posix()) if taken else run)
    return found


def cut(runs: Sequence[Run], moments: Sequence[tuple[str, float]]) -> list[Run]:
    """Runs of which some are cut into parts, each a run of its own.

    Args:
        runs: that were read.
        moments: names of runs, each with a time of its log [s] at which a part ends and another begins.

    Raises:
        InputError: no run has the name, or none of its rows is between two moments.
    """
    names = [run.name for run in runs]
    for name, _ in moments:
        if name not in names:
            raise InputError(f"there is no training run '{name}' to split{nearest(name, names)}")
    found = []
    for run in runs:
        edges = [-inf, *sorted(time for name, time in moments if name == run.name), inf]
        for begin, end in pairwise(edges):
            rows = (run.time >= begin) & (run.time < end)
            if not rows.any():
                begins, ends = run.time[[0, -1]]
                raise InputError(
                    f"run '{run.name}' has no row in a part of it: it is from {begins:g} to {ends:g} s"
                )
            of = [f"from {begin:g} s"] * (begin > -inf) + [f"until {end:g} s"] * (end < inf)
            found.append(replace(run.rows(rows), name=" ".join([run.name, *of])))
    return found
