"""The record of a validation: criteria, what the data say of them, and all that it was made with.

``validation.json`` has numbers in SI, but those of a criterion in its unit; one that is not finite, or
not known, is null. E is the mean of measured minus predicted, of position of the distance; estimate, low
and high are the share, or the RMS, with bounds at the criterion's confidence. Of standard uncertainties
the combined ones, u_input and u_val, hold what is known.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim import InputError

from ..execution.result_folder import together
from ..predictors import ship_name
from ..report.content import Content, fmu_result, part, sensor_results, versions
from ..runs import side_cars
from ..session import Comparison
from .budget import Budget, Learned, read_learned, sources_of
from .criterion import JUDGED, ReadCriteria, now, read_criteria
from .judged_criterion import Judgement, Predicted, judge
from .predictions import Predictions
from .record_files import FILES, entry, write_record
from .record_keys import FORM, REFERENCES, STANDING
from .validity import covered, window_means

# Attributes that the record holds; KEY=ATTRIBUTE where a key has another name.
JUDGEMENT = (
    "criterion=criterion.title requirement=criterion.text outcome reason runs unit=criterion.unit "
    "tolerance=criterion.tolerance windows=errors.size independent"
)
BUDGET = "u_D=measurement initial_state parameters process_noise u_input u_num=numerical u_val"
Files = Mapping[str, "Path | str | Sequence[Path | str] | None"]


@dataclass(frozen=True, eq=False)
class Validation:
    """What criteria say of a model, see :func:`validate`.

    Attributes:
        content: of ``validation.json``, but for the reports and the key.
        judgements: with the errors of all windows.
    """

    content: Content
    judgements: Sequence[Judgement]

    def write(self, folder: str | Path, sign: str | Path | None = None) -> list[str]:
        """Write the record and its report into a folder, all files or none.

        Args:
            folder: made if it is not there.
            sign: file of the private key (Ed25519, PEM) that signs the record; None: it is not signed.

        Returns:
            The names of the files.

        Raises:
            InputError: no such key, or nothing can be written.
        """
        with together(Path(folder), FILES) as new:
            return self.write_into(new, sign)

    def write_into(self, folder: Path, sign: str | Path | None) -> list[str]:
        """The same in a folder that is there, file by file."""
        return write_record(self.content, self.judgements, folder, sign)

    def __str__(self) -> str:
        return "\n".join(lines(self.content))


def lines(content: Content) -> Iterator[str]:
    """The outcome, a line for each criterion."""
    for j in content.judgements:
        yield f"{j.criterion}: {j.outcome}. {j.requirement}: {j.reason}."


def validate(
    comparison: Comparison,
    criteria: str | Path | ReadCriteria,
    learned: str | Path | None = None,
    files: Files | None = None,
    command: str | None = None,
) -> Validation:
    """Judge by criteria that were written down before how well a model agrees with measured runs.

    Args:
        comparison: of the model with the runs, from :func:`diagnosis.compare`.
        criteria: the file that holds them.
        learned: result folder of ``diagnosis.learn`` that made the model, which says how uncertain its
            parameters are and what acts unrecorded.
        files: further files that the result depends on, by what they are for, such as ``model``.
        command: that the record tells; None: that of this program.

    Raises:
        InputError: the criteria or the folder cannot be used.
    """
    read = criteria if isinstance(criteria, ReadCriteria) else read_criteria(criteria)
    known = None if learned is None else read_learned(learned)
    predicted: dict[float, list[Predicted]] = {}
    notes: list[str] = []
    for c in read.content.criteria:
        if c.horizon not in predicted:
            predicted[c.horizon] = list(_predicted(comparison, c.horizon, known, notes))
    given = [e.name for e in comparison.evaluations]
    judgements = [judge(c, given, predicted[c.horizon]) for c in read.content.criteria]
    every = {**(files or {}), "learned": () if known is None else known.files}
    fmu = fmu_result(comparison)
    content = {
        "form": FORM,
        "standing": STANDING,
        "references": [*REFERENCES],
        "made": now(),
        "command": command or " ".join(sys.argv),
        "versions": versions(),
        "model": fmu.name if fmu else str((files or {}).get("model") or "nominal model"),
        "ship": ship_name(comparison.evaluations[0].model.ship),
        "fmu": fmu,
        "files": [*_data(comparison), *_files(every)],
        "criteria": part(read, "path sha256 modified read purpose=content.purpose"),
        "judgements": [_result(j) for j in judgements],
        "validity": covered(comparison.evaluations),
        "sensors": [s for e in comparison.evaluations for s in sensor_results(e)],
        "notes": [*dict.fromkeys(notes)],
        "not_covered": [*_not_covered(comparison, judgements)],
        "reports": [],
        "public_key": None,
    }
    return Validation(Content.of(content), judgements)


def _predicted(
    comparison: Comparison, horizon: float, learned: Learned | None, notes: list[str]
) -> Iterator[Predicted]:
    """The runs in windows of a length; of others, and of sources that are not known, a note."""
    for e in comparison.evaluations:
        try:
            p = Predictions(e, horizon)
        except InputError as error:
            notes.append(str(error))
            continue
        found = sources_of(p, learned)
        notes += [f"{source.replace('_', ' ')}: {why}" for source, why in found.notes.items()]
        yield Predicted(e.name, p, found, window_means(p))


def _data(comparison: Comparison) -> Iterator[dict[str, str]]:
    for e in comparison.evaluations:
        if (path := e.weak_windows.run.file) is not None:
            yield entry("data", path)
            for beside in side_cars(path) if path.is_file() else ():
                yield entry("layout of data", beside)


def _files(files: Files) -> Iterator[dict[str, str]]:
    for role, paths in files.items():
        several = [] if paths is None else [paths] if isinstance(paths, (str, Path)) else paths
        for path in several:
            yield entry(role, Path(path))


def _result(j: Judgement) -> dict[str, Any]:
    c, f = j.criterion, j.criterion.factor
    some, whole = j.errors.size > 0, 1.0 if c.statistic != "rms" else f
    estimate, low, high = (None, None, None) if j.interval is None else (x / whole for x in j.interval)
    return part(j, JUDGEMENT) | {
        "E": float(np.mean(j.errors)) / f if some else None,
        "rms": float(np.sqrt(np.mean(j.errors**2))) / f if some else None,
        "largest": float(np.max(np.abs(j.errors))) / f if some else None,
        "estimate": estimate,
        "low": low,
        "high": high,
        "budget": None if j.budget is None else _budget(j.budget, f),
    }


def _budget(b: Budget, factor: float) -> dict[str, Any]:
    scaled = {name: None if u is None else u / factor for name, u in part(b, BUDGET).items()}
    return scaled | {"unknown": b.unknown}


def _not_covered(comparison: Comparison, judgements: Sequence[Judgement]) -> Iterator[str]:
    """What nobody may conclude from the record."""
    yield "Speeds, drift angles, yaw rates and commands outside the validity range."
    horizons = sorted({j.criterion.horizon for j in judgements})
    yield f"Predictions over other times than {', '.join(f'{h:g}' for h in horizons)} s."
    judged = {j.criterion.quantity for j in judgements if j.outcome != "cannot be judged"}
    rest = [q for q in JUDGED if q not in judged]
    if rest:
        yield f"Errors of {', '.join(rest)}: no criterion on them is judged."
    for j in judgements:
        unknown = [] if j.budget is None else j.budget.unknown
        if unknown:
            yield f"{j.criterion.title}: u_val is without {', '.join(unknown)}, which are not known."
    predictor = comparison.predictor
    if predictor.whole:
        yield f"Predictions from a measured state: the velocity of {predictor.name} cannot be set."
    yield "Systematic errors of sensors that no other channel shows."
    trial = any(e.weak_windows.run.trial for e in comparison.evaluations)
    which = ", which comparison.json has, and no criterion" if trial else ": no run is one"
    yield f"Measures of manoeuvring trials{which}."
