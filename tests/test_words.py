"""The prose of the pages: the field's words (docs/glossary.md), short sentences, correct spelling."""

import re
import subprocess
import sys
from functools import cache

import pytest
from markdown_it import MarkdownIt
from support.project import ROOT

LONGEST = 35  # words a sentence; the aim is 25 (CONTRIBUTING.md, 'Words')

# Phrases of this project that are not the field's, as regular expressions, with the field's word.
PRIVATE = {
    r"(?:un)?told|tells?|telling": "report, state, give",
    r"believ(?:es?|ed|ing)|beliefs?|disbelie\w+": "prior, controller model, assume",
    r"(?:holds?|held) (?:\w+ ){0,4}against": "compare with, validate against",
    r"withdraw(?:n|als?|s)?": "pruning, rejected",
    r"unseen|seen only now": "validation data, test data",
    r"unrecorded forces?": "disturbance, process noise",
    r"alike": "indistinguishable, similar",
    r"what (?:is|are|was) left|left over": "residual, remainder",
    r"(?:takes?|took|taken) (?:\w+ )?away": "explain, reduce",
    r"nothing else (?:does|takes)|by nothing else": "unique contribution",
    r"(?:goes|go|going) with": "is fixed to, belongs to, follows",
    r"miss(?:es)? by": "prediction error",
    r"stands? beside|lies? beside": "is next to, in addition to",
    r"knows? better|nobody knows|knows? nothing": "is unknown",
    r"sails?|sailed": "simulate, run",
    r"(?<!marine )crafts?": "ship, vessel",
    r"in vain|fore(?:tells?|told)|dead (?!band|time|zone|reckoning)\w+": "name the fact",
    r"look(?:s|ed)? after|reckons? with|comes? to rest|sees? to": "name the fact",
    r"(?<!there )(?<!where )(?:is|are|was|were) no (?!longer|more|less|greater)\w+": "is not a",
    r"\w+n't|(?:it|that|there|what|let)'s": "no contractions",
    r"so that\b.*\bso that": "no chain of 'so that'",
}
PHRASES = re.compile("|".join(rf"(?P<p{k}>\b(?:{p})\b)" for k, p in enumerate(PRIVATE)), re.IGNORECASE)
FIELDS = list(PRIVATE.values())
RELATIVE = re.compile(r"(?:What|Whatever|Who|Whoever)\b[^?]*$")

# Sentences that stay as they are: (page, words that it has) -> reason. At most 30.
EXCEPTIONS: dict[tuple[str, str], str] = {}

# Pages that are not yet rewritten.
LATER: set[str] = set()

PAGES = {
    path.relative_to(ROOT).as_posix(): path
    for pattern in ("*.md", "benchmarks/*.md", "studies/*.md", "docs/*.md", "docs/notebooks/*.md")
    for path in sorted(ROOT.glob(pattern))
    if path.name != "CHANGELOG.md"  # its older entries are history
}


@cache
def sentences(page):
    """(line, kind of block, sentence) of each sentence of a page; code counts as one word."""
    text = re.sub(r"\A---\n.*?\n---\n", lambda m: "\n" * m[0].count("\n"), PAGES[page].read_text("utf-8"), flags=re.S)
    tokens, found, line = MarkdownIt().enable("table").parse(text), [], 0
    for before, token in zip([None, *tokens], tokens, strict=False):
        line = token.map[0] + 1 if token.map else line
        if token.type == "inline":
            words = ("CODE" if c.type == "code_inline" else c.content or " " for c in token.children)
            for sentence in re.split(r"(?<=[.!?])\)?\s+", "".join(words)):
                found.append((line, before.type, sentence))
    return found


@cache
def faults(page):
    """What a page's prose breaks: line, rule, sentence."""
    found = []
    for line, kind, sentence in sentences(page):
        if any(page == p and part in sentence for p, part in EXCEPTIONS):
            continue
        found += [
            f"{page}:{line}: '{m[0]}' -> {FIELDS[int(m.lastgroup[1:])]}: {sentence}" for m in PHRASES.finditer(sentence)
        ]
        count = sum(any(c.isalpha() for c in word) for word in sentence.split())
        if count > LONGEST:
            found.append(f"{page}:{line}: {count} words, at most {LONGEST}: {sentence}")
        if kind == "paragraph_open" and RELATIVE.match(sentence):
            found.append(f"{page}:{line}: begins with a relative clause: {sentence}")
    return found


@pytest.mark.parametrize("page", sorted(PAGES.keys() - LATER))
def test_a_page_is_in_the_words_of_the_field(page):
    assert faults(page) == []


@pytest.mark.parametrize("page", sorted(LATER))
def test_a_page_of_the_list_of_later_ones_still_needs_it(page):
    assert faults(page), f"{page} passes: take it out of LATER"


def test_exceptions_are_few_have_reasons_and_are_needed():
    assert len(EXCEPTIONS) <= 30
    for (page, part), reason in EXCEPTIONS.items():
        assert reason
        assert any(part in sentence for _, _, sentence in sentences(page)), part


@pytest.mark.parametrize(
    ("sentence", "wrong"),
    [
        ("The report tells the reason.", True),
        ("The report states the reason.", False),
        ("A model is held against a run.", True),
        ("The held-out run decides nothing.", False),
        ("An effect is no cause.", True),
        ("There is no other cause.", False),
    ],
)
def test_the_phrases_hit_what_they_should(sentence, wrong):
    assert bool(PHRASES.search(sentence)) == wrong


def test_spelling():
    """Codespell over all prose, docstrings and messages; its words to ignore are in pyproject.toml."""
    folders = [*PAGES.values(), *(ROOT / p for p in ("cosim", "cybership", "diagnosis", "fmucheck", "fmus", "studies", "thesis"))]
    done = subprocess.run([sys.executable, "-m", "codespell_lib", *map(str, folders)], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout == ""
