"""What the diagnosis says on a terminal and in a notebook, of a result that is made up."""

from io import StringIO
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure
from rich.console import Console

from cosim import InputError
from diagnosis.report import ComparisonContent, DiagnosisContent, figures, notebook, tracks
from diagnosis.report.profiles import QUANTITIES
from diagnosis.report.terminal import has_learned, show_comparison, show_diagnosis, summary

COUNTS = {"samples": 100, "frozen": 1, "dropped": 2, "spikes": 3, "used": 94}


def errors(run, held_out, size=1.0, **others):
    return {
        "run": run,
        "held_out": held_out,
        "window_position_rmse": {"before": 0.126 * size, "after": 0.00073 * size},
        "window_heading_rmse": {"before": 0.0047 * size, "after": None},
        "omega_rms": {"before": [0.24, 0.005 * size, 0.001], "after": [0.0029, 0.0049, 0.0012]},
        **others,
    }


TRIAL = {"tactical_diameter": [3.4, 3.0, 3.35], "overshoot": [[0.2, 0.1, 0.19], [0.3, None, 0.31]]}
FAULT = {"run": "a", "channel": "r", "kind": "scale", "value": 1.05, "unit": "1", "ci95": [1.0, 1.1], "start": 0.0, "end": 9.0, "sentence": "r reads too much", "alike": [], "repaired": False}  # fmt: skip
RATE = FAULT | {
    "channel": "time",
    "kind": "clock_rate",
    "sentence": "its clock is fast",
    "repaired": True,
}
COMPARED = {
    "data": {**COUNTS, "runs": [{**COUNTS, "run": "a", "held_out": False, "seconds": 96.04, "notes": ["a gap"]},
                                {**COUNTS, "run": "b", "held_out": True, "seconds": 48.0, "notes": []}]},
    "windows": {"prediction": 8.0, "model_error": 3.0},
    "sensors": [FAULT, RATE, FAULT | {"run": "b"}],
    "errors": [errors("a", False), errors("b", True, 2.0, trial=TRIAL, measured={"port.thrust": {"rms_before": 12.0, "rms_after": 3.0}})],
    "where": {"sentences": ["Surge: worst when fast."], "regions": [], "profiles": []},
    "runs": ["a", "b"],
    "model": None,
    "files": ["one.json", "two.html"],
    "versions": {},
}  # fmt: skip


def effect(name, confidence, **others):
    made = {"id": name, "axis": "X", "coefficients": {}, "confidence": confidence, "share_of_error": 0.904, "indistinguishable": [], "advice": "", "sentence": f"There is {name}.", "equation": f"X = {name}", "separation": ""}  # fmt: skip
    return made | others


def ranked(name, behind):
    return {
        "id": name,
        "score": 10.0 + behind,
        "q2": 0.9,
        "beyond": 0.5,
        "behind": behind,
        "behind_std": 3.14159,
    }


FOUND = COMPARED | {
    "verdict": "ambiguous",
    "sentence": "In short.",
    "effects": [effect("doubtful", 0.6, indistinguishable=["other"], share_unique=0.25), effect("sure", 0.99, separation="They differ.", advice="Run astern.")],
    "possibilities": [effect("unlikely", 0.2, in_model=False, doubt="something acts")],
    "withdrawn": [{"id": "gone", "reason": "worse on held-out runs"}],
    "remainder": {"significant": False, "axes": {}, "sentence": "Little is left."},
    "unrecorded": {"size": [], "time": [], "values": {}, "stretches": [], "sentence": "No unrecorded force."},
    "correlation": {"names": [], "matrix": [], "together": [["N_r", "Y_r"], ["m", "X_u"]]},
    "inseparable": ["One shaft speed."],
    "suspect_coefficients": [{"name": "N_r", "z": -4.234, "value": -2.3456}],
    "ranking": [ranked(name, 12.3456 * k) for k, name in enumerate(("sure", "b", "c", "d", "e", "f"))],
    "where_after": COMPARED["where"],
    "stability": {"nominal_min_dissipation": 0.6, "learned_min_dissipation": None, "bounded": True, "region": None, "mass_definite": True, "closed_loop": True, "notes": ["a note"]},
    "prior": None,
    "seed": 0,
}  # fmt: skip


def lines(shown):
    """What a terminal shows, without empty lines, spaces as one."""
    text = StringIO()
    console = Console(file=text, width=80)
    for part in shown:
        console.print(part)
    assert max(map(len, text.getvalue().splitlines())) <= 80
    return [" ".join(line.split()) for line in text.getvalue().splitlines() if line.strip()]


DATA = """Data
run time samples frozen dropped spikes used
a 96.04 s 100 1 2 3 94
b (held out) 48 s 100 1 2 3 94
Found in the data
a: a gap
What channels say of each other
a: r reads too much (not repaired)
a: its clock is fast, 0.0 to 9.0 s
b: r reads too much (not repaired)
Where the model fails
Surge: worst when fast."""

COMPARISON = """Predictions over 8 s miss by
run position [mm] heading [°]
a 126 0.27
b (held out) 252 0.54
Force that the model lacks
run X [N] Y [N] N [N m]
a 0.24 0.005 0.001
b (held out) 0.24 0.01 0.001
Measured outputs of actuators and the model's
run what is measured off by [SI]
b (held out) port.thrust 12
Manoeuvring trials, from just before the first execute
run measure measured predicted unit
b (held out) tactical_diameter 3.4 3 m
b (held out) overshoot_1 11.5 5.7 °
b (held out) overshoot_2 17.2 - °
one.json, two.html in out/folder"""

DIAGNOSIS = """What is left without an explanation
Little is left.
Finding 1: sure
There is sure.
X = sure
confidence 99 %, takes away 90 % of the squared error
They differ.
Run astern.
Finding 2: doubtful
Possibly doubtful or other (60 % for doubtful): There is doubtful.
X = doubtful
confidence 60 %, takes away 90 % of the squared error, 25 % that nothing else
does
Possibility: unlikely
Possibly unlikely (20 % for unlikely): There is unlikely. But something acts.
The learned model does not have it.
X = unlikely
confidence 20 %, takes away 90 % of the squared error
Withdrawn
gone: worse on held-out runs
Suspect coefficients
N_r is rather -2.35 (-4.2 standard deviations of the prior)
How sure the values are
No unrecorded force.
Known only together: N_r, Y_r.
Known only together: m, X_u.
Warning: One shaft speed.
Best candidates, by how much worse than the first
sure, b +12.3 (± 3.1), c +24.7 (± 3.1), d +37 (± 3.1), e +49.4 (± 3.1)
Predictions over 8 s miss by, before -> after
run position [mm] heading [°]
a 126 -> 0.73 0.27 -> -
b (held out) 252 -> 1.5 0.54 -> -
Force that the model lacks, before -> after
run X [N] Y [N] N [N m]
a 0.24 -> 0.0029 0.005 -> 0.0049 0.001 -> 0.0012
b (held out) 0.24 -> 0.0029 0.01 -> 0.0049 0.001 -> 0.0012
Measured outputs of actuators and the model's, before -> after
run what is measured off by [SI]
b (held out) port.thrust 12 -> 3
Manoeuvring trials, from just before the first execute, before -> after
run measure measured predicted unit
b (held out) tactical_diameter 3.4 3 -> 3.4 m
b (held out) overshoot_1 11.5 5.7 -> 11 °
b (held out) overshoot_2 17.2 - -> 18 °
Stability
In closed loop the learned model stays bounded on the reference paths.
smallest dissipation - 1/s, of the model at first 0.6 1/s
a note
one.json, two.html in out/folder"""


def test_a_comparison_has_its_data_and_errors_before():
    shown = lines(show_comparison(ComparisonContent(**COMPARED), "out/folder"))
    assert shown == f"{DATA}\n{COMPARISON}".splitlines()


def test_a_diagnosis_has_what_is_sure_first_and_errors_before_and_after():
    shown = lines(show_diagnosis(DiagnosisContent(**FOUND), "out/folder"))
    assert shown == f"{DATA}\n{DIAGNOSIS}".splitlines()


NOTHING = FOUND | {
    "verdict": "none",
    "effects": [],
    "possibilities": [],
    "withdrawn": [],
    "suspect_coefficients": [],
}


def test_where_nothing_is_found_the_sentence_is_the_finding():
    data = COMPARED["data"] | {"runs": [r | {"notes": []} for r in COMPARED["data"]["runs"]]}
    none = DiagnosisContent(**NOTHING | {"sensors": [], "data": data, "errors": [errors("a", False)]})
    shown = lines(show_diagnosis(none, "out"))
    assert shown[shown.index("Finding") + 1] == "In short."
    absent = (
        "Found in the data",
        "What channels say",
        "Withdrawn",
        "Suspect",
        "Best",
        "Measured",
        "Manoeuvring",
    )
    assert not [line for line in shown if line.startswith(absent)]
    assert "Predictions over 8 s miss by" in shown
    one = FOUND | {"effects": FOUND["effects"][1:]}
    assert "Finding" in lines(show_diagnosis(DiagnosisContent(**one), "out"))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"bounded": False},
            "In closed loop the learned model does NOT stay bounded on the reference paths.",
        ),
        ({"closed_loop": False}, "Without thrust the learned model stays bounded."),
        ({"mass_definite": False}, "The mass matrix of the learned model is not positive definite."),
        ({"region": "|u| < 1"}, "warning: less dissipation than at first: |u| < 1"),
        (
            {"learned_min_dissipation": 0.5},
            "smallest dissipation 0.5 1/s, of the model at first 0.6 1/s",
        ),
    ],
)
def test_stability_in_words(changes, told):
    made = FOUND | {"stability": FOUND["stability"] | changes}
    assert told in lines(show_diagnosis(DiagnosisContent(**made), "out"))
    assert told not in lines(show_diagnosis(DiagnosisContent(**FOUND), "out"))


@pytest.mark.parametrize(
    ("changes", "learned"),
    [
        ({}, False),
        ({"calibrated": True}, True),
        ({"verdict": "coefficients"}, True),
        ({"possibilities": FOUND["possibilities"]}, False),
        ({"possibilities": [FOUND["possibilities"][0] | {"in_model": True}]}, True),
        ({"effects": FOUND["effects"]}, True),
    ],
)
def test_what_has_been_learned(changes, learned):
    assert has_learned(DiagnosisContent(**NOTHING | changes)) == learned


def test_a_summary_has_ten_lines_at_the_most():
    title, *rest = summary(DiagnosisContent(**FOUND)).splitlines()
    assert title == "ambiguous: Something is missing, and more than one cause fits"
    assert rest[0] == "  There is sure. [99 %]"
    assert rest[1].startswith("  Possibly doubtful or other")
    assert rest[2].endswith("[20 %]")
    assert rest[3:] == [
        "  Little is left.",
        "  a: predictions over 8 s miss by 126 -> 0.73 mm",
        "  b (held out): predictions over 8 s miss by 252 -> 1.5 mm",
    ]
    many = FOUND | {"effects": 3 * FOUND["effects"], "errors": [errors(n, False) for n in "abcde"]}
    text = summary(DiagnosisContent(**many)).splitlines()
    assert len(text) == 9
    assert text[-1] == "  and 2 more runs"
    assert summary(DiagnosisContent(**NOTHING)).splitlines()[1] == "  In short."


@pytest.fixture
def drawn(monkeypatch):
    """Names and arguments of the figures that are made, in place of these."""
    made = []
    for module, name in (
        (figures, "profile"),
        (figures, "model_error"),
        (tracks, "track"),
        (figures, "ranking"),
    ):
        monkeypatch.setattr(
            module, name, lambda *given, name=name: made.append((name, *given)) or Figure()
        )
    monkeypatch.setattr(notebook, "binned_errors", lambda *given: given)
    return made


@pytest.mark.parametrize("learned", [False, True])
def test_pictures_of_a_notebook_are_those_of_their_run(drawn, learned):
    a, b = (SimpleNamespace(before=0, after=k if learned else 0) for k in range(2))
    compared = SimpleNamespace(evaluations=[a, b], omega_std=["of a", "of b"])
    plots = notebook.Plots(DiagnosisContent(**FOUND), compared)
    last = QUANTITIES[-1]
    shown = [
        plots.where(),
        plots.where(last.name),
        plots.omega(),
        plots.omega(1),
        plots.track(),
        plots.track(1),
    ]
    assert all("<svg" in picture._repr_svg_() for picture in shown)
    errors = [a, b], ["of a", "of b"]
    assert drawn == [
        ("profile", QUANTITIES[0], (QUANTITIES[0], *errors), learned),
        ("profile", last, (last, *errors), learned),
        ("model_error", a, "of a", learned),
        ("model_error", b, "of b", learned),
        ("track", a, learned),
        ("track", b, learned),
    ]
    plots.ranking()
    assert [r.id for r in drawn[-1][1]] == ["sure", "b", "c", "d", "e", "f"]
    with pytest.raises(InputError, match=f"no quantity 'x'; there are {QUANTITIES[0].name}, "):
        plots.where("x")
    with pytest.raises(InputError, match="no candidates"):
        notebook.Plots(DiagnosisContent(**FOUND | {"ranking": []}), compared).ranking()


def test_a_notebook_has_finding_effects_errors_and_two_pictures(drawn):
    compared = SimpleNamespace(evaluations=[SimpleNamespace(before=0, after=0)], omega_std=["of a"])
    content = DiagnosisContent(**FOUND | {"sentence": "1 < 2."})
    text = notebook.as_html(content, notebook.Plots(content, compared))
    assert (
        "<b>Something is missing, and more than one cause fits</b></p><p>1 &lt; 2.</p><p>Little is left.</p>"
        in text
    )
    assert (
        "<tr><td>doubtful</td><td>X = doubtful</td></tr><tr><td>sure</td><td>X = sure</td></tr>" in text
    )
    assert "<th>position over 8 s [mm]</th><th>heading over 8 s [°]</th>" in text
    assert "<tr><td>a</td><td>126 → 0.73</td>" in text
    assert "<tr><td>b (held out)</td><td>252 → 1.46</td>" in text
    assert [name for name, *_ in drawn] == ["profile", "model_error"]
    assert text.count("<svg") == 2
