"""Numbers of pages about benchmarks are those of the results that lie beside them."""

import json
import re

import numpy as np
import pytest
from support.project import ROOT

from benchmarks.logs.aims import aims
from benchmarks.logs.recorded import Recorded

BENCHMARKS = ROOT / "docs" / "benchmarks"
PAGE = (ROOT / "benchmarks" / "measured_data.md").read_text("utf-8")
# The columns of the table of logs: file of the results, effects that there are (None: not known).
LOGS = {"simulated": ["X_u"], "cse1": None, "gunnerus": None}


def column(number):
    """Row -> cell of a column of the table of slow, held and filtered logs."""
    part = PAGE.split("## Slow, held and filtered logs")[1].split("\n## ")[0]
    lines = [line.strip("| ").split(" | ") for line in part.splitlines() if line.startswith("| ")]
    return {cells[0]: cells[number + 1] for cells in lines[1:]}


@pytest.mark.parametrize(("number", "name"), [*enumerate(LOGS)])
def test_aims_of_logs_are_those_of_the_results(number, name):
    ways = json.loads((BENCHMARKS / "logs" / f"{name}_learned.json").read_text("utf-8"))["ways"]
    found = dict(aims([Recorded.of(way) for way in ways], LOGS[name]))
    stated = [re.findall(r"\d+ (?:channels )?of \d+|\d+\.\d\d|\d+ are", text) for text in found.values()]
    refused, known, bounds, doubted, others, kept, leading, sure, errors = (
        [n.replace(" channels", "").removesuffix(" are") for n in row] for row in stated
    )
    cells = [refused, known[:1], [*bounds, known[1]], doubted, others, kept, leading, sure, errors]
    for (row, cell), numbers in zip(column(number).items(), cells, strict=True):
        assert re.findall(r"\d+ of \d+|\d+\.\d\d|\d+$", re.sub(r" \(\d+ %\)", "", cell)) == numbers, row


METHODS = {
    "initial": "nominal",
    "`learn --quick`": "calibrated",
    "`learn`": "learned",
    "ridge": "ridge",
    "NARX": "narx",
    "SINDy": "sindy",
    "Kalman": "kalman_regression",
    "network": "neural",
}
OWN = "calibrated", "learned"


def test_methods_on_measured_ships_are_those_of_the_results():
    """Every row of the table, and a star where another method has a smaller error than both own ones."""
    means = json.loads((BENCHMARKS / "ships" / "results.json").read_text("utf-8"))["means"]
    page = (ROOT / "docs" / "trust.md").read_text("utf-8")
    part = page.partition("### Compared with established methods")[2]
    lines = [line.strip("| ").split(" | ") for line in part.splitlines() if line.startswith("| ")]
    (_, *head), *rows = [row for row in lines if len(row) == len(METHODS) + 1]
    assert head == [*METHODS]
    assert {row[0] for row in rows} == {*means}
    for data, *cells in rows:
        m = means[data]
        for name, cell in zip(METHODS.values(), cells, strict=True):
            shown = "–"
            if name in m:
                values = {"position": m[name]["position"], "heading": np.degrees(m[name]["heading"])}
                best = {q: min(m[own][q] for own in OWN if own in m) for q in values}
                stars = ["*" if name not in OWN and m[name][q] < best[q] else "" for q in values]
                units = zip(values.values(), stars, (" m", "°"), strict=True)
                shown = ", ".join(f"{x:.3g}{star}{unit}" for x, star, unit in units)
            assert cell == shown, (data, name)


def test_calibrated_ships_are_those_of_their_studies():
    """Position in mm and medians of windows as the table of the ships has them."""
    page = (ROOT / "docs" / "ships.md").read_text("utf-8")
    lines = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    cells = {row[0]: row[1:3] for row in lines}

    def results(study):
        return json.loads((ROOT / "docs" / "studies" / study / "results.json").read_text("utf-8"))

    (place, _, X, Y, N, thrust) = results("tanker_calibrated")["overall"]["root mean square"]
    in_mm = [f"{1e3 * x:.0f}" for x in place]
    assert cells["tanker, position over 20 s, root mean square [mm]"] == in_mm
    errors = {"model error in surge [N]": X, "in sway [N]": Y, "in yaw [N m]": N}
    errors |= {"thrust compared with the dynamometer [N]": thrust}
    for name, pair in errors.items():
        assert cells[f"tanker, {name}"] == [f"{x:.1f}" for x in pair]
    vessel = results("research_vessel")
    for k, (name, pair) in enumerate({"position": "[m]", "heading": "[°]"}.items()):
        stated = cells[f"research vessel, {name} over 60 s, median of windows {pair}"]
        assert stated == [f"{when[k]:.1f}" for when in vessel["medians of windows"]]
    circles = np.array(vessel["circles"])  # measured, before, after
    off = 100.0 * np.median(np.abs(circles[:, 1:] / circles[:, :1] - 1.0), axis=0)
    for k, name in enumerate(("speed", "yaw rate")):
        assert cells[f"research vessel, {name} of circles [%]"] == [f"{x:.1f}" for x in off[:, k]]


def test_kinds_of_tests_of_the_low_speed_tanker_are_those_of_the_study():
    page = (ROOT / "docs" / "ships.md").read_text("utf-8")
    text = (ROOT / "docs" / "studies" / "low_speed_tanker" / "results.json").read_text("utf-8")
    before, _, after, *_ = (table["rows"] for table in json.loads(text)["tables"])
    for first, last in zip(before, after, strict=True):
        pairs = [f"{x} → {y}" for x, y in zip(first[2:6], last[2:6], strict=True)]
        assert f"| {first[1]} | {' | '.join(pairs)} | {last[6]}, {last[7]} |" in page
