"""When a thruster gave nothing, on problems that are made up: times and cells, the cost, and what is found."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csc_matrix

from diagnosis.predictors.weak_form import OVERLAP
from diagnosis.runs.cleaning import Z95
from diagnosis.search.nonlinear.interval_sums import IntervalSums
from diagnosis.search.nonlinear.segmentation import (
    RunCells,
    SegmentationProblem,
    around,
    intervals,
    likely,
    moved,
    programmed,
    programmed_in,
    segmented,
    shares_of_rows,
    sharpened,
)
from fmus.scale import REFERENCE

PAIRS = [("start_1", "end_1"), ("start_2", "end_2")]
A, B = RunCells("a", 2.0, 0, 240, PAIRS), RunCells("b", -1.0, 240, 600, PAIRS)
SPANS = [(60, 110), (150, 200), (300, 420)]
TIMES = {
    "start_1@a": 8.0,
    "end_1@a": 13.0,
    "start_2@a": 17.0,
    "end_2@a": 22.0,
    "start_1@b": 5.0,
    "end_1@b": 17.0,
}


def problem(noise=0.0, spans=SPANS, b=(0.0, 0.0), **changes):
    """Windows every third cell that see ten cells each; a force on two axes, two nuisance forces."""
    rng = np.random.default_rng(3)
    middles = np.arange(5.0, 597.0, 3.0)
    middles = middles[(middles < 235) | (middles > 245)]
    sees = np.maximum(1.0 - np.abs(np.arange(600) + 0.5 - middles[:, None]) / 5.0, 0.0) / 5.0
    force = np.stack(
        [0.0 * np.arange(600), 1.0 + 0.3 * np.sin(np.arange(600) / 9.0), np.full(600, -0.4)]
    )
    columns = (sees[:, None, :] * force).reshape(-1, 600)
    dead = np.zeros(600)
    for first, last in spans:
        dead[first:last] = 1.0
    Z = rng.standard_normal((columns.shape[0], 2))
    y = columns @ dead + Z @ np.array(b) + noise * rng.standard_normal(len(Z))
    work = np.concatenate([np.full(240, 1.0 / 240), np.full(360, 1.0 / 360)])
    made = SegmentationProblem([A, B], False, 0.1, y, csc_matrix(columns), middles, Z, np.diag([4.0, 1.0]), np.array([0.3, -0.2]), np.ones(2), work, REFERENCE)  # fmt: skip
    return replace(made, **changes)


def test_intervals_are_times_of_their_runs_and_back():
    p = problem()
    assert p.values(SPANS) == pytest.approx(TIMES)
    assert p.spans(TIMES) == SPANS
    assert p.keys(SPANS)[1] == ("start_2@a", "end_2@a")
    assert p.spans({"start_1@b": -9.0, "end_1@b": 99.0}) == [(240, 600)], "what lies outside is cut"
    assert p.spans({"start_1@a": 8.0}) == [(60, 240)]
    assert p.spans({"start_2@a": 8.04, "end_2@a": 9.06}) == [pytest.approx((60.4, 70.6))]
    assert [p.section(cell).run for cell in (0, 239, 240, 599)] == ["a", "a", "b", "b"]


def test_cost_of_whole_cells_is_that_of_parts_of_them():
    p = problem(noise=0.1)
    close = [(a + 1e-9, b - 1e-9) for a, b in SPANS]
    assert p.cost(close) == pytest.approx(p.cost(SPANS), rel=1e-6)
    assert p.dead([(60.25, 62.5)])[59:64].tolist() == [0.0, 0.75, 1.0, 0.5, 0.0]
    assert p.dead([(60.25, 60.5)])[60] == 0.25


@pytest.mark.parametrize("parts", [(0.3, 0.8), (0.05, 0.5)])
def test_change_points_are_found_between_cells(parts):
    spans = [(60 + parts[0], 110 + parts[1]), (300 - parts[1], 420 - parts[0])]
    p = problem()
    p = replace(
        p, y=p.columns @ p.dead(spans) + 1e-3 * np.random.default_rng(1).standard_normal(p.y.size)
    )
    found = segmented(p.weighted(np.full(3, 1e-3)))
    assert np.array(found) == pytest.approx(np.array(spans), abs=0.02)
    assert np.array(p.spans(p.values(found))) == pytest.approx(np.array(found), abs=1e-4)
    whole = [(round(a), round(b)) for a, b in spans]
    assert np.array(sharpened(p, whole)) == pytest.approx(np.array(spans), abs=0.1), "in any unit"


def test_a_row_longer_than_a_cell_counts_in_each_by_its_time():
    rows = shares_of_rows(np.array([0.5, 2.75, 3.0, 3.25]), 4).toarray()
    by_hand = [[0.5, 1, 0.75, 0], [0, 0, 0.25, 0], [0, 0, 0, 0.25], [0, 0, 0, 0.25]]
    lengths = np.array([2.25, 0.25, 0.25, 0.25])
    assert rows * lengths[:, None] == pytest.approx(np.array(by_hand))
    beyond = shares_of_rows(np.array([-1.5, 4.0]), 3).toarray()
    assert beyond.sum(axis=1) == pytest.approx(1.0), "what is outside counts at the ends"


def test_what_lasts_has_no_end_and_begins_after_the_start_of_time():
    sections = [s._replace(names=[("since", "")]) for s in (A, B)]
    p = problem(lasting=True, sections=sections)
    assert p.values([(60, 240), (250, 600)]) == pytest.approx({"since@a": 8.0, "since@b": 0.1})
    assert p.spans({"since@a": 8.0}) == [(60, 240)]
    assert p.seconds(sections[1], 260) == 1.0
    assert problem().seconds(B, 250) == 0.0


@pytest.mark.parametrize(
    ("spans", "passes", "endless"),
    [
        ([(0, 120)], True, False),
        ([(0, 121)], False, False),
        ([(0, 60), (100, 161)], False, False),  # together
        ([(0, 119), (240, 419)], True, False),  # each run by itself
        ([(0, 119), (240, 421)], False, False),
        ([(121, 240), (500, 600)], True, True),
        ([(121, 240), (500, 599)], True, False),
        ([(150, 170), (230, 240)], True, False),
    ],
)
def test_a_failure_that_passes_and_one_for_good(spans, passes, endless):
    p = problem()
    assert p.passing(spans) == passes
    assert p.without_end(spans) == endless
    assert replace(p, lasting=True).passing(spans)


def test_the_cost_is_that_of_direct_least_squares_and_log_n_for_each_change():
    p = problem(0.05, b=(0.2, -0.1))

    def direct(spans):
        """The nuisance parameters and the least sum of squares, with the prior as rows of its own."""
        root = np.sqrt(p.precision)
        X, z = np.vstack([p.nuisance, root]), np.concatenate([p.left(spans), -root @ p.offset])
        b, (least,), *_ = np.linalg.lstsq(X, z, rcond=None)
        return b, least

    rest = p.left([(60, 110)])
    assert rest == pytest.approx(p.y - np.asarray(p.columns.todense())[:, 60:110].sum(axis=1))
    assert p.fitted(rest) == pytest.approx(rest - p.nuisance @ direct([(60, 110)])[0], abs=1e-6)
    charge = np.log(p.y.size / OVERLAP)
    three = [(60, 63), (65, 110), (250, 251)]
    for spans, changes in (([(60, 110)], 2), ([(60, 240)], 1), (three, 6)):
        assert p.cost(spans) == pytest.approx(direct(spans)[1] + changes * charge, rel=1e-6)
    bare = replace(p, nuisance=np.zeros((p.y.size, 0)), precision=np.zeros((0, 0)), offset=np.zeros(0))
    assert bare.fitted(rest) is rest
    assert bare.cost([(60, 110)]) == pytest.approx(rest @ rest + 2.0 * charge)
    scaled = p.weighted(np.array([1.0, 2.0, 0.5]))
    assert scaled.y.reshape(-1, 3) * np.sqrt(OVERLAP) * [1.0, 2.0, 0.5] == pytest.approx(
        p.y.reshape(-1, 3)
    )
    assert scaled.left(SPANS)[1::3] == pytest.approx(p.left(SPANS)[1::3] / 2.0 / np.sqrt(OVERLAP))
    assert scaled.nuisance[2::3] == pytest.approx(p.nuisance[2::3] / 0.5 / np.sqrt(OVERLAP))


@pytest.mark.parametrize("size", [1.0, 1e3])
def test_intervals_are_found_beside_nuisance_forces_whatever_the_unit(size):
    p = problem(0.05, b=(0.2, -0.1))
    columns, offset = csc_matrix(size * p.columns), size * p.offset
    p = replace(p, y=size * p.y, columns=columns, offset=offset, precision=p.precision / size**2)
    for found in (intervals(p), segmented(p.weighted(np.full(3, 0.05 * size)))):
        assert len(found) == 3
        assert np.abs(np.subtract(found, SPANS)).max() <= 2
    assert intervals(problem(0.05, [])) == []


def test_ends_are_moved_to_the_least_cost_and_intervals_that_give_nothing_go():
    p = problem(0.01).weighted(np.full(3, 0.01))
    best = moved(p, SPANS)
    assert np.abs(np.subtract(best, SPANS)).max() <= 1
    for start in ([(50, 130), (145, 190), (310, 400)], [(60, 85), (90, 110), (150, 200), (300, 420)], [(10, 14), *SPANS]):  # fmt: skip
        assert moved(p, start) == best
    assert all(p.cost(trial) >= p.cost(best) for k in range(3) for trial in around(p, best, k, 1))


def test_an_interval_is_moved_within_its_run_and_between_its_neighbours():
    p = problem()
    spans = [(2, 8), (10, 20), (230, 239)]
    assert sorted(around(p, spans, 1, 5)) == sorted([
        [(2, 8), (15, 20), (230, 239)],
        [(2, 8), (10, 15), (230, 239)],
        [(2, 8), (10, 25), (230, 239)],
        [(2, 8), (230, 239)],
        [(2, 8), (10, 239)],
    ])  # fmt: skip
    assert [(0, 8), (10, 20), (230, 239)] in list(around(p, spans, 0, 2))
    assert [(2, 8), (8, 20), (230, 239)] in list(around(p, spans, 1, 2)), "up to the next"
    assert [(2, 8), (10, 20), (230, 240)] in list(around(p, spans, 2, 1)), "to the end of the run"
    assert all(b <= 240 for trial in around(p, spans, 2, 5) for _, b in trial)
    assert all(a >= 0 for trial in around(p, spans, 0, 5) for a, _ in trial)
    assert [(10, 300)] not in list(around(p, [(10, 20), (250, 300)], 0, 1)), (
        "no interval lies in two runs"
    )
    lasting = list(around(replace(p, lasting=True), [(100, 240)], 0, 5))
    assert lasting == [[(95, 240)], [(105, 240)], []]


def test_likely_ends_are_those_whose_cost_is_within_the_quantile():
    p = problem(0.2).weighted(np.full(3, 0.2))
    best = moved(p, SPANS)
    found = likely(p, best)
    assert found.keys() == TIMES.keys()
    for name, (low, high) in found.items():
        k, end = next(
            (k, e) for k, pair in enumerate(p.keys(best)) for e, n in enumerate(pair) if n == name
        )
        section = p.section(best[k][0])
        at = [round((t - section.first) / p.cell) + section.start for t in (low, high)]
        assert at[0] < best[k][end] < at[1]
        for place, within in ((at[0], False), (at[0] + 1, True), (at[1] - 1, True), (at[1], False)):
            trial = [list(s) for s in best]
            trial[k][end] = place
            assert (p.cost([tuple(s) for s in trial]) <= p.cost(best) + Z95**2) == within


@pytest.mark.parametrize(("most", "lasting"), [(1, False), (2, False), (1, True)])
def test_programming_finds_what_trying_all_finds(most, lasting):
    rng = np.random.default_rng(most)
    for _ in range(20):
        gain = rng.standard_normal(7) * 3.0
        every = [[]]
        for n in range(1, most + 1):
            for edges in combinations(range(8), 2 * n):
                spans = list(zip(edges[::2], edges[1::2], strict=True))
                if not lasting or spans[0][1] == 7:
                    every.append(spans)

        def worth(spans, gain=gain):
            changes = sum(1 + (b < 7) for _, b in spans)
            return sum(gain[a:b].sum() for a, b in spans) - 1.5 * changes

        assert worth(programmed(gain, 1.5, most, lasting)) == pytest.approx(max(map(worth, every)))


def test_what_windows_gain_is_programmed_in_the_bins_of_their_run():
    p = problem()
    gain = np.where((p.middles > 300) & (p.middles < 420), 50.0, -1.0)
    assert list(programmed_in(p, A, gain)) == []
    ((first, last),) = programmed_in(p, B, gain)
    assert abs(first - 300) <= 5
    assert abs(last - 420) <= 5
    ((_, last),) = programmed_in(p, B, np.where(p.middles > 400, 50.0, -1.0))
    assert last == 600


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_sums_over_intervals_are_those_of_their_cells(seed, width):
    """Of windows of any width, and of intervals that touch, are next to each other, or at an end."""
    rng = np.random.default_rng(seed)
    dense = np.zeros((45, 40))
    for row in dense:
        first = rng.integers(0, 40)
        row[first : first + width] = rng.normal(size=row[first : first + width].size)
    ends = np.sort(rng.choice(41, 6, replace=False))
    spans = [*zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True)]
    spans += [(b, c) for (_, b), (c, _) in pairwise(spans)][: rng.integers(0, 3)]
    further = rng.normal(size=(3, 40))
    dead = np.zeros(40)
    for a, b in spans:
        dead[a:b] = 1.0
    sums = IntervalSums(csc_matrix(dense), further)
    assert sums.square(spans) == pytest.approx(float(np.square(dense @ dead).sum()), abs=1e-9)
    assert sums.linear(spans) == pytest.approx(further @ dead)
    assert (sums.square([]), sums.linear([]).tolist()) == (0.0, [0.0] * 3)
