"""What a release promises: public names that stay, and the same description of it wherever one stands."""

import json
import re
import sys
from datetime import date
from types import ModuleType

import pytest
import typing_extensions
import yaml
from support.project import ROOT
from support.public_api import PACKAGES, lines, listing, page

from cosim.command import EXTRAS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

API = (ROOT / "docs" / "public_api.md").read_text(encoding="utf-8")
MARK = "  # deprecated"
ADVICE = (
    "is public and has changed or gone. Other programs use it: keep it, marked by typing_extensions.deprecated, for one "
    "minor version (CONTRIBUTING.md, 'A name that goes away'); then: python tests/support/public_api.py > docs/public_api.md"
)


def broken(promised, present):
    """Promised lines that no longer hold; further arguments at the end that have defaults are no break."""
    present = [line.removesuffix(MARK) for line in present]

    def still(line):
        if line in present or not line.endswith(")"):
            return line in present
        name, _, inside = line[:-1].partition("(*, ")
        if inside:  # by keyword alone, in any order
            now = [
                p[:-1].partition("(*, ")[2].split(", ") for p in present if p.startswith(f"{name}(*, ")
            ]
            further = [
                set(p) - set(inside.split(", ")) for p in now if set(p) >= set(inside.split(", "))
            ]
        else:
            further = [p[len(line) - 1 : -1].split(", ") for p in present if p.startswith(line[:-1])]
        return any(all("=" in a or a in ("", "*") for a in arguments) for arguments in further)

    return [f"{line.strip()} {ADVICE}" for line in promised if not still(line.removesuffix(MARK))]


def promised(package):
    return re.search(rf"^## {package}\n\n```text\n(.*?)\n```$", API, re.M | re.S)[1].splitlines()


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_stay(package):
    assert broken(promised(package), listing(package)) == []


def test_page_of_public_names_is_up_to_date():
    assert page() == API, "python tests/support/public_api.py > docs/public_api.md"


@pytest.mark.parametrize(
    ("before", "after", "breaks"),
    [
        ("f(a, b=1)", "f(a, b=1)", False),
        ("f(a, b=1)", "f(a, b=1, c=None)", False),
        ("f(a)", "f(a, *, c=None, d=2)", False),
        ("f()", "f(c=None)", False),
        ("f(*, a, b)", "f(*, a, c=None, b)", False),
        ("f(*, a, b)", "f(*, a, c, b)", True),
        ("f(a)", "f(a, b)", True),
        ("f(a)", "f(a, b=1, c)", True),
        ("f(a, b=1)", "f(a, b=2)", True),
        ("f(a, b)", "f(b, a)", True),
        ("f(a)", "f()", True),
        ("f(a)", "g(a)", True),
        ("f(a)", "f(a)  # deprecated", False),
        ("C.x", "C.y", True),
    ],
)
def test_a_name_that_vanishes_or_an_argument_that_changes_breaks_a_promise(before, after, breaks):
    assert bool(broken([before], [after])) == breaks


def test_page_tells_arguments_members_and_what_is_deprecated():
    class Thing:
        def __init__(self, a, b=2, *, c=()): ...

        def move(self, by): ...

        @property
        def size(self): ...

        def _hidden(self): ...

    @typing_extensions.deprecated("use Thing")
    def old(a): ...

    found = list(lines("Thing", Thing))
    assert found == ["Thing(a, b=2, *, c=...)", "    Thing.move(self, by)", "    Thing.size"]
    assert list(lines("old", old)) == ["old(a)  # deprecated"]
    assert list(lines("m", ModuleType("m"))) == ["m  # module"]


def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_descriptions_of_the_release_agree():
    stated = project()
    zenodo = json.loads((ROOT / ".zenodo.json").read_text())
    cff = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    heading = re.search(r"^## (\S+), (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert {stated["version"], zenodo["version"], cff["version"]} == {heading[1]}
    assert {zenodo["publication_date"], str(cff["date-released"])} == {heading[2]}
    assert date.fromisoformat(heading[2])
    assert {zenodo["title"], cff["title"]} == {stated["name"]}
    assert zenodo["license"] == cff["license"] == (ROOT / "LICENSE").read_text().split()[0]
    assert zenodo["keywords"] == cff["keywords"] == stated["keywords"]
    names = [a["name"] for a in stated["authors"]]
    assert [c["name"] for c in zenodo["creators"]] == [a["name"] for a in cff["authors"]] == names
    assert zenodo["description"].startswith(cff["abstract"].strip())


def test_metadata_have_what_their_readers_need():
    """Keys that Zenodo's deposit and the Citation File Format 1.2.0 demand, and values that they know."""
    zenodo = json.loads((ROOT / ".zenodo.json").read_text())
    assert {
        "title",
        "upload_type",
        "description",
        "creators",
        "access_right",
        "license",
    } <= zenodo.keys()
    assert (zenodo["upload_type"], zenodo["access_right"]) == ("software", "open")
    cff = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= cff.keys()
    assert (str(cff["cff-version"]), cff["type"]) == ("1.2.0", "software")
    (thesis,) = cff["references"]
    assert thesis["title"] in " ".join(zenodo["references"])


def test_the_readme_has_a_sentence_of_each_extra_for_users():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    users = project["optional-dependencies"].keys() - {"dev", "benchmark", "docs"}
    stated = re.findall(r"^- `(\w+)`: .+\.$", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(stated) == sorted(users)
    assert len(users) <= 6
    assert {*EXTRAS.values()} <= users
