"""The report of a study: Markdown with tables and figures, and all numbers as JSON beside it."""

import json
import math
import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from cosim import InputError, atomic_write, read_log
from cosim.results import draw, read_options
from diagnosis.report import as_json, finite

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT, RESULTS = "report.md", "results.json"
PACKAGES = ("cybership", "numpy", "scipy", "matplotlib")
DPI = 150


def machine() -> str:
    """One line: what the numbers were made with."""
    versions = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    return (
        f"{platform.python_implementation()} {platform.python_version()} on {platform.machine()} "
        f"{platform.system()}, {os.cpu_count()} cores; {', '.join(versions)}"
    )


def seeds_line(seeds: Sequence[int]) -> str:
    """The seeds for people: ``seeds 0-9``."""
    gapless = list(seeds) == list(range(seeds[0], seeds[0] + len(seeds)))
    if gapless and len(seeds) > 1:
        return f"seeds {seeds[0]}-{seeds[-1]}"
    return f"seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))}"


def cell(value: Any) -> str:
    """A table cell: a number to four digits, anything else as it prints."""
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else "–"
    return str(value).replace("|", "\\|")


Answer = bool | None | Mapping[str, bool | None]
WORDS = {True: "holds", False: "does not hold", None: "undecided"}


MANY = 8  # settings, of which more are counted and not named; chosen


def said(answer: Answer) -> str:
    """An answer in words: one word where all settings agree, else each word with its settings."""
    if not isinstance(answer, Mapping):
        return WORDS[answer]
    grouped: dict[str, list[str]] = {}
    for setting, each in sorted(answer.items(), key=lambda pair: [*WORDS].index(pair[1])):
        grouped.setdefault(WORDS[each], []).append(setting.replace(",", ""))
    if len(grouped) == 1:
        return next(iter(grouped))
    if len(answer) > MANY:
        return "; ".join(f"{word} in {len(each)} of {len(answer)}" for word, each in grouped.items())
    return "; ".join(f"{word}: {', '.join(each)}" for word, each in grouped.items())


class Verdict(NamedTuple):
    """A statement of the thesis, whether it holds, and the numbers or the reason.

    Attributes:
        thesis: the statement.
        here: whether it holds for today's algorithms, as one answer or setting by setting; None: the
            runs do not decide.
        numbers: on which it rests, with their limits.
        printed: the same for the algorithms as printed; empty where there is one form alone.
    """

    thesis: str
    here: Answer
    numbers: str
    printed: Answer = MappingProxyType({})

    @property
    def holds(self) -> bool | None:
        """Whether the statement holds in every setting, or in none; None: in part, or undecided."""
        return overall(self.here)

    @property
    def cells(self) -> tuple[str, str, str]:
        """Both answers in words, and the numbers."""
        return said(self.here), said(self.printed) if self.printed != {} else "–", self.numbers


def overall(answer: Answer) -> bool | None:
    """The answer of all settings; None where they differ, or do not decide."""
    each = answer.values() if isinstance(answer, Mapping) else [answer]
    answers = {x if x is None else bool(x) for x in each}
    return answers.pop() if len(answers) == 1 else None


def stored(folder: Path) -> dict[str, Any]:
    """The results of an earlier run of a study.

    Raises:
        InputError: there are none.
    """
    try:
        return json.loads((folder / RESULTS).read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read '{folder / RESULTS}': {error}; run the study first") from None


def records(kind: type[Any], value: Any) -> Any:
    """What ``results.json`` has of nested mappings and lists of a named tuple; null is NaN."""
    if isinstance(value, list):
        return [records(kind, x) for x in value]
    if list(value) != list(kind._fields):
        return {k: records(kind, x) for k, x in value.items()}
    numbers = {k: float("nan") if x is None else x for k, x in value.items()}
    return kind(**{k: tuple(x) if isinstance(x, list) else x for k, x in numbers.items()})


def _listed(statements: Sequence[str]) -> str:
    return f": {'; '.join(statements)}" if statements else ""


def opening(rows: Sequence[Verdict], why: str) -> list[str]:
    """What held, what did not, and why; nothing where no statement was judged."""
    by = {h: [v.thesis for v in rows if v.holds is h] for h in (True, False, None)}
    printed = [overall(v.printed) for v in rows if v.printed != {}]
    forms = f" (as printed {printed.count(True)} of {len(printed)})" if printed else ""
    lines = [
        f"Hold, {len(by[True])} of {len(rows)}{forms}{_listed(by[True])}.",
        f"Do not hold, {len(by[False])}{_listed(by[False])}; in part or undecided, "
        f"{len(by[None])}{_listed(by[None])}.",
        *([f"Reason: {why}"] if why else []),
    ]
    return ["\n".join(f"- {line}" for line in lines)] if rows else []


class Report:
    """Collects pieces and writes them at the end; figures are written as they come.

    Args:
        folder: where the report goes, made when missing.
        title: heading of the report.
        seeds: of the runs, those of the results if there are any; empty where nothing is random.
        again: results of an earlier run, of which only the words are written anew; its pictures stay.
    """

    def __init__(
        self,
        folder: Path,
        title: str,
        seeds: Sequence[int] = (),
        again: Mapping[str, Any] | None = None,
    ) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot write to '{folder}': {error.strerror}") from None
        self.folder, self.draws, made = folder, again is None, machine()
        if again is not None:
            made, seeds = str(again["machine"]), list(again["seeds"])
        self.seeds = seeds
        self._pieces = [f"# {title}"]
        self._tables: list[dict[str, Any]] = []
        self._verdicts: list[Verdict] = []
        self._why = ""
        self._results: dict[str, Any] = {"title": title, "seeds": list(seeds), "machine": made}
        ran = f"{seeds_line(seeds).capitalize()}. " if seeds else ""
        self.text(f"{ran}{made}.")

    def heading(self, text: str) -> None:
        self._pieces.append(f"## {text}")

    def text(self, paragraph: str) -> None:
        self._pieces.append(" ".join(paragraph.split()))

    def items(self, lines: Iterable[str]) -> None:
        """A list with a point before each line."""
        self._pieces.append("\n".join(f"- {' '.join(line.split())}" for line in lines))

    def table(self, header: Sequence[str], rows: Iterable[Sequence[Any]], words: bool = False) -> None:
        """A table, which ``results.json`` has too; columns are aligned right unless they hold words."""
        side, rows = ":--" if words else "--:", [list(row) for row in rows]
        plain = [[x if isinstance(x, (int, float)) else str(x) for x in row] for row in rows]
        self._tables.append({"header": list(header), "rows": plain})
        lines = [header, [":--", *[side] * (len(header) - 1)], *([cell(c) for c in r] for r in rows)]
        self._pieces.append("\n".join(f"| {' | '.join(line)} |" for line in lines))

    def verdicts(self, name: str, rows: Sequence[Verdict], numbers: str = "numbers") -> None:
        """A table of verdicts, which also go to ``results.json``.

        Args:
            name: in ``results.json``.
            rows: the verdicts.
            numbers: heading of the last column.
        """
        header = ["thesis", "today", "as printed", numbers]
        cells = [[row.thesis, *row.cells] for row in rows]
        if all(row.printed == {} for row in rows):
            header, cells = ["thesis", "here", numbers], [[x, here, z] for x, here, _, z in cells]
        self.table(header, cells, words=True)
        self._verdicts += rows
        self.result(name, rows)

    def why(self, reason: str) -> None:
        """The reason for what did not hold, for the head of the report."""
        self._why = reason

    def figure(self, name: str, figure: "Figure | Callable[[], Figure]", caption: str) -> None:
        """Write ``<name>.png`` and embed it; a function draws only where figures are drawn."""
        if self.draws:
            from matplotlib.backends.backend_agg import FigureCanvasAgg

            shown = figure() if callable(figure) else figure
            FigureCanvasAgg(shown)
            with atomic_write(self.folder / f"{name}.png") as scratch:
                shown.savefig(scratch, format="png", dpi=DPI)
        self.picture(f"{name}.png", caption)

    def picture(self, path: str, caption: str) -> None:
        """Embed a picture that lies in the report's folder already."""
        self._pieces.append(f"![{caption}]({path})\n\n*{caption}*")

    def draw(self, name: str, runs: Mapping[str, Path]) -> None:
        """Draw the pictures of ``cosim.results.draw`` of some runs, which :meth:`picture` embeds.

        Args:
            name: folder of the pictures, within the report's.
            runs: label -> folder of the log; read only where figures are drawn.
        """
        if self.draws:
            stated = {label: read_options(log) for label, log in runs.items()}
            draw({k: dict(read_log(log)) for k, log in runs.items()}, self.folder / name, stated)

    def result(self, name: str, value: Any) -> None:
        """Numbers for ``results.json``: nested mappings, sequences, named tuples, arrays."""
        self._results[name] = finite(value)

    def write(self) -> Path:
        """Write ``results.json``, then ``report.md``; returns the latter's path."""
        text = as_json({**self._results, "tables": self._tables})
        title, *rest = self._pieces
        page = "\n\n".join([title, *opening(self._verdicts, self._why), *rest])
        for name, content in ((RESULTS, text), (REPORT, page)):
            with atomic_write(self.folder / name) as scratch:
                scratch.write_text(content + "\n", encoding="utf-8")
        return self.folder / REPORT
