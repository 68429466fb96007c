"""The result in a few sentences: what is sure first, what is only possible below it."""

from collections.abc import Sequence

from ..verdict.confidence import FOUND
from .finding_text import listed
from .result_keys import DiagnosisContent, EffectResult, PossibilityResult, SuspectResult

NOTHING_FOUND = "Nothing is missing that these data show."
TOO_LITTLE = "What is missing is more than noise, but too little to matter."
UNEXPLAINED = "Something is missing, and no effect that is known here explains it."
NOT_BELIEVED = (
    "Something is missing, and no effect that is known here is likely enough to be told as its cause."
)
CALIBRATED = (
    " The learned model is calibrated: with all coefficients fitted together, each within what is "
    "believed of it, runs left out are predicted better. It tells no cause."
)
VERDICTS = {
    "found": "Something is missing, and it was found",
    "ambiguous": "Something is missing, and more than one cause fits",
    "coefficients": "Coefficients are wrong, and nothing else is missing",
    "unexplained": "Something is missing, and nothing known here explains it",
    "none": "Nothing is missing that these data show",
}
# Headings where one cause fits and is not sure, and where effects are possible and none is believed.
UNSURE = "Something is missing, and what it is, is not sure"

MOST_NAMED = 4  # of the coefficients; chosen


def _names(suspects: Sequence[SuspectResult]) -> str:
    names = [f"{s.name} ({s.description})" if s.description else s.name for s in suspects]
    more = [f"{len(names) - MOST_NAMED} others"] if len(names) > MOST_NAMED else []
    *most, last = [*names[:MOST_NAMED], *more]
    return f"{', '.join(most)} and {last}" if most else last


def is_sure(e: EffectResult) -> bool:
    """Whether a finding is told as a fact; one of a method without confidence is not."""
    return (e.confidence or 0.0) >= FOUND


def told(e: EffectResult) -> str:
    """A finding in a sentence: a fact, or a possibility with its rivals and its probability."""
    if is_sure(e):
        return e.sentence
    others = f" or {listed(e.indistinguishable)}" if e.indistinguishable else ""
    sure = "" if e.confidence is None else f" ({100.0 * e.confidence:.2g} % for {e.id})"
    doubt = f" But {e.doubt}." if e.doubt else ""
    left_out = isinstance(e, PossibilityResult) and not e.in_model
    model = " The learned model does not have it." if left_out else ""
    return f"Possibly {e.id}{others}{sure}: {e.sentence}{doubt}{model}"


def verdict_title(r: DiagnosisContent) -> str:
    """The verdict as a heading, which claims no more than the findings do."""
    one_cause = r.verdict == "ambiguous" and not r.effects[0].indistinguishable
    possible = r.verdict == "unexplained" and r.possibilities
    return UNSURE if one_cause or possible else VERDICTS[r.verdict]


def headline(
    verdict: str,
    effects: Sequence[EffectResult],
    possibilities: Sequence[EffectResult],
    suspects: Sequence[SuspectResult],
    something: bool,
    calibrated: bool,
) -> str:
    """The result in a few sentences.

    Args:
        verdict: that of the diagnosis.
        effects: that were found, in the order of acceptance.
        possibilities: that were accepted and are not believed.
        suspects: nominal coefficients that are wrong.
        something: whether more than noise is left.
        calibrated: whether the learned model is a calibrated one.
    """
    if effects:
        return " ".join(told(e) for e in sorted(effects, key=lambda e: not is_sure(e)))
    if verdict == "coefficients":
        names = f", above all {_names(suspects)}" if suspects else ""
        return (
            f"Other values of the nominal coefficients explain these data{names}; no effect is missing."
        )
    if verdict == "unexplained":
        return (NOT_BELIEVED if possibilities else UNEXPLAINED) + CALIBRATED * calibrated
    return TOO_LITTLE if something else NOTHING_FOUND
