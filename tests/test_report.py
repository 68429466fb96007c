"""The report: one page that needs no other file, and how a browser shows it."""

import base64
import html
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from support import reported
from support.chromium import Tab, opened
from support.cse1 import EFFECTS
from support.measured import sail, smoothed
from support.project import ROOT

from diagnosis import Comparison, Model, PredictionError, evaluate_run
from diagnosis.assessment.covariates import EAST, NORTH, SPEED, means_of_run
from diagnosis.assessment.regions import Region
from diagnosis.predictors import weak_windows
from diagnosis.predictors.windows import free_runs
from diagnosis.report import (
    Curve,
    ReportData,
    curves,
    glossary,
    headline,
    page,
    write_report,
)
from diagnosis.report.pictures import tracks
from diagnosis.report.pictures.chart import Text
from diagnosis.report.report_data import error_changes
from diagnosis.report.reported_effect import ReportedCoefficient
from diagnosis.runs.sensors.sensor_finding import Examined, SensorFinding
from fmus.ship import ship
from fmus.ships.naming import described_ship

HIDDEN = {"thrust_curve_deadband": 0.1, "thrust_curve_astern": -0.3}
EVIL = "<script>alert(1)</script> & $x_1$ \" id=\"body' onload='x"


@pytest.fixture(scope="module")
def data():
    runs = [sail(40.0, thrusters=HIDDEN, seed=k)[0] for k in range(2)]
    return [weak_windows(smoothed(replace(r, name=n))) for r, n in zip(runs, (EVIL, "b"), strict=True)]


@pytest.fixture(scope="module")
def evaluations(data):
    after = Model().plus(HIDDEN)
    return [evaluate_run(w, Model(), after, held_out=k == 1) for k, w in enumerate(data)]


def seen_in(report, folder, width):
    """Numbers of a page of some width [px], see MEASURE."""
    with Tab(report, folder) as tab:
        tab.size(width, 800)
        tab.wait("document.readyState === 'complete'")
        found = tab.evaluate(MEASURE)
        assert tab.console == []
    return found


def compared(evaluations, **before):
    """The comparison of these runs; of where the model fails, something else than there is."""
    std = [np.full_like(e.before.omega, 0.01) for e in evaluations]
    c = Comparison(evaluations, std, evaluations[0].predictor)
    vars(c)["before"] = replace(c.before, **before)
    return c


def found(evaluations):
    """A diagnosis with one effect."""
    values = {n: ReportedCoefficient(v, "1", (v - 0.01, v + 0.01), None) for n, v in HIDDEN.items()}
    effect = reported.effect(
        "thrust_curve",
        0.97,
        coefficients=values,
        indistinguishable=["curve_vsp_x(c)"],
        advice="run astern & <b>slowly</b>",
        sentence=f"The propellers of {EVIL} give too little.",
        equation="f = k c",
    )
    names = ["vessel.N_r", "vessel.Y_r"]
    ranking = [
        reported.ranked("thrust_curve", 0.0, 0.0, beyond=0.9),
        reported.ranked("curve_vsp_x(c)", 2.0, 3.0, beyond=0.8),
        reported.ranked("X_u", 890.0, 40.0, q2=-0.1, beyond=-0.2),
    ]
    d = reported.diagnosis(
        verdict="ambiguous",
        learned=reported.learned(ranking, [("N_r", -4.2, -2.3)]),
        posterior=SimpleNamespace(
            names=names, correlation=np.array([[1.0, 0.98], [0.98, 1.0]]), together=[names], std={}
        ),
    )
    return reported.report_data(compared(evaluations), d, [effect])


@pytest.fixture(scope="module")
def report(evaluations, tmp_path_factory):
    return write_report(tmp_path_factory.mktemp("report") / "report.html", found(evaluations))


class Page(HTMLParser):
    """Elements, attributes and text of a page."""

    EMPTY = ("meta", "br", "link", "img")

    def __init__(self, path):
        super().__init__()
        self.tags, self.attributes, self.text, self.open = Counter(), [], [], []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()

    def handle_starttag(self, tag, attrs):
        self.handle_startendtag(tag, attrs)
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags[tag] += 1
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)

    def values(self, *names):
        return [value for name, value in self.attributes if name in names]


def saved(page):
    """What the links of pictures hold."""
    return [link for link in page.values("href") if link.startswith("data:image/svg+xml;base64,")]


def test_every_picture_can_be_saved_as_a_file(report):
    page = Page(report)
    links, names = saved(page), page.values("download")
    assert len(links) == len(set(names)) == page.tags["svg"]
    for link, name in zip(links, names, strict=True):
        text = base64.b64decode(link.partition(",")[2]).decode()
        assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
        assert "var(--" not in text  # the colours of the page, which is not there
        assert name.endswith(".svg")


def test_page_is_whole_by_itself(report):
    page = Page(report)
    assert not page.open
    assert page.tags["figure"] == page.tags["figcaption"] == page.tags["svg"] > 10
    assert not page.tags["link"] + page.tags["img"] + page.tags["iframe"]
    assert "src" not in dict(page.attributes)
    ids = page.values("id")
    assert ids
    assert len(set(ids)) == len(ids)
    references = [r for r in page.values("href", "xlink:href", "src") if r not in saved(page)]
    references += [
        f"#{name}"
        for v in page.values("clip-path", "style")
        for name in re.findall(r"url\(#([^)]+)\)", v)
    ]
    assert references
    assert {r[:1] for r in references} == {"#"}
    assert {r[1:] for r in references} <= set(ids)
    content = report.read_text(encoding="utf-8")
    assert not re.search(r"url\((?!#)|@import", content)
    assert report.stat().st_size < 3e6


def test_nobodys_text_becomes_part_of_the_page(report):
    page = Page(report)
    text = "".join(page.text)
    assert text.count(EVIL) >= 4
    assert "run astern & <b>slowly</b>" in text
    assert not [name for name, _ in page.attributes if name.startswith("on")]
    assert "body" not in page.values("id")


def test_page_says_what_the_result_says(report, evaluations):
    assert "after" in Page(report).text
    text = " ".join("".join(Page(report).text).split())
    for e in evaluations:
        assert f"{1e3 * e.before.position:.3g} → {1e3 * e.after.position:.3g}" in text
    assert "curve_vsp_x(c)" in text
    assert "97 %" in text
    assert "several candidates" in text
    assert "8 s of a run, predicted from its measured state at the start; of ω: 3 s" in text
    assert "−4.2" in text


def test_every_colour_follows_the_page(report):
    """No hexadecimal colour is left in a figure: on a dark screen it could not be seen."""
    figures = re.findall(r"<svg.*?</svg>", report.read_text(encoding="utf-8"), re.DOTALL)
    assert figures
    assert not [
        c for f in figures for c in re.findall(r'(?:style|fill|stroke)="[^"]*(#[0-9a-fA-F]{6})', f)
    ]


def test_same_input_gives_the_same_bytes(report, evaluations, tmp_path):
    again = write_report(tmp_path / "again.html", found(evaluations))
    assert again.read_bytes() == report.read_bytes()


def test_comparison_has_no_after(data, tmp_path):
    c = compared([evaluate_run(w, Model()) for w in data[1:]], sentences=["Surge is worst <astern>."])
    text = Page(write_report(tmp_path / "report.html", ReportData(c))).text
    assert "Surge is worst <astern>." in "".join(text)
    assert "model error" in text  # in a legend
    assert "after" not in text


def test_page_of_nothing_found_and_numbers_that_are_not_there(data, tmp_path):
    evaluations = [replace(evaluate_run(w, Model()), windows=None) for w in data[1:]]
    e = evaluations[0]
    evaluations = [replace(e, before=replace(e.before, errors=None), after=e.before)]
    r = reported.report_data(compared(evaluations), reported.diagnosis())
    text = " ".join(Page(write_report(tmp_path / "report.html", r)).text)
    assert "no missing effect" in text
    assert "None" not in text
    assert not re.search(r"\bnan\b", text, re.IGNORECASE)


@pytest.mark.parametrize(
    ("fate", "stated"),
    [
        ({}, "u reads 5 % too little"),
        ({"repaired": False}, "u reads 5 % too little (not repaired)"),
        ({"repaired": False, "aside": ("u", "v")}, "(not repaired; u and v not used)"),
    ],
)
def test_a_fault_of_a_channel_has_its_row(evaluations, tmp_path, fate, stated):
    fault = SensorFinding("u", "scale", 0.95, "1", (0.9, 1.0), 0.0, 9.0, "u reads 5 % too little")
    first = evaluations[0]
    examined = replace(
        first.smoothed, sensors=Examined(first.weak_windows.run, (replace(fault, **fate),))
    )
    faulty = replace(first, weak_windows=replace(first.weak_windows, smoothed=examined))
    page = write_report(tmp_path / "report.html", ReportData(compared([faulty]))).read_text("utf-8")
    assert f"{stated}</td>" in page


def test_nothing_half_written_stays(evaluations, tmp_path, monkeypatch):
    (tmp_path / "report.html").write_text("old")

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_report(tmp_path / "report.html", found(evaluations), advance=stop)
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text() == "old"


def test_model_that_runs_away_is_drawn(evaluations, tmp_path):
    e = evaluations[0]
    assert e.windows is not None
    diverged = np.arange(len(e.before.residuals))[:, None] % 400 > 200
    residuals = np.where(diverged, np.inf, e.before.residuals)
    before = PredictionError(e.before.omega, residuals, e.windows.summary(residuals))
    wild = replace(e, before=before)
    assert Page(write_report(tmp_path / "report.html", ReportData(compared([wild])))).tags["svg"]


SHAPES = {
    "curve_X(u)": {"curve_X_u_12": 0.2},
    "curve_vsp_x(c)": {"curve_vsp_x_c_11": -0.1},
    "curve_vsp_y(c)": {"curve_vsp_y_c_11": -0.1},
    "curve_bow(|u|)": {"curve_bow_u_1": -0.5},
    "bow_speed_loss": {"bow_speed_loss": 2.0},
    "deadband": {"deadband": 0.05},
    "saturation": {"saturation_bow": 1.0},
    "thrust_curve": HIDDEN,
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_that_of_the_effect(name, evaluations, tmp_path):
    given = {n: ReportedCoefficient(v, "1", (v - 0.1, v + 0.1), None) for n, v in SHAPES[name].items()}
    drawn = [*curves([reported.effect(name, 0.9, coefficients=given)], evaluations)]
    assert drawn
    for c in drawn:
        assert isinstance(c, Curve)
        assert c.covered[0] < c.covered[1]
        assert (c.sure is not None) == EFFECTS[name].linear
        if c.sure is not None:
            assert (c.sure[0] <= c.learned + 1e-12).all()
            assert (c.learned <= c.sure[1] + 1e-12).all()
    assert not [*curves([reported.effect(name, 0.9)], evaluations)]


def test_dead_band_is_seen_in_its_shape(evaluations):
    given = {"deadband": ReportedCoefficient(0.05, "1", None, None)}
    (vsp, bow) = curves([reported.effect("deadband", 0.9, coefficients=given)], evaluations)
    for c in (vsp, bow):
        assert np.allclose(c.learned[np.abs(c.x) < 0.05], 0.0)
        assert np.interp(0.5, c.x, c.learned) == pytest.approx(0.45, abs=1e-9)
        assert np.allclose(c.learned, -c.learned[::-1])


@pytest.fixture
def browser(tmp_path):
    """A function that runs headless Chromium without network, and gives what it printed."""
    return lambda page, *options: opened(page, tmp_path, *options)


MEASURE = """(() => {
  const page = document.documentElement, found = { folded: page.scrollHeight };
  const said = t => getComputedStyle(t, "::before").height.replace("auto", "0px") != "0px";
  const closed = [...page.querySelectorAll(".table")].filter(t => t.checkVisibility());
  found.unsaid = closed.filter(t => said(t) != (t.scrollWidth > t.clientWidth)).length;
  page.querySelectorAll("details").forEach(d => d.open = true);
  const heads = [...page.querySelectorAll("thead th")].map(h => getComputedStyle(h).whiteSpace);
  found.unwrapped = heads.filter(w => w == "nowrap").length;
  const figures = [...page.querySelectorAll("svg")].map(f => f.getBoundingClientRect());
  found.width = page.scrollWidth;
  found.height = page.scrollHeight;
  found.figures = figures.length;
  found.thin = figures.filter(f => f.width < 250 || f.height < 100).length;
  const tables = [...page.querySelectorAll(".table")];
  found.cut = tables.filter(t => t.scrollWidth > t.clientWidth).length;
  found.wide = figures.filter(f => f.right > page.clientWidth).length;
  return found;
})()"""


@pytest.mark.parametrize("width", [390, 1200])
def test_browser_shows_the_page_without_a_sideways_scroll(report, tmp_path, width):
    seen = seen_in(report, tmp_path, width)
    assert seen["width"] == width
    assert seen["height"] > 2000
    assert seen["figures"] == Page(report).tags["svg"]
    assert seen["thin"] == seen["wide"] == 0
    assert width < 1000 or seen["cut"] == 0  # on a phone tables may be scrolled
    assert seen["unsaid"] == 0, "and say so"
    assert seen["unwrapped"] == 0, "headings"


@pytest.mark.slow
def test_a_report_of_nine_runs_is_six_screens(evaluations, tmp_path):
    """Of 1280 x 900; the pictures of each run are folded, and can be opened."""
    nine = [replace(e, use=use) for e in evaluations[:1] for use in ("train",) * 6 + ("test",) * 3]
    page = write_report(tmp_path / "report.html", found(nine))
    assert seen_in(page, tmp_path, 1280)["folded"] <= 6 * 900
    summaries = re.findall(r"<summary>([^<]*): (\d) pictures</summary>", page.read_text("utf-8"))
    assert len(summaries) == 9
    assert all(int(count) >= 4 for _, count in summaries)


def test_a_title_has_ship_runs_date_and_verdict(evaluations, data, tmp_path):
    title = headline.page_title(found(evaluations), "2026-11-25")
    assert title == f"CyberShip Enterprise 1, {EVIL} and b, 2026-11-25: {headline.VERDICTS['ambiguous']}"
    many = headline.page_title(found([evaluations[1]] * 9), "2026-11-25")
    assert many.startswith("CyberShip Enterprise 1, 9 runs, 2026-11-25: ")
    alone = headline.page_title(ReportData(compared(evaluations)), "2026-11-25")
    assert alone.endswith(": comparison of model and measurements")


def test_a_rise_within_the_noise_is_grey(evaluations):
    """A force below its uncertainty, a prediction within its paired standard errors; else it is orange."""
    r = found(evaluations)
    position = error_changes(r, 0)[0]
    assert position.kind == "fall"
    e = evaluations[0]
    for size, kind in ((0.012, "noise"), (0.1, "rise")):
        omega = np.full_like(e.before.omega, size)
        worse = replace(
            e, after=replace(e.after, omega=omega), before=replace(e.before, omega=0.5 * omega)
        )
        changed = error_changes(found([worse]), 0)[2:]
        assert {c.kind for c in changed} == {kind}, "the standard deviation is 0.01"
        assert {c.ratio for c in changed} == {"0.5×"}
    errors = e.before.errors
    rng = np.random.default_rng(1)
    for shift, kind in ((0.0, "noise"), (0.5, "rise")):
        factor = np.exp(
            shift + 0.01 + 0.3 * rng.permutation(np.linspace(-1.0, 1.0, errors.position.size))
        )
        after = replace(e.before, errors=replace(errors, position=factor * errors.position))
        if after.position > e.before.position:
            assert error_changes(found([replace(e, after=after)]), 0)[0].kind == kind


def test_browser_has_nothing_to_complain_of_and_prints(report, browser, tmp_path):
    dom = browser(report, "--dump-dom")
    assert "thrust_curve" in dom
    assert dom.count("<svg") == Page(report).tags["svg"]
    printed = tmp_path / "report.pdf"
    browser(report, f"--print-to-pdf={printed}")
    content = printed.read_bytes()
    assert content.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", content)) >= 3


@pytest.mark.parametrize(("by", "drawn"), [(EAST, True), (NORTH, True), (SPEED, False)])
def test_what_is_found_at_a_place_has_a_picture_of_the_place(data, tmp_path, by, drawn):
    region = Region("X", by, None, 1.0, None, 0.2, 0.1, 0.3, 0.0, 1.0, 2.0)
    c = compared([evaluate_run(w, Model()) for w in data[1:]], regions=[region])
    page = Page(write_report(tmp_path / "report.html", ReportData(c)))
    assert ("place-0.svg" in page.values("download")) is drawn
    assert page.values("download").count("free.svg") == 1


def test_runs_say_what_their_data_were_used_for(evaluations, tmp_path):
    """In tables and below pictures; the main numbers are those of the runs that nothing has used."""
    uses = [replace(evaluations[0], use=use) for use in ("train", "validate")]
    r = found([*uses, evaluations[1]])
    assert [r.use(e) for e in r.evaluations] == ["training", "validation", "test"]
    text = " ".join("".join(Page(write_report(tmp_path / "report.html", r)).text).split())
    for e in r.evaluations:
        assert f"{e.name} {r.use(e)}" in text, "a row of a table"
        assert f"{e.name} ({r.use(e)}): the worst window." in text
        assert f"Prediction error over time, {r.use(e)} runs" in text
    assert [remark.partition(",")[0] for *_, remark in page._tiles(r)] == 2 * ["test runs"]


@pytest.mark.parametrize(
    ("after", "shown", "remark"),
    [
        ([0.01, 0.03], "50 → 22.4 mm", "test runs, 2.2× less"),
        ([0.1, 0.0], "50 → 70.7 mm", "test runs, more than before"),
        ([0.01, np.nan], "50 mm", "test runs"),
    ],
)
def test_errors_of_runs_are_told_as_their_root_mean_square(after, shown, remark):
    pairs = [*zip((0.01, 0.07), after, strict=True)]  # sqrt((1 + 49) / 2) = 5
    (tile,) = page._tile("error", pairs, 1e3, "mm", "test runs")
    assert tile == ("error", shown, remark)
    assert not list(page._tile("error", [(np.nan, np.nan)], 1.0, "mm", ""))


def test_lines_point_where_the_missing_force_does(data):
    """A force to the north and to the east by the heading of the ship, from its own axes."""
    e = evaluate_run(data[1], Model())
    north, east = 0.3, -0.2
    psi = means_of_run(e.weak_windows)[3]
    c, s = np.cos(psi), np.sin(psi)
    omega = np.column_stack([c * north + s * east, c * east - s * north, 0.0 * c])
    known = replace(e, before=replace(e.before, omega=omega))
    arrows = tracks.place(known, False).legend["predicted"]
    ends, tips = (np.column_stack([v[k::3] for v in arrows[:2]]) for k in (0, 1))
    assert np.allclose((tips - ends)[:, 0] / (tips - ends)[:, 1], east / north)
    assert (tips > ends)[:, 1].all()


def test_a_picture_has_at_most_eight_ellipses_and_eight_ships(data):
    e = evaluate_run(data[1], Model(), Model().plus(HIDDEN))
    assert e.windows is not None
    since = np.linspace(0.0, e.windows.length, 17)
    starts = tracks.worst_of(e)
    many = SimpleNamespace(ellipses=lambda window, level: np.tile(level + 0.1 * since, (2, 30, 1)).T)
    chart = tracks.worst_window(replace(e, bands=many), True)
    areas = [m for m in chart.panels[0].marks if m.area]
    count = sum(np.count_nonzero(np.isnan(m.x)) for m in areas)
    assert starts is not None
    assert count == 8
    last = max(np.nanmax(m.x) for m in areas)
    assert last == pytest.approx(0.9 + 0.1 * since[-1]), "that of the end among them"
    poses = np.tile([0.0, 0.0, 0.0], (30, 1))
    panel = tracks._map(np.array([[-9.0, -9.0], [9.0, 9.0]]))
    tracks._ships(panel, poses, ship())
    assert len(panel.marks) == 8


def test_nothing_of_a_map_of_forces_lies_on_its_key(data):
    """Lines are seen within the panel only, in each format; the key is above it."""
    e = evaluate_run(data[1], Model(), Model().plus(HIDDEN))
    for chart in (tracks.place(e, True), tracks.place(e, True, [(5.0, 10.0)])):
        (box,) = chart.boxes()
        free = [(item, inside) for item, inside in chart.drawn() if inside is None]
        key = [i for i, _ in free if not isinstance(i, Text) and np.max(i.y) < box.top]
        words = [i for i, _ in free if isinstance(i, Text) and i.y < box.top]
        assert len(key) == len(words) == len(chart.legend)
        for line, word, following in zip(key, words, [*key[1:], None], strict=True):
            assert np.max(line.x) < word.x
            assert following is None or word.x + 5.2 * len(word.text) < np.min(following.x)
        (axes,) = chart.figure().axes
        boxes = [line.get_clip_box().transformed(axes.transData.inverted()) for line in axes.lines]
        tops = [min(b.y0, b.y1) for b in boxes]
        within = [item for item, inside in chart.drawn() if inside is not None]
        assert sum(top == pytest.approx(box.top) for top in tops) == len(within)


def test_the_picture_of_a_whole_run_names_the_cause(evaluations):
    r = found(evaluations)
    assert headline.cause(r) == "cause found: thrust_curve, " + EFFECTS[
        "thrust_curve"
    ].description.rstrip(".")
    made = tracks.free(r.least_used, headline.cause(r))
    assert r.least_used.use == "test"
    assert [*made.legend] == ["measured", "predicted before", "predicted after"]
    assert made.panels[0].x.label.endswith(headline.cause(r))
    assert headline.cause(ReportData(r.comparison)) == ""


def test_a_whole_run_is_predicted_from_its_first_state(data):
    """The ship with what is hidden in it stays near; the nominal one leaves."""
    s = data[1].smoothed
    measured = s.eta[np.flatnonzero(s.used)[0] :]
    away = {}
    for name, model in (("true", Model().plus(HIDDEN)), ("nominal", Model())):
        _, (pose,) = free_runs(s, [model])
        assert pose[0] == pytest.approx(measured[0], abs=1e-6)
        at = np.linspace(0, len(pose) - 1, len(measured)).round().astype(int)
        away[name] = np.hypot(*(pose[at] - measured).T[:2]).max()
    assert away["true"] < 0.1 * away["nominal"]


@pytest.mark.parametrize("name", ["cse1", "otter"])
def test_ships_have_their_own_outline_where_it_fits(name):
    """On a track of some lengths; within a window of a third of a length there is none."""
    craft = ship(description=described_ship(name))
    outline = np.array(craft.vessel.outline.corners)
    for lengths, fits in ((3.0, True), (0.3, False)):
        spread = lengths * craft.vessel.outline.length
        panel = tracks._map(np.array([[0.0, 0.0], [spread, spread]]))
        tracks._ships(panel, np.array([[1.0, 2.0, 0.5]]), craft)
        assert bool(panel.marks) is fits
        for m in panel.marks:
            corners = np.column_stack([m.x, m.y])[:-1]  # closed
            apart = [np.linalg.norm(c[:, None] - c, axis=2) for c in (corners, outline)]
            assert apart[0] == pytest.approx(apart[1])


def test_a_fall_stands_below_its_numbers_and_not_in_a_column_of_its_own(report):
    """Eleven columns of long numbers are wider than a page of 1,300 px; six are not."""
    head = report.read_text(encoding="utf-8").partition("<thead>")[2].partition("</thead>")[0]
    assert head.count("<th ") == 6


def test_terms_lead_to_the_glossary_of_the_page(report):
    """Each is linked at its first use only, has the sentence of docs/glossary.md, and none is left over."""
    text = report.read_text("utf-8")
    links = re.findall(r'<a class="term" href="#(term-[^"]+)" title="([^"]+)">([^<]+)</a>', text)
    kept = re.findall(r'<div id="(term-[^"]+)"><dt>(?:[^<]*)</dt>\s*<dd>([^<]+)</dd>', text)
    assert [anchor for anchor, _, _ in links] == [anchor for anchor, _ in kept]
    assert {"confidence", "unique contribution", "explained error"} <= {words for *_, words in links}
    glossary = (ROOT / "docs" / "glossary.md").read_text("utf-8").replace("`", "")
    for (_, meaning, _), (_, shown) in zip(links, kept, strict=True):
        assert f"| {html.unescape(meaning)} |" in glossary
        assert shown.startswith(meaning)


def test_all_terms_of_the_glossary_can_be_linked():
    rows = re.findall(
        r"^\| (?!term \|)([^|]+) \|", (ROOT / "docs" / "glossary.md").read_text("utf-8"), re.M
    )
    names = {t.name for t in glossary.terms().values()}
    assert names < set(rows)
    for name in names - glossary.EVERYDAY:
        for word in set(name.split(", ")) - glossary.EVERYDAY:
            page, used = glossary.linked(f"<p>Each {word} of <i>it</i>; {word} again.</p>")
            assert (page.count("<a "), [t.name for t in used]) == (1, [name])


@pytest.mark.parametrize(
    "page",
    [
        "<p><a href='#x'>confidence</a> <b>run</b></p>",
        "<p class='equation'>noise = 3</p><th scope='row'>prior</th><td>prior</td><h2>Noise</h2>",
        "<p>a_run run_2 noise=2 noise.csv prior(x) X_run</p>",
        "<svg><text>confidence</text></svg><style>p > noise {}</style>",
    ],
)
def test_names_code_and_links_stay_as_they_are(page):
    assert glossary.linked(page) == (page, [])


def test_a_hostile_name_stays_a_text_where_terms_are_linked():
    page, (term,) = glossary.linked(f"<p>{html.escape(EVIL + ' noise ' + EVIL)}</p>")
    assert term.name == "noise"
    assert re.sub(r"</?a[^>]*>", "", page) == f"<p>{html.escape(EVIL + ' noise ' + EVIL)}</p>"
