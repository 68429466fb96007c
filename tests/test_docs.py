"""The pages of docs: what they name exists, and their links lead somewhere."""

import ast
import json
import re
import shlex
from functools import cache
from inspect import signature
from pathlib import Path

import pytest
from support.command import command, main_of

import cosim
import diagnosis.predictors
import fmus
from fmus.build.finding import load

ROOT = Path(__file__).parents[1]
SYMBOLS = (ROOT / "docs" / "symbols.md").read_text(encoding="utf-8")
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.md"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")), *NOTEBOOKS]


def rows():
    """Names and files of each row of the tables of symbols."""
    for line in SYMBOLS.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 4 and "/" in cells[3]:
            yield re.findall(r"`([\w.]+)`", cells[2]), re.findall(r"`([\w./]+)`", cells[3])


def defined(path):
    """Names of a module's functions, classes and constants, and of the classes' members."""
    found = set()
    for node in ast.parse((ROOT / path).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.Assign):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        if isinstance(node, ast.ClassDef):
            members = [m.name for m in node.body if isinstance(m, ast.FunctionDef)]
            members += [m.target.id for m in node.body if isinstance(m, ast.AnnAssign)]
            found |= {f"{node.name}.{m}" for m in members}
    return found


def test_there_are_symbols():
    assert len(list(rows())) > 50


@pytest.mark.parametrize(("names", "files"), [*rows()], ids=lambda x: x[0])
def test_symbols_are_where_the_page_says(names, files):
    assert names
    there = set().union(*map(defined, files))
    assert set(names) <= there
    for file in files:
        assert defined(file) & set(names), f"none of them is in {file}"


@pytest.mark.parametrize("page", NOTEBOOKS, ids=lambda p: p.name)
def test_a_notebook_is_in_the_index_and_uses_public_names(page):
    """The site runs them; here is what can be told without."""
    assert f"notebooks/{page.stem}\n" in (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    cells = re.findall(r"```\{code-cell\} ipython3\n(.*?)```\n", page.read_text("utf-8"), re.DOTALL)
    assert cells
    code = ast.parse("\n".join(re.sub(r"^!.*", "", cell, flags=re.MULTILINE) for cell in cells))
    ours = {"cosim": cosim, "diagnosis": diagnosis, "fmus": fmus}
    for node in ast.walk(code):
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id in ours
        ):
            assert node.attr in ours[node.value.id].__all__, ast.unparse(node)


def test_a_controller_that_a_notebook_writes_is_one(tmp_path):
    """The site builds and runs it; here it is declared."""
    page = ROOT / "docs" / "notebooks" / "own_controller.md"
    (code,) = re.findall(r"write_text\('{3}\n(.*?)'{3}\)", page.read_text("utf-8"), re.DOTALL)
    (tmp_path / "pull.py").write_text(code, "utf-8")
    assert load("pull", tmp_path / "pull.py")[1].name == "controller_pull"


def in_pages(pattern):
    """(page, groups) of each match in all pages."""
    for page in PAGES:
        for found in re.findall(pattern, page.read_text(encoding="utf-8")):
            yield page, found


def test_links_lead_to_files():
    links = [(p, link) for p, link in in_pages(r"\]\(([^)#\s]+)[^)]*\)") if "://" not in link]
    assert links
    assert [(p.name, link) for p, link in links if not (p.parent / link).exists()] == []


@cache
def anchors(page):
    """Anchors of a page's headings, as GitHub and the site make them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    titles = [re.sub(r"\]\([^)]*\)", "", t) for t in re.findall(r"^#+ (.+)$", text, re.MULTILINE)]
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def test_links_lead_to_headings():
    wrong = [
        (page.name, f"{file}#{anchor}")
        for page, (file, anchor) in in_pages(r"\]\(([^)#\s:]*)#([^)\s]+)\)")
        if anchor not in anchors(page.parent / file if file else page)
    ]
    assert wrong == []


def test_files_that_a_page_names_exist():
    named = r"`((?:fmus|cosim|diagnosis|tests|studies|thesis|benchmarks)/[\w./]+)`"
    wrong = [(p.name, name) for p, name in in_pages(named) if not (ROOT / name).exists()]
    assert [each for each in wrong if each[1] not in EXAMPLES] == []


def blocks(kind):
    """(page, reason it is not run here, text) of each code block of a kind; CONTRIBUTING's by its tests."""
    for page in PAGES:
        for reason, text in re.findall(
            rf"(?:<!-- ((?:not )?run(?: by|:) [^>]*) -->\n)?```{kind}\n(.*?)```",
            page.read_text("utf-8"),
            re.DOTALL,
        ):
            yield pytest.param(page, reason, text, id=f"{page.name}: {text.splitlines()[0][:40]}")


@pytest.mark.parametrize(("page", "reason", "text"), [*blocks("python")])
def test_python_of_the_pages_is_run_by_the_test_that_a_page_names(page, reason, text):
    compile(text, page.name, "exec")
    if page.name == "CONTRIBUTING.md":
        tests = ["tests/test_fmus.py", "tests/test_faults.py"]
        assert all("CONTRIBUTING.md" in (ROOT / test).read_text("utf-8") for test in tests)
    elif reason:
        (test,) = re.findall(r"tests/[\w/]+\.py", reason)
        assert (ROOT / test).is_file()
        assert page.name in (ROOT / test).read_text("utf-8") or ":" in reason, "what it does instead"
    else:
        assert page.name in RUN_HERE, "give the block a test, or say by which one it is run"


# Pages whose code needs no more than a learned model in the folder.
RUN_HERE = {"stability.md", "getting_started.md"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "reason", "text"), [b for b in blocks("python") if b.values[0].name in RUN_HERE]
)
def test_python_of_the_pages_runs(page, reason, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    diagnosis.predictors.write_model(tmp_path / "model.ssv", diagnosis.Model().plus({"delta_X_u": -2.0}))
    exec(compile(text, page.name, "exec"), {"__name__": "page"})


@cache
def help_of(module):
    """What a command of ours says of its options."""
    main = main_of(module)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", [module, "--help"])
        done = command(main if signature(main).parameters else lambda _: main(), "--help")
    assert done.returncode == 0
    return done.stdout


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_commands_of_the_pages_have_the_options_that_are_shown(page):
    for kind in ("sh", "bash"):
        for text in re.findall(rf"```{kind}\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
            for line in text.replace("\\\n", " ").splitlines():
                for module, rest in re.findall(
                    r"python -m ((?:cosim|fmus|diagnosis|studies|thesis|benchmarks)[\w.]*)([^#&]*)", line
                ):
                    for option in re.findall(r"(?<=\s)--[\w-]+", rest):
                        assert option in help_of(module), f"{module} {option}"
                    for name in re.findall(r"scenarios/[\w./]+", rest):
                        assert (ROOT / name).exists(), name


@pytest.mark.parametrize(("page", "reason", "text"), [*blocks("json")])
def test_json_of_the_pages_can_be_read(page, reason, text):
    text = text.strip().rstrip(",")
    json.loads(text if text[0] in "[{" else f"{{{text}}}")  # a part of a scenario stands without braces


EXAMPLES = {"fmus/controller/pull.py"}  # a newcomer's


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the shipped scenarios, cut short, a learned model, and a run."""
    folder = tmp_path_factory.mktemp("shell")
    (folder / "results" / "diagnosis").mkdir(parents=True)
    model = diagnosis.predictors.Model().plus({"delta_X_u": -2.0})
    diagnosis.predictors.write_model(folder / "results" / "diagnosis" / "model.ssv", model)
    (folder / "scenarios").mkdir()
    for path in (ROOT / "scenarios").glob("*.json"):
        content = json.loads(path.read_text("utf-8"))
        # The pages look at the set-point from 60 s on, and some scenarios do so themselves.
        least = 60.0 if path.stem == "setpoint" else content.get("metrics", {}).get("from", 0.0)
        content["stop"] = min(content["stop"], max(40.0, least + 10.0))
        (folder / "scenarios" / path.name).write_text(json.dumps(content), "utf-8")
    scenario = cosim.load_scenario(folder / "scenarios" / "eight.json")
    cosim.simulate(scenario, folder / "results" / "c")
    return folder


def commands(text):
    """Module and arguments of each line of a shell block."""
    for line in text.replace("\\\n", " ").splitlines():
        python, option, module, *arguments = shlex.split(line, comments=True)
        assert (python, option) == ("python", "-m"), line
        yield module, arguments


@pytest.mark.parametrize(("page", "reason", "text"), [*blocks("sh")])
def test_shell_of_the_pages_is_run_or_says_why_not(page, reason, text):
    tests = re.findall(r"tests/[\w/]+\.py", reason)
    assert all((ROOT / test).is_file() for test in tests)
    assert reason.startswith("not run: ") or tests or [*commands(text)]


@pytest.mark.slow
@pytest.mark.parametrize(("page", "reason", "text"), [b for b in blocks("sh") if not b.values[1]])
def test_shell_of_the_pages_runs(page, reason, text, place):
    for name, arguments in commands(text):
        done = command(main_of(name), *arguments, cwd=place)
        assert done.returncode == 0, done.stderr


def test_the_site_begins_with_picture_line_and_how_to_contribute():
    front = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    before = front.partition("```{toctree}")[0]
    assert before.count("![") == before.count("pip install") == 1
    assert "\ncontributing\n" in front
    assert "../CONTRIBUTING.md" in (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")


FRONTS = [ROOT / "README.md", ROOT / "docs" / "index.md"]


@pytest.mark.parametrize("page", FRONTS, ids=lambda p: p.name)
def test_a_front_page_says_what_for_in_ten_seconds(page):
    """One line, the eight before and after with a caption, three cards, two lines to start, few links."""
    text = page.read_text("utf-8").partition("```{toctree}")[0]
    title, line, picture, caption, *_ = text.split("\n\n")
    assert title.startswith("# ")
    assert line.startswith("**")
    assert "images/eight.png)" in picture
    assert (ROOT / "docs" / "images" / "eight.png").stat().st_size < 200_000
    assert caption.startswith("*")
    assert "`X_u`" in caption, "the cause by name"
    assert all(name in text for name in ("Simulate", "Diagnose", "Export"))
    assert len(re.findall(r"(?<!!)\[[^\]]+\]\([^)]+\)", text)) <= 12
    prose = re.sub(r"```.*?```|<!--.*?-->|^\|.*$|^[%:].*$", "\n\n", text, flags=re.DOTALL | re.MULTILINE)
    for sentence in re.split(r"(?<=[.:!?])[*)]*\s+|\n\n|\n- ", re.sub(r"`[^`]*`", "x", prose)):
        assert len(sentence.split()) <= 25, sentence


def test_the_picture_of_the_front_pages_is_that_of_the_demo():
    from cybership import demo

    assert "eight.png" in Path(demo.__file__).read_text("utf-8")


def test_the_readme_has_the_two_lines_of_the_gate():
    lines = [x for x in FRONTS[0].read_text("utf-8").splitlines() if x.startswith("python -m pip")]
    assert lines == [
        "python -m pip install . && python -m cosim.run scenarios/ellipse.json",
        'python -m pip install -e ".[dev]" && python -m pytest -n auto',
    ]


def test_no_two_pages_of_the_site_have_the_same_title():
    pages = [p for p in (ROOT / "docs").rglob("*.md") if p.name != "contributing.md"]
    titles = [re.search(r"^# (.+)$", p.read_text(encoding="utf-8"), re.MULTILINE)[1] for p in pages]
    assert len(titles) == len(set(titles))
