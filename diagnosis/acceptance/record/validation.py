"""The record of a validation: criteria, what the data say of them, and all that it was made with.

``validation.json`` has numbers in SI, but those of a criterion in its unit; one that is not finite, or
not known, is null. E = S - D is the mean of predicted minus measured, of position the mean distance,
with the mean by axes of the ship in E_axes; estimate, low and high are the share, or the RMS, with
bounds at the criterion's confidence. Of standard uncertainties the combined ones, u_input and u_val,
hold what is known. Times are those of the computer's clock, with their offset from UTC.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cosim import InputError

from ...execution.result_folder import together
from ...execution.short_text import ShortRepr
from ...predictors.evaluation import Evaluation
from ...report.content import Content, fmu_result, part, sensor_results, versions
from ...runs import Fingerprint
from ...runs.run_constants import IN_A_ROW
from ...session import Comparison
from ..budget import Learned, read_learned, sources_of
from ..criterion import JUDGED, InputStd, ReadCriteria, now, read_criteria
from ..judged_criterion import EXPANDED, Judgement, Predicted, judge
from ..predictions import Predictions, possible
from ..validity import covered, window_means
from . import FILES
from .provenance import Files, code, files_of, foreign, parameters_of, parameters_sha256, samples
from .record_figures import figures
from .record_files import write_record
from .verification import FORM

STANDING = (
    "This record uses terms of ASME V&V 20, ITTC 7.5-02-06-03 and DNV-RP-0513. It does not claim "
    "conformity with them."
)
REFERENCES = (
    "ASME V&V 20-2009: Standard for Verification and Validation in Computational Fluid Dynamics "
    "and Heat Transfer (comparison error E, u_num, u_input, u_D, u_val).",
    "ITTC Recommended Procedures 7.5-02-06-03: Validation of Manoeuvring Simulation Models "
    "(documentation of a model and of its validation data).",
    "DNV-RP-0513: Assurance of simulation models (criteria before the comparison, intended use, "
    "traceable records).",
    "JCGM 100:2008 (GUM): Guide to the expression of uncertainty in measurement (standard and expanded "
    "uncertainty).",
)
# Attributes that the record holds; KEY=ATTRIBUTE where a key has another name.
JUDGEMENT = (
    "criterion=criterion.title requirement=criterion.text restrictions=criterion.restrictions outcome "
    "reason flags runs=counts.runs left_out=counts.left_out unit=criterion.unit "
    "tolerance=criterion.tolerance offered=counts.offered excluded=counts.excluded "
    "windows=counts.judged"
)
# Keys of the numbers of windows, null where none counts.
NUMBERS = (
    *("independent", "E", "E_axes", "k", "k_u_val", "rms", "largest"),
    *("estimate", "low", "high", "budget"),
)
BUDGET = (
    "u_D=measurement initial_state parameters process_noise current wind u_input u_num=numerical u_val"
)


@dataclass(frozen=True, eq=False, repr=False)
class Validation(ShortRepr):
    """Judgements of a model by criteria, see :func:`validate`.

    Attributes:
        content: of ``validation.json``, but for the reports and the key.
        judgements: with the errors of all windows.
        evaluations: of the runs, for the figures of tracks; without them there are none.
    """

    content: Content
    judgements: Sequence[Judgement]
    evaluations: Sequence[Evaluation] = ()

    @property
    def met(self) -> bool:
        """Whether all criteria are met."""
        return all(judgement.outcome == "met" for judgement in self.judgements)

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
        plots = [*figures(self.judgements, self.evaluations)]
        return write_record(self.content, plots, folder, sign)

    def __str__(self) -> str:
        return "\n".join(lines(self.content))


def lines(content: Content) -> Iterator[str]:
    """The outcome, a line for each criterion, and one for each of its flags."""
    for j in content.judgements:
        counts = (
            f"{j.windows} of {j.offered} windows of {len(j.runs)} of {len(content.samples)} runs count"
        )
        yield f"{j.criterion}: {j.outcome}. {j.requirement}: {j.reason}; {counts}."
        yield from (f"  note: {flag}" for flag in j.flags)


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
        command: that the record names; None: that of this program.

    Raises:
        InputError: the criteria or the folder cannot be used.
    """
    read = criteria if isinstance(criteria, ReadCriteria) else read_criteria(criteria)
    known = None if learned is None else read_learned(learned)
    every = {**(files or {}), "learned": () if known is None else known.files}
    hashed = files_of(comparison, every)  # before any work: a file that has changed since
    notes: list[str] = []
    if known is not None and not known.is_of(
        comparison.evaluations[0].learned or comparison.predictor.model
    ):
        known = known._replace(posterior=None)
        notes.append(
            f"'{learned}' belongs to a model with other values; its posterior does not apply here"
        )
    runs = _JudgedRuns(comparison, known, read.content.input_std, notes)
    horizons = dict.fromkeys(c.horizon for c in read.content.criteria)
    predicted = {horizon: [*runs.predicted(horizon)] for horizon in horizons}
    given = [e.name for e in comparison.evaluations]
    judgements = [
        judge(c, given, predicted[c.horizon], runs.short.get(c.horizon)) for c in read.content.criteria
    ]
    judgements = [
        j._replace(flags=[*j.flags, *_of_code(comparison)]) if j.outcome == "met" else j
        for j in judgements
    ]
    fmu = fmu_result(comparison)
    evaluations = {e.name: e for e in comparison.evaluations}
    content = {
        "form": FORM,
        "standing": STANDING,
        "references": [*REFERENCES],
        "made": now(),
        "command": command or " ".join(sys.argv),
        "versions": versions(),
        "code": code(),
        "particulars": read.content.particulars.lines,
        "confinement": _confinement(comparison),
        "model": _model_name(comparison),
        "ship": comparison.evaluations[0].model.ship.name,
        "fmu": fmu,
        "files": hashed,
        "samples": samples(comparison.evaluations),
        "hashes": parameters_sha256(comparison),
        "learned_from": [{"name": f.name, "sha256": f.sha256} for f in runs.learned_from],
        "same_runs": [sorted(pair) for pair in runs.same],
        "criteria": part(read, "path sha256 modified read purpose=content.purpose")
        | {"content": read.content.model_dump(mode="json")},
        "judgements": [_result(j) for j in judgements],
        "validity": [
            {"criterion": j.criterion.title} | row
            for j in judgements
            for row in covered([(p.predictions, rows) for p, rows in j.windows], evaluations)
        ],
        "sensors": [s for e in comparison.evaluations for s in sensor_results(e)],
        "notes": [*dict.fromkeys(notes)],
        "not_covered": [*_not_covered(comparison, judgements)],
        "reports": [],
        "public_key": None,
    }
    return Validation(Content.of(content), judgements, comparison.evaluations)


class _JudgedRuns:
    """The compared runs as criteria judge them.

    Attributes:
        learned_from: runs of which the model was learned, as far as it is known.
        same: pairs of names of runs that are the same, or nearly.
        short: horizon -> name of a run without a window of that length -> windows that it might have.
    """

    def __init__(
        self, comparison: Comparison, learned: Learned | None, acting: InputStd, notes: list[str]
    ) -> None:
        self._evaluations = comparison.evaluations
        self._learned, self._acting, self._notes = learned, acting, notes
        self.short: dict[float, dict[str, int]] = {}
        prints = {e.name: Fingerprint.of(e.smoothed) for e in comparison.evaluations}
        stated = [*comparison.predictor.model.learned_from, *(learned.learned_from if learned else ())]
        stated += [
            prints[e.name] for e in comparison.evaluations if e.learned is not None and not e.held_out
        ]
        self.learned_from = [*{f.sha256: f for f in stated}.values()]
        rows = {e.name: _rows(e.weak_windows.run.pose) for e in comparison.evaluations}
        self.same = [
            {a, b} for a, b in combinations(prints, 2) if rows[a] & rows[b] or prints[a].alike(prints[b])
        ]
        self._seen = {n for n, f in prints.items() if any(f.alike(g) for g in self.learned_from)}

    def predicted(self, horizon: float) -> Iterator[Predicted]:
        """The runs in windows of a length; of others, and of sources that are not known, a note."""
        short = self.short.setdefault(horizon, {})
        for e in self._evaluations:
            try:
                p = Predictions(e, horizon)
            except InputError as error:
                short[e.name] = possible(e.smoothed, horizon)
                self._notes.append(str(error))
                continue
            found = sources_of(p, self._learned, self._acting)
            unknown = ((name, why) for name, why in found.items() if isinstance(why, str))
            self._notes += [f"{name.replace('_', ' ')}: {why}" for name, why in unknown]
            same = frozenset(name for pair in self.same if e.name in pair for name in pair)
            yield Predicted(e.name, p, found, window_means(p), same, e.name in self._seen)


def _rows(pose: np.ndarray) -> set[bytes]:
    """Each stretch of so many poses (n, 3) that all differ: what two cuts of a log have in common."""
    moving = np.append(False, (np.diff(pose, axis=0) != 0.0).any(axis=1) & np.isfinite(pose[1:, 0]))
    known = sliding_window_view(moving, IN_A_ROW).all(axis=1)
    return {pose[k : k + IN_A_ROW].tobytes() for k in np.flatnonzero(known)}


def _model_name(comparison: Comparison) -> str:
    """The model's file, or what it is without one."""
    predictor = comparison.predictor
    if foreign(predictor):
        return f"{type(predictor).__name__}, a class of the user"
    if files := getattr(predictor, "files", None):
        return str(files[0][1])
    if not predictor.parametric:
        return f"{predictor.name}, which is not a file"
    return (
        "nominal model" if not any(parameters_of(predictor.model)) else "parameters that are not a file"
    )


def _confinement(comparison: Comparison) -> str:
    """What keeps the model's code from the data."""
    predictor = comparison.predictor
    own = any(e.model.ship.effects.files for e in comparison.evaluations)
    if predictor.parametric and not own and not foreign(predictor):
        return "none needed: the model is parameters of this program"
    found = getattr(predictor, "confinement", "") or "unconfined"
    return f"unconfined: effects of the user ({found})" if own else found


def _of_code(comparison: Comparison) -> Iterator[str]:
    """What a reader must know of the model's code where a criterion is met, a sentence each."""
    if (found := _confinement(comparison)).startswith("unconfined"):
        yield f"The model's code may have read the measurement: it ran {found}."
    description = comparison.predictor.description()
    if outside := () if description is None else description.outside:
        named = ", ".join(outside[:3]) + (", ..." if outside[3:] else "")
        yield f"The model opened, or tried to open, files outside of its own: {named}."


def _result(j: Judgement) -> dict[str, Any]:
    c, f, e = j.criterion, j.criterion.factor, j.found
    if e is None:
        return part(j, JUDGEMENT) | dict.fromkeys(NUMBERS) | {"independent": 0.0, "k": EXPANDED}
    numbers = (
        e.independent,
        float(np.mean(e.errors)) / f,
        (e.offset / f).tolist() if c.quantity == "position" else None,
        EXPANDED,
        EXPANDED * e.budget.u_val / f,
        float(np.sqrt(np.mean(e.errors**2))) / f,
        float(np.max(np.abs(e.errors))) / f,
        *(x / (f if c.statistic == "rms" else 1.0) for x in e.interval),
        {name: None if u is None else u / f for name, u in part(e.budget, BUDGET).items()}
        | {"unknown": e.budget.unknown},
    )
    return part(j, JUDGEMENT) | dict(zip(NUMBERS, numbers, strict=True))


def _not_covered(comparison: Comparison, judgements: Sequence[Judgement]) -> Iterator[str]:
    """What nobody may conclude from the record."""
    yield (
        "Speeds, drift angles, yaw rates and commands outside the validity range of the judged windows."
    )
    horizons = sorted({j.criterion.horizon for j in judgements})
    yield f"Predictions over other times than {', '.join(f'{h:g}' for h in horizons)} s."
    judged = {j.criterion.quantity for j in judgements if j.outcome != "cannot be judged"}
    rest = [q for q in JUDGED if q not in judged]
    if rest:
        yield f"Errors of {', '.join(rest)}: no criterion on them is judged."
    for j in judgements:
        unknown = [] if j.found is None else j.found.budget.unknown
        if unknown:
            yield (
                f"{j.criterion.title}: u_val does not include {', '.join(unknown)}, which are not known."
            )
    predictor = comparison.predictor
    if predictor.whole:
        yield f"Predictions from a measured state: the velocity of {predictor.name} cannot be set."
    yield "Systematic errors of sensors that no redundant channel shows."
    trial = any(e.weak_windows.run.trial for e in comparison.evaluations)
    which = (
        ", which comparison.json has, but no criterion"
        if trial
        else ": there is no trial among the runs"
    )
    yield f"Measures of manoeuvring trials{which}."
