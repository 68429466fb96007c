"""The result in a few sentences: what is sure first, what is only possible below it."""

from collections.abc import Iterator, Sequence

import numpy as np

from fmus.effects.force import CHANGES

from ..assessment.stability import Stability
from ..execution.short_text import SHOWN
from ..predictors.uncertainty import NOISE_TOLERANCE
from ..predictors.windows import WindowErrors
from ..runs.run_constants import FAR_OFF, NEGLIGIBLE
from ..search.significance import lower_throughout
from ..session import CalibratedModel, Diagnosis
from ..verdict.confidence import FOUND
from ..verdict.prediction_gain import PredictionGain
from .finding_text import listed
from .formatting import number, percent
from .report_data import SHOWN_ERRORS, ReportData
from .reported_effect import ReportedEffect, further_fitted_values, is_fitted

SEARCH_GAINED = "The search for effects improves the predictions over calibration alone."
SEARCH_GAINED_NOTHING = "The search for effects gained nothing over calibration alone."
SEARCH_NAMES_CAUSE = "Calibration alone predicts as well; the search shows a likely cause."
OTHER_FIT = (
    "It found no effect to add. It fits the same coefficients to accelerations first and to predictions "
    "over several times then, so that its numbers differ from those of the calibration."
)
OTHER_CALIBRATION = (
    "It found no effect to add. Its model is another calibration, with further parameters that are "
    "usually small, so that its numbers differ."
)
NO_CALIBRATION = (
    "The comparison is with the initial model, because calibration does not improve the predictions."
)
OWN_VALUES = (
    "Values that hold in one run alone are of that run where it is left out as a whole. Other runs are "
    "predicted with the mean of these values, reduced by its uncertainty, and without times of failures."
)
CALIBRATION_GAINED = "Calibration improves the predictions of the initial model."
CALIBRATION_GAINED_NOTHING = (
    "Calibration does not improve the predictions of the initial model by more than chance."
)
MEASURED_COMMANDS = (
    "The commands are read as measured values of the actuators, of which the mean over a row acts, and "
    "not as orders, because the initial and the calibrated model then predict better. State "
    '"measured": true or false for each command in the side-car to decide it.'
)
NOTHING_FOUND = "These data show no missing effect."
TOO_LITTLE = "The residual exceeds the noise, but it is too small to be relevant."
UNEXPLAINED = "A model error remains that no known effect explains."
NOT_BELIEVED = "The model has an error that no known effect explains with sufficient confidence."
BEYOND = (
    " In the learned model coefficients are beyond {far:g} standard deviations of their priors: {names}."
)
DRIVEN_ON = (
    "In {motions} the hull of the learned model gains energy, which no hull does: it predicts motions "
    "like those of these runs, and is wrong for others."
)
CALIBRATED = (
    " The learned model is calibrated: all coefficients are fitted together within their priors, "
    "and predict data left out of the fit no worse, beyond chance. This does not identify a cause."
)
NOT_IN_MODEL = "It is not in the learned model, which predicts as well without it."
OTHER_RUN = "something acts in it that the others do not show, or it is another manoeuvre"
MAY_BE_CHANCE = "; of so few windows this may be chance"
LESS_BEYOND = "what was learned does not hold in it"
BESIDE = " In addition it fits, without claiming a cause: {}"
PRODUCTS = "small coefficients of further products of speeds"
FAR_COEFFICIENTS = (
    "Other values of the nominal coefficients explain these data, but beyond {far:g} standard "
    "deviations of their priors: {names}. Either these priors are wrong, or an effect acts like a "
    "change of them."
)
VERDICTS = {
    "found": "An effect is missing and was identified",
    "ambiguous": "An effect is missing, and several candidates explain it",
    "coefficients": "Coefficients differ from their nominal values; no effect is needed",
    "unexplained": "The model has an error that no known effect explains",
    "none": "These data show no missing effect",
}
# Headings where one cause fits and is not sure, and where effects are possible and none is believed.
UNSURE = "An effect is missing; which one is uncertain"


def is_sure(e: ReportedEffect) -> bool:
    """Whether a finding is reported as a fact; one of a method without confidence is not."""
    return e.confidence >= FOUND


def surest_first(effects: Sequence[ReportedEffect]) -> list[ReportedEffect]:
    """Effects that are sure, then the others."""
    return sorted(effects, key=lambda e: not is_sure(e))


def finding_sentence(e: ReportedEffect) -> str:
    """A finding in a sentence: a fact, or a possibility with its rivals and its probability."""
    if is_sure(e):
        return e.sentence
    others = f" or {listed(e.indistinguishable)}" if e.indistinguishable else ""
    whose = f" for {e.id}" if e.indistinguishable else ""
    sure = f" ({percent(e.confidence)}{whose})" if np.isfinite(e.confidence) else ""
    doubt = f" However, {e.doubt}." if e.doubt else ""
    if not e.in_model:
        doubt += f" {NOT_IN_MODEL}"
    elif 0.0 <= max(e.share_of_error, e.share_unique or 0.0) < NEGLIGIBLE:
        doubt += f" It explains {percent(e.share_of_error)} of the squared error."
    return f"Possibly {e.id}{others}{sure}: {e.sentence}{doubt}"


def cause(r: ReportData) -> str:
    """The effects that were found, by name and description, for a line of a picture; empty if none."""
    if r.diagnosis is None:
        return ""
    known = r.diagnosis.start.ship.effects
    what = {e.id: known[e.id].description.removeprefix(f"addition to {e.id}: ") for e in r.effects}
    sure = [f"{e.id}, {what[e.id].rstrip('.')}" for e in r.effects if is_sure(e)]
    return f"cause found: {'; '.join(sure)}" if sure else ""


def gain_sentences(gain: PredictionGain | None, gained: str, nothing: str, over: float) -> list[str]:
    """What a model gains in windows of so many seconds, in words and numbers; empty: not known."""
    if gain is None:
        return []
    parts, worse = [], []
    for name, unit, factor in SHOWN_ERRORS:
        change = getattr(gain, name)
        errors = " → ".join(number(x, 3, factor) for x in (change.before, change.after))
        way = "falls" if change.difference >= 0.0 else "rises"
        by, std = (number(abs(x), 2, factor**2) for x in (change.difference, change.standard_error))
        parts.append(f"{name} {errors} {unit} (the mean square {way} by {by} ± {std} {unit}²)")
        worse += [f"the {name}"] if change.is_worse else []
    where = f"Predictions over {number(over)} s in {gain.windows} windows of {gain.where}"
    of = "However, predictions of" if gain.gained else "Predictions of"
    but = [f"{of} {' and '.join(worse)} are worse."] if worse else []
    return [gained if gain.gained else nothing, *but, f"{where}: {', '.join(parts)}."]


def gain_of_search(r: ReportData) -> list[str]:
    """What the search for effects gained over calibration alone; empty where that is not known."""
    d = r.diagnosis
    gain = None if d is None else d.gain
    nothing = SEARCH_NAMES_CAUSE if any(map(is_sure, r.effects)) else SEARCH_GAINED_NOTHING
    said = gain_sentences(gain, SEARCH_GAINED, nothing, r.lengths[0])
    if d and gain and d.refitted and not d.learned.effects and gain.position.difference:
        said.insert(1, OTHER_CALIBRATION if d.calibrated else OTHER_FIT)
    if d and gain and any(f.of_runs for f in d.learned.effects):
        said.append(OWN_VALUES)
    return [*said, NO_CALIBRATION] if gain is not None and gain.over == "initial" else said


def gain_of_calibration(calibrated: CalibratedModel, r: ReportData) -> list[str]:
    """What calibration gained over the initial model; empty where that is not known."""
    return gain_sentences(calibrated.gain, CALIBRATION_GAINED, CALIBRATION_GAINED_NOTHING, r.lengths[0])


def contradicted_by_tests(r: ReportData) -> Iterator[str]:
    """What test runs say against the learned model, a sentence each; they decide nothing.

    A run may be predicted worse than by the initial or by the calibrated model: beyond chance, or by
    more than NOISE_TOLERANCE. Or it is predicted so much worse than all others that the difference is no
    chance: by more than three times. What acts in it alone would make these models worse as well.
    """
    others = [e.after for e in r.evaluations if not e.held_out]
    for e in r.evaluations:
        its = e.after.errors
        if not e.held_out or its is None:
            continue
        is_worse = False
        for other, of in (("the initial model", e.before.errors), ("calibration alone", e.calibrated)):
            if not r.learned or of is None:
                continue
            worse = larger_errors(its, of)
            if not worse and (perhaps := larger_errors(its, of, NOISE_TOLERANCE, surely=False)):
                worse = perhaps + MAY_BE_CHANCE
            if worse:
                is_worse = True
                yield f"The learned model predicts the test run {e.name} worse than {other}: {worse}."
        far = []
        for name, unit, factor in SHOWN_ERRORS:
            after = getattr(e.after, name)
            most = max((getattr(of, name) for of in others if of.errors is not None), default=np.inf)
            if after > FAR_OFF * most:
                far.append(f"{name} {number(after, 2, factor)} against {number(most, 2, factor)} {unit}")
        if far:
            by, why = ", ".join(far), LESS_BEYOND if is_worse else OTHER_RUN
            yield f"The test run {e.name} is predicted worse than all other runs ({by}): {why}."


def worse_than_constant_velocities(r: ReportData) -> Iterator[str]:
    """Runs that constant velocities predict better than the model, beyond noise, a sentence each."""
    for e in r.evaluations:
        steady, own = e.constant_velocities, e.after.errors
        if steady is None or own is None:
            continue
        if worse := larger_errors(own, steady, NOISE_TOLERANCE):
            yield (
                f"The {'learned ' if r.learned else ''}model predicts {r.called(e)} worse than constant "
                f"velocities do: {worse}. If that is unexpected, check the ship, and the units, "
                "signs, columns and clocks of the file."
            )


def larger_errors(
    its: WindowErrors, others: WindowErrors, least: float = 1.0, surely: bool = True
) -> str:
    """What is larger than of another prediction: position, heading, both, or nothing.

    Args:
        its, others: errors in the same windows.
        least: ratio that the errors of both have at the least.
        surely: whether only what is larger beyond chance counts.
    """
    larger = []
    for k, (name, unit, factor) in enumerate(SHOWN_ERRORS):
        other, own = (float(of.over_all()[k]) for of in (others, its))
        squares = (np.square(getattr(of, name)) for of in (others, its))
        if own > least * other and (not surely or lower_throughout(*squares)):
            larger.append(f"{name} {number(other, 2, factor)} → {number(own, 2, factor)} {unit}")
    return " and ".join(larger)


def reading_of_commands(found: CalibratedModel | Diagnosis) -> list[str]:
    """How commands are read, where that is not as the files state; else empty."""
    return [MEASURED_COMMANDS] if found.measured else []


def first_sentences(r: ReportData) -> str:
    """The headline, after the sentence that the search gained nothing where that is so.

    A hull that gains energy, which none does, follows it.
    """
    gain, d = gain_of_search(r), r.diagnosis
    driven = d.stability.driven_on if d and r.comparison.predictor.parametric else ()
    warning = [DRIVEN_ON.format(motions=listed(driven, "and"))] if driven else []
    nothing = gain[:1] if d and d.gain and not d.gain.gained else []
    return " ".join([*nothing, headline(r), *warning])


def verdict_title(r: ReportData) -> str:
    """The verdict as a heading, which claims no more than the findings do; empty for a comparison."""
    if r.diagnosis is None:
        return ""
    verdict = r.diagnosis.verdict
    one_cause = verdict == "ambiguous" and not r.effects[0].indistinguishable
    possible = verdict == "unexplained" and r.possibilities
    return UNSURE if one_cause or possible else VERDICTS[verdict]


def page_title(r: ReportData, day: str) -> str:
    """Ship or model, runs, date and verdict, as the title of a page."""
    predictor = r.comparison.predictor
    of = predictor.model.ship.description.title if predictor.parametric else predictor.name
    names = [e.name for e in r.evaluations]
    runs = f"{len(names)} runs" if len(names) > SHOWN else listed(names, "and")
    return f"{of}, {runs}, {day}: {verdict_title(r) or 'comparison of model and measurements'}"


def headline(r: ReportData) -> str:
    """The result of a diagnosis in a few sentences; empty for a comparison."""
    d = r.diagnosis
    if d is None:
        return ""
    names = [f"{name} ({text})" if text else name for name, text in r.suspects.items()]
    if r.effects:
        said = [finding_sentence(e) for e in surest_first(r.effects)]
        if names and not any(map(is_sure, r.effects)):
            said.append(f"Coefficients that are probably wrong as well: {listed(names, 'and')}.")
        return " ".join(said)
    if d.verdict == "coefficients":
        differ = "differs" if len(names) == 1 else "differ"
        off = f" {listed(names, 'and')} {differ} from the description beyond chance." if names else ""
        others = further_values(d)
        beside = f" together with {listed(others, 'and')}" if others else ""
        needed = "no other effect is needed" if others else "no effect is needed"
        return f"Other values of the nominal coefficients explain these data{beside}; {needed}.{off}"
    if d.verdict == "unexplained":
        remains = d.remainder.significant and not r.possibilities
        moved = d.learned.moved if d.refitted or r.possibilities else {}
        far = [f"{name} by {number(z, 2)}" for name, z in moved.items() if abs(z) > FAR_OFF]
        beside = further_fitted_values(d) if d.calibrated else []
        further = BESIDE.format(" ".join(beside)) if beside else ""
        if far and d.refitted and not d.remainder.significant:
            return FAR_COEFFICIENTS.format(far=FAR_OFF, names=listed(far, "and")) + further
        beyond = BEYOND.format(far=FAR_OFF, names=listed(far, "and")) if far else ""
        known = (UNEXPLAINED if remains else NOT_BELIEVED) + CALIBRATED * d.calibrated
        return known + further + beyond
    return TOO_LITTLE if d.remainder.beyond_chance else NOTHING_FOUND


def further_values(d: Diagnosis) -> list[str]:
    """What the learned model has beside the coefficients of the ship; products of speeds as one."""
    known = d.start.ship.coefficients
    others = [name for name in d.posterior.std if name not in known and is_fitted(d, name)]
    products = {name for e in CHANGES for name in e.coefficients}.intersection(others)
    return [*([PRODUCTS] if products else []), *(name for name in others if name not in products)]


def boundedness(s: Stability) -> str:
    """Whether the learned model stays bounded in a simulation."""
    model = f"the learned model {'stays' if s.bounded else 'does NOT stay'} bounded"
    return (
        f"In closed loop {model} on the reference paths" if s.closed_loop else f"Without thrust {model}"
    )
