"""The scenario of each run of a campaign: made of the base, checked before anything runs, and hashed."""

import json
from typing import Any

from ..dispatch.job import Job, Task, job_of
from ..dispatch.travelling_files import Files
from ..errors import InputError
from ..scenario.load import with_settings
from ..scenario.schema import Scenario
from ..system.preparation import prepare
from .campaign_file import LoadedCampaign
from .design import Case

# Values of an axis that are all tried before anything runs; chosen: of longer axes, which hold seeds or
# drawn numbers, the smallest and largest tell whether all are allowed.
ALL_TRIED = 20


class CaseScenarios:
    """The scenarios of a campaign.

    Args:
        loaded: the campaign and its base.
        files: collects the FMUs and tables that the scenarios name.
        task: makes each run.
    """

    def __init__(self, loaded: LoadedCampaign, files: Files, task: Task) -> None:
        self._loaded = loaded
        self._files = files
        self._task = task

    def scenario(self, case: Case) -> Scenario:
        """The scenario of a run.

        Raises:
            InputError: a value that its place cannot have.
        """
        settings = [(path, case.values[name]) for name, path in self._loaded.outer_first]
        try:
            return with_settings(self._loaded.base, settings, self._loaded.folder, stated(case))
        except InputError as error:
            raise InputError(
                str(error).replace(f"{stated(case)}: ", "") + f" (in the run {stated(case)})"
            ) from None

    def job(self, case: Case) -> Job:
        """What travels to a worker.

        Raises:
            InputError: as :meth:`scenario`; or a file that cannot be read.
        """
        return job_of(self.scenario(case), self._files, self._task)

    def check(self, cases: list[Case]) -> list[str]:
        """Refuse a campaign one of whose runs cannot be run; nothing has run then.

        Every value of every axis is tried against the FMUs, beside each choice of FMUs; of an axis of
        many numbers those at its ends.

        Args:
            cases: all runs.

        Returns:
            Oddities that are no reason to refuse, each once.

        Raises:
            InputError: the first error, with the run that has it.
        """
        notes: dict[str, None] = dict.fromkeys(self._loaded.base.notes)
        tried = [(case, self.scenario(case)) for case in _representatives(cases)]
        notes |= dict.fromkeys(self._files.read([scenario for _, scenario in tried]))
        for case, scenario in tried:
            try:
                notes |= dict.fromkeys(prepare(scenario, models=self._files.models(scenario)).warnings)
            except InputError as error:
                raise InputError(f"{error} (in the run {stated(case)})") from None
        axes = self._loaded.campaign.axes
        if not self._loaded.base.faults and any("seed" in axis.paths for axis in axes.values()):
            notes["the scenario has no faults, so the seed has no effect"] = None
        return [*notes]


def stated(case: Case) -> str:
    """A run by the values of its axes, for messages."""
    return ", ".join(f"{name} = {value}" for name, value in case.shown.items())


def _representatives(cases: list[Case]) -> list[Case]:
    """Runs among which each value of each axis occurs, beside each combination of what is no number."""
    wanted = {name: _tried([case.values[name] for case in cases]) for name in cases[0].values}
    seen: set[tuple[str, str, str]] = set()
    found: list[Case] = []
    for case in cases:
        words = {n: v for n, v in case.values.items() if not _is_number(v)}
        beside = json.dumps(words, sort_keys=True)
        pairs = {(name, json.dumps(value)) for name, value in case.values.items()}
        new = {(beside, *pair) for pair in pairs if pair[1] in wanted[pair[0]]} | {(beside, "", "")}
        if not new <= seen:
            seen |= new
            found.append(case)
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _tried(values: list[Any]) -> set[str]:
    """The values of one axis that are tried, as JSON."""
    different = {json.dumps(value): value for value in values}
    if len(different) <= ALL_TRIED:
        return set(different)
    whole = [v for v in different.values() if isinstance(v, int) and not isinstance(v, bool)]
    broken = [v for v in different.values() if isinstance(v, float)]
    ends = {json.dumps(end(part)) for part in (whole, broken) if part for end in (min, max)}
    return ends | {text for text, value in different.items() if not _is_number(value)}
