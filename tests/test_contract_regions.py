"""Regions of a covariate in which an error is larger: sums, Welch's test, and which region is chosen."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ttest_ind

from diagnosis.assessment import regions
from diagnosis.assessment.covariates import HEADING, NORTH, SPEED, CovariateValues
from diagnosis.assessment.regions import (
    ClusterMean,
    _Design,
    _exceeds_noise,
    cluster_mean,
    find_regions,
    numbered,
    welch_p_value,
)
from diagnosis.assessment.settings import SETTINGS
from diagnosis.runs.run_constants import BLOCK
from fmus.scale import REFERENCE

CLUSTERS, EACH = 40, 4  # clusters of windows, and windows of each


def error(size, seed=0):
    """Squares of an error (K,) that lasts for a cluster, of a size by cluster."""
    rng = np.random.default_rng(seed)
    return np.repeat(np.asarray(size) * np.exp(0.3 * rng.standard_normal(CLUSTERS)), EACH) ** 2


CLUSTER = np.repeat(np.arange(CLUSTERS), EACH)
NOISE = np.full(CLUSTERS * EACH, 1e-4)
VALUES = (
    np.repeat((np.arange(CLUSTERS) * 7) % CLUSTERS, EACH) / CLUSTERS
)  # of the covariate, mixed in time


def design(squares, covariate=SPEED, values=VALUES, several=False, run=None, noise=NOISE):
    rows = np.arange(values.size)
    by = SimpleNamespace(covariate=covariate, rows=rows, values=values, run=run)
    by.edges = covariate.bin_edges(values, BLOCK)
    return _Design.of("X", by, squares, noise, CLUSTER, several)


def where(low, high, far=3.0):
    """An error that is larger at some values of the covariate."""
    inside = (VALUES[::EACH] >= low) & (VALUES[::EACH] < high)
    return error(np.where(inside, far, 1.0)), inside


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.integers(2, 12), st.integers(2, 12))
def test_the_test_is_that_of_welch(seed, m, n):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(0.3, 1.0, m), rng.normal(0.0, 2.0, n)
    wanted = ttest_ind(a, b, equal_var=False, alternative="greater").pvalue
    found = welch_p_value(*(cluster_mean(x, np.ones(x.size)) for x in (a, b)))
    assert found == pytest.approx(wanted, rel=1e-9)


def test_without_freedom_or_variance_nothing_is_significant():
    sure, zero = ClusterMean(5.0, 0.1, 3), ClusterMean(0.0, 0.0, 3)
    assert welch_p_value(sure, zero) < 0.01
    assert welch_p_value(sure._replace(dof=0), zero) == welch_p_value(sure, zero._replace(dof=0)) == 1.0
    assert welch_p_value(sure._replace(variance=0.0), zero) == 1.0


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_a_mean_over_clusters_has_the_variance_of_its_formula(seed):
    rng = np.random.default_rng(seed)
    count = rng.integers(0, 5, 12)
    count[:2] = 1, 3
    total = count * rng.normal(size=12)
    parts = [(t, c) for t, c in zip(total, count, strict=True) if c]
    n, G = sum(c for _, c in parts), len(parts)
    mean = sum(t for t, _ in parts) / n
    variance = G / (G - 1) * sum((t - c * mean) ** 2 for t, c in parts) / n**2
    found = cluster_mean(total, count)
    assert found == (pytest.approx(mean), pytest.approx(variance), G - 1)
    assert cluster_mean(np.array([6.0, 0.0]), np.array([3, 0])) == (2.0, 0.0, 0)
    assert cluster_mean(np.zeros(2), np.zeros(2))[:2] == (0.0, 0.0)


def test_clusters_of_each_run_have_numbers_of_their_own():
    assert numbered([np.array([0, 0, 2]), np.array([0, 2, 2])]).tolist() == [0, 0, 1, 2, 3, 3]


def test_a_profile_has_the_rms_of_each_bin():
    squares, _ = where(0.5, 0.75)
    noise = NOISE * (1.0 + VALUES)
    profile = design(squares, noise=noise).profile
    assert profile.edges.size == 9
    parts = [
        (a <= VALUES) & (b > VALUES) for a, b in zip(profile.edges, profile.edges[1:], strict=False)
    ]
    parts[-1] |= profile.edges[-1] == VALUES
    assert profile.rms == pytest.approx([np.sqrt(squares[p].mean()) for p in parts])
    assert profile.uncertainty == pytest.approx([np.sqrt(noise[p].mean()) for p in parts])
    assert profile.share == pytest.approx([p.mean() for p in parts])
    assert profile.run is None
    assert design(squares, several=True, run="a").profile.run == "a"
    assert design(squares, several=False, run="a").profile.run is None


def test_a_bin_without_windows_has_no_rms():
    values = np.where(VALUES < 0.5, -3.0, 3.0)  # on two headings
    profile = design(error(np.ones(CLUSTERS)), HEADING, values).profile
    assert np.isfinite(profile.rms).tolist() == [True, *[False] * 6, True]
    assert profile.share.tolist() == [0.5, *[0.0] * 6, 0.5]


def test_rows_of_some_windows_alone_are_counted():
    rows = np.arange(0, VALUES.size, 2)
    by = SimpleNamespace(covariate=SPEED, rows=rows, values=VALUES[rows], run="b")
    by.edges = SPEED.bin_edges(by.values, BLOCK)
    squares, _ = where(0.5, 0.75)
    d = _Design.of("X", by, squares, NOISE, CLUSTER, True)
    assert d.count.sum() == rows.size
    assert d.total.sum() == pytest.approx(squares[rows].sum())
    assert d.total.sum(axis=0) == pytest.approx(
        [squares[rows][CLUSTER[rows] == k].sum() for k in range(CLUSTERS)]
    )


@pytest.mark.parametrize(
    ("covariate", "low", "high"),
    [(SPEED, 0.625, 1.0), (SPEED, 0.0, 0.25), (NORTH, 0.25, 0.5), (NORTH, 0.75, 1.0)],
)
def test_the_region_is_that_in_which_the_error_is_larger(covariate, low, high):
    squares, inside = where(low, high)
    region = design(squares, covariate).clearest_region()
    inside = np.repeat(inside, EACH)
    assert region.low == (None if low == 0.0 else pytest.approx(low, abs=0.03))
    assert region.high == (None if high == 1.0 else pytest.approx(high, abs=0.03))
    assert region.share == pytest.approx(inside.mean())
    assert region.rms == pytest.approx(np.sqrt(squares[inside].mean()))
    assert region.elsewhere == pytest.approx(np.sqrt(squares[~inside].mean()))
    assert (region.axis, region.covariate) == ("X", covariate)


def test_its_p_value_is_welch_s_times_the_regions_that_were_tried():
    squares, inside = where(0.5, 1.0, far=1.8)
    d = design(squares)
    region = d.clearest_region()
    logs = np.log(squares[::EACH] + NOISE[0])
    tried = len([*d.intervals()])
    assert tried == 14
    wanted = ttest_ind(logs[inside], logs[~inside], equal_var=False, alternative="greater").pvalue
    # Each cluster is in one bin, and has as many windows as any other.
    assert region.p_value == pytest.approx(tried * wanted)
    spread = (logs[inside].mean() - logs[~inside].mean()) ** 2
    assert region.contrast == pytest.approx(0.25 * spread)


def test_an_error_that_is_the_same_everywhere_has_none():
    assert design(error(np.ones(CLUSTERS))).clearest_region() is None
    assert design(np.full(CLUSTERS * EACH, 2.0)).clearest_region() is None


def test_a_region_is_at_most_three_fifths_and_clearly_worse():
    """1.4 times the RMS elsewhere at least; the errors here hardly vary, so that all are sure."""
    rng = np.random.default_rng(0)
    inside = VALUES[::EACH] >= 0.5

    def region_of(far, inside=inside):
        size = np.where(inside, far, 1.0) * np.exp(1e-3 * rng.standard_normal(CLUSTERS))
        return design(np.repeat(size, EACH) ** 2).clearest_region()

    assert region_of(1.42) is not None
    assert region_of(1.38) is None
    most = region_of(3.0, VALUES[::EACH] >= 0.25)
    assert most is None or most.share <= SETTINGS.largest_region


def test_a_region_needs_four_clusters_inside():
    """Of three it would be found by chance."""
    for clusters, found in ((4, True), (3, False)):
        inside = np.arange(CLUSTERS) >= CLUSTERS - clusters
        values = np.repeat(inside * 1.0, EACH) + np.linspace(0.0, 1e-6, CLUSTERS * EACH)
        size = np.where(inside, 3.0, 1.0) * np.exp(1e-3 * np.sin(np.arange(CLUSTERS)))
        by = SimpleNamespace(covariate=SPEED, rows=np.arange(values.size), values=values, run=None)
        by.edges = np.array([0.0, 0.5, 1.1])
        d = _Design.of("X", by, np.repeat(size, EACH) ** 2, NOISE, CLUSTER, False)
        assert (d.clearest_region() is not None) == found


def test_on_headings_a_region_may_pass_south():
    psi = 2.0 * np.pi * (VALUES + 0.5 / CLUSTERS) - np.pi
    inside = np.abs(psi[::EACH]) > 0.75 * np.pi
    region = design(error(np.where(inside, 3.0, 1.0)), HEADING, psi).clearest_region()
    assert (region.low, region.high) == (pytest.approx(0.75 * np.pi), pytest.approx(-0.75 * np.pi))
    assert region.share == 0.25
    whole = np.abs(psi[::EACH] - 0.75 * np.pi) < 0.25 * np.pi  # up to its end at pi
    region = design(error(np.where(whole, 3.0, 1.0)), HEADING, psi).clearest_region()
    assert (region.low, region.high) == (pytest.approx(0.5 * np.pi), pytest.approx(np.pi))


def test_an_error_is_more_than_noise_by_the_clusters_mean():
    """By 1.3 times the standard deviation, and by two standard errors of the mean over clusters."""
    noise = np.ones(CLUSTERS * EACH)
    even = 1.0 + 0.01 * np.sin(np.arange(CLUSTERS * EACH))
    assert _exceeds_noise(1.35**2 * even, noise, CLUSTER)
    assert not _exceeds_noise(1.28**2 * even, noise, CLUSTER)
    jump = np.zeros(CLUSTERS)
    jump[:3] = 60.0  # a mean of 4.5, with a standard error of 2.5
    assert not _exceeds_noise(np.repeat(jump, EACH), noise, CLUSTER)
    jump[:6] = 60.0
    assert _exceeds_noise(np.repeat(jump, EACH), noise, CLUSTER)


def found(monkeypatch, *squares, std=0.01):
    """Regions of errors (K,) of each axis in two halves of a run, over one covariate."""
    by = CovariateValues(SPEED, np.arange(VALUES.size), VALUES, REFERENCE)
    monkeypatch.setattr(regions, "covariates_by_axis", lambda _: [[by]] * 3)
    data = [SimpleNamespace(block=2 * CLUSTER), SimpleNamespace(block=np.zeros(0, int))]
    omega = np.sqrt(np.column_stack(squares))
    none = np.zeros((0, 3))
    return find_regions(data, [omega, none], [np.full_like(omega, std), none])


def test_each_axis_has_a_sentence_on_what_is_known(monkeypatch):
    larger, _ = where(0.625, 1.0)
    even = error(np.ones(CLUSTERS))
    result = found(monkeypatch, larger, even, 0.5 * NOISE)
    assert [r.axis for r in result.regions] == ["X"]
    assert result.sentences[0] == result.regions[0].sentence
    rms = np.sqrt(even.mean())
    assert result.sentences[1] == (
        f"Sway: {rms:.2g} N (uncertainty 0.01), no region is significantly worse than the others."
    )
    assert result.sentences[2] == (
        "Yaw: no model error detected, 0.0071 N m (uncertainty 0.01) is within the noise."
    )
    assert [p.axis for p in result.profiles] == ["X", "Y", "N"]
    rare = np.zeros(CLUSTERS * EACH)
    rare[:EACH] = 1.0
    result = found(monkeypatch, rare, rare, rare)
    assert result.regions == []
    assert all(s.endswith("(uncertainty 0.01), too rare to locate.") for s in result.sentences)


def test_two_blocks_are_a_cluster(monkeypatch):
    seen = []
    of = _Design.of
    monkeypatch.setattr(_Design, "of", lambda *args: seen.append(args) or of(*args))
    found(monkeypatch, *[error(np.ones(CLUSTERS))] * 3)
    for args in seen:
        assert args[4].tolist() == CLUSTER.tolist()
        assert args[5] is True
