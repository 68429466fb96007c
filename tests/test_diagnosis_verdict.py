"""What a diagnosis says of what it does not know: remainder, verdict, withdrawal, confidence."""

from dataclasses import replace

import numpy as np
import pytest
from support import reported
from support.measured import NOISE, commands, sail, smoothed
from support.planted import bank, dead_bow, gusts, voyages

import diagnosis
from diagnosis import Model, Run, omega, weak_windows
from diagnosis.assessment.regions import find_regions
from diagnosis.assessment.residual.recurrence import recurrence
from diagnosis.assessment.residual.remainder import AxisRemainder, Remainder, axis_remainders
from diagnosis.assessment.stability import OPERATING
from diagnosis.execution.progress import silent
from diagnosis.predictors.evaluation import evaluate_run
from diagnosis.predictors.parameter_set import ship_with
from diagnosis.predictors.ship_model import of_one_run
from diagnosis.predictors.uncertainty import correlated_windows, omega_std
from diagnosis.predictors.weak_form import commanded
from diagnosis.report import diagnosis_content
from diagnosis.report.headline import UNSURE, VERDICTS, verdict_title
from diagnosis.runs.cleaning import Z95
from diagnosis.search.conclusion import AcceptedEffect
from diagnosis.search.effect_evidence import EffectEvidence, credible
from diagnosis.search.findings import Finding, Findings
from diagnosis.search.forward_selection import taken_over
from diagnosis.search.gram import block_folds
from diagnosis.search.map_regression import Scored, first_share
from diagnosis.search.prediction_fit.disturbance import ForceDisturbance
from diagnosis.search.prediction_fit.disturbance_summary import Unrecorded
from diagnosis.search.prediction_fit.joint_posterior import JointPosterior
from diagnosis.search.prediction_fit.refit import RefitOutcome
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel, at_limit
from diagnosis.search.significance import harm, lower_throughout, worse
from diagnosis.session import begin
from diagnosis.verdict import judging, law_in_parts
from diagnosis.verdict.coefficients import worsens_training_runs
from diagnosis.verdict.confidence import Confidence, Doubts, confidence_of, most_by_intervals
from diagnosis.verdict.judging import (
    differing,
    faster_than_smoothing,
    judge,
    more_than_waves,
    unexplained_axes,
    verdict_name,
    with_confidence,
)
from diagnosis.verdict.law_in_parts import next_to_possibility, of_several, on_one_line, shape_corrected
from diagnosis.verdict.pruning import overfits, proven, prune, without
from diagnosis.verdict.pruning_criteria import criterion
from diagnosis.verdict.shares import falls_by_axis, replaceable
from diagnosis.verdict.validation_data import Fold, ValidationData, fold_losses

SHORT = {"count": 2, "seconds": 90.0}
GUSTS, BANK, DEAD = {"push": gusts}, {"push": bank}, {"dead": dead_bow}


@pytest.mark.parametrize("possible", [False, True])
@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("said", VERDICTS)
def test_heading_claims_no_more_than_the_findings(said, alone, possible):
    """Unsure are one cause without rivals that is not believed, and possibilities where none is found."""
    effects = [reported.effect("lag", 0.5, indistinguishable=[] if alone else ["X_u"])]
    possibilities = [reported.effect("X_u", 0.1)] if possible else []
    r = reported.report_data(None, reported.diagnosis(verdict=said), effects, possibilities)
    unsure = (said == "ambiguous" and alone) or (said == "unexplained" and possible)
    assert verdict_title(r) == (UNSURE if unsure else VERDICTS[said])


def left(runs, model=None):
    """Remainder of a model, of which the nominal one is the first."""
    first, model = Model(), model or Model()
    before, after = ([omega(w, m) for w in runs] for m in (first, model))
    return axis_remainders(runs, before, after, [omega_std(w, first) for w in runs], first)


@pytest.mark.parametrize("noise", [1.0, pytest.param(10.0, marks=pytest.mark.slow)])
def test_noise_alone_is_no_remainder(noise):
    axes = left(voyages(**SHORT, noise=noise, h=0.05))
    assert not any(a.significant for a in axes.values())
    assert all(0.7 < a.rms / a.uncertainty < 1.3 for a in axes.values())


def test_true_model_leaves_no_remainder():
    runs = voyages(**SHORT, ship={"delta_X_u": -3.0})
    drag = left(runs)["X"]
    assert drag.significant
    force = np.sqrt(np.mean(commanded(runs, Model())[:, 0] ** 2))
    assert drag.of_command == pytest.approx(drag.rms / force)
    assert not any(a.significant for a in left(runs, Model().plus({"delta_X_u": -3.0})).values())


@pytest.fixture(scope="module")
def lap():
    """Windows of a run that laps an ellipse at a speed that changes, under commands of another period."""
    t = np.arange(0.0, 240.0, 0.1)
    along = 2.0 * np.pi * t / 47.0 + 0.8 * np.sin(2.0 * np.pi * t / 31.0)
    ahead = np.unwrap(np.arctan2(2.0 * np.cos(along), -3.0 * np.sin(along)))
    pose = np.column_stack([3.0 * np.cos(along), 2.0 * np.sin(along), ahead])
    pose += NOISE * np.random.default_rng(0).standard_normal(pose.shape)
    return [weak_windows(smoothed(Run("lap", t, pose, commands(t))))]


@pytest.mark.parametrize("space", ["place", "heading", "motion", "command", None])
def test_remainder_repeats_with_what_it_was_made_of(lap, space):
    (w,) = lap
    s = w.smoothed
    slow = np.random.default_rng(1).standard_normal(s.time.size // 40 + 2)
    force = {
        "place": np.sin(2.0 * s.eta[:, 0]) * np.cos(1.5 * s.eta[:, 1]),
        "heading": np.sin(2.0 * s.eta[:, 2]),
        "motion": s.nu[:, 0] * np.abs(s.nu[:, 0]),
        "command": np.maximum(w.run.tau_cmd[:, 0], 0.2),
        None: np.interp(s.time, 4.0 * np.arange(slow.size), slow),
    }[space]
    left = (w.smooth @ np.nan_to_num(force))[:, None] * np.ones(3)
    (how, *_) = recurrence(lap, left - left.mean(axis=0))
    assert how.best == space
    assert not how.in_part
    assert how.lasts > 2.0


@pytest.mark.parametrize("fixed", [True, False])
def test_a_force_to_north_that_depends_on_the_place_repeats_there_on_any_heading(lap, fixed):
    """As the pull of a cable; a force that turns with another period repeats nowhere."""
    (w,) = lap
    t = w.smoothed.time
    spun = replace(w.smoothed, eta=np.column_stack([w.smoothed.eta[:, :2], 2.0 * np.pi * t / 13.0]))
    psi, north = spun.eta[:, 2], np.sin(2.0 * spun.eta[:, 0])
    off = psi if fixed else np.cumsum(np.random.default_rng(1).normal(0.0, 0.2, t.size))
    body = np.column_stack([north * np.cos(off), -north * np.sin(off), 0.0 * north])
    error = w.smooth @ np.nan_to_num(body)
    how = recurrence([replace(w, smoothed=spun)], error - error.mean(axis=0))
    assert [each.best for each in how[:2]] == (["place", "place"] if fixed else [None, None])


def test_error_that_is_large_in_one_part_of_the_basin_is_said_to_be_there(lap):
    (w,) = lap
    noise = 0.01 * np.random.default_rng(2).standard_normal((w.middle.size, 3))
    north = w.smooth @ np.nan_to_num(w.smoothed.eta[:, 0])
    found = find_regions(lap, [np.where(north > 1.0, 8.0, 1.0)[:, None] * noise], [0.2 * np.abs(noise)])
    assert all("largest north of 0.9" in sentence for sentence in found.sentences)


def test_force_that_depends_on_the_place_is_a_remainder():
    assert left(voyages(**SHORT, **BANK))["N"].significant


@pytest.mark.parametrize("at_times", [True, False])
def test_part_of_a_command_that_comes_and_goes_is_told_from_a_force_that_does(lap, at_times):
    (w,) = lap
    dead = ((w.run.time // 8.0) % 3.0 == 1.0).astype(float)
    left = w.held @ (dead[:, None] * (w.run.tau_cmd if at_times else np.ones(3)))
    assert [axis.in_part for axis in recurrence(lap, left)] == [at_times] * 3


def test_an_error_that_lasts_longer_than_a_run_lasts_through_whole_runs(lap):
    (w,) = lap
    parts = {name: getattr(w, name)[:40] for name in ("middle", "block", "smooth", "slope", "held")}
    runs = [replace(w, **parts)] * 2
    left = np.repeat([1.0, 2.0], 40)[:, None] * np.ones(3)
    assert [axis.lasts for axis in recurrence(runs, left)] == [np.inf] * 3


@pytest.mark.parametrize("alone", [True, False])
def test_an_error_of_one_run_alone_is_told_from_one_of_all_runs(lap, alone):
    (w,) = lap
    slow = np.random.default_rng(3).standard_normal(w.middle.size)[:, None] * np.ones(3)
    track = replace(w.smoothed.track, run=replace(w.run, name="other"))
    runs = [w, replace(w, smoothed=replace(w.smoothed, track=track))]
    how = recurrence(runs, np.concatenate([slow, 0.1 * slow if alone else slow]))
    assert [axis.run for axis in how] == [w.run.name if alone else ""] * 3
    assert [axis.run for axis in recurrence(lap, slow)] == [""] * 3


def learned(runs, prior):
    return diagnosis.diagnose(runs[:-1], runs[-1:], prior)


@pytest.mark.slow
@pytest.mark.numerical
def test_cause_that_no_candidate_has_is_unexplained():
    found = learned(voyages(**GUSTS), 0.1)
    assert found.verdict == "unexplained"
    assert found.remainder.significant
    assert found.learned.model.values == Model().values
    content = diagnosis_content(found, None, [])
    assert "gusts" in content.remainder.sentence
    assert "no missing effect" not in content.sentence
    assert content.remainder.axes["X"].rms > 20.0 * content.remainder.axes["X"].uncertainty


@pytest.mark.slow
@pytest.mark.numerical
def test_thruster_that_fails_at_times_is_found_with_its_intervals():
    found = learned(voyages(**DEAD), 0.1)
    assert found.verdict == "found"
    (effect,) = found.learned.effects
    assert effect.id == "bow_outage"
    assert effect.confidence > 0.9
    assert effect.of_runs == ["run0", "run1"]
    true = [11.0, 15.0, 40.0, 48.0, 71.0, 75.0, 100.0, 108.0]
    for run in effect.of_runs:
        ends = sorted(of_one_run(effect.values, run).values())
        assert ends == pytest.approx(true, abs=1.5), "the bow command passes zero at two of the ends"
        assert np.median(np.abs(np.subtract(ends, true))) < 0.2
    assert not found.remainder.significant
    *trained, held_out = found.comparison.evaluations
    for e in trained:
        assert e.after.position < 0.5 * e.before.position
    timeless = evaluate_run(held_out.weak_windows, replace(found.learned.model, runs={})).before
    assert np.array_equal(held_out.after.residuals, timeless.residuals), "it has none of their times"
    assert found.shares[0] > 0.5, "of its own runs"
    assert found.withdrawn == []
    content = diagnosis_content(found, None, [])
    (stated,) = content.effects
    assert stated.sentence.startswith("Run run0: The bow thruster fails from 1")
    assert "Run run1: The bow" in stated.sentence
    runs = {name: c.run for name, c in stated.coefficients.items()}
    assert runs["bow_outage_start_1"] == "run0"
    assert runs["bow_outage_start_1@run1"] == "run1"


def finding(start, **values):
    (name,) = values
    return Finding(name.removeprefix("delta_"), values, {}, 0.9, [], 0.5, 0.5, start.plus(values))


def test_effect_that_spoils_unseen_runs_is_withdrawn_and_another_kept():
    runs = voyages(**SHORT, ship={"delta_X_u": -3.0})
    start = Model()
    right, wrong = finding(start, delta_X_u=-3.0), finding(start, delta_N_r=1.0)
    model = start.plus({"delta_X_u": -3.0, "delta_N_r": 1.0})
    found = Findings([right, replace(wrong, model=model)], model=model, sigma=np.full(3, 0.01))
    unseen = ValidationData(runs[:1], runs[1:], start, found.sigma)
    kept, gone = prune(found, unseen, lambda a, b: False, harm)
    assert [w.id for w in gone] == ["N_r"]
    assert "validation runs" in gone[0].reason
    assert [f.id for f in kept.effects] == ["X_u"]
    assert kept.model.values == start.plus({"delta_X_u": -3.0}).values
    assert prune(kept, unseen, lambda a, b: False, harm) == (kept, [])


@pytest.mark.parametrize(
    ("values", "hidden", "stays"),
    [
        ({"mass": 3.0}, {"ship": {"mass": 3.0}}, True),
        ({"mass": 99.0}, {"ship": {"mass": 99.0}}, False),  # as true as it may be, nobody looked further
        ({"loss_surge": 0.97}, {"thrusters": {"loss_surge": 0.97}}, True),  # nearly all there is
    ],
)
def test_what_is_at_the_limit_of_what_was_looked_for_is_withdrawn_and_a_whole_share_is_not(
    values, hidden, stays
):
    runs, start = voyages(**SHORT, **hidden), Model()
    found = Findings([finding(start, **values)], model=start.plus(values), sigma=np.full(3, 0.01))
    kept, gone = prune(
        found, ValidationData(runs[:1], runs[1:], start, found.sigma), lambda a, b: False, harm
    )
    assert bool(kept.effects) == stays
    assert [w.id for w in gone] == ([] if stays else ["mass"])
    text = "mass = 99 kg is at the upper limit of the search, 100 kg (a ship of 113.8 kg: weigh it)"
    assert stays or gone[0].reason == text


def test_less_dissipation_needs_unseen_data_that_show_it():
    runs = voyages(**SHORT, ship={"delta_X_u": -3.0})
    start = Model()
    found = Findings([finding(start, delta_N_uv=1e-6)], model=start, sigma=np.full(3, 0.01))
    unseen = ValidationData([], runs, start, found.sigma)
    assert prune(found, unseen, lambda a, b: False, harm)[1] == []
    assert [w.id for w in prune(found, unseen, lambda a, b: True, harm)[1]] == ["N_uv"]


def test_the_stretches_of_a_run_miss_together_what_it_misses():
    (w, *_), sigma = voyages(**SHORT), np.array([0.1, 0.2, 0.05])
    model = Model().plus({"delta_X_u": -1.0})
    (whole,) = fold_losses([Fold(w)], [model], sigma)
    assert whole.omega.sum() == pytest.approx(np.sum((omega(w, model) / sigma) ** 2))
    folds = [Fold(w, blocks) for blocks in block_folds([w])]
    parts = fold_losses(folds, [model] * len(folds), sigma)
    assert np.concatenate([p.omega for p in parts]) == pytest.approx(whole.omega)
    positions = np.concatenate([p.position for p in parts])
    assert 0 < positions.size < whole.position.size, (
        "windows begin and end in a stretch, or do not count"
    )
    assert np.isin(positions, whole.position).all()


class OnPredictions(ValidationData):
    """Unseen data whose model errors are the same for every model, so that predictions alone decide."""

    def losses(self, *found):
        made = super().losses(*found)
        return [each._replace(omega=made[0].omega) for each in made]


def test_effect_that_spoils_predictions_alone_is_withdrawn_and_one_that_mends_them_stays():
    """However sure an effect is: the right one has confidence 0 here, the wrong one 0.9."""
    runs = voyages(**SHORT, ship={"delta_X_u": -3.0})
    start = Model()
    right, wrong = finding(start, delta_X_u=-3.0), finding(start, delta_N_r=1.0)
    model = start.plus({"delta_X_u": -3.0, "delta_N_r": 1.0})
    found = Findings(
        [replace(right, confidence=0.0, together=0.0), replace(wrong, model=model)],
        model=model,
        sigma=np.full(3, 0.01),
    )
    unseen = OnPredictions(runs[:1], runs[1:], start, found.sigma)
    kept, gone = prune(found, unseen, lambda a, b: False, harm)
    assert [f.id for f in kept.effects] == ["X_u"]
    assert [w.id for w in gone] == ["N_r"]
    assert "predictions of validation runs are worse" in gone[0].reason


def test_coefficients_beside_a_failure_of_one_run_are_held_against_unseen_runs():
    runs = voyages(**SHORT, ship={"delta_X_u": -3.0})
    start, times = Model(), {"bow_outage_start_1@run0": 10.0, "bow_outage_end_1@run0": 12.0}
    outage = Finding("bow_outage", times, {}, 0.9, [], 0.5, 0.5)
    for drag, stays in ((-3.0, True), (3.0, False)):
        model = start.plus({**times, "delta_X_u": drag})
        found = Findings([replace(outage, model=model)], model=model, sigma=np.full(3, 0.01))
        unseen = ValidationData(runs[:1], runs[1:], start, found.sigma)
        kept, gone = prune(found, unseen, lambda a, b: False, harm)
        assert [f.id for f in kept.effects] == ["bow_outage"]
        assert gone == []
        assert kept.model.values == (model if stays else start.plus(times)).values


def test_of_two_effects_that_stand_in_for_each_other_one_stays():
    runs = voyages(**SHORT, ship={"delta_X_u": -3.0})
    start, both = Model(), {"delta_X_u": -3.0, "delta_X_uuu": -200.0}
    first, second = finding(start, delta_X_u=-3.0), finding(start, delta_X_uuu=-200.0)
    model = start.plus(both)
    found = Findings([first, replace(second, model=model)], model=model, sigma=np.full(3, 0.01))
    unseen = ValidationData(runs[:1], runs[1:], start, found.sigma)
    alone = [without(found, [i], start) for i in ("X_u", "X_uuu")]
    full, *beside = unseen.losses(found, *alone)
    assert all(harm(full, other) for other in beside), "each is harmful beside the other"
    kept, gone = prune(found, unseen, lambda a, b: False, harm)
    assert [w.id for w in gone] == ["X_uuu"]
    assert kept.model.values == start.plus({"delta_X_u": -3.0}).values


@pytest.mark.parametrize(("moved", "stays"), [(15.0, True), (2.0, False)])
def test_coefficients_moved_beyond_belief_do_not_take_the_place_of_an_effect(moved, stays):
    runs, start = voyages(**SHORT, ship={"delta_X_u": -3.0}), Model()
    nominal = start.value("X_u")
    rest = Findings(refitted=Model(vessel={"X_u": nominal - 3.0}), moved={"X_u": moved})
    almost = finding(start, delta_X_u=-2.5)
    found = Findings([almost], model=almost.model, sigma=np.full(3, 0.01), refit=lambda ids: rest)
    unseen = ValidationData(runs[:1], runs[1:], start, found.sigma)
    full, other, first = unseen.losses(found, rest, start)
    assert harm(full, other)
    assert not harm(full, first)
    kept, gone = prune(found, unseen, lambda a, b: False, harm)
    assert [f.id for f in kept.effects] == (["X_u"] if stays else [])
    assert len(gone) == (not stays)


def test_an_effect_is_not_withdrawn_for_what_the_coefficients_beside_it_spoil():
    """The fit to the training runs has spoilt N_r, with the idle effect as well as without it."""
    runs, start = voyages(**SHORT, ship={"delta_X_u": -3.0}), Model()
    spoilt = Model(vessel={"N_r": start.value("N_r") - 0.1})
    right, idle = finding(start, delta_X_u=-3.0), finding(start, delta_N_uv=1e-9)

    def fitted(ids):
        effects = [f for f in (right, idle) if f.id in ids]
        model = spoilt
        for f in effects:
            model = model.plus(f.values)
        effects = [replace(f, model=model) for f in effects]
        moved = {"N_r": 15.0} if len(ids) < 2 else {}
        return Findings(effects, model=model, moved=moved, sigma=np.full(3, 0.01), refit=fitted)

    found = fitted(["X_u", "N_uv"])
    unseen = ValidationData(runs[:1], runs[1:], start, found.sigma)
    full, alone = unseen.losses(found, right.model)
    assert harm(full, alone), "with the initial coefficients the idle effect seems harmful"
    assert prune(found, unseen, lambda a, b: False, harm) == (found, [])


def doubted(found, *ids):
    """The findings with effects that are possibilities."""
    effects = [replace(f, confidence=0.1, together=0.1) if f.id in ids else f for f in found.effects]
    return replace(found, effects=effects)


def test_possibility_stays_in_the_model_if_data_show_its_gain_and_a_finding_in_any_case():
    runs, start = voyages(**SHORT, ship={"delta_X_u": -3.0}), Model()
    idle = {"delta_N_uv": 1e-9}  # neither harm nor gain
    right, other = finding(start, delta_X_u=-3.0), finding(start, **idle)
    model = start.plus({"delta_X_u": -3.0} | idle)
    found = Findings([right, replace(other, model=model)], model=model, sigma=np.full(3, 0.01))
    data = ValidationData(runs[:1], runs[1:], start, found.sigma)
    assert prune(found, data, lambda a, b: False, harm)[1] == []
    assert proven(found, data, harm) == (found, [])
    kept, gone = proven(doubted(found, "X_u", "N_uv"), data, harm)
    assert [f.id for f in kept.effects] == ["X_u"]
    assert [f.id for f in gone] == ["N_uv"]
    assert kept.model.values == start.plus({"delta_X_u": -3.0}).values


def test_gain_of_a_possibility_shows_in_the_run_that_it_was_not_fitted_to():
    runs, start = voyages(**SHORT, ship={"delta_X_u": -3.0})[:2], Model()
    right = finding(start, delta_X_u=-3.0)
    found = doubted(Findings([right], model=right.model, sigma=np.full(3, 0.01)), "X_u")
    data = ValidationData(runs, [], start, found.sigma)
    within = [right.model] * len(block_folds(runs))
    for of_other_run, stays in ((right.model, True), (start, False)):
        found = replace(found, fold_models=within, run_models=[of_other_run] * 2)
        assert prune(found, data, lambda a, b: False, harm)[1] == []
        kept, gone = proven(found, data, harm)
        assert bool(kept.effects) == stays
        assert [f.id for f in gone] == ([] if stays else ["X_u"])


@pytest.mark.parametrize(
    ("fitted", "before", "over"),
    [
        ({"delta_X_u": -3.0}, {"delta_X_u": -2.5}, False),
        ({"delta_X_u": -2.5}, {"delta_X_u": -3.0}, True),  # worse than the fit by the model error
        ({"delta_N_r": 1.0}, {"delta_N_r": 1.5}, True),  # better than that, but not than the first model
    ],
)
def test_fit_to_predictions_is_judged_by_the_run_that_it_has_not_seen(fitted, before, over):
    runs, start = voyages(count=3, seconds=90.0, ship={"delta_X_u": -3.0})[:3], Model()
    data = ValidationData(runs, [], start, np.full(3, 0.01))
    both = [Findings(model=start, run_models=[start.plus(v)] * 3) for v in (fitted, before)]
    assert overfits(*both, data, harm) == over
    assert not overfits(replace(both[0], run_models=[]), both[1], data, harm)


def left_on(**significant):
    """A remainder that is significant on some axes."""
    axes = {
        a: AxisRemainder(1.0, 0.1, 0.5, 1.0, 0.5, 0.1, significant.get(a, False), 0.1) for a in "XYN"
    }
    return Remainder(axes, "")


def stated(confidence, together, ids=("X_u",), start=None):
    effects = [
        replace(
            finding(start or Model(), **{f"delta_{i}": -1.0}), confidence=confidence, together=together
        )
        for i in ids
    ]
    return Findings(effects)


@pytest.mark.parametrize(
    ("found", "refitted", "remains", "said"),
    [
        (stated(0.8, 0.8), False, False, "found"),
        (stated(0.79, 0.99), False, False, "ambiguous"),
        (stated(0.3, 0.5), False, False, "ambiguous"),
        (stated(0.3, 0.49), False, False, "unexplained"),
        (stated(np.nan, np.nan), False, False, "ambiguous"),
        (Findings(), True, False, "coefficients"),
        (Findings(), False, True, "unexplained"),
        (Findings(), False, False, "none"),
    ],
)
def test_verdict_follows_the_confidence(found, refitted, remains, said):
    assert verdict_name(found, refitted, left_on(X=remains)) == said


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, "coefficients"),
        ({"delta_X_uu": 0.3, "heading_offset": 0.01}, "coefficients"),
        ({"delta_X_uu": 0.3, "deadband": 0.1}, "unexplained"),
        ({"position_latency": 0.2}, "unexplained"),
        ({"V_n": 0.1, "V_e": 0.0}, "unexplained"),
    ],
)
def test_a_calibration_with_more_than_coefficients_explains_nothing(values, said):
    at = RefinedModel(Model(), np.zeros(0), values)
    assert verdict_name(Findings(estimate=at), True, left_on()) == said


def test_verdict_goes_on_without_what_is_not_believed():
    unlikely, sure = stated(0.1, 0.2, ["N_r"]), stated(0.9, 0.9)
    both = replace(sure, effects=[*unlikely.effects, *sure.effects])
    assert verdict_name(both, False, left_on()) == "found"


@pytest.mark.parametrize(
    ("weights", "others"),
    [
        ({"a": 0.96, "b": 0.04}, []),
        ({"a": 0.5, "b": 0.46, "c": 0.04}, ["b"]),
        ({"b": 0.5, "a": 0.3, "c": 0.2}, ["b", "c"]),
    ],
)
def test_set_holds_95_percent_of_the_weights_that_confidence_comes_from(weights, others):
    assert credible("a", weights) == others


def test_remainder_on_an_axis_of_an_effect_makes_it_even_odds_and_on_others_does_not():
    found = stated(0.99, 0.99)
    (there,), (beside,) = (
        with_confidence(found, Model(), Doubts(unexplained_axes(found, left, Model()))).effects
        for left in (left_on(X=True), left_on(N=True))
    )
    assert there.confidence == there.together == 0.5
    assert "same axis" in there.doubt
    assert beside.confidence == beside.together == 0.99
    assert not beside.doubt


@pytest.mark.parametrize(("slow", "unexplained"), [(0.9, {"X"}), (0.5, set())])
def test_waves_account_for_a_quick_remainder_and_not_for_a_slow_one(slow, unexplained):
    waves = Finding("waves", {"wave_peak": 1.0}, {}, 0.9, [], 0.9, 0.9, together=0.9)
    axes = {"X": AxisRemainder(1.0, 0.1, 0.5, slow, 1e-9, 0.1, True, 0.1)}
    assert unexplained_axes(Findings([waves]), Remainder(axes, ""), Model()) == unexplained


@pytest.mark.parametrize(
    ("axis", "rms", "force", "own"),
    [
        ("X", 2.0, 1.0, 0.5),  # three times the power of the waves is left: their peak may be by chance
        ("X", 2.0, np.sqrt(2.0), 0.5),
        ("Y", 2.0, np.sqrt(3.0), 0.75),
        ("Y", 2.0, 2.1, 0.9),  # that is the waves themselves
        ("N", 2.0, 1.0, 0.9),  # of a moment their force says nothing
    ],
)
def test_waves_that_account_for_half_of_a_residual_are_even_odds(axis, rms, force, own):
    waves = Finding(
        "waves", {"wave_peak": 1.0, "wave_force": force}, {}, 0.9, [], 0.9, 0.9, together=0.9
    )
    left = Remainder({axis: AxisRemainder(rms, 0.0, 0.5, 0.1, 1e-9, 0.1, True, 0.1)}, "")
    doubts = Doubts(more_than_waves=more_than_waves(Findings([waves]), left, Model()))
    assert confidence_of(waves, Model(), doubts).own == pytest.approx(own)
    other = replace(waves, id="X_u", values={"delta_X_u": 1.0})
    assert more_than_waves(Findings([other]), left, Model()) == {}
    noise = Remainder({axis: replace(left.axes[axis], significant=False)}, "")
    assert more_than_waves(Findings([waves]), noise, Model()) == {}


@pytest.mark.parametrize(
    ("ids", "sure"),
    [
        (("N_|r|r", "N_r"), ()),  # of a cubic damping too much by its square and too little by its line
        (("N_v", "N_|v|v", "N_ur"), ()),  # of a lift by u|v|; another one on the axis is no surer
        (("N_r", "N_uv"), ("N_r", "N_uv")),
        (("N_r", "Y_r"), ("N_r", "Y_r")),
        (("N_r", "N_|r|r", "Y_ur", "loss_yaw"), ("Y_ur", "loss_yaw")),
        (("N_|r|r",), ("N_|r|r",)),
    ],
)
def test_laws_of_one_family_on_an_axis_make_up_another_shape(ids, sure):
    start = Model()
    made = [Finding(i, {}, {}, 0.99, [], 0.9, 0.9, together=0.99) for i in ids]
    found = with_confidence(Findings(made, model=start), start, Doubts()).effects
    assert [f.confidence for f in found] == [0.99 if i in sure else 0.5 for i in ids]
    assert all(("another shape" in f.doubt) != (f.id in sure) for f in found)


@pytest.mark.parametrize(
    ("values", "parts"),
    [
        ({"loss_bow": 0.2, "bow_speed_loss": 0.3}, 2),  # a thruster that loses force in a third way
        ({"loss_surge": 0.1, "loss_bow": 0.2}, 0),
        ({"loss_sway": 0.1, "loss_yaw": 0.2}, 0),
        ({"loss_bow": 0.2, "lag": 0.4}, 0),  # what acts late has the same line, and is no part
        ({"loss_bow": 0.2, "N_r": -0.3}, 0),
        ({"loss_bow": 0.2}, 0),
    ],
)
def test_changes_of_actuators_on_one_line_make_up_another_force(values, parts):
    start = Model()
    windows = weak_windows(smoothed(sail(96.0)[0]))
    made = [Finding(i, {i: x}, {}, 0.99, [], 0.9, 0.9, together=0.99) for i, x in values.items()]
    of = Findings(made, model=start.plus(values))
    on_line = on_one_line(of, start, [windows])
    assert len(on_line) == parts
    found = with_confidence(of, start, Doubts(on_one_line=on_line)).effects
    assert [f.confidence for f in found] == [0.5 if f.id in on_line else 0.99 for f in made]
    assert all(("on the same line" in f.doubt) == (f.id in on_line) for f in found)


@pytest.mark.parametrize(("off", "parts"), [(0.0, 2), (0.21, 2), (0.23, 0), (1.5, 0)])
def test_forces_are_on_one_line_where_little_of_their_square_is_off_it(off, parts, monkeypatch):
    """A twentieth of the square is that of an angle of 0.2255 rad; the sign of a line says nothing."""
    lines = {"loss_sway": [0.0, 1.0, 0.0], "loss_bow": [0.0, -np.cos(off), np.sin(off)]}
    monkeypatch.setattr(law_in_parts, "_line", lambda f, *_: lines[f.id])
    made = [Finding(i, {i: 0.1}, {}, 0.99, [], 0.9, 0.9) for i in lines]
    assert len(on_one_line(Findings(made, model=Model()), Model(), [])) == parts


@pytest.mark.parametrize(("own", "sure"), [(0.5, False), (0.99, True)])
def test_what_an_unsure_finding_cannot_be_discriminated_from_is_not_sure(own, sure):
    """Of a thrust curve that may as well be a drag, and the drag beside it, neither is known."""
    start = Model()
    made = [
        Finding("thrust_curve", {}, {}, own, ["X_uuu"], 0.9, 0.9, together=0.99),
        Finding("X_uuu", {}, {}, 0.93, [], 0.9, 0.9, together=0.93),
    ]
    found = with_confidence(Findings(made, model=start), start, Doubts()).effects
    assert [f.confidence for f in found] == [own, 0.93 if sure else 0.5]
    assert bool(found[1].doubt) != sure


def test_a_law_beside_a_mere_possibility_of_its_family_stays_sure():
    start = Model()
    made = [Finding(i, {}, {}, c, [], 0.9, 0.9, together=c) for i, c in (("N_|r|r", 0.99), ("N_r", 0.3))]
    found = with_confidence(Findings(made, model=start), start, Doubts()).effects
    assert [f.confidence for f in found] == [0.99, 0.3]


@pytest.mark.parametrize(
    ("other", "had", "sure"),
    [(0.99, ["lag"], True), (0.3, ["lag"], False), (0.3, [], True), (None, ["lag"], False)],
)
def test_an_effect_that_took_the_place_of_another_rests_on_the_other_findings(other, had, sure):
    """One that is not sure, or is not left, is none to rest on: the first may be the cause."""
    start = Model()
    made = [Finding("mass", {}, {}, 0.99, [], 0.9, 0.9, together=0.99, instead_of=had, beside=["N_r"])]
    made += [Finding("N_r", {}, {}, other, [], 0.9, 0.9, together=other)] if other else []
    made += [Finding("lag", {}, {}, 0.3, [], 0.1, 0.1, together=0.3)]  # found later
    first, *_ = with_confidence(Findings(made, model=start), start, Doubts()).effects
    assert (first.confidence, first.together) == ((0.99, 0.99) if sure else (0.5, 0.5))
    assert first.alike == ([] if sure else had)
    assert bool(first.doubt) != sure


def test_a_law_that_gives_way_is_another_cause_and_a_free_curve_is_none():
    old, new = (AcceptedEffect(i, (), {}, {}, 1.0) for i in ("lag", "mass"))
    ship, curve = Model().ship, AcceptedEffect("curve_X(u)", (), {}, {}, 1.0)
    assert ship.effects[curve.id].search.smooth
    taken = taken_over(new, old, ship)
    assert (taken.id, taken.instead_of) == ("mass", ("lag",))
    assert taken_over(new, curve, ship).instead_of == ()
    assert taken_over(AcceptedEffect("N_r", (), {}, {}, 1.0), taken, ship).instead_of == ("lag", "mass")
    assert taken_over(old, taken, ship).instead_of == ("mass",)


@pytest.mark.parametrize(
    ("ship", "law", "moved", "sure"),
    [
        ("cse1", "N_r", {"N_absr_r": 4.8}, False),
        ("cse1", "N_r", {"N_absr_r": 2.0}, True),
        ("cse1", "N_r", {"X_absu_u": 4.8}, True),
        ("cse1", "N_r", {"m": 9.0}, True),
        ("kvlcc2", "yaw_by_yaw", {"Y_v_prime": 4.8, "Y_vvv_prime": -4.8}, False),  # one law of two
        ("kvlcc2", "yaw_by_yaw", {"Y_v_prime": 4.8, "Y_vvv_prime": -2.0}, True),
    ],
)
def test_a_law_beside_a_coefficient_of_its_family_far_from_its_prior_is_in_parts(ship, law, moved, sure):
    """More drag by the cube, and hardly any by the square, are a law of a higher power as well."""
    start = Model(ship=ship_with((), ship))
    values = dict.fromkeys(start.ship.effects[law].coefficients, -1.0)
    made = [Finding(law, values, {}, 0.99, [], 0.9, 0.9, together=0.99)]
    (f,) = with_confidence(Findings(made, model=start, moved=moved), start, Doubts()).effects
    assert f.confidence == (0.99 if sure else 0.5)
    assert ("law of another shape" in f.doubt) != sure


def test_a_coefficient_is_no_second_part_of_its_own_change():
    start = Model()
    made = [Finding("N_r", {"delta_N_r": -1.0}, {}, 0.99, [], 0.9, 0.9, together=0.99)]
    (f,) = with_confidence(Findings(made, model=start, moved={"N_r": 5.0}), start, Doubts()).effects
    assert f.confidence == 0.99


@pytest.mark.parametrize(("own", "sure"), [(0.9, True), (0.01, False), (0.0, False), (None, True)])
def test_an_effect_without_which_all_else_explains_as_much_is_even_odds(own, sure):
    """By shares of the first error; a method that cannot fit without it says nothing."""
    found, start = stated(0.99, 0.99), Model()
    doubts = Doubts(replaceable=replaceable(found, [0.9], [own], 0.5))
    (f,) = with_confidence(found, start, doubts).effects
    assert f.confidence == (0.99 if sure else 0.5)
    assert ("as much without it" in f.doubt) != sure
    # Coefficients explain most of the 90 %; without the effect more than twice as much is left.
    assert not replaceable(found, [0.9], [0.01], 0.009)
    assert replaceable(found, [0.9], [0.01], 0.011)


@pytest.mark.parametrize("value", ["delta_X_absu_u", "m"])
def test_an_effect_of_which_two_fits_differ_is_even_odds(value):
    """A coefficient beside it may be the better one of another shape; its own value may not."""
    start = Model()
    made = [Finding("X_|u|u", {"delta_X_absu_u": -1.0}, {}, 0.99, [], 0.5, 0.5, together=0.99)]
    found, apart = Findings(made, model=start), {value: (-1.0, -2.0)}
    push = ForceDisturbance(np.zeros(3), np.zeros(3))
    fit = RefitOutcome(found, JointPosterior.nothing(), Unrecorded(push, apart, []))
    (f,) = with_confidence(found, start, Doubts(differing=differing(fit))).effects
    assert f.confidence == f.together == (0.99 if value == "m" else 0.5)
    assert ("accelerations" in f.doubt) == (value != "m")


def filters_of(*values):
    made = [Finding(i, {i: T}, {}, 0.99, [], 0.5, 0.5, together=0.99) for i, T in values]
    return Findings(made, model=Model(measurement=dict(values)))


@pytest.mark.parametrize(("noise", "faster"), [(0.0, set()), (0.05, {"heading_tracker"})])
def test_a_tracking_filter_faster_than_the_smoothing_is_even_odds(noise, faster):
    """Of a noise of 3 degrees the smoothing of the heading ends at 1 rad/s; the filter's corner is 2."""
    run = sail(60.0, 0.1, {})[0]
    pose = np.array(run.pose)
    pose[:, 2] += noise * np.random.default_rng(3).standard_normal(len(pose))
    windows = [weak_windows(smoothed(replace(run, pose=pose)))]
    found = filters_of(("heading_tracker", 0.5), ("position_tracker", 1.5), ("heading_lag", 0.5))
    assert faster_than_smoothing(found, Model(), windows) == faster
    slow = filters_of(("heading_tracker", 3.0))
    assert not faster_than_smoothing(slow, Model(), windows)
    assert not faster_than_smoothing(slow, slow.model, windows)
    doubts = Doubts(smoothed=faster)
    sure = [f.id for f in with_confidence(found, Model(), doubts).effects if f.confidence > 0.5]
    assert {f.id for f in found.effects} - {*sure} == faster


@pytest.mark.parametrize("validate", [False, True])
def test_waves_are_in_no_model_and_have_no_share_of_the_squared_error(validate):
    """Their share is of the power; to fit all else without them says nothing of them."""
    start, run = Model(), weak_windows(smoothed(sail(60.0, 0.1, {})[0]))
    waves = Finding("waves", {"wave_peak": 0.6}, {}, 0.95, [], 0.8, 0.8, together=0.95, model=start)
    found = Findings([waves], model=start, refit=lambda ids: pytest.fail("nothing to fit"))
    explained = judging.shares(found, start, [run] if validate else [])
    unique = judging.unique_shares(found, start, [run], [])
    assert (explained, unique) == ([0.8], [None])
    assert not replaceable(found, explained, unique, 0.2)


@pytest.fixture(scope="module")
def searched():
    """A session with a run of a ship with drag, and what forward selection finds in it."""
    runs = diagnosis.gather([sail(64.0, 0.1, {"delta_X_u": -2.0})[0]])
    session = begin(runs)
    return session, session.method.fit(runs, session.start, session.prior, silent, 0)


@pytest.mark.slow
def test_the_judgement_is_sure_only_of_what_nothing_else_explains(searched, monkeypatch):
    """The same evidence of the same run, once as if coefficients made up for the effect."""
    session, found = searched
    data, region = session.data(found.sigma), OPERATING

    def seen():
        decided, _ = judge(found, data, session.known, session.harms, region, True, None, silent)
        return decided.learned.effects

    (sure,) = seen()
    monkeypatch.setattr(judging, "unique_shares", lambda learned, *_: [0.0] * len(learned.effects))
    (unsure,) = seen()
    assert (sure.id, unsure.id) == ("X_u", "X_u")
    assert sure.confidence > 0.8
    assert unsure.confidence == 0.5


@pytest.mark.slow
def test_what_takes_the_place_of_effects_keeps_the_candidates_of_the_search(searched, monkeypatch):
    """Calibrated coefficients, or the initial model where each effect may be none and predicts no better."""
    session, found = searched
    data, calibration = session.data(found.sigma), session.calibration
    for name, value in (("any_sure", False), ("needless", True), ("predicts_worse", False)):
        monkeypatch.setattr(judging, name, lambda *_, value=value: value)

    def seen(other, than_effects=None):
        """With a calibration that takes the place of the initial model, and with one of the effects."""
        monkeypatch.setattr(
            judging,
            "better_calibration",
            lambda _, now, *more: other if now is session.start else than_effects,
        )
        decided, _ = judge(
            found, data, session.known, session.harms, OPERATING, True, calibration, silent
        )
        assert not decided.learned.effects
        assert [f.id for f in decided.dropped] == ["X_u"]
        assert decided.learned.ranking == found.ranking != []
        return decided

    coefficients, nothing = seen(None, calibration), seen(None)
    assert (coefficients.refitted, nothing.refitted) == (True, False)
    assert (coefficients.changed, nothing.changed) == (True, False)
    assert nothing.learned.model == session.start
    in_place_of_nothing = seen(calibration)
    assert in_place_of_nothing.refitted
    assert in_place_of_nothing.learned.model is coefficients.learned.model


@pytest.mark.parametrize("calibrates", [True, False])
def test_coefficients_are_asked_for_where_the_model_has_them(monkeypatch, calibrates):
    start, asked = Model(), []
    runs = [voyages(**SHORT, ship={})[0]]
    found = Findings([], model=start, sigma=np.array([0.1, 0.1, 0.05]))
    data = ValidationData(runs, [], start, found.sigma)
    known = NominalPrior.of(start, None)
    monkeypatch.setattr(judging, "_coefficients_alone", lambda *given: asked.append(given))
    decided, gain = judge(found, data, known, criterion(), OPERATING, calibrates, None, silent)
    assert len(asked) == calibrates
    assert (decided.learned.effects, decided.learned.model) == ([], start)
    assert (gain is None) != calibrates


@pytest.mark.parametrize(("second", "spoilt"), [({"delta_X_u": -3.0}, False), ({}, True)])
def test_effects_that_predict_one_of_their_runs_worse_spoil_it(second, spoilt):
    """More drag that acts in the first run alone, as by a failure that is paid for with coefficients."""
    start, change = Model(), {"delta_X_u": -3.0}
    runs = [voyages(**SHORT, ship=change)[0], voyages(**SHORT, ship=second)[1]]
    f = Finding("X_u", change, {}, 0.1, [], 0.5, 0.5)
    found = Findings([f], model=start.plus(change), sigma=np.array([0.1, 0.1, 0.05]))
    data = ValidationData(runs, [], start, found.sigma)
    assert worsens_training_runs(found, data) == spoilt
    assert not worsens_training_runs(replace(found, effects=[]), data), (
        "without an effect nothing is paid for"
    )


@pytest.mark.parametrize(("kilograms", "is_finding"), [(100.0, False), (96.0, False), (90.0, True)])
def test_value_at_the_limit_of_its_range_is_no_finding(kilograms, is_finding):
    start = Model()
    assert start.declared("mass").range.max == 100.0
    f = Finding("mass", {"mass": kilograms}, {}, 0.99, [], 0.9, 0.9, together=0.99)
    seen = confidence_of(f, start)
    assert (seen.own == 0.99) == is_finding
    assert ("limit of the search" in seen.doubt) != is_finding


@pytest.mark.parametrize(
    ("effect", "value", "text"),
    [
        ("mass", -9.8, "mass = -9.8 kg is at the lower limit of the search, -10 kg (a ship of 4.99 kg: weigh it)"),
        ("mass", 99.0, "mass = 99 kg is at the upper limit of the search, 100 kg (a ship of 113.8 kg: weigh it)"),
        (
            "loss_surge",
            0.98,
            "loss_surge = 0.98 is at the upper limit of the search, 1 (more would be a force against the command: "
            "check its sign in the log)",
        ),
        ("loss_bow", 1.0, "loss_bow = 1 is at the upper limit of the search, 1 (more would be a force against the "
         "command: check its sign in the log)"),
        ("added_mass_Y", -9.8, "added_mass_Y = -9.8 kg is at the lower limit of the search, -10 kg"),
        ("mass", 90.0, ""),
    ],
)  # fmt: skip
def test_a_value_at_its_limit_is_reported_with_the_limit_and_what_to_measure(effect, value, text):
    assert " and ".join(map(str, at_limit(Model(), effect, {effect: value}))) == text


@pytest.mark.parametrize(("interval", "sure"), [((-0.01, 0.05), False), ((0.02, 0.04), True)])
def test_a_value_that_may_be_nothing_is_no_sure_finding(interval, sure):
    f = Finding("lag", {"lag": 0.02}, {"lag": interval}, 0.94, [], 0.9, 0.9, together=0.94)
    seen = confidence_of(f, Model())
    assert seen.own == (0.94 if sure else 0.5)
    assert ("include zero" in seen.doubt) != sure


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6])
def test_of_many_candidates_one_is_far_from_zero_by_chance(unit):
    """The less so the further, whatever their unit is."""
    start = Model()
    count = len(start.ship.candidates)

    def most(*squares):
        names = ("attack_point_dx", "attack_point_dy")[: len(squares)]
        ends = [(unit * (z - 1.96), unit * (z + 1.96)) for z in map(np.sqrt, squares)]
        values = dict.fromkeys(names, unit)
        intervals = dict(zip(names, ends, strict=True))
        f = Finding("attack_point", values, intervals, 0.99, [], 0.9, 0.9, together=0.99)
        return most_by_intervals(f, start), confidence_of(f, start)

    for z in (2.1, 3.0, 3.5, 4.0, 5.0):
        bound, seen = most(z**2)
        assert bound == pytest.approx(max(0.5, 1.0 / (1.0 + count * np.exp(-0.5 * z**2))), rel=2e-3)
        assert seen.own == pytest.approx(min(0.99, bound))
        assert ("by chance" in seen.doubt) == (bound < 0.99)
        assert most(0.5 * z**2, 0.5 * z**2)[0] == pytest.approx(bound, rel=1e-6), "both count"
    assert most(100.0)[0] == pytest.approx(1.0)
    unknown = Finding("lag", {"lag": 0.1}, {}, 0.99, [], 0.9, 0.9, together=0.99)
    assert most_by_intervals(unknown, start) == 1.0


@pytest.mark.parametrize(("second", "sure"), [((-0.02, 0.005), False), ((0.02, 0.04), True)])
def test_an_effect_of_two_values_that_may_both_be_nothing_is_no_sure_finding(second, sure):
    values = {"attack_point_dx": -0.04, "attack_point_dy": 0.02}
    intervals = {"attack_point_dx": (-0.16, 0.08), "attack_point_dy": second}
    f = Finding("attack_point", values, intervals, 0.93, [], 0.9, 0.9, together=0.93)
    seen = confidence_of(f, Model())
    assert seen.own == (0.93 if sure else 0.5)
    assert ("include zero" in seen.doubt) != sure


@pytest.mark.parametrize(
    ("name", "offset", "sure"),
    [("otter", -0.2, False), ("otter", 0.2, True), ("otter", -2.0, True), ("cse1", -0.2, True)],
)
def test_pose_younger_than_its_stamp_is_not_told_from_lags_that_are_too_long(name, offset, sure):
    start = Model(ship=ship_with((), name))
    f = Finding("clock_offset", {"clock_offset": offset}, {}, 0.99, [], 0.9, 0.9, together=0.99)
    seen = confidence_of(f, start)
    assert seen.own == (0.99 if sure else 0.5)
    assert ("the same effect" in seen.doubt) != sure


@pytest.mark.parametrize(
    ("doubts", "own", "of_set"),
    [
        (Doubts(), 0.94, 0.96),
        (Doubts(residual="X"), 0.5, 0.5),
        (Doubts(residual="N"), 0.94, 0.96),
        (Doubts(replaceable={"X_u"}, without_gain={"X_u"}), 0.5, 0.5),
        (Doubts(of_data="samples"), 0.5, 0.5),
    ],
)
def test_an_alternative_is_in_neither_the_effect_nor_its_set(doubts, own, of_set):
    f = Finding("X_u", {"delta_X_u": -2.0}, {}, 0.94, [], 0.9, 0.9, together=0.96)
    seen = confidence_of(f, Model(), doubts)
    assert (seen.own, seen.of_set) == pytest.approx((own, of_set))
    assert seen.is_finding
    assert bool(seen.doubt) == (own < 0.94)
    one_of_two = replace(f, confidence=0.49)
    assert bool(confidence_of(one_of_two, Model(), doubts).doubt) == (own < 0.94), "of its set"


@pytest.mark.parametrize(("left", "nearest"), [(0.1, 0.09), (0.1, 0.005), (0.2, 0.3)])
def test_beside_a_residual_an_effect_is_as_sure_as_its_nearest_rival_is_far(left, nearest):
    seen = EffectEvidence(1.0, left, 0.0, nearest, left)
    f = Finding("X_u", {"delta_X_u": -2.0}, {}, np.nan, [], 0.9, 0.9, evidence=seen, set_evidence=seen)
    alone = confidence_of(f, Model()).own
    beside = confidence_of(f, Model(), Doubts(residual="X"))
    assert beside.own == pytest.approx(min(alone, max(1.0 / (1.0 + left**2 / nearest), 0.5)))
    assert bool(beside.doubt) == (beside.own < alone)
    assert confidence_of(f, Model(), Doubts(residual="X", without_gain={"X_u"})).own == 0.5


@pytest.mark.quick
def test_axis_that_is_never_commanded_has_the_force_of_the_ships_inertia():
    (w, *_) = voyages(**SHORT)
    model = Model()
    run = replace(w.run, tau_cmd=w.run.tau_cmd * [1.0, 0.0, 1.0])
    idle = replace(w, smoothed=replace(w.smoothed, track=replace(w.smoothed.track, run=run)))
    force, with_sway = commanded([idle], model), commanded([w], model)
    assert np.array_equal(force[:, [0, 2]], with_sway[:, [0, 2]])
    u, v, r = np.nan_to_num(w.smoothed.nu).T
    M = model.mass
    Y = M[1, 1] * np.gradient(v, w.run.time) + M[0, 0] * u * r + M[1, 2] * np.gradient(r, w.run.time)
    assert force[:, 1] == pytest.approx(w.smooth @ Y, abs=0.05 * np.abs(Y).max())


def test_worse_is_more_than_two_paired_standard_errors():
    rng = np.random.default_rng(0)
    loss, change = rng.exponential(100.0, 64), rng.standard_normal(64)
    change -= change.mean()
    assert not worse(loss + change + 0.1, loss)
    assert worse(loss + change + 0.5, loss)
    assert not worse(loss + change - 5.0, loss)


def test_one_block_with_most_of_the_loss_hides_no_gain_in_the_others():
    before = np.append(np.ones(30), 1000.0)
    assert not worse(before, np.zeros(31)), "one block decides the standard error"
    assert lower_throughout(np.zeros(31), before)
    assert not lower_throughout(before, np.zeros(31))
    assert not lower_throughout(np.zeros(31), np.append(-np.ones(30), 1000.0)), "in one block alone"
    assert not lower_throughout(np.append(np.zeros(30), 1000.0), np.append(np.ones(30), 0.0))
    assert not lower_throughout(before, before)
    assert lower_throughout(np.zeros(31), 1e-3 * before), "however small the unit"


def test_a_gain_by_chance_is_seldom_shown():
    losses = np.random.default_rng(4).standard_t(2.5, (2, 600, 40))
    shown = [lower_throughout(a, b) for a, b in zip(*losses, strict=True)]
    assert 0.01 < np.mean(shown) < 0.06, "2.3 % by the mean, and as many by ranks, mostly the same"


def test_candidates_that_are_the_same_share_their_probability():
    blocks = np.random.default_rng(0).exponential(10.0, 20)
    one = Scored(0, 0, blocks, blocks, 0.0, 5.0)
    far = replace(one, candidate=2, blocks=blocks + 10.0)
    shares = first_share([one, replace(one, candidate=1), far], np.random.default_rng(0))
    assert shares == pytest.approx([0.5, 0.5, 0.0], abs=1e-6)


def test_correlation_is_that_of_an_autoregression(lap):
    """tau of x_k = a x_(k-1) + e is (1 + a) / (1 - a)."""
    (w,) = lap
    rng, a = np.random.default_rng(0), 0.7
    found = []
    for _ in range(5):
        x = rng.standard_normal((20 * w.middle.size, 3))
        for k in range(1, len(x)):
            x[k] += a * x[k - 1]
        found.append(correlated_windows([w] * 20, x))
    assert np.mean(found) == pytest.approx((1 + a) / (1 - a), rel=0.25)


@pytest.mark.parametrize(("own", "finding"), [(0.32, False), (0.5, True), (0.9, True), (np.nan, True)])
def test_a_method_that_tells_no_set_has_findings_by_their_own_confidence(own, finding):
    """Waves of 32 % were one, as if their method gave no confidence."""
    waves = Finding("waves", {"wave_peak": 1.0}, {}, own, [], 0.9, 0.9)
    assert confidence_of(waves, Model()).is_finding == finding


@pytest.mark.parametrize(
    ("ship", "small", "change", "confidence", "mends"),
    [
        ("otter", "N_|r|r", 1200.0, 0.44, False),  # known to 426.5: three deviations are 1279.5
        ("otter", "N_|r|r", 1300.0, 0.44, True),
        ("otter", "N_|r|r", 1200.0, 0.5, True),  # likelier than any change of the coefficient
        ("otter", "lag_port", 1.4, 0.44, False),  # 1 s, known to 0.5 s
        ("otter", "lag_port", 1.6, 0.44, True),
        ("otter", "added_mass_N", 0.1, 0.44, True),
        ("kvlcc2", "wake_propeller", 0.11, 0.44, False),  # known to 0.04: a coefficient of the law
        ("kvlcc2", "wake_propeller", 0.13, 0.44, True),
    ],
)
def test_what_stated_deviations_of_a_coefficient_allow_mends_nothing(
    ship, small, change, confidence, mends
):
    """A coefficient that differs as its file states is no part of another force."""
    start = Model(ship=ship_with((), ship))
    (name,) = start.ship.effects[small].coefficients
    made = [
        Finding("loss_yaw", {"loss_yaw": 0.3}, {"loss_yaw": (0.2, 0.4)}, 0.99, [], 0.9, 0.9),
        Finding(small, {name: change}, {name: (0.9 * change, 1.1 * change)}, 0.99, [], 0.0, 0.0),
    ]
    falls, squares = np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 0.01]]), np.array([[1.0] * 3, [0.1] * 3])
    alone = [Confidence(0.99, 0.99), Confidence(confidence, confidence)]
    found = Findings(made, model=start.plus({name: change}))
    assert ("loss_yaw" in shape_corrected(found, start, falls, squares, alone)) == mends
    if small == "N_|r|r":  # together with what the model's coefficient has already
        moved = replace(found, model=found.model.plus({"N_absr_r": change}))
        assert "loss_yaw" in shape_corrected(moved, start, falls, squares, alone)


@pytest.mark.parametrize(
    ("falls", "doubted"),
    [
        (
            {"bias_rudder": (0, 0.7, 0.9), "inflow_rudder": (0, 0, 0.03)},
            {"bias_rudder": 0.1, "inflow_rudder": 1.0},
        ),
        ({"bias_rudder": (0, 0.7, 0.9), "inflow_rudder": (0, 0, 0.06)}, {}),  # two causes
        ({"bias_rudder": (0, 0.04, 0.04), "inflow_rudder": (0, 0.04, 0.04)}, {}),
        ({"X_u": (0.9, 0, 0), "N_r": (0, 0, 0.9)}, {}),
        ({"mass": (0, 0.5, 0.5), "X_u": (0.9, 0, 0)}, {}),  # each explains an axis of its own
        ({"mass": (0.9, 0.5, 0.5), "X_u": (0.04, 0, 0)}, {"mass": 0.1, "X_u": 1.0}),
        ({"X_u": (0.9, 0, 0), "heading_offset": (0.03, 0, 0.01)}, {"heading_offset": 1.0}),
        ({"heading_offset": (0.9, 0.5, 0), "X_u": (0.03, 0, 0)}, {}),
        (
            {"position_latency": (0, 0.5, 0.9), "marker_offset": (0, 0, 0.03)},
            {"position_latency": 0.1, "marker_offset": 1.0},
        ),
    ],
)
def test_a_far_smaller_finding_on_the_same_axis_may_mend_the_shape_of_the_larger(falls, doubted):
    """A moment by u |u| was a biased rudder with 0.99, and a rudder in a stream that is askew beside it."""
    start = Model(ship=ship_with((), "kvlcc2"))
    values = {i: dict.fromkeys(start.ship.effects[i].coefficients, 0.1) for i in falls}
    made = [
        Finding(i, v, dict.fromkeys(v, (0.08, 0.12)), 0.99, [], 0.9, 0.9, together=0.99)
        for i, v in values.items()
    ]
    by_axis, sure = np.array([*falls.values()], float), [Confidence(0.99, 0.99)] * len(made)
    squares = np.array([[10.0, 10.0, 10.0], [9.0, 0.5, 1.0]])[:, :: -1 if "mass" in falls else 1]
    assert shape_corrected(Findings(made), start, by_axis, squares, sure) == doubted
    # Of some 50 candidates one is 2.8 standard deviations from zero by chance, or nearer.
    for z, mends in ((1.0, False), (2.5, False), (3.5, True)):
        half = {f.id: Z95 * 0.1 * np.sqrt(len(f.values)) / z for f in made}
        near = [
            replace(f, ci95=dict.fromkeys(f.values, (0.1 - half[f.id], 0.1 + half[f.id]))) for f in made
        ]
        assert shape_corrected(Findings(near), start, by_axis, squares, sure) == (
            doubted if mends else {}
        )
    possible = [Confidence(0.3, 0.3)] * len(made)
    assert not shape_corrected(Findings(made), start, by_axis, squares, possible)
    # On an axis without a force of the larger one, coefficients explain what that seems to.
    apart = squares.copy()
    apart[0] = 0.0
    assert not shape_corrected(Findings(made), start, by_axis, apart, sure)
    # A possibility mends a finding as well, and has no confidence to lose.
    first = {i: share for i, share in doubted.items() if share < 1.0}
    assert shape_corrected(Findings(made), start, by_axis, squares, [sure[0], possible[1]]) == first
    seen = confidence_of(made[0], start, Doubts(shape_corrected=doubted))
    assert seen.own == (0.5 if made[0].id in doubted else 0.99)
    # With evidence: what a smaller one explains counts as a residual.
    for nearest, odds in ((0.9, 1.0 / (1.0 + 0.1 / 0.9)), (0.05, 0.5)):
        known = EffectEvidence(0.999, 0.0, 0.0, nearest, 0.0)
        seen = confidence_of(
            replace(made[0], evidence=known, set_evidence=known), start, Doubts(shape_corrected=doubted)
        )
        assert seen.own == pytest.approx(odds if doubted.get(made[0].id) == 0.1 else 0.99, abs=0.002)


@pytest.mark.parametrize(
    ("effect", "at_rest", "confidence"),
    [
        ("curve_X(u)", (0.007, 0.0005), 0.5),
        ("curve_X(u)", (-0.007, 0.0005), 0.5),
        ("curve_X(u)", (0.001, 0.0005), 0.99),  # two standard deviations
        ("curve_vsp_x(c)", (0.007, 0.0005), 0.99),  # an actuator may have a force at no command
    ],
)
def test_a_curve_of_the_hull_with_a_force_at_rest_may_be_a_constant_force_and_a_drag(
    effect, at_rest, confidence
):
    """With |u|u and a small constant force hidden, a curve over the surge speed had 0.99."""
    e = Model().ship.effects[effect]
    value, std = at_rest
    # A curve that is not zero but in its middle, and is known everywhere.
    values = {p.name: 0.05 for p in e.parameters if p.name not in e.settings}
    ci95 = dict.fromkeys(values, (0.04, 0.06))
    middle = [*values][len(values) // 2]
    values[middle], ci95[middle] = value, (value - Z95 * std, value + Z95 * std)
    made = Finding(effect, values, ci95, 0.99, [], 0.9, 0.9, together=0.99)
    seen = confidence_of(made, Model())
    assert seen.own == confidence
    assert ("zero speed" in seen.doubt) == (confidence < 0.99)
    # Nodes without data are no part of a finding.
    del values[middle], ci95[middle]
    assert confidence_of(replace(made, values=values, ci95=ci95), Model()).own == 0.99


@pytest.mark.parametrize("listed", [0.02, 0.6, 0.999])
def test_an_effect_is_no_surer_than_beside_a_modulated_force_which_is_named(listed):
    """A bow thruster lost force with the shaft speed: a curve over its command had 0.976."""
    known = EffectEvidence(0.999, 0.0, 0.0, 0.5, 0.0, listed)
    made = Finding("loss_bow", {}, {}, 0.99, [], 0.9, 0.9, evidence=known, set_evidence=known)
    seen = confidence_of(replace(made, modulation="the force of the bow in proportion to n"), Model())
    assert seen.own == pytest.approx(min(listed, 0.99), abs=0.002)
    named = (
        "the force of the bow in proportion to n, which is not among the candidates, explains as much"
    )
    assert seen.doubt == (named if listed < 0.99 else "")
    assert confidence_of(made, Model()).own == pytest.approx(0.99, abs=0.002)


@pytest.mark.parametrize(
    ("explained", "believed", "doubted"),
    [
        ((0.94, 0.02), (False, True), {"loss_surge": 0.3}),
        ((0.94, 0.02), (True, True), {}),
        ((0.94, 0.06), (False, True), {}),  # not next to nothing
        ((0.01, 0.02), (False, True), {}),  # more than what is not believed
    ],
)
def test_a_small_finding_is_no_surer_than_what_explains_most(explained, believed, doubted):
    """Of a towed body `Y_uv` took the most with no confidence, and `loss_surge` the rest with 0.98.

    Both have to be true: the second one's probability is that of the first one times its own.
    """
    made = [Finding(i, {}, {}, 0.99, [], 0.9, 0.9) for i in ("Y_uv", "loss_surge")]
    sure = [Confidence(0.99, 0.99) if each else Confidence(0.01, 0.3) for each in believed]
    assert next_to_possibility(Findings(made), explained, sure) == doubted
    seen = confidence_of(made[1], Model(), Doubts(next_to_possibility=doubted))
    assert seen.own == pytest.approx(0.99 * 0.3 if doubted else 0.99)
    assert seen.is_finding == (not doubted)
    assert bool(seen.doubt) == bool(doubted)
    of_a_run = replace(made[1], id="bow_failure", values={"bow_failure_time@a": 9.0})
    assert of_a_run.of_runs
    assert not next_to_possibility(Findings([made[0], of_a_run]), explained, sure)


@pytest.mark.parametrize(("other", "doubted"), [(1.1, True), (0.5, False), (-1.1, False)])
def test_a_lag_of_one_propeller_is_in_doubt_if_the_other_one_has_it_too(other, doubted):
    """Both propellers of the Otter were slower; one was found with 0.99, the other a coefficient."""
    start = Model(ship=ship_with((), "otter"))
    values = {"lag_port": 1.2}
    model = start.plus(values | {"lag_starboard": other})
    made = [Finding("lag_port", values, {"lag_port": (1.1, 1.3)}, 0.99, [], 0.9, 0.9, together=0.99)]
    found = Findings(made, model=model, moved={"lag_starboard": other / 0.5})
    assert of_several(found, start) == ({"lag_port"} if doubted else set())
    assert of_several(replace(found, moved={}), start) == set()
    seen = confidence_of(made[0], start, Doubts(of_several=of_several(found, start)))
    assert seen.own == (0.5 if doubted else 0.99)


def test_the_error_of_an_axis_falls_with_the_finding_that_acts_there():
    runs, start = voyages(**SHORT, ship={"delta_X_u": -3.0})[:1], Model()
    model = start.plus({"delta_X_u": -3.0})
    found = Findings(
        [finding(start, delta_X_u=-3.0), replace(finding(start, delta_N_uv=1e-9), model=model)]
    )
    X, Y, N = falls_by_axis(found, start, runs).T
    assert X[0] > 0.9
    assert abs(X[1]) < 1e-6
    assert max(*abs(Y), *abs(N)) < 0.1


def test_beside_coefficients_beyond_their_priors_nothing_is_sure():
    made, start = Finding("X_u", {"delta_X_u": -1.0}, {}, 0.99, [], 0.9, 0.9, together=0.99), Model()
    near, far = (Findings([made], moved={"N_r": z}) for z in (-2.9, 3.1))
    for found, own in ((near, 0.99), (far, 0.5)):
        seen = confidence_of(made, start, Doubts(implausible=not found.plausible))
        assert seen.own == own
        assert ("beyond their priors" in seen.doubt) == (own < 0.99)
