"""The count of numbers in a package: each kind is found where it is, and moving a number does not remove it."""

import re

import pytest
from support.project import ROOT

from benchmarks import constants as command
from benchmarks.constants import KINDS, attributes, constants


def counted(tmp_path, text, name="module.py"):
    """Numbers of each kind in a package of one file; kinds without any are left out."""
    (tmp_path / name).write_text(text)
    found = constants(tmp_path)
    return {k: n for k in KINDS if (n := sum(c.numbers for c in found if c.kind == k))}


SETTINGS = '''
from dataclasses import dataclass

@dataclass(frozen=True)
class Search:
    """By what it decides.

    Attributes:
        chance: [1] of a false finding; chosen.
        width, every: [s] of a window,
            and from one to the next.
    """

    chance: float
    width: float
    every: float

SEARCH = Search(chance=0.01, width=3.0, every=0.5)
'''


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("A = 0.5", {"module": 1}),
        ("A = -0.5", {"module": 1}),
        ("A: float = 0", {"module": 1}),
        ("A, B = 1.0, (2.0, 3.0)", {"module": 3}),
        ("A = 2.0 * 3.0 / (1.0 - 0.1)", {"module": 1}),
        ("A = np.array([1.0, 2.0]) / 6.0", {"module": 2}),
        ("A = {'a': 1.0, 'b': [2.0, 3.0]}", {"module": 3}),
        ("A = B[3]", {}),
        ("A = 2 * B - 1.0, round(1.0 / B), B**2", {}),
        ("A = 3.0 * B, 2.0 * np.pi, (B, 0.0)", {"module": 3}),
        ("A, B, C = range(3)", {}),
        ("A = True, None, '3'", {}),
        ("A = sorted(B, key=lambda b: b * 3.0 + 1.0)", {"literal": 1}),
        ("if True:\n    A = 3", {"module": 1}),
        ("@rule(0.3)\ndef f(): ...", {"module": 1}),
        ("class A:\n    b: float = 0.5\n    c: int\n    d = 3, 4", {"field": 3}),
        ("class A:\n    def f(self, a=0.5, *, b=3.0): return 5.0 * a", {"default": 2, "literal": 1}),
        (
            "class A:\n    b: float = 0.0\n    c: float = 1\n    d: int = Field(0, ge=0)\n    e: int = 2",
            {"field": 1},
        ),
        ("class A:\n    b: float = Field(0.0, le=5.0)\n    c = 0, 1", {"field": 4}),
        (SETTINGS, {"field": 3}),
        ("def f(a, b=0, c=-1.0, d=None): ...", {}),
        ("def f(a):\n    return a[3] + 2 * a[-1] - 1.0 + 0.5 * a ** 2", {"literal": 1}),
        ("def f(a):\n    b: float = -3.0\n    b += 4\n    return f'{a:.3f} {5}'", {"literal": 3}),
        ("def f():\n    class A:\n        b = 7\n", {"literal": 1}),
    ],
)
def test_numbers_of_each_kind(tmp_path, text, expected):
    assert counted(tmp_path, text) == expected


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.json", '{"a": [1, 2.5, "3", true], "b": {"c": -1}}', 3),
        ("a.toml", 'a = 1\nb = [2.0, 3.0]\nc = "4"\n[d]\ne = 5', 4),
        ("a.csv", "name,value\nx,1.0\ny,2e3\n", 2),
        (
            "a.mplstyle",
            "# 3 lines\nfigure.dpi: 100\nfigure.figsize: 8, 5  # in\nfont.family: serif\n",
            3,
        ),
        ("a.txt", "1 2 3", 0),
    ],
)
def test_numbers_in_data_files(tmp_path, name, text, expected):
    assert counted(tmp_path, text, name).get("data", 0) == expected


@pytest.mark.parametrize(
    "texts",
    [
        ("A = 0.3", "def f(a):\n    return 0.3 * a", "def f(a=0.3): ...", "class A:\n    a = 0.3"),
        ("A = 0.3\nB = 0.4", "A, B = 0.3, 0.4", "A = {'a': 0.3, 'b': 0.4}"),
    ],
)
def test_moving_and_merging_keep_the_count(tmp_path, texts):
    assert len({sum(counted(tmp_path, text).values()) for text in texts}) == 1


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("# Chosen.\nA = 0.5  # s", "s. Chosen."),
        ("A = 0.5  # s; chosen", "s; chosen"),
        ("# Of a window.\n# Chosen.\nA = 0.5", "Of a window. Chosen."),
        ("# Of another one.\n\nA = 0.5", ""),
        ("B = ()  # of another one\nA = 0.5", ""),
        ("A = (\n    0.5,  # s\n)", "s"),
        ("class M:\n    a: float = Field(0.9, description='smallest share')", "smallest share"),
        (SETTINGS, "[1] of a false finding; chosen."),
    ],
)
def test_reasons(tmp_path, text, reason):
    (tmp_path / "module.py").write_text(text)
    assert constants(tmp_path)[0].reason == reason


def test_entries_of_a_docstring():
    found = attributes("Of a room.\n\nAttributes:\n    a: [s] one\n        more.\n    b, c: two")
    assert found == {"a": "[s] one more.", "b": "two", "c": "two"}


def test_the_command_counts_lists_and_refuses(tmp_path, capsys):
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "a.py").write_text("A = 0.5\nB = 0.1, 3.0  # m; derived\n")
    (tmp_path / "b.py").write_text("def f(a):\n    return 7.0 * a\n")
    run = [str(tmp_path)]
    assert command.main(run) == 0
    assert "| room | 3 | 0 | 0 | 0 | 0 | 3 |\n| all | 3 | 0 | 0 | 1 | 0 | 4 |" in capsys.readouterr().out
    assert command.main([*run, "--by", "kind", "--most", "4"]) == 0
    assert "\n2 names of constants" in capsys.readouterr().out
    assert command.main([*run, "--most", "3"]) == 1
    assert command.main([*run, "--most", "1", "--without", "room"]) == 0
    assert command.main([*run, "--most", "3", "--kinds", "module"]) == 0
    capsys.readouterr()
    command.main([*run, "--list"])
    assert "room/a.py:2: module B = (0.1, 3.0)  # m; derived" in capsys.readouterr().out
    command.main([*run, "--unexplained"])
    assert capsys.readouterr().out == "room/a.py:1: module A = 0.5\n"


def test_the_page_is_current(capsys):
    """``python -m benchmarks.constants --page > docs/constants.md`` brings it up to date."""
    command.main(["--page"])
    assert (ROOT / "docs" / "constants.md").read_text() == capsys.readouterr().out


def test_each_constant_of_the_page_has_a_unit_and_a_reason():
    rows = [
        re.split(r"(?<!\\)\|", line)[1:-1]
        for line in (ROOT / "docs" / "constants.md").read_text().splitlines()
        if line.startswith("| `")
    ]
    assert {len(row) for row in rows} == {4}
    assert [row[0] for row in rows if not all(cell.strip() for cell in row)] == []
