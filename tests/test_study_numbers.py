"""Numbers of pages about studies are those of the results beside their reports."""

import json
import re
import shutil
from string import Formatter

import numpy as np
import pytest
from support.project import ROOT

from studies.study_report import cell, opening
from thesis import results_page

STUDIES = ROOT / "docs" / "studies"
WITH_TABLES = [
    path.parent
    for path in sorted(STUDIES.glob("*/results.json"))
    if '"tables"' in path.read_text("utf-8")
]


@pytest.fixture(scope="module")
def ship():
    """Results of the real ship."""
    return json.loads((STUDIES / "measured_ship" / "results.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def page():
    """What the page of the studies says of it, in one line."""
    return " ".join((ROOT / "studies" / "README.md").read_text("utf-8").split())


def ends(values, digits):
    """The least and the largest, as a page gives them."""
    return f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"


def falls(ship, kind, axis):
    return [f["axes"][axis]["out"] for f in ship["falls"].values() if f["kind"] == kind]


def test_falls_of_the_model_error_are_those_of_the_results(ship, page):
    held, hand = "dynamic positioning", "by hand"
    surge, sway = falls(ship, held, "surge"), falls(ship, hand, "sway")
    assert f"falls {surge[0]:.1f} and {surge[1]:.1f} times in surge in dynamic positioning" in page
    assert f"{sway[0]:.1f} and {sway[1]:.1f} times in sway under manual control" in page
    low, high = ends(falls(ship, held, "yaw") + falls(ship, hand, "yaw"), 1)
    assert f"{low} to {high} times in yaw" in page
    rise = sorted(1.0 / x for x in falls(ship, hand, "surge"))
    assert f"In surge under manual control it rises (to {rise[0]:.1f} and {rise[1]:.1f} times)" in page


def test_predictions_are_those_of_the_report(page):
    text = (STUDIES / "measured_ship" / "report.md").read_text("utf-8")
    part = text.split("## Prediction over 8 s")[1].split("\n## ")[0]
    rows = [line.split(" | ")[1:] for line in part.splitlines() if re.match(r"\| \w+ \| [\d.]", line)]
    before, after, _, psi_before, psi_after, _ = np.array(
        [[float(x.strip(" |")) for x in r] for r in rows]
    ).T
    low, high = ends(before / after, 1)
    assert f"positions after 8 s are {low} to {high} times better" in page
    assert (psi_after < psi_before).all()
    assert "Headings are better in all four runs" in page
    (mean,) = re.findall(r"reduction of the heading error: ([\d.]+)× left out", text)
    assert float(mean) == pytest.approx(np.exp(np.mean(np.log(psi_before / psi_after))), abs=0.01)
    assert f"{mean} times as good in the geometric mean" in page


def test_thrust_and_delay_are_those_of_the_results(ship, page):
    found = ship["bollard"]["differences"]
    everything, nominal = found["all runs"], found["nominal"]
    assert f"differs by {everything['rms']:.3f} N from the bollard pulls" in page
    assert f"nominal line {nominal['rms']:.3f} N" in page
    low, high = ends([d["rms"] for n, d in found.items() if n.startswith("without")], 3)
    assert f"{low} to {high} N if a run is left out" in page
    assert (
        f"factor it differs by {everything['scaled']:.3f} N (nominal {nominal['scaled']:.3f} N)" in page
    )
    low, high = ends(ship["late"].values(), 2)
    assert f"{low} to {high} s in the four runs" in page
    (delay,) = (row["came"] for row in ship["expected"] if row["expected"].startswith("delay"))
    assert delay == ["no"] * 4
    assert "None of the four learned models has one" in page


def test_findings_are_those_of_the_results(ship, page):
    folds = [d for name, d in ship["diagnoses"].items() if name.startswith("without")]
    assert {d["verdict"] for d in folds} == {"unexplained"}
    assert not [e for d in folds for e in d["effects"]]
    assert "all four diagnoses are `unexplained`" in page
    assert all(d["calibrated"] for d in folds)
    assert "It is calibrated in all four folds" in page
    for d in folds:
        named = {p["id"] for p in d["possibilities"]} | {s["name"] for s in d["suspect_coefficients"]}
        assert {"Y_r", "N_r"} & named
        assert named & {"deadband", "curve_vsp_x(c)"}


def test_share_of_the_residual_by_commands_is_that_of_the_results(ship, page):
    axes = ship["falls"]["random_run1"]["axes"]
    shares = [f"{100 * axes[a]['single']:.0f} %" for a in ("sway", "yaw")]
    assert f"`random_run1` {shares[0]} of the residual in sway and {shares[1]} in yaw" in page


@pytest.mark.parametrize("folder", WITH_TABLES, ids=lambda path: path.name)
def test_tables_of_a_report_are_those_of_its_results(folder):
    tables = json.loads((folder / "results.json").read_text("utf-8"))["tables"]
    text = (folder / "report.md").read_text("utf-8")
    for table in tables:
        for row in [table["header"], *table["rows"]]:
            assert f"| {' | '.join(cell(np.nan if c is None else c) for c in row)} |" in text
    rules = len(re.findall(r"^\| :-- ", text, re.MULTILINE))
    assert len(tables) == rules, "each table of the report is in the results"


@pytest.mark.parametrize("name", results_page.JUDGED)
def test_report_opens_with_the_verdicts_of_its_results(name):
    content = json.loads((STUDIES / name / "results.json").read_text("utf-8"))
    text = (STUDIES / name / "report.md").read_text("utf-8")
    (why,) = re.findall(r"^- Reason: (.*)$", text, re.MULTILINE)
    rows = results_page.judged(content)
    assert opening(rows, why)[0] in text
    for row in rows:
        here, _, numbers = (cell(x) for x in row.cells)
        assert f"| {cell(row.thesis)} | {here} | " in text
        assert f" | {numbers} |" in text


def test_page_of_the_thesis_has_the_numbers_of_its_results():
    given = (ROOT / "docs" / "thesis_results.md").read_text("utf-8")
    assert results_page.page() == given, "python -m thesis.results_page > docs/thesis_results.md"


def test_template_has_every_number_once_and_no_other():
    """A number that is typed in changes with no result; only sections, gains and limits may be."""
    template = (STUDIES / results_page.TEMPLATE).read_text("utf-8")
    names = [name for _, name, _, _ in Formatter().parse(template) if name]
    assert sorted(names) == sorted(results_page.numbers())
    text = re.sub(
        r"\{\w+\}|\(?[Ff]ootnote 1 of 4\.1\.4|\d\.\d\.\d|Chapter \d|\*\*7\.5\*\*|thesis 0\.4",
        "",
        template,
    )
    typed = set(re.findall(r"(?<![\w.])\d+(?:\.\d+)?", text))
    chosen = {
        "0",
        "0.1",
        "1",
        "10",
        "0.01",
        "2",
        "6.4.4",
        "0.16",
        "0.08",
        "9.9",
        "50",
        "6",
        "9",
        "95",
        "7.1",
        "0.3",
        "0.31",
    }
    assert typed <= chosen


def test_a_result_that_changes_changes_the_page(tmp_path):
    """The page follows the outcomes of runs, not only the tables."""
    shutil.copytree(STUDIES, tmp_path / "s", ignore=shutil.ignore_patterns("*.png", "*.md"))
    file = tmp_path / "s" / "chapter5" / "results.json"
    content = json.loads(file.read_text("utf-8"))
    for run in content["outcomes"]["ellipse"]["mdf"]["controller_abs"]:
        run["position"] *= 0.5
    file.write_text(json.dumps(content), "utf-8")
    assert results_page.numbers(tmp_path / "s")["abs_ellipse"] != results_page.numbers()["abs_ellipse"]
    assert results_page.page(tmp_path / "s") != results_page.page()


@pytest.mark.parametrize(
    ("values", "said"), [([1.2, 3.9], "1 to 4"), ([2.0, 2.1], "2"), ([1.0, float("nan")], "1")]
)
def test_range_of_numbers(values, said):
    assert results_page.ends(values) == said
