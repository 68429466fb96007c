"""Half and double of a constant: which numbers change, that all that follows from them does, and the summary."""

import ast
import subprocess
import sys

import pandas as pd
import pytest
from support.project import ROOT

from benchmarks.constants import PACKAGE, constants, deciding
from benchmarks.sensitivity import on_evidence
from benchmarks.sensitivity.__main__ import COLUMNS, Task, markdown, summary
from benchmarks.sensitivity.changed_constant import DOUBLE, HALF, change, names_of, places
from diagnosis.verdict import confidence


def values(text, name, factor):
    """Names of a module's text -> values, with one constant changed."""
    tree = ast.parse(text)
    change(tree, name, factor)
    found = {}
    exec(compile(tree, "module", "exec"), found)
    return {k: v for k, v in found.items() if not k.startswith("__")}


@pytest.mark.parametrize(
    ("text", "half", "double"),
    [
        ("A = 3.0", 1.5, 6.0),
        ("A = -0.2", -0.1, -0.4),
        ("A = 5", 2, 10),
        ("A = 1", 1, 2),
        ("A = 0.9", 0.8, 0.95),
        ("A: float = 0.5", 0.25, 1.0),
        ("A = 60.0 * 60.0", 1800.0, 7200.0),
        ("A = (0.1, 4)", (0.05, 2), (0.2, 8)),
        ("A = dict(a=2.0)", {"a": 1.0}, {"a": 4.0}),
        ("A = max(4.0, 2.0)", 2.0, 8.0),
        ("A, B = 4.0, 8.0", 2.0, 8.0),
        ("B = 2.0\nA = 3.0 * B", 6.0, 6.0),
    ],
)
def test_half_and_double(text, half, double):
    assert values(text, "A", HALF)["A"] == pytest.approx(half)
    assert values(text, "A", DOUBLE)["A"] == pytest.approx(double)


def test_one_constant_changes_and_what_follows_from_it():
    found = values("A, C = 4.0, 5.0\nB = A + 1.0\ndef f(a=A): return a", "A", DOUBLE)
    assert (found["A"], found["B"], found["C"], found["f"]()) == (8.0, 9.0, 5.0, 8.0)


@pytest.mark.parametrize("name", ["SEARCH.chance", "Search.width"])
def test_settings_change_field_by_field(name):
    text = (
        "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass Search:\n"
        "    chance: float\n    width: float = 3.0\nSEARCH = Search(chance=0.02)\n"
    )
    found = values(text, name, HALF)["SEARCH"]
    assert (found.chance, found.width) == ((0.01, 3.0) if "chance" in name else (0.02, 1.5))


def test_every_constant_of_the_page_is_found_in_its_module():
    for constant in deciding(constants(PACKAGE)):
        tree = ast.parse((PACKAGE / constant.file).read_text())
        there = {name for name, _, _ in places(tree.body)}
        for name in names_of(constant):
            assert name.partition(":")[2] in there, name


def test_a_module_is_imported_with_the_change():
    """In a process of its own; modules that import the constant have the changed one, too."""
    code = (
        "from benchmarks.sensitivity.changed_constant import import_changed\n"
        "import_changed('diagnosis.execution.progress:EVERY', 2.0)\n"
        "from diagnosis.execution.progress import EVERY; print(EVERY)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "60.0", done.stderr


def test_prepared_runs_serve_rooms_after_the_preparation():
    assert Task(0, "diagnosis.search.shortlist:NEW", HALF).prepared
    assert Task(0, "", 1.0).prepared
    assert not Task(0, "diagnosis.runs.cleaning:HELD", HALF).prepared
    assert not Task(1, "diagnosis.search.shortlist:NEW", HALF).prepared


def test_the_summary_counts_what_is_not_as_usual():
    nan = float("nan")
    rows = [
        (0, "", 1.0, "p", "found", "X_u", 1.0),
        (0, "", 1.0, "q", "none", "", nan),
        (0, "m:A", 0.5, "p", "found", "X_u", 1.001),
        (0, "m:A", 0.5, "q", "none", "", nan),
        (0, "m:A", 2.0, "p", "found", "X_u Y_v", 1.2),
        (0, "m:A", 2.0, "q", "found", "Y_v", 1.0),
        (0, "m:B", 0.5, "p", "failed", "", nan),
        (1, "m:B", 0.5, "p", "failed", "", nan),
    ]
    counts = summary(pd.DataFrame(rows, columns=COLUMNS), 0)
    assert counts.index.tolist() == ["m:A", "m:B"]
    assert counts.loc["m:A"].to_dict() == {
        ("verdicts", 0.5): 0,
        ("sets", 0.5): 0,
        ("errors", 0.5): 0,
        ("verdicts", 2.0): 1,
        ("sets", 2.0): 2,
        ("errors", 2.0): 2,
    }
    assert counts.loc["m:B", [("verdicts", 0.5), ("errors", 0.5)]].tolist() == [1, 1]
    assert "| m:A | 0 | 0 | 0 | 1 | 2 | 2 |" in markdown(counts, 2)


def test_constants_of_the_verdict_are_tried_on_saved_evidence(tmp_path):
    (tmp_path / "results.csv").write_text("effect,evidence\na,1 0 0; 0.5 0 0\nb,\nc,1 0.3 0\n")
    found = on_evidence.read(tmp_path / "results.csv")
    assert [on_evidence.outcome(e) for e in found] == ["found", "ambiguous", "ambiguous"]
    before = confidence.SURE
    changed = {name: counts for name, *counts in on_evidence.changes(found)}
    assert changed == {"SURE": [1, 1], "PER_DOUBT": [1, 1], "FOUND": [0, 0], "EVEN_ODDS": [0, 3]}
    assert before == confidence.SURE, "as it was"
