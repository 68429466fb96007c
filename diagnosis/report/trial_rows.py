"""Measures of manoeuvring trials as page and terminal show them, angles in degrees."""

from collections.abc import Iterator, Sequence
from math import degrees
from typing import Any, NamedTuple

from cosim.trials import DEGREES, MEASURES

from .result_keys import Number, RunErrors

UNITS = {m.name.removesuffix("_1"): m.unit for m in MEASURES}


class TrialRow(NamedTuple):
    """A measure of a run that is a trial: measured, and as the models predict it."""

    run: str
    held_out: bool
    measure: str
    unit: str
    measured: Number
    before: Number
    after: Number


def trial_rows(errors: Sequence[RunErrors]) -> Iterator[TrialRow]:
    """One row for each measure of each trial."""
    for e in errors:
        trial: dict[str, list[Any]] = dict(e.trial or {})
        for name, found in trial.items():
            unit, several = UNITS[name], isinstance(found[0], list)
            factor = degrees(1.0) if unit in DEGREES else 1.0
            for k, triple in enumerate(found if several else [found], 1):
                shown = [None if x is None else factor * x for x in triple]
                label = f"{name}_{k}" if several else name
                yield TrialRow(e.run, e.held_out, label, DEGREES.get(unit, unit), *shown)
