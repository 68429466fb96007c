"""What the diagnosis says on a terminal and in a notebook, of a result that is made up."""

from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from support.reported import STABILITY, diagnosis, effect, learned, ranked, report_data

from cosim import InputError
from diagnosis import Counts, Model
from diagnosis.assessment.covariates import SPEED
from diagnosis.report import notebook
from diagnosis.report.content import gain_content
from diagnosis.report.headline import (
    NOTHING_FOUND,
    OTHER_CALIBRATION,
    OTHER_FIT,
    OWN_VALUES,
    SEARCH_GAINED,
    SEARCH_GAINED_NOTHING,
    SEARCH_NAMES_CAUSE,
    first_sentences,
    gain_of_search,
    gain_sentences,
)
from diagnosis.report.pictures import figures, tracks
from diagnosis.report.pictures.chart import Chart, Panel
from diagnosis.report.reported_effect import further_fitted_values, within_range
from diagnosis.report.terminal import as_text, show_calibration, show_comparison, show_diagnosis, summary
from diagnosis.runs import MeasuredChannel
from diagnosis.runs.measured_channels import UNUSED
from diagnosis.runs.sensors.sensor_finding import SensorFinding
from diagnosis.search.findings import Finding, Findings
from diagnosis.verdict.prediction_gain import PairedChange, PredictionGain


def run(name, use, size=1.0, notes=(), faults=(), learned=True):
    """Evaluation of a run, as far as the terminal asks."""

    def errors(position, heading, omega_rms):
        return SimpleNamespace(position=position, heading=heading, omega_rms=omega_rms, errors=None)

    before = errors(0.126 * size, 0.0047 * size, [0.24, 0.005 * size, 0.001])
    after = errors(0.00073 * size, np.nan, [0.0029, 0.0049, 0.0012])
    seconds = 48.0 * (1 + (name == "a"))
    smoothed = SimpleNamespace(
        time=np.array([0.0, seconds]),
        track=SimpleNamespace(period=0.04 * (name == "a")),
        counts=Counts(100, 1, 2, 3, 94),
        notes=notes,
        sensors=SimpleNamespace(findings=faults),
    )
    return SimpleNamespace(
        name=name,
        use=use,
        held_out=use == "test",
        calibrated=None,
        constant_velocities=None,
        before=before,
        after=after if learned else before,
        smoothed=smoothed,
        windows=SimpleNamespace(length=8.0),
        weak_windows=SimpleNamespace(horizon=8.0, width=3.0, run=SimpleNamespace(commands=None)),
    )


TRIAL = {"tactical_diameter": [3.4, 3.0, 3.35], "overshoot": [[0.2, 0.1, 0.19], [0.3, None, 0.31]]}
FAULT = SensorFinding("r", "scale", 1.05, "1", (1.0, 1.1), 0.0, 9.0, "r reads too much", (), False)
RATE = SensorFinding("time", "clock_rate", 1.05, "1", (1.0, 1.1), 0.0, 9.0, "its clock is fast")
OURS = SimpleNamespace(parametric=True, description=lambda: None)
SPEEDS = [
    MeasuredChannel(name, 10.0, 0.0, 0.01, 0.5, "m/s", "estimated", 0.0, 0.0, 0, why=why)
    for name, why in (
        ("u", "both are 2 % too large"),
        ("v", "both are 2 % too large"),
        ("speed", UNUSED),
    )
]
CHANNELS = [
    ("a", [MeasuredChannel("x", 20.0, 0.0, 0.002, 0.0, "m", "given", 0.0, 0.0, 2, (1.5, 3.0)), *SPEEDS]),
    ("b", [MeasuredChannel("x", 10.0, 0.5, 0.004, 0.0, "m", "given", 0.0, 0.0, 1, (7.0,))]),
]
DERIVED = {"channels": CHANNELS, "trials": [None, TRIAL], "measured": [{}, {"port.thrust": (12.0, 3.0)}]}


def compared(learned, faults=(FAULT, RATE), notes=("a gap",)):
    runs = [
        run("a", "train", notes=notes, faults=faults, learned=learned),
        run("b", "test", 2.0, faults=faults[:1], learned=learned),
    ]
    where = SimpleNamespace(sentences=["Surge: worst when fast."])
    return SimpleNamespace(evaluations=runs, omega_std=["of a", "of b"], predictor=OURS, before=where)


EFFECTS = [
    effect("doubtful", 0.6, indistinguishable=["other"], share_unique=0.25),
    effect("sure", 0.99, separation="They differ.", advice="Run astern."),
]
POSSIBILITIES = [effect("unlikely", 0.2, in_model=False, doubt="something acts")]
RANKING = [ranked(name, 12.3456 * k) for k, name in enumerate(("sure", "b", "c", "d", "e", "f"))]
FOUND = {
    "verdict": "ambiguous",
    "learned": learned(RANKING, [("N_r", -4.234, -2.3456), ("m", 3.5, 15.3)]),
    "withdrawn": [SimpleNamespace(id="gone", reason="worse on held-out runs")],
    "posterior": SimpleNamespace(together=[["N_r", "Y_r"], ["m", "X_u"]]),
}


def found(comparison=None, effects=EFFECTS, possibilities=POSSIBILITIES, **changes):
    """The report of a diagnosis with three effects, of which one is only possible."""
    derived = {"inseparable": ["One shaft speed."], **DERIVED}
    given = compared(True) if comparison is None else comparison
    return report_data(given, diagnosis(**FOUND | changes), effects, possibilities, **derived)


def nothing(comparison=None):
    """The report of a diagnosis in which nothing was found."""
    given = compared(False) if comparison is None else comparison
    return report_data(given, diagnosis(), **DERIVED)


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
b 48 s 100 1 2 3 94
Channels, medians of all runs
channel rate held noise outliers used
x 15 Hz 25 % 0.003 m given 3 yes
u 10 Hz 0 % 0.01 m/s uncertain 0 no
v 10 Hz 0 % 0.01 m/s uncertain 0 no
speed 10 Hz 0 % 0.01 m/s uncertain 0 no
x: first outlier in a at 1.5 s
u, v: not used: both are 2 % too large
Found in the data
a: a gap
Faults that redundant channels show
a: r reads too much (not repaired)
a: its clock is fast, 0.0 to 9.0 s
b: r reads too much (not repaired)
Location of the model error
Surge: worst when fast."""

COMPARISON = """Prediction error over 8 s
run position [mm] heading [°]
a 126 0.27
b 252 0.54
Model error
run X [N] Y [N] N [N m]
a 0.24 0.005 0.001
b 0.24 0.01 0.001
Measured and predicted outputs of actuators
run measured output error [SI]
b port.thrust 12
Manoeuvring trials, from just before the first execute
run measure measured predicted unit
b tactical_diameter 3.4 3 m
b overshoot_1 11.5 5.7 °
b overshoot_2 17.2 - °
one.json, two.html in out/folder"""

DIAGNOSIS = """Residual without explanation
Little is left.
Finding 1: sure
There is sure.
X = sure
confidence 99 %, explains 90 % of the squared error with the coefficients
They differ.
Run astern.
Finding 2: doubtful
Possibly doubtful or other (60 % for doubtful): There is doubtful.
X = doubtful
confidence 60 %, explains 90 % of the squared error with the coefficients,
unique contribution 25 % (lost without this effect)
Possibility: unlikely
Possibly unlikely (20 %): There is unlikely. However, something acts. It is
not in the learned model, which predicts as well without it.
X = unlikely
Rejected
gone: worse on held-out runs
Suspect coefficients
N_r: probably -2.35 (-4.2 standard deviations of the prior)
m: probably 15.3 (3.5 standard deviations of the prior), in kg: weigh the ship
Uncertainty of the values
No disturbance.
Identifiable only together: N_r, Y_r.
Identifiable only together: m, X_u.
Warning: One shaft speed.
Best candidates, with the score difference to the first
sure, b +12.3 (± 3.1), c +24.7 (± 3.1), d +37 (± 3.1), e +49.4 (± 3.1)
Prediction error over 8 s, before -> after
run position [mm] heading [°]
a (training) 126 -> 0.73 0.27 -> -
b (test) 252 -> 1.5 0.54 -> -
Model error, before -> after
run X [N] Y [N] N [N m]
a (training) 0.24 -> 0.0029 0.005 -> 0.0049 0.001 -> 0.0012
b (test) 0.24 -> 0.0029 0.01 -> 0.0049 0.001 -> 0.0012
Measured and predicted outputs of actuators, before -> after
run measured output error [SI]
b (test) port.thrust 12 -> 3
Manoeuvring trials, from just before the first execute, before -> after
run measure measured predicted unit
b (test) tactical_diameter 3.4 3 -> 3.4 m
b (test) overshoot_1 11.5 5.7 -> 11 °
b (test) overshoot_2 17.2 - -> 18 °
Stability
In closed loop the learned model stays bounded on the reference paths.
smallest dissipation - 1/s, of the initial model 0.6 1/s
a note
one.json, two.html in out/folder"""


def test_a_comparison_has_its_data_and_errors_before():
    shown = lines(show_comparison(report_data(compared(False), **DERIVED), "out/folder"))
    assert shown == f"{DATA}\n{COMPARISON}".splitlines()


def test_a_diagnosis_has_what_is_sure_first_and_errors_before_and_after():
    shown = lines(show_diagnosis(found(), "out/folder"))
    assert shown == DIAGNOSIS.splitlines()


@pytest.mark.parametrize(
    ("confidence", "share", "in_model", "short"),
    [(0.049, 0.049, True, True), (0.051, 0, True, False), (0, 0.051, True, False), (0, 0, False, False)],
)
def test_what_is_hardly_possible_and_explains_little_has_one_line(confidence, share, in_model, short):
    small = effect("small", confidence, share_of_error=share, in_model=in_model, advice="Run.")
    shown = lines(show_diagnosis(found(possibilities=[*POSSIBILITIES, small]), "out"))
    assert ("small: X = small" in shown) is short
    assert ("Possibility: small" in shown) is not short
    assert "Possibility: unlikely" in shown


@pytest.mark.parametrize(("heading", "stated"), [(-2.1, True), (-1.9, False), (2.1, False)])
def test_a_gain_in_position_that_costs_heading_says_so(heading, stated):
    better = PairedChange(0.032, 0.0089, 9.4e-4, 1.1e-4)
    other = PairedChange(0.01, 0.02, heading * 1e-5, 1e-5)
    gain = PredictionGain("validation runs", 54, better, other, True, "calibrated")
    said = " ".join(gain_sentences(gain, SEARCH_GAINED, SEARCH_GAINED_NOTHING, 10.0))
    assert said.startswith(SEARCH_GAINED)
    assert ("However, predictions of the heading are worse." in said) is stated
    assert ("the mean square rises by 0.0" in said) is (heading < 0.0)


@pytest.mark.parametrize(
    ("times", "stated"),
    [
        ((-2.1, -2.1), " Predictions of the position and the heading are worse."),
        ((-2.1, 1.0), " Predictions of the position are worse."),
        ((-1.9, -1.9), ""),
    ],
)
def test_a_model_that_predicts_worse_is_said_to(times, stated):
    changes = [PairedChange(0.01, 0.02, x * 1e-5, 1e-5) for x in times]
    gain = PredictionGain("validation runs", 54, *changes, False)
    said = gain_sentences(gain, SEARCH_GAINED, SEARCH_GAINED_NOTHING, 10.0)
    assert " ".join(said).startswith(f"{SEARCH_GAINED_NOTHING}{stated} Predictions over 10 s in 54")


@pytest.mark.parametrize("driven", [(), ("surge",)])
def test_a_hull_that_gains_energy_is_in_the_headline(driven):
    stability = SimpleNamespace(**vars(STABILITY) | {"driven_on": driven})
    stated = first_sentences(found(stability=stability))
    assert stated.startswith(first_sentences(found()))
    assert ("In surge the hull of the learned model gains energy" in stated) == bool(driven)


@pytest.mark.parametrize("gained", [True, False])
def test_what_the_search_gained_is_the_first_sentence(gained):
    change = PairedChange(0.032, 0.0089, 9.4e-4, 1.1e-4)
    gain = PredictionGain("validation runs", 54, change, change, gained, "calibrated")
    made = found(gain=gain)
    shown = lines(show_diagnosis(made, "out"))
    first = SEARCH_GAINED if gained else SEARCH_NAMES_CAUSE
    assert shown[:2] == ["Gain of the search", first]
    assert "mean square falls by 940 ± 110 mm²" in " ".join(shown)
    assert first_sentences(made).startswith(SEARCH_NAMES_CAUSE) is not gained
    unsure = found(gain=gain, effects=EFFECTS[:1])
    assert first_sentences(unsure).startswith(SEARCH_GAINED_NOTHING) is not gained
    assert gain_content(gain, ["One.", "Two."]) == {
        "gained": gained,
        "over": "calibrated",
        "where": "validation runs",
        "windows": 54,
        "position": vars(change),
        "heading": vars(change),
        "sentence": "One. Two.",
    }


@pytest.mark.parametrize("name", ["V_n@a", "V_n"])
def test_what_single_runs_have_of_their_own_is_said_beside_the_gain(name):
    change = PairedChange(0.03, 0.02, 0.03**2 - 0.02**2, 1e-4)
    gain = PredictionGain("data left out of the fit", 54, change, change, True, "calibrated")
    r = found(gain=gain)
    r.diagnosis.learned = Findings([Finding("current", {name: 0.1}, {}, 0.99, [], 1.0, 1.0)])
    assert (OWN_VALUES in gain_of_search(r)) is ("@" in name)


def test_a_report_says_how_commands_are_read_where_files_do_not():
    shown = " ".join(lines(show_diagnosis(found(measured=True), "out")))
    assert shown.startswith("Commands The commands are read as measured values")
    assert "measured values" not in " ".join(lines(show_diagnosis(found(), "out")))


@pytest.mark.parametrize(
    ("refitted", "now", "stated"), [(True, 0.02, True), (True, 0.03, False), (False, 0.02, False)]
)
def test_a_search_without_an_effect_says_why_its_numbers_differ(refitted, now, stated):
    change = PairedChange(0.03, now, 0.03**2 - now**2, 1e-4)
    gain = PredictionGain("validation runs", 54, change, change, False, "calibrated")
    shown = " ".join(lines(show_diagnosis(found(gain=gain, refitted=refitted), "out")))
    assert (OTHER_FIT in shown) is stated


def test_a_calibrated_model_says_that_it_is_another_calibration():
    change = PairedChange(0.03, 0.02, 0.03**2 - 0.02**2, 1e-4)
    gain = PredictionGain("validation runs", 54, change, change, False, "calibrated")
    calibrated = found(gain=gain, refitted=True, calibrated=True)
    shown = " ".join(lines(show_diagnosis(calibrated, "out")))
    assert OTHER_CALIBRATION in shown
    assert OTHER_FIT not in shown
    assert "N_r: in the learned model -2.35" in shown
    assert "N_r: probably" not in shown


def test_what_a_calibrated_model_has_of_water_and_compass_is_said():
    start = Model()

    def said(posterior=SimpleNamespace(std={}), **values):
        learned = SimpleNamespace(model=start.plus(values))
        d = SimpleNamespace(start=start, learned=learned, speeds=(0.4, 0.1, 0.2), posterior=posterior)
        return further_fitted_values(d)

    assert said() == said(delta_X_uu=1.0) == []
    assert said(V_n=0.3) == ["The water moves at 0.3 m/s towards 0°."]
    (water, compass) = sorted(said(V_n=0.0, V_e=-0.2, heading_offset=0.1))[::-1]
    assert water == "The water moves at 0.2 m/s towards 270°."
    assert "5.73°" in compass
    assert said(heading_offset=0.0049) == [], "0.28 degrees matter in no manoeuvre"
    assert said(heading_offset=-0.0051)
    (dead,) = said(deadband=0.3)
    assert "0.3 N" in dead
    assert said(SimpleNamespace(std={"deadband": 0.14}), deadband=0.3) == [dead]
    assert said(plant_F_vsp=2.0) == [], "a coefficient of the file"
    assert said(SimpleNamespace(std={"deadband": 0.16}), deadband=0.3) == [], "it may be none"


@pytest.mark.parametrize(
    ("name", "value", "ends", "shown"),
    [
        ("position_tracker", 0.07, (-6.4, 6.6), (0.0, 3.0)),
        ("position_tracker", 0.07, (0.05, 0.09), (0.05, 0.09)),
        ("position_tracker", -0.1, (-0.2, 0.3), (-0.1, 0.3)),
        ("delta_X_u", 1.0, (-99.0, 99.0), (-99.0, 99.0)),
        ("bow_outage_end_1@run", 5.0, (-1.0, 6.0), (0.0, 6.0)),
    ],
)
def test_an_interval_ends_where_its_parameter_cannot_be(name, value, ends, shown):
    assert within_range(Model(), name, value, *ends) == shown


def test_without_a_gain_nothing_is_said_of_it():
    assert "Gain of the search" not in lines(show_diagnosis(found(), "out"))
    assert gain_content(None, []) is None


def test_where_nothing_is_found_the_sentence_is_the_finding():
    shown = lines(show_diagnosis(nothing(compared(False, (), ())), "out"))
    assert shown[shown.index("Finding") + 1] == NOTHING_FOUND
    absent = ("Found in the data", "Faults", "Rejected", "Suspect", "Best")
    assert not [line for line in shown if line.startswith(absent)]
    assert "Prediction error over 8 s" in shown
    assert "Finding" in lines(show_diagnosis(found(effects=EFFECTS[1:]), "out"))


@pytest.mark.parametrize(
    ("changes", "stated"),
    [
        (
            {"bounded": False},
            "In closed loop the learned model does NOT stay bounded on the reference paths.",
        ),
        ({"closed_loop": False}, "Without thrust the learned model stays bounded."),
        ({"mass_definite": False}, "The mass matrix of the learned model is not positive definite."),
        ({"region": "|u| < 1"}, "warning: less dissipation than the initial model: |u| < 1"),
        (
            {"learned_min_dissipation": 0.5},
            "smallest dissipation 0.5 1/s, of the initial model 0.6 1/s",
        ),
    ],
)
def test_stability_in_words(changes, stated):
    made = found(stability=SimpleNamespace(**vars(STABILITY) | changes))
    assert stated in lines(show_diagnosis(made, "out"))
    assert stated not in lines(show_diagnosis(found(), "out"))


def test_a_summary_has_ten_lines_at_the_most():
    title, *rest = summary(found()).splitlines()
    assert title == "ambiguous: An effect is missing, and several candidates explain it"
    assert rest[0] == "  There is sure. [99 %]"
    assert rest[1].startswith("  Possibly doubtful or other")
    assert rest[2].endswith("[20 %]")
    assert rest[3:] == [
        "  Little is left.",
        "  a (training): prediction error over 8 s 126 -> 0.73 mm",
        "  b (test): prediction error over 8 s 252 -> 1.5 mm",
    ]
    many = compared(True)
    many.evaluations = [run(n, "train") for n in "abcde"]
    text = summary(found(many, 3 * EFFECTS)).splitlines()
    assert len(text) == 10
    assert text[-1] == "  and 2 more runs"
    assert summary(nothing()).splitlines()[1] == f"  {NOTHING_FOUND}"


@pytest.fixture
def drawn(monkeypatch):
    """Names and arguments of the charts that are made, in place of these."""
    made = []
    for module, name in (
        (figures, "profile"),
        (figures, "model_error"),
        (tracks, "track"),
        (figures, "ranking"),
    ):
        chart = Chart(100.0, [Panel()])
        monkeypatch.setattr(
            module, name, lambda *given, name=name, chart=chart: made.append((name, *given)) or chart
        )
    return made


@pytest.mark.parametrize("learned", [False, True])
def test_pictures_of_a_notebook_are_those_of_their_run(drawn, learned):
    given = compared(learned)
    a, b = given.evaluations
    given.before, given.after = (SimpleNamespace(profiles=p) for p in ("first", "last"))
    plots = notebook.Plots(found(given))
    *_, last = figures.LABELS
    shown = [
        plots.where(),
        plots.where("heading"),
        plots.omega(),
        plots.omega(1),
        plots.track(),
        plots.track(1),
    ]
    assert all("<svg" in picture._repr_svg_() for picture in shown)
    after = "last" if learned else None
    assert drawn == [
        ("profile", SPEED, "first", after),
        ("profile", last, "first", after),
        ("model_error", a, "of a", learned),
        ("model_error", b, "of b", learned),
        ("track", a, learned),
        ("track", b, learned),
    ]
    plots.ranking()
    assert [r.id for r in drawn[-1][1]] == ["sure", "b", "c", "d", "e", "f"]
    with pytest.raises(InputError, match="no quantity 'x'; there are surge speed, yaw rate, "):
        plots.where("x")
    with pytest.raises(InputError, match="no candidates"):
        notebook.Plots(nothing(given)).ranking()


def test_a_picture_can_be_saved_in_each_format(tmp_path):
    picture = notebook.NotebookChart(Chart(100.0, [Panel()]))
    for name in ("a.png", "a.svg", "a.pdf"):
        assert picture.save(tmp_path / name).stat().st_size > 1000


def test_a_notebook_has_finding_effects_errors_and_two_pictures(drawn):
    given = compared(True)
    given.before.profiles, given.after = "first", SimpleNamespace(profiles="last")
    text = notebook.as_html(found(given, [effect("a<b", 0.6), EFFECTS[1]])).replace("\n", "")
    assert "<b>An effect is missing; which one is uncertain</b></p><p>There is sure." in text
    assert "There is a&lt;b.</p><p>Little is left.</p>" in text
    assert "<tr><td>a&lt;b</td><td>X = a&lt;b</td></tr><tr><td>sure</td><td>X = sure</td></tr>" in text
    assert "<th>position over 8 s [mm]</th><th>heading over 8 s [°]</th>" in text
    assert "<tr><td>a (training)</td><td>126 → 0.73</td>" in text
    assert "<tr><td>b (test)</td><td>252 → 1.46</td>" in text
    assert [name for name, *_ in drawn] == ["profile", "model_error"]
    assert text.count("<svg") == 2


def test_coefficients_that_moved_most_are_shown_with_a_calibration():
    start = Model()
    found = Findings([], model=start, moved={"X_u": -1.5, "m": 0.1})
    calibrated = SimpleNamespace(learned=found, model=start, measured=False, gain=None)
    text = as_text(show_calibration(calibrated, report_data(compared(False), **DERIVED)))
    assert text.index("X_u is") < text.index("m is")
    assert "(-1.5)" in text
