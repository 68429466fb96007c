"""Numbers, sentences and figures of the report, of results that were made up."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.report import figures, finding_text, formatting, headline, tracks
from diagnosis.report.panels import breaks
from diagnosis.report.profiles import BinnedError, Quantity, binned_errors
from diagnosis.report.result_keys import RankedResult
from diagnosis.report.shape import Curve
from diagnosis.report.terminal import _number as terminal_number
from diagnosis.report.terminal import _percent as terminal_percent
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


def test_numbers_have_their_digits_and_factor():
    assert formatting.number(0.12345, 2, 1000.0) == "123"
    assert formatting.number(1.2345, 2) == "1.2"
    assert formatting.unit("N.s2/m3") == "N·s²/m³"
    assert formatting.unit("1") == ""
    assert (formatting.percent(0.256), formatting.percent(None)) == ("26 %", "–")
    assert [terminal_number(x) for x in (None, 999.4, 1000.0, -12345.6, 0.12345)] == [
        "-",
        "999",
        "1000",
        "-12346",
        "0.123",
    ]
    assert terminal_number(123.4, 2) == "123"
    assert (terminal_percent(0.256), terminal_percent(0.256, 1), terminal_percent(None)) == (
        "26 %",
        "25.6 %",
        "-",
    )


@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        (10.0, 5.0, "2.0×"),
        (99.4, 10.0, "9.9×"),
        (99.5, 10.0, "10×"),
        (1.0, 2.0, "0.5×"),
        (0.0, 1.0, "0.0×"),
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


def test_glossary_has_the_lengths_of_both_windows():
    words = dict(formatting.glossary(8.0, 3.0))
    assert "8 s of a run" in words["window"]
    assert "of ω: 3 s" in words["window"]
    assert not any("{" in meaning for meaning in words.values())


def effect(name, confidence, alike=(), doubt=None):
    return SimpleNamespace(
        id=name,
        confidence=confidence,
        indistinguishable=list(alike),
        doubt=doubt,
        sentence=f"There is {name}.",
    )


def test_what_is_sure_is_a_fact_and_comes_first():
    sure, unsure = (
        effect("lag", headline.FOUND),
        effect("delay", 0.5, ["lag", "deadband"], "it is at its limit"),
    )
    assert headline.is_sure(sure)
    assert not headline.is_sure(effect("lag", headline.FOUND - 0.01))
    assert not headline.is_sure(effect("lag", None))
    assert headline.told(sure) == "There is lag."
    assert (
        headline.told(unsure)
        == "Possibly delay or lag or deadband (50 % for delay): There is delay. But it is at its limit."
    )
    assert headline.told(effect("lag", None)) == "Possibly lag: There is lag."
    both = headline.headline("found", [unsure, sure], [], [], False, False)
    assert both == f"{headline.told(sure)} {headline.told(unsure)}"


def test_headline_of_each_verdict():
    def said(verdict, possibilities=(), suspects=(), something=False, calibrated=False):
        return headline.headline(verdict, [], list(possibilities), list(suspects), something, calibrated)

    suspects = [
        SimpleNamespace(name=n, description=d)
        for n, d in zip("abcdef", ["mass", "", "", "", "", ""], strict=True)
    ]
    assert said("none") == headline.NOTHING_FOUND
    assert said("none", something=True) == headline.TOO_LITTLE
    assert said("unexplained") == headline.UNEXPLAINED
    assert said("unexplained", calibrated=True) != headline.UNEXPLAINED
    assert said("unexplained", [effect("lag", 0.1)]) == headline.NOT_BELIEVED
    assert ", above all a (mass) and b; no effect" in said("coefficients", suspects=suspects[:2])
    assert ", above all b; no effect" in said("coefficients", suspects=suspects[1:2])
    assert "a (mass), b, c, d and 2 others; no" in said("coefficients", suspects=suspects)
    assert "above all" not in said("coefficients")


def test_names_in_a_row():
    assert finding_text.listed(["a"]) == "a"
    assert finding_text.listed([*"abc"]) == "a, b or c"
    assert finding_text.listed([*"abcd"]) == "a, b, c or d"
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


# Figures


def lines(panel):
    return {line.get_label(): line for line in panel.get_lines()}


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
    figure = figures.model_error(windows(time, measured, left), std, True)
    for axis, panel in enumerate(figure.axes):
        drawn = lines(panel)
        assert drawn["measured"].get_xdata() == pytest.approx(
            [0.0, 1.0, 2.0, np.nan, 10.0, 11.0], nan_ok=True
        )
        assert drawn["measured"].get_ydata()[[0, 1, 2, 4, 5]] == pytest.approx(measured[:, axis])
        assert drawn["explained"].get_ydata()[[0, 1, 2, 4, 5]] == pytest.approx(0.75 * measured[:, axis])
        (band,) = panel.collections
        first = band.get_paths()[0].vertices
        assert np.ptp(first[first[:, 0] == 0.0][:, 1]) == pytest.approx(2.0 * 1.96 * 2.0, rel=1e-3)
    assert [panel.get_ylabel() for panel in figure.axes] == ["ω X [N]", "ω Y [N]", "ω N [N·m]"]
    assert [t.get_text() for t in figure.legends[0].get_texts()] == [
        "uncertainty, 95 %",
        "measured",
        "explained",
    ]
    plain = figures.model_error(windows(time, measured, left), None, False)
    assert "explained" not in lines(plain.axes[0])
    assert not plain.axes[0].collections
    assert breaks(np.array([0, 0, 1, 1, 2])).tolist() == [2, 4]


def test_profile_has_its_bins_before_and_after():
    edges = np.array([0.0, 1.0, 3.0])
    error = BinnedError(edges, np.array([2.0, 4.0]), np.array([1.0, 3.0]), np.array([0.5, 0.25]))
    speed = Quantity("speed", ("u", "u", "u"), lambda w: w)
    figure = figures.profile(speed, [error] * 3, True)
    points = list(figure.axes[0].get_lines())
    assert [line.get_ydata().tolist() for line in points] == [[2.0, 4.0], [1.0, 3.0]]
    assert points[0].get_xdata().tolist() == [0.5, 2.0]
    assert [panel.get_xlabel() for panel in figure.axes] == ["", "", "u"], "once, where it is the same"
    assert all(panel.get_ylim()[0] == 0.0 for panel in figure.axes)
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["noise", "before", "after"]
    own = Quantity("level", ("a", "b", "c"), lambda w: w, edges)
    figure = figures.profile(own, [error] * 3, False)
    assert [panel.get_xlabel() for panel in figure.axes] == ["a", "b", "c"]
    assert figure.axes[2].get_xticks().tolist() == [0.0, 0.75, 1.5, 2.25, 3.0]
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["noise", "model error"]


def test_bins_with_few_windows_are_empty_and_noise_has_its_own_root_mean_square():
    values = np.repeat([0.5, 1.5, 2.5, 9.0], [10, 4, 5, 3])
    quantity = Quantity("q", ("q", "q", "q"), lambda w: values, np.array([0.0, 1.0, 2.0, 3.0]))
    omega = np.column_stack([values, 2.0 * values, -values])
    e = SimpleNamespace(
        weak_windows=None, before=SimpleNamespace(omega=omega), after=SimpleNamespace(omega=0.5 * omega)
    )
    X, Y, N = binned_errors(quantity, [e], [np.full(omega.shape, 0.1)])
    assert X.before == pytest.approx([0.5, np.nan, 2.5], nan_ok=True)
    assert Y.before == pytest.approx([1.0, np.nan, 5.0], nan_ok=True)
    assert N.after == pytest.approx([0.25, np.nan, 1.25], nan_ok=True)
    assert X.uncertainty == pytest.approx([0.1, np.nan, 0.1], nan_ok=True)
    assert binned_errors(quantity, [e], None)[0].uncertainty is None


def ranked(name, behind, std, beyond=None, q2=0.5, score=None):
    return RankedResult(id=name, score=score, q2=q2, beyond=beyond, behind=behind, behind_std=std)


def test_ranking_is_from_the_best_down_with_what_ties_hollow():
    made = [
        ranked("a", 0.0, 0.0, 0.9),
        ranked("b", 1.0, 1.0, -0.1),
        ranked("c", 5.0, 1.0),
        ranked("d", 6.0, 1.0, q2=None),
    ]
    panel = figures.ranking(made).axes[0]
    assert [text.get_text() for text in panel.get_yticklabels()] == ["a", "b", "c", "d"]
    assert panel.get_ylim() == (3.5, -0.5), "the best is above"
    assert [text.get_text() for text in panel.texts] == ["90 %", "< 0 %", "50 %", ""]
    points = [bars.lines[0] for bars in panel.containers]
    assert [point.get_xdata()[0] for point in points] == [0.0, 1.0, 5.0, 6.0]
    assert [point.get_color() for point in points] == [figures.AFTER] * 2 + [figures.BAND] * 2
    assert [point.get_markerfacecolor() for point in points] == [
        figures.AFTER,
        "none",
        figures.BAND,
        figures.BAND,
    ]
    assert panel.get_xscale() == "linear"
    far = figures.ranking([*made, ranked("e", 20.1, 1.0)]).axes[0]
    assert far.get_xscale() == "symlog"
    many = figures.ranking([ranked(f"c{k}", float(k), 1.0) for k in range(40)]).axes[0]
    assert len(many.containers) == figures.MAX_RANKED
    scores = figures.ranking(
        [ranked("a", None, None, score=2.0), ranked("b", None, None, score=3.5)]
    ).axes[0]
    assert [bars.lines[0].get_xdata()[0] for bars in scores.containers] == [0.0, 1.5]


def test_a_curve_is_grey_where_no_data_are():
    x = np.linspace(0.0, 1.0, 11)
    c = Curve(
        "id", "over", "what", x, x, 2.0 * x, (1.5 * x, 2.5 * x), (0.2, 1.0), {"pulls": (x[:2], x[:2])}
    )
    figure = figures.curve(c)
    (panel,) = figure.axes
    drawn = lines(panel)
    assert drawn["before"].get_ydata() == pytest.approx(x)
    assert drawn["learned"].get_ydata() == pytest.approx(2.0 * x)
    assert drawn["pulls"].get_xdata().size == 2
    (span,) = panel.patches
    assert span.get_extents().transformed(panel.transData.inverted()).x1 == pytest.approx(0.2)
    assert (panel.get_xlabel(), panel.get_ylabel(), panel.get_xlim()) == ("over", "what", (0.0, 1.0))
    assert len(panel.collections) == 1
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["before", "learned", "pulls"]


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
    figure = tracks.error_growth([none, e], True)
    position, heading = figure.axes
    for panel, scale in ((position, 10.0), (heading, 1.0)):
        drawn = lines(panel)
        middle = drawn["before"].get_xdata()
        assert middle.size == tracks.BINS
        assert middle[0] == pytest.approx(0.125)
        assert drawn["before"].get_ydata() == pytest.approx(scale * middle, abs=0.13 * scale)
        assert drawn["after"].get_ydata() == pytest.approx(0.5 * drawn["before"].get_ydata())
        assert panel.get_yscale() == "log"
    assert (position.get_ylabel(), heading.get_ylabel()) == ("position [mm]", "heading [°]")
    assert heading.get_xlim() == (0.0, 8.0)
    assert not tracks.error_growth([e], False).legends


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
    (panel,) = tracks.worst_window(e, True).axes
    drawn = lines(panel)
    inside = of.sample_window == 2
    assert drawn["measured"].get_xdata() == pytest.approx(of.measured[inside, 1])
    assert drawn["before"].get_xdata() == pytest.approx((of.measured - residuals)[inside, 1])
    assert drawn["before"].get_ydata() == pytest.approx((of.measured - residuals)[inside, 0])
    assert drawn["after"].get_ydata() == pytest.approx(of.measured[inside, 0])
    assert tracks.heading_bands(e) is None
    assert tracks.worst_window(SimpleNamespace(windows=None), True) is None


def test_a_map_holds_all_places_in_one_scale_with_room_around():
    places = np.array([[0.0, -1.0], [10.0, 1.0]])
    _, panel = tracks._map(places)
    assert panel.get_ylim() == pytest.approx((5.0 - 5.301, 5.0 + 5.301), abs=1e-9)
    assert panel.get_xlim() == pytest.approx((-2.001, 2.001)), "no narrower than two fifths"
    assert (panel.get_xlabel(), panel.get_ylabel(), panel.get_aspect()) == ("east [m]", "north [m]", 1.0)
