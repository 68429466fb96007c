"""Numbers, sentences and figures of the report, of results that were made up."""

from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.reported import diagnosis, effect, ranked, report_data

from diagnosis import Model
from diagnosis.assessment.covariates import HEADING, SPEED
from diagnosis.assessment.regions import Profile
from diagnosis.predictors.evaluation import PredictionError
from diagnosis.predictors.windows import WindowErrors
from diagnosis.report import finding_text, formatting, headline, terminal
from diagnosis.report.pictures import chart, figures, shape, tracks
from diagnosis.report.pictures.shape import Curve
from diagnosis.report.reported_effect import ReportedCoefficient
from diagnosis.report.terminal import _number as terminal_number
from diagnosis.report.terminal import _percent as terminal_percent
from diagnosis.runs.run_constants import CHANCE
from fmus.ship import ship

# Numbers and sentences


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1234.5, "1234"),
        (12345.6, "12346"),
        (999999.0, "999999"),
        (1e6, "1e+06"),
        (0.00012345, "0.000123"),
        (0.0001, "0.0001"),
        (0.00002, "2e−05"),
        (-0.5, "−0.5"),
        (0.0, "0"),
        (None, "–"),
        (np.nan, "–"),
        (np.inf, "–"),
    ],
)
def test_numbers_are_written_out_unless_very_large_or_small(value, text):
    assert formatting.number(value) == text


def evaluation(name, before, after, held_out):
    """A run whose errors in ten windows are about these [m] and [rad]."""

    def error(size):
        position = np.linspace(0.9, 1.1, 10) * size
        errors = WindowErrors(np.zeros(10, int), np.arange(10.0), np.ones(10), position, position)
        return PredictionError(np.zeros((1, 3)), np.zeros((0, 3)), errors)

    return SimpleNamespace(
        name=name, before=error(before), after=error(after), held_out=held_out, calibrated=None
    )


@pytest.mark.parametrize(
    ("before", "after", "learned", "said"),
    [
        (0.05, 0.02, True, ""),
        (0.05, 0.029, True, ""),  # another manoeuvre may well be harder to predict
        (0.05, 0.031, True, "is predicted worse than all other runs (position 31 against 10 mm"),
        (0.01, 0.02, True, "worse than the initial model: position 10 → 20 mm and heading"),
        (0.01, 0.02, False, ""),
        (0.05, 0.05, True, "is predicted worse than all other runs"),
    ],
)
def test_test_runs_that_contradict_the_learned_model_are_told(before, after, learned, said):
    trained = evaluation("a", 0.05, 0.01, held_out=False)
    tested = evaluation("b", before, after, held_out=True)
    r = SimpleNamespace(evaluations=[trained, tested], learned=learned)
    stated = [*headline.contradicted_by_tests(r)]
    assert bool(stated) == bool(said)
    assert all("test run b" in sentence for sentence in stated)
    assert said in " ".join(stated)
    # Calibration alone may predict better where the initial model does not.
    tested.calibrated = evaluation("", 0.8 * after, 0.0, held_out=True).before.errors
    better = " ".join(headline.contradicted_by_tests(r))
    numbers = f"position {800 * after:.2g} → {1000 * after:.2g} mm"
    assert learned == (f"test run b worse than calibration alone: {numbers} and" in better)
    # The same errors on a run that was learned from say nothing, nor does a test run alone.
    trained_too = SimpleNamespace(**{**vars(tested), "held_out": False})
    assert not [
        *headline.contradicted_by_tests(
            SimpleNamespace(evaluations=[trained, trained_too], learned=learned)
        )
    ]


@pytest.mark.parametrize(("size", "said"), [(12.0, True), (2.0, False)])
def test_an_error_that_is_larger_by_chance_is_told_as_such(size, said):
    """One of ten windows is predicted so much worse, all others a little better."""
    trained = evaluation("a", 0.05, 0.01, held_out=False)
    tested = evaluation("b", 0.05, 0.05, held_out=True)
    tested.after.errors.position[:] *= np.where(np.arange(10) == 3, size, 0.9)  # that of heading, too
    stated = [
        *headline.contradicted_by_tests(SimpleNamespace(evaluations=[trained, tested], learned=True))
    ]
    assert ("; of so few windows this may be chance." in stated[0]) == said
    # Its cause is in the model, and not in the run, where another model predicts it better.
    assert stated[-1].endswith(f"{headline.LESS_BEYOND if said else headline.OTHER_RUN}.")


@pytest.mark.parametrize(
    ("model", "steady", "said"),
    [
        (0.05, 0.06, ""),
        (0.05, 0.04, ""),  # within what is taken as noise
        (0.05, 0.02, "position 20 → 50 mm and heading 1.1 → 2.9 °"),
    ],
)
def test_a_run_that_constant_velocities_predict_better_is_told(model, steady, said):
    e = evaluation("a", model, model, held_out=False)
    e.constant_velocities = evaluation("", steady, steady, held_out=False).before.errors
    unknown = SimpleNamespace(after=e.after, constant_velocities=None)
    r = SimpleNamespace(evaluations=[e, unknown], learned=False, called=lambda e: e.name)
    stated = [*headline.worse_than_constant_velocities(r)]
    assert [sentence.partition(". ")[0] for sentence in stated] == (
        [f"The model predicts a worse than constant velocities do: {said}"] if said else []
    )
    r.learned = True
    assert all(s.startswith("The learned model") for s in headline.worse_than_constant_velocities(r))


def test_numbers_have_their_digits_and_factor():
    assert formatting.number(0.12345, 2, 1000.0) == "123"
    assert formatting.number(1.2345, 2) == "1.2"
    assert formatting.unit("N.s2/m3") == "N·s²/m³"
    assert formatting.unit("1") == ""
    assert [formatting.percent(x) for x in (0.256, None, np.nan)] == ["26 %", "–", "–"]
    assert [terminal_number(x) for x in (None, np.inf, 999.4, 1000.0, -12345.6, 0.12345)] == [
        "-",
        "-",
        "999",
        "1000",
        "-12346",
        "0.123",
    ]
    assert terminal_number(123.4, 2) == "123"
    assert [terminal_percent(x) for x in (0.256, None, np.nan)] == ["26 %", "-", "-"]


@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        (10.0, 5.0, "2×"),
        (99.4, 10.0, "9.9×"),
        (99.6, 10.0, "10×"),
        (1234.0, 10.0, "123×"),
        (1.0, 2.0, "0.5×"),
        (0.0, 1.0, "0×"),
        (1.0, 0.0, "–"),
        (None, 1.0, "–"),
        (1.0, None, "–"),
        (np.inf, 1.0, "–"),
    ],
)
def test_falls_are_ratios(before, after, text):
    assert formatting.times(before, after) == text


def test_any_value_of_json_is_told_on_one_line():
    assert formatting.plain({"a": [1.0, True, None], "b": "x"}) == "a 1, yes, –, b x"
    assert formatting.plain(False) == "no"
    assert formatting.plain(0.1234567) == "0.123457"


def test_what_is_sure_is_a_fact_and_comes_first():
    sure = effect("lag", headline.FOUND)
    unsure = effect(
        "delay", 0.5, indistinguishable=["lag", "deadband"], doubt="it is at its limit", in_model=False
    )
    assert headline.is_sure(sure)
    assert not headline.is_sure(effect("lag", headline.FOUND - 0.01))
    assert not headline.is_sure(effect("lag", np.nan))
    assert headline.finding_sentence(sure) == "There is lag."
    assert headline.finding_sentence(unsure) == (
        "Possibly delay or lag or deadband (50 % for delay): There is delay. "
        "However, it is at its limit. It is not in the learned model, which predicts as well without it."
    )
    assert headline.finding_sentence(effect("lag", np.nan)) == "Possibly lag: There is lag."
    small = effect("lag", 0.5, share_of_error=0.003)
    assert headline.finding_sentence(small).endswith(
        "There is lag. It explains < 1 % of the squared error."
    )
    both = report_data(None, diagnosis(verdict="found"), [unsure, sure])
    assert (
        headline.headline(both)
        == f"{headline.finding_sentence(sure)} {headline.finding_sentence(unsure)}"
    )


def test_beside_findings_that_are_not_sure_wrong_coefficients_are_named():
    """Of an azimuth with 30 % less thrust than described the coefficient took all, and a filter the rest."""
    off, unsure = {"k_ahead": "thrust", "X_u": ""}, effect("delay", 0.5)
    said = headline.headline(report_data(None, diagnosis(), [unsure], suspects=off))
    assert said.endswith(" Coefficients that are probably wrong as well: k_ahead (thrust) and X_u.")
    for effects, suspects in (([unsure, effect("lag", headline.FOUND)], off), ([unsure], {})):
        assert "Coefficients" not in headline.headline(
            report_data(None, diagnosis(), effects, suspects=suspects)
        )


@pytest.mark.parametrize(
    ("by_power", "of"), [(True, "of the power of"), (False, "of the squared error")]
)
def test_the_share_of_a_finding_says_what_it_is_of(by_power, of):
    *_, line = terminal._effect(effect("waves", 0.9, by_power=by_power))
    assert f"explains 90 % {of}" in line


def test_headline_of_each_verdict():
    def said(
        verdict,
        possibilities=(),
        suspects=(),
        something=False,
        calibrated=False,
        shared=None,
        left=True,
        moved=(),
    ):
        start = Model()
        model = start.plus({"m": 0.1} | (shared or {}))
        d = diagnosis(
            verdict=verdict,
            calibrated=calibrated,
            remainder=SimpleNamespace(beyond_chance=something, significant=left),
            start=start,
            learned=SimpleNamespace(model=model, moved=dict(moved)),
            refitted=calibrated,
            speeds=(0.4, 0.1, 0.2),
            posterior=SimpleNamespace(std=dict.fromkeys(["m", "body_bias_N", *(shared or {})], 0.1)),
        )
        return headline.headline(report_data(None, d, [], possibilities, suspects=dict(suspects)))

    suspects = [(n, d) for n, d in zip("abcdef", ["mass", "", "", "", "", ""], strict=True)]
    assert said("none") == headline.NOTHING_FOUND
    assert said("none", something=True) == headline.TOO_LITTLE
    assert said("unexplained") == headline.UNEXPLAINED
    assert said("unexplained", calibrated=True) != headline.UNEXPLAINED
    calibrated = said("unexplained", calibrated=True, left=False)
    assert calibrated == headline.NOT_BELIEVED + headline.CALIBRATED, "no error remains"
    assert said("unexplained", [effect("lag", 0.1)]) == headline.NOT_BELIEVED
    near, far = [("m", 2.9)], [("m", 2.9), ("X_u", -3.24), ("N_r", 5.0)]
    assert said("unexplained", calibrated=True, left=False, moved=near) == calibrated
    beyond = said("unexplained", calibrated=True, left=False, moved=far)
    assert "explain these data" in beyond
    assert "X_u by −3.2 and N_r by 5." in beyond
    known = headline.UNEXPLAINED + headline.CALIBRATED
    limit = headline.BEYOND.format(far=3.0, names="X_u by −3.2 and N_r by 5")
    assert said("unexplained", calibrated=True, moved=far) == known + limit
    assert said("unexplained", calibrated=True, moved=near) == known
    late = said("unexplained", calibrated=True, left=False, moved=far, shared={"position_latency": 0.4})
    assert late.startswith(beyond)
    assert late.endswith("without claiming a cause: The position is 0.4 s older than its time stamp.")
    assert said("unexplained", left=False, moved=far) == headline.NOT_BELIEVED
    doubted = said("unexplained", [effect("lag", 0.1)], left=False, moved=far)
    assert doubted.startswith(headline.NOT_BELIEVED)
    assert doubted.endswith("3 standard deviations of their priors: X_u by −3.2 and N_r by 5.")
    off = " from the description beyond chance."
    assert said("coefficients", suspects=suspects[:2]).endswith(f"needed. a (mass) and b differ{off}")
    assert said("coefficients", suspects=suspects[1:2]).endswith(f"needed. b differs{off}")
    assert f"a (mass), b, c, d and 2 others differ{off}" in said("coefficients", suspects=suspects)
    assert said("coefficients").endswith("explain these data; no effect is needed.")
    beside = said("coefficients", shared={"heading_offset": 0.1, "body_bias_N": 2.0})
    assert "explain these data together with body_bias_N and heading_offset; no other" in beside
    beside = said("coefficients", shared={"heading_offset": 0.1, "delta_Y_ur": 2.0, "delta_X_rr": 1.0})
    assert f"together with {headline.PRODUCTS} and heading_offset; no other" in beside


def test_names_in_a_row():
    assert finding_text.listed(["a"]) == "a"
    assert finding_text.listed([*"abc"]) == "a, b or c"
    assert finding_text.listed([*"abcd"]) == "a, b, c or d"
    assert finding_text.listed([*"abcde"]) == "a, b, c, d or 1 other"
    assert finding_text.listed([*"abcdef"]) == "a, b, c, d or 2 others"
    assert finding_text.separation_note("x", []) == ""


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        (None, "δ = 0.123 m"),
        ((0.1, 0.15), "δ = 0.123 m (0.1 to 0.15)"),
        ((0.1233, 0.1235), "δ = 0.12344 m (0.1233 to 0.1235)"),
        ((0.2, 0.2), "δ = 0.123 m (0.2 to 0.2)"),
        ((-np.inf, np.inf), "δ = 0.123 m (-inf to inf)"),
    ],
)
def test_coefficients_have_the_digits_in_which_their_interval_differs(interval, text):
    assert finding_text._coefficient("δ", 0.1234444, "m", interval) == text
    assert finding_text._coefficient("δ", 0.5, "1", None) == "δ = 0.5"


# Charts


def marks(panel):
    return {m.label: m for m in panel.marks if m.label}


def windows(time, measured, left, every=1.0):
    return SimpleNamespace(
        weak_windows=SimpleNamespace(middle=time, every=every),
        before=SimpleNamespace(omega=measured),
        after=SimpleNamespace(omega=left),
    )


def test_model_error_is_interrupted_at_gaps_and_has_what_is_explained():
    time = np.array([0.0, 1.0, 2.0, 10.0, 11.0])
    measured = np.arange(15.0).reshape(5, 3)
    left, std = 0.25 * measured, np.full((5, 3), 2.0)
    made = figures.model_error(windows(time, measured, left), std, True)
    for axis, panel in enumerate(made.panels):
        drawn = marks(panel)
        assert drawn["measured"].x == pytest.approx([0.0, 1.0, 2.0, np.nan, 10.0, 11.0], nan_ok=True)
        assert drawn["measured"].y[[0, 1, 2, 4, 5]] == pytest.approx(measured[:, axis])
        assert drawn["explained"].y[[0, 1, 2, 4, 5]] == pytest.approx(0.75 * measured[:, axis])
        band = drawn["uncertainty, 95 %"]
        assert np.ptp(band.y[band.x == 0.0]) == pytest.approx(2.0 * 1.96 * 2.0, rel=1e-3)
        assert band.area
    assert [panel.y.label for panel in made.panels] == ["ω X [N]", "ω Y [N]", "ω N [N·m]"]
    assert [*made.legend] == ["uncertainty, 95 %", "measured", "explained"]
    plain = figures.model_error(windows(time, measured, left), None, False)
    assert [*plain.legend] == ["measured"]


def profiles(rms, covariate=SPEED):
    edges, noise = np.array([0.0, 1.0, 3.0]), np.array([0.5, 0.25])
    every = zip("XYN", (1.0, 2.0, 3.0), strict=True)
    return [Profile(a, covariate, None, edges, f * np.array(rms), noise, np.ones(2)) for a, f in every]


def test_profile_has_its_bins_before_and_after_in_the_units_of_people():
    others = profiles([9.0, 9.0])
    made = figures.profile(
        HEADING, [*others, *profiles([2.0, 4.0], HEADING)], profiles([1.0, 3.0], HEADING)
    )
    for k, panel in enumerate(made.panels, 1):
        drawn = marks(panel)
        assert drawn["before"].x == pytest.approx(np.degrees([0.0, 1.0, 1.0, 3.0]))
        assert drawn["before"].y.tolist() == [2.0 * k, 2.0 * k, 4.0 * k, 4.0 * k]
        assert drawn["after"].y.tolist() == [k, k, 3.0 * k, 3.0 * k]
        assert panel.ends()[1][0] <= 0.0
    assert [panel.x.shown for panel in made.panels] == [False, False, True], "once, as it is the same"
    assert [*made.legend] == ["noise", "before", "after"]
    own = figures.profile(figures.THRUST, profiles([1.0, 2.0], figures.THRUST))
    assert [panel.x.shown for panel in own.panels] == [True, True, True]
    assert [*own.legend] == ["noise", "model error"]


def test_profile_over_what_never_changes_has_one_bin():
    one = np.ones(1)
    edge = [Profile(a, SPEED, None, np.array([0.2]), one, one, one) for a in "XYN"]
    made = figures.profile(SPEED, edge, edge)
    assert made.panels[0].x.limits == (0.2, 0.2)
    assert "nan" not in made.svg("key", "label")


def test_ranking_is_from_the_best_down_with_what_ties_hollow():
    made = [
        ranked("a", 0.0, 0.0, beyond=0.9),
        ranked("b", 1.0, 1.0, beyond=-0.1),
        ranked("c", 5.0, 1.0, q2=0.5),
        ranked("d", 6.0, 1.0, q2=np.nan),
    ]
    (panel,) = figures.ranking(made).panels
    assert panel.y.names == ["a", "b", "c", "d"]
    assert panel.ends()[1] == (4.0, -1.0), "the best is above"
    assert [*panel.notes.values()] == ["90 %", "0 %", "50 %", ""]
    labels = ["best", "not clearly worse", "clearly worse"]
    assert [*figures.ranking(made).legend] == labels, "the picture explains hollow and grey dots"
    tiny = [ranked("a", 0.0, 0.0, beyond=8.9e-38)]
    assert [*figures.ranking(tiny).panels[0].notes.values()] == ["< 1 %"]
    dots = [m for m in panel.marks if m.dots]
    assert [m.x[0] for m in dots] == [0.0, 1.0, 5.0, 6.0]
    assert [m.colour for m in dots] == [figures.AFTER] * 2 + [figures.BAND] * 2
    assert [m.hollow for m in dots] == [False, True, False, False]
    far = panel
    assert far.x.spaced(1e-3) / 1e-3 == pytest.approx(far.x.spaced(2e-3) / 2e-3, rel=1e-4), "linear"
    assert far.x.spaced(1e6) - far.x.spaced(1e5) == pytest.approx(np.log(10.0)), "logarithmic"
    (many,) = figures.ranking([ranked(f"c{k}", float(k), 1.0) for k in range(40)]).panels
    assert len(many.y.names) == 2 * figures.LENGTH
    unpaired = [ranked(n, np.nan, np.nan, score=x) for n, x in (("a", 2.0), ("b", 3.5))]
    assert [m.x[0] for m in figures.ranking(unpaired).panels[0].marks if m.dots] == [0.0, 1.5]


def test_a_curve_is_grey_where_no_data_are():
    x = np.linspace(0.0, 1.0, 11)
    c = Curve("id", "over", "what", x, x, 2.0 * x, (1.5 * x, 2.5 * x), (0.2, 1.0))
    (panel,) = figures.curve(c).panels
    drawn = marks(panel)
    assert drawn["before"].y == pytest.approx(x)
    assert drawn["learned"].y == pytest.approx(2.0 * x)
    (grey,) = (m for m in panel.marks if m.colour == figures.BAND)
    assert np.nanmax(grey.x) == pytest.approx(0.2)
    assert (panel.x.label, panel.y.label, panel.ends()[0]) == ("over", "what", (0.0, 1.0))
    assert [*figures.curve(c).legend] == ["before", "learned"]


@given(
    st.integers(0, 2**32 - 1),
    st.floats(-9.0, 9.0),
    st.one_of(st.none(), st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0))),
    st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_a_curve_has_the_values_of_its_effect_and_covers_98_percent_of_the_data(
    seed, value, about, given_ends
):
    """Its bounds are those of its coefficient, or itself; its axis is that given, or that of the data."""
    rng, model, effect = np.random.default_rng(seed), Model(), ship().effects["X_uuu"]
    runs = [rng.normal(m, 0.3, n) for m, n in ((0.0, 400), (1.0, 600))]
    ci95 = None if about is None else (value - about[0], value + about[1])
    coefficient = ReportedCoefficient(value, "N", ci95, None)
    found = SimpleNamespace(coefficients={"delta_X_uuu": coefficient, "other": coefficient})
    sweep = shape.Sweep(
        "over",
        "what",
        lambda x, m: m.value("delta_X_uuu") * x**3,
        lambda e: e,
        (-2.0, 3.0) if given_ends else None,
    )
    curve = shape._curve(found, effect, sweep, runs, model)
    data = np.sort(np.concatenate(runs))
    ends = (-2.0, 3.0) if given_ends else (data[0], data[-1])
    assert (curve.x[0], curve.x[-1]) == pytest.approx(ends)
    np.testing.assert_allclose(curve.learned, value * curve.x**3, atol=1e-9)
    np.testing.assert_array_equal(curve.nominal, 0.0)
    for bound, at in zip(curve.sure, ci95 or (value, value), strict=True):
        np.testing.assert_allclose(bound, at * curve.x**3, atol=1e-9)
    low, high = curve.covered
    share = CHANCE * data.size  # of each tail
    assert abs(np.sum(data < low) - share) <= 1
    assert abs(np.sum(data > high) - share) <= 1


@pytest.mark.parametrize(
    ("ends", "texts"),
    [
        ((-1.0, 203.0), ["0", "50", "100", "150", "200"]),
        ((-0.26, 0.26), ["−0.2", "−0.1", "0", "0.1", "0.2"]),
        ((0.0, 4.5e-6), ["0", "1e−06", "2e−06", "3e−06", "4e−06"]),
        ((1e7, 1.1e7), ["1e+07", "1.02e+07", "1.04e+07", "1.06e+07", "1.08e+07", "1.1e+07"]),
    ],
)
def test_ticks_are_round_and_differ(ends, texts):
    found = chart.ChartAxis().ticks(ends, 6)
    assert [text for _, text in found] == texts
    assert all(ends[0] <= x <= ends[1] for x, _ in found)


def test_ticks_of_a_logarithmic_axis_are_the_roundest_that_have_room():
    axis = chart.ChartAxis(scale=np.log10)
    ends = axis.ends([np.array([1.0, 1000.0])])
    assert {t for _, t in axis.ticks(ends, 5)} == {"1", "10", "100", "1000"}
    within = axis.ticks((np.log10(1.5), np.log10(8.0)), 5)
    assert {t for _, t in within} == {"2", "5"}


def test_a_chart_is_the_same_in_each_format():
    """Points at the same places by SVG and by matplotlib; what is interrupted has two parts."""
    panel = chart.Panel(chart.ChartAxis("x", (0.0, 10.0)), chart.ChartAxis("y <1>", (0.0, 1.0)))
    x = np.array([0.0, 5.0, np.nan, 6.0, 10.0])
    panel.draw(x, 0.1 * x, chart.AFTER, "line")
    panel.fill(x, 0.0 * x, 0.1 * x, chart.BAND, "area")
    panel.draw(x, 0.1 * x, chart.THIRD, "dots", dots=True, hollow=True)
    made = chart.Chart(150.0, [panel])
    (b,) = made.boxes()
    root = ElementTree.fromstring(made.svg("key", "<label>"))
    assert root.get("aria-label") == "<label>"
    paths = [e.get("d") for e in root.iter() if e.get("stroke") == chart.AFTER and e.get("clip-path")]
    (line,) = paths
    assert line.count("M") == 2
    first = [float(v) for v in line[1:].split(" ")[0].split(",")]
    assert first == pytest.approx([b.left, b.top + b.height], abs=0.06)
    circles = [e for e in root.iter() if e.tag.endswith("circle")]
    assert len(circles) == 4 + 1, "one in the legend"
    texts = [e.text for e in root.iter() if e.tag.endswith("text")]
    assert {"x", "y <1>", "line", "area", "dots", "10"} <= set(texts)
    (axes,) = made.figure().axes
    shown = {line.get_color(): line for line in axes.get_lines() if np.size(line.get_xdata()) == 5}
    assert shown[chart.AFTER].get_xdata()[0] == pytest.approx(first[0], abs=0.06)
    assert {t.get_text() for t in axes.texts} >= set(texts)
    assert [chart.PALETTE[c] for c in chart.PALETTE if c in chart.themed(made.svg("k", ""))] == []


def prediction(n=64, windows=4, growth=1.0):
    """Windows of 8 s in which the position is off by 10 mm a second, the heading by 1 degree a second."""
    since = np.tile(np.linspace(0.0, 8.0, n, endpoint=False), windows)
    off = growth * since
    residuals = np.column_stack([0.006 * off, -0.008 * off, np.radians(-off)])
    measured = np.column_stack([since, 2.0 * since, 0.0 * since])
    of = SimpleNamespace(
        since=since, length=8.0, sample_window=np.repeat(np.arange(windows), n), measured=measured
    )
    return of, residuals


def test_errors_grow_by_their_quartiles_in_millimetres_and_degrees():
    of, residuals = prediction()
    e = SimpleNamespace(
        windows=of,
        before=SimpleNamespace(residuals=residuals),
        after=SimpleNamespace(residuals=0.5 * residuals),
    )
    none = SimpleNamespace(windows=None)
    position, heading = tracks.error_growth([none, e], True).panels
    for panel, scale in ((position, 10.0), (heading, 1.0)):
        drawn = marks(panel)
        middle = drawn["before"].x
        assert middle.size == 2 * tracks.INSTANTS
        assert middle[0] == pytest.approx(0.125)
        assert drawn["before"].y == pytest.approx(scale * middle, abs=0.13 * scale)
        assert drawn["after"].y == pytest.approx(0.5 * drawn["before"].y)
        assert panel.y.scale is np.log10
    assert (position.y.label, heading.y.label) == ("position [mm]", "heading [°]")
    assert heading.ends()[0] == (0.0, 8.0)
    assert not tracks.error_growth([e], False).legend


def test_the_worst_window_is_that_with_the_largest_error_that_is_finite():
    errors = SimpleNamespace(position=np.array([1.0, np.inf, 3.0, np.nan, 2.0]))
    e = SimpleNamespace(windows="some", before=SimpleNamespace(errors=errors))
    assert tracks.worst_of(e) == 2
    assert tracks.worst_of(SimpleNamespace(windows=None)) is None
    assert tracks.worst_of(SimpleNamespace(windows="some", before=SimpleNamespace(errors=None))) is None


def test_worst_window_is_drawn_from_its_start_with_both_predictions():
    of, residuals = prediction()
    errors = SimpleNamespace(position=np.array([1.0, 2.0, 4.0, 3.0]))
    e = SimpleNamespace(
        windows=of,
        bands=None,
        model=SimpleNamespace(ship=ship()),
        before=SimpleNamespace(residuals=residuals, errors=errors),
        after=SimpleNamespace(residuals=0.0 * residuals),
    )
    drawn = tracks.worst_window(e, True).legend
    inside = of.sample_window == 2
    assert drawn["measured"].x == pytest.approx(of.measured[inside, 1])
    assert drawn["before"].x == pytest.approx((of.measured - residuals)[inside, 1])
    assert drawn["before"].y == pytest.approx((of.measured - residuals)[inside, 0])
    assert drawn["after"].y == pytest.approx(of.measured[inside, 0])
    assert tracks.heading_bands(e) is None
    assert tracks.worst_window(SimpleNamespace(windows=None), True) is None


def test_a_map_holds_all_places_in_one_scale_with_room_around():
    places = np.array([[0.0, -1.0], [10.0, 1.0]])
    panel = tracks._map(places)
    east, north = panel.ends()
    assert north == pytest.approx((5.0 - 5.25, 5.0 + 5.25), abs=1e-9)
    assert east == pytest.approx((-2.5, 2.5)), "no narrower than half of its height"
    assert (panel.x.label, panel.y.label) == ("east [m]", "north [m]")
    (box,) = tracks._chart(panel).boxes()
    assert box.width / np.ptp(east) == pytest.approx(box.height / np.ptp(north))
