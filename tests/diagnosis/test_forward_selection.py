"""The parts of the forward selection, by direct least squares and by the definitions of their numbers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.measured import sail, smoothed

from diagnosis import Model
from diagnosis.predictors.weak_form import weak_windows
from diagnosis.search import forward_selection
from diagnosis.search.candidates import Candidate
from diagnosis.search.conclusion import AcceptedEffect
from diagnosis.search.findings import MOST_REPORTED, Finding, Findings, Ranked
from diagnosis.search.forward_selection import (
    ForwardSelection,
    accepted_effect,
    in_one_order,
    searched_again,
)
from diagnosis.search.gram import Nuisance
from diagnosis.search.map_regression import REPLICATES, Scored, first_share

K = 240


def drawn(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


NUISANCE = Nuisance(drawn(K, 3, 2, seed=4), np.diag([0.0, 1.0]), np.zeros(2), np.ones(2))


# What is reported of candidates


def scored(candidate, blocks, penalty=0.0):
    blocks = np.array(blocks, float)
    return Scored(candidate, 0, blocks, blocks, penalty, 0.0)


def test_all_candidates_are_in_one_order_with_those_of_the_shortlist_as_refined():
    """Shares are of the model error, and of what coefficients alone leave."""
    order = [scored(0, [4.0, 4.0]), scored(1, [5.0, 5.0]), scored(2, [2.0, 9.0]), scored(3, [9.0, 9.0])]
    effects = [Candidate(SimpleNamespace(id=f"e{k}")) for k in range(4)]
    ranking = SimpleNamespace(candidates=effects, order=order, size=40.0)
    best = SimpleNamespace(ids=["e0", "e1"], scored=[scored(1, [1.0, 3.0], 0.5), scored(0, [6.0, 7.0])])
    found = in_one_order(ranking, best, scored(-1, [10.0, 10.0]))
    assert [r.id for r in found] == ["e1", "e2", "e0", "e3"]
    assert [r.score for r in found] == [4.5, 11.0, 13.0, 18.0]
    assert [r.q2 for r in found] == pytest.approx([1.0 - x / 40.0 for x in (4.0, 11.0, 13.0, 18.0)])
    assert [r.beyond for r in found] == pytest.approx([1.0 - x / 20.0 for x in (4.0, 11.0, 13.0, 18.0)])
    assert [r.behind for r in found] == [0.0, 6.5, 8.5, 13.5]
    differences = ([0.0, 0.0], [1.0, 6.0], [5.0, 4.0], [8.0, 6.0])
    assert [r.behind_std for r in found] == pytest.approx(
        [np.sqrt(2.0) * np.std(d) for d in differences]
    )


def ranking_of(ids, order):
    """A ranking with these candidates."""
    candidates = [SimpleNamespace(effect=SimpleNamespace(id=name)) for name in ids]
    return SimpleNamespace(candidates=candidates, order=order)


@pytest.mark.parametrize("chosen", [0, 1])
def test_an_effect_that_is_accepted_has_its_intervals_and_the_shares_of_all(chosen):
    rng = np.random.default_rng(0)
    each = [scored(1, 5.0 + rng.random(20)), scored(0, 5.0 + rng.random(20))]
    best = SimpleNamespace(
        ids=["X_u", "lag"],
        starts=[
            SimpleNamespace(values={"delta_X_u": 1.0}),
            SimpleNamespace(values={"T": 2.0, "d": 1.0}),
        ],
        refined=[SimpleNamespace(intervals={"delta_X_u": (0.0, 2.0)}), SimpleNamespace(intervals={})],
        scored=each,
    )
    ranking = ranking_of(["lag", "X_u"], each)
    nothing = scored(-1, np.full(20, 9.0))
    found = accepted_effect(ranking, best, np.random.default_rng(1), nothing, chosen)
    own, other = (each[k].blocks.sum() for k in (chosen, 1 - chosen))
    assert found.nearest == pytest.approx(max((other - own) / (20 * 9.0 - own), 0.0))
    assert found.id == ["lag", "X_u"][chosen]
    assert found.names == [("T", "d"), ("delta_X_u",)][chosen]
    assert found.intervals == [{}, {"delta_X_u": (0.0, 2.0)}][chosen]
    shares = first_share(each, np.random.default_rng(1))
    assert found.weights == {"lag": pytest.approx(shares[0]), "X_u": pytest.approx(shares[1])}
    assert sum(found.weights.values()) == pytest.approx(1.0)


def test_what_has_no_other_candidate_is_imitated_by_none():
    best = SimpleNamespace(
        ids=["X_u"],
        starts=[SimpleNamespace(values={"delta_X_u": 1.0})],
        refined=[SimpleNamespace(intervals={})],
        scored=[scored(0, [1.0] * 10)],
    )
    nothing = scored(-1, [30.0] * 10)
    found = accepted_effect(ranking_of(["X_u"], best.scored), best, np.random.default_rng(1), nothing)
    assert found.nearest == 1.0


def test_a_candidate_out_of_the_shortlist_that_one_block_alone_refutes_has_a_share():
    """Of drag by |u|u only linear drag had a probability, as the start alone speaks for that: 0.92."""
    best = SimpleNamespace(
        ids=["X_u"],
        starts=[SimpleNamespace(values={"delta_X_u": 1.0})],
        refined=[SimpleNamespace(intervals={})],
        scored=[scored(0, [1.0] * 8)],
    )
    order = [scored(1, [1.0] * 8), scored(0, [60.0] + [1.0] * 7), scored(2, [9.0] * 8)]
    ranking, nothing = ranking_of(["X_|u|u", "X_u", "lag"], order), scored(-1, [30.0] * 8)
    found = accepted_effect(ranking, best, np.random.default_rng(1), nothing)
    without_it = (1.0 - 1.0 / 8.0) ** 8  # of the draws, in which both have even odds
    assert found.weights["X_|u|u"] == pytest.approx(0.5 * without_it, abs=0.06)
    assert found.weights["lag"] < 1e-6, "every block refutes it"
    assert list(found.weights) == ["X_u", "X_|u|u", "lag"]


def test_shares_are_odds_of_scores_on_blocks_that_are_drawn_anew():
    """Of scores that are the same in every block no draw makes a difference."""
    even = [scored(0, [1.0] * 10), scored(1, [1.2] * 10, 1.0)]
    odds = np.exp(-0.5 * 3.0)
    assert first_share(even, np.random.default_rng(0)) == pytest.approx(
        [1.0 / (1.0 + odds), odds / (1.0 + odds)]
    )
    one_block = [scored(0, [0.0] * 9 + [100.0]), scored(1, [5.0] * 10)]
    share = first_share(one_block, np.random.default_rng(0))[1]
    drawn_once = 1.0 - 0.9**10  # that the block of 100 is drawn at all
    assert share == pytest.approx(drawn_once, abs=4.0 * np.sqrt(0.25 / REPLICATES))


# Waves, which are no force of the model


PEAK = SimpleNamespace(peak=1.7, force=0.4, confidence=0.95, share=0.6)


def with_waves(monkeypatch, effects, peak=PEAK):
    """What the selection finds, where a search has found some effects."""
    start = Model()
    found = [Finding(name, {}, {}, 0.9, [], 0.5, 0.5, replace(start)) for name in effects]
    ranked = [Ranked("X_u", 3.0, 0.4)]

    class Done:
        model = "learned"

        def findings(self, ids=None):
            kept = [f for f in found if ids is None or f.id in ids]
            return Findings(kept, ranked, fold_models=["a", "b"], run_models=["c"], suspects=["suspect"])

    cleared = []
    runs = [
        SimpleNamespace(smoothed=k, memory=SimpleNamespace(clear=lambda k=k: cleared.append(k)))
        for k in range(2)
    ]

    def look(smoothed, model, rng):
        assert (smoothed, model, cleared) == ([0, 1], "learned", [0, 1])
        return peak

    monkeypatch.setattr(forward_selection, "search", lambda *_: Done())
    monkeypatch.setattr(forward_selection, "find_waves", look)
    said = []
    return start, ForwardSelection().fit(runs, start, None, said.append, 0), said


def test_waves_come_first_and_leave_the_model_as_it_is(monkeypatch):
    start, found, said = with_waves(monkeypatch, ["X_u"])
    assert said == ["waves"]
    waves, drag = found.effects
    assert (waves.id, drag.id) == ("waves", "X_u")
    assert waves.values == {"wave_peak": 1.7 - start.value("wave_peak"), "wave_force": 0.4}
    assert (waves.confidence, waves.q2, waves.share) == (0.95, 0.6, 0.6)
    assert waves.model is start
    assert [r.id for r in found.ranking] == ["waves", "X_u"]
    assert (found.ranking[0].score, found.ranking[0].q2) == (0.0, 0.6)
    assert (found.fold_models, found.run_models, found.suspects) == (["a", "b"], ["c"], ["suspect"])


def test_waves_alone_are_beside_the_first_model_in_each_fold(monkeypatch):
    """Without another effect the coefficients are those of the first model."""
    start, found, _ = with_waves(monkeypatch, [])
    assert [f.id for f in found.effects] == ["waves"]
    assert found.fold_models == [start, start]
    assert found.run_models == [start]
    assert found.suspects == []


def test_findings_are_fitted_anew_with_the_waves_or_without_them(monkeypatch):
    _, found, _ = with_waves(monkeypatch, ["X_u", "N_r"])
    assert [f.id for f in found.refit(["waves", "N_r"]).effects] == ["waves", "N_r"]
    assert [f.id for f in found.refit(["N_r"]).effects] == ["N_r"]
    assert [r.id for r in found.refit(["N_r"]).ranking] == ["X_u"]


def test_without_waves_the_findings_are_those_of_the_search(monkeypatch):
    _, found, _ = with_waves(monkeypatch, ["X_u"], None)
    assert [f.id for f in found.effects] == ["X_u"]
    assert [r.id for r in found.ranking] == ["X_u"]


class FakeModel:
    """A model that is the set of effects in it."""

    def __init__(self, effects):
        self.effects = frozenset(effects)
        laws = {i: SimpleNamespace(search=SimpleNamespace(smooth=False)) for i in "abcd"}
        self.start = SimpleNamespace(ship=SimpleNamespace(effects=laws))
        self.values, self.fitted, self.offset = {}, (), np.zeros(0)

    def theta(self, names):
        return self.offset

    def without(self, names):
        return FakeModel(self.effects - set(names))


def search_places(monkeypatch, scores, accepted):
    """The places searched again of single-letter effects, where scores tell how good each set of them is."""

    def rank(t, beside, others, made, nuisance, *_):
        assert others == beside.effects
        return SimpleNamespace(nuisance=nuisance, beside=beside, order=[])

    def reweighted(t, beside, ranking, present):
        assert beside.effects.isdisjoint(present), "the effect whose place is searched is a candidate"
        ids = sorted("abcd", key=lambda i: scores(beside.effects | {i}))
        ids = [i for i in ids if i not in beside.effects]
        found = [
            Scored(k, 0, np.full(4, 0.25 * scores(beside.effects | {i})), np.zeros(4), 0.0, 0.0)
            for k, i in enumerate(ids)
        ]
        best = SimpleNamespace(
            ids=ids,
            scored=found,
            starts=[SimpleNamespace(values={i: 1.0}) for i in ids],
            refined=[SimpleNamespace(intervals={})] * len(ids),
            of=lambda k: FakeModel(beside.effects | {ids[k]}),
        )
        return t, ranking, best

    def alone(t, at):
        return Scored(-1, 0, np.full(4, 0.25 * scores(at.effects)), np.zeros(4), 0.0, 0.0)

    monkeypatch.setattr(forward_selection, "rank", rank)
    monkeypatch.setattr(forward_selection, "reweighted", reweighted)
    monkeypatch.setattr(forward_selection, "scored_alone", alone)
    monkeypatch.setattr(forward_selection, "leads", lambda *given: False)
    monkeypatch.setattr(forward_selection, "nuisance_of", lambda *given: NUISANCE)
    monkeypatch.setattr(forward_selection, "refit", lambda t, at, nuisance: SimpleNamespace(estimate=at))
    found = [AcceptedEffect(i, (i,), {}, {i: 1.0}, 1.0) for i in accepted]
    t = SimpleNamespace(error=lambda at: None)
    rng = np.random.default_rng(0)
    at, kept, gone = searched_again(t, FakeModel(accepted), found, {}, lambda text: None, rng)
    assert at.effects == {p.id for p in kept}
    return {p.id: p for p in kept}, gone


def by(values, default=1000.0):
    """Scores of sets of effects, told as words of letters in order."""
    return lambda effects: values.get("".join(sorted(effects)), default)


def test_an_effect_that_another_made_superfluous_gives_way_to_nothing(monkeypatch):
    """Of a that stood for b, once b is in; one that still brings something stays."""
    needless = by({"a": 500.0, "b": 100.0, "ab": 95.0})
    kept, gone = search_places(monkeypatch, needless, "ab")
    assert (set(kept), gone) == ({"b"}, {"a"})
    needed = by({"a": 500.0, "b": 120.0, "ab": 95.0})
    kept, gone = search_places(monkeypatch, needed, "ab")
    assert (set(kept), gone) == ({"a", "b"}, set())


def test_after_a_replacement_the_last_effect_is_compared_with_its_rivals_again(monkeypatch):
    """c takes the place of a; beside it b is no better than d, which no one had asked beside a."""
    scores = by({"a": 500.0, "b": 400.0, "c": 450.0, "ab": 300.0, "bc": 100.0, "cd": 101.0})
    kept, gone = search_places(monkeypatch, scores, "ab")
    assert (set(kept), gone) == ({"b", "c"}, set())
    assert kept["c"].instead_of == ("a",)
    assert kept["b"].weights["b"] == pytest.approx(0.6, abs=0.1)
    assert kept["b"].weights["d"] == pytest.approx(0.4, abs=0.1)


def test_a_search_ends_though_what_is_found_gives_way_again_and_again(monkeypatch):
    """As where a cause that no candidate has is made up of any of them."""
    found = []

    def gives_way(t, at, accepted, *more):
        found.append(accepted[-1].id)
        return at.without(accepted[-1].names), list(accepted[:1]), set()

    monkeypatch.setattr(forward_selection, "searched_again", gives_way)
    monkeypatch.setattr(forward_selection, "beyond_chance", lambda *them: True)
    monkeypatch.setattr(forward_selection, "matters", lambda *them, **command: True)
    monkeypatch.setattr(forward_selection, "harmful", lambda *them: False)
    w = weak_windows(smoothed(sail(60.0, 0.1, ship={"delta_X_u": -2.0})[0]))
    rng = np.random.default_rng(0)
    selection = forward_selection.search([w], None, Model(), lambda step: None, rng)
    assert len(found) == MOST_REPORTED - 1
    assert len(selection.findings().effects) == 1
