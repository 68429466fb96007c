"""The result in a few sentences: what is sure first, what is only possible below it."""

from collections.abc import Sequence

from .finding_text import listed
from .result_keys import EffectResult, SuspectResult

# Confidence from which on a finding is told as a fact; chosen: nobody may act on less as on one.
SURE = 0.8
NOTHING_FOUND = "Nothing is missing that these data show."
TOO_LITTLE = "What is missing is more than noise, but too little to matter."
UNEXPLAINED = "Something is missing, and no effect that is known here explains it."
VERDICTS = {
    "found": "Something is missing, and it was found",
    "ambiguous": "Something is missing, and more than one cause fits",
    "coefficients": "Coefficients are wrong, and nothing else is missing",
    "unexplained": "Something is missing, and nothing known here explains it",
    "none": "Nothing is missing that these data show",
}
UNSURE = "Something is missing, and what it is, is not sure"  # heading of findings of which none is


MOST_NAMED = 4  # of the coefficients; chosen


def _names(suspects: Sequence[SuspectResult]) -> str:
    names = [s.name for s in suspects]
    more = [f"{len(names) - MOST_NAMED} others"] if len(names) > MOST_NAMED else []
    *most, last = [*names[:MOST_NAMED], *more]
    return f"{', '.join(most)} and {last}" if most else last


def is_sure(e: EffectResult) -> bool:
    """Whether a finding is told as a fact; one of a method without confidence is not."""
    return (e.confidence or 0.0) >= SURE and not e.indistinguishable


def possibility(e: EffectResult) -> str:
    """A finding that is not sure, in a sentence."""
    others = f" or {listed(e.indistinguishable)}" if e.indistinguishable else ""
    sure = "" if e.confidence is None else f" ({100.0 * e.confidence:.0f} % for {e.id})"
    return f"Possibly {e.id}{others}{sure}: {e.sentence}"


def told(e: EffectResult) -> str:
    """A finding in a sentence, as a fact or as a possibility."""
    return e.sentence if is_sure(e) else possibility(e)


def verdict_title(verdict: str, effects: Sequence[EffectResult]) -> str:
    """A verdict as a heading, which claims no more than the findings do."""
    unsure = verdict == "found" and not any(is_sure(e) for e in effects)
    return UNSURE if unsure else VERDICTS[verdict]


def headline(
    verdict: str,
    effects: Sequence[EffectResult],
    suspects: Sequence[SuspectResult],
    something: bool,
) -> str:
    """The result in a few sentences.

    Args:
        verdict: that of the diagnosis.
        effects: that were found, in the order of acceptance.
        suspects: nominal coefficients that are wrong.
        something: whether more than noise is left.
    """
    if effects:
        return " ".join(told(e) for e in sorted(effects, key=lambda e: not is_sure(e)))
    if verdict == "coefficients":
        names = f", above all {_names(suspects)}" if suspects else ""
        return (
            f"Other values of the nominal coefficients explain these data{names}; no effect is missing."
        )
    if verdict == "unexplained":
        return UNEXPLAINED
    return TOO_LITTLE if something else NOTHING_FOUND
