"""Nonlinear parameters of an effect from many starts: what is tried, what is linear, and the best, in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.search.nonlinear.multistart import (
    POINTS,
    WIDEST,
    Landscape,
    best_values,
    limits,
    linear_ones,
    refined,
)

X = np.linspace(0.0, 3.0, 61)


def variable(name, low=None, high=None, unit="1"):
    return SimpleNamespace(name=name, unit=unit, range=SimpleNamespace(min=low, max=high))


def landscape(force, y, *parameters, shape=(), values=None, extent=10.0, units=None):
    names = [p.name for p in parameters]
    effect = SimpleNamespace(
        parameters=parameters,
        coefficients=[n for n in names if n not in shape],
        shape_parameters=[*shape],
    )
    values = dict.fromkeys(names, 0.0) | (values or {})
    return Landscape(effect, force, y, extent, values, dict.fromkeys(names, 1.0) | (units or {}))


def plain(p, **options):
    return landscape(lambda v: 0.0 * X, X, p, **options)


@pytest.mark.parametrize(
    ("p", "options", "scale"),
    [
        (variable("a"), {"values": {"a": -3.0}}, 3.0),
        (variable("a", unit="m"), {}, 2.0),
        (variable("a", unit="m"), {"values": {"a": 5.0}}, 5.0),
        (variable("a", unit="rad"), {}, np.pi / 10.0),
        (variable("a", -7.0, 2.0), {}, 7.0),
        (variable("a", high=4.0), {}, 4.0),
        (variable("a"), {"units": {"a": 0.3}}, 0.3),
    ],
)
def test_a_scale_is_the_start_the_way_of_the_ship_or_the_limits(p, options, scale):
    assert plain(p, **options).scale(p) == pytest.approx(scale)


@given(st.floats(0.0, 1.0), st.floats(-50.0, 50.0), st.floats(0.1, 50.0))
def test_what_is_tried_is_spread_over_the_limits(share, low, width):
    p = variable("a", low, low + width)
    found = plain(p).within(p, share)
    ratio = (low + width) / low if low > 0.0 else 1.0
    expected = low * ratio**share if ratio > WIDEST**2 else low + share * width
    assert found == pytest.approx(expected)
    assert limits(p) == (low, low + width)
    wide = variable("a", 0.01, 10.0)
    assert plain(wide).within(wide, share) == pytest.approx(0.01 * 1000.0**share)


@given(st.floats(0.0, 1.0), st.floats(0.1, 5.0))
def test_without_limits_values_are_the_sparser_the_further_to_both_sides(share, start):
    p, of = variable("a"), plain(variable("a"), values={"a": start})
    ends = [of.within(p, s) for s in (0.0, 0.5, 1.0)]
    assert ends == pytest.approx([start - WIDEST * start, start, start + WIDEST * start])
    up, down = of.within(p, 0.5 + 0.5 * share), of.within(p, 0.5 - 0.5 * share)
    assert up - start == pytest.approx(start - down, abs=1e-9)
    further = of.within(p, 0.5 + 0.25 * share) - start
    assert up - start >= 2.0 * further - 1e-9
    half = variable("a", low=0.5 * start)
    assert plain(half, values={"a": start}).within(half, 0.0) == pytest.approx(0.5 * start)
    assert limits(half) == (0.5 * start, np.inf)
    assert limits(p) == (-np.inf, np.inf)


def test_points_begin_with_the_values_that_are_there_and_cover_the_range():
    p, q = variable("p", 0.0, 1.0), variable("q", -2.0, 2.0)
    of = landscape(lambda v: 0.0 * X, X, p, q, values={"p": 0.3, "q": 1.5})
    found = [*of.points(["p", "q"])]
    assert found[0] == {"p": 0.3, "q": 1.5}
    assert len(found) == POINTS + 1
    for name, low, high in (("p", 0.0, 1.0), ("q", -2.0, 2.0)):
        cells = np.floor((np.array([x[name] for x in found[1:]]) - low) / (high - low) * POINTS)
        assert sorted(cells) == [*range(POINTS)], "one in each part of the range"
    assert [*of.points([])] == [{}]


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_what_linear_parameters_leave_is_that_of_least_squares(seed):
    rng = np.random.default_rng(seed)
    f, g, y = rng.standard_normal((3, X.size))
    a, b = variable("a"), variable("b", high=0.5)
    of = landscape(
        lambda v: v.get("a", 0.0) * f + v.get("b", 0.0) * g + v.get("s", 0.0), y, a, b, units={"a": 4.0}
    )
    assert (of.unit("a"), of.unit("b")) == (4.0, 0.25)
    assert of.columns({}, ["a", "b"]) == pytest.approx(np.column_stack([f, g]))
    A = np.column_stack([f, g])
    assert of.left({}, ["a", "b"]) == pytest.approx(y - A @ np.linalg.lstsq(A, y, rcond=None)[0])
    assert of.left({"a": 2.0, "b": 0.0}, []) == pytest.approx(y - 2.0 * f)
    assert (of.left({"s": np.inf}, ["a"]) == y).all(), "a force that is not finite explains nothing"


def test_coefficients_are_linear_idle_or_neither():
    def force(v):
        return v["a"] * X + v["b"] * abs(v["b"]) * X**2 + v["a"] * v["c"] * X**3

    of = landscape(force, X, variable("a"), variable("b"), variable("c"))
    assert linear_ones(of) == (["a"], ["c"])


@settings(max_examples=10)
@given(st.floats(0.4, 3.0), st.sampled_from([-2.0, 0.5, 3.0]))
def test_a_shape_and_its_size_are_found_far_from_the_start(s, size):
    def force(v):
        return v.get("k", 0.0) * np.exp(-v["s"] * X)

    of = landscape(force, size * np.exp(-s * X), variable("k"), variable("s", 0.0, 5.0), shape=["s"])
    found, linear = best_values(of, lambda shape: [])
    assert linear == ["k"]
    assert found[0]["s"] == pytest.approx(s, rel=1e-3)
    losses = [np.sum(of.left(v, linear) ** 2) for v in found]
    assert losses == sorted(losses)
    assert losses[0] < 1e-6
    loss, at = refined(of, {"s": 4.9}, ["k"])
    assert loss == pytest.approx(np.sum(of.left(at, ["k"]) ** 2))
    assert 0.0 <= at["s"] <= 5.0


def test_an_effect_that_does_nothing_has_no_best_values():
    of = landscape(lambda v: 0.0 * X, X, variable("k"), variable("s", 0.0, 5.0), shape=["s"])
    assert best_values(of, lambda shape: []) == ([], [])


def test_coefficients_that_are_not_linear_are_tried_at_the_values_that_are_given():
    """A dead band's force is not in proportion to its width."""
    y = np.maximum(X - 1.2, 0.0)
    of = landscape(
        lambda v: np.where(v["d"] != 0.0, np.maximum(X - abs(v["d"]), 0.0), 0.0), y, variable("d")
    )
    found, linear = best_values(of, lambda shape: [{"d": d} for d in (0.1, 1.0, 2.5)])
    assert linear == []
    assert abs(found[0]["d"]) == pytest.approx(1.2, abs=1e-3)
