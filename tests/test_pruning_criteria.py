"""Criteria of pruning: what they have in common, what an information criterion charges, one of a user."""

import re

import numpy as np
import pytest
from support.project import ROOT

from cosim import InputError
from diagnosis.search.significance import Losses
from diagnosis.verdict.pruning_criteria import CRITERIA, criterion

BLOCKS = 40


def losses(size=1.0, seed=0):
    """Losses of so many times the usual size."""
    draws = np.random.default_rng(seed).exponential(1.0, (3, BLOCKS))
    return Losses(*(size * draws))


@pytest.fixture
def own(tmp_path):
    """The criterion that docs/evidence.md shows, as a file."""
    page = (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```python\n(\"\"\"Rejects.*?)```", page, re.DOTALL)
    (tmp_path / "own.py").write_text(text)
    return str(tmp_path / "own.py")


@pytest.mark.parametrize("name", CRITERIA)
def test_a_model_does_itself_no_harm(name):
    assert not criterion(name)(losses(), losses(), 0)


@pytest.mark.parametrize("name", [*CRITERIA, "own"])
def test_a_model_that_is_much_worse_does_harm_and_one_that_is_much_better_does_not(name, own):
    harm = criterion(own if name == "own" else name)
    assert "{where}" in harm(losses(2.0), losses(), 1)
    assert not harm(losses(0.5), losses(), 1)


@pytest.mark.parametrize(("more", "harms"), [(1, False), (2, True)])
def test_information_criterion_charges_the_logarithm_of_the_number_of_blocks_for_each_parameter(
    more, harms
):
    others = losses()
    its = others._replace(omega=others.omega - 1.5 * np.log(BLOCKS) / BLOCKS)
    assert bool(criterion("bic")(its, others, more)) == harms
    assert not criterion("paired")(its, others, more)


def test_mistakes_are_one_line(tmp_path):
    (tmp_path / "none.py").write_text("x = 1")
    (tmp_path / "two.py").write_text("def harm(its, others):\n    return ''")
    for name, line in (
        (str(tmp_path / "two.py"), r"has no function harm\(its, others, more\)"),
        ("pared", "did you mean 'paired'"),
        (str(tmp_path / "none.py"), "has no function harm"),
        (str(tmp_path / "missing.py"), "no such Python file of a criterion of pruning"),
    ):
        with pytest.raises(InputError, match=line):
            criterion(name)
