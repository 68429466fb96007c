"""What a next run has to tell apart (diagnosis/design/hypotheses.py): rivals, weights and parameters."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.measured import sail, smoothed

from diagnosis import Model, weak_windows
from diagnosis.design import hypotheses
from diagnosis.design.hypotheses import (
    EffectParameters,
    Rival,
    Space,
    _left,
    _weights,
    block_of,
    knowledge,
    learned_changes,
    rivals,
    usable,
)
from diagnosis.execution.short_text import SHOWN
from diagnosis.search.candidates import SMALL, CandidateShape, model_error
from diagnosis.search.prior import NominalPrior
from diagnosis.search.shortlist import LENGTH


def effect(name, others=(), confidence=0.9):
    return {"id": name, "indistinguishable": [*others], "confidence": confidence}


def test_effects_come_first_and_possibilities_may_be_none():
    content = {
        "effects": [effect("X_u"), effect("lag", ["delay"], None)],
        "possibilities": [effect("current", ["wind"], 0.3)],
        "verdict": "found",
        "ranking": [{"id": "other"}],
    }
    first, second, third = rivals(content)
    assert first == Rival(("X_u",), 0.9)
    assert second.ids == ("lag", "delay")
    assert np.isnan(second.confidence)
    assert third == Rival(("current", "wind", ""), 0.3)


@pytest.mark.parametrize("verdict", ["unexplained", "none", "coefficients"])
def test_where_nothing_is_found_the_first_of_the_ranking_or_nothing_are_rivals(verdict):
    ranking = [{"id": f"e{k}"} for k in range(SHOWN + 3)]
    found = rivals({"effects": [], "possibilities": [], "verdict": verdict, "ranking": ranking})
    if verdict == "unexplained":
        (one,) = found
        assert one.ids == (*(f"e{k}" for k in range(SHOWN)), "")
        assert np.isnan(one.confidence)
    else:
        assert found == []


def test_effects_of_the_clock_of_a_run_and_random_ones_cannot_be_designed_for():
    model = Model()
    assert usable(model, "")
    assert usable(model, "X_u")
    assert usable(model, "lag")
    assert not usable(model, "bow_outage")
    assert not usable(model, "waves")
    assert not usable(model, "no_such_effect")


# Weights


def weighed(evidence, ids, *found):
    """The weights of hypotheses whose odds by the data are known."""
    k = SimpleNamespace(
        hypotheses=[SimpleNamespace(ids=names) for names in ids], log_evidence=np.log(evidence) - 700.0
    )
    return _weights(k, found)


def test_without_a_confidence_the_data_decide():
    found = weighed([1.0, 3.0, 4.0], [("a",), ("b",), ()], Rival(("a", "b", ""), np.nan))
    assert found == pytest.approx([0.125, 0.375, 0.5])


def test_an_effect_has_its_confidence_and_its_rivals_share_the_rest_by_the_data():
    found = weighed([1.0, 3.0, 1.0], [("a",), ("b",), ("c",)], Rival(("a", "b", "c"), 0.6))
    assert found == pytest.approx([0.6, 0.3, 0.1])


def test_two_effects_have_the_confidence_of_each():
    ids = [("a", "x"), ("a", "y"), ("b", "x"), ("b", "y")]
    found = weighed([1.0] * 4, ids, Rival(("a", "b"), 0.8), Rival(("x", "y"), 0.7))
    assert found == pytest.approx([0.56, 0.24, 0.14, 0.06])


def test_effects_that_hypotheses_share_unevenly_have_the_confidence_of_each():
    ids = [("a", "x"), ("a",), ("x",), ()]
    a, x = Rival(("a", ""), 0.7), Rival(("x", ""), 0.8)
    for first, second in ((a, x), (x, a)):
        found = weighed([9.0, 1.0, 1.0, 2.0], ids, first, second)
        assert found[:2].sum() == pytest.approx(0.7, abs=0.01)
        assert found[[0, 2]].sum() == pytest.approx(0.8, abs=0.01)
        # The odds ratio is that of the data.
        assert found[0] * found[3] / (found[1] * found[2]) == pytest.approx(18.0, rel=1e-9)


def test_what_all_hypotheses_have_or_none_changes_no_weight():
    ids = [("a", "x"), ("a", "y")]
    assert weighed([1.0, 3.0], ids, Rival(("a",), 0.5)) == pytest.approx([0.25, 0.75])
    assert weighed([1.0, 3.0], ids, Rival(("z", "x"), 0.5)) == pytest.approx([0.25, 0.75])


def test_hypotheses_that_the_data_exclude_share_evenly():
    k = SimpleNamespace(
        hypotheses=[SimpleNamespace(ids=(n,)) for n in "abc"], log_evidence=np.array([0.0, -1e6, -1e6])
    )
    assert _weights(k, [Rival(("a", "b", "c"), 0.4)]) == pytest.approx([0.4, 0.3, 0.3])


# Parameters


K = 40
NOISE = np.array([0.5, 2.0, 0.1])


def shape(seed, given=(), fitted=("lag",), offset=None):
    columns = np.random.default_rng(seed).standard_normal((K, 3, len(fitted)))
    return CandidateShape(dict(given), fitted, offset, columns, np.ones(len(fitted)))


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("fitted", [(), ("lag",), ("lag", "delay")])
def test_what_a_shape_leaves_is_by_least_squares_in_units_of_the_noise(given, fitted):
    y = np.random.default_rng(5).standard_normal((K, 3))
    offset = np.random.default_rng(6).standard_normal((K, 3)) if given else None
    s = shape(1, fitted=fitted, offset=offset)
    rest = (y - offset / NOISE if given else y).ravel()
    if fitted:
        A = (s.columns / NOISE[:, None]).reshape(3 * K, -1)
        rest = rest - A @ np.linalg.pinv(A) @ rest
    assert _left(s, y, NOISE) == pytest.approx(rest @ rest)


def test_parameters_are_about_the_best_shape_with_steps_of_its_values():
    start = Model()
    one, other = shape(1, {"delay": 0.3}), shape(2, {"delay": -0.7, "lag": 0.0})
    for best, value in ((one, 0.3), (other, 0.7)):
        base = best.columns @ [2.0] + 1e-3 * np.random.default_rng(3).standard_normal((K, 3))
        block = block_of(start, [one, other], base, NOISE)
        assert block.given == best.given
        assert block.names == ("lag", "delay")
        assert block.steps == pytest.approx((start.unit("lag"), value))
        assert block.precision is None


def test_values_that_follow_each_other_have_their_precision_in_units_of_the_steps():
    start = Model()
    P = np.array([[4.0, 1.0], [1.0, 9.0]])
    s = CandidateShape({}, ("lag", "V_n"), None, np.ones((K, 3, 2)), np.ones(2), precision=P)
    block = block_of(start, [s], np.ones((K, 3)), NOISE)
    units = np.array([start.unit("lag"), start.unit("V_n")])
    assert block.precision == pytest.approx(P * np.outer(units, units))


def space():
    start = Model()
    prior = NominalPrior.of(start, 0.1)
    prior.std["X_u"] = 0.0
    blocks = {
        "lag": EffectParameters({"lag": 0.4}, ("lag",), (0.4,)),
        "current": EffectParameters({}, ("V_n", "V_e"), (0.1, 0.2)),
    }
    return Space(start, start, prior, blocks, NOISE, np.ones(3))


def test_an_effect_has_one_place_for_its_point_and_one_for_each_slope():
    s = space()
    q = len(s.prior.std) - 1
    assert "X_u" not in s.nuisance
    assert len(s.nuisance) == q
    assert {n: p.tolist() for n, p in s.places().items()} == {
        "lag": [q, q + 1],
        "current": [q + 2, q + 3, q + 4],
    }


def test_the_model_of_a_hypothesis_has_its_point_and_steps_within_their_ranges():
    s = space()
    q = len(s.nuisance)
    z = np.zeros(q + 5)
    z[0], z[q + 1], z[q + 3], z[q + 4] = 0.5, -0.25, 2.0, -1.0
    first = s.nuisance[0]
    model = s.model(SimpleNamespace(ids=("lag",)), z)
    assert model.value("lag") == pytest.approx(s.start.value("lag") + 0.4 - 0.25 * 0.4)
    assert model.value("V_n") == s.start.value("V_n")
    assert model.value(first) == pytest.approx(s.start.value(first) + 0.5 * s.prior.std[first])
    both = s.model(SimpleNamespace(ids=("lag", "current")), z)
    assert [both.value("V_n"), both.value("V_e")] == pytest.approx([0.2, -0.2])
    z[q + 1] = -9.0
    assert s.model(SimpleNamespace(ids=("lag",)), z).value("lag") == 0.0, "no lag is negative"


def test_columns_are_slopes_of_the_model_error_in_units_of_the_noise(monkeypatch):
    """Of a model error that is linear in the values they are exact."""
    s = space()
    rng = np.random.default_rng(0)
    names = [*s.prior.std, "lag", "V_n", "V_e"]
    each = dict(zip(names, rng.standard_normal((len(names), K, 3)), strict=True))
    start = s.start

    def error(data, model):
        return 3.0 - sum(x * (model.value(n) - start.value(n)) for n, x in each.items())

    monkeypatch.setattr(hypotheses, "model_error", error)
    found = s.columns([])
    expected = [each[n] * s.prior.std[n] for n in s.nuisance]
    expected += [
        0.4 * each["lag"],
        0.4 * each["lag"],
        0.0 * each["lag"],
        0.1 * each["V_n"],
        0.2 * each["V_e"],
    ]
    assert found == pytest.approx(np.stack(expected, axis=2) / NOISE[:, None], abs=1e-6 / SMALL * 1e-3)
    rows = s.rows([])
    assert rows[4] == pytest.approx(found[1, 1])
    assert s.gram([]) == pytest.approx(rows.T @ rows)


# All that a diagnosis leaves open


class Made:
    """A space of two parameters of the ship and two of each effect, on data that are made up."""

    def __init__(self, effects, data, start):
        self.blocks, self.start = dict.fromkeys(effects), start
        self.nuisance, self.sigma, self._rows = ["X_u", "N_r"], NOISE, data

    def places(self):
        return {n: np.array([2 + 2 * k, 3 + 2 * k]) for k, n in enumerate(self.blocks)}

    def rows(self, data):
        return self._rows


def known(monkeypatch, found, without=()):
    """The knowledge by findings; effects whose name begins with z cannot be designed for."""
    rng = np.random.default_rng(0)
    error, asked = rng.standard_normal((K, 3)), []

    def space_of(data, start, prior, ids, learned):
        asked.extend(ids)
        effects = [i for i in ids if i not in without]
        p = 2 + 2 * len(effects)
        return Made(effects, rng.standard_normal((3 * K, p)), start), np.eye(p), np.zeros(p)

    monkeypatch.setattr(hypotheses, "usable", lambda start, name: not name.startswith("z"))
    monkeypatch.setattr(hypotheses, "space_of", space_of)
    monkeypatch.setattr(hypotheses, "model_error", lambda data, start: error)
    space, k = knowledge([], None, None, found)
    return space, k, asked, error


def test_hypotheses_are_one_rival_of_each_effect_with_their_parameters_and_the_ship_s(monkeypatch):
    found = [Rival(("a", "b"), 0.7), Rival(("c", "zero", ""), 0.9)]
    space, k, asked, error = known(monkeypatch, found)
    assert asked == ["a", "b", "c"]
    assert {h.ids for h in k.hypotheses} == {("a", "c"), ("b", "c"), ("a",), ("b",)}
    for h in k.hypotheses:
        own = np.concatenate([space.places()[n] for n in h.ids])
        assert h.own.tolist() == own.tolist()
        assert h.columns.tolist() == [0, 1, *own]
    A = space.rows([])
    assert pytest.approx(A.T @ A) == k.G
    assert k.b == pytest.approx(A.T @ (error / NOISE).ravel())
    assert k.weights.sum() == pytest.approx(1.0)
    assert (np.diff(k.weights) <= 0.0).all(), "the likeliest first"
    last = np.array(["c" in h.ids for h in k.hypotheses])
    assert k.weights[last].sum() == pytest.approx(0.9)
    assert k.listed == 1.0


def test_an_effect_without_a_rival_leaves_its_doubt_to_none_of_the_hypotheses(monkeypatch):
    found = [Rival(("a",), 0.8), Rival(("b",), 0.6), Rival(("c",), np.nan), Rival(("d", "e"), 0.1)]
    _, k, *_ = known(monkeypatch, found)
    assert k.listed == 0.6
    assert {h.ids for h in k.hypotheses} == {("a", "b", "c", "d"), ("a", "b", "c", "e")}


def test_effects_that_do_nothing_in_the_runs_are_left_out(monkeypatch):
    _, k, *_ = known(monkeypatch, [Rival(("a", "b"), 0.8)], without=("b",))
    assert [h.ids for h in k.hypotheses] == [("a",), ()]
    _, nothing, *_ = known(monkeypatch, [Rival(("zero",), 0.8)])
    assert [h.ids for h in nothing.hypotheses] == [()]
    assert nothing.weights.tolist() == [1.0]


def test_all_is_linear_about_what_was_learned_and_the_prior_is_about_the_initial_model():
    """Of a lag and a drag as learned, what is left is the noise; without them the model is the first."""
    true = {"X_u": -0.4, "lag": 0.6}
    content = {
        "coefficients": [
            {"name": "vessel.X_u", "before": -0.6, "after": -1.0},
            {"name": "vessel.Y_v", "before": -1.0, "after": -1.0},
            {"name": "thrusters.lag", "before": 0.0, "after": 0.6},
        ]
    }
    learned = learned_changes(content)
    assert learned == pytest.approx(true)
    start = Model()
    run = sail(60.0, ship={"X_u": -1.0}, thrusters={"lag": 0.6}, noise=0.1)[0]
    data = [weak_windows(smoothed(run))]
    prior = NominalPrior.of(start, 0.5)
    space, k = knowledge(data, start, prior, [Rival(("lag",), 0.9)], learned)
    assert space.start.value("X_u") == pytest.approx(start.value("X_u") - 0.4)
    assert space.start.value("lag") == start.value("lag")
    assert space.blocks["lag"].given == pytest.approx({"lag": 0.6})
    (h,) = k.hypotheses
    left = model_error(data, space.model(h, k.estimates[0].mean))
    assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(model_error(data, start) ** 2))
    before = space.model(h, np.where(np.isin(np.arange(k.prior.size), h.own), 0.0, k.prior))
    assert before.value("X_u") == pytest.approx(start.value("X_u"))


def test_the_likeliest_hypotheses_alone_are_kept(monkeypatch):
    names = tuple(f"e{k}" for k in range(LENGTH + 3))
    _, k, *_ = known(monkeypatch, [Rival(names, np.nan)])
    assert len(k.hypotheses) == LENGTH
    assert k.weights.sum() == pytest.approx(1.0)
