"""Reports of the thesis' studies by numbers that are given: tables, sentences, pictures as SVG, lost signals."""

import json
import re
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from thesis import chapter5
from thesis.analysis import outlier_report, pls_report
from thesis.analysis.page_figure import figure_of
from thesis.error_models import lost_signals
from thesis.monte_carlo import interval, ratio
from thesis.tracking.verdict import CONTROLLERS, FOUR, short

NAN = np.nan


class Page:
    """A report that keeps what it is given."""

    def __init__(self, *_, draws=True):
        self.texts, self.headings, self.tables, self.figures, self.drawn, self.results = (
            [],
            [],
            [],
            [],
            [],
            {},
        )
        self.text, self.heading, self.draws = self.texts.append, self.headings.append, draws
        self.why = self.texts.append

    def table(self, header, rows):
        self.tables.append((header, [*rows]))

    def figure(self, name, figure, caption):
        self.figures.append((name, figure, caption))

    def picture(self, name, caption):
        self.figures.append((name, None, caption))

    def draw(self, folder, runs):
        self.drawn.append((folder, runs))

    def verdicts(self, name, rows, *_):
        self.results[name] = [*rows]

    def result(self, name, value):
        self.results[name] = value

    def write(self):
        return self


# Chapter 5


def outcome(position, done=True, start=20.0):
    names = ("second", "heading", "omega_Y", "omega_N", "iaewwt", "sigma", "rank")
    values = {n: (k + 2.0) * position for k, n in enumerate(names)}
    return SimpleNamespace(done=done, start=start, position=position, **values)


@pytest.fixture
def table(monkeypatch):
    monkeypatch.setattr(chapter5, "columns", lambda each, name: [getattr(o, name) for o in each])
    conditions = {}
    for condition, count in (("mdf", 3), ("kalman", 3), ("true", 1)):
        conditions[condition] = {
            c: [outcome(0.1 * (k + 1) * (1.0 + 0.01 * s * (k + 1))) for s in range(count)]
            for k, c in enumerate(CONTROLLERS)
        }
    conditions["mdf"][CONTROLLERS[1]][2] = outcome(0.5, False, 7.0)
    return conditions


def test_a_table_of_a_path_has_means_over_the_seeds(table):
    page = Page()
    chapter5.tables(page, "ellipse", table)
    assert page.headings == ["Ellipse"]
    assert page.texts == [
        "**mdf**, 3 seeds; from 20 s on:", "**kalman**, 3 seeds; from 20 s on:",
        "**true**, one run without noise; from 20 s on:",
    ]  # fmt: skip
    header, rows = page.tables[0]
    assert len(header) == len(rows[0]) == 9
    assert rows[1][0] == f"{CONTROLLERS[1]} (1 aborted)"
    assert rows[0][0] == CONTROLLERS[0]
    each = table["mdf"][CONTROLLERS[0]]
    assert rows[0][1] == str(interval([o.position for o in each]))
    assert rows[0][8] == str(interval([o.rank for o in each]))
    assert len(page.tables) == 3


def test_differences_are_paired_ratios_to_adaptive_backstepping(table):
    page = Page()
    chapter5.differences(page, {"ellipse": table})
    ((header, rows),) = page.tables
    others = [c for c in CONTROLLERS if c != "controller_abs"]
    assert header == ["run", *map(short, others)]
    assert [row[0] for row in rows] == ["ellipse, mdf", "ellipse, kalman"]
    base = [o.position for o in table["kalman"]["controller_abs"]]
    first = [o.position for o in table["kalman"][others[0]]]
    assert rows[1][1] == str(ratio(first, base))


@pytest.mark.parametrize("draws", [True, False])
def test_pictures_are_of_each_group_and_path(monkeypatch, draws, tmp_path):
    ran = []
    names = {c: {} for c in CONTROLLERS}
    by = {"mdf": names, "true": names, chapter5.PRINTED: {FOUR[0]: {"printed": 1}}}
    monkeypatch.setattr(chapter5, "variants", lambda path, seconds: by)
    monkeypatch.setattr(chapter5, "vary", lambda content, log: content)
    monkeypatch.setattr(chapter5, "run_all", lambda contents, *of: ran.append(contents))
    page = Page(draws=draws)
    page.folder = tmp_path
    chapter5.pictures(page, None, 1)
    assert len(ran) == draws
    if draws:
        assert ran[0].keys() == {
            f"{p}/{k}/{c}" for p in chapter5.PATHS for k in ("today", "printed") for c in CONTROLLERS
        }
        assert ran[0][f"ellipse/printed/{FOUR[0]}"] == {"printed": 1}
        assert ran[0][f"ellipse/today/{FOUR[0]}"] == {}
    assert [folder for folder, _ in page.drawn][:4] == [
        "ellipse_variants_today", "eight_variants_today", "ellipse_against_today", "eight_against_today",
    ]  # fmt: skip
    assert page.drawn[0][1] == {
        short(n): tmp_path / "logs" / "ellipse" / "today" / n / "0" for n in FOUR
    }
    captions = {name: caption for name, _, caption in page.figures}
    assert (
        captions["eight_against_today/model_error.png"]
        == "eight, against, today: model error (seed 0, Fig. 5.13)"
    )
    assert captions["ellipse_variants_printed/errors.png"].endswith("(seed 0, Fig. 5.1b)")
    assert "singular_values_printed" in captions
    assert len(page.figures) == 2 * (4 * 5 + 1)


def test_outcomes_are_sorted_by_path_and_condition(monkeypatch):
    contents = {"mdf": {"c1": 1, "c2": 2}, "true": {"c1": 3}, "mdf, stale": {"c1": 4}}
    monkeypatch.setattr(chapter5, "variants", lambda path, seconds: contents)
    asked = {}

    def run_each(todo, some, outcome, processes, advance):
        asked.update(some)
        return {key: [key] for key in todo}

    monkeypatch.setattr(chapter5, "run_each", run_each)
    found = chapter5.run(range(5), None, 1)
    assert found["eight"]["mdf"]["c2"] == [("eight", "mdf", "c2")]
    assert found.keys() == {"ellipse", "eight"}
    assert [len(asked["ellipse", c, "c1"]) for c in contents] == [5, 1, 3]


@pytest.mark.parametrize("again", [True, False])
def test_the_study_takes_the_outcomes_of_an_earlier_run(monkeypatch, again, tmp_path):
    pages = []
    monkeypatch.setattr(chapter5, "Report", lambda *of: pages.append((of, Page())) or pages[-1][1])
    monkeypatch.setattr(chapter5, "stored", lambda out: {"outcomes": "kept"})
    monkeypatch.setattr(chapter5, "records", lambda kind, of: {"ellipse": of})
    monkeypatch.setattr(chapter5, "run", lambda seeds, seconds, jobs: {"eight": "new"})
    for name in ("claims", "statements", "store_claims", "goals"):
        monkeypatch.setattr(chapter5, name, lambda by, name=name: [name])
    for name in ("differences", "tables", "pictures"):
        monkeypatch.setattr(chapter5, name, lambda page, *of, name=name: page.text((name, *of)))
    page = chapter5.study(tmp_path, range(3), 60.0, 2, again)
    found = {"ellipse": "kept"} if again else {"eight": "new"}
    assert page.results == {
        "claims": ["claims", "statements", "store_claims", "goals"],
        "outcomes": found,
    }
    ((of, _),) = pages
    assert of[3] == ({"outcomes": "kept"} if again else None)
    ((path, values),) = found.items()
    assert page.texts[-3:] == [("differences", found), ("tables", path, values), ("pictures", 60.0, 2)]
    assert page.headings == ["Conclusions of the thesis, and results here", "Pictures"]
    assert len(page.texts) == 6


# Partial least squares and principal components


def regressed(kind="quadratic", clipped=None, columns=("u", "v", "tau_X")):
    """A regression of three columns, of each axis by itself."""
    std = np.array([[0.1, 1.0, 0.1], [0.1, 0.1, 0.1], [2.0, 0.1, 0.1]])
    signs = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0]])
    B = np.array([[1.0, 1.0, 0.2], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]])
    parts = [
        SimpleNamespace(
            axes=[k], std=std[[k]], sign_changes=signs[[k]], B=B[[k]], factors=2,
            by_factors=np.array([[0.5], [0.75]]), r2_by_factors=np.array([[0.6], [0.8]]),
        )
        for k in range(3)
    ]  # fmt: skip
    values = {
        "factors": {"X": 2, "Y": 3, "N": 4},
        "r2": {"X": 0.5, "Y": 0.25, "N": 1.0},
        "q2": {"X": 0.4, "Y": 0.2, "N": 0.9},
    }
    return SimpleNamespace(
        recipe=SimpleNamespace(name="PLS2", kind=kind), parts=parts, B=B, columns=[*columns], clipped=clipped or {},
        samples=SimpleNamespace(time=np.zeros(50)), by_axis=values.__getitem__, X=np.array([[0.0, 1.0, 2.0], [4.0, 1.0, 0.0]]),
    )  # fmt: skip


def test_coefficients_that_are_not_sure_are_named_by_axis():
    # Within two deviations: v of X, u of N; just two of tau_X of X; of changing sign tau_X of Y.
    assert pls_report.insignificant(regressed()) == "X: v; Y: tau_X; N: u"
    assert pls_report.insignificant(regressed("continuous")) == ""


def test_the_sentences_of_a_regression(monkeypatch):
    monkeypatch.setattr(pls_report, "goes_into_the_plant", lambda columns: "u" in columns)
    monkeypatch.setattr(pls_report, "thrust_of", lambda r: SimpleNamespace(sentence="Thrust."))
    stable = SimpleNamespace(
        r2=np.array([0.1, 0.2, 0.3]), given_r2=np.array([0.4, 0.5, 0.6]), changed=True
    )
    first, weak, outside, thrust, last = pls_report.sentences(
        regressed(clipped={"u": 0.25, "v": 0.0}), stable
    )
    assert (
        first
        == "PLS2, 50 samples, 3 columns. R² / Q² X: 0.5 / 0.4 by 2 factors; Y: 0.25 / 0.2 by 3 factors; N: 1 / 0.9 by 4 factors."
    )
    assert weak.endswith("of another sign in another fold: X: v; Y: tau_X; N: u.")
    assert outside == "Outside of the ranges of Table 1, and clipped: u 25 %."
    assert thrust == "Thrust."
    assert last == "The nearest stable model explains R² 0.1, 0.2, 0.3, this one 0.4, 0.5, 0.6."
    stable.changed = False
    plain = [*pls_report.sentences(regressed("continuous", columns=("w",)), stable)]
    assert plain[1:] == ["The model is already stable."]
    assert len([*pls_report.sentences(regressed("continuous", columns=("w",)))]) == 1


def test_a_part_of_the_page_has_the_coefficients_of_its_axes(monkeypatch):
    made = {}
    for name in ("share_of_variance", "coefficient_bars", "loadings"):
        monkeypatch.setattr(
            pls_report.pictures, name, lambda *of, name=name: made.setdefault(name, []).append(of)
        )
    points = np.ones((4, 2))
    monkeypatch.setattr(pls_report, "correlations", lambda r, part: (points, ["a"]))
    r = regressed()
    section = pls_report._part(r, r.parts[1])
    factors, coefficients = section.tables
    assert factors.rows == [["1", "0.5"], ["2", "0.75"]]
    assert coefficients.rows[0] == ["u", "1 ± 0.1"]
    assert coefficients.rows[1][1].startswith("−1 ± 0.1")
    assert coefficients.rows[2][1].endswith(f", 1 of {pls_report.BLOCKS} of other sign")
    ((share, q2, count, _),) = made["share_of_variance"]
    assert (share.tolist(), q2.tolist(), count) == ([0.6, 0.8], [0.5, 0.75], 2)
    ((force, spread, *_),) = made["coefficient_bars"]
    scale = np.array([np.sqrt(8.0), 0.0, np.sqrt(2.0)])
    assert force == pytest.approx([1.0, -1.0, 1.0] * scale)
    assert spread == pytest.approx(0.1 * scale)
    assert len(section.plots) == 3
    points = np.ones((4, 1))
    assert len(pls_report._part(r, r.parts[1]).plots) == 2


def components():
    model = SimpleNamespace(
        samples=200, kept=2, explained=np.linspace(0.5, 1.0, 9), loadings=np.eye(9), mean=np.zeros(9),
        scale=np.ones(9), t2_limit=9.0, q_limit=3.0, variance=np.arange(9.0, 0.0, -1.0),
        scores=lambda X: X, t2=lambda X: X[:, 0], q=lambda X: X[:, 1],
    )  # fmt: skip
    samples = SimpleNamespace(
        run=np.array(["a"] * 200), time=0.5 * np.arange(200), names=["a"], nu=np.zeros((200, 3))
    )
    removed = [
        SimpleNamespace(first=4, last=4 + k % 7, why="T2", variable="u")
        for k in range(outlier_report.LISTED + 2)
    ]
    kept = np.ones(200, bool)
    kept[:5] = False
    q2 = model.explained - 0.1
    q2[7] = 1.1
    return outlier_report.OutlierComponents(samples, np.zeros((200, 9)), model, q2, removed, kept)


def test_components_are_told_with_what_was_removed():
    stated = outlier_report.content(components(), "smoothed")
    assert stated["removed_share"] == pytest.approx(0.025)
    assert stated["removed"][6] == {
        "run": "a",
        "from": 2.0,
        "to": 5.0,
        "samples": 7,
        "why": "T2",
        "variable": "u",
    }
    assert stated["loadings"].shape == (2, 9)
    first, above, gone = outlier_report.sentences(components())
    assert first.startswith(
        "2 components explain 56 % of the variance of 9 variables in 200 samples, cross-validated 46 %"
    )
    assert above.startswith("Q² exceeds R² with 8 components")
    assert gone.endswith("5 samples, 2.5 %, in 32 places.")


def test_the_page_lists_the_longest_removals(monkeypatch):
    for name in ("share_of_variance", "loadings", "cloud", "against_limit", "before_and_after"):
        monkeypatch.setattr(outlier_report.pictures, name, lambda *of, name=name: (name, *of))
    a = components()
    page = outlier_report.document(a, "smoothed")
    share, gone = page.sections
    assert [row[0] for row in share.tables[0].rows] == [str(k) for k in range(1, 10)]
    assert share.tables[1].header == ["variable", "p1", "p2"]
    assert [p.figure[0] for p in share.plots] == ["share_of_variance", "loadings", "cloud"]
    np.testing.assert_allclose(share.plots[1].figure[1][:2], np.diag([3.0, np.sqrt(8.0)]))
    rows = gone.tables[0].rows
    assert len(rows) == outlier_report.LISTED
    lengths = [row[3] for row in rows]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] == 7
    assert f"The {outlier_report.LISTED} longest of 32 are listed." in gone.text[0]
    a.model.kept, a.removed[:] = 1, []
    page = outlier_report.document(a, "smoothed")
    assert len(page.sections[0].plots) == 2
    assert page.sections[1].tables == []
    assert "are listed" not in page.sections[1].text[0]


# Pictures as SVG


def test_a_figure_is_an_element_with_ids_of_its_own():
    def drawn(key):
        figure = figure_of(1.5)
        axes = figure.subplots()
        axes.plot([0.0, 0.123456789], [0.0, 1.0])
        axes.set_title("x & y")
        return figure.svg(key, "a <line>")

    text = drawn("f1")
    root = ElementTree.fromstring(text)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert (root.get("role"), root.get("aria-label"), root.get("width"), root.get("version")) == (
        "img",
        "a <line>",
        None,
        None,
    )
    assert not {e.tag.partition("}")[2] for e in root.iter()} & {"metadata", "style"}
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert ids
    assert all(i.startswith("f1-") for i in ids)
    refers = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
    assert refers == {*ids}
    assert not re.search(r"\d\.\d{3}", " ".join(e.get("d", "") for e in root.iter()))
    assert text == drawn("f1"), "the same figure is the same text"
    assert "f2-" in drawn("f2")


# Lost signals


def test_a_copy_of_a_run_has_lost_most_of_force_and_error(tmp_path):
    whole = tmp_path / "whole"
    whole.mkdir()
    log = pd.DataFrame({n: np.arange(2000.0) for n in ("time", *lost_signals.GONE, "vessel.x")})
    log.to_csv(whole / "log.csv", index=False)
    (whole / "log.json").write_text("{}")
    found = pd.read_csv(lost_signals.lossy(whole, tmp_path / "a" / "lost") / "log.csv")
    assert (tmp_path / "a" / "lost" / "log.json").read_text() == "{}"
    gone = found[lost_signals.GONE].isna()
    assert (gone.all(axis=1) == gone.any(axis=1)).all()
    assert gone.any(axis=1).mean() == pytest.approx(0.99, abs=0.01)
    assert found["vessel.x"].tolist() == log["vessel.x"].tolist()
    kept = ~gone.any(axis=1)
    assert found.loc[kept, lost_signals.GONE[0]].tolist() == log.loc[kept, lost_signals.GONE[0]].tolist()


@pytest.mark.parametrize(("off", "holds"), [(5e-10, True), (2e-9, False)])
def test_signals_that_come_back_are_those_that_were_lost(off, holds):
    whole = {n: np.zeros(5) for n in lost_signals.Z1}
    found = {n: np.zeros(5) for n in lost_signals.Z1}
    found[lost_signals.Z1[2]][3] = -off
    verdict = lost_signals.came_back(whole, found)
    assert verdict[1] == holds
    assert f"{off:.2g} " in verdict[2]


def test_the_replay_is_shown_with_what_was_measured(monkeypatch, tmp_path):
    time = np.arange(5.0)
    found = {n: time + k for k, n in enumerate(lost_signals.Z1)}
    measured = {n: np.where(time < 2.0, NAN, x) for n, x in found.items()}
    figure = lost_signals.picture(measured, found, time)
    for k, panel in enumerate(figure.axes):
        replay, dots = panel.get_lines()
        assert replay.get_ydata().tolist() == (time + k).tolist()
        assert np.isfinite(dots.get_ydata()).sum() == 3
    assert figure.axes[0].get_ylabel().startswith("z1_x [")
    assert figure.axes[2].get_xlabel() == "time [s]"
    played = SimpleNamespace(at_samples=found.__getitem__, source=SimpleNamespace(time=time))
    seen = []
    monkeypatch.setattr(lost_signals, "lossy", lambda run, scratch: scratch.mkdir() or scratch)
    monkeypatch.setattr(lost_signals, "gather_source", lambda run: run)
    monkeypatch.setattr(lost_signals, "loop_of", lambda *of: seen.append(of))
    monkeypatch.setattr(lost_signals, "play", lambda source, loop: played)
    monkeypatch.setattr(lost_signals.cosim, "read_log", lambda run: found)
    page = Page()
    lost_signals.write_replay(page, tmp_path / "run", {"a": 1}, tmp_path / "lost")
    assert seen[0][1:3] == ("cl_win_eps", None)
    assert json.loads(seen[0][3].read_text()) == {"a": 1}
    ((verdict,),) = page.results.values()
    assert verdict[1] is True
    assert [name for name, *_ in page.figures] == ["lost_signals"]


def test_panels_have_the_style_of_the_page_and_texts_are_no_formulas():
    figure = figure_of(1.5)
    first, second = figure.subplots(2, 1)
    for panel in (first, second):
        assert not panel.spines["top"].get_visible()
        assert not panel.spines["right"].get_visible()
        assert panel.xaxis.get_gridlines()[0].get_visible()
        assert panel.yaxis.label.get_fontsize() == 9.0
    second.set_ylabel("$x$")
    second.plot([0.0, 1.0], label="$y$")
    second.legend()
    text = figure.svg("f", "it")
    assert ">$x$</text>" in text
    assert ">$y$</text>" in text
