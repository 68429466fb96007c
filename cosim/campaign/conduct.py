"""A campaign from its file to its table."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cybership.scratch_folder import sweep

from ..compiled.library import kind_of, prepare_library
from ..dispatch.job import Job, RunRow
from ..dispatch.measured_run import Measured
from ..dispatch.places import RunPlace, check_address, check_workers, place_for
from ..dispatch.travelling_files import Files
from ..errors import InputError, SimulationError, not_written
from ..files import update_json, write_roomy_json
from ..interrupts import Held
from ..process.run_state import CAMPAIGN, STATE
from ..results.folder_lock import locked_folder
from ..scenario.load import with_settings
from ..scenario.schema import Scenario
from .campaign_file import LoadedCampaign
from .case_scenarios import CaseScenarios
from .comparison import StopRule
from .design import Case, cases
from .run_table import JOURNAL, TABLE, Journal, hashes, keep_log, table, write_table

if TYPE_CHECKING:
    import pandas

NEEDED = ("pandas", "pyarrow", "scipy", "distributed")
SUMMARY = "campaign.json"
LOCK = ".campaign.lock"
# Share of the time that writing the table of a larger campaign may take while it runs; chosen: it then
# lacks the runs of the last half second, and none where a run takes longer.
WRITING = 0.02
SMALL = 20  # runs up to which the table lacks none; chosen: written in 10 ms, it takes 0.2 s for these
# Receives the number of runs that have ended, failed ones among them, and of all runs.
Progress = Callable[[int, int, int], None]


def run_campaign(
    campaign: str | Path | dict[str, Any],
    out: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    keep_logs: bool = False,
    stop_when: str | None = None,
    show: Callable[[str], None] = lambda _: None,
    progress: Progress = lambda ended, failed, of: None,
    overwrite: bool = False,
    base: Scenario | None = None,
    native: bool | str | None = None,
) -> pandas.DataFrame:
    """Run a scenario many times, and give one row for each run.

    Runs that have finished in the same folder before are not run again.

    Args:
        campaign: path of a campaign file, or its content.
        out: result folder; default ``results/<name of the file>`` in the working directory.
        workers: processes on this computer; None is one for each core, 0 runs in this process.
        scheduler: address of a Dask scheduler whose workers run, in place of processes here.
        keep_logs: whether to keep the log of each run, in ``logs/<first 16 digits of its hash>``.
        stop_when: end as soon as a difference is known: ``"axis metric width"``, see
            :class:`cosim.campaign.comparison.StopRule`.
        show: receives notes, a line each.
        progress: receives how many runs have ended, how many of them failed, and how many there are.
        overwrite: whether runs may vanish from the table of the folder, those of another campaign.
        base: the scenario, in place of the one that the campaign names.
        native: whether to compile, in place of what the scenario says, see :func:`cosim.simulate`.

    Returns:
        The table: axes, metrics, ``status``, ``message``, ``wall_s`` [s], ``hash``. It is in
        ``runs.parquet`` of the folder, too, and what ran in ``campaign.json``.

    Raises:
        InputError: the campaign cannot be run; nothing has run.
        SimulationError: the workers were lost, or the disk is full; what has finished is kept.
        KeyboardInterrupt: what has finished is kept.
    """
    demand_packages()
    check_workers(workers)
    check_address(scheduler)
    loaded = LoadedCampaign(campaign, base)
    if native is not None:
        loaded.base = with_settings(loaded.base, [("native", native)], Path.cwd())
    folder = Path(os.path.abspath(result_folder(campaign, out)))
    if not isinstance(campaign, dict) and Path(campaign).resolve() == (folder / SUMMARY).resolve():
        raise InputError(f"the results would overwrite '{campaign}'; give another --out")
    sweep()
    files = Files()
    try:
        scenarios = CaseScenarios(loaded, files, Measured(keep_logs))
        every = cases(loaded.campaign)
        rule = None if stop_when is None else StopRule(stop_when, every, loaded.campaign.seed)
        for note in scenarios.check(every):
            show(f"note: {note}")
        for compiled in {files.fmus[name].is_native for name in files.identities}:
            show(f"note: {kind_of(compiled)}")
        # Workers would wait for each other, deaf to interrupts.
        if note := prepare_library(loaded.base.native):
            show(f"note: {note}")
        taken = f"another campaign runs in '{folder}'"
        with locked_folder(folder, LOCK, taken), closing(Journal(folder)) as journal:
            if journal.unread:
                show(
                    f"note: {journal.unread} lines of '{JOURNAL}' do not describe a run: those "
                    "runs are repeated"
                )
            work = _Work(scenarios, journal, rule.ordered if rule else every, rule, folder)
            work.recall(overwrite)
            stated = {
                "campaign": loaded.campaign.model_dump(mode="json", exclude_unset=True),
                "scenario": loaded.base.model_dump(mode="json", by_alias=True, exclude_unset=True),
                "fmus": files.origins,
                "place": scheduler or ("this process" if workers == 0 else "processes on this computer"),
                "versions": _versions(),
            }
            return work.run(partial(place_for, files, scheduler, workers), stated, progress)
    finally:
        files.close()


def demand_packages() -> None:
    """See that what a campaign needs beside the package is installed.

    Raises:
        InputError: it is not.
    """
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise InputError(f"a campaign needs {', '.join(missing)}: pip install 'cybership[campaign]'")


def result_folder(campaign: str | Path | dict[str, Any], out: str | Path | None) -> Path:
    """Where the results go if ``out`` does not say: ``results/<name of the file>``.

    Raises:
        InputError: ``out`` is empty.
    """
    if out is not None and not str(out).strip():
        raise InputError("out must be the name of a folder; got an empty text")
    name = "campaign" if isinstance(campaign, dict) else Path(campaign).stem.removesuffix(".campaign")
    return Path(out) if out is not None else Path("results") / name


@dataclass
class _Work:
    """The runs of one campaign that has been checked.

    Attributes:
        cases: in the order in which they are made.
        known: those that were asked for so far, with their hashes.
        waiting: how many of them wait for the run of a hash.
        ended, failed: how many of them have ended, and failed.
        earlier: hashes of the runs that the table had before.
        due: when the table is written next, of :func:`time.monotonic`.
    """

    scenarios: CaseScenarios
    journal: Journal
    cases: Sequence[Case]
    rule: StopRule | None
    folder: Path
    known: dict[int, tuple[Case, str]] = field(default_factory=dict)
    waiting: Counter[str] = field(default_factory=Counter)
    ended: int = 0
    failed: int = 0
    earlier: set[str] = field(default_factory=set)
    due: float = 0.0

    def recall(self, overwrite: bool) -> None:
        """Find the runs that the folder has.

        Args:
            overwrite: whether others may vanish from the table.

        Raises:
            InputError: they would.
        """
        self.earlier = hashes(self.folder)
        if not self.journal.rows and not self.earlier:
            return
        pairs = [(case, self.scenarios.job(case).hash) for case in self.cases]
        gone = self.earlier.difference(hash_ for _, hash_ in pairs)
        if gone and not overwrite:
            raise InputError(
                f"'{self.folder / TABLE}' has {len(self.earlier)} runs, and {len(gone)} of them "
                "are not in this campaign: they would be lost; give another --out, or --overwrite"
            )
        self.known |= {case.number: (case, h) for case, h in pairs if h in self.journal.rows}

    def run(
        self, place: Callable[[], RunPlace], stated: dict[str, Any], progress: Progress
    ) -> pandas.DataFrame:
        """Make the runs that are missing; journal, table and summary agree however that ends."""
        self.started, self.stated = time.time(), stated
        try:
            write_roomy_json(self.folder / SUMMARY, self.stated | self._state("running"))
            self._keep("running")
        except OSError as error:
            raise InputError(not_written(self.folder, error)) from None
        except KeyboardInterrupt:
            self._end("interrupted")
            raise
        STATE.write(CAMPAIGN, str(self.folder / SUMMARY))
        status, message = "failed", ""
        with ExitStack() as stack:
            try:
                jobs = self._missing()
                first = next(jobs, None)
                progress(self.ended, self.failed, len(self.cases))
                if first is not None:
                    there = stack.enter_context(closing(place()))
                    rows = stack.enter_context(closing(there.rows(chain([first], jobs))))
                    self._take(rows, progress)
                status = "done"
            except KeyboardInterrupt:
                status = "interrupted"
                raise
            except (InputError, SimulationError) as error:
                message = str(error)
                raise
            except OSError as error:
                message = not_written(self.folder, error)
                raise SimulationError(f"{message}; {self.ended} finished runs are kept") from None
            finally:  # before the place closes, which may take seconds
                made = self._end(status, message)
        return made

    def _end(self, status: str, message: str = "") -> pandas.DataFrame:
        with Held():
            made = self._keep(status, message)
            STATE.write(CAMPAIGN, "")
        return made

    def _take(self, rows: Iterator[tuple[Job, RunRow]], progress: Progress) -> None:
        for job, row in rows:
            if row.log:
                keep_log(self.folder, job.hash, row.log)
            with Held():  # what is on the disk is counted
                self.journal.add(job.hash, row)
                self._count(row, self.waiting.pop(job.hash, 0))
            if len(self.journal.rows) <= SMALL or time.monotonic() >= self.due:
                self._keep("running")
            progress(self.ended, self.failed, len(self.cases))
            if self._settled():
                break

    def _keep(self, status: str, message: str = "") -> pandas.DataFrame:
        """Bring the table to what the journal has, and the summary to both.

        Raises:
            OSError: the table cannot be written; then the journal is brought to what that has.
        """
        started = time.monotonic()
        made = table(self._counted(), self.journal.rows)
        try:
            write_table(self.folder, made)
            self.journal.agree()
        except OSError:
            self.journal.take_back()
            if status == "running":
                raise
        update_json(self.folder / SUMMARY, self.stated, self._state(status, message))
        self.due = (ended := time.monotonic()) + (ended - started) / WRITING
        return made

    def _state(self, status: str, message: str = "") -> dict[str, Any]:
        """What changes in campaign.json."""
        rows = [self.journal.rows[h].status for _, h in self._counted() if h in self.journal.rows]
        done = rows.count("done")
        return {
            "status": status,
            "message": message,
            "runs": len(self.cases),
            "done": done,
            "failed": len(rows) - done,
            "stopped": self.rule.verdict(self._row) if self.rule else None,
            "wall_s": time.time() - self.started,
        }

    def _missing(self) -> Iterator[Job]:
        """The runs that have not finished yet, each once."""
        for case in self.cases:
            if self._settled():
                return
            job = self.scenarios.job(case)
            self.known[case.number] = case, job.hash
            if (row := self.journal.finished(job.hash)) is not None:
                self._count(row, 1)
                continue
            self.waiting[job.hash] += 1
            if self.waiting[job.hash] == 1:
                yield job

    def _count(self, row: RunRow, runs: int) -> None:
        self.ended += runs
        self.failed += runs * (row.status != "done")

    def _row(self, number: int) -> RunRow | None:
        known = self.known.get(number)
        return None if known is None else self.journal.finished(known[1])

    def _settled(self) -> bool:
        return self.rule is not None and self.rule.satisfied(self._row)

    def _counted(self) -> list[tuple[Case, str]]:
        """The runs of the table: all, or those until the difference was known, and earlier ones."""
        numbers = self.rule.counted(self._row) if self.rule else None
        return [
            pair
            for n, pair in self.known.items()
            if numbers is None or n in numbers or pair[1] in self.earlier
        ]


@cache
def _versions() -> dict[str, str]:
    names = ("cybership", "fmpy", "numpy", "scipy", "pandas", "distributed")
    return {"python": platform.python_version()} | {n: importlib.metadata.version(n) for n in names}
