"""The equations of a path and its clock: the true path satisfies all of them, and none goes over a gap."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis import Run
from diagnosis.runs.sensors.clock_path import (
    ACROSS,
    ALONG,
    CLOCK,
    DRIFT,
    FIXED,
    HEADING,
    RATE,
    TURN,
    PathProblem,
    _spaced,
)
from diagnosis.runs.sensors.evidence import Evidence, integral

STEP, SECONDS = 0.25, 30.0
TIME = np.arange(0.0, SECONDS, STEP)
SIZES = (0.01, 0.005)
halves = st.integers(0, round(2 * SECONDS)).map(lambda k: 0.5 * k)  # nodes lie at whole seconds


def truth(clock, gaps=(), jump=0.0):
    """What the channels of a turning ship say, whose log runs too slowly; it jumps over each gap [m, rad]."""
    velocity = np.column_stack([1.0 + 0.2 * np.sin(0.3 * TIME), 0.5 * np.cos(0.2 * TIME)])
    rate = 0.1 * np.sin(0.4 * TIME)
    pose = clock * np.column_stack([integral(TIME, velocity), integral(TIME, rate)])
    for start, end in gaps:
        pose[end <= TIME] += jump
        rows = (start < TIME) & (end > TIME)
        pose[rows] += 100.0  # rows of the gap count for nothing
    run = Run("made", TIME, pose, np.zeros_like(pose))
    return Evidence(
        run, np.arange(TIME.size), pose[:, 2], velocity, rate, ("x_dot", "y_dot"), TIME < 0.0
    )


@st.composite
def some_gaps(draw):
    ends = sorted(draw(st.lists(halves, min_size=0, max_size=6, unique=True)))
    pairs = list(zip(ends[::2], ends[1::2], strict=False))
    return [(a, b) for a, b in pairs if a > 1.0 and b < SECONDS - 2.0]


def is_cut(first, last, gaps):
    """Whether some instant strictly between two nodes is strictly inside of a gap, by trying many."""
    inside = np.linspace(first, last, 402)[1:-1]
    return any(((inside > start) & (inside < end)).any() for start, end in gaps)


@settings(max_examples=60, deadline=None)
@given(some_gaps())
def test_the_nodes_to_both_sides_of_a_gap_are_not_connected(gaps):
    problem = PathProblem(truth(1.0), SIZES, gaps)
    expected = [is_cut(a, b, gaps) for a, b in zip(problem.edges[:-1], problem.edges[1:], strict=True)]
    assert problem.cut.tolist() == expected
    count = np.bincount(problem.equations.group, minlength=FIXED + 1)
    whole = np.flatnonzero(~problem.cut)
    assert count[DRIFT] == 2 * whole.size
    assert count[TURN] == whole.size
    assert count[CLOCK] == np.sum(np.diff(whole) == 1), "the clock walks over two intervals side by side"
    assert count[RATE] == problem.nodes.size


@settings(max_examples=60, deadline=None)
@given(some_gaps(), st.floats(0.6, 1.8), st.sampled_from([0.0, 7.0]))
def test_the_true_path_satisfies_every_equation(gaps, clock, jump):
    e = truth(clock, gaps, jump)
    problem = PathProblem(e, SIZES, gaps)
    pose = e.run.pose - [*e.run.pose[0, :2], 0.0]
    x = np.column_stack([pose[problem.nodes], np.full(problem.nodes.size, clock)]).ravel()
    off = problem.equations.matrix @ x - problem.right
    believed = np.isin(problem.equations.group, [RATE, FIXED])  # priors of the clock and of the place
    np.testing.assert_allclose(off[~believed], 0.0, atol=1e-9)
    np.testing.assert_allclose(off[problem.equations.group == RATE], clock - 1.0)
    np.testing.assert_allclose(problem.solve([]).clock[~problem.cut], clock, rtol=0.01)


@pytest.mark.parametrize("without", [frozenset(), frozenset({8, 33, 90})])
def test_each_sample_counts_once_on_each_axis_unless_it_is_left_out(without):
    """Those between a node and the gap that follows belong to no interval without a jump, as in the gap."""
    gap = (10.5, 13.5)  # nodes at 10.0 s, and, every second from then on, at 13.5 s
    problem = PathProblem(truth(1.0), SIZES, [gap], without)
    expected = {k for k in range(TIME.size) if TIME[k] <= 10.0 or gap[1] <= TIME[k] < problem.edges[-1]}
    _, start, rows, axes = problem.parts[0]
    assert sorted(rows.tolist()) == sorted(expected - without)
    assert (TIME[start] <= TIME[rows]).all()
    assert (TIME[rows] - TIME[start] < 1.0).all()
    assert len(axes) == 3
    for k, group in enumerate((ALONG, ACROSS, HEADING)):
        assert (problem.equations.group[k * rows.size : (k + 1) * rows.size] == group).all()
        assert np.sum(problem.equations.group == group) == rows.size


@given(st.lists(st.floats(0.01, 3.0), min_size=1, max_size=40), st.floats(0.1, 4.0))
def test_nodes_are_as_close_as_the_spacing_allows(steps, spacing):
    time = np.cumsum(steps)
    kept = _spaced(time, spacing)
    assert kept[0] == 0
    assert (np.diff(time[kept]) >= spacing * (1.0 - 1e-5)).all()
    for k in set(range(time.size)) - set(kept.tolist()):
        before = kept[kept < k][-1]
        assert time[k] - time[before] < spacing
