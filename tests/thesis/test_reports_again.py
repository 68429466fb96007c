"""Reports beside the studies are what today's code makes of the results beside them."""

import shutil

import pytest
from support.project import ROOT

from cosim import InputError
from studies.study_report import stored
from thesis import (
    allocation,
    chapter5,
    chapter6,
    improved,
    lost_thrust,
    observer_gains,
    realtime,
    store_weight,
    stored_samples,
)

STUDIES = ROOT / "docs" / "studies"
LEARNED = STUDIES / "chapter6_learned" / "model.ssv"
AGAIN = {
    "allocation": lambda out: allocation.study(out, (), allocation.Push(), (), again=True),
    "chapter5": lambda out: chapter5.study(out, (), None, None, again=True),
    "chapter6": lambda out: chapter6.study(out, (), 1.0, None, again=True),
    "chapter6_learned": lambda out: chapter6.study(out, (), 1.0, None, LEARNED, again=True),
    "improved": lambda out: improved.study(out, (), 0.0, None, again=True),
    "lost_thrust": lambda out: lost_thrust.study(out, again=True),
    "realtime": lambda out: realtime.study(out, 20.0, realtime.FACTORS, (), again=True),
    "observer_gains": lambda out: observer_gains.study(out, (), 120.0, None, again=True),
    "stored_samples": lambda out: stored_samples.study(out, (), 198.0, None, again=True),
    "store_weight": lambda out: store_weight.study(out, (), None, None, again=True),
}


@pytest.mark.parametrize("name", AGAIN)
def test_report_is_what_todays_code_makes_of_its_results(name, tmp_path):
    """Tables, verdicts, sentences and captions; a changed rule or a changed number shows here."""
    shutil.copy(STUDIES / name / "results.json", tmp_path)
    AGAIN[name](tmp_path)
    for file in ("report.md", "results.json"):
        stated = f"python -m thesis.… --again --out docs/studies/{name}"
        assert (tmp_path / file).read_text("utf-8") == (STUDIES / name / file).read_text("utf-8"), stated


def test_report_without_results_is_not_written_anew(tmp_path):
    with pytest.raises(InputError, match=r"results\.json.*run the study first"):
        improved.study(tmp_path / "none", (), 0.0, None, again=True)
    (tmp_path / "results.json").write_text("{")
    with pytest.raises(InputError, match="cannot read"):
        stored(tmp_path)
