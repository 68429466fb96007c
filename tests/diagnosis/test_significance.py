"""Comparisons of losses: what counts as one sample."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.search.significance import Losses, as_good, fits_predict_worse, predicts_worse


def folds(ratios, windows=40, seed=0):
    """Losses of folds, and those of fits that miss by these ratios in all windows of a fold."""
    rng = np.random.default_rng(seed)
    its, others = [], []
    for ratio in ratios:
        one = Losses(np.ones(1), *rng.uniform(0.9, 1.1, (2, windows)))
        others.append(one)
        its.append(one._replace(position=ratio * one.position, heading=ratio * one.heading))
    return its, others


def joined(parts):
    return Losses(*map(np.concatenate, zip(*parts, strict=True)))


@pytest.mark.parametrize(
    ("factors", "good"),
    [
        ((1.0, 1.0, 1.0), True),
        ((1.0, 0.9, 1.0), True),
        ((1.0, 0.99, 1.02), False),  # both predictions together, by the least
        ((1.0, 0.9, 1.02), True),
        ((1.2, 0.9, 0.9), False),  # the fit is worse, beyond chance
    ],
)
def test_a_model_as_good_predicts_as_well_and_does_no_harm(factors, good):
    (one, *_), _ = folds([1.0])
    one = one._replace(omega=1.0 + 0.1 * np.random.default_rng(2).random(40))
    assert as_good(Losses(*(f * x for f, x in zip(factors, one, strict=True))), one) == good


def test_windows_that_one_fit_predicts_are_one_sample():
    """A single fold that goes wrong shows nothing of the way to fit, however many windows it has."""
    its, others = folds([3.0, 0.9, 0.9])
    assert predicts_worse(joined(its), joined(others))
    assert not fits_predict_worse(its, others)


def test_a_way_to_fit_is_worse_if_the_folds_agree():
    assert fits_predict_worse(*folds([1.5, 1.6, 1.4]))
    assert not fits_predict_worse(*folds([0.5, 0.6, 0.4]))
    assert not fits_predict_worse(*folds([1.5])), "of one fold nothing is known"


@given(st.lists(st.floats(0.2, 5.0), min_size=2, max_size=8))
def test_of_two_ways_at_most_one_is_worse(ratios):
    its, others = folds(ratios)
    assert not (fits_predict_worse(its, others) and fits_predict_worse(others, its))


def test_by_chance_one_in_forty_is_worse():
    rng = np.random.default_rng(1)
    worse = [fits_predict_worse(*folds(np.exp(rng.normal(0.0, 0.3, 4)), 5)) for _ in range(2000)]
    assert 0.01 < np.mean(worse) < 0.04


def test_a_model_that_runs_away_is_worse():
    its, others = folds([1.0, 1.0, 1.0])
    its[1].position[3] = np.inf
    assert fits_predict_worse(its, others)
    assert not fits_predict_worse(others, its)


def test_folds_without_windows_do_not_count():
    nothing = Losses(np.ones(3), np.zeros(0), np.zeros(0))
    its, others = folds([1.5, 1.6, 1.4])
    assert fits_predict_worse([*its, nothing], [*others, nothing])
