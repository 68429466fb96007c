"""The table of the thesis' items has each of them."""

import re

import pytest
from support.project import ROOT

PAGE = "".join(
    (ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("thesis.md", "thesis_items.md")
)
# How many the thesis has, by chapter; those before chapter 2 are numbered without one.
ITEMS = {
    "equation": {"2": 39, "3": 20, "4": 63, "5": 5, "6": 2, "7": 15, "A": 12},
    "Fig": {"2": 4, "3": 5, "4": 1, "5": 13, "6": 25, "7": 18, "A": 1},
    "Table": {"": 5, "2": 1, "3": 3, "4": 3, "5": 2, "6": 4, "7": 2},
    "Algorithm": {"": 4},
}
NUMBER = r"(?:[2-9A]\.)?\d+"


def those(first, last):
    """The items from one number to another of the same chapter: 7.2, 7.4 -> 7.2, 7.3, 7.4."""
    chapter, _, start = first.rpartition(".")
    end = last.rpartition(".")[2] or start
    return {(chapter, n) for n in range(int(start), int(end) + 1)}


def named(kind):
    """The items that first columns of the page name."""
    found = set()
    for line in PAGE.splitlines():
        cell = line.split("|")[1] if line.startswith("|") else ""
        if kind == "equation":
            lists = re.findall(rf"\(({NUMBER})\)(?:-\(({NUMBER})\))?", cell)
        else:
            stated = re.findall(rf"{kind}s?\.? ((?:{NUMBER}(?:-{NUMBER})?(?:, )?)+)", cell)
            lists = [m for s in stated for m in re.findall(rf"({NUMBER})(?:-({NUMBER}))?", s)]
        for first, last in lists:
            found |= those(first, last)
    return found


@pytest.mark.parametrize("kind", ITEMS)
def test_page_has_every_item_of_the_thesis_and_no_other(kind):
    there = {(chapter, n) for chapter, count in ITEMS[kind].items() for n in range(1, count + 1)}
    assert named(kind) == there


@pytest.mark.parametrize(
    "command", sorted(set(re.findall(r"`(?:python -m )?((?:studies|thesis)\.[\w.]+\w)", PAGE)))
)
def test_studies_that_the_page_names_exist(command):
    assert (ROOT / f"{command.replace('.', '/')}.py").is_file()
