"""The prose of pages and code: the field's words (docs/glossary.md), short sentences, correct spelling."""

import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from itertools import pairwise

import pytest
from markdown_it import MarkdownIt
from support import texts
from support.project import ROOT

LONGEST = 35  # words a sentence, code not counted; 25 are the aim (CONTRIBUTING.md, "Words")
LINES = 300  # of a page

# Phrases that are private to this project, as regular expressions, with the field's.
PRIVATE = {
    r"(?:un|re)?told|tells?|telling": "report, state, give, discriminate",
    r"believ(?:es?|ed|ing)|beliefs?": "prior, controller model, assume",
    r"(?:holds?|held) (?:\S+ ){0,4}against": "compare with, validate against",
    r"withdraw(?:n|als?|s|ing)?": "prune, reject",
    r"unseen|(?:seen|not seen) (?:only now|before)": "validation data, test data",
    r"unrecorded forces?": "disturbance, process noise",
    r"alike": "similar, indistinguishable",
    r"what (?:is|are|was|were) left|left over": "residual, remainder",
    r"(?:takes?|took|taken|taking) (?:\w+ )?away": "explain, reduce, remove",
    r"nothing else (?:does|takes)|by nothing else": "unique contribution",
    r"(?:goes|go|going|went) with": "is fixed to, belongs to, depends on",
    r"miss(?:es)? by": "prediction error",
    r"(?:stands?|lies?|said) beside": "is next to, in addition to",
    r"knows? better|nobody knows|knows? nothing": "is unknown",
    r"sail(?:s|ed)?|in vain|fore(?:tells?|told)|come to rest|comes to rest": "name the fact",
    r"(?<!marine )crafts?": "ship, vessel",
    r"(?<!there )(?<!where )(?:is|are|was|were) no (?!(?:more|less|better|worse|\w+er)\b)\w+": "is not a",
    r"\w+n't|(?:it|that|there|what|let)'s": "no contraction",
    r"so that\b.*\bso that": "one 'so that' a sentence",
}
PHRASES = re.compile("|".join(rf"(?P<p{k}>\b(?:{p})\b)" for k, p in enumerate(PRIVATE)), re.IGNORECASE)
RELATIVE = re.compile(r"(?:What|Whatever|Who|Whoever)\b[^?]*$")

# A sentence that may break a rule: (page or module, words of it) -> the reason. At most 30.
EXCEPTIONS: dict[tuple[str, str], str] = {
    ("cosim.Scenario.model_post_init", "that's what pydantic-core"): "a docstring of pydantic",
    ("diagnosis/report/content.py", "to=end sentence alike"): "names of fields, not prose",
}


FOLDERS = ("*.md", "benchmarks/*.md", "studies/*.md", "docs/*.md", "docs/notebooks/*.md")
PACKAGES = ("benchmarks", "cosim", "cybership", "diagnosis", "fmucheck", "fmus", "studies", "thesis")
CODE = (*PACKAGES, "help of commands", "public docstrings", "report templates")
PAGES = {
    path.relative_to(ROOT).as_posix(): path
    for folder in FOLDERS
    for path in sorted(ROOT.glob(folder))
    if path.name != "CHANGELOG.md"  # its older entries are history
}


@cache
def sentences(page):
    """(line, kind of block, sentence) of each sentence, table cell and comment of a command of a page."""
    text = re.sub(
        r"\A---\n.*?\n---\n",
        lambda m: "\n" * m[0].count("\n"),
        PAGES[page].read_text("utf-8"),
        flags=re.S,
    )
    tokens, found, line = MarkdownIt().enable("table").parse(text), [], 0
    for before, token in zip([None, *tokens], tokens, strict=False):
        line = token.map[0] + 1 if token.map else line
        if token.type == "fence" and token.info == "sh":
            found += [(line, "comment", c) for c in re.findall(r"(?:^|\s)# (.+)$", token.content, re.M)]
        if token.type == "inline":
            words = ("``" if c.type == "code_inline" else c.content or " " for c in token.children)
            for sentence in re.split(r"(?<=[.!?])[*)]*\s+", "".join(words)):
                found.append((line, before.type, sentence))
    return found


def faults(page):
    """One line for each rule that a sentence of a page breaks."""
    return [f for line, kind, sentence in sentences(page) for f in broken(page, line, kind, sentence)]


def broken(place, line, kind, sentence) -> Iterator[str]:
    """One line for each rule that a sentence breaks, but for exceptions."""
    if any(place == p and part in sentence for p, part in EXCEPTIONS):
        return
    wrong = [
        f"'{m[0]}': {[*PRIVATE.values()][int(m.lastgroup[1:])]}" for m in PHRASES.finditer(sentence)
    ]
    count = sum(any(c.isalpha() for c in word) for word in sentence.split())
    if count > LONGEST:
        wrong.append(f"{count} words, at most {LONGEST}")
    if kind == "paragraph_open" and RELATIVE.match(sentence):
        wrong.append("begins with a relative clause")
    yield from (f"{place}:{line}: {w}; in: {sentence}" for w in wrong)


@cache
def code_sentences(part):
    """(place, line, sentence) of each sentence of a part of the code, see :mod:`support.texts`."""
    if part == "help of commands":
        made = texts.parsers().items()
        found = [(module, 0, text) for module, parser in made for text in texts.help_texts(parser)]
    elif part == "public docstrings":
        found = [(name, 0, text) for name, text in texts.public_docstrings()]
    else:
        pages = part == "report templates"  # of any package, and none of an old build
        names, read = (PACKAGES, texts.template_texts) if pages else ((part,), texts.module_texts)
        paths = [p for n in names for p in (ROOT / n).rglob("templates/*.html" if pages else "*.py")]
        found = [(p.relative_to(ROOT).as_posix(), *text) for p in sorted(paths) for text in read(p)]
    return [
        (place, line, sentence.strip())
        for place, line, text in found
        for sentence in re.split(r"(?<=[.!?])[*)]*\s+|\n", text)
    ]


@pytest.mark.parametrize(
    "part", [pytest.param(p, marks=[pytest.mark.slow] * (p == "help of commands")) for p in CODE]
)
def test_the_code_speaks_in_the_words_of_the_field(part):
    assert len(code_sentences(part)) > 20
    assert [f for s in code_sentences(part) for f in broken(s[0], s[1], "paragraph_open", s[2])] == []


@pytest.mark.quick
def test_help_states_the_default_that_an_option_has():
    stated = [
        (m[1], str(action.default), f"{module} {action.dest}: {shown}")
        for module, parser in texts.parsers().items()
        for action, shown in texts.help_of_arguments(parser)
        if (m := re.search(r"\(default: ([^);,]+)", shown)) and action.default not in (None, [], ())
    ]
    assert len(stated) > 30
    wrong = [where for said, of, where in stated if of not in (said, f"{said}.0")]
    assert [where for where in wrong if "(default: processors)" not in where] == []


def test_a_page_is_not_two():
    lines = {page: path.read_text("utf-8").count("\n") for page, path in PAGES.items()}
    assert {page: n for page, n in lines.items() if n > LINES} == {}


@pytest.mark.parametrize("page", sorted(PAGES))
def test_a_page_is_in_the_words_of_the_field(page):
    assert faults(page) == []


PRINTED = sorted(
    p.relative_to(ROOT).as_posix()
    for f in ("studies", "benchmarks")
    for p in ROOT.glob(f"docs/{f}/*/*.md")
)
AGREE = 0.96  # share of word pairs; chosen: old pages had less, and names that are filled in make some


def neighbours(text):
    """Pairs of words that follow each other, without names and numbers between them."""
    for piece in re.split(r"\S*[\d_]\S*|[^\w\s'’-]+|\n|\b(?:[A-Z]+|[b-z]|psi)\b|(?<!\w)-", text):
        words = piece.split()
        yield from pairwise(words)


@cache
def printed_pairs():
    """Those of all texts of the code, from which scripts make their pages."""
    return {
        pair
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        for _, text in texts.module_texts(path, fewest=1)
        for pair in neighbours(text.replace("``", " 0 "))
    }


@pytest.mark.parametrize("page", PRINTED)
def test_a_page_of_a_long_run_has_the_words_that_its_script_prints_today(page):
    text = (ROOT / page).read_text("utf-8")
    prose = "\n".join(line for line in text.splitlines() if line[:1] != "|")
    pairs = {*neighbours(re.sub(r"`[^`]*`|\]\([^)]*\)", " 0 ", prose))}  # a sentence may come often
    strange = [" ".join(p) for p in pairs if p not in printed_pairs()]
    assert len(strange) <= (1.0 - AGREE) * len(pairs), strange
    assert [m[0] for m in PHRASES.finditer(text)] == []


def test_a_text_of_the_code_is_seen(tmp_path):
    code = tmp_path / "code.py"
    code.write_text(
        'def f(x):\n    """Not this one here."""\n    raise E(f"{x} is told {g(\'it is no run\')}")\n'
    )
    assert [*texts.module_texts(code)] == [(3, "`` is told ``"), (3, "it is no run")]


def test_exceptions_are_few_needed_and_have_reasons():
    assert len(EXCEPTIONS) <= 30
    of_code = [
        (place, s) for part in CODE if part != "help of commands" for place, _, s in code_sentences(part)
    ]
    of_pages = [(page, s) for page in PAGES for _, _, s in sentences(page)]
    for (place, part), reason in EXCEPTIONS.items():
        assert reason
        assert any(place == p and part in s for p, s in of_code + of_pages), part


@pytest.mark.parametrize(
    ("sentence", "wrong"),
    [
        ("The report tells the reason.", True),
        ("The report states the reason.", False),
        ("A model is held against a run.", True),
        ("The held-out run decides nothing.", False),
        ("An effect is no cause.", True),
        ("There is no other cause, and it is no longer likely.", False),
        ("It takes away 99 % of the error.", True),
    ],
)
def test_a_private_phrase_is_detected_and_its_replacement_is_not(sentence, wrong):
    assert bool(PHRASES.search(sentence)) == wrong


def test_the_glossary_has_each_term_once_with_one_sentence():
    rows = [
        line.strip("|").split("|")
        for line in PAGES["docs/glossary.md"].read_text("utf-8").splitlines()
        if line[:2] == "| "
    ]
    rows = [[cell.strip() for cell in row] for row in rows if row[0].strip() != "term"]
    assert len({row[0] for row in rows}) == len(rows) > 100
    for term, symbol, unit, meaning, literature in rows:
        assert re.fullmatch(r"[A-Z][^.]*(?:\.(?=\d|ssv|json)[^.]*)*\.", meaning), term
        assert all((symbol, unit, literature)), term


def test_spelling():
    """Of all pages, messages, docstrings and names; the words that codespell ignores are in pyproject.toml."""
    packages = (*PACKAGES, "ships", "scenarios", "examples", "docs/studies", "docs/benchmarks")
    done = subprocess.run(
        [sys.executable, "-m", "codespell_lib", *PAGES, "CHANGELOG.md", *packages],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("", "")
