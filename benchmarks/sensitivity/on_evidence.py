"""What changes with the constants of the verdict, on saved evidence of findings: no diagnosis is run.

The evidence is that of a table of :mod:`benchmarks.hidden_effects`. It is made into confidence and a
verdict by the functions of the diagnosis.
"""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest.mock import patch

from diagnosis.runs.run_constants import LEVEL
from diagnosis.search.effect_evidence import EffectEvidence
from diagnosis.verdict import confidence

from ..hidden_effects.results import BETWEEN
from .changed_constant import DOUBLE, HALF, scaled

NAMES = ("SURE", "PER_DOUBT", "FOUND", "EVEN_ODDS")


def read(path: Path) -> list[EffectEvidence]:
    """The evidence of all findings of a table."""
    with path.open(encoding="utf-8", newline="") as file:
        texts = [text for row in csv.DictReader(file) for text in row["evidence"].split(BETWEEN)]
    # Earlier tables lack what the logistic map does not need.
    numbers = [[*map(float, text.split()), 0.0, 0.0][:5] for text in texts if text]
    return [EffectEvidence(*each) for each in numbers]


def outcome(e: EffectEvidence) -> str:
    """What is said of a finding; a set that cannot be distinguished has all of its weight."""
    own = confidence.probability(e)
    of_set = own if e.bagged >= LEVEL else confidence.probability(e._replace(bagged=1.0))
    if not confidence.Confidence(own, of_set).is_finding:
        return "possibility"
    return "found" if own >= confidence.FOUND else "ambiguous"


def changes(found: Sequence[EffectEvidence]) -> Iterator[tuple[str, int, int]]:
    """Name of each constant, and of how many findings another thing is said at half and at double."""
    usual = [outcome(e) for e in found]
    for name in NAMES:
        counts = []
        for factor in (HALF, DOUBLE):
            with patch.object(confidence, name, scaled(getattr(confidence, name), factor)):
                counts.append(sum(outcome(e) != was for e, was in zip(found, usual, strict=True)))
        yield name, counts[0], counts[1]
