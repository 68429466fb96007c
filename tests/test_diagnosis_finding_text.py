"""What is said of a finding: every effect has its sentence, every pair its advice."""

import re
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from support.cse1 import EFFECTS

from diagnosis.predictors import Model
from diagnosis.report.finding_text import (
    advice,
    discriminating_run,
    equation,
    sentence,
    separation_note,
    unit,
)
from diagnosis.report.reported_effect import _sentence, of_whole_hull
from diagnosis.search.findings import Finding
from fmus.effects import Effect
from fmus.effects.families import UNKNOWN
from fmus.effects.text import Found


def values(effect, x):
    """Every parameter x; the ends of an interval after its start."""
    ends = {end: 2.0 * x for _, end in effect.search.intervals}
    return dict.fromkeys(effect.coefficients, x) | ends


@pytest.mark.parametrize("runs", [["a"], ["a", "b"], [*"abcd"], [*"abcde"]])
def test_what_holds_in_single_runs_is_said_of_each_where_there_are_several(runs):
    start, name = Model(), "bow_failure_time"
    times = {f"{name}@{run}": 20.0 + 5.0 * k for k, run in enumerate(runs)}
    f = Finding("bow_failure", times, {}, 0.9, (), 0.5, 0.5)
    d = SimpleNamespace(
        start=start, speeds=(0.1, 0.0, 0.0), comparison=SimpleNamespace(evaluations=runs),
        learned=SimpleNamespace(model=start),
    )  # fmt: skip
    each = {
        run: sentence(Found(EFFECTS[f.id], {name: times[f"{name}@{run}"]}, d.speeds)) for run in runs
    }
    stated = [f"Run {run}: {text}" for run, text in each.items()][:4]
    stated += ["diagnosis.json has 1 more."] if len(runs) > 4 else []
    said = " ".join(stated) if len(runs) > 1 else each["a"]
    assert f.of_runs == runs
    assert _sentence(d, f, times) == said


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_has_a_sentence_of_its_own_with_numbers(name):
    effect = EFFECTS[name]
    assert effect.wording.sentence is not None
    said = sentence(Found(effect, values(effect, 0.25)))
    assert said[0].isupper()
    assert said.endswith(".")
    assert "{" not in said
    if name != "waves":
        assert re.search(r"\d", said)


SIGNS = "mass centre_of_gravity added_mass_X loss_bow loss_surge attack_point earth_force body_bias current heading_offset X_u"


@pytest.mark.parametrize("name", [*SIGNS.split(), "marker_offset", "clock_offset", "Y_ur", "curve_X(u)"])
def test_the_other_sign_says_the_other(name):
    effect = EFFECTS[name]
    more, less = (sentence(Found(effect, values(effect, x))) for x in (0.25, -0.25))
    assert more != less


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("mass", {"mass": 3.1}, "The ship has 3.1 kg more mass than the model."),
        (
            "bow_failure",
            {"bow_failure_time": 118.0},
            "The bow thruster gives no force from t = 118 s on.",
        ),
        (
            "bow_outage",
            {"bow_outage_start_1": 40.0, "bow_outage_end_1": 48.0, "bow_outage_end_3": 15.5},
            "The bow thruster fails from 0 to 15.5 s and from 40 to 48 s.",
        ),
        ("vsp_outage", {}, "The propellers fail at no time."),
        ("loss_surge", {"loss_surge": 0.3}, "The thrusters lose 30 % of the commanded surge force."),
        ("current", {"V_n": 0.0, "V_e": 0.05}, "The water moves at 0.05 m/s towards 90°."),
        (
            "heading_offset",
            {"heading_offset": -0.0349066},
            "The heading is measured 2° to port of the true one.",
        ),
        ("delay", {"delay": 0.4}, "The thrusters act 0.4 s after they are commanded."),
        (
            "marker_offset",
            {"marker_offset_dx": 0.0, "marker_offset_dy": -0.333},
            "The position is measured 33.3 cm to port of the place in the model.",
        ),
    ],
)
def test_sentences(name, given, said):
    assert sentence(Found(EFFECTS[name], given)) == said


def test_force_of_a_damping_term_is_that_at_the_speeds_reached():
    said = sentence(Found(EFFECTS["X_|u|u"], {"delta_X_absu_u": -20.0}, (0.2, 0.0, 0.0)))
    assert said == "The ship has more surge drag than the model: 0.8 N more at 0.2 m/s."


@pytest.mark.parametrize(
    ("effect", "others", "said"),
    [
        ("X_uuu", {}, ""),
        ("X_uuu", {"X_absu_u": -20.0}, ""),
        ("X_uuu", {"X_absu_u": 30.0}, "differs by 0.4 N astern."),
        ("X_uuu", {"X_absu_u": 150.0}, "differs by 4.4 N ahead."),
        ("X_uuu", {"N_r": 5.0}, ""),
        ("mass", {"X_absu_u": 150.0}, ""),
    ],
)
def test_a_coefficient_whose_force_others_take_away_says_so(effect, others, said):
    """A law of one shape is a sum of two of others: the first alone is not what the ship has more."""
    values = {"delta_X_uuu": -200.0} if effect == "X_uuu" else {"mass": 1.0}
    start = Model()
    learned = start.plus(values).plus(others)
    stated = of_whole_hull(
        Finding(effect, values, {}, 0.9, [], 0.9, 0.9), start, learned, (0.2, 0.1, 0.1)
    )
    assert stated.endswith(said)
    assert bool(stated) is bool(said)


def test_of_a_finding_that_is_not_in_the_model_no_force_is_told():
    finding = Finding("X_uuu", {"delta_X_uuu": -200.0}, {}, 0.9, [], 0.9, 0.9)
    assert of_whole_hull(finding, Model(), Model(), (0.2, 0.1, 0.1)) == ""


def test_values_of_an_equation_are_written_out_with_their_sign():
    value, interval = np.float64(-2740.0), (np.float64(-5070.0), np.float64(-414.0))
    found = equation(EFFECTS["X_uuu"], {"delta_X_uuu": value}, {"delta_X_uuu": interval})
    assert found.endswith("= -2740 N.s3/m3 (-5070 to -414)")
    assert equation(EFFECTS["loss_surge"], {"loss_surge": 0.3}, {}).endswith("= 0.3")


def test_an_effect_of_a_user_says_what_it_says_of_itself():
    mine = Effect("mine", "force", "N", "A moment that I suspect.", "N = k", "k", "", "", True, (), None)
    assert (
        sentence(Found(mine, {}))
        == "The ship has an effect that the model lacks: A moment that I suspect."
    )
    assert mine.wording.family is UNKNOWN
    assert UNKNOWN.excite in discriminating_run(mine, EFFECTS["mass"])


@pytest.mark.parametrize("name", [e.id for e in EFFECTS.values() if e.search.by != "given"])
def test_equation_has_every_number_with_its_unit(name):
    effect = EFFECTS[name]
    given = dict.fromkeys(effect.coefficients, 0.25)
    text = equation(effect, given, dict.fromkeys(given, (0.125, 0.375)))
    assert effect.formula in text
    assert text.count("0.25") == len(given)
    for n in given:
        assert unit(effect, n) in text or unit(effect, n) == "1"
    if len(given) < 9:
        assert text.count("(0.125 to 0.375)") == len(given)


def test_every_effect_has_a_family_and_every_pair_an_advice():
    assert all(e.wording.family is not UNKNOWN for e in EFFECTS.values())
    for a, b in combinations(EFFECTS.values(), 2):
        assert discriminating_run(a, b)
        same_family = a.wording.family is b.wording.family
        assert discriminating_run(a, b) == discriminating_run(b, a) or not same_family


def test_what_tells_effects_apart_names_effects_and_families_that_there_are():
    families = {e.wording.family.name for e in EFFECTS.values()}
    for e in EFFECTS.values():
        assert set(e.wording.apart) <= set(EFFECTS)
        assert set(e.wording.family.apart) <= families


def test_known_pairs():
    def apart(a, b):
        return discriminating_run(EFFECTS[a], EFFECTS[b])

    assert "astern" in apart("X_u", "body_bias")
    assert "sync pulse" in apart("delay", "clock_offset")
    assert "turn on the spot" in apart("N_ur", "N_r")
    assert advice("X_u", [], EFFECTS) == separation_note("X_u", []) == ""
    said = advice("lag", ["delay", "clock_offset"], EFFECTS)
    assert said.count("To discriminate lag from") == 2
    assert separation_note("lag", ["delay", "mass", "X_u"]).endswith("from delay, mass or X_u.")


def test_of_many_others_the_likeliest_are_told():
    others = [name for name in EFFECTS if name != "X_u"]
    assert separation_note("X_u", others).endswith(f"or {len(others) - 4} others.")
    said = advice("X_u", others, EFFECTS)
    assert said.count("To discriminate") <= 4
    assert said.endswith("vary speed, turn and drift more.")
