"""Links from words of a page to its glossary, which holds the terms of docs/glossary.md that it uses."""

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

# In an installation a copy within this package (setup.py), in a clone the page itself.
FILES = (Path(__file__).parent / "glossary.md", Path(__file__).parents[2] / "docs" / "glossary.md")
SECTIONS = ("Ship and forces", "Models and data", "Diagnosis", "Metrics")  # those that reports use
EVERYDAY = {"order", "work", "reading", "log"}  # words that sentences use in another sense as well
LINKED, LEFT = {"p", "li", "th", "figcaption"}, {"a", "b"}  # elements with links, and parts without


class GlossaryTerm(NamedTuple):
    """A row of the glossary."""

    name: str
    symbol: str
    unit: str
    meaning: str
    literature: str

    @property
    def anchor(self) -> str:
        """Its id in a page."""
        return "term-" + re.sub(r"\W+", "-", self.name)


@cache
def terms() -> dict[str, GlossaryTerm]:
    """Each word with its term; a term may have several words, such as surge, sway and yaw."""
    text = next(file for file in FILES if file.is_file()).read_text("utf-8")
    found = {}
    for heading, rows in re.findall(r"^## (.+)\n\n\|.*\n\|-.*\n((?:\|.*\n)+)", text, re.MULTILINE):
        for row in rows.splitlines() if heading in SECTIONS else ():
            term = GlossaryTerm(*(cell.strip().replace("`", "") for cell in row.strip("|").split("|")))
            found |= dict.fromkeys(set(term.name.split(", ")) - EVERYDAY, term)
    return found


@cache
def _words() -> re.Pattern[str]:
    """Any of the words, the longest first, also in the plural."""
    longest = sorted(terms(), key=len, reverse=True)
    return re.compile(rf"(?<![\w.-])({'|'.join(map(re.escape, longest))})s?(?![\w(=-]|\.\w)", re.I)


def linked(page: str) -> tuple[str, list[GlossaryTerm]]:
    """Link the first use of each term in the sentences and the column headings of a page.

    Returns:
        The page, and its terms in their order; each link leads to the anchor of a term.
    """
    used: list[GlossaryTerm] = []

    def link(m: re.Match[str]) -> str:
        term = next(t for word, t in terms().items() if word.lower() == m[1].lower())
        if term in used:
            return m[0]
        used.append(term)
        return f'<a class="term" href="#{term.anchor}" title="{term.meaning}">{m[0]}</a>'

    parts, within, left = re.split(r"(<[^>]*>)", page), False, False
    for k, part in enumerate(parts):
        if tag := re.match(r"<(/?)(\w+)", part):
            if tag[2] in LINKED:
                within = not tag[1] and not re.search("equation|scope=.row", part)
            left = not tag[1] if tag[2] in LEFT else left
        elif within and not left:
            parts[k] = _words().sub(link, part)
    return "".join(parts), used
